"""The package before the judge: the rules over decimals of 100 digits; and the judge himself."""

import csv
import decimal
import sys
from decimal import Decimal
from pathlib import Path

import judge as court
import pytest
from delicate import CHAINS, chains_of
from families import JUDGED, family
from judge import Verdict, exact, judge, meaning, off, on_bounds, second_opinion, shrunk
from problem import Problem

# --- the package -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", chains_of("the judge"))
def test_named_chain(name):
    """The outcome of `collide` and of the batch; both passed the certificate when wrong."""
    assert judge(CHAINS[name].problem).word == "right"


STORED = Path(__file__).parents[1] / "data" / "judge.csv"
#: Chains of each family in the tests: as many as some seconds allow.
SAMPLE = {
    "losses": 250, "wide": 150, "generic": 400, "at bounds": 300, "extremes": 80, "ties": 120,
    "ties within bounds": 120, "tiny ratios": 15, "mixed zeros": 120, "light balls": 120,
}  # fmt: skip
#: Begins with fifty chains of "losses" of which one was wrong by .1 when first judged.
SEED = 2026007778
REFUTED = ("wrong", "other reading")


def no_wrong_chain(name, count, seed, **options):
    """All of so many chains of a family whose exact run ends are right, and these are most."""
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
    no_wrong_chain(name, 25 * SAMPLE[name], seed=31)


def test_no_family_is_left_out():
    assert list(SAMPLE) == list(JUDGED)


def test_the_stored_run():
    """Of many chains of every family none was wrong, and most had an exact run with an end."""
    with STORED.open(encoding="utf-8") as file:
        rows = {row.pop("family"): row for row in csv.DictReader(file)}
    assert list(rows) == list(JUDGED)
    for name, row in rows.items():
        assert list(row) == list(court.WORDS)
        assert sum(map(int, row.values())) >= 1000, name
        if name != "tiny ratios":  # products of two of these are below the last of 32 digits
            assert row["wrong"] == row["other reading"] == "0", name
        assert int(row["right"]) > 600, name


# --- the judge ---------------------------------------------------------------------------------


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
    right = exact(CHAINS["a rounding ended an idle contact"].problem)
    printed = [-0.38197548, -0.27627427, -0.03074706, 0.12760094, 0.13425148, 0.13759522]
    assert max(abs(float(v) - w) for v, w in zip(right, printed, strict=True)) < 5.1e-9


#: Two contacts that close on the third ball: in decimals both closed at .1 m/s, in doubles not.
TIE = Problem([1.0] * 5, [1.0, 0.1, 0.2, 0.3, -1.0], [1.0] * 4, [0.1] * 3, [0.1] * 3)


def answering(by=0.0, read=meaning):
    """Somebody who is off by so much, or reads the inputs in this way."""
    return lambda problem: [float(v) + by for v in exact(problem, read)]


def test_it_can_say_no():
    assert judge(TIE, answering()).word == judge(TIE, answering(9e-10)).word == "right"
    assert judge(TIE, answering(), answering(2e-9)).word == "wrong"
    assert judge(TIE, answering(), lambda _: None).word == "unfinished"
    assert judge(TIE, answering(read=Decimal)).word == "other reading"
    beside = Problem([1.0, 3.0, 4.0], [1.0, 0.0, 0.0], [1.0, 1.0], [4 / 7], [0.0])
    assert exact(beside) != exact(on_bounds(beside))
    assert judge(beside, lambda _: exact(on_bounds(beside))).word == "right"


@pytest.mark.parametrize("name", ["losses", "wide", "at bounds", "ties"])
def test_twice_the_digits_say_the_same(name):
    """No decision is left to the last digits; an infinite sequence may take longer to fade."""
    compared = 0
    for problem in family(name, 15, seed=32):
        one, other = exact(problem), exact(problem, twice=True)
        if one and other:
            assert off(problem, one, other) < 1e-55, problem
            compared += 1
    assert compared > 10


def test_a_gap_that_closes_at_once():
    """It lay at zero: no rounding is absorbed by contact 2 of e = 0, which would end it."""
    problem = Problem(
        [0.1, 1.0, 0.053, 0.053, 0.166, 0.166, 1.0],
        [1.0, 0.0, 0.5, -0.5, 0.5, -0.5, 0.0],
        [1.0, 1.0, 0.0, 1.0, 1.0, 0.0],
        [0.2955870108243131, 0.3084507042253521, 0.3789954337899544, 0.0, 0.25],
        [0.0, 0.25, 0.2857142857142857, 0.15445462114904246, 0.27092262576133547],
        meeting=0.0,
    )
    assert off(problem, exact(problem), exact(problem, twice=True)) < 1e-60


def test_relations():
    """The exact outcome of a single striker seen from elsewhere."""
    for problem in family("generic", 20, seed=33):
        at_rest = [0.0] * (len(problem.masses) - 1)
        single = problem._replace(velocities=[1.0, *at_rest], meeting=0.25)
        if here := exact(single, Decimal):
            there = exact(single.mirrored(), Decimal)
            other = exact(single.in_units(0.25, 2.0).boosted(1.0), Decimal)
            with decimal.localcontext(prec=100):
                assert off(single, here, [-v for v in reversed(there)]) < 1e-60
                assert off(single, here, [(v - 1) / 2 for v in other]) < 1e-60


def test_a_sequence_without_end():
    """Two balls press a light one; and a light ball that goes to and fro some thousand times."""
    pressed = Problem([1.0, 0.04, 1.0], [1.0, 0.0, 0.0], [0.5, 0.5], [0.15], [0.15])
    assert judge(pressed).word == "endless"
    assert second_opinion(pressed).word == "as 50 digits"
    long = Problem([1.0, 1e-7, 1.0], [1.0, 0.0, 0.0], [1.0, 1.0], [0.0], [0.0])
    assert judge(long).word == "endless"
    assert second_opinion(long).word == "as relations"


def test_wrong_chains_are_shrunk():
    """To the least that shows the fault: here, a loss beside a heavy ball."""

    def is_wrong(problem):
        pairs = zip(problem.masses[1:], problem.restitution)
        return any(m > 2 and e < 1 for m, e in pairs)

    problem = next(p for p in family("wide", 100, seed=34) if len(p.masses) > 6 and is_wrong(p))
    small = shrunk(problem, is_wrong)
    assert len(small.masses) == 2
    assert small.velocities == [0.0] * 2
    assert small.forward == small.backward == []


def test_command(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["judge.py", "--family", "generic", "--count", "60"])
    court.main()
    head, row = capsys.readouterr().out.splitlines()[:2]
    assert head.split()[:2] == ["right", "wrong"]
    assert sum(map(int, row.split()[1:])) == 60


def test_verdicts_are_those_of_the_table():
    assert Verdict("right").word in court.WORDS
    assert set(court.DOUBTFUL) <= set(court.WORDS)
