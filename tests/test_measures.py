"""Measures of outcomes: bouncing patterns, effective ratios, the arc of conserving outcomes."""

import re

import numpy as np
import pytest
from chains import striking

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


def test_an_effective_ratio_that_no_step_brackets_is_found():
    """With a light ball between others velocities turn back within a step; one that fits is one."""
    chain = Chain([1.708, 0.009418937, 1.365], [1, 0, 0], [0.76, 0.79])
    trace = collide(chain, ImpulseCorrelation(0.3133, excess="saturate"))
    after = collide(chain, ImpulseCorrelation(effective_ratio(trace), excess="saturate"))
    np.testing.assert_allclose(after.velocities, trace.velocities, rtol=0, atol=1e-6)


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
