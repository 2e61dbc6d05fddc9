"""Synthetic experiments with hanging balls, as a phone would film them: files for the examples.

Writes five files of `data/` in seconds.
`row_synthetic.csv`: a row of five equal steel balls with narrow gaps, one to three lifted.
`row_film_synthetic.txt`: a film of this row, one ball lifted.
`swing_synthetic.txt`: six seconds of a swing of five balls with wide gaps.
`video_synthetic.txt` and `shots_synthetic.csv`: balls of three kinds.
The last ones follow the pendulum's own equation of motion, the impact the values of Tables 1 and 2;
velocities are found from the marks, each a random amount off, as a reader would find them.
"""

from functools import partial

import numpy as np
from scipy.special import ellipj, ndtri
from stored import options, write

import cradle
from cradle import (
    Chain,
    Pendulums,
    SequentialCollisions,
    SpringChain,
    collide,
    hertz_stiffness,
    paper_chain,
)
from cradle.fit import velocities_from_tracks
from cradle.fit.tracks import Track

LENGTH, GRAVITY = 0.3, 9.81
FRAMES_PER_SECOND, FRAMES = 240.0, 24  # frames on either side of the impact
WINDOW = 0.05  # used of it, s
SCATTER = 0.0004  # of a mark, m
DIAMETER = 0.035
SPEEDS = (0.6, 1.0, 1.4)
#: Sets of the experiment and how many shots of each there are at every speed.
SETS = {"AB": 4, "AC": 4, "ABA": 4, "BAC": 4, "CAB": 4, "ACA": 4, "ABACA": 2}
# The row, with the law of the book that fits it.
ROW_SPEEDS = (0.35, 0.35, 0.7, 0.7, 1.4, 1.4)
RADIUS, MASS, ERROR = 0.01109, 0.0448, 0.0009  # m, kg, m/s
ROW_GAPS, APART, VISCOSITY = (3e-6, 1.5e-6, 0.5e-6), 600e-6, 2e-7  # m; m, of strikers; s
# The swing.
PERIOD, DAMPING, RESTITUTION, SWING_GAPS = 0.8, 0.02, 0.985, 8e-5  # s, 1/s, -, m
SWING_SCATTER = 0.0003  # of a mark, m
HEADER = "set shot ball type mass before after sigma sigma_before"


def swing(velocity, times):
    """Return positions of a pendulum that passes its lowest point at time 0."""
    rate = np.sqrt(GRAVITY / LENGTH)
    largest = velocity / LENGTH / (2 * rate)  # sine of half the angle: largest * sn, its cosine dn
    sn, _, dn, _ = ellipj(rate * times, largest**2)
    return 2 * LENGTH * largest * sn * dn


def marked(names, before, after, times, off, apart):
    """Return tracks of balls that hang so far apart and meet at time 0, each mark so much off."""
    return {
        name: Track(
            times - times[0],
            k * apart
            + np.where(times < 0, swing(before[k], times), swing(after[k], times))
            + off[k],
        )
        for k, name in enumerate(names)
    }


def film(name, speed, random):
    """Return the tracks of one shot; the impact falls anywhere between two frames."""
    chain, model = paper_chain(name, speed)
    after = collide(chain, model).velocities
    times = (np.arange(2 * FRAMES + 1) - FRAMES + random.random() - 0.5) / FRAMES_PER_SECOND
    labels = [f"{x}{k}" if name.count(x) > 1 else x for k, x in enumerate(name, 1)]
    off = SCATTER * random.standard_normal((len(name), times.size))
    return marked(labels, chain.velocities, after, times, off, DIAMETER), chain.masses


def export(tracks):
    """Return the text that Tracker would export for several tracks."""
    lines = ["#multi:", "\t" + "".join(f"{name}\t\t" for name in tracks)]
    lines.append("t\t" + "x\ty\t" * len(tracks))
    times = next(iter(tracks.values())).times
    for time, *places in zip(times, *(track.positions for track in tracks.values())):
        lines.append(f"{time:.6f}\t" + "".join(f"{x:.5f}\t0.00000\t" for x in places))
    return "\n".join(lines) + "\n"


