"""The paper's model: one Impulse Correlation Ratio at each interior ball and direction."""

import functools
from dataclasses import dataclass, field
from typing import NoReturn

import numpy as np

from cradle.chain import Chain
from cradle.closed_form import largest_ratios
from cradle.input import values as asked
from cradle.input.values import ArrayLike, Vector
from cradle.kernel import Inputs, Options
from cradle.kernel.state import LIMITS, REFUSED, UNFINISHED, UNSOUND
from cradle.runtime.job import DEFECTS, Job, outputs
from cradle.trace import Event, ImpactNotCertified, ImpactNotFinished, Trace

MAX_EVENTS = 5_000_000  #: Steps after which an impact is given up, unless told otherwise.

_MOST_NUMBERS = 10_000_000  # that a path may hold unless it is asked for in full: 80 MB
_EVERY = 2**40
_KINDS = ("maximum_compression", "end", "close", "collapse", "repetition")
# Each event once: the same ones come again and again.
_event = functools.cache(lambda kind, contact: Event(_KINDS[kind], contact))


@dataclass(frozen=True)
class ImpulseCorrelation:
    """The paper's rule: Impulse Correlation Ratio and energetic restitution (equations 16, 47-53).

    At an interior ball one contact drives the other: for each unit of its impulse the driven one
    receives the ratio (Ceanga and Hurmuzlu, J. Appl. Mech. 68 (2001) 575-583).  A contact ends when
    it has given back the part e^2 of the work it absorbed.  Between events velocities are linear in
    the impulses, so no step size is needed.  A value outside its range raises a `ValueError`.

    Where several contacts of balls that touch approach, the leftmost one drives all the others; so
    balls that are struck from both sides and their mirror image end differently.

    Parameters
    ----------
    forward, backward : float or sequence, length N - 2
        Ratio, 0 to 1, at each interior ball when its left contact drives its right one, and when
        its right one drives its left one.  If `backward` is left out, it equals `forward`.
    meeting : float
        Two balls may be driven towards each other by separate collisions.  Their velocities meet at
        this part, 0 to 1, of the overlap of their ranges to the next events; 1/2 as in the paper.
    excess : {"raise", "saturate"}
        What to do with a ratio above its bound (Eq. 53): refuse it, or hold the contact closed
        while the ratio would open it.
    max_events : int
        Number of steps after which the impact is given up.

    Examples
    --------
    >>> from cradle import Chain, ImpulseCorrelation, collide
    >>> model = ImpulseCorrelation(forward=0.15)
    >>> collide(Chain([1, 1, 1], [1, 0, 0], [1, 1]), model).velocities.round(4).tolist()
    [-0.0811, 0.0883, 0.9928]
    """

    forward: ArrayLike
    backward: ArrayLike | None = None
    meeting: float = field(default=0.5, kw_only=True)
    excess: str = field(default="raise", kw_only=True)
    max_events: int = field(default=MAX_EVENTS, kw_only=True)

    def __post_init__(self) -> None:
        check_options(self.meeting, self.excess, self.max_events)
        for name in ("forward", "backward"):
            if (given := getattr(self, name)) is not None or name == "forward":
                vars(self)[name] = asked.number_or_row(name, given, "N - 2", *asked.PART)
        vars(self).update(meeting=float(self.meeting), max_events=int(self.max_events))

    def ratios(self, n: int) -> tuple[Vector, Vector]:
        """Return the ratios forward and backward at the interior balls of a chain of n balls."""
        backward = self.forward if self.backward is None else self.backward
        row = asked.row_of
        return row("forward", self.forward, n - 2, n), row("backward", backward, n - 2, n)

    def solve(self, chain: Chain, *, record: bool | None = None, progress: bool = False) -> Trace:
        """Solve the impact of `chain`; see `collide`."""
        n = len(asked.must_be(Chain, "chain", chain))
        own = chain.masses, chain.velocities, chain.restitution, *self.ratios(n)
        # Copies: compiled code is made for arrays that may be written to.
        inputs = Inputs(*(part[None].copy() for part in own))
        most = max(_MOST_NUMBERS // (2 * n - 1), 1)  # N velocities and N - 1 impulses each
        room = most if record is None else _EVERY if asked.flag("record", record) else 0
        options = Options(self.meeting, self.max_events, self.excess == "raise")
        job = Job(inputs, outputs(1, n, last=True), options, room)
        if asked.flag("progress", progress):
            from tqdm import tqdm

            with tqdm(unit=" events", delay=2.0) as bar:
                job.run(pause=lambda: bar.update(int(job.counts["events"]) - bar.n))
        else:
            job.run()
        if job.status == REFUSED:
            raise_refused(options.bounded, *own)
        results, written = job.outputs, job.state.record
        written.velocities[0] = chain.velocities
        count = int(job.counts["events"])
        kept = min(count, len(written.kinds))
        events = map(_event, written.kinds[:kept].tolist(), written.contacts[:kept].tolist())
        trace = Trace(
            chain, self, results.v[0], results.p, results.a, results.hits[0],
            written.velocities[: kept + 1], written.impulses[: kept + 1], tuple(events),
            collapsed=bool(results.collapsed[0]),
            saturated=tuple(results.held.nonzero()[0].tolist()),
            margin=float(results.margin[0]),
            left_out=count - kept if kept else 0,  # without a record not all are counted
        )  # fmt: skip
        if job.status == UNFINISHED:
            steps = f"max_events = {self.max_events} steps, {count} events"
            told = f"the impact was not finished after {steps}"
            heaviest = np.ldexp(chain.masses.max(), -int(job.counts["mass_shift"]))
            fastest = np.ldexp(np.abs(chain.velocities).max(), -int(job.counts["shift"]))
            raise ImpactNotFinished(told, trace, job.stored() / float(heaviest * fastest * fastest))
        if job.status == UNSOUND:
            raise ImpactNotCertified(chain, self, DEFECTS[int(job.counts["defect"])])
        return trace


def check_options(meeting: float, excess: str, max_events: int) -> None:
    """Raise if an option is outside its range."""
    asked.one_number("meeting", meeting, *asked.PART)
    asked.one_of("excess", excess, ("raise", "saturate"))
    asked.whole_number("max_events", max_events, "at least 1 and below 2**63", high=2**63 - 1)


def check_values(bounded: bool, *values: ArrayLike) -> None:
    """Raise if a value is outside its limits: what the kernel refuses, in words."""
    masses, velocities, restitution, forward, backward = values
    m, v = asked.checked_masses(masses), asked.checked("velocities", velocities)
    asked.checked_restitution(restitution)
    f = asked.checked("forward", forward, *asked.PART)
    b = asked.checked("backward", backward, *asked.PART)
    asked.refuse_overflow(v, m)
    if m.size:
        # How a ball as light as that parts the heavy ones is below rounding.
        small = m < LIMITS.lightest * m.max(axis=-1, keepdims=True)
        least = f"at least {LIMITS.lightest} of the heaviest ball of its chain"
        asked.refuse_where("masses", m, small, f"for this model it must be {least}")
    if not bounded:
        return
    f, b = (np.broadcast_to(x, (m.shape[-1] - 2,)) if x.ndim == 0 else x for x in (f, b))
    bounds = largest_ratios(m, f, b)
    for name, given, bound in zip(("forward", "backward"), (f, b), bounds, strict=True):
        above = given > bound * LIMITS.rounded
        if above.any():
            at, mirrored = tuple(np.argwhere(above)[0]), ", mirrored" * (name == "backward")
            rule = (
                f"at ball {at[-1] + 1}, counted from 0, it must not exceed {float(bound[at]):.6g} "
                f"(Eq. 53{mirrored}): above it a driven contact opens; excess='saturate' "
                "holds the contact closed instead"
            )
            asked.refuse_where(name, given, above, rule)


def raise_refused(bounded: bool, *values: ArrayLike) -> NoReturn:
    """Say in words what the kernel has refused."""
    check_values(bounded, *values)
    raise AssertionError("the kernel refused a chain that the checks admit")
