"""Rows of the package's models, and of schemes that have a step."""

from functools import partial
from itertools import product

import numpy as np
from march import march
from measure import Row, distance, ours, outcome
from scenes import LOSSY, SCENES, random_chains
from truth import in_fifty_digits
from verlet import verlet

import cradle
from cradle import Chain, QuadraticDissipation, SpringChain, collide
from cradle.runtime import compile as runtime

FIFTY = "same rules, event loop of the tests in fifty digits"
CONVERGED = "same springs, DOP853 with rtol 3e-14"
PATH = "velocities, impulses, path"
TIMED = "velocities, impulses, path, forces, times"
batch = partial(cradle.post_impact_velocities, excess="saturate")


def model_error(scene, velocities):
    """Return the distance from Hertz where that applies, else from the paper's model."""
    reference, name = scene.truth, "event solver with Tables 1 and 2"
    if scene.elastic:
        reference, name = scene.springs, "Hertz springs, converged"
    return {"model_error": distance(velocities, reference()), "model_reference": name}


def row(clock, about, scene, setting, run, exact=None, impacts=1, kernel=None, **more):
    """Return a row: what `run` gives, how far that is from `exact` (velocities, which), how long.

    `about` is what all rows of a family share.  `run` gives velocities, or a trace, or velocities
    and how many steps they took.
    """
    given = run()
    after, steps = given if isinstance(given, tuple) else (getattr(given, "velocities", given), "")
    after = np.atleast_2d(after)[0]
    fields = {"versions": ours(), "evaluations": steps} | about
    fields |= outcome(scene.masses, scene.velocities, after)
    if exact is None:
        fields |= model_error(scene, after)
    else:
        fields |= {"numerical_error": distance(after, exact[0]), "numerical_reference": exact[1]}
    time = clock(run, impacts, kernel=kernel)
    return Row(setting=setting, chain=scene.name, **(fields | more), **time)


def event_rows(clock, quick):
    """Yield the paper's model: compiled or as it stands, one call or a batch, single precision."""
    about = {"group": "event", "model": "ImpulseCorrelation", "needs": "e, ratios"}
    kernels = ({"compiled": None} if runtime.compiled() else {}) | {"plain": "plain"}
    usual = f"{next(iter(kernels))}, batch"
    for scene in SCENES.values():
        exact = scene.truth(), FIFTY
        ways = {
            "one call with its path": (partial(collide, scene.chain, scene.model), PATH),
            "one call, outcome alone": (partial(batch, *scene.given), "velocities"),
        }
        trace = collide(scene.chain, scene.model)
        shared = about | {"evaluations": len(trace.events), "note": f"ratios: {scene.source}"}
        if scene.elastic:
            shared |= model_error(scene, trace.velocities)
        for (name, kernel), (words, (run, gives)) in product(kernels.items(), ways.items()):
            setting = f"{name}, {words}"
            yield row(clock, shared, scene, setting, run, exact, kernel=kernel, gives=gives)
        many = partial(batch, *(np.tile(part, (2000, 1)) for part in scene.given))
        yield row(clock, shared, scene, usual, many, exact, 2000, gives="velocities")
    yield from (row for balls in (3, 6) for row in random_rows(clock, quick, about, usual, balls))


def random_rows(clock, quick, about, usual, balls):
    """Yield random chains in a batch, in full and stored in single precision."""
    count, some = (500, 20) if quick else (2000, 60)
    chains = random_chains(balls, count)
    few = zip(*(part[:some].tolist() for part in chains), strict=True)
    truth = np.array([in_fifty_digits(*chain) for chain in few])

    def single():
        return batch(*(np.float64(np.float32(part)) for part in chains)).astype(np.float32)

    shared = about | {
        "chain": f"{balls} balls, random", "numerical_reference": FIFTY, "gives": "velocities",
        "versions": ours(),
    }  # fmt: skip
    note = f"{count} chains, e from .3 to 1; error: worst of {some}"
    in_24_bits = "inputs and outcome rounded to 24 bits; solved in 53"
    full = partial(cradle.post_impact_velocities, *chains)
    single_setting = f"{usual}, stored in float32"
    for setting, run, words in (usual, full, note), (single_setting, single, in_24_bits):
        error, time = distance(run()[:some], truth), clock(run, count)
        yield Row(**shared, setting=setting, numerical_error=error, note=words, **time)


def march_rows(clock, quick):
    """Yield the same rules in small fixed steps of impulse."""
    about = {
        "group": "march", "model": "ImpulseCorrelation", "needs": "e, ratios, step",
        "gives": "velocities, impulses",
        "note": "brute force, its steps compiled, no code in common with the event solver",
    }  # fmt: skip
    counts = (10, 100, 1000) if quick else (10, 30, 100, 300, 1000, 3000, 10_000)
    for name, steps in product(("three equal", "ABCCA"), counts):
        scene = SCENES[name]

        def run(given=scene.given, steps=steps):
            done = march(*given, steps=steps)
            return done.velocities, done.steps

        setting = f"fixed step, 1/{steps} of the first closing speed"
        yield row(clock, about, scene, setting, run, (scene.truth(), FIFTY), parameter=1 / steps)


