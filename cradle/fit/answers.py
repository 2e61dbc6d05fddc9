"""An estimate with its confidence set, and what estimates predict."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cradle.fit.parameters import Key, label
from cradle.fit.search import RISE, Mode, Scan
from cradle.input.values import Vector

if TYPE_CHECKING:
    import pandas as pd

# A set that is so much longer on one side than on the other is no bell curve's; what is said then.
SKEW = 1.3
FOLDED = (
    " (no bell curve, as near a fold: such sets held the true value in 90 of 100 trials, not 95)"
)
# A confidence set that covers more than this part of the range says nothing.
_ALL = 0.999


@dataclass(frozen=True, eq=False)
class Estimate:
    """One coefficient of restitution or one ratio."""

    kind: str  #: "restitution" or "ratio".
    key: Key  #: Types of the balls.
    value: float | None  #: Where chi-square is lowest; None if the data tell nothing.
    #: The 95 % confidence set, by profile likelihood; several (lower, upper) if several ranges of
    #: values explain the data.
    intervals: tuple[tuple[float, float], ...]
    modes: tuple[Mode, ...]  #: All minima of chi-square that were found, lowest first.
    identified: bool  #: False if the confidence set covers the whole range.
    at_bound: str  #: "lower" or "upper" if the lowest chi-square is at an end of the range, or "".
    bound: float  #: Upper end of the range; the lower one is 0.
    grid: Vector  #: Values tried, shape (P,).
    excess: Vector  #: Chi-square there above its lowest value, shape (P,).

    @classmethod
    def of(cls, kind: str, key: Key, bound: float, found: Scan | None) -> Estimate:
        """Make an estimate of what a search found; of a parameter that acts in no shot, of None."""
        if found is None:
            found = Scan((), ((0.0, bound),), np.array([0.0, bound]), np.zeros(2))
        modes, intervals, grid, excess = found
        identified = sum(high - low for low, high in intervals) < _ALL * bound
        value, at_bound = modes[0].value if identified else None, ""
        if value is not None and value <= 1e-6 * bound:
            at_bound = "lower"
        elif value is not None and value >= (1.0 - 1e-6) * bound:
            at_bound = "upper"
        return cls(kind, key, value, intervals, modes, identified, at_bound, bound, grid, excess)

    @property
    def name(self) -> str:
        """Name of the parameter, such as "ABC"."""
        return label(self.key)

    @property
    def standard_error(self) -> float:
        """Total length of the confidence set over 3.92, as if it were that of a bell curve."""
        return sum(high - low for low, high in self.intervals) / (2.0 * float(np.sqrt(RISE)))

    @property
    def folded(self) -> bool:
        """Whether chi-square is no parabola over the confidence set: it may cover but 90 %.

        So it is near a fold, a ratio at which the order of the impact's events changes.
        """
        if self.value is None or self.at_bound:
            return False
        near = self.grid[self.excess <= 4 * RISE]  # twice as far as the set reaches
        sides = self.value - float(near.min()), float(near.max()) - self.value
        return len(self.intervals) > 1 or max(sides) > SKEW * min(sides)

    def __str__(self) -> str:
        """Return the estimate with its confidence set."""
        if self.value is None:
            return f"{self.kind} {self.name}: not identified"
        # Two digits of the error.
        digits = min(8, max(2, 1 - int(np.floor(np.log10(max(self.standard_error, 1e-8))))))
        sets = " or ".join(f"[{low:.{digits}f}, {high:.{digits}f}]" for low, high in self.intervals)
        end = f" at its {self.at_bound} bound" if self.at_bound else ""
        return f"{self.kind} {self.name} = {self.value:.{digits}f} {sets}{end}"


class Group(NamedTuple):
    """Ratios fitted together: points tried, and how likely each is, up to a factor."""

    keys: tuple[Key, ...]
    points: Vector
    density: Vector


@dataclass(frozen=True, eq=False)
class Prediction:
    """Velocities predicted for N balls, with what the errors of the parameters leave open.

    `lower` to `upper` holds the central 95 % of the predictions.  Where a ratio has a confidence
    set of several pieces, these may come in groups; what lies between the groups is inside too.
    """

    types: tuple[str, ...]
    median: Vector  #: Shape (N,), m/s; so are the ends.
    lower: Vector
    upper: Vector

    def rows(self) -> list[dict[str, Any]]:
        """Return one row per ball."""
        names = ("ball", "type", "velocity", "lower", "upper")
        columns = (x.tolist() for x in (self.median, self.lower, self.upper))
        balls = zip(range(1, len(self.types) + 1), self.types, *columns, strict=True)
        return [dict(zip(names, ball, strict=True)) for ball in balls]

    def table(self) -> pd.DataFrame:
        """Return the rows as a table."""
        import pandas as pd

        return pd.DataFrame(self.rows()).set_index("ball")

    def __repr__(self) -> str:
        """Return the predictions in one line."""
        parts = [f"{r['velocity']:.3f} [{r['lower']:.3f}, {r['upper']:.3f}]" for r in self.rows()]
        return f"Prediction({label(self.types)}: {', '.join(parts)} m/s)"
