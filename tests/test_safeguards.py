"""Every safeguard earns its place: a small chain that goes wrong without it.

The plain event loop runs with one limit or one function exchanged.  As it is, it gives a certified
answer, for short impacts that of fifty digits; with the exchange it does not: it goes wrong, does
not finish, or its answer is not certified.
"""

import inspect
import math

import mpmath
import numpy as np
import pytest
import truth
from plain import rooms, solve
from test_defects import LAST_DIGITS, LITTLE_LEFT, NAMED, PORTIONS, THROWN

from cradle.kernel import certificate, collapse, cycles, jump, loop, meeting
from cradle.kernel.state import FINISHED, UNFINISHED, UNSOUND

WRONG = "wrong"


def simple_zero(_):
    """In place of `arrive`: the closing speed alone is set to zero, the balls stay as they are."""

    def arrive(c, _low, _high, _n, _ball, contact):
        contact[c].u = 0.0

    return arrive


def from_one_end(_):
    """In place of `share_out`: one sum from left to right."""

    def share_out(first, last, before, _after, ball, contact):
        impulse = before
        for c in range(first, last + 1):
            impulse -= ball[c].m * ball[c].x
            contact[c].x = impulse

    return share_out


def one_number(_):
    """In place of `add_velocity`: a velocity is one number."""

    def add_velocity(b, x):
        b.hi += x
        b.lo = 0.0

    return add_velocity


def one_store(_):
    """In place of `add_store`: what a contact can still release is one number."""

    def add_store(k, x):
        k.q = max(k.q + x, 0.0)

    return add_store


def first_room_only(_):
    """In place of `part_beyond`: no gap further on is looked at."""
    return lambda *_: math.inf


def any_neighbours(names):
    """In place of `neighbours_stay`: the works are worked out, and all is well."""

    def neighbours_stay(*given):
        names["neighbours_stay"](*given)
        return True

    return neighbours_stay


def lower_level_only(names):
    """In place of `look`: cycles that contain collapses are not looked for."""

    def look(number, c, n, state):
        return (c, c - 1) if number == 1 else names["look"](number, c, n, state)

    return look


def changed(room, name, part, other):
    """In place of a function: the same, with a part of its text exchanged."""

    def exchange(names):
        code = inspect.getsource(getattr(room, name)).partition("\n")[2]
        assert code.count(part) == 1
        own = dict(names)
        exec(code.replace(part, other), own)
        return own[name]

    return exchange


def just_been(names):
    """In place of `chatters`: what its neighbours end takes no part, however slow it is."""

    def chatters(c, n, state):
        if not 0 <= c < n - 1:
            return False
        k, rest = state.contact[c], (state.tally[0].threshold, state.ball, state.contact)
        if k.active == 1 and k.w > 0.0 and names["exhausted"](c, k.w, *rest):
            return True
        return k.tiny > 0 and names["exhausted"](c, k.q, *rest)

    return chatters


def sure(names):
    """In place of `limit`: the digits of the neighbours' shares leave nothing in doubt."""

    def limit(*given):
        *found, _, _ = names["limit"](*given)
        return (*found, 0.0, 0.0)

    return limit


LIGHT_BETWEEN = ([1e-6, 1e-9, 1e-6, 1], [1, 0, 0, 0], [0.3, 0.1, 0.99], [0.3, 0.1], [0.5, 1], 1.0)

#: A light ball is squeezed between two heavy ones; before they are at one velocity, one of them
#: falls back on a third.
BEFORE_A_LIMIT = ([1, 1, 1e-7, 3], [0.5, 1, -1, 0], [1e-3, 0.9, 0.3], [1, 0], [0, 0.1], 1.0)

#: Its last collisions are far below the last digit of its velocities.
EXHAUSTED = ([0.07, 4, 0.08, 70], [0.8, 0.8, 0.6, -1], [1, 1, 0], [0.2, 0.9], [0.009, 0.8], 0.5)

