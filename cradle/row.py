"""A row of balls in a physics engine: the engine moves them, `collide` solves their impacts.

Engines solve one contact after another, or all at once as one body; neither is what a row of
elastic balls does.  `Row` takes the contacts of one row over: the engine is told not to collide
these balls with each other, and `Row.step` takes the place of the engine's step.  It looks where
the balls are, lets the engine step to the instant of a contact, solves the balls that touch there
as one chain, and gives the impulses back.  All else stays with the engine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cradle.chain import Chain
from cradle.input.values import Vector, a, checked, must_be, one_number
from cradle.models import Model, collide
from cradle.swinging.resting import common_velocities, stretches
from cradle.swinging.swing import part

__all__ = ["Bodies", "Row"]

# Contact lines of one cluster may differ by this angle, rad: beyond it the balls are no row.
_BEND = 0.1
# Somebody looks at the balls at least that often, s.
_LONGEST = 0.01
# More impacts than this in one step are no row of balls: with a resting rule they end long before.
_MOST_IMPACTS = 10_000

Pairs = Sequence[Sequence[float]]


class Bodies(Protocol):
    """What a row asks of an engine: an adapter of three short methods.

    All is told in a plane that holds the centres of the balls: two coordinates, the second one up.
    """

    def motion(self) -> tuple[Pairs, Pairs]:
        """Return the positions and the velocities of the N centres, m and m/s."""
        ...

    def push(self, ball: int, impulse: tuple[float, float]) -> None:
        """Give one ball an impulse at its centre, N s."""
        ...

    def advance(self, step: float) -> None:
        """Let the engine make one step of so many seconds."""
        ...


class Row:
    """A row of balls that an engine moves and the package collides.

    Parameters
    ----------
    bodies : Bodies
        The engine's adapter.  The engine must not collide these balls with each other.
    chain : Chain
        Masses and restitution of the balls from left to right; its velocities are not used.  The
        mass is what a push at the centre meets: where a ball turns about its pivot as one piece
        with its arm, its moment of inertia about the pivot over the arm's length squared.
    model : Model
        The impact law, such as ``ImpulseCorrelation(0.13)``.
    radii : float or array_like, shape (N,)
        Of the balls, m; above 0.
    pivots : array_like, shape (N, 2), optional
        Where the strings end, m, in the order of the row.  A ball on a string takes up the part of
        an impulse along the tangent of its arc; its string takes the rest.  Without pivots the
        balls are free.
    touching : float, optional
        Balls whose gap is at most this touch, m; a thousandth of the smallest radius r if left
        out.  Steel balls of a toy are pressed into each other by about that.
    resting : float, optional
        Balls that touch and close no faster than this do not rebound: they go on together, m/s;
        sqrt(a r) / 100 with the acceleration a if left out.
    acceleration : float
        The largest acceleration between neighbours that is to be expected, usually that of
        gravity, m/s^2.  From it follows for how long nobody need look at balls that do not hang
        on equal strings.  All are looked at every hundredth of a second, if the steps are shorter,
        in case something else strikes them.

    Raises
    ------
    TypeError
        If an argument is of the wrong kind.
    ValueError
        If a value is wrong, or the balls are no row: balls that are no neighbours touch, balls
        overlap by more than `touching`, or pivots are not in the order of the balls.

    Notes
    -----
    Any units will do, such as pixels, if all lengths have the same one, and the acceleration too.

    Examples
    --------
    An engine of ten lines, and three balls in it of which the first one flies:

    >>> import numpy as np
    >>> from cradle import Chain
    >>> from cradle.row import Row
    >>> class Free:
    ...     def __init__(self, x, v):
    ...         self.x, self.v = np.array(x), np.array(v)
    ...     def motion(self):
    ...         return self.x.tolist(), self.v.tolist()
    ...     def push(self, ball, impulse):
    ...         self.v[ball] += impulse  # mass 1
    ...     def advance(self, step):
    ...         self.x += step * self.v
    >>> from cradle import ImpulseCorrelation
    >>> balls = Free([[-1.0, 0.0], [0.0, 0.0], [0.2, 0.0]], [[2.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    >>> row = Row(balls, Chain([1, 1, 1], [0, 0, 0], 1), ImpulseCorrelation(0.5), 0.1)
    >>> for _ in range(60):
    ...     row.step(1 / 60)
    >>> balls.v[:, 0].round(6).tolist(), row.impacts
    ([-0.666667, 1.333333, 1.333333], 1)
    """

    def __init__(
        self,
        bodies: Bodies,
        chain: Chain,
        model: Model,
        radii: ArrayLike,
        pivots: ArrayLike | None = None,
        *,
        touching: float | None = None,
        resting: float | None = None,
        acceleration: float = 9.81,
    ) -> None:
        missing = [name for name in ("motion", "push", "advance") if not hasattr(bodies, name)]
        if missing:
            raise TypeError(
                f"bodies is {a(type(bodies).__name__)} without {', '.join(missing)}; must be an "
                "adapter with motion, push and advance"
            )
        n = len(must_be(Chain, "chain", chain))
        collide(Chain(chain.masses, np.zeros(n), chain.restitution), model)  # do they fit?
        size = checked("radii", radii, "must be above 0", 0.0, open_low=True)
        if size.shape not in ((), (n,)):
            raise ValueError(f"radii has shape {size.shape}; {n} balls need () or ({n},)")
        self.bodies, self.chain, self.model = bodies, chain, model
        self.radii: list[float] = np.broadcast_to(size, (n,)).tolist()
        self.reach = [a + b for a, b in zip(self.radii, self.radii[1:], strict=False)]
        self.pivots = None if pivots is None else checked("pivots", pivots)
        if self.pivots is not None and self.pivots.shape != (n, 2):
            raise ValueError(f"pivots has shape {self.pivots.shape}; {n} balls need ({n}, 2)")
        self.acceleration = one_number(
            "acceleration", acceleration, "must be above 0", 0.0, open_low=True
        )
        near = 1e-3 * min(self.radii) if touching is None else touching
        self.touching = one_number("touching", near, "must be above 0", 0.0, open_low=True)
        slow = 0.01 * math.sqrt(self.acceleration * min(self.radii)) if resting is None else resting
        self.resting = one_number("resting", slow, "must be above 0", 0.0, open_low=True)
        x = checked("motion: positions", bodies.motion()[0])
        self._refuse_a_pack(x)
        overlaps = self.reach - np.hypot(*np.diff(x, axis=0).T)
        if (overlaps > self.touching).any():
            c = int(np.argmax(overlaps))
            rule = f"must be at most `touching` = {self.touching:g} at the start"
            raise ValueError(f"balls {c} and {c + 1} overlap by {overlaps[c]:g} m; {rule}")
        # Balls on equal strings that nearly touch are accelerated alike, others not.
        self.hang_alike = False
        if self.pivots is not None:
            places = self.pivots @ (self.pivots[-1] - self.pivots[0])
            back = np.diff(places) < 0.0
            if back.any():
                ball = int(np.argmax(back)) + 1
                raise ValueError(
                    f"pivots[{ball}] lies behind pivots[{ball - 1}] on the way from the first to "
                    "the last; the balls must be told from one end of the row to the other"
                )
            if (x[-1] - x[0]) @ (self.pivots[-1] - self.pivots[0]) <= 0.0:
                raise ValueError("pivots lead the other way than the balls; must be in their order")
            lengths = np.hypot(*(x - self.pivots).T)
            self.hang_alike = bool(np.ptp(lengths) <= 1e-3 * lengths.min())
        self.speeding = 0.0 if self.hang_alike else self.acceleration
        #: How many impacts were solved so far, and how often touching balls were brought to rest.
        self.impacts, self.settled = 0, 0
        #: For how long nothing can happen, s.
        self.quiet = 0.0

    def step(self, duration: float) -> None:
        """Move the scene on by one step; the engine steps at least once, and to every contact.

        Raises
        ------
        ValueError
            If the duration or what `motion` tells is wrong, or balls that touch are not in a row.
        RuntimeError
            If balls have passed through each other, or the impacts of the step do not end.
        """
        if not (type(duration) is float and 0.0 < duration < math.inf):  # one comparison a step
            duration = one_number("duration", duration, "must be above 0", 0.0, open_low=True)
        self.quiet -= duration
        if self.quiet >= 0.0:
            self.bodies.advance(duration)
            return
        left, most = duration, self.impacts + _MOST_IMPACTS
        while True:
            arrival, self.quiet = self._look()
            if arrival >= left:
                break
            if arrival > 0.0:
                self.bodies.advance(arrival)
                left -= arrival
            elif self.impacts > most:
                raise RuntimeError(
                    f"more than {_MOST_IMPACTS} impacts in a step of {duration!r} s; the balls are "
                    f"squeezed between others, or `resting` = {self.resting!r} is too low"
                )
        self.bodies.advance(left)
        self.quiet -= left

    def wake(self) -> None:
        """Look at the balls at the next step: call it after moving or kicking one of them."""
        self.quiet = 0.0

    def _look(self) -> tuple[float, float]:
        """Solve what touches now.  Return when the next contact arrives, and how long is quiet.

        The first time goes by the present velocities, and is 0 after an impact: look again.  For
        the second, neighbours may also be accelerated towards each other.
        """
        x, v = self.bodies.motion()
        if not self.hang_alike:  # nothing else keeps the balls in order
            self._refuse_a_pack(np.array(x, dtype=np.float64))
        arrival, quiet = math.inf, _LONGEST
        strike = rest = False
        for c, reach in enumerate(self.reach):
            (xa, ya), (xb, yb) = x[c], x[c + 1]
            dx, dy = xb - xa, yb - ya
            distance = math.hypot(dx, dy)
            gap = distance - reach
            closing = (v[c][0] - v[c + 1][0]) * dx + (v[c][1] - v[c + 1][1]) * dy
            if not math.isfinite(gap + closing):
                checked("motion: positions", x)
                checked("motion: velocities", v)
            if not gap > -0.5 * reach:
                raise RuntimeError(
                    f"balls {c} and {c + 1} overlap by {-gap:g} m; the step is too long, or "
                    "something else pushes them"
                )
            closing /= distance
            if gap <= self.touching:
                strike |= closing > self.resting
                rest |= gap <= 0.0 and closing > 1e-3 * self.resting
            elif closing > self.resting:
                arrival = min(arrival, gap / closing)
            # The first t > 0 with room = closing t + speeding t^2 / 2; none if they part for good.
            room = max(gap, 0.0) + self.touching
            root = math.sqrt(closing * closing + 2.0 * self.speeding * room)
            if closing + root > 0.0:
                quiet = min(quiet, 2.0 * room / (closing + root))
        if strike or rest:
            self._solve(np.array(x, dtype=np.float64), np.array(v, dtype=np.float64))
        return (0.0 if strike else arrival), quiet

    def _solve(self, x: Vector, v: Vector) -> None:
        """Solve each cluster of touching balls, and give the impulses to the engine."""
        lines = np.diff(x, axis=0)
        distance = np.hypot(*lines.T)
        lines /= distance[:, None]
        gaps = distance - self.reach
        for first, last in stretches(gaps <= self.touching):
            contacts = slice(first, last - 1)
            axis = lines[contacts].sum(axis=0)
            axis /= math.hypot(*axis)
            self._refuse_a_bend(lines[contacts], axis, first)
            along = self._along(x[first:last], axis, first)
            masses = self.chain.masses[first:last] / along**2
            before = v[first:last] @ axis
            after = self._after(masses, before, gaps[contacts], first)
            # The part of the impulse along the arc; all of it where balls are free.
            for ball, impulse in enumerate(masses * (after - before), start=first):
                if impulse:
                    self.bodies.push(ball, self._given(x[ball], axis, impulse, ball))

    def _after(self, masses: Vector, before: Vector, gaps: Vector, first: int) -> Vector:
        """Return the velocities of a cluster along its axis, after impact and rest."""
        contacts, v = slice(first, first + len(gaps)), before
        if (v[:-1] - v[1:] > self.resting).any():
            chain = Chain(masses, v, self.chain.restitution[contacts])
            model = part(self.model, len(self.chain), first, first + len(masses))
            v = collide(chain, model).velocities
            self.impacts += 1
        slow = v[:-1] - v[1:] > 0.0
        if slow.any():
            v, _ = common_velocities(masses, v, slow, 0.0)
            self.settled += 1
        deep = gaps < -self.touching
        if deep.any():
            # Balls that overlap by more than is unseen part, slower than what counts as an impact.
            ramp = np.concatenate([[0.0], np.cumsum(np.where(deep, 0.5 * self.resting, 0.0))])
            v = v + ramp - masses @ ramp / masses.sum()
        return v

    def _tangent(self, position: Vector, ball: int) -> Vector:
        assert self.pivots is not None
        x, y = position - self.pivots[ball]
        tangent: Vector = np.array([-y, x]) / math.hypot(x, y)
        return tangent

    def _along(self, x: Vector, axis: Vector, first: int) -> Vector:
        """Return the cosine between each ball's arc and the axis of the cluster; 1 if free."""
        if self.pivots is None:
            return np.ones(len(x))
        found = np.array([self._tangent(p, i) @ axis for i, p in enumerate(x, start=first)])
        if (np.abs(found) < 0.1).any():
            ball = first + int(np.argmin(np.abs(found)))
            raise ValueError(f"ball {ball} is struck along its string; its arc leads elsewhere")
        return found

    def _given(
        self, position: Vector, axis: Vector, impulse: float, ball: int
    ) -> tuple[float, float]:
        """Return the impulse that a ball takes up: along its arc, if it hangs."""
        given = impulse * axis
        if self.pivots is not None:
            tangent = self._tangent(position, ball)
            given = (given @ tangent) * tangent
        return float(given[0]), float(given[1])

    def _refuse_a_bend(self, lines: NDArray[np.float64], axis: Vector, first: int) -> None:
        off = np.arccos(np.clip(lines @ axis, -1.0, 1.0))
        if off.max() > _BEND:
            raise ValueError(
                f"balls {first} to {first + len(lines)} touch, but not in a straight row: a line "
                f"of centres is {math.degrees(off.max()):.0f} degrees off; at most "
                f"{math.degrees(_BEND):.0f} are allowed"
            )

    def _refuse_a_pack(self, x: Vector) -> None:
        n = len(self.chain)
        if x.shape != (n, 2):
            raise ValueError(f"motion() tells positions of shape {x.shape}; must be ({n}, 2)")
        for i in range(n):
            for j in range(i + 2, n):
                if math.hypot(*(x[j] - x[i])) <= self.radii[i] + self.radii[j] + self.touching:
                    raise ValueError(
                        f"balls {i} and {j} touch and are no neighbours; a row alone can be "
                        "solved, no pack"
                    )
