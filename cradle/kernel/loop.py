"""The event loop: rounds of events, each a closed-form root of the impulses (R8); the door.

Numbers of 32 digits are pairs kept in one complex number (`numbers`); `.real` is the leading one.
"""

import math
from typing import Any, NamedTuple

from cradle.kernel.cycles import forget, take_limits
from cradle.kernel.events import close_contacts, end_contacts, reduced_mass, start
from cradle.kernel.numbers import minus, negative, over, plus, read, scaled, times
from cradle.kernel.progress import go
from cradle.kernel.record import velocity
from cradle.kernel.state import (
    ENERGY,
    FINISHED,
    LEDGER,
    LIMITS,
    LOWER,
    MOMENTUM,
    ONE,
    ORDER,
    PAUSED,
    PULL,
    REFUSED,
    UNDECIDED,
    UNFINISHED,
    UNSOUND,
    UPPER,
    ZERO,
    apart,
    door,
)


class Inputs(NamedTuple):
    """Chains, one a row."""

    m: Any
    v: Any
    e: Any
    forward: Any
    backward: Any


class Options(NamedTuple):
    """How to solve them."""

    meeting: float
    max_events: int  # most rounds; the textbook allows two for each event
    bounded: bool  # refuse ratios above Eq. 53


class Outputs(NamedTuple):
    """Outcomes, a row for each chain; impulses, works and held contacts of the last one alone."""

    v: Any
    hits: Any
    collapsed: Any
    margin: Any
    p: Any
    a: Any
    held: Any


def largest_ratio(m, driven, onward):
    """R7: the bound of a ratio (Eq. 53), as `closed_form.largest_ratios` draws it."""
    return 1.0 / (1.0 + m / driven * (1.0 - onward))


def meant(ratio, m, driven, onward, given):
    """R7: the ratio, or its bound (Eq. 53) if only rounding parts it from that of the one given."""
    bound = largest_ratio(m.real, driven.real, given)
    if bound < ratio.real * LIMITS.rounded and ratio.real < bound * LIMITS.rounded:
        return over(driven, plus(driven, times(m, minus(ONE, onward))))
    return ratio


@apart
def admissible(n, chain, bounded):
    """Tell whether all inputs are within their limits, ratios within Eq. 53 too if `bounded`."""
    m, v, e, forward, backward = chain.m, chain.v, chain.e, chain.forward, chain.backward
    heaviest = energy = momentum = 0.0
    for i in range(n):
        heaviest = max(heaviest, m[i])
        momentum += 2.0 * (m[i] * abs(v[i]))
        energy += m[i] * v[i] * v[i]
    if not (energy < math.inf and momentum < math.inf):
        return False
    for i in range(n):
        if not (0.0 < m[i] < math.inf and m[i] >= LIMITS.lightest * heaviest):
            return False
        if i < n - 1 and not (e[i] == 0.0 or LIMITS.least_restitution <= e[i] <= 1.0):
            return False
    for i in range(n - 2):
        if not (0.0 <= forward[i] <= 1.0 and 0.0 <= backward[i] <= 1.0):
            return False
        onward, back = forward[i + 1] if i < n - 3 else 0.0, backward[i - 1] if i > 0 else 0.0
        if bounded and (
            forward[i] > largest_ratio(m[i + 1], m[i + 2], onward) * LIMITS.rounded
            or backward[i] > largest_ratio(m[i + 1], m[i], back) * LIMITS.rounded
        ):
            return False
    return True


@apart
def prepare(n, chain, meeting, state):
    """Write the chain into the state, in its own units, powers of two; R2; tell if UNDECIDED."""
    ball, contact, tally = state.ball, state.contact, state.tally[0]
    largest, heaviest, product = 0.0, 0.0, 1.0
    for i in range(n):
        largest = max(largest, abs(chain.v[i]))
        heaviest = max(heaviest, chain.m[i])
    # The units themselves and their inverses are numbers too.
    tally.shift = min(max(math.frexp(largest)[1], -1000), 1023)
    tally.mass_shift = min(max(math.frexp(heaviest)[1], -1000), 1023)
    tally.unit, mass_unit = math.ldexp(1.0, -tally.shift), math.ldexp(1.0, -tally.mass_shift)
    tally.meeting = read(meeting)
    tally.events = tally.rounds = tally.stamp = tally.collapsed = tally.defect = 0
    tally.cut_off, tally.fastest, tally.energy, tally.margin = LIMITS.cut, 0.0, 0.0, 1.0
    for i in range(n):
        b = ball[i]
        b.v = chain.v[i]
        b.start = scaled(read(chain.v[i]), tally.unit)
        b.m = scaled(read(chain.m[i]), mass_unit)
        b.inverse, b.pull, b.turn = over(ONE, b.m), ZERO, 0
        tally.cut_off = min(tally.cut_off, LIMITS.cut * b.m.real)
    for c in range(n - 1):
        k = contact[c]
        k.e = read(chain.e[c])
        k.square = times(k.e, k.e)
        if c < n - 2:
            back = contact[c - 1].backward if c > 0 else ZERO
            k.forward = read(chain.forward[c])
            given = chain.backward[c - 1] if c > 0 else 0.0
            k.backward = meant(read(chain.backward[c]), ball[c + 1].m, ball[c].m, back, given)
            for ratio in (chain.forward[c], chain.backward[c]):
                product *= ratio if 0.0 < ratio < LIMITS.faint else 1.0
        k.u = minus(ball[c].start, ball[c + 1].start)
        k.made = abs(ball[c].start.real) + abs(ball[c + 1].start.real)
        k.before = negative(k.u)
        k.q = k.p = k.a = k.rate = k.slope = ZERO
        k.w = 0.0
        k.active = k.tiny = k.hits = k.held = k.fixed = k.due = k.stamp = 0
        if k.u.real > 0.0:
            tally.fastest = max(tally.fastest, k.u.real)
            tally.energy = max(tally.energy, reduced_mass(c, ball) * k.u.real * k.u.real)
    for c in range(n - 3, -1, -1):
        onward = contact[c + 1].forward if c < n - 3 else ZERO
        given = chain.forward[c + 1] if c < n - 3 else 0.0
        contact[c].forward = meant(contact[c].forward, ball[c + 1].m, ball[c + 2].m, onward, given)
    forget(LOWER, state.level)
    forget(UPPER, state.level)
    start(n, state)
    if product < LIMITS.product:
        tally.margin = 0.0
    return product < LIMITS.product


