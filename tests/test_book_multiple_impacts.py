"""The chapter on repeated collisions: Eqs. 35-42 and Fig. 5, each by a second route."""

import re
from itertools import pairwise

import mpmath
import numpy as np
import pytest
import truth
from chains import changes
from chapters import Chapter

from cradle import Chain, ImpulseCorrelation, collide

SEQUENCE = [("end", 0), ("close", 0), ("end", 1), ("close", 1), ("end", 0), ("end", 1)]
VELOCITIES = (1, "0.8", 0)
CHAPTER, READING = Chapter("multiple_impacts"), Chapter("reading_multiple_impacts")
# The chapter's example and others with the same sequence: masses, e2, e3, forward, backward.
EXAMPLES = [
    ((1, 1, 1), "0.25", "0.25", "0.15", "0.15"),
    ((1, 1, 1), "0.2", "0.2", "0.1", "0.1"),
    ((1, 1, 1), "0.25", "0.35", "0.08", "0.02"),
    ((2, "1.5", "1.7"), "0.25", "0.3", "0.05", "0.1"),
]


def solved(masses, e2, e3, forward, backward):
    """The reference solver's outcome at fifty digits, and the package's trace."""
    with mpmath.workdps(50):
        exact = truth.solve(masses, VELOCITIES, [e2, e3], [forward], [backward])
    chain = Chain([float(m) for m in masses], [1, 0.8, 0], [float(e2), float(e3)])
    return exact, collide(chain, ImpulseCorrelation([float(forward)], [float(backward)]))


@pytest.mark.parametrize("example", EXAMPLES)
def test_fig_5_path_and_sequence(example):
    exact, trace = solved(*example)
    assert changes(trace.events) == SEQUENCE
    assert [tuple(event) for event in trace.events] == exact.events
    np.testing.assert_allclose(trace.path, np.array(exact.path, float), atol=1e-14)
    np.testing.assert_allclose(
        trace.path_impulses, np.array(exact.path_impulses, float), atol=1e-14
    )


def ends_and_closings(exact):
    return [k for k, (kind, _) in enumerate(exact.events, 1) if kind != "maximum_compression"]


def pieces(example):
    """The six pieces of the path between changes: velocities and impulses at both ends."""
    exact, trace = solved(*example)
    stops = [0, *ends_and_closings(exact)]
    states = np.hstack([trace.path, trace.path_impulses])
    return dict(zip("ABCDEF", pairwise(states[stops])))


@pytest.mark.parametrize("example", EXAMPLES)
def test_eqs_35_to_38_slope_of_every_piece(example):
    (m1, m2, m3), _, _, a, b = [
        tuple(map(float, x)) if isinstance(x, tuple) else float(x) for x in example
    ]
    over_tau_2 = {"A": 1 - a, "C": 1 - 1 / b, "D": 1, "E": 1 - a}
    over_tau_3 = {"A": 1 / a - 1, "B": -1, "C": b - 1, "E": 1 / a - 1, "F": -1}
    for piece, (start, end) in pieces(example).items():
        dv1, dv2, dv3, d2, d3 = end - start
        assert dv1 == pytest.approx(-d2 / m1, abs=1e-14)  # Eq. 35
        assert dv3 == pytest.approx(d3 / m3, abs=1e-14)  # Eq. 38
        if piece in over_tau_2:  # Eq. 36
            assert dv2 == pytest.approx(over_tau_2[piece] * d2 / m2, abs=1e-14)
        else:
            assert d2 == 0
        if piece in over_tau_3:  # Eq. 37
            assert dv2 == pytest.approx(over_tau_3[piece] * d3 / m2, abs=1e-14)
        else:
            assert d3 == 0


def test_eq_36_fourth_line_needs_its_factor():
    # As printed (slope 1/m2) momentum is missing; the amount is the one the chapter prints.
    for example in EXAMPLES:
        start, end = pieces(example)["E"]
        m2, a = float(example[0][1]), float(example[3])
        too_fast = start[1] + (end[3] - start[3]) / m2 - end[1]
        assert too_fast == pytest.approx(a * (end[3] - start[3]) / m2, rel=1e-9)
        assert too_fast > 1e-3
        if example is EXAMPLES[0]:
            text = READING.printed("multiple-functions")
            stored = re.search(r"momentum missing .*: ([\d.]+)", text)
            assert float(stored[1]) == pytest.approx(m2 * too_fast, abs=6e-6)


