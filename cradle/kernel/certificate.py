"""Every answer is checked before it is returned: momentum, order, energy, ledger."""

import math

from cradle.kernel.motion import closing, relative_energy
from cradle.kernel.state import ENERGY, LEDGER, LIMITS, MOMENTUM, ORDER, apart


@apart
def certify(n, state):
    """Return what the outcome breaks, or 0; each sum within the rounding of its terms.

    Every increment of an impulse is rounded once in the impulse and once in each ball, so a ball's
    momentum is known to a few roundings of the impulses that it has had, however many.  Works are
    products of impulses and closing speeds, so energies are known to a few roundings of all works,
    and of their sums over the balls.
    """
    ball, contact, unit = state.ball, state.contact, math.ldexp(1.0, -state.tally[0].shift)
    before = 0.0
    absorbed = 0.0
    lost = 0.0
    fastest = 0.0
    now = relative_energy(0, n - 1, ball)
    for i in range(n):
        after = contact[i].p if i < n - 1 else 0.0
        change = (ball[i].hi - ball[i].v * unit) + ball[i].lo
        if not abs(ball[i].m * change - (before - after)) <= LIMITS.sound * (before + after):
            return MOMENTUM
        before = after
        ball[i].x, ball[i].y = ball[i].hi, ball[i].lo
        fastest = max(fastest, abs(ball[i].hi - ball[0].hi), abs(ball[i].v - ball[0].v) * unit)
    for c in range(n - 1):
        if not closing(c, ball) <= LIMITS.sound * fastest:
            return ORDER
        absorbed += contact[c].a
        lost += (1.0 - contact[c].e * contact[c].e) * contact[c].a
    # Energies relative to the centre of mass: what a common velocity adds says nothing here.
    for i in range(n):
        ball[i].hi, ball[i].lo = ball[i].v * unit, 0.0
    at_first = relative_energy(0, n - 1, ball)
    for i in range(n):
        ball[i].hi, ball[i].lo = ball[i].x, ball[i].y
    slack = (LIMITS.sound + n * LIMITS.digits) * (at_first + absorbed)
    if not now <= at_first + slack:
        return ENERGY
    if not abs(at_first - now - lost) <= slack:
        return LEDGER
    return 0
