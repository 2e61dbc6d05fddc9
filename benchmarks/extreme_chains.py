"""Measuring apparatus for the extremes: invariants in exact arithmetic, errors at fifty digits.

`faults` needs no reference.  `measure` compares with the independent solver and says how much of
the error is the problem's own: the change of the exact outcome when every input changes by its
last digit.
"""

import contextlib
import math
from fractions import Fraction
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import mpmath
import numpy as np
from chains import magnitudes, power_of_ten, uniform, with_ends, within_bounds
from problem import Problem, case
from truth import EventLimit, as_meant

from cradle import ImpactNotFinished, outcomes, paper_chain, post_impact_velocities
from cradle.measures import _events_at_balls as events_at_balls

EPS = 2.0**-52
TINIEST = 5e-324  # the smallest number above zero

RANGES = {"masses": (TINIEST, math.inf), "velocities": (-math.inf, math.inf)}
RANGES |= dict.fromkeys(("restitution", "forward", "backward"), (0.0, 1.0))


def sequence(name):
    return Problem.of(*paper_chain(name, excess="saturate"))


# --- what must hold ------------------------------------------------------------------------


def invariants(trace):
    """Defects of momentum, energy and ledger, in units of rounding, and overlap: by fractions.

    The units are eps times the larger sum of |m v| or m v^2 / 2, before or after, and one smallest
    number a ball, for results that underflow.
    """
    chain = trace.chain
    arrays = chain.masses, chain.velocities, trace.velocities, chain.restitution, trace.absorbed
    m, v, w, e, absorbed = ([Fraction(x) for x in array.tolist()] for array in arrays)
    momentum = sum(a * (x - y) for a, x, y in zip(m, w, v))
    before, after = (sum(a * x * x for a, x in zip(m, part)) / 2 for part in (v, w))
    loss = before - after
    ledger = sum((1 - x * x) * a for x, a in zip(e, absorbed))
    # A velocity that underflows is off by up to half a smallest number.
    eps, tiniest = Fraction(EPS), Fraction(TINIEST)
    speed, lowest = max(map(abs, (*v, *w))), tiniest * sum(m)
    unit = eps * max(sum(a * abs(x) for a, x in zip(m, part)) for part in (v, w)) + lowest
    work = eps * max(before, after) + lowest * speed + len(m) * tiniest
    return {
        "momentum": float(abs(momentum) / unit),
        "gain": float(-loss / work),
        "ledger": float(abs(loss - ledger) / work),
        "overlap": float(max(a - b for a, b in pairwise(w))),
    }


def faults(trace, finished=True, overlap=0.0):
    """What is wrong with a trace, by itself; empty if nothing is.

    Eight roundings are granted per ball, and, for the energy, per square root of the number of
    events: so do they add up.  Balls that come to rest together may approach each other by
    `overlap`.
    """
    names = "velocities", "impulses", "absorbed", "path", "path_impulses"
    if not all(np.isfinite(getattr(trace, name)).all() for name in names):
        return ["not finite"]
    n, defect = len(trace.chain), invariants(trace)
    momentum = 8.0 * n
    energy = momentum * max(1.0, math.sqrt(len(trace.events)))
    wrong = {
        f"momentum off by {defect['momentum']:.3g} roundings": defect["momentum"] > momentum,
        f"energy gained: {defect['gain']:.3g} roundings": defect["gain"] > energy,
        f"ledger open by {defect['ledger']:.3g} roundings": finished and defect["ledger"] > energy,
        f"balls overlap by {defect['overlap']:.3g}": finished and defect["overlap"] > overlap,
        "negative impulse or work": (trace.impulses < 0).any() or (trace.absorbed < 0).any(),
    }
    return [words for words, so in wrong.items() if so]


# --- error against fifty digits --------------------------------------------------------------


def moved(problem, name, k, change):
    """The case with one input changed, or None if that leaves its range."""
    values = list(getattr(problem, name))
    values[k] += change
    low, high = RANGES[name]
    return problem._replace(**{name: values}) if low <= values[k] <= high else None


def inputs(problem, names=tuple(RANGES)):
    """Inputs of a case that are not zero, as (name, index, value)."""
    return [(n, k, value) for n in names for k, value in enumerate(getattr(problem, n)) if value]


def in_digits(problem, max_events=20_000):
    return problem.exact(max_events).velocities


