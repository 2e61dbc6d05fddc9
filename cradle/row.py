"""A row of balls in a physics engine: the engine moves them, `collide` solves their impacts.

The engine's steps stay whole.  It keeps an energy that belongs to the length h of its step: that is
v^2/2 + V - h v V'/2 for v += h a, x += h v; so to cut a step at each contact pumps energy.  A ball
moves on a polygon: straight on with the speed w of the step, then a kick.  With the corners x and
x' of a side, and k the stiffness that draws the ball back, w^2 + k x x' stays the same.  A contact
with a time t of the step left makes x' + t u of x', and w + u of w.  Where the balls hang alike and
touch, that changes the energy of the row by the sum of m ((w + u)^2 - w^2), up to terms whose mean
is zero; and that sum is what `collide` keeps.  Two pushes do it: m u t / h before the engine's
step, and the rest after it, when w is known.  Where w lies between the velocities before and after
a step, the row learns from steps without contact.

A solver that puts balls back onto their strings takes the part q (h w / l)^2 of each w, q up to
1/2.  The row learns q too; then each part of a divided side loses what it would lose alone.
"""

import warnings
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from cradle.chain import Chain
from cradle.input.values import ABOVE_ZERO, ArrayLike, a, one_number, shown
from cradle.models import Model
from cradle.swinging.stride import Alone, Flight, Plane
from cradle.swinging.stride import Hit as Hit

_LESSONS = 200  # looks at moving balls to learn how the engine steps, and at what pushes did

Pairs = Sequence[Sequence[float]]


class Bodies(Protocol):
    """The adapter that you write for your engine; places have two numbers, the second one up."""

    def motion(self) -> tuple[Pairs, Pairs]:
        """Return the positions and the velocities of the N centres, m and m/s."""

    def push(self, ball: int, impulse: tuple[float, float]) -> None:
        """Give one ball an impulse at its centre, N s."""

    def advance(self, step: float) -> None:
        """Let the engine make one step of so many seconds."""


