"""The textbook against a second reading of its rules, which shares no code with it."""

import decimal
import re
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
import second_reading as second
from chains import FIG_8, changes
from families import family
from problem import Problem

from cradle import Chain, ImpulseCorrelation, collide, paper_chain, textbook
from cradle.tables import paper_sequences

#: Digits of all numbers, and the longest exact run that is compared.
DIGITS, EVENTS, AGREE = 60, 300, Decimal("1e-30")


@pytest.fixture(autouse=True)
def sixty_digits():
    with decimal.localcontext() as context:
        context.prec = DIGITS
        yield


def decimals(problem):
    """A number means what it prints as: ties of the decimals are exact."""
    parts = [[Decimal(repr(x)) for x in part] for part in problem[:5]]
    return Problem(*parts, Decimal(repr(problem.meeting)))


def read(problem):
    """Velocities and changes by the second reading."""
    return decimals(problem).solve(second.second_reading)


def differ(problem):
    """By how much the two differ, of the largest speed; None where the textbook has no end."""
    given = decimals(problem)
    try:
        by_text = given.solve(textbook.solve, number=Decimal, max_events=EVENTS)
    except textbook.EventLimit:
        return None
    velocities, _ = given.solve(second.second_reading)
    speed = max(map(abs, given.velocities)) or 1
    pairs = zip(velocities, by_text.velocities, strict=True)
    return max(abs(a - b) for a, b in pairs) / speed


def no_difference(problems, least):
    """None of the chains differs, and at least so many of them were compared."""
    found = [(differ(problem), problem) for problem in problems]
    compared = [(off, problem) for off, problem in found if off is not None]
    assert len(compared) >= least
    wrong = [f"{off:.2g}: {problem}" for off, problem in compared if off > AGREE]
    assert not wrong, f"{len(wrong)} of {len(compared)} chains:\n" + "\n".join(wrong)


def test_it_shares_no_code_with_the_textbook():
    source = Path(second.__file__).read_text(encoding="utf-8")
    assert re.findall(r"(?m)^ *(?:from|import) (.*)", source) == [
        "decimal import Decimal, getcontext"
    ]


def short(name, count, seed, most=7):
    """Of so many chains of a family those of at most seven balls."""
    return (problem for problem in family(name, count, seed) if len(problem.masses) <= most)


#: Of each family how many chains are drawn, and how many of them are compared at least.
SAMPLE = {
    "ties": (240, 70),
    "ties within bounds": (240, 70),
    "mixed zeros": (160, 25),
    "generic": (90, 50),
}


@pytest.mark.parametrize("name", SAMPLE)
def test_chains_of_a_family(name):
    count, least = SAMPLE[name]
    no_difference(short(name, count, seed=31), least)


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", SAMPLE)
def test_many_chains_of_a_family(name):
    count, least = SAMPLE[name]
    no_difference(short(name, 20 * count, seed=32), 15 * least)


def against_the_package(chain, model, tolerance=1e-13):
    """The second reading's changes; its velocities and changes are those of `collide`."""
    velocities, events = read(Problem.of(chain, model))
    trace = collide(chain, model)
    np.testing.assert_allclose(
        trace.velocities, [float(v) for v in velocities], rtol=0, atol=tolerance
    )
    assert changes(trace.events) == events
    return events


def test_figure_8_sequence():
    model = ImpulseCorrelation((0.1, 0.1), (0.1, 0.1))
    assert against_the_package(Chain([1] * 4, [1, 0.5, 0, 0], 1), model) == FIG_8


@pytest.mark.parametrize("sequence", list(paper_sequences()))
def test_the_ten_sequences(sequence):
    """ABCCA among them, whose contact of balls 4 and 5 is held (R7)."""
    assert against_the_package(*paper_chain(sequence, excess="saturate"))


@pytest.mark.parametrize(
    "problem",
    [
        Problem([1] * 6, [1, 0, 0.5, 0.5, 0, 0], [1] * 5, [0] * 4, [0, 0.1, 1, 0], 0),
        Problem([1] * 7, [1] + [0] * 6, [1] * 6, [1, 1, 1, 0.1, 0], [0, 0, 0, 1, 0], 1),
        Problem([1] * 8, [1] + [0] * 7, [1] * 7, [1, 0, 1, 1, 0, 0], [0, 0, 0, 1, 1, 0], 0),
    ],
)
def test_a_contact_that_waits_pushes_and_ends(problem):
    """R3, R5, R6: chains where it matters are the limit of small ratios."""
    velocities, _ = read(problem)
    small = [[a or 1e-26 for a in way] for way in (problem.forward, problem.backward)]
    limit, _ = read(problem._replace(forward=small[0], backward=small[1]))
    assert max(abs(a - b) for a, b in zip(velocities, limit, strict=True)) < Decimal("1e-24")


def test_it_says_that_an_impact_has_no_end():
    given = decimals(Problem([1] * 3, [1, 0, 0], [0, 0], [0], [0]))
    with pytest.raises(RuntimeError, match="not over after 50 rounds"):
        given.solve(second.second_reading, rounds=50)