def unavoidable(problem, velocities, names=tuple(RANGES), ulps=1, solve=in_digits):
    """Change of each exact velocity when all inputs change by their last digits, added up.

    The conditioning, measured at the very distance that matters, so that square roots and jumps
    count at their true size.
    """
    total = nothing = [mpmath.mpf(0)] * len(velocities)
    for name, k, value in inputs(problem, names):
        low, high = RANGES[name]
        worst = nothing
        for end in (-math.inf, math.inf):
            near = math.nextafter(value, end)
            if not low <= near <= high or near == 0:
                continue
            values = list(getattr(problem, name))
            values[k] = min(max(value + ulps * (near - value), low), high)
            try:
                others = solve(problem._replace(**{name: values}))
            except EventLimit:
                worst = [mpmath.inf] * len(velocities)
                break
            worst = [max(w, abs(a - b)) for w, a, b in zip(worst, others, velocities)]
        total = [a + b for a, b in zip(total, worst)]
    return total


class Measured(NamedTuple):
    """Largest error of a velocity and unavoidable change, over eps times the largest speed."""

    error: float
    condition: float
    own: float  #: largest error over the velocity's own rounding plus its own unavoidable change


def compare(trace, known):
    """Measure an outcome against exact velocities and their unavoidable change, None if unknown."""
    velocities, change = known
    with mpmath.workdps(50):
        off = [abs(mpmath.mpf(a) - b) for a, b in zip(trace.velocities.tolist(), velocities)]
        largest = max(abs(x) for x in velocities) or mpmath.mpf(1)
        if change is None:  # a limit at rest is at rest to half of the fifty digits
            largest = largest if largest > mpmath.mpf(10) ** -25 else mpmath.mpf(1)
            return Measured(float(max(off) / largest / EPS), math.nan, math.nan)
        own = max(a / (EPS * abs(b) + c + TINIEST) for a, b, c in zip(off, velocities, change))
        return Measured(*(float(max(x) / largest / EPS) for x in (off, change)), float(own))


def measure(problem, trace):
    """Compare a trace with fifty digits; raises `EventLimit` where these take too long."""
    with mpmath.workdps(50):
        exact = in_digits(problem)
        return compare(trace, (exact, unavoidable(problem, exact)))


def truth(problem, trace, longest=400, conditioned=80):
    """Exact velocities and their unavoidable change, or None if too long.

    Three balls whose impacts have no end take their common velocity.
    """
    within = partial(in_digits, max_events=longest)
    with mpmath.workdps(50):
        try:
            exact = problem.exact(longest)
        except EventLimit:
            if not trace.collapsed or len(trace.chain) > 3:
                return None
            m, v = ([as_meant(x) for x in part] for part in problem[:2])
            return [mpmath.fdot(m, v) / sum(m)] * 3, None
        velocities = exact.velocities
        if len(exact.events) > conditioned:
            return velocities, None
        change = unavoidable(problem, velocities, solve=within)
        # So near to its bound a ratio counts as at its bound.
        slack = unavoidable(problem, velocities, ("forward", "backward"), 4, within)
        return velocities, [a + b for a, b in zip(change, slack)]


# --- the map of the error ----------------------------------------------------------------------

SHAPES = {
    "middle": lambda r: (1.0, r, 1.0),
    "striker": lambda r: (r, 1.0, 1.0),
    "last": lambda r: (1.0, 1.0, r),
    "taper": lambda r: (1.0, math.sqrt(r), r),
}
POWERS = range(-12, 13, 3)
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
    m1, m2, m3 = SHAPES[shape](power_of_ten(4 * power))
    forward, backward = (RATIOS[ratio](m / (m + m2)) for m in (m3, m1))
    return case((m1, m2, m3), VELOCITIES[velocities], e, [forward], [backward])


# --- growth of a perturbation ------------------------------------------------------------------


def copies(rng, masses, e, ratio, size):
    """Chains whose first balls strike, and the same with every input changed by the part `size`.

    Masses have a shape (..., n); `e` and `ratio` fit the shape before n.
    """
    *chains, n = masses.shape
    e, ratio = (np.atleast_1d(x)[:, None] for x in (e, ratio))
    rows = (np.eye(n)[0], n), (e, n - 1), (ratio, n - 2)
    parts = [masses, *(np.broadcast_to(row, (*chains, length)) for row, length in rows)]
    changed = [part * (1 + size * rng.choice([-1, 1], part.shape)) for part in parts]
    changed[2] = np.minimum(changed[2], 1.0)
    return parts, changed


def rows_of_balls(spread, n, e, size, chains=10, seed=2001):
    """Chains of n balls of 1 but for the part `spread`, ratio .1, and copies changed by `size`."""
    rng = np.random.default_rng([seed, n, round(1000 * e)])
    masses = uniform(rng, 1 - spread, 1 + spread, (chains, n))
    return copies(rng, masses, e, 0.1, size)


