"""From arrays to the event loop and back: work areas, pauses, plain or compiled.

The event loop stops by itself after some effort and is called again: so Ctrl-C works, a record can
grow, and small work can begin plain and go on compiled.
"""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Callable
from typing import Any, get_type_hints

import numpy as np

from cradle import kernel as plain
from cradle.kernel import state as rooms
from cradle.kernel.state import FINISHED, PAUSED, REFUSED, UNFINISHED, UNSOUND
from cradle.runtime import compile as runtime

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

__all__ = ["DEFECTS", "FINISHED", "LARGE", "REFUSED", "UNFINISHED", "UNSOUND", "Job", "Stopped"]

# Contacts touched between two pauses, plain and compiled: some hundredths of a second.
_EFFORT = {False: 5_000, True: 2_000_000}
# Chains times balls from which on compiling is worth the wait at once.
LARGE = 50_000
# No limit.
_ENDLESS = 2**62
_NOTHING = rooms.Record([], [], [], [])
#: Events that one round may write: each contact may end, close, collapse, pass its maximum, and
#: repeat itself.
_ROUND = 5


class Stopped(Exception):
    """Another thread has failed, or the user has had enough."""


def _type(record: type) -> np.dtype[Any]:
    """Return the NumPy type of one of the kernel's records."""
    kinds = {int: "i8", float: "f8", complex: "c16"}
    return np.dtype([(name, kinds[kind]) for name, kind in get_type_hints(record).items()])


_TYPES = {
    name: _type(getattr(rooms, name)) for name in ("Ball", "Contact", "Run", "Level", "Memory")
}
_TALLY = _type(rooms.Tally)


def _blank(record: type, size: int) -> list[Any]:
    """Return as many objects, all fields zero."""
    kinds = get_type_hints(record).items()
    things = [record() for _ in range(size)]
    for thing in things:
        for name, kind in kinds:
            setattr(thing, name, kind())
    return things


def _area(n: int, compiled: bool, record: rooms.Record) -> rooms.State:
    """Return a work area: NumPy records for compiled code, Python objects for plain."""
    sizes = {"Ball": n, "Contact": n, "Run": n, "Level": 2}
    if compiled:
        arrays: list[Any] = [np.zeros(size, _TYPES[name]) for name, size in sizes.items()]
        arrays += [np.zeros((2, n), _TYPES["Memory"]), np.zeros(1, _TALLY), record]
        return rooms.State(*arrays)
    things: list[Any] = [_blank(getattr(rooms, name), size) for name, size in sizes.items()]
    things += [[_blank(rooms.Memory, n) for _ in range(2)], _blank(rooms.Tally, 1), record]
    return rooms.State(*things)


_kept = threading.local()


def _kept_area(n: int, compiled: bool) -> rooms.State:
    """Return this thread's work area for n balls, without a record, kept for its next call."""
    kept = getattr(_kept, "areas", None)
    if kept is None:
        kept = _kept.areas = {}
    found = kept.get(compiled)
    if found is None or len(found.ball) != n:
        empty = _record(0, n) if compiled else _NOTHING
        found = kept[compiled] = _area(n, compiled, empty)
    return found


def _record(room: int, n: int) -> rooms.Record:
    """Return room for that many events."""
    integer = np.int64
    return rooms.Record(
        np.zeros(room, integer),
        np.zeros(room, integer),
        np.zeros((room + 1, n)),
        np.zeros((room + 1, n - 1)),
    )


