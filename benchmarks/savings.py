"""Rows that show what it saves to model only what a scene requires, in pairs.

`model` names the question, `setting` starts with "all: " or "less: ", and both rows of a pair
give the same velocities; the time is that of one impact.
"""

import numpy as np
from measure import Row, distance, ours, outcome
from scenes import SCENES, random_chains
from solvers import PATH

from cradle import Chain, ImpulseCorrelation, collide, post_impact_velocities
from cradle.closed_form import one_collision_each, three_balls

SAME = "the other row of the pair"


def rows(clock, quick):
    """Yield the pairs."""
    few, many = (100, 1000) if quick else (500, 10_000)
    yield from _path_or_outcome(clock, few)
    yield from _one_by_one_or_at_once(clock, few)
    yield from _two_balls(clock, many)
    yield from _one_collision_each(clock, many)
    yield from _idle_balls(clock, 1000)


def _pair(clock, question, chain, both, note=""):
    """Yield the rows of {setting: (function, impacts, what it gives)}, with their difference."""
    answers = [np.asarray(function(), float) for function, _, _ in both.values()]
    error = distance(*answers)
    for setting, (function, impacts, gives) in both.items():
        yield Row(
            "saving",
            question,
            setting,
            chain,
            numerical_error=error,
            numerical_reference=SAME,
            gives=gives,
            needs="e, ratios",
            versions=ours(),
            note=note,
            **clock(function, impacts),
        )


def _path_or_outcome(clock, count):
    """Yield: the path of each impact, or all outcomes alone, for the same chains of six balls."""
    chains = random_chains(6, count)
    made = [
        (Chain(m, v, e), ImpulseCorrelation(f, b)) for m, v, e, f, b in zip(*chains, strict=True)
    ]

    def paths():
        return [collide(*pair).velocities for pair in made]

    both = {
        "all: the path of each, one call a chain": (paths, count, PATH),
        "less: outcomes alone, one call": (
            lambda: post_impact_velocities(*chains),
            count,
            "velocities",
        ),
    }
    yield from _pair(clock, "paths or outcomes", "6 balls, random", both)


def _one_by_one_or_at_once(clock, count):
    """Yield: one call a chain, or one call for all."""
    chains = random_chains(3, count)

    def one_by_one():
        return [post_impact_velocities(*chain) for chain in zip(*chains, strict=True)]

    both = {
        "all: one call a chain": (one_by_one, count, "velocities"),
        "less: one call for all": (lambda: post_impact_velocities(*chains), count, "velocities"),
    }
    yield from _pair(clock, "one by one or at once", "3 balls, random", both)


def _two_balls(clock, count):
    """Yield: two balls by the batch, or by Newton's rule."""
    m, v, e, f, b = random_chains(2, count)

    def formula():
        impulse = (1 + e[:, 0]) * (v[:, 0] - v[:, 1]) / (1 / m[:, 0] + 1 / m[:, 1])
        return v + np.stack([-impulse, impulse], axis=-1) / m

    both = {
        "all: post_impact_velocities": (
            lambda: post_impact_velocities(m, v, e, f, b), count, "velocities"
        ),
        "less: Newton's rule": (formula, count, "velocities, impulses"),
    }  # fmt: skip
    yield from _pair(clock, "two balls", "2 balls, random", both)


def _one_collision_each(clock, count):
    """Yield: one collision per contact, by the batch, or by Eqs. 24 and 30."""
    m, v, e, f, b = random_chains(3, 4 * count)
    once = np.flatnonzero(one_collision_each(m, v, e, f[:, 0]))[:count]
    m, v, e, f, b = (part[once] for part in (m, v, e, f, b))
    both = {
        "all: post_impact_velocities": (
            lambda: post_impact_velocities(m, v, e, f, b), len(m), "velocities"
        ),
        "less: closed form": (lambda: three_balls(m, v, e, f[:, 0]), len(m), "velocities"),
    }  # fmt: skip
    yield from _pair(clock, "one collision per contact", "3 balls, random", both)


def _idle_balls(clock, balls):
    """Yield: a long line in which three balls touch, or those three alone."""
    scene = SCENES["three equal"]
    masses = np.ones(balls)
    # The others touch each other and fly ahead, faster than any of the three will be.
    velocities = np.full(balls, 2.0)
    velocities[:3] = scene.velocities

    def line():
        return post_impact_velocities(masses, velocities, 1.0, 0.167)[:3]

    def three():
        return post_impact_velocities(masses[:3], velocities[:3], 1.0, 0.167)

    after = line()
    both = {
        f"all: line of {balls} balls": (line, 1, "velocities"),
        "less: the three that touch": (three, 1, "velocities"),
    }
    for row in _pair(clock, "balls that no impulse reaches", scene.name, both):
        vars(row).update(outcome(scene.masses, scene.velocities, after))
        yield row
