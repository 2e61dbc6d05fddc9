"""Chains of springs: the contact forces, and the one model here that has a time."""

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cradle.chain import Chain
from cradle.input import values as asked
from cradle.input.values import ArrayLike, Vector
from cradle.kernel.kinks import Law, Springs
from cradle.kernel.state import FINISHED, REFUSED, UNFINISHED, UNSOUND
from cradle.models.batch import fail, in_order, rows_of
from cradle.models.springs import COARSEST, FINEST, MOST_STEPS, TimedTrace, refused
from cradle.runtime.job import DEFECTS, LARGE, follow, motions
from cradle.trace import ImpactNotCertified, ImpactNotFinished, Trace

# What is asked of the parameters: a rule, limits, whether the lower one is excluded; of contacts,
_RULES = {
    "stiffness": asked.ABOVE_ZERO,
    "viscosity": ("must be at least 0", 0.0, np.inf, False),
    "gaps": ("must be finite", -np.inf, np.inf, False),
}
# and of the whole chain; the laws of loss.
DAMPING = "viscoelastic", "hunt-crossley"
_EXPONENT = "must lie in [1, 10]", 1.0, 10.0
_ACCURACY = f"must lie in [{FINEST:g}, {COARSEST:g}]", FINEST, COARSEST
_CHUNK = 2048  # chains at once


@dataclass(frozen=True)
class SpringChain:
    """Balls on massless springs (equations 7-11): the contact forces, followed in time.

    The laws of force are those of `spring_velocities`.  In the trace, `absorbed` is the energy that
    a contact stores at each maximum of its compression, less that at the start or minimum before.
    Speeds below ``accuracy / 100`` of the fastest closing speed count as none, so how often balls
    touch very gently depends on the accuracy.  With leans, impulses leave out the strings' pull.

    Parameters
    ----------
    stiffness, exponent, viscosity, gaps, damping, accuracy
        As for `spring_velocities`, for one chain.  Times and forces need the true stiffness.
    max_steps : int
        Number of steps after which the impact is given up.

    Raises
    ------
    ValueError, ImpactNotFinished, ImpactNotCertified
        As for `spring_velocities`; a ValueError also if the chain has a restitution below 1.

    Examples
    --------
    >>> from cradle import Chain, SpringChain, collide
    >>> collide(Chain([1, 1, 1], [1, 0, 0]), SpringChain()).velocities.round(6)
    array([-0.070952,  0.076403,  0.994549])
    """

    stiffness: float | Sequence[float] = 1.0
    exponent: float = 1.5
    viscosity: float | Sequence[float] = field(default=0.0, kw_only=True)
    gaps: float | Sequence[float] = field(default=0.0, kw_only=True)
    damping: str = field(default=DAMPING[0], kw_only=True)
    accuracy: float = field(default=1e-9, kw_only=True)
    max_steps: int = field(default=MOST_STEPS, kw_only=True)

    def __post_init__(self) -> None:
        vars(self)["exponent"] = asked.one_number("exponent", self.exponent, *_EXPONENT)
        vars(self)["accuracy"] = asked.one_number("accuracy", self.accuracy, *_ACCURACY)
        for name, rules in _RULES.items():
            vars(self)[name] = asked.number_or_row(name, getattr(self, name), "N - 1", *rules)
        asked.one_of("damping", self.damping, DAMPING)
        vars(self)["max_steps"] = asked.whole_number("max_steps", self.max_steps)

    def solve(self, chain: Chain, *, once: bool = False, progress: bool = False) -> TimedTrace:
        """Solve the impact of `chain`; see `collide`.  `once`: until all contacts have opened."""
        n = len(asked.must_be(Chain, "chain", chain))
        rule = "must be 1 for SpringChain, whose losses are its viscosity: see viscosity_from"
        asked.refuse_where("restitution", chain.restitution, chain.restitution < 1.0, rule)
        contacts = (asked.row_of(name, getattr(self, name), n - 1, n) for name in _RULES)
        # As arrays that may be written to: else all would be compiled a second time.
        row = Springs(*(row[None].copy() for row in (chain.masses, chain.velocities, *contacts)))
        hunt = self.damping == DAMPING[1]
        out = motions(1, n)
        law = Law(self.exponent, self.accuracy, float(self.max_steps), once, hunt)
        if progress:
            from tqdm import tqdm

            with tqdm(unit=" steps", delay=2.0) as bar:
                _, status, clock = follow(row, law, out, pause=lambda k: bar.update(k - bar.n))
        else:
            _, status, clock = follow(row, law, out)
        if status == REFUSED:
            raise refused(clock, law, [], row)
        if status == UNSOUND:
            raise ImpactNotCertified(chain, self, DEFECTS[int(clock["defect"])])
        if status == UNFINISHED:
            m, v, reached = chain.masses, chain.velocities, out.v[0]
            none, impulses = np.zeros(n - 1), np.cumsum(m * (v - reached))[:-1]
            c = np.argmax(self.stiffness / np.minimum(m[:-1], m[1:]))
            held = "; or leans hold balls together" if np.min(self.gaps) < 0.0 else ""
            told = (
                f"the impact was not finished (max_steps = {self.max_steps}): contact {c}, the "
                "quickest of the springs, makes the steps short; or balls that collide often "
                f"amplify errors, and finer runs do not agree: a coarser accuracy may do{held}"
            )
            ends = np.array([v, reached]), np.array([none, impulses]), ()
            path = Trace(chain, self, reached, impulses, none, none.astype(int), *ends, left_out=1)
            raise ImpactNotFinished(told, path)
        trace = object.__new__(TimedTrace)
        motion = {"evaluations": int(out.steps[0]), "error": float(out.error[0])}
        # The run that follows the way writes to the same room.
        vars(trace).update(chain=chain, model=self, velocities=out.v[0].copy(), **motion)
        vars(trace)["_ran"] = row, law, out
        return trace


