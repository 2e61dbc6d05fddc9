"""Chains that went wrong once, by name; and families of chains like them."""

import math
from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest
from chains import uniform
from delicate import CHAINS, chains_of, seen
from extreme_chains import faults, invariants
from families import FAMILIES, family
from problem import Problem

from cradle import Chain, ImpactNotFinished, ImpulseCorrelation, collide, textbook

#: Chains with one answer, the same by more digits and in floats.
NAMED = chains_of("one answer")
named = pytest.mark.parametrize("name", NAMED)


def exact(problem, digits=50, number=Decimal, max_events=1_000_000):
    """The outcome at fifty digits."""
    with localcontext(prec=digits):
        return problem.exact(max_events, number=number)


def difference(one, other):
    return max(abs(float(Decimal(a) - Decimal(b))) for a, b in zip(one, other))


#: Those that the table asks of fifty digits, but for those of the rules.
EXACT = [
    name
    for name, row in CHAINS.items()
    if math.isfinite(row.velocities) and row.law != "one line of the solver"
]


@pytest.mark.parametrize(("name", "problem"), seen(EXACT))
def test_at_fifty_digits(name, problem):
    row = CHAINS[name.removesuffix(", mirrored")]
    trace, truth = problem.collide(max_events=row.events), exact(problem)
    assert difference(trace.velocities, truth.velocities) < row.velocities
    assert difference(trace.impulses, truth.impulses) < row.impulses
    if row.law == "one answer":
        assert not truth.collapsed
        assert difference(trace.absorbed, truth.absorbed) < 1e-12
        assert trace.collisions.tolist() == truth.collisions
    if row.law == "a collapse":
        assert trace.collapsed
        assert faults(trace, overlap=1e-30) == []
        assert trace.collisions.max() < 1000
    if row.law == "no light ball is thrown":
        assert len(trace.events) < 1000


@named
def test_named_chain_has_one_answer(name):
    """More digits, and the plain rules in doubles, say the same: it is the chain's own."""
    problem = CHAINS[name].problem
    truth = exact(problem)
    assert difference(truth.velocities, exact(problem, 90).velocities) < 1e-40
    assert difference(truth.velocities, problem.solve(textbook.solve).velocities) < 1e-12


@named
def test_named_chain_in_moving_frames(name):
    """Invariance under boosts, where rounding of the boosted input is the only difference."""
    problem = CHAINS[name].problem
    here = problem.collide().velocities
    for speed in (1.0, -0.5):
        there = problem.boosted(speed).collide().velocities
        assert difference(there - speed, here) < 1e-11


def common_velocity(problem):
    """Where all balls end at one velocity, it and the impulses follow from momentum alone."""
    m, v = ([Fraction(x) for x in part] for part in (problem.masses, problem.velocities))
    common = sum(a * b for a, b in zip(m, v)) / sum(m)
    passed = np.cumsum([a * (b - common) for a, b in zip(m, v)])[:-1]
    return float(common), passed.astype(float)


@pytest.mark.parametrize(("name", "problem"), seen(chains_of("many collapses")))
def test_momentum_and_energy_through_many_collapses(name, problem):
    trace = problem.collide()
    collapses = [event.kind for event in trace.events].count("collapse")
    assert collapses > (20 if name == "tiny cycles" else 0)
    assert invariants(trace)["ledger"] < 2
    m, v, w = (
        [Fraction(x) for x in part.tolist()]
        for part in (trace.chain.masses, trace.chain.velocities, trace.velocities)
    )
    passed = [0, *map(Fraction, trace.impulses.tolist()), 0]
    for mass, began, ended, before, after in zip(m, v, w, passed, passed[1:]):
        missing = abs(mass * (ended - began) - (before - after))
        assert missing <= 16 * Fraction(2) ** -52 * (before + after + mass * abs(began))
    if name.startswith(("beside a light ball", "tiny cycles")):
        common, impulses = common_velocity(problem)
        np.testing.assert_allclose(trace.velocities, common, rtol=1e-13)
        np.testing.assert_allclose(trace.impulses, impulses, rtol=1e-9)


