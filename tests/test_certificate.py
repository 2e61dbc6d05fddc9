"""An answer with one thing wrong is refused, and told what: the kernel's `certify`, by itself."""

import plain
import pytest
from families import FAMILIES, family

from cradle.kernel.state import ENERGY, LEDGER, MOMENTUM, ORDER, PULL

KERNEL = plain.rooms()
LOSSY = ([1, 0.3, 0.6, 2], [1, 0.2, 0, -0.5], 0.8, 0.2)
ELASTIC = ([1, 0.3, 0.6, 2], [1, 0.2, 0, -0.5], 1.0, 0.2)
#: A millionth of a millionth, some thousand times what rounding may be.
SMALL = 1e-12


def solved(masses, velocities, e, ratio, boost=0.0):
    found = plain.solve(masses, [v + boost for v in velocities], e, ratio, kernel=KERNEL)
    return found.state


def verdict(state):
    return KERNEL["certify"](len(state.ball), state.ball, state.contact, state.tally[0])


def pull(state, c, impulse):
    """Balls and contact c as if it had had so much less impulse."""
    one, other = state.ball[c], state.ball[c + 1]
    state.contact[c].p -= impulse
    one.hi += impulse / one.m
    other.hi -= impulse / other.m


@pytest.mark.parametrize("name", FAMILIES)
def test_what_the_event_loop_leaves_is_right(name):
    for problem in family(name, 10, seed=3):
        *chain, meeting = problem
        found = plain.solve(*chain, meeting=meeting, max_events=2000, kernel=KERNEL)
        if found.status == 0:
            assert verdict(found.state) == 0


@pytest.mark.parametrize("ball", range(4))
@pytest.mark.parametrize("sign", [1, -1])
def test_a_ball_that_moves_without_an_impulse(ball, sign):
    state = solved(*LOSSY)
    state.ball[ball].hi += sign * SMALL
    assert verdict(state) == MOMENTUM


@pytest.mark.parametrize("contact", range(3))
@pytest.mark.parametrize("sign", [1, -1])
def test_an_impulse_that_moves_no_ball(contact, sign):
    state = solved(*LOSSY)
    state.contact[contact].p += sign * SMALL
    assert verdict(state) == MOMENTUM


@pytest.mark.parametrize("contact", range(3))
def test_balls_that_still_approach(contact):
    state = solved(*LOSSY)
    one, other = state.ball[contact], state.ball[contact + 1]
    apart = KERNEL["closing"](contact, state.ball)
    pull(state, contact, (SMALL - apart) * one.m * other.m / (one.m + other.m))
    assert verdict(state) == ORDER


def test_a_contact_that_pulls():
    """All else agrees: the energy that it takes from a ball which flies away is booked as lost."""
    state = solved([1, 1, 1], [1, 0, 5], 0.5, 0.1)
    contact = state.contact[1]
    assert contact.p == 0.0
    before = sum(ball.m * ball.hi**2 / 2 for ball in state.ball)
    pull(state, 1, 1e-3)
    after = sum(ball.m * ball.hi**2 / 2 for ball in state.ball)
    contact.a = (before - after) / (1 - contact.e**2)
    assert verdict(state) == PULL


@pytest.mark.parametrize("contact", range(3))
def test_works_below_nothing_that_balance(contact):
    """What an elastic contact absorbs shows in no ledger."""
    state = solved(*ELASTIC)
    state.contact[contact].a = -SMALL
    assert verdict(state) == PULL


def test_energy_from_nothing():
    state = solved(*ELASTIC)
    pull(state, 1, -SMALL)
    assert verdict(state) == ENERGY


@pytest.mark.parametrize("boost", [0.0, 1000.0])
def test_energy_lost_without_a_contact_that_keeps_it(boost):
    """Also seen from a moving frame, where all kinetic energy is a million times as much."""
    state = solved(*ELASTIC, boost=boost)
    pull(state, 1, 100 * SMALL)
    assert verdict(state) == LEDGER


@pytest.mark.parametrize("heavy", [1, 3])
def test_energy_beside_a_fast_light_ball(heavy):
    """Among the heavy balls it is little, seen from the light one much."""
    state = solved([1e-9, 1, heavy, 1], [1000, 0, 0, 0], 1.0, 0.2)
    pull(state, 2, 1e-4 * state.contact[2].p)
    assert verdict(state) == LEDGER


def test_balls_that_fly_on_untouched_hide_nothing():
    state = solved([*LOSSY[0], 1000], [*LOSSY[1], 1000], *LOSSY[2:])
    state.contact[1].a *= 1 + 1e-9
    assert verdict(state) == LEDGER


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("contact", range(3))
def test_work_that_was_not_done(contact, sign):
    state = solved(*LOSSY)
    assert state.contact[contact].a > 0.01
    state.contact[contact].a *= 1 + 100 * sign * SMALL
    assert verdict(state) == LEDGER


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
@pytest.mark.parametrize("thing", ["ball", "impulse", "work"])
def test_no_number_at_all(thing, number):
    state = solved(*LOSSY)
    if thing == "ball":
        state.ball[2].hi = number
    elif thing == "impulse":
        state.contact[1].p = number
    else:
        state.contact[1].a = number
    assert verdict(state) != 0
