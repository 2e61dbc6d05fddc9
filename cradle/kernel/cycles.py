"""R9: the second sign of a collapse: impacts that repeat themselves in cycles.

The state at the end of a contact is that at its end a cycle before on a smaller scale.  Then all
cycles to come are smaller copies of the last one, by the factor L, L^2, ..., and their sum is a
geometric series.  Cycles that contain collapses are found in the same way, on a second level: there
collapses are counted, not ends.
"""

import math

from cradle.kernel.collapse import (
    change_of,
    common_velocity,
    end_plastically,
    exhausted_stretch,
    merge,
)
from cradle.kernel.events import reduced_mass
from cradle.kernel.numbers import ONE, ZERO, minus, over, plus, scaled, times
from cradle.kernel.record import record
from cradle.kernel.snapshot import cluster_around, forget, remember, since
from cradle.kernel.state import (
    COLLAPSE,
    LIMITS,
    LOWER,
    REPETITION,
    UPPER,
    apart,
    jit,
)


@jit
def kept_part(neighbour, edge, exists, contact, memory):
    """Return 1 - h for a steady neighbour with h times the impulse of the outermost contact."""
    if not exists:
        return ONE
    one = since(edge, contact, memory)
    kept = over(minus(one, since(neighbour, contact, memory)), one)
    if abs(kept.real) < LIMITS.kept:
        return complex(LIMITS.kept, 0.0)  # nothing is kept: nearly infinite mass
    return kept


@apart
def limit(cluster, number, state):
    """Leave in x the impulses to the limit: the balls first..last + 1 come to one velocity.

    Returns T, the sum of all cycles to come over the last one, T = L / (1 - L); how far the state
    is from its snapshot scaled by L, relative to its own size; and this size.  T is 0 if there is
    no limit, and below -1 if the cycles come from there and grow, driven by steady neighbours.
    """
    ball, contact, memory = state.ball, state.contact, state.memory[number]
    left, first, last, right = cluster.left, cluster.first, cluster.last, cluster.right
    left_part = kept_part(first - 1, first, first > left, contact, memory)
    right_part = kept_part(last + 1, last, last < right, contact, memory)
    common_velocity(first, last, left_part, right_part, ball, contact)
    to_come = done = ZERO
    size = 0.0
    for c in range(first, last + 1):
        to_come = plus(to_come, contact[c].x)
        done = plus(done, since(c, contact, memory))
        speed = math.sqrt(2.0 * contact[c].q.real / reduced_mass(c, ball))
        size = max(size, abs(contact[c].u.real), speed)
    total = over(to_come, done).real
    if size == 0.0 or not math.inf > abs(total) > 0.0 or -1.0 <= total <= 0.0:
        return 0.0, math.inf, 0.0
    factor = total / (1.0 + total)
    off = 0.0
    for c in range(first, last + 1):
        off = max(off, abs(contact[c].u.real - factor * memory[c].u.real) / size)
        stored = contact[c].q.real - factor * factor * memory[c].q.real
        off = max(off, abs(stored) / reduced_mass(c, ball) / size / size)
    # The steady neighbours' impulses go with those of the contacts beside them.
    if left < first:
        one = times(contact[first].x, minus(ONE, left_part))
        one = over(one, since(first - 1, contact, memory))
        for c in range(left, first):
            contact[c].x = times(since(c, contact, memory), one)
    if last < right:
        other = times(contact[last].x, minus(ONE, right_part))
        other = over(other, since(last + 1, contact, memory))
        for c in range(last + 1, right + 1):
            contact[c].x = times(since(c, contact, memory), other)
    return total, off, size


@jit
def stays_at_zero(c, contact, memory):
    """Tell whether contact c has been at u = 0 since the snapshot: its balls move as one."""
    k, then = contact[c], memory[c]
    idle = k.a.real == then.a.real and k.a.imag == then.a.imag
    return k.active == 1 and k.u.real == 0.0 and then.u.real == 0.0 and idle


@jit
def sum_of_squares(total, part):
    """Return the sum of L^2, L^4, ... on this part of the way to the limit."""
    return part * (2.0 - part) * total * (total / (1.0 + 2.0 * total))


