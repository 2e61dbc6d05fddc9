"""Many impacts, outcome alone or with a record of one: checks of input, event loop, outcome."""

import math
from typing import Any, NamedTuple

from cradle.kernel.certificate import certify
from cradle.kernel.loop import impact
from cradle.kernel.record import settle
from cradle.kernel.state import FINISHED, LIMITS, REFUSED, UNSOUND, apart, door


class Inputs(NamedTuple):
    """Chains: one a row, or one row for all."""

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
    p: Any
    a: Any
    held: Any


@apart
def admissible(n, chain, bounded):
    """Tell whether all inputs are within their limits, ratios within Eq. 53 too if `bounded`."""
    m, v, e, forward, backward = chain.m, chain.v, chain.e, chain.forward, chain.backward
    heaviest = 0.0
    for i in range(n):
        heaviest = max(heaviest, m[i])
    energy = 0.0
    momentum = 0.0
    for i in range(n):
        if not (0.0 < m[i] < math.inf and m[i] >= LIMITS.lightest * heaviest):
            return False
        momentum += 2.0 * (m[i] * abs(v[i]))
        energy += m[i] * v[i] * v[i]
    if not (energy < math.inf and momentum < math.inf):
        return False
    for c in range(n - 1):
        if not (0.0 <= e[c] <= 1.0 and (e[c] == 0.0 or e[c] >= LIMITS.least_restitution)):
            return False
    for i in range(n - 2):
        if not (0.0 <= forward[i] <= 1.0 and 0.0 <= backward[i] <= 1.0):
            return False
    if bounded:
        # The operations of `closed_form.largest_ratios`, so that both draw the same line.
        onward = 0.0
        back = 0.0
        for i in range(n - 2):
            j = n - 3 - i
            if forward[j] > 1.0 / (1.0 + m[j + 1] / m[j + 2] * (1.0 - onward)) * LIMITS.rounded:
                return False
            if backward[i] > 1.0 / (1.0 + m[i + 1] / m[i] * (1.0 - back)) * LIMITS.rounded:
                return False
            onward = forward[j]
            back = backward[i]
    return True


@apart
def hand_out(k, n, out, ball, contact, tally):
    """Write the outcome of chain k in the caller's units."""
    shift, mass_shift = tally.shift, tally.mass_shift
    out_v, hits = out.v[k], out.hits[k]
    for i in range(n):
        out_v[i] = ball[i].after
    out.collapsed[k] = tally.collapsed
    for c in range(n - 1):
        hits[c] = contact[c].hits
    for c in range(len(out.p)):
        out.p[c] = math.ldexp(contact[c].p.real, shift + mass_shift)
        out.a[c] = math.ldexp(contact[c].a.real, 2 * shift + mass_shift)
        out.held[c] = contact[c].held


@door
def batch(begin, resumed, n, inputs, options, out, state, effort):
    """Solve the chains of `out` from number `begin` on; return the next one's number, and status.

    It stops at the first chain whose status is not FINISHED: PAUSED, when `effort` (contacts
    touched) is used up, to be `resumed` there.
    """
    rows = len(out.v)
    # How far to go from row to row: not at all in an input that has one for all.
    by_m, by_v = min(len(inputs.m), 2) - 1, min(len(inputs.v), 2) - 1
    by_e = min(len(inputs.e), 2) - 1
    by_f, by_b = min(len(inputs.forward), 2) - 1, min(len(inputs.backward), 2) - 1
    state.tally[0].effort, state.tally[0].capacity = effort, len(state.record.kinds)
    for k in range(begin, rows):
        chain = Inputs(
            inputs.m[k * by_m], inputs.v[k * by_v], inputs.e[k * by_e],
            inputs.forward[k * by_f], inputs.backward[k * by_b],
        )  # fmt: skip
        if not resumed and not admissible(n, chain, options.bounded):
            return k, REFUSED
        status = impact(n, chain, options.meeting, options.max_events, resumed, state)
        resumed = False
        settle(n, state.ball, state.contact, state.tally[0].unit)
        if status == FINISHED:
            state.tally[0].defect = certify(n, state.ball, state.contact, state.tally[0])
            status = UNSOUND if state.tally[0].defect > 0 else FINISHED
        hand_out(k, n, out, state.ball, state.contact, state.tally[0])
        if status != FINISHED:
            return k, status
    return rows, FINISHED
