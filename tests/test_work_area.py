"""What the work area held before an impact, or a contact before it waited, changes nothing."""

from typing import get_type_hints

import plain
import pytest
from families import FAMILIES, Draw, family
from problem import Problem

from cradle import drive

#: Contacts that wait from the beginning: no impulse has reached them yet.
WAITING = Problem(
    [1.0] * 9,
    [-0.5, 1, 0, 0.5, 0, -0.5, -0.5, 1, 0.5],
    [1.0] * 8,
    [0, 1, 0, 0, 0, 0, 1],
    [0, 0, 0, 1, 1, 0, 1],
    meeting=0.0,
)
#: An impact that leaves rates where the contacts of the next one wait.
BEFORE = Problem(
    [1, 1, 1, 1, 1, 3, 0.3, 1, 1],
    [1.0] + [0.0] * 8,
    [0.9] * 8,
    [0, 0.1, 0, 0.1, 0, 0.1, 1],
    [1, 0.1, 0, 0.1, 0.1, 1, 1],
    meeting=1.0,
)
OTHERS = {"effort", "room"}  # the caller sets them


def filled(seed):
    """How a work area is made that is full of numbers which no impact may see."""

    def area(n, compiled, record):
        draw = Draw(seed)
        state = drive._area(n, compiled, record)
        groups = (state.ball, state.contact, state.run, state.level, *state.memory, state.tally)
        for thing in (thing for group in groups for thing in group):
            for name, kind in get_type_hints(type(thing)).items():
                if name not in OTHERS:
                    setattr(thing, name, kind(draw.decimal(-4, 4, 2)))
        return state

    return area


def outcome(problem, kernel, **options):
    parts = (problem.masses, problem.velocities, problem.restitution)
    found = plain.solve(
        *parts, problem.forward, problem.backward, meeting=problem.meeting, max_events=500,
        kernel=kernel, **options,
    )  # fmt: skip
    return found.status, found.velocities, found.collisions, found.absorbed, found.impulses


@pytest.fixture(scope="module")
def kernel():
    return plain.rooms()


seeds = pytest.mark.parametrize("seed", range(3))


@seeds
@pytest.mark.parametrize("name", FAMILIES)
def test_the_work_area_is_laid_out_anew(name, seed, kernel):
    for problem in family(name, 5, seed=5):
        assert outcome(problem, kernel, area=filled(seed)) == outcome(problem, kernel)


def test_an_impact_forgets_the_one_before(kernel):
    one = drive._area(9, False, plain.no_record())
    for problem in (BEFORE, WAITING):
        assert outcome(problem, kernel, area=lambda *_: one) == outcome(problem, kernel)


def test_waiting_contacts_have_no_rate():
    """Nor their balls a pull: not even what they had before."""
    seen = []

    def watched(names):
        def rates(first, run, ball, contact, tally):
            opens = names["rates"](first, run, ball, contact, tally)
            one = run[first]
            for c in [*range(first, one.low), *range(one.high + 1, one.last + 1)]:
                seen.append(contact[c].rate == contact[c].slope == 0.0)
            outer = [*range(first, one.low), *range(one.high + 2, one.last + 2)]
            seen.extend(ball[i].pull == 0.0 for i in outer)
            return opens

        return rates

    kernel = plain.rooms(rates=watched)
    for problem in family("ties within bounds", 20, seed=5):
        outcome(problem, kernel)
    assert len(seen) > 100
    assert all(seen)
