"""The motion of springs that give back only a part of what they absorb, for `energy`."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from cradle.input.values import Vector
from cradle.trace import Event

if TYPE_CHECKING:
    from cradle.models.energy import EnergyDistribution

_EPSILON = float(np.finfo(np.float64).eps)


class TooManyEvaluations(Exception):
    """The forces were evaluated as often as allowed."""


class Process:
    """The motion of a chain in its own units, and the record of it.

    The state of N balls is one vector y: changes of velocity (N), the x of `EnergyDistribution`
    (N - 1; below zero they are gaps) and impulses (N - 1).
    """

    def __init__(self, m: Vector, u: Vector, k: Vector, e: Vector, model: EnergyDistribution):
        n, p = len(m), model.exponent
        self.m, self.u, self.k, self.e, self.p = m, u, k, e, p
        self.gaps, self.rtol, self.most = model.gaps, model.rtol, model.max_evaluations
        self.reduced = m[:-1] / (m[:-1] + m[1:]) * m[1:]
        self.t, self.y = 0.0, np.zeros(3 * n - 2)
        # Absolute tolerance, in units of the first collision, but of each contact's own stiffness.
        own = np.concatenate([np.ones(n), k ** (-1 / (p + 1)), np.ones(n - 1)])
        self.atol = 0.1 * self.rtol * own
        self.closed = np.zeros(n - 1, dtype=bool)
        self.loading = np.zeros(n - 1, dtype=bool)  # closed, and its compression grows
        self.weights = np.zeros(n - 1)  # dx / (u dt) of each contact, up to the next event
        self.collisions = np.zeros(n - 1, dtype=np.int64)
        self.absorbed = np.zeros(n - 1)
        self.collapsed = False
        #: Largest change of each velocity at an event so far: what rounding was left by.
        self.largest = np.zeros(n)
        self.record = [("", -1, self.y)]
        self.steps = [self.y[:, None]]
        self.evaluations = 0

    def parts(self, y: Vector) -> tuple[Vector, Vector, Vector]:
        """Return changes of velocity, compressions and impulses, as views of y."""
        n = len(self.m)
        return y[:n], y[n : 2 * n - 1], y[2 * n - 1 :]

    def account(self, velocities: Vector, mass: float, speed: float) -> dict[str, Any]:
        """Return what happened, in the chain's units, as fields of an `EnergyTrace`."""
        kinds, contacts, states = zip(*self.record, strict=True)
        change, _, impulses = self.parts(np.array(states).T)
        step_change, _, step_impulses = self.parts(np.concatenate(self.steps, axis=1))
        reached = self.parts(self.y)
        return {
            "velocities": velocities + speed * reached[0],
            "impulses": mass * speed * reached[2],
            "absorbed": mass * speed * speed * self.absorbed,
            "collisions": self.collisions,
            "path": velocities + speed * change.T,
            "path_impulses": mass * speed * impulses.T,
            "events": tuple(map(Event, kinds[1:], contacts[1:])),
            "step_velocities": velocities + speed * step_change.T,
            "step_impulses": mass * speed * step_impulses.T,
            "evaluations": self.evaluations,
            "collapsed": self.collapsed,
        }

    def speeds(self, y: Vector) -> Vector:
        """Return the closing speeds; what is no more than rounding is zero."""
        n = len(self.m)
        u = self.u + (y[: n - 1] - y[1:n])
        change = np.maximum(self.largest, np.abs(y[:n]))
        rounding = 4.0 * _EPSILON * (np.abs(self.u) + change[:-1] + change[1:])
        return np.where(np.abs(u) <= rounding, 0.0, u)

    def stored(self, y: Vector) -> Vector:
        """Return the energy that each contact stores."""
        return self.k * np.maximum(self.parts(y)[1], 0.0) ** (self.p + 1.0) / (self.p + 1.0)

    def rate(self, _: float, y: Vector) -> Vector:
        """Return dy/dt while no contact opens, closes or turns.

        A closed contact that a trial step draws apart pulls, so that the step sees no kink.
        """
        if self.evaluations == self.most:
            raise TooManyEvaluations
        self.evaluations += 1
        d, out = np.where(self.closed, self.parts(y)[1], 0.0), np.zeros_like(y)
        change, growth, force = self.parts(out)
        force[:] = self.k * np.copysign(np.abs(d) ** self.p, d)
        change[1:] = force
        change[:-1] -= force
        change /= self.m
        growth[:] = self.speeds(y) * self.weights
        return out

    def run(self) -> str:
        """Run to the last separation; return why it could not be reached, or nothing."""
        self.settle([])
        self.record = self.record[:1]  # what touches from the start does not close
        try:
            while self.closed.any() or self.fly():
                if self.closed.any() and (failure := self.integrate()):
                    return failure
        except TooManyEvaluations:
            return f"max_evaluations = {self.most} reached{self.advice()}"
        self.part()
        return ""

    def advice(self) -> str:
        """Return what makes the steps of the integration short, and which models take none."""
        pairs = np.minimum(self.m[:-1], self.m[1:])
        c = int(np.argmax(self.k / pairs))
        ball = c if self.m[c] <= self.m[c + 1] else c + 1
        return (
            f"; ball {ball} on contact {c}, the quickest of the springs, makes the steps short; "
            "SequentialCollisions and ImpulseCorrelation (with a ratio) take no steps"
        )

    def fly(self) -> bool:
        """Fly with all contacts open to the next closing; False if there is none."""
        u, d = self.speeds(self.y), self.parts(self.y)[1]
        if not (self.gaps and (u > self.rtol).any()):
            return False
        ahead = np.flatnonzero(u > 0.0)
        needed = -d[ahead] / u[ahead]
        first = int(np.argmin(needed))
        self.t += float(needed[first])
        self.y = self.y.copy()
        self.parts(self.y)[1][:] += u * needed[first]
        self.settle([int(ahead[first])])
        return True

    def solution(self, begin: float, y: Vector, end: float, **options: Any) -> Any:
        """Return SciPy's integration of the rates."""
        # SciPy is slow to import, and only this model needs it.
        from scipy.integrate import solve_ivp

        options |= {"method": "DOP853", "rtol": self.rtol, "atol": self.atol}
        # For a large p a trial step far too long overflows, and is rejected.
        with np.errstate(over="ignore", invalid="ignore"):
            return solve_ivp(self.rate, (begin, end), y, **options)

    def integrate(self) -> str:
        """Integrate to the next event; return why it failed, or nothing."""
        released = np.divide(1.0, self.e**2, out=np.ones_like(self.e), where=self.e > 0.0)
        self.weights = np.where(self.closed & ~self.loading, released, self.closed | self.gaps)
        # Balls at rest together that nothing touches have no events.
        d = self.parts(self.y)[1]
        contacts = np.flatnonzero(self.closed | (d != 0.0) | (self.speeds(self.y) != 0.0)).tolist()
        events = [self.crossing(c) for c in contacts] + [self.extreme(c) for c in contacts]

        def extremes(found: Any) -> list[tuple[float, int, Vector]]:
            half = len(contacts)
            by_contact = zip(contacts, found.t_events[half:], found.y_events[half:], strict=True)
            turns = [(t, c, y) for c, ts, ys in by_contact for t, y in zip(ts, ys, strict=True)]
            return sorted(turns, key=lambda turn: turn[:2])

        found = self.solution(self.t, self.y, np.inf, events=events)
        turns = extremes(found)
        # A contact that opens and closes again (or the reverse) within one step goes unnoticed,
        # but for its extreme: a second run that ends there has to cross zero before.
        side = np.where(self.closed, 1.0, -1.0)
        missed = [t for t, c, y in turns if side[c] * self.parts(y)[1][c] < 0.0]
        if missed:
            found = self.solution(self.t, self.y, missed[0], events=events)
            turns = extremes(found)
        if found.status < 0:
            return str(found.message)
        crossed = [c for c, ts in zip(contacts, found.t_events, strict=False) if len(ts)]
        if crossed:
            found.y[:, -1] = self.again(found)
        self.steps.append(found.y)
        self.t, self.y = float(found.t[-1]), found.y[:, -1].copy()
        for _, c, y in turns:
            self.turn(c, y)
        # An extreme may fall on the end, where rounding can hide it.
        ahead = self.closed & (self.loading == (self.speeds(self.y) < 0.0))
        for c in np.flatnonzero(ahead).tolist():
            self.turn(c, self.y)
        self.settle(crossed)
        return ""

    def again(self, found: Any) -> Any:
        """Return the state at the end of an integration, better than by interpolation.

        The force is not smooth where a contact opens or closes, and there SciPy's interpolation is
        less exact than its steps: the last step is done again to where the crossing was found.
        """
        begin, end = found.t[-2:]
        if begin == end:
            return found.y[:, -1]
        last = self.solution(begin, found.y[:, -2], end, first_step=end - begin)
        return found.y[:, -1] if last.status < 0 else last.y[:, -1]

    def crossing(self, c: int) -> Any:
        """Return SciPy's event of contact c opening or closing."""
        if not (self.closed[c] or self.gaps):
            return _leaving(-1.0, lambda y: self.speeds(y)[c])
        return _leaving(1.0 if self.closed[c] else -1.0, lambda y: self.parts(y)[1][c])

    def extreme(self, c: int) -> Any:
        """Return SciPy's event of contact c turning from compression to release or back."""
        # The rate has a kink there, unless e = 1: no step may cross it.  Without a kink the
        # integration goes on, and may meet several extremes, of both kinds.
        if self.closed[c] and self.e[c] < 1.0:
            return _leaving(1.0 if self.loading[c] else -1.0, lambda y: self.speeds(y)[c])
        return lambda _, y: float(self.speeds(y)[c])

    def turn(self, c: int, y: Vector) -> None:
        """Book an extreme of a compression: the energy stored there, and a maximum as an event."""
        acceleration = self.rate(0.0, y)
        falling = bool(acceleration[c] < acceleration[c + 1])
        # Extremes alternate; one at the end of an integration must not count in the next again.
        if not self.closed[c] or self.parts(y)[1][c] <= 0.0 or falling != self.loading[c]:
            return
        self.loading[c] = not falling
        stored = self.stored(y)[c]
        self.absorbed[c] += stored if falling else -stored
        if falling:
            self.record.append(("maximum_compression", c, y))

    def settle(self, crossed: list[int]) -> None:
        """Open the contacts that have ended, close those that approach, and record both."""
        self.y = self.y.copy()
        change, d, _ = self.parts(self.y)
        self.largest = np.maximum(self.largest, np.abs(change))
        d[crossed] = 0.0
        if not self.gaps:
            # Where several end at one instant, rounding shows gaps that rigid balls never close.
            np.maximum(d, 0.0, out=d)
        # The limit of e to zero: what is stored is lost at u = 0.
        plastic = self.closed & ~self.loading & (self.e == 0.0)
        d[plastic] = 0.0
        u = self.speeds(self.y)
        touching = d >= 0.0
        closed = ~plastic & np.where(self.closed, (d > 0.0) | (u > 0.0), touching & (u > 0.0))
        resting = ~closed & touching & ((u == 0.0) | plastic)
        resting[crossed] |= ~self.closed[crossed]
        # What touches at rest beside a contact that pushes on its ball closes too.
        for c in [*range(1, len(closed)), *range(len(closed) - 2, -1, -1)]:
            closed[c] |= resting[c] & closed[max(c - 1, 0) : c + 2].any()
        stay = self.closed & closed & ~plastic
        opens, closes = self.closed & ~stay, closed & ~stay
        self.note("end", opens)
        # What goes on with speeds below the errors of the integration alone may go on for ever.
        speeds = np.maximum(u, np.sqrt(2.0 * self.stored(self.y) / self.reduced))
        if (speeds <= self.rtol).all():
            self.collapsed = bool(stay.any() or (closes & (self.collisions > 0)).any())
            self.note("collapse", stay)
            self.closed = np.zeros_like(closed)
            return
        self.note("close", closes)
        self.collisions += closes
        self.loading = (self.loading & stay) | closes
        self.closed = closed

    def note(self, kind: str, where: Vector) -> None:
        """Record an event of some contacts, now."""
        self.record += [(kind, c, self.y) for c in np.flatnonzero(where).tolist()]

    def part(self) -> None:
        """Give a common velocity to balls that are left with closing speeds above zero."""
        from scipy.optimize import isotonic_regression

        u = self.speeds(self.y)
        if not (u > 0.0).any():
            return
        self.y = self.y.copy()
        change, _, impulses = self.parts(self.y)
        # Nearest in kinetic energy among the velocities in order: groups that collide plastically.
        groups = isotonic_regression(-np.cumsum([0.0, *u]), weights=self.m).blocks
        for first, last in itertools.pairwise(groups.tolist()):
            # From the heaviest ball of the group: of a larger sum its mass would show the rounding.
            m, lag = self.m[first:last], -np.cumsum([0.0, *u[first : last - 1]])
            lag -= lag[np.argmax(m)]
            jump = m @ lag / m.sum() - lag
            change[first:last] += jump
            impulses[first : last - 1] -= np.cumsum(m * jump)[:-1]
        self.record[-1] = (*self.record[-1][:2], self.y)


def _leaving(side: float, value: Callable[[Vector], float]) -> Any:
    """Return SciPy's event, an end, of a value leaving its side of zero; zero is still there."""

    def event(_: float, y: Vector) -> float:
        return float(value(y)) or side

    vars(event).update(terminal=True, direction=-side)
    return event