#: What is exchanged; the chain with its ratios and `meeting`; what becomes of it.
NEEDED = {
    "velocities as sums of two numbers": (
        {"add_velocity": one_number},
        ([1000, 1], [1, 0], 0.3, [], [], 0.5),
        UNSOUND,
    ),
    "a cycle that still turns": (
        {"bend": 0.0},
        ([1, 1e-6, 1], [1, 0, 0], [0.9, 1], 0.05, 0, 0.5),
        UNFINISHED,
    ),
    "a cycle that turns too far": (
        {"bend": math.inf},
        ([1.7, 1e-3, 1, 1], [1, 0, 0, 0], [0.9, 0.99, 0.9], [0.05, 0.1], [0.1, 0.05], 0.5),
        WRONG,
    ),
    "a cycle beside neighbours whose shares have few digits": (
        {"doubt": 0.0},
        LIGHT_BETWEEN,
        UNFINISHED,
    ),
    "impulses summed from both ends": (
        {"share_out": from_one_end},
        ([1, 1e-6, 1000, 1e-9], [1, 0, 0, 0], [0.5, 0, 0.1], [0.3, 0.5], [0.3, 0.1], 1.0),
        UNSOUND,
    ),
    "what arrives takes the other's velocity": (
        {"arrive": simple_zero},
        (
            [0.77, 2.75, 0.56, 2.45, 2.67, 0.69, 2.55],
            [0.8, 0.59, 0.44, 0.34, 0.28, 0.15, 0.04],
            [0.83, 0.56, 0.6, 0.88, 0.55, 0.98],
            [0, 0, 0, 0, 0], [0.18, 0, 0, 0, 0], 0.5,
        ),
        WRONG,
    ),
    "gaps reached at once": (
        {"tie": 0.0},
        (
            [1.94, 2.65, 1.39, 2.14, 1.98, 1.73, 1.82, 1.75, 1.36],
            [0.9, 0.63, 0.55, 0.55, 0.51, 0.43, 0.21, 0.17, 0.05],
            [0.62, 0.63, 0.77, 0.74, 0.7, 0.55, 0.69, 0.83],
            [0.37, 0.4, 0, 0, 0.1, 0.08, 0.1], [0.32, 0.21, 0.06, 0.2, 0, 0.41, 0.52], 0.5,
        ),
        WRONG,
    ),
    "contacts with next to nothing left": ({"exhausted": 1e-300}, EXHAUSTED, UNFINISHED),
    "exhausted collisions in a row": (
        {"repeats": math.inf},
        (
            [0.9, 20, 2, 10, 2], [1, 0, 0, 0, 0], [1, 0.00194, 1, 0.702], [1, 0.3, 0.05],
            [1, 0, 0.4], 0.5,
        ),
        UNFINISHED,
    ),
    "a cycle that repeats itself but for rounding": (
        {"self_similar": 0.0},
        (
            [100, 700, 0.006, 0.06, 20], [0.45, 0.44, 0.33, 0.19, -0.25], [0.5, 0.8, 0, 0.5],
            [1.44e-5, 0.373, 0.996], [0.128, 0.178, 0], 0.5,
        ),
        UNFINISHED,
    ),
    "a collapse that costs next to no energy": (
        {"faint": 0.0},
        (
            [1, 0.3, 1, 3, 1, 0.3, 1, 3, 0.3, 3], [1] + [0] * 9,
            [0, 0.9, 1, 0.9, 0.9, 0.9, 0, 0.5, 0.5],
            [0.1, 0.1, 0.1, 0, 0, 0, 0, 1], [0.1, 0.1, 0.1, 0, 1, 1, 0, 0.1], 1.0,
        ),
        UNFINISHED,
    ),
    "a gap that rounding has closed": (
        {"parts_to_meeting": changed(meeting, "parts_to_meeting", ".u, 0.0)", ".u, -math.inf)")},
        LAST_DIGITS["a gap that rounding has closed"],
        UNSOUND,
    ),
    "parts of a segment that are whole but for rounding": (
        {"simultaneous": 1.0},
        (
            [0.045, 0.053, 0.166, 0.053, 0.053, 0.053, 0.053, 0.053, 0.053, 0.166, 0.045, 0.166],
            [0.5, -0.5, 0, 0.5, 0.5, -0.5, 1, -0.5, 1, -0.5, 1, 0.5], 1,
            [0, 0, 0.2857142857142857, 0.25, 0, 0.25, 0, 0.3789954337899544, 0, 0],
            [0, 0.12100456621004566, 0, 0.25, 0, 0, 0.25, 0.2857142857142857, 0,
             0.3933649289099526], 0.0,
        ),
        WRONG,
    ),
    "closing speeds that are zero but for rounding": (
        {"roundings": 0.0},
        ([1] * 9, [1] + [0] * 8, 1, [0.1, 0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0.1, 0.1], 0.5),
        WRONG,
    ),
    "an end that is exact only if it is meant to be": (
        {"same": math.inf},
        ([1, 1, 1], [1, 0.5, 0], 1, 0.1, 1, 0.0),
        UNSOUND,
    ),
    "ratios of zero are far below all others": (
        {"vanishing": 2},
        ([1, 1, 1, 1], [1, 0.5, 1, -0.5], 1, [0, 1], [0.1, 0.1], 0.0),
        WRONG,
    ),
    "a gap further on that is passed": (
        {"part_beyond": first_room_only},
        (
            [1.47, 2.46, 3, 2.22, 1.04, 0.68, 2.27], [0.75, 0.74, 0.74, 0.5, 0.46, 0.31, 0.16],
            [0.63, 0.56, 0.61, 0.66, 0.72, 0.94],
            [0.38, 0.24, 0, 0.1, 0], [0.28, 0, 0.43, 0.37, 0.27], 0.5,
        ),
        UNSOUND,
    ),
    "gaps beside a run that has moved": (
        {"touch_closed": lambda _: lambda *_: None},
        NAMED["an end and a closing beside it at once"],
        WRONG,
    ),
    "a correction of rounding that would throw a light ball": (
        {"handed_on": lambda _: lambda *_: 0.0},
        THROWN["a light ball beyond a heavy one that light balls touch"],
        UNSOUND,
    ),
    "of two runs that meet, the one that hands on less": (
        {"touch": changed(loop, "touch", "left_moves = one <= other", "left_moves = True")},
        LAST_DIGITS["two balls that chatter between balls held fast"],
        WRONG,
    ),
    "corrections of rounding that do work": (
        {"push_at_work": lambda names: names["push"]},
        LITTLE_LEFT,
        UNSOUND,
    ),
    "momentum to the last digit of two numbers": (
        {"certify": changed(certificate, "certify", " + LIMITS.dust * b.m", "")},
        LAST_DIGITS["a ball that is reached, and no more"],
        UNSOUND,
    ),
    "neighbours that come to their own event in a cycle": (
        {"neighbours_stay": any_neighbours},
        (
            [1e-3, 1, 1, 1e-3, 1e-6, 1], [1, 0, 0, 0, 0, 0], [0.99, 1, 0.3, 0.5, 0.5],
            [0, 0, 0.05, 0.5], [0.05, 0.1, 1, 0.3], 1.0,
        ),
        UNSOUND,
    ),
    "cycles that contain collapses": (
        {"look": lower_level_only},
        (
            [15, 0.25, 0.071, 16, 12], [1, 0, 0, 0, 0], [0.75, 0.55, 0, 0.53],
            [0.084, 0.8, 1], [0.8, 1, 0.86], 0.5,
        ),
        UNFINISHED,
    ),
    "a cycle repeated up to its neighbour's event": (
        {"many": math.inf},
        BEFORE_A_LIMIT,
        UNFINISHED,
    ),
    "a cycle that grows": (
        {"limit": changed(jump, "limit", "-1.0 <= total <= 0.0", "total <= 0.0")},
        ([1, 1, 1e-9, 1], [1, 0.5, 0, 0], 0, 0.1, 0.1, 0.5),
        UNFINISHED,
    ),
    "a cycle repeated, with what it can still release": (
        {"shrink": lambda _: lambda *_: None},
        BEFORE_A_LIMIT,
        UNSOUND,
    ),
    "how far a cycle between balls held fast shrinks": (
        {"limit": sure},
        LAST_DIGITS["two balls that chatter between balls held fast"],
        UNFINISHED,
    ),
    "a cycle's sum of which no digit is known": (
        {"one_digit": math.inf},
        LAST_DIGITS["two balls that chatter between balls held fast"],
        UNFINISHED,
    ),
    "contacts that their neighbours end, below the last digit": (
        {"chatters": just_been},
        LAST_DIGITS["sequences within a sequence that no digit can end"],
        UNFINISHED,
    ),
    "contacts that have just closed, below the last digit": (
        {
            "chatters": changed(
                collapse, "chatters", "lately = ", "lately = contact[c].active == 0 and "
            )
        },
        LAST_DIGITS["contacts that have just closed at the last digit"],
        UNFINISHED,
    ),
    "a store that is released in portions below its last digit": (
        {"add_store": one_store},
        PORTIONS,
        UNSOUND,
    ),
    "a sequence down to the last digit": (
        {"dust": 0.0},
        LAST_DIGITS["contacts that have just closed at the last digit"],
        UNFINISHED,
    ),
}  # fmt: skip


