"""The event loop: the rules of the Impulse Correlation Ratio on plain indexable sequences.

One source, three runtimes.  This file runs as it stands, compiled by numba (`cradle.runtime`), and
in MicroPython: scalars, loops, sequences and `math`; no classes, no exceptions, no allocation.
The caller passes the work area in and turns the status code into an error.

The rules are those of the chapter on N balls:

R1  relations inside a run         R4  hand-over            R7  largest admissible ratio
R2  start                          R5  closing              R8  two runs that meet
R3  end of a contact               R6  ratio zero           R9  collapse

Notation (n balls; ball i lies between contacts i - 1 and i, contact c between balls c and c + 1;
all in the chain's own units, see `scales`)::

  m[i]         mass                                   e[c]    restitution

  hi[i] lo[i]  velocity as a sum of two numbers, with twice the digits (see `add`)
  u[c]         closing speed, > 0 in compression
  q[c]         work that the contact can still release, e^2 W+ - W-, since it became active
  w[c]         work absorbed since it became active, W+
  top[c] tip[c]  closing speed at which its compression began, as a sum of two numbers
  p[c]         impulse, since the last snapshot       p0[c]   impulse before that
  a[c]         work absorbed, since the last snapshot a0[c]   work absorbed before that
  rate[c]      impulse per unit of progress of the contact's run; the largest of a run is about 1
  slope[c]     closing speed per unit of progress, du/ds
  pull[i]      velocity of ball i per unit of progress, dv/ds
  ratio[i]     ratio in force at ball i                rest[i]      1 - ratio, to all its digits
  until[c]     progress to the contact's own next event
  before[c]    -u of an idle contact at the start of the round, or at its end
  reach[k]     progress of run k to its own next event
  u1[c] q1[c]  snapshot of u and q                    x[i] y[i] z[i]  scratch
  u2[c] q2[c]  the same, of a collapse                p2[c] a2[c]  impulse, work since that

  active[c]    1 while the contact is active
  turn[i]      direction at ball i: 1 forward, -1 backward, 0 none
  fixed[c]     above 0 while the contact is held at u = 0, 2 if its ratio is just the bound
  held[c]      1 if it had an impulse while held by a ratio above the bound
  hits[c]      how often it became active             tiny[c] how many exhausted collisions in a row
  code1[c] hits1[c]  snapshot of what is active and how it is driven, and of hits; code2, hits2
  power[c]     binary exponent of the rate; a flag    first[k], last[k]  the contacts of run k
"""

import math

# Rows of the work area.
FLOATS = 29
INTS = 11

# Status codes.
FINISHED, UNFINISHED, REFUSED = 0, 1, 2
# Kinds of event.
MAXIMUM_COMPRESSION, END, CLOSE, COLLAPSE = 0, 1, 2, 3

# R9: what is exhausted, relative to the largest initial closing speed; what its collapse may cost,
# relative to the energy of the initial closing; how many exhausted collisions in a row are a
# collapse; how closely a cycle must repeat, relative to its own scale.
EXHAUSTED = 1e-18
FAINT = 1e-20
REPEATS = 8
SELF_SIMILAR = 1e-13
BEND = 1e-2
# How closely impulses are known, relative to themselves; and what a jump beside a steady neighbour
# may leave in doubt, as a multiple of what is exhausted.
DIGITS = 4 * 2.0**-52
DOUBT = 1e5
# R8: meeting keys closer than this are equal; a run's events closer than this, relative to the
# progress they need, are simultaneous.
TIE = 1e-9
SIMULTANEOUS = 1.0 + 64 * 2.0**-52
# R3: an end speed this close to -e times the speed at which its compression began is meant to be.
SAME = 16 * 2.0**-52
# R7: a ratio this close to its bound, on either side, was meant to be the bound.
ROUNDED = 1.0 + 4 * 2.0**-52
# A closing speed below this part of the velocities is their rounding.
DUST = 2.0**-100
# A rate below this part of its run's largest, times the lightest ball's part of the heaviest, is
# zero: no ball could notice it.
CUT = 2.0**-120
# How many contacts the window grows by at a time.
AHEAD = 8
# Closed forms are used for numbers between these, where no square over- or underflows, and for
# conditions that are met by this part of the largest term.
TINY, HUGE = 1e-60, 1e60
CLEAR = 1e-12
# The smallest number above zero.
LEAST = 5e-324
# Lightest ball allowed, as a part of the heaviest: beyond it squares of small numbers vanish.
LIGHTEST = 1e-150
# R6: one vanishing ratio, as a binary exponent far below any of a number.
VANISHING = 1 << 40

if "jit" not in globals():

    def jit(function):
        """Stand in for the compiler: `cradle.runtime` replaces this before it runs the file."""
        return function


@jit
def start(n, u, active, turn, hits):
    """R2: in each touching stretch the leftmost approaching contact is the source."""
    c = 0
    while c < n - 1:
        if u[c] < 0.0:
            c += 1
            continue
        left = c
        source = -1
        while c < n - 1 and u[c] >= 0.0:
            if source < 0 and u[c] > 0.0:
                source = c
            c += 1
        if source >= 0:
            for k in range(left, c):
                active[k] = 1
                hits[k] += 1
                if k > left:
                    turn[k] = 1 if k > source else -1


@jit
def ratios_in_force(left, right, forward, backward, m, u, w, ratio, rest, turn, fixed):
    """R7: ratios in force in the run left..right; contacts above their bound are held.

    Each chain of drives is worked from its far end towards its driver, because the bound of a
    contact (Eq. 53) needs the ratio in force of the next one.  Only a contact at u = 0 that has
    absorbed nothing can be held; one driven from both sides cannot open, so it never is.
    """
    for c in range(left, right + 1):
        fixed[c] = 0
    for c in range(right, left, -1):
        if turn[c] == 1:
            f = forward[c - 1]
            ratio[c] = f
            rest[c] = 1.0 - f
            if u[c] == 0.0 and w[c] == 0.0 and turn[c + 1] != -1:
                kept = m[c] * (rest[c + 1] if turn[c + 1] == 1 else 1.0)
                bound = m[c + 1] / (m[c + 1] + kept)
                if f * ROUNDED >= bound:
                    fixed[c] = 1 if f > bound * ROUNDED else 2
                    ratio[c] = bound
                    rest[c] = kept / (m[c + 1] + kept)
    for c in range(left, right):
        if turn[c + 1] == -1:
            f = backward[c]
            ratio[c + 1] = f
            rest[c + 1] = 1.0 - f
            if u[c] == 0.0 and w[c] == 0.0 and turn[c] != 1:
                kept = m[c + 1] * (rest[c] if turn[c] == -1 else 1.0)
                bound = m[c] / (m[c] + kept)
                if f * ROUNDED >= bound:
                    fixed[c] = 1 if f > bound * ROUNDED else 2
                    ratio[c + 1] = bound
                    rest[c + 1] = kept / (m[c] + kept)


@jit
def several_sources(left, right, smallest, rate, ratio, turn, power):
    """R1, R6: rates of a run with more than one source, where products of ratios are divided.

    Each rate is x * 2**k, so that long products neither overflow nor vanish, and a ratio of zero
    is one more vanishing factor: of the contacts, those of the leading order move.
    """
    x, k = 0.5, 1
    top = k
    rate[left] = x
    power[left] = k
    for c in range(left + 1, right + 1):
        f = ratio[c]
        if f == 0.0:
            k -= turn[c] * VANISHING
        else:
            f, j = math.frexp(f)
            if turn[c] == 1:
                x *= f
                k += j
                if x < 0.5:
                    x *= 2.0
                    k -= 1
            else:
                x /= f
                k -= j
                if x >= 1.0:
                    x *= 0.5
                    k += 1
        rate[c] = x
        power[c] = k
        top = max(top, k)
    for c in range(left, right + 1):
        k = power[c] - top
        rate[c] = math.ldexp(rate[c], k) if k > -VANISHING // 2 else 0.0
        if rate[c] <= smallest:
            rate[c] = 0.0


