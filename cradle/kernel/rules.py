"""One run: its impulse rates (R1, R6), ratios in force (R7) and straight way (R3, R8.2).

Its contacts low..high have impulses, or balls that move; contacts beyond them wait, because no
impulse that a ball could notice reaches them.  Numbers of 32 digits are pairs (`numbers`).
"""

import math

from cradle.kernel.numbers import least, less, minus, negative, over, plus, root, scaled, times
from cradle.kernel.state import LIMITS, NEVER, ONE, ZERO, apart


def source_of(first, last, ball):
    """R1: the one contact of a run that drives all others, or -1 if there are several."""
    source = first
    while source < last and ball[source + 1].turn == -1:
        source += 1
    for c in range(source + 1, last + 1):
        if ball[c].turn != 1:
            return -1
    return source


def farthest(c, end, smallest, contact):
    """R1: how far towards `end` impulses reach from the source c: no ratio is above its nominal."""
    x, way = 1.0, 1 if c < end else -1
    while way * (end - c) > 0 and x > smallest:
        ratio = contact[c].forward if way == 1 else contact[c - 1].backward
        x *= ratio.real
        c += way
    return c


def reached(first, run, smallest, ball, contact):
    """R1: set low..high of a run, all of it with several sources; what was reached now waits."""
    one = run[first]
    low, high, source = one.low, one.high, one.source
    one.low = first if source < 0 else farthest(source, first, smallest, contact)
    one.high = one.last if source < 0 else farthest(source, one.last, smallest, contact)
    for c in range(low, one.low):
        contact[c].rate = contact[c].slope = ball[c].pull = ZERO
    for c in range(one.high + 1, high + 1):
        contact[c].rate = contact[c].slope = ball[c + 1].pull = ZERO


def keep_closed(i, low, high, ball, contact, tally):
    """R7: lower the ratio at ball i to its bound (Eq. 53) if the contact driven would open now."""
    # It is held at u = 0 there.  One that is driven from both sides cannot open.
    b, far = ball[i], i + ball[i].turn
    k = contact[min(i, far)]
    if ball[far].turn == -b.turn or k.u.real != 0.0 or k.w != 0.0:
        return
    one = ball[far].m
    onward = ball[far].ratio if low < far <= high else ZERO
    both = plus(one, times(b.m, minus(ONE, onward)))
    nominal, bound = b.ratio.real * both.real, one.real
    if nominal * LIMITS.rounded >= bound:
        k.fixed = 1 if nominal > bound * LIMITS.rounded else 2
        b.ratio = over(one, both)
    if k.fixed != 2:
        tally.margin = min(tally.margin, abs(nominal - bound) / bound)


def ratios_in_force(low, high, ball, contact, tally):
    """R7: the ratios in force in a run, each chain of drives from its far end to its driver."""
    for c in range(low, high + 1):
        contact[c].fixed = 0
    for i in range(low + 1, high + 1):
        ball[i].ratio = contact[i - 1].forward if ball[i].turn == 1 else contact[i - 1].backward
    for i in range(high, low, -1):
        if ball[i].turn == 1:
            keep_closed(i, low, high, ball, contact, tally)
    for i in range(low + 1, high + 1):
        if ball[i].turn == -1:
            keep_closed(i, low, high, ball, contact, tally)


@apart
def several_sources(low, high, smallest, ball, contact):
    """R1, R6: rates of a run with more than one source, where products of ratios are divided."""
    # Each is x * 2**k: long products do not overflow, and a ratio of zero is one vanishing factor.
    x = ONE
    k = top = 0
    for c in range(low, high + 1):
        if c > low:
            way, ratio = ball[c].turn, ball[c].ratio
            if ratio.real == 0.0:
                k -= way * LIMITS.vanishing
            else:
                # The least ratio is 2**-1074: halfway up there is room for it and its rounding.
                x = scaled(x, math.ldexp(1.0, way * 600))
                x = times(x, ratio) if way == 1 else over(x, ratio)
                j = math.frexp(x.real)[1]
                x = scaled(x, math.ldexp(1.0, -j))
                k += j - way * 600
        contact[c].rate = x
        contact[c].power = k
        top = max(top, k) if c > low else k
    for c in range(low, high + 1):
        k = contact[c].power - top
        x = scaled(contact[c].rate, math.ldexp(1.0, max(k, -1000)))
        contact[c].rate = x if k > -1000 and x.real > smallest else ZERO


