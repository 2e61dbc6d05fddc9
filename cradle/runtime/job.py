"""From arrays to the two loops and back: work areas, pauses, plain or compiled.

A loop stops by itself after some effort and is called again: so Ctrl-C works, a record can grow,
and small work can begin plain and go on compiled.
"""

import functools
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, get_type_hints

import numpy as np

from cradle import kernel as plain
from cradle.kernel import state as rooms
from cradle.kernel.kinks import Clock, Law, Link, Motions, Springs
from cradle.kernel.state import FINISHED, PAUSED, UNDECIDED
from cradle.runtime import compile as runtime
from cradle.runtime import exact

#: What an answer can break, by the number that the kernel gives.
DEFECTS = {
    rooms.NO_EVENT: "no event follows, though contacts are active",
    rooms.PASSED: "two groups of balls that should have met have passed each other",
    rooms.MOMENTUM: "a ball's momentum is not that of its impulses",
    rooms.PULL: "a contact has pulled, or has absorbed less than nothing",
    rooms.ORDER: "balls still approach",
    rooms.ENERGY: "kinetic energy has grown",
    rooms.LEDGER: "the energy lost is not what the contacts keep back",
}

# Contacts touched between two pauses, plain and compiled, some hundredths of a second: of events;
# of contact forces, in each step; and with a record, of which each step is a page.
_EFFORT, _STEPS, _PAGES = {False: 5_000, True: 2_000_000}, {False: 5_000, True: 5_000_000}, 1024
LARGE = 50_000  #: Chains times balls from which on compiling is worth the wait at once.
_ENDLESS = 2**62  # no limit
_ROUND = 5  # events of a contact in one round: end, close, collapse, maximum, repetition


_kept = threading.local()  # a thread's work areas, for its next call


@functools.cache
def _zeros(kind: type) -> tuple[dict[str, Any], np.dtype[Any]]:
    """Return the fields of a record of the kernel, all zero, and its type for NumPy."""
    fields = {name: number() for name, number in get_type_hints(kind).items()}
    return fields, np.dtype([(name, np.array(zero).dtype) for name, zero in fields.items()])


def blank(kind: type, size: int, compiled: bool) -> Any:
    """Return records of the kernel, all zero: NumPy's for compiled code, objects for plain."""
    fields, dtype = _zeros(kind)
    if compiled:
        return np.zeros(size, dtype)
    things = [kind() for _ in range(size)]
    for thing in things:
        vars(thing).update(fields)
    return things


def _area(n: int, compiled: bool, record: rooms.Record) -> rooms.State:
    """Return a work area for n balls."""
    kinds = rooms.Ball, rooms.Contact, rooms.Run, rooms.Memory, rooms.Memory
    ball, contact, run, *memory = (blank(kind, n, compiled) for kind in kinds)
    level, tally = blank(rooms.Level, 2, compiled), blank(rooms.Tally, 1, compiled)
    kept = np.array(memory) if compiled else memory
    return rooms.State(ball, contact, run, level, kept, tally, record)


def _record(room: int, n: int) -> rooms.Record:
    """Return room for that many events."""
    kinds, contacts = np.zeros((2, room), np.int64)
    return rooms.Record(kinds, contacts, np.zeros((room + 1, n)), np.zeros((room + 1, n - 1)))


def outputs(rows: int, n: int, last: bool = False) -> plain.Outputs:
    """Return room for the outcomes of so many chains; `last`: impulses of the last one too."""
    integer, one = np.int64, n - 1 if last else 0
    hits, collapsed = np.empty((rows, n - 1), integer), np.empty(rows, integer)
    parts = np.zeros(one), np.zeros(one), np.zeros(one, integer)
    return plain.Outputs(np.empty((rows, n)), hits, collapsed, np.empty(rows), *parts)


