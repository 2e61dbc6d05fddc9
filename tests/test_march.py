"""The march of small steps converges, at first order, to what can be found with a pencil.

Every expected outcome is derived here, by integrals over straight velocity-impulse lines; no other
program is asked. `test_textbook.py` compares generic chains of every kind. A step overshoots each
event by a part of itself that depends on the numbers, so one error alone says little: orders are
fitted to errors averaged over chains or step sizes.
"""

import math

import numpy as np
import pytest
from chains import uniform
from march import march

STEPS = (200, 800, 3200)


def converges(chains, error=math.inf, steps=STEPS, spread=0.15):
    """Whether (args, options, exact) do: slope of log(mean error) against log(step), last error."""
    errors = []
    for k in steps:
        runs = [
            march(*args, steps=n, **options).velocities
            for (args, options, _), n in zip(chains, np.broadcast_to(k, len(chains)), strict=True)
        ]
        errors.append(
            np.mean([abs(v - exact).max() for v, (*_, exact) in zip(runs, chains, strict=True)])
        )
    order = -np.polyfit(np.log([np.mean(k) for k in steps]), np.log(errors), 1)[0]
    assert abs(order - 1) < spread
    assert errors[-1] < error


def one_converges(chain, exact):
    """The same of one chain, errors averaged over five numbers around each of `STEPS`."""
    steps = np.outer(STEPS, np.geomspace(1, 1.5, 5))
    converges([(chain, {}, np.array(exact))] * 5, 5e-4, steps, spread=0.2)


def pair_outcome(m0, m1, v0, v1, e):
    """Two balls: momentum, and relative velocity reversed and multiplied by e."""
    common = (m0 * v0 + m1 * v1) / (m0 + m1)
    return common - e * m1 * (v0 - v1) / (m0 + m1), common + e * m0 * (v0 - v1) / (m0 + m1)


def three_balls(m, v, e, a):
    """One collision per contact: Eqs. 24 and 30-33, or None where there are more (or fewer).

    While both contacts act, u0 falls at the rate 1/m0 + (1 - a)/m1 per unit of the left impulse, so
    the left one ends at (1 + e0) times its compression impulse (Eq. 24). By then the right one
    has absorbed the area under its straight line. From there on it is a pair by itself, of reduced
    mass mu: it absorbs mu u^2 / 2 more and parts at the speed e1 sqrt(2 W / mu) (Eq. 30).
    """
    u0, u1 = v[0] - v[1], v[1] - v[2]
    p0 = (1 + e[0]) * u0 / (1 / m[0] + (1 - a) / m[1])
    u1_then = u1 + ((1 - a) / m[1] - a / m[2]) * p0
    mu = m[1] * m[2] / (m[1] + m[2])
    if u0 <= 0 or u1 < 0 or u1_then < 0:  # the right contact must outlast the left one
        return None
    work = a * p0 * (u1 + u1_then) / 2 + mu * u1_then**2 / 2
    p1 = a * p0 + mu * (u1_then + e[1] * math.sqrt(2 * work / mu))
    after = v[0] - p0 / m[0], v[1] + (p0 - p1) / m[1], v[2] + p1 / m[2]
    return np.array(after) if after[0] <= after[1] else None


def test_one_collision_per_contact():
    """Eqs. 24 and 30-33 on sixty random chains."""
    rng = np.random.default_rng(2)
    chains = []
    while len(chains) < 60:
        m, e, a = uniform(rng, 0.3, 3, 3), rng.random(2), rng.random()
        v = np.array([1.0, rng.choice([0.0, rng.random()]), 0.0])
        exact = three_balls(m, v, e, a)
        if exact is not None and a <= m[2] / (m[1] + m[2]):
            chains.append(((m, v, e, a, 0.0), {}, exact))
    converges(chains, 2e-3)
    for args, _, _ in chains:
        assert march(*args).collisions == [1, 1]


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


def test_ratio_zero_is_a_sequence_of_pairs():
    """R6: five balls, one pair after the other, none meeting again."""
    m, e = (2.0, 1.1, 0.7, 0.45, 0.3), (0.9, 0.8, 0.7, 0.6)
    v = [1.0, 0.0, 0.0, 0.0, 0.0]
    for c in range(4):
        v[c], v[c + 1] = pair_outcome(m[c], m[c + 1], v[c], v[c + 1], e[c])
    assert v == sorted(v)
    one_converges((m, (1, 0, 0, 0, 0), e, 0), v)


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
    one_converges(chain, (x, y, -y, -x))
    assert march(*chain).collisions == [1, 1, 1]


def random_chain(rng, n):
    m, e = uniform(rng, 0.4, 2.7, n), uniform(rng, 0.2, 1, n - 1)
    a, b = rng.random((2, n - 2)) * (rng.random((2, n - 2)) > 0.15)
    return m, uniform(rng, -1, 1, n), e, a, b


def test_momentum_energy_and_order():
    """R3's ledger: the energy lost is what the ended contacts absorbed, times 1 - e^2."""
    rng = np.random.default_rng(4)
    misses = []
    for _ in range(40):
        chain = random_chain(rng, rng.integers(2, 7))
        m, v, e = chain[:3]
        runs = [march(*chain, steps=k) for k in (250, 4000)]
        for run in runs:
            assert m @ run.velocities == pytest.approx(m @ v, abs=1e-9)
        energy = m @ v**2 / 2
        lost = [energy - m @ run.velocities**2 / 2 for run in runs]
        ledger = [(1 - e**2) @ run.ledger for run in runs]
        order = [max(-np.diff(run.velocities).min(), 0) for run in runs]
        misses.append([[abs(x - y) / energy for x, y in zip(lost, ledger, strict=True)], order])
    (coarse_energy, fine_energy), (coarse_order, fine_order) = np.mean(misses, axis=0)
    assert fine_energy < coarse_energy / 8  # 16 times smaller steps
    assert fine_order < coarse_order / 8
    assert fine_energy < 1e-3


def test_limits_are_errors():
    with pytest.raises(RuntimeError, match="max_steps = 100"):
        march((1, 1), (1, 0), 1, max_steps=100)
    with pytest.raises(RuntimeError, match="max_events"):
        march((1, 1, 1), (1, 0, 0), 0, 0, max_events=1)
