"""The package before the judge: the rules over decimals of 100 digits; and the judge himself."""

from decimal import Decimal

import judge as court
import pytest
from delicate import CHAINS, chains_of
from families import JUDGED, family
from judge import batch, exact, judge, meaning, off, on_bounds, second_opinion, shrunk
from problem import Problem
from stored import numbers

from cradle import outcomes
from cradle.closed_form import largest_ratios
from cradle.runtime import exact as package


@pytest.mark.parametrize("name", chains_of("the judge"))
def test_named_chain(name):
    """The outcome of `collide` and of the batch; both passed the certificate when wrong."""
    assert judge(CHAINS[name].problem).word == "right"


@pytest.mark.parametrize("name", chains_of("products of tiny ratios"))
def test_a_tie_decided_by_products_of_tiny_ratios(name):
    """Beyond 32 digits: the textbook decides it, in decimals; the loop alone would be wrong."""
    problem = CHAINS[name].problem
    right = exact(on_bounds(problem)).velocities
    for found in (problem.collide(), problem.solve(outcomes, excess="saturate")):
        assert off(problem, found.velocities.tolist(), right) <= court.WRONG
        assert found.margin == 0.0
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(package, "answer", lambda *_: False)
        loop = [ask(problem) for ask in (batch, court.single)]
    assert None in loop or max(off(problem, one, right) for one in loop) > court.WRONG
    clear = [[1e-4 if x == 1e-20 else x for x in side] for side in problem[3:5]]
    clear = problem._replace(forward=clear[0], backward=clear[1])
    assert judge(clear).word == "right"
    assert clear.collide().margin > 0.0


def test_an_outcome_that_hangs_on_when_a_chatter_ends_is_told_by_the_margin():
    problem = CHAINS["an outcome that hangs on when a chatter ends"].problem
    assert off(problem, problem.collide().velocities.tolist(), exact(problem).velocities) > 1e-3
    assert problem.collide().margin == 0.0


#: Chains of each family in the tests: as many as some seconds allow.
SAMPLE = {
    "losses": 125, "wide": 75, "generic": 200, "at bounds": 150, "extremes": 40, "ties": 60,
    "ties within bounds": 60, "tiny ratios": 10, "mixed zeros": 60, "light balls": 60,
    "small ratios": 10,
}  # fmt: skip
#: Begins with fifty chains of "losses" of which one was wrong by .1 when first judged.
SEED = 2026007778
REFUTED = ("wrong", "other reading")


def no_wrong_chain(name, count, seed, **options):
    """Of so many chains of a family none is wrong, and most are right."""
    verdicts = [(judge(problem, **options), problem) for problem in family(name, count, seed)]
    wrong = [f"{verdict}: {problem}" for verdict, problem in verdicts if verdict.word in REFUTED]
    right = sum(verdict.word == "right" for verdict, _ in verdicts)
    assert not wrong, f"{len(wrong)} of {count} chains:\n" + "\n".join(wrong)
    assert right > 0.6 * count


@pytest.mark.parametrize("name", SAMPLE)
def test_sample_of_a_family(name):
    no_wrong_chain(name, SAMPLE[name], seed=SEED, events=200)


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", JUDGED)
def test_many_of_a_family(name):
    no_wrong_chain(name, 50 * SAMPLE[name], seed=31)


def test_no_family_is_left_out():
    assert list(SAMPLE) == list(JUDGED)


def stored(run, words):
    """Counts of a stored run, in the order of its families."""
    rows = numbers(run, "family")
    assert [row.pop("family") for row in rows] == list(JUDGED)
    assert all(list(row) == words for row in rows)
    return rows


def test_the_stored_run_of_short_chains():
    """A million chains end within a hundred events, of every family: all answers are right."""
    rows = stored("judge_short.csv", [*court.ENDS, court.LEFT_OUT])
    right = [row["right"] for row in rows]
    assert sum(right) > 1_000_000
    assert min(right) > 1500
    assert [row[word] for row in rows for word in court.ENDS[1:]] == [0] * 4 * len(JUDGED)


def test_the_stored_run():
    """Of many chains of every family none was wrong, and most had an exact run with an end."""
    for name, row in zip(JUDGED, stored("judge.csv", court.WORDS), strict=True):
        assert sum(row.values()) >= 7000, name
        assert row["other reading"] == row["wrong"] == 0, name
        assert row["open"] <= 1, name
        assert row["right"] > 4200, name


@pytest.mark.parametrize(
    ("x", "means"),
    [
        (0.9, "0.9"), (-0.053, "-0.053"), (1, "1"), (1e-7, "1e-7"), (0.0, "0"), (-0.0, "0"),
        (0.123456789012345, "0.123456789012345"), (999999999999999.0, "999999999999999"),
        (1e14, "1e14"), (1 / 3, None), (0.1 + 0.2, None), (1e-20, None), (9.9e-8, None),
        (1e15, None), (1e300, None), (0.1234567890123456, None),
    ],
)  # fmt: skip
def test_meaning_of_a_float(x, means):
    """What it prints as, up to 15 digits from 1e-7 to 1e15; else its exact value."""
    assert meaning(x) == Decimal(x if means is None else means)


