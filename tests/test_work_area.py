"""What the work area held before an impact, or a contact before it waited, changes nothing.

And nothing outside it is touched: compiled code does not ask (`cradle.runtime.compile`).
"""

from typing import get_type_hints

import plain
import pytest
from delicate import chains_of, seen
from extreme_chains import any_chain
from families import FAMILIES, Draw, family

from cradle.runtime import job as drive

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
                    number = kind(draw.decimal(-4, 4, 2))
                    setattr(thing, name, number + 1e-17j if kind is complex else number)
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


class Strict(list):
    """A sequence that does not count from its end."""

    def __getitem__(self, k):
        assert k >= 0, k
        return super().__getitem__(k)

    def __setitem__(self, k, value):
        assert k >= 0, k
        super().__setitem__(k, value)


def strict(seed):
    """How a work area is made whose sequences have no index below zero."""

    def area(n, compiled, record):
        state = filled(seed)(n, compiled, record)
        memory = Strict(Strict(row) for row in state.memory)
        parts = {name: Strict(getattr(state, name)) for name in state._fields[:4]}
        kinds, contacts, *paths = record
        paths = (Strict(Strict(row) for row in path) for path in paths)
        record = type(record)(Strict(kinds), Strict(contacts), *paths)
        return state._replace(**parts, memory=memory, record=record)

    return area


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", FAMILIES)
def test_what_was_there_and_a_record_change_no_outcome(name, seed, kernel):
    """Every index lies inside; compressions are worked out in room that other functions use too."""
    for problem in family(name, 20, seed=seed):
        found = outcome(problem, kernel, area=strict(seed), room=200)
        assert found == outcome(problem, kernel)


@pytest.mark.parametrize("way", ["within", "saturate"])
def test_no_index_lies_outside_the_work_area_where_sequences_are_infinite(way, kernel):
    collapsed = 0
    for index in range(30):
        masses, velocities, e, forward, backward, *_ = any_chain(way, 3, index)
        found = plain.solve(
            masses, velocities, e, forward, backward, max_events=2000, room=200, kernel=kernel,
            area=strict(1),
        )  # fmt: skip
        collapsed += found.collapsed
    assert collapsed > 5


@pytest.mark.parametrize(("what", "n"), [("rates", 9), ("collisions", 5)])
def test_an_impact_forgets_the_one_before(what, n, kernel):
    """Collisions were compared with its own where a sequence is slower than the last digit."""
    one = drive._area(n, False, drive._record(0, n))
    for _, problem in seen(chains_of(f"{what} of the impact before")):
        found = outcome(problem, kernel, area=lambda *_: one)
        assert found[0] == 0
        assert found == outcome(problem, kernel)


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
