"""A row of balls that makes one step alone; `cradle.row.Row` is one that an engine moves.

Places and velocities are complex numbers, x + i y in the plane of the row.  A ball's own velocity
is that in its own way: along its arc, a real number, where it hangs; where it is free, all of it.
"""

import math
import warnings
from itertools import combinations, pairwise
from typing import Any, NamedTuple

import numpy as np

from cradle.chain import Chain
from cradle.input import values as asked
from cradle.input.values import ArrayLike, NDArray, Vector
from cradle.models import Model, collide
from cradle.runtime.compile import without_waiting
from cradle.swinging.resting import common_velocities, stretches
from cradle.swinging.swing import part
from cradle.trace import compared_as_objects

_MISFIT = 0.1  # of two radii: so far may balls hang apart or overlap; gaps and leans are smaller
_BEND = 0.1  # rad, between contact lines of one cluster: beyond it the balls are no row
_LONGEST = 0.01  # s, until somebody looks at the balls
_MOST_IMPACTS = 10_000  # in one step: with a resting rule they end long before

Plane = NDArray[np.complexfloating[Any, Any]]


@compared_as_objects
class Hit(NamedTuple):
    """One impact of a row, as `Row.on_hit` is told of it."""

    time: float  #: When it happened, s of steps since the row was made.
    balls: range  #: The balls that took part; they touched each other.
    before: Vector  #: Their velocities along the row just before, left to right, m/s.
    after: Vector  #: Their velocities just after, m/s.
    loudest: int  #: The contact with the largest impulse, that of this ball and the next one.
    impulse: float  #: The impulse of that contact, N s.


#: What the contacts of a step do to the balls' own velocities, m/s: all of it, and the part that,
#: from the start on, takes the balls to where the step ends; and the impacts.
Flight = tuple[Plane, Plane, list[Hit]]


