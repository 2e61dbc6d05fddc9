"""The chapter on bouncing patterns: Eqs. 43-46, Figs. 6 and 7, and what it adds to them."""

import mpmath
import numpy as np
import pytest
from chains import magnitudes, uniform
from chapters import Chapter, floats
from scipy.optimize import brentq
from truth import solve
from turns import by_turns, edge, last_with, turn

from cradle import Chain, ImpulseCorrelation, collide, outcomes
from cradle.closed_form import back_impact_line, first_ball_stops, middle_ball_stops
from cradle.measures import bouncing_pattern

ALPHA, E = 0.15, 0.5
CHAPTER, READING = Chapter("patterns"), Chapter("reading_patterns")
GLUED = CHAPTER.glued


def masses(r1, r2):
    return np.stack(np.broadcast_arrays(1 / np.asarray(r1), 1.0, 1 / np.asarray(r2)), axis=-1)


def solved(r1, r2, e=E, alpha=ALPHA):
    return outcomes(masses(r1, r2), [1, 0, 0], e, alpha)


def count(r1, r2, e=E, alpha=ALPHA):
    return solved(r1, r2, e, alpha).collisions.sum(axis=-1)


def velocity(ball, r1, r2, e=E, alpha=ALPHA):
    return float(solved(r1, r2, e, alpha).velocities[ball - 1])


def reference(r1, r2, e=E, alpha=ALPHA):
    return solve([1 / r1, 1.0, 1 / r2], [1, 0, 0], e, alpha, number=float)


def random_cases(seed, size):
    """Ratios of masses, restitution of both contacts, ratio within both bounds."""
    rng = np.random.default_rng(seed)
    r1, r2 = 0.3 * magnitudes(rng, 2.4, (2, size))
    e = uniform(rng, 0.3, 1, size)
    return r1, r2, e, uniform(rng, 0, 1, size) / (1 + np.maximum(r1, r2))


def test_eq_43_impulse_of_the_back_impact():
    """The second contact's impulse at the moment when the first one closes again."""
    tried = 0
    for r1, r2, e, alpha in zip(*random_cases(43, 200)):
        trace = collide(Chain(masses(r1, r2), [1, 0, 0], e), ImpulseCorrelation(alpha))
        closings = [k for k, event in enumerate(trace.events, 1) if event == ("close", 0)]
        if closings:
            m1, m2 = 1 / r1, 1.0
            eq_43 = m2 * (alpha * m1 + e * (m1 + m2)) / ((1 - alpha) * m1 + m2)
            assert trace.path_impulses[closings[0], 1] == pytest.approx(eq_43, rel=1e-12)
            # The left half of the paper's condition is empty: the difference is e2 m2 v1.
            end = trace.path_impulses[trace.events.index(("end", 0)) + 1, 1]
            assert eq_43 - end == pytest.approx(e, rel=1e-12)
            tried += 1
    assert tried > 40


def test_eq_44_separates_one_collision_each():
    """Both solvers, just above and just below the curve."""
    tried = 0
    for _, r2, e2, alpha in zip(*random_cases(44, 200)):
        e = [e2, 1.3 - e2]
        r1 = float(back_impact_line(r2, *e, alpha))
        if 0.01 < r1 < 1 / alpha - 1:
            for side, collisions in ((1 + 1e-9, [1, 1]), (1 - 1e-9, [2, 1])):
                assert solved(r1 * side, r2, e, alpha).collisions.tolist() == collisions
                assert reference(r1 * side, r2, e, alpha).collisions == collisions
            tried += 1
    assert tried > 50


@pytest.mark.parametrize(("e", "alpha"), [(0.5, 0.15), (0.9, 0.3), (1.0, 0.0), (0.3, 0.05)])
def test_eqs_45_46_balls_at_rest(e, alpha):
    """Roots of the solved velocities, above the curve of Eq. 44."""
    r1, r2 = first_ball_stops(e, alpha), middle_ball_stops(e, alpha)
    found_1 = brentq(lambda x: velocity(1, x, 1.2 * r2, e, alpha), 0.9 * r1, 1.1 * r1, xtol=1e-15)
    high = min(1.5 * r1, 1 / alpha - 1 if alpha else np.inf)
    found_2 = brentq(lambda y: velocity(2, high, y, e, alpha), 0.9 * r2, 1.1 * r2, xtol=1e-15)
    assert found_1 == pytest.approx(r1, rel=1e-12)
    assert found_2 == pytest.approx(r2, rel=1e-12)
    assert count(high, r2, e, alpha) == count(r1, 1.2 * r2, e, alpha) == 2
    # They hold only there: among multiple collisions they are no border.
    assert abs(velocity(1, r1, 0.5 * r2, e, alpha)) > 1e-3


