"""R9, the second sign of an infinite sequence: impacts repeat in ever smaller cycles.

The state at the end of one contact is that at its end a cycle before, smaller.  Then all further
cycles are smaller copies, and their sum is a geometric series.  Cycles that contain collapses are
found in the same way, on a second level: there collapses are counted, not ends.
"""

import math

from cradle.kernel.collapse import exhausted_stretch, merge
from cradle.kernel.jump import go_on, limit, neighbours_stay, to_limit, velocity_changes
from cradle.kernel.record import record
from cradle.kernel.state import (
    COLLAPSE,
    END,
    LIMITS,
    LOWER,
    REPETITION,
    UPPER,
    Cluster,
    apart,
    jit,
    once,
)


@jit
def settle(n, memory):
    """Hand impulses and works since the last snapshot to the upper level, and begin anew."""
    for c in range(n - 1):
        then, above = memory[LOWER][c], memory[UPPER][c]
        above.p += then.p
        above.a += then.a
        then.p = then.a = 0.0


@jit
def forget(number, levels):
    """Drop the snapshot of a level."""
    level = levels[number]
    level.mark = -1
    # The first snapshot comes after 32 ends, or 8 collapses: short impacts need none.
    level.seen = 16 if number == LOWER else 4
    level.count = 0


@jit
def code(c, state):
    """Return one number for whether contact c is active, and who drives whom at its balls."""
    ball = state.ball
    return 9 * state.contact[c].active + 3 * ball[c].turn + ball[c + 1].turn


@once
def snapshot(level, n, state):
    """Remember the state."""
    contact, memory = state.contact, state.memory[level]
    for c in range(n - 1):
        memory[c].p = memory[c].a = 0.0
        memory[c].u = contact[c].u
        memory[c].q, memory[c].q_lo = contact[c].q, contact[c].q_lo
        memory[c].hits = contact[c].hits
        memory[c].code = code(c, state)


@jit
def has_waited(c, n, state, memory):
    """Tell whether contact c, if it exists, is as it was at the snapshot, without a collision."""
    if not 0 <= c < n - 1:
        return True
    return state.contact[c].hits == memory[c].hits and code(c, state) == memory[c].code


@apart
def cluster_around(c, level, n, state):
    """Return the contacts of a possible cycle around contact c; empty (last < first) if none.

    Contacts left..right had an impulse since the snapshot; of these first..last collided anew and
    the others, steady neighbours, stayed active.  All must be active and driven as they were at the
    snapshot, and one that collided must lose energy.
    """
    contact, memory = state.contact, state.memory[level]
    left = c
    right = c
    while left > 0 and memory[left - 1].p > 0.0:
        left -= 1
    while right < n - 2 and memory[right + 1].p > 0.0:
        right += 1
    first = right + 1
    last = left - 1
    same = memory[c].p > 0.0  # else c has collided without an impulse
    loses = False
    for k in range(left, right + 1):
        same = same and memory[k].code == code(k, state)
        if contact[k].hits != memory[k].hits:
            first = min(first, k)
            last = k
            loses = loses or contact[k].e < 1.0
        else:
            same = same and contact[k].active == 1
    for k in range(first, last + 1):
        same = same and contact[k].hits != memory[k].hits
    # Whoever is active next to them has waited throughout, at a ratio of zero.
    same = same and has_waited(left - 1, n, state, memory)
    same = same and has_waited(right + 1, n, state, memory)
    if (left > 1 and memory[left - 2].p > 0.0) or (right < n - 3 and memory[right + 2].p > 0.0):
        same = False
    if same and loses:
        return Cluster(left, first, last, right)
    return Cluster(c, c, c - 1, c)


@apart
def repeat(c, n, state):
    """Note that the cycle that contact c ends has been repeated; look for another one from here."""
    run = state.run
    first = state.tally[0].first
    while first < n:
        run[first].stirred = 1
        first = run[first].onward
    forget(LOWER, state.level)
    record(REPETITION, c, n, state)