class Alone:
    """A row of balls at places x; the parameters are those of `cradle.row.Row`."""

    def __init__(
        self, x: ArrayLike, chain: Chain, model: Model, radii: ArrayLike, pivots: ArrayLike | None,
        touching: float | None, resting: float | None, acceleration: float,
    ) -> None:  # fmt: skip
        n = len(asked.must_be(Chain, "chain", chain))
        with without_waiting():
            collide(Chain(chain.masses, np.zeros(n), chain.restitution), model)  # do they fit?
        self.chain, self.model = chain, model
        size = asked.number_or_row("radii", radii, "N", *asked.ABOVE_ZERO)
        self.radii: list[float] = asked.row_of("radii", size, n, n).tolist()
        self.reach, least = [a + b for a, b in pairwise(self.radii)], min(self.radii)
        self.acceleration = asked.one_number("acceleration", acceleration, *asked.ABOVE_ZERO)
        near = 1e-3 * least if touching is None else touching
        slow = 0.01 * math.sqrt(self.acceleration * least) if resting is None else resting
        self.touching = asked.one_number("touching", near, *asked.ABOVE_ZERO)
        self.resting = asked.one_number("resting", slow, *asked.ABOVE_ZERO)
        self.met = 1e-3 * self.touching  # so near are balls that a flight has brought together
        at = self._plane("motion: positions", x)
        self._refuse_a_pack(at.tolist())
        overlaps = self.reach - np.abs(np.diff(at))
        for c in np.flatnonzero(overlaps > self.touching)[:1].tolist():
            rule = f"must be at most `touching` = {self.touching:g} at the start"
            raise ValueError(f"balls {c} and {c + 1} overlap by {overlaps[c]:g} m; {rule}")
        self.pivots = None if pivots is None else self._plane("pivots", pivots)
        #: How fast neighbours may come to close; 0 on equal strings: these are accelerated alike.
        self.speeding = self.acceleration
        if self.pivots is not None:
            lengths = self.arms(at)
            low = np.diff(self.pivots - 1j * lengths)  # unequal strings end at unequal heights
            for c in np.flatnonzero((low / (at[-1] - at[0])).real < 0.0)[:1].tolist():
                rule = "on the way from the first ball to the last; must be in the order of the row"
                raise ValueError(f"pivots[{c + 1}] lies behind pivots[{c}] {rule}")
            self.speeding *= np.ptp(lengths) > 1e-3 * lengths.min()
            apart = np.abs(low)
            for c in np.flatnonzero(np.abs(apart - self.reach) > _MISFIT * apart)[:1].tolist():
                sizes = f"radii[{c}] + radii[{c + 1}] = {self.reach[c]:g}"
                rule = f"should be within a tenth of {apart[c]:g}, as far as these balls hang apart"
                warnings.warn(f"{sizes}; {rule}", stacklevel=3)
        #: Part of a velocity that a step takes, over the square of the angle by which it turns.
        self.loss = 0.0
        #: For how long nothing can happen, s.
        self.quiet = 0.0

    def ways(self, x: Plane) -> Plane:
        """Return the directions in which balls at these places can move; 1 if they are free."""
        if self.pivots is None:
            return np.ones(len(x), complex)
        return 1j * (x - self.pivots) / self.arms(x)

    def own(self, v: Plane, x: Plane) -> Plane:
        """Return velocities in the balls' own ways."""
        return v if self.pivots is None else (v / self.ways(x)).real + 0j

    def travelled(self, x: Plane, y: Plane) -> Plane:
        """Return the own ways from places x to places y, m."""
        if self.pivots is None:
            return y - x
        return self.arms(x) * np.angle((y - self.pivots) / (x - self.pivots)) + 0j

    def moved(self, x: Plane, ways: Plane) -> Plane:
        """Return where balls are after such own ways."""
        if self.pivots is None:
            return x + ways
        turned: Plane = (x - self.pivots) * np.exp(1j * ways.real / self.arms(x))
        return self.pivots + turned

    def arms(self, x: Plane) -> Vector:
        """Return how far balls are from their pivots; infinity if they are free."""
        return np.full(len(x), np.inf) if self.pivots is None else np.abs(x - self.pivots)

    def taken(self, x: Plane, own: Plane, duration: float) -> Plane:
        """Return what a step takes of own velocities that it turns."""
        return self.loss * (own * duration / self.arms(x)) ** 2 * own

    def fly(self, x: Plane, own: Plane, duration: float) -> Flight | None:
        """Make a step with these own velocities; None if nothing touches."""
        change, early = np.zeros((2, len(x)), complex)
        hits: list[Hit] = []
        left, touched = duration, False
        for _ in range(_MOST_IMPACTS):
            touches, arrival, self.quiet = self.look(x.tolist(), (own * self.ways(x)).tolist())
            if touches:
                gained, touched = self._solve(x, own, duration - left, hits), True
                own, change = own + gained, change + gained
                early += left / duration * gained
            passed = min(arrival, left)
            taken = passed / duration * self.taken(x, own, duration)
            own, change = own - taken, change - taken
            if passed == left:
                self.quiet -= left
                return (change, early, hits) if touched else None
            x, left = self.moved(x, passed * own), left - passed
        why = f"balls are squeezed between others, or `resting` = {self.resting!r} is too low"
        raise RuntimeError(f"more than {_MOST_IMPACTS} impacts in a step of {duration!r} s; {why}")

    def look(self, x: list[complex], v: list[complex]) -> tuple[bool, float, float]:
        """Tell whether something touches now, when the next contact arrives, how long is quiet."""
        arrival, quiet = math.inf, _LONGEST
        strike = rest = False
        for c, reach in enumerate(self.reach):
            line = x[c + 1] - x[c]
            distance = math.hypot(line.real, line.imag)
            gap = distance - reach
            closing = ((v[c] - v[c + 1]) * line.conjugate()).real
            if not math.isfinite(gap + closing):
                for name, told in (("positions", x), ("velocities", v)):
                    asked.checked(f"motion: {name}", [(one.real, one.imag) for one in told])
            if not gap > -0.5 * reach:
                why = "the step is too long, or something else pushes them"
                raise RuntimeError(f"balls {c} and {c + 1} overlap by {-gap:g} m; {why}")
            closing /= distance
            if closing > self.resting:
                strike |= gap <= self.met
                arrival = min(arrival, max(gap, 0.0) / closing)
            rest |= gap <= 0.0 and closing > 1e-3 * self.resting
            # The first t > 0 with room = closing t + speeding t^2 / 2; none if they part for good.
            room = gap if gap > self.touching else max(gap, 0.0) + self.touching
            root = math.sqrt(closing * closing + 2.0 * self.speeding * room)
            if closing + root > 0.0:
                quiet = min(quiet, 2.0 * room / (closing + root))
        if self.speeding:  # nothing else keeps the balls in order
            self._refuse_a_pack(x)
        return strike or rest, 0.0 if strike else arrival, quiet  # after a strike look again

    def _solve(self, x: Plane, own: Plane, time: float, hits: list[Hit]) -> Plane:
        """Solve each cluster of touching balls; return what their own velocities gain."""
        gained, ways = np.zeros(len(x), complex), self.ways(x)
        lines, v = np.diff(x), own * ways
        gaps = np.abs(lines) - self.reach
        # Neighbours that have met, and those near each other that hardly move against each other.
        still = np.abs((np.diff(v) * lines.conj()).real) <= self.resting * np.abs(lines)
        for first, last in stretches((gaps <= self.met) | (still & (gaps <= self.touching))):
            balls = slice(first, last)
            axis = lines[first : last - 1].sum()
            axis /= abs(axis)
            off = np.abs(np.angle(lines[first : last - 1] / axis)).max()
            if off > _BEND:
                row = f"balls {first} to {last - 1} touch, but not in a straight row"
                told = f"{math.degrees(off):.0f} degrees off; at most {math.degrees(_BEND):.0f}"
                raise ValueError(f"{row}: a line of centres is {told} are allowed")
            # How a ball's own way lies to the axis; a free ball's is the axis.
            free = self.pivots is None
            along = np.ones(last - first) if free else (ways[balls] / axis).real
            if (np.abs(along) < 0.1).any():
                ball = first + int(np.argmin(np.abs(along)))
                raise ValueError(f"ball {ball} is struck along its string; its arc leads elsewhere")
            masses, before = self.chain.masses[balls] / along**2, (v[balls] / axis).real
            after = before
            if (before[:-1] - before[1:] > self.resting).any():
                alike, _ = common_velocities(masses, before, still[first : last - 1], self.resting)
                chain = Chain(masses, alike, self.chain.restitution[first : last - 1])
                with without_waiting():
                    after = collide(chain, part(self.model, len(x), first, last)).velocities
                impulses = np.cumsum(masses * (before - after))[:-1]
                loudest = first + int(np.argmax(impulses)), float(impulses.max())
                hits.append(Hit(time, range(first, last), before, after, *loudest))
            after = self._rested(masses, after, gaps[first : last - 1])
            gained[balls] = (after - before) * (axis if free else 1.0 / along)
        return gained

    def _rested(self, masses: Vector, v: Vector, gaps: Vector) -> Vector:
        """Return velocities after those that touch and still approach have come to rest."""
        v, _ = common_velocities(masses, v, v[:-1] > v[1:], 0.0)
        if (deep := gaps < -self.touching).any():  # these part, no faster than by default
            slow = min(0.5 * self.resting, 0.16 * math.sqrt(self.acceleration * self.touching))
            ramp = np.append(0.0, np.cumsum(slow * deep))
            v += ramp - masses @ ramp / masses.sum()
        return v

    def _plane(self, name: str, places: ArrayLike) -> Plane:
        """Return places in the plane as complex numbers."""
        x, n = asked.checked(name, places), len(self.chain)
        if x.shape != (n, 2):
            raise ValueError(f"{name} has shape {x.shape}; {n} balls need ({n}, 2)")
        return x[:, 0] + 1j * x[:, 1]

    def _refuse_a_pack(self, x: list[complex]) -> None:
        for i, j in combinations(range(len(x)), 2):
            if j > i + 1 and abs(x[j] - x[i]) <= self.radii[i] + self.radii[j] + self.touching:
                rule = "a row alone can be solved, no pack; are these radii, not diameters?"
                raise ValueError(f"balls {i} and {j} touch and are no neighbours; {rule}")
