"""R9: snapshots of the contacts around one that has ended, and what has repeated itself since."""

from cradle.kernel.numbers import minus
from cradle.kernel.state import LIMITS, LOWER, Cluster, apart, jit


@jit
def forget(number, levels):
    """Drop the snapshot of a level, and begin to count anew: short impacts need none."""
    level = levels[number]
    level.mark = -1
    level.count = level.taken = 0
    level.due = 16 if number == LOWER else 4


@jit
def code(c, state):
    """Return one number for whether contact c is active, and who drives whom at its balls."""
    ball = state.ball
    return 9 * state.contact[c].active + 3 * ball[c].turn + ball[c + 1].turn


@apart
def remember(number, c, n, state):
    """Take a snapshot of the contacts around c.

    It is kept for 1, 1, 2, 1, 1, 2, 4, 1, ... times the least distance, so that a short cycle is
    found soon and a long one, too.
    """
    level, contact, memory = state.level[number], state.contact, state.memory[number]
    level.mark = c
    level.taken += 1
    distance, k = 16 if number == LOWER else 4, level.taken
    while k == 2 * (k // 2):
        distance, k = 2 * distance, k // 2
    level.due = level.count + distance
    level.low, level.high = max(c - LIMITS.window, 0), min(c + LIMITS.window, n - 2)
    for j in range(level.low, level.high + 1):
        k, then = contact[j], memory[j]
        then.u, then.q, then.p, then.a = k.u, k.q, k.p, k.a
        then.hits, then.code = k.hits, code(j, state)


@jit
def since(c, contact, memory):
    """Return the impulse of contact c since the snapshot."""
    return minus(contact[c].p, memory[c].p)


@jit
def has_waited(c, level, state, memory):
    """Tell whether contact c, if it was seen, is as it was at the snapshot, without a collision."""
    if not level.low <= c <= level.high:
        return True
    return state.contact[c].hits == memory[c].hits and code(c, state) == memory[c].code


@jit
def alone(left, right, n, state):
    """Tell whether no run is active but those at contacts left..right.

    Each of infinitely many rounds lets all other runs go on, too.
    """
    run = state.run
    first = state.tally[0].first
    while first < n:
        if run[first].last < left or first > right:
            return False
        first = run[first].onward
    return True


@apart
def cluster_around(c, number, n, state):
    """Return the contacts of a possible cycle around contact c; empty (last < first) if none.

    Contacts left..right had an impulse since the snapshot; of these first..last collided anew and
    the others, steady neighbours, stayed active.  All must be active and driven as they were at the
    snapshot, and one that collided must lose energy.
    """
    level, contact, memory = state.level[number], state.contact, state.memory[number]
    left = c
    right = c
    while left > level.low and since(left - 1, contact, memory).real > 0.0:
        left -= 1
    while right < level.high and since(right + 1, contact, memory).real > 0.0:
        right += 1
    first = right + 1
    last = left - 1
    loses = False
    same = since(c, contact, memory).real > 0.0  # else c has collided without an impulse
    same = same and (left > level.low or left == 0) and (right < level.high or right == n - 2)
    for k in range(left, right + 1):
        same = same and memory[k].code == code(k, state)
        if contact[k].hits != memory[k].hits:
            first = min(first, k)
            last = k
            loses = loses or contact[k].e.real < 1.0
        else:
            same = same and contact[k].active == 1
    for k in range(first, last + 1):
        same = same and contact[k].hits != memory[k].hits
    # Whoever is active next to them has waited throughout, at a ratio of zero.
    same = same and has_waited(left - 1, level, state, memory)
    same = same and has_waited(right + 1, level, state, memory)
    for k in (left - 2, right + 2):
        if level.low <= k <= level.high and since(k, contact, memory).real > 0.0:
            same = False
    if same and loses and alone(left, right, n, state):
        return Cluster(left, first, last, right)
    return Cluster(c, c, c - 1, c)
