"""A minute of Newton's cradle: in engines as they are, with the mend, by `swing`, on Hertz springs.

Writes `data/scene_*.csv` in some minutes.  The scenes are those of `examples/`; `data/README.md`
describes them.  Hertz springs are integrated here, independently of the package: the judge.
"""

import importlib
import math
import statistics
import sys
from contextlib import contextmanager
from functools import cache, partial
from itertools import product

import numba
import numpy as np
from measure import BULLET, RAPIER, absent, cpu, in_turn, named_engines, present, quotient, versions
from stored import DATA, make

from cradle import Chain, ImpulseCorrelation, Pendulums, SpringChain, swing, viscosity_from
from cradle.runtime.job import warm_up

sys.path.append(str(DATA.parent / "examples"))

BALLS, RADIUS, LENGTH, GRAVITY = 5, 0.1, 1.0, 9.81
ANGLE = math.radians(30)
RATIO = 0.1325  # three equal balls on Hertz springs (data/implied_ratio.csv)
FRAMES = 60  # samples a second
MINUTE, FILM = 60, 11  # s
WILD = 10.0  # times the energy at the release
GAPS = (0.0, 5e-5, 1e-3, 1e-2)  # of the first strokes, over a diameter
FREQUENCY = math.sqrt(GRAVITY / LENGTH)
#: Contact of two balls at the first stroke, s: steel, if the cradle were ten times smaller.
STEEL = 6.9e-4 / FREQUENCY
SPRINGS = {
    "steel": {},
    "half the step": {"steps_a_contact": 200},
    "ten times softer": {"contact": 10**0.4 * STEEL},
}
MODELS = {"ratio": ImpulseCorrelation(RATIO), "springs": SpringChain(1.0)}
RESTITUTION = 0.97  # of what loses energy; of springs at the striker's first speed
SPEED = 2.0 * math.sqrt(GRAVITY * LENGTH) * math.sin(ANGLE / 2)


def pressed(contact):
    """Depth and stiffness of Hertz springs by which two balls touch so long at the first stroke."""
    depth = contact * SPEED / 2.9432  # of masses 1: a contact takes 2.9432 d/v, k d^(5/2) = 5/8 v^2
    return depth, 0.625 * SPEED**2 / depth**2.5


DEPTH, STIFFNESS = pressed(STEEL)
APART = 3 * DEPTH  # a gap
LOSSY = viscosity_from(RESTITUTION, speed=SPEED, masses=[1] * BALLS)
#: What else a row can solve its impacts by: restitution and model.
LAWS = {name: (1, model) for name, model in MODELS.items()} | {
    "springs, outer apart": (1, SpringChain(STIFFNESS, gaps=(APART, 0, 0, APART))),
    "ratio, losses": (RESTITUTION, MODELS["ratio"]),
    "springs, losses": (1, SpringChain(1.0, viscosity=LOSSY)),
}
AT = (1, 5, 20, 50)  # strokes that are kept of these
ENERGIES = " ball1 ball2 ball3 ball4 ball5"
SETTINGS = "default", "fine", "refined"

FINER = {"step": 1e-4, "mended_step": 1e-3, "contact": 0.002}  # with the mend another step
ENGINES = named_engines(  # program in `examples/`: default, refined
    {
        "pymunk_cradle": ({"step": 1 / 60, "iterations": 10}, {"step": 1e-3, "iterations": 100}),
        "box2d_cradle": (
            {"step": 1 / 60, "iterations": (8, 3)},
            {"step": 1e-3, "iterations": (100, 30)},
        ),
        "bullet_cradle": ({"step": 1 / 240}, BULLET | {"step": 1e-3, "numSolverIterations": 200}),
        "rapier_cradle": (
            {"step": 1 / 60},
            RAPIER | {"step": 1e-3, "num_internal_pgs_iterations": 50},
        ),
        "mujoco_cradle": ({"step": 2e-3, "contact": 0.02}, FINER),
    }
)


