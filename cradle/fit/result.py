"""What a fit found: estimates with their confidence sets, a table, a plot, predictions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from cradle.chain import Vector, one_number
from cradle.fit.parameters import (
    Key,
    Points,
    label,
    outcomes_of_draws,
    pair_keys,
    parameter_key,
    triplet_keys,
)
from cradle.fit.search import LEVEL, RISE, Mode, Scan
from cradle.fit.shots import Shots

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

# Draws from the fitted parameters for a prediction.
_DRAWS = 4000
# A confidence set that covers more than this part of the range says nothing.
_ALL = 0.999


@dataclass(frozen=True, eq=False)
class Estimate:
    """One coefficient of restitution or one ratio.

    Attributes
    ----------
    kind : {"restitution", "ratio"}
    key : tuple of str
        Types of the balls.
    value : float or None
        Where chi-square is lowest; None if the data tell nothing.
    intervals : tuple of (float, float)
        The 95 % confidence set, by profile likelihood; several intervals if several ranges of
        values explain the data.
    modes : tuple of Mode
        All minima of chi-square that were found, lowest first.
    identified : bool
        False if the confidence set covers the whole range.
    at_bound : {"", "lower", "upper"}
        Whether the lowest chi-square is at an end of the range.
    bound : float
        Upper end of the range; the lower one is 0.
    grid, excess : ndarray, shape (P,)
        Values tried, and chi-square there above its lowest value.
    """

    kind: str
    key: Key
    value: float | None
    intervals: tuple[tuple[float, float], ...]
    modes: tuple[Mode, ...]
    identified: bool
    at_bound: str
    bound: float
    grid: Vector
    excess: Vector

    @classmethod
    def of(cls, kind: str, key: Key, found: Scan, bound: float) -> Estimate:
        """Make an estimate from a scan of one parameter."""
        return cls.at(kind, key, found.modes, found.intervals, bound, found.grid, found.excess)

    @classmethod
    def at(
        cls, kind: str, key: Key, modes: tuple[Mode, ...],
        intervals: tuple[tuple[float, float], ...], bound: float, grid: Vector, excess: Vector,
    ) -> Estimate:  # fmt: skip
        """Make an estimate from its minima and its confidence set."""
        identified = sum(high - low for low, high in intervals) < _ALL * bound
        value = modes[0].value
        ends = {"lower": value <= 1e-6 * bound, "upper": value >= (1.0 - 1e-6) * bound}
        at_bound = next((end for end, reached in ends.items() if reached and identified), "")
        return cls(kind, key, value if identified else None, intervals, modes, identified,
                   at_bound, bound, grid, excess)  # fmt: skip

    @classmethod
    def unidentified(cls, kind: str, key: Key, bound: float) -> Estimate:
        """Make the estimate of a parameter that acts in no shot."""
        grid = np.array([0.0, bound])
        return cls(kind, key, None, ((0.0, bound),), (), False, "", bound, grid, np.zeros(2))

    @property
    def name(self) -> str:
        """Name of the parameter, such as "ABC"."""
        return label(self.key)

    @property
    def standard_error(self) -> float:
        """Total length of the confidence set over 3.92, as if it were that of a bell curve."""
        return sum(high - low for low, high in self.intervals) / (2.0 * float(np.sqrt(RISE)))

    def __str__(self) -> str:
        """Return the estimate with its confidence set."""
        if self.value is None:
            return f"{self.kind} {self.name}: not identified"
        digits = _digits(self.standard_error)
        sets = " or ".join(f"[{low:.{digits}f}, {high:.{digits}f}]" for low, high in self.intervals)
        end = f" at its {self.at_bound} bound" if self.at_bound else ""
        return f"{self.kind} {self.name} = {self.value:.{digits}f} {sets}{end}"


def _digits(error: float) -> int:
    """Return how many decimals show two digits of an error."""
    return min(8, max(2, 1 - int(np.floor(np.log10(max(error, 1e-8))))))


@dataclass(frozen=True, eq=False)
class Group:
    """Ratios fitted together: points tried, chi-square there, and the size of their cells."""

    keys: tuple[Key, ...]
    points: Vector
    excess: Vector
    weights: Vector

    def draw(self, uniform: Vector) -> Vector:
        """Return points in proportion to their likelihood, one for each number in [0, 1)."""
        density = np.exp(-0.5 * self.excess) * self.weights
        total = np.cumsum(density)
        return np.asarray(self.points[np.searchsorted(total, uniform * total[-1], side="right")])


@dataclass(frozen=True, eq=False)
class Prediction:
    """Velocities predicted for a chain, with what the errors of the parameters leave open.

    Attributes
    ----------
    types : tuple of str, length N
    median, lower, upper : ndarray, shape (N,)
        Middle and ends of the central 95 % of the predictions, m/s.
    """

    types: tuple[str, ...]
    median: Vector
    lower: Vector
    upper: Vector

    def rows(self) -> list[dict[str, Any]]:
        """Return one row per ball."""
        return [
            {"ball": k + 1, "type": kind, "velocity": float(self.median[k]),
             "lower": float(self.lower[k]), "upper": float(self.upper[k])}
            for k, kind in enumerate(self.types)
        ]  # fmt: skip

    def table(self) -> pd.DataFrame:
        """Return the rows as a table."""
        import pandas as pd

        return pd.DataFrame(self.rows()).set_index("ball")

    def __repr__(self) -> str:
        """Return the predictions in one line."""
        parts = [
            f"{m:.3f} [{a:.3f}, {b:.3f}]"
            for m, a, b in zip(self.median, self.lower, self.upper, strict=True)
        ]
        return f"Prediction({label(self.types)}: {', '.join(parts)} m/s)"


@dataclass(frozen=True, eq=False)
class Fit:
    """All estimates of a fit.

    Attributes
    ----------
    shots : Shots
        The data.
    estimates : mapping of str to Estimate
    given : mapping of str to (float, float)
        Coefficients of restitution that the fit was given, with their errors.
    groups : tuple of Group
        Ratios that were fitted together.
    chi_square : float
        Its lowest value, all estimates together.
    degrees_of_freedom : int
        Measured velocities after impacts, less the parameters fitted.
    known : mapping of str to float
        Ratios that were not fitted.
    """

    shots: Shots
    estimates: Mapping[str, Estimate]
    given: Mapping[str, tuple[float, float]]
    groups: tuple[Group, ...]
    chi_square: float
    degrees_of_freedom: int
    known: Mapping[str, float] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Estimate:
        """Return one estimate."""
        if name not in self.estimates:
            raise KeyError(f"no estimate {name!r}; there are {', '.join(self.estimates)}")
        return self.estimates[name]

    @property
    def probability(self) -> float:
        """Chance of a chi-square at least as large if model and errors were right."""
        from scipy.special import chdtrc

        return float(chdtrc(max(self.degrees_of_freedom, 1), self.chi_square))

    def values(self) -> dict[str, tuple[float, float]]:
        """Return each identified value with its standard error."""
        return {
            name: (one.value, one.standard_error)
            for name, one in self.estimates.items()
            if one.value is not None
        }

    def __repr__(self) -> str:
        """Return the estimates in one line, and how well they fit."""
        shown = [str(one) for one in self.estimates.values()]
        poor = "" if self.probability > 1e-3 else ", a poor fit"
        return (
            f"Fit({', '.join(shown)}; "
            f"chi-square {self.chi_square:.1f} of {self.degrees_of_freedom}{poor})"
        )

    def rows(self) -> list[dict[str, Any]]:
        """Return one row per estimate."""
        return [
            {
                "name": name,
                "kind": one.kind,
                "value": one.value,
                "lower": one.intervals[0][0] if one.identified else None,
                "upper": one.intervals[-1][1] if one.identified else None,
                "intervals": len(one.intervals) if one.identified else 0,
                "minima": len(one.modes),
                "identified": one.identified,
                "at_bound": one.at_bound,
                "bound": one.bound,
            }
            for name, one in self.estimates.items()
        ]

    def table(self) -> pd.DataFrame:
        """Return the rows as a table; where nothing was identified the numbers are missing."""
        import pandas as pd

        return pd.DataFrame(self.rows()).set_index("name")

    def plot(self, name: str | None = None, axes: Sequence[Axes] | None = None) -> Sequence[Axes]:
        """Draw the likelihood of one estimate, and its data with their predictions.

        Parameters
        ----------
        name : str, optional
            Which estimate; the first identified one if left out.
        axes : sequence of two Axes, optional
            Where to draw; new axes if left out.

        Returns
        -------
        sequence of Axes
        """
        from cradle.fit.drawing import draw_fit

        return draw_fit(self, name, axes)

    def predict(self, types: str | Sequence[str], speed: float = 1.0) -> Prediction:
        """Predict a longer chain, the first ball striking the others at rest.

        Parameters
        ----------
        types : str or sequence of str, length N
            Types of the balls, left to right.
        speed : float
            Of the first ball, m/s.

        Returns
        -------
        Prediction
            Spread by the errors of the ratios and of the coefficients of restitution; a ratio that
            the data left open takes all values up to its bound.

        Raises
        ------
        ValueError
            If the mass of a type, the coefficient of restitution of a pair or the ratio of a
            triplet (or of its reverse) is neither fitted nor given.
        """
        row = tuple(types)
        one_number("speed", speed, "must be above 0", 0.0, open_low=True)
        masses = self.shots.masses
        e, ratios = self._draws(row, masses)
        velocities = outcomes_of_draws([masses[kind] for kind in row], speed, e, *ratios)
        lower, median, upper = np.quantile(
            velocities, [(1 - LEVEL) / 2, 0.5, (1 + LEVEL) / 2], axis=0
        )
        return Prediction(row, median, lower, upper)

    def _draws(
        self, types: tuple[str, ...], masses: Mapping[str, float]
    ) -> tuple[Vector, tuple[Vector, Vector]]:
        """Draw coefficients of restitution and ratios of a chain from what was fitted."""
        for kind in types:
            if kind not in masses:
                raise ValueError(
                    f"no mass is known of type {kind!r}; there are {', '.join(masses)}"
                )
        random = np.random.default_rng(0)
        restitution: dict[Key, Vector] = {}
        for key in dict.fromkeys(pair_keys(types)):
            value, error = self._restitution(key)
            restitution[key] = np.clip(value + error * random.standard_normal(_DRAWS), 0.0, 1.0)
        drawn: dict[Key, Vector] = {
            key: points
            for group in self.groups
            for key, points in zip(group.keys, group.draw(random.random(_DRAWS)).T, strict=True)
        }
        forward, backward = triplet_keys(types)
        for key in (*forward, *backward):
            if key in drawn:
                continue
            name = label(key)
            if name in self.known:
                drawn[key] = np.full(_DRAWS, self.known[name])
            elif name in self.estimates:
                drawn[key] = self.estimates[name].bound * random.random(_DRAWS)
            else:
                raise ValueError(
                    f"the ratio of {name} is not known; fitted: {', '.join(self.estimates)}"
                )
        e = np.stack([restitution[key] for key in pair_keys(types)], axis=-1)
        empty = np.zeros((_DRAWS, 0))
        ratios = tuple(
            np.stack([drawn[key] for key in keys], axis=-1) if keys else empty
            for keys in (forward, backward)
        )
        return e, (ratios[0], ratios[1])

    def _restitution(self, key: Key) -> tuple[float, float]:
        name = label(key)
        known = {**self.given, **{n: v for n, v in self.values().items() if len(key) == 2}}
        if name not in known:
            raise ValueError(f"the coefficient of restitution of {name} is not known")
        return known[name]


def predicted_points(fit: Fit, types: Sequence[str]) -> Points | None:
    """Return the best parameters for a set, or None if one of them is not identified."""
    forward, backward = triplet_keys(types)
    ratios: dict[Key, Vector] = {}
    for key in (*forward, *backward):
        name = label(key)
        if name in fit.known:
            ratios[key] = np.array([fit.known[name]])
            continue
        value = fit.estimates[name].value
        # A ratio without effect may have any value.
        if value is None and any(key in group.keys for group in fit.groups):
            return None
        ratios[key] = np.array([0.0 if value is None else value])
    restitution = {tuple(sorted(parameter_key(n))): v for n, (v, _) in fit.given.items()}
    return Points(restitution, ratios)