def relative_changes(pair):
    """Change of each velocity between two batches, over the largest speed of its chain."""
    one, other = (post_impact_velocities(*chains, excess="saturate") for chains in pair)
    return np.abs(other - one) / np.abs(one).max(axis=-1, keepdims=True)


def perturbed(spread, n, e, size):
    """Largest change of each of `rows_of_balls`, and how many last balls keep six digits."""
    off = relative_changes(rows_of_balls(spread, n, e, size))
    leading = [int(np.argmin([*row[::-1], False])) for row in off <= 1e-6]
    return off.max(axis=-1), np.array(leading)


UNEQUAL = {  # name: masses of n balls, and by which part each is off
    "1 kg, off by 1 %": (lambda n: np.ones(n), 0.01),
    "1 kg, off by 10 %": (lambda n: np.ones(n), 0.1),
    "1 and 0.3 kg in turn, off by 10 %": (lambda n: np.where(np.arange(n) % 2, 0.3, 1.0), 0.1),
    "each 2 % lighter, off by 10 %": (lambda n: np.cumprod([1.0, *[0.98] * (n - 1)]), 0.1),
}


def unequal_jumps(family, n, ratio, chains=24, size=1e-12, e=0.9):
    """Largest change of each of some unequal rows; NaN: not done in a million steps."""
    masses, spread = UNEQUAL[family]
    rng = np.random.default_rng([2001, n, round(1000 * ratio)])
    masses = masses(n) * uniform(rng, 1 - spread, 1 + spread, (chains, n))
    options, found = {"excess": "saturate", "max_events": 1_000_000}, np.full(chains, math.nan)
    for k, pair in enumerate(zip(*(zip(*parts) for parts in copies(rng, masses, e, ratio, size)))):
        with contextlib.suppress(ImpactNotFinished):
            one, other = (post_impact_velocities(*chain, **options) for chain in pair)
            found[k] = np.abs(other - one).max()
    return found


def changes_of_rows(spread, n, e, ratio, chains=4, size=1e-12):
    """Largest change of a velocity, and of the last ball's, for each of the arrays e and ratio."""
    rng = np.random.default_rng([2001, n])
    masses = uniform(rng, 1 - spread, 1 + spread, (chains, len(e), n))
    off = relative_changes(copies(rng, masses, e, ratio, size))
    return off.max(axis=(0, 2)), off[..., -1].max(axis=0)


# --- a light ball between two heavy ones -------------------------------------------------------