def experiment():
    """Return the rows of the table, and the text of one film."""
    films = []
    for name, count in SETS.items():
        random = np.random.default_rng([2001, *map(ord, name)])
        shots = [speed for speed in SPEEDS for _ in range(count)]
        for shot, speed in enumerate(shots, 1):
            true_speed = speed * (1 + 0.03 * (random.random() - 0.5))  # a hand lets go
            tracks, masses = film(name, true_speed, random)
            films.append((name, shot, tracks, masses))
    # The marks of all films have one scatter: pooled, it is known well.
    velocities = partial(velocities_from_tracks, length=LENGTH, window=WINDOW)
    scatter = float(np.sqrt(np.mean([velocities(film[2]).scatter ** 2 for film in films])))
    rows = []
    for name, shot, tracks, masses in films:
        found = velocities(tracks, scatter=scatter)
        for k, letter in enumerate(name):
            numbers = (found.before[k], found.after[k], found.sigma[k], found.sigma_before[k])
            rows.append([name, shot, k + 1, letter, f"{masses[k]:.3f}",
                         *(f"{x + 0.0:.4f}" if x else "0" for x in numbers)])  # fmt: skip
    text = next(export(tracks) for name, _, tracks, _ in films if name == "BAC")
    return rows, text


def row_struck(before, lifted):
    """Return what the row does by its law."""
    gaps = np.array([APART, *ROW_GAPS])
    gaps[1 : lifted - 1] = APART
    law = SpringChain(hertz_stiffness([RADIUS] * 5), gaps=gaps, viscosity=VISCOSITY, accuracy=1e-6)
    return collide(Chain([MASS] * 5, before), law).velocities


def film_of_the_row(speed=0.7):
    """Return what Tracker would export of a shot of the row, a quarter of a swing each way."""
    before = speed * np.eye(5)[0]
    count = int(np.pi / 2 * np.sqrt(LENGTH / GRAVITY) * FRAMES_PER_SECOND)
    moments = (np.arange(-count, count + 1) + 0.3) / FRAMES_PER_SECOND
    off = SCATTER * ndtri(np.random.default_rng(7).random((5, moments.size)))
    return export(marked("12345", before, row_struck(before, 1), moments, off, 2 * RADIUS))


def row_of(lifted):
    """Return the rows of the table of one set of the row; how fast the strikers came is exact."""
    before = np.outer(ROW_SPEEDS, np.arange(5) < lifted)
    off = ERROR * ndtri(np.random.default_rng(lifted).random(before.shape))
    after = off + [row_struck(v, lifted) for v in before]
    return [
        [f"{lifted} lifted", shot + 1, k + 1, "A", MASS, f"{before[shot, k]:g}",
         f"{after[shot, k]:.5f}", ERROR, 0]
        for shot, k in np.ndindex(before.shape)
    ]  # fmt: skip


def film_of_a_swing():
    """Return what Tracker would export of a row that is let go, and swings."""
    moments = np.arange(0, 6, 1 / 30)
    strings = GRAVITY * (PERIOD / (2 * np.pi)) ** 2
    run = cradle.swing(
        Chain([1] * 5, [0] * 5, RESTITUTION), SequentialCollisions(), [-0.03, 0, 0, 0, 0], moments,
        pendulums=Pendulums(strings, damping=DAMPING, gaps=SWING_GAPS),
    )  # fmt: skip
    moved = np.random.default_rng(1).normal(0, SWING_SCATTER, run.positions.shape)
    places = run.positions + moved + 2 * RADIUS * np.arange(5)
    return export({name: Track(moments, x) for name, x in zip("ABCDE", places.T)})


if __name__ == "__main__":
    folder = options(__doc__).parse_args().output
    rows, text = experiment()
    (folder / "video_synthetic.txt").write_text(text, encoding="utf-8")
    comment = "# SYNTHETIC: made by benchmarks/fit_example.py, not measured\n"
    write("shots_synthetic.csv", HEADER, rows, folder, comment)
    rows = [row for lifted in (1, 2, 3) for row in row_of(lifted)]
    write("row_synthetic.csv", HEADER, rows, folder, comment)
    (folder / "row_film_synthetic.txt").write_text(film_of_the_row(), encoding="utf-8")
    (folder / "swing_synthetic.txt").write_text(film_of_a_swing(), encoding="utf-8")
