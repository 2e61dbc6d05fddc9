"""Two real cradles against the models: first strikes of a film, half a minute of swinging, gaps.

Usage::

    python benchmarks/real_cradles.py            # prints tables, some minutes
    python benchmarks/real_cradles.py strikes    # or half_minute, or gaps

Strikes: velocities relative to the row, over the striker's, the striking side first.  Lengths in
Hertz units of the first release, (m v^2 / k)^(2/5); v its striker's speed.  The striker's speed was
read in part from the sum of momentum: of the five numbers of a release one may not be free, so the
degrees of freedom are too many by up to one a release.  `strikes` writes data/film_fits.csv.
"""

import csv
import itertools
import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, least_squares, minimize_scalar

from cradle import (
    Chain,
    EnergyDistribution,
    ImpulseCorrelation,
    SequentialCollisions,
    collide,
    ratio_table,
)

DATA = Path(__file__).parents[1] / "data"
READINGS = (1, 2, 3, 4)
EQUAL = (1, 1, 1, 1, 1)
SLOWER = 0.766  # strikers of the second release over the one of the first, relative to the row


def table(name):
    """Return the columns of a file as arrays, empty fields as nan."""
    with (DATA / name).open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {
        key: np.array([float(r[key] or "nan") if key != "kind" else r[key] for r in rows])
        for key in rows[0]
    }


def first_strikes(reading):
    """Return {release: (velocities, errors)} relative to the row, over the striker's speed."""
    t, found = table("film_strikes.csv"), {}
    for release in (1, 2):
        use = (t["reading"] == reading) & (t["release"] == release) & (t["strike"] == 1)
        v, sigma, before = (t[key][use][::-1] for key in ("after", "sigma_after", "before"))
        if reading > 2:  # in the room: the row drifts
            row = before[release:].mean()
            v, sigma = (v - row) / (1 - row), np.maximum(np.hypot(sigma, 0.002), 0.002)
        found[release] = v, sigma
    return found


def spheres(speeds, gaps, loss, limit=400.0):
    """Return velocities of equal spheres after F = k (d^1.5 + A d(d^1.5)/dt), never pulling.

    The balls rest at `gaps` in front of one another; mass and k are 1.
    """
    n, room = len(speeds), np.asarray(gaps, float)

    def rate(_, state):
        x, v = state[:n], state[n:]
        deep = np.maximum(x[:-1] - x[1:] - room, 0.0)
        push = deep**1.5 + loss * 1.5 * np.sqrt(deep) * (v[:-1] - v[1:])
        push = np.maximum(push, 0.0)
        return np.concatenate([v, np.append(0, push) - np.append(push, 0)])

    state, time = np.concatenate([np.zeros(n), speeds]), 0.0
    while time < limit:
        closing = state[n:-1] - state[n + 1 :]
        apart = room - (state[: n - 1] - state[1:n])
        if time and (closing < 1e-6).all() and (apart > 0).all():
            break
        if (apart > 0).all():  # nothing touches: fly to the next contact
            wait = np.min(np.where(closing > 1e-9, apart / np.maximum(closing, 1e-9), np.inf))
            state[:n] += wait * state[n:]
            time += wait
        run = solve_ivp(rate, (0, 4), state, method="DOP853", rtol=1e-8, atol=1e-10, max_step=0.3)
        state, time = run.y[:, -1], time + 4.0
    return state[n:]


def by_law(model, restitution, release, apart, masses=EQUAL):
    """Return velocities of five balls; `model(k)` is the law of the balls from k on.

    Strikers that are apart come one after another: all meet in pairs after the first one.
    """
    late = release - 1 if apart else 0
    speeds = [1.0] * (release - late) + [0.0] * (5 - release)
    e = np.broadcast_to(restitution, 4)
    v = collide(Chain(masses[late:], speeds, e[late:]), model(late)).velocities
    for k in range(late, 0, -1):
        chain = Chain(masses[k - 1 :], [1.0, *v], e[k - 1 :])
        v = collide(chain, SequentialCollisions()).velocities
    return v


