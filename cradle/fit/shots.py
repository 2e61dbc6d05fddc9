"""What is measured: shots, velocities before and after impacts, with their tables; tracks."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cradle.input.values import Vector, one_number


@dataclass(frozen=True, eq=False)
class ShotSet:
    """All shots of one arrangement of N balls; K shots.

    Attributes
    ----------
    name : str
        The set's name.
    types : tuple of str, length N
        Types of the balls, left to right.
    shots : tuple of str, length K
        Names of the shots.
    masses : ndarray, shape (N,)
        kg.
    before, after, sigma, sigma_before : ndarray, shape (K, N)
        Velocities and their standard errors, m/s.

    Examples
    --------
    >>> from cradle.fit import read_shots
    >>> from cradle.tables import data_folder
    >>> read_shots(data_folder() / "shots_template.csv")["AB"].types
    ('A', 'B')
    """

    name: str
    types: tuple[str, ...]
    shots: tuple[str, ...]
    masses: Vector
    before: Vector
    after: Vector
    sigma: Vector
    sigma_before: Vector

    @property
    def momentum_residuals(self) -> Vector:
        """Momentum gained in each shot over its standard error, shape (K,): about 1 in size."""
        gain = (self.after - self.before) @ self.masses
        error = np.sqrt((self.sigma**2 + self.sigma_before**2) @ self.masses**2)
        return np.asarray(gain / error)

    def mean_after(self, speed: float = 1.0) -> tuple[Vector, Vector]:
        """Return the mean velocities after the impact, each shot scaled to one speed.

        Parameters
        ----------
        speed : float
            Of the first ball before the impact, m/s.

        Returns
        -------
        mean, error : ndarray, shape (N,)
            m/s; the standard errors follow from those of the velocities before and after.

        Raises
        ------
        ValueError
            If a shot begins otherwise than with the first ball striking the others at rest.

        Examples
        --------
        >>> from cradle.fit import read_shots
        >>> from cradle.tables import data_folder
        >>> mean, error = read_shots(data_folder() / "shots_template.csv")["AB"].mean_after()
        >>> mean.round(3).tolist(), error.round(3).tolist()
        ([0.176, 0.7], [0.006, 0.007])
        """
        one_number("speed", speed, "must be above 0", 0.0, open_low=True)
        striker = self.before[:, :1]
        if (striker <= 0).any() or self.before[:, 1:].any():
            raise ValueError(
                f"set {self.name} has shots that do not begin with ball 1 striking the others at "
                "rest"
            )
        share = self.after / striker
        errors = np.hypot(self.sigma, share * self.sigma_before[:, :1]) / striker
        return speed * share.mean(axis=0), speed * np.sqrt((errors**2).sum(axis=0)) / len(striker)


@dataclass(frozen=True, eq=False)
class Shots:
    """Measured shots of one or several arrangements.

    Attributes
    ----------
    sets : tuple of ShotSet
        In the order of the table.

    Examples
    --------
    >>> from cradle.fit import read_shots
    >>> from cradle.tables import data_folder
    >>> read_shots(data_folder() / "shots_template.csv")
    Shots(AB: 2 shots of 2 balls, ABA: 1 shot of 3 balls)
    """

    sets: tuple[ShotSet, ...]

    def __getitem__(self, name: str) -> ShotSet:
        """Return the set of that name."""
        for one in self.sets:
            if one.name == name:
                return one
        raise KeyError(f"no set {name!r}; there are {', '.join(s.name for s in self.sets)}")

    def __repr__(self) -> str:
        """Return the sets with their sizes."""
        parts = [
            f"{s.name}: {len(s.shots)} shot{'s' * (len(s.shots) > 1)} of {len(s.types)} balls"
            for s in self.sets
        ]
        return f"Shots({', '.join(parts)})"

    @property
    def masses(self) -> dict[str, float]:
        """Mass of each type of ball, kg."""
        return {t: float(m) for s in self.sets for t, m in zip(s.types, s.masses, strict=True)}

    def without(self, *names: str) -> Shots:
        """Return the shots less some sets: what is not to be fitted, but to be predicted.

        Parameters
        ----------
        names : str
            Of the sets to leave out.

        Returns
        -------
        Shots

        Raises
        ------
        ValueError
            If there is no set of that name, or no set is left.

        Examples
        --------
        >>> from cradle.fit import read_shots
        >>> from cradle.tables import data_folder
        >>> read_shots(data_folder() / "shots_template.csv").without("ABA")
        Shots(AB: 2 shots of 2 balls)
        """
        there = [one.name for one in self.sets]
        for name in names:
            if name not in there:
                raise ValueError(f"no set {name!r} to leave out; there are {', '.join(there)}")
        kept = tuple(one for one in self.sets if one.name not in names)
        if not kept:
            raise ValueError(f"no set is left without {', '.join(names)}")
        return Shots(kept)

    def momentum_check(self) -> tuple[float, int]:
        """Return chi-square of the momentum gained and the number of shots.

        The sum of squares of `ShotSet.momentum_residuals`.  Far above the number of shots it says
        that masses, velocities or their errors are wrong, whatever the model.

        Returns
        -------
        chi_square : float
        shots : int

        Examples
        --------
        >>> from cradle.fit import read_shots
        >>> from cradle.tables import data_folder
        >>> shots = read_shots(data_folder() / "shots_template.csv")
        >>> shots.momentum_check()[1]
        3
        """
        residuals = np.concatenate([s.momentum_residuals for s in self.sets])
        return float(residuals @ residuals), residuals.size


class Track(NamedTuple):
    """Marks of one ball: times in s and positions along the row in m, both of shape (T,)."""

    times: Vector
    positions: Vector


#: Marks of every ball, by the names of the tracks, in the order of the file.
Tracks = dict[str, Track]


def chance(chi_square: float, degrees_of_freedom: int) -> float:
    """Return the chance of a chi-square at least as large if model and errors are right."""
    from scipy.special import chdtrc

    return float(chdtrc(max(degrees_of_freedom, 1), chi_square))


def table_lines(source: Any) -> list[tuple[str, dict[str, Any]]]:
    """Return the rows of a table, each with a name of its place."""
    if isinstance(source, (str, Path)) or hasattr(source, "open"):
        path = Path(source) if isinstance(source, str) else source
        return _file_lines(path.name, path.read_bytes())
    if hasattr(source, "read"):
        return _file_lines(getattr(source, "name", "the file"), source.read())
    if not (isinstance(source, Mapping) or hasattr(source, "columns")):
        raise TypeError(f"source is a {type(source).__name__}; must be a path or a table")
    _refuse_repeated([str(name) for name in source])
    columns = {str(name): list(source[name]) for name in source}
    lengths = {len(values) for values in columns.values()}
    if len(lengths) > 1:
        raise ValueError(f"columns have different lengths: {sorted(lengths)}")
    return [
        (f"row {k + 1}", {name: values[k] for name, values in columns.items()})
        for k in range(lengths.pop() if lengths else 0)
    ]


def _file_lines(name: str, content: bytes) -> list[tuple[str, dict[str, Any]]]:
    """Return the rows of a CSV file; comments and rows without any cell filled are left out."""
    try:
        file = io.StringIO(content.decode("utf-8-sig"), newline="")
    except UnicodeDecodeError as error:
        raise ValueError(
            f"{name} is no UTF-8 text (byte {error.start}); save it as CSV in UTF-8"
        ) from None
    numbered = [
        (number, text) for number, text in enumerate(file, 1)
        if text.strip(", \t\r\n") and not text.lstrip().startswith("#")
    ]  # fmt: skip
    for mark, word in ((";", "semicolon"), ("\t", "tab")):
        if numbered and mark in numbered[0][1] and "," not in numbered[0][1]:
            if any(re.search(r"\d,\d", text) for _, text in numbered):
                raise ValueError(
                    f"{name} has {word}s between the columns and commas in the decimals; "
                    f"first turn every comma into a point, then every {word} into a comma"
                )
            raise ValueError(f"{name} has {word}s; put commas between the columns")
    reader = csv.reader(text for _, text in numbered)
    header = [name.strip() for name in next(reader, [])]
    _refuse_repeated(header)
    lines = []
    for (number, _), cells in zip(numbered[1:], reader, strict=True):
        if len(cells) != len(header):
            raise ValueError(
                f"line {number}: {len(cells)} values; the header has {len(header)} columns "
                "(decimals need a point)"
            )
        lines.append((f"line {number}", dict(zip(header, cells, strict=True))))
    return lines


def _refuse_repeated(names: Sequence[str]) -> None:
    """Refuse a column that is there twice: which one counts is not said."""
    for name in names:
        if name and names.count(name) > 1:  # a spreadsheet may add columns without a name
            raise ValueError(f"column {name!r} is there {names.count(name)} times; keep one")
