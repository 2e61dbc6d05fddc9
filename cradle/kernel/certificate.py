"""Every answer is checked before it is returned: momentum, pushes, order, energy, ledger."""

import math

from cradle.kernel.motion import closing
from cradle.kernel.state import ENERGY, LEDGER, LIMITS, MOMENTUM, ORDER, PULL, apart, once


@once
def energies(n, k, ball):
    """Return the change of kinetic energy, and the energies before and after of what has changed.

    Counted from the velocity that ball k, the heaviest of these, had before: what a common velocity
    adds, and what flies on untouched, says nothing here.  The balls' y are the velocities before,
    their x the changes.
    """
    change = 0.0
    size = 0.0
    for i in range(n):
        b = ball[i]
        if b.x != 0.0:
            before = b.y - ball[k].y
            after = before + b.x
            change += b.m * b.x * (before + 0.5 * b.x)
            size += 0.5 * b.m * (before * before + after * after)
    return change, size


@apart
def certify(n, ball, contact, tally):
    """Return what the outcome breaks, or 0; each sum within the rounding of its terms.

    Every increment of an impulse is rounded once in the impulse and once in each ball, so a ball's
    momentum is known to a few roundings of the impulses that it has had, however many; or to the
    last digit of two numbers, where the velocity is far larger than what has changed it.  Works are
    products of impulses and closing speeds, so energies are known to a few roundings of all works,
    and of their sums over the balls.  A contact only pushes, and only absorbs in compression, but
    for the roundings of what it rests on.
    """
    before = 0.0
    weakest = strongest = 0.0
    absorbed = 0.0
    least = 0.0
    lost = 0.0
    spread = 0.0  # the largest velocity relative to ball 0
    heaviest = -1  # of the balls that have changed
    for i in range(n):
        b = ball[i]
        b.y = b.v * tally.unit
        b.x = (b.hi - b.y) + b.lo
        after = contact[i].p if i < n - 1 else 0.0
        slack = LIMITS.sound * (abs(before) + abs(after)) + LIMITS.dust * b.m
        if not abs(b.m * b.x - (before - after)) <= slack < math.inf:
            return MOMENTUM
        weakest, strongest = min(weakest, after), max(strongest, after)
        before = after
        spread = max(spread, abs(b.hi - ball[0].hi), abs(b.y - ball[0].y))
        if b.x != 0.0 and (heaviest < 0 or b.m > ball[heaviest].m):
            heaviest = i
    for c in range(n - 1):
        k = contact[c]
        if not closing(c, ball) <= LIMITS.sound * spread:
            return ORDER
        absorbed += k.a
        lost += (1.0 - k.e * k.e) * k.a
        least = min(least, k.a)
    gained, size = energies(n, heaviest, ball)
    slack = (LIMITS.sound + n * LIMITS.digits) * (size + absorbed)
    if least < -slack or weakest < -(LIMITS.sound * strongest + LIMITS.dust):
        return PULL
    if not gained <= slack < math.inf:
        return ENERGY
    if not abs(gained + lost) <= slack:
        return LEDGER
    return 0
