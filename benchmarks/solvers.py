"""Rows of the package's models, and of a scheme that has a step."""

import itertools
import math

import numpy as np
from measure import Row, distance, ours, outcome
from scenes import SCENES, march, random_chains, random_truth

from cradle import (
    Chain,
    EnergyDistribution,
    FusedChain,
    ImpulseCorrelation,
    QuadraticDissipation,
    SequentialCollisions,
    SpringChain,
    collide,
    post_impact_velocities,
    swing,
)
from cradle.closed_form import three_balls
from cradle.runtime import compile as runtime

FIFTY = "same rules, event loop of the tests in fifty digits"
CONVERGED = "same springs, DOP853 with rtol 3e-14"
HERTZ = "Hertz springs, converged"
TABLES = "event solver with Tables 1 and 2"
RATIO = 0.167

PATH = "velocities, impulses, path"
TIMED = "velocities, impulses, path, forces, times"


def model_error(scene, velocities):
    """Return the distance from Hertz where that applies, else from the paper's model."""
    reference, name = (scene.springs(), HERTZ) if scene.elastic else (scene.truth(), TABLES)
    return {"model_error": distance(velocities, reference), "model_reference": name}


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
    kernels = ["plain"] if runtime.compiled() is None else [None, "plain"]
    usual = "plain" if runtime.compiled() is None else "compiled"
    for scene in SCENES.values():
        given = scene.masses, scene.velocities, scene.restitution, scene.forward, scene.backward
        many = [np.tile(part, (2000, 1)) for part in given]

        def path(chain=scene.chain, model=scene.model):
            return collide(chain, model)

        def alone(given=given):
            return post_impact_velocities(*given, excess="saturate")

        def batch(many=many):
            return post_impact_velocities(*many, excess="saturate")

        trace, exact = path(), (scene.truth(), FIFTY)
        common = {"evaluations": len(trace.events), "note": f"ratios: {scene.source}"}
        common |= model_error(scene, trace.velocities) if scene.elastic else {}
        ways = (
            ("one call with its path", path, PATH),
            ("one call, outcome alone", alone, "velocities"),
        )
        for kernel, (words, run, gives) in itertools.product(kernels, ways):
            setting = f"{'plain' if kernel else 'compiled'}, {words}"
            yield row(
                clock, about, scene, setting, run, exact, kernel=kernel, gives=gives, **common
            )
        yield row(
            clock, about, scene, f"{usual}, batch", batch, exact, 2000, gives="velocities", **common
        )

    count = 500 if quick else 2000
    for balls in (3, 6):
        chains = random_chains(balls, count)
        some = 20 if quick else 60
        truth = random_truth(chains, some)

        def batch(chains=chains):
            return post_impact_velocities(*chains)

        def single(chains=chains):
            stored = [part.astype(np.float32).astype(np.float64) for part in chains]
            return post_impact_velocities(*stored, excess="saturate").astype(np.float32)

        for setting, function, note in (
            (f"{usual}, batch", batch, ""),
            (
                f"{usual}, batch, stored in float32",
                single,
                "inputs and outcome rounded to 24 bits; solved in 53",
            ),
        ):
            yield Row(
                **about,
                setting=setting,
                chain=f"{balls} balls, random",
                numerical_error=distance(function()[:some], truth),
                numerical_reference=FIFTY,
                gives="velocities",
                versions=ours(),
                note=note or f"{count} chains, e from .3 to 1; error: worst of {some}",
                **clock(function, count),
            )


def march_rows(clock, quick):
    """Yield the same rules in small fixed steps of impulse."""
    about = {
        "group": "march", "model": "ImpulseCorrelation", "needs": "e, ratios, step",
        "gives": "velocities, impulses",
        "note": "brute force, its steps compiled, no code in common with the event solver",
    }  # fmt: skip
    for scene in (SCENES["three equal"], SCENES["ABCCA"]):
        chain = scene.masses, scene.velocities, scene.restitution, scene.forward, scene.backward
        for steps in (10, 100, 1000) if quick else (10, 30, 100, 300, 1000, 3000, 10_000):

            def run(chain=chain, steps=steps):
                done = march(*chain, steps=steps)
                return done.velocities, done.steps

            setting = f"fixed step, 1/{steps} of the first closing speed"
            yield row(
                clock, about, scene, setting, run, (scene.truth(), FIFTY), parameter=1 / steps
            )