def spring_velocities(
    masses: ArrayLike, velocities: ArrayLike, stiffness: ArrayLike = 1.0, *,
    exponent: float = 1.5, viscosity: ArrayLike = 0.0, gaps: ArrayLike = 0.0,
    damping: str = DAMPING[0], accuracy: float = 1e-3, progress: bool = False,
) -> Vector:  # fmt: skip
    """Post-impact velocities of many chains of balls on springs; leading axes broadcast.

    A contact whose balls are pressed together by the distance d pushes with k (d^p + A d(d^p)/dt),
    while that is above zero: p = 1 is a linear spring, p = 3/2 the contact of two spheres, elastic
    (A = 0) or viscoelastic.  By Hunt and Crossley it pushes with k d^p (1 + A dd/dt).  Without
    losses and gaps only ratios of stiffnesses matter.  `spring_outcomes` adds estimated errors.

    Parameters
    ----------
    masses, velocities : array_like, shape (..., N)
        Masses, kg, and velocities before the impact, m/s.
    stiffness, viscosity, gaps : array_like, shape (..., N - 1) or ()
        k, N/m^p, above 0; A, s, 0 for an elastic contact; and the distance of two balls before the
        impact, m.  With the speed u and the reduced mass m of the contact that closes fastest, the
        unit of compression is L = (m u^2 / k)^(1 / (p + 1)).  A is at most 10 L / u, and a gap
        matters if it is not small beside L.  A gap below zero, a lean, says how far strings press
        two balls together, at most L; they pull until no contact pushes, or swings by more than
        1e-7 of the fastest closing speed, and none closes.
    exponent : float
        p, from 1 to 10.
    damping : {"viscoelastic", "hunt-crossley"}
        The law of the losses.  By Hunt and Crossley A is in s/m, at most 10 / u.
    accuracy : float
        Largest estimated error of a velocity over the fastest closing speed, 1e-12 to 0.02.
    progress : bool
        Show a progress bar.

    Returns
    -------
    ndarray, shape (..., N)
        Velocities after the impact, m/s.

    Raises
    ------
    ValueError
        If a value or a shape is wrong, if values are too far apart to be resolved together, or if
        a contact would pull by Hunt and Crossley's law.
    ImpactNotFinished, ImpactNotCertified
        If a run takes over twenty million steps, finer runs do not agree, or leans hold balls
        together; if an outcome breaks momentum, or energy or order by more than `accuracy`.

    References
    ----------
    Hinch and Saint-Jean, Proc. R. Soc. A 455 (1999) 3201-3220; Brilliantov, Spahn, Hertzsch and
    Poeschel, Phys. Rev. E 53 (1996) 5382-5392.

    Examples
    --------
    >>> from cradle import spring_velocities
    >>> for law in {}, {"viscosity": 0.05, "gaps": 0.1}:  # elastic; with losses, a little apart
    ...     spring_velocities([1] * 5, [1, 0, 0, 0, 0], **law).round(3)
    array([-0.071, -0.03 , -0.014,  0.127,  0.989])
    array([-0.003,  0.023,  0.03 ,  0.101,  0.849])
    """
    return spring_outcomes(
        masses, velocities, stiffness, exponent=exponent, viscosity=viscosity, gaps=gaps,
        damping=damping, accuracy=accuracy, progress=progress,
    )[0]  # fmt: skip


