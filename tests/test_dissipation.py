"""Quadratic dissipation: two balls, the conditions of the minimum, and what it can reach."""

import itertools
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from laws import keeps

from cradle import Chain, QuadraticDissipation, collide


@st.composite
def cases(draw):
    """Chain and coefficients: two to five balls."""
    n = draw(st.integers(2, 5))
    masses = [10.0 ** draw(st.floats(-1.5, 1.5)) for _ in range(n)]
    number = st.sampled_from([0.0, 1.0, -1.0]) | st.floats(-1, 1).map(lambda v: round(v, 3))
    velocities = [draw(number) for _ in range(n)]
    kappa = [draw(st.sampled_from([0.0, 1.0]) | st.floats(0, 50)) for _ in range(n - 1)]
    return Chain(masses, velocities, 1), kappa


def part(chain):
    """Which contacts take part: those in a stretch of touching contacts with one that closes."""
    u = chain.closing_speeds
    taking = u > 0
    for c in [*range(1, len(u)), *range(len(u) - 2, -1, -1)]:
        taking[c] |= u[c] == 0 and taking[max(c - 1, 0) : c + 2].any()
    return taking


@settings(max_examples=50)
@given(cases())
def test_laws(case):
    chain, kappa = case
    keeps(collide(chain, QuadraticDissipation(kappa)), energy=1e-10, order=1e-13)


def solved(matrix, right):
    """Solve equations of rational numbers, by elimination."""
    rows = np.column_stack([matrix, right])
    for i in range(len(rows)):
        rows[i] = rows[i] / rows[i, i]  # of a positive definite matrix: never 0
        for j in set(range(len(rows))) - {i}:
            rows[j] = rows[j] - rows[j, i] * rows[i]
    return rows[:, -1]


def minimum(chain, kappa):
    """The minimum in exact rational numbers: all sets of contacts that stay closed are tried."""
    n = len(chain)
    m, v = (np.array([*map(Fraction, row)]) for row in (chain.masses, chain.velocities))
    touching = np.flatnonzero(part(chain)).tolist()
    mass = np.diag(m)
    half = 0 * mass
    for i in touching:
        row = np.array([(k == i) - (k == i + 1) for k in range(n)])
        reduced = m[i] * m[i + 1] / (m[i] + m[i + 1])
        half = half + Fraction(kappa[i]) * reduced * np.outer(row, row)
    best, least = None, None
    for size in range(len(touching) + 1):
        for closed in itertools.combinations(touching, size):
            # Balls that stay together move as one: x = groups @ y.
            label = np.cumsum([0] + [c not in closed for c in range(n - 1)])
            groups = np.eye(label[-1] + 1, dtype=int)[label]
            matrix = groups.T @ (mass + half) @ groups
            x = groups @ solved(matrix, groups.T @ (mass - half) @ v)
            cost = (m @ (x - v) ** 2 + (x + v) @ half @ (x + v)) / 2
            if all(x[c] <= x[c + 1] for c in touching) and (best is None or cost < least):
                best, least = x, cost
    return best.astype(float)


def is_the_minimum(chain, kappa, tolerance=1e-12):
    """The first problem of an impact is solved by it, where there is an impact."""
    if (chain.closing_speeds > 0).any():
        trace = collide(chain, QuadraticDissipation(kappa))
        np.testing.assert_allclose(trace.path[1], minimum(chain, kappa), rtol=0, atol=tolerance)


@settings(max_examples=50)
@given(cases())
def test_against_every_active_set(case):
    is_the_minimum(*case)


@pytest.mark.parametrize("last", [0.0, 1e-300, 1e-25, 1e-15, 1e-9, 1e-3])
def test_a_light_pair_between_heavy_balls_and_a_coefficient_of_0_or_next_to_it(last):
    rng = np.random.default_rng(1)
    for _ in range(50):
        masses = rng.integers(1, 9, 4) / [1, 32, 32, 1]
        velocities = -np.sort(rng.integers(0, 9, 4)) / 8
        kappa = [float(k) for k in rng.integers(1, 99, 2)] + [last]
        is_the_minimum(Chain(masses, velocities, 0), kappa)
    chain, kappa = Chain([6, 0.2, 0.1, 6], [-0.4, -0.9, -1, -1], 1), [30.0, 60.0, last]
    after = collide(chain, QuadraticDissipation(kappa)).velocities
    np.testing.assert_allclose(after, minimum(chain, kappa), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("values", "sizes", "tolerance"),
    [
        ([0, 1e-300, 1e-18, 1e-12, 1e-6, 0.5, 1, 60, 1e3], [2, 3, 4, 5], 1e-12),
        ([0, 0.5, 1e6, 1e8, 1e9], [3], 1e-6),  # large ones cost digits
    ],
)
def test_coefficients_of_all_magnitudes_in_one_chain(values, sizes, tolerance):
    rng = np.random.default_rng(2)
    for _ in range(300):
        n = int(rng.choice(sizes))
        masses = np.ldexp(rng.random(n) + 0.5, rng.integers(-4, 5, n))
        velocities, kappa = rng.integers(-4, 5, n) / 4, rng.choice(values, n)[1:].tolist()
        is_the_minimum(Chain(masses, velocities, 0), kappa, tolerance)