@jit
def rates(
    left, right, smallest, forward, backward, m, u, w, rate, slope, pull, ratio, rest, turn, fixed,
    power,
):  # fmt: skip
    """R1, R6, R7: impulse rates and slopes of the run of contacts left..right.

    Returns whether a contact at u = 0 is about to open.
    """
    ratios_in_force(left, right, forward, backward, m, u, w, ratio, rest, turn, fixed)
    source = left
    while source < right and turn[source + 1] == -1:
        source += 1
    alone = True
    for c in range(source + 1, right + 1):
        alone = alone and turn[c] == 1
    if alone:
        rate[source] = 1.0
        for c in range(source + 1, right + 1):
            f = rate[c - 1] * ratio[c]
            rate[c] = f if f > smallest else 0.0
        for c in range(source - 1, left - 1, -1):
            f = rate[c + 1] * ratio[c + 1]
            rate[c] = f if f > smallest else 0.0
    else:
        several_sources(left, right, smallest, rate, ratio, turn, power)

    # Eqs. 47-48: m dv = dP on the left - dP on the right.
    pull[left] = -rate[left] / m[left]
    for c in range(left, right):
        # The difference of the rates leaves the sum of the momenta alone; where they are nearly
        # equal, what the driver keeps for the ball has more digits.
        if rest[c + 1] > 0.5:
            pull[c + 1] = (rate[c] - rate[c + 1]) / m[c + 1]
        elif turn[c + 1] == 1:
            pull[c + 1] = rate[c] * rest[c + 1] / m[c + 1]
        else:
            pull[c + 1] = -rate[c + 1] * rest[c + 1] / m[c + 1]
    pull[right + 1] = rate[right] / m[right + 1]
    opens = False
    for c in range(left, right + 1):
        slope[c] = pull[c] - pull[c + 1]
        # A held contact stays at u = 0.  A driven one within its bound cannot open either;
        # rounding must not make it.
        driven = (c > left and turn[c] == 1) or (c < right and turn[c + 1] == -1)
        if fixed[c] > 0 or (driven and slope[c] < 0.0 and u[c] == 0.0 and w[c] == 0.0):
            slope[c] = 0.0
        opens = opens or (u[c] == 0.0 and slope[c] < 0.0)
    return opens


@jit
def end_progress(u, q, slope, rate, e):
    """R3: progress to the end of a contact, where all that it can release is released.

    While u < 0, Q(s) = Q + rate (u s + slope s^2 / 2); the root is written without cancellation.
    """
    s = 0.0
    if u > 0.0:
        if slope >= 0.0:
            return math.inf
        s = -u / slope
        q += 0.5 * e * e * rate * u * s
        u = 0.0
        if q <= 0.0:
            return s
    if q <= 0.0 or rate == 0.0:
        return math.inf
    square = u * u - 2.0 * slope * q / rate
    if square < 0.0:
        return math.inf  # recompression comes first
    speed = math.sqrt(square) - u
    if speed <= 0.0:
        return math.inf
    return s + 2.0 * q / (rate * speed)


@jit
def end_speed(u, q, slope, rate, e):
    """Return the closing speed at the end of a contact, by the root of `end_progress`."""
    if u > 0.0:
        q += 0.5 * e * e * rate * u * (-u / slope)
        u = 0.0
    if q <= 0.0 or rate == 0.0:
        return 0.0
    return -math.sqrt(max(u * u - 2.0 * slope * q / rate, 0.0))


@jit
def idles(c, inside, u, w, rate, slope):
    """Tell whether no impulse arrives at contact c, untouched so far, nor at its neighbour."""
    untouched = u[c] == 0.0 and w[c] == 0.0 and slope[c] == 0.0
    return untouched and rate[c] == 0.0 and rate[inside] == 0.0


@jit
def segment(left, right, n, e, u, q, rate, slope, pull, until, before, active):
    """R8.2: progress of the run left..right to its own next rate-changing event."""
    s = math.inf
    for c in range(left, right + 1):
        until[c] = end_progress(u[c], q[c], slope[c], rate[c], e[c])
        s = min(s, until[c])
    # Idle neighbours close; a gap, shared with another run, is no event of this run's own.
    c = left - 1
    if c >= 0:
        before[c] = -u[c]
        until[c] = math.inf
        if not (c > 0 and active[c - 1] == 1) and pull[left] < 0.0:
            until[c] = u[c] / pull[left]
            s = min(s, until[c])
    c = right + 1
    if c < n - 1:
        before[c] = -u[c]
        until[c] = math.inf
        if not (c < n - 2 and active[c + 1] == 1) and pull[c] > 0.0:
            until[c] = -u[c] / pull[c]
            s = min(s, until[c])
    return s


@jit
def add(b, x, hi, lo):
    """Add x to the velocity hi + lo of ball b, by a sum that loses nothing.

    A light ball may shuttle a thousand times as fast as the heavy balls beside it.  Closing speeds
    alone would lose track of how these move, single velocities of how slowly some balls part.
    """
    total = hi[b] + x
    part = total - hi[b]
    x = ((hi[b] - (total - part)) + (x - part)) + lo[b]
    hi[b] = total + x
    lo[b] = x - (hi[b] - total)


@jit
def closing(c, hi, lo):
    """Return the closing speed of contact c from the velocities of its balls, zero if rounding."""
    speed = (hi[c] - hi[c + 1]) + (lo[c] - lo[c + 1])
    return speed if abs(speed) > DUST * abs(hi[c]) else 0.0


@jit
def closing_parts(c, hi, lo):
    """Return the closing speed of contact c to all digits, as a sum of two numbers."""
    speed = hi[c] - hi[c + 1]
    part = speed - hi[c]
    return speed, (hi[c] - (speed - part)) - (hi[c + 1] + part) + (lo[c] - lo[c + 1])


@jit
def open_at(c, low, high, speed, rest, rate, u, hi, lo, m):
    """Make the velocities agree with a closing speed + rest that is known better than they are.

    The two sides share the difference, a rounding error, so that no momentum is made.  To a side
    belong the balls that exact zeros within contacts low..high join to it.  Returns the contacts at
    their far ends.
    """
    first = c
    last = c + 1
    left = m[c]
    right = m[c + 1]
    while first > low and u[first - 1] == 0.0 and rate[first - 1] > 0.0:
        first -= 1
        left += m[first]
    while last <= high and u[last] == 0.0 and rate[last] > 0.0:
        last += 1
        right += m[last]
    speed_now, rest_now = closing_parts(c, hi, lo)
    x = ((speed - speed_now) + (rest - rest_now)) / (left + right)
    for b in range(first, c + 1):
        add(b, x * right, hi, lo)
    for b in range(c + 1, last + 1):
        add(b, -x * left, hi, lo)
    return first - 1, last


@jit
def heaviest_of(first, last, m):
    """Return the heaviest of balls first..last."""
    k = first
    for b in range(first + 1, last + 1):
        k = b if m[b] > m[k] else k
    return k


@jit
def share(first, last, hi, lo, m):
    """Give balls first..last the velocity of their momentum."""
    k = heaviest_of(first, last, m)
    mass = 0.0
    momentum = 0.0
    for b in range(first, last + 1):
        mass += m[b]
        momentum += m[b] * ((hi[b] - hi[k]) + (lo[b] - lo[k]))
    add(k, momentum / mass, hi, lo)
    for b in range(first, last + 1):
        hi[b] = hi[k]
        lo[b] = lo[k]


