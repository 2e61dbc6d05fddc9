"""Measures of outcomes: bouncing patterns, effective ratios, the arc of conserving outcomes."""

import re
from fractions import Fraction

import numpy as np
import pytest
from chains import magnitudes, striking, uniform

from cradle import (
    Chain,
    EnergyDistribution,
    FusedChain,
    ImpulseCorrelation,
    SequentialCollisions,
    collide,
    post_impact_velocities,
)
from cradle.measures import (
    bouncing_pattern,
    condition_number,
    conserving_angle,
    conserving_outcomes,
    effective_ratio,
)


def test_pattern_of_each_sign():
    """All three signs of a velocity, for the two balls that can go back; leading axes stay."""
    expected = {(-1, -1): 3, (-1, 0): 1, (-1, 1): 1, (0, 0): 2, (0, 1): 2, (1, 1): 2}
    velocities = np.array([[[*signs, 2.0]] for signs in expected])
    assert bouncing_pattern(velocities).tolist() == [[pattern] for pattern in expected.values()]


@pytest.mark.parametrize("part", [0, 0.01, 0.3, 0.7, 1])
@pytest.mark.parametrize("e", [1.0, 0.7])
@pytest.mark.parametrize("masses", [(1, 2, 0.5), (2, 1, 2.5)])
def test_effective_ratio_of_a_ratio_is_that_ratio(masses, e, part):
    bound = masses[2] / (masses[1] + masses[2])
    for chain in (striking(masses, e), Chain(masses[::-1], [0, 0, -1], e)):  # and its mirror image
        trace = collide(chain, ImpulseCorrelation(part * bound, excess="saturate"))
        assert effective_ratio(trace) == pytest.approx(part * bound, abs=1e-9)


def test_effective_ratio_of_the_textbook_answers():
    assert effective_ratio(collide(striking(), SequentialCollisions())) == pytest.approx(0)
    assert effective_ratio(collide(striking(), FusedChain())) == pytest.approx(0.5, abs=1e-9)


def test_two_ratios_one_outcome():
    """Masses 3, 1, 2 (an arc of 45 degrees): ratios 0 and 2/3 leave the same velocities."""
    chain = striking((3, 1, 2))
    one, other = (collide(chain, ImpulseCorrelation(ratio)) for ratio in (0, 2 / 3))
    np.testing.assert_allclose(one.velocities, other.velocities, rtol=0, atol=1e-13)
    assert effective_ratio(other) == 0


def test_no_effective_ratio():
    """Energy is lost elsewhere than under a ratio; the nearest one is told."""
    trace = collide(striking(e=0.5), EnergyDistribution(1.0))
    with pytest.raises(ValueError, match=r"^no ratio in \[0, 0\.5\] gives .* misses by") as error:
        effective_ratio(trace)
    words = re.search(r"nearest, ([\d.e-]+), misses by ([\d.e-]+) of", str(error.value))
    ratio, miss = float(words[1]), float(words[2])
    after = collide(trace.chain, ImpulseCorrelation(ratio)).velocities
    assert abs(after - trace.velocities).max() == pytest.approx(miss, rel=0.01)
    # No ratio of a fine grid comes nearer by much.
    grid = post_impact_velocities([1, 1, 1], [1, 0, 0], 0.5, np.linspace(0, 0.5, 5001)[:, None])
    assert abs(grid - trace.velocities).max(axis=1).min() > 0.95 * miss


@pytest.mark.parametrize("seed", range(10))
def test_conserving_outcomes_conserve(seed):
    rng = np.random.default_rng(seed)
    m, v = magnitudes(rng, 2, 3), np.sort(uniform(rng, -1, 1, 3))[::-1]
    angles, after = conserving_outcomes(m, v)
    np.testing.assert_allclose(after @ m, m @ v, rtol=1e-12)
    np.testing.assert_allclose(after**2 @ m, m @ v**2, rtol=1e-12)
    assert (np.diff(after, axis=1) > -1e-14).all()
    assert after[0, 0] == pytest.approx(after[0, 1], abs=1e-13)
    assert after[-1, 1] == pytest.approx(after[-1, 2], abs=1e-13)
    end = m[0] * m[2] / ((m[0] + m[1]) * (m[1] + m[2]))
    assert np.cos(angles[-1]) ** 2 == pytest.approx(end, rel=1e-12)
    back = [conserving_angle(m, outcome) for outcome in after]
    np.testing.assert_allclose(back, angles, rtol=0, atol=1e-12)
    # Any ordered outcome that conserves both is on the arc: the ellipse of closing speeds.
    same = conserving_outcomes(m, v, back[1:-1])[1]
    np.testing.assert_allclose(same, after[1:-1], rtol=0, atol=1e-12)


