"""The script of the live explorer against the package, to the last bit: V8 inside pytest."""

import json
import math
import re

import pytest
from families import FAMILIES, Draw, family, within_bounds
from problem import Problem
from script import Script, bits

from cradle import Chain, ImpactNotFinished, ImpulseCorrelation, collide
from cradle.closed_form import largest_ratios
from cradle.kernel.state import ORDER
from cradle.runtime import exact
from cradle.runtime import job as drive
from cradle.trace import ImpactNotCertified

import explorer_engine  # isort: skip  (found by way of `script`)


@pytest.fixture(scope="module")
def source():
    return explorer_engine.engine()


@pytest.fixture(scope="module")
def script(source):
    script = Script(source)
    yield script
    script.context.close()


def asked(problem, **options):
    names = "masses", "velocities", "restitution", "forward", "backward", "meeting"
    return {name: getattr(problem, name) for name in names} | options


def expected(problem, **options):
    """How the package answers: status, and a trace or what the answer would have broken."""
    try:
        return "finished", problem.collide(**options)
    except ImpactNotFinished as stopped:
        return "unfinished", stopped.trace
    except ImpactNotCertified as refused:
        return "unsound", refused.defect


def check(answer, status, trace):
    """Every field of an outcome."""
    assert answer["status"] == status
    if status == "unsound":
        assert answer == {"status": status, "defect": trace}
        return
    for name in (
        "velocities", "impulses", "absorbed", "collisions", "path", "pathImpulses", "margin",
    ):  # fmt: skip
        assert bits(answer[name]) == bits(getattr(trace, name.replace("I", "_i"))), name
    assert answer["collapsed"] is trace.collapsed
    assert tuple(answer["saturated"]) == trace.saturated
    events = [(event["kind"], event["contact"]) for event in answer["events"]]
    assert events == [tuple(event) for event in trace.events]


def generic(draw, n):
    """Any masses over six decades, velocities, coefficients with 0 and 1; ratios up to 1."""

    def part():
        return draw.choice([0.0, 1.0, draw.decimal(0, 1, 3), draw.decimal(0, 1, 3)])

    masses = [draw.decimal(1, 9.99, 2) * draw.choice([0.001, 1.0, 1.0, 1000.0]) for _ in range(n)]
    velocities = [draw.decimal(-1, 1, 3) for _ in range(n)]
    if draw.chance(50):
        velocities.sort(reverse=True)
    forward, backward = ([part() for _ in range(n - 2)] for _ in range(2))
    if draw.chance(50):
        forward, backward = within_bounds(masses, iter(forward + backward).__next__)
    restitution = [part() for _ in range(n - 1)]
    return Problem(masses, velocities, restitution, forward, backward, draw.choice([0.0, 0.5, 1.0]))


def problems(name, count, largest=12):
    if name == "generic":
        draw = Draw(53)
        return [generic(draw, 2 + draw.below(6)) for _ in range(count)]
    return [problem for problem in family(name, count) if len(problem.masses) <= largest]


COUNTS = {
    "generic": 250,
    "ties": 400,
    "ties within bounds": 300,
    "tiny ratios": 200,
    "mixed zeros": 150,
    "light balls": 100,
}


@pytest.mark.parametrize("name", COUNTS)
def test_impacts_to_the_last_bit(script, name, monkeypatch):
    monkeypatch.setattr(exact, "answer", lambda *_: False)  # the page has the event loop alone
    chains = problems(name, COUNTS[name])
    assert len(chains) >= COUNTS[name] / 2
    # Light balls between heavy ones collide a hundred thousand times: that is not looked at here.
    answers = script.each("cradle.collide", [asked(chain, maxEvents=2000) for chain in chains])
    outcomes = [expected(chain, max_events=2000) for chain in chains]
    for answer, outcome in zip(answers, outcomes):
        check(answer, *outcome)
    finished = [trace for status, trace in outcomes if status == "finished"]
    assert len(finished) > 0.8 * len(chains)
    kinds = {kind for trace in finished for kind, _ in trace.events}
    assert {"maximum_compression", "end", "close"} <= kinds
    if name in ("generic", "ties"):
        assert "collapse" in kinds
        assert any(trace.saturated for trace in finished)
    assert {"generic", *FAMILIES} == set(COUNTS)


def test_the_outcome_alone_is_the_same(script):
    chains = problems("generic", 200)
    rows = [asked(chain, maxEvents=1000) for chain in chains]
    for alone, answer in zip(
        script.each("cradle.outcome", rows), script.each("cradle.collide", rows)
    ):
        for name in ("events", "path", "pathImpulses"):
            del answer[name]
        assert alone == answer


def test_pairs_are_never_taken_for_numbers(script, source):
    """An operator that met one would throw."""
    pair = "return { real, imag };"
    throws = "return { real, imag, [Symbol.toPrimitive]() { throw new Error('a pair'); } };"
    assert source.count(pair) == 1
    strict = Script(source.replace(pair, throws))
    rows = [asked(chain, maxEvents=1000) for chain in problems("ties", 300)]
    answers = strict.each("cradle.collide", rows)
    strict.context.close()
    assert answers == script.each("cradle.collide", rows)
    broken = Script(source.replace(pair, throws).replace("b.start.real", "b.start"))
    assert "a pair" in broken.each("cradle.collide", rows)
    broken.context.close()


def test_units_far_from_one(script):
    """Powers of two up to the limits of doubles: frexp, ldexp, numbers below 2 ** -1022."""
    chains = [
        problem.in_units(math.ldexp(1, mass), math.ldexp(1, speed))
        for problem in problems("generic", 40)
        for mass, speed in [(-900, 0), (900, 0), (0, -900), (0, 400), (-500, -500), (10, -1040)]
    ]
    answers = script.each("cradle.collide", [asked(chain, maxEvents=1000) for chain in chains])
    for chain, answer in zip(chains, answers):
        check(answer, *expected(chain, max_events=1000))


