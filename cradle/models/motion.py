"""The motion of balls on springs in time, which `compliant` and `energy` share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cradle.chain import Chain
from cradle.input.values import Vector, must_be, row_of
from cradle.trace import Event, Trace


def own_units(
    chain: Chain, stiffness: float | Sequence[float]
) -> tuple[Vector, float, float, float]:
    """Return the stiffness of each contact, and the units in which springs are solved.

    These are stiffness, reduced mass and closing speed of the contact that closes fastest; the
    speed is 1 if none moves.
    """
    n, u = len(must_be(Chain, "chain", chain)), chain.closing_speeds
    k = row_of("stiffness", stiffness, n - 1, n)
    c = int(np.argmax(u))
    with np.errstate(over="ignore"):
        mass = chain.masses[c] / (chain.masses[c] + chain.masses[c + 1]) * chain.masses[c + 1]
    if not np.finfo(np.float64).tiny <= mass:
        raise ValueError(
            f"masses[{c}] = {float(chain.masses[c])!r}; its reduced mass with masses[{c + 1}] = "
            f"{float(chain.masses[c + 1])!r} is beyond the range of floats: choose other units"
        )
    return k, float(k[c]), float(mass), abs(float(u[c])) or 1.0


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class CurvedTrace(Trace):
    """The path of an impact whose events are joined by smooth curves; N balls, S steps."""

    step_velocities: Vector
    step_impulses: Vector
    evaluations: int

    def curve(self) -> tuple[Vector, Vector]:
        """Return impulses and velocities at the steps of the integration, and at the end."""
        return (
            np.vstack([self.step_impulses, self.impulses]),
            np.vstack([self.step_velocities, self.velocities]),
        )


class TooManyEvaluations(Exception):
    """The forces were evaluated as often as allowed."""


class Motion:
    """The motion of a chain in its own units, and the record of it.

    The state of N balls is one vector y: changes of velocity (N), compressions (N - 1; below zero
    they are gaps) and impulses (N - 1).
    """

    def __init__(self, m: Vector, u: Vector, k: Vector, p: float, rtol: float) -> None:
        n = len(m)
        self.m, self.u, self.k, self.p, self.rtol = m, u, k, p, rtol
        self.t, self.y = 0.0, np.zeros(3 * n - 2)
        # Absolute tolerance, in units of the first collision, but of each contact's own stiffness.
        self.atol = 0.1 * rtol * np.concatenate([np.ones(n), k ** (-1 / (p + 1)), np.ones(n - 1)])
        self.closed = np.zeros(n - 1, dtype=bool)
        self.loading = np.zeros(n - 1, dtype=bool)  # closed, and its compression grows
        self.collisions = np.zeros(n - 1, dtype=np.int64)
        self.absorbed, self.durations = np.zeros((2, n - 1))
        self.record = [(self.t, "", -1, self.y)]
        self.steps = [(np.zeros(1), self.y[:, None])]
        self.evaluations, self.most = 0, 0

    def parts(self, y: Vector) -> tuple[Vector, Vector, Vector]:
        """Return changes of velocity, compressions and impulses, as views of y."""
        n = len(self.m)
        return y[:n], y[n : 2 * n - 1], y[2 * n - 1 :]

    def account(self, chain: Chain, mass: float, speed: float) -> dict[str, Any]:
        """Return what happened, in the chain's units, as fields of a `CurvedTrace`."""
        _, kinds, contacts, states = zip(*self.record, strict=True)
        change, _, impulses = self.parts(np.array(states).T)
        steps = np.concatenate([y for _, y in self.steps], axis=1)
        step_change, _, step_impulses = self.parts(steps)
        reached = self.parts(self.y)
        return {
            "chain": chain,
            "velocities": chain.velocities + speed * reached[0],
            "impulses": mass * speed * reached[2],
            "absorbed": mass * speed * speed * self.absorbed,
            "collisions": self.collisions,
            "path": chain.velocities + speed * change.T,
            "path_impulses": mass * speed * impulses.T,
            "events": tuple(map(Event, kinds[1:], contacts[1:])),
            "step_velocities": chain.velocities + speed * step_change.T,
            "step_impulses": mass * speed * step_impulses.T,
            "evaluations": self.evaluations,
        }

    def speeds(self, y: Vector) -> Vector:
        """Return the closing speeds."""
        n = len(self.m)
        return self.u + (y[: n - 1] - y[1:n])

    def forces(self, y: Vector) -> Vector:
        """Return the contact forces, for states (3 N - 2, S)."""
        return self.k[:, None] * np.maximum(self.parts(y)[1], 0.0) ** self.p

    def rate(self, t: float, y: Vector) -> Vector:
        """Return dy/dt while no contact opens or closes.

        A closed contact that a trial step draws apart pulls, so that the step sees no kink.
        """
        if self.evaluations == self.most:
            self.t = max(self.t, t)
            raise TooManyEvaluations
        self.evaluations += 1
        n = len(self.m)
        d = np.where(self.closed, y[n : 2 * n - 1], 0.0)
        force = self.k * np.copysign(np.abs(d) ** self.p, d)
        out = np.zeros(3 * n - 2)
        out[1:n] = force
        out[: n - 1] -= force
        out[:n] /= self.m
        out[n : 2 * n - 1] = self.speeds(y)
        out[2 * n - 1 :] = force
        return out

    def run(self, method: str, limit: float, most: int) -> str:
        """Run to the last separation; return why it could not be reached, or nothing."""
        self.most = most
        self.settle([])
        self.record = self.record[:1]  # what touches from the start does not close
        try:
            while self.t < limit:
                if not self.closed.any():
                    if not self.fly():
                        return ""
                elif failure := self.integrate(method, limit):
                    return failure
        except TooManyEvaluations:
            return f"max_evaluations = {most} reached{self.advice()}"
        except ValueError as error:  # SciPy's, where the interpolation of LSODA misses its steps
            return f"{method} failed: {error}"
        return "max_time reached"

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
        ahead = np.flatnonzero(u > 0.0)
        if not ahead.size:
            return False
        needed = -d[ahead] / u[ahead]
        first = int(np.argmin(needed))
        self.t += float(needed[first])
        self.y = self.y.copy()
        self.parts(self.y)[1][:] += u * needed[first]
        self.settle([int(ahead[first])])
        return True

    def integrate(self, method: str, limit: float) -> str:
        """Integrate to the next opening or closing; return why it failed, or nothing."""
        # SciPy is slow to import, and only this model needs it.
        from scipy.integrate import solve_ivp

        def solution(begin: float, y: Vector, end: float, **options: Any) -> Any:
            span, tolerances = (begin, end), {"rtol": self.rtol, "atol": self.atol}
            # For a large p a trial step far too long overflows, and is rejected.
            with np.errstate(over="ignore", invalid="ignore"):
                return solve_ivp(self.rate, span, y, method, **tolerances, **options)

        n = len(self.m)
        # Balls at rest together that nothing touches have no events.
        _, d, _ = self.parts(self.y)
        contacts = np.flatnonzero(self.closed | (d != 0.0) | (self.speeds(self.y) != 0.0)).tolist()
        events = [self.crossing(c) for c in contacts] + [self.extreme(c) for c in contacts]

        def extremes(found: Any) -> list[tuple[float, int, Vector]]:
            half = len(contacts)
            by_contact = zip(contacts, found.t_events[half:], found.y_events[half:], strict=True)
            turns = [(t, c, y) for c, ts, ys in by_contact for t, y in zip(ts, ys, strict=True)]
            return sorted(turns, key=lambda turn: turn[:2])

        found = solution(self.t, self.y, limit, events=events)
        turns = extremes(found)
        # A contact that opens and closes again (or the reverse) within one step goes unnoticed,
        # but for its extreme: a second run that ends there has to cross zero before.
        missed = [t for t, c, y in turns if y[n + c] * (1 if self.closed[c] else -1) < 0.0]
        if missed:
            found = solution(self.t, self.y, missed[0], events=events)
            turns = extremes(found)
        if found.status < 0:
            return str(found.message)
        crossed = [c for c, ts in zip(contacts, found.t_events, strict=False) if len(ts)]
        if crossed:
            found.y[:, -1] = self.again(found, solution)
        self.durations[self.closed] += found.t[-1] - self.t
        self.steps.append((found.t, found.y))
        self.t, self.y = float(found.t[-1]), found.y[:, -1].copy()
        for turn in turns:
            self.turn(*turn)
        # An extreme may fall on the end, where rounding can hide it.
        ahead = self.closed & (self.loading == (self.speeds(self.y) < 0.0))
        for c in np.flatnonzero(ahead).tolist():
            self.turn(self.t, c, self.y)
        self.y = self.y.copy()
        self.settle(crossed)
        return ""

    def again(self, found: Any, solution: Any) -> Any:
        """Return the state at the end of an integration, better than by interpolation.

        The force is not smooth where a contact opens or closes, and there SciPy's interpolation is
        less exact than its steps: the last step is done again to where the crossing was found.
        """
        begin, end = found.t[-2:]
        if begin == end:
            return found.y[:, -1]
        last = solution(begin, found.y[:, -2], end, first_step=end - begin)
        return found.y[:, -1] if last.status < 0 else last.y[:, -1]

    def crossing(self, c: int) -> Any:
        """Return SciPy's event of contact c opening or closing."""
        n = len(self.m)
        # A start at exactly zero is no crossing: it counts to the side that it is about to take.
        side = 1.0 if self.closed[c] else -1.0

        def event(t: float, y: Vector) -> float:
            return float(self.exact(t, y)[n + c]) or side

        vars(event).update(terminal=True, direction=-side)
        return event

    def extreme(self, c: int) -> Any:
        """Return SciPy's event of an extreme of the compression of contact c."""
        return lambda t, y: float(self.speeds(self.exact(t, y))[c])

    def exact(self, t: float, y: Vector) -> Vector:
        """Return y, but the start as it is: LSODA and BDF interpolate it with a rounding error."""
        return y if t > self.t else self.y

    def turn(self, t: float, c: int, y: Vector) -> None:
        """Book an extreme of a compression: the energy stored there, and a maximum as an event."""
        d = self.parts(y)[1][c]
        acceleration = self.rate(t, y)
        falling = bool(acceleration[c] < acceleration[c + 1])
        # Extremes alternate; one at the end of an integration must not count in the next again.
        if not self.closed[c] or d <= 0.0 or falling != self.loading[c]:
            return
        self.loading[c] = not falling
        stored = self.k[c] * d ** (self.p + 1.0) / (self.p + 1.0)
        self.absorbed[c] += stored if falling else -stored
        if falling:
            self.record.append((t, "maximum_compression", c, y))

    def settle(self, crossed: list[int]) -> None:
        """Open the contacts that are drawn apart, close those that approach, and record both."""
        _, d, _ = self.parts(self.y)
        d[crossed] = 0.0
        u = self.speeds(self.y)
        closed = np.where(self.closed, (d > 0.0) | (u >= 0.0), (d >= 0.0) & (u > 0.0))
        self.pass_on(closed, ~closed & (d == 0.0) & (u == 0.0))
        opens, closes = self.closed & ~closed, closed & ~self.closed
        for kind, where in (("end", opens), ("close", closes)):
            self.record += [(self.t, kind, c, self.y) for c in np.flatnonzero(where).tolist()]
        self.collisions += closes
        self.loading = (self.loading & closed) | closes
        self.closed = closed

    def pass_on(self, closed: Vector, resting: Vector) -> None:
        """Close contacts that touch at rest beside one that pushes on their ball."""
        for c in [*range(1, len(closed)), *range(len(closed) - 2, -1, -1)]:
            closed[c] |= resting[c] & closed[max(c - 1, 0) : c + 2].any()
