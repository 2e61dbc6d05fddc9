"""Rows of the package's models, and of two schemes that have a step."""

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


def event_rows(clock, quick):
    """Yield the paper's model: compiled or as it stands, one call or a batch, single precision."""
    about = {"group": "event", "model": "ImpulseCorrelation", "needs": "e, ratios"}
    kernels = ["plain"] if runtime.compiled() is None else [None, "plain"]
    usual = "plain" if runtime.compiled() is None else "compiled"
    for scene in SCENES.values():
        m, v, e = scene.masses, scene.velocities, scene.restitution
        ratios = scene.forward, scene.backward

        def one(chain=scene.chain, model=scene.model):
            return collide(chain, model)

        def alone(m=m, v=v, e=e, ratios=ratios):
            return post_impact_velocities(m, v, e, *ratios, excess="saturate")

        trace = one()
        common = about | outcome(m, v, trace.velocities)
        common |= model_error(scene, trace.velocities) if scene.elastic else {}
        common |= {
            "chain": scene.name,
            "numerical_error": distance(trace.velocities, scene.truth()),
            "numerical_reference": FIFTY,
            "evaluations": len(trace.events),
            "versions": ours(),
            "note": f"ratios: {scene.source}",
        }
        for kernel in kernels:
            how = "plain" if kernel else "compiled"
            for setting, function, gives in (
                ("one call with its path", one, PATH),
                ("one call, outcome alone", alone, "velocities"),
            ):
                time = clock(function, kernel=kernel)
                yield Row(setting=f"{how}, {setting}", gives=gives, **common, **time)

        many = [np.tile(part, (2000, 1)) for part in (m, v, e, *ratios)]

        def batch(many=many):
            return post_impact_velocities(*many, excess="saturate")

        time = clock(batch, 2000)
        yield Row(setting=f"{usual}, batch", gives="velocities", **common, **time)

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
    for name in ("three equal", "ABCCA"):
        scene = SCENES[name]
        arguments = (
            scene.masses, scene.velocities, scene.restitution, scene.forward, scene.backward
        )  # fmt: skip
        for steps in (10, 100, 1000) if quick else (10, 30, 100, 300, 1000, 3000, 10_000):

            def run(arguments=arguments, steps=steps):
                return march(*arguments, steps=steps)

            result = run()
            yield Row(
                "march",
                "ImpulseCorrelation",
                f"fixed step, 1/{steps} of the first closing speed",
                name,
                parameter=1 / steps,
                **outcome(scene.masses, scene.velocities, result.velocities),
                numerical_error=distance(result.velocities, scene.truth()),
                numerical_reference=FIFTY,
                evaluations=result.steps,
                needs="e, ratios, step",
                gives="velocities, impulses",
                versions=ours(),
                note="brute force, its steps compiled, no code in common with the event solver",
                **clock(run),
            )


def closed_form_rows(clock, _):
    """Yield Eqs. 22 to 33, for three balls that collide once per contact."""
    scene = SCENES["three equal"]
    arguments = scene.masses, scene.velocities, scene.restitution, scene.forward[0]
    many = [np.tile(part, (2000, 1)) for part in arguments[:3]] + [np.full(2000, RATIO)]
    for setting, given, impacts in (
        ("one call", arguments, 1),
        ("2000 chains in one call", many, 2000),
    ):

        def run(given=given):
            return three_balls(*given)

        after = np.atleast_2d(run())[0]
        yield Row(
            "closed form",
            "three_balls",
            setting,
            scene.name,
            **outcome(scene.masses, scene.velocities, after),
            numerical_error=distance(after, scene.truth()),
            numerical_reference=FIFTY,
            **model_error(scene, after),
            evaluations=1,
            needs="e, ratio",
            gives="velocities, impulses",
            versions=ours(),
            note="three balls, one collision per contact",
            **clock(run, impacts),
        )


def spring_rows(clock, quick):
    """Yield springs integrated in time with error control."""
    tolerances = (1e-3, 1e-6, 1e-9) if quick else [10.0**-k for k in range(3, 13)]
    cases = [("three equal", method) for method in ("RK45", "DOP853", "LSODA")]
    cases += [("five equal", "DOP853"), ("light middle", "DOP853")]
    for name, method in cases[:3] if quick else cases:
        scene = SCENES[name]
        for rtol in tolerances:
            model = SpringChain(1.0, rtol=rtol, method=method)

            def run(scene=scene, model=model):
                return collide(scene.chain, model)

            trace = run()
            yield Row(
                "springs",
                "SpringChain, Hertz",
                f"{method}, rtol {rtol:.0e}",
                name,
                parameter=rtol,
                **outcome(scene.masses, scene.velocities, trace.velocities),
                numerical_error=distance(trace.velocities, scene.springs()),
                numerical_reference=CONVERGED,
                evaluations=trace.evaluations,
                needs="stiffness, e = 1",
                gives=TIMED,
                versions=ours("scipy"),
                note="SciPy's integrators, called from Python",
                **clock(run),
            )
    scene = SCENES["three equal"]
    linear = SpringChain(1.0, 1, rtol=1e-9)
    after = collide(scene.chain, linear).velocities
    yield Row(
        "springs",
        "SpringChain, linear",
        "DOP853, rtol 1e-09",
        scene.name,
        parameter=1e-9,
        **outcome(scene.masses, scene.velocities, after),
        numerical_error=distance(after, scene.springs(1)),
        numerical_reference=CONVERGED,
        **model_error(scene, after),
        needs="stiffness, e = 1",
        gives=TIMED,
        versions=ours("scipy"),
        **clock(lambda: collide(scene.chain, linear)),
    )


