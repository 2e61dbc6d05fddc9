"""Contact forces in time: velocity Verlet, made fourth-order by what costs no second root.

Balls drift by h v between nodes and are kicked by h F at them.  Three things make the velocities
after the impact exact to h^4, at very small steps to h^3.5:

    the kick     the sum of the kicks is the integral of the force along the path y, and the nodes
                 follow x = y - h^2/12 dv/dt: so the force is that at x + h^2/12 dv/dt, by its slope
    the kink     what a contact that closes or opens owes to the sum is given back (`kinks`)
    the losses   dj/dt has the impulse j, whatever happens on the way: a velocity v + b, b that of
                 the impulses j, feels f alone, and y has the sum of b as well; a cubic through the
                 last nodes tells where f + dj/dt begins and ends

Takahashi and Imada, J. Phys. Soc. Jpn. 53 (1984) 3765; Rowlands, J. Comput. Phys. 97 (1991) 235.
"""

import math

from cradle.kernel.kinks import grade, pay
from cradle.kernel.state import FINISHED, PAUSED, REFUSED, UNFINISHED, apart

# A run begins, and a flight ends, so many steps before the first node that is to find a contact
# closed: there a closing owes least to the next order.
AHEAD = 0.8
REST = 1e-7  # speed below which a contact rests while others are pulled back, at any accuracy
PULLS = 9  # why a chain is refused on its way, after the rules of `accuracy`


def idle(c, slow, s):
    """Tell whether contact c is open and stays so, or what it stores moves no ball that counts."""
    a = s[c]
    u = a.v - s[c + 1].v
    if a.f == 0.0:
        return u <= 0.0
    both = a.w + s[c + 1].w
    return abs(u) + a.spent * both <= slow and a.f * a.d * both <= slow * slow


def done(c, beside, slow, s, leans):
    """Tell whether contact c need not be watched: it and one beside it are idle, none leans."""
    return not leans and idle(c, slow, s) and idle(beside, slow, s)


def settled(slow, low, high, s):
    """Tell whether all watched contacts are idle, or open and closing too slowly to be noticed."""
    for c in range(low, high):
        if not (idle(c, slow, s) if s[c].f > 0.0 else s[c].v - s[c + 1].v <= slow):
            return False
    return True


def push(p, a, d, move, early):
    """Return force and slope of a contact: once open, none until it closes or its losses push."""
    if d > 0.0 and (move > 0.0 if a.f == 0.0 and early < 1.0 else d + early * move > 0.0):
        g = grade(p, d)
        return a.k * d * g, p * a.k * g
    return 0.0, 0.0


def step(p, h, low, high, s):
    """Drift to the next node and kick; return the number of kinks, and the largest frequency^2.

    The force of a contact waits for that of the next, the kick of a ball for the forces of both.
    """
    part = h * h / 12.0
    kinks, here = 0, s[low].v
    top = force = steep = gain = given = 0.0
    for c in range(low, high):
        a = s[c]
        there = s[c + 1].v
        move = h * (here - there)
        d = a.d + move
        a.d = d
        f, g = push(p, a, d, move, 0.0)
        if (f > 0.0) != (a.f > 0.0):
            s[kinks].kink, a.move = c, move
            kinks += 1
        a.f, a.g = f, g
        f -= a.pull
        dv = (force - f) * a.w
        if c > low:
            b, more = s[c - 1], part * steep * (gain - dv)
            b.v = b.v + h * gain + h * b.w * (given - more)
            given = more
        top = max(top, (steep + g) * a.w)
        force, steep, gain, here = f, g, dv, there
    b, last = s[high - 1], s[high]
    more = part * steep * (gain - force * last.w)
    b.v = b.v + h * gain + h * b.w * (given - more)
    last.v += h * last.w * (force + more)
    return kinks, max(top, steep * last.w)


def drop(p, hunt, a):
    """Work out the impulse of a contact's losses, and its slope."""
    if hunt:
        a.spent, a.grip = a.loss * (a.f * a.y - a.pull * a.lean) / (p + 1.0), a.loss * a.f
    else:
        a.spent, a.grip = a.loss * (a.f - a.pull), a.loss * a.g
    a.held = a.spent


def drift_lossy(p, hunt, h, low, high, s):
    """Drift with losses, to where a cubic has the node; return as `step`."""
    kinks = 0
    top = steep = 0.0
    for c in range(low, high):
        a = s[c]
        a.d += h * (a.v - s[c + 1].v)
        a.before, a.jerk = a.y - a.last + (2.0 * a.bend + a.bent) / 6.0, a.bend - a.bent
        a.last, a.bent = a.y, a.bend
        move = a.before + a.bend + 0.5 * a.jerk
        new = a.y + a.before + 0.5 * a.bend + a.jerk / 6.0
        f, g = push(p, a, new, move, a.early / h)
        if hunt and f > 0.0 and h + a.loss * move < 0.0:
            return -1 - c, top  # it would pull
        if (f > 0.0) != (a.f > 0.0):
            s[kinks].kink = c
            kinks += 1
        a.f, a.g, a.push, a.move, a.y = f, g, f - a.pull, move, new
        drop(p, hunt, a)
        top = max(top, (steep + g) * a.w)
        steep = g
    return kinks, max(top, steep * s[high].w)


