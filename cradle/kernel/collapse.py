"""R9: collapse, and the first sign of one: contacts that are exhausted.

What they have left is far below the last digit of an answer, and they alone go on making events.
"""

from cradle.kernel.events import deactivate, exhausted, stir
from cradle.kernel.numbers import minus, over, plus, times
from cradle.kernel.state import LIMITS, ONE, ZERO, apart


@apart
def end_plastically(first, last, n, state):
    """End those contacts of first..last that are active; their balls have one velocity."""
    contact, run = state.contact, state.run
    for c in range(first, last + 1):
        contact[c].made = 0.0
        contact[c].tiny = 0
        if contact[c].active == 1:
            begin = c
            while begin > 0 and contact[begin - 1].active == 1:
                begin -= 1
            deactivate(c, begin, n, state.ball, contact, run, state.tally[0])
    for c in (first - 1, last + 1):
        if 0 <= c < n - 1:
            stir(c, n, run, contact)


def change_of(c, low, high, ball, contact):
    """Return how impulses x of contacts low..high change the closing speed of contact c."""
    before = contact[c - 1].x if low <= c - 1 <= high else ZERO
    here = contact[c].x if low <= c <= high else ZERO
    after = contact[c + 1].x if low <= c + 1 <= high else ZERO
    left = times(minus(before, here), ball[c].inverse)
    return minus(left, times(minus(here, after), ball[c + 1].inverse))


@apart
def common_velocity(first, last, left_part, right_part, ball, contact):
    """Leave in x of contacts first..last the impulses that bring their balls to one velocity.

    Tells whether there is one: beside neighbours with larger impulses, masses are below zero.
    """
    # A steady neighbour with h times the impulse of the contact beside it makes the ball between
    # act as one of mass m / (1 - h); the parts are these 1 - h.
    mass = momentum = speed = ZERO  # velocities count from that of the first ball
    for i in range(first, last + 2):
        b = ball[i]
        b.x = b.m
        if i == first:
            b.x = over(b.x, left_part)
        if i == last + 1:
            b.x = over(b.x, right_part)
        mass = plus(mass, b.x)
        momentum = plus(momentum, times(b.x, speed))
        if i <= last:
            speed = minus(speed, contact[i].u)
    if mass.real == 0.0:
        return False
    common = over(momentum, mass)
    impulse = speed = ZERO
    for c in range(first, last + 1):
        impulse = plus(impulse, times(ball[c].x, minus(speed, common)))
        speed = minus(speed, contact[c].u)
        contact[c].x = impulse
    return True


def last_chatter(c, step, n, state):
    """Return the last contact from c on that only chatters; what is between is at rest, empty."""
    # It is or was in an exhausted collision, or in one at a speed far below that: dust.
    tally, last, j = state.tally[0], c, c + step
    while 0 <= j < n - 1:
        k = state.contact[j]
        now = k.active == 1 and k.w > 0.0
        dust = k.hits > 0 and k.made < LIMITS.dust * tally.fastest
        gone = exhausted(j, k.w if now else k.q.real, state.ball, state.contact, tally)
        if gone and (now or dust or k.tiny > 0):
            last = j
        elif k.u.real != 0.0 or k.q.real > 0.0:
            break
        j += step
    return last


@apart
def merge(first, last, n, state):
    """Bring the balls of first..last to one velocity; return what has ended, first..last."""
    # Balls joined to theirs by zeros go with them; idle neighbours that this makes approach join.
    ball, contact = state.ball, state.contact
    while True:
        low, high = first, last
        while low > 0 and contact[low - 1].u.real == 0.0:
            low -= 1
        while high < n - 2 and contact[high + 1].u.real == 0.0:
            high += 1
        common_velocity(low, high, ONE, ONE, ball, contact)
        for c in (low - 1, high + 1):
            if 0 <= c < n - 1:
                contact[c].u = plus(contact[c].u, change_of(c, low, high, ball, contact))
        for c in range(low, high + 1):
            contact[c].p = plus(contact[c].p, contact[c].x)
            contact[c].u = ZERO
        if low > 0 and contact[low - 1].active == 0 and contact[low - 1].u.real > 0.0:
            first = low - 1
        elif high < n - 2 and contact[high + 1].active == 0 and contact[high + 1].u.real > 0.0:
            last = high + 1
        else:
            break
    end_plastically(first, last, n, state)
    return first, last


@apart
def merge_exhausted(c, n, state):
    """Merge the contacts around c that only chatter; return (first, last), empty if none are."""
    # One must lose energy, unless all are dust: elastic sequences are finite, or hand it all on.
    contact, run, tally = state.contact, state.run, state.tally[0]
    first, last = last_chatter(c, -1, n, state), last_chatter(c, 1, n, state)
    loses = False
    fastest = 0.0
    for k in range(first, last + 1):
        loses = loses or contact[k].e.real < 1.0
        fastest = max(fastest, abs(contact[k].u.real))
    if loses or fastest < LIMITS.dust * tally.fastest:
        begin, end = run[n - 1].onward, run[n - 1].back
        if begin < first or run[end].last > last:
            tally.margin = 0.0  # others go on in each round, and how many were left decides
        return merge(first, last, n, state)
    return c, c - 1