@jit
def motion(left, right, hi, lo, m):
    """Kinetic energy of balls left..right relative to their centre of mass."""
    k = heaviest_of(left, right, m)
    mass = 0.0
    momentum = 0.0
    energy = 0.0
    for b in range(left, right + 1):
        x = (hi[b] - hi[k]) + (lo[b] - lo[k])
        mass += m[b]
        momentum += m[b] * x
        energy += 0.5 * m[b] * x * x
    return energy - 0.5 * momentum * (momentum / mass)


@jit
def stick(c, low, high, rate, u, hi, lo, m):
    """Give all balls that exact zeros join to contact c, within low..high, one velocity.

    Returns the last contact of the stretch.
    """
    first = c
    last = c
    while first > low and u[first - 1] == 0.0 and rate[first - 1] > 0.0:
        first -= 1
    while last < high and u[last + 1] == 0.0 and rate[last + 1] > 0.0:
        last += 1
    share(first, last + 1, hi, lo, m)
    return last


@jit
def approach(c, due, ball, other, own, ends, m, hi, lo, u):
    """R5: the idle contact c, whose `ball` is pushed by its `own` contact, only ever closes.

    When it is `due`, it waits at zero, and a light ball takes the velocity of the heavier one: what
    is left of its own is rounding.  If its own contact `ends` at the same time with the two balls
    at rest to each other, they stay so, unless the balls that meet overlap by more than their own
    velocities' rounding: then they met before, and the end is still to come.
    """
    overlap = closing(c, hi, lo)
    late = overlap > (SIMULTANEOUS - 1.0) * max(abs(hi[c]), abs(hi[c + 1]))
    u[c] = 0.0 if due else min(overlap, 0.0)
    if (due or late) and m[ball] < m[other] and (u[own] != 0.0 or (ends and late)):
        high, low = hi[ball], lo[ball]
        hi[ball] = hi[other]
        lo[ball] = lo[other]
        speed = closing(own, hi, lo)
        if u[own] * speed < 0.0 or (u[own] != 0.0 and speed == 0.0):
            hi[ball], lo[ball] = high, low  # rounding decides no event
        else:
            u[own] = speed


@jit
def advance(
    left, right, s, whole, n, e, m, hi, lo, u, q, w, top, tip, p, a, rate, slope, pull, until,
    fixed, held, old,
):  # fmt: skip
    """Take the run left..right straight on by s; `whole` if that is its own next event.

    Velocities are linear and works quadratic in s.  What is zero at the event is stored as zero.
    """
    horizon = s * SIMULTANEOUS if whole else -1.0
    for c in range(left, right + 1):
        if u[c] > 0.0 and q[c] == 0.0:
            top[c], tip[c] = closing_parts(c, hi, lo)
        add(c, pull[c] * s, hi, lo)
    add(right + 1, pull[right + 1] * s, hi, lo)
    for c in range(left, right + 1):
        old[c] = u[c]
        if until[c] <= horizon:
            u[c] = end_speed(u[c], q[c], slope[c], rate[c], e[c])
            # With one slope all the time it ends at this speed; light balls collide so often that
            # a rounding error each time would matter.  From e = 1/2 on no difference is rounded.
            speed = e[c] * top[c]
            if e[c] >= 0.5 and abs(u[c] + speed) < SAME * speed:
                u[c] = -speed
                tip[c] = (1.0 - e[c]) * top[c] - (top[c] - speed) - e[c] * tip[c]
            else:
                tip[c] = 0.0
            top[c] = 0.0
        else:
            speed = closing(c, hi, lo)
            if slope[c] != 0.0 and (speed < u[c]) == (slope[c] < 0.0):
                u[c] = speed  # else a change below rounding
    # Exact zeros: balls that touch at rest to each other have one velocity.
    c = left
    while c <= right:
        if u[c] == 0.0 and closing(c, hi, lo) != 0.0:
            c = stick(c, left, right, rate, u, hi, lo, m)
        c += 1
    for c in range(left, right + 1):
        if u[c] < 0.0 and until[c] <= horizon:
            for k in open_at(c, left, right, u[c], tip[c], rate, u, hi, lo, m):
                if left <= k <= right and until[k] > horizon:
                    speed = closing(k, hi, lo)
                    if speed * u[k] > 0.0:
                        u[k] = speed
    for c in range(left, right + 1):
        u0 = old[c]
        u1 = u[c]
        p[c] += rate[c] * s
        if fixed[c] == 1 and rate[c] * s > 0.0:
            held[c] = 1
        gain = 0.0  # absorbed
        give = 0.0  # released
        if u0 >= 0.0 and u1 >= 0.0:
            gain = 0.5 * rate[c] * s * (u0 + u1)
        elif u0 <= 0.0 and u1 <= 0.0:
            give = -0.5 * rate[c] * s * (u0 + u1)
        else:
            s0 = -u0 / slope[c]
            if u0 > 0.0:
                gain = 0.5 * rate[c] * s0 * u0
                give = -0.5 * rate[c] * (s - s0) * u1
            else:
                give = -0.5 * rate[c] * s0 * u0
                gain = 0.5 * rate[c] * (s - s0) * u1
        w[c] += gain
        if w[c] == 0.0 and rate[c] * s > 0.0 and max(u0, u1) > 0.0:
            w[c] = LEAST  # a work that underflows is one nevertheless
        a[c] += gain
        q[c] = 0.0 if until[c] <= horizon else max(q[c] + e[c] * e[c] * gain - give, 0.0)
    c = left - 1
    if c >= 0:
        approach(c, until[c] <= horizon, left, c, left, until[left] <= horizon, m, hi, lo, u)
    c = right + 1
    if c < n - 1:
        approach(c, until[c] <= horizon, c, c + 1, right, until[right] <= horizon, m, hi, lo, u)


@jit
def activate(c, from_left, from_right, u, q, w, active, turn, hits):
    """R4, R5: contact c becomes active, driven from the side or sides already active."""
    u[c] = 0.0
    q[c] = 0.0
    w[c] = 0.0
    active[c] = 1
    hits[c] += 1
    if from_left:
        turn[c] = 1
    if from_right:
        turn[c + 1] = -1


@jit
def deactivate(c, u, q, before, active, turn):
    """R4: contact c ends and its relations go."""
    q[c] = 0.0
    active[c] = 0
    turn[c] = 0
    turn[c + 1] = 0
    before[c] = -u[c]


@jit
def velocities(hi, u, p, out, n, v, shift, m, p0):
    """Velocities in the caller's units; a ball without impulse keeps its own to the last bit.

    Balls that do not approach are in order.  Where the last bit tells otherwise, the lighter of
    the two gives way, with all that have its velocity; a ball without impulse never does.
    """
    unit = math.ldexp(1.0, shift)
    for i in range(n):
        out[i] = v[i] if rests(i, n, p, p0) else hi[i] * unit
    i = 1
    while i < n:
        if out[i] >= out[i - 1] or u[i - 1] > 0.0:
            i += 1
            continue
        first = i - 1
        while first > 0 and out[first - 1] == out[i - 1]:
            first -= 1
        last = i
        while last < n - 1 and out[last + 1] == out[i]:
            last += 1
        if weight(first, i - 1, n, p, p0, m) >= weight(i, last, n, p, p0, m):
            for k in range(i, last + 1):
                out[k] = out[i - 1]
        else:
            for k in range(first, i):
                out[k] = out[i]
            i = max(first, 1)