class Job:
    """Chains of n balls on their way through the event loop.

    Parameters
    ----------
    inputs : Inputs
        Arrays of floats with a row for each chain, or one row for all.
    rows : int
        How many chains.
    options : Options
        How to solve them.
    room : int or None
        Most events to record, of the last chain; None for the outcome alone.
    large : bool
        Whether the work is surely worth compiling for.
    """

    def __init__(
        self,
        inputs: plain.Inputs,
        rows: int,
        options: plain.Options,
        room: int | None = None,
        large: bool = False,
    ) -> None:
        n = inputs.m.shape[-1]
        self.n, self.rows, self.inputs, self.options, self.limit = n, rows, inputs, options, room
        self.large = large
        # The number of the next chain, and how the one before it ended.
        self.next, self.status = 0, FINISHED
        one = 0 if room is None else n - 1
        integer = np.int64
        self.outputs = plain.Outputs(
            np.empty((rows, n)),
            np.empty((rows, n - 1), dtype=integer),
            np.empty(rows, dtype=integer),
            np.zeros(one),
            np.zeros(one),
            np.zeros(one, dtype=integer),
        )
        self.compiled: bool | None = None

    def run(
        self, stop: threading.Event | None = None, pause: Callable[[], object] | None = None
    ) -> Job:
        """Solve the chains, up to the first whose status is not FINISHED.

        It ends when `stop` is set, and calls `pause` whenever the event loop pauses.
        """
        resumed = False
        while self.next < self.rows:
            if stop is not None and stop.is_set():
                raise Stopped
            kernel = runtime.chosen(self.large)
            if self.compiled is not (kernel is not plain):
                self._begin(kernel is not plain)
                resumed = False
            begun = time.perf_counter()
            known = kernel is plain or runtime.loaded()
            call = kernel.batch if known else functools.partial(runtime.first_call, kernel.batch)
            self.next, self.status = call(
                self.next,
                resumed,
                self.n,
                self.given,
                self.options,
                self.results,
                self.state,
                _EFFORT[bool(self.compiled)],
            )
            if not self.compiled:
                runtime.spend(time.perf_counter() - begun)
            resumed = self.status == PAUSED
            if pause is not None:
                pause()
            if resumed and self.tally("events") > self.tally("room"):
                self._grow()
            elif not resumed and self.status != FINISHED:
                break
        if self.compiled is False:
            self._write_back()
        return self

    def _begin(self, compiled: bool) -> None:
        """Lay out work area and outputs for one runtime; what is solved so far stays."""
        if self.compiled is False:
            self._write_back()
        self.compiled = compiled
        self.given, self.results = self.inputs, self.outputs
        if not compiled:
            # Python's own numbers: faster than NumPy's one at a time, and the same digits.
            self.given = plain.Inputs(*(part.tolist() for part in self.inputs))
            self.results = plain.Outputs(*(part.tolist() for part in self.outputs))
        self.state = _kept_area(self.n, compiled)
        if self.limit is None:
            self._set_room(_ENDLESS)
        else:
            self.record = _NOTHING
            self._grow()

    def tally(self, name: str) -> Any:
        """Return a count of the impact at hand."""
        tally = self.state.tally
        return tally[name][0].item() if self.compiled else getattr(tally[0], name)

    def stored(self) -> float:
        """Return the work that contacts can still release, in the kernel's own units."""
        contacts = self.state.contact
        return float(sum(k["q"].real if self.compiled else k.q.real for k in contacts))

    def _set_room(self, room: int) -> None:
        """Let the event loop write so many events."""
        if self.compiled:
            self.state.tally["room"] = room
        else:
            self.state.tally[0].room = room

    def _grow(self) -> None:
        """Make room for more events, twice as many as before, up to the limit."""
        assert self.limit is not None
        old, spare = self.record, _ROUND * self.n
        room = min(max(2 * len(old.kinds), 64 + spare), self.limit)
        self.record = _record(room, self.n)
        if len(old.kinds):
            done = min(self.tally("events"), len(old.kinds))
            written = self.state.record
            for new, part, more in zip(self.record, written, (0, 0, 1, 1), strict=True):
                new[: done + more] = part[: done + more]
        record = self.record
        if not self.compiled:
            record = rooms.Record(*(part.tolist() for part in self.record))
        self.state = self.state._replace(record=record)
        self._set_room(_ENDLESS if room == self.limit else room - spare)

    def _write_back(self) -> None:
        """Copy what the plain loop wrote into the arrays."""
        parts = [*zip(self.outputs, self.results, strict=True)]
        if self.limit is not None:
            parts += zip(self.record, self.state.record, strict=True)
        for array, values in parts:
            if array.size:
                array[...] = values


@functools.cache
def warm_up() -> None:
    """Compile the event loop, or load it compiled, if numba is there: then nothing waits for it.

    The first time on a machine takes up to a minute, afterwards a second.  Programs that must not
    stop, such as games with a `cradle.row.Row`, call it while they load.

    Examples
    --------
    >>> warm_up()
    """
    one = np.ones((1, 2))
    inputs = plain.Inputs(one, np.array([[1.0, 0.0]]), np.ones((1, 1)), *[np.ones((1, 0))] * 2)
    Job(inputs, 1, plain.Options(0.5, 1000, True), large=True).run()
