"""Tables of shots: one row per ball of each shot, read and checked."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from cradle.fit.shots import Shots, ShotSet
from cradle.input.csv import table_lines
from cradle.input.values import one_number, one_of

#: Columns that every table of shots has, and what they hold.
COLUMNS = {
    "set": "name of the arrangement; all shots of a set have the same balls in the same order",
    "shot": "number or name of the shot within its set",
    "ball": "position in the row, 1 at the left",
    "type": "what kind of ball it is; balls of one type are alike",
    "mass": "kg",
    "before": "velocity just before the impact, m/s, positive to the right",
    "after": "velocity after the impact, m/s",
    "sigma": "standard error of `after`, m/s",
}
#: One more column that may be there.
OPTIONAL = {
    "sigma_before": "standard error of `before`; if left out, sigma for a moving ball, 0 at rest",
}

_MASS_UNITS = {"kg": 1.0, "g": 1e-3}
_VELOCITY_UNITS = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3}
# What no ball of a cradle is likely to exceed, and what to say then: the unit is probably another.
_LIKELY = {
    "mass": (5.0, "kg", "grams: say mass_unit='g'", "mass_unit='kg'"),
    "before": (20.0, "m/s", "cm/s: say velocity_unit='cm/s'", "velocity_unit='m/s'"),
}
_LIKELY["after"] = _LIKELY["before"]
_ABOVE = "must be above 0"
# A defect of a measurement counts from so many standard errors on.
_BEYOND = 5.0


class _Row(NamedTuple):
    set: str
    shot: str
    ball: int
    type: str
    mass: float
    before: float
    after: float
    sigma: float
    sigma_before: float
    where: str


def read_shots(
    source: str | Path | Any,
    *,
    mass_unit: str | None = None,
    velocity_unit: str | None = None,
    sigma: float | None = None,
) -> Shots:
    """Read a table of shots and check it.

    Parameters
    ----------
    source : path, binary file, DataFrame or mapping of columns
        A CSV file (UTF-8, comma, one header line; lines that begin with # and empty rows are
        skipped), a pandas DataFrame, or columns by name.  Columns: `COLUMNS` and `OPTIONAL`.
    mass_unit : {"kg", "g"}, optional
        Unit of the masses.  Left out, it is kg, and masses that look like grams are refused.
    velocity_unit : {"m/s", "cm/s", "mm/s"}, optional
        Unit of the velocities and their errors; likewise.
    sigma : float, optional
        Standard error of all velocities, in the unit of the velocities, for a table without it.

    Returns
    -------
    Shots
        The measured shots, in kg and m/s.

    Raises
    ------
    ValueError
        If a column is missing or there twice, sigma is given beside a column sigma, a value is
        wrong, balls pass through each other, or a shot gains more energy than its errors allow; the
        message names row and column.

    Examples
    --------
    >>> shots = read_shots(
    ...     {"set": ["AB", "AB"], "shot": [1, 1], "ball": [1, 2], "type": ["A", "B"],
    ...      "mass": [45, 53], "before": [1.0, 0.0], "after": [0.17, 0.70], "sigma": [0.01, 0.01]},
    ...     mass_unit="g",
    ... )
    >>> shots["AB"].masses
    array([0.045, 0.053])
    """
    lines = table_lines(source)
    if not lines:
        raise ValueError("the table has no rows")
    there = list(lines[0][1])
    for name in COLUMNS:
        if name not in there and (name != "sigma" or sigma is None):
            other = "; or give sigma=" if name == "sigma" else ""
            alike = [one for one in there if one.lower() == name]
            hint = "".join(f": write {one} in small letters" for one in alike)
            raise ValueError(
                f"column {name!r} is missing ({COLUMNS[name]}{other}); "
                f"there are {', '.join(there)}{hint}"
            )
    if sigma is not None:
        one_number("sigma", sigma, _ABOVE, 0.0, open_low=True)
        if "sigma" in there:
            raise ValueError(f"sigma = {sigma!r}; the table has a column sigma: leave out one of "
                             "them")  # fmt: skip
    scale = (_MASS_UNITS[one_of("mass_unit", mass_unit or "kg", list(_MASS_UNITS))],
             _VELOCITY_UNITS[one_of("velocity_unit", velocity_unit or "m/s",
                                    list(_VELOCITY_UNITS))])  # fmt: skip
    rows = [_row(where, line, scale, sigma) for where, line in lines]
    for name, (limit, unit, other, same) in _LIKELY.items():
        given = mass_unit if name == "mass" else velocity_unit
        for row in rows:
            if given is None and abs(value := getattr(row, name)) > limit:
                rule = f"is it in {other} (or in {unit} indeed: say {same})"
                _refuse(row.where, name, f"{value:g} {unit} is unlikely; {rule}")
    groups: dict[str, dict[str, list[_Row]]] = {}
    for row in rows:
        groups.setdefault(row.set, {}).setdefault(row.shot, []).append(row)
    return Shots(tuple(_shot_set(name, shots) for name, shots in groups.items()))


def _refuse(where: str, column: str, words: str) -> NoReturn:
    raise ValueError(f"{where}, column {column}: {words}") from None


def _row(where: str, line: dict[str, Any], scale: tuple[float, float], sigma: float | None) -> _Row:
    """Return one row in kg and m/s."""

    def number(name: str, rule: str = "must be finite", low: float = -np.inf) -> float:
        place = f"{where}, column {name}"
        try:
            value = float(line[name])
        except (TypeError, ValueError):
            raise ValueError(f"{place} = {line[name]!r}; must be a number") from None
        return one_number(place, value, rule, low, open_low=rule == _ABOVE)

    ball, mass = number("ball"), number("mass", _ABOVE, 0.0) * scale[0]
    if ball < 1 or ball != int(ball):
        _refuse(where, "ball", f"{line['ball']!r}; must be 1, 2, ... from the left")
    before, after = number("before") * scale[1], number("after") * scale[1]
    error = scale[1] * (number("sigma", _ABOVE, 0.0) if sigma is None else float(sigma))
    earlier = error if before else 0.0
    if line.get("sigma_before") not in (None, ""):
        earlier = scale[1] * number("sigma_before", "must be at least 0", 0.0)
    group, shot, kind = (str(line[name]).strip() for name in ("set", "shot", "type"))
    return _Row(group, shot, int(ball), kind, mass, before, after, error, earlier, where)


def _shot_set(name: str, shots: dict[str, list[_Row]]) -> ShotSet:
    """Put the rows of a set together; all its shots have the same balls."""
    table = [sorted(rows, key=lambda row: row.ball) for rows in shots.values()]
    first = table[0]
    for (shot, given), rows in zip(shots.items(), table, strict=True):
        places, what = [row.ball for row in rows], f"set {name}, shot {shot} has"
        if len(rows) < 2 or places != list(range(1, len(rows) + 1)):
            _refuse(given[0].where, "ball", f"{what} balls {places}; each shot needs 1, 2, ... N, "
                                            "each once, N >= 2")  # fmt: skip
        if len(rows) != len(first):
            _refuse(rows[0].where, "ball", f"{what} {len(rows)} balls; the first shot of the set "
                                           f"has {len(first)}")  # fmt: skip
        for row, model in zip(rows, first, strict=True):
            for column in ("type", "mass"):
                value, usual = getattr(row, column), getattr(model, column)
                if value != usual:
                    words = f"{value!r}; ball {row.ball} of set {name} has {usual!r} elsewhere"
                    _refuse(row.where, column, words)
        _check_physics(f"set {name}, shot {shot}", rows)
    types = "".join(row.type for row in first)
    rest = name.removeprefix(types)
    if rest != name and rest.isalpha() and rest.isupper():  # all other names are free
        _refuse(first[0].where, "set", f"set {name} has the balls {types} alone; is the row of "
                f"ball {len(first) + 1} missing?  If not, give the set another name")  # fmt: skip
    values = {
        column: np.array([[getattr(row, column) for row in rows] for rows in table])
        for column in ("before", "after", "sigma", "sigma_before")
    }
    masses = np.array([row.mass for row in first])
    return ShotSet(name, tuple(row.type for row in first), tuple(shots), masses, **values)


def _check_physics(what: str, rows: list[_Row]) -> None:
    """Raise if no balls approach, balls pass through each other, or energy is gained."""
    if all(a.before <= b.before for a, b in pairwise(rows)):
        _refuse(rows[0].where, "before", f"{what}: no balls approach")
    for left, right in pairwise(rows):
        if left.after - right.after > _BEYOND * np.hypot(left.sigma, right.sigma):
            _refuse(right.where, "after", f"{what}: ball {left.ball} at {left.after:g} m/s "
                    f"would pass through ball {right.ball} at {right.after:g} m/s")  # fmt: skip
    gain = sum(0.5 * r.mass * (r.after**2 - r.before**2) for r in rows)
    error = np.sqrt(sum(
        r.mass**2 * ((r.after * r.sigma) ** 2 + (r.before * r.sigma_before) ** 2) for r in rows
    ))  # fmt: skip
    if gain > _BEYOND * error:
        share = gain / sum(0.5 * r.mass * r.before**2 for r in rows)
        raise ValueError(
            f"{rows[0].where}, columns before and after: {what} gains {100 * share:.3g} % of its "
            f"energy, {gain / error:.3g} standard errors; check units, signs and sigma"
        )
