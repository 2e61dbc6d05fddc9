"""Events: contacts end, close and hand over; runs split and grow accordingly (R2 to R5)."""

from cradle.kernel.numbers import minus, negative
from cradle.kernel.record import record
from cradle.kernel.rules import active_beside, is_clear, is_over, rates, source_of
from cradle.kernel.state import CLOSE, END, LIMITS, ZERO, apart


def link(before, after, run):
    """Make two runs neighbours in the ring."""
    run[before].onward = after
    run[after].back = before


def stir(c, n, run, contact):
    """Note that the runs at contact c and across an idle contact beside it have changed."""
    for k in range(max(c - 2, 0), min(c + 2, n - 2) + 1):
        if contact[k].active == 1:
            if k == 0 or contact[k - 1].active == 0:
                run[k].stirred = 1
            elif k == n - 2 or contact[k + 1].active == 0:
                run[run[k].first].stirred = 1


def make_run(first, last, source, low, high, run):
    """Write a run down; source, low and high are those of a longer one, or of this."""
    run[first].last = last
    run[last].first = first
    run[first].source = min(max(source, first), last) if source >= 0 else -1
    run[first].low = min(max(low, first), last)
    run[first].high = min(max(high, first), last)
    run[first].stirred = 1


def start(n, state):
    """R2: in each touching stretch the leftmost approaching contact is the source."""
    ball, contact, run, tally = state.ball, state.contact, state.run, state.tally[0]
    link(n - 1, n - 1, run)
    # Whether two approaching contacts are of one stretch hangs on the contacts between them.
    last, wide, between = n, 0.0, False
    for k in range(n - 1):
        u = contact[k].u.real
        if u > 0.0:
            if last < k and wide == 0.0 and between:
                tally.margin = min(tally.margin, contact[last].u.real / tally.fastest)
            if last < k - 1:
                tally.margin = min(tally.margin, wide / tally.fastest)
            between = last < k and wide == 0.0
            last, wide = k, 0.0
        wide = max(wide, -u)
    c = 0
    while c < n - 1:
        first, source = c, -1
        while c < n - 1 and contact[c].u.real >= 0.0:
            if source < 0 and contact[c].u.real > 0.0:
                source = c
            c += 1
        if source >= 0:
            for k in range(first, c):
                contact[k].active = contact[k].hits = 1
                if k > first:
                    ball[k].turn = 1 if k > source else -1
            make_run(first, c - 1, source, first, c - 1, run)
            link(run[n - 1].back, first, run)
            link(first, n - 1, run)
        c += 1


@apart
def grow(c, n, ball, contact, run):
    """R4, R5: contact c closes; it joins the runs beside it, one or two, which drive it."""
    k = contact[c]
    k.q = k.rate = ZERO  # it drives nobody in this round
    k.w = 0.0
    k.active = 1
    k.hits += 1
    first = last = low = high = c
    source = -1  # R8.5: several sources
    from_left = c > 0 and contact[c - 1].active == 1
    from_right = c < n - 2 and contact[c + 1].active == 1
    if from_left:
        ball[c].turn = 1
        first = run[c - 1].first
        low = run[first].low
    if from_right:
        ball[c + 1].turn = -1
        last, high = run[c + 1].last, run[c + 1].high
    if not from_left:
        source = run[c + 1].source
        link(run[c + 1].back, c, run)
    elif not from_right:
        source = run[first].source
    if from_right:
        link(first, run[c + 1].onward, run)
    make_run(first, last, source, low, high, run)
    stir(c, n, run, contact)


@apart
def deactivate(c, first, n, ball, contact, run, tally):
    """R4: contact c of a run ends and its relations go; contacts that it drove become sources."""
    contact[c].q = ZERO
    contact[c].active = 0
    contact[c].before, contact[c].stamp = negative(contact[c].u), tally.stamp
    ball[c].turn = ball[c + 1].turn = 0
    last, source, low, high = run[first].last, run[first].source, run[first].low, run[first].high
    before, after = run[first].back, run[first].onward
    for one, other in ((first, c - 1), (c + 1, last)):
        if one <= other:
            own = source if source >= 0 else source_of(one, other, ball)
            make_run(one, other, own, low, high, run)
            link(before, one, run)
            before = one
    link(before, after, run)
    stir(c, n, run, contact)


def reduced_mass(c, ball):
    """Return the reduced mass of the two balls of contact c."""
    one, other = ball[c].m.real, ball[c + 1].m.real
    return one / (one + other) * other


def exhausted(c, work, ball, contact, tally):
    """R9: tell whether next to nothing is left of contact c, neither closing speed nor `work`."""
    least = LIMITS.exhausted * tally.fastest
    slow = abs(contact[c].u.real) < least
    return slow and 2.0 * work < reduced_mass(c, ball) * least * least


def count_exhausted(c, n, ball, contact, tally):
    """R9: count an exhausted collision; tell whether so many in a row may be a collapse."""
    if not exhausted(c, contact[c].w, ball, contact, tally):
        for k in range(max(c - 1, 0), min(c + 1, n - 2) + 1):
            contact[k].tiny = 0
    elif contact[c].w > 0.0:
        contact[c].tiny += 1
        return contact[c].tiny >= LIMITS.repeats
    return False


def end_contacts(at_zero, n, state):
    """R3, R8.1: end what needs no progress to end: by its past; then, at new rates, `at_zero`."""
    ball, contact, run, tally = state.ball, state.contact, state.run, state.tally[0]
    first = run[n - 1].onward
    while first < n - 1:
        after = run[first].onward
        if run[first].stirred == 1:
            if at_zero:
                rates(first, run, ball, contact, tally)
            high = run[first].high
            for c in range(run[first].low, high + 1):
                if not is_over(c, at_zero, ball, contact):
                    continue
                tally.ends += 1
                tally.ended = c
                if count_exhausted(c, n, ball, contact, tally):
                    tally.worn = max(tally.worn, c)
                last = run[first].last
                deactivate(c, first, n, ball, contact, run, tally)
                if c < last:
                    first = c + 1
                record(END, c, n, state)
        first = after


def about_to_close(c, n, contact):
    """R5, R6: tell whether contact c is idle, at zero, and driven from one side, however weakly."""
    if not 0 <= c < n - 1 or contact[c].active == 1 or contact[c].u.real < 0.0:
        return False
    return active_beside(c, n, contact) == 1


def closes_now(c, n, contact, tally):
    """R5, R8.6: tell whether contact c closes; of two on one free ball the nearer, or left one."""
    if not about_to_close(c, n, contact):
        return False
    if not about_to_close(c + 1, n, contact):
        return True
    # How far they were from closing before the last progress, or when they ended since.
    left, right = contact[c], contact[c + 1]
    one = left.before if left.stamp == tally.stamp else ZERO
    other = right.before if right.stamp == tally.stamp else ZERO
    farther = minus(one, other).real
    return not (is_clear(farther, one.real, tally) and farther > 0.0)


def close_contacts(n, state):
    """R5, R8.1: activate every idle contact that is about to close, left to right; tell if any."""
    contact, run, tally = state.contact, state.run, state.tally[0]
    closed = False
    first = run[n - 1].onward
    while first < n - 1:
        after = run[first].onward
        if run[first].stirred == 1:
            for c in (first - 1, run[first].last + 1):
                if closes_now(c, n, contact, tally):
                    grow(c, n, state.ball, contact, run)
                    record(CLOSE, c, n, state)
                    closed = True
        first = after
    return closed
