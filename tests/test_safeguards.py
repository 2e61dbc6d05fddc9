"""Every safeguard earns its place: a small chain that goes wrong without it.

The plain event loop runs with one limit or one function exchanged.  As it is, it gives a certified
answer, for short impacts that of fifty digits (`test_defects.py`); with the exchange it does not:
it goes wrong, does not finish, or its answer is not certified.  What a limit costs or saves in work
is in `test_speed.py`.
"""

import inspect
import math

import numpy as np
import pytest
from delicate import CHAINS
from plain import rooms, solve

from cradle.kernel import collapse, cycles
from cradle.kernel.state import FINISHED, NEVER, REFUSED, UNFINISHED, UNSOUND

WRONG = "wrong"


def first_room_only(_):
    """In place of `part_beyond`: no gap further on is looked at."""
    return lambda *_: NEVER


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


LIGHT_BETWEEN = ([1e-6, 1e-9, 1e-6, 1], [1, 0, 0, 0], [0.3, 0.1, 0.99], [0.3, 0.1], [0.5, 1], 1.0)
HELD_FAST = "two balls that chatter between balls held fast"

#: A chain of `delicate_chains.csv`, what is exchanged, and what becomes of the chain.
NEEDED = [
    ("gaps reached at once", {"tie": 0.0}, UNSOUND),
    ("closing speeds that are zero but for rounding", {"tie": 0.0}, WRONG),
    ("ratios of zero are far below all others", {"vanishing": 2}, WRONG),
    ("contacts with next to nothing left", {"exhausted": 1e-300}, UNFINISHED),
    (HELD_FAST, {"repeats": math.inf}, UNFINISHED),
    ("dust between contacts that only chatter", {"dust": 0.0}, UNFINISHED),
    (HELD_FAST, {"repeats": 1}, WRONG),  # one exhausted collision is no row of them
    ("a light ball squeezed until another falls back", {"many": math.inf}, UNFINISHED),
    ("a light ball squeezed until another falls back", {"window": 1}, UNFINISHED),
    ("a cycle that repeats itself but for rounding", {"self_similar": 0.0}, UNFINISHED),
    ("a cycle that turns far", {"self_similar": math.inf}, WRONG),
    ("a cycle that turns far", {"bend": math.inf}, WRONG),
    ("a cycle that still turns", {"bend": 0.0}, UNFINISHED),
    ("what a sum may be off", {"sound": 0.0}, UNSOUND),
    ("a gap further on that is passed", {"part_beyond": first_room_only}, UNSOUND),
    ("neighbours that come to their own event in a cycle", {"neighbours_stay": any_neighbours},
     UNSOUND),
    ("balls held together that go together in a cycle",
     {"stays_at_zero": lambda _: lambda *_: False}, UNSOUND),
    ("cycles that contain collapses", {"look": lower_level_only}, UNFINISHED),
    ("a cycle that grows",
     {"limit": changed(cycles, "limit", "-1.0 <= total <= 0.0", "total <= 0.0")}, UNFINISHED),
]  # fmt: skip


def run(chain, **exchanged):
    *chain, meeting = chain
    return solve(*chain, meeting=meeting, max_events=3000, **exchanged)


@pytest.mark.parametrize(("name", "exchange", "becomes"), NEEDED)
def test_without_it_a_chain_goes_wrong(name, exchange, becomes):
    chain = CHAINS[name].problem
    real, other = run(chain), run(chain, **exchange)
    assert real.status == FINISHED
    if becomes == WRONG:
        assert other.status == FINISHED
        assert np.abs(np.subtract(real.velocities, other.velocities)).max() > 1e-6
    else:
        assert other.status == becomes


def test_cycles_that_still_change_leave_digits_in_doubt():
    """Where they end depends on steady neighbours: all digits are those of each collision made."""
    chain = CHAINS["cycles that still change"].problem
    real, other = run(chain), run(chain, doubt=math.inf)
    assert real.status == FINISHED
    assert np.abs(np.subtract(real.velocities, other.velocities)).max() > 1e-12


def test_a_part_that_is_kept_is_never_zero():
    """A ball beside a steady neighbour that hands all on is one of infinite mass: it divides."""
    assert run(CHAINS[HELD_FAST].problem).status == FINISHED
    with pytest.raises(ZeroDivisionError):
        run(CHAINS[HELD_FAST].problem, kept=0.0)


def test_balls_beside_larger_impulses_may_have_no_common_velocity():
    """Their masses, divided by the parts that they keep, then sum up to zero: there is no limit."""
    chain = CHAINS["a cycle of no mass"].problem
    assert run(chain).status == FINISHED
    without = changed(collapse, "common_velocity", "if mass.real == 0.0:", "if False:")
    with pytest.raises(ZeroDivisionError):
        run(chain, common_velocity=without)


def test_balls_lighter_than_digits_can_tell_are_refused():
    chain = [1, 1e-20, 1e-20, 1], [1, 0.5, 0, -0.3], [0.5, 0.9, 0.3], 0.1, 0.2, 0.5
    assert run(chain).status == REFUSED
    assert run(chain, lightest=0.0).status == UNSOUND


def test_a_ratio_meant_to_be_its_bound():
    """Eq. 34 by another order of operations may be a last digit above: it is no larger ratio."""
    usual, names = rooms(), rooms(rounded=1.0)
    above = endless = 0
    for k in range(1, 200):
        masses = [1.0, 1.0 + k / 7, 0.3 + k / 11]
        ratio = 1.0 / (1.0 + masses[1] / masses[2])
        chain = masses, [1, 0, 0], 0.5, ratio, 0.0
        kept = solve(*chain, kernel=usual)
        assert kept.status == FINISHED
        assert kept.held == [0, 0]
        other = solve(*chain, kernel=names, max_events=2000)
        above += other.held != [0, 0]
        endless += other.status == UNFINISHED
    assert above > 0
    assert endless > 0


def test_collisions_without_an_impulse_are_no_cycle():
    """A limit divides by the impulses of a cycle.  No chain is known in which one of them is 0."""
    found = []

    def watched(names):
        def cluster_around(c, level, n, state):
            real = names["cluster_around"](c, level, n, state)
            if real.first <= real.last:
                remembered = state.memory[level][c]
                kept, remembered.p = remembered.p, state.contact[c].p
                found.append(names["cluster_around"](c, level, n, state))
                remembered.p = kept
            return real

        return cluster_around

    assert run(LIGHT_BETWEEN, cluster_around=watched).status == FINISHED
    assert found
    assert all(cluster.last < cluster.first for cluster in found)


@pytest.mark.parametrize(
    "name", ["a cycle that is cut early", "a cycle of two light balls that is cut early"]
)
def test_a_limit_tells_the_velocities_better_than_the_works(name):
    chain = CHAINS[name].problem[:5]
    early, late = solve(*chain), solve(*chain, bend=0.0, self_similar=0.0, many=math.inf)
    assert early.collapsed
    assert late.collapsed
    np.testing.assert_allclose(early.velocities, late.velocities, rtol=0, atol=1e-15)
    kept = 1 - np.square(chain[2])
    assert kept @ early.absorbed == pytest.approx(kept @ late.absorbed, rel=1e-14)
    # What `Trace.absorbed` promises, and no more.
    apart = np.abs(np.subtract(early.absorbed, late.absorbed)).max()
    assert 1e-6 < apart / max(late.absorbed) < 1e-4
