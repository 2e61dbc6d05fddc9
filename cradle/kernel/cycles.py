"""R9: the second sign of a collapse: impacts that repeat themselves in cycles.

The state at the end of a contact is that at its end a cycle before, scaled by L.  Then all cycles
to come are copies of the last one by L, L^2, ..., and their sum is a geometric series.  Cycles that
contain collapses are found in the same way, on a second level: collapses are counted, not ends.
"""

import math

from cradle.kernel.collapse import change_of, common_velocity, end_plastically, merge_exhausted
from cradle.kernel.events import reduced_mass
from cradle.kernel.numbers import minus, over, plus, scaled, times
from cradle.kernel.record import record
from cradle.kernel.state import COLLAPSE, LIMITS, LOWER, ONE, REPEAT, UPPER, ZERO, Cluster, apart


def forget(number, levels):
    """Drop the snapshot of a level, and begin to count anew: short impacts need none."""
    level = levels[number]
    level.mark = -1
    level.count = level.taken = 0
    level.due = 16 if number == LOWER else 4


def code(c, state):
    """Return one number for whether contact c is active, and who drives whom at its balls."""
    return 9 * state.contact[c].active + 3 * state.ball[c].turn + state.ball[c + 1].turn


@apart
def remember(number, c, n, state):
    """Take a snapshot of the contacts around c."""
    # It is kept for 1, 2, 1, 4, 1, 2, 1, 8, ... times the least distance: short cycles come first.
    level, contact, memory = state.level[number], state.contact, state.memory[number]
    level.mark = c
    level.taken += 1
    distance, k = 16 if number == LOWER else 4, level.taken
    while k == 2 * (k // 2):
        distance, k = 2 * distance, k // 2
    level.due = level.count + distance
    for j in range(max(c - LIMITS.window, 0), min(c + LIMITS.window, n - 2) + 1):
        k, then = contact[j], memory[j]
        then.u, then.q, then.p, then.a = k.u, k.q, k.p, k.a
        then.hits, then.code = k.hits, code(j, state)


def since(c, contact, memory):
    """Return the impulse of contact c since the snapshot."""
    return minus(contact[c].p, memory[c].p)


@apart
def cluster_around(c, number, n, state):
    """Return the contacts of a possible cycle around contact c; empty (last < first) if none."""
    # Contacts left..right had an impulse since the snapshot; of these first..last collided anew and
    # the others, steady neighbours, stayed active.  All are active and driven as they were then,
    # and one that collided loses energy.
    contact, run, memory = state.contact, state.run, state.memory[number]
    low, high = max(c - LIMITS.window, 0), min(c + LIMITS.window, n - 2)
    left = right = c
    while left > low and since(left - 1, contact, memory).real > 0.0:
        left -= 1
    while right < high and since(right + 1, contact, memory).real > 0.0:
        right += 1
    # Each of infinitely many rounds lets all other runs go on, too.
    begin, end = run[n - 1].onward, run[n - 1].back
    alone = begin == n - 1 or (run[begin].last >= left and end <= right)
    first, last, anew = right + 1, left - 1, 0
    loses = False
    same = since(c, contact, memory).real > 0.0  # else c has collided without an impulse
    same = same and (left > low or left == 0) and (right < high or right == n - 2)
    for k in range(left, right + 1):
        same = same and memory[k].code == code(k, state)
        if contact[k].hits != memory[k].hits:
            first = min(first, k)
            last = k
            anew += 1
            loses = loses or contact[k].e.real < 1.0
        else:
            same = same and contact[k].active == 1
    same = same and anew == last - first + 1
    for k in (left - 2, right + 2):
        if low <= k <= high and since(k, contact, memory).real > 0.0:
            same = False
    if same and loses and alone:
        return Cluster(left, first, last, right)
    return Cluster(c, c, c - 1, c)


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
    """Leave in x the impulses to the limit: the balls first..last + 1 come to one velocity."""
    # Returns T = L / (1 - L), all cycles to come over the last one; how far the state is from its
    # snapshot scaled by L, relative to its own size; and this size.  T is 0 if there is no limit,
    # and below -1 if the cycles come from there and grow, driven by steady neighbours.
    ball, contact, memory = state.ball, state.contact, state.memory[number]
    left, first, last, right = cluster.left, cluster.first, cluster.last, cluster.right
    left_part = kept_part(first - 1, first, first > left, contact, memory)
    right_part = kept_part(last + 1, last, last < right, contact, memory)
    if not common_velocity(first, last, left_part, right_part, ball, contact):
        return 0.0, math.inf, 0.0
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
    for c in range(left, right + 1):
        if c < first or c > last:
            edge, beside = (first, first - 1) if c < first else (last, last + 1)
            there = times(contact[edge].x, minus(ONE, left_part if c < first else right_part))
            there = over(there, since(beside, contact, memory))
            contact[c].x = times(since(c, contact, memory), there)
    return total, off, size


def stays_at_zero(c, contact, memory):
    """Tell whether contact c has been at u = 0 since the snapshot: its balls move as one."""
    k, then = contact[c], memory[c]
    idle = minus(k.a, then.a).real == 0.0
    return k.active == 1 and k.u.real == 0.0 and then.u.real == 0.0 and idle


@apart
def neighbours_stay(cluster, total, part, number, n, state):
    """Leave in y what neighbours of a cycle absorb; tell whether none comes to its own event."""
    # Impulse and closing speed of a neighbour go the same part of their ways, so its work is that
    # of the straight line between, but for what it was more in the last cycle, times the sum of
    # L^2, L^4, ...  A cycle that grows goes on while these are below the first closing's energy.
    ball, contact, memory = state.ball, state.contact, state.memory[number]
    left, right = cluster.left, cluster.right
    squares = part * (2.0 - part) * total * (total / (1.0 + 2.0 * total))
    share = complex(part, 0.0)
    for c in range(max(left - 1, 0), min(right + 1, n - 2) + 1):
        k, then = contact[c], memory[c]
        k.y = ZERO
        if cluster.first <= c <= cluster.last or stays_at_zero(c, contact, memory):
            continue
        speed = plus(k.u, times(change_of(c, left, right, ball, contact), share))
        closes = k.active == 0 and speed.real > 0.0  # from zero, too
        if closes or k.u.real * then.u.real < 0.0 or k.u.real * speed.real < 0.0:
            return False
        if c < left or c > right:
            continue
        impulse = since(c, contact, memory)
        if part < 0.0 and abs(then.u.real * impulse.real * squares) > state.tally[0].energy:
            return False
        straight = times(impulse, scaled(plus(then.u, k.u), 0.5))
        done = minus(k.a, then.a) if k.u.real > 0.0 else minus(k.q, then.q)
        way = times(times(k.x, share), scaled(plus(k.u, speed), 0.5))
        k.y = plus(way, times(minus(done, straight), complex(squares, 0.0)))
        if k.u.real < 0.0 and k.q.real + k.y.real <= 0.0:
            return False
    return True


@apart
def jump(cluster, part, number, n, state):
    """Go a part of the way to the limit: impulses by x, neighbours' works by y."""
    # (1 - e^2) of the works of the cycle itself is what disappears of motion and stores.
    ball, contact, memory = state.ball, state.contact, state.memory[number]
    left, first, last, right = cluster.left, cluster.first, cluster.last, cluster.right
    lost = loss = 0.0
    share = complex(part, 0.0)
    left_over = minus(ONE, share)
    rest = left_over.real
    for c in range(left, right + 1):
        contact[c].x = times(contact[c].x, share)
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
        contact[c].a = plus(contact[c].a, times(more, complex(squares, 0.0)))


@apart
def go_on(c, cluster, total, n, state):
    """Repeat the cycle that contact c ends 2, 4, 8 ... times, before a neighbour has its event."""
    # After k cycles the balls have gone the part 1 - L^k of the way to the limit, L = T / (1 + T):
    # half of it at most, as a neighbour's event may be at the limit itself.
    contact, run, memory = state.contact, state.run, state.memory[LOWER]
    cycles, part = 1, 1.0 / (1.0 + total)
    while True:
        further = part * (2.0 - part)
        if further > 0.5 or not neighbours_stay(cluster, total, further, LOWER, n, state):
            break
        cycles, part = 2 * cycles, further
    if cycles < LIMITS.many:
        return
    neighbours_stay(cluster, total, part, LOWER, n, state)
    jump(cluster, part, LOWER, n, state)
    for k in range(cluster.first, cluster.last + 1):
        contact[k].hits += cycles * (contact[k].hits - memory[k].hits)
    first = run[n - 1].onward
    while first < n - 1:
        run[first].stirred = 1
        first = run[first].onward
    forget(LOWER, state.level)  # look for another one from here
    record(REPEAT, c, n, state)


def is_in_doubt(cluster, bent, state):
    """Tell whether a bent cycle's limit is open: with steady neighbours it depends on the bend."""
    if cluster.left == cluster.first and cluster.last == cluster.right:
        return False
    farthest = 0.0
    for i in range(cluster.left, cluster.right + 2):
        before = state.contact[i - 1].x.real if i > cluster.left else 0.0
        after = state.contact[i].x.real if i <= cluster.right else 0.0
        farthest = max(farthest, abs(before - after) * state.ball[i].inverse.real)
    return bent * farthest > LIMITS.doubt * state.tally[0].fastest


@apart
def cycle(number, c, n, state):
    """If the neighbourhood of contact c repeats itself on another scale, go to the limit."""
    # Light balls need many cycles to settle on one factor.  It is enough that the bend, how far the
    # state will turn by the time that it is exhausted, is below its limit; and that it leaves
    # nothing in doubt.  Where there is no limit, or a neighbour comes to its event before it, the
    # cycle is repeated as often as it surely repeats itself.
    # Returns (first, last) of the contacts that have collapsed, empty if none have.
    cluster = cluster_around(c, number, n, state)
    if cluster.last < cluster.first:
        return c, c - 1
    total, off, size = limit(cluster, number, state)
    if total == 0.0:
        return c, c - 1
    bent = 0.0
    if off > LIMITS.self_similar:
        # How often the scale still shrinks by L: log(1 / L) is about 1 / (T + 1/2).
        threshold = max(LIMITS.exhausted * state.tally[0].fastest, 5e-324)
        bent = off * max(math.log(size / threshold), 1.0) * (total + 0.5)
        if not 0.0 < bent < LIMITS.bend:  # a cycle that grows, T below -1, does so by one factor
            return c, c - 1
    if total > 0.0:
        if is_in_doubt(cluster, bent, state):
            return c, c - 1
        if neighbours_stay(cluster, total, 1.0, number, n, state):
            jump(cluster, 1.0, number, n, state)
            end_plastically(cluster.first, cluster.last, n, state)
            return cluster.first, cluster.last
    if number == LOWER and bent == 0.0:
        go_on(c, cluster, total, n, state)
    return c, c - 1


def look(number, c, n, state):
    """See whether contact c has come round; take a new snapshot if the last one is old."""
    level, first, last = state.level[number], c, c - 1
    if level.mark == c:
        first, last = cycle(number, c, n, state)
    if last < first and level.count >= level.due:
        remember(number, c, n, state)
    return first, last


@apart
def take_limits(n, state):
    """R9, after contacts have ended: tell whether some have collapsed; if so, in cycles, too."""
    level, tally = state.level, state.tally[0]
    level[LOWER].count += tally.ends
    first, last = tally.ended, tally.ended - 1
    if tally.worn >= 0:
        first, last = merge_exhausted(tally.worn, n, state)
    if last < first:
        first, last = look(LOWER, tally.ended, n, state)
    if last < first:
        return False
    forget(LOWER, level)
    level[UPPER].count += 1
    one, other = look(UPPER, first, n, state)
    if one <= other:
        forget(UPPER, level)
        first, last = one, other
    for c in range(first, last + 1):
        record(COLLAPSE, c, n, state)
    tally.collapsed = 1
    return True
