"""Rows that show what it saves to model only what a scene requires, in pairs.

`model` names the question, `setting` starts with "all: " or "less: ", and both rows of a pair
give the same velocities; the time is that of one impact.
"""

from functools import partial

import numpy as np
from measure import Row, distance, ours, outcome
from scenes import SCENES, random_chains
from solvers import PATH

from cradle import Chain, ImpulseCorrelation, collide, post_impact_velocities
from cradle.closed_form import one_collision_each, three_balls


def pairs(quick):
    """Yield question, chain, impacts, and both ways: a name, a function, what it gives."""
    few, many = (100, 1000) if quick else (500, 10_000)
    chains = random_chains(6, few)
    made = [(Chain(*one[:3]), ImpulseCorrelation(*one[3:])) for one in zip(*chains, strict=True)]
    yield (
        *("paths or outcomes", "6 balls, random", few),
        ("the path of each, one call a chain",
         lambda: [collide(*pair).velocities for pair in made], PATH),
        ("outcomes alone, one call", partial(post_impact_velocities, *chains), "velocities"),
    )  # fmt: skip

    chains = random_chains(3, few)
    singles = list(zip(*chains, strict=True))
    yield (
        *("one by one or at once", "3 balls, random", few),
        ("one call a chain", lambda: [post_impact_velocities(*one) for one in singles],
         "velocities"),
        ("one call for all", partial(post_impact_velocities, *chains), "velocities"),
    )  # fmt: skip

    m, v, e, *_ = two = random_chains(2, many)

    def newton():
        impulse = (1 + e[:, 0]) * (v[:, 0] - v[:, 1]) / (1 / m).sum(axis=1)
        return v + np.stack([-impulse, impulse], axis=-1) / m

    yield (
        *("two balls", "2 balls, random", many),
        ("post_impact_velocities", partial(post_impact_velocities, *two), "velocities"),
        ("Newton's rule", newton, "velocities, impulses"),
    )

    chains = random_chains(3, 4 * many)
    once = np.flatnonzero(one_collision_each(*chains[:3], chains[3][:, 0]))[:many]
    chains = [part[once] for part in chains]
    formula = partial(three_balls, *chains[:3], chains[3][:, 0])
    yield (
        *("one collision per contact", "3 balls, random", len(once)),
        ("post_impact_velocities", partial(post_impact_velocities, *chains), "velocities"),
        ("closed form", formula, "velocities"),
    )

    # The others touch each other and fly ahead, faster than any of the three will be.
    velocities = np.array([1.0, 0.0, 0.0] + [2.0] * 997)
    line = partial(post_impact_velocities, np.ones(1000), velocities, 1.0, 0.167)
    three = partial(post_impact_velocities, np.ones(3), velocities[:3], 1.0, 0.167)
    yield (
        *("balls that no impulse reaches", "three equal", 1),
        ("line of 1000 balls", lambda: line()[:3], "velocities"),
        ("the three that touch", three, "velocities"),
    )


def rows(clock, quick):
    for question, chain, impacts, *ways in pairs(quick):
        answers = [np.asarray(run(), float) for _, run, _ in ways]
        about = {
            "group": "saving", "model": question, "chain": chain, "needs": "e, ratios",
            "numerical_error": distance(*answers),
            "numerical_reference": "the other row of the pair", "versions": ours(),
        }  # fmt: skip
        if scene := SCENES.get(chain):
            about |= outcome(scene.masses, scene.velocities, answers[0])
        for whole, (name, run, gives) in zip(("all", "less"), ways, strict=True):
            yield Row(**about, setting=f"{whole}: {name}", gives=gives, **clock(run, impacts))
