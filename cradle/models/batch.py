"""Many chains at once by the paper's model: the outcome alone, on all processors."""

import itertools
import math
import os
import threading
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple, NoReturn

import numpy as np

from cradle.chain import Chain
from cradle.input.values import ArrayLike, NDArray, Vector, flag, shaped
from cradle.kernel import Inputs, Options, Outputs
from cradle.kernel.state import FINISHED, REFUSED
from cradle.models import correlation as paper
from cradle.runtime.job import LARGE, Job, outputs
from cradle.trace import ImpactNotCertified, ImpactNotFinished, compared_as_objects

CHUNK = 4096  #: Chains solved at a time, which bounds the memory.


def post_impact_velocities(
    masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike, forward: ArrayLike,
    backward: ArrayLike | None = None, *, meeting: float = 0.5, excess: str = "raise",
    max_events: int = paper.MAX_EVENTS, progress: bool = False,
) -> Vector:  # fmt: skip
    """Post-impact velocities of many chains of N balls at once; leading axes broadcast.

    The rule is that of `ImpulseCorrelation`.  No path is kept; `outcomes` returns margins as well.

    Parameters
    ----------
    masses, velocities : array_like, shape (..., N)
        Masses, kg, and velocities before the impact, m/s.
    restitution : array_like, shape (..., N - 1) or ()
        Energetic coefficients of restitution.
    forward, backward : array_like, shape (..., N - 2) or ()
        Ratios; `backward` equals `forward` if left out.  Several tiny ones are slow.
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
    ValueError, ImpactNotFinished, ImpactNotCertified
        If a shape or a value is wrong (the message tells its place); if an impact takes more than
        `max_events` steps (a note tells the place of the first such chain); or if an outcome fails
        the check that every answer has to pass.

    Examples
    --------
    >>> from cradle import post_impact_velocities
    >>> post_impact_velocities([1, 1, 1], [1, 0, 0], 1, [[0.0], [0.5]]).round(3)  # ends of Fig. 4
    array([[ 0.   ,  0.   ,  1.   ],
           [-0.333,  0.667,  0.667]])
    """
    return outcomes(
        masses, velocities, restitution, forward, backward,
        meeting=meeting, excess=excess, max_events=max_events, progress=progress,
    ).velocities  # fmt: skip


@compared_as_objects
class Outcomes(NamedTuple):
    """What `outcomes` returns: velocities after the impacts, collisions, margins."""

    velocities: Vector  #: Velocities after the impact, shape (..., N), m/s.
    collisions: NDArray[np.int64]  #: How often each contact became active, shape (..., N - 1).
    collapsed: NDArray[np.bool_]  #: Whether the impact was taken to a limit, shape (...).
    margin: Vector  #: As `Trace.margin`, shape (...).


def outcomes(
    masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike, forward: ArrayLike,
    backward: ArrayLike | None = None, *, meeting: float = 0.5, excess: str = "raise",
    max_events: int = paper.MAX_EVENTS, progress: bool = False,
) -> Outcomes:  # fmt: skip
    """Velocities, collisions and margins of many chains of N balls; leading axes broadcast.

    Arguments and errors are those of `post_impact_velocities`.

    Examples
    --------
    >>> from cradle import outcomes
    >>> found = outcomes([1, 1, 1], [1, 0, 0], [[1, 1], [0, 0]], 0)
    >>> found.collisions[0].tolist(), found.collapsed.tolist()  # Fig. 6 is a map of such counts
    ([1, 1], [False, True])
    """
    paper.check_options(meeting, excess, max_events)
    options = Options(float(meeting), int(max_events), excess == "raise")
    given = {"masses": masses, "velocities": velocities, "restitution": restitution}
    given |= {"forward": forward, "backward": forward if backward is None else backward}
    arrays, lead = shaped(given, (0, 0, 1, 2, 2))  # the kernel checks whether these are in range
    n, count = arrays[0].shape[-1], math.prod(lead)
    if count == 0 or n == 2:  # then no chain has a ratio, but one is given
        paper.check_values(options.bounded, *given.values())
    whole, large = outputs(count, n), count * n >= LARGE

    def solve(rows: slice, stop: threading.Event | None = None) -> tuple[int, int]:
        """Solve these chains; return how the last of them ended, and where."""
        part = Inputs(*(rows_of(array, lead, rows) for array in arrays))
        v, hits, collapsed, margin, *last = whole
        out = Outputs(v[rows], hits[rows], collapsed[rows], margin[rows], *last)
        job = Job(part, out, options, large=large).run(stop)
        # Not the job: its arrays would wait for those of the chunks before.
        return job.status, rows.start + job.next

    # At the first failure in the order of the chains; none has been returned before.
    for status, failed in in_order(solve, count, CHUNK, progress):
        if status == REFUSED:
            paper.raise_refused(options.bounded, *given.values())
        if status != FINISHED:
            # Alone, with its record; it stops where it stopped here, and raises.
            m, v, e, f, b = (rows_of(array, lead, slice(failed, failed + 1))[0] for array in arrays)
            model = paper.ImpulseCorrelation(
                f, b, meeting=meeting, excess="saturate", max_events=max_events
            )
            fail(model, Chain(m, v, e), np.unravel_index(failed, lead))
    v, hits, collapsed, margin = [x.reshape(lead + x.shape[1:]) for x in whole[:4]]
    return Outcomes(v, hits, collapsed.astype(bool), margin)


def fail(model: Any, chain: Chain, place: Sequence[Any]) -> NoReturn:
    """Raise what this chain of a batch raises alone, with a note of its place."""
    try:
        model.solve(chain)
    except ImpactNotFinished as error:
        if place:
            error.add_note(f"in the batch it is chain {[int(k) for k in place]}")
        raise
    raise ImpactNotCertified(chain, model, "among others it stops, alone it does not")


def in_order(
    solve: Callable[..., tuple[int, int]], count: int, size: int, progress: bool
) -> Iterable[tuple[int, int]]:
    """Solve chunks of that size on all processors; yield what `solve` returns, in order."""
    chunks = [slice(begin, min(begin + size, count)) for begin in range(0, count, size)]
    if flag("progress", progress):
        from tqdm import tqdm

        ended = in_order(solve, count, size, progress=False)
        yield from tqdm(ended, total=len(chunks), unit="chunk")
    elif len(chunks) < 2 or (workers := min(len(chunks), os.cpu_count() or 1)) < 2:
        yield from map(solve, chunks)
    else:
        from concurrent.futures import ThreadPoolExecutor

        stop = threading.Event()
        with ThreadPoolExecutor(workers) as pool:
            try:
                yield from pool.map(solve, chunks, itertools.repeat(stop))
            finally:
                stop.set()
                pool.shutdown(cancel_futures=True)


def rows_of(array: Vector, lead: tuple[int, ...], rows: slice) -> Vector:
    """Return some rows of `array` broadcast to the leading shape."""
    size = array.shape[-1]
    if array.shape[:-1] == lead and array.flags.c_contiguous:
        part = array.reshape(math.prod(lead), size)[rows]
        # Compiled code is made for aligned arrays that may be written to; it writes to no input.
        return part if part.flags.carray else part.copy()
    if array.size == size:
        return np.full((rows.stop - rows.start, size), array.reshape(size))
    full = np.broadcast_to(array, (*lead, size))  # without making the others
    return full[np.unravel_index(np.arange(rows.start, rows.stop), lead)]
