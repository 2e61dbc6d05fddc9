"""From arrays to the loop of the contact forces and back: work area, pauses, plain or compiled."""

import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from cradle import kernel as plain
from cradle.kernel.kinks import Clock, Law, Link, Motions, Springs
from cradle.kernel.state import PAUSED
from cradle.runtime import compile as runtime
from cradle.runtime.job import FINISHED, Stopped, blank

# Contacts times steps between two pauses, plain and compiled: some hundredths of a second; and with
# a record, of which each step is a page.
_EFFORT, _PAGES = {False: 5_000, True: 5_000_000}, 1024


def room(rows: int, n: int) -> Motions:
    """Return room for what so many chains come to."""
    return Motions(np.empty((rows, n)), np.zeros(rows), np.zeros(rows), np.zeros(rows, np.int64))


def solve(
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
    while k < rows and status in (FINISHED, PAUSED):
        if stop is not None and stop.is_set():
            raise Stopped
        kernel = runtime.chosen(large, "follow")
        if compiled is not (kernel is not plain):
            # A chain that has begun plain begins anew.
            compiled, status = kernel is not plain, FINISHED
            if record is not None:
                record.clear()
            area = blank(Link, n, compiled), blank(Clock, 1, compiled)
            clock = area[1][0] if compiled else vars(area[1][0])
            given = chains if compiled else Springs(*(part.tolist() for part in chains))
        door = kernel.follow if compiled else plain.follow
        fixed = n, given, law, out, *area, pages, _EFFORT[compiled] if record is None else _PAGES
        k, status = runtime.call(door, k, status == PAUSED, *fixed)
        if pause is not None:
            pause(int(clock["effort"] + clock["steps"] * (status == PAUSED)))
        if record is not None:
            record.append(pages[: clock["row"]].copy())
            clock["row"] = 0
    return k, status, clock
