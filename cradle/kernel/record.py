"""What is written down: events, and velocities and impulses in the caller's units.

A record is made beside the run and changes nothing in it.
"""

import math

from cradle.kernel.numbers import NEVER, ZERO, least, less, minus, negative, over, plus, times
from cradle.kernel.state import LIMITS, MAXIMUM_COMPRESSION, apart, jit


@jit
def velocity(b, change, unit):
    """Return the velocity of a ball in the caller's units, from what impulses have changed it by.

    One that has not been touched is as given.
    """
    return b.v if change.real == 0.0 else plus(b.start, change).real / unit


@apart
def settle(n, ball, contact, unit):
    """Leave changes of velocity in `x`, velocities in `after`, these in the caller's units.

    Balls that move as one, or whose order is lost in the last of 32 digits, have one velocity:
    that of the ball which impulses have changed least.
    """
    before = ZERO
    for i in range(n):
        after = contact[i].p if i < n - 1 else ZERO
        ball[i].x = times(minus(before, after), ball[i].inverse)
        ball[i].after = velocity(ball[i], ball[i].x, unit)
        before = after
    first = 0
    while first < n:
        last = best = first
        while last < n - 1 and (
            contact[last].u.real == 0.0
            or (contact[last].u.real < 0.0 and ball[last].after > ball[last + 1].after)
        ):
            last += 1
            if abs(ball[last].x.real) < abs(ball[best].x.real):
                best = last
        v = ball[best].after
        for i in range(first, last + 1):
            ball[i].after = v
        first = last + 1


@apart
def write(kind, c, low, high, way, n, state):
    """Write an event and the state when contacts low..high have gone so far on at their rates."""
    record, tally = state.record, state.tally[0]
    ball, contact, k = state.ball, state.contact, tally.events
    record.kinds[k] = kind
    record.contacts[k] = c
    velocities, impulses = record.velocities[k + 1], record.impulses[k + 1]
    before = ZERO
    for i in range(n):
        after = contact[i].p if i < n - 1 else ZERO
        if low <= i <= high:
            after = plus(after, times(contact[i].rate, way))
        change = times(minus(before, after), ball[i].inverse)
        velocities[i] = velocity(ball[i], change, tally.unit)
        if i < n - 1:
            impulses[i] = math.ldexp(after.real, tally.shift + tally.mass_shift)
        before = after


@jit
def record(kind, c, n, state):
    """Count an event; write it and the state after it, if there is room."""
    if state.tally[0].events < state.tally[0].capacity:
        write(kind, c, 0, -1, ZERO, n, state)
    state.tally[0].events += 1


@apart
def record_compressions(first, way, n, state):
    """Record every maximum compression of a run on its way, in order of progress.

    It changes no rate, so the run itself does not stop for it: the state there is made on the side.
    """
    contact, run, tally = state.contact, state.run, state.tally[0]
    low, high = run[first].low, run[first].high
    for c in range(low, high + 1):
        k = contact[c]
        k.x = NEVER
        if k.u.real > 0.0 and k.slope.real < 0.0:
            at = over(k.u, negative(k.slope))
            ends = run[first].goes == 2 and k.due == 1
            # One that comes at the end of the way is one of it, whatever its last digits say.
            if ends or minus(at, way).real <= LIMITS.tie * k.age:
                k.x = at
    while True:
        found = low
        for c in range(low, high + 1):
            if less(contact[c].x, contact[found].x):
                found = c
        at = contact[found].x
        if at.real == math.inf:
            return
        contact[found].x = NEVER
        if tally.events < tally.capacity:
            write(MAXIMUM_COMPRESSION, found, low, high, least(at, way), n, state)
        tally.events += 1
