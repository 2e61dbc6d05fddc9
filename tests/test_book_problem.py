"""Chapter "The problem": momentum, restitution, and the two answers (Eqs. 1-6, Fig. 1)."""

from fractions import Fraction

import numpy as np
import pytest
from chains import uniform
from chapters import Chapter, floats
from truth import solve

from cradle import Chain, ImpulseCorrelation, collide

EQUAL = Chain([1, 1, 1], [1, 0, 0], 1)
CHAPTER, READING = Chapter("problem"), Chapter("reading_problem")


def elastic(m1, v1, m2, v2):
    """Two balls, e = 1: each velocity is mirrored in that of the centre of mass."""
    centre = (m1 * v1 + m2 * v2) / (m1 + m2)
    return 2 * centre - v1, 2 * centre - v2


@pytest.mark.parametrize("equation", [1, 2, 3])
def test_eqs_1_to_3_momentum_of_each_ball(equation: int):
    rng = np.random.default_rng(1)
    for _ in range(50):
        masses, velocities, e = (
            uniform(rng, 0.5, 2, 3),
            uniform(rng, -1, 1, 3),
            uniform(rng, 0.2, 1, 2),
        )
        chain = Chain(masses, np.sort(velocities)[::-1], e)
        trace = collide(chain, ImpulseCorrelation(uniform(rng, 0, 0.2)))
        tau_2, tau_3 = trace.path_impulses.T
        push = {1: -tau_2, 2: tau_2 - tau_3, 3: tau_3}[equation]
        ball = equation - 1
        change = chain.masses[ball] * (trace.path[:, ball] - chain.velocities[ball])
        np.testing.assert_allclose(change, push, rtol=0, atol=1e-13)
        # A contact can only push: what makes the signs those of Eqs. 1-3.
        assert (np.diff(trace.path_impulses, axis=0) >= 0).all()
        assert trace.impulses[0] > 0


def test_eq_4_kinematic_restitution():
    """For two balls kinematic and energetic restitution agree."""
    rng = np.random.default_rng(4)
    for e in uniform(rng, 0, 1, 50):
        chain = Chain(uniform(rng, 0.1, 10, 2), [uniform(rng, 0, 1), uniform(rng, -1, 0)], e)
        v = collide(chain, ImpulseCorrelation(0)).velocities
        before = chain.velocities[0] - chain.velocities[1]
        assert v[0] - v[1] == pytest.approx(-e * before, rel=0, abs=1e-13)


def both_solvers(ratio):
    """Three equal elastic balls by the independent solver and by the package."""
    yield floats(solve([1, 1, 1], [1, 0, 0], 1, ratio).velocities)
    yield collide(EQUAL, ImpulseCorrelation(ratio)).velocities


def test_eq_5_fused_rest():
    first, rest = elastic(Fraction(1), Fraction(1), Fraction(2), Fraction(0))
    for velocities in both_solvers(0.5):
        np.testing.assert_allclose(velocities, floats((first, rest, rest)), rtol=0, atol=1e-14)
    assert f"({first}, {rest}, {rest})" in CHAPTER.printed("sympy-answers")


def test_eq_6_sequential():
    v1, v2 = elastic(Fraction(1), Fraction(1), Fraction(1), Fraction(0))
    v2, v3 = elastic(Fraction(1), v2, Fraction(1), Fraction(0))
    for velocities in both_solvers(0):
        np.testing.assert_allclose(velocities, floats((v1, v2, v3)), rtol=0, atol=1e-14)
    assert f"({v1}, {v2}, {v3})" in CHAPTER.printed("sympy-answers")


def test_energy_left_by_three_definitions():
    """Of e = 1, equal balls: the closed forms of the figure (test_book_figures.py) by paths."""
    for a in np.linspace(0, 0.499, 12):
        trace = collide(EQUAL, ImpulseCorrelation(a))
        left, right = trace.impulses
        compressed = trace.path_impulses[1 + trace.events.index(("maximum_compression", 1)), 1]
        for pushed, energy in (
            (2 * compressed, (4 + a**2) / (2 - a) ** 2),  # Poisson
            (left / 2, (2 + a**2) / (2 - a) ** 2),  # Newton
            (right, 1),
        ):
            found = (1 - left) ** 2 + (left - pushed) ** 2 + pushed**2
            assert found == pytest.approx(energy, rel=1e-13)
    assert "at a = 1/2: 17/9" in READING.printed("problem-poisson")


def test_exercise_2_heavy_middle():
    for ratio, expected in ((0, (-1 / 3, 2 / 9, 8 / 9)), (1 / 3, (-1 / 2, 1 / 2, 1 / 2))):
        for v in (
            floats(solve([1, 2, 1], [1, 0, 0], 1, ratio).velocities),
            collide(Chain([1, 2, 1], [1, 0, 0], 1), ImpulseCorrelation(ratio)).velocities,
        ):
            np.testing.assert_allclose(v, expected, rtol=0, atol=1e-7)
