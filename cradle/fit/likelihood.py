"""How well parameters explain shots: chi-square over many parameter points at once.

The velocities before an impact are measured too, and the coefficients of restitution are known
with errors only.  Both enter as nuisances: chi-square is profiled over them.  The outcomes are
linear in the velocity of a single striker, so that the profile over it is exact; in the
coefficients of restitution they are taken as linear over one standard error.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cradle.fit.parameters import Key, Points, pair_keys
from cradle.fit.shots import ShotSet
from cradle.input.values import Vector

# Parameter points evaluated at a time, to bound the memory.
_CHUNK = 4096

Uncertain = Sequence[tuple[Key, float]]


def responses(
    shots: ShotSet, points: Points, uncertain: Uncertain
) -> tuple[Vector, Vector, Vector]:
    """Return velocities after K shots at P points, shape (K, P, N), and what they change with.

    That is each uncertain restitution, (K, P, N, E), and one standard error of each measured
    velocity before, (K, P, N, M).
    """
    moving = np.flatnonzero((shots.before != 0).any(axis=0))
    at_rest_exactly = not np.delete(shots.sigma_before, moving, axis=1).any()
    single = moving.size == 1 and (shots.before[:, moving] > 0).all() and at_rest_exactly
    unit = np.eye(shots.masses.size)
    before = unit[None, moving] if single else shots.before[:, None, :]

    def solve(points: Points, change: Vector | float = 0.0) -> Vector:
        return points.outcomes(shots.types, shots.masses, before + change)

    outcome = solve(points)
    slopes = np.zeros((*outcome.shape, len(uncertain)))
    for k, (key, sigma) in enumerate(uncertain):
        if key in pair_keys(shots.types):
            e = points.restitution[key]
            up, down = min(1.0, e + sigma) - e, max(0.0, e - sigma) - e
            above, below = (
                solve(Points({**points.restitution, key: e + step}, points.ratios))
                for step in (up, down)
            )
            slopes[..., k] = (above - below) / (up - down)
    if single:
        # Homogeneous of degree one: the slope with the striker's velocity is the outcome itself.
        speed, error = (v[:, moving, None] for v in (shots.before, shots.sigma_before))
        return outcome * speed, slopes * speed[..., None], (outcome * error)[..., None]
    measured = np.flatnonzero((shots.sigma_before > 0).any(axis=0))
    movers = np.zeros((*outcome.shape, measured.size))
    for k, ball in enumerate(measured):
        error = shots.sigma_before[:, ball, None, None]
        step = unit[ball] * error.max()
        movers[..., k] = (solve(points, step) - solve(points, -step)) / (2 * error.max()) * error
    return outcome, slopes, movers


def normal_equations(
    shots: ShotSet, points: Points, uncertain: Uncertain
) -> tuple[Vector, Vector, Vector]:
    """Chi-square at the nominal restitution, its slope and curvature, profiled over `before`.

    Of restitution changed by d it is chi_square - 2 slope d + d curvature d.
    """
    outcome, slopes, movers = responses(shots, points, uncertain)
    residual = shots.after[:, None, :] - outcome
    columns = np.concatenate([residual[..., None], slopes], axis=-1)
    weight = (1.0 / shots.sigma**2)[:, None, :, None]
    products = np.einsum("kpni,kpnj->pij", columns, columns * weight)
    weighted = movers * weight
    inner = np.einsum("kpnm,kpnl->kpml", movers, weighted) + np.eye(weighted.shape[-1])
    cross = np.einsum("kpnm,kpni->kpmi", weighted, columns)
    products -= np.einsum("kpmi,kpmj->pij", cross, np.linalg.solve(inner, cross))
    return products[:, 0, 0], products[:, 0, 1:], products[:, 1:, 1:]


def chi_squares(sets: Sequence[ShotSet], points: Points, uncertain: Uncertain) -> Vector:
    """Chi-square of all shots at each point, profiled over restitution and velocities before."""
    size = max((values.size for values in points.ratios.values()), default=1)
    found = []
    for begin in range(0, size, _CHUNK):
        ratios = {key: values[begin : begin + _CHUNK] for key, values in points.ratios.items()}
        some = Points(points.restitution, ratios)
        parts = zip(*(normal_equations(one, some, uncertain) for one in sets), strict=True)
        totals: list[Any] = [sum(part) for part in parts]
        chi_square, slope, curvature = totals
        if uncertain:  # profiled over the coefficients of restitution that the sets share
            curvature = curvature + np.diag([1.0 / sigma**2 for _, sigma in uncertain])
            step = np.linalg.solve(curvature, slope[..., None])[..., 0]
            chi_square = chi_square - (slope * step).sum(axis=-1)
        found.append(chi_square)
    return np.concatenate(found)
