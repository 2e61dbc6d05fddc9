"""The march of small steps converges, at first order, to what can be found with a pencil.

Every expected outcome is derived here, by integrals over straight velocity-impulse lines; no other
program is asked. A step overshoots each event by a part of itself that depends on the numbers,
so one error alone says little: orders are fitted to errors averaged over chains or step sizes.
"""

import math

import numpy as np
import pytest
from chains import FIG_8, changes, uniform
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


def one_converges(chain, exact=None, error=math.inf, steps=STEPS, finer=4, several=5, spread=0.2):
    """The same of one chain, errors averaged over several numbers around each of `steps`.

    Returns the limit: without an exact outcome it is extrapolated from finer marches.
    """
    factors = np.geomspace(1, 1.5, several)
    if exact is None:
        runs = [march(*chain, steps=finer * steps[-1] * f).velocities for f in factors]
        exact = np.polyfit(1 / factors, np.array(runs), 1)[1]  # linear in the step: the intercept
    converges([(chain, {}, exact)] * several, error, np.outer(steps, factors), spread)
    return exact


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


def test_two_balls():
    rng = np.random.default_rng(1)
    chains = []
    for e in rng.random(20):
        m0, m1, v0 = uniform(rng, 0.2, 5, 3)
        chains.append((((m0, m1), (v0, 0.1), e), {}, np.array(pair_outcome(m0, m1, v0, 0.1, e))))
    converges(chains, 1e-3)


@pytest.mark.parametrize(("ratio", "exact"), [(0.0, (0, 0, 1)), (0.5, (-1 / 3, 2 / 3, 2 / 3))])
def test_ends_of_fig_4(ratio, exact):
    one_converges(((1, 1, 1), (1, 0, 0), 1, ratio), exact, 5e-4, spread=0.15)


def test_one_collision_per_contact():
    """Eqs. 24 and 30-33 on sixty random chains."""
    rng = np.random.default_rng(2)
    chains = []
    while len(chains) < 60:
        m, e, a = uniform(rng, 0.3, 3, 3), rng.random(2), rng.random()
        v = np.array([1.0, rng.choice([0.0, rng.random()]), 0.0])
        exact = three_balls(m, v, e, a)
        if exact is not None and a <= m[2] / (m[1] + m[2]):
            chains.append(((m, v, e, a, 0.0), {"excess": "raise"}, exact))
    converges(chains, 2e-3)
    for args, _, _ in chains:
        assert march(*args).collisions == [1, 1]


def test_hold_is_the_largest_admissible_ratio():
    """R7: a ratio above m2 / (m1 + m2), right ball at rest, acts as if it were that bound."""
    rng = np.random.default_rng(3)
    chains = []
    while len(chains) < 20:
        m, e = uniform(rng, 0.3, 3, 3), rng.random(2)
        bound = m[2] / (m[1] + m[2])
        exact = three_balls(m, (1, 0, 0), e, bound * (1 - 1e-15))
        if exact is not None:
            chains.append(((m, (1, 0, 0), e, uniform(rng, bound, 1)), {}, exact))
    converges(chains, 1e-3)
    assert all(march(*args).held == {1} for args, _, _ in chains)


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
    one_converges((m, (1, 0, 0, 0, 0), e, 0), v, 5e-4)


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
    one_converges(chain, (x, y, -y, -x), 5e-4)
    assert march(*chain).collisions == [1, 1, 1]


def test_fig_7_light_ball():
    chain = (1, 0.01, 1), (1, 0, 0), 1, 0.15
    limit = one_converges(chain, steps=(200, 400, 800), several=4)
    assert limit == pytest.approx((-0.003, 0.347, 0.999), abs=5e-4)
    assert limit @ (1, 0.01, 1) == pytest.approx(1, abs=1e-9)
    assert limit**2 @ (1, 0.01, 1) == pytest.approx(1, abs=1e-3)


def test_fig_8_four_balls():
    """The middle contact ends alone, and closes again while both others act (3.2)."""
    chain = (1, 1, 1, 1), (1, 0.5, 0, 0), 1, 0.1
    limit = one_converges(chain)
    assert limit.sum() == pytest.approx(1.5, abs=1e-9)
    assert (limit**2).sum() == pytest.approx(1.25, abs=1e-4)
    assert (np.diff(limit) > 0).all()
    assert changes(march(*chain).events) == FIG_8


def test_hold_that_starts_late():
    """ABCCAB of Tables 1 and 2: admissible at first, held once the last contact has ended."""
    chain = (
        (45, 53, 53, 53, 45, 53),
        (1, 0, 0, 0, 0, 0),
        (0.53, 0.28, 0.27, 0.31, 0.53),
        (0.111, 0.319, 0.462, 0.499),
        (0.435, 0.414, 0.216, 0.088),
    )
    one_converges(chain, steps=(1000, 4000, 16000), finer=2)
    run = march(*chain, steps=16000, excess="raise")
    assert run.held == {3}
    assert run.collisions == [1, 3, 2, 2, 1]


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


@pytest.mark.parametrize("meeting", [0.5, 0.2])
@pytest.mark.parametrize("strikers", [1, 2])
def test_mirrored_chain(meeting, strikers):
    """Reversed balls, velocities and ratios, and 1 - meeting: the mirrored outcome.

    Two strikers come from the two ends; the balls between them drift apart, so that each touching
    stretch has one, and no two distances are equal (a tie goes to the left: no mirror image).
    """
    rng = np.random.default_rng(5)
    for n in [4, 5, 6] * 5:
        m, _, e, a, b = random_chain(rng, n)
        v = np.array([1, *np.zeros(n - 1)])
        if strikers == 2:
            v = np.array([1, *np.sort(uniform(rng, -0.1, 0.1, n - 2)), -0.7])
        here = march(m, v, e, a, b, meeting=meeting, steps=2000)
        reversed_chain = m[::-1], -v[::-1], e[::-1], b[::-1], a[::-1]
        there = march(*reversed_chain, meeting=1 - meeting, steps=2000)
        # The march itself is symmetric; the rounding of a fraction to whole steps may not be.
        assert abs(here.velocities + there.velocities[::-1]).max() < 1e-3


def test_limits_are_errors():
    with pytest.raises(RuntimeError, match="max_steps = 100"):
        march((1, 1), (1, 0), 1, max_steps=100)
    with pytest.raises(RuntimeError, match="max_events"):
        march((1, 1, 1), (1, 0, 0), 0, 0, max_events=1)
    with pytest.raises(ValueError, match="above the bound"):
        march((1, 1, 1), (1, 0, 0), 1, 0.6, excess="raise")