@jit
def weight(first, last, n, p, p0, m):
    """Return the largest mass of balls first..last, infinite if one of them has had no impulse."""
    heaviest = 0.0
    for i in range(first, last + 1):
        heaviest = max(heaviest, math.inf if rests(i, n, p, p0) else m[i])
    return heaviest


@jit
def rests(i, n, p, p0):
    """Tell whether ball i has had no impulse."""
    return (i == 0 or p0[i - 1] + p[i - 1] == 0.0) and (i == n - 1 or p0[i] + p[i] == 0.0)


@jit
def record(
    count, kind, c, hi, u, p, n, v, shift, mass_shift, m, p0, kinds, contacts, path_v, path_p,
):  # fmt: skip
    """Write an event and the state after it, if there is room; return the number of events."""
    if count < len(kinds):
        kinds[count] = kind
        contacts[count] = c
        velocities(hi, u, p, path_v[count + 1], n, v, shift, m, p0)
        for j in range(n - 1):
            path_p[count + 1][j] = math.ldexp(p0[j] + p[j], shift + mass_shift)
    return count + 1


@jit
def record_compressions(
    count, left, right, s, whole, n, v, shift, mass_shift, m, hi, lo, u, p, p0, rate, slope, pull,
    until, x, y, z, power, kinds, contacts, path_v, path_p,
):  # fmt: skip
    """Record every maximum compression of the run within the next s, in order of progress.

    It changes no rate, so the run itself does not stop for it: the state there is made on the side.
    """
    for c in range(left, right + 1):
        ends = whole and until[c] <= s * SIMULTANEOUS
        power[c] = 1 if u[c] > 0.0 and (ends or u[c] + slope[c] * s <= 0.0) else 0
    while True:
        k = -1
        at = 0.0
        for c in range(left, right + 1):
            if power[c] == 1 and (k < 0 or -u[c] / slope[c] < at):
                k = c
                at = -u[c] / slope[c]
        if k < 0:
            return count
        power[k] = 0
        at = min(at, s)
        for b in range(n):
            y[b] = hi[b]
            if left <= b <= right + 1:
                y[b] += lo[b] + pull[b] * at
        y[k] = y[k + 1] = y[k] if m[k] > m[k + 1] else y[k + 1]
        for c in range(n - 1):
            x[c] = y[c] - y[c + 1]
            z[c] = p[c]
            if left <= c <= right:
                z[c] += rate[c] * at
        count = record(
            count, MAXIMUM_COMPRESSION, k, y, x, z, n, v, shift, mass_shift, m, p0, kinds,
            contacts, path_v, path_p,
        )  # fmt: skip


@jit
def reduced_mass(m1, m2):
    """Return the reduced mass of two balls."""
    return m1 / (m1 + m2) * m2


@jit
def exhausted(c, work, threshold, m, u):
    """R9: tell whether next to nothing is left of contact c, neither closing speed nor `work`."""
    if abs(u[c]) >= threshold:
        return False
    return 2.0 * work < reduced_mass(m[c], m[c + 1]) * threshold * threshold


@jit
def chatters(c, threshold, n, m, u, q, w, active, tiny):
    """R9: tell whether contact c exists and is in an exhausted collision, or has just been."""
    if not 0 <= c < n - 1:
        return False
    if active[c] == 1 and w[c] > 0.0 and exhausted(c, w[c], threshold, m, u):
        return True
    return tiny[c] > 0 and exhausted(c, q[c], threshold, m, u)


@jit
def exhausted_stretch(c, threshold, faint, n, e, m, hi, lo, u, q, w, active, tiny):
    """R9: the stretch around c of exhausted contacts that only chatter, as (first, last).

    A contact at rest between two of them, which passes their impulses on, belongs to it.  Empty
    (last < first) if nothing in it can lose energy: elastic sequences are finite; or if its balls
    move with an energy above `faint`: heavy ones, slower than a light ball that struck them.
    """
    left = c
    right = c
    while True:
        if chatters(left - 1, threshold, n, m, u, q, w, active, tiny):
            left -= 1
        elif (
            left > 1
            and u[left - 1] == 0.0
            and w[left - 1] == 0.0
            and chatters(left - 2, threshold, n, m, u, q, w, active, tiny)
        ):
            left -= 2
        else:
            break
    while True:
        if chatters(right + 1, threshold, n, m, u, q, w, active, tiny):
            right += 1
        elif (
            right < n - 3
            and u[right + 1] == 0.0
            and w[right + 1] == 0.0
            and chatters(right + 2, threshold, n, m, u, q, w, active, tiny)
        ):
            right += 2
        else:
            break
    loses = False
    for k in range(left, right + 1):
        loses = loses or e[k] < 1.0
    if loses and motion(left, right + 1, hi, lo, m) <= faint:
        return left, right
    return c, c - 1


@jit
def merge(first, last, n, m, hi, lo, u, q, p, x, tiny, before, active, turn):
    """R9: end the contacts first..last plastically: their balls take the common velocity.

    A neighbour that this makes them approach, at a speed below the threshold, joins.  Returns the
    contacts that ended.
    """
    while True:
        for b in range(first, last + 2):
            x[b] = hi[b]
        share(first, last + 1, hi, lo, m)
        impulse = 0.0
        for c in range(first, last + 1):
            impulse += m[c] * (x[c] - hi[c])
            p[c] += max(impulse, 0.0)
            u[c] = 0.0
            tiny[c] = 0
            deactivate(c, u, q, before, active, turn)
        if first > 0:
            u[first - 1] = closing(first - 1, hi, lo)
            if active[first - 1] == 0 and u[first - 1] > 0.0:
                first -= 1
                continue
        if last < n - 2:
            u[last + 1] = closing(last + 1, hi, lo)
            if active[last + 1] == 0 and u[last + 1] > 0.0:
                last += 1
                continue
        return first, last


@jit
def settle(n, p, p0, p2, a, a0, a2):
    """R9: add the impulses and works since the last snapshot to the sums, and begin anew."""
    for c in range(n - 1):
        p0[c] += p[c]
        p2[c] += p[c]
        p[c] = 0.0
        a0[c] += a[c]
        a2[c] += a[c]
        a[c] = 0.0


@jit
def snapshot(n, u, q, u1, q1, active, turn, code1, hits1, hits):
    """R9: remember the state."""
    for c in range(n - 1):
        u1[c] = u[c]
        q1[c] = q[c]
        hits1[c] = hits[c]
        code1[c] = 9 * active[c] + 3 * turn[c] + turn[c + 1]


@jit
def chatterers(c, n, e, p, active, turn, code1, hits1, hits):
    """R9: (left, first, last, right) of a possible cycle around contact c, or last < first.

    Contacts left..right had an impulse since the snapshot; of these first..last collided anew and
    the others stayed active.  All must be active and driven as they were at the snapshot.
    """
    left = c
    right = c
    while left > 0 and p[left - 1] > 0.0:
        left -= 1
    while right < n - 2 and p[right + 1] > 0.0:
        right += 1
    first = right + 1
    last = left - 1
    loses = False
    for k in range(left, right + 1):
        if code1[k] != 9 * active[k] + 3 * turn[k] + turn[k + 1]:
            return c, c, c - 1, c
        if hits[k] != hits1[k]:
            first = min(first, k)
            last = k
            loses = loses or e[k] < 1.0
        elif active[k] == 0:
            return c, c, c - 1, c
    for k in range(first, last + 1):
        if hits[k] == hits1[k]:
            return c, c, c - 1, c
    # Whoever is active next to them has waited throughout, at a ratio of zero.
    for k in range(max(left - 1, 0), min(right + 1, n - 2) + 1):
        if (k < left or k > right) and (
            hits[k] != hits1[k] or code1[k] != 9 * active[k] + 3 * turn[k] + turn[k + 1]
        ):
            return c, c, c - 1, c
    if (left > 1 and p[left - 2] > 0.0) or (right < n - 3 and p[right + 2] > 0.0):
        return c, c, c - 1, c
    if not loses:
        return c, c, c - 1, c
    return left, first, last, right


