"""The paper's model: one Impulse Correlation Ratio at each interior ball and direction."""

from __future__ import annotations

import itertools
import math
import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cradle.chain import (
    Chain,
    Vector,
    checked,
    checked_masses,
    numbers,
    one_number,
    refuse_overflow,
)
from cradle.closed_form import largest_ratios
from cradle.drive import DEFECTS, FINISHED, LARGE, REFUSED, UNFINISHED, UNSOUND, Job
from cradle.kernel import Inputs, Options
from cradle.kernel.state import LIMITS
from cradle.trace import Event, ImpactNotCertified, ImpactNotFinished, Trace

#: Steps after which an impact is given up, unless told otherwise.
MAX_EVENTS = 5_000_000

# Numbers that a path may hold unless it is asked for in full: 80 MB.
_MOST_NUMBERS = 10_000_000
_EVERY = 2**40


def _most_events(n: int) -> int:
    return max(_MOST_NUMBERS // n, 1000)


_KINDS = ("maximum_compression", "end", "close", "collapse")


@dataclass(frozen=True)
class ImpulseCorrelation:
    """Impulse Correlation Ratio and energetic restitution (Ceanga and Hurmuzlu).

    At an interior ball the impulse of the driven contact grows in proportion to that of the
    contact that drives it.  Every contact ends when it has given back the part e^2 of the work it
    absorbed.  Between events all velocities are linear in the impulses, so the impact is solved
    event by event, without a step size.

    Parameters
    ----------
    forward : float or sequence, length N - 2
        Ratio at each interior ball when its left contact drives its right one.
    backward : float or sequence, length N - 2, optional
        The same when the right contact drives the left one; as `forward` if left out.
    meeting : float
        Where two balls meet that are driven towards each other by separate collisions, as a part
        of the overlap of their velocities; 1/2 is the paper's midpoint.
    excess : {"raise", "saturate"}
        What to do with a ratio above its bound (Eq. 53): refuse it, or accept it and hold the
        contact closed while the ratio would open it.
    max_events : int
        Largest number of steps before the impact is given up.

    Raises
    ------
    ValueError
        If a value is outside its range; the message names the value and the rule.

    References
    ----------
    Ceanga and Hurmuzlu, J. Appl. Mech. 68 (2001) 575-583, Eqs. 16, 47-53.

    Examples
    --------
    >>> from cradle import Chain, collide
    >>> model = ImpulseCorrelation(forward=0.15)
    >>> collide(Chain([1, 1, 1], [1, 0, 0], [1, 1]), model).velocities.round(4).tolist()
    [-0.0811, 0.0883, 0.9928]
    """

    forward: float | tuple[float, ...]
    backward: float | tuple[float, ...] | None = None
    meeting: float = 0.5
    excess: str = "raise"
    max_events: int = MAX_EVENTS

    def __init__(
        self,
        forward: ArrayLike,
        backward: ArrayLike | None = None,
        *,
        meeting: float = 0.5,
        excess: str = "raise",
        max_events: int = MAX_EVENTS,
    ) -> None:
        _check_options(meeting, excess, max_events)
        for name, ratios in (("forward", forward), ("backward", backward)):
            value = None
            if ratios is not None or name == "forward":
                array = _checked_ratios(name, ratios)
                if array.ndim > 1:
                    raise ValueError(f"{name} has shape {array.shape}; must be () or (N - 2,)")
                value = tuple(array.tolist()) if array.ndim else float(array)
            object.__setattr__(self, name, value)
        object.__setattr__(self, "meeting", float(meeting))
        object.__setattr__(self, "excess", excess)
        object.__setattr__(self, "max_events", int(max_events))

    def solve(self, chain: Chain, *, record: bool | None = None) -> Trace:
        """Solve the impact of `chain`; see `collide`."""
        n = len(chain)
        ratios: list[Vector] = []
        for name in ("forward", "backward"):
            given = getattr(self, name)
            if given is None:
                ratios.append(ratios[0])
                continue
            if np.ndim(given) and len(given) != n - 2:
                raise ValueError(
                    f"{name} has {len(given)} values; {n} balls need {n - 2}, or one number"
                )
            ratios.append(np.broadcast_to(np.asarray(given), (n - 2,)).astype(np.float64))
        if self.excess == "raise":
            _refuse_excess(chain.masses, *ratios)

        inputs = Inputs(
            *(part[None].copy() for part in (chain.masses, chain.velocities, chain.restitution)),
            *(part[None] for part in ratios),
        )
        room = _most_events(n) if record is None else _EVERY if record else 0
        job = Job(inputs, 1, Options(self.meeting, self.max_events, False, True), room).run()
        trace = self._trace(chain, job)
        if job.status == UNFINISHED:
            v = trace.velocities
            raise ImpactNotFinished(
                f"the impact was not finished after max_events = {self.max_events} steps, "
                f"{job.tally.events} events; closing speeds so far {(v[:-1] - v[1:]).tolist()}",
                trace,
            )
        if job.status == UNSOUND:
            raise ImpactNotCertified(chain, self, DEFECTS[int(job.tally.defect)])
        return trace

    def _trace(self, chain: Chain, job: Job) -> Trace:
        """Return what the event loop left."""
        results, written = job.outputs, job.record
        kept = min(int(job.tally.events), len(written.kinds))
        kinds, contacts = written.kinds[:kept].tolist(), written.contacts[:kept].tolist()
        return Trace(
            chain=chain,
            model=self,
            velocities=results.v[0],
            impulses=results.p,
            absorbed=results.a,
            collisions=results.hits[0],
            path=written.velocities[: kept + 1],
            path_impulses=written.impulses[: kept + 1],
            events=tuple(Event(_KINDS[k], c) for k, c in zip(kinds, contacts, strict=True)),
            collapsed=bool(results.collapsed[0]),
            saturated=tuple(np.flatnonzero(results.held).tolist()),
        )


def post_impact_velocities(
    masses: ArrayLike,
    velocities: ArrayLike,
    restitution: ArrayLike,
    forward: ArrayLike,
    backward: ArrayLike | None = None,
    *,
    meeting: float = 0.5,
    excess: str = "raise",
    max_events: int = MAX_EVENTS,
    progress: bool = False,
) -> Vector:
    """Post-impact velocities of many chains of N balls at once; leading axes broadcast.

    The same event loop as `collide` with `ImpulseCorrelation`, without the record; two balls, and
    three that collide once each, take the closed form instead.  Compiled, some
    thousands of chains and more are shared out to all processors.

    Parameters
    ----------
    masses, velocities : array_like, shape (..., N)
        kg and m/s.
    restitution : array_like, shape (..., N - 1) or ()
        Energetic coefficients of restitution.
    forward, backward : array_like, shape (..., N - 2) or ()
        Ratios; `backward` as `forward` if left out.
    meeting, excess, max_events
        As for `ImpulseCorrelation`.
    progress : bool
        Show a progress bar.

    Returns
    -------
    ndarray, shape (..., N)
        Velocities after the impact, m/s.

    Raises
    ------
    ValueError
        If a value or a shape is wrong; the message names the first value and the rule.
    ImpactNotFinished
        If an impact takes more than `max_events` steps; `trace` is that of the first such chain.

    References
    ----------
    Ceanga and Hurmuzlu, J. Appl. Mech. 68 (2001) 575-583.

    Examples
    --------
    The two ends of Fig. 4 in one call:

    >>> post_impact_velocities([1, 1, 1], [1, 0, 0], 1, [[0.0], [0.5]]).round(3)
    array([[ 0.   ,  0.   ,  1.   ],
           [-0.333,  0.667,  0.667]])
    """
    return outcomes(
        masses,
        velocities,
        restitution,
        forward,
        backward,
        meeting=meeting,
        excess=excess,
        max_events=max_events,
        progress=progress,
    ).velocities


class Outcomes(NamedTuple):
    """What a batch of impacts leaves.

    Examples
    --------
    >>> outcomes([100, 1, 100], [1, 0, 0], 1, 0.15).collisions.tolist()
    [10, 10]
    """

    #: Velocities after the impact, shape (..., N), m/s.
    velocities: Vector
    #: How often each contact became active, shape (..., N - 1); before the limit, if collapsed.
    collisions: NDArray[np.int64]
    #: Whether an infinite sequence of impacts was taken to its limit, shape (...).
    collapsed: NDArray[np.bool_]


def outcomes(
    masses: ArrayLike,
    velocities: ArrayLike,
    restitution: ArrayLike,
    forward: ArrayLike,
    backward: ArrayLike | None = None,
    *,
    meeting: float = 0.5,
    excess: str = "raise",
    max_events: int = MAX_EVENTS,
    progress: bool = False,
) -> Outcomes:
    """Solve many chains of N balls at once, and count their collisions too.

    Parameters
    ----------
    masses, velocities, restitution, forward, backward, meeting, excess, max_events, progress
        As for `post_impact_velocities`.

    Returns
    -------
    Outcomes
        Velocities, collisions and collapses.

    Raises
    ------
    ValueError, ImpactNotFinished
        As `post_impact_velocities`.

    References
    ----------
    Ceanga and Hurmuzlu, J. Appl. Mech. 68 (2001) 575-583; Fig. 6 is a map of such counts.

    Examples
    --------
    >>> outcomes([1, 1, 1], [1, 0, 0], [[1, 1], [0, 0]], 0).collapsed.tolist()
    [False, True]
    """
    _check_options(meeting, excess, max_events)
    given = {
        "masses": masses,
        "velocities": velocities,
        "restitution": restitution,
        "forward": forward,
        "backward": forward if backward is None else backward,
    }
    # Whether these are in range is checked by the kernel.
    arrays = [numbers(name, values) for name, values in given.items()]
    n = arrays[0].shape[-1] if arrays[0].ndim else 0
    if n < 2:
        raise ValueError(f"masses has shape {arrays[0].shape}; must be (..., N) with N >= 2")
    if arrays[1].shape[-1:] != (n,):
        raise ValueError(f"velocities has shape {arrays[1].shape}; must be (..., {n}), as masses")
    for k, size in ((2, n - 1), (3, n - 2), (4, n - 2)):
        if arrays[k].ndim == 0:
            arrays[k] = np.full(size, arrays[k])
        elif arrays[k].shape[-1] != size:
            raise ValueError(
                f"{list(given)[k]} has shape {arrays[k].shape}; "
                f"must be () or (..., {size}) for {n} balls"
            )
    try:
        lead = np.broadcast_shapes(*(array.shape[:-1] for array in arrays))
    except ValueError:
        shapes = ", ".join(f"{name} {a.shape}" for name, a in zip(given, arrays, strict=True))
        raise ValueError(f"leading axes do not broadcast: {shapes}") from None

    count, chunk = math.prod(lead), _chunk(n)
    if count == 0:
        _check(given, excess)
    out = np.empty((count, n))
    hits = np.empty((count, n - 1), dtype=np.int64)
    collapsed = np.empty(count, dtype=np.int64)
    options = Options(float(meeting), int(max_events), excess == "raise", False)
    large = count * n >= LARGE

    def solve(begin: int, stop: threading.Event) -> Job:
        """Solve the chunk of chains that begins there."""
        rows = slice(begin, min(begin + chunk, count))
        part = Inputs(*(_rows(array, lead, rows) for array in arrays))
        job = Job(part, rows.stop - begin, options, large=large).run(stop)
        out[rows], hits[rows], collapsed[rows] = job.outputs[:3]
        return job

    starts = range(0, count, chunk)
    # At the first failure in the order of the chains; none has been returned before.
    for begin, job in zip(starts, _in_order(solve, starts, progress), strict=True):
        if job.status == REFUSED:
            _check(given, excess)
            raise AssertionError("the kernel refused chains that the checks admit")
        if job.status != FINISHED:
            failed = begin + job.next
            # Alone, with its record; it stops where it stopped here, and raises.
            m, v, e, f, b = (_rows(array, lead, slice(failed, failed + 1))[0] for array in arrays)
            model = ImpulseCorrelation(
                f, b, meeting=meeting, excess="saturate", max_events=max_events
            )
            model.solve(Chain(m, v, e))
    return Outcomes(out.reshape(*lead, n), hits.reshape(*lead, n - 1), collapsed.reshape(lead) != 0)


def _in_order(
    solve: Callable[[int, threading.Event], Job], starts: range, progress: bool
) -> Iterable[Job]:
    """Yield the results of `solve` in order, made by as many threads as there are processors."""
    stop = threading.Event()
    if progress:
        from tqdm.auto import tqdm

        with tqdm(total=len(starts), unit="chunk") as bar:
            for job in _in_order(solve, starts, progress=False):
                bar.update()
                yield job
    elif (workers := min(len(starts), os.cpu_count() or 1)) < 2:
        yield from (solve(begin, stop) for begin in starts)
    else:
        with ThreadPoolExecutor(workers) as pool:
            try:
                yield from pool.map(solve, starts, itertools.repeat(stop))
            finally:
                stop.set()
                pool.shutdown(cancel_futures=True)


def _chunk(n: int) -> int:
    """Return how many chains of n balls are solved at a time, more where they may be short cuts.

    So much memory is needed beyond inputs and outputs.
    """
    return 16_384 if n <= 3 else 4096


def _check(given: dict[str, ArrayLike], excess: str) -> None:
    """Raise if a value is outside its limits: what the kernel checks, and in words."""
    m = checked_masses(given["masses"])
    v = checked("velocities", given["velocities"])
    checked("restitution", given["restitution"], "must lie in [0, 1]", 0.0, 1.0)
    f, b = (_checked_ratios(name, given[name]) for name in ("forward", "backward"))
    refuse_overflow(v, m)
    if excess == "raise":
        ends = m.shape[-1] - 2
        f, b = (np.broadcast_to(x, (ends,)) if x.ndim == 0 else x for x in (f, b))
        _refuse_excess(m, f, b)


def _rows(array: Vector, lead: tuple[int, ...], rows: slice) -> Vector:
    """Return some rows of `array` broadcast to the leading shape, or the one row that all share."""
    size = array.shape[-1]
    if array.size == size:
        part = array.reshape(1, size)
    elif array.shape[:-1] == lead and array.flags.c_contiguous:
        part = array.reshape(math.prod(lead), size)[rows]
    else:
        # Without making the others.
        full = np.broadcast_to(array, (*lead, size))
        return full[np.unravel_index(np.arange(rows.start, rows.stop), lead)]
    # Compiled code is made for arrays that may be written to; it writes to no input.
    return part if part.flags.writeable and part.flags.c_contiguous else part.copy()


def _checked_ratios(name: str, ratios: ArrayLike | None) -> Vector:
    return checked(name, ratios, "must lie in [0, 1]", 0.0, 1.0)


def _check_options(meeting: float, excess: str, max_events: int) -> None:
    # The usual options first: they cost a call for one chain less than the checks in full.
    if not (type(meeting) is float and 0.0 <= meeting <= 1.0):
        one_number("meeting", meeting, "must lie in [0, 1]", 0.0, 1.0)
    if not isinstance(excess, str) or excess not in ("raise", "saturate"):
        raise ValueError(f"excess = {excess!r}; must be 'raise' or 'saturate'")
    if isinstance(max_events, bool) or not isinstance(max_events, (int, np.integer)):
        raise ValueError(f"max_events = {max_events!r}; must be a whole number")
    if not 1 <= max_events < 2**63:
        raise ValueError(f"max_events = {max_events!r}; must be at least 1 and below 2**63")


def _refuse_excess(masses: Vector, forward: Vector, backward: Vector) -> None:
    """Raise if a ratio is above Eq. 53 or its mirror image, by more than a rounding error."""
    bounds = largest_ratios(masses, forward, backward)
    for name, ratios, bound in (("forward", forward, bounds[0]), ("backward", backward, bounds[1])):
        above = ratios > bound * LIMITS.rounded
        if above.any():
            at = np.unravel_index(int(np.argmax(above)), above.shape)
            ratio = float(np.broadcast_to(ratios, above.shape)[at])
            place = ", ".join(str(int(k)) for k in at)
            mirrored = "" if name == "forward" else ", mirrored"
            raise ValueError(
                f"{name}[{place}] = {ratio!r}; at ball {int(at[-1]) + 1}, counted from 0, it must "
                f"not exceed {float(bound[at]):.6g} (Eq. 53{mirrored}): a larger ratio would make "
                "a contact pull; excess='saturate' holds the contact closed instead"
            )