def test_fig_6_patterns_and_counts_by_the_map_of_turns():
    """The solver's counts and velocities against the map, for random ratios and restitutions."""
    cases = random_cases(66, 1500)
    r1, r2, e, alpha = cases
    found = outcomes(masses(r1, r2), [1, 0, 0], np.stack([e, e], -1), alpha[:, None])
    finite = np.flatnonzero(~found.collapsed)
    assert finite.size > 1400
    turns = [by_turns(*(values[k] for values in cases)) for k in finite]
    assert found.collisions[finite].sum(axis=-1).tolist() == [number for number, _ in turns]
    velocities = np.array([v for _, v in turns])
    np.testing.assert_allclose(found.velocities[finite], velocities, rtol=0, atol=1e-12)
    assert set(bouncing_pattern(found.velocities).tolist()) == {1, 2, 3}


@pytest.mark.parametrize(("number", "r2"), [(3, 0.5), (4, 0.5), (4, 0.1), (5, 0.1), (8, 0.05)])
def test_fig_6_borders_of_further_collisions(number, r2):
    """Bisection on the solver's count; the map and the reference solver on both sides."""
    low, high = last_with(lambda r1: count(r1, r2) >= number)
    for r1, expected in ((low - 1e-9, number), (high + 1e-9, number - 1)):
        assert by_turns(r1, r2, E, ALPHA)[0] == expected
        assert sum(reference(r1, r2).collisions) == expected
    if number == 3:
        assert low == pytest.approx(float(back_impact_line(r2, E, E, ALPHA)), abs=1e-11)
    # The outcome does not jump.
    left, right = solved(low, r2).velocities, solved(high, r2).velocities
    np.testing.assert_allclose(left, right, rtol=0, atol=1e-10)


@pytest.mark.parametrize(("e", "alpha"), [(0.5, 0.15), (0.3, 0.4), (0.8, 0.05), (0.1, 0), (0.9, 0)])
def test_fig_6_infinite_region(e, alpha):
    """Inside the border the map never stops and the solver collapses; outside both end."""
    for r2 in (0.001, 0.3 * edge(1e-9, e, alpha), 0.7 * edge(1e-9, e, alpha)):
        r1 = edge(r2, e, alpha)
        if alpha == 0:
            assert (1 + r1) * (1 + r2) == pytest.approx((1 + e) ** 2 / (4 * e), rel=1e-6)
        else:
            assert by_turns(r1 * (1 - 1e-6), r2, e, alpha)[0] == 10_000
            assert 100 < by_turns(r1 * (1 + 1e-3), r2, e, alpha)[0] < 10_000
        inside = solved(0.98 * r1, r2, e, alpha)
        assert inside.collapsed
        assert np.ptp(inside.velocities) < 1e-12
        far = 1.3 * r1, r2, e, alpha
        assert bool(solved(*far).collapsed) == (by_turns(*far)[0] > 1000)
        assert solved(*far).collapsed or count(*far) == by_turns(*far)[0]


def test_zeta_rises_in_each_cycle_and_without_losses_in_each_turn():
    """With r1 = 1, r2 = 0.02 the first turn lowers it: a single turn need not raise it."""
    rng, falls = np.random.default_rng(8), 0
    for _ in range(2000):
        r1, r2 = magnitudes(rng, 3, 2)
        e, part = uniform(rng, 0.05, 1, 2)
        a = part / (1 + max(r1, r2))
        zetas = [e * (1 - a + r1) / (1 + e)]
        for k in range(60):
            x, limit, y, d = turn(zetas[-1], (r2, r1)[k % 2], e, a)
            if x >= limit:
                break
            zetas.append(d * y / (y - x))
        falls += zetas[1:2] < zetas[:1] and len(zetas) > 1
        assert (np.diff(zetas[::2]) > -1e-14).all()
        b, r = 1 - a * (1 + r1), r1
        for zeta in np.linspace(0, (b + b**0.5) / (1 + r), 12)[:-1]:
            x, _, y, d = turn(zeta, r, 1, a)
            assert d * y / (y - x) > zeta
    assert falls > 50
    x, _, y, d = turn(2 / 3, 0.02, 0.5, 0)
    assert d * y / (y - x) < 2 / 3


def test_fig_6_is_not_kept_for_other_parameters():
    grid = np.linspace(0, 3, 31)[1:] - 0.05
    plastic = solved(grid[:, None], grid[None, :], 0.0)
    assert plastic.collapsed.all()
    assert set(bouncing_pattern(plastic.velocities).flat) == {2}
    elastic = solved(grid[:, None], grid[None, :], 1.0)
    assert not elastic.collapsed.any()
    # Equal outer balls, elastic: ball 1 never goes on, ball 2 never goes back.
    fine = np.geomspace(1e-3, 3, 2000)
    v1, v2, v3 = solved(fine, fine, 1.0).velocities.T
    assert v1.max() < 1e-12
    assert v2.min() > -1e-12
    np.testing.assert_allclose(2 * v1 * v3, -fine * v2 * (2 - (1 + fine) * v2), atol=1e-12)
    # A vanishing middle ball: the outer two as if alone.
    v1 = solved(3e-7, 1e-7, 1.0).velocities[0]
    assert v1 == pytest.approx((1 / 3 - 1) / (1 / 3 + 1), abs=1e-5)
    # Without restitution the map goes on for ever: it starts at 0 and gives back 0.
    for r1, r2 in ((0.1, 3.0), (2.0, 0.4), (1.0, 1.0)):
        assert by_turns(r1, r2, 0.0, ALPHA)[0] == 10_000
    # For a ratio above e the line of Eq. 45, and with it the meeting point, which is the end of
    # that of Eq. 46, are beyond the ratio's bound; the line of Eq. 44 is not.
    assert first_ball_stops(0.4, 0.5) > 1 / 0.5 - 1
    assert first_ball_stops(0.6, 0.5) < 1 / 0.5 - 1
    assert back_impact_line(0.5, 0.4, 0.4, 0.5) < 1 / 0.5 - 1