@dataclass
class Job:
    """Chains of n balls on their way through the event loop, from `inputs` into `outputs`."""

    inputs: plain.Inputs  # a row for each chain
    outputs: plain.Outputs
    options: plain.Options
    room: int = 0  # events to record of the last chain, at most
    large: bool = False  # surely worth compiling for
    next: int = 0  # number of the next chain
    status: int = FINISHED  # how the chain before it ended
    compiled: bool | None = None

    def run(
        self, stop: threading.Event | None = None, pause: Callable[[], object] | None = None
    ) -> "Job":
        """Solve the chains, up to the first that is not FINISHED, or until `stop` is set."""
        # It calls `pause` whenever the event loop pauses.
        resumed, rows = False, len(self.outputs.v)
        while self.next < rows and not (stop and stop.is_set()):
            kernel = runtime.chosen(self.large)
            if self.compiled is not (kernel is not plain):
                self._begin(kernel is not plain)
                resumed = False
            effort = _EFFORT[bool(self.compiled)]
            self.next, self.status = runtime.call(
                kernel.batch, self.next, resumed, self.n, self.given, self.options, self.outputs,
                self.state, effort,
            )  # fmt: skip
            if pause is not None:
                pause()
            resumed = self.status == PAUSED
            if self.status == UNDECIDED:  # what has no end in decimals goes on in the loop
                resumed = not exact.answer(self, self.next)
                self.next, self.status = self.next + (not resumed), FINISHED
            elif resumed and self.counts["events"] > self.counts["room"]:
                self._make_room(2 * len(self.state.record.kinds))
            elif not resumed and self.status != FINISHED:
                break
        return self

    def _begin(self, compiled: bool) -> None:
        """Lay out the work area for one runtime; what is solved so far stays."""
        self.compiled, self.given, self.n = compiled, self.inputs, self.outputs.v.shape[1]
        if not compiled:
            # Python's own numbers: faster than NumPy's one at a time, and the same digits.
            self.given = plain.Inputs(*(part.tolist() for part in self.inputs))
        areas: dict[Any, rooms.State] = vars(_kept)
        if compiled not in areas or len(areas[compiled].ball) != self.n:
            areas[compiled] = _area(self.n, compiled, _record(0, self.n))
        self.state = areas[compiled]
        tally = self.state.tally[0]
        self.counts = tally if compiled else vars(tally)  # of the impact at hand
        self._make_room(64 + _ROUND * self.n)

    def stored(self) -> float:
        """Return the work that contacts can still release, in the kernel's own units."""
        contacts = self.state.contact
        return float(sum(k["q"].real if self.compiled else k.q.real for k in contacts))

    def _make_room(self, wanted: int) -> None:
        """Make room for so many events, within the limit, and keep what is written."""
        room, old = min(wanted, self.room), self.state.record
        if len(self.outputs.p):  # of one chain whose path the caller keeps; others need none
            record = _record(room, self.n)
            if len(old.kinds):
                for part, written in zip(record, old, strict=True):
                    part[: len(written)] = written
            self.state = rooms.State(*self.state[:-1], record)
        self.counts["room"] = _ENDLESS if room == self.room else room - _ROUND * self.n


def motions(rows: int, n: int) -> Motions:
    """Return room for what so many chains come to."""
    error, h, slow = np.zeros((3, rows))
    return Motions(np.empty((rows, n)), error, h, slow, np.zeros(rows, np.int64))


def follow(
    chains: Springs, law: Law, out: Motions, large: bool = False,
    stop: threading.Event | None = None, record: list[Any] | None = None,
    pause: Callable[[int], object] | None = None,
) -> tuple[int, int, Any]:  # fmt: skip
    """Follow chains until `stop`; return the next one's number, how the last ended, its clock."""
    # A `record` takes the pages of one chain, at the step in `out`; `pause` the steps so far.
    (rows, n), k, status = out.v.shape, 0, FINISHED
    compiled: bool | None = None
    pages = np.empty((0 if record is None else _PAGES + 2, 4, n))
    clock: Any = None
    while k < rows and status in (FINISHED, PAUSED) and not (stop and stop.is_set()):
        kernel = runtime.chosen(large, "follow")
        if compiled is not (kernel is not plain):
            # A chain that has begun plain begins anew.
            compiled, status = kernel is not plain, FINISHED
            if record is not None:
                record.clear()
            area = blank(Link, n, compiled), blank(Clock, 1, compiled)
            clock = area[1][0] if compiled else vars(area[1][0])
            given = chains if compiled else Springs(*(part.tolist() for part in chains))
        fixed = n, given, law, out, *area, pages, _STEPS[compiled] if record is None else _PAGES
        k, status = runtime.call(kernel.follow, k, status == PAUSED, *fixed)
        if pause is not None:
            pause(int(clock["effort"] + clock["steps"] * (status == PAUSED)))
        if record is not None:
            record.append(pages[: clock["row"]].copy())
            clock["row"] = 0
    return k, status, clock


@functools.cache
def warm_up() -> None:
    """Compile the solvers, or load them compiled, if numba is there, so that no later call waits.

    The first time on a machine this takes up to a minute, afterwards a second.

    Examples
    --------
    >>> from cradle import warm_up
    >>> warm_up()
    """
    one, still, apart, none = np.ones((1, 2)), np.zeros((1, 2)), np.ones((1, 1)), np.zeros((1, 1))
    inputs = plain.Inputs(one, still, apart, *[np.ones((1, 0))] * 2)
    Job(inputs, outputs(1, 2), plain.Options(0.5, 1000, True), large=True).run()
    follow(Springs(one, still, apart, none, none), Law(1.5, 1e-3, 1e3), motions(1, 2), large=True)
