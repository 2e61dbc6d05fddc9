"""R9, the limit of a cycle: all its smaller copies are a geometric series, taken in one jump."""

import math

from cradle.kernel.collapse import end_plastically
from cradle.kernel.motion import (
    add_impulse,
    add_store,
    add_velocity,
    add_work,
    closing,
    heaviest_of,
    one_velocity,
    reduced_mass,
    share_out,
)
from cradle.kernel.state import LIMITS, LOWER, apart, jit, once


@jit
def kept_part(neighbour, edge, exists, memory):
    """Return 1 - h for a steady neighbour whose impulse is h times that of the outermost contact.

    The ball between them acts as one of mass m / (1 - h), whatever its sign.  With nothing kept
    that mass is infinite: the last digit is kept instead.
    """
    if not exists:
        return 1.0
    kept = 1.0 - memory[neighbour].p / memory[edge].p
    return kept if kept != 0.0 else LIMITS.digits


@apart
def limit(cluster, level, state):
    """Work out the limit: one velocity of the balls first..last + 1.

    Returns T, the sum of all cycles to come over the last one; how far the state is from its
    snapshot scaled by T / (1 + T), relative to its own size; this size; and what the digits of the
    neighbours' shares leave in doubt, relative to T and of the common velocity.  T is 0 if there is
    no limit, and below -1 if the cycles come from there and grow, driven by steady neighbours.

    T comes from the limit itself: the impulses that bring all balls to one velocity, over those of
    the last cycle.  With L the factor from cycle to cycle T = L / (1 - L), but 1 - L itself would
    lose all digits for a very light ball.
    """
    ball, contact, memory = state.ball, state.contact, state.memory[level]
    left, first, last, right = cluster.left, cluster.first, cluster.last, cluster.right
    none = 0.0, math.inf, 0.0, 0.0, 0.0
    kept_left = kept_part(first - 1, first, first > left, memory)
    kept_right = kept_part(last + 1, last, last < right, memory)
    # Velocities count from that of the first ball; masses are as the steady neighbours change them.
    size = 0.0
    mass = 0.0
    momentum = 0.0
    ball[first].x = 0.0
    for i in range(first, last + 2):
        b = ball[i]
        b.y = b.m / (kept_left if i == first else kept_right if i == last + 1 else 1.0)
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
    total = to_come / done
    if -1.0 <= total <= 0.0:
        return none
    factor = total / (1.0 + total)
    off = 0.0
    for c in range(first, last + 1):
        off = max(off, abs(contact[c].u - factor * memory[c].u) / size)
        stored = contact[c].q - factor * factor * memory[c].q
        off = max(off, abs(stored) / reduced_mass(c, ball) / size / size)
    one, other = LIMITS.digits / mass / kept_left, LIMITS.digits / mass / kept_right
    unsure = abs(one * (mass - ball[first].y)) + abs(other * (mass - ball[last + 1].y))
    doubt = abs(one * contact[first].x) + abs(other * contact[last].x)
    return total, off, size, unsure, doubt


@jit
def stays_at_zero(c, contact, memory):
    """Tell whether contact c has been at u = 0 since the snapshot: its balls move as one."""
    k, then = contact[c], memory[c]
    return k.active == 1 and k.u == 0.0 and then.u == 0.0 and then.a == 0.0 and k.q == then.q


@jit
def one_body(cluster, contact, memory):
    """Return the first and the last ball of those of a cycle, and of those held to them."""
    one, other = cluster.first, cluster.last + 1
    while one > cluster.left and stays_at_zero(one - 1, contact, memory):
        one -= 1
    while other <= cluster.right and stays_at_zero(other, contact, memory):
        other += 1
    return one, other