def test_arc_of_a_very_light_middle_ball():
    """Its length keeps its digits where the arccos of a number near one has none."""
    for light in (1e-6, 1e-14):
        angles, outcomes = conserving_outcomes([1, light, 1], [1, 0, 0])
        assert angles[-1] == pytest.approx(np.arctan(np.sqrt(light * (2 + light))), rel=1e-14)
        assert outcomes[-1, 2] - outcomes[-1, 1] == pytest.approx(0, abs=1e-7)
    assert conserving_angle([1, 2, 3], [0.1, 0.1, 0.1]) == 0


@pytest.mark.parametrize("power", [-1073, -600, 900])
def test_the_arc_has_no_unit_of_mass(power):
    """To the bit, from the smallest floats on: once products of masses were lost."""
    velocities = [1.0, 0.0, -0.25]
    angles, outcomes = conserving_outcomes([1, 2, 1], velocities)
    same = np.ldexp([1.0, 2.0, 1.0], power)
    other_angles, other_outcomes = conserving_outcomes(same, velocities)
    assert other_angles.tolist() == angles.tolist()
    assert other_outcomes.tolist() == outcomes.tolist()
    assert conserving_angle(same, outcomes[90]) == conserving_angle([1, 2, 1], outcomes[90])


@pytest.mark.parametrize("where", [0, 1, 2])
@pytest.mark.parametrize("other", [1e-12, 1e-150, 1e12, 1e150])
def test_ends_of_the_arc_of_masses_far_apart(where, other):
    """Against the two collisions whose outcomes the ends are, in rational numbers.

    At one end balls 1 and 2 go on together and ball 3 leaves them elastically, at the other end
    ball 1 leaves balls 2 and 3: each as two balls with the speeds that energy and momentum fix.
    """
    masses = [1.0, 1.0, 1.0]
    masses[where] = other
    m1, m2, m3 = map(Fraction, masses)
    total = m1 + m2 + m3
    left = [-2 * m3 / total, -2 * m3 / total, (m1 + m2 - m3) / total]  # ball 3 comes at -1
    right = [(m1 - m2 - m3) / total, 2 * m1 / total, 2 * m1 / total]  # ball 1 comes at 1
    ends = [([0.0, 0.0, -1.0], 0, left), ([1.0, 0.0, 0.0], -1, right)]
    for velocities, end, exact in ends:
        outcome = conserving_outcomes(masses, velocities)[1][end]
        np.testing.assert_allclose(outcome, list(map(float, exact)), rtol=1e-12, atol=1e-15)


#: Ratios above their bounds, and an impact of 1800 events: whatever a last digit changes grows.
CHAOTIC = (
    Chain([15, 0.072, 5, 0.043, 0.25, 0.079], [1, 0, 0, 0, 0, 0], [0.85, 0.73, 0.83, 0.69, 0.76]),
    ImpulseCorrelation([0.54, 0.36, 0.29, 0.44], [0.6, 0.2, 0.07, 0.14], excess="saturate"),
)


def test_the_margin_does_not_see_what_grows_and_the_condition_number_does():
    chain, model = CHAOTIC
    trace = collide(chain, model)
    assert trace.margin > 1e-3
    nudged = chain.masses * [1, 1, 1, 1 + 1e-12, 1, 1]
    other = collide(Chain(nudged, chain.velocities, chain.restitution), model)
    assert np.abs(other.velocities - trace.velocities).max() > 1e-7
    assert condition_number(chain, model, 1e-10).number > 1e4
