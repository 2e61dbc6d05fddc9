"""Contact forces as finely as is asked for: units, steps, runs that are compared, the certificate.

A chain is followed in the units of the contact that closes fastest, all the balls together at rest.
The step bounds the error where most contacts collide once: measured on random chains, it was
C (h omega)^4, at very small steps C / 1.5 (h omega)^3.5.  Balls that collide again and again
amplify it, those that strings pull swing long: then finer and finer runs tell.
"""

import math

from cradle.kernel.forces import REST, begin, put_down, run
from cradle.kernel.kinks import FAINT, Springs, grade
from cradle.kernel.state import (
    ENERGY,
    FINISHED,
    LEDGER,
    MOMENTUM,
    ORDER,
    PAUSED,
    REFUSED,
    UNFINISHED,
    UNSOUND,
    apart,
    door,
)

# Why a chain is refused: a value that is none, too quick, light, soft, lossy, wide, narrow, deep;
# or a reduced mass that has lost digits.  (9 is PULLS.)
VALUE, QUICK, LIGHT, SOFT, LATE, WIDE, NARROW, DEEP, REDUCED = 1, 2, 3, 4, 5, 6, 7, 8, 10
# A step times the largest frequency from which on a run shows whether it was short enough; a
# coarser one that only measures the frequency; and what it may measure too little.
ENOUGH, COARSE, SPARE = 0.2, 0.5, 1.05
# C, at least, without losses and with them, and a radian of a ball on average; radians of a step;
HARD, LOST, SWING, WHOLE = 0.01, 0.022, 0.0027, 0.8
TURN, FEW = 2.4, 7  # and of equal balls; longest row whose first step is for unequal ones
# From so many kinks beyond two of each contact (more in a longer row) or radians runs are compared.
OFTEN, LONG, SPREAD = 4.0, 30.0, 45.0
STRONG = 0.5  # A from which on they are, of viscoelastic balls: it may open a contact at any node
TRIALS, DAMPED = 16, 0.25  # runs, at most; step times A times the square of a frequency, at most
SMALLEST = 1e-9  # lightest ball and softest contact, as a part of the largest
LONGEST, MOST_HUNT = 10.0, 10.0  # A, in contact times, and in one over the closing speed
TINY, NORMAL = 1e-300, 2.0**-1022  # the least depth, 1 over the largest; less has lost digits
# The widest gap and the narrowest, in depths; the widest whose last digit is below this accuracy.
WIDEST, NARROWEST, BLURRED = 1e9, 1e-12, 1e13


def refuse(wrong, rule, place, clock):
    """Note the rule that is first found broken, and where."""
    if wrong and clock.rule == 0:
        clock.rule, clock.place = rule, place


@apart
def measure(n, chain, law, sized, s, clock):
    """Write a chain down in its own units; what cannot be resolved beside the rest is refused."""
    m, v, p = chain.m, chain.v, law.p
    clock.rule = clock.fastest = 0
    energy = momentum = heavy = hard = fast = 0.0
    for i in range(n):
        refuse(not (0.0 < m[i] < math.inf and abs(v[i]) < math.inf), VALUE, i, clock)
        energy += m[i] * v[i] * v[i]
        momentum += 2.0 * (m[i] * abs(v[i]))
        heavy = max(heavy, m[i])
        if i < n - 1:
            known = 0.0 < chain.k[i] < math.inf and 0.0 <= chain.loss[i] < math.inf
            refuse(not (known and abs(chain.gap[i]) < math.inf), VALUE, i, clock)
            sized = sized or chain.loss[i] > 0.0 or chain.gap[i] != 0.0
            hard = max(hard, chain.k[i])
            if v[i] - v[i + 1] > fast or i == 0:
                clock.fastest, fast = i, v[i] - v[i + 1]
    refuse(not (energy < math.inf and momentum < math.inf), VALUE, 0, clock)
    if clock.rule > 0:
        return
    at, part = clock.fastest, 1.0 / (p + 1.0)
    clock.stiffness, clock.speed = chain.k[at], fast if fast > 0.0 else 1.0
    clock.mass = m[at] / (m[at] + m[at + 1]) * m[at + 1]
    size = clock.mass / chain.k[at] * clock.speed * clock.speed
    if not TINY < size < 1.0 / TINY:
        clock.length = clock.mass**part / chain.k[at] ** part * clock.speed ** (2.0 * part)
    else:  # a power takes as long as a step: it is left out where no length is asked for
        clock.length = size**part if sized else 1.0
    refuse(clock.mass < NORMAL, REDUCED, at, clock)
    refuse(not TINY <= clock.length <= 1.0 / TINY, QUICK, at, clock)
    if clock.rule > 0:
        return
    widest = min(WIDEST, BLURRED * law.accuracy)
    rate = clock.speed if law.hunt else clock.speed / clock.length
    rate = rate if fast > 0.0 else 0.0  # else nothing is lost, at whatever speed
    longest = MOST_HUNT if law.hunt else LONGEST
    total = mean = 0.0
    clock.lossy = clock.leans = 0.0
    for i in range(n):
        a = s[i]
        refuse(m[i] < SMALLEST * heavy, LIGHT, i, clock)
        a.w, a.start = clock.mass / m[i], (v[i] - v[at]) / clock.speed
        a.k = a.loss = a.early = a.lean = 0.0
        total += m[i]
        mean += m[i] * a.start
        if i < n - 1:
            refuse(chain.k[i] < SMALLEST * hard, SOFT, i, clock)
            a.k = chain.k[i] / chain.k[at]
            a.loss, a.lean = chain.loss[i] * rate, -chain.gap[i] / clock.length
            a.early = 0.0 if law.hunt else p * a.loss
            refuse(a.loss > longest, LATE, i, clock)
            refuse(-a.lean > widest, WIDE, i, clock)
            refuse(a.lean != 0.0 and abs(a.lean) < NARROWEST, NARROW, i, clock)
            refuse(a.lean > 1.0, DEEP, i, clock)
            clock.lossy, clock.leans = max(clock.lossy, a.loss), max(clock.leans, a.lean)
    for i in range(n):
        a = s[i]
        a.start -= mean / total
        a.after = a.start


