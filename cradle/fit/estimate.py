"""Coefficients of restitution and Impulse Correlation Ratios from measured shots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from cradle.fit.answers import Estimate, Group
from cradle.fit.likelihood import chi_squares
from cradle.fit.parameters import (
    Key,
    Points,
    label,
    pair_keys,
    parameter_key,
    ratio_keys,
    triplet_keys,
)
from cradle.fit.result import Fit
from cradle.fit.search import RISE, Mode, refine, scan
from cradle.fit.shots import Shots, ShotSet
from cradle.input.values import Vector, checked, one_number
from cradle.kernel.state import LIMITS

# Values of a coefficient or ratio on the first grid.
_GRID = 2001
# Points at which it is tried whether a ratio acts at all.
_TRIALS = 513

Known = Mapping[str, "float | tuple[float, float]"]


def restitution(shots: Shots) -> Fit:
    """Fit the coefficient of restitution of every pair of balls that was shot alone.

    Parameters
    ----------
    shots : Shots
        Sets of two balls are used; others are left aside.

    Returns
    -------
    Fit
        One estimate a pair, named by its types in alphabetical order.

    Raises
    ------
    ValueError
        If no set has two balls.

    Notes
    -----
    Two balls need no model: momentum and e give the velocities.  Chi-square is profiled over the
    velocities before the impact, exactly.

    Examples
    --------
    >>> from cradle.fit import read_shots
    >>> from cradle.tables import data_folder
    >>> restitution(read_shots(data_folder() / "shots_template.csv"))
    Fit(restitution AB = 0.5270 [0.5113, 0.5429]; chi-square 0.8 of 3)
    """
    pairs: dict[Key, list[ShotSet]] = {}
    for one in shots.sets:
        if len(one.types) == 2:
            pairs.setdefault(pair_keys(one.types)[0], []).append(one)
    if not pairs:
        raise ValueError("no set has two balls; restitution comes from pairs")
    estimates, chi_square, freedom = {}, 0.0, -len(pairs)
    for key, sets in sorted(pairs.items()):

        def chi(e: Vector, sets: Sequence[ShotSet] = sets) -> Vector:
            return np.asarray(sum(_pair_chi_square(one, e) for one in sets))

        found = scan(chi, np.linspace(0.0, 1.0, _GRID))
        estimates[label(key)] = Estimate.of("restitution", key, found, 1.0)
        chi_square += found.lowest
        freedom += sum(one.after.size for one in sets)
    return Fit(shots, estimates, {}, (), chi_square, freedom)


def _pair_chi_square(shots: ShotSet, e: Vector) -> Vector:
    """Chi-square of shots of two balls at each e, profiled over the velocities before."""
    m1, m2 = shots.masses
    share = np.array([[m1, m2], [m1, m2]]) / (m1 + m2)
    relative = np.array([[-m2, m2], [m1, -m1]]) / (m1 + m2)
    matrix = share + e[:, None, None] * relative  # after = matrix @ before
    residual = shots.after[:, None, :] - np.einsum("pij,kj->kpi", matrix, shots.before)
    covariance = np.einsum("pij,kj,plj->kpil", matrix, shots.sigma_before**2, matrix)
    covariance = covariance + (np.eye(2) * shots.sigma[:, None, :] ** 2)[:, None]
    solved = np.linalg.solve(covariance, residual[..., None])[..., 0]
    return np.asarray((residual * solved).sum(axis=(0, 2)))


def restitution_from_heights(name: str, drop: ArrayLike, rise: ArrayLike, sigma: float) -> Fit:
    """Fit the coefficient of restitution of a ball that bounces on something very heavy.

    Parameters
    ----------
    name : str
        Name of the pair, such as "AB".
    drop, rise : array_like, shape (K,)
        Heights above the point of contact before and after, in the same unit; above 0.
    sigma : float
        Standard error of each height, in that unit.

    Returns
    -------
    Fit
        One estimate.  The speeds are as the square roots of the heights: e^2 = rise / drop.

    Raises
    ------
    ValueError
        If a height or the error is not above 0, or the lengths differ.

    Examples
    --------
    >>> restitution_from_heights("AA", [1.0, 1.0], [0.88, 0.90], 0.01)
    Fit(restitution AA = 0.9434 [0.9336, 0.9533]; chi-square 1.1 of 1)
    """
    high = checked("drop", drop, "must be above 0", 0.0, open_low=True)
    low = checked("rise", rise, "must be above 0", 0.0, open_low=True)
    error = float(checked("sigma", sigma, "must be above 0", 0.0, open_low=True))
    if high.ndim != 1 or high.shape != low.shape:
        raise ValueError(f"drop has shape {high.shape}, rise {low.shape}; must be alike, (K,)")

    def chi(e: Vector) -> Vector:
        square = e[:, None] ** 2
        return np.asarray(((low - square * high) ** 2 / (1 + square**2)).sum(axis=1) / error**2)

    key = parameter_key(name)
    found = scan(chi, np.linspace(0.0, 1.0, _GRID))
    estimate = Estimate.of("restitution", key, found, 1.0)
    return Fit(Shots(()), {label(key): estimate}, {}, (), found.lowest, high.size - 1)


def ratio(
    shots: Shots, restitution: Fit | Known, *, known: Mapping[str, float] | None = None
) -> Fit:
    """Fit the Impulse Correlation Ratio of every triplet in shots of three balls and more.

    Triplets whose ratios act in the same shots are fitted together.

    Parameters
    ----------
    shots : Shots
        Sets of three balls and more are used.
    restitution : Fit or mapping
        Of every pair of neighbours: the result of `restitution`, or a mapping from the pair's name
        to the coefficient or to (coefficient, standard error).
    known : mapping, optional
        Ratios that are not to be fitted, from the triplet's name to the ratio.  With it no set
        needs three balls: what is known predicts, and nothing is fitted.

    Returns
    -------
    Fit
        One estimate for each triplet and direction that is not known.  The ratios lie between 0 and
        the bound of three balls (Eq. 34).

    Raises
    ------
    ValueError
        If no set has three balls and nothing is known, a coefficient of restitution is missing, a
        known ratio is above its bound, or more than six ratios act together.

    References
    ----------
    Ceanga and Hurmuzlu, J. Appl. Mech. 68 (2001) 575-583, section 4.2, fits one ratio at a time.

    Examples
    --------
    >>> from cradle.fit import read_shots
    >>> from cradle.tables import data_folder
    >>> shots = read_shots(data_folder() / "shots_template.csv")
    >>> ratio(shots, {"AB": (0.53, 0.01)})
    Fit(ratio ABA = 0.109 [0.071, 0.146]; chi-square 0.2 of 2)
    """
    sets = [one for one in shots.sets if len(one.types) > 2]
    if not sets and known is None:
        raise ValueError("no set has three balls or more; ratios come from triplets")
    values, errors = _restitution_values(restitution, sets)
    fixed = _known_ratios(known or {}, shots.masses)
    bounds = {key: m for one in sets for key, m in _bounds(one).items() if key not in fixed}
    acting = {key for key in bounds if any(_acts(key, one, bounds, fixed, values) for one in sets)}
    estimates: dict[str, Estimate] = {}
    groups, chi_square, freedom = [], 0.0, -len(acting)
    for keys, members in _components(sets, acting):
        group, found, lowest = _fit_group(keys, members, bounds, fixed, (values, errors))
        groups.append(group)
        estimates.update({label(estimate.key): estimate for estimate in found})
        chi_square += lowest
        freedom += sum(one.after.size for one in members)
    for key in bounds:
        estimates.setdefault(label(key), Estimate.unidentified("ratio", key, bounds[key]))
    order = sorted(estimates, key=lambda name: list(map(label, bounds)).index(name))
    kept = {label(key): (value, errors.get(key, 0.0)) for key, value in values.items()}
    return Fit(shots, {name: estimates[name] for name in order}, kept, tuple(groups),
               chi_square, freedom, {label(k): v for k, v in fixed.items()})  # fmt: skip


def _with_error(name: str, given: float | tuple[float, float]) -> tuple[float, float]:
    """Return a value and its standard error, 0 if it was given alone."""
    numbers = np.atleast_1d(checked(name, given))
    if numbers.size not in (1, 2):
        raise ValueError(f"{name} = {given!r}; must be a number, or a number and its error")
    value = checked(name, numbers[0], "must lie in [0, 1]", 0.0, 1.0)
    error = float(numbers[1]) if numbers.size > 1 else 0.0
    if error < 0:
        raise ValueError(f"{name}[1] = {error!r}; a standard error must be at least 0")
    return float(value), error


def _restitution_values(
    given: Fit | Known, sets: Sequence[ShotSet]
) -> tuple[dict[Key, float], dict[Key, float]]:
    """Return the coefficients and their errors by pair; all that the sets need are there."""
    table = given.values() if isinstance(given, Fit) else given
    values, errors = {}, {}
    for name, value in table.items():
        key = tuple(sorted(parameter_key(name)))
        values[key], error = _with_error(f"restitution[{name!r}]", value)
        if error > 0:
            errors[key] = error
    for one in sets:
        for key in pair_keys(one.types):
            if key not in values:
                raise ValueError(
                    f"restitution has no {label(key)!r}, which set {one.name} needs; "
                    f"it has {', '.join(map(label, values)) or 'nothing'}"
                )
    return values, errors


def _known_ratios(known: Mapping[str, float], masses: Mapping[str, float]) -> dict[Key, float]:
    """Return the ratios that are not fitted; none is above the bound of its balls, to be held."""
    fixed = {}
    for given, value in known.items():
        key, name = parameter_key(given), f"known[{given!r}]"
        fixed[key] = one_number(name, value, "must lie in [0, 1]", 0.0, 1.0)
        if len(key) == 3 and masses.keys() >= set(key):
            bound = masses[key[2]] / (masses[key[1]] + masses[key[2]])
            rule = f"must not exceed the bound of these balls, {bound:.6g} (Eq. 34)"
            one_number(name, value, rule, high=bound * LIMITS.rounded)
    return fixed


def _bounds(one: ShotSet) -> dict[Key, float]:
    """Largest ratio of each triplet of a set and of its reverse, for three balls (Eq. 34)."""
    m, bounds = one.masses, {}
    for i, (forward, backward) in enumerate(zip(*triplet_keys(one.types), strict=True)):
        bounds[forward] = float(m[i + 2] / (m[i + 1] + m[i + 2]))
        bounds[backward] = float(m[i] / (m[i] + m[i + 1]))
    return bounds


def _acts(
    key: Key, one: ShotSet, bounds: Mapping[Key, float], fixed: Mapping[Key, float],
    restitution: Mapping[Key, float],
) -> bool:  # fmt: skip
    """Tell whether a ratio changes any outcome of a set, tried at points all over the ranges."""
    keys = ratio_keys(one.types)
    if key not in keys:
        return False
    # Multiples of irrational numbers fill a box evenly.
    turns = np.arange(1, _TRIALS + 1)
    ratios = {}
    for place, k in enumerate(sorted(keys)):
        part = (turns * np.sqrt(place + 2.0)) % 1.0
        ratios[k] = np.full(_TRIALS, fixed[k]) if k in fixed else bounds[k] * part
    # Outcomes go with the speed: shots that differ in nothing else are solved once.
    speeds = np.abs(one.before).max(axis=1, keepdims=True)
    before = np.unique(one.before / speeds, axis=0)[:, None, :]
    base = Points(restitution, ratios).outcomes(one.types, one.masses, before)
    for value in (0.0, 0.5 * bounds[key], bounds[key]):
        changed = {**ratios, key: np.full(_TRIALS, value)}
        outcome = Points(restitution, changed).outcomes(one.types, one.masses, before)
        if (np.abs(outcome - base) > 1e-9).any():
            return True
    return False


def _components(sets: Sequence[ShotSet], acting: set[Key]) -> list[tuple[list[Key], list[ShotSet]]]:
    """Return groups of ratios that act in the same sets, with those sets."""
    groups: list[tuple[set[Key], list[ShotSet]]] = []
    for one in sets:
        keys = ratio_keys(one.types) & acting
        touched = [group for group in groups if group[0] & keys]
        groups = [group for group in groups if group not in touched]
        members = [member for group in touched for member in group[1]]
        groups.append((keys.union(*(group[0] for group in touched)), [*members, one]))
    return [(sorted(keys), members) for keys, members in groups if keys]


def _fit_group(
    keys: list[Key], sets: Sequence[ShotSet], bounds: Mapping[Key, float],
    fixed: Mapping[Key, float], known: tuple[dict[Key, float], dict[Key, float]],
) -> tuple[Group, list[Estimate], float]:  # fmt: skip
    """Fit the ratios that act together."""
    values, errors = known
    needed = {key for one in sets for key in pair_keys(one.types)}
    uncertain = [(key, sigma) for key, sigma in sorted(errors.items()) if key in needed]
    silent = {key for one in sets for key in ratio_keys(one.types)} - set(keys)

    def chi(points: Vector) -> Vector:
        columns = points[:, None] if points.ndim == 1 else points
        ratios = {key: columns[:, i] for i, key in enumerate(keys)}
        for key in silent:  # those without effect may have any value
            ratios[key] = np.full(len(columns), fixed.get(key, 0.0))
        return chi_squares(sets, Points(values, ratios), uncertain)

    if len(keys) == 1:
        bound = bounds[keys[0]]
        # Near the bound the outcome goes like the square root of what is left to it.
        grid = bound * (1.0 - np.linspace(1.0, 0.0, _GRID) ** 2)
        found = scan(chi, grid)
        group = Group((keys[0],), grid[:, None], found.excess, np.gradient(grid))
        return group, [Estimate.of("ratio", keys[0], found, bound)], found.lowest
    upper = np.array([bounds[key] for key in keys])
    region = refine(chi, upper)
    estimates = []
    for axis, key in enumerate(keys):
        modes = tuple(Mode(float(point[axis]), excess) for point, excess in region.modes)
        intervals = tuple((low, min(high, bounds[key])) for low, high in region.intervals(axis))
        low = region.excess <= 4 * RISE
        order = np.argsort(region.points[low, axis])
        estimates.append(
            Estimate.at("ratio", key, modes, intervals, bounds[key],
                        region.points[low, axis][order], region.excess[low][order])
        )  # fmt: skip
    weights = np.ones(len(region.points))
    return Group(tuple(keys), region.points, region.excess, weights), estimates, region.lowest