def run(chain, **exchanged):
    *chain, meeting = chain
    steps = 25_000 if chain[0] == PORTIONS.masses else 3000
    return solve(*chain, meeting=meeting, max_events=steps, **exchanged)


@pytest.mark.parametrize("name", NEEDED)
def test_without_it_a_chain_goes_wrong(name):
    exchange, chain, becomes = NEEDED[name]
    real, other = run(chain), run(chain, **exchange)
    assert real.status == FINISHED
    if becomes == WRONG:
        assert other.status == FINISHED
        assert np.abs(np.subtract(real.velocities, other.velocities)).max() > 1e-6
    else:
        assert other.status == becomes


# The others take fifty digits minutes.
SHORT = [
    name
    for name, (_, chain, _) in NEEDED.items()
    if min(chain[0]) > 0.01 and name != "cycles that contain collapses"
]


@pytest.mark.parametrize("name", SHORT)
def test_with_it_the_answer_is_that_of_fifty_digits(name):
    *chain, meeting = NEEDED[name][1]
    with mpmath.workdps(50):
        exact = truth.solve(
            *[list(map(float, x)) if np.ndim(x) else float(x) for x in chain],
            meeting=meeting, excess="saturate", max_events=2000,
        )  # fmt: skip
        off = max(abs(a - b) for a, b in zip(run(NEEDED[name][1]).velocities, exact.velocities))
    assert off < 1e-13


