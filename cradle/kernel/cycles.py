"""R9, the second sign of an infinite sequence: impacts repeat in ever smaller cycles.

The state at the end of one contact is that at its end a cycle before, smaller.  Then all further
cycles are smaller copies, and their sum is a geometric series.  Cycles that contain collapses are
found in the same way, on a second level: there collapses are counted, not ends.
"""

import math

from cradle.kernel.collapse import end_plastically, exhausted_stretch, merge
from cradle.kernel.motion import (
    add_impulse,
    add_velocity,
    add_work,
    closing,
    heaviest_of,
    join_velocities,
    one_velocity,
    reduced_mass,
    relative_energy,
    share_out,
)
from cradle.kernel.record import record
from cradle.kernel.state import COLLAPSE, END, LIMITS, LOWER, UPPER, Cluster, apart, jit, once


@jit
def settle(n, memory):
    """Hand impulses and works since the last snapshot to the upper level, and begin anew."""
    for c in range(n - 1):
        memory[1][c].p += memory[0][c].p
        memory[1][c].a += memory[0][c].a
        memory[0][c].p = memory[0][c].a = 0.0


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
        memory[c].u = contact[c].u
        memory[c].q = contact[c].q
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
    snapshot.
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
    same = True
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


@jit
def kept_part(neighbour, edge, exists, memory):
    """Return 1 - h for a steady neighbour whose impulse is h times that of the outermost contact.

    The ball between them acts as one of mass m / (1 - h), whatever its sign.
    """
    if not exists:
        return 1.0
    kept = 1.0 - memory[neighbour].p / memory[edge].p
    return kept if kept != 0.0 else LIMITS.digits


@apart
def limit(cluster, level, state):
    """Work out the limit: one velocity of the balls first..last + 1.

    Returns T, the sum of all cycles to come over the last one; how far the state is from its
    snapshot scaled by T / (1 + T), relative to its own size; this size; and the doubt about the
    common velocity that the digits of the neighbours' shares leave.  T is 0 if there is no limit.

    T comes from the limit itself: the impulses that bring all balls to one velocity, over those of
    the last cycle.  With L the factor from cycle to cycle T = L / (1 - L), but 1 - L itself would
    lose all digits for a very light ball.
    """
    ball, contact, memory = state.ball, state.contact, state.memory[level]
    left, first, last, right = cluster.left, cluster.first, cluster.last, cluster.right
    none = 0.0, math.inf, 0.0, 0.0
    kept_left = kept_part(first - 1, first, first > left, memory)
    kept_right = kept_part(last + 1, last, last < right, memory)
    size = 0.0
    mass = 0.0
    momentum = 0.0
    ball[first].x = 0.0
    for i in range(first, last + 2):
        b = ball[i]
        b.y = b.m
        if i == first:
            b.y /= kept_left
        if i == last + 1:
            b.y /= kept_right
        mass += b.y
        momentum += b.y * b.x
        if i <= last:
            ball[i + 1].x = b.x - contact[i].u
            speed = math.sqrt(2.0 * contact[i].q / reduced_mass(i, ball))
            size = max(size, abs(contact[i].u), speed)
    if mass == 0.0 or size == 0.0:
        return none
    common = momentum / mass
    impulse = 0.0
    to_come = 0.0
    done = 0.0
    for c in range(first, last + 1):
        impulse += ball[c].y * (ball[c].x - common)
        to_come += impulse
        done += memory[c].p
        contact[c].x = impulse
    if to_come <= 0.0:
        return none
    total = to_come / done
    factor = total / (1.0 + total)
    off = 0.0
    for c in range(first, last + 1):
        off = max(off, abs(contact[c].u - factor * memory[c].u) / size)
        stored = contact[c].q - factor * factor * memory[c].q
        off = max(off, abs(stored) / reduced_mass(c, ball) / size / size)
        if abs(contact[c].x - total * memory[c].p) > 0.01 * total * memory[c].p:
            return none
    doubt = 0.0
    if first > left:
        doubt += abs(contact[first].x / kept_left / mass)
    if last < right:
        doubt += abs(contact[last].x / kept_right / mass)
    return total, off, size, LIMITS.digits * doubt