@apart
def cycle(level, c, early, n, state):
    """If the neighbourhood of contact c repeats itself on another scale, go to the limit.

    Light balls need many cycles to settle on one factor.  It is enough that what still changes
    will not matter: the bend, how far the state turns by the time that it is exhausted, is below
    its limit at the pace since the snapshot; `early` after it that pace says little.  Without
    steady neighbours the limit does not depend on the bend.  With them it does: then the part of
    the way that the bend leaves open, and what the digits of the neighbours' shares do, must be
    too small to matter.  Where these say nothing of the limit, the cycle ends where it is, if it is
    too small to matter itself.

    Where there is none, or a neighbour comes to its event before it, the cycle is repeated as often
    as it surely repeats itself.

    Returns (first, last) of the contacts that have collapsed, empty if none have.
    """
    threshold = state.tally[0].threshold
    cluster = cluster_around(c, level, n, state)
    if cluster.last < cluster.first:
        return c, c - 1
    total, off, size, unsure, doubt = limit(cluster, level, state)
    if total == 0.0:
        return c, c - 1
    if total > 0.0 and unsure > LIMITS.one_digit:
        total, unsure, doubt = 0.0, 0.0, size  # only the last digits tell of the limit
    bent = 0.0
    if off > LIMITS.self_similar:
        if early or total < 0.0:
            return c, c - 1  # a cycle that grows does so by one factor
        # How often the scale still shrinks by L before nothing is left; log(1 / L) is above
        # 1 / (T + 1/2), and as good as that for a slow cycle.
        bent = off * max(math.log(size / threshold), 1.0) * (total + 0.5)
        if not bent < LIMITS.bend:
            return c, c - 1
    farthest = velocity_changes(cluster, total, level, state)
    steady = cluster.left < cluster.first or cluster.last < cluster.right
    # Of two contacts only the scale changes slowly; of more, `off` may be of something else too.
    two = cluster.last < cluster.first + 2
    turns = bent if two else max(bent, off * (total + 0.5))
    error = doubt + (unsure + turns) * farthest if steady else 0.0
    if total >= 0.0:
        if error > LIMITS.doubt * threshold:
            return c, c - 1
        if neighbours_stay(cluster, total, 1.0, level, n, state):
            to_limit(cluster, total, level, n, state)
            return cluster.first, cluster.last
    certain = bent == 0.0 and (two or not steady)
    if level == LOWER and certain and go_on(cluster, total, error, n, state):
        repeat(c, n, state)
    return c, c - 1


@apart
def remember(number, c, n, state):
    """Take a snapshot at contact c, in place of the one before."""
    level, memory = state.level[number], state.memory
    level.mark = c
    level.seen = level.count
    if number == LOWER:
        settle(n, memory)
    snapshot(number, n, state)


@jit
def look(number, c, n, state):
    """See whether contact c has come round; take a new snapshot if the last one is old.

    Snapshots are taken at doubling distances, so that a cycle of any length is found.
    """
    level = state.level[number]
    if level.mark == c:
        early = 2 * level.count <= 3 * level.seen
        first, last = cycle(number, c, early, n, state)
        if first <= last:
            return first, last
    if level.count >= 2 * level.seen:
        remember(number, c, n, state)
    return c, c - 1


@apart
def look_above(first, last, n, state):
    """R9: contacts first..last have collapsed; see whether such collapses come round too."""
    level = state.level
    forget(LOWER, level)
    settle(n, state.memory)
    level[UPPER].count += 1
    one, other = look(UPPER, first, n, state)
    if one <= other:
        forget(UPPER, level)
        first, last = one, other
    loses = False
    for c in range(first, last + 1):
        loses = loses or state.contact[c].e < 1.0
    for c in range(first, last + 1):
        record(COLLAPSE if loses else END, c, n, state)
    if loses:
        state.tally[0].collapsed = 1


@once
def take_limits(ends, ended, worn, n, state):
    """R9, after `ends` contacts have ended, `ended` the last; tell whether contacts collapsed."""
    state.level[LOWER].count += ends
    first, last = ended, ended - 1
    if worn >= 0:
        first, last = exhausted_stretch(worn, n, state)
        if first <= last:
            first, last = merge(first, last, n, state)
    if last < first:
        first, last = look(LOWER, ended, n, state)
    if last < first:
        return False
    look_above(first, last, n, state)
    return True


@once
def last_limits(n, state):
    """R9: sequences that shrank so fast that the last digit was the limit have collapsed too."""
    contact = state.contact
    for c in range(n - 1):
        if contact[c].tiny > 0 and contact[c].u == 0.0 and contact[c].e < 1.0:
            state.tally[0].collapsed = 1
            record(COLLAPSE, c, n, state)