@pytest.mark.parametrize(
    ("masses", "velocities", "kappa"),
    [
        ([10, 20, 1, 0.01], [0.25, -0.75, -0.25, -0.5], [1000, 60, 0]),
        ([0.1, 10, 20, 0.02, 0.1], [-0.5, 0.5, -0.5, 0.5, -1], [60, 60, 1000, 0]),
        ([10, 1, 1, 0.1, 10], [0.75, -0.5, -0.25, 0, 0], [60, 1, 60, 1000]),
        ([10, 10, 0.05, 0.02], [0.75, -0.25, -1, -0.25], [1000, 0, 60]),
        ([1, 1, 5], [0, 1, 0], [19, 19]),  # ball 2 comes back from ball 3, and is caught up with
    ],
)
def test_balls_held_together_take_part_together_in_the_next_problem(masses, velocities, kappa):
    """Against one exact minimum after the other; light balls turn rounding into closing speeds."""
    exact = velocities
    while (np.diff(exact) < 0).any():
        exact = minimum(Chain(masses, exact, 0), kappa)
    after = collide(Chain(masses, velocities, 0), QuadraticDissipation(kappa)).velocities
    np.testing.assert_allclose(after, exact, rtol=0, atol=1e-12)


@pytest.mark.parametrize("e", [0.5, 0.999, 1 - 1e-6, 1 - 3e-9])
def test_digits_next_to_elastic(e):
    """kappa = (1 + e) / (1 - e) up to 1e9: momentum, energy and Newton's rule to rounding."""
    chain = Chain([1, 0.1, 3], [1, 0, 0], e)
    after = collide(chain, QuadraticDissipation()).velocities
    assert chain.masses @ after == pytest.approx(1, rel=1e-14)
    assert chain.masses @ after**2 <= 1 + 1e-13
    two = collide(Chain([1, 2], [1, 0], e), QuadraticDissipation()).velocities
    assert two[1] - two[0] == pytest.approx(e, rel=1e-14)


def test_a_row_that_moves_fast_as_a_whole_ends():
    """Closing speeds are known no better than the velocities that they are differences of."""
    m = [2.667898041887937, 0.1513775675083485, 2.985023514304723]
    v = [-0.028269191764867287, -0.028561050917407852, -0.02836761474957303]
    e = [0.1829277623249298, 0.9893257365314005]
    after = collide(Chain(m, v, e), QuadraticDissipation()).velocities
    # The same row, seen by somebody who moves along with its first ball.
    seen = collide(Chain(m, np.subtract(v, v[0]), e), QuadraticDissipation()).velocities
    np.testing.assert_allclose(after, seen + v[0], rtol=0, atol=1e-15)
    assert (np.diff(after) > -1e-16).all()


def test_heavy_balls_come_to_rest_by_impulses_below_their_last_digit():
    """A light ball between two heavy ones chatters until all three have one velocity."""
    m = [0.5, 0.01, 2.0]
    v = [0.01602603859008885, 0.01562735139806692, 0.015915201918699724]
    chain = Chain(m, v, [0.8324974858123636, 0.5648333423146973])
    trace = collide(chain, QuadraticDissipation())
    common = sum(map(Fraction, np.multiply(m, v))) / sum(map(Fraction, m))
    np.testing.assert_allclose(trace.velocities, float(common), rtol=2e-15)
    assert len(trace.events) < 1000


def test_a_light_striker_keeps_its_momentum():
    """Heavy balls gain next to no velocity, and all of the momentum: no difference tells it."""
    for masses in ([1e-5, 1e5, 1e5, 1.0], [1e-5, 1.0, 1e3, 1e5]):
        trace = collide(Chain(masses, [1, 0, 0, 0], 0.5), QuadraticDissipation())
        assert np.dot(masses, trace.velocities) == pytest.approx(masses[0], rel=1e-14)


def test_a_last_digit_opens_no_contact():
    """Balls 2 and 3 touch, though 0.1 + 0.2 is not 0.3."""
    touching, by_rounding = (
        collide(Chain([1, 1, 1], [1, 0.3, last], 0.5), QuadraticDissipation()).velocities
        for last in (0.3, 0.1 + 0.2)
    )
    np.testing.assert_allclose(by_rounding, touching, rtol=1e-14)
