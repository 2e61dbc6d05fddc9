"""Balls on springs: their records, what they push with, what a kink owes to a sum over steps.

A contact pushes with f = k d^p while its compression d is above zero; with losses with f + dj/dt
while that is above zero: j = A f, or by Hunt and Crossley A f d/(p + 1).  A sum over nodes differs
from the integral of tau^p by h^(p + 1) zeta(-p, theta), theta steps from the kink to the first one.

Kuwabara and Kono, Jpn. J. Appl. Phys. 26 (1987) 1230; Hunt and Crossley, J. Appl. Mech. 42 (1975)
440; Navot, J. Math. and Phys. 40 (1961) 271.
"""

import math
from typing import Any, NamedTuple

from cradle.kernel.state import apart


class Link:
    """One ball and the contact on its right, in the chain's own units."""

    w: float  # 1 / mass
    start: float  # velocity before the impact,
    after: float  # and after the last run
    lean: float  # compression before the impact
    v: float  # velocity between two nodes; with losses, less that of the impulses A f
    k: float  # stiffness
    loss: float  # A,
    early: float  # and p A, so long before d is zero they open it; 0 by Hunt and Crossley
    pull: float  # force that presses the contact together at rest, all the time
    d: float  # compression at a node, as the drifts have it; below zero a gap
    f: float  # force at the node,
    g: float  # its slope df/dd,
    move: float  # how much d grows in a step: at a kink, in that step; with losses at the node
    y: float  # with losses: compression at the node, as it is,
    last: float  # and at the node before,
    before: float  # `move` there,
    bend: float  # how much that grows in a step,
    bent: float  # and did a step before,
    jerk: float  # and what is between the two
    lag: float  # what y is more than `d`,
    push: float  # force less the pull, corrected; none if the contact is not watched
    spent: float  # impulse j of the losses at a node, as that of the force alone, more than at rest
    held: float  # and corrected,
    grip: float  # and dj/dd
    dv: float  # if pulls alone act: acceleration,
    free: float  # and velocity at the node
    seen: float  # time at which the contact was last looked at
    kinks: int  # how often the contact has closed and opened so far
    kink: int  # a contact that has closed or opened in this step


class Springs(NamedTuple):
    """Chains on springs, a row for each."""

    m: Any
    v: Any
    k: Any
    loss: Any
    gap: Any


class Motions(NamedTuple):
    """What they come to, a row for each."""

    v: Any
    error: Any  # estimate, relative to the fastest closing
    h: Any  # the last step, in the chain's own units,
    slow: Any  # and the closing speed that was too slow to be noticed
    steps: Any  # of all runs


class Law(NamedTuple):
    """The law of force, and what is asked for."""

    p: float
    accuracy: float
    most: float  # steps of a run
    once: bool = False  # stop when all contacts are open that were not
    hunt: bool = False  # losses by Hunt and Crossley


class Clock:
    """Where a run is: contacts low..high - 1 are watched, the others fly or rest; and its chain."""

    low: int
    high: int
    steps: int
    time: float
    stiff: float  # largest square of a frequency at the last node, 0 if all contacts are open,
    top: float  # and so far
    row: int  # of the record, to be written next
    h: float  # step,
    slow: float  # closing speed that is too slow to be noticed,
    eta: float  # what it times a frequency may be, at most,
    most: float  # steps of a run
    trial: int  # number of the run,
    swing: float  # how much of the error is for each radian of a ball
    often: float  # how many kinks of a contact are many
    coarser: float  # step of the run before it, if that was fine enough,
    told: float  # what its change from another told of the error, over the accuracy,
    error: float  # and the estimate so far
    effort: int  # steps of all runs before
    lossy: float  # largest A, and deepest lean: with leans all contacts are watched, all the time
    leans: float
    fastest: int  # the contact that closes fastest, which gives the units:
    mass: float
    speed: float
    length: float
    stiffness: float
    rule: int  # why the chain is refused, 0 for nothing,
    place: int  # and where
    defect: int  # what the outcome breaks


FAINT = 0.01  # what is too little to matter, over the accuracy


def grade(p, x):
    """Return x^(p - 1); with the same bits everywhere for spheres and linear springs."""
    if p == 1.5:
        return math.sqrt(x)
    return 1.0 if p == 1.0 else x ** (p - 1.0)


def tail(q, x, inverse):
    """Return zeta(-q, x) / x^q for x not small, by the sum of Euler and Maclaurin."""
    s = inverse * inverse
    series = 1.0 - (q - 5.0) * (q - 6.0) * (1.0 / 40.0) * s
    series = 1.0 - (q - 3.0) * (q - 4.0) * (1.0 / 42.0) * s * series
    series = 1.0 - (q - 1.0) * (q - 2.0) * (1.0 / 60.0) * s * series
    return 0.5 - x / (q + 1.0) - q * (1.0 / 12.0) * inverse * series