@contextmanager
def scene(engine, setting, pulled, *, mend, gap=0.0, law=None):
    """Give a function that makes one step, the bodies, and the step; a law if not one ratio."""
    program = importlib.import_module(engine.scene)
    # "fine" is a step of a millisecond and nothing else: to compare costs.
    fine = engine.default | {"step": 1e-3}
    chosen = fine if setting == "fine" else dict(getattr(engine, setting))
    step = chosen.pop("step")
    mended_step = chosen.pop("mended_step", step)
    bodies = program.hang(pulled, ANGLE, mend=mend, gap=gap, **chosen)
    advance = bodies.advance
    if mend:
        row, step = program.mended(bodies, MODELS["ratio"]), mended_step
        advance = row.step
        if law is not None:
            row.chain, row.model = Chain([1] * BALLS, [0] * BALLS, law[0]), law[1]
    yield advance, bodies, step
    getattr(bodies, "close", lambda: None)()  # gives back what an engine holds


def in_engine(engine, setting, pulled, *, mend, gap=0.0, duration=MINUTE, law=None):
    pivots = 2 * RADIUS * (1 + gap) * np.arange(BALLS)
    frames, taken = [], 0
    with scene(engine, setting, pulled, mend=mend, gap=gap, law=law) as (advance, bodies, step):
        for k in range(int(duration * FRAMES) + 1):
            while taken < round(k / FRAMES / step):
                advance(step)
                taken += 1
            x, v = (np.array(part, float) for part in bodies.motion())
            angle = np.arctan2(x[:, 0] - pivots, -x[:, 1])
            rate = (v[:, 0] * np.cos(angle) + v[:, 1] * np.sin(angle)) / LENGTH
            frames.append((taken * step, angle, rate))
    return tuple(np.array(part) for part in zip(*frames, strict=True))


def by_swing(pulled, duration=MINUTE, model=MODELS["ratio"], restitution=1):
    hanging = Pendulums(length=LENGTH, gravity=GRAVITY, angle="full")
    release = [-ANGLE * LENGTH] * pulled + [0.0] * (BALLS - pulled)
    times = np.arange(int(duration * FRAMES) + 1) / FRAMES
    chain = Chain([1] * BALLS, [0] * BALLS, restitution)
    run = swing(chain, model, release, times, pendulums=hanging)
    return run.times, run.positions / LENGTH, run.velocities / LENGTH


def on_springs(pulled, duration=MINUTE, *, contact=STEEL, steps_a_contact=100, apart=0.0):
    """Run on Hertz springs of that contact at the first stroke; the outer balls hang `apart`."""
    angle = np.repeat([-ANGLE, 0.0], [pulled, BALLS - pulled])
    inner = math.ceil(steps_a_contact / contact / FRAMES)
    gaps = np.array([apart, *[0.0] * (BALLS - 3), apart])
    return _march(angle, int(duration * FRAMES), inner, pressed(contact)[1], gaps)


@numba.njit(cache=True)
def _march(angle, frames, inner, stiffness, gaps):
    """Velocity Verlet for pendulums whose balls repel each other by k d^(3/2), in the plane."""
    n = len(angle)
    step = 1.0 / FRAMES / inner
    rate, pull = np.zeros(n), np.zeros(n)
    sine, cosine = np.sin(angle), np.cos(angle)
    times = np.arange(frames + 1) / FRAMES
    angles, rates = np.zeros((frames + 1, n)), np.zeros((frames + 1, n))
    angles[0] = angle
    for i in range(n):
        pull[i] = -GRAVITY / LENGTH * sine[i]
    for frame in range(1, frames + 1):
        for _ in range(inner):
            for i in range(n):
                rate[i] += 0.5 * step * pull[i]
                angle[i] += step * rate[i]
                sine[i], cosine[i] = math.sin(angle[i]), math.cos(angle[i])
                pull[i] = -GRAVITY / LENGTH * sine[i]
            for c in range(n - 1):
                dx = 2.0 * RADIUS + gaps[c] + LENGTH * (sine[c + 1] - sine[c])
                if dx < 2.0 * RADIUS:
                    dy = LENGTH * (cosine[c] - cosine[c + 1])
                    distance = math.sqrt(dx * dx + dy * dy)
                    depth = 2.0 * RADIUS - distance
                    if depth > 0.0:
                        force = stiffness * depth * math.sqrt(depth) / distance / LENGTH
                        pull[c] -= force * (dx * cosine[c] + dy * sine[c])
                        pull[c + 1] += force * (dx * cosine[c + 1] + dy * sine[c + 1])
            for i in range(n):
                rate[i] += 0.5 * step * pull[i]
        angles[frame], rates[frame] = angle, rate
    return times, angles, rates