def ratios(p, e, release, apart, backward=None, masses=EQUAL):
    """Return velocities by the ratios p of balls 2, 3, 4."""

    def model(k):
        back = None if backward is None else backward[k:]
        return ImpulseCorrelation(p[k:], back, excess="saturate")

    return by_law(model, e, release, apart, masses)


def by_spheres(p, release, apart=False):
    """Return velocities: p = gaps of contacts 2, 3, 4, A, and the gap of the strikers."""
    unit = 1.0 if release == 1 else SLOWER
    between = APART if apart else p[4]
    gaps = [between] * (release - 1) + [0.0] + list(p[release - 1 : 3])
    return spheres([unit] * release + [0.0] * (5 - release), np.abs(gaps), abs(p[3])) / unit


# Name: velocities from parameters, release and whether strikers are apart; starts; bounds; for
# `OWN`, which number only the first release depends on if the strikers are apart.
APART = 30.0  # Hertz units: far enough
E, LOSS, THREE = (0.5, 1.0), (0.0, 0.1), list(itertools.product((0.04, 0.12), repeat=3))
LAWS = {
    "pairs, e": (
        lambda p, r, a: by_law(lambda _: SequentialCollisions(), p[0], r, a),
        [[0.98]],
        [E],
    ),
    "energy law (Hertz), e": (
        lambda p, r, a: by_law(lambda _: EnergyDistribution(1.0, 1.5), p[0], r, a),
        [[0.98]],
        [E],
    ),
    "one ratio, e": (
        lambda p, r, a: ratios([p[0]] * 3, p[1], r, a),
        [[0.05, 0.99], [0.12, 0.99], [0.3, 0.98]],
        [(0, 0.5), E],
    ),
    "one ratio, e, four masses": (
        lambda p, r, a: ratios([p[0]] * 3, p[1], r, a, masses=[1, *p[2:]]),
        [[s, 0.985, 1, 1, 1, 1] for s in (0.05, 0.1, 0.13)],
        [(0, 0.45), E] + [(0.95, 1.05)] * 4,
    ),
    "three ratios, e": (
        lambda p, r, a: ratios(p[:3], p[3], r, a),
        [[*s, 0.985] for s in THREE],
        [(0, 0.5)] * 3 + [E],
    ),
    "three ratios, four e": (
        lambda p, r, a: ratios(p[:3], p[3:], r, a),
        [[*s, *[0.985] * 4] for s in THREE],
        [(0, 0.5)] * 3 + [E] * 4,
    ),
    "three ratios each way, e": (
        lambda p, r, a: ratios(p[:3], p[6], r, a, p[3:6]),
        [[*s, *t, 0.985] for s in THREE for t in ([0.1] * 3, [0.04, 0.12, 0.12])],
        [(0, 0.5)] * 6 + [E],
    ),
    "touching spheres, A": (
        lambda p, r, a: by_spheres([0, 0, 0, p[0], 0], r, a),
        [[0.003], [0.02]],
        [LOSS],
    ),
    "spheres, one gap, A": (
        lambda p, r, a: by_spheres([*p[:1]] * 3 + [p[1], p[0]], r, a),
        [[0.05, 0.005], [0.15, 0.005], [0.4, 0.005]],
        [(0, 6), LOSS],
    ),
    "spheres, three gaps, A": (
        by_spheres,
        [[0.17, 0.03, 0.05, 0.007], [0.1, 0.05, 0.05, 0.007]],
        [(0, 6)] * 3 + [LOSS],
    ),
    "spheres, four gaps, A": (  # the strikers' own
        lambda p, r, _: by_spheres(p, r),
        [[a, b, c, 0.007, g] for a, b, c in [(0.17, 0.03, 0.05), (0.1, 0.05, 0.05), (0.3,) * 3]
         for g in (1.0, 3.0)],
        [(0, 6)] * 3 + [LOSS, (0, 6)],
    ),
}  # fmt: skip
TOGETHER = [name for name in LAWS if name != "spheres, three gaps, A"]
ONE_BY_ONE = [n for n in LAWS if n not in ("three ratios, four e", "three ratios each way, e",
                                           "spheres, four gaps, A")]  # fmt: skip