def kick_lossy(h, low, high, s):
    """Move nodes to where the forces have them, and the forces along their slopes; twice; kick."""
    part = h * h / 12.0
    for _ in range(2):
        force = impulse = rate = dv = b = db = 0.0
        for c in range(low, high + 1):
            z = s[c]
            f, j, r = z.push, z.held, z.grip * z.move / h
            gain, hold, more = (force - f) * z.w, (impulse - j) * z.w, (rate - r) * z.w
            if c > low:
                a = s[c - 1]
                grown, held = dv - gain, b - hold
                a.lag = 0.5 * h * held + part * (grown - (db - more))
                late = a.d + a.lag - a.y
                a.push, a.held = a.f - a.pull + a.g * late, a.spent + a.grip * late
                a.move = h * (a.v - z.v + 0.5 * h * grown + held)
                a.bend = h * h * (grown + db - more)
            force, impulse, rate, dv, b, db = f, j, r, gain, hold, more
    force = impulse = moved = 0.0
    for c in range(low, high + 1):
        a = s[c]
        a.y = a.d + a.lag
        a.v += h * (force - a.push) * a.w
        move = h * (impulse - a.held) * a.w
        if c > low:
            s[c - 1].d += moved - move
        force, impulse, moved = a.push, a.held, move


def bring(a, time, u, h):
    """Let the balls of an open contact fly freely for this time, at this closing speed.

    One that was left pressed, or closed since, closed too slowly to be noticed: it rests.
    """
    a.d = min(a.d + time * u, max(a.d, 0.0))
    a.f = a.g = a.push = a.held = a.grip = a.lag = a.bend = a.bent = 0.0
    a.y, a.last = a.d, a.d - h * u


def leave(a, time):
    """Watch a contact no more."""
    a.seen, a.g, a.push, a.held, a.grip = time, 0.0, 0.0, 0.0, 0.0


def fly(h, low, high, s):
    """Fly, with all contacts open, to the next closing if it is not near; return how long."""
    soonest = 0.0
    first = -1
    for c in range(low, high):
        u = s[c].v - s[c + 1].v
        if u > 0.0 and (first < 0 or -s[c].d < soonest * u):
            first, soonest = c, -s[c].d / u
    if not soonest > h:
        return 0.0
    before = (1.0 - AHEAD) * h
    for c in range(low, high):
        bring(s[c], soonest - before, s[c].v - s[c + 1].v, h)
    s[first].d = s[first].y = before * (s[first + 1].v - s[first].v)
    return soonest - before


@apart
def begin(n, p, hunt, s, clock, record):
    """Go back to the start; there the sums owe h^2/12 times the rates of forces."""
    clock.low, clock.high, clock.steps, clock.row = n, 0, 0, 0
    clock.top, clock.time, clock.stiff = 0.0, 0.0, 1.0
    for i in range(n):
        a = s[i]
        a.v, a.d, a.y = a.start, a.lean, a.lean
        a.push = a.move = a.lag = a.seen = a.bend = a.bent = 0.0
        a.f, a.g = push(p, a, a.d, 1.0, 0.0)
        a.pull, a.kinks = a.f, 0
        drop(p, hunt, a)
        if i < n - 1 and a.v > s[i + 1].start:
            clock.low = min(clock.low, i)
            clock.high = i + 1
    if clock.leans and clock.high > 0:
        clock.low, clock.high = 0, n - 1
    put_down(n, s, clock, record)
    if clock.leans == 0:
        clock.time = (AHEAD - 1.0) * clock.h  # before all touch, they fly
    part = clock.h * clock.h / 12.0
    force = impulse = db = u = 0.0
    for i in range(n):
        a = s[i]
        a.seen = clock.time
        if i < n - 1:
            u = a.start - s[i + 1].start
            a.d += clock.time * u
            a.y, a.last = a.d, a.d - clock.h * u
        f = a.g * u if a.f > 0.0 else 0.0
        a.v += part * a.w * (force - f)
        more = a.w * (impulse - a.grip * u)
        if i > 0:
            s[i - 1].d += part * (db - more)
        force, impulse, db = f, a.grip * u, more


