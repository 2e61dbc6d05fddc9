"""Every answer is checked before it is returned: momentum, order, energy, ledger."""

from cradle.kernel.motion import closing
from cradle.kernel.state import ENERGY, LEDGER, LIMITS, MOMENTUM, ORDER, apart, once


@once
def energies(n, ball, tally):
    """Return the change of kinetic energy, and the energies before and after of what has changed.

    Counted from the centre of mass of the balls that have changed: what a common velocity adds, and
    what flies on untouched, says nothing here.
    """
    unit = tally.unit
    k = -1  # the heaviest of them, from whose velocity all others are counted
    for i in range(n):
        b = ball[i]
        b.y = b.v * unit
        b.x = (b.hi - b.y) + b.lo
        if b.x != 0.0 and (k < 0 or b.m > ball[k].m):
            k = i
    origin = ball[max(k, 0)].y
    mass = 0.0
    momentum = 0.0
    for i in range(n):
        b = ball[i]
        if b.x != 0.0:
            mass += b.m
            momentum += b.m * (b.y - origin)
    change = 0.0
    size = 0.0
    for i in range(n):
        b = ball[i]
        if b.x != 0.0:
            before = (b.y - origin) - momentum / mass
            change += b.m * b.x * (before + 0.5 * b.x)
            size += 0.5 * b.m * (before * before + (before + b.x) * (before + b.x))
    return change, size


@apart
def certify(n, ball, contact, tally):
    """Return what the outcome breaks, or 0; each sum within the rounding of its terms.

    Every increment of an impulse is rounded once in the impulse and once in each ball, so a ball's
    momentum is known to a few roundings of the impulses that it has had, however many; or to the
    last digit of two numbers, where the velocity is far larger than what has changed it.  Works are
    products of impulses and closing speeds, so energies are known to a few roundings of all works,
    and of their sums over the balls.
    """
    unit = tally.unit
    before = 0.0
    absorbed = 0.0
    lost = 0.0
    fastest = 0.0
    for i in range(n):
        after = contact[i].p if i < n - 1 else 0.0
        change = (ball[i].hi - ball[i].v * unit) + ball[i].lo
        slack = LIMITS.sound * (abs(before) + abs(after)) + LIMITS.dust * ball[i].m
        if not abs(ball[i].m * change - (before - after)) <= slack:
            return MOMENTUM
        before = after
        fastest = max(fastest, abs(ball[i].hi - ball[0].hi), abs(ball[i].v - ball[0].v) * unit)
    for c in range(n - 1):
        if not closing(c, ball) <= LIMITS.sound * fastest:
            return ORDER
        absorbed += contact[c].a
        lost += (1.0 - contact[c].e * contact[c].e) * contact[c].a
    gained, size = energies(n, ball, tally)
    slack = (LIMITS.sound + n * LIMITS.digits) * (size + absorbed)
    if not gained <= slack:
        return ENERGY
    if not abs(gained + lost) <= slack:
        return LEDGER
    return 0