@jit
def cycle(
    c, bend, threshold, n, e, m, hi, lo, u, q, w, p, total_p, a, total_a, before, u1, q1, x, y,
    active, turn, tiny, code1, hits1, hits,
):  # fmt: skip
    """R9: if the neighbourhood of contact c repeats itself on a smaller scale, go to the limit.

    The state is compared with the snapshot of an earlier end, or collapse, of the same contact.
    If every closing speed of the chattering contacts has shrunk by one factor L, and every stored
    work by its square, then so will the next cycle, and the sum of all cycles is a geometric series
    with T = L / (1 - L).  T comes from the limit itself: the impulses that bring all chattering
    balls to one velocity, over the impulses of the last cycle.  1 - L itself would lose all digits
    for a very light ball.  Neighbours that stay active throughout receive their share; if that
    would take one of them to an event of its own, there is no jump.

    Light balls need many cycles to settle on one factor.  It is enough that what still changes
    will not matter: the bend, how far the state turns (relative to its own size, as u / scale) by
    the time that it is exhausted, is below BEND at the present pace, and the pace was no lower
    (`bend`) over the snapshot before.  Without steady neighbours the limit does not depend on it.
    With them it does: then the part of the way that the bend leaves open, and what the digits of
    the neighbours' shares do, must be below DOUBT.

    p and a are impulses and works since the snapshot; those to come are added to total_p, total_a.

    Returns (first, last) of the contacts that have collapsed, empty, with nothing changed, if
    there is no cycle; and the bend.
    """
    left, first, last, right = chatterers(c, n, e, p, active, turn, code1, hits1, hits)
    if last < first:
        return c, c - 1, math.inf

    # The limit: one velocity.  A steady neighbour whose impulse is h times that of the outermost
    # chatterer makes the ball between them act as one of mass m / (1 - h), whatever its sign.
    kept_left = 1.0 - p[first - 1] / p[first] if first > left else 1.0
    kept_right = 1.0 - p[last + 1] / p[last] if last < right else 1.0
    if kept_left == 0.0:
        kept_left = DIGITS
    if kept_right == 0.0:
        kept_right = DIGITS
    scale = 0.0
    mass = 0.0
    momentum = 0.0
    x[first] = 0.0
    for k in range(first, last + 2):
        y[k] = m[k]
        if k == first:
            y[k] /= kept_left
        if k == last + 1:
            y[k] /= kept_right
        mass += y[k]
        momentum += y[k] * x[k]
        if k <= last:
            x[k + 1] = x[k] - u[k]
            mu = reduced_mass(m[k], m[k + 1])
            scale = max(scale, abs(u[k]), math.sqrt(2.0 * q[k] / mu))
    if mass == 0.0:
        return c, c - 1, math.inf
    common = momentum / mass
    impulse = 0.0
    to_come = 0.0
    last_cycle = 0.0
    for k in range(first, last + 1):
        impulse += y[k] * (x[k] - common)
        to_come += impulse
        last_cycle += p[k]
        x[k] = impulse
    if to_come <= 0.0:
        return c, c - 1, math.inf
    total = to_come / last_cycle
    factor = total / (1.0 + total)
    worst = 0.0
    for k in range(first, last + 1):
        mu = reduced_mass(m[k], m[k + 1])
        worst = max(worst, abs(u[k] - factor * u1[k]) / scale)
        worst = max(worst, abs(q[k] - factor * factor * q1[k]) / mu / scale / scale)
        if abs(x[k] - total * p[k]) > 0.01 * total * p[k]:
            return c, c - 1, math.inf
    bent = 0.0
    if worst > SELF_SIMILAR:
        # How often the scale still shrinks by L before nothing is left; log(1 / L) is above
        # 1 / (T + 1/2), and as good as that for a slow cycle.
        spans = max(math.log(scale / threshold), 1.0) * (total + 0.5)
        bent = worst * spans
        if not bent < min(BEND, bend):
            return c, c - 1, bent
    squares = total * total / (1.0 + 2.0 * total)  # sum of L^2, L^4, ...

    # Where the velocities go (x, changes): those of the neighbours' balls by the impulses of all
    # cycles, the chatterers' to a common one that leaves the momentum alone.
    doubt = 0.0
    if first > left:
        doubt += DIGITS * abs(x[first] / kept_left / mass)
    if last < right:
        doubt += DIGITS * abs(x[last] / kept_right / mass)
    i = heaviest_of(first, last + 1, m)
    mass = 0.0
    farthest = 0.0
    momentum = 0.0
    for b in range(left, right + 2):
        if first <= b <= last + 1:
            mass += m[b]
            momentum += m[b] * ((hi[b] - hi[i]) + (lo[b] - lo[i]))
        else:
            push = p[b - 1] if b > left else 0.0
            x[b] = (push - (p[b] if b <= right else 0.0)) * total / m[b]
            momentum -= m[b] * x[b]
            farthest = max(farthest, abs(x[b]))
    for b in range(first, last + 2):
        x[b] = momentum / mass - ((hi[b] - hi[i]) + (lo[b] - lo[i]))
        farthest = max(farthest, abs(x[b]))
    if (left < first or last < right) and doubt + bent * farthest > DOUBT * threshold:
        return c, c - 1, bent

    # Neighbours: y is the work of all cycles, with the closing speed linear in the impulse so far.
    low = max(left - 1, 0)
    high = min(right + 1, n - 2)
    for k in range(low, high + 1):
        if first <= k <= last:
            continue
        change = (x[k] if k >= left else 0.0) - (x[k + 1] if k <= right else 0.0)
        speed = u[k] + change
        if active[k] == 1 and u[k] == 0.0 and u1[k] == 0.0 and abs(change) < TIE * farthest:
            y[k] = 0.0  # held throughout; the change is rounding
            continue
        if u[k] * u1[k] < 0.0 or u[k] * speed < 0.0 or (u[k] == 0.0) != (speed == 0.0):
            return c, c - 1, math.inf
        work = a[k] if u[k] > 0.0 else q[k] - q1[k]
        y[k] = p[k] * (total * u[k] + change * squares) + (work - u1[k] * p[k]) * squares
        if active[k] == 1 and u[k] < 0.0 and q[k] + y[k] <= 0.0:
            return c, c - 1, math.inf
    energy = motion(left, right + 1, hi, lo, m)
    for b in range(left, right + 2):
        add(b, x[b], hi, lo)
    for b in range(first, last + 2):
        hi[b] = hi[i]
        lo[b] = lo[i]
    # The ledger: what disappears is the part 1 - e^2 of what the chatterers absorb.  That makes the
    # sum of L^2, L^4, ... exact.
    energy -= motion(left, right + 1, hi, lo, m)
    loss = 0.0
    for k in range(low, high + 1):
        if first <= k <= last:
            energy += q[k]
            loss += (1.0 - e[k] * e[k]) * a[k]
        else:
            energy -= y[k]
    if loss > 0.0:
        squares = max(energy / loss, 0.0)
    impulse = p[first - 1] * total if first > left else 0.0
    for k in range(low, high + 1):
        if first <= k <= last:
            impulse -= m[k] * x[k]
            total_p[k] += max(impulse, 0.0)
            total_a[k] += a[k] * squares
            u[k] = 0.0
            tiny[k] = 0
            deactivate(k, u, q, before, active, turn)
            continue
        total_p[k] += p[k] * total
        if active[k] == 1 and u[k] == 0.0:
            open_at(k, k, k, 0.0, 0.0, p, u, hi, lo, m)
            continue
        u[k] = closing(k, hi, lo)
        if active[k] == 1 and u[k] > 0.0:
            w[k] += y[k]
            total_a[k] += y[k]
            q[k] += e[k] * e[k] * y[k]
        elif active[k] == 1:
            q[k] += y[k]
    return first, last, math.inf


