"""What a fit found: estimates with their confidence sets, a table, a plot, predictions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cradle.fit import parameters
from cradle.fit.parameters import Key, fitted_keys, label, outcomes, pair_keys
from cradle.fit.search import LEVEL, RISE, Mode, Scan
from cradle.fit.shots import Shots, ShotSet, chance
from cradle.input.values import ABOVE_ZERO, Vector, one_number

if TYPE_CHECKING:
    import pandas as pd

#: Columns of the table of a fit.
RESULT_COLUMNS = ("name", "kind", "value", "intervals", "minima", "identified", "at_bound", "bound")
_DRAWS = 4000  # from the fitted parameters, for a prediction
# A set that is so much longer on one side than on the other is no bell curve's; what is said then.
SKEW = 1.3
FOLDED = " (no bell curve, as near a fold: such sets held the true value 90 times of 100, not 95)"
_ALL = 0.999  # a confidence set that covers more than this part of the range says nothing


@dataclass(frozen=True, eq=False)
class Estimate:
    """What data say of one number: a coefficient of restitution, a ratio, a period."""

    kind: str  #: "restitution", "ratio", or "swing" for the numbers of `fit_swing`.
    key: Key  #: Types of the balls; for a swing, the name of the number.
    value: float | None  #: The best value, where chi-square is lowest; None if data tell nothing.
    #: The 95 % confidence set by profile likelihood, one interval (lower, upper) or several.
    intervals: tuple[tuple[float, float], ...]
    modes: tuple[Mode, ...]  #: All minima of chi-square that were found, lowest first.
    identified: bool  #: False if the confidence set covers the whole range.
    at_bound: str  #: "lower" or "upper" if the lowest chi-square is at an end of the range, or "".
    bound: float  #: Upper end of the range; the lower one is 0, of a period a quarter of it.
    grid: Vector  #: The P values that were tried, shape (P,).
    excess: Vector  #: Chi-square there, less its lowest value, shape (P,).

    @classmethod
    def of(cls, kind: str, key: Key, bound: float, found: Scan | None) -> "Estimate":
        """Make an estimate of what a search found; of a parameter that acts in no shot, of None."""
        nothing = Scan((), ((0.0, bound),), np.array([0.0, bound]), np.zeros(2))
        modes, intervals, grid, excess = found or nothing
        identified = sum(high - low for low, high in intervals) < _ALL * bound
        value = modes[0].value if identified else None
        part = 0.5 if value is None else value / bound
        at_bound = "lower" * (part <= 1e-6) + "upper" * (part >= 1.0 - 1e-6)
        return cls(kind, key, value, intervals, modes, identified, at_bound, bound, grid, excess)

    @property
    def name(self) -> str:
        """Name of the parameter, such as "ABC" or, of a swing, "period"."""
        return label(self.key)

    @property
    def standard_error(self) -> float:
        """Length of the confidence set over 3.92; a side cut off by the range is as the other."""
        length = sum(high - low for low, high in self.intervals)
        inner = [end for ends in self.intervals for end in ends if 0.0 < end < self.bound]
        if self.value is not None and len(inner) == 1:
            length = max(length, 2.0 * abs(inner[0] - self.value))
        return length / (2.0 * float(np.sqrt(RISE)))

    @property
    def folded(self) -> bool:
        """Whether chi-square is far from a parabola, so that the set may hold 90 %, not 95.

        That happens near a fold, a ratio at which the order of the impact's events changes.
        """
        if self.value is None or self.at_bound:
            return False
        ends = (self.excess[self.grid == x].min() for x in (self.grid.min(), self.grid.max()))
        most = float(min(4 * RISE, *ends))  # twice as far as the set reaches, or to an end
        near = self.grid[self.excess <= most]
        sides = self.value - float(near.min()), float(near.max()) - self.value
        return len(self.intervals) > 1 or (max(sides) > SKEW * min(sides) and most > RISE)

    def row(self) -> dict[str, Any]:
        """Return the row of this estimate in a table."""
        return {n: len(self.modes) if n == "minima" else getattr(self, n) for n in RESULT_COLUMNS}

    def told(self, times: float = 1.0, unit: str = "") -> str:
        """Return value and confidence set as text; in a smaller unit, so many times as large."""
        if self.value is None:
            return f"{self.kind} {self.name}: not identified"
        # Two digits of the error.
        digits = 1 - int(np.floor(np.log10(max(self.standard_error, 1e-8) * times)))
        form = f".{min(8, max(2, digits))}f"
        sets = " or ".join(f"[{a * times:{form}}, {b * times:{form}}]" for a, b in self.intervals)
        end = f" at its {self.at_bound} bound" if self.at_bound else ""
        return f"{self.kind} {self.name} = {self.value * times:{form}} {sets}{unit}{end}"

    __str__ = told


class Group(NamedTuple):
    """Ratios fitted together: points tried, and how likely each is, up to a factor."""

    keys: tuple[Key, ...]
    points: Vector
    density: Vector


@dataclass(frozen=True, eq=False)
class Prediction:
    """Velocities predicted for N balls, with what the errors of the parameters leave open.

    From `lower` to `upper` lie the central 95 % of the predictions.  If a confidence set is in
    several pieces, predictions come in groups, and the range spans the space between them too.
    """

    types: tuple[str, ...]  #: Types of the balls, left to right.
    median: Vector  #: Median velocities after the impact, shape (N,), m/s.
    lower: Vector  #: Lower ends, shape (N,), m/s.
    upper: Vector  #: Upper ends, shape (N,), m/s.

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each ball, as dictionaries."""
        columns = (x.tolist() for x in (self.median, self.lower, self.upper))
        rows, names = zip(self.types, *columns, strict=True), ("type", "velocity", "lower", "upper")
        return [{"ball": k, **dict(zip(names, row, strict=True))} for k, row in enumerate(rows, 1)]

    def table(self) -> "pd.DataFrame":
        """Return the rows as a table of pandas."""
        import pandas as pd

        return pd.DataFrame(self.rows()).set_index("ball")

    def __repr__(self) -> str:
        parts = [f"{r['velocity']:.3f} [{r['lower']:.3f}, {r['upper']:.3f}]" for r in self.rows()]
        return f"Prediction({label(self.types)}: {', '.join(parts)} m/s)"


