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
    join_velocities,
    one_velocity,
    reduced_mass,
    share_out,
)
from cradle.kernel.state import LIMITS, apart, jit, once


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
    snapshot scaled by T / (1 + T), relative to its own size; this size; and what the digits of the
    neighbours' shares leave in doubt, relative to T and of the common velocity.  T is 0 if there is
    no limit.

    T comes from the limit itself: the impulses that bring all balls to one velocity, over those of
    the last cycle.  With L the factor from cycle to cycle T = L / (1 - L), but 1 - L itself would
    lose all digits for a very light ball.
    """
    ball, contact, memory = state.ball, state.contact, state.memory[level]
    left, first, last, right = cluster.left, cluster.first, cluster.last, cluster.right
    none = 0.0, math.inf, 0.0, 0.0, 0.0
    kept_left = kept_part(first - 1, first, first > left, memory)
    kept_right = kept_part(last + 1, last, last < right, memory)
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
    one, other = LIMITS.digits / mass / kept_left, LIMITS.digits / mass / kept_right
    unsure = abs(one * (mass - ball[first].y)) + abs(other * (mass - ball[last + 1].y))
    doubt = abs(one * contact[first].x) + abs(other * contact[last].x)
    return total, off, size, unsure, doubt


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
        work = then.a if k.u > 0.0 else (k.q - then.q) + (k.q_lo - then.q_lo)
        k.y = then.p * (total * k.u + change * squares) + (work - then.u * then.p) * squares
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
    energy = energy_lost(left, right + 1, ball)
    for i in range(left, right + 2):
        add_velocity(ball[i], ball[i].x)
    one_velocity(first, last + 1, heaviest_of(first, last + 1, ball), ball)
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
                    add_store(k, k.e * k.e * work)
                elif k.active == 1:
                    add_store(k, k.y)
        add_impulse(k, share)
        add_work(k, work)
        if level == 0:
            memory[c].p += share
            memory[c].a += work
    hold_together(cluster, low, high, ball, contact)
    end_plastically(first, last, n, state)
