"""Exhaustive search: a grid over the whole range, then finer grids where it matters.

Chi-square of an impact has several minima and flat stretches.  A function takes points of shape
(P, parameters), from 0 to `upper`, and both searches return what each axis shows, the points, how
likely each is up to a factor, and the lowest value.
"""

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np
import scipy

from cradle.input.values import Vector

#: A set holds the true value in 95 of 100 experiments where chi-square rises by no more than this.
LEVEL, RISE = 0.95, 3.841458820694124

_GRID = 2001  # points of the grid in one dimension
_KEPT = 600  # points of a grid in several dimensions that go on to the next finer one
_ENOUGH = 400  # points inside the confidence set that tell its ends well beside its width
_CELLS = {2: 61, 3: 21, 4: 11, 5: 7, 6: 5}  # along each axis of the first grid, by their number

Function = Callable[[Vector], Vector]
Found = tuple[list["Scan"], Vector, Vector, float]


class Mode(NamedTuple):
    """A minimum of chi-square."""

    value: float  #: Value of the parameter there.
    excess: float  #: Chi-square there, less its lowest value.


class Scan(NamedTuple):
    """Chi-square of one parameter: its minima, the confidence set, its excess at points tried."""

    modes: tuple[Mode, ...]
    intervals: tuple[tuple[float, float], ...]
    grid: Vector
    excess: Vector


def scan(function: Function, upper: Vector) -> Found:
    """Search one dimension: a grid, then walk to each minimum and each end of the set."""
    # Near the bound the outcome goes like the square root of what is left to it.
    points = upper * (1.0 - np.linspace(1.0, 0.0, _GRID)[:, None] ** 2)
    grid, values = points[:, 0], function(points)
    padded = np.pad(values, 1, constant_values=np.inf)
    # The first point of a level stretch stands for it.
    lows = np.flatnonzero((padded[1:-1] < padded[:-2]) & (padded[1:-1] <= padded[2:]))
    cells = np.gradient(grid)
    (modes,), lowest = _walked(function, points[lows], cells[lows, None], upper)
    # Minima narrower than a cell of the grid count too.
    extra = np.array([mode for mode in modes if mode.excess <= RISE])
    x, at = np.unique(np.concatenate([grid, extra[:, 0]]), return_index=True)
    excess = values - lowest
    inside = np.concatenate([[False], np.append(excess, extra[:, 1])[at] <= RISE, [False]])

    def over(at: float) -> float:
        return float(function(np.array([[at]]))[0]) - lowest - RISE

    ends = [
        float(x[k - (k > 0)]) if k in (0, x.size) else scipy.optimize.brentq(over, x[k - 1], x[k])
        for k in np.flatnonzero(np.diff(inside)).tolist()
    ]
    found = Scan(modes, tuple(zip(ends[::2], ends[1::2], strict=True)), grid, excess)
    return [found], points, np.exp(-0.5 * excess) * cells, lowest


def refine(function: Function, upper: Vector) -> Found:
    """Search several dimensions: a grid of cells, then the best cells divided."""
    size = upper.size
    if size not in _CELLS:
        told = f"{size} ratios act together in these shots; at most {max(_CELLS)} can be searched"
        raise ValueError(f"{told}: add shots of fewer balls, or fix some by known=")
    step = upper / _CELLS[size]
    points = np.array(list(product(*(s * (np.arange(_CELLS[size]) + 0.5) for s in step))))
    halves = np.array(list(product((-0.25, 0.25), repeat=size)))
    while True:
        values = function(points)
        order = np.argsort(values, kind="stable")
        # The grid can be far above the minimum in its best cell, from where the set is counted.
        *_, lowest = _walked(function, points[order[:1]], step[None], upper)
        if np.count_nonzero(values - lowest <= RISE) >= _ENOUGH or (step < 1e-6 * upper).all():
            break
        points = (points[order[:_KEPT], None, :] + halves * step).reshape(-1, size)
        step = step / 2
    # Points that no neighbour undercuts, among those near the lowest.
    some = order[:1500][values[order[:1500]] - values.min() <= 4 * RISE]
    near = np.all(np.abs(points[some, None] - points[None, some]) < 1.5 * step, axis=-1)
    lows = points[some[~np.any(near & (values[some] < values[some][:, None]), axis=1)]]
    each, lowest = _walked(function, lows, np.broadcast_to(step, lows.shape), upper)
    excess = values - lowest
    scans = []
    for axis, (bound, modes) in enumerate(zip(upper.tolist(), each, strict=True)):
        # The confidence set, to about a step.
        places, half = np.unique(points[excess <= RISE, axis]), 0.5 * step[axis]
        places = places if places.size else np.array([modes[0].value])
        parts = np.split(places, np.flatnonzero(np.diff(places) > 3.0 * half) + 1)
        ends = [(max(0.0, float(part[0] - half)), min(float(part[-1] + half), bound))
                for part in parts]  # fmt: skip
        low = [k for k in np.argsort(points[:, axis]) if excess[k] <= 4 * RISE]
        scans.append(Scan(modes, tuple(ends), points[low, axis], excess[low]))
    return scans, points, np.exp(-0.5 * excess), lowest


def _walked(
    function: Function, points: Vector, steps: Vector, upper: Vector
) -> tuple[list[tuple[Mode, ...]], float]:
    """Walk from points by the best neighbours to minima; return them by axis, lowest first."""
    moves = np.array(list(product((0.0, -1.0, 1.0), repeat=upper.size)))
    for _ in range(40):
        around = np.clip(points[:, None] + moves * steps[:, None], 0.0, upper)
        values = function(around.reshape(-1, upper.size)).reshape(len(points), -1)
        best = around[np.arange(len(points)), np.argmin(values, axis=1)]
        steps = np.where((best == points).all(axis=1, keepdims=True), steps / 2, steps)
        points = best
    minima = values.min(axis=1)
    order = np.argsort(minima, kind="stable")
    lowest = float(minima[order[0]])
    excess = (minima[order] - lowest).tolist()
    return [tuple(map(Mode, axis, excess)) for axis in points[order].T.tolist()], lowest