@dataclass(frozen=True, eq=False)
class Fit:
    """All estimates of a fit; ``fit["ABC"]`` is that of the triplet ABC."""

    shots: Shots  #: The data.
    estimates: Mapping[str, Estimate]  #: The estimates by their names, such as "ABC".
    given: Mapping[str, tuple[float, float]]  #: Coefficients of restitution, with their errors.
    groups: tuple[Group, ...]  #: Ratios that were fitted together.
    chi_square: float  #: Lowest chi-square, of all estimates together.
    degrees_of_freedom: int  #: Number of velocities measured after impacts, less numbers fitted.
    known: Mapping[str, float] = field(default_factory=dict)  #: Ratios that were not fitted.

    def __getitem__(self, name: str) -> Estimate:
        if name not in self.estimates:
            raise KeyError(f"no estimate {name!r}; there are {', '.join(self.estimates)}")
        return self.estimates[name]

    @property
    def probability(self) -> float:
        """Chance of a chi-square at least as large if model and errors were right."""
        return chance(self.chi_square, self.degrees_of_freedom)

    def values(self) -> dict[str, tuple[float, float]]:
        """Return each identified value with its standard error."""
        found = self.estimates.items()
        return {name: (e.value, e.standard_error) for name, e in found if e.value is not None}

    def __repr__(self) -> str:
        shown = ", ".join(map(str, self.estimates.values()))
        chi = f"chi-square {self.chi_square:.1f} of {self.degrees_of_freedom}"
        return f"Fit({shown}; {chi}{'' if self.probability > 1e-3 else ', a poor fit'})"

    def expected(self, shots: ShotSet) -> Vector | None:
        """Return velocities after shots of a set by the best values, (K, N), m/s; None if open."""
        best: dict[str, float | None] = {name: value for name, (value, _) in self.given.items()}
        # What acts in no shot may have any value.
        best |= {name: one.value if one.modes else 0.0 for name, one in self.estimates.items()}
        best |= self.known
        keys = [*pair_keys(shots.types), *fitted_keys(shots.types)]
        values = {key: best.get(label(key)) for key in keys}
        if None in values.values():
            return None
        return outcomes(shots.types, shots.masses, shots.before[:, None], values)[:, 0]

    def correlations(self) -> dict[tuple[str, str], float]:
        """Return the correlation of the errors of every two ratios that were fitted together."""
        found = {}
        for group in self.groups:
            for (i, one), (j, other) in combinations(enumerate(map(label, group.keys)), 2):
                spread = np.cov(group.points[:, [i, j]].T, aweights=group.density)
                found[one, other] = float(spread[0, 1] / np.sqrt(spread[0, 0] * spread[1, 1]))
        return found

    def summary(self) -> str:
        """Return all that the fit says, as text.

        Residuals, in units of their errors, are told by their root mean square and the largest.
        """
        lines = [f"{one}{'' if one.value is None else f', standard error {one.standard_error:.2g}'}"
                 f"{FOLDED * one.folded}" for one in self.estimates.values()]  # fmt: skip
        chi = f"chi-square {self.chi_square:.1f}, degrees of freedom {self.degrees_of_freedom}"
        lines.append(f"{chi}, chance {self.probability:.2g}")
        lines += [f"correlation of {a} and {b}: {value:.2f}"
                  for (a, b), value in self.correlations().items()]  # fmt: skip
        fitted = {one.key for one in self.estimates.values()}
        for shots in self.shots.sets:
            expected = self.expected(shots) if fitted & fitted_keys(shots.types) else None
            if expected is None:
                continue
            share = shots.sigma_before / np.where(shots.before, np.abs(shots.before), 1.0)
            error = np.hypot(shots.sigma, np.abs(expected) * share.max(axis=1, keepdims=True))
            left = (shots.after - expected) / error
            shot, ball = np.unravel_index(np.argmax(np.abs(left)), left.shape)
            usual, largest = np.sqrt((left**2).mean()), f"largest {left[shot, ball]:.1f}"
            lines.append(f"residuals of {shots.name}: {usual:.1f} standard errors, the {largest} "
                         f"(shot {shots.shots[shot]}, ball {ball + 1})")  # fmt: skip
        return "\n".join(lines)

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each estimate, as dictionaries, named as in `Estimate`."""
        return [one.row() for one in self.estimates.values()]

    def table(self) -> "pd.DataFrame":
        """Return the rows as a table of pandas; a value that the data leave open is missing."""
        import pandas as pd

        return pd.DataFrame(self.rows(), columns=RESULT_COLUMNS).set_index("name")

    def plot(self, name: str | None = None, axes: Any = None) -> Any:
        """Draw the likelihood of one estimate, its data and what is predicted, on two `axes`.

        If `name` is left out, the first identified one; a ValueError if nothing was fitted.
        """
        from cradle.pictures.fits import draw_fit

        return draw_fit(self, name, axes)

    def predict(self, types: str | Sequence[str], speed: float = 1.0) -> Prediction:
        """Predict a longer chain, the first ball striking the others at rest.

        Errors are drawn independently, but ratios that were fitted together are drawn together; one
        that the data left open takes all values up to its bound.  Fewer than 2 balls, and a mass,
        restitution or ratio that is not known, raise a ValueError.

        Parameters
        ----------
        types : str or sequence of str, length N
            Types of the balls, left to right; in one string such as "ABA" or "steel-brass-steel".
        speed : float
            Of the first ball, m/s, above 0.
        """
        row = parameters.types_in_a_row(types)
        one_number("speed", speed, *ABOVE_ZERO)
        masses = self.shots.masses
        for kind in (kind for kind in row if kind not in masses):
            raise ValueError(f"no mass is known of type {kind!r}; there are {', '.join(masses)}")
        random, values = np.random.default_rng(0), dict[Key, Any]()
        given = {**self.given, **self.values()}
        for key in dict.fromkeys(pair_keys(row)):
            if label(key) not in given:
                raise ValueError(f"the coefficient of restitution of {label(key)} is not known")
            value, error = given[label(key)]
            values[key] = np.clip(value + error * random.standard_normal(_DRAWS), 0.0, 1.0)
        for group in self.groups:
            total = np.cumsum(group.density)
            drawn = np.searchsorted(total, random.random(_DRAWS) * total[-1], side="right")
            values.update(zip(group.keys, group.points[drawn].T, strict=True))
        ratios = [key for keys in parameters.triplet_keys(row) for key in keys]
        for key in (key for key in ratios if key not in values):
            if (name := label(key)) not in {**self.known, **self.estimates}:
                there = ", ".join(n for n, e in self.estimates.items() if e.kind == "ratio")
                raise ValueError(f"the ratio of {name} is not known; fitted: {there or 'none'}")
            values[key] = (self.known[name] if name in self.known else
                           self.estimates[name].bound * random.random(_DRAWS))  # fmt: skip
        balls, before = np.array([masses[kind] for kind in row]), speed * np.eye(1, len(row))
        velocities = outcomes(row, balls, before, values)
        parts = [0.5, (1 - LEVEL) / 2, (1 + LEVEL) / 2]
        return Prediction(row, *np.quantile(velocities, parts, axis=0))