@apart
def velocity_changes(cluster, total, level, state):
    """Leave in x where the velocities of the balls go; return the largest change.

    Steady neighbours' balls go by the impulses of all cycles, the others to a common velocity that
    leaves the momentum alone.
    """
    ball, memory = state.ball, state.memory[level]
    left, first, last, right = cluster.left, cluster.first, cluster.last, cluster.right
    k = heaviest_of(first, last + 1, ball)
    mass = 0.0
    momentum = 0.0
    farthest = 0.0
    for i in range(left, right + 2):
        b = ball[i]
        if first <= i <= last + 1:
            mass += b.m
            momentum += b.m * ((b.hi - ball[k].hi) + (b.lo - ball[k].lo))
        else:
            before = memory[i - 1].p if i > left else 0.0
            b.x = (before - (memory[i].p if i <= right else 0.0)) * total / b.m
            momentum -= b.m * b.x
            farthest = max(farthest, abs(b.x))
    for i in range(first, last + 2):
        b = ball[i]
        b.x = momentum / mass - ((b.hi - ball[k].hi) + (b.lo - ball[k].lo))
        farthest = max(farthest, abs(b.x))
    return farthest


@apart
def neighbours_stay(cluster, total, farthest, level, n, state):
    """Work out what the neighbours of a cycle absorb; tell whether none comes to its own event.

    Their works of all cycles are left in y; closing speeds are linear in the impulse so far, with
    the sum of L^2, L^4, ... as `squares`.
    """
    ball, contact, memory = state.ball, state.contact, state.memory[level]
    left, right = cluster.left, cluster.right
    squares = total * total / (1.0 + 2.0 * total)
    for c in range(max(left - 1, 0), min(right + 1, n - 2) + 1):
        if cluster.first <= c <= cluster.last:
            continue
        k, then = contact[c], memory[c]
        change = (ball[c].x if c >= left else 0.0) - (ball[c + 1].x if c <= right else 0.0)
        speed = k.u + change
        k.y = 0.0
        if k.active == 1 and k.u == 0.0 and then.u == 0.0 and abs(change) < LIMITS.tie * farthest:
            continue  # held throughout; the change is rounding
        if k.u * then.u < 0.0 or k.u * speed < 0.0 or (k.u == 0.0) != (speed == 0.0):
            return False
        work = then.a if k.u > 0.0 else k.q - then.q
        k.y = then.p * (total * k.u + change * squares) + (work - then.u * then.p) * squares
        if k.active == 1 and k.u < 0.0 and k.q + k.y <= 0.0:
            return False
    return True


@once
def exact_squares(cluster, total, energy, state, memory, low, high):
    """Return the sum of L^2, L^4, ...: what disappears is (1 - e^2) of what is absorbed.

    `energy` is what the balls have lost.
    """
    contact = state.contact
    loss = 0.0
    for c in range(low, high + 1):
        k = contact[c]
        if cluster.first <= c <= cluster.last:
            energy += k.q
            loss += (1.0 - k.e * k.e) * memory[c].a
        else:
            energy -= k.y
    if loss > 0.0:
        return max(energy / loss, 0.0)
    return total * total / (1.0 + 2.0 * total)


@once
def hold_together(cluster, low, high, ball, contact):
    """Bring balls of neighbours that are held at u = 0 to one velocity again, after a jump."""
    c = low
    while c <= high:
        end = c
        while end <= high and (
            cluster.first <= end <= cluster.last
            or (contact[end].active == 1 and contact[end].u == 0.0)
        ):
            end += 1
        if c < end and (c < cluster.first or end - 1 > cluster.last):
            join_velocities(c, end, ball, contact)
            for k in (c - 1, end):
                if low <= k <= high:
                    contact[k].u = closing(k, ball)
        c = end + 1