@apart
def zetas(p, theta):
    """Return Hurwitz's zeta(-p, theta) and zeta(-p - 1, theta)."""
    one, two, x = 0.0, 0.0, theta
    if p == 1.5 and x <= 1.0:  # polynomials, to 1e-6, in place of the values at 1 + x
        one = ((((0.0239223 - 0.0038369 * x) * x - 0.1599788) * x - 0.5483335) * x - 0.3117729) * x
        two = ((((0.0071221 * x - 0.0944837) * x - 0.4598364) * x - 0.3890269) * x - 0.0637753) * x
        term = x * math.sqrt(x)
        return one - 0.025486 + term, two + 0.0085178 + x * term
    while x < 2.0:
        term = x * grade(p, x)
        one += term
        two += x * term
        x += 1.0
    term, inverse = x * grade(p, x), 1.0 / x
    return one + term * tail(p, x, inverse), two + x * term * tail(p + 1.0, x, inverse)


@apart
def crossing(p, h, k, early, closes, ends, theta, move):
    """Return the kick and the shift that a kink owes a contact: an impulse, and that times a time.

    It closes theta steps before this node, or reaches d = 0 theta steps after the last one, by
    `move` a step.  With losses its force ends at d = `ends` moves, and the rest of A f at once.
    """
    unit = h * k * move * grade(p, move)
    one, two = zetas(p, theta)
    if closes:
        return -unit * one, h * unit * (two - (theta + early / p) * one)
    rest = ends * grade(p, ends) if ends > 0.0 else 0.0
    cut = ends * rest / (p + 1.0)
    spent = one + cut
    kick = early / p * rest - spent
    moment = two - ends * one - ends * cut / (p + 2.0)
    return unit * kick, h * unit * ((1.0 - theta + ends) * kick - moment - early / p * spent)


def echo(p, x):
    """Return what a closing owes besides, of second order in the force, in parts of its square.

    Of linear springs by theory, of spheres fitted to two balls that meet at any part of a step.
    """
    if p == 1.5:
        return (((-0.17017 * x + 0.01714) * x + 0.09709) * x + 0.00526) * x - 0.00344
    if p == 1.0:
        return (((-x - 2.0) * x - 1.0) * x + 2.0) * x / 24.0 - 1.0 / 360.0
    return 0.0


def turning(a, early, soonest):
    """Return when, in steps from the last node on, d and `early` moves are 0; d there, its move.

    There the force with losses begins or ends; by Newton's method.
    """
    at, change = 0.5, 0.0
    d = move = 0.0
    for _ in range(5):
        at = min(max(at - change, soonest), 1.25)
        move = a.before + at * (a.bend + 0.5 * at * a.jerk)
        d = a.last + at * (a.before + at * (0.5 * a.bend + at * a.jerk / 6.0))
        slope = move + early * (a.bend + at * a.jerk)
        change = (d + early * move) / slope if slope != 0.0 else 0.0
    return at, d, move


@apart
def resumed(p, h, a, theta, d, move):
    """Return the same if losses had opened it and it pushes again, theta steps before the node."""
    first = a.k * d * grade(p, d)
    half, third = 0.5 - theta, 0.5 * (theta * (1.0 - theta) - 1.0 / 6.0)
    owed = h * first * (half + p * move / d * third)
    kick = -owed - a.loss * first
    return kick, h * h * first * third - a.loss * owed + theta * h * kick


@apart
def pay(p, h, kinks, slow, lossy, first, s):
    """Give back what the kinks of this step owe, where it can be noticed: kick and shift apart."""
    for i in range(kinks):
        c = s[i].kink
        a = s[c]
        a.kinks += 1
        move, left, right = a.move, a.w, s[c + 1].w
        again, d, early, at, end, slant = False, a.d, 0.0, 0.0, 0.0, 0.0
        if lossy:
            d, move, early = a.y, a.y - a.last, a.early / h
            again = a.f > 0.0 and a.last > 0.0 and early > 0.0
            if again or (a.f == 0.0 and early > 0.0):
                at, end, slant = turning(a, early, 0.0 if first else -1.0)
        j = x = 0.0
        if again and end > 0.0:
            j, x = resumed(p, h, a, 1.0 - at, end, slant)
        elif early == 0.0 and h * a.k * abs(move) * grade(p, abs(move)) * (left + right) <= slow:
            continue
        elif a.f == 0.0 and end > 0.0 and slant < 0.0:
            ends = -end / slant
            j, x = crossing(p, h, a.k, early, False, ends, max(at + ends, 0.0), -slant)
        elif a.f == 0.0 and move < 0.0:
            ends = max(-d / move, 0.0) if early > 0.0 else 0.0
            j, x = crossing(p, h, a.k, early, False, ends, max(1.0 - d / move, 0.0), -move)
        elif a.f > 0.0 and move > 0.0:
            theta, unit = min(max(d / move, 0.0), 1.0), h * a.k * grade(p, move)
            j, x = crossing(p, h, a.k, early, True, 0.0, theta, move)
            if not lossy:
                j += h * move * unit * unit * (left + right) * echo(p, theta)
        a.v -= j * left
        s[c + 1].v += j * right
        a.d -= x * (left + right)
        if c > 0:
            s[c - 1].d += x * left
        s[c + 1].d += x * right  # also of the last ball, which has no contact
