"""The rules of one run: who starts (R2), drives whom (R1, R4 to R7), and ends when (R3)."""

import math

from cradle.kernel.state import LIMITS, apart, jit, once

# A run's contacts low..high have impulses, or balls that move; contacts beyond them wait, because
# no impulse that a ball could notice reaches them (`reached`).


@jit
def source_of(first, last, ball):
    """R1: the one contact of a run that drives all others, or -1 if there are several."""
    source = first
    while source < last and ball[source + 1].turn == -1:
        source += 1
    for c in range(source + 1, last + 1):
        if ball[c].turn != 1:
            return -1
    return source


@jit
def keep_closed(i, driven, far, onward, ball, contact):
    """R7: lower the ratio at ball i to its bound (Eq. 53) if the driven contact would open at once.

    There the contact is held at u = 0.  `far` is its other ball, which keeps the part `onward` of
    the contact's impulse: 1 - ratio in force there, or 1.
    """
    b, k = ball[i], contact[driven]
    if k.u == 0.0 and k.w == 0.0:
        kept = b.m * onward
        bound = ball[far].m / (ball[far].m + kept)
        if b.ratio * LIMITS.rounded >= bound:
            k.fixed = 1 if b.ratio > bound * LIMITS.rounded else 2
            b.ratio = bound
            b.rest = kept / (ball[far].m + kept)


@once
def ratios_in_force(low, high, ball, contact):
    """R7: the ratios in force in a run, each chain of drives from its far end to its driver.

    A contact driven from both sides cannot open, so it is never held.
    """
    for c in range(low, high + 1):
        contact[c].fixed = 0
    for i in range(low + 1, high + 1):
        b = ball[i]
        b.ratio = contact[i - 1].forward if b.turn == 1 else contact[i - 1].backward
        b.rest = 1.0 - b.ratio
    for c in range(high, low, -1):
        if ball[c].turn == 1 and ball[c + 1].turn != -1:
            onward = ball[c + 1].rest if c < high and ball[c + 1].turn == 1 else 1.0
            keep_closed(c, c, c + 1, onward, ball, contact)
    for c in range(low, high):
        if ball[c + 1].turn == -1 and ball[c].turn != 1:
            onward = ball[c].rest if c > low and ball[c].turn == -1 else 1.0
            keep_closed(c + 1, c, c, onward, ball, contact)


@apart
def several_sources(low, high, smallest, ball, contact):
    """R1, R6: rates of a run with more than one source, where products of ratios are divided.

    Each rate is x * 2**k, so that long products neither overflow nor vanish, and a ratio of zero
    is one more vanishing factor: of the contacts, those of the leading order move.
    """
    x, k = 0.5, 1
    top = k
    contact[low].rate = x
    contact[low].power = k
    for c in range(low + 1, high + 1):
        f = ball[c].ratio
        way = ball[c].turn
        if f == 0.0:
            k -= way * LIMITS.vanishing
        else:
            f, j = math.frexp(f)
            k += way * j
            x = x * f if way == 1 else x / f
            if x < 0.5:
                x *= 2.0
                k -= 1
            elif x >= 1.0:
                x *= 0.5
                k += 1
        contact[c].rate = x
        contact[c].power = k
        top = max(top, k)
    for c in range(low, high + 1):
        k = contact[c].power - top
        contact[c].rate = math.ldexp(contact[c].rate, k) if k > -LIMITS.vanishing // 2 else 0.0
        if contact[c].rate <= smallest:
            contact[c].rate = 0.0


@jit
def wait(low, high, ball, contact, outer):
    """Let contacts low..high of a run wait: they have no impulse, and their `outer` balls no pull.

    `outer` is 0 for the left ball of each contact and 1 for the right one.
    """
    for c in range(low, high + 1):
        contact[c].rate = contact[c].slope = 0.0
        ball[c + outer].pull = 0.0


@once
def reached(first, run, smallest, ball, contact):
    """R1: set low..high of a run: as far as impulses reach at the nominal ratios, or beyond.

    No ratio in force is larger than its nominal one.
    From the one source outwards rates only become less.  With several sources all contacts count.
    Those that were reached before, and no longer are, wait.
    """
    source, last = run[first].source, run[first].last
    low, high = run[first].low, run[first].high
    run[first].low = first
    run[first].high = last
    if source < 0:
        return
    x = 1.0
    c = source
    while c < last and x > smallest:
        x *= contact[c].forward
        c += 1
    run[first].high = c
    wait(c + 1, high, ball, contact, 1)
    x = 1.0
    c = source
    while c > first and x > smallest:
        x *= contact[c - 1].backward
        c -= 1
    run[first].low = c
    wait(low, c - 1, ball, contact, 0)


@once
def impulse_rates(low, high, source, smallest, ball, contact):
    """R1, R6: impulse rates of contacts low..high of a run."""
    if source < 0:
        several_sources(low, high, smallest, ball, contact)
    else:
        contact[source].rate = 1.0
        for c in range(source + 1, high + 1):
            x = contact[c - 1].rate * ball[c].ratio
            contact[c].rate = x if x > smallest else 0.0
        for c in range(source - 1, low - 1, -1):
            x = contact[c + 1].rate * ball[c + 1].ratio
            contact[c].rate = x if x > smallest else 0.0