def test_velocities_that_other_codes_gave():
    """Three programs that share no line agreed on the first of the named chains."""
    right = exact(CHAINS["a rounding ended an idle contact"].problem).velocities
    printed = [-0.38197548, -0.27627427, -0.03074706, 0.12760094, 0.13425148, 0.13759522]
    assert max(abs(float(v) - w) for v, w in zip(right, printed, strict=True)) < 5.1e-9


TIE = CHAINS["two contacts that close on one ball at once in decimals"].problem


def answering(by=0.0, read=meaning):
    """Somebody who is off by so much, or reads the inputs in this way."""
    return lambda problem: [float(v) + by for v in exact(problem, read).velocities]


def test_it_can_say_no():
    assert judge(TIE, answering()).word == judge(TIE, answering(9e-10)).word == "right"
    assert judge(TIE, answering(), answering(2e-9)).word == "wrong"
    assert judge(TIE, answering(), lambda _: None).word == "unfinished"
    assert judge(TIE, answering(read=Decimal)).word == "other reading"
    beside = CHAINS["a ratio on a bound that is no float"].problem
    bound = exact(on_bounds(beside)).velocities
    assert exact(beside).velocities != bound
    assert judge(beside, lambda _: bound).word == "right"


def test_a_bound_is_meant_as_floats_draw_it():
    problem = CHAINS["a bound as floats draw it"].problem
    m, _, _, forward, backward, _ = problem
    assert largest_ratios(m, forward, backward)[0][:3].tolist() == forward[:3]
    as_it_is = [float(v) for v in exact(problem).velocities]
    assert off(problem, as_it_is, batch(problem)) > 5e-9
    assert judge(problem).word == "right"
    assert judge(problem, lambda _: as_it_is).word == "other reading"


def test_a_bound_is_drawn_from_the_ratio_given_beyond():
    """All balls but the first then part as one body: 1 kg strikes 11.5 kg."""
    problem = CHAINS["ratios between four roundings and five from their bound"].problem
    assert judge(problem, answering(2e-9)).word == "wrong"
    assert batch(problem) == pytest.approx([-0.84, *[0.16] * 5], rel=1e-14)


def test_a_bound_counts_on_what_is_in_force_beyond():
    """Ball 3's ratio is above its bound, 1/2, and held there; with it ball 2's bound is 2/3."""
    problem = CHAINS["a bound that follows from a ratio above its own"].problem
    assert judge(problem).word == "right"
    as_it_stands = [float(v) for v in exact(problem).velocities]
    assert judge(problem, lambda _: as_it_stands).word == "other reading"


@pytest.mark.parametrize("name", chains_of("a bound in force"))
def test_a_bound_is_meant_whenever_it_comes_into_force(name):
    problem = CHAINS[name].problem
    assert judge(problem).word == "right"
    fixed = exact(on_bounds(problem)).velocities
    assert off(problem, batch(problem), fixed) > court.WRONG
    assert judge(problem, answering(2e-9)).word == "wrong"


def test_a_wrong_chain_is_shrunk():
    """To what an answer is wrong for: here two light balls beside each other."""
    long = Problem([1.0, 3.0, 0.3, 0.3, 1.0], [1.0, 0, 0, 0.5, 0], [0.9] * 4, [0.1] * 3, [0.1] * 3)

    def wrong(problem):
        return answering(0.1 * (problem.masses[-3:-1] == [0.3, 0.3]))(problem)

    least = shrunk(long, "wrong", wrong)
    assert least == Problem([0.3, 0.3, 1.0], [0.0] * 3, [1.0, 1.0], [0.0], [0.0])


def test_a_gap_that_closes_at_once():
    problem = CHAINS["a gap that closes at once"].problem
    one, other = exact(problem), exact(problem, twice=True)
    assert off(problem, one.velocities, other.velocities) < 1e-60


def test_a_sequence_without_end():
    """Two balls press a light one; and a light ball that goes to and fro some thousand times."""
    pressed = CHAINS["two balls press a light one"].problem
    assert judge(pressed).word == "endless"
    assert second_opinion(pressed).word == "as 50 digits"
    long = Problem([1.0, 1e-7, 1.0], [1.0, 0.0, 0.0], [1.0, 1.0], [0.0], [0.0])
    assert judge(long).word == "endless"
    assert second_opinion(long).word == "as relations"


def test_a_run_that_ends_where_its_digits_do():
    problem = CHAINS["a run that ends where its digits do"].problem
    assert off(problem, batch(problem), exact(on_bounds(problem)).velocities) > 0.1
    assert judge(problem).word == "endless"
    assert second_opinion(problem).word == "as 50 digits"