@jit
def scales(n, v, m):
    """Return binary exponents of the largest velocity and the largest mass: the chain's own units.

    Powers of two change no digit, and in these units nothing overflows.  The units themselves and
    their inverses are numbers too.
    """
    largest = 0.0
    heaviest = 0.0
    for i in range(n):
        largest = max(largest, abs(v[i]))
        heaviest = max(heaviest, m[i])
    shift, mass_shift = math.frexp(largest)[1], math.frexp(heaviest)[1]
    return min(max(shift, -1000), 1023), min(max(mass_shift, -1000), 1023)


@jit
def end_contacts(
    low, high, count, threshold, sloped, n, v, e, shift, mass_shift, m, hi, u, q, w, p, p0, slope,
    before, active, turn, tiny, kinds, contacts, path_v, path_p,
):  # fmt: skip
    """R8.1: end every contact of low..high that needs no progress to end; left to right.

    With nothing left to release, a contact ends if it opens: u < 0, or, once the slopes are known
    (`sloped`), u = 0 and falling; with e = 0 also at u = 0 after compression (R3).
    Returns the number of ends, the last contact ended, one that is worn out (R9) or -1, and count.
    """
    ends = 0
    ended = -1
    worn = -1
    for c in range(low, high + 1):
        if active[c] == 0 or q[c] > 0.0:
            continue
        if not (
            u[c] < 0.0
            or (u[c] == 0.0 and e[c] == 0.0 and w[c] > 0.0)
            or (sloped and u[c] == 0.0 and slope[c] < 0.0)
        ):
            continue
        # R9: a collision counts as tiny if all of it was; a genuine one clears its neighbours.
        if not exhausted(c, w[c], threshold, m, u):
            for k in range(max(c - 1, 0), min(c + 1, n - 2) + 1):
                tiny[k] = 0
        elif w[c] > 0.0:
            tiny[c] += 1
            if tiny[c] >= REPEATS:
                worn = c
        deactivate(c, u, q, before, active, turn)
        ends += 1
        ended = c
        count = record(
            count, END, c, hi, u, p, n, v, shift, mass_shift, m, p0, kinds, contacts, path_v,
            path_p,
        )  # fmt: skip
    return ends, ended, worn, count


@jit
def close_contacts(
    low, high, count, n, v, shift, mass_shift, m, hi, u, q, w, p, p0, rate, before, active, turn,
    hits, kinds, contacts, path_v, path_p,
):  # fmt: skip
    """R5, R8.1: activate every idle contact of low..high at u = 0 that is about to rise.

    A contact with active contacts on both sides is a gap and waits for R8.3.
    """
    for c in range(low, high + 1):
        if active[c] == 1 or u[c] < 0.0:
            continue
        from_left = c > 0 and active[c - 1] == 1
        from_right = c < n - 2 and active[c + 1] == 1
        if from_left == from_right:
            continue
        if rate[c - 1 if from_left else c + 1] == 0.0:
            continue
        # R8.6: two runs close on one ball; the contact that was nearer goes first.
        if (
            from_left
            and c < n - 3
            and u[c + 1] == 0.0
            and active[c + 2] == 1
            and rate[c + 2] > 0.0
            and before[c + 1] < before[c]
        ):
            continue
        activate(c, from_left, from_right, u, q, w, active, turn, hits)
        rate[c] = 0.0  # it drives nobody in this round
        count = record(
            count, CLOSE, c, hi, u, p, n, v, shift, mass_shift, m, p0, kinds, contacts, path_v,
            path_p,
        )  # fmt: skip
    return count


@jit
def meeting_gap(runs, meeting, u, pull, reach, first, last):
    """R8.3-4: the gap that is reached first, as (index of its left run, left part, right part).

    Index -1: no gap must meet.  Parts are fractions of the two runs' segments.  Velocities are
    counted from that of the gap's left ball; that ball only rises and the other only falls.
    """
    best = -1
    best_large = best_small = 0.0
    best_left = best_right = 0.0
    for k in range(runs - 1):
        if last[k] + 2 != first[k + 1]:
            continue
        wide = -u[last[k] + 1]
        rise = pull[last[k] + 1] * reach[k]
        fall = -pull[first[k + 1]] * reach[k + 1]
        if rise + fall <= wide:
            continue
        # They overlap from low to high.  Each distance is exact at the ends, meeting = 0 and 1: a
        # run that gets to its own next event must do it.
        low = max(0.0, wide - fall)
        high = min(rise, wide)
        at = low + meeting * (high - low) if meeting < 1.0 else high
        back = min(fall, wide) - meeting * (high - low) if meeting < 1.0 else wide - high
        part_left = at / rise if rise > 0.0 else 0.0
        part_right = back / fall if fall > 0.0 else 0.0
        if part_left * SIMULTANEOUS >= 1.0:
            part_left = 1.0
        if part_right * SIMULTANEOUS >= 1.0:
            part_right = 1.0
        large = max(part_left, part_right)
        small = min(part_left, part_right)
        if (
            best < 0
            or large < best_large - TIE
            or (large < best_large + TIE and small < best_small - TIE)
        ):
            best, best_large, best_small = k, large, small
            best_left, best_right = part_left, part_right
    return best, best_left, best_right


