"""The textbook's rules by themselves, against the package, and against a march by small steps."""

import ast
import functools
import math
import random
from decimal import Decimal, localcontext
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest
from chains import local_orders
from march import march
from problem import Problem
from truth import EventLimit, Impact, meaning, solve

from cradle import textbook
from cradle.closed_form import largest_ratios

SOURCE = Path(textbook.__file__).read_text(encoding="utf-8")


@pytest.fixture(autouse=True)
def fifty_digits():
    with mpmath.workdps(50):
        yield


def test_it_is_short_and_every_rule_has_its_place():
    """A newcomer reads it at one sitting: 250 lines, no function above 25, few parameters."""
    assert len(SOURCE.splitlines()) <= 250
    functions = [n for n in ast.walk(ast.parse(SOURCE)) if isinstance(n, ast.FunctionDef)]
    for node in functions:
        assert node.end_lineno - node.lineno < 25, node.name
        assert len(node.args.args) <= 6 or node.name == "solve", node.name
    docs = " ".join(ast.get_docstring(node) or "" for node in functions)
    for rule in ["R1", "R2", "R3", "R4", "R5", "R6", "R7", *(f"R8.{k}" for k in range(1, 7))]:
        assert rule in docs, rule


def test_a_scalar_stands_for_all_and_a_string_for_a_decimal():
    in_digits = functools.partial(textbook.solve, number=mpmath.mpf)
    tenth, third = mpmath.mpf(1) / 10, mpmath.mpf(3) / 10
    one = in_digits([1, 2, 1], ["0.3", 0, 0], "0.1", "0.1").velocities
    assert one == in_digits([1, 2, 1], [third, 0, 0], [tenth] * 2, [tenth], [tenth]).velocities
    assert one != in_digits([1, 2, 1], [0.3, 0, 0], 0.1, 0.1).velocities


def generic(seed, n, bounded=True, light=0.3):
    """A chain without ties: nothing decided by rounding; ratios two parts in a hundred off bounds.

    At a bound, the speed that an ulp of the ratio releases is of the order of its square root.
    """
    rng = random.Random(seed)
    masses = [(light + (2 - light) * rng.random()) * rng.choice([1, 2]) for _ in range(n)]
    if rng.random() < 0.7:
        velocities = [2 * rng.random() - 1 for _ in range(n)]
    else:
        velocities = [1.0] + [0.0] * (n - 1)
    restitution = [(0.05 + (0.95 - 0.05) * rng.random()) for _ in range(n - 1)]
    forward, backward = ([0.02 + 0.96 * rng.random() for _ in range(n - 2)] for _ in range(2))
    if bounded:
        for k in reversed(range(n - 2)):  # Eq. 53 needs the next ratio
            forward[k] *= largest_ratios(masses, forward, backward)[0][k]
        for k in range(n - 2):
            backward[k] *= largest_ratios(masses, forward, backward)[1][k]
    meeting = rng.choice([0.5, 0.5, 0.0, 1.0, rng.random()])
    return (masses, velocities, restitution, forward, backward), meeting


@functools.cache
def compared(n, bounded):
    """Generic chains that end soon, with what the package and the textbook make of them."""
    found = []
    for seed in range(150):
        chain, meeting = generic((n, seed).__hash__(), n, bounded)
        try:
            plain = textbook.solve(*chain, meeting=meeting, max_events=40)
        except EventLimit:
            continue
        trace = Problem(*chain, meeting).collide()
        if not trace.collapsed and len(plain.events) < 60:
            found.append((chain, trace, plain))
    assert len(found) > 60
    return found


@pytest.mark.parametrize("n", [2, 3, 4, 5, 6])
@pytest.mark.parametrize("bounded", [True, False], ids=["within bounds", "saturated"])
def test_generic_chains_in_every_event(n, bounded):
    held = 0
    for chain, trace, plain in compared(n, bounded):
        assert local_orders(trace.events, n - 1) == local_orders(plain.events, n - 1), chain
        np.testing.assert_allclose(trace.velocities, plain.velocities, rtol=0, atol=1e-13)
        np.testing.assert_allclose(trace.impulses, plain.impulses, rtol=0, atol=4e-13)
        np.testing.assert_allclose(trace.absorbed, plain.absorbed, rtol=0, atol=4e-13)
        assert trace.collisions.tolist() == plain.collisions
        assert trace.saturated == tuple(sorted(plain.held))
        held += bool(plain.held)
    assert held > 10 or bounded or n == 2


@pytest.mark.parametrize(
    ("number", "tie"), [(float, 1e-11), (mpmath.mpf, 1e-33), (Decimal, "1e-19"), (Fraction, 0)]
)
@pytest.mark.parametrize(("side", "first"), [(0, 1), (1, 1), (-1, 1), (1e4, 1), (-1e4, 2)])
def test_double_closing_within_the_tie(number, tie, side, first):
    """R8.6: of two contacts on one ball the nearer closes; at a tie, whatever number, the left."""
    nudge = number(tie) * number(side) if tie else number(side) / 10**40
    if number is Fraction and side == -1:
        first = 2  # the least there is: exact numbers tie when they are equal
    velocities = [1, number("-0.1"), 0, number("0.1") + nudge, -1]
    outcome = textbook.solve([1] * 5, velocities, 1, "0.1", number=number)
    assert outcome.events[:2] == [("close", first), ("close", 3 - first)]


