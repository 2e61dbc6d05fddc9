"""Contact forces: chains of springs in their own units, each followed as finely as is asked for."""

from __future__ import annotations

import math
import threading
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from cradle.chain import Chain
from cradle.input.values import (
    Vector,
    checked,
    checked_masses,
    one_number,
    refusal,
    refuse_overflow,
    refuse_where,
)
from cradle.kernel.kinks import Forces, Law
from cradle.kernel.state import ENERGY, FINISHED, LEDGER, MOMENTUM, ORDER, REFUSED, UNFINISHED
from cradle.models.batch import in_order, rows_of, shaped
from cradle.runtime.job import DEFECTS, LARGE
from cradle.runtime.springs import room, solve
from cradle.trace import ImpactNotCertified, ImpactNotFinished, Trace

#: Least and largest error that can be asked for; steps of one run after which it is given up.
FINEST, COARSEST, MOST_STEPS = 1e-12, 0.02, 20_000_000
_CHUNK, _FAINT = 2048, 0.01  # rows at once; what is too little to matter, over the accuracy
# A step times the largest frequency from which on a run shows whether it was short enough; a
# coarser one that only measures the frequency; and what it may measure too little.
_ENOUGH, _COARSE, _SPARE = 0.25, 0.5, 1.05
# Kinks of a contact and radians of the quickest ball, on average, from which on runs are compared.
_OFTEN, _LONG = 2.4, 30.0
_TRIALS = 16  # runs of a chain, each finer than the one before
_DAMPED = 0.5  # step times A times the square of a frequency, at most
_SMALLEST = 1e-9  # lightest ball and softest contact, as a part of the largest
# The longest time that counts in the losses, the widest gap and the narrowest, in contact times and
# depths; and the widest at which its last digit still is below this accuracy.
_LONGEST, _WIDEST, _NARROWEST, _BLURRED = 0.3, 1e9, 1e-12, 1e13
_TINY = 1e-300  # the least depth, and one over the largest


class Problem(NamedTuple):
    """Chains, a row for each or one for all, and the law of their contacts."""

    m: Vector
    v: Vector
    k: Vector
    loss: Vector
    gap: Vector
    p: float
    accuracy: float

    def own(self, timed: bool = False) -> tuple[Forces, Vector, Vector, Vector]:
        """Return the chains in their own units; and mass, speed and length, (rows, 1).

        These are those of the contact that closes fastest; the speed is 1 if none closes.  The
        length is 1 where nobody asks for it.
        """
        rows, n = max(map(len, self[:5])), self.m.shape[1]
        m, v = (np.broadcast_to(part, (rows, n)) for part in self[:2])
        k, loss, gap = (np.broadcast_to(part, (rows, n - 1)) for part in self[2:5])
        u = v[:, :-1] - v[:, 1:]
        at = u.argmax(axis=-1)[:, None]
        ball, left, right, unit = (
            np.take_along_axis(x, i, -1) for x, i in ((v, at), (m, at), (m, at + 1), (k, at))
        )
        speed, mass = np.take_along_axis(u, at, -1), left / (left + right) * right
        speed = np.where(speed > 0.0, speed, 1.0)
        length = np.ones_like(speed)
        if timed or loss.any() or gap.any():
            with np.errstate(divide="ignore", over="ignore"):
                energy = np.log(mass) + 2.0 * np.log(speed) - np.log(unit)
                length = np.exp(energy / (self.p + 1.0))
        w, v, k = mass / m, (v - ball) / speed, k / unit
        own = Forces(w, v, k, loss * (speed / length), -gap / length, speed[:, 0])
        return own, mass, speed, length


class Solved(NamedTuple):
    """What chains come to, in their own units, and how."""

    v: Vector
    error: Vector  # estimate, relative to the fastest closing
    h: Vector  # the last step
    steps: Any  # of all runs
    defect: Any  # what an outcome breaks, 0 for nothing; or, below zero, why it was not reached


def exponent_and_accuracy(exponent: float, accuracy: float) -> tuple[float, float]:
    """Return both, within their ranges."""
    rule = f"must lie in [{FINEST}, {COARSEST}]"
    p = one_number("exponent", exponent, "must lie in [1, 10]", 1.0, 10.0)
    return p, one_number("accuracy", accuracy, rule, FINEST, COARSEST)


