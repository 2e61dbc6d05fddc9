"""Exhaustive search: a grid over the whole range, then finer grids where it matters.

Chi-square of an impact has several minima and flat stretches.  A search from one start finds one
of the minima; a grid finds all that are wider than its cells.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
    """Chi-square of one parameter over its range."""

    grid: Vector
    excess: Vector
    lowest: float
    modes: tuple[Mode, ...]
    intervals: tuple[tuple[float, float], ...]


def scan(function: Function, grid: Vector) -> Scan:
    """Search one dimension: grid, then polish every minimum and every end of the confidence set."""
    values = function(grid)
    padded = np.concatenate([[np.inf], values, [np.inf]])
    # The first point of a level stretch stands for it.
    lows = np.flatnonzero((padded[1:-1] < padded[:-2]) & (padded[1:-1] <= padded[2:]))
    minima = sorted((_polished(function, grid, int(k)) for k in lows), key=lambda pair: pair[1])
    lowest = minima[0][1]
    modes = tuple(Mode(x, y - lowest) for x, y in minima if _is_minimum(x, y, values, grid))
    excess = values - lowest
    return Scan(grid, excess, lowest, modes, _intervals(function, grid, excess, lowest, modes))


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


def _intervals(
    function: Function, grid: Vector, excess: Vector, lowest: float, modes: tuple[Mode, ...]
) -> tuple[tuple[float, float], ...]:
    """Return the stretches where chi-square is within `RISE` of its lowest value."""
    # Minima narrower than a cell of the grid count too.
    extra = [mode for mode in modes if mode.excess <= RISE]
    x = np.concatenate([grid, [mode.value for mode in extra]])
    y = np.concatenate([excess, [mode.excess for mode in extra]])
    order = np.argsort(x, kind="stable")
    x, inside = x[order], y[order] <= RISE
    ends = np.flatnonzero(inside[1:] != inside[:-1])
    crossings = [_crossing(function, x[k], x[k + 1], lowest) for k in ends]
    if inside[0]:
        crossings.insert(0, float(x[0]))
    if inside[-1]:
        crossings.append(float(x[-1]))
    return tuple(zip(crossings[::2], crossings[1::2], strict=True))


def _crossing(function: Function, low: float, high: float, lowest: float) -> float:
    """Return where chi-square passes `RISE` above its lowest value, between two points."""
    for _ in range(_ROUNDS):
        fine = np.linspace(low, high, _FINE)
        inside = function(fine) - lowest <= RISE
        k = int(np.flatnonzero(inside[1:] != inside[:-1])[0])
        low, high = float(fine[k]), float(fine[k + 1])
    return 0.5 * (low + high)


class Region(NamedTuple):
    """Chi-square of several parameters, on cells of one size where it is low."""

    points: Vector
    excess: Vector
    step: Vector
    lowest: float
    best: Vector
    modes: tuple[tuple[Vector, float], ...]

    def intervals(self, axis: int) -> tuple[tuple[float, float], ...]:
        """Return the confidence set of one parameter as disjoint intervals, to about a step."""
        inside = np.unique(self.points[self.excess <= RISE, axis])
        half = 0.5 * self.step[axis]
        if not inside.size:
            inside = self.best[axis : axis + 1]
        breaks = np.flatnonzero(np.diff(inside) > 3.0 * half)
        starts, ends = np.concatenate([[0], breaks + 1]), np.concatenate([breaks, [-1]])
        return tuple(
            (max(0.0, float(inside[a] - half)), float(inside[b] + half))
            for a, b in zip(starts, ends, strict=True)
        )


def refine(function: Function, upper: Vector) -> Region:
    """Search several dimensions from 0 to `upper`: a grid of cells, then the best cells divided."""
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
        lowest = float(values.min())
        if np.count_nonzero(values - lowest <= RISE) >= _ENOUGH or (step < 1e-6 * upper).all():
            break
        best = points[np.argsort(values, kind="stable")[:_KEPT]]
        points = (best[:, None, :] + halves * step).reshape(-1, size)
        step = step / 2
    minima = sorted(
        (_descended(function, point, step, upper) for point in _lows(points, values, step)),
        key=lambda pair: pair[1],
    )
    best_point, lowest = minima[0]
    modes = tuple((point, value - lowest) for point, value in minima)
    return Region(points, values - lowest, step, lowest, best_point, modes)


def _lows(points: Vector, values: Vector, step: Vector) -> Vector:
    """Return the points that no neighbour undercuts, among those near the lowest."""
    some = np.argsort(values, kind="stable")[:1500]
    some = some[values[some] - values[some[0]] <= 4 * RISE]
    distance = np.abs(points[some, None] - points[None, some])
    near: NDArray[np.bool_] = np.all(distance < 1.5 * step, axis=-1)
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