@apart
def neighbours_stay(cluster, total, part, number, n, state):
    """Work out what the neighbours of a cycle absorb; tell whether none comes to its own event.

    Their works on this part of the way are left in y.  Impulse and closing speed of a neighbour go
    the same part of their ways, so its work is that of the straight line between, but for what it
    was more in the last cycle, times the sum of L^2, L^4, ...  A cycle that grows goes on only
    while its neighbours' works stay below the energy of the first closing.
    """
    ball, contact, memory = state.ball, state.contact, state.memory[number]
    left, right = cluster.left, cluster.right
    squares = sum_of_squares(total, part)
    for c in range(max(left - 1, 0), min(right + 1, n - 2) + 1):
        if cluster.first <= c <= cluster.last:
            continue
        k, then = contact[c], memory[c]
        k.y = ZERO
        if stays_at_zero(c, contact, memory):
            continue
        change = scaled_by(change_of(c, left, right, ball, contact), part)
        speed = plus(k.u, change)
        if k.u.real * then.u.real < 0.0 or k.u.real * speed.real < 0.0:
            return False
        if (k.u.real == 0.0) != (speed.real == 0.0):
            return False
        if c < left or c > right:
            continue
        impulse = since(c, contact, memory)
        if part < 0.0 and abs(then.u.real * impulse.real * squares) > state.tally[0].energy:
            return False
        straight = times(impulse, scaled(plus(then.u, k.u), 0.5))
        done = minus(k.a, then.a) if k.u.real > 0.0 else minus(k.q, then.q)
        way = times(scaled_by(k.x, part), scaled(plus(k.u, speed), 0.5))
        k.y = plus(way, scaled_by(minus(done, straight), squares))
        if k.active == 1 and k.u.real < 0.0 and k.q.real + k.y.real <= 0.0:
            return False
    return True


@jit
def scaled_by(a, x):
    """Return a x for any float x."""
    return times(a, complex(x, 0.0))


@apart
def jump(cluster, part, number, n, state):
    """Go a part of the way to the limit: impulses by x, neighbours' works by y.

    The works of the cycle itself are known from what disappears of motion and stores: (1 - e^2) of
    them.
    """
    ball, contact, memory = state.ball, state.contact, state.memory[number]
    left, first, last, right = cluster.left, cluster.first, cluster.last, cluster.right
    lost = loss = 0.0
    left_over = minus(ONE, complex(part, 0.0))
    rest = left_over.real
    for c in range(left, right + 1):
        contact[c].x = scaled_by(contact[c].x, part)
    for c in range(max(left - 1, 0), min(right + 1, n - 2) + 1):
        k = contact[c]
        before = k.u.real
        if first <= c <= last:
            lost += k.q.real * part * (1.0 + rest)
            loss += (1.0 - k.square.real) * minus(k.a, memory[c].a).real
            k.u, k.q = times(k.u, left_over), times(k.q, times(left_over, left_over))
            k.w *= rest * rest
            k.made *= abs(rest)
        elif not stays_at_zero(c, contact, memory):
            k.u = plus(k.u, change_of(c, left, right, ball, contact))
            lost -= k.y.real
            if k.active == 1 and k.u.real > 0.0:
                k.a = plus(k.a, k.y)
                k.w += k.y.real
                k.q = plus(k.q, times(k.square, k.y))
            elif k.active == 1:
                k.q = plus(k.q, k.y)
        if left <= c <= right:
            lost += 0.5 * k.x.real * (before + k.u.real)
            k.p = plus(k.p, k.x)
    squares = max(lost / loss, 0.0) if loss > 0.0 else 0.0
    for c in range(first, last + 1):
        more = minus(contact[c].a, memory[c].a)
        contact[c].a = plus(contact[c].a, scaled_by(more, squares))


@apart
def go_on(cluster, total, n, state):
    """Repeat a cycle 2, 4, 8 ... times, before a neighbour comes to its event; tell if it did.

    After k cycles everything is L^k of what it was, L = T / (1 + T), and the balls have gone the
    part 1 - L^k of the way to the limit: half of it at most, as a neighbour's event may be at the
    limit itself.
    """
    contact, memory = state.contact, state.memory[LOWER]
    cycles, part = 1, 1.0 / (1.0 + total)
    while True:
        further = part * (2.0 - part)
        if further > 0.5 or not neighbours_stay(cluster, total, further, LOWER, n, state):
            break
        cycles, part = 2 * cycles, further
    if cycles < LIMITS.many:
        return False
    neighbours_stay(cluster, total, part, LOWER, n, state)
    jump(cluster, part, LOWER, n, state)
    for c in range(cluster.first, cluster.last + 1):
        contact[c].hits += cycles * (contact[c].hits - memory[c].hits)
    return True


