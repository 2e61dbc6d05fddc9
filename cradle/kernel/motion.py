"""Velocities: sums of two numbers, moved by impulses of contacts and by nothing else.

A light ball may shuttle a thousand times as fast as the heavy balls beside it.  Closing speeds
alone would lose track of how these move, single velocities of how slowly some balls part.
"""

import math

from cradle.kernel.state import LIMITS, apart, jit


@jit
def add(high, low, x):
    """Add x to a sum of two numbers, keeping what the addition rounds off (Knuth's two-sum)."""
    total = high + x
    part = total - high
    x = ((high - (total - part)) + (x - part)) + low
    high = total + x
    return high, x - (high - total)


@jit
def add_velocity(b, x):
    """Add x to the velocity of ball b."""
    b.hi, b.lo = add(b.hi, b.lo, x)


@jit
def add_impulse(k, x):
    """Add x to the impulse of contact k."""
    k.p, k.p_lo = add(k.p, k.p_lo, x)


@jit
def add_work(k, x):
    """Add x to the work that contact k has absorbed."""
    k.a, k.a_lo = add(k.a, k.a_lo, x)


@jit
def add_store(k, x):
    """Add x to the work that contact k can still release, which is never below nothing.

    A contact that rests on the edge of a long sequence gives it away in portions, hundreds of
    thousands of them and each below the last digit of the whole.
    """
    k.q, k.q_lo = add(k.q, k.q_lo, x)
    if k.q <= 0.0:
        k.q = k.q_lo = 0.0


@jit
def closing(c, ball):
    """Return the closing speed of contact c from the velocities of its balls."""
    return (ball[c].hi - ball[c + 1].hi) + (ball[c].lo - ball[c + 1].lo)


@jit
def closing_parts(c, ball):
    """Return the closing speed of contact c to all digits, as a sum of two numbers."""
    speed = ball[c].hi - ball[c + 1].hi
    part = speed - ball[c].hi
    rest = (ball[c].hi - (speed - part)) - (ball[c + 1].hi + part)
    return speed, rest + (ball[c].lo - ball[c + 1].lo)


@jit
def reduced_mass(c, ball):
    """Return the reduced mass of the two balls of contact c."""
    return ball[c].m / (ball[c].m + ball[c + 1].m) * ball[c + 1].m


@jit
def heaviest_of(first, last, ball):
    """Return the heaviest of balls first..last."""
    k = first
    for i in range(first + 1, last + 1):
        k = i if ball[i].m > ball[k].m else k
    return k


@jit
def one_velocity(first, last, k, ball):
    """Write the velocity of ball k, to the last bit, for all balls first..last."""
    for i in range(first, last + 1):
        ball[i].hi = ball[k].hi
        ball[i].lo = ball[k].lo


@jit
def bodies(c, low, high, ball, contact):
    """Return what moves as one with each ball of contact c: first and last ball, and both masses.

    Balls that zeros of contacts low..high join are one body.
    """
    first = c
    left = ball[c].m
    while first > low and contact[first - 1].u == 0.0:
        first -= 1
        left += ball[first].m
    last = c + 1
    right = ball[last].m
    while last <= high and contact[last].u == 0.0:
        last += 1
        right += ball[last].m
    return first, last, left, right


@jit
def push(c, impulse, body, ball, contact):
    """Give contact c an impulse; contacts inside its two bodies pass on what their balls need."""
    first, last, left, right = body
    add_impulse(contact[c], impulse)
    part = 0.0
    for i in range(first, c + 1):
        add_velocity(ball[i], -impulse / left)
        part += ball[i].m
        if i < c:
            add_impulse(contact[i], impulse * (part / left))
    part = 0.0
    for j in range(c + 1, last + 1):
        i = last + c + 1 - j
        add_velocity(ball[i], impulse / right)
        part += ball[i].m
        if i > c + 1:
            add_impulse(contact[i - 1], impulse * (part / right))


@jit
def push_at_work(c, impulse, body, ball, contact):
    """Push active contact c, and book the work, absorbed or released; one that ends has no more."""
    k = contact[c]
    u = k.u
    push(c, impulse, body, ball, contact)
    k.u = closing(c, ball)
    work = 0.5 * impulse * (u + k.u)
    if u > 0.0:
        k.w += work
        add_work(k, work)
        add_store(k, k.e * k.e * work)
    elif k.q > 0.0:
        add_store(k, work)


@apart
def set_closing_speed(c, speed, rest, low, high, ball, contact):
    """Bring the closing speed of contact c to speed + rest by a push of its balls.

    At zero the balls of both bodies have one velocity to the last bit.
    """
    body = bodies(c, low, high, ball, contact)
    first, last, left, right = body
    speed_now, rest_now = closing_parts(c, ball)
    x = (speed_now - speed) + (rest_now - rest)
    push(c, x * (left / (left + right) * right), body, ball, contact)
    if speed == 0.0:
        one_velocity(first, last, heaviest_of(first, last, ball), ball)
    contact[c].u = speed
    contact[c].blur = 2.0**-53 * abs(speed)
    for k in (first - 1, last):
        if low <= k <= high:
            contact[k].u = closing(k, ball)


