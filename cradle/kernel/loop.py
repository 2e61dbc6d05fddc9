"""The event loop: rounds of events, each a closed-form root of the impulses (R8)."""

import math

from cradle.kernel.certificate import certify
from cradle.kernel.cycles import forget, last_limits, take_limits
from cradle.kernel.events import close_contacts, end_contacts, grow, start
from cradle.kernel.meeting import first_meeting, part_beyond
from cradle.kernel.motion import (
    add_impulse,
    add_store,
    add_velocity,
    add_work,
    arrive,
    closing,
    closing_parts,
    handed_on,
    reduced_mass,
    set_closing_speed,
)
from cradle.kernel.record import record, record_compressions
from cradle.kernel.rules import rates, segment
from cradle.kernel.state import (
    CERTAIN,
    CLOSE,
    FINISHED,
    LIMITS,
    LOWER,
    NO_EVENT,
    PASSED,
    PAUSED,
    SLOPED,
    UNFINISHED,
    UNSOUND,
    UPPER,
    apart,
    jit,
    once,
)


@once
def works(k, s, ended, recent):
    """Book the works of contact k over a progress s that took its closing speed from u0 to u."""
    u0, u1, rate = k.u0, k.u, k.rate
    gain = 0.0  # absorbed
    give = 0.0  # released
    if u0 >= 0.0 and u1 >= 0.0:
        gain = 0.5 * rate * s * (u0 + u1)
    elif u0 <= 0.0 and u1 <= 0.0:
        give = -0.5 * rate * s * (u0 + u1)
    else:
        s0 = s * (u0 / (u0 - u1))
        if u0 > 0.0:
            gain = 0.5 * rate * s0 * u0
            give = -0.5 * rate * (s - s0) * u1
        else:
            give = -0.5 * rate * s0 * u0
            gain = 0.5 * rate * (s - s0) * u1
    k.w += gain
    if k.w == 0.0 and rate * s > 0.0 and max(u0, u1) > 0.0:
        k.w = 5e-324  # a work that underflows is one nevertheless (R7)
    add_work(k, gain)
    recent.a += gain
    if ended:
        k.q = k.q_lo = 0.0
    else:
        add_store(k, k.e * k.e * gain - give)


@once
def end_exactly(low, high, ball, contact):
    """R3: give the contacts that end at this instant the closing speed that they end with.

    With one slope all the time it is -e times that at the start of compression; light balls collide
    so often that a rounding error each time would matter.  From e = 1/2 on no difference of these
    is rounded.
    """
    for c in range(low, high + 1):
        if contact[c].due == 1 and contact[c].final == 0.0:
            set_closing_speed(c, 0.0, 0.0, low, high, ball, contact)
    for c in range(low, high + 1):
        k = contact[c]
        if k.due == 1 and k.final < 0.0:
            final = k.final
            rest = 0.0
            speed = k.e * k.top
            if k.e >= 0.5 and abs(final + speed) < LIMITS.same * speed:
                final = -speed
                rest = (1.0 - k.e) * k.top - (k.top - speed) - k.e * k.tip
            k.top = 0.0
            set_closing_speed(c, final, rest, low, high, ball, contact)


@once
def advance(first, part, n, state):
    """Take a run straight on by a part of its segment.

    Velocities are linear and works quadratic in the progress.  What is zero at the event becomes
    zero to the last bit, by impulses of the run's own contacts.
    """
    ball, contact, run, recent = state.ball, state.contact, state.run, state.memory[LOWER]
    low, high = run[first].low, run[first].high
    s = run[first].reach * part
    whole = part == 1.0
    for c in range(low, high + 1):
        k = contact[c]
        if k.u > 0.0 and k.q == 0.0:
            k.top, k.tip = closing_parts(c, ball)
    for i in range(low, high + 2):
        add_velocity(ball[i], ball[i].pull * s)
    for c in range(low, high + 1):
        k = contact[c]
        k.u0 = k.u
        if k.slope != 0.0:
            k.u = closing(c, ball)
            k.blur += 2.0**-53 * abs(k.slope) * s
        impulse = k.rate * s
        add_impulse(k, impulse)
        recent[c].p += impulse
        if k.fixed == 1 and impulse > 0.0:
            k.held = 1
    if whole:
        end_exactly(low, high, ball, contact)
    for c in range(low, high + 1):
        works(contact[c], s, whole and contact[c].due == 1, recent[c])
    for c in (low - 1, high + 1):
        if 0 <= c < n - 1 and contact[c].active == 0:
            if whole and contact[c].due == 1:
                arrive(c, low, high, n, ball, contact)
            else:
                contact[c].u = closing(c, ball)
                contact[c].blur += 2.0**-53 * abs(ball[low if c < low else c].pull) * s
    run[first].stirred = 1