@pytest.mark.parametrize(("r2", "pattern"), [(0.5, "I"), (0.1, "III")])
def test_fig_6_above_eq_44_with_a_small_backward_ratio(r2, pattern):
    """There it does not act, but an equal one would be above its bound: the ratio exceeds e."""
    chain = Chain([0.5, 1, 1 / r2], [1, 0, 0], 0.4)
    trace = collide(chain, ImpulseCorrelation(0.5, 0.0))
    assert trace.collisions.tolist() == [1, 1]
    assert (trace.velocities < 0).tolist() == [True, pattern == "III", False]
    with pytest.raises(ValueError, match="backward"):
        collide(chain, ImpulseCorrelation(0.5))


@pytest.fixture(scope="module")
def light():
    return collide(Chain([100, 1, 100], [1, 0, 0], 1), ImpulseCorrelation(ALPHA))


def test_fig_7_against_50_digits(light):
    with mpmath.workdps(50):
        exact = solve([100, 1, 100], [1, 0, 0], 1, "0.15")
        velocities, path = floats(exact.velocities), np.array(exact.path, float)
    assert light.collisions.tolist() == exact.collisions == [10, 10]
    np.testing.assert_allclose(light.velocities, velocities, rtol=0, atol=1e-12)
    ends = [k for k, event in enumerate(light.events, 1) if event.kind != "maximum_compression"]
    others = [k for k, event in enumerate(exact.events, 1) if event[0] in ("end", "close")]
    np.testing.assert_allclose(light.path[ends], path[others], rtol=0, atol=1e-11)
    np.testing.assert_allclose(by_turns(0.01, 0.01, 1, ALPHA)[1], velocities, rtol=0, atol=1e-12)


def test_fig_7_printed_velocities(light):
    """Two of three printed numbers agree; the middle one differs by one unit of its last digit."""
    printed = np.array([-0.003, 0.348, 0.999])
    assert (np.round(light.velocities, 3) == printed).tolist() == [True, False, True]
    assert f"{printed[1] - light.velocities[1]:.4f}" == "0.0006"


def test_fig_7_last_digit(light):
    """What the last digit hangs on, and the arithmetic that gives the printed one."""

    def middle(alpha):
        return velocity(2, 0.01, 0.01, 1.0, alpha)

    slope = (middle(ALPHA + 1e-6) - middle(ALPHA - 1e-6)) / 2e-6
    assert slope == pytest.approx(11.57, abs=0.01)
    READING.tells({"patterns-slope": slope})
    needed = brentq(lambda alpha: middle(alpha) - 0.3475, 0.15, 0.1501)
    READING.tells({"patterns-alpha-needed": needed})
    assert needed - 0.15 == pytest.approx((0.3475 - light.velocities[1]) / slope, rel=1e-2)
    tau_2, tau_3 = (float(f"{p:.6g}") for p in light.impulses)
    assert (tau_2, tau_3) == (100.287, 99.9392)
    printed = np.round([1 - tau_2 / 100, tau_2 - tau_3, tau_3 / 100], 3)
    assert printed.tolist() == [-0.003, 0.348, 0.999]


def test_light_ball_has_no_limit():
    """The heavy balls tend to 0 and 1; the light one sweeps from one to the other."""
    for r in (1e-3, 1e-5):
        same = np.linspace(r, 1.5 * r, 3000)
        v1, v2, v3 = solved(same, same, 1.0).velocities.T
        assert abs(v1).max() < r
        assert abs(v3 - 1).max() < 2 * r
        assert v2.min() < 0.05
        assert v2.max() > 0.95


def test_exercises():
    """Where ball 1 turns, where a third collision sets in, and ball 3 with all that is left."""
    border = brentq(lambda e: count(1, 1, e) - 2.5, 0.2, 0.9)
    CHAPTER.tells({"ex-1": f"{1 - ALPHA:.2f}", "ex-border": border})
    for e in (0.3, 0.6, 1.0):
        assert reference(1, 1, e).velocities[1] > 0  # ball 2 never goes back
    assert reference(1, 1, 0.3).velocities[0] > 0
    r1, r2 = (float(GLUED[f"ex-{name}"]) for name in ("r1", "r2"))
    v = floats(solve([1 / r1, 1, 1 / r2], [1, 0, 0], ["0.9", "0.3"], "0.15").velocities)
    assert v[:2] == pytest.approx([0, 0], abs=1e-3)
    assert float(GLUED["ex-part"]) == pytest.approx(v[2] ** 2 * r1 / r2, abs=2e-3)
