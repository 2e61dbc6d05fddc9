"""R8: progress of all runs, and of two that meet: they have no common clock."""

import math

from cradle.kernel.events import grow
from cradle.kernel.numbers import least, less, minus, most, negative, over, plus, scaled, times
from cradle.kernel.record import goes_all, record, record_compressions
from cradle.kernel.rules import active_beside, course, is_clear, segment
from cradle.kernel.state import CLOSE, LIMITS, NEVER, NO_EVENT, ONE, PASSED, ZERO


def parts_to_meeting(one, other, gap, ball, contact, tally):
    """R8.3: work out at what parts of their segments two runs must meet in a gap, if they must."""
    # Velocities count from that of the gap's left ball, which only rises; the other only falls.
    wide, made = negative(contact[gap].u), contact[gap].made
    rise = times(ball[gap].pull, one.reach) if one.high == gap - 1 else ZERO
    fall = negative(times(ball[gap + 1].pull, other.reach)) if other.low == gap + 1 else ZERO
    passed = minus(plus(rise, fall), wide).real
    size = made + rise.real + fall.real
    one.left = NEVER
    # At zero it closes, even if both pushes vanish.
    if wide.real == 0.0 or (is_clear(passed, size, tally) and passed > 0.0):
        # They overlap from low to high; a run that gets to its own next event must do it.
        low, high = minus(wide, fall), least(rise, wide)
        if low.real < 0.0:
            low = ZERO
        at = plus(low, times(tally.meeting, minus(high, low)))
        one.left = part_of(at, rise, made)
        one.right = part_of(minus(wide, at), fall, made)


def part_of(way, whole, made):
    """Return a part of a segment: none or all of it if only rounding says otherwise."""
    rounding = 0.5 * LIMITS.tie * made
    if way.real <= rounding:
        return ZERO
    if minus(whole, way).real <= rounding:
        return ONE
    return over(way, whole)


def first_meeting(n, state):
    """R8.2, R8.4: of several gaps that must close the one first reached, as its left run, or -1."""
    # No run goes yet: all parts are zero.
    run, contact, tally = state.run, state.contact, state.tally[0]
    best = before = -1
    first = run[n - 1].onward
    while first < n - 1:
        run[first].part = ZERO
        if run[first].stirred == 1:
            segment(first, n, run, state.ball, contact, tally)
        if before >= 0 and first == run[before].last + 2:
            if run[before].stirred == 1 or run[first].stirred == 1:
                gap = first - 1
                parts_to_meeting(run[before], run[first], gap, state.ball, contact, tally)
            if run[before].left.real < math.inf and (
                best < 0 or is_reached_sooner(run[before], run[best], tally)
            ):
                best = before
        before = first
        first = run[first].onward
    return best


def is_reached_sooner(one, other, tally):
    """R8.4: compare two gaps by the larger parts of their runs, then the smaller; ties go left."""
    larger = minus(most(one.left, one.right), most(other.left, other.right)).real
    if is_clear(larger, 1.0, tally):
        return larger < 0.0
    smaller = minus(least(one.left, one.right), least(other.left, other.right)).real
    return is_clear(smaller, 1.0, tally) and smaller < 0.0


def part_beyond(first, part, outward, c, n, state):
    """R8.4: part of its segment at which run `first` reaches gap c beyond, if sooner, or NEVER."""
    # `outward` is the pull of its ball there, towards the gap.
    if active_beside(c, n, state.contact) < 2:
        return NEVER
    whole = times(outward, state.run[first].reach)
    wide = negative(state.contact[c].u)
    way = times(whole, part)
    passed = minus(way, wide).real
    if is_clear(passed, state.contact[c].made + way.real, state.tally[0]) and passed > 0.0:
        return over(wide, whole)
    return NEVER