def closed_form_rows(clock, _):
    """Yield Eqs. 22 to 33, for three balls that collide once per contact."""
    about = {
        "group": "closed form", "model": "three_balls", "evaluations": 1, "needs": "e, ratio",
        "gives": "velocities, impulses", "note": "three balls, one collision per contact",
    }  # fmt: skip
    scene = SCENES["three equal"]
    one = scene.masses, scene.velocities, scene.restitution, scene.forward[0]
    many = [np.tile(part, (2000, 1)) for part in one[:3]] + [np.full(2000, RATIO)]
    for setting, given, impacts in (("one call", one, 1), ("2000 chains in one call", many, 2000)):

        def run(given=given):
            return three_balls(*given)

        errors = model_error(scene, np.atleast_2d(run())[0])
        exact = scene.truth(), FIFTY
        yield row(clock, about, scene, setting, run, exact, impacts, **errors)


def spring_rows(clock, quick):
    """Yield springs followed in time to an accuracy."""
    about = {
        "group": "springs", "model": "SpringChain, Hertz", "needs": "stiffness, e = 1",
        "gives": TIMED, "note": "velocity Verlet with two corrections, compiled",
    }  # fmt: skip
    accuracies = (1e-3, 1e-6, 1e-9) if quick else [1e-2, *(10.0**-k for k in range(3, 13))]
    for name, accuracy in itertools.product(
        ("three equal", "five equal", "light middle"), accuracies
    ):
        scene, model = SCENES[name], SpringChain(1.0, accuracy=accuracy)

        def run(scene=scene, model=model):
            return collide(scene.chain, model)

        yield row(
            clock, about, scene, f"accuracy {accuracy:.0e}", run, (scene.springs(), CONVERGED),
            parameter=accuracy, evaluations=run().evaluations,
        )  # fmt: skip
    scene, linear = SCENES["three equal"], SpringChain(1.0, 1, accuracy=1e-9)

    def run():
        return collide(scene.chain, linear)

    yield row(
        clock, about, scene, "accuracy 1e-09", run, (scene.springs(1), CONVERGED),
        parameter=1e-9, model="SpringChain, linear", **model_error(scene, run().velocities),
    )  # fmt: skip


def _penalty(masses, velocities, stiffness, exponent, step, most):
    """March balls on springs with a fixed step until they part; return velocities and steps.

    A drift, then a whole kick: semi-implicit Euler.  Velocity Verlet halves each kick; between
    two drifts the halves join.  Where the forces start and end at zero both give one outcome.
    """
    n = len(masses)
    v = velocities.copy()
    d = np.zeros(n - 1)
    steps = 0
    apart = False
    while steps < most and not apart:
        for c in range(n - 1):
            d[c] += step * (v[c] - v[c + 1])
        for c in range(n - 1):
            if d[c] > 0.0:
                kick = step * stiffness * d[c] ** exponent
                v[c] -= kick / masses[c]
                v[c + 1] += kick / masses[c + 1]
        steps += 1
        apart = True
        for c in range(n - 1):
            apart = apart and d[c] <= 0.0 and v[c] <= v[c + 1]
    return v, steps


def _compiled(function):
    """Return `function` compiled by numba where it is installed."""
    if runtime.compiled() is None:
        return function
    import numba

    return numba.njit(function)


penalty = _compiled(_penalty)


def contact_time(exponent):
    """Return how long two balls of mass one touch, at speed one and stiffness one."""
    chain = Chain([1.0, 1.0], [1.0, 0.0], 1)
    return float(collide(chain, SpringChain(1.0, exponent, accuracy=1e-12)).durations[0])