def law_of(chains: Forces, p: float, accuracy: float, most: int = MOST_STEPS) -> Law:
    """Return how chains are to be run."""
    lossy, leans = bool(chains.loss.any()), bool((chains.d > 0.0).any())
    if leans:  # balls that strings hold together after all swing for ever
        most = min(most, int(2e4 / accuracy**0.25))
    return Law(p, accuracy * _FAINT, most, lossy, leans)


def run(chains: Forces, law: Law, large: bool = False, stop: Any = None) -> Solved:
    """Run chains, each as finely as needed.

    The step bounds the error where a contact collides about once and loses nothing: measured on
    random chains, it was C (h omega)^4, at very small steps K (h omega)^3.5.  Balls that collide
    again and again amplify it, and losses add to it: then runs with h, h / 2 ... tell.
    """
    (count, n), lossy, accuracy = chains.v.shape, law.lossy, law.slow / _FAINT
    c = 0.03 + 0.94 * max(0.0, 1.5 - law.p)
    eta = min((accuracy / c) ** 0.25, (4.0 * accuracy / c) ** (1.0 / 3.5), 0.6)
    eta = min(1.6 * eta, 0.6) if lossy else eta
    worst = np.maximum(chains.loss.max(axis=-1), 1e-300)
    top, first = _highest(chains, law.p), eta if eta >= _ENOUGH else _COARSE
    h = np.minimum(first / np.sqrt(top), _DAMPED / (worst * top))
    out = Solved(chains.v.copy(), np.zeros(count), h, *np.zeros((2, count), np.int64))
    before, changes = np.full((count, n), np.inf), np.full(count, np.inf if lossy else 0.0)
    todo = np.flatnonzero((chains.v[:, :-1] > chains.v[:, 1:]).any(axis=-1))
    for _ in range(_TRIALS):
        if not todo.size:
            return out._replace(defect=_defects(chains, law, out))
        part = chains if todo.size == count else Forces(*(array[todo] for array in chains))
        moved, h = room(todo.size, n), out.h[todo]
        at, status = solve(part._replace(h=h), law, moved, large, stop)
        out.v[todo] = moved.v
        out.steps[todo] += moved.steps
        if status != FINISHED:
            todo = todo[at:]
            break
        phase = h * np.sqrt(moved.top)
        off = phase / eta
        fine = off <= 1.0
        # The run before may have been near by luck: its own change counts too, with losses always.
        change = (2.0 if lossy else 0.5) * abs(moved.v - before[todo]).max(axis=-1) / accuracy
        told = np.maximum(change, 0.25 * changes[todo])
        changes[todo] = np.where(np.isfinite(change) | lossy, change, 0.0)
        before[todo] = np.where(fine[:, None], moved.v, np.inf)
        many = (moved.kinks > _OFTEN * (n - 1)) | (moved.steps * phase > _LONG * (n - 1))
        compare = fine & (lossy | many)
        error = np.where(compare, np.maximum(off**4, told), off**4)
        out.error[todo] = accuracy * error
        h = np.where(fine, 0.5 * h, h / (off * _SPARE))
        again = error > 1.0
        todo, h, top = todo[again], h[again], moved.top[again]
        out.h[todo] = np.minimum(h, _DAMPED / (worst[todo] * top))
    out.defect[todo[0]] = -UNFINISHED
    return out


def _defects(chains: Forces, law: Law, out: Solved) -> Any:
    """Return what each outcome breaks, or 0: momentum, order, energy."""
    m, accuracy = 1.0 / chains.w, law.slow / _FAINT
    mean = (m * chains.v).sum(axis=-1, keepdims=True) / m.sum(axis=-1, keepdims=True)
    before, after = chains.v - mean, out.v - mean
    change, rounding = after - before, 2.0**-52 * (64.0 + out.steps)
    size = (m * (abs(after) + abs(before))).sum(axis=-1)
    gained = (m * change * 0.5 * (after + before)).sum(axis=-1)
    slack = accuracy * size + rounding * (m * before * before).sum(axis=-1)
    defect = np.where(gained <= slack, 0, ENERGY)
    if not (law.lossy or law.leans):
        defect[~(gained >= -slack)] = LEDGER
    defect[~(abs((m * change).sum(axis=-1)) <= rounding * size)] = MOMENTUM
    defect[~(np.diff(out.v) >= -law.slow).all(axis=-1)] = ORDER
    return defect