@jit
def next_inwards(c, low, high, contact):
    """Return the first contact of the run low..high beside contact c that is not at zero, or -1."""
    step = 1 if c < low else -1
    k = low if c < low else high
    while low <= k <= high and contact[k].u == 0.0:
        k += step
    return k if low <= k <= high else -1


@jit
def handed_on(c, low, high, ball, contact):
    """Return how fast what is behind it recoils for one unit that `arrive` moves the run's ball.

    That is the ratio of the masses of two bodies: of the ball at contact c, and of what lies beyond
    the contact inwards, through which it is pushed.  It is infinite if there is no such contact.
    """
    k = next_inwards(c, low, high, contact)
    if k < 0:
        return math.inf
    _, _, left, right = bodies(k, low, high, ball, contact)
    return left / right if c < low else right / left


@jit
def is_throw(speed, low, high, contact):
    """Tell whether a change of velocity by `speed` is more than rounding of the run low..high."""
    fastest = 0.0
    for c in range(low, high + 1):
        fastest = max(fastest, abs(contact[c].u), abs(contact[c].u0))
    return speed > LIMITS.tie * fastest


@apart
def arrive(c, low, high, n, ball, contact):
    """Let contact c beside the run low..high be at zero: the run's ball takes the other's velocity.

    The two differ by rounding, most often by that of what the run's last impulse did to this ball,
    and to those that zeros join to it.  Where it is more, the impulse of the contact inwards is
    corrected first: a push moves whatever rests on its balls, but what is taken back is taken from
    the run alone, since no contact pulls.  If there is no such contact, or a light ball beyond it
    would be thrown, one that has not quite arrived is left as it is, but for dust.
    """
    k = next_inwards(c, low, high, contact)
    near = -closing(c, ball)
    if k < 0 or is_throw(abs(near) * handed_on(c, low, high, ball, contact), low, high, contact):
        contact[c].u = -near
        if near < LIMITS.dust:
            set_closing_speed(c, 0.0, 0.0, 0, n - 2, ball, contact)
        return
    begin, end = (0, n - 2) if near >= 0.0 else (low, high)
    body = bodies(k, begin, end, ball, contact)
    first, last, left, right = body
    impulse = near * (left if c < low else right)
    if abs(impulse) > LIMITS.digits * contact[k].p:
        push_at_work(k, impulse, body, ball, contact)
    if c < low:
        one_velocity(low, k, c, ball)
    else:
        one_velocity(k + 1, high + 1, c + 1, ball)
    for j in (first - 1, k, last):
        if 0 <= j <= n - 2:
            contact[j].u = closing(j, ball)
    contact[c].u = contact[c].blur = 0.0


@apart
def share_out(first, last, before, after, ball, contact):
    """Leave in x of contacts first..last the impulses that change the velocities by the balls' x.

    `before` and `after` are the impulses of the contacts beside them.  Each sum begins at its own
    end and stops at the heaviest ball, so that the impulse of a light one keeps its digits.
    """
    k = heaviest_of(first, last + 1, ball)
    impulse = before
    for c in range(first, k):
        impulse -= ball[c].m * ball[c].x
        contact[c].x = impulse
    impulse = after
    for j in range(k, last + 1):
        c = last + k - j
        impulse += ball[c + 1].m * ball[c + 1].x
        contact[c].x = impulse


@apart
def join_velocities(first, last, ball, contact):
    """Bring balls first..last to one velocity by impulses of the contacts between them."""
    k = heaviest_of(first, last, ball)
    mass = 0.0
    momentum = 0.0
    for i in range(first, last + 1):
        b = ball[i]
        b.x = -((b.hi - ball[k].hi) + (b.lo - ball[k].lo))
        mass += b.m
        momentum -= b.m * b.x
    for i in range(first, last + 1):
        ball[i].x += momentum / mass
    share_out(first, last - 1, 0.0, 0.0, ball, contact)
    for c in range(first, last):
        add_impulse(contact[c], contact[c].x)
        contact[c].u = contact[c].blur = 0.0
    add_velocity(ball[k], ball[k].x)
    one_velocity(first, last, k, ball)


@apart
def relative_energy(first, last, ball):
    """Kinetic energy of balls first..last relative to their centre of mass."""
    k = heaviest_of(first, last, ball)
    mass = 0.0
    momentum = 0.0
    energy = 0.0
    for i in range(first, last + 1):
        x = (ball[i].hi - ball[k].hi) + (ball[i].lo - ball[k].lo)
        mass += ball[i].m
        momentum += ball[i].m * x
        energy += 0.5 * ball[i].m * x * x
    return energy - 0.5 * momentum * (momentum / mass)