def penalty_rows(clock, quick):
    """Yield springs with a fixed step, as simulators do it: over the step and the stiffness."""
    scene = SCENES["three equal"]
    masses, velocities = (np.array(x) for x in (scene.masses, scene.velocities))
    about = {
        "needs": "stiffness, step, e = 1", "gives": TIMED,
        "note": "plain Python" if runtime.compiled() is None else "compiled by numba",
    }  # fmt: skip

    def stepped(group, law, setting, parameter, stiffness, exponent, step):
        def run():
            return penalty(masses, velocities, stiffness, exponent, step, 10_000_000)

        exact, model = (scene.springs(exponent), CONVERGED), f"penalty, {law}"
        return row(
            clock, about, scene, setting, run, exact, group=group, model=model, parameter=parameter
        )

    for law, exponent in (("Hertz", 1.5), ("linear", 1.0)):
        lasts = contact_time(exponent)
        for count in (10, 100, 1000) if quick else (5, 10, 30, 100, 300, 1000, 3000, 10_000):
            setting = f"{count} steps a contact"
            yield stepped("penalty", law, setting, 1 / count, 1.0, exponent, lasts / count)
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
        if scene.elastic:
            exact = scene.springs(), "Hertz springs, converged: its limit at e = 1"
        else:
            finest = collide(scene.chain, EnergyDistribution(1.0, rtol=3e-13))
            exact = finest.velocities, "same law, rtol 3e-13"
        for rtol in (1e-6,) if quick else (1e-3, 1e-5, 1e-7, 1e-9, 1e-11):
            model = EnergyDistribution(1.0, rtol=rtol)

            def run(scene=scene, model=model):
                return collide(scene.chain, model)

            trace = run()
            errors = {} if scene.elastic else model_error(scene, trace.velocities)
            yield row(
                clock, about, scene, f"rtol {rtol:.0e}", run, exact,
                parameter=rtol, evaluations=trace.evaluations, **errors,
            )  # fmt: skip


def outcome_rows(clock, _):
    """Yield models that answer at once, against Hertz or against the paper's model."""
    for scene in SCENES.values():
        # e = 1 is a limit of the convex problem.
        convex = QuadraticDissipation(1e9) if scene.elastic else QuadraticDissipation()
        models = [
            (SequentialCollisions(), "e", PATH, ""),
            (FusedChain(), "e", PATH, ""),
            (convex, "e", "velocities, impulses", "coefficients 1e9" if scene.elastic else ""),
        ]
        if not scene.elastic:
            one = ImpulseCorrelation(RATIO, excess="saturate")
            models.append((one, "e, ratio", PATH, "one ratio, .167, everywhere"))
        for model, needs, gives, note in models:
            about = {"group": "outcome", "model": type(model).__name__, "note": note}
            about |= {"needs": needs, "gives": gives}

            def run(chain=scene.chain, model=model):
                return collide(chain, model)

            yield row(clock, about, scene, "one call", run)


def door_rows(clock, _):
    """Yield what surrounds an impact: a chain that is made, a strike of a swing to its end."""
    scene = SCENES["five equal"]
    m, v, e = (list(part) for part in (scene.masses, scene.velocities, scene.restitution))
    still, times = Chain(m, [0.0] * len(m), e), [0.0, 10.0]

    def swings():
        return swing(still, scene.model, [-0.02, *[0.0] * (len(m) - 1)], times)

    strikes = len(swings().impacts)
    for setting, function, count in (
        ("a chain of lists", lambda: Chain(m, v, e), 1),
        ("one strike of a swing", swings, strikes),
    ):
        yield Row(
            group="door",
            model="ImpulseCorrelation",
            setting=setting,
            chain=scene.name,
            needs="e, ratios",
            gives="the chain" if count == 1 else f"{PATH}, flights",
            versions=ours(),
            **clock(function, count),
        )


FAMILIES = (
    event_rows, march_rows, closed_form_rows, spring_rows, penalty_rows, energy_rows, outcome_rows,
    door_rows,
)  # fmt: skip


def rows(clock, quick):
    """Yield the rows of all families."""
    assert math.isclose(RATIO, SCENES["three equal"].forward[0])
    for family in FAMILIES:
        yield from family(clock, quick)
