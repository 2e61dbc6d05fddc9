"""Events: contacts end, close and hand over; runs split and grow accordingly (R2 to R5)."""

from cradle.kernel.numbers import ZERO, minus, negative
from cradle.kernel.record import record
from cradle.kernel.rules import has_ended, is_clear, opens_at_zero, source_of
from cradle.kernel.state import CERTAIN, CLOSE, END, LIMITS, SLOPED, apart, jit, once


@jit
def link(before, after, n, run, tally):
    """Make two runs neighbours in the list; -1 stands for its beginning, n for its end."""
    if before < 0:
        tally.first = after
    else:
        run[before].onward = after
    if after < n:
        run[after].back = before


@jit
def run_of(c, contact):
    """Return the first contact of the run of the active contact c."""
    while c > 0 and contact[c - 1].active == 1:
        c -= 1
    return c


@jit
def stir(c, n, run, contact):
    """Note that the runs at contact c and across an idle contact beside it have changed."""
    k = c
    if contact[c].active == 0:
        k = c - 1
        if k >= 0 and contact[k].active == 1:
            run[run[k].first].stirred = 1
        k = c + 1
        if k < n - 1 and contact[k].active == 1:
            run[k].stirred = 1
    if c > 1 and contact[c - 1].active == 0 and contact[c - 2].active == 1:
        run[run[c - 2].first].stirred = 1
    if c < n - 3 and contact[c + 1].active == 0 and contact[c + 2].active == 1:
        run[c + 2].stirred = 1


@jit
def make_run(first, last, source, low, high, run):
    """Write a run down."""
    run[first].last = last
    run[last].first = first
    run[first].source = source
    run[first].low = low
    run[first].high = high
    run[first].stirred = 1


@once
def start(n, state):
    """R2: in each touching stretch the leftmost approaching contact is the source."""
    ball, contact, run, tally = state.ball, state.contact, state.run, state.tally[0]
    link(-1, n, n, run, tally)
    before = -1
    c = 0
    while c < n - 1:
        if contact[c].u.real < 0.0:
            c += 1
            continue
        first = c
        source = -1
        while c < n - 1 and contact[c].u.real >= 0.0:
            if source < 0 and contact[c].u.real > 0.0:
                source = c
            c += 1
        if source >= 0:
            for k in range(first, c):
                contact[k].active = 1
                contact[k].hits = 1
                if k > first:
                    ball[k].turn = 1 if k > source else -1
            make_run(first, c - 1, source, first, c - 1, run)
            link(before, first, n, run, tally)
            link(first, n, n, run, tally)
            before = first


@once
def activate(c, from_left, from_right, ball, contact):
    """R4, R5: contact c becomes active, driven from the side or sides already active."""
    contact[c].q = ZERO
    contact[c].w = 0.0
    contact[c].rate = ZERO  # it drives nobody in this round
    contact[c].active = 1
    contact[c].hits += 1
    if from_left:
        ball[c].turn = 1
    if from_right:
        ball[c + 1].turn = -1


@apart
def grow(c, n, ball, contact, run, tally):
    """R5: take the contact c that has just closed into the run, or the two runs, beside it."""
    from_left = c > 0 and contact[c - 1].active == 1
    from_right = c < n - 2 and contact[c + 1].active == 1
    activate(c, from_left, from_right, ball, contact)
    if from_left and from_right:  # R8.5: several sources
        first, right = run[c - 1].first, c + 1
        last, after = run[right].last, run[right].onward
        make_run(first, last, -1, first, last, run)
        link(first, after, n, run, tally)
    elif from_left:
        first = run[c - 1].first
        make_run(first, c, run[first].source, run[first].low, c, run)
    else:
        right = c + 1
        before, after, source = run[right].back, run[right].onward, run[right].source
        make_run(c, run[right].last, source, c, run[right].high, run)
        link(before, c, n, run, tally)
        link(c, after, n, run, tally)
    stir(c, n, run, contact)


@apart
def deactivate(c, first, n, ball, contact, run, tally):
    """R4: contact c of a run ends and its relations go; contacts that it drove become sources."""
    contact[c].q = ZERO
    contact[c].active = 0
    contact[c].before, contact[c].stamp = negative(contact[c].u), tally.stamp
    ball[c].turn = 0
    ball[c + 1].turn = 0
    last, source, low, high = run[first].last, run[first].source, run[first].low, run[first].high
    before, after = run[first].back, run[first].onward
    if c > first:
        one = source
        if source < 0:
            one = source_of(first, c - 1, ball)
        elif c <= source:
            one = c - 1
        make_run(first, c - 1, one, min(low, c - 1), min(high, c - 1), run)
        before = first
    if c < last:
        other = source
        if source < 0:
            other = source_of(c + 1, last, ball)
        elif c >= source:
            other = c + 1
        make_run(c + 1, last, other, max(low, c + 1), max(high, c + 1), run)
        link(before, c + 1, n, run, tally)
        before = c + 1
    link(before, after, n, run, tally)
    stir(c, n, run, contact)