@pytest.mark.parametrize("limit", [1, 2, 5, 20])
def test_unfinished_impacts(script, limit):
    """The state reached, as Python's error holds it."""
    chains = problems("ties", 100) + problems("generic", 100)
    answers = script.each("cradle.collide", [asked(chain, maxEvents=limit) for chain in chains])
    outcomes = [expected(chain, max_events=limit) for chain in chains]
    for answer, outcome in zip(answers, outcomes):
        check(answer, *outcome)
    unfinished = sum(status == "unfinished" for status, _ in outcomes)
    assert unfinished > 20


def test_defects_have_the_package_s_words(source):
    (words,) = re.findall(r"^const DEFECTS = (.*);$", source, re.MULTILINE)
    assert {int(number): text for number, text in json.loads(words).items()} == drive.DEFECTS


def test_an_outcome_that_is_not_certified_has_no_numbers(source):
    """If no rounding at all were allowed, the certificate would refuse this chain."""
    assert source.count(", sound = ") == 1
    script = Script(source.replace(", sound = ", ", sound = -"))
    answer = script("cradle.collide", {"masses": [1, 1, 1], "velocities": [1, 0, 0], "forward": 0})
    script.context.close()
    assert answer == {
        "status": "unsound",
        "defect": drive.DEFECTS[ORDER],
    }


GOOD = {
    "masses": [1, 2, 1], "velocities": [1, 0, 0], "restitution": [1, 1], "forward": [0.1],
    "backward": [0.1], "meeting": 0.5,
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("masses", [1, 0, 1]),
        ("masses", [1, -2.5, 1]),
        ("masses", [1]),
        ("masses", [1e-26, 1, 1]),
        ("velocities", [1, 0]),
        ("velocities", [1e200, 0, 0]),
        ("velocities", [1e155, 0, 0]),
        ("restitution", [1, 1.2]),
        ("restitution", -1e-5),
        ("restitution", 1e-40),
        ("restitution", [0.5, 1e-40]),
        ("restitution", [1, 1, 1]),
        ("forward", [1.0000001]),
        ("forward", 2),
        ("forward", [0.1, 0.1]),
        ("backward", [-1e-7]),
        ("meeting", 1.5),
        ("maxEvents", 0),
    ],
)
def test_refusals_in_the_words_of_the_package(script, name, value):
    given = GOOD | {name: value}
    options = {"max_events": given["maxEvents"]} if "maxEvents" in given else {}
    with pytest.raises(ValueError, match=name.replace("maxE", "max_e")) as refused:
        collide(
            Chain(given["masses"], given["velocities"], given["restitution"]),
            ImpulseCorrelation(
                given["forward"], given["backward"], meeting=given["meeting"], **options
            ),
        )
    assert script.each("cradle.collide", [given]) == [spelt(refused.value)]


def spelt(error):
    """A refusal of the package with the options' names in JavaScript."""
    words = str(error).replace("max_events = 0", "maxEvents = 0.0").replace(" and below 2**63", "")
    return words.replace("excess='saturate'", "saturate: true")


def test_what_is_no_number(script):
    cases = {
        "{...given, masses: [1, NaN, 1]}": "masses[1] = nan; must be finite",
        "{...given, velocities: [1, -Infinity, 1]}": "velocities[1] = -inf; must be finite",
        '{...given, masses: [1, "2", 1]}': 'masses[1] = "2"; must be a real number',
        "{...given, masses: [1, 2n, 1]}": "masses[1] = 2n; must be a real number",
        '{...given, saturate: "no"}': 'saturate = "no"; must be true or false',
        "{...given, maxEvents: 1.5}": "maxEvents = 1.5; must be a whole number, at least 1",
        "undefined": "an impact = undefined; must be an object",
        "{...given, restitutions: 1}": "restitutions is no part of an impact; these are: masses, "
        "velocities, restitution, forward, backward, meeting, saturate, maxEvents, record",
        "{...given, forward: undefined}": "forward = undefined; must be a real number",
        "{...given, meeting: [1]}": "meeting = 1; must be one number",
    }
    for given, sentence in cases.items():
        assert script.each(f"given => cradle.collide({given})", [GOOD]) == [sentence]


def test_two_balls_need_no_ratio(script):
    answer = script.each("cradle.outcome", [{"masses": [1, 1], "velocities": [1, 0]}])
    assert answer[0]["velocities"] == [0, 1]


def test_ratios_above_their_bound(script):
    """Refused in the same words, or held."""
    chains = problems("ties", 200) + problems("generic", 200)
    rows = [asked(chain, saturate=False, maxEvents=1) for chain in chains]
    answers = script.each("cradle.outcome", rows)
    refused = 0
    for chain, answer in zip(chains, answers):
        model = ImpulseCorrelation(chain.forward, chain.backward, meeting=chain.meeting)
        sentence = None
        try:
            collide(Chain(chain.masses, [0] * len(chain.masses), chain.restitution), model)
        except ValueError as error:
            sentence = spelt(error)
            refused += 1
        assert (answer if isinstance(answer, str) else None) == sentence
    assert 50 < refused < 350


def test_largest_ratios(script):
    for chain in problems("generic", 100):
        bounds = script("(m, f, b) => cradle.largestRatios(m, f, b)",
                        chain.masses, chain.forward, chain.backward)  # fmt: skip
        expected = largest_ratios(chain.masses, chain.forward, chain.backward)
        assert bits(bounds["forward"]) == bits(expected[0])
        assert bits(bounds["backward"]) == bits(expected[1])