def spring_rows(clock, quick):
    """Yield springs followed in time to an accuracy, elastic and lossy; one call and a batch."""
    about = {
        "group": "springs", "model": "SpringChain, Hertz", "gives": TIMED,
        "note": "velocity Verlet with two corrections, compiled",
    }  # fmt: skip
    many = {"group": "many springs", "model": "spring_velocities, Hertz", "gives": "velocities"}
    accuracies = (1e-3, 1e-6, 1e-9) if quick else [1e-2, *(10.0**-k for k in range(3, 13))]
    names = "three equal", "five equal", "light middle", *LOSSY
    for scene, accuracy in product(((SCENES | LOSSY)[name] for name in names), accuracies):
        how = CONVERGED if scene.elastic else "same springs, DOP853 with rtol 1e-12"
        lost, exact = scene.viscosity(), (scene.springs(), how)
        needs = "stiffness, e = 1" if scene.elastic else "stiffness, viscosity"
        common = {"parameter": accuracy, "needs": needs}
        elastic = Chain(scene.masses, scene.velocities)
        run = partial(collide, elastic, SpringChain(1.0, viscosity=lost, accuracy=accuracy))
        setting = f"accuracy {accuracy:.0e}"
        yield row(clock, about, scene, setting, run, exact, evaluations=run().evaluations, **common)
        copies = [np.tile(part, (2000, 1)) for part in (scene.masses, scene.velocities)]
        run = partial(cradle.spring_velocities, *copies, viscosity=lost, accuracy=accuracy)
        if accuracy > 1e-9:
            yield row(clock, about | many, scene, f"batch, {setting}", run, exact, 2000, **common)


def penalty_rows(clock, quick):
    """Yield springs with a fixed step, as simulators do it: over the step and the stiffness."""
    scene = SCENES["three equal"]
    about = {
        "needs": "stiffness, step, e = 1", "gives": TIMED,
        "note": "compiled by numba" if hasattr(verlet, "py_func") else "plain Python",
    }  # fmt: skip

    def stepped(group, law, setting, parameter, stiffness, exponent, step):
        balls = np.array([scene.masses]), np.array([scene.velocities])
        run = partial(verlet, *balls, stiffness, exponent, 0.0, step, 0.0)
        given = about | {"group": group, "model": f"penalty, {law}", "parameter": parameter}
        return row(clock, given, scene, setting, run, (scene.springs(exponent), CONVERGED))

    counts = (10, 100, 1000) if quick else (5, 10, 30, 100, 300, 1000, 3000, 10_000)
    for law, exponent in (("Hertz", 1.5), ("linear", 1.0)):
        # How long two balls of mass one touch, at speed one and stiffness one.
        two = collide(Chain([1, 1], [1, 0], 1), SpringChain(1.0, exponent, accuracy=1e-12))
        for count in counts:
            setting, step = f"{count} steps a contact", two.durations[0] / count
            yield stepped("penalty", law, setting, 1 / count, 1.0, exponent, step)
    # One step for all, as a simulator has it: what the stiffness makes of it. mu = 1/2.
    step = 1e-3
    for phase in (0.01, 0.1, 1.0) if quick else (0.003, 0.01, 0.03, 0.1, 0.3, 0.6, 1.0, 1.5):
        stiffness = 0.5 * (phase / step) ** 2
        setting = f"step 1 ms, stiffness {stiffness:.3g} N/m"
        yield stepped("stiffness", "linear", setting, phase, stiffness, 1.0, step)


def energy_rows(clock, quick):
    """Yield the law of Liu, Zhao and Brogliato, over its tolerance."""
    about = {
        "group": "energy", "model": "EnergyDistribution, Hertz", "note": "plain Python",
        "needs": "e, stiffness ratios, exponent", "gives": f"{PATH}, stored energies",
        "versions": ours("scipy"),
    }  # fmt: skip
    for name in ("three equal",) if quick else ("three equal", "ABCCA"):
        scene = SCENES[name]
        law = partial(cradle.EnergyDistribution, 1.0)
        finest = collide(scene.chain, law(rtol=3e-13)).velocities
        exact = finest, "same law, rtol 3e-13"
        if scene.elastic:
            exact = scene.springs(), "Hertz springs, converged: its limit at e = 1"
        for rtol in (1e-6,) if quick else (1e-3, 1e-5, 1e-7, 1e-9, 1e-11):
            run = partial(collide, scene.chain, law(rtol=rtol))
            trace = run()
            more = {} if scene.elastic else model_error(scene, trace.velocities)
            more |= {"parameter": rtol, "evaluations": trace.evaluations}
            yield row(clock, about, scene, f"rtol {rtol:.0e}", run, exact, **more)


def outcome_rows(clock, _):
    """Yield models that answer at once, against Hertz or against the paper's model."""
    for scene in SCENES.values():
        models = [
            (cradle.SequentialCollisions(), "e", PATH, ""),
            (cradle.FusedChain(), "e", PATH, ""),
        ]
        if scene.elastic:  # a limit of the convex problem
            limit = QuadraticDissipation(1e9)
            models.append((limit, "e", "velocities, impulses", "coefficients 1e9"))
        else:
            one = cradle.ImpulseCorrelation(0.167, excess="saturate")
            models.append((QuadraticDissipation(), "e", "velocities, impulses", ""))
            models.append((one, "e, ratio", PATH, "one ratio, .167, everywhere"))
        for model, needs, gives, note in models:
            about = {"group": "outcome", "model": type(model).__name__, "note": note}
            run = partial(collide, scene.chain, model)
            yield row(clock, about, scene, "one call", run, needs=needs, gives=gives)


def rows(clock, quick):
    families = event_rows, march_rows, spring_rows, penalty_rows, energy_rows, outcome_rows
    yield from (row for family in families for row in family(clock, quick))
