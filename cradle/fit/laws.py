"""Any impact law fitted to shots: gaps and losses of spheres, one ratio for a whole row."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from cradle.chain import Chain
from cradle.fit.search import RISE
from cradle.fit.shots import Shots, ShotSet, chance
from cradle.input.values import PART, Vector, checked, must_be, one_number, shown, whole_number
from cradle.models import Model, collide

Law = Callable[..., Model]
_STEP = 1e-4  # of a slope, as a part of the range
_SAME = 0.02  # minima nearer to one another than this part of each range are one


@dataclass(frozen=True, eq=False, repr=False)
class LawFit:
    """What shots say of the numbers of a law."""

    values: Mapping[str, float | None]  #: Best value of each number; None if the shots tell none.
    #: 95 % interval of each, by profiles of chi-square; it spans those about all the minima.
    intervals: Mapping[str, tuple[float, float]]
    minima: tuple[Mapping[str, float | None], ...]  #: Other values that explain the shots.
    residuals: Mapping[str, Vector]  #: By sets, (measured - computed) / error, shape (K, N).
    chi_square: float  #: Lowest chi-square.
    degrees_of_freedom: int  #: Number of velocities measured after impacts, less numbers fitted.

    def summary(self) -> str:
        """Return all that the fit says, as text."""
        ends = (f"[{low:.3g}, {high:.3g}]" for low, high in self.intervals.values())
        chi = f"chi-square {self.chi_square:.1f}, degrees of freedom {self.degrees_of_freedom}"
        likely = chance(self.chi_square, self.degrees_of_freedom)
        best, *others = ([f"{k} {'open' if x is None else f'= {x:.4g}'}" for k, x in one.items()]
                         for one in (self.values, *self.minima))  # fmt: skip
        lines = [*map(" ".join, zip(best, ends, strict=True)), f"{chi}, chance {likely:.2g}"]
        return "\n".join([*lines, *(f"or {', '.join(one)}" for one in others)])

    def __repr__(self) -> str:
        return f"LawFit({'; '.join(self.summary().splitlines())})"


def fit_law(
    shots: Shots, law: Law | Mapping[str, Law], ranges: Mapping[str, tuple[float, float]], *,
    restitution: float = 1.0, starts: int = 32,
) -> LawFit:  # fmt: skip
    """Fit the numbers of any impact law to shots, by the least chi-square that is found.

    The velocities computed for a shot may all be off by one factor, within the error of those
    before.  If the chance of the chi-square is small, the law fails and the intervals mean nothing.
    A ValueError says what is wrong, or what a law refuses; other errors are those of `collide`.

    Parameters
    ----------
    shots : Shots
        The data, from `read_shots`.
    law : callable, or mapping of callables by the names of the sets
        ``law(**numbers)`` returns a model.  A number named restitution is not passed to it: it is
        that of all contacts of the chain.
    ranges : mapping of str to (float, float)
        Least and largest value of each number.
    restitution : float
        Of all contacts, where it is not fitted.
    starts : int
        Number of points in the ranges from which minima are searched for.

    Examples
    --------
    >>> import numpy as np
    >>> from cradle import SpringChain
    >>> from cradle.fit import fit_law, read_shots
    >>> table = {"set": "apart", "shot": 1, "ball": [1, 2, 3], "type": "A", "mass": 1.0,
    ...          "before": [1.0, 0.0, 0.0], "after": [-0.037, 0.039, 0.998], "sigma_before": 0.0}
    >>> shots = read_shots({k: np.broadcast_to(x, 3) for k, x in table.items()}, sigma=0.01)
    >>> fit_law(shots, lambda gap: SpringChain(gaps=[0.0, gap]), {"gap": (0.0, 2.0)})
    LawFit(gap = 0.1184 [0.0636, 0.196]; chi-square 0.0, degrees of freedom 2, chance 1)
    """
    sets, count = must_be(Shots, "shots", shots).sets, len(must_be(Mapping, "ranges", ranges))
    measured = sum(one.after.size for one in sets)
    laws = law if isinstance(law, Mapping) else {one.name: law for one in sets}
    for name in (one.name for one in sets if not callable(laws.get(one.name))):
        raise ValueError(f"law has no callable for set {name!r}; it has {shown(laws)}")
    for name, given in ranges.items():
        must_be(str, "a name of ranges", name)
        ends = checked(f"ranges[{name!r}]", given, *(PART if name == "restitution" else ()))
        if ends.shape != (2,) or not ends[0] < ends[1]:
            raise ValueError(f"ranges[{name!r}] = {shown(given)}; must be two numbers that rise")
    if not 0 < count < measured:
        told = f"ranges has {count} numbers, shots have {measured} velocities"
        raise ValueError(f"{told}; must be at least 1 number, and fewer than velocities")
    known = {"restitution": one_number("restitution", restitution, *PART)}
    if "restitution" in ranges and restitution != 1.0:
        raise ValueError(f"restitution = {restitution!r} is in ranges, too; leave out one of them")
    spread = scipy.stats.qmc.Halton(count, scramble=False)
    begin = 1.0 + spread.random(whole_number("starts", starts) + 1)[1:]
    return _Search(sets, laws, ranges, known, measured - count).found(begin)


@dataclass
class _Search:
    """What a law leaves of shots, by numbers z: 1 at the lower end of a range, 2 at the upper."""

    sets: Sequence[ShotSet]
    laws: Mapping[str, Law]
    ranges: Mapping[str, tuple[float, float]]
    known: Mapping[str, float]
    freedom: int
    tried: list[tuple[float, list[float]]] = field(default_factory=list)  # minima: chi-square, z

    def __post_init__(self) -> None:
        """Ask each set once: its different starts, who has which, and the errors of the factor."""
        self.starts = [np.unique(one.before, axis=0, return_inverse=True) for one in self.sets]
        self.errors = [np.abs(s.sigma_before / np.where(s.before, s.before, np.inf)).max(axis=1)
                       for s in self.sets]  # fmt: skip

    def numbers(self, z: Vector) -> dict[str, float]:
        """Return the numbers by name."""
        low, high = np.array([*self.ranges.values()], float).T
        return dict(zip(self.ranges, (low * (2.0 - z) + high * (z - 1.0)).tolist(), strict=True))

    def left(self, z: Vector) -> list[Vector]:
        """Return residuals over errors, (K, N + 1) for each set, the last one of the factor."""
        values, found = {**self.known, **self.numbers(np.round(z, 9))}, []  # none nearly at an end
        e = values.pop("restitution")
        for one, (starts, of), error in zip(self.sets, self.starts, self.errors, strict=True):
            try:
                model = self.laws[one.name](**values)
                chains = [Chain(one.masses, before, e) for before in starts]
                v = np.array([collide(chain, model).velocities for chain in chains])[of.ravel()]
            except ValueError as reason:
                told = f"inside ranges = {dict(self.ranges)} is what a law refuses"
                raise ValueError(f"{told}: {reason}") from reason
            weight = 1.0 / one.sigma**2
            # The factor that makes the sum of squares least, less 1 and over its error.
            gain = (weight * v * (one.after - v)).sum(axis=1) * error
            off = gain / (1.0 + error**2 * (weight * v * v).sum(axis=1))
            rest = (one.after - (1.0 + off * error)[:, None] * v) / one.sigma
            found.append(np.column_stack([rest, off]))
        return found

    def descend(self, z: Vector, free: list[int]) -> tuple[Vector, float]:
        """Go down along some axes to a minimum; return z and chi-square there."""
        end = z.copy()

        def rest(part: Vector) -> Vector:
            end[free] = part
            return np.concatenate([part.ravel() for part in self.left(end)])

        if free:
            end[free] = scipy.optimize.least_squares(
                rest, z[free], bounds=(1.0, 2.0), method="dogbox", diff_step=_STEP,
                ftol=1e-11, xtol=1e-11, max_nfev=60,
            ).x  # fmt: skip
        last = rest(end[free])
        self.tried.append((float(last @ last), end.tolist()))
        return end, self.tried[-1][0]

    def reach(self, best: Vector, lowest: float, k: int, limit: float) -> float:
        """Return how far number k goes to a limit before chi-square has risen by `RISE`."""
        others, here, step, grow = [i for i in range(best.size) if i != k], best, 10 * _STEP, 2.0
        while step > 0.1 * _STEP and here[k] != limit:
            trial = here.copy()
            trial[k] += np.clip(limit - here[k], -step, step)
            end, value = self.descend(trial, others)
            if abs(value - lowest - RISE) < 0.01:
                return float(end[k])
            if value > lowest + RISE:
                grow = 0.5
            else:
                here = end
            step *= grow
        return float(here[k])

    def found(self, begin: Vector) -> LawFit:
        """Return the fit: from the lowest minimum, until no profile finds a lower one."""
        every = list(range(begin.shape[1]))
        ends = [self.descend(z, every) for z in begin]
        while True:
            lowest = min(value for _, value in ends)
            # Of those that are equally low the one with the least numbers.
            ends.sort(key=lambda end: (max(end[1] - lowest, 0.01), end[0].round(3).tolist()))
            minima = [ends[0][0]]
            for end, value in ends:
                far = (np.abs(end - x).max() > _SAME for x in minima)
                # From another minimum chi-square rises on the straight way to each that is known.
                ways = ([x + s * (end - x) for s in (0.3, 0.7)] for x in minima)
                tops = (max(self.descend(z, [])[1] for z in way) for way in ways)
                if value < lowest + RISE and all(far) and min(tops) > value + 0.01:
                    minima.append(end)
            spans = [[pick(self.reach(z, lowest, k, limit) for z in minima) for k in every]
                     for pick, limit in ((min, 1.0), (max, 2.0))]  # fmt: skip
            value, z = min(self.tried)
            if value > (1.0 - 1e-6) * lowest - 0.01:
                break
            ends.append(self.descend(np.array(z), every))
        low, high = (self.numbers(np.array(span)) for span in spans)
        intervals = {name: (low[name], high[name]) for name in self.ranges}
        values, *others = (
            {k: x if intervals[k] != tuple(self.ranges[k]) else None for k, x in found.items()}
            for found in (self.numbers(np.round(end, 9)) for end in minima)
        )
        left = {one.name: x[:, :-1] for one, x in zip(self.sets, self.left(minima[0]), strict=True)}
        return LawFit(values, intervals, tuple(others), left, lowest, self.freedom)
