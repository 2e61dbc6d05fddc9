"""The event loop: rounds of events, each a closed-form root of the impulses (R8)."""

import math

from cradle.kernel.cycles import take_limits
from cradle.kernel.events import close_contacts, end_contacts, grow, reduced_mass, start
from cradle.kernel.meeting import first_meeting, who_goes
from cradle.kernel.numbers import ONE, ZERO, minus, negative, over, plus, read, scaled, times
from cradle.kernel.record import record, record_compressions
from cradle.kernel.rules import pull_beside, pulls_at, rates, segment
from cradle.kernel.snapshot import forget
from cradle.kernel.state import (
    CLOSE,
    FINISHED,
    LIMITS,
    LOWER,
    NO_EVENT,
    PASSED,
    PAUSED,
    UNFINISHED,
    UNSOUND,
    UPPER,
    apart,
    jit,
)


@jit
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


@jit
def set_speed(k, u, change, tally):
    """Set the closing speed of a contact whose balls have changed by so much, both together.

    What is zero but for its last digits is zero.  An idle contact that has passed it is a defect.
    """
    k.made += change
    k.u = u
    if abs(u.real) <= LIMITS.tie * k.made:
        k.u = ZERO
    elif k.active == 0 and u.real > 0.0:
        tally.defect = PASSED


@jit
def advance(first, n, state):
    """Take a run straight on its way: velocities are linear in the impulses, works quadratic."""
    ball, contact, run, tally = state.ball, state.contact, state.run, state.tally[0]
    low, high, s = run[first].low, run[first].high, run[first].way
    for c in range(max(low - 1, 0), min(high + 1, n - 2) + 1):
        k = contact[c]
        own = low <= c <= high
        if not own and k.active == 1:
            continue  # it waits
        slope = k.slope if own else pull_beside(c, low, ball)
        pulls = pulls_at(c, ball) if own else abs(slope.real)
        ends = run[first].goes == 2 and k.due == 1
        now = k.final if ends else plus(k.u, times(slope, s))
        if own:
            impulse = times(k.rate, s)
            k.p = plus(k.p, impulse)
            if k.fixed == 1 and impulse.real > 0.0:
                k.held = 1
            if k.fixed == 0:
                book_work(k, impulse, now)
        elif k.stamp < tally.stamp:
            k.before, k.stamp = negative(k.u), tally.stamp
        if ends:
            k.q = ZERO
            k.u, k.made = now, abs(now.real)  # known by construction
        else:
            set_speed(k, now, pulls * s.real, tally)
    run[first].stirred = 1


@jit
def go(n, state):
    """R8.3 to R8.6: take every run on; close the gap at which two of them meet."""
    run, contact, tally = state.run, state.contact, state.tally[0]
    tally.stamp += 1
    gap = who_goes(first_meeting(n, state), n, state)
    first = tally.first
    while first < n:
        if run[first].goes > 0:
            if not run[first].way.real < math.inf:
                tally.defect = NO_EVENT
                return
            if tally.capacity > 0:
                record_compressions(first, run[first].way, n, state)
            advance(first, n, state)
        first = run[first].onward
    if gap >= 0:
        if contact[gap].u.real != 0.0:
            tally.defect = PASSED
        contact[gap].u, contact[gap].made = ZERO, 0.0
        grow(gap, n, state.ball, contact, run, tally)
        record(CLOSE, gap, n, state)


@apart
def prepare(n, chain, meeting, state):
    """Write the chain into the state, in units of its own, powers of two; R2."""
    ball, contact, tally = state.ball, state.contact, state.tally[0]
    largest = heaviest = 0.0
    for i in range(n):
        largest = max(largest, abs(chain.v[i]))
        heaviest = max(heaviest, chain.m[i])
    # The units themselves and their inverses are numbers too.
    tally.shift = min(max(math.frexp(largest)[1], -1000), 1023)
    tally.mass_shift = min(max(math.frexp(heaviest)[1], -1000), 1023)
    tally.unit, mass_unit = math.ldexp(1.0, -tally.shift), math.ldexp(1.0, -tally.mass_shift)
    tally.meeting = read(meeting)
    tally.events = tally.rounds = tally.stamp = tally.collapsed = tally.defect = 0
    tally.cut_off, tally.fastest, tally.energy, tally.margin = LIMITS.cut, 0.0, 0.0, 1.0
    for i in range(n):
        b = ball[i]
        b.v = chain.v[i]
        b.start = scaled(read(chain.v[i]), tally.unit)
        b.m = scaled(read(chain.m[i]), mass_unit)
        b.inverse = over(ONE, b.m)
        b.pull = ZERO
        b.turn = 0
        tally.cut_off = min(tally.cut_off, LIMITS.cut * b.m.real)
    for c in range(n - 1):
        k = contact[c]
        k.e = read(chain.e[c])
        k.square = times(k.e, k.e)
        if c < n - 2:
            k.forward, k.backward = read(chain.forward[c]), read(chain.backward[c])
        k.u = minus(ball[c].start, ball[c + 1].start)
        k.made = abs(ball[c].start.real) + abs(ball[c + 1].start.real)
        k.before = negative(k.u)
        k.q = k.p = k.a = k.rate = k.slope = ZERO
        k.w = 0.0
        k.active = k.tiny = k.hits = k.held = k.fixed = k.due = k.stamp = 0
        if k.u.real > 0.0:
            tally.fastest = max(tally.fastest, k.u.real)
            tally.energy = max(tally.energy, reduced_mass(c, ball) * k.u.real * k.u.real)
    forget(LOWER, state.level)
    forget(UPPER, state.level)
    start(n, state)


@jit
def new_rates(n, state):
    """Work out the rates of the runs that have changed; tell whether a contact is about to open."""
    run, tally = state.run, state.tally[0]
    opening = False
    first = tally.first
    while first < n:
        if run[first].stirred == 1:
            opens = rates(first, run, state.ball, state.contact, tally)
            opening = opening or opens
            tally.effort -= 2 + run[first].high - run[first].low
        first = run[first].onward
    return opening


@jit
def new_segments(n, state):
    """R8.2: work out the segments of the runs that have changed."""
    run, tally = state.run, state.tally[0]
    first = tally.first
    while first < n:
        if run[first].stirred == 1:
            segment(first, n, run, state.ball, state.contact, tally)
        first = run[first].onward


@jit
def impact(n, chain, meeting, max_rounds, resumed, state):
    """Solve one impact: run rounds until no contact is active; return the status.

    With tally.effort or tally.room used up it stops, PAUSED, to be `resumed`.
    """
    tally = state.tally[0]
    if not resumed:
        prepare(n, chain, meeting, state)
    while True:
        if tally.effort < 0 or tally.events > tally.room:
            return PAUSED
        # R8.1: ends first, those that are known without the slopes before the others; then R9.
        tally.ends, tally.worn = 0, -1
        end_contacts(False, n, state)
        certain = tally.ends
        if new_rates(n, state):
            end_contacts(True, n, state)
        collapsed = tally.ends > 0 and take_limits(n, state)
        if tally.first >= n:
            break
        tally.rounds += 1
        if tally.rounds > max_rounds:
            return UNFINISHED
        # R8.1: then closings; both need no progress, so the next round looks again.
        if tally.ends > certain or collapsed or close_contacts(n, state):
            continue
        # R8.2 to R8.6: progress.
        new_segments(n, state)
        go(n, state)
        if tally.defect > 0:
            return UNSOUND
    return FINISHED