@jit
def move(first, part, n, state):
    """Take a run straight on by a part of its segment, with a record of it if wanted."""
    if state.tally[0].capacity > 0:
        record_compressions(first, state.run[first].reach * part, part == 1.0, n, state)
    advance(first, part, n, state)


@jit
def touch(gap, n, state):
    """Bring a gap to zero: the ball that has just moved takes the other's velocity.

    If both have, it is the one whose correction moves less what is behind it: the last digit of a
    heavy ball's velocity is a throw for a light one.
    """
    k = state.contact[gap]
    if k.u > max(LIMITS.roundings * k.blur, LIMITS.sound):
        state.tally[0].defect = PASSED
    run, ball = state.run, state.ball
    left, right = run[gap - 1].first, gap + 1
    left_moves = run[left].stirred == 1 and ball[gap].pull != 0.0
    right_moves = run[right].stirred == 1 and ball[gap + 1].pull != 0.0
    if left_moves and right_moves:
        one = handed_on(gap, run[left].low, gap - 1, ball, state.contact)
        other = handed_on(gap, right, run[right].high, ball, state.contact)
        left_moves = one <= other
    if left_moves:
        arrive(gap, run[left].low, gap - 1, n, ball, state.contact)
    elif right_moves:
        arrive(gap, right, run[right].high, n, ball, state.contact)


@once
def touch_closed(n, state):
    """Bring every gap beside a run that has moved to zero, if only rounding says otherwise."""
    contact, run = state.contact, state.run
    first = state.tally[0].first
    while first < n:
        gap, after = run[first].last + 1, run[first].onward
        moved = after < n and (run[first].part >= 0.0 or run[after].part >= 0.0)
        if moved and after == gap + 1 and contact[gap].u >= -LIMITS.roundings * contact[gap].blur:
            touch(gap, n, state)
        first = after


@once
def who_moves(one, n, state):
    """R8.4: let run `one` and the next go to where they meet, and the others stay.

    If one of them reaches the gap at its far side on the way, this gap closes first, and only that
    run moves.  Returns the gap that closes.
    """
    ball, run = state.ball, state.run
    other = run[one].onward
    part_one, part_other = run[one].left, run[one].right
    left, gap, right = one - 1, run[one].last + 1, run[other].last + 1
    beyond_left = part_beyond(one, part_one, -ball[one].pull, left, n, state)
    beyond_right = part_beyond(other, part_other, ball[right].pull, right, n, state)
    if beyond_left < math.inf and beyond_left <= beyond_right:
        gap, part_one, part_other = left, beyond_left, -1.0
    elif beyond_right < math.inf:
        gap, part_one, part_other = right, -1.0, beyond_right
    first = state.tally[0].first
    while first < n:
        run[first].part = -1.0
        first = run[first].onward
    run[one].part, run[other].part = part_one, part_other
    return gap


@once
def go(one, n, state):
    """R8.4 to R8.6: take every run to its own next event, or run `one` and the next to a gap."""
    run, tally = state.run, state.tally[0]
    gap = who_moves(one, n, state) if one >= 0 else -1
    first = tally.first
    while first < n:
        if run[first].part >= 0.0:
            move(first, run[first].part, n, state)
        first = run[first].onward
    touch_closed(n, state)
    if gap >= 0:
        touch(gap, n, state)
        grow(gap, n, state.ball, state.contact, run, tally)
        record(CLOSE, gap, n, state)


