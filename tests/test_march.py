"""The march of small steps against what can be found with a pencil, and what it shows of R7.

`test_textbook.py` compares it with generic chains of every kind.
"""

import math

import numpy as np
import pytest
from march import march

STEPS = (200, 800, 3200)


def test_hold_is_the_limit_of_chatter_where_the_held_contact_drives_nobody():
    chain = (1.0, 1.3, 0.8), (1, 0, 0), 0.7, 0.9
    held = march(*chain, steps=50_000).velocities
    slope = [abs(march(*chain, steps=k, hold=False).velocities - held).max() for k in STEPS]
    assert march(*chain, steps=STEPS[-1], hold=False).collisions[1] > 500
    assert slope[0] > 2 * slope[1] > 4 * slope[2]
    assert slope[2] < 1e-3


def test_hold_is_not_the_limit_of_chatter_where_the_held_contact_drives_on():
    """Each end of a chattering contact cuts the run in two: the pieces lose their common clock."""
    chain = (1, 1, 1, 1), (1, 0, 0, 0), 1, (0.8, 0.3)
    held = march(*chain, steps=1000)
    chatter = march(*chain, steps=1000, hold=False)
    assert held.velocities == pytest.approx((-0.41668, 0.18184, 0.49304, 0.74179), abs=2e-3)
    assert chatter.velocities == pytest.approx((-0.5, 0.5, 0.5, 0.5), abs=2e-3)


def test_two_runs_that_meet():
    """R8 for a symmetric chain, by hand: the gap closes at zero and is driven from both sides.

    Outer mass m, inner mass 1, velocities (1, -d, d, -1), e = 1, ratio a; x, y are the left half's.
    """
    m, d, a = 0.3, 0.1, 0.2
    x, u = 1 - d / m, 1 - d / m  # the inner balls stop at the gap after an impulse d
    stored = d * (1 + d + u) / 2
    k = 1 / m + 1 - a
    p = (u + math.sqrt(u**2 + 2 * k * stored)) / k  # outer contacts: work back to zero
    x, y = x - p / m, (1 - a) * p
    y = -math.sqrt(y**2 + a * (1 - a) * p**2)  # the gap returns 2 a (1 - a) p^2 / 2 as well
    assert x < y
    chain = (m, 1, 1, m), (1, -d, d, -1), 1, a
    # A step overshoots each event by a part of itself that depends on the numbers: means of five.
    errors = [
        np.mean([abs(march(*chain, steps=n).velocities - [x, y, -y, -x]).max() for n in numbers])
        for numbers in np.outer(STEPS, np.geomspace(1, 1.5, 5)).astype(int)
    ]
    order = -np.polyfit(np.log(STEPS), np.log(errors), 1)[0]
    assert abs(order - 1) < 0.2
    assert errors[-1] < 5e-4
    assert march(*chain).collisions == [1, 1, 1]
