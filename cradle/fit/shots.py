"""What is measured: shots, velocities before and after impacts, read from tables and checked."""

from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import scipy

from cradle.input.csv import table_lines
from cradle.input.values import ABOVE_ZERO, Vector, one_number, one_of

#: Columns of a table of shots, and what they hold.
COLUMNS = {
    "set": "name of the arrangement; all shots of a set have the same balls in the same order",
    "shot": "number or name of the shot within its set",
    "ball": "position in the row, 1 at the left",
    "type": "what kind of ball it is; balls of one type are alike",
    "mass": "kg",
    "before": "velocity just before the impact, m/s, positive to the right",
    "after": "velocity after the impact, m/s",
    "sigma": "standard error of `after`, m/s",
    "sigma_before": "standard error of `before`; if left out, sigma for a moving ball, 0 at rest",
}

# Units, the first if none is told; what no ball of a cradle is likely to exceed; another unit that
# such a number may be in, in words and as an option.
_UNITS: dict[str, tuple[dict[str, float], float, str, str]] = {
    "mass_unit": ({"kg": 1.0, "g": 1e-3}, 5.0, "grams", "g"),
    "velocity_unit": ({"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3}, 20.0, "cm/s", "cm/s"),
}
_RULES = {"mass": ABOVE_ZERO, "sigma": ABOVE_ZERO, "sigma_before": ("must be at least 0", 0.0)}
_BEYOND = 5.0  # standard errors from which on a defect of a measurement counts
_MEASURED = ("before", "after", "sigma", "sigma_before")
_Row = dict[str, Any]  # cells by column, in kg and m/s, and under "where" the place in the source


@dataclass(frozen=True, eq=False)
class ShotSet:
    """K shots of one arrangement of N balls."""

    name: str  #: Name of the arrangement.
    types: tuple[str, ...]  #: Types of the N balls, left to right.
    shots: tuple[str, ...]  #: Names of the K shots.
    masses: Vector  #: Masses, shape (N,), kg.
    before: Vector  #: Velocities before the impact, shape (K, N), m/s.
    after: Vector  #: Velocities after the impact, shape (K, N), m/s.
    sigma: Vector  #: Standard errors of `after`, shape (K, N), m/s.
    sigma_before: Vector  #: Standard errors of `before`, shape (K, N), m/s.

    @property
    def momentum_residuals(self) -> Vector:
        """Momentum gained in each shot over its standard error, about 1 in size; shape (K,)."""
        gain = (self.after - self.before) @ self.masses
        return np.asarray(gain / np.sqrt((self.sigma**2 + self.sigma_before**2) @ self.masses**2))

    def mean_after(self, speed: float = 1.0) -> tuple[Vector, Vector]:
        """Return means of the velocities after the impact and their errors, each (N,), m/s.

        Each shot is scaled to one `speed` of the first ball, m/s; a ValueError is raised if a shot
        begins otherwise than with that ball striking the others at rest.
        """
        one_number("speed", speed, *ABOVE_ZERO)
        striker = self.before[:, :1]
        if (striker <= 0).any() or self.before[:, 1:].any():
            rule = "do not begin with ball 1 striking the others at rest"
            raise ValueError(f"set {self.name} has shots that {rule}")
        share = self.after / striker
        errors = np.hypot(self.sigma, share * self.sigma_before[:, :1]) / striker
        return speed * share.mean(axis=0), speed * np.sqrt((errors**2).sum(axis=0)) / len(striker)


@dataclass(frozen=True, eq=False)
class Shots:
    """Measured shots of one or several arrangements; ``shots["AB"]`` is the set named AB."""

    sets: tuple[ShotSet, ...]  #: The sets, in the order of the table.

    def __getitem__(self, name: str) -> ShotSet:
        there = {one.name: one for one in self.sets}
        if name not in there:
            raise KeyError(f"no set {name!r}; there are {', '.join(there)}")
        return there[name]

    def __repr__(self) -> str:
        parts = [f"{s.name}: {len(s.shots)} shot{'s' * (len(s.shots) > 1)} of {len(s.types)} balls"
                 for s in self.sets]  # fmt: skip
        return f"Shots({', '.join(parts)})"

    @property
    def masses(self) -> dict[str, float]:
        """Mass of each type of ball, kg."""
        return {t: float(m) for s in self.sets for t, m in zip(s.types, s.masses, strict=True)}

    def without(self, *names: str) -> "Shots":
        """Return the shots without these sets, which you may want to predict."""
        there = [one.name for one in self.sets]
        for name in (name for name in names if name not in there):
            raise ValueError(f"no set {name!r} to leave out; there are {', '.join(there)}")
        kept = tuple(one for one in self.sets if one.name not in names)
        if not kept:
            raise ValueError(f"no set is left without {', '.join(names)}")
        return Shots(kept)

    def momentum_check(self) -> tuple[float, int]:
        """Return chi-square of the momentum gained, and the number of shots.

        If the first is far above the second, masses, velocities or their errors are wrong.
        """
        residuals = np.concatenate([s.momentum_residuals for s in self.sets])
        return float(residuals @ residuals), residuals.size


def chance(chi_square: float, degrees_of_freedom: int) -> float:
    """Return the chance of a chi-square at least as large if model and errors are right."""
    return float(scipy.special.chdtrc(max(degrees_of_freedom, 1), chi_square))


def read_shots(
    source: str | Path | Any, *, mass_unit: str | None = None, velocity_unit: str | None = None,
    sigma: float | None = None,
) -> Shots:  # fmt: skip
    """Read a table of shots and check it; the result is in kg and m/s.

    A ValueError names the place if a column is missing or there twice, a value is wrong, no balls
    approach, balls pass through each other, or a shot gains more energy than its errors allow.

    Parameters
    ----------
    source : path, open file, DataFrame or mapping of columns
        A CSV file (UTF-8, comma, one header line; lines that begin with # and empty rows are
        skipped), a pandas DataFrame, or columns by name.  `COLUMNS` says what each column holds.
    mass_unit, velocity_unit : {"kg", "g"}, {"m/s", "cm/s", "mm/s"}, optional
        If left out, kg and m/s are meant, and numbers that look like other units are refused.
    sigma : float, optional
        Standard error of all velocities, in their unit, for a table without it.

    Examples
    --------
    >>> from cradle.fit import read_shots
    >>> table = {"set": ["AB", "AB"], "shot": [1, 1], "ball": [1, 2], "type": ["A", "B"],
    ...          "mass": [45, 53], "before": [1.0, 0.0], "after": [0.17, 0.70]}
    >>> shots = read_shots(table, mass_unit="g", sigma=0.01)
    >>> shots, shots["AB"].masses
    (Shots(AB: 1 shot of 2 balls), array([0.045, 0.053]))
    """
    lines = table_lines(source)
    if not lines:
        raise ValueError("the table has no rows")
    there = list(lines[0][1])
    if not {*there} & {*COLUMNS}:  # such as a film's
        raise ValueError(f"no column of {', '.join(COLUMNS)}; marks in a film go to `cradle film`")
    optional = ("sigma_before", "sigma") if sigma is not None else ("sigma_before",)
    for name in COLUMNS:
        if name not in (*there, *optional):
            other = "; or give sigma=" if name == "sigma" else ""
            hint = "".join(f": write {x} in small letters" for x in there if x.lower() == name)
            told = f"column {name!r} is missing ({COLUMNS[name]}{other})"
            raise ValueError(f"{told}; there are {', '.join(there)}{hint}")
    for name in there:
        if name not in COLUMNS and (near := get_close_matches(name, COLUMNS, cutoff=0.85)):
            raise ValueError(f"column {name!r}: write {near[0]!r}, or another name if it is not")
    if sigma is not None:
        one_number("sigma", sigma, *ABOVE_ZERO)
        if "sigma" in there:
            raise ValueError(f"sigma = {sigma!r}; the table has a column sigma: leave out one")
    units = {"mass_unit": mass_unit, "velocity_unit": velocity_unit}
    for option, unit in units.items():
        one_of(option, unit or next(iter(_UNITS[option][0])), list(_UNITS[option][0]))
    groups: dict[str, dict[str, list[_Row]]] = {}
    masses: dict[str, float] = {}
    for where, line in lines:
        row = _row(where, line if sigma is None else {**line, "sigma": sigma}, units)
        if row["mass"] != (usual := masses.setdefault(row["type"], row["mass"])):
            _refuse(where, "mass", f"{row['mass']!r}; balls of type {row['type']} have {usual!r} "
                    "elsewhere, and those of one type are alike")  # fmt: skip
        groups.setdefault(row["set"], {}).setdefault(row["shot"], []).append(row)
    return Shots(tuple(_shot_set(name, shots) for name, shots in groups.items()))


def _refuse(where: str, column: str, words: str) -> NoReturn:
    raise ValueError(f"{where}, column {column}: {words}") from None


def _number(where: str, line: dict[str, Any], name: str, units: dict[str, str | None]) -> float:
    """Return the number in a column, in kg or m/s."""
    place = f"{where}, column {name}"
    try:
        value = float(str(line[name]))  # it means what it prints as
    except ValueError:
        words = f"{line[name]!r}; must be a number, its decimals after a point"
        raise ValueError(f"{place} = {words}") from None
    value = one_number(place, value, *_RULES.get(name, ()))
    if name == "ball":
        return value
    unit = "mass_unit" if name == "mass" else "velocity_unit"
    scales, limit, other, short = _UNITS[unit]
    usual = next(iter(scales))
    value *= scales[units[unit] or usual]
    if units[unit] is None and abs(value) > limit and "sigma" not in name:
        _refuse(where, name, f"{value:g} {usual} is unlikely; is it in {other}: say "
                f"{unit}={short!r} (or in {usual} indeed: say {unit}={usual!r})")  # fmt: skip
    return value


def _row(where: str, line: dict[str, Any], units: dict[str, str | None]) -> _Row:
    """Return one row in kg and m/s."""
    row: _Row = {"where": where, **{n: str(line[n]).strip() for n in ("set", "shot", "type")}}
    told = str(line.get("sigma_before", "")) not in ("", "None", "nan", "<NA>")
    for name in ("ball", "mass", "before", "after", "sigma", *["sigma_before"] * told):
        row[name] = _number(where, line, name, units)
    if row["ball"] < 1 or row["ball"] % 1:
        _refuse(where, "ball", f"{line['ball']!r}; must be 1, 2, ... from the left")
    if not row["type"] or "-" in row["type"]:
        _refuse(where, "type", f"{row['type']!r}; must be a name without -, which joins types")
    return {"sigma_before": row["sigma"] if row["before"] else 0.0, **row, "ball": int(row["ball"])}


def _shot_set(name: str, shots: dict[str, list[_Row]]) -> ShotSet:
    """Put the rows of a set together; all its shots have the same balls."""
    table = [sorted(rows, key=lambda row: row["ball"]) for rows in shots.values()]
    first = table[0]
    for shot, rows in zip(shots, table, strict=True):
        places, what = [row["ball"] for row in rows], f"set {name}, shot {shot}"
        if len(rows) < 2 or places != list(range(1, len(rows) + 1)):
            _refuse(shots[shot][0]["where"], "ball", f"{what} has balls {places}; each shot needs "
                    "1, 2, ... N, each once, N >= 2")  # fmt: skip
        if len(rows) != len(first):
            _refuse(rows[0]["where"], "ball", f"{what} has {len(rows)} balls; the first shot of "
                    f"the set has {len(first)}")  # fmt: skip
        for row, usual in zip(rows, first, strict=True):
            if row["type"] != usual["type"]:
                _refuse(row["where"], "type", f"{row['type']!r}; ball {row['ball']} of set "
                        f"{name} has {usual['type']!r} elsewhere")  # fmt: skip
        _check_physics(what, rows)
    types = "".join(row["type"] for row in first)
    rest = name.removeprefix(types)
    if rest != name and rest.isalpha() and rest.isupper():  # all other names are free
        _refuse(first[0]["where"], "set", f"set {name} has the balls {types} alone; is the row of "
                f"ball {len(first) + 1} missing?  If not, give the set another name")  # fmt: skip
    columns = (np.array([[row[name] for row in rows] for rows in table]) for name in _MEASURED)
    kinds, masses = zip(*((row["type"], row["mass"]) for row in first), strict=True)
    return ShotSet(name, kinds, tuple(shots), np.array(masses), *columns)


def _check_physics(what: str, rows: list[_Row]) -> None:
    """Raise if no balls approach, balls pass through each other, or energy is gained."""
    columns = ("mass", *_MEASURED)
    mass, before, after, sigma, earlier = np.array([[row[n] for row in rows] for n in columns])
    if (np.diff(before) >= 0).all():
        _refuse(rows[0]["where"], "before", f"{what}: no balls approach")
    through = -np.diff(after) > _BEYOND * np.hypot(sigma[:-1], sigma[1:])
    if through.any():
        k = int(np.argmax(through))
        _refuse(rows[k + 1]["where"], "after", f"{what}: ball {k + 1} at {after[k]:g} m/s "
                f"would pass through ball {k + 2} at {after[k + 1]:g} m/s")  # fmt: skip
    gain = 0.5 * (mass * (after**2 - before**2)).sum()
    error = np.sqrt((mass**2 * ((after * sigma) ** 2 + (before * earlier) ** 2)).sum())
    if gain > _BEYOND * error:
        part = f"{100 * gain / (0.5 * mass * before**2).sum():.3g} % of its energy"
        told = f"{what} gains {part}, {gain / error:.3g} standard errors"
        place = f"{rows[0]['where']}, columns before and after"
        raise ValueError(f"{place}: {told}; check units, signs and sigma")
