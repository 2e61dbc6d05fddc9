"""Measuring apparatus for the extremes: invariants in exact arithmetic, errors at fifty digits.

`faults` needs no reference: it checks in rational numbers what must hold for every outcome.
`measure` compares with the independent solver and says how much of the error is the problem's own:
the change of the exact outcome when every input changes by its last digit.
"""

import math
from fractions import Fraction
from typing import NamedTuple

import mpmath
import numpy as np
from reference import EventLimit, solve

from cradle import Chain, ImpactNotFinished, ImpulseCorrelation, collide

EPS = 2.0**-52
TINIEST = 5e-324  # the smallest number above zero

FIELDS = ("masses", "velocities", "restitution", "forward", "backward")


class Case(NamedTuple):
    """A chain with its ratios, as plain lists."""

    masses: list
    velocities: list
    restitution: list
    forward: list
    backward: list
    meeting: float = 0.5

    def collide(self, max_events=200_000):
        """The trace, unfinished or not, and whether it finished."""
        chain = Chain(self.masses, self.velocities, self.restitution)
        model = ImpulseCorrelation(
            self.forward,
            self.backward,
            meeting=self.meeting,
            excess="saturate",
            max_events=max_events,
        )
        try:
            return collide(chain, model), True
        except ImpactNotFinished as stopped:
            return stopped.trace, False

    def exact(self, max_events=20_000, **options):
        """The outcome by the independent solver, at the digits in force."""
        return solve(
            *(list(map(float, part)) for part in self[:5]),
            meeting=self.meeting,
            excess="saturate",
            max_events=max_events,
            **options,
        )


def case(masses, velocities, restitution, forward, backward=None, meeting=0.5):
    """A case from arrays or scalars."""
    n = len(masses)
    backward = forward if backward is None else backward
    return Case(
        [float(m) for m in masses],
        [float(v) for v in velocities],
        np.broadcast_to(np.asarray(restitution, float), n - 1).tolist(),
        np.broadcast_to(np.asarray(forward, float), n - 2).tolist(),
        np.broadcast_to(np.asarray(backward, float), n - 2).tolist(),
        meeting,
    )


# --- what must hold ------------------------------------------------------------------------


def invariants(trace):
    """Defects of momentum, energy and ledger, each in units of rounding, and the overlap of balls.

    Exact rational arithmetic on the stored numbers.  Momentum: in units of eps times the larger sum
    of |m v|, before or after.  Energy gained and ledger: in units of eps times the larger sum of
    m v^2 / 2.  Both units contain one smallest number a ball, for results that underflow.
    """
    m = [Fraction(x) for x in trace.chain.masses.tolist()]
    v = [Fraction(x) for x in trace.chain.velocities.tolist()]
    w = [Fraction(x) for x in trace.velocities.tolist()]
    eps, tiniest, n = Fraction(EPS), Fraction(TINIEST), len(m)
    momentum = sum(a * (x - y) for a, x, y in zip(m, w, v))
    unit = max(sum(a * abs(x) for a, x in zip(m, part)) for part in (v, w))
    energy = [sum(a * x * x for a, x in zip(m, part)) / 2 for part in (v, w)]
    work = max(energy)
    loss = energy[0] - energy[1]
    ledger = sum(
        (1 - Fraction(e) ** 2) * Fraction(a)
        for e, a in zip(trace.chain.restitution.tolist(), trace.absorbed.tolist())
    )
    speed = max(abs(x) for x in (*v, *w))
    # A velocity that underflows is off by up to half a smallest number.
    lowest = tiniest * sum(m)
    return {
        "momentum": float(abs(momentum) / (eps * unit + lowest)) if unit else 0.0,
        "gain": float(-loss / (eps * work + lowest * speed + n * tiniest)) if work else 0.0,
        "ledger": float(abs(loss - ledger) / (eps * work + lowest * speed + n * tiniest))
        if work
        else 0.0,
        "overlap": float(max(a - b for a, b in zip(w, w[1:]))),
    }


def faults(trace, finished=True, momentum=8.0, energy=8.0):
    """What is wrong with a trace, by itself; empty if nothing is.

    `momentum` and `energy` are multiples of rounding that are granted per ball, and, for the
    ledger, per square root of the number of events: so do rounding errors add up.
    """
    n = len(trace.chain)
    arrays = (trace.velocities, trace.impulses, trace.absorbed, trace.path, trace.path_impulses)
    if not all(np.isfinite(array).all() for array in arrays):
        return ["not finite"]
    found = []
    defect = invariants(trace)
    if defect["momentum"] > momentum * n:
        found.append(f"momentum off by {defect['momentum']:.3g} roundings")
    if defect["gain"] > energy * n:
        found.append(f"energy gained: {defect['gain']:.3g} roundings")
    if finished:
        if defect["ledger"] > energy * n * max(1.0, math.sqrt(len(trace.events))):
            found.append(f"ledger open by {defect['ledger']:.3g} roundings")
        if defect["overlap"] > 0:
            found.append(f"balls overlap by {defect['overlap']:.3g}")
    if (trace.impulses < 0).any() or (trace.absorbed < 0).any():
        found.append("negative impulse or work")
    return found


# --- error against fifty digits --------------------------------------------------------------


def neighbours(value, low=-math.inf, high=math.inf):
    """The numbers one last digit below and above, inside the range; none for zero."""
    if value == 0:
        return []
    return [x for x in (math.nextafter(value, -math.inf), math.nextafter(value, math.inf))
            if low <= x <= high and x != 0]  # fmt: skip


