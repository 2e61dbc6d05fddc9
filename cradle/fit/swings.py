"""Period, damping, restitution and gap of a cradle, from the places of its balls in a film."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import scipy

from cradle.chain import Chain
from cradle.fit.result import Estimate
from cradle.fit.search import LEVEL, RISE, Mode, Scan
from cradle.fit.shots import chance
from cradle.input import values as asked
from cradle.input.values import ArrayLike, Vector
from cradle.models import Model
from cradle.swinging.pendulums import Pendulums
from cradle.swinging.record import Swing
from cradle.swinging.swing import swing

#: What can be fitted; how many of the unit that the summary tells are one of SI, and the unit.
UNITS = {"period": (1, " s"), "damping": (1, " 1/s"), "restitution": (1, ""), "gaps": (1e6, " µm")}
_LIMITS = {"period": ("must lie in [0.1, 30]", 0.1, 30.0), "damping": ("must be at least 0", 0.0),
           "restitution": asked.PART, "gaps": ("must be at least 0", 0.0)}  # fmt: skip
# A law fails if chi-square has a chance below the one, or residuals are alike by so many standard
# errors; then parts of the film are compared, for these numbers of parts.
_CHANCE, _FAR, _PARTS = 1e-3, 3.3, (4, 6, 8, 12, 16, 24, 32)


@dataclass(frozen=True, eq=False, repr=False)
class SwingFit:
    """What a film of K frames says of a cradle of N balls."""

    values: Mapping[str, float | None]  #: Best value of each number; None if the film tells none.
    intervals: Mapping[str, tuple[float, float]]  #: 95 % interval of each number.
    estimates: Mapping[str, Estimate]  #: The same, with profiles of chi-square.
    swing: Swing  #: The swing that fits best; its times begin with the first frame.
    residuals: Vector  #: Filmed less computed, less the mean of each ball, shape (K, N), m.
    reading: float  #: Standard error of a reading, m, as given or that of the residuals.
    chi_square: float | None  #: That of the residuals; None if `reading` was found from them.
    degrees_of_freedom: int  #: Number of readings, less what was fitted to them.
    correlation: float  #: Of a ball's residuals in successive frames, near 0 if the law fits.
    poor: bool  #: Whether the law does not fit.
    widened: Mapping[str, float]  #: Factors by which intervals were widened as it does not fit.

    def summary(self) -> str:
        """Return all that the fit says, as text."""
        wide = ", ".join(f"{name} {times:.1f} times" for name, times in self.widened.items())
        chi = f"chi-square {self.chi_square:.1f}, " if self.chi_square else ""
        return "\n".join([
            *(one.told(*UNITS[name]) for name, one in self.estimates.items()),
            f"{chi}degrees of freedom {self.degrees_of_freedom}, "
            f"reading {self.reading:.2g} m, correlation of residuals {self.correlation:.2f}",
            *[f"poor fit: intervals are too short, though widened: {wide or 'none'}"] * self.poor,
        ])  # fmt: skip

    def __repr__(self) -> str:
        return f"SwingFit({'; '.join(self.summary().splitlines())})"

    def plot(self, axes: Any = None) -> Any:
        """Draw film and swing, and the residuals, on two `axes` or on new ones; return them."""
        from cradle.pictures.fits import draw_swing

        return draw_swing(self.swing, self.residuals, axes)


def fit_swing(
    times: ArrayLike, positions: ArrayLike, model: Model, *, seen: ArrayLike | None = None,
    reading: float | None = None, free: Collection[str] = tuple(UNITS),
    known: Mapping[str, float] | None = None, masses: ArrayLike | None = None,
) -> SwingFit:  # fmt: skip
    """Fit `swing` to a film, with one restitution and one gap for all contacts.

    At the first frame some balls, let go at one moment, are on their way; the others are at rest.
    Their places and velocities at that frame are fitted too, and where each ball hangs.  Intervals
    hold 95 %, by profiles of chi-square (Venzon and Moolgavkar, Applied Statistics 37, 1988,
    87-94).  If the law fails (a large chi-square, or residuals alike from frame to frame), they are
    widened by how much parts of the film differ (clusters: Liang and Zeger, Biometrika 73, 1986,
    13-22).  The interval of the damping is too short if nearly all balls were pulled; where one has
    no width the law jumps.  Errors: those of `swing`; too few readings, no motion: a ValueError.

    Parameters
    ----------
    times, positions : array_like, shapes (K,) and (K, N)
        Times of the frames, s; and each ball's place from where it hangs, m, nan if not seen.
    model : Model
        The impact law.
    seen : array_like of bool, shape (K, N) or (N,), optional
        Which readings count.
    reading : float, optional
        Standard error of a reading, m; if left out, that of the residuals.
    free : collection of str
        What is fitted: "period" of small swings, s; "damping", 1/s; "restitution"; "gaps", m.
    known : mapping of str to float, optional
        Values of what is not fitted; if left out, no damping, restitution 1, no gaps.
    masses : array_like, shape (N,), optional
        Masses in any unit; if left out, they are equal.

    Examples
    --------
    >>> import numpy as np
    >>> from cradle import Chain, ImpulseCorrelation, swing
    >>> from cradle.fit import fit_swing
    >>> times, law = np.arange(0, 2.5, 0.05), ImpulseCorrelation(0)
    >>> film = swing(Chain([1, 1], [0, 0], 0.9), law, [-0.05, 0], times).positions
    >>> found = fit_swing(times, film, law, free=["restitution"], known={"period": 0.634374})
    >>> round(found.values["restitution"], 4)
    0.9
    """
    film = _Film(times, positions, model, seen, reading, free, known or {}, masses)
    found: SwingFit | Vector = film.begin()
    while not isinstance(found, SwingFit):
        found = film.judged(*film.descend(found))
    return found


class _Film:
    """Readings, and swings by numbers p: of `names`, places of balls on their way, their v / x."""

    def __init__(  # as for `fit_swing`
        self, times: Any, positions: Any, model: Model, seen: Any, reading: float | None,
        free: Collection[str], known: Mapping[str, float], masses: Any,
    ) -> None:  # fmt: skip
        t, x = asked.checked("times", times), asked.numbers("positions", positions)
        mask = np.ones(x.shape[1:], bool) if seen is None else np.asarray(seen, bool)
        fit = x.ndim == 2 and t.shape == x.shape[:1] and mask.shape in (x.shape, x.shape[1:])
        if not (fit and t.size and x.shape[1] > 1):
            told = f"times, positions and seen have shapes {t.shape}, {x.shape} and {mask.shape}"
            raise ValueError(f"{told}; must be (K,), (K, N) and (K, N) or (N,), N at least 2")
        asked.refuse_where("times", t, np.diff(t, prepend=-np.inf) <= 0.0, "must rise")
        asked.refuse_where("positions", x, np.isinf(x), "must be finite, or nan where not seen")
        n, m = x.shape[1], asked.number_or_row("masses", 1.0 if masses is None else masses, "N")
        self.model, self.balls = model, Chain(asked.row_of("masses", m, n, n), np.zeros(n), 1.0)
        self.times, self.seen = t - t[0], mask & np.isfinite(x)
        self.x = np.where(self.seen, x, np.nan)
        free = (free,) if isinstance(free, str) else asked.must_be(Collection, "free", free)
        for name in (*free, *asked.must_be(Mapping, "known", known)):
            asked.one_of("free or known", name, tuple(UNITS))
        for name, value in known.items():
            asked.one_number(f"known['{name}']", value, *_LIMITS[name])
        self.names = [name for name in UNITS if name in free and name not in known]
        self.fixed = {"damping": 0.0, "restitution": 1.0, "gaps": 0.0, **known}
        if "period" not in {*self.names, *known}:
            raise ValueError("period is neither free nor known; must be one of them")
        asked.one_number("reading", 1.0 if reading is None else reading, *asked.ABOVE_ZERO)
        self.reading = reading

    def begin(self) -> Vector:
        """Search from nothing, in ever longer parts of the film."""
        t, often = self.times, self.seen.sum(axis=0)
        # No impact changes the place of the centre of mass.
        some = often >= 0.5 * often.max()
        mean = np.average(self.x[:, some], axis=1, weights=self.balls.masses[some])
        mean, at = mean[np.isfinite(mean)], t[np.isfinite(mean)]
        if min(at.size, often.sum() // 3) < 10:
            raise ValueError(f"{often.sum()} readings, {at.size} full frames; needs 30 and 10")
        self.size = size = float(np.nanmax(np.abs(self.x)))
        if "period" not in self.fixed and np.std(mean) < 0.02 * size:
            raise ValueError("their mean rests, and tells no period: give known['period']")
        rates = np.arange(0.5, 0.5 * at.size, 0.125) * 2.0 * np.pi / np.ptp(at)
        rate = rates[scipy.signal.lombscargle(at, mean - mean.mean(), rates).argmax()]
        self.period = period = self.fixed.get("period", 2.0 * np.pi / rate)
        asked.one_number("the period that is seen, s,", period, *_LIMITS["period"])
        early = self.seen & (t <= max(period / 16.0, t[3]))[:, None]
        lines = [np.polyfit(t[some], x[some], 1) if some.sum() > 2 else np.zeros(2)
                 for some, x in zip(early.T, self.x.T, strict=True)]  # fmt: skip
        v, x = np.transpose(lines)
        self.movers = np.flatnonzero(np.abs(x) > 0.1 * size)
        if not self.movers.size:
            raise ValueError("no ball is seen on its way at first; begin soon after the release")
        v, x = v[self.movers], x[self.movers]
        rows: dict[str, tuple[float, float, float, Any]] = {
            "period": (0.5 * period, 2.0 * period, 1e-4 * period, [period]),
            "damping": (0.0, np.pi / period, 1e-2 / period, [0.0]),
            "restitution": (0.0, 1.0, 1e-3, [0.997, 0.99, 0.97, 0.9, 0.7]),
            "gaps": (0.0, size, 1e-3 * size, size * np.append(0.0, np.geomspace(1e-4, 0.1, 13))),
        }  # limits, first steps, and where to begin
        used = [rows[name] for name in self.names]
        used += [(-2.0 * size, 2.0 * size, 1e-3 * size, [place]) for place in x]
        used.append((-100.0 / period, 100.0 / period, 1e-2 / period, [x @ v / (x @ x)]))
        self.low, self.high, self.steps = np.array([row[:3] for row in used]).T
        self.least, count = 1e-4 * self.steps, int(np.searchsorted(t, 2.2 * period))
        nodes = [np.array(node) for node in product(*(row[3] for row in used))]
        self.half = min(nodes, key=lambda node: float((self.left(node, count) ** 2).sum()))
        parts = [len(t) >> k for k in range(20, 0, -1)]
        for part in [count, *(part for part in parts if part > 1.5 * count)]:
            self.half = self.descend(self.half, part)[0]
        return self.half

    def swung(self, p: Vector, count: int | None = None) -> Swing:
        """Return the swing by numbers, in all frames or the first ones."""
        now = self.fixed | dict(zip(self.names, p.tolist(), strict=False))
        x, hung = np.zeros(len(self.balls)), now["gaps"] * np.arange(len(self.balls))
        x[self.movers] = p[len(self.names) : -1]
        x = scipy.optimize.isotonic_regression(x + hung).x - hung  # none overlap
        chain = Chain(self.balls.masses, p[-1] * x, now["restitution"])
        length = Pendulums.gravity * (now["period"] / (2.0 * np.pi)) ** 2
        pendulums = Pendulums(length, gaps=now["gaps"], damping=now["damping"])
        try:
            return swing(chain, self.model, x, self.times[:count], pendulums=pendulums)
        except ValueError as reason:
            rule = "positions are from where each ball hangs, m, balls from left to right"
            raise ValueError(f"{reason}; so no swing is near the film: {rule}") from reason

    def left(self, p: Vector, count: int | None = None) -> Vector:
        """Return what the swing by numbers leaves of the readings in these frames."""
        seen = self.seen[:count]
        left = np.where(seen, self.x[:count] - self.swung(p, count).positions, 0.0)
        return np.asarray((left - left.sum(axis=0) / np.maximum(seen.sum(axis=0), 1))[seen])

    def descend(self, p: Vector, count: int | None = None) -> tuple[Vector, Vector, Vector]:
        """Return a minimum: numbers, what their swing leaves, and the slopes of that."""
        size = self.seen[:count].sum()

        def slopes(q: Vector) -> Vector:
            left, out = self.left(q, count), np.zeros((size, p.size))
            for k in range(p.size):
                trial, step = q.copy(), self.steps[k]
                trial[k] += step if q[k] + step < self.high[k] else -step
                out[:, k] = (self.left(trial, count) - left) / (trial[k] - q[k])
                # The next step is about as wide as the error, and so goes over what is rough.
                error = np.sqrt(left @ left / (out[:, k] @ out[:, k] + 1e-300) / size)
                self.steps[k] = np.clip(error, self.least[k], 0.4 * (self.high[k] - self.low[k]))
            return out

        found = scipy.optimize.least_squares(
            lambda q: self.left(q, count), p, slopes, (self.low, self.high), "dogbox",
            ftol=0.01 / size, xtol=None, gtol=None, x_scale="jac", max_nfev=15,
        )  # fmt: skip
        return found.x, found.fun, found.jac

    def judged(self, p: Vector, left: Vector, slopes: Vector) -> SwingFit | Vector:
        """Return the fit; or, if a profile finds a lower minimum, that."""
        freedom = left.size - int(self.seen.any(axis=0).sum()) - p.size
        grid, spread = np.full(self.seen.shape, np.nan), float(left @ left) / freedom
        grid[self.seen], spread = left, max(spread, (1e-15 * self.size) ** 2)  # it may be exact
        reading = self.reading or float(np.sqrt(spread))
        # Products of residuals of a ball some frames apart, up to a quarter of a swing.
        most = 2 + int(0.25 * self.period / self.times[-1] * len(grid))
        apart = [grid[k:] * grid[:-k] for k in range(1, most)]
        alike = [np.nansum(both) / np.sqrt(np.isfinite(both).sum()) / spread
                 for both in (apart[0], np.concatenate(apart))]  # fmt: skip
        chi, wide = self.reading and float(left @ left) / reading**2, np.ones(p.size)
        exact = spread < (1e-6 * self.size) ** 2  # rounding alone is left
        poor = not exact and bool(max(alike) > _FAR or (chi and chance(chi, freedom) < _CHANCE))
        self.variance = max(reading**2, spread * poor)
        inverse = (solver := np.linalg.pinv(slopes)) @ solver.T
        errors = np.sqrt(self.variance * np.diag(inverse))
        errors = np.where(slopes.any(axis=0), errors, self.steps / np.sqrt(RISE))
        if poor:
            # By how parts of the film differ: each reading has moved p by so much.
            moved, spreads = np.zeros((*grid.shape, p.size)), [np.ones(p.size)]
            moved[self.seen] = (solver * left).T / errors
            for parts in _PARTS:
                sums = np.add.reduceat(moved.sum(axis=1), np.arange(parts) * len(grid) // parts)
                times = scipy.special.stdtrit(parts - 1, 0.5 + 0.5 * LEVEL) / np.sqrt(RISE)
                spreads.append(times * np.sqrt((sums**2).sum(axis=0) * parts / (parts - 1)))
            wide = np.hypot(np.max(spreads, axis=0), (self.half - p) / np.sqrt(RISE) / errors)
        estimates = {}
        for k, name in enumerate(self.names):
            rise = RISE * self.variance * wide[k] ** 2
            found = self.profile(p, left, slopes, k, float(wide[k] * errors[k]), rise)
            if not isinstance(found, Scan):
                return found
            estimates[name] = Estimate.of("swing", (name,), float(self.high[k]), found)
        return SwingFit(
            {name: one.value for name, one in estimates.items()},
            {name: one.intervals[0] for name, one in estimates.items()},
            estimates, self.swung(p), grid, reading, chi, freedom,
            float(np.nanmean(apart[0]) / spread), poor,
            dict(zip(self.names, wide.tolist(), strict=False)),
        )  # fmt: skip

    def profile(
        self, p: Vector, left: Vector, slopes: Vector, k: int, error: float, rise: float
    ) -> Scan | Vector:
        """Return the profile of a number; or, if it finds a lower minimum, that."""
        solver = np.linalg.pinv(np.where(np.arange(p.size) == k, 0.0, slopes))
        points, ends = [(float(p[k]), 0.0)], []
        for side, limit in ((-1.0, self.low[k]), (1.0, self.high[k])):
            way = np.sqrt(RISE) * error
            for _ in range(20):
                q = p.copy()
                q[k] = np.clip(p[k] + side * way, self.low[k], self.high[k])
                rest, gain = self.left(q), np.inf
                while gain > 0.01 * self.variance:
                    trial = np.clip(q - solver @ rest, self.low, self.high)
                    closer = self.left(trial)
                    gain = float(rest @ rest - closer @ closer)
                    q, rest = (trial, closer) if gain > 0.0 else (q, rest)
                excess = float(rest @ rest - left @ left)
                if excess < -0.5 * self.variance:
                    return q
                points.append((float(q[k]), excess))
                near = np.sqrt(max(excess, 0.0) / rise)
                if abs(near - 1.0) < 0.02 or (q[k] == limit and near < 1.0):
                    break
                way = abs(q[k] - p[k]) / np.clip(near, 0.3, 3.0)
            # Where all is rough, a swing near by may leave more than one far off: by slopes, then.
            away = max(side * (q[k] - p[k]), np.sqrt(RISE) * error)
            ends.append(float(np.clip(p[k] + side * away, self.low[k], self.high[k])))
        grid, excess = np.array(sorted(points)).T
        return Scan((Mode(float(p[k]), 0.0),), ((ends[0], ends[1]),), grid, excess * RISE / rise)