def test_nearness_is_that_of_the_last_segments():
    """R8.6: contacts 2 and 3 close on one ball; |u| counts where the round starts, not before."""
    outcome = textbook.solve([1] * 6, [1, "-0.1", "-0.1", 1, "0.2", "-0.5"], "0.9", "0.1")
    assert outcome.events[2:7] == [
        *(("end", 0), ("end", 3), ("maximum_compression", 4)),
        *(("close", 2), ("close", 3)),
    ]
    first, before = outcome.path[0], outcome.path[4]
    assert first[3] - first[4] < first[3] - first[2]  # contact 3 was the nearer one
    assert before[4] - before[3] > 3 * (before[3] - before[2]) > 0


def test_ties_do_not_depend_on_the_digits():
    """What coincides in decimal numbers coincides in all: rounding decides no event."""
    n = 13
    velocities = [1, 0.5, -0.5, 1, 1, 0.5, 0, 0.5, 1, 0, 1, 0.5, 0]
    given = ["0.053"] * n, velocities, "0.9", "0.1", ["0", "0.1"] * 5 + ["0"]
    outcomes = [textbook.solve(*given, meeting=0)]
    for digits in (20, 40, 60):
        with mpmath.workdps(digits):
            outcomes.append(textbook.solve(*given, meeting=0, number=mpmath.mpf))
    for one in outcomes[:-1]:
        assert one.events == outcomes[-1].events
        error = max(abs(float(v - w)) for v, w in zip(one.velocities, outcomes[-1].velocities))
        assert error < 1e-12


CHATTER = ([2, "0.1", "0.2", 5], [1, "0.5", 0, 0], [0, "0.5", 0], ["0.8", "0.1"], ["0.8", 1])


def test_threshold_is_a_limit():
    """Ten digits less in the threshold move the outcome by no more than the threshold."""

    class Near(Impact):
        def collapse_below(self):
            return Decimal("1e-20")

    with localcontext(prec=50):
        near, far = (solve(*CHATTER, number=Decimal, impact=one) for one in (Near, Impact))
    assert len(near.events) < len(far.events)
    assert max(abs(a - b) for a, b in zip(near.velocities, far.velocities)) < 1e-19


def test_a_run_whose_ball_does_not_move_goes_no_way_to_a_meeting():
    """Light balls are fast: what rounding left of that way was divided by zero."""
    chain = [1, 1e-6, 1e-6, 1, 1], [1, 0, 0, 0, 0], [0.99, 1, 1, 0.9], [0.1, 0, 0.1], [0.1, 0.1, 0]
    with pytest.raises(textbook.EventLimit):  # it goes on without end
        textbook.solve(*chain, number=meaning, max_events=300)


def test_event_limit_reports_what_was_reached():
    with pytest.raises(EventLimit, match="max_events = 100") as caught:
        textbook.solve([1, 1e-6, 1], [1, 0, 0], 1, 0, max_events=100)
    state = caught.value.args[1]
    assert len(state.events) > 90
    assert sum(m * v for m, v in zip([1, 1e-6, 1], state.velocities)) == pytest.approx(1, rel=1e-12)


STEPS = (200, 800, 3200)


def marched(kind):
    """Generic chains of a kind: so many balls, or with something that must happen in them."""
    found, seed = [], 0
    while len(found) < 16:
        seed += 1
        n = kind if isinstance(kind, int) else 3 + seed % 4
        chain, meeting = generic(seed, n, bounded=kind != "held")
        try:
            plain = solve(*chain, meeting=meeting, max_events=40, number=float)
        except EventLimit:
            continue
        # The march has no rule R9, and needs a step far smaller than the last of many collisions.
        if plain.collapsed or not 1 < len(plain.events) < 40:
            continue
        if (
            isinstance(kind, int)
            or (kind == "two runs meet" and plain.meetings)
            or (kind == "held" and plain.held)
            or (kind == "close many times" and max(plain.collisions) >= 4)
        ):
            found.append((chain, meeting, plain.velocities))
    return found


@pytest.mark.parametrize("kind", [3, 6, "two runs meet", "held", "close many times"])
def test_march_converges_to_the_textbook_at_first_order(kind):
    """The mean over chains: the error of one chain depends on where its steps fall."""
    chains = marched(kind)
    errors = [
        np.mean([
            abs(march(*chain, meeting=meeting, steps=k).velocities - v).max()
            for chain, meeting, v in chains
        ])
        for k in STEPS
    ]  # fmt: skip
    order = -np.polyfit(np.log(STEPS), np.log(errors), 1)[0]
    assert 0.8 < order < 1.2
    assert errors[-1] < 4e-4


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
    found = textbook.solve([m, 1, 1, m], [1, -d, d, -1], 1, a)
    np.testing.assert_allclose(found.velocities, [x, y, -y, -x], rtol=0, atol=1e-15)
    assert found.collisions == march((m, 1, 1, m), (1, -d, d, -1), 1, a).collisions == [1, 1, 1]