@jit
def reduced_mass(c, ball):
    """Return the reduced mass of the two balls of contact c."""
    one, other = ball[c].m.real, ball[c + 1].m.real
    return one / (one + other) * other


@jit
def exhausted(c, work, ball, contact, tally):
    """R9: tell whether next to nothing is left of contact c, neither closing speed nor `work`."""
    threshold = LIMITS.exhausted * tally.fastest
    if abs(contact[c].u.real) >= threshold:
        return False
    return 2.0 * work < reduced_mass(c, ball) * threshold * threshold


@once
def count_exhausted(c, n, ball, contact, tally):
    """R9: count a collision as exhausted if all of it was; a genuine one clears its neighbours.

    Returns whether so many in a row may be a collapse.
    """
    if not exhausted(c, contact[c].w, ball, contact, tally):
        for k in range(max(c - 1, 0), min(c + 1, n - 2) + 1):
            contact[k].tiny = 0
    elif contact[c].w > 0.0:
        contact[c].tiny += 1
        return contact[c].tiny >= LIMITS.repeats
    return False


@jit
def end_contacts(which, n, state):
    """R3, R8.1: end every contact that needs no progress to end; left to right.

    SLOPED are those that open from u = 0, once the slopes are known; CERTAIN all others, before.
    Returns the number of ends, the last contact ended, and one that is worn out (R9) or -1.
    """
    ball, contact, run, tally = state.ball, state.contact, state.run, state.tally[0]
    ends = 0
    ended = -1
    worn = -1
    first = tally.first
    while first < n:
        after = run[first].onward
        if run[first].stirred == 1:
            high = run[first].high
            for c in range(run[first].low, high + 1):
                sloped = which == SLOPED and opens_at_zero(c, ball, contact)
                if not (sloped or (which == CERTAIN and has_ended(c, contact))):
                    continue
                if count_exhausted(c, n, ball, contact, tally):
                    worn = c
                last = run[first].last
                deactivate(c, first, n, ball, contact, run, tally)
                if c < last:
                    first = c + 1
                ends += 1
                ended = c
                record(END, c, n, state)
        first = after
    return ends, ended, worn


@jit
def about_to_close(c, n, contact):
    """R5: tell whether the idle contact c is at zero, driven from one side.

    Its neighbour pushes, be it by a vanishing number (R6).
    """
    if not 0 <= c < n - 1 or contact[c].active == 1 or contact[c].u.real < 0.0:
        return False
    from_left = c > 0 and contact[c - 1].active == 1
    return from_left != (c < n - 2 and contact[c + 1].active == 1)


@jit
def distance(c, contact, tally):
    """Return how far contact c was from closing before the last progress, or at its end since."""
    k = contact[c]
    return k.before if k.stamp == tally.stamp else ZERO


@once
def goes_first(c, left, contact, tally):
    """R8.6: tell whether contact c closes before the one on the left of the same free ball.

    The nearer one does; of equals the left one.
    """
    one = distance(left, contact, tally)
    nearer = minus(one, distance(c, contact, tally)).real
    return is_clear(nearer, one.real, tally) and nearer > 0.0


@jit
def close_contacts(n, state):
    """R5, R8.1: activate every idle contact that is about to close; left to right.

    Of two that close on one ball between two runs, the one that was nearer goes first (R8.6).
    """
    ball, contact, run, tally = state.ball, state.contact, state.run, state.tally[0]
    closes = 0
    first = tally.first
    while first < n:
        after = run[first].onward
        if run[first].stirred == 1:
            left, right = first - 1, run[first].last + 1
            if about_to_close(left, n, contact):
                grow(left, n, ball, contact, run, tally)
                record(CLOSE, left, n, state)
                closes += 1
            if about_to_close(right, n, contact):
                both = about_to_close(right + 1, n, contact)
                if not (both and goes_first(right + 1, right, contact, tally)):
                    grow(right, n, ball, contact, run, tally)
                    record(CLOSE, right, n, state)
                    closes += 1
        first = after
    return closes