@apart
def put_down(n, s, clock, record):
    """Write a page, if there is a record: time, velocities, compressions, forces, of all balls."""
    if len(record) > 0:
        page = record[clock.row]
        clock.row += 1
        page[0][0] = clock.time
        v, y, f = page[1], page[2], page[3]
        for c in range(n):
            a = s[c]
            v[c], y[c], f[c] = a.v, a.y if clock.lossy > 0.0 else a.d, a.f
            if c < n - 1 and not clock.low <= c < clock.high:
                y[c] += (clock.time - a.seen) * (a.v - s[c + 1].v)
                f[c] = 0.0


@apart
def parted(n, slow, s, clock):
    """Tell whether in this step all contacts were open or at rest, and none closing; go back there.

    Then the pulls end.  Until then they alone act, so that balls fly at constant accelerations.
    """
    h = late = clock.h
    soon = before = held = swings = drawn = 0.0
    most = max(slow, REST)
    for i in range(n):
        a = s[i]
        push = a.f - a.pull
        if a.f > 0.0 and push * push * a.w > most * most * a.g:
            return False  # most steps end here
        a.dv = a.w * (before - push)
        a.free = a.v + a.w * (held - a.spent) - 0.5 * h * a.dv
        before, held = push, a.spent
    for c in range(n - 1):
        a = s[c]
        u, gain = a.free - s[c + 1].free, a.dv - s[c + 1].dv
        if a.f > 0.0:
            push = a.f - a.pull
            swings = max(swings, u * u + push * push * (a.w + s[c + 1].w) / a.g)
            continue
        y = a.y if clock.lossy else a.d + h * h / 12.0 * gain
        y, rate = y + a.early * u, u + a.early * gain
        root = rate * rate - 2.0 * gain * y
        shut = y > 0.0 and not (root > 0.0 and rate > 0.0)
        if shut or (u > 0.0 and gain <= 0.0):
            return False
        drawn = max(drawn, gain)
        # It opened where d + p A u was 0 (or d), and may by now be closed again.
        if root > 0.0 and gain > 0.0:
            late = min(late, (rate + math.sqrt(root)) / gain)
        elif root > 0.0 and math.sqrt(root) > rate:
            late = min(late, -2.0 * y / (math.sqrt(root) - rate))
        if u > 0.0:
            soon = max(soon, u / gain)
        elif gain < 0.0:
            late = min(late, u / gain)
    # What still swings goes on, while one that is pulled comes back.
    rest = REST if drawn > 0.0 else slow
    ended = soon <= late and swings <= rest * rest
    for i in range(n if ended else 0):
        s[i].v = s[i].free - late * s[i].dv
    return ended


@apart
def run(n, law, effort, s, clock, record):
    """Run until all contacts are idle, or `effort` is used up; return how it ended, and the rest.

    A contact is watched from when its neighbour closes until both are idle; other balls fly freely.
    """
    p, slow, h = law.p, clock.slow, clock.h
    lossy, leans = clock.lossy > 0.0, clock.leans > 0.0
    low, high = clock.low, clock.high
    while low < high and clock.steps < clock.most and effort > 0:
        effort -= high - low
        if clock.stiff == 0.0 and not leans:
            if law.once and clock.top > 0.0:
                low = high
                break
            clock.stiff = 1.0
            flown = fly(h, low, high, s)
            clock.time += flown
            if flown > 0.0:
                put_down(n, s, clock, record)
            continue
        clock.steps += 1
        clock.time = time = clock.time + h
        left, right = s[low].v, s[high].v
        if lossy:
            kinks, stiff = drift_lossy(p, law.hunt, h, low, high, s)
            if kinks < 0:
                clock.rule, clock.place = PULLS, -1 - kinks
                return REFUSED, effort
        else:
            kinks, stiff = step(p, h, low, high, s)
        clock.top, clock.stiff = max(clock.top, stiff), stiff
        a, z = s[low], s[high - 1]
        # Before kinks are paid: one that is watched from now on gets its part, but of no past.
        if high < n - 1 and z.f > 0.0 and (lossy or z.d > slow or right - s[high + 1].v > slow):
            bring(s[high], time - s[high].seen, right - s[high + 1].v, h)
            high += 1
        if low > 0 and a.f > 0.0 and (lossy or a.d > slow or s[low - 1].v - left > slow):
            low -= 1
            bring(s[low], time - s[low].seen, s[low].v - left, h)
        if kinks > 0:
            pay(p, h, kinks, slow, lossy, clock.steps == 1, s)
        if lossy:
            kick_lossy(h, low, high, s)
        ended = parted(n, slow, s, clock) if leans else settled(slow, low, high, s)
        while low < high and (ended or done(low, min(low + 1, high - 1), slow, s, leans)):
            leave(s[low], time)
            low += 1
        while low < high and done(high - 1, high - 2, slow, s, leans):
            high -= 1
            leave(s[high], time)
        clock.low, clock.high = low, high
        if len(record) > 0:
            put_down(n, s, clock, record)
    if low < high and clock.steps < clock.most:
        return PAUSED, effort
    return (UNFINISHED if low < high else FINISHED), effort
