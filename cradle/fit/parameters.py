"""What is fitted, named by the types of the balls, and how well values of it explain shots.

The velocities before an impact are measured too, and the coefficients of restitution are known
with errors only.  Both enter as nuisances: chi-square is profiled over them.  The outcomes are
linear in the velocity of a single striker, so that the profile over it is exact; in the
coefficients of restitution they are taken as linear over one standard error.
"""

from collections.abc import KeysView, Mapping, Sequence
from itertools import chain, pairwise
from typing import Any

import numpy as np

from cradle.fit.shots import ShotSet
from cradle.input.values import Vector, shown
from cradle.models.batch import post_impact_velocities

#: A parameter: the types of two balls (restitution, in alphabetical order) or of three (ratio).
Key = tuple[str, ...]
#: Parameters at P points: of shape (P,), or a number for all points.
Values = Mapping[Key, Any]
Uncertain = Sequence[tuple[Key, float]]

_CHUNK = 4096  # parameter points evaluated at a time, to bound the memory


def label(key: Key) -> str:
    """Return the name of a parameter, such as "ABC" or "steel-brass"."""
    return ("" if all(len(name) == 1 for name in key) else "-").join(key)


def parameter_key(name: str | Sequence[str]) -> Key:
    """Return the types of balls that a name joins."""
    return tuple(name.split("-") if isinstance(name, str) and "-" in name else name)


def types_in_a_row(types: str | Sequence[str]) -> Key:
    """Return the types of a row of balls, at least two."""
    row = parameter_key(types)
    if len(row) < 2:
        raise ValueError(f"types = {shown(types)}; must name at least 2 balls")
    return row


def pair_keys(types: Sequence[str]) -> list[Key]:
    """Return the restitution parameter of each contact."""
    return [tuple(sorted(pair)) for pair in pairwise(types)]


def triplet_keys(types: Sequence[str]) -> tuple[list[Key], list[Key]]:
    """Return the forward and the backward ratio parameter of each interior ball."""
    forward = [tuple(types[i : i + 3]) for i in range(len(types) - 2)]
    return forward, [key[::-1] for key in forward]


def ratio_keys(types: Sequence[str]) -> KeysView[Key]:
    """Return the ratio parameters of a chain, of both ways, each once."""
    return dict.fromkeys(chain.from_iterable(zip(*triplet_keys(types), strict=True))).keys()


def fitted_keys(types: Sequence[str]) -> KeysView[Key]:
    """Return what shots of a chain are fitted for: of a pair its restitution, else its ratios."""
    return ratio_keys(types) or dict.fromkeys(pair_keys(types)).keys()


def outcomes(types: Sequence[str], masses: Vector, velocities: Vector, values: Values) -> Vector:
    """Solve a chain at P points; velocities (..., 1, N) -> (..., P, N)."""
    e, forward, backward = (
        np.stack(np.broadcast_arrays(*(values[key] for key in keys)), axis=-1)
        if keys else np.zeros((1, 0))
        for keys in (pair_keys(types), *triplet_keys(types))
    )  # fmt: skip
    return post_impact_velocities(masses, velocities, e, forward, backward, excess="saturate")


def normal_equations(
    shots: ShotSet, values: Values, uncertain: Uncertain
) -> tuple[Vector, Vector, Vector]:
    """Chi-square c - 2 s d + d k d of restitution changed by d, profiled over `before`: c, s, k."""
    # Velocities after K shots at P points, (K, P, N), and lists of their changes: by one standard
    # error of each of M measured velocities before, and of each uncertain restitution.
    moving = np.flatnonzero((shots.before != 0).any(axis=0))
    at_rest_exactly = not np.delete(shots.sigma_before, moving, axis=1).any()
    single = moving.size == 1 and (shots.before[:, moving] > 0).all() and at_rest_exactly
    unit = np.eye(shots.masses.size)
    before = unit[None, moving] if single else shots.before[:, None, :]

    def solve(changed: Values, change: Vector | float = 0.0) -> Vector:
        return outcomes(shots.types, shots.masses, before + change, {**values, **changed})

    outcome, moved = solve({}), []
    slopes = [np.zeros_like(outcome)] * len(uncertain)
    for k, (key, sigma) in enumerate(uncertain):
        if key in pair_keys(shots.types):
            low, high = max(0.0, values[key] - sigma), min(1.0, values[key] + sigma)
            slopes[k] = (solve({key: high}) - solve({key: low})) / (high - low)
    if single:
        # Homogeneous of degree one: the slope with the striker's velocity is the outcome itself.
        speed, error = (v[:, moving, None] for v in (shots.before, shots.sigma_before))
        slopes, moved, outcome = [s * speed for s in slopes], [outcome * error], outcome * speed
    else:
        for ball in np.flatnonzero((shots.sigma_before > 0).any(axis=0)):
            error = shots.sigma_before[:, ball, None, None]
            step = unit[ball] * error.max()
            moved.append((solve({}, step) - solve({}, -step)) / (2 * error.max()) * error)
    columns = np.stack([shots.after[:, None, :] - outcome, *slopes], axis=-1)
    movers = np.stack([*moved, outcome], axis=-1)[..., :-1]  # M may be 0
    weight = (1.0 / shots.sigma**2)[:, None, :, None]
    products = np.einsum("kpni,kpnj->pij", columns, columns * weight)
    weighted = movers * weight
    inner = np.einsum("kpnm,kpnl->kpml", movers, weighted) + np.eye(len(moved))
    cross = np.einsum("kpnm,kpni->kpmi", weighted, columns)
    products -= np.einsum("kpmi,kpmj->pij", cross, np.linalg.solve(inner, cross))
    return products[:, 0, 0], products[:, 0, 1:], products[:, 1:, 1:]


def chi_squares(sets: Sequence[ShotSet], values: Values, uncertain: Uncertain) -> Vector:
    """Chi-square of all shots at each point, profiled over restitution and velocities before."""
    size = max(np.size(value) for value in values.values())
    found = []
    for begin in range(0, size, _CHUNK):
        some = {key: value[begin : begin + _CHUNK] if np.size(value) == size > 1 else value
                for key, value in values.items()}  # fmt: skip
        parts = zip(*(normal_equations(one, some, uncertain) for one in sets), strict=True)
        chi_square, slope, curvature = (np.asarray(sum(part)) for part in parts)
        if uncertain:  # profiled over the coefficients of restitution that the sets share
            curvature = curvature + np.diag([1.0 / sigma**2 for _, sigma in uncertain])
            step = np.linalg.solve(curvature, slope[..., None])[..., 0]
            chi_square = chi_square - (slope * step).sum(axis=-1)
        found.append(chi_square)
    return np.concatenate(found)
