"""The event loop: rounds of events, each a closed-form root of the impulses (R8); the door."""

import math
from typing import Any, NamedTuple

from cradle.kernel.cycles import forget, take_limits
from cradle.kernel.events import close_contacts, end_contacts, grow, reduced_mass, start
from cradle.kernel.meeting import first_meeting, who_goes
from cradle.kernel.numbers import ONE, ZERO, minus, negative, over, plus, read, scaled, times
from cradle.kernel.record import certify, goes_all, record, record_compressions, settle
from cradle.kernel.rules import course
from cradle.kernel.state import (
    CLOSE,
    FINISHED,
    LIMITS,
    LOWER,
    NO_EVENT,
    PASSED,
    PAUSED,
    REFUSED,
    UNFINISHED,
    UNSOUND,
    UPPER,
    apart,
    door,
)


class Inputs(NamedTuple):
    """Chains: one a row, or one row for all."""

    m: Any
    v: Any
    e: Any
    forward: Any
    backward: Any


class Options(NamedTuple):
    """How to solve them."""

    meeting: float
    max_events: int  # most rounds; the textbook allows two for each event
    bounded: bool  # refuse ratios above Eq. 53


class Outputs(NamedTuple):
    """Outcomes, a row for each chain; impulses, works and held contacts of the last one alone."""

    v: Any
    hits: Any
    collapsed: Any
    p: Any
    a: Any
    held: Any


def above_bound(ratio, m, driven, onward):
    """R7: tell whether a ratio is above its bound, as `closed_form.largest_ratios` draws it."""
    return ratio > 1.0 / (1.0 + m / driven * (1.0 - onward)) * LIMITS.rounded


@apart
def admissible(n, chain, bounded):
    """Tell whether all inputs are within their limits, ratios within Eq. 53 too if `bounded`."""
    m, v, e, forward, backward = chain.m, chain.v, chain.e, chain.forward, chain.backward
    heaviest = energy = momentum = 0.0
    for i in range(n):
        heaviest = max(heaviest, m[i])
        momentum += 2.0 * (m[i] * abs(v[i]))
        energy += m[i] * v[i] * v[i]
    if not (energy < math.inf and momentum < math.inf):
        return False
    for i in range(n):
        if not (0.0 < m[i] < math.inf and m[i] >= LIMITS.lightest * heaviest):
            return False
    for c in range(n - 1):
        if not (e[c] == 0.0 or LIMITS.least_restitution <= e[c] <= 1.0):
            return False
    for i in range(n - 2):
        if not (0.0 <= forward[i] <= 1.0 and 0.0 <= backward[i] <= 1.0):
            return False
        onward, back = forward[i + 1] if i < n - 3 else 0.0, backward[i - 1] if i > 0 else 0.0
        if bounded and (
            above_bound(forward[i], m[i + 1], m[i + 2], onward)
            or above_bound(backward[i], m[i + 1], m[i], back)
        ):
            return False
    return True


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
    """Take a run straight on its way: velocities are linear in the impulses, works quadratic.

    What is zero but for its last digits is zero.  An idle contact that has passed it is a defect.
    """
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
    one.stirred = 1


def go(n, state):
    """R8.2 to R8.6: take every run on; close the gap at which two of them meet."""
    run, contact, tally = state.run, state.contact, state.tally[0]
    tally.stamp += 1
    gap = who_goes(first_meeting(n, state), n, state)
    first = run[n - 1].onward
    while first < n - 1:
        one = run[first]
        if one.part.real > 0.0:
            one.way = times(one.reach, one.part)
            if not one.way.real < math.inf:
                tally.defect = NO_EVENT
                return
            if tally.capacity > 0:
                record_compressions(one, n, state)
            advance(one, n, state)
        first = one.onward
    if gap >= 0:
        if contact[gap].u.real != 0.0:
            tally.defect = PASSED
        contact[gap].u, contact[gap].made = ZERO, 0.0
        grow(gap, n, state.ball, contact, run)
        record(CLOSE, gap, n, state)


def impact(n, max_rounds, state):
    """Solve one impact: run rounds until no contact is active; return the status.

    With tally.effort or tally.room used up it stops, PAUSED, and can be called again.
    """
    run, tally = state.run, state.tally[0]
    while True:
        if tally.effort < 0 or tally.events > tally.room:
            return PAUSED
        # R8.1: ends first, those that are known without the slopes before the others; then R9.
        tally.ends, tally.worn = 0, -1
        end_contacts(False, n, state)
        certain = tally.ends
        end_contacts(True, n, state)
        collapsed = tally.ends > 0 and take_limits(n, state)
        if run[n - 1].onward == n - 1:
            return FINISHED
        tally.rounds += 1
        if tally.rounds > max_rounds:
            return UNFINISHED
        # R8.1: then closings; both need no progress, so the next round looks again.
        if tally.ends > certain or collapsed or close_contacts(n, state):
            continue
        go(n, state)
        if tally.defect > 0:
            return UNSOUND


@apart
def hand_out(k, n, out, ball, contact, tally):
    """Write the outcome of chain k in the caller's units."""
    shift, mass_shift = tally.shift, tally.mass_shift
    out_v, hits = out.v[k], out.hits[k]
    for i in range(n):
        out_v[i] = ball[i].after
    out.collapsed[k] = tally.collapsed
    for c in range(n - 1):
        hits[c] = contact[c].hits
    for c in range(len(out.p)):
        out.p[c] = math.ldexp(contact[c].p.real, shift + mass_shift)
        out.a[c] = math.ldexp(contact[c].a.real, 2 * shift + mass_shift)
        out.held[c] = contact[c].held


@door
def batch(begin, resumed, n, inputs, options, out, state, effort):
    """Solve the chains of `out` from number `begin` on; return the next one's number, and status.

    It stops at the first chain whose status is not FINISHED: PAUSED, when `effort` (contacts
    touched) is used up, to be `resumed` there.
    """
    ball, contact, tally = state.ball, state.contact, state.tally[0]
    tally.effort, tally.capacity = effort, len(state.record.kinds)
    for k in range(begin, len(out.v)):
        if not resumed:
            chain = Inputs(
                inputs.m[min(k, len(inputs.m) - 1)],
                inputs.v[min(k, len(inputs.v) - 1)],
                inputs.e[min(k, len(inputs.e) - 1)],
                inputs.forward[min(k, len(inputs.forward) - 1)],
                inputs.backward[min(k, len(inputs.backward) - 1)],
            )
            if not admissible(n, chain, options.bounded):
                return k, REFUSED
            prepare(n, chain, options.meeting, state)
        resumed = False
        status = impact(n, options.max_events, state)
        settle(n, ball, contact, tally.unit)
        if status == FINISHED:
            tally.defect = certify(n, ball, contact, tally)
            status = UNSOUND if tally.defect > 0 else FINISHED
        hand_out(k, n, out, ball, contact, tally)
        if status != FINISHED:
            return k, status
    return len(out.v), FINISHED
