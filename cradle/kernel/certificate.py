"""Every answer is checked before it is returned: momentum, pushes, order, energy, ledger."""

import math

from cradle.kernel.numbers import minus, plus
from cradle.kernel.state import ENERGY, LEDGER, LIMITS, MOMENTUM, ORDER, PULL, apart


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
    strongest = weakest = least = 0.0
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
        lost += 0.5 * k.p.real * (first + closing)
        energy += abs(k.p.real) * (abs(first) + abs(closing))
        kept += (1.0 - k.square.real) * k.a.real
        absorbed += k.a.real
        strongest, weakest, least = (
            max(strongest, k.p.real), min(weakest, k.p.real), min(least, k.a.real)
        )  # fmt: skip
    slack = (LIMITS.sound + n * 2.0**-52) * (energy + absorbed)
    if not abs(momentum) <= LIMITS.sound * terms + grain < math.inf:
        return MOMENTUM
    if least < -slack or weakest < -LIMITS.sound * strongest:
        return PULL
    if not -lost <= slack < math.inf:
        return ENERGY
    if not abs(lost - kept) <= slack:
        return LEDGER
    return 0