def gap_to_close(one, n, state):
    """R8.4: the gap that closes first, and the parts that run `one` and the next go to it."""
    # They meet; but one that reaches the gap at its far side on the way goes alone.
    run, other, far = state.run, state.run[one].onward, one - 1
    left, right, beyond = run[one].left, run[one].right, run[other].last + 1
    by_left = part_beyond(one, left, negative(state.ball[one].pull), far, n, state)
    by_right = part_beyond(other, right, state.ball[beyond].pull, beyond, n, state)
    if less(by_right, by_left):
        return beyond, ZERO, by_right
    if by_left.real < math.inf:
        return far, by_left, ZERO
    return other - 1, left, right


def book_work(k, impulse, now):
    """R3: book the works of contact k: an impulse takes its closing speed straight to `now`."""
    u = k.u
    if u.real * now.real >= 0.0:
        work = scaled(times(impulse, plus(u, now)), 0.5)
        gain = work if work.real > 0.0 else ZERO
        give = ZERO if work.real > 0.0 else work
    else:
        # Squares of closing speeds share out work: rate u^2 / (2 |slope|) on each side of zero.
        half = over(scaled(impulse, 0.5), minus(u, now))
        gain = times(half, times(u, u))
        give = negative(times(half, times(now, now)))
        if u.real < 0.0:
            gain, give = give, gain
    if gain.real > 0.0 or (impulse.real > 0.0 and max(u.real, now.real) > 0.0):
        k.w += max(gain.real, 5e-324)  # a work that underflows is one nevertheless (R7)
        k.a = plus(k.a, gain)
    k.q = plus(k.q, plus(times(k.square, gain), give))
    if k.q.real <= 0.0:
        k.q = ZERO


def advance(one, n, state):
    """Take a run straight on its way; what is zero but for its last digits is zero."""
    # An idle contact that has passed zero is a defect.
    ball, contact, tally = state.ball, state.contact, state.tally[0]
    low, high = one.low, one.high
    for c in range(max(low - 1, 0), min(high + 1, n - 2) + 1):
        k = contact[c]
        own = low <= c <= high
        if not own and k.active == 1:
            continue  # it waits
        slope, pulls = course(c, low, high, ball, contact)
        ends = k.due == 1 and goes_all(one)
        now = k.final if ends else plus(k.u, times(slope, one.way))
        if own:
            impulse = times(k.rate, one.way)
            k.p = plus(k.p, impulse)
            if k.fixed == 1 and impulse.real > 0.0:
                k.held = 1
            if k.fixed == 0:
                book_work(k, impulse, now)
        elif k.stamp < tally.stamp:
            k.before, k.stamp = negative(k.u), tally.stamp
        k.u = now
        if ends:
            k.q = ZERO
            k.made = abs(now.real)  # known by construction
            continue
        k.made += pulls * one.way.real
        if abs(now.real) <= LIMITS.tie * k.made:
            k.u = ZERO
        elif k.active == 0 and now.real > 0.0:
            tally.defect = PASSED


def go(n, state):
    """R8.2 to R8.6: take all runs to their next events, or the two that meet first to their gap."""
    run, contact, tally = state.run, state.contact, state.tally[0]
    tally.stamp += 1
    met, gap = first_meeting(n, state), -1
    if met >= 0:
        gap, run[met].part, run[run[met].onward].part = gap_to_close(met, n, state)
    first = run[n - 1].onward
    while first < n - 1:
        one = run[first]
        if met < 0:
            one.part = ONE
        one.stirred = 1 if one.part.real > 0.0 else 0
        if one.stirred == 1:
            one.way = times(one.reach, one.part)
            if not one.way.real < math.inf:
                tally.defect = NO_EVENT
                return
            if len(state.record.kinds) > 0:
                record_compressions(one, n, state)
            advance(one, n, state)
        first = one.onward
    if gap >= 0:
        if contact[gap].u.real != 0.0:
            tally.defect = PASSED
        contact[gap].u, contact[gap].made = ZERO, 0.0
        grow(gap, n, state.ball, contact, run)
        record(CLOSE, gap, n, state)