@jit
def impact(
    n, masses, v, e, forward, backward, meeting, max_events,
    out_v, out_p, out_a, hits, held, floats, ints, kinds, contacts, path_v, path_p,
):  # fmt: skip
    """Solve one impact; return (status, number of events, 1 if any contacts collapsed).

    Inputs: n balls; `masses`, `v` (n); `e` (n - 1); `forward`, `backward` (n - 2); scalars.
    Outputs: `out_v` (n); `out_p` and `out_a` (n - 1, or 0 for none); `hits`, `held` (n - 1).
    Work area: `floats` (FLOATS, n), `ints` (INTS, n).
    Record, kept while there is room: `kinds`, `contacts` (K), `path_v` (K + 1, n), `path_p`
    (K + 1, n - 1).  Pass length 0 for the outcome alone: the run is the same.
    """
    shift, mass_shift = scales(n, v, masses)
    scale, mass_scale = math.ldexp(1.0, -shift), math.ldexp(1.0, -mass_shift)
    m, u, q, w, p, p0 = floats[0], floats[1], floats[2], floats[3], floats[4], floats[5]
    a, a0, rate, slope, pull = floats[6], floats[7], floats[8], floats[9], floats[10]
    ratio, until, before, reach = floats[11], floats[12], floats[13], floats[14]
    u1, q1, x, y, z = floats[15], floats[16], floats[17], floats[18], floats[19]
    hi, lo, rest, top, tip = floats[20], floats[21], floats[22], floats[23], floats[24]
    p2, a2, u2, q2 = floats[25], floats[26], floats[27], floats[28]
    active, turn, fixed, tiny, power = ints[0], ints[1], ints[2], ints[3], ints[4]
    first, last, code1, hits1 = ints[5], ints[6], ints[7], ints[8]
    code2, hits2 = ints[9], ints[10]
    recording = len(kinds) > 0
    smallest = CUT
    for i in range(n):
        m[i] = masses[i] * mass_scale
        smallest = min(smallest, CUT * m[i])
        hi[i] = v[i] * scale
        lo[i] = 0.0
        turn[i] = 0
    threshold = LEAST
    faint = 0.0
    for c in range(n - 1):
        u[c] = hi[c] - hi[c + 1]
        q[c] = w[c] = top[c] = p[c] = p0[c] = p2[c] = a[c] = a0[c] = a2[c] = 0.0
        before[c] = abs(u[c])
        active[c] = tiny[c] = hits[c] = held[c] = 0
        speed = max(u[c], 0.0)
        threshold = max(threshold, EXHAUSTED * speed)
        faint = max(faint, FAINT * reduced_mass(m[c], m[c + 1]) * speed * speed)
    start(n, u, active, turn, hits)
    if recording:
        velocities(hi, u, p, path_v[0], n, v, shift, m, p0)
        for c in range(n - 1):
            path_p[0][c] = 0.0

    count = 0
    rounds = 0
    # R9: how many contacts ended since the last collapse; the snapshot's contact, and `ends` at
    # that time.  Snapshots are taken at doubling distances, so that a cycle of any length is found.
    ends = 0
    mark, marked_at = -1, 16
    bend = bent = math.inf  # of the snapshot before, and of this one so far
    # The same for cycles that contain collapses: counted in collapses, with their own snapshot.
    falls = 0
    mark2, marked2 = -1, 4
    bend2 = bent2 = math.inf
    collapsed = 0
    status = FINISHED
    low, high = 0, n - 2  # the window: no contact outside it is at work
    while True:
        # R8.1, events without progress: ends, those first that are known without the slopes.
        more, ended, worn, count = end_contacts(
            low, high, count, threshold, False, n, v, e, shift, mass_shift, m, hi, u, q, w, p, p0,
            slope, before, active, turn, tiny, kinds, contacts, path_v, path_p,
        )  # fmt: skip
        while low <= high and active[low] == 0:
            low += 1
        while low <= high and active[high] == 0:
            high -= 1
        runs = 0
        opening = False
        c = low
        while c <= high:
            if active[c] == 1:
                first[runs] = c
                while c < high and active[c + 1] == 1:
                    c += 1
                last[runs] = c
                opens = rates(
                    first[runs], c, smallest, forward, backward, m, u, w, rate, slope, pull, ratio,
                    rest, turn, fixed, power,
                )  # fmt: skip
                # Impulses that reach the edge of the window go on beyond it.
                left = low
                right = high
                if c == high and rate[c] > 0.0:
                    while high < min(right + AHEAD, n - 2) and active[high + 1] == 1:
                        high += 1
                if first[runs] == low and rate[low] > 0.0:
                    while low > max(left - AHEAD, 0) and active[low - 1] == 1:
                        low -= 1
                if low < left or high > right:
                    c = first[runs] if low == left else low
                    continue
                runs += 1
                opening = opening or opens
            c += 1
        # Where none arrives, the window ends.
        while runs > 0 and low < last[0] and idles(low, low + 1, u, w, rate, slope):
            low += 1
            first[0] = low
        while runs > 0 and high > first[runs - 1] and idles(high, high - 1, u, w, rate, slope):
            high -= 1
            last[runs - 1] = high
        if opening:
            others, c, k, count = end_contacts(
                low, high, count, threshold, True, n, v, e, shift, mass_shift, m, hi, u, q, w, p,
                p0, slope, before, active, turn, tiny, kinds, contacts, path_v, path_p,
            )  # fmt: skip
            if others > 0:
                more += others
                ended = c
                worn = max(worn, k)
                runs = -1
        # R9, after the ends.
        if more > 0:
            ends += more
            left, right = ended, ended - 1
            if worn >= 0:
                left, right = exhausted_stretch(
                    worn, threshold, faint, n, e, m, hi, lo, u, q, w, active, tiny,
                )  # fmt: skip
            if left <= right:
                left, right = merge(
                    left, right, n, m, hi, lo, u, q, p, x, tiny, before, active, turn,
                )  # fmt: skip
            elif mark == ended:
                left, right, bent = cycle(
                    mark, bend if 2 * ends > 3 * marked_at else 0.0, threshold, n, e, m, hi, lo, u,
                    q, w, p, p, a, a, before, u1, q1, x, y, active, turn, tiny, code1, hits1, hits,
                )  # fmt: skip
            if left <= right:
                collapsed = 1
                mark, marked_at, ends = -1, 16, 0
                bend = bent = math.inf
                # Collapses may themselves be part of a cycle: the same again, one level up.
                settle(n, p, p0, p2, a, a0, a2)
                falls += 1
                one, other = 0, -1
                if mark2 == left:
                    one, other, bent2 = cycle(
                        mark2, bend2 if 2 * falls > 3 * marked2 else 0.0, threshold, n, e, m, hi,
                        lo, u, q, w, p2, p0, a2, a0, before, u2, q2, x, y, active, turn, tiny,
                        code2, hits2, hits,
                    )  # fmt: skip
                if one <= other:
                    left, right = one, other
                    mark2, marked2, falls = -1, 4, 0
                    bend2 = bent2 = math.inf
                elif falls >= 2 * marked2:
                    bend2 = bent2 if mark2 == left else math.inf
                    bent2 = math.inf
                    mark2, marked2 = left, falls
                    for c in range(n - 1):
                        p2[c] = a2[c] = 0.0
                    snapshot(n, u, q, u2, q2, active, turn, code2, hits2, hits)
                for c in range(left, right + 1):
                    count = record(
                        count, COLLAPSE, c, hi, u, p, n, v, shift, mass_shift, m, p0, kinds,
                        contacts, path_v, path_p,
                    )  # fmt: skip
                runs = -1
            elif ends >= 2 * marked_at:
                bend = bent if mark == ended else math.inf
                bent = math.inf
                mark, marked_at = ended, ends
                settle(n, p, p0, p2, a, a0, a2)
                snapshot(n, u, q, u1, q1, active, turn, code1, hits1, hits)
        if runs == 0:
            break
        rounds += 1
        if rounds > max_events:
            status = UNFINISHED
            break
        if runs < 0:
            continue
        # R8.1, closings.
        low = max(low - 1, 0)
        high = min(high + 1, n - 2)
        so_far = count
        count = close_contacts(
            low, high, count, n, v, shift, mass_shift, m, hi, u, q, w, p, p0, rate, before, active,
            turn, hits, kinds, contacts, path_v, path_p,
        )  # fmt: skip
        if count > so_far:
            continue

        # R8.2: each run to its own next event.
        for k in range(runs):
            reach[k] = segment(
                first[k], last[k], n, e, u, q, rate, slope, pull, until, before, active,
            )  # fmt: skip
        meet, part_left, part_right = meeting_gap(runs, meeting, u, pull, reach, first, last)

        one, other = 0, runs - 1  # the runs that advance
        gap = -1
        if meet >= 0:
            one, other = meet, meet + 1
            gap = last[meet] + 1
            # R8.4: a gap at the far side of either run may be reached on the way.
            beyond_left = beyond_right = math.inf
            if meet > 0 and last[meet - 1] + 2 == first[meet]:
                fall = -pull[first[meet]] * reach[meet]
                if fall * part_left > -u[first[meet] - 1]:
                    beyond_left = -u[first[meet] - 1] / fall
            if meet + 2 < runs and last[meet + 1] + 2 == first[meet + 2]:
                rise = pull[last[meet + 1] + 1] * reach[meet + 1]
                if rise * part_right > -u[last[meet + 1] + 1]:
                    beyond_right = -u[last[meet + 1] + 1] / rise
            if beyond_left < math.inf and beyond_left <= beyond_right:
                other = meet
                gap = first[meet] - 1
                part_left = beyond_left
            elif beyond_right < math.inf:
                one = meet + 1
                gap = last[meet + 1] + 1
                part_right = beyond_right

        for k in range(one, other + 1):
            part = 1.0
            if meet >= 0:
                part = part_left if k == meet else part_right
            s = reach[k] * part
            if recording:
                count = record_compressions(
                    count, first[k], last[k], s, part == 1.0, n, v, shift, mass_shift, m, hi, lo, u,
                    p, p0, rate, slope, pull, until, x, y, z, power, kinds, contacts, path_v,
                    path_p,
                )  # fmt: skip
            advance(
                first[k], last[k], s, part == 1.0, n, e, m, hi, lo, u, q, w, top, tip, p, a, rate,
                slope, pull, until, fixed, held, x,
            )  # fmt: skip
        if gap >= 0:
            # R8.5: driven from both sides, at one velocity.
            approach(gap, True, gap, gap + 1, gap - 1, False, m, hi, lo, u)
            approach(gap, True, gap + 1, gap, gap + 1, False, m, hi, lo, u)
            activate(gap, True, True, u, q, w, active, turn, hits)
            count = record(
                count, CLOSE, gap, hi, u, p, n, v, shift, mass_shift, m, p0, kinds, contacts,
                path_v, path_p,
            )  # fmt: skip

    for c in range(n - 1):
        # R9: sequences that shrank so fast that the last digit was the limit.
        if status == FINISHED and tiny[c] > 0 and u[c] == 0.0 and e[c] < 1.0:
            collapsed = 1
            count = record(
                count, COLLAPSE, c, hi, u, p, n, v, shift, mass_shift, m, p0, kinds, contacts,
                path_v, path_p,
            )  # fmt: skip
    velocities(hi, u, p, out_v, n, v, shift, m, p0)
    for c in range(len(out_p)):
        out_p[c] = math.ldexp(p0[c] + p[c], shift + mass_shift)
        out_a[c] = math.ldexp(a0[c] + a[c], 2 * shift + mass_shift)
    return status, count, collapsed


