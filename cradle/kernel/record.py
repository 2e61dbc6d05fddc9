"""What is written down: events, and velocities and impulses in the caller's units."""

import math

from cradle.kernel.state import MAXIMUM_COMPRESSION, apart, jit


@jit
def in_units(b, speed, unit):
    """Return a velocity of ball b in the caller's units: as given, if it has not changed."""
    return b.v if speed == b.v * unit else speed / unit


@apart
def write(k, kind, c, n, state):
    """Write event number k, with the velocities x of the balls and impulses x of the contacts."""
    record, tally = state.record, state.tally[0]
    record.kinds[k] = kind
    record.contacts[k] = c
    path = record.velocities[k + 1]
    for i in range(n):
        path[i] = in_units(state.ball[i], state.ball[i].x, tally.unit)
    path = record.impulses[k + 1]
    for j in range(n - 1):
        path[j] = math.ldexp(state.contact[j].x, tally.shift + tally.mass_shift)


@apart
def write_present(kind, c, n, state):
    """Write an event and the state after it."""
    ball, contact = state.ball, state.contact
    for i in range(n):
        ball[i].x = ball[i].hi
    for j in range(n - 1):
        contact[j].x = contact[j].p
    write(state.tally[0].events, kind, c, n, state)


@jit
def record(kind, c, n, state):
    """Count an event; write it and the state after it, if there is room."""
    if state.tally[0].events < state.tally[0].capacity:
        write_present(kind, c, n, state)
    state.tally[0].events += 1


@apart
def record_compressions(first, s, whole, n, state):
    """Record every maximum compression of a run within the next s, in order of progress.

    It changes no rate, so the run itself does not stop for it: the state there is made on the side.
    """
    ball, contact, run, tally = state.ball, state.contact, state.run, state.tally[0]
    low, high = run[first].low, run[first].high
    for c in range(low, high + 1):
        k = contact[c]
        ends = whole and k.due == 1
        k.passes = 1 if k.u > 0.0 and (ends or k.u + k.slope * s <= 0.0) else 0
    while True:
        found = -1
        at = 0.0
        for c in range(low, high + 1):
            k = contact[c]
            if k.passes == 1 and (found < 0 or -k.u / k.slope < at):
                found = c
                at = -k.u / k.slope
        if found < 0:
            return
        contact[found].passes = 0
        at = min(at, s)
        if tally.events < tally.capacity:
            for i in range(n):
                b = ball[i]
                moves = low <= i <= high + 1
                b.x = b.hi + (b.lo + b.pull * at) if moves else b.hi
            one, other = ball[found], ball[found + 1]
            one.x = other.x = one.x if one.m > other.m else other.x
            for j in range(n - 1):
                k = contact[j]
                k.x = k.p + k.rate * at if low <= j <= high else k.p
            write(tally.events, MAXIMUM_COMPRESSION, found, n, state)
        tally.events += 1