@apart
def jump(cluster, total, level, n, state):
    """Go to the limit: velocities by the balls' x, steady neighbours' works by the contacts' y."""
    ball, contact, memory = state.ball, state.contact, state.memory[level]
    left, first, last, right = cluster.left, cluster.first, cluster.last, cluster.right
    low = max(left - 1, 0)
    high = min(right + 1, n - 2)
    energy = relative_energy(left, right + 1, ball)
    for i in range(left, right + 2):
        add_velocity(ball[i], ball[i].x)
    one_velocity(first, last + 1, heaviest_of(first, last + 1, ball), ball)
    energy -= relative_energy(left, right + 1, ball)
    squares = exact_squares(cluster, total, energy, state, memory, low, high)
    before = memory[first - 1].p * total if first > left else 0.0
    after = memory[last + 1].p * total if last < right else 0.0
    share_out(first, last, before, after, ball, contact)
    for c in range(low, high + 1):
        k = contact[c]
        work = 0.0
        if first <= c <= last:
            share = k.x
            work = memory[c].a * squares
            k.u = k.blur = 0.0
        else:
            share = memory[c].p * total
            if not (k.active == 1 and k.u == 0.0):  # else held throughout, see below
                k.u = closing(c, ball)
                if k.active == 1 and k.u > 0.0:
                    work = k.y
                    k.w += work
                    k.q += k.e * k.e * work
                elif k.active == 1:
                    k.q += k.y
        add_impulse(k, share)
        add_work(k, work)
        if level == 0:
            memory[c].p += share
            memory[c].a += work
    hold_together(cluster, low, high, ball, contact)
    end_plastically(first, last, n, state)


@once
def cycle(level, c, bend, n, state):
    """If the neighbourhood of contact c repeats itself on a smaller scale, go to the limit.

    Light balls need many cycles to settle on one factor.  It is enough that what still changes
    will not matter: the bend, how far the state turns by the time that it is exhausted, is below
    its limit at the present pace, and the pace was no lower (`bend`) over the snapshot before.
    Without steady neighbours the limit does not depend on it.  With them it does: then the part of
    the way that the bend leaves open, and what the digits of the neighbours' shares do, must be
    too small to matter.

    Returns (first, last) of the contacts that have collapsed, empty, with nothing changed, if
    there is no cycle; and the bend.
    """
    threshold = state.tally[0].threshold
    cluster = cluster_around(c, level, n, state)
    if cluster.last < cluster.first:
        return c, c - 1, math.inf
    total, off, size, doubt = limit(cluster, level, state)
    if total == 0.0:
        return c, c - 1, math.inf
    bent = 0.0
    if off > LIMITS.self_similar:
        # How often the scale still shrinks by L before nothing is left; log(1 / L) is above
        # 1 / (T + 1/2), and as good as that for a slow cycle.
        bent = off * max(math.log(size / threshold), 1.0) * (total + 0.5)
        if not bent < min(LIMITS.bend, bend):
            return c, c - 1, bent
    farthest = velocity_changes(cluster, total, level, state)
    steady = cluster.left < cluster.first or cluster.last < cluster.right
    if steady and doubt + bent * farthest > LIMITS.doubt * threshold:
        return c, c - 1, bent
    if not neighbours_stay(cluster, total, farthest, level, n, state):
        return c, c - 1, math.inf
    jump(cluster, total, level, n, state)
    return cluster.first, cluster.last, math.inf


@jit
def forget(number, levels):
    """Drop the snapshot of a level."""
    level = levels[number]
    level.mark = -1
    level.due = 16 if number == 0 else 4
    level.count = 0
    level.bend = level.bent = math.inf


@apart
def look(number, c, n, state):
    """See whether contact c has come round; take a new snapshot if the last one is old.

    Snapshots are taken at doubling distances, so that a cycle of any length is found.
    """
    level, memory = state.level[number], state.memory
    if level.mark == c:
        early = 2 * level.count <= 3 * level.due
        first, last, level.bent = cycle(number, c, 0.0 if early else level.bend, n, state)
        if first <= last:
            return first, last
    if level.count >= 2 * level.due:
        level.bend = level.bent if level.mark == c else math.inf
        level.bent = math.inf
        level.mark = c
        level.due = level.count
        if number == 0:
            settle(n, memory)
        for k in range(n - 1):
            memory[number][k].p = memory[number][k].a = 0.0
        snapshot(number, n, state)
    return c, c - 1


@apart
def take_limits(ends, ended, worn, n, state):
    """R9, after `ends` contacts have ended, `ended` the last; tell whether contacts collapsed."""
    level = state.level
    level[0].count += ends
    first, last = ended, ended - 1
    if worn >= 0:
        first, last = exhausted_stretch(worn, n, state)
        if first <= last:
            first, last = merge(first, last, n, state)
    if last < first:
        first, last = look(LOWER, ended, n, state)
    if last < first:
        return False
    forget(LOWER, level)
    settle(n, state.memory)
    level[1].count += 1
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
    return True