def energies(angles, rates):
    """Return each ball's kinetic and potential energy, shape (T, N), as part of all at release."""
    each = 0.5 * (LENGTH * rates) ** 2 + 2.0 * GRAVITY * LENGTH * np.sin(angles / 2) ** 2
    return each / each[0].sum()


def strokes(angles, rates):
    """Return each ball's energy after every stroke, at the turning point of the mean, shape (S, N).

    A stroke is a passage of the mean angle through zero: impacts leave the mean alone.
    """
    mean = angles.mean(axis=1)
    passed = np.flatnonzero(np.diff(mean > 0.0)) + 1
    each = energies(angles, rates)
    ends = np.append(passed[1:], len(mean))
    turning = [a + int(np.argmax(np.abs(mean[a:b]))) for a, b in zip(passed, ends, strict=True)]
    # The last one may lie beyond the end of the run.
    found = each[[t for t in turning if t < len(mean) - 1]]
    # Balls that go over the top have no strokes any more.
    wild = np.flatnonzero(found.sum(axis=1) > WILD)
    return found[: wild[0] + 1] if wild.size else found


def each_run():
    """Yield who moves the balls and how, gap, how many balls were pulled back, and the run."""
    for pulled in (1, 2):
        for setting, given in SPRINGS.items():
            yield "Hertz springs", "alone", setting, 0.0, pulled, on_springs(pulled, **given)
        for setting, model in MODELS.items():
            yield "swing", "alone", setting, 0.0, pulled, by_swing(pulled, model=model)
    ways = ("as it is", 0.0), ("as it is", GAPS[-1]), ("mended", 0.0)
    cases = [(*way, pulled) for pulled in (1, 2) for way in ways]
    cases.append(("no impacts", 0.0, BALLS))
    for engine, setting, case in product(present(ENGINES), ("default", "refined"), cases):
        how, gap, pulled = case
        run = in_engine(engine, setting, pulled, mend=how != "as it is", gap=gap)
        yield engine.name, how, setting, gap, pulled, run


runs = cache(lambda: [*each_run()])


def written(each):
    return [f"{e:.4f}" for e in each]


def some(*about, run):
    """Yield the energies after the strokes of a run that are kept, as far as it went."""
    each = strokes(*run[1:])
    yield from ((*about, k, *written(each[k - 1])) for k in AT if k <= len(each))


def scene_strokes():
    yield "run how setting gap pulled stroke" + ENERGIES
    for name, how, setting, gap, pulled, (_, *run) in runs():
        for k, each in enumerate(strokes(*run), start=1):
            yield name, how, setting, f"{gap:g}", pulled, k, *written(each)


def scene_film():
    """Yield angles in one engine, as it is and by the law of the programs of `examples/`."""
    yield "run how time" + ENERGIES
    for engine, (how, mend) in product(
        present(ENGINES[:1]), (("as it is", False), ("mended", True))
    ):
        law = LAWS["springs, outer apart"]
        run = in_engine(engine, "default", 1, mend=mend, duration=FILM, law=law)
        for t, each in list(zip(run[0], np.degrees(run[1]), strict=True))[::2]:
            yield engine.name, how, f"{t:.4f}", *(f"{a:.1f}" for a in each)