@apart
def highest(n, p, s):
    """Bound the square of a ball's frequency: two contacts store at most all E; size up the row.

    By Hoelder, k d^(p - 1) + k' d'^(p - 1) <= (k + k')^(2/(p + 1)) ((p + 1) E)^((p - 1)/(p + 1)).
    """
    energy = part = total = left = drop = 0.0
    fastest = s[0].start
    for i in range(n):
        a = s[i]
        fastest = max(fastest, a.start)
        drop = max(drop, fastest - a.start)
        energy += 0.5 * (p + 1.0) * a.start * a.start / a.w
        both = (left + a.k) * a.w
        own = both * both * grade(p, a.w)
        part, total, left = max(part, own), total + own, a.k
    # Where powers would overflow, and where strings press, the runs tell.
    bound = p * (part * grade(p, min(energy, 1e15))) ** (1.0 / (p + 1.0))
    return bound if bound > 0.0 else 1.0, n * part / total, drop  # how balls differ, and all close


@apart
def aim(n, law, s, clock):
    """Choose the first step, and the largest part of a radian that a step may be."""
    accuracy, spread = law.accuracy, max(0.0, 1.5 - law.p)
    hard, clock.often = (LOST if clock.lossy else HARD) + spread, OFTEN - 8.0 * spread
    clock.swing = (0.75 if clock.lossy else 1.0) * SWING / hard
    top, unlike, drop = highest(n, law.p, s)
    part = accuracy / hard / max(drop, 1.0)
    root = math.sqrt(math.sqrt(part))
    clock.eta = min(root, (1.5 * part) ** (1.0 / 3.5)) if part < 0.04 else root
    # Longer where balls differ: in short rows, not compared anyway, it spares most second runs.
    long = 1.0 if clock.leans or n > FEW else max(1.0, clock.swing * TURN * unlike)
    eta = min(clock.eta / math.sqrt(math.sqrt(long)), 0.7 if clock.lossy else WHOLE)
    h = (eta if eta >= ENOUGH else COARSE) / math.sqrt(top)
    # Half its digits, rounded down: the last ones of a power may depend on the machine.
    h = min(h, DAMPED / max(clock.lossy, 1e-300) / top) * (1.0 - 1e-8)
    clock.h = h * 134217729.0 - (h * 134217729.0 - h)
    # Balls that strings hold together after all swing for ever, or with losses long.
    most = (6e4 if clock.lossy else 2e4) / accuracy**0.25
    clock.most = min(law.most, most) if clock.leans else law.most
    clock.slow = FAINT * accuracy
    clock.trial = clock.effort = 0
    clock.error = clock.coarser = clock.told = 0.0