@once
def pulls(low, high, ball, contact):
    """Eqs. 47-48: m dv = dP on the left - dP on the right, for the balls of contacts low..high."""
    ball[low].pull = -contact[low].rate / ball[low].m
    ball[high + 1].pull = contact[high].rate / ball[high + 1].m
    for i in range(low + 1, high + 1):
        b = ball[i]
        # The difference of the rates leaves the sum of the momenta alone; where they are nearly
        # equal, what the driver keeps for the ball has more digits.
        if b.rest > 0.5:
            b.pull = (contact[i - 1].rate - contact[i].rate) / b.m
        elif b.turn == 1:
            b.pull = contact[i - 1].rate * b.rest / b.m
        else:
            b.pull = -contact[i].rate * b.rest / b.m
    # The balls of a contact that is held move as one, to the last bit.
    for c in range(low + 1, high + 1):
        if contact[c].fixed > 0 and ball[c].turn == 1:
            ball[c + 1].pull = ball[c].pull
    for j in range(low, high):
        c = low + high - 1 - j
        if contact[c].fixed > 0 and ball[c + 1].turn == -1:
            ball[c].pull = ball[c + 1].pull


@jit
def rates(first, run, ball, contact, tally):
    """R1, R6, R7: impulse rates, pulls and slopes of a run.

    Returns whether a contact at u = 0 with nothing to release is about to open.
    """
    reached(first, run, tally.cut_off, ball, contact)
    low, high = run[first].low, run[first].high
    ratios_in_force(low, high, ball, contact)
    impulse_rates(low, high, run[first].source, tally.cut_off, ball, contact)
    pulls(low, high, ball, contact)
    opens = False
    for c in range(low, high + 1):
        contact[c].slope = ball[c].pull - ball[c + 1].pull
        opens = opens or opens_at_zero(c, contact)
    return opens


@jit
def opens_at_zero(c, contact):
    """R3: tell whether contact c, at u = 0 with nothing to release, is about to open."""
    k = contact[c]
    return k.u == 0.0 and k.q <= 0.0 and k.slope < 0.0


@once
def has_ended(c, contact):
    """R3: tell whether contact c has ended: it opens, or has e = 0 and no longer closes."""
    k = contact[c]
    if k.q > 0.0:
        return False
    return k.u < 0.0 or (k.u == 0.0 and k.e == 0.0 and k.w > 0.0)


@once
def end_progress(u, q, slope, rate, e):
    """R3: progress to the end of a contact, where all that it can release is released.

    While u < 0, Q(s) = Q + rate (u s + slope s^2 / 2); the root is written without cancellation.
    Returns the progress and the closing speed there.
    """
    s = 0.0
    if u > 0.0:
        if slope >= 0.0:
            return math.inf, 0.0
        s = -u / slope
        q += 0.5 * e * e * rate * u * s
        u = 0.0
        if q <= 0.0:
            return s, 0.0
    if q <= 0.0 or rate == 0.0:
        return math.inf, 0.0
    square = u * u - 2.0 * slope * q / rate
    if square < 0.0:
        return math.inf, 0.0  # recompression comes first
    root = math.sqrt(square)
    speed = root - u
    if speed <= 0.0:
        return math.inf, 0.0
    return s + 2.0 * q / (rate * speed), -root


@jit
def is_gap(c, n, contact):
    """R8: tell whether the idle contact c has active contacts on both sides."""
    return 0 < c < n - 2 and contact[c - 1].active == 1 and contact[c + 1].active == 1


@once
def rounding_after(k, s):
    """Return how much of the closing speed of contact k may be rounding after a progress s."""
    return LIMITS.roundings * (k.blur + 2.0**-53 * abs(k.slope) * s)


@once
def comes_at(s, k):
    """Tell whether the next event of contact k comes at progress s, as far as rounding can tell.

    It closes, or ends at u = 0, when u gets there.  It ends otherwise when Q = 0: of rounding in
    what it has absorbed Q has e^2, and once u < 0 it changes by rate * u.  An end that is further
    off than the whole segment comes later: runs that meet again and again come nearer to it by a
    part of the rest each time, to all digits.
    """
    if not k.until < math.inf:
        return False
    late = k.until - s
    blur = rounding_after(k, s)
    if k.active == 1 and k.final < 0.0:
        at_zero = min(s, -k.u / k.slope) if k.u > 0.0 else 0.0
        unsure_work = blur * at_zero + LIMITS.roundings * 2.0**-53 * k.w / k.rate
        unsure_store = k.e * k.e * unsure_work + blur * (s - at_zero)
        slow = late * abs(k.slope) <= max(-k.final, blur)
        return late <= s and slow and late * -k.final <= unsure_store
    return late * abs(k.slope) <= blur


@jit
def segment(first, n, run, ball, contact):
    """R8.2: progress of a run to its own next rate-changing event.

    Returns how much later the next one is that does not come at the very same time, relative to
    itself.
    """
    low, high = run[first].low, run[first].high
    s = second = math.inf
    for c in range(low, high + 1):
        k = contact[c]
        k.until, k.final = end_progress(k.u, k.q, k.slope, k.rate, k.e)
        s = min(s, k.until)
    # Idle neighbours close; a gap, shared with another run, is no event of this run's own.
    for c in (low - 1, high + 1):
        if 0 <= c < n - 1 and contact[c].active == 0:
            contact[c].before = -contact[c].u
            contact[c].until = math.inf
            contact[c].slope = -ball[low].pull if c < low else ball[c].pull
            if contact[c].slope > 0.0 and not is_gap(c, n, contact):
                contact[c].until = -contact[c].u / contact[c].slope
                s = min(s, contact[c].until)
    run[first].reach = s
    for c in range(max(low - 1, 0), min(high + 1, n - 2) + 1):
        k = contact[c]
        if low <= c <= high or k.active == 0:
            k.due = 1 if comes_at(s, k) else 0
            if k.until > s and k.until < second:
                second = k.until
    return 1.0 - s / second if second < math.inf else 1.0