@apart
def prepare(n, chain, meeting, state):
    """Write the chain into the state, in its own units; R2."""
    ball, contact, tally = state.ball, state.contact, state.tally[0]
    largest = heaviest = 0.0
    for i in range(n):
        largest = max(largest, abs(chain.v[i]))
        heaviest = max(heaviest, chain.m[i])
    # The units themselves and their inverses are numbers too.
    tally.shift = min(max(math.frexp(largest)[1], -1000), 1023)
    tally.mass_shift = min(max(math.frexp(heaviest)[1], -1000), 1023)
    tally.unit = unit = math.ldexp(1.0, -tally.shift)
    mass_unit = math.ldexp(1.0, -tally.mass_shift)
    tally.events = tally.rounds = tally.collapsed = tally.defect = 0
    tally.cut_off, tally.meeting = LIMITS.cut, meeting
    tally.threshold, tally.energy, tally.margin = 5e-324, 0.0, 1.0
    for i in range(n):
        ball[i].v = chain.v[i]
        ball[i].m = chain.m[i] * mass_unit
        tally.cut_off = min(tally.cut_off, LIMITS.cut * ball[i].m)
        ball[i].hi = chain.v[i] * unit
        ball[i].lo = ball[i].pull = 0.0
        ball[i].turn = 0
    for c in range(n - 1):
        k = contact[c]
        k.e = chain.e[c]
        if c < n - 2:
            k.forward, k.backward = chain.forward[c], chain.backward[c]
        k.u = u = ball[c].hi - ball[c + 1].hi
        k.q = k.q_lo = k.w = k.top = k.tip = k.rate = k.slope = k.blur = 0.0
        k.p = k.p_lo = k.a = k.a_lo = 0.0
        k.before = abs(u)
        k.active = k.tiny = k.hits = k.held = 0
        for level in (LOWER, UPPER):
            then = state.memory[level][c]
            then.p = then.a = 0.0
            then.hits = 0
        if u > 0.0:
            tally.threshold = max(tally.threshold, LIMITS.exhausted * u)
            tally.energy = max(tally.energy, reduced_mass(c, ball) * u * u)
    forget(LOWER, state.level)
    forget(UPPER, state.level)
    start(n, state)


@once
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


@once
def new_segments(n, state):
    """R8.2: work out the segments of the runs that have changed."""
    run, tally = state.run, state.tally[0]
    first = tally.first
    while first < n:
        if run[first].stirred == 1:
            apart_by = segment(first, n, run, state.ball, state.contact)
            tally.margin = min(tally.margin, apart_by)
        first = run[first].onward


@once
def make_ready(n, state):
    """Let every run be about to go to its own next event; if one has none, that is a defect."""
    run, tally = state.run, state.tally[0]
    first = tally.first
    while first < n:
        if not run[first].reach < math.inf:
            tally.defect = NO_EVENT
        run[first].stirred, run[first].part = 0, 1.0
        first = run[first].onward


@once
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
        ends, ended, worn = end_contacts(CERTAIN, n, state)
        more = 0
        if new_rates(n, state):
            more, last, last_worn = end_contacts(SLOPED, n, state)
            ends += more
            ended = last if more > 0 else ended
            worn = max(worn, last_worn)
        collapsed = ends > 0 and take_limits(ends, ended, worn, n, state)
        if tally.first >= n:
            break
        tally.rounds += 1
        if tally.rounds > max_rounds:
            return UNFINISHED
        # R8.1: then closings; both need no progress, so the next round looks again.
        if more > 0 or collapsed or close_contacts(n, state) > 0:
            continue
        # R8.2; R8.3, R8.4: do two runs meet?  R8.4 to R8.6: go.
        new_segments(n, state)
        one = first_meeting(n, state)
        make_ready(n, state)
        if tally.defect == 0:
            go(one, n, state)
        if tally.defect > 0:
            return UNSOUND
    last_limits(n, state)
    tally.defect = certify(n, state.ball, state.contact, tally)
    return UNSOUND if tally.defect > 0 else FINISHED