class Row(Alone):
    """A row of balls that an engine moves and the package collides.

    A TypeError or a ValueError is raised if a value is wrong, or the balls are no row: if balls
    that are no neighbours touch, balls overlap by more than `touching`, or pivots are out of order.

    Parameters
    ----------
    bodies : Bodies
        The adapter of the engine, which must not collide these balls with each other itself.
    chain, model : Chain, Model
        Masses and restitution from left to right, and the impact law.  A mass is what resists a
        push at the centre: for a ball that is one piece with its arm, the moment of inertia about
        the pivot over the square of the arm.
    radii : float or array_like, shape (N,)
        Radii of the balls, m; above 0.
    pivots : array_like, shape (N, 2), optional
        Where the strings end, m, in the order of the row; a string takes up the part of an impulse
        that is at right angles to the ball's arc.  Without pivots the balls are free.
    touching, resting : float, optional
        Neighbours count as touching, and are struck together, if they meet, or if their gap is at
        most `touching`, m, and they close or part no faster than `resting`, m/s.  Slower balls go
        on together.  If left out, r / 1000 and sqrt(a r) / 100, with the smallest radius r.
    acceleration : float
        a, m/s^2, above 0: that of gravity, or the most by which anything draws neighbours closer.

    Attributes
    ----------
    on_hit : callable, optional
        Your function, called after each step with every `Hit` of it: to play a sound, say.
    impacts, time : int, float
        How many impacts were solved so far, and how much time was stepped, s.

    Notes
    -----
    A step never waits for a compiler: unless `warm_up` was called before, an impact of five balls
    takes a millisecond or two.  Any unit of length will do if the acceleration has it too.

    Examples
    --------
    >>> import numpy as np
    >>> from cradle import Chain, ImpulseCorrelation
    >>> from cradle.row import Row
    >>> class Free:  # an engine
    ...     x, v = np.array([[-1, 0], [0, 0], [0.2, 0]]), np.array([[2.0, 0], [0, 0], [0, 0]])
    ...     def motion(self):
    ...         return self.x.tolist(), self.v.tolist()
    ...     def push(self, ball, impulse):
    ...         self.v[ball] += impulse  # mass 1
    ...     def advance(self, step):
    ...         self.x += step * self.v
    >>> balls = Free()
    >>> row = Row(balls, Chain([1, 1, 1], [0, 0, 0], 1), ImpulseCorrelation(0.5), radii=0.1)
    >>> for _ in range(60):
    ...     row.step(1 / 60)
    >>> balls.v[:, 0].round(6).tolist(), row.impacts
    ([-0.666667, 1.333333, 1.333333], 1)
    """

    def __init__(
        self, bodies: Bodies, chain: Chain, model: Model, radii: ArrayLike,
        pivots: ArrayLike | None = None, *, touching: float | None = None,
        resting: float | None = None, acceleration: float = 9.81,
    ) -> None:  # fmt: skip
        if missing := [x for x in ("motion", "push", "advance") if not hasattr(bodies, x)]:
            what = f"bodies is {a(type(bodies).__name__)} without {', '.join(missing)}"
            raise TypeError(f"{what}; must be an adapter with motion, push and advance")
        x, v = bodies.motion()
        super().__init__(x, chain, model, radii, pivots, touching, resting, acceleration)
        self._plane("motion: velocities", v)
        self.bodies = bodies
        self.on_hit: Callable[[Hit], object] | None = None
        self.impacts, self.time = 0, 0.0
        #: Where the speed of a step lies: 0 is the velocity before it, 1 the one after it.
        self.lag = 0.5
        self._samples, self._losses = list[float](), list[float]()
        self._last: tuple[Plane, Plane, float] | None = None
        self._lessons = self._doubts = self._driven = 0

    def step(self, duration: float) -> None:
        """Move the scene on by one step of `duration` seconds, which the engine makes as a whole.

        A ValueError or a RuntimeError is raised if the duration or what `motion` tells is wrong; if
        balls that touch are not in a row, have passed through each other or collide without end; if
        a push shows that a mass is not the engine's; or if the world moves between (`step_rows`).
        """
        if type(duration) is float and 0.0 < duration <= self.quiet:  # the usual case, and fast
            self.quiet -= duration
            self.time += duration
            self.bodies.advance(duration)
        else:
            step_rows((self,), duration)

    def wake(self) -> None:
        """Look at the balls at the next step: call it after moving or kicking one of them."""
        self.quiet, self._last = 0.0, None

    def _motion(self) -> list[list[complex]]:
        return [[complex(*one) for one in told] for told in self.bodies.motion()]

    def _push(self, own: Plane, x: Plane) -> None:
        for ball, impulse in enumerate((self.chain.masses * own * self.ways(x)).tolist()):
            if impulse:
                self.bodies.push(ball, (impulse.real, impulse.imag))

    def _before(self, duration: float) -> tuple[Plane, Plane, Flight] | None:
        """Push the balls so that the engine's step takes them where their contacts would."""
        self.quiet -= duration
        if self.quiet >= 0.0:
            return None
        told = self._motion()
        touches, arrival, self.quiet = self.look(*told)
        self.quiet -= duration
        near = touches or arrival < 1.5 * duration  # the step itself makes them faster or slower
        learning = self._lessons < _LESSONS and max(map(abs, told[1])) > self.resting
        if not (near or learning):
            self._last = None
            return None
        x, v = map(np.array, told)
        own = self.own(v, x)
        if learning:
            self._learn(x, own, duration)
        flight = self.fly(x, own + self.lag * duration * self._pull(x), duration) if near else None
        if flight is None:
            self.quiet *= not learning  # to compare two neighbouring looks
            return None
        self._last = None
        self._push(flight[1], x)
        return x, own, flight

    def _after(self, begun: tuple[Plane, Plane, Flight] | None, duration: float) -> None:
        """Push the balls so that they go on as after their contacts: now their speed is known."""
        started, self.time = self.time, self.time + duration
        if begun is None:
            return
        x, own, (_, early, hits) = begun
        now, v = map(np.array, self._motion())
        if hits and self.impacts < _LESSONS and self._driven < 2:
            self._watch(own + early, x, v, hits, duration)
        # The speed of the step, whether its kick comes first, last, or half and half.
        taken = self.taken(x, own + early, duration)
        speeds = own + self.lag * (self.own(v, now) + taken - early - own)
        speeds += self.lag * (1.0 - self.lag) * duration * (self._pull(x) - self._pull(now))
        change, _, hits = self.fly(x, speeds, duration) or (-taken, early, [])
        asked = change - early + taken
        self._push(asked, now)
        if self.impacts < _LESSONS:
            self._weigh(asked, self.own(v, now))
        self.impacts += len(hits)
        for hit in hits:
            if self.on_hit is not None:
                self.on_hit(hit._replace(time=started + hit.time))

    def _pull(self, x: Plane) -> Plane:
        """Return what gravity gives along the arcs, m/s^2; 0 if balls are free."""
        return -self.acceleration * self.ways(x).imag + 0j

    def _watch(self, own: Plane, x: Plane, v: Plane, hits: list[Hit], duration: float) -> None:
        """Warn where balls part by more than they were pushed: the engine collides them too."""
        gained, lines = v - own * self.ways(x), np.diff(x)
        parted = (np.diff(gained) * lines.conj()).real / np.abs(lines)
        pushed = self.chain.masses * gained
        # Gravity and what else moves a row pushes to one side; contacts push to both.
        if abs(pushed.sum()) < 0.3 * np.abs(pushed).sum():
            c, closing = int(parted.argmax()), max(-np.diff(hit.before).min() for hit in hits)
            self._driven += bool(parted[c] > 0.5 * closing + self.acceleration * duration)
            if self._driven == 2:
                told = f"balls {c} and {c + 1} part by {parted[c]:.3g} m/s more than pushed"
                rule = "the engine must not collide the balls of a row with each other"
                warnings.warn(f"{told}; {rule}", stacklevel=5)

    def _weigh(self, asked: Plane, before: Plane) -> None:
        """Refuse masses that are not the engine's: a push tells, where it acts at once."""
        x, v = map(np.array, self._motion())
        gained = self.own(v, x) - before
        # A body answers at once as if it were free, on an arm of its own with up to a quarter less.
        wrong = (np.abs(gained - asked) > 0.4 * np.abs(asked)) & (np.abs(asked) > self.resting)
        for ball in np.flatnonzero(wrong & (gained != 0.0)).tolist():
            mass, got = self.chain.masses[ball], gained[ball] / asked[ball]
            why = "`push` must be in the axes and the sense of `motion`"
            if got.real > 0.0:
                why = f"its mass is {mass / abs(got):.3g} where masses[{ball}] is {mass:g}"
            told = f"ball {ball} gains {abs(got):.3g} times the velocity that a push should give"
            raise RuntimeError(f"{told}; {why}")

    def _learn(self, x: Plane, own: Plane, duration: float) -> None:
        """Compare the ways of the last step with the velocities before and after it."""
        last, self._last = self._last, (x, own, duration)
        if last is None:
            return
        was, before, step = last
        way, gain = self.travelled(was, x), own - before
        mean, speed, gained = way / step, np.abs(0.5 * (own + before)), np.abs(gain)
        fast = speed > np.maximum(4.0 * gained, self.resting)
        self._lessons += 1
        if fast.any():
            self._doubts = self._doubts + 1 if (np.abs(mean[fast]) > 1.5 * speed[fast]).all() else 0
        if self._doubts > 2:
            rule = "call wake after moving it; rows are stepped together, by cradle.row.step_rows"
            raise RuntimeError(f"the world moves on between the steps of this row; {rule}")
        # Near the turning points the lag is seen: the kicks are in proportion to the pulls.
        first, second = self._pull(was).real, self._pull(x).real
        seen = (gained > 0.05 * speed) & (np.abs(first) > 0.05 * self.acceleration)
        if seen.any():
            share = ((mean - before)[seen] / gain[seen]).real
            late = share * second[seen]
            self._samples += (late / (late + (1.0 - share) * first[seen])).tolist()
            self.lag = float(np.clip(np.median(self._samples), 0.0, 1.0))
        # Near the lowest point one sees what a solver takes of a velocity that it turns.
        turn = way.real / self.arms(was)
        seen = fast & (np.abs(turn) > 0.01)
        if seen.any() and self._samples:
            kick = step * (self.lag * first + (1.0 - self.lag) * second)
            less = (kick - gain.real)[seen] / (0.5 * (own + before)).real[seen]
            self._losses += (less / turn[seen] ** 2).tolist()
            self.loss = float(np.clip(np.median(self._losses), 0.0, 0.5))


def step_rows(rows: Sequence[Row], duration: float) -> None:
    """Move a world with all its rows on by one step of `duration` seconds.

    The first row's engine makes the step; errors are those of `Row.step`.
    """
    whole = isinstance(rows, Sequence) and rows and all(isinstance(one, Row) for one in rows)
    if not whole or len({*rows}) < len(rows):
        raise ValueError(f"rows = {shown(rows)}; must be different Rows: the first has the engine")
    duration = one_number("duration", duration, *ABOVE_ZERO)
    begun = [row._before(duration) for row in rows]
    rows[0].bodies.advance(duration)
    for row, push in zip(rows, begun, strict=True):
        row._after(push, duration)