@apart
def velocity_changes(cluster, total, level, state):
    """Leave in x where the velocities of the balls go; return the largest change.

    Steady neighbours' balls go by the impulses of all cycles, the others to a common velocity that
    leaves the momentum alone.  Balls held together go together.
    """
    ball, contact, memory = state.ball, state.contact, state.memory[level]
    left, right = cluster.left, cluster.right
    one, other = one_body(cluster, contact, memory)
    k = heaviest_of(one, other, ball)
    common = 0.0
    farthest = 0.0
    i = left
    while i <= right + 1:
        end = i
        mass = ball[i].m
        while end <= right and (one <= end < other or stays_at_zero(end, contact, memory)):
            end += 1
            mass += ball[end].m
        if i == one:
            heavy = mass
            for j in range(one, other + 1):
                common += ball[j].m * ((ball[j].hi - ball[k].hi) + (ball[j].lo - ball[k].lo))
        else:
            before = memory[i - 1].p if i > left else 0.0
            change = (before - (memory[end].p if end <= right else 0.0)) * total / mass
            common -= mass * change
            farthest = max(farthest, abs(change))
            for j in range(i, end + 1):
                ball[j].x = change
        i = end + 1
    for i in range(one, other + 1):
        b = ball[i]
        b.x = common / heavy - ((b.hi - ball[k].hi) + (b.lo - ball[k].lo))
        farthest = max(farthest, abs(b.x))
    return farthest


@jit
def sum_of_squares(total, part):
    """Return the sum of L^2, L^4, ... on this part of the way to the limit."""
    return part * (2.0 - part) * total * (total / (1.0 + 2.0 * total))


@apart
def neighbours_stay(cluster, total, part, level, n, state):
    """Work out what the neighbours of a cycle absorb; tell whether none comes to its own event.

    Their works of all cycles on this part of the way are left in y; closing speeds are linear in
    the impulse so far, with the sums of L^2, L^4, ... as `squares` and of L - L, L^2 - L^3,
    L^3 - L^5, ... as `steps`.  A cycle that grows goes on only while its neighbours' works stay
    below the energy of the first closing: the digits of the works in one cycle tell no more.
    """
    ball, contact, memory = state.ball, state.contact, state.memory[level]
    left, right = cluster.left, cluster.right
    squares = sum_of_squares(total, part)
    steps = part * total * (part * (1.0 + total) - 1.0) / (1.0 + 2.0 * total)
    for c in range(max(left - 1, 0), min(right + 1, n - 2) + 1):
        if cluster.first <= c <= cluster.last:
            continue
        k, then = contact[c], memory[c]
        change = (ball[c].x if c >= left else 0.0) - (ball[c + 1].x if c <= right else 0.0)
        speed = k.u + part * change
        k.y = 0.0
        if stays_at_zero(c, contact, memory):
            continue
        if k.u * then.u < 0.0 or k.u * speed < 0.0 or (k.u == 0.0) != (speed == 0.0):
            return False
        if part < 0.0 and abs(then.u * then.p * squares) > state.tally[0].energy:
            return False
        work = then.a if k.u > 0.0 else (k.q - then.q) + (k.q_lo - then.q_lo)
        k.y = then.p * (part * total * k.u + change * steps)
        k.y += (work - then.u * then.p) * squares
        if k.active == 1 and k.u < 0.0 and k.q + k.y <= 0.0:
            return False
    return True


@once
def energy_lost(first, last, ball):
    """Return the kinetic energy that balls first..last lose when each velocity changes by its x.

    From the changes: the energies before and after may be so large that their last digit is more.
    """
    k = heaviest_of(first, last, ball)
    lost = 0.0
    for i in range(first, last + 1):
        b = ball[i]
        lost -= b.m * b.x * ((b.hi - ball[k].hi) + (b.lo - ball[k].lo) + 0.5 * b.x)
    return lost