@pytest.mark.parametrize("example", EXAMPLES)
def test_eqs_39_to_42_energy_balance_of_every_collision(example):
    _, trace = solved(*example)
    u = -np.diff(trace.path, axis=1)
    middle = (u[1:] + u[:-1]) / 2 * np.diff(trace.path_impulses, axis=0)  # exact: u is straight
    kinds = [tuple(event) for event in trace.events]
    for c, e in ((0, float(example[1])), (1, float(example[2]))):
        rows = [k for k, event in enumerate(kinds, 1) if event == ("end", c)]
        tops = [k for k, event in enumerate(kinds, 1) if event == ("maximum_compression", c)]
        assert len(rows) == len(tops) == 2
        for start, top, end in zip([0, rows[0]], tops, rows):  # Eqs. 39, 41 and 40, 42
            absorbed, released = middle[start:top, c].sum(), middle[top:end, c].sum()
            assert absorbed > 1e-6
            assert e**2 * absorbed + released == pytest.approx(0, abs=1e-15)


def sequence_occurs(e, ratio):
    outcome = truth.solve((1, 1, 1), VELOCITIES, e, ratio, number=float)
    kinds = outcome.events
    here = changes(kinds) == SEQUENCE
    between = kinds[kinds.index(("end", 1)) : kinds.index(("close", 1))] if here else []
    return here, ("maximum_compression", 0) in between


def test_fig_5_region_of_the_sequence():
    edges = re.search(r"([\d.]+) < e < ([\d.]+)", CHAPTER.printed("edges"))
    lower, upper = map(float, edges.groups())
    text = READING.printed("multiple-other-part")
    found = re.search(r"order of the print.*: ([\d.]+) ([\d.]+)", text)
    split, top = map(float, found.groups())
    assert top == upper
    step = 1e-4  # the last digit printed
    for e, occurs in (
        (lower + step, (True, False)), (split - step, (True, False)),
        (split + step, (True, True)), (upper - step, (True, True)),
    ):  # fmt: skip
        assert sequence_occurs(e, 0.15) == occurs
    for e in (lower - step, upper + step):
        assert not sequence_occurs(e, 0.15)[0]
    end = float(READING.glued["multiple-backward-end"])
    for backward, occurs in ((end - 0.001, True), (end + 0.001, False)):
        outcome = truth.solve((1, 1, 1), VELOCITIES, 0.25, 0.15, backward, number=float)
        assert (changes(outcome.events) == SEQUENCE) == occurs


def test_fig_5_middle_ball_turns_round():
    # The text says that v2 continues to fall after the first end and to rise after the second; and
    # that the process ends because v2 < v1.
    path = pieces(EXAMPLES[0])
    change = {piece: end[1] - start[1] for piece, (start, end) in path.items()}
    assert change["A"] > 0 > change["B"]
    assert change["C"] < 0 < change["D"]
    v1, v2, v3 = path["F"][1][:3]
    assert v1 < v2 < v3


def test_exercises():
    """The lead of ball 2, the energy lost, and its four parts, from the reference solver's path."""
    exact, _ = solved(*EXAMPLES[0])
    path, impulses = np.array(exact.path, float), np.array(exact.path_impulses, float)
    first, second, *_ = ends_and_closings(exact)
    lost = 500 * (path[0] @ path[0] - path[-1] @ path[-1])  # mJ
    early, late = impulses[[first, second], 1]
    told = {"lead": late - early, "tau3-1": early, "tau3-2": late, "loss": lost}
    behind = truth.solve((1, 1, 1), (0, "-0.8", -1), "0.25", "0.15")
    assert (sum(exact.collisions), sum(behind.collisions)) == (4, 3)
    told |= {"front": "four", "front-v2": float(exact.velocities[1])}
    told |= {"behind": "three", "behind-v2": -float(behind.velocities[1])}
    CHAPTER.tells({f"multiple-{name}": value for name, value in told.items()})
    works = [float(x) for x in re.findall(r"[\d.]+", CHAPTER.glued["multiple-works"])]
    assert (1 - 0.25**2) * sum(works) == pytest.approx(lost, abs=0.02)
    # Two balls alone and a straight line: contact 1-2 absorbs half of 0.2 m/s times its impulse.
    assert works[0] == pytest.approx(100 * impulses[1, 0], abs=6e-3)
