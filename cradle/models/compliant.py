"""Chains of springs: the contact forces, and the one model here that has a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cradle.chain import Chain, Vector, checked, one_number
from cradle.kernel.state import LIMITS
from cradle.trace import Event, ImpactNotFinished, Trace

_METHODS = ("RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA")
# SciPy takes no smaller relative tolerance.
_SMALLEST_RTOL = 100 * float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class TimedTrace(Trace):
    """The path of an impact that has a time; N balls, K events, S steps of the integration.

    Its events are joined by smooth curves, not by the straight lines of a rigid model, and every
    number carries the error of the integration.

    Attributes
    ----------
    times : ndarray, shape (K + 1,)
        Time of each row of the path, s; the first is 0.
    forces : ndarray, shape (K + 1, N - 1)
        Contact forces at each row of the path, N; the largest of a contact is at a maximum
        compression.
    durations : ndarray, shape (N - 1,)
        Time that each contact was closed, over all its collisions, s.
    step_times : ndarray, shape (S,)
        Times of the steps of the integration, s.
    step_forces : ndarray, shape (S, N - 1)
        Contact forces there, N: curves of the force over the time.
    evaluations : int
        How often the forces were evaluated.

    References
    ----------
    Ceanga and Hurmuzlu, J. Appl. Mech. 68 (2001) 575-583, section 2.2.

    Examples
    --------
    The duration of a contact of two balls on a linear spring is pi sqrt(mu / k):

    >>> from cradle import Chain, collide
    >>> trace = collide(Chain([2, 2], [1, 0], 1), SpringChain(1.0, exponent=1))
    >>> trace.durations.round(6)
    array([3.141593])
    """

    times: Vector
    forces: Vector
    durations: Vector
    step_times: Vector
    step_forces: Vector
    evaluations: int


@dataclass(frozen=True)
class SpringChain:
    """Elastic balls on massless springs: each contact pushes with the force k delta^p.

    delta is the compression of the contact, p = 1 a linear spring, p = 3/2 the contact of two
    elastic spheres (Hertz).  Contacts that do not open start at delta = 0.  So do those that open:
    in the limit of rigid balls every gap is nothing beside the balls, but it counts beside the
    compressions, and it must close before the contact pushes.  The outcome depends on the ratios
    of masses, stiffnesses and closing speeds alone.

    The motion is integrated in time by SciPy, from one opening or closing of a contact to the
    next, so no step crosses a kink of the forces.  While all contacts are open the flight is exact.
    `absorbed` is the energy stored at each maximum of a compression, less that at a minimum
    between two of them; all of it comes back.  A minimum and a maximum within a single step of the
    integration go unnoticed.

    Speeds below rtol times that of the fastest closing are errors of the integration.  So are
    collisions at such speeds: long chains leave balls behind that hardly move, and how often those
    touch depends on rtol.

    Parameters
    ----------
    stiffness : float or sequence, length N - 1
        k of each contact, N/m^p; above 0.
    exponent : float
        p, at least 1.
    rtol : float
        Relative tolerance of the integration, per step.  The absolute one is a tenth of it, times
        the speed, compression and impulse of the fastest closing.
    method : {"RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA"}
        Integrator, as for `scipy.integrate.solve_ivp`.
    max_time : float, optional
        Time after which the impact is given up, s; none if left out.
    max_evaluations : int
        How often the forces may be evaluated before the impact is given up.

    Raises
    ------
    ValueError
        If a value is outside its range; on solving, if a restitution is below 1.
    ImpactNotFinished
        On solving, if `max_time` or `max_evaluations` is reached or the integrator fails.

    References
    ----------
    Hinch and Saint-Jean, Proc. R. Soc. A 455 (1999) 3201-3220; Ceanga and Hurmuzlu, J. Appl. Mech.
    68 (2001) 575-583, Eqs. 7-11.

    Examples
    --------
    >>> from cradle import Chain, collide
    >>> collide(Chain([1, 1, 1], [1, 0, 0], 1), SpringChain(1.0)).velocities.round(6)
    array([-0.070952,  0.076403,  0.994549])
    """

    stiffness: float | Sequence[float]
    exponent: float = 1.5
    rtol: float = field(default=1e-9, kw_only=True)
    method: str = field(default="DOP853", kw_only=True)
    max_time: float | None = field(default=None, kw_only=True)
    max_evaluations: int = field(default=1_000_000, kw_only=True)

    def __post_init__(self) -> None:
        k = checked("stiffness", self.stiffness, "must be above 0", 0.0, open_low=True)
        if k.ndim > 1:
            raise ValueError(f"stiffness has shape {k.shape}; must be () or (N - 1,)")
        if k.size and k.min() < LIMITS.lightest * k.max():
            raise ValueError(
                f"stiffness[{int(k.argmin())}] = {float(k.min())!r}; "
                f"must be at least {LIMITS.lightest} of the stiffest contact"
            )
        object.__setattr__(self, "stiffness", tuple(k.tolist()) if k.ndim else float(k))
        rules = {
            "exponent": ("must be at least 1", 1.0, math.inf),
            "rtol": (f"must lie in [{_SMALLEST_RTOL:.3g}, 0.1]", _SMALLEST_RTOL, 0.1),
        }
        for name, (rule, low, high) in rules.items():
            object.__setattr__(self, name, one_number(name, getattr(self, name), rule, low, high))
        if self.method not in _METHODS:
            raise ValueError(f"method = {self.method!r}; must be one of {', '.join(_METHODS)}")
        if self.max_time is not None:
            limit = one_number("max_time", self.max_time, "must be at least 0", 0.0, math.inf)
            object.__setattr__(self, "max_time", limit)
        most = self.max_evaluations
        if isinstance(most, bool) or not isinstance(most, (int, np.integer)) or most < 1:
            raise ValueError(f"max_evaluations = {most!r}; must be a whole number, at least 1")

    def solve(self, chain: Chain) -> TimedTrace:
        """Solve the impact of `chain`; see `collide`."""
        k, unit, mass, speed = _own_units(chain, self.stiffness)
        if (chain.restitution < 1.0).any():
            c = int(np.argmax(chain.restitution < 1.0))
            raise ValueError(
                f"restitution[{c}] = {float(chain.restitution[c])!r}; must be 1 for SpringChain: "
                "a spring gives back all the energy that it stores"
            )
        logarithm = math.log(mass) + 2.0 * math.log(speed) - math.log(unit)
        logarithm = logarithm / (self.exponent + 1.0) - math.log(speed)
        if not abs(logarithm) <= 600.0:
            raise ValueError(
                f"stiffness = {self.stiffness!r}; a contact would last about exp({logarithm:.0f}) "
                "seconds: choose other units"
            )
        second = math.exp(logarithm)

        scaled = (chain.masses / mass, chain.closing_speeds / speed, k / unit)
        motion = _Motion(*scaled, self.exponent, self.rtol)
        limit = math.inf if self.max_time is None else self.max_time / second
        reason = motion.run(self.method, limit, self.max_evaluations)
        reached = motion.parts(motion.y)
        times, kinds, contacts, states = zip(*motion.record, strict=True)
        change, _, impulses = motion.parts(np.array(states).T)
        path = chain.velocities + speed * change.T
        path_impulses = mass * speed * impulses.T
        newton = mass * speed / second
        trace = TimedTrace(
            chain=chain,
            model=self,
            velocities=chain.velocities + speed * reached[0],
            impulses=mass * speed * reached[2],
            absorbed=mass * speed**2 * motion.absorbed,
            collisions=motion.collisions,
            path=path,
            path_impulses=path_impulses,
            events=tuple(map(Event, kinds[1:], contacts[1:])),
            times=second * np.array(times),
            forces=newton * motion.forces(np.array(states).T).T,
            durations=second * motion.durations,
            step_times=second * np.concatenate([t for t, _ in motion.steps]),
            step_forces=newton * np.concatenate([motion.forces(y).T for _, y in motion.steps]),
            evaluations=motion.evaluations,
        )
        if reason:
            raise ImpactNotFinished(
                f"the impact was not finished after {second * motion.t:.6g} s and "
                f"{len(trace.events)} events: {reason}; closing speeds so far "
                f"{(trace.velocities[:-1] - trace.velocities[1:]).tolist()}",
                trace,
            )
        return trace


def _own_units(
    chain: Chain, stiffness: float | Sequence[float]
) -> tuple[Vector, float, float, float]:
    """Return the stiffnesses; then stiffness, reduced mass and speed of the fastest closing."""
    n, u = len(chain), chain.closing_speeds
    if np.ndim(stiffness) and np.size(stiffness) != n - 1:
        raise ValueError(
            f"stiffness has {np.size(stiffness)} values; {n} balls need {n - 1}, or one"
        )
    c = int(np.argmax(u))
    mass = chain.masses[c] / (chain.masses[c] + chain.masses[c + 1]) * chain.masses[c + 1]
    k = np.broadcast_to(np.asarray(stiffness, dtype=np.float64), (n - 1,))
    return k, float(k[c]), float(mass), abs(float(u[c])) or 1.0


class _TooManyEvaluations(Exception):
    """The forces were evaluated as often as allowed."""


class _Motion:
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

    def parts(self, y: Vector) -> list[Vector]:
        """Return changes of velocity, compressions and impulses, as views of y."""
        n = len(self.m)
        return np.split(y, [n, 2 * n - 1])

    def speeds(self, y: Vector) -> Vector:
        """Return the closing speeds."""
        n = len(self.m)
        return self.u + (y[: n - 1] - y[1:n])

    def forces(self, y: Vector) -> Vector:
        """Return the contact forces, for states (3 N - 2, S)."""
        return self.k[:, None] * np.maximum(self.parts(y)[1], 0.0) ** self.p

    def rate(self, _: float, y: Vector) -> Vector:
        """Return dy/dt while no contact opens or closes.

        A closed contact that a trial step draws apart pulls, so that the step sees no kink.
        """
        if self.evaluations == self.most:
            raise _TooManyEvaluations
        self.evaluations += 1
        n = len(self.m)
        d = np.where(self.closed, y[n : 2 * n - 1], 0.0)
        force = self.k * np.copysign(np.abs(d) ** self.p, d)
        out = np.zeros_like(y)
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
        except _TooManyEvaluations:
            return f"max_evaluations = {most} reached"
        except ValueError as error:  # SciPy's, where the interpolation of LSODA misses its steps
            return f"{method} failed: {error}"
        return "max_time reached"

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
        # An extreme may fall on the end, where rounding can hide it.
        ahead = self.closed & (self.loading == (self.speeds(self.y) < 0.0))
        turns += [(self.t, c, self.y) for c in np.flatnonzero(ahead).tolist()]
        for turn in turns:
            self.turn(*turn)
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
        # Balls that touch at rest feel a push on their neighbour: their contact closes as well.
        resting = ~closed & (d == 0.0) & (u == 0.0)
        for c in range(1, len(u)):
            closed[c] |= resting[c] & closed[c - 1]
        for c in range(len(u) - 2, -1, -1):
            closed[c] |= resting[c] & closed[c + 1]
        opens, closes = self.closed & ~closed, closed & ~self.closed
        for kind, where in (("end", opens), ("close", closes)):
            self.record += [(self.t, kind, c, self.y) for c in np.flatnonzero(where).tolist()]
        self.collisions += closes
        self.loading = (self.loading & closed) | closes
        self.closed = closed