def test_corrections_of_rounding_do_work():
    problem = CHAINS["next to nothing left of a light ball"].problem
    trace, truth = problem.collide(), exact(problem)
    assert invariants(trace)["ledger"] < 2
    assert difference(trace.velocities, truth.velocities) < 1e-15
    np.testing.assert_allclose(trace.absorbed, [float(x) for x in truth.absorbed], rtol=1e-9)


def test_balls_equal_but_for_the_last_digit():
    """They collide again, at speeds of a last digit, and end as equal ones do."""
    rng = np.random.default_rng(0)
    equal = Problem([1.0] * 20, [1.0] + [0.0] * 19, [1.0] * 19, [0.3] * 18, [0.3] * 18)
    assert equal.collide().collisions.tolist() == [1] * 19
    for _ in range(5):
        masses = 1 + 1e-15 * uniform(rng, -1, 1, 20)
        row = equal._replace(masses=masses.tolist())
        assert difference(row.collide().velocities, equal.collide().velocities) < 1e-13


def test_no_contact_pulls_where_a_run_arrives_on_both_sides():
    """All balls come to rest, so momentum alone fixes every impulse; the first has next to none."""
    problem = CHAINS["a run that arrives on both sides at the last digit"].problem
    trace = problem.collide()
    assert trace.impulses.min() >= 0
    assert trace.impulses[0] <= 2**-52 * trace.impulses[1]
    assert np.abs(trace.velocities).max() < 1e-16
    passed = np.cumsum(np.multiply(problem.masses, problem.velocities))[:-1]
    np.testing.assert_allclose(trace.impulses, passed, rtol=0, atol=1e-15)


def squeezed(light):
    """Two pairs of heavy balls on a light one: which of them it leaves first is near a tie."""
    return Problem(
        [1, 1, light, 1, 1], [1, -0.5, -1, -0.5, 1], [0.5, 0, 0.9, 0.5], 0.001, [1, 1, 0.001]
    )


def test_masses_of_fifteen_decades_are_solved_and_of_more_refused():
    """Twenty decades apart, heavy balls were wrong by .2 m/s."""
    for light in (1e-13, 1e-14, 1e-15):
        trace, truth = squeezed(light).collide(), exact(squeezed(light))
        assert difference(trace.velocities, truth.velocities) < 1e-15
    with pytest.raises(ValueError, match=r"^masses\[2\] = 9e-16; .* at least 1e-15 of the"):
        squeezed(9e-16).collide()
    with pytest.raises(ValueError, match=r"^masses\[1\] = 1e-26; "):
        collide(Chain([1e-8, 1e-26, 1e-9, 1], [0, 1, 0, 0], [0, 1, 1]), ImpulseCorrelation(0.3))


#: Chains of a family.  Products of tiny ratios take tens of milliseconds each, over decimals.
COUNT, FEWER = 400, {"tiny ratios": 20}


def finished(name, count, seed):
    """Problems of a family with their traces; nearly all must finish."""
    found = []
    for problem in family(name, count, seed):
        try:
            found.append((problem, problem.collide(max_events=50_000)))
        except ImpactNotFinished:
            continue
    assert len(found) > 0.9 * count
    return found


@pytest.mark.parametrize("name", FAMILIES)
def test_invariants(name):
    for problem, trace in finished(name, FEWER.get(name, COUNT), seed=1):
        assert faults(trace, overlap=1e-30) == [], problem


@pytest.mark.parametrize("name", ["ties", "ties within bounds"])
def test_boosts_by_exact_speeds(name):
    for problem, trace in finished(name, COUNT // 2, seed=3):
        boosted = problem.boosted(1.5).collide(max_events=100_000)
        assert difference(boosted.velocities - 1.5, trace.velocities) < 1e-8, problem