#: Cycles beside steady neighbours.  All digits are those of the loop that makes each collision, 20
#: million of them in the first; of the others it needs too many, but not at a hundred times the
#: light masses, and there all agree.  The last is known to 1e-12, without it to 1e-11.
DIGITS = {
    "balls held together go together in a cycle": (
        {"stays_at_zero": lambda _: lambda *_: False},
        (
            [0.56365, 1.5552725560868464e-06, 1.96269, 1.39623, 6.188765e-07, 0.42382],
            [0, 0, 0.5, -1, 0, -0.5], [0, 0.3, 0.001, 0.5, 1], [0, 0.5, 0.1, 1],
            [0.001, 0.1, 1, 0.5], 0.0,
        ),
    ),
    "cycles of three contacts that still change": (
        {"cycle": changed(cycles, "cycle", "two = cluster.last < cluster.first + 2", "two = True")},
        (
            [1.160541747753352, 6.747e-07, 0.33448, 1.85497, 6.581e-05, 2.72338],
            [0.45804, 0.78246, 0.33838, 0.88286, -0.79193, -1.56234], [0.9, 0, 0.001, 0.9, 0.3],
            [0.1, 0.1, 0, 1], [0.1, 0.5, 1, 0.5], 0.5,
        ),
    ),
    "how far a cycle turns, from a long way": (
        {"look": changed(cycles, "look", "early = 2 *", "early = math.inf <")},
        (
            [11.7, 12.5, 7.44, 1.03, 1.85, 0.0375, 0.658],
            [0.91, 0.804, 0.596, 0.477, 0.463, -0.159, -0.267], [0.17, 1, 0.78, 0.55, 0.4, 0.25],
            [0, 0.35, 0.77, 0.96, 0], [1, 0.35, 0.65, 0.63, 0.32], 0.5,
        ),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", DIGITS)
def test_without_it_digits_are_lost(name):
    exchange, chain = DIGITS[name]
    real, other = run(chain), run(chain, **exchange)
    assert real.status == FINISHED
    lost = np.abs(np.subtract(real.velocities, other.velocities)).max()
    assert other.status == UNFINISHED or lost > 1e-12


def test_a_ratio_meant_to_be_its_bound():
    """Eq. 34 by another order of operations may be a last digit above: it is no larger ratio."""
    names = rooms(rounded=1.0)
    above = 0
    for k in range(1, 200):
        masses = [1.0, 1.0 + k / 7, 0.3 + k / 11]
        ratio = 1.0 / (1.0 + masses[1] / masses[2])
        chain = masses, [1, 0, 0], 0.5, ratio, 0.0
        kept = solve(*chain)
        assert kept.status == FINISHED
        assert kept.held == [0, 0]
        above += solve(*chain, kernel=names).held != [0, 0]
    assert above > 0


def test_collisions_without_an_impulse_are_no_cycle():
    """A limit divides by the impulses of a cycle.  No chain is known in which one of them is 0."""
    found = []

    def watched(names):
        def cluster_around(c, level, n, state):
            real = names["cluster_around"](c, level, n, state)
            if real.first <= real.last:
                remembered = state.memory[level][c]
                kept, remembered.p = remembered.p, 0.0
                found.append(names["cluster_around"](c, level, n, state))
                remembered.p = kept
            return real

        return cluster_around

    assert run(LIGHT_BETWEEN, cluster_around=watched).status == FINISHED
    assert found
    assert all(cluster.last < cluster.first for cluster in found)


@pytest.mark.parametrize(
    "chain",
    [
        (
            [0.12340293906449111, 0.015272256033722932, 0.0010428007666734443, 0.2953516775518479],
            [1, 0.3, 1, 0.5], [0.99, 0.1, 0.9], [0.1, 0],
        ),
        (
            [0.465, 0.002, 0.0775, 0.00198, 0.363], [0, 1, -0.5, 0.5, -1], [0.1, 0.7, 0.1, 0.99],
            [0.01, 0, 0],
        ),
    ],
)  # fmt: skip
def test_a_limit_tells_the_velocities_better_than_the_works(chain):
    early, late = solve(*chain), solve(*chain, bend=0.0, self_similar=0.0, many=math.inf)
    assert early.collapsed
    assert late.collapsed
    np.testing.assert_allclose(early.velocities, late.velocities, rtol=0, atol=1e-15)
    kept = 1 - np.square(chain[2])
    assert kept @ early.absorbed == pytest.approx(kept @ late.absorbed, rel=1e-14)
    # What `Trace.absorbed` promises, and no more.
    apart = np.abs(np.subtract(early.absorbed, late.absorbed)).max()
    assert 1e-6 < apart / max(late.absorbed) < 1e-4
