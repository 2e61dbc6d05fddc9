"""How well parameters explain shots: chi-square over many parameter points at once.

The velocities before an impact are measured too, and the coefficients of restitution are known
with errors only.  Both enter as nuisances: chi-square is profiled over them.  The outcomes are
linear in the velocity of a single striker, so that the profile over it is exact; in the
coefficients of restitution they are taken as linear over one standard error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cradle.fit.parameters import Key, Points, pair_keys
from cradle.fit.shots import ShotSet
from cradle.input.values import Vector

# Parameter points evaluated at a time, to bound the memory.
_CHUNK = 4096


@dataclass(frozen=True, eq=False)
class Responses:
    """Outcomes of one set of K shots at P points, and what they change with."""

    #: Velocities after the impact, shape (K, P, N); their change with each uncertain restitution,
    #: (K, P, N, E), and with one standard error of each measured velocity before, (K, P, N, M).
    outcome: Vector
    slopes: Vector
    movers: Vector


def responses(shots: ShotSet, points: Points, uncertain: Sequence[tuple[Key, float]]) -> Responses:
    """Solve one set of shots at all points, with the slopes that the profile needs."""
    moving = np.flatnonzero((shots.before != 0).any(axis=0))
    at_rest_exactly = not np.delete(shots.sigma_before, moving, axis=1).any()
    single = moving.size == 1 and (shots.before[:, moving[0]] > 0).all() and at_rest_exactly
    if single:
        before = np.zeros((1, 1, shots.masses.size))
        before[..., moving] = 1.0
    else:
        before = shots.before[:, None, :]
    outcome = points.outcomes(shots.types, shots.masses, before)
    slopes = np.zeros((*outcome.shape, len(uncertain)))
    for k, (key, sigma) in enumerate(uncertain):
        if key not in pair_keys(shots.types):
            continue
        e = points.restitution[key]
        up, down = min(1.0, e + sigma) - e, max(0.0, e - sigma) - e
        ends = [
            points.shifted(key, step).outcomes(shots.types, shots.masses, before)
            for step in (up, down)
        ]
        slopes[..., k] = (ends[0] - ends[1]) / (up - down)
    if single:
        # Homogeneous of degree one: the slope with the striker's velocity is the outcome itself.
        speed, error = (v[:, moving, None] for v in (shots.before, shots.sigma_before))
        return Responses(outcome * speed, slopes * speed[..., None], (outcome * error)[..., None])
    movers = []
    for ball in np.flatnonzero((shots.sigma_before > 0).any(axis=0)):
        step = np.zeros(shots.masses.size)
        step[ball] = shots.sigma_before[:, ball].max()
        ends = [
            points.outcomes(shots.types, shots.masses, before + sign * step) for sign in (1, -1)
        ]
        error = shots.sigma_before[:, ball, None, None]
        movers.append((ends[0] - ends[1]) / (2 * step[ball]) * error)
    columns = np.stack(movers, axis=-1) if movers else np.zeros((*outcome.shape, 0))
    return Responses(outcome, slopes, columns)


def normal_equations(shots: ShotSet, solved: Responses) -> tuple[Vector, Vector, Vector]:
    """Chi-square at the nominal restitution, its slope and curvature, profiled over `before`.

    Of restitution changed by d it is chi_square - 2 slope d + d curvature d.
    """
    residual = shots.after[:, None, :] - solved.outcome
    columns = np.concatenate([residual[..., None], solved.slopes], axis=-1)
    weight = (1.0 / shots.sigma**2)[:, None, :, None]
    products = np.einsum("kpni,kpnj->pij", columns, columns * weight)
    weighted = solved.movers * weight
    inner = np.einsum("kpnm,kpnl->kpml", solved.movers, weighted) + np.eye(weighted.shape[-1])
    cross = np.einsum("kpnm,kpni->kpmi", weighted, columns)
    products -= np.einsum("kpmi,kpmj->pij", cross, np.linalg.solve(inner, cross))
    return products[:, 0, 0], products[:, 0, 1:], products[:, 1:, 1:]


def chi_squares(
    sets: Sequence[ShotSet], points: Points, uncertain: Sequence[tuple[Key, float]]
) -> Vector:
    """Chi-square of all shots at each point, profiled over restitution and velocities before."""
    size = max((values.size for values in points.ratios.values()), default=1)
    parts = []
    for begin in range(0, size, _CHUNK):
        part = slice(begin, begin + _CHUNK)
        some = Points(points.restitution, {k: v[part] for k, v in points.ratios.items()})
        parts.append(_profiled([normal_equations(s, responses(s, some, uncertain)) for s in sets],
                               uncertain))  # fmt: skip
    return np.concatenate(parts)


def _profiled(
    equations: Sequence[tuple[Vector, Vector, Vector]], uncertain: Sequence[tuple[Key, float]]
) -> Vector:
    """Add the sets up and profile over the coefficients of restitution that they share."""
    chi_square, slope, curvature = (sum(parts) for parts in zip(*equations, strict=True))
    if uncertain:
        curvature = curvature + np.diag([1.0 / sigma**2 for _, sigma in uncertain])
        step = np.linalg.solve(curvature, slope[..., None])[..., 0]
        chi_square = chi_square - (slope * step).sum(axis=-1)
    return np.asarray(chi_square)
