"""Exhaustive search: a grid over the whole range, then finer grids where it matters.

Chi-square of an impact has several minima and flat stretches.  A search from one start finds one
of the minima; a grid finds all that are wider than its cells.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np

from cradle.input.values import Vector

#: A set holds the true value in 95 of 100 experiments where chi-square rises by no more than this.
LEVEL = 0.95
RISE = 3.841458820694124

# Finer grids: points of each, and how many.  Together they narrow a cell by 20^4.
_FINE, _ROUNDS = 41, 4
# Points of a grid in several dimensions that go on to the next finer one.
_KEPT = 600
# Points inside the confidence set that make its ends known to a small part of its width.
_ENOUGH = 400
# Cells along each axis of the first grid, by the number of axes.
_CELLS = {2: 61, 3: 21, 4: 11, 5: 7, 6: 5}

Function = Callable[[Vector], Vector]
Intervals = tuple[tuple[float, float], ...]


class Mode(NamedTuple):
    """A minimum of chi-square.

    Examples
    --------
    >>> Mode(0.2, 0.0)
    Mode(value=0.2, excess=0.0)
    """

    #: Where it is.
    value: float
    #: Chi-square there above the lowest.
    excess: float


class Scan(NamedTuple):
    """Chi-square of one parameter: its minima, the confidence set, its excess at points tried."""

    modes: tuple[Mode, ...]
    intervals: Intervals
    grid: Vector
    excess: Vector


def scan(function: Function, grid: Vector) -> tuple[Scan, float]:
    """Search one dimension: grid, then polish every minimum and every end of the confidence set."""
    values = function(grid)
    padded = np.concatenate([[np.inf], values, [np.inf]])
    # The first point of a level stretch stands for it.
    lows = np.flatnonzero((padded[1:-1] < padded[:-2]) & (padded[1:-1] <= padded[2:]))
    minima = sorted((_polished(function, grid, int(k)) for k in lows), key=lambda pair: pair[1])
    lowest = minima[0][1]
    modes = tuple(Mode(x, y - lowest) for x, y in minima if _is_minimum(x, y, values, grid))
    excess = values - lowest
    # Minima narrower than a cell of the grid count too.
    extra = [mode for mode in modes if mode.excess <= RISE]
    x = np.concatenate([grid, [mode.value for mode in extra]])
    order = np.argsort(x, kind="stable")
    x = x[order]
    inside = np.concatenate([excess, [mode.excess for mode in extra]])[order] <= RISE
    ends = [x[0]] * bool(inside[0])
    ends += [_crossing(function, x[k : k + 2], lowest) for k in np.flatnonzero(np.diff(inside))]
    ends = [float(end) for end in ends + [x[-1]] * bool(inside[-1])]
    return Scan(modes, tuple(zip(ends[::2], ends[1::2], strict=True)), grid, excess), lowest


def _is_minimum(x: float, y: float, values: Vector, grid: Vector) -> bool:
    """Tell a minimum from rounding on a level stretch of chi-square."""
    near = np.abs(np.arange(grid.size) - np.searchsorted(grid, x)) <= 3
    return bool(values[near].max() - y > 1e-9 * max(1.0, abs(y))) or bool(y == values.min())


def _polished(function: Function, grid: Vector, at: int) -> tuple[float, float]:
    """Return a minimum next to a grid point, by finer and finer grids between its neighbours."""
    low, high = grid[max(at - 1, 0)], grid[min(at + 1, grid.size - 1)]
    best, value = float(grid[at]), np.inf
    for _ in range(_ROUNDS):
        fine = np.union1d(np.linspace(low, high, _FINE), [best])
        values = function(fine)
        k = int(np.argmin(values))
        best, value = float(fine[k]), float(values[k])
        low, high = fine[max(k - 1, 0)], fine[min(k + 1, fine.size - 1)]
    return best, value


def _crossing(function: Function, ends: Vector, lowest: float) -> float:
    """Return where chi-square passes `RISE` above its lowest value, between two points."""
    for _ in range(_ROUNDS):
        fine = np.linspace(ends[0], ends[1], _FINE)
        k = np.flatnonzero(np.diff(function(fine) - lowest <= RISE))[0]
        ends = fine[k : k + 2]
    return 0.5 * float(ends[0] + ends[1])


def refine(function: Function, upper: Vector) -> tuple[list[Scan], Vector, Vector, float]:
    """Search several dimensions from 0 to `upper`: a grid of cells, then the best cells divided.

    Returns what each axis shows, all points of the last grid, their excess, and the lowest value.
    """
    size = upper.size
    if size not in _CELLS:
        raise ValueError(
            f"{size} ratios act together in these shots; at most {max(_CELLS)} can be searched "
            "at a time: add shots of fewer balls, or fix some by known="
        )
    step = upper / _CELLS[size]
    centres = [s * (np.arange(_CELLS[size]) + 0.5) for s in step]
    points = np.array(list(product(*centres)))
    halves = np.array(list(product((-0.25, 0.25), repeat=size)))
    while True:
        values = function(points)
        inside = values - values.min() <= RISE
        if np.count_nonzero(inside) >= _ENOUGH or (step < 1e-6 * upper).all():
            break
        best = points[np.argsort(values, kind="stable")[:_KEPT]]
        points = (best[:, None, :] + halves * step).reshape(-1, size)
        step = step / 2
    minima = sorted(
        (_descended(function, point, step, upper) for point in _lows(points, values, step)),
        key=lambda pair: pair[1],
    )
    lowest = minima[0][1]
    excess = values - lowest
    low = excess <= 4 * RISE
    scans = []
    for axis, bound in enumerate(upper.tolist()):
        modes = tuple(Mode(float(point[axis]), value - lowest) for point, value in minima)
        # The confidence set, to about a step.
        places, half = np.unique(points[excess <= RISE, axis]), 0.5 * step[axis]
        places = places if places.size else minima[0][0][axis : axis + 1]
        parts = np.split(places, np.flatnonzero(np.diff(places) > 3.0 * half) + 1)
        ends = [(float(part[0] - half), float(part[-1] + half)) for part in parts]
        order = np.argsort(points[low, axis])
        scans.append(Scan(modes, tuple((max(0.0, a), min(b, bound)) for a, b in ends),
                          points[low, axis][order], excess[low][order]))  # fmt: skip
    return scans, points, excess, lowest


def _lows(points: Vector, values: Vector, step: Vector) -> Vector:
    """Return the points that no neighbour undercuts, among those near the lowest."""
    some = np.argsort(values, kind="stable")[:1500]
    some = some[values[some] - values[some[0]] <= 4 * RISE]
    near = np.all(np.abs(points[some, None] - points[None, some]) < 1.5 * step, axis=-1)
    lower = values[some][None, :] < values[some][:, None]
    return np.asarray(points[some[~np.any(near & lower, axis=1)]])


def _descended(
    function: Function, point: Vector, step: Vector, upper: Vector
) -> tuple[Vector, float]:
    """Walk to the minimum by the best of all neighbours, with smaller and smaller steps."""
    moves = np.array(list(product((-1.0, 0.0, 1.0), repeat=point.size)))
    for _ in range(40):
        around = np.clip(point + moves * step, 0.0, upper)
        values = function(around)
        k = int(np.argmin(values))
        if not moves[k].any() or (around[k] == point).all():
            step = step / 2
        point, value = around[k], float(values[k])
    return point, value