def ranges(part):
    return {"masses": (TINIEST, math.inf), "velocities": (-math.inf, math.inf)}.get(part, (0, 1))


def unavoidable(problem, exact, max_events=20_000):
    """Change of each exact velocity when all inputs change by their last digits, added up.

    An answer cannot be known better than that from rounded inputs: it is the conditioning, measured
    at the very distance that matters, so that square roots and jumps count at their true size.
    """
    total = [mpmath.mpf(0)] * len(problem.masses)
    for name in FIELDS:
        values = getattr(problem, name)
        for k, value in enumerate(values):
            worst = [mpmath.mpf(0)] * len(total)
            for moved in neighbours(value, *ranges(name)):
                changed = problem._replace(**{name: [*values[:k], moved, *values[k + 1 :]]})
                try:
                    other = changed.exact(max_events)
                except EventLimit:
                    worst = [mpmath.inf] * len(total)
                    break
                moves = [abs(a - b) for a, b in zip(other.velocities, exact.velocities)]
                worst = [max(a, b) for a, b in zip(worst, moves)]
            total = [a + b for a, b in zip(total, worst)]
    return total


class Measured(NamedTuple):
    """Error of one outcome.

    error: largest error of a velocity, in units of eps times the largest speed.
    condition: unavoidable change, in the same units.
    own: largest error of a velocity in units of its own rounding plus its own unavoidable change.
    events: the exact solver's number of events, or -1 if it was not asked.
    same: whether the number of collisions of every contact is the exact one.
    """

    error: float
    condition: float
    own: float
    events: int
    same: bool


def measure(problem, trace=None, max_events=20_000, digits=50, conditioning=True):
    """Compare the package with fifty digits; raises `EventLimit` where these take too long."""
    if trace is None:
        trace, finished = problem.collide()
        assert finished
    with mpmath.workdps(digits):
        exact = problem.exact(max_events)
        after = [mpmath.mpf(x) for x in trace.velocities.tolist()]
        off = [abs(a - b) for a, b in zip(after, exact.velocities)]
        largest = max(abs(x) for x in exact.velocities) or mpmath.mpf(1)
        change = [mpmath.mpf(0)] * len(off)
        if conditioning:
            change = unavoidable(problem, exact, max_events)
        own = max(
            a / (EPS * abs(b) + c + TINIEST) for a, b, c in zip(off, exact.velocities, change)
        )
        return Measured(
            float(max(off) / largest / EPS),
            float(max(change) / largest / EPS),
            float(own),
            len(exact.events),
            trace.collisions.tolist() == exact.collisions or exact.collapsed,
        )


# --- the map of the error ----------------------------------------------------------------------

SHAPES = {
    "middle": lambda r: (1.0, r, 1.0),
    "striker": lambda r: (r, 1.0, 1.0),
    "last": lambda r: (1.0, 1.0, r),
    "taper": lambda r: (1.0, math.sqrt(r), r),
}
POWERS = range(-12, 13, 2)
RESTITUTION = (0.0, 1e-16, 0.3, 0.9, 1.0 - 2.0**-53, 1.0)
RATIOS = {
    "0": lambda _: 0.0,
    "1e-300": lambda _: 1e-300,
    "1e-16": lambda _: 1e-16,
    "0.3 bound": lambda bound: 0.3 * bound,
    "bound - ulp": lambda bound: math.nextafter(bound, 0.0),
    "bound": lambda bound: bound,
    "bound + ulp": lambda bound: min(math.nextafter(bound, 2.0), 1.0),
}
VELOCITIES = {
    "struck": (1.0, 0.0, 0.0),
    "row": (1.0, 0.5, 0.0),
    "one ulp apart": (1.0, 1.0 - 2.0**-53, 0.0),
    "squeezed": (1.0, 0.0, -1.0),
}


def map_case(shape, power, e, ratio, velocities):
    """A point of the map: three balls."""
    m1, m2, m3 = SHAPES[shape](10.0**power)
    forward, backward = (RATIOS[ratio](m / (m + m2)) for m in (m3, m1))
    return case((m1, m2, m3), VELOCITIES[velocities], e, [forward], [backward])


def truth(problem, trace, longest=400, conditioned=80):
    """Exact velocities and their unavoidable change as floats with rests, or None if too long.

    Three balls whose impacts have no end take their common velocity.
    """
    with mpmath.workdps(50):
        if trace.collapsed and len(trace.chain) == 3 and len(trace.events) > conditioned:
            m, v = ([mpmath.mpf(x) for x in part] for part in problem[:2])
            common = sum(a * b for a, b in zip(m, v)) / sum(m)
            return [common] * 3, None
        try:
            exact = problem.exact(longest)
        except EventLimit:
            return None
        change = None
        if len(exact.events) <= conditioned:
            change = unavoidable(problem, exact, longest)
        return exact.velocities, change


def compare(trace, known):
    """Error and condition as in `Measured`, from what `truth` returned."""
    velocities, change = known
    with mpmath.workdps(50):
        off = [abs(mpmath.mpf(a) - b) for a, b in zip(trace.velocities.tolist(), velocities)]
        largest = max(abs(x) for x in velocities) or mpmath.mpf(1)
        error = float(max(off) / largest / EPS)
        if change is None:
            return error, math.nan, math.nan
        own = max(a / (EPS * abs(b) + c + TINIEST) for a, b, c in zip(off, velocities, change))
        return error, float(max(change) / largest / EPS), float(own)