def _highest(chains: Forces, p: float) -> Vector:
    """Return a bound of the square of a ball's frequency, from the energy of its contacts.

    Two contacts store at most all the energy E there is, so p (k d^(p - 1) + k' d'^(p - 1)) is at
    most p (k + k')^(2 / (p + 1)) ((p + 1) E)^((p - 1) / (p + 1)), by Hoelder's inequality.
    """
    m = 1.0 / chains.w
    mean = (m * chains.v).sum(axis=-1, keepdims=True) / m.sum(axis=-1, keepdims=True)
    stored = (chains.k * np.maximum(chains.d, 0.0) ** (p + 1.0)).sum(axis=-1) / (p + 1.0)
    energy = 0.5 * (m * (chains.v - mean) ** 2).sum(axis=-1) + stored
    both = np.zeros(m.shape)
    both[:, 1:] += chains.k
    both[:, :-1] += chains.k
    part = (both ** (2.0 / (p + 1.0)) * chains.w).max(axis=-1)
    most = p * part * ((p + 1.0) * energy) ** ((p - 1.0) / (p + 1.0))
    return np.where(most > 0.0, most, 1.0)


def admit(problem: Problem) -> None:
    """Raise if a value is outside its limits."""
    m = checked_masses(problem.m)
    v = checked("velocities", problem.v)
    k = checked("stiffness", problem.k, "must be above 0", 0.0, open_low=True)
    checked("viscosity", problem.loss, "must be at least 0", 0.0)
    checked("gaps", problem.gap)
    if m.size and v.size:
        refuse_overflow(v, m)
        largest = ("masses", m, "heaviest ball"), ("stiffness", k, "stiffest contact")
        for name, array, of in largest:
            small = array < _SMALLEST * array.max(axis=-1, keepdims=True)
            rule = f"must be at least {_SMALLEST} of the {of} of its chain"
            refuse_where(name, array, small, rule)


def beyond(problem: Problem, own: tuple[Forces, Vector, Vector, Vector]) -> list[Any]:
    """Return names, values, where they are too small or large in their chain's units, and rules."""
    (_, _, _, loss, d, _), mass, _, length = own
    most = min(_WIDEST, _BLURRED * problem.accuracy)
    far = ~((mass > 0.0) & (length >= _TINY) & (length <= 1.0 / _TINY)) | np.isnan(d)
    of, k, gap = "the depth of the fastest closing", problem.k, problem.gap
    late = f"must be at most {_LONGEST} contact times, depth over speed of the fastest closing"
    return [
        ("stiffness", k, far, "a contact's time is beyond floats: choose other units"),
        ("viscosity", problem.loss, loss > _LONGEST, late),
        ("gaps", gap, -d > most, f"must be at most {most:g} times {of} at this accuracy"),
        ("gaps", gap, (d != 0.0) & (abs(d) < _NARROWEST), f"must be 0, or {_NARROWEST} of {of}"),
        ("gaps", gap, d > 1.0, f"must be a lean of at most {of}"),
    ]


def refuse_beyond(problem: Problem, own: Any, at: tuple[int, ...] = ()) -> None:
    """Raise if something of a chain, the only row, cannot be resolved; `at` is its place."""
    for name, values, wrong, rule in beyond(problem, own):
        if wrong.any():
            c = int(wrong[0].argmax())
            raise refusal(name, (*at, c), f" = {float(values[0, c])!r}; {rule}")


def refuse(problem: Problem, defect: int, reached: Vector, model: Any = None) -> NoReturn:
    """Raise for a chain, the only row, that was not finished, or not certified."""
    m, v, k, *law = (row[0] for row in problem[:5])
    chain, names = Chain(m, v), ("stiffness", "viscosity", "gaps", "exponent", "accuracy")
    values = (*(row.tolist() for row in (k, *law)), *problem[5:])
    model = model or dict(zip(names, values, strict=True))
    if defect > 0:
        raise ImpactNotCertified(chain, model, DEFECTS[defect])
    none, impulses = np.zeros(len(m) - 1), np.cumsum(m * (v - reached))[:-1]
    c = int(np.argmax(k / np.minimum(m[:-1], m[1:])))
    held = "; or leans hold balls together" if (law[1] < 0.0).any() else ""
    raise ImpactNotFinished(
        f"the impact was not finished: contact {c}, the quickest of the springs, makes the steps "
        f"short; or balls that collide often amplify errors, and finer runs do not agree{held}",
        Trace(
            chain, model, reached, impulses, none, none.astype(np.int64), np.array([v, reached]),
            np.array([none, impulses]), (), left_out=1,
        ),
    )  # fmt: skip


