"""Coefficients of restitution and Impulse Correlation Ratios from measured shots."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from cradle.fit import parameters
from cradle.fit.parameters import Key, fitted_keys, label, pair_keys, parameter_key, ratio_keys
from cradle.fit.result import Estimate, Fit, Group
from cradle.fit.search import refine, scan
from cradle.fit.shots import Shots, ShotSet
from cradle.input.values import PART, Vector, checked, flag, must_be, one_number
from cradle.kernel.state import LIMITS

_TRIALS = 513  # points at which it is tried whether a ratio acts at all
Known = Mapping[str, "float | tuple[float, float]"]


def restitution(shots: Shots) -> Fit:
    """Fit the coefficient of restitution of every pair of balls that was shot alone.

    There is one estimate for each pair, named by its types in alphabetical order.  Sets of more
    balls are not used; if there is no set of two, a ValueError is raised.

    Examples
    --------
    >>> from cradle.fit import read_shots, restitution
    >>> from cradle.tables import data_folder
    >>> print(restitution(read_shots(data_folder() / "shots_template.csv")).summary())
    restitution AB = 0.5270 [0.5113, 0.5429], standard error 0.0081
    chi-square 0.8, degrees of freedom 3, chance 0.85
    residuals of AB: 0.4 standard errors, the largest 0.6 (shot 1, ball 1)
    """
    sets = must_be(Shots, "shots", shots).sets
    pairs = sorted(pair_keys(one.types)[0] for one in sets if len(one.types) == 2)
    if not pairs:
        raise ValueError("no set has two balls; restitution comes from pairs")
    return _fitted(shots, "restitution", dict.fromkeys(pairs, 1.0), {}, {}, int)


def ratio(
    shots: Shots, restitution: Fit | Known, *, known: Mapping[str, float] | None = None,
    progress: bool = False,
) -> Fit:  # fmt: skip
    """Fit the Impulse Correlation Ratio of every triplet in shots of three balls and more.

    There is one estimate for each triplet and direction that is not known, between 0 and the bound
    of three balls (Eq. 34).  Ratios that act in the same shots, six at most, are fitted together;
    Ceanga and Hurmuzlu fit one at a time (section 4.2).  A ValueError says that no set has three
    balls and nothing is known, a restitution is missing, or a known ratio is above its bound.

    Parameters
    ----------
    shots : Shots
        Sets of two balls are not used.
    restitution : Fit or mapping
        The result of `restitution`; or, by the names of the pairs, coefficients, or tuples of a
        coefficient and its standard error.
    known : mapping, optional
        Ratios not to be fitted, by triplet; if given, no set needs three balls.
    progress : bool
        After two seconds, show how many points were tried; six ratios need 2.5 million.

    Examples
    --------
    >>> from cradle.fit import ratio, read_shots
    >>> from cradle.tables import data_folder
    >>> shots = read_shots(data_folder() / "shots_template.csv")
    >>> fit = ratio(shots, {"AB": (0.53, 0.01)})
    >>> fit
    Fit(ratio ABA = 0.109 [0.071, 0.146]; chi-square 0.2 of 2)
    >>> fit.predict("ABA")
    Prediction(ABA: 0.129 [0.110, 0.148], 0.243 [0.230, 0.256], 0.585 [0.571, 0.600] m/s)
    """
    sets = [one for one in must_be(Shots, "shots", shots).sets if len(one.types) > 2]
    if not sets and known is None:
        raise ValueError("no set has three balls or more; ratios come from triplets")
    from tqdm import tqdm

    given, fixed, masses = _restitution_values(restitution, sets), dict[Key, float](), shots.masses
    for triplet, value in must_be(Mapping, "known", {} if known is None else known).items():
        key, name = parameter_key(triplet), f"known[{triplet!r}]"
        if len(key) != 3 or not masses.keys() >= set(key):
            raise ValueError(f"{name}; must name three of the balls {', '.join(masses)}")
        bound = _bound(key, masses)
        rule = f"must be 0 to the bound of these balls, {bound:.6g} (Eq. 34)"
        fixed[key] = one_number(name, value, rule, 0.0, bound * LIMITS.rounded)
    bounds = {key: _bound(key, masses)
              for one in sets for key in ratio_keys(one.types) if key not in fixed}  # fmt: skip
    with tqdm(unit=" points", delay=2.0, disable=not flag("progress", progress)) as bar:
        return _fitted(shots, "ratio", bounds, given, fixed, bar.update)


def _restitution_values(
    given: Fit | Known, sets: Sequence[ShotSet]
) -> dict[Key, tuple[float, float]]:
    """Return the coefficients and their errors by pair; all that the sets need are there."""
    told: Any = given.values() if isinstance(given, Fit) else given
    told = must_be(Mapping, "restitution", dict(told) if hasattr(told, "keys") else told)
    values = {}
    for pair, value in told.items():
        key, name = tuple(sorted(parameter_key(pair))), f"restitution[{pair!r}]"
        numbers = np.atleast_1d(checked(name, value)).tolist()
        if len(numbers) not in (1, 2):
            raise ValueError(f"{name} = {value!r}; must be a number, or a number and its error")
        e, error = (*numbers, 0.0)[:2]
        values[key] = one_number(name, e, *PART), error
        one_number(f"{name}[1]", error, "a standard error must be at least 0", 0.0)
    for one in sets:
        for key in pair_keys(one.types):
            if key not in values:
                there = ", ".join(map(label, values)) or "nothing"
                needs = f"{label(key)!r}, which set {one.name} needs"
                raise ValueError(f"restitution has no {needs}; it has {there}")
    return values


def _bound(key: Key, masses: Mapping[str, float]) -> float:
    """Return the largest ratio of three balls (Eq. 34)."""
    return masses[key[2]] / (masses[key[1]] + masses[key[2]])


def _acting(one: ShotSet, bounds: Mapping[Key, float], given: Mapping[Key, float]) -> set[Key]:
    """Return the ratios that change any outcome of a set, tried at points all over the ranges."""
    keys = sorted(fitted_keys(one.types) & bounds.keys())
    points = np.random.default_rng(0).random((len(keys), _TRIALS))
    values = {**given, **{key: bounds[key] * x for key, x in zip(keys, points, strict=True)}}
    # Outcomes go with the speed: shots that differ in nothing else are solved once.
    speeds = np.abs(one.before).max(axis=1, keepdims=True)
    before = np.unique(one.before / speeds, axis=0)[:, None, :]

    def solved(changed: Mapping[Key, float]) -> Vector:
        return parameters.outcomes(one.types, one.masses, before, {**values, **changed})

    base = solved({})
    return {key for key in keys for share in (0.0, 0.5, 1.0)
            if (np.abs(solved({key: share * bounds[key]}) - base) > 1e-9).any()}  # fmt: skip


def _together(acting: Iterable[set[Key]]) -> list[list[Key]]:
    """Join the ratios that act in the same sets."""
    groups: list[set[Key]] = []
    for keys in filter(None, acting):
        joined = keys.union(*(group for group in groups if group & keys))
        groups = [*(group for group in groups if not group & keys), joined]
    return [sorted(group) for group in groups]


def _fitted(
    shots: Shots, kind: str, bounds: Mapping[Key, float], given: Mapping[Key, tuple[float, float]],
    fixed: Mapping[Key, float], tell: Callable[[int], Any],
) -> Fit:  # fmt: skip
    """Fit those of the parameters with these bounds that act in the shots."""
    uncertain = [(key, error) for key, (_, error) in sorted(given.items()) if error]
    known = {**{key: value for key, (value, _) in given.items()}, **fixed}
    sets = [one for one in shots.sets if fitted_keys(one.types) & bounds.keys()]
    acting = set[Key]().union(*(_acting(one, bounds, known) for one in sets))
    known = {**dict.fromkeys(bounds, 0.0), **known}  # without effect: any value

    def chi(keys: list[Key], members: list[ShotSet], points: Vector) -> Vector:
        values = {**known, **dict(zip(keys, points.T, strict=True))}
        tell(len(points))
        return parameters.chi_squares(members, values, uncertain)

    found = {label(key): Estimate.of(kind, key, bound, None) for key, bound in bounds.items()}
    groups, chi_square, freedom = [], 0.0, 0
    for keys in _together(fitted_keys(one.types) & acting for one in sets):
        members = [one for one in sets if fitted_keys(one.types) & {*keys}]
        search = refine if len(keys) > 1 else scan
        upper = np.array([bounds[key] for key in keys])
        scans, points, density, lowest = search(partial(chi, keys, members), upper)
        if kind == "ratio":
            groups.append(Group(tuple(keys), points, density))
        for key, one in zip(keys, scans, strict=True):
            found[label(key)] = Estimate.of(kind, key, bounds[key], one)
        chi_square += lowest
        freedom += sum(one.after.size for one in members) - len(keys)
    named = {label(key): value for key, value in given.items()}
    held = {label(key): value for key, value in fixed.items()}
    return Fit(shots, found, named, tuple(groups), chi_square, freedom, held)