# The number that one release alone depends on: it is fitted to that release even where the others
# were fitted to the other one.
OWN = {
    ("three ratios, e", True): {1: 0},
    ("spheres, three gaps, A", True): {1: 0},
    ("spheres, four gaps, A", False): {1: 0, 2: 4},
}
COLUMNS = ["reading", "law", "strikers", "fitted", "freedom", "chi_one", "chi_two", "parameters"]


def misfits(velocities, data, releases):
    """Return residuals of {release: velocities}; the scale of each is free within 1 %."""
    out = []
    for release in releases:
        (v, sigma), w = data[release], velocities(release)
        scale = (1e4 + (v * w / sigma**2).sum()) / (1e4 + (w * w / sigma**2).sum())
        out += [*((v - scale * w) / sigma), (scale - 1) / 0.01]
    return np.array(out)


def chi_square(law, p, apart, data, releases):
    """Return the sum of squared residuals of a law at parameters p."""
    return float((misfits(lambda r: LAWS[law][0](p, r, apart), data, releases) ** 2).sum())


def fitted(law, apart, data, releases):
    """Return the parameters of the best of several fits."""
    solve, starts, bounds = LAWS[law]
    fits = [
        least_squares(
            lambda p: misfits(lambda r: solve(p, r, apart), data, releases),
            start,
            bounds=np.transpose(bounds),
            diff_step=3e-3,  # well above the noise of the integration
            x_scale=np.maximum(np.abs(start), 0.01),
            max_nfev=25,
        )
        for start in starts
    ]
    return min(fits, key=lambda fit: fit.cost).x


def tuned(law, apart, p, index, data, release):
    """Return p with one number fitted to one release."""

    def with_number(x):
        q = np.array(p)
        q[index] = x
        return q

    def misfit(x):
        return chi_square(law, with_number(x), apart, data, (release,))

    low, high = LAWS[law][2][index]
    grid = low + (high - low) * np.linspace(0, 1, 61) ** 2
    best = min(range(61), key=lambda i: misfit(grid[i]))
    around = grid[max(best - 1, 0)], grid[min(best + 1, 60)]
    return with_number(minimize_scalar(misfit, bounds=around, method="bounded").x)


def fits_of(reading, law, apart):
    """Return rows of a law fitted to both releases, and to one that predicts the other."""
    data, rows = first_strikes(reading), []
    count, own = len(LAWS[law][2]), OWN.get((law, apart), {})
    how = "own gap" if "four gaps" in law else "apart" if apart else "together"
    for fit, releases in (("both", (1, 2)), ("one", (1,)), ("two", (2,))):
        p, other = fitted(law, apart, data, releases), 3 - releases[0]
        free = 10 - count if fit == "both" else 5 - (other in own)
        if fit != "both" and other in own:
            p = tuned(law, apart, p, own[other], data, other)
        p = [float(f"{x:.5g}") for x in p]  # as stored
        chi = [f"{chi_square(law, p, apart, data, (r,)):.4g}" for r in (1, 2)]
        rows.append([reading, law, how, fit, free, *chi, " ".join(f"{x:.5g}" for x in p)])
        print(*rows[-1], sep=", ", flush=True)
    return rows