def spring_velocities(
    masses: ArrayLike,
    velocities: ArrayLike,
    stiffness: ArrayLike = 1.0,
    *,
    exponent: float = 1.5,
    viscosity: ArrayLike = 0.0,
    gaps: ArrayLike = 0.0,
    accuracy: float = 1e-3,
    progress: bool = False,
) -> Vector:
    """Post-impact velocities of many chains of balls on springs; leading axes broadcast.

    Each contact pushes with k (d^p + A d(d^p)/dt) while that is above zero, d its compression:
    p = 3/2 is the contact of two spheres, elastic or viscoelastic.  The velocities depend on the
    ratios of the stiffnesses alone where there are neither losses nor gaps.

    Parameters
    ----------
    masses, velocities : array_like, shape (..., N)
        kg and m/s.
    stiffness : array_like, shape (..., N - 1) or ()
        k, N/m^p; above 0.
    exponent : float
        p, from 1 to 10.
    viscosity : array_like, shape (..., N - 1) or ()
        A, s; 0 for an elastic contact.  Two spheres lose the more the faster they collide.
    gaps : array_like, shape (..., N - 1) or ()
        Distance of two balls before the impact, m; it closes before the contact pushes.  Below
        zero a lean: how far the strings press the two together at rest.  Their pull stays what it
        is until the last contact has opened.
    accuracy : float
        Largest error of a velocity, relative to the fastest closing; from 1e-12 to 0.02.  It is
        estimated and met, not proven.
    progress : bool
        Show a progress bar.

    Returns
    -------
    ndarray, shape (..., N)
        Velocities after the impact, m/s.

    Raises
    ------
    ValueError
        If a value or a shape is wrong, or too small or large beside the others to be resolved; the
        message names the first value and the rule.
    ImpactNotFinished
        If an impact takes more than twenty million steps, or finer and finer runs do not agree, or
        leans hold balls together.
    ImpactNotCertified
        If an outcome breaks momentum, energy or order.

    References
    ----------
    Hinch and Saint-Jean, Proc. R. Soc. A 455 (1999) 3201-3220; Brilliantov, Spahn, Hertzsch and
    Poeschel, Phys. Rev. E 53 (1996) 5382-5392.

    Examples
    --------
    Five equal elastic spheres; and with gaps of a tenth of the compression and losses:

    >>> spring_velocities([1] * 5, [1, 0, 0, 0, 0], accuracy=1e-6).round(4)
    array([-0.0711, -0.0303, -0.0145,  0.127 ,  0.9888])
    >>> spring_velocities([1] * 5, [1, 0, 0, 0, 0], viscosity=0.05, gaps=0.1).round(2)
    array([-0.  ,  0.02,  0.03,  0.1 ,  0.85])
    """
    p, accuracy = exponent_and_accuracy(exponent, accuracy)
    given = {"masses": masses, "velocities": velocities, "stiffness": stiffness}
    given |= {"viscosity": viscosity, "gaps": gaps}
    arrays, lead = shaped(given, (0, 0, 1, 1, 1))
    m, v, k, loss, gap = arrays
    admit(Problem(m, v, k, loss, gap, p, accuracy))
    n, count = m.shape[-1], math.prod(lead)
    out = np.empty((count, n))

    def problem(rows: slice) -> Problem:
        m, v, k, loss, gap = (rows_of(array, lead, rows) for array in arrays)
        return Problem(m, v, k, loss, gap, p, accuracy)

    def run_chunk(begin: int, stop: threading.Event | None = None) -> tuple[int, int]:
        """Solve the chunk of chains that begins there; return a defect, and where."""
        rows = slice(begin, min(begin + _CHUNK, count))
        part = problem(rows)
        own = forces, _, speed, _ = part.own()
        wrong = np.any([where.any(axis=-1) for _, _, where, _ in beyond(part, own)], axis=0)
        if wrong.any():
            return -REFUSED, begin + int(wrong.argmax())
        found = run(forces, law_of(forces, p, accuracy), count * n >= LARGE, stop)
        out[rows] = part.v + speed * (found.v - forces.v)
        at = int((found.defect != 0).argmax())
        return int(found.defect[at]), begin + at

    for defect, at in in_order(run_chunk, range(0, count, _CHUNK), progress):
        if defect:
            one = problem(slice(at, at + 1))
            refuse_beyond(one, one.own(), tuple(map(int, np.unravel_index(at, lead))))
            refuse(one, defect, out[at])
    return out.reshape(*lead, n)
