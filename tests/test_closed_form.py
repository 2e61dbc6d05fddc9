"""Eqs. 17-34 and 43-46 against the event solver, which knows none of them."""

import numpy as np
from chains import magnitudes, uniform

from cradle import Chain, ImpulseCorrelation, collide
from cradle.closed_form import (
    back_impact_line,
    largest_ratios,
    one_collision_each,
    three_balls,
)


def random_three_balls(seed, count=4000):
    """Half with v2 = v3, half with v2 > v3; e = 0 and 1 among them; ratios up to Eq. 34."""
    rng = np.random.default_rng(seed)
    masses = magnitudes(rng, 2, (count, 3))
    velocities = np.sort(uniform(rng, -1, 1, (count, 3)))[:, ::-1].copy()
    velocities[: count // 2, 1] = velocities[: count // 2, 2]
    e = rng.random((count, 2))
    e = np.where(rng.random(e.shape) < 0.1, np.round(e), e)
    ratio = rng.random(count) * masses[:, 2] / (masses[:, 1] + masses[:, 2])
    ratio[rng.random(count) < 0.1] = 0.0
    return masses, velocities, e, ratio


def test_where_the_closed_form_does_not_apply_the_solver_finds_more_collisions():
    chains = random_three_balls(seed=44)
    masses, velocities, e, ratio = chains
    after = three_balls(*chains)
    # Not within rounding of the two edges: ball 2 falling back on ball 1, contact 2-3 ending first.
    clear = np.abs(after[:, 0] - after[:, 1]) > 1e-9
    apply = one_collision_each(*chains)
    more = 0
    for i in np.flatnonzero(clear):
        model = ImpulseCorrelation(ratio[i], excess="saturate")
        trace = collide(Chain(masses[i], velocities[i], e[i]), model)
        once = trace.collisions.tolist() == [1, 1]
        assert once == apply[i], i
        more += not once
    assert more > 300


def test_largest_ratios_broadcast():
    m, f = np.ones((4, 1, 5)), np.full((3, 3), 0.5)
    forward, backward = largest_ratios(m, f, f[0])
    assert (forward.shape, backward.shape) == ((4, 3, 3), (4, 1, 3))
    np.testing.assert_array_equal(forward[2, 1], largest_ratios(m[0, 0], f[0], f[0])[0])
    # Two balls have no ball in between, and no chains no bounds.
    assert [bound.shape for bound in largest_ratios([1, 2], [], [])] == [(0,), (0,)]
    shapes = [bound.shape for bound in largest_ratios(np.ones((0, 4)), *np.ones((2, 0, 2)))]
    assert shapes == [(0, 2), (0, 2)]


def test_three_balls_pass_on_nan():
    """An input that is NaN spoils its own chain, without a warning; none approach: 0/0."""
    masses = [[1, 1, 1], [1, np.nan, 1], [1, 1, 1]]
    velocities = [[1, 0, 0], [1, 0, 0], [2, 2, 2]]
    after = three_balls(masses, velocities, [1, 1], 0.1)
    assert np.isnan(after).any(axis=1).tolist() == [False, True, True]
    once = one_collision_each(masses, velocities, [1, 1], 0.1)
    assert once.tolist() == [True, False, False]


def test_eq_44_beyond_the_bound_is_nan():
    """The line ends where the ratio is at its bound (Eq. 34), r2 = 1 / ratio - 1."""
    line = back_impact_line([0, 3, 3.1], 0.5, 0.5, 0.25)
    assert np.isnan(line).tolist() == [False, False, True]