def impact(n, max_rounds, state):
    """Run rounds until no contact is active, or until effort or room are used up: PAUSED."""
    run, tally = state.run, state.tally[0]
    while True:
        if tally.effort < 0 or tally.events > tally.room:
            return PAUSED
        # R8.1: ends first, those that are known without the slopes before the others; then R9.
        tally.ends, tally.worn = 0, -1
        end_contacts(False, n, state)
        certain = tally.ends
        end_contacts(True, n, state)
        collapsed = tally.ends > 0 and take_limits(n, state)
        if run[n - 1].onward == n - 1:
            return FINISHED
        tally.rounds += 1
        if tally.rounds > max_rounds:
            return UNFINISHED
        # R8.1: then closings; both need no progress, so the next round looks again.
        if tally.ends > certain or collapsed or close_contacts(n, state):
            continue
        go(n, state)
        if tally.defect > 0:
            return UNSOUND


@apart
def settle(n, v, ball, contact, unit):
    """Leave changes of velocity in `x`, and velocities in `v`, these in the caller's units."""
    # Balls that move as one, or whose order is lost in the last digits, have one velocity: that of
    # the ball which impulses have changed least.
    before = ZERO
    for i in range(n):
        after = contact[i].p if i < n - 1 else ZERO
        ball[i].x = times(minus(before, after), ball[i].inverse)
        v[i] = velocity(ball[i], ball[i].x, unit)
        before = after
    first = 0
    while first < n:
        last = best = first
        while last < n - 1 and (
            contact[last].u.real == 0.0 or (contact[last].u.real < 0.0 and v[last] > v[last + 1])
        ):
            last += 1
            if abs(ball[last].x.real) < abs(ball[best].x.real):
                best = last
        common = v[best]
        for i in range(first, last + 1):
            v[i] = common
        first = last + 1


@apart
def certify(n, v, ball, contact, tally):
    """Return what a settled outcome breaks, or 0; each sum within the rounding of its terms."""
    # Velocities come from impulses alone: they must part as the closing speeds say, and the energy
    # lost, impulse times mean closing speed, must be (1 - e^2) of the contacts' works.
    unit = tally.unit
    momentum = terms = grain = 0.0
    lost = kept = absorbed = energy = 0.0
    strongest = weakest = least_work = 0.0
    speed = plus(ball[0].start, ball[0].x)
    for i in range(n):
        b = ball[i]
        push = contact[i].p.real if i < n - 1 else 0.0
        change = v[i] * unit - b.v * unit
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
        if (v[i] - v[i + 1]) * unit > LIMITS.tie * spread:
            return ORDER
        speed = next_speed
        first = minus(b.start, right.start).real
        lost += 0.5 * push * (first + closing)
        energy += abs(push) * (abs(first) + abs(closing))
        kept += (1.0 - k.square.real) * k.a.real
        absorbed += k.a.real
        strongest, weakest = max(strongest, push), min(weakest, push)
        least_work = min(least_work, k.a.real)
    slack = (LIMITS.sound + n * 2.0**-52) * (energy + absorbed)
    if not abs(momentum) <= LIMITS.sound * terms + grain < math.inf:
        return MOMENTUM
    if least_work < -slack or weakest < -LIMITS.sound * strongest:
        return PULL
    if not -lost <= slack < math.inf:
        return ENERGY
    if not abs(lost - kept) <= slack:
        return LEDGER
    return 0


@door
def batch(begin, resumed, n, inputs, options, out, state, effort):
    """Solve the chains of `out` from number `begin` on; return the next one's number and status."""
    # It stops at the first chain whose status is not FINISHED: PAUSED, when `effort` (contacts
    # touched) is used up, to be `resumed` there; UNDECIDED, before its first event, likewise.
    ball, contact, tally = state.ball, state.contact, state.tally[0]
    tally.effort = effort
    for k in range(begin, len(out.v)):
        if not resumed:
            chain = Inputs(
                inputs.m[k], inputs.v[k], inputs.e[k], inputs.forward[k], inputs.backward[k]
            )
            if not admissible(n, chain, options.bounded):
                return k, REFUSED
            if prepare(n, chain, options.meeting, state):
                return k, UNDECIDED
        resumed = False
        v, hits = out.v[k], out.hits[k]
        status = impact(n, options.max_events, state)
        settle(n, v, ball, contact, tally.unit)
        if status == FINISHED:
            tally.defect = certify(n, v, ball, contact, tally)
            status = UNSOUND if tally.defect > 0 else FINISHED
        out.collapsed[k] = tally.collapsed
        out.margin[k] = tally.margin
        for c in range(n - 1):
            hits[c] = contact[c].hits
        for c in range(len(out.p)):
            out.p[c] = math.ldexp(contact[c].p.real, tally.shift + tally.mass_shift)
            out.a[c] = math.ldexp(contact[c].a.real, 2 * tally.shift + tally.mass_shift)
            out.held[c] = contact[c].held
        if status != FINISHED:
            return k, status
    return len(out.v), FINISHED
