"""R8: two runs that meet have no common clock."""

import math

from cradle.kernel.numbers import (
    NEVER,
    ONE,
    ZERO,
    least,
    less,
    minus,
    most,
    negative,
    over,
    plus,
    times,
)
from cradle.kernel.rules import is_clear, is_gap
from cradle.kernel.state import LIMITS, jit


@jit
def parts_to_meeting(first, after, run, ball, contact, tally):
    """R8.3: work out whether runs `first` and `after` must meet, at what parts of their segments.

    Velocities are counted from that of the gap's left ball; that ball only rises and the other only
    falls.
    """
    one, other = run[first], run[after]
    gap = one.last + 1
    wide = negative(contact[gap].u)
    rise = times(ball[gap].pull, one.reach) if one.high == gap - 1 else ZERO
    fall = negative(times(ball[gap + 1].pull, other.reach)) if other.low == after else ZERO
    passed = minus(plus(rise, fall), wide).real
    made = contact[gap].made
    size = made + rise.real + fall.real
    # At zero it closes, even if both pushes vanish.
    meets = wide.real == 0.0 or (is_clear(passed, size, tally) and passed > 0.0)
    one.meets = 1 if meets else 0
    if not meets:
        return
    # They overlap from low to high; a run that gets to its own next event must do it.
    low, high = minus(wide, fall), least(rise, wide)
    if low.real < 0.0:
        low = ZERO
    at = plus(low, times(tally.meeting, minus(high, low)))
    one.left = part_of(at, rise, made)
    one.right = part_of(minus(wide, at), fall, made)


@jit
def part_of(way, whole, made):
    """Return a part of a segment: none or all of it if only rounding says otherwise."""
    rounding = 0.5 * LIMITS.tie * made
    if way.real <= rounding:
        return ZERO
    if minus(whole, way).real <= rounding:
        return ONE
    return over(way, whole)


@jit
def first_meeting(n, state):
    """R8.4: of several gaps that must close the one first reached, as its left run, or -1."""
    run, tally = state.run, state.tally[0]
    best = -1
    first = tally.first
    while first < n:
        after = run[first].onward
        if after < n and after == run[first].last + 2:
            if run[first].stirred == 1 or run[after].stirred == 1:
                parts_to_meeting(first, after, run, state.ball, state.contact, tally)
            if run[first].meets == 1 and (
                best < 0 or is_reached_sooner(run[first], run[best], tally)
            ):
                best = first
        first = after
    return best


@jit
def is_reached_sooner(one, other, tally):
    """R8.4: compare two gaps by the larger parts of their runs, then the smaller; ties go left."""
    larger = minus(most(one.left, one.right), most(other.left, other.right)).real
    if is_clear(larger, 1.0, tally):
        return larger < 0.0
    smaller = minus(least(one.left, one.right), least(other.left, other.right)).real
    return is_clear(smaller, 1.0, tally) and smaller < 0.0


@jit
def part_beyond(first, part, outward, c, n, state):
    """R8.4: part of the segment of run `first` at which it reaches the gap c beyond, if sooner.

    `outward` is the pull of its ball there, towards the gap; NEVER if it does not get there.
    """
    if not is_gap(c, n, state.contact):
        return NEVER
    whole = times(outward, state.run[first].reach)
    wide = negative(state.contact[c].u)
    way = times(whole, part)
    passed = minus(way, wide).real
    if is_clear(passed, state.contact[c].made + way.real, state.tally[0]) and passed > 0.0:
        return over(wide, whole)
    return NEVER


@jit
def who_goes(one, n, state):
    """R8.4 to R8.6: say how far each run goes; return the gap that then closes, or -1.

    Run `one` and the next go to where they meet.  If one of them reaches the gap at its far side on
    the way, this gap closes first, and only that run goes.  Without a run `one` all go on to their
    own next events.
    """
    ball, run = state.ball, state.run
    first = state.tally[0].first
    while first < n:
        run[first].goes = 2 if one < 0 else 0
        run[first].way = run[first].reach
        run[first].stirred = 0
        first = run[first].onward
    if one < 0:
        return -1
    other = run[one].onward
    gap = run[one].last + 1
    left, right = run[one].left, run[one].right
    far, beyond = one - 1, run[other].last + 1
    sooner_left = part_beyond(one, left, negative(ball[one].pull), far, n, state)
    sooner_right = part_beyond(other, right, ball[beyond].pull, beyond, n, state)
    by_left, by_right = True, True
    if sooner_left.real < math.inf or sooner_right.real < math.inf:
        by_left = not less(sooner_right, sooner_left)
        by_right = not by_left
        gap = far if by_left else beyond
        left, right = sooner_left, sooner_right
    if by_left:
        set_way(run[one], left)
    if by_right:
        set_way(run[other], right)
    return gap


@jit
def set_way(one, part):
    """Let a run go a part of its segment, all of it if the part is 1."""
    one.goes = 2 if part.real == 1.0 and part.imag == 0.0 else 1
    if one.goes == 1:
        one.way = times(one.reach, part)