@once
def exact_squares(cluster, total, part, energy, state, memory, low, high):
    """Return the sum of L^2, L^4, ...: what disappears is (1 - e^2) of what is absorbed.

    `energy` is what the balls have lost.
    """
    contact = state.contact
    loss = 0.0
    for c in range(low, high + 1):
        k = contact[c]
        if cluster.first <= c <= cluster.last:
            energy += k.q * part * (2.0 - part)
            loss += (1.0 - k.e * k.e) * memory[c].a
        else:
            energy -= k.y
    if loss > 0.0:
        return max(energy / loss, 0.0)
    return sum_of_squares(total, part)


@once
def shrink(first, last, scale, ball, contact):
    """Make contacts first..last as large as their cycle then is."""
    for c in range(first, last + 1):
        k = contact[c]
        k.u = closing(c, ball)
        k.q, k.q_lo, k.w = k.q * scale * scale, k.q_lo * scale * scale, k.w * scale * scale
        k.top, k.tip = k.top * scale, k.tip * scale


@apart
def jump(cluster, total, part, level, n, state):
    """Go a part of the way to the limit: velocities by the balls' x, neighbours' works by y."""
    ball, contact, memory = state.ball, state.contact, state.memory[level]
    left, first, last, right = cluster.left, cluster.first, cluster.last, cluster.right
    low = max(left - 1, 0)
    high = min(right + 1, n - 2)
    one, other = one_body(cluster, contact, memory)
    for i in range(left, right + 2):
        ball[i].x *= part
    energy = energy_lost(left, right + 1, ball)
    for i in range(left, right + 2):
        add_velocity(ball[i], ball[i].x)
    if part == 1.0:
        one_velocity(one, other, heaviest_of(one, other, ball), ball)
    squares = exact_squares(cluster, total, part, energy, state, memory, low, high)
    for c in range(low, high + 1):
        contact[c].x = memory[c].p * total * part
    before = contact[one - 1].x if one > left else 0.0
    after = contact[other].x if other <= right else 0.0
    share_out(one, other - 1, before, after, ball, contact)
    shrink(first, last, 1.0 - part, ball, contact)
    for c in range(low, high + 1):
        k = contact[c]
        work = 0.0
        if first <= c <= last:
            work = memory[c].a * squares
        elif not stays_at_zero(c, contact, memory):
            k.u = closing(c, ball)
            if k.active == 1 and k.u > 0.0:
                work = k.y
                k.w += work
                add_store(k, k.e * k.e * work)
            elif k.active == 1:
                add_store(k, k.y)
        add_impulse(k, k.x)
        add_work(k, work)
        if level == LOWER:
            memory[c].p += k.x
            memory[c].a += work


@apart
def to_limit(cluster, total, level, n, state):
    """Go to the limit, where the contacts of the cycle end plastically."""
    jump(cluster, total, 1.0, level, n, state)
    for c in range(cluster.first, cluster.last + 1):
        state.contact[c].u = state.contact[c].blur = 0.0
    end_plastically(cluster.first, cluster.last, n, state)


@apart
def go_on(cluster, total, error, n, state):
    """Repeat a cycle 2, 4, 8 ... times, before a neighbour comes to its event; tell if it did.

    After k cycles everything is L^k of what it was, L = T / (1 + T), and the balls have gone the
    part 1 - L^k of the way to the limit: so far that the `error` of the whole way does not matter,
    and half of it at most, as a neighbour's event may be at the limit itself.
    """
    contact, memory = state.contact, state.memory[LOWER]
    cycles, part = 1, 1.0 / (1.0 + total)
    while True:
        further = part * (2.0 - part)
        if further > 0.5 or not abs(further) * error <= LIMITS.doubt * state.tally[0].threshold:
            break
        if not neighbours_stay(cluster, total, further, LOWER, n, state):
            break
        cycles, part = 2 * cycles, further
    if cycles < LIMITS.many:
        return False
    neighbours_stay(cluster, total, part, LOWER, n, state)
    jump(cluster, total, part, LOWER, n, state)
    for c in range(cluster.first, cluster.last + 1):
        contact[c].hits += cycles * (contact[c].hits - memory[c].hits)
    return True