def rates(first, run, ball, contact, tally):
    """R1, R6: rates of a run, pulls (Eqs. 47-48: m dv = dP left - dP right), slopes."""
    smallest, source = tally.cut_off, run[first].source
    reached(first, run, smallest, ball, contact)
    low, high = run[first].low, run[first].high
    tally.effort -= 2 + high - low
    ratios_in_force(low, high, ball, contact, tally)
    if source < 0:
        several_sources(low, high, smallest, ball, contact)
    else:
        contact[source].rate = ONE
        for c in range(source + 1, high + 1):
            x = times(contact[c - 1].rate, ball[c].ratio)
            contact[c].rate = x if x.real > smallest else ZERO
        for c in range(source - 1, low - 1, -1):
            x = times(contact[c + 1].rate, ball[c + 1].ratio)
            contact[c].rate = x if x.real > smallest else ZERO
    ball[low].pull = negative(times(contact[low].rate, ball[low].inverse))
    for c in range(low, high + 1):
        onward = contact[c + 1].rate if c < high else ZERO
        ball[c + 1].pull = times(minus(contact[c].rate, onward), ball[c + 1].inverse)
        held = contact[c].fixed > 0
        contact[c].slope = ZERO if held else minus(ball[c].pull, ball[c + 1].pull)


def is_clear(difference, size, tally):
    """Tell whether a difference of two numbers of this size is none of rounding; note how large."""
    part = abs(difference) / size if size > 0.0 else 0.0
    if part <= LIMITS.tie:
        return False
    tally.margin = min(tally.margin, part)
    return True


def is_over(c, at_zero, ball, contact):
    """R3: tell whether contact c ends: it opens, or has e = 0 and no longer closes."""
    # `at_zero`: at closing speed zero it ends if it is about to open.  A source whose rate vanishes
    # beside those of other sources (R6) still pushes its own balls apart.
    k = contact[c]
    if k.q.real > 0.0:
        return False
    if not at_zero:
        return k.u.real < 0.0 or (k.u.real == 0.0 and k.e.real == 0.0 and k.w > 0.0)
    source = ball[c].turn != 1 and ball[c + 1].turn != -1
    return k.u.real == 0.0 and (k.slope.real < 0.0 or (source and k.rate.real == 0.0))


def way_to_end(k, tally):
    """R3: progress until contact k has released all, and its closing speed then; or NEVER."""
    # While it opens, Q + rate (u s + slope s^2 / 2) is zero where u^2 is u^2 - 2 slope Q / rate.
    # If it closes first, Q gains e^2 rate u^2 / (2 |slope|): it ends at e^2 u^2 - 2 slope Q / rate.
    closes = k.u.real > 0.0
    if k.rate.real == 0.0 or (k.slope.real >= 0.0 and k.u.real >= 0.0):
        return NEVER, ZERO
    if k.q.real <= 0.0:  # it closes, else it would have ended
        speed = times(k.e, k.u)
    else:
        now = times(k.u, k.u)
        part = over(times(k.slope, k.q), k.rate)
        square = minus(times(k.square, now) if closes else now, plus(part, part))
        again = not closes and k.slope.real > 0.0
        if again and not (is_clear(square.real, now.real, tally) and square.real > 0.0):
            return NEVER, ZERO  # it is compressed again before that
        speed = root(square)
    # Each of these two roots is a sum of positive terms.
    if closes:
        return over(plus(k.u, speed), negative(k.slope)), negative(speed)
    return over(plus(k.q, k.q), times(k.rate, minus(speed, k.u))), negative(speed)


def active_beside(c, n, contact):
    """Return how many of the contacts beside contact c are active; beside an idle gap (R8) two."""
    left = contact[c - 1].active if c > 0 else 0
    return left + (contact[c + 1].active if c < n - 2 else 0)


def course(c, low, high, ball, contact):
    """Return du/ds at contact c of a run or beside it, and the pulls of its balls together."""
    if low <= c <= high:
        return contact[c].slope, abs(ball[c].pull.real) + abs(ball[c + 1].pull.real)
    slope = negative(ball[low].pull) if c < low else ball[c].pull
    return slope, abs(slope.real)


def segment(first, n, run, ball, contact, tally):
    """R8.2: progress of a run to its own next event, and which contacts have it then."""
    # Two events are one if they are closer than what their closing speeds are known to.
    low, high = run[first].low, run[first].high
    left = low - 1 if low > 0 and contact[low - 1].active == 0 else low
    right = high + 1 if high < n - 2 and contact[high + 1].active == 0 else high
    reach = NEVER
    age_of_first = 0.0
    for c in range(left, right + 1):
        k = contact[c]
        slope, pulls = course(c, low, high, ball, contact)
        k.until, k.final = NEVER, ZERO
        if low <= c <= high:
            k.until, k.final = way_to_end(k, tally)
        elif slope.real > 0.0 and active_beside(c, n, contact) == 1:
            k.until = over(negative(k.u), slope)  # a gap, shared with another run, is no own event
        k.age = k.made / pulls if pulls > 0.0 else 0.0
        if less(k.until, reach):
            reach = k.until
            age_of_first = k.age
    run[first].reach = reach
    second = NEVER
    for c in range(left, right + 1):
        k = contact[c]
        late = minus(k.until, reach).real if k.until.real < math.inf else math.inf
        k.due = 1 if late <= LIMITS.tie * max(k.age, age_of_first) else 0
        if k.due == 0:
            second = least(second, k.until)
    if second.real < math.inf:
        tally.margin = min(tally.margin, minus(second, reach).real / second.real)