def scene_gaps():
    yield "run setting gap pulled" + ENERGIES
    for case in product(present(ENGINES), ("default", "refined"), GAPS, (1, 2)):
        engine, setting, gap, pulled = case
        _, *run = in_engine(engine, setting, pulled, mend=False, gap=gap, duration=1.3)
        yield engine.name, setting, f"{gap:g}", pulled, *written(strokes(*run)[0])


def scene_gap_minutes():
    yield "run setting pulled stroke" + ENERGIES
    for engine, setting, pulled in product(present(ENGINES), SETTINGS, (1, 2)):
        run = in_engine(engine, setting, pulled, mend=False, gap=GAPS[1])
        yield from some(engine.name, setting, pulled, run=run)


def scene_laws():
    """Yield energies after some strokes of rows by each law, and of what they should do.

    That is `swing` with the same law; Hertz springs where the law has gaps.  Engines as they are
    come last, with a step of a millisecond.
    """
    yield "run law setting pulled stroke" + ENERGIES
    for (name, law), pulled in product(LAWS.items(), (1, 2)):
        if name == "springs, outer apart":
            found = {("Hertz springs", "alone"): on_springs(pulled, apart=APART)}
        else:
            found = {("swing", "alone"): by_swing(pulled, model=law[1], restitution=law[0])}
        for engine, setting in product(present(ENGINES), SETTINGS):
            found[engine.name, setting] = in_engine(engine, setting, pulled, mend=True, law=law)
        for (who, setting), run in found.items():
            yield from some(who, name, setting, pulled, run=run)
    for engine, pulled in product(present(ENGINES), (1, 2)):
        run = in_engine(engine, "fine", pulled, mend=False)
        yield from some(engine.name, "as it is", "fine", pulled, run=run)


def cost(engine, setting, pulled, seconds, mend, law=None):
    """Return the processor time of a simulated second."""
    with scene(engine, setting, pulled, mend=mend, law=law) as (advance, _, step):
        count = round(seconds / step)
        return cpu(lambda: [advance(step) for _ in range(count)]) / (count * step)


def scene_costs(repeats=5, seconds=5.0):
    """Yield what a simulated second costs, beside `swing` and, if mended, the engine as it is."""
    yield "run how setting pulled seconds over_swing over_as_it_is repeats version"
    on_springs(1, 1 / FRAMES)  # compiles
    alone = {"alone": lambda: cpu(lambda: on_springs(1, seconds)) / seconds}
    cases = [("Hertz springs", "steel", 1, "numba", alone)]
    for engine, setting, pulled in product(present(ENGINES), SETTINGS, (0, 1)):
        of = partial(cost, engine, setting, pulled, seconds)
        ways = {"as it is": partial(of, False), "mended": partial(of, True)}
        cases.append((engine.name, setting, pulled, engine.distribution, ways))
    for name, setting, pulled, package, ways in cases:
        clocks = [lambda: cpu(lambda: by_swing(1, seconds)) / seconds, *ways.values()]
        by_swings, *taken = in_turn(clocks, repeats)
        for how, times in zip(ways, taken):
            over = quotient(times, by_swings), quotient(times, taken[0])
            row = name, how, setting, pulled, statistics.median(times), *over, repeats
            yield *row, versions(package)


def scene_law_costs(repeats=5, seconds=5.0):
    """Yield what `swing` and a swinging row cost with another law, as a multiple of one ratio."""
    yield "run law over_one_ratio repeats"

    def swung(law=(1, MODELS["ratio"])):
        return cpu(lambda: by_swing(1, seconds, law[1], law[0]))

    ways = {"swing": swung}
    for engine in present(ENGINES):
        ways[engine.name] = partial(cost, engine, "fine", 1, seconds, True)
    for (who, way), (name, law) in product(ways.items(), LAWS.items()):
        if name != "ratio" and (who, name) != ("swing", "springs, outer apart"):
            yield who, name, quotient(*in_turn([partial(way, law=law), way], repeats)), repeats


if __name__ == "__main__":
    for reason in absent(ENGINES).values():
        print("skipped:", reason)
    warm_up()
    make(__doc__, *(rows for name, rows in vars().copy().items() if name.startswith("scene_")))
