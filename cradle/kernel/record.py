"""What is written down, and the check that every answer has to pass before it is returned.

A record is made beside the run and changes nothing in it.
"""

import math

from cradle.kernel.numbers import NEVER, ZERO, least, less, minus, negative, over, plus, times
from cradle.kernel.state import (
    ENERGY,
    LEDGER,
    LIMITS,
    MAXIMUM_COMPRESSION,
    MOMENTUM,
    ORDER,
    PULL,
    apart,
)


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
def certify(n, ball, contact, tally):
    """Return what a settled outcome breaks, or 0; each sum within the rounding of its terms.

    The loop follows closing speeds and works, velocities come from impulses alone: so they must
    part as the closing speeds say, and the energy lost, impulse times mean closing speed, must be
    what the contacts keep back, (1 - e^2) of their work.
    """
    unit = tally.unit
    momentum = terms = grain = 0.0
    lost = kept = absorbed = energy = 0.0
    strongest = weakest = least_work = 0.0
    speed = plus(ball[0].start, ball[0].x)
    for i in range(n):
        b = ball[i]
        push = contact[i].p.real if i < n - 1 else 0.0
        change = b.after * unit - b.v * unit
        momentum += b.m.real * change
        terms += b.m.real * (abs(change) + abs(b.start.real)) + abs(push)
        grain += b.m.real * (5e-324 * unit)  # no finer velocity is a float
        if i == n - 1:
            break
        k, right = contact[i], ball[i + 1]
        next_speed = plus(right.start, right.x)
        closing = minus(speed, next_speed).real
        spread = abs(speed.real) + abs(next_speed.real) + tally.fastest
        slack = LIMITS.sound * spread
        if not (closing <= slack and abs(closing - k.u.real) <= slack):
            return ORDER
        if (b.after - right.after) * unit > LIMITS.tie * spread:
            return ORDER
        speed = next_speed
        first = minus(b.start, right.start).real
        lost += 0.5 * push * (first + closing)
        energy += abs(push) * (abs(first) + abs(closing))
        kept += (1.0 - k.square.real) * k.a.real
        absorbed += k.a.real
        strongest, weakest = max(strongest, push), min(weakest, push)
        least_work = min(least_work, k.a.real)
    slack = (LIMITS.sound + n * 2.0**-52) * (energy + absorbed)
    if not abs(momentum) <= LIMITS.sound * terms + grain < math.inf:
        return MOMENTUM
    if least_work < -slack or weakest < -LIMITS.sound * strongest:
        return PULL
    if not -lost <= slack < math.inf:
        return ENERGY
    if not abs(lost - kept) <= slack:
        return LEDGER
    return 0


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


def record(kind, c, n, state):
    """Count an event; write it and the state after it, if there is room."""
    if state.tally[0].events < state.tally[0].capacity:
        write(kind, c, 0, -1, ZERO, n, state)
    state.tally[0].events += 1


def goes_all(one):
    """Tell whether a run goes all of its segment: the events at its end are due then."""
    return one.part.real == 1.0 and one.part.imag == 0.0


@apart
def record_compressions(one, n, state):
    """Record every maximum compression of a run on its way, in order of progress.

    It changes no rate, so the run itself does not stop for it: the state there is made on the side.
    """
    contact, tally = state.contact, state.tally[0]
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
        if tally.events < tally.capacity:
            write(MAXIMUM_COMPRESSION, found, low, high, least(at, way), n, state)
        tally.events += 1