@apart
def repeated(c, n, state):
    """Note that the cycle that contact c ends has been repeated; look for another one from here."""
    run = state.run
    first = state.tally[0].first
    while first < n:
        run[first].stirred = 1
        first = run[first].onward
    forget(LOWER, state.level)
    record(REPETITION, c, n, state)


@apart
def cycle(number, c, n, state):
    """If the neighbourhood of contact c repeats itself on another scale, go to the limit.

    Light balls need many cycles to settle on one factor.  It is enough that what still changes
    will not matter: the bend, how far the state turns by the time that it is exhausted, is below
    its limit at the pace since the snapshot.  Without steady neighbours the limit does not depend
    on the bend.  With them it does: then what it leaves open must be too small to matter.

    Where there is no limit, or a neighbour comes to its event before it, the cycle is repeated as
    often as it surely repeats itself.

    Returns (first, last) of the contacts that have collapsed, empty if none have.
    """
    cluster = cluster_around(c, number, n, state)
    if cluster.last < cluster.first:
        return c, c - 1
    total, off, size = limit(cluster, number, state)
    if total == 0.0:
        return c, c - 1
    bent = 0.0
    if off > LIMITS.self_similar:
        if total < 0.0:
            return c, c - 1  # a cycle that grows does so by one factor
        # How often the scale still shrinks by L before nothing is left; log(1 / L) is above
        # 1 / (T + 1/2), and as good as that for a slow cycle.
        threshold = max(LIMITS.exhausted * state.tally[0].fastest, 5e-324)
        bent = off * max(math.log(size / threshold), 1.0) * (total + 0.5)
        if not bent < LIMITS.bend:
            return c, c - 1
    if total > 0.0:
        if is_in_doubt(cluster, bent, state):
            return c, c - 1
        if neighbours_stay(cluster, total, 1.0, number, n, state):
            jump(cluster, 1.0, number, n, state)
            end_plastically(cluster.first, cluster.last, n, state)
            return cluster.first, cluster.last
    if number == LOWER and bent == 0.0 and go_on(cluster, total, n, state):
        repeated(c, n, state)
    return c, c - 1


@jit
def is_in_doubt(cluster, bent, state):
    """Tell whether steady neighbours leave open where a bent cycle's limit is."""
    if cluster.left == cluster.first and cluster.last == cluster.right:
        return False
    farthest = 0.0
    for i in range(cluster.left, cluster.right + 2):
        before = state.contact[i - 1].x.real if i > cluster.left else 0.0
        after = state.contact[i].x.real if i <= cluster.right else 0.0
        farthest = max(farthest, abs(before - after) * state.ball[i].inverse.real)
    return bent * farthest > LIMITS.doubt * state.tally[0].fastest


@jit
def look(number, c, n, state):
    """See whether contact c has come round; take a new snapshot if the last one is old."""
    level = state.level[number]
    if level.mark == c:
        first, last = cycle(number, c, n, state)
        if first <= last:
            return first, last
    if level.count >= level.due:
        remember(number, c, n, state)
    return c, c - 1


@apart
def look_above(first, last, n, state):
    """Contacts first..last have collapsed; see whether such collapses come round too."""
    level = state.level
    forget(LOWER, level)
    level[UPPER].count += 1
    one, other = look(UPPER, first, n, state)
    if one <= other:
        forget(UPPER, level)
        first, last = one, other
    for c in range(first, last + 1):
        record(COLLAPSE, c, n, state)
    state.tally[0].collapsed = 1


@jit
def take_limits(n, state):
    """R9, after contacts have ended; tell whether some have collapsed."""
    tally = state.tally[0]
    state.level[LOWER].count += tally.ends
    first, last = tally.ended, tally.ended - 1
    if tally.worn >= 0:
        first, last = exhausted_stretch(tally.worn, n, state)
        if first <= last:
            first, last = merge(first, last, n, state)
    if last < first:
        first, last = look(LOWER, tally.ended, n, state)
    if last < first:
        return False
    look_above(first, last, n, state)
    return True