def strikes():
    """Fit every law to readings 4 and 2; write film_fits.csv."""
    rows = [
        row
        for reading in (4, 2)
        for apart, laws in ((False, TOGETHER), (True, ONE_BY_ONE))
        for law in laws
        for row in fits_of(reading, law, apart)
    ]
    with (DATA / "film_fits.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows])


def half_minute():
    """Print what the swing of five balls says: the mean, the end, the outer amplitudes."""
    t = table("cradle_trace.csv")
    time, x = t["t_s"], np.stack([t[f"x{k}_m"] for k in range(1, 6)])
    use = np.isfinite(x).all(0) & (time > 0.8)
    time, mean = time[use], x[:, use].mean(0)

    def swing(p):
        return p[4] + p[0] * np.exp(-p[1] * time) * np.cos(p[2] * time + p[3])

    fits = [
        least_squares(lambda p: (swing(p) - mean) / 1e-4, [0.006, 0.03, 8.585, phase, 0.0],
                      x_scale=[1e-3, 0.01, 0.01, 1, 1e-4])
        for phase in np.arange(0, 6.3, 0.8)
    ]  # fmt: skip
    p = min(fits, key=lambda fit: fit.cost).x
    print(f"\nMean of five: {abs(p[0]) * 1e3:.3f} mm exp(-{p[1]:.4f} t) cos, period", end=" ")
    print(f"{2 * np.pi / p[2]:.4f} s; residual rms {np.std(swing(p) - mean) * 1e6:.0f} um")
    peaks, common = table("cradle_peaks.csv"), table("cradle_common.csv")
    flights = peaks["kind"] == "flight"
    first = np.abs(peaks["x_m"][flights & (peaks["t_s"] < 2)])
    print(f"A fifth of the first flights ({1e3 * first.mean():.2f} mm), decayed, against seen:")
    for at in (15.0, 20.0, 25.0, 28.0):
        near = np.abs(common["t_mid_s"] - at) < 1.5
        outer = np.abs(peaks["x_m"][np.abs(peaks["t_s"] - at) < 1.5])
        predicted = first.mean() / 5 * np.exp(-p[1] * (at - 1.3))
        print(f"  {at:4.0f} s: predicted {1e3 * predicted:.2f} mm, mean of five", end=" ")
        print(f"{1e3 * abs(p[0]) * np.exp(-p[1] * at):.2f}; inner", end=" ")
        print(
            f"{1e3 * np.nanmean(common['amplitude_m'][near]):.2f}, outer {1e3 * outer.mean():.2f}"
        )
    for ball in (1, 5):
        use = (peaks["ball"] == ball) & flights & (peaks["t_s"] < 20)
        at, size = peaks["t_s"][use], np.abs(peaks["x_m"][use])
        error = peaks["u_x"][use]
        for name, shape in (("line", lambda z: 1 - z), ("exponential", lambda z: np.exp(-z))):

            def curve(q, shape=shape, data=(at, size, error)):
                return (q[0] * shape(q[1] * data[0]) - data[1]) / data[2]

            fit = least_squares(curve, [0.028, 0.03])
            print(f"Ball {ball}, {name}: {1e3 * fit.x[0]:.2f} mm, {fit.x[1]:.4f} per s;", end=" ")
            print(f"chi-square {2 * fit.cost:.1f} / {len(at) - 2}")


def gaps():
    """Print the ratio that a gap behind the struck ball implies: three equal elastic spheres."""
    listed = ratio_table()
    print("\nTable 2, ratios:", np.round(np.percentile(listed["ratio"], (0, 25, 50, 75, 100)), 3))
    for ball in "ABCD":
        print(ball * 3, float(listed.set_index("triplet")["ratio"][ball * 3]), end="  ")
    bulk = 2.1e11 / (2 * (1 - 0.3**2))  # 1 / ((1 - nu^2) / E + ...), steel on steel
    radius, mass = 0.01109, 0.0448
    stiff = 4 / 3 * bulk * np.sqrt(radius / 2)

    def implied(units):
        v = spheres([1.0, 0.0, 0.0], [0.0, units], 0.0)
        chain = Chain([1, 1, 1], [1, 0, 0], 1.0)

        def misfit(ratio):
            return collide(chain, ImpulseCorrelation(ratio)).velocities[1] - v[1]

        return v, brentq(misfit, 0, 0.35) if misfit(0) < 0 else 0.0

    for units in (0, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2):
        v, ratio = implied(units)
        print(
            f"\ngap {units:5.2f} Hertz units: velocities {np.round(v, 4)}, ratio {ratio:.4f}",
            end="",
        )
    print()
    for speed in (0.36, 0.5, 1.0, 2.0):
        unit = (mass * speed**2 / stiff) ** 0.4
        row = [implied(gap * 1e-6 / unit)[1] for gap in (0, 0.1, 0.3, 1, 2, 5)]
        print(f"{speed} m/s, unit {unit * 1e6:.1f} um; gaps 0 .1 .3 1 2 5 um:", np.round(row, 3))


if __name__ == "__main__":
    for name in sys.argv[1:] or ("gaps", "half_minute", "strikes"):
        {"gaps": gaps, "half_minute": half_minute, "strikes": strikes}[name]()
