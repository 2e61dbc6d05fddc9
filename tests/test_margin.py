"""`Trace.margin` tells where another order of events is within rounding."""

import numpy as np
import pytest
from extreme_chains import events_at_balls, moved, sequence

from cradle import Chain, ImpulseCorrelation, collide, paper_chain

#: An input of one of the paper's chains, by how much it is changed, and how far the velocities jump
#: there: edges of `data/extremes_edges.csv`.
EDGES = {
    "restitution of ABCCAB": ("ABCCAB", "restitution", 2, -0.1045, 0.0046),
    "a mass of ABCCAB": ("ABCCAB", "masses", 3, -0.04106, 0.0025),
    "a ratio of BCACBA": ("BCACBA", "backward", 2, 0.06774, 0.0012),
}


def changed(name, part, k, change):
    """The chain with one input changed by that part of it."""
    problem = sequence(name)
    return moved(problem, part, k, change * getattr(problem, part)[k]).collide()


@pytest.mark.parametrize("name", EDGES)
def test_it_vanishes_where_the_outcome_jumps(name):
    *which, at, jump = EDGES[name]
    near, far = 0.98 * at, 1.02 * at
    before, after = (events_at_balls(changed(*which, x)) for x in (near, far))
    assert before != after
    for _ in range(40):
        middle = 0.5 * (near + far)
        same = events_at_balls(changed(*which, middle)) == before
        near, far = (middle, far) if same else (near, middle)
    sides = [changed(*which, x) for x in (near, far)]
    moved = np.abs(sides[1].velocities - sides[0].velocities).max()
    assert moved / np.abs(sides[0].velocities).max() == pytest.approx(jump, rel=0.05)
    assert max(side.margin for side in sides) < 1e-11
    # It is the distance to the edge, as far as that goes.
    assert 1e-5 < changed(*which, near + 1e-3 * at).margin < 1e-2


@pytest.mark.parametrize(
    ("velocities", "ball", "e", "ratio", "jump"),
    [([1, 0.25, 0.25, 0], 2, 0.95, 0.2, 0.1222), ([1, 0, 0, 0, -1], 3, 0.98, 0.15, 0.157)],
)
def test_it_tells_of_balls_at_rest_between_two_that_approach(velocities, ball, e, ratio, jump):
    """R2: all that touch have one source; a motion of any size makes them two stretches."""

    def struck(change):
        v = np.array(velocities, float)
        v[ball] += change
        return collide(Chain(np.ones(len(v)), v, e), ImpulseCorrelation(ratio))

    rest, left, right = struck(0.0), struck(-1e-12), struck(1e-12)
    assert rest.margin == 0.0
    assert max(left.margin, right.margin) < 2e-12
    assert np.abs(rest.velocities - right.velocities).max() == pytest.approx(jump, rel=0.01)
    fastest = -np.diff(velocities).min()
    assert struck(1e-3).margin == pytest.approx(1e-3 / fastest, rel=0.01)


def test_it_is_large_far_from_any_other_order():
    assert collide(Chain([1, 1, 1], [1, 0, 0]), ImpulseCorrelation(0.5)).margin == 1.0
    assert collide(*paper_chain("AAA")).margin > 0.01
