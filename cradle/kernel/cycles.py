"""R9: the second sign of a collapse: impacts that repeat themselves in cycles.

The state around a contact that ends, or collapses, is that at its end a cycle before on a smaller
scale.  Then all cycles to come are smaller copies of the last one, by the factor L, L^2, ..., and
their sum is a geometric series.  A cycle may contain collapses of other contacts.
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
from cradle.kernel.state import COLLAPSE, LIMITS, REPETITION, Cluster, apart, jit


@jit
def code(c, state):
    """Return one number for whether contact c is active, and who drives whom at its balls."""
    return 9 * state.contact[c].active + 3 * state.ball[c].turn + state.ball[c + 1].turn


@jit
def forget(tally):
    """Drop the snapshot and begin to count anew: short impacts need none."""
    tally.mark, tally.count, tally.taken, tally.due = -1, 0, 0, LIMITS.hold


@apart
def remember(c, n, state):
    """Take a snapshot of the contacts around c.

    It is kept for 1, 1, 2, 1, 1, 2, 4, 1, ... times the least number of ends, so that a short cycle
    is found soon and a long one, too.
    """
    tally = state.tally[0]
    tally.mark = c
    tally.taken += 1
    hold, k = LIMITS.hold, tally.taken
    while k == 2 * (k // 2):
        hold, k = 2 * hold, k // 2
    tally.due = tally.count + hold
    tally.low, tally.high = max(c - LIMITS.window, 0), min(c + LIMITS.window, n - 2)
    for j in range(tally.low, tally.high + 1):
        k = state.contact[j]
        k.then_u, k.then_q, k.then_p, k.then_a = k.u, k.q, k.p, k.a
        k.then_hits, k.then_code = k.hits, code(j, state)


@jit
def since(k):
    """Return the impulse of a contact since the snapshot."""
    return minus(k.p, k.then_p)


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
def cluster_around(c, n, state):
    """Return the contacts of a possible cycle around contact c; empty (last < first) if none.

    Contacts left..right had an impulse since the snapshot; of these first..last collided anew and
    the others, steady neighbours, stayed active.  All must be active and driven as they were at the
    snapshot, and one that collided must lose energy.
    """
    contact, low, high = state.contact, state.tally[0].low, state.tally[0].high
    left = right = c
    while left > low and since(contact[left - 1]).real > 0.0:
        left -= 1
    while right < high and since(contact[right + 1]).real > 0.0:
        right += 1
    first, last, loses = right + 1, left - 1, False
    same = since(contact[c]).real > 0.0  # else c has collided without an impulse
    same = same and (left > low or left == 0) and (right < high or right == n - 2)
    for k in range(left, right + 1):
        same = same and contact[k].then_code == code(k, state)
        if contact[k].hits != contact[k].then_hits:
            first = min(first, k)
            last = k
            loses = loses or contact[k].e.real < 1.0
        else:
            same = same and contact[k].active == 1
    for k in range(first, last + 1):
        same = same and contact[k].hits != contact[k].then_hits
    for k in (left - 2, right + 2):
        same = same and not (low <= k <= high and since(contact[k]).real > 0.0)
    if same and loses and alone(left, right, n, state):
        return Cluster(left, first, last, right)
    return Cluster(c, c, c - 1, c)


@jit
def kept_part(neighbour, edge, exists, contact):
    """Return 1 - h for a steady neighbour with h times the impulse of the outermost contact."""
    if not exists:
        return ONE
    one = since(contact[edge])
    kept = over(minus(one, since(contact[neighbour])), one)
    if abs(kept.real) < LIMITS.kept:
        return complex(LIMITS.kept, 0.0)  # nothing is kept: nearly infinite mass
    return kept


@apart
def limit(cluster, state):
    """Leave in x the impulses to the limit: the balls first..last + 1 come to one velocity.

    Returns T, the sum of all cycles to come over the last one, T = L / (1 - L); how far the state
    is from its snapshot scaled by L, relative to its own size; and this size.  T is 0 if there is
    no limit, and below -1 if the cycles come from there and grow, driven by steady neighbours.
    """
    ball, contact = state.ball, state.contact
    left, first, last, right = cluster.left, cluster.first, cluster.last, cluster.right
    left_part = kept_part(first - 1, first, first > left, contact)
    right_part = kept_part(last + 1, last, last < right, contact)
    common_velocity(first, last, left_part, right_part, ball, contact)
    to_come = done = ZERO
    size = 0.0
    for c in range(first, last + 1):
        k = contact[c]
        to_come, done = plus(to_come, k.x), plus(done, since(k))
        size = max(size, abs(k.u.real), math.sqrt(2.0 * k.q.real / reduced_mass(c, ball)))
    total = over(to_come, done).real
    if size == 0.0 or not math.inf > abs(total) > 0.0 or -1.0 <= total <= 0.0:
        return 0.0, math.inf, 0.0
    factor = total / (1.0 + total)
    off = 0.0
    for c in range(first, last + 1):
        k = contact[c]
        stored = abs(k.q.real - factor * factor * k.then_q.real)
        off = max(off, abs(k.u.real - factor * k.then_u.real) / size)
        off = max(off, stored / reduced_mass(c, ball) / size / size)
    # The steady neighbours' impulses go with those of the contacts beside them.
    for c in range(left, right + 1):
        if not first <= c <= last:
            edge = contact[first if c < first else last]
            contact[c].x = times(since(contact[c]), over(edge.x, since(edge)))
    return total, off, size


@jit
def stays_at_zero(k):
    """Tell whether a contact has been at u = 0 since the snapshot: its balls move as one."""
    idle = k.a.real == k.then_a.real and k.a.imag == k.then_a.imag
    return k.active == 1 and k.u.real == 0.0 and k.then_u.real == 0.0 and idle


@jit
def scaled_by(a, x):
    """Return a x for any float x."""
    return times(a, complex(x, 0.0))


@apart
def neighbours_stay(cluster, total, part, n, state):
    """Work out what the neighbours of a cycle absorb; tell whether none comes to its own event.

    Their works on this part of the way are left in y.  Impulse and closing speed of a neighbour go
    the same part of their ways, so its work is that of the straight line between, but for what it
    was more in the last cycle, times the sum of L^2, L^4, ...
    """
    ball, contact, left, right = state.ball, state.contact, cluster.left, cluster.right
    squares = part * (2.0 - part) * total * (total / (1.0 + 2.0 * total))
    for c in range(max(left - 1, 0), min(right + 1, n - 2) + 1):
        k = contact[c]
        if cluster.first <= c <= cluster.last or stays_at_zero(k):
            continue
        speed = plus(k.u, scaled_by(change_of(c, left, right, ball, contact), part))
        if k.u.real * k.then_u.real < 0.0 or k.u.real * speed.real < 0.0:
            return False
        k.y = ZERO
        if left <= c <= right:
            straight = times(since(k), scaled(plus(k.then_u, k.u), 0.5))
            done = minus(k.a, k.then_a) if k.u.real > 0.0 else minus(k.q, k.then_q)
            way = times(scaled_by(k.x, part), scaled(plus(k.u, speed), 0.5))
            k.y = plus(way, scaled_by(minus(done, straight), squares))
            if k.active == 1 and k.u.real < 0.0 and k.q.real + k.y.real <= 0.0:
                return False
    return True


@apart
def jump(cluster, part, n, state):
    """Go a part of the way to the limit: impulses by x, neighbours' works by y.

    The works of the cycle itself are known from what disappears of motion and stores: (1 - e^2) of
    them.
    """
    ball, contact = state.ball, state.contact
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
            loss += (1.0 - k.square.real) * minus(k.a, k.then_a).real
            k.u, k.q = times(k.u, left_over), times(k.q, times(left_over, left_over))
            k.w *= rest * rest
            k.made *= abs(rest)
        elif not stays_at_zero(k):
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
        k = contact[c]
        k.a = plus(k.a, scaled_by(minus(k.a, k.then_a), squares))


@apart
def go_on(c, cluster, total, n, state):
    """Repeat a cycle that ends with contact c 2, 4, 8 ... times, before a neighbour's event.

    After k cycles everything is L^k of what it was, L = T / (1 + T), and the balls have gone the
    part 1 - L^k of the way to the limit: half of it at most, as a neighbour's event may be at the
    limit itself.
    """
    run, contact, tally = state.run, state.contact, state.tally[0]
    cycles, part = 1, 1.0 / (1.0 + total)
    while True:
        further = part * (2.0 - part)
        if further > 0.5 or not neighbours_stay(cluster, total, further, n, state):
            break
        cycles, part = 2 * cycles, further
    if cycles < LIMITS.many:
        return
    neighbours_stay(cluster, total, part, n, state)
    jump(cluster, part, n, state)
    for k in range(cluster.first, cluster.last + 1):
        contact[k].hits += cycles * (contact[k].hits - contact[k].then_hits)
    first = tally.first
    while first < n:
        run[first].stirred = 1
        first = run[first].onward
    forget(tally)
    record(REPETITION, c, n, state)


@apart
def cycle(c, n, state):
    """If the neighbourhood of contact c repeats itself on another scale, go to the limit.

    Light balls need many cycles to settle on one factor.  It is enough that what still changes
    will not matter: the bend, how far the state turns by the time that it is exhausted, is below
    its limit at the pace since the snapshot.  That does not move the limit itself, but beside
    steady neighbours, where it would.

    Where there is no limit, or a neighbour comes to its event before it, the cycle is repeated as
    often as it surely repeats itself.

    Returns (first, last) of the contacts that have collapsed, empty if none have.
    """
    cluster = cluster_around(c, n, state)
    if cluster.last < cluster.first:
        return c, c - 1
    total, off, size = limit(cluster, state)
    if total == 0.0:
        return c, c - 1
    if off > LIMITS.self_similar:
        # How often the scale still shrinks by L before nothing is left; log(1 / L) is above
        # 1 / (T + 1/2), and as good as that for a slow cycle.
        threshold = max(LIMITS.exhausted * state.tally[0].fastest, 5e-324)
        bent = off * max(math.log(size / threshold), 1.0) * (total + 0.5)
        steady = cluster.left < cluster.first or cluster.last < cluster.right
        if steady or not bent < LIMITS.bend:
            return c, c - 1
    if total > 0.0 and neighbours_stay(cluster, total, 1.0, n, state):
        jump(cluster, 1.0, n, state)
        end_plastically(cluster.first, cluster.last, n, state)
        return cluster.first, cluster.last
    if off <= LIMITS.self_similar:
        go_on(c, cluster, total, n, state)
    return c, c - 1


@jit
def look(c, n, state):
    """See whether contact c has come round; take a new snapshot if the last one is old."""
    tally = state.tally[0]
    first, last = c, c - 1
    if tally.mark == c:
        first, last = cycle(c, n, state)
    if last < first and tally.count >= tally.due:
        remember(c, n, state)
    return first, last


@jit
def take_limits(n, state):
    """R9, after contacts have ended; tell whether some have collapsed."""
    tally = state.tally[0]
    tally.count += tally.ends
    first, last = tally.ended, tally.ended - 1
    if tally.worn >= 0:
        first, last = exhausted_stretch(tally.worn, n, state)
        if first <= last:
            first, last = merge(first, last, n, state)
    if last < first:
        first, last = look(tally.ended, n, state)
    if last < first:
        return False
    one, other = look(first, n, state)
    if one <= other:
        first, last = one, other
    for c in range(first, last + 1):
        record(COLLAPSE, c, n, state)
    tally.collapsed = 1
    return True
