"""What is written down; a record is made beside the run and changes nothing in it."""

import math

from cradle.kernel.numbers import least, less, minus, negative, over, plus, times
from cradle.kernel.state import LIMITS, MAXIMUM_COMPRESSION, NEVER, ZERO, apart


def velocity(b, change, unit):
    """Return a ball's velocity in the caller's units after a change; untouched it is as given."""
    return b.v if change.real == 0.0 else plus(b.start, change).real / unit


@apart
def write(kind, c, n, state, low, high, way):
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


def record(kind, c, n, state, low=0, high=-1, way=ZERO):
    """Count an event; write it and the state after it, if there is room; contacts as `write`."""
    if state.tally[0].events < len(state.record.kinds):
        write(kind, c, n, state, low, high, way)
    state.tally[0].events += 1


def goes_all(one):
    """Tell whether a run goes all of its segment: the events at its end are due then."""
    return one.part.real == 1.0 and one.part.imag == 0.0


@apart
def record_compressions(one, n, state):
    """Record every maximum compression of a run on its way, in order: it does not stop for them."""
    contact = state.contact
    low, high, way = one.low, one.high, one.way
    for c in range(low, high + 1):
        k = contact[c]
        k.x = NEVER
        if k.u.real > 0.0 and k.slope.real < 0.0:
            at = over(k.u, negative(k.slope))
            # One that comes at the end of the way is one of it, whatever its last digits say.
            late = minus(at, way).real
            if late <= LIMITS.tie * k.age or (k.due == 1 and goes_all(one)):
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
        record(MAXIMUM_COMPRESSION, found, n, state, low, high, least(at, way))