def alternating(problem):
    """Number of impacts of three balls, v = (1, 0, 0), at ratio 0 and e near 1, and the outcome.

    In mass-weighted coordinates the balls are a point in a wedge of angle
    theta = arctan sqrt(m2 (m1 + m2 + m3) / (m1 m3)), every elastic impact a mirror: unfolded, the
    path is a straight line, at right angles to the first wall, and meets ceil(pi / theta) - 1.
    Closing speeds map linearly.  With e an ulp below 1 another impact may follow.
    """
    a, b, c = (as_meant(m) for m in problem.masses)
    e, f = (as_meant(x) for x in problem.restitution)
    angle = mpmath.atan(mpmath.sqrt(b * (a + b + c) / (a * c)))
    number = int(mpmath.ceil(mpmath.pi / angle)) - 1
    left = mpmath.matrix([[-e, 0], [(1 + e) * a / (a + b), 1]])
    right = mpmath.matrix([[1, (1 + f) * c / (b + c)], [0, -f]])
    u = (right * left) ** (number // 2) * mpmath.matrix([1, 0])
    if number % 2:
        u = left * u
    while u[number % 2] > mpmath.mpf(10) ** -40:
        u, number = (right, left)[number % 2 == 0] * u, number + 1
    middle = (a - a * u[0] + c * u[1]) / (a + b + c)
    return number, [middle + u[0], middle, middle - u[1]]


def elastic_impacts(light, last=1.0, e=1.0):
    """Number, exact outcome and its unavoidable change, of (1, light, last), e near 1, ratio 0."""
    problem = case([1, light, last], [1, 0, 0], e, 0)
    number, after = alternating(problem)
    inexact = "masses", "restitution"
    return number, after, unavoidable(problem, after, inexact, solve=lambda p: alternating(p)[1])


def infinite_below(e):
    """Largest light mass of (1, light, 1) with an infinite sequence, ratio 0, both e alike.

    Two impacts map the closing speeds by a matrix of determinant e^2 and trace
    (1 + e)^2 / (1 + light)^2 - 2 e, whose eigenvalues are real from trace = 2 e on.
    """
    return (1 - math.sqrt(e)) ** 2 / (2 * math.sqrt(e)) if e > 0 else math.inf


def edge(e, ratio, low=1e-7, high=2.0):
    """The same at any ratio, by bisection on what the solver reports."""
    for _ in range(60):
        middle = math.sqrt(low * high)
        found = outcomes([1.0, middle, 1.0], [1.0, 0.0, 0.0], e, ratio)
        low, high = (middle, high) if found.collapsed else (low, middle)
    return math.sqrt(low * high)


# --- distance to another sequence of events ----------------------------------------------------


def nearest_edge(problem, name, k, side, scale, farthest=0.3, step=1.12):
    """How far, relatively, an input can move to one side before the events change; the jump there.

    (inf, 0) if there is no edge up to `farthest` or to the end of the input's range.
    """
    base = events_at_balls(problem.attempt()[0])

    def at(distance):
        """Velocities, and whether the events are the same; None outside the range."""
        if changed := moved(problem, name, k, side * distance * scale):
            trace = changed.attempt()[0]
            return trace.velocities, events_at_balls(trace) == base

    near, far, found = 0.0, 1e-12, at(1e-12)
    while found and found[1] and far <= farthest:
        near, far = far, far * step
        found = at(far)
    if not found or far > farthest:
        return math.inf, 0.0
    while far - near > max(1e-10 * far, 1e-15):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if at(middle)[1] else (near, middle)
    before, after = at(near)[0], at(far)[0]
    return far, float(np.abs(after - before).max() / np.abs(before).max())


def jumps(problem, name, k, scale, least=1e-3, farthest=0.3, steps=6000):
    """Relative changes of one input where the outcome jumps by more than `least`, and the jumps.

    A step of the scan that moves a velocity so far is halved, again and again: a steep slope then
    becomes small, and a jump stays.
    """

    def after(parts):
        given = {field: np.tile(getattr(problem, field), (len(parts), 1)) for field in RANGES}
        given[name][:, k] += parts * scale
        return post_impact_velocities(**given, meeting=problem.meeting, excess="saturate")

    low, high = RANGES[name]
    parts = np.linspace(-farthest, farthest, steps + 1)
    reached = getattr(problem, name)[k] + parts * scale
    parts = parts[(low <= reached) & (reached <= high)]
    velocities = after(parts)
    largest = np.abs(velocities).max(axis=1)
    found = []
    for i in np.flatnonzero(np.abs(np.diff(velocities, axis=0)).max(axis=1) > least * largest[:-1]):
        (near, far), (begin, end) = parts[i : i + 2], velocities[i : i + 2]
        while far - near > 1e-12:
            half = 0.5 * (near + far)
            (middle,) = after(np.array([half]))
            if np.abs(middle - begin).max() > np.abs(end - middle).max():
                far, end = half, middle
            else:
                near, begin = half, middle
        jump = float(np.abs(end - begin).max() / np.abs(begin).max())
        if jump > least:
            found.append((float(far), jump))
    return found


# --- every chain finishes ----------------------------------------------------------------------

FAMILIES = (("within", 3), ("within", 6), ("saturate", 3), ("saturate", 6))
CHAINS = 25_000  # of each family


def any_chain(family, decades, index):
    """A chain of 2 to 8 balls, e and ratios often exactly 0 or 1 (or at their bounds)."""
    rng = np.random.default_rng([FAMILIES.index((family, decades)), index])
    n = int(rng.integers(2, 9))
    masses = magnitudes(rng, decades, n)
    some, falling = uniform(rng, -1, 1, n), np.sort(uniform(rng, -1, 1, n))[::-1]
    velocities = (some, falling, np.eye(n)[0])[rng.integers(3)]
    part = with_ends(rng)
    e = part((n - 1,))
    within = family == "within"
    ratios = within_bounds(masses, part) if within else [part((n - 2,)) for _ in range(2)]
    return case(masses, velocities, e, *ratios)


def longer_than(problem, steps):
    """Collisions, whether it collapsed, whether so many steps were too few; and what is open then.

    That is how much a velocity can still change, over the largest closing speed at the start.
    """
    try:
        found = outcomes(*problem[:5], excess="saturate", max_events=steps)
    except ImpactNotFinished as stopped:
        change = np.abs(stopped.bounds - stopped.trace.velocities).max()
        closing = max(a - b for a, b in pairwise(problem.velocities))
        return int(stopped.trace.collisions.sum()), False, True, change / closing
    return int(found.collisions.sum()), bool(found.collapsed), False, 0.0