@jit
def short_cut(n, m, v, e, forward, backward, bounded, out_v):
    """Eqs. 24 and 30: two balls, or three whose first strikes the others, one collision each.

    Returns False, with nothing decided, if that is not so or not clear beyond rounding, if an input
    is not well within the limits of `admissible`, or if the numbers are so far from 1 that the
    loop's own units are needed.
    """
    for i in range(n):
        if not (TINY < m[i] < HUGE and (v[i] == 0.0 or TINY < abs(v[i]) < HUGE)):
            return False
    u0 = v[0] - v[1]
    if not (u0 > 0.0 and CLEAR < e[0] <= 1.0):
        return False
    one, two = 1.0 / m[0], 1.0 / m[1]
    if n == 2:
        impulse = (1.0 + e[0]) * u0 * reduced_mass(m[0], m[1])
        out_v[0] = v[0] - impulse * one
        out_v[1] = v[1] + impulse * two
        return out_v[0] < out_v[1]
    a = forward[0]
    if not (CLEAR < e[1] <= 1.0 and a >= 0.0 and a * (m[1] + m[2]) <= (1.0 - CLEAR) * m[2]):
        return False
    # Nothing is driven backward, but a ratio that is none is refused.
    b = backward[0]
    if not (b >= 0.0 and b * (m[0] + m[1] if bounded else 1.0) <= (m[0] if bounded else 1.0)):
        return False
    u1 = v[1] - v[2]
    if u1 < 0.0:
        return False
    # Contact 0 drives contact 1 until it ends (Eqs. 17-24); speeds per impulse.
    three = 1.0 / m[2]
    first = (1.0 + e[0]) * u0 / (one + (1.0 - a) * two)
    gain = first * ((1.0 - a) * two - a * three)
    u2 = u1 + gain
    # Contact 1 goes on alone, with all the work it has absorbed to give back (Eqs. 25-30).
    both = two + three
    opens = e[1] * math.sqrt(u2 * u2 + a * first * (u1 + u2) * both)
    second = (u2 + opens) / both
    apart = e[0] * u0 - second * two  # Eq. 43: ball 1 does not fall back on ball 0
    if not (apart > CLEAR * u0 and opens > CLEAR * u0):
        return False
    out_v[0] = v[0] - first * one
    out_v[2] = v[2] + (a * first + second) * three
    # A light ball's velocity from its neighbour's, a heavy one's from its impulses.
    if m[1] < m[0]:
        out_v[1] = out_v[0] + apart
    else:
        out_v[1] = v[1] + ((1.0 - a) * first - second) * two
    return out_v[0] < out_v[1] < out_v[2]


@jit
def admissible(n, m, v, e, forward, backward, bounded):
    """Tell whether all inputs are within their limits, ratios within Eq. 53 too if `bounded`."""
    heaviest = 0.0
    for i in range(n):
        heaviest = max(heaviest, m[i])
    energy = 0.0
    momentum = 0.0
    for i in range(n):
        if not (0.0 < m[i] < math.inf and m[i] >= LIGHTEST * heaviest):
            return False
        momentum += 2.0 * (m[i] * abs(v[i]))
        energy += m[i] * v[i] * v[i]
    for c in range(n - 1):
        if not 0.0 <= e[c] <= 1.0:
            return False
    for i in range(n - 2):
        if not (0.0 <= forward[i] <= 1.0 and 0.0 <= backward[i] <= 1.0):
            return False
    if not (energy < math.inf and momentum < math.inf):
        return False
    if bounded:
        # The operations of `closed_form.largest_ratios`, so that both draw the same line.
        onward = 0.0
        back = 0.0
        for i in range(n - 2):
            j = n - 3 - i
            if forward[j] > 1.0 / (1.0 + m[j + 1] / m[j + 2] * (1.0 - onward)) * ROUNDED:
                return False
            if backward[i] > 1.0 / (1.0 + m[i + 1] / m[i] * (1.0 - back)) * ROUNDED:
                return False
            onward = forward[j]
            back = backward[i]
    return True


@jit
def batch(
    rows, n, bounded, masses, v, e, forward, backward, meeting, max_events, out_v, hits, collapsed,
    p, a, held, floats, ints, kinds, contacts, path_v, path_p,
):  # fmt: skip
    """Solve `rows` impacts, outcome alone; return how many, and the status of the next.

    Inputs have a row for each chain, or one for all; `out_v`, `hits`, `collapsed` one for each.
    It stops at the first row whose status is not FINISHED.
    """
    # How far to go from row to row: not at all in an input that has one for all.
    by_m, by_v, by_e = min(len(masses), 2) - 1, min(len(v), 2) - 1, min(len(e), 2) - 1
    by_f, by_b = min(len(forward), 2) - 1, min(len(backward), 2) - 1
    for k in range(rows):
        m_k, v_k, e_k = masses[k * by_m], v[k * by_v], e[k * by_e]
        f_k, b_k = forward[k * by_f], backward[k * by_b]
        collapsed[k] = 0
        if n <= 3 and short_cut(n, m_k, v_k, e_k, f_k, b_k, bounded, out_v[k]):
            for c in range(n - 1):
                hits[k][c] = 1
            continue
        if not admissible(n, m_k, v_k, e_k, f_k, b_k, bounded):
            return k, REFUSED
        status, _, collapsed[k] = impact(
            n, m_k, v_k, e_k, f_k, b_k, meeting, max_events, out_v[k], p, a, hits[k], held, floats,
            ints, kinds, contacts, path_v, path_p,
        )  # fmt: skip
        if status != FINISHED:
            return k, status
    return rows, FINISHED
