"""Measures of outcomes: bouncing patterns."""

import numpy as np
import pytest

from cradle.measures import bouncing_pattern


def test_pattern_of_each_sign():
    """All three signs of a velocity, for the two balls that can go back."""
    expected = {(-1, -1): 3, (-1, 0): 1, (-1, 1): 1, (0, 0): 2, (0, 1): 2, (1, 1): 2}
    for signs, pattern in expected.items():
        assert bouncing_pattern([*signs, 2]) == pattern


def test_pattern_keeps_leading_axes():
    velocities = np.array([[[-1.0, 1.0, 2.0]], [[-2.0, -1.0, 2.0]]])
    pattern = bouncing_pattern(velocities)
    assert pattern.shape == (2, 1)
    assert pattern.tolist() == [[1], [3]]


@pytest.mark.parametrize(
    ("velocities", "message"),
    [
        ([1.0, 2.0], r"velocities has shape \(2,\); must be \(\.\.\., 3\)"),
        (1.0, r"velocities has shape \(\); must be \(\.\.\., 3\)"),
        ([0.0, np.nan, 1.0], r"velocities\[1\] = nan; must be finite"),
        ([-3.0, -2.0, -1.0], r"velocities of ball 3 = -1.0; must be at least 0"),
        ([[0.0, 0.0, 1.0], [-2.0, -2.0, -1.0]], r"velocities of ball 3\[1\] = -1.0"),
    ],
)
def test_pattern_refuses(velocities, message):
    with pytest.raises(ValueError, match=message):
        bouncing_pattern(velocities)