@apart
def judge(n, law, change, s, clock):
    """Estimate the error of a run, by its steps and by the run before; tell if it is to be finer.

    Of the run before, if it was fine enough, the outcome counts, and its change from another: two
    may agree by luck, most in long rows; where balls that strings pull swing long, it takes three.
    """
    many = used = 0
    for c in range(n - 1):
        many += max(s[c].kinks - 2, 0)
        used += min(s[c].kinks, 1)
    phase = clock.h * math.sqrt(clock.top)
    radians = clock.steps * phase / max(used, 1)
    off = phase / clock.eta * math.sqrt(math.sqrt(max(1.0, clock.swing * radians)))
    often = many > clock.often * max(1.0, used / SPREAD)
    compare = often or clock.leans > 0 or (clock.lossy > STRONG and not law.hunt)
    told, ratio = math.inf, clock.coarser / clock.h
    if ratio > 0.0:
        told = (60.0 if clock.leans else max(15.0, 5.0 * math.sqrt(used))) * change / law.accuracy
        told /= ratio * ratio * ratio * ratio - 1.0
    error = off * off * off * math.sqrt(off)
    if off <= 1.0 and compare:
        error = max(error, told, 0.25 * clock.told)
    clock.told = told if ratio > 0.0 or (clock.leans and (often or radians > LONG)) else 0.0
    clock.error = law.accuracy * max(error, FAINT if clock.lossy else 0.0)  # what counts as none
    if not error > 1.0:
        return False
    finer = max(off * SPARE, 1.5) if compare else off * SPARE
    if off <= 1.0:
        finer = math.sqrt(2.0) if clock.lossy or (ratio == 0.0 and not clock.leans) else 2.0
    if compare and off <= 2.0 and not clock.leans:
        clock.slow /= finer * finer * finer * finer  # runs agree that left out the same, amplified
    clock.coarser = clock.h if off <= (1.0 if clock.leans else 2.0) else 0.0
    clock.h /= finer
    clock.trial += 1
    return True


@apart
def defect_of(n, law, s, clock):
    """Return what the outcome breaks, or 0: order, momentum, energy."""
    rounding = 2.0**-52 * (64.0 + clock.effort)
    size = change = gained = energy = 0.0
    slowest = max(FAINT * law.accuracy, REST if clock.leans > 0.0 else 0.0)
    ordered = True
    for i in range(n):
        a = s[i]
        v, old, m = a.after, a.start, 1.0 / a.w
        size += m * (abs(v) + abs(old))
        change += m * (v - old)
        gained += m * (v - old) * 0.5 * (v + old)
        energy += m * old * old
        if i < n - 1:
            ordered = ordered and s[i + 1].after - v >= -slowest
    slack = law.accuracy * size + rounding * energy
    if not (ordered or law.once):
        return ORDER
    if not abs(change) <= rounding * size:
        return MOMENTUM
    if not (clock.lossy or clock.leans or gained >= -slack):
        return LEDGER
    return 0 if gained <= slack else ENERGY


@door
def follow(begun, resumed, n, chains, law, out, s, clocks, record, effort):
    """Follow the chains of `out` from number `begun` on; return the next one's number, and status.

    It stops at the first chain whose status is not FINISHED: PAUSED, when `effort` (contacts times
    steps) is used up, to be `resumed` there.  With a record, which has room for two pages more than
    effort, there is one run, at the step in `out`: its start, its nodes, and the outcome.
    """
    clock = clocks[0]
    for k in range(begun, len(out.v)):
        v = chains.v[k]
        if not resumed:
            chain = Springs(chains.m[k], v, chains.k[k], chains.loss[k], chains.gap[k])
            measure(n, chain, law, len(record) > 0, s, clock)
            if clock.rule > 0:
                return k, REFUSED
            aim(n, law, s, clock)
            if len(record) > 0:
                clock.h, clock.slow = out.h[k], out.slow[k]
            begin(n, law.p, law.hunt, s, clock, record)
        status, more = FINISHED, clock.high > 0
        while more:
            status, effort = run(n, law, effort, s, clock, record)
            if status == PAUSED:
                return k, PAUSED
            change = 0.0
            for i in range(n):
                change = max(change, abs(s[i].after - s[i].v))
                s[i].after = s[i].v
            clock.effort += clock.steps
            more = status == FINISHED and len(record) == 0 and judge(n, law, change, s, clock)
            if more and clock.trial == TRIALS:
                status, more = UNFINISHED, False
            elif more:
                begin(n, law.p, law.hunt, s, clock, record)
        resumed = False
        put_down(n, s, clock, record)
        for i in range(n):
            out.v[k][i] = v[i] + clock.speed * (s[i].after - s[i].start)
        out.error[k], out.steps[k] = clock.error, clock.effort
        out.h[k], out.slow[k] = clock.h, clock.slow
        if status != FINISHED:
            return k, status
        clock.defect = defect_of(n, law, s, clock)
        if clock.defect > 0:
            return k, UNSOUND
    return len(out.v), FINISHED