def _penalty(masses, velocities, stiffness, exponent, step, kick_first, most):
    """March balls on springs with a fixed step until they part; return velocities and steps.

    `kick_first` 1.0 is semi-implicit Euler: the whole kick, then the drift. 0.5 is velocity
    Verlet: half a kick, the drift, half a kick.
    """
    n = len(masses)
    v = velocities.copy()
    d = np.zeros(n - 1)
    force = np.zeros(n - 1)
    steps = 0
    while steps < most:
        for part in (kick_first, 1.0 - kick_first):
            for c in range(n - 1):
                v[c] -= part * step * force[c] / masses[c]
                v[c + 1] += part * step * force[c] / masses[c + 1]
            if part == kick_first:
                for c in range(n - 1):
                    d[c] += step * (v[c] - v[c + 1])
                    force[c] = stiffness * d[c] ** exponent if d[c] > 0.0 else 0.0
        steps += 1
        done = True
        for c in range(n - 1):
            done = done and d[c] <= 0.0 and v[c] <= v[c + 1]
        if done:
            break
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
    return float(collide(chain, SpringChain(1.0, exponent, rtol=1e-12)).durations[0])


def penalty_rows(clock, quick):
    """Yield springs with a fixed step, as simulators do it: over the step and the stiffness."""
    scene = SCENES["three equal"]
    masses, velocities = (np.array(x) for x in (scene.masses, scene.velocities))
    schemes = {"semi-implicit Euler": 1.0, "velocity Verlet": 0.5}
    note = "compiled by numba" if runtime.compiled() is not None else "plain Python"

    def row(group, law, scheme, setting, parameter, stiffness, exponent, step):
        def run():
            kick = schemes[scheme]
            return penalty(masses, velocities, stiffness, exponent, step, kick, 10_000_000)

        after, steps = run()
        return Row(
            group,
            f"penalty, {law}",
            setting,
            scene.name,
            parameter=parameter,
            **outcome(masses, velocities, after),
            numerical_error=distance(after, scene.springs(exponent)),
            numerical_reference=CONVERGED,
            evaluations=steps,
            needs="stiffness, step, e = 1",
            gives=TIMED,
            versions=ours(),
            note=note,
            **clock(run),
        )

    for law, exponent in (("Hertz", 1.5), ("linear", 1.0)):
        lasts = contact_time(exponent)
        for scheme in schemes:
            for count in (10, 100, 1000) if quick else (5, 10, 30, 100, 300, 1000, 3000, 10_000):
                yield row(
                    "penalty", law, scheme, f"{scheme}, {count} steps a contact",
                    1 / count, 1.0, exponent, lasts / count,
                )  # fmt: skip
    # One step for all, as a simulator has it: what the stiffness makes of it. mu = 1/2.
    step = 1e-3
    for scheme in schemes:
        for phase in (0.01, 0.1, 1.0) if quick else (0.003, 0.01, 0.03, 0.1, 0.3, 0.6, 1.0, 1.5):
            stiffness = 0.5 * (phase / step) ** 2
            yield row(
                "stiffness", "linear", scheme,
                f"{scheme}, step 1 ms, stiffness {stiffness:.3g} N/m",
                phase, stiffness, 1.0, step,
            )  # fmt: skip


def energy_rows(clock, quick):
    """Yield the law of Liu, Zhao and Brogliato, over its tolerance."""
    for name in ("three equal",) if quick else ("three equal", "ABCCA"):
        scene = SCENES[name]
        if scene.elastic:
            reference, against = scene.springs(), "Hertz springs, converged: its limit at e = 1"
        else:
            reference = collide(scene.chain, EnergyDistribution(1.0, rtol=3e-13)).velocities
            against = "same law, rtol 3e-13"
        for rtol in (1e-6,) if quick else (1e-3, 1e-5, 1e-7, 1e-9, 1e-11):
            model = EnergyDistribution(1.0, rtol=rtol)

            def run(scene=scene, model=model):
                return collide(scene.chain, model)

            trace = run()
            yield Row(
                "energy",
                "EnergyDistribution, Hertz",
                f"rtol {rtol:.0e}",
                name,
                parameter=rtol,
                **outcome(scene.masses, scene.velocities, trace.velocities),
                numerical_error=distance(trace.velocities, reference),
                numerical_reference=against,
                **({} if scene.elastic else model_error(scene, trace.velocities)),
                evaluations=trace.evaluations,
                needs="e, stiffness ratios, exponent",
                gives=f"{PATH}, stored energies",
                versions=ours("scipy"),
                note="plain Python",
                **clock(run),
            )


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

            def run(chain=scene.chain, model=model):
                return collide(chain, model)

            after = run().velocities
            yield Row(
                "outcome",
                type(model).__name__,
                "one call",
                scene.name,
                **outcome(scene.masses, scene.velocities, after),
                **model_error(scene, after),
                needs=needs,
                gives=gives,
                versions=ours(),
                note=note,
                **clock(run),
            )


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