def spring_outcomes(
    masses: ArrayLike, velocities: ArrayLike, stiffness: ArrayLike = 1.0, *,
    exponent: float = 1.5, viscosity: ArrayLike = 0.0, gaps: ArrayLike = 0.0,
    damping: str = DAMPING[0], accuracy: float = 1e-3, progress: bool = False,
) -> tuple[Vector, Vector]:  # fmt: skip
    """Velocities of many chains of balls on springs, and their estimated errors.

    Arguments and errors are those of `spring_velocities`.  Returned are the velocities, m/s, shape
    (..., N), and the estimated error of each chain, over its fastest closing speed, shape (...).

    Examples
    --------
    >>> from cradle import spring_outcomes
    >>> velocities, errors = spring_outcomes([1] * 3, [1, 0, 0], [[1, 1], [1, 9]])
    >>> velocities.shape, (errors < 1e-3).tolist()
    ((2, 3), [True, True])
    """
    p = asked.one_number("exponent", exponent, *_EXPONENT)
    accuracy = asked.one_number("accuracy", accuracy, *_ACCURACY)
    given = {"masses": masses, "velocities": velocities, "stiffness": stiffness}
    given |= {"viscosity": viscosity, "gaps": gaps}
    asked.one_of("damping", damping, DAMPING)
    arrays, lead = asked.shaped(given, (0, 0, 1, 1, 1))
    n, count = arrays[0].shape[-1], math.prod(lead)
    if count == 0:
        check_rows(arrays)
    law = Law(p, accuracy, float(MOST_STEPS), False, damping == DAMPING[1])
    out, error = np.empty((count, n)), np.empty(count)

    def run_chunk(rows: slice, stop: threading.Event | None = None) -> tuple[int, int]:
        """Solve these chains; return how the last of them ended, and where."""
        part = Springs(*(rows_of(array, lead, rows) for array in arrays))
        found = motions(rows.stop - rows.start, n)._replace(v=out[rows], error=error[rows])
        at, status, _ = follow(part, law, found, count * n >= LARGE, stop)
        return status, rows.start + at

    for status, at in in_order(run_chunk, count, _CHUNK, progress):
        if status == FINISHED:
            continue
        check_rows(arrays)
        row = Springs(*(rows_of(array, lead, slice(at, at + 1)) for array in arrays))
        place = [int(k) for k in np.unravel_index(at, lead)]
        if status == REFUSED:
            raise refused(follow(row, law, motions(1, n))[2], law, place, row)
        # Alone, it stops where it stopped here, and raises.
        m, v, k, loss, gap = (values[0] for values in row)
        model = SpringChain(k, p, viscosity=loss, gaps=gap, damping=damping, accuracy=accuracy)
        fail(model, Chain(m, v), place)
    return out.reshape(*lead, n), error.reshape(lead)


def hertz_stiffness(radii: ArrayLike, young: float = 210e9, poisson: float = 0.3) -> Vector:
    """Stiffness of the contacts of spheres by Hertz: 2/3 E / (1 - nu^2) (R R' / (R + R'))^(1/2).

    Parameters
    ----------
    radii : array_like, shape (..., N)
        R, m, above 0.
    young, poisson : float
        E, Pa, above 0, and nu, above -1 and at most 1/2; those of steel if left out.

    Returns
    -------
    ndarray, shape (..., N - 1)
        k, N/m^(3/2), for `SpringChain` and `spring_velocities` (Johnson, Contact Mechanics, 1985).

    Examples
    --------
    >>> from cradle import hertz_stiffness
    >>> [f"{k:.3g}" for k in hertz_stiffness([0.01, 0.01, 0.02])]  # steel balls
    ['1.09e+10', '1.26e+10']
    """
    r = asked.checked("radii", radii, *asked.ABOVE_ZERO)
    if r.ndim == 0 or r.shape[-1] < 2:
        raise ValueError(f"radii has shape {r.shape}; must be (..., N), of two balls or more")
    e = asked.one_number("young", young, *asked.ABOVE_ZERO)
    nu = asked.one_number("poisson", poisson, "must be above -1 and at most 0.5", -1.0, 0.5, True)
    half = r[..., :-1] / (r[..., :-1] + r[..., 1:]) * r[..., 1:]
    return np.asarray(2.0 / 3.0 * e / (1.0 - nu * nu) * np.sqrt(half))


def check_rows(arrays: Sequence[Vector]) -> None:
    """Raise at the first value that has no meaning."""
    asked.refuse_overflow(asked.checked("velocities", arrays[1]), asked.checked_masses(arrays[0]))
    for (name, rules), values in zip(_RULES.items(), arrays[2:], strict=True):
        asked.checked(name, values, *rules)
