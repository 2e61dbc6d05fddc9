"""R8: two runs that meet have no common clock."""

import math

from cradle.kernel.rules import is_gap
from cradle.kernel.state import LIMITS, jit, once


@once
def parts_to_meeting(first, after, run, ball, contact, meeting):
    """R8.3: parts of their two segments at which runs `first` and `after` meet.

    The first part is -1 if they need not meet.  A gap that rounding has closed is closed at once.
    Velocities are counted from that of the gap's left ball; that ball only rises and the other only
    falls.
    """
    gap = run[first].last + 1
    wide = max(-contact[gap].u, 0.0)
    rise = ball[gap].pull * run[first].reach if run[first].high == gap - 1 else 0.0
    fall = -ball[gap + 1].pull * run[after].reach if run[after].low == after else 0.0
    blur = LIMITS.roundings * (contact[gap].blur + 2.0**-53 * (rise + fall))
    if rise + fall <= wide + blur:
        return -1.0, 0.0
    # They overlap from low to high.  Each distance is exact at the ends, meeting = 0 and 1: a run
    # that gets to its own next event must do it.  A narrow overlap keeps its digits.
    low = max(0.0, wide - fall)
    high = min(rise, wide)
    overlap = rise - low if max(rise, fall) < wide else min(rise, min(fall, wide))
    at = low + meeting * overlap if meeting < 1.0 else high
    back = min(fall, wide) - meeting * overlap if meeting < 1.0 else wide - high
    left = at / rise if rise > 0.0 else 0.0
    right = back / fall if fall > 0.0 else 0.0
    if left * LIMITS.simultaneous >= 1.0:
        left = 1.0
    if right * LIMITS.simultaneous >= 1.0:
        right = 1.0
    return left, right


@jit
def first_meeting(n, state):
    """R8.4: of several gaps that must close the one first reached, as its left run, or -1.

    It is the one whose larger part is least, of equals the one whose smaller part is, then the
    left one.
    """
    run, tally = state.run, state.tally[0]
    best = -1
    best_large = best_small = 0.0
    first = tally.first
    while first < n:
        after = run[first].onward
        if after < n and after == run[first].last + 2:
            if run[first].stirred == 1 or run[after].stirred == 1:
                run[first].left, run[first].right = parts_to_meeting(
                    first, after, run, state.ball, state.contact, tally.meeting
                )
            if run[first].left >= 0.0:
                large = max(run[first].left, run[first].right)
                small = min(run[first].left, run[first].right)
                if (
                    best < 0
                    or large < best_large - LIMITS.tie
                    or (large < best_large + LIMITS.tie and small < best_small - LIMITS.tie)
                ):
                    best, best_large, best_small = first, large, small
        first = after
    return best


@jit
def part_beyond(first, part, outward, c, n, state):
    """R8.4: part of the segment of run `first` at which it reaches the gap c beyond, if sooner.

    `outward` is the pull of its ball there, towards the gap; infinite if it does not get there.
    """
    if not is_gap(c, n, state.contact):
        return math.inf
    way = outward * state.run[first].reach
    wide = max(-state.contact[c].u, 0.0)
    if way * part > wide + LIMITS.roundings * (state.contact[c].blur + 2.0**-53 * way):
        return wide / way
    return math.inf
