"""Impulses shared out by the energy that the contacts store: Liu, Zhao and Brogliato's model."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from cradle.chain import Chain
from cradle.input import values as asked
from cradle.input.values import Vector
from cradle.trace import Event, ImpactNotFinished, Trace

#: Why a chain is refused whose quickest contact moves too small a mass; other ball, its mass.
BEYOND = "its reduced mass with masses{} = {!r} is beyond the range of floats: choose other units"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EnergyTrace(Trace):
    """The trace of an impact by `EnergyDistribution`, with its curves at S points."""

    step_velocities: Vector  #: At steps, and where contacts close fastest, shape (S, N), m/s.
    step_impulses: Vector  #: Impulses so far at these points, shape (S, N - 1), N s.
    evaluations: int  #: How often the proportions of the impulses were evaluated.

    def curve(self) -> tuple[Vector, Vector]:
        """Return impulses and velocities at the points of the curves, and at the end."""
        impulses = np.vstack([self.step_impulses, self.impulses])
        return impulses, np.vstack([self.step_velocities, self.velocities])


@dataclass(frozen=True)
class EnergyDistribution:
    """Impulses grow in proportions set by stored energies (Liu, Zhao and Brogliato).

    While contacts i and j are closed, their impulses P grow by
    (Proc. R. Soc. A 464, 2008, 3193-3211) ::

        dP_j / dP_i = (k_j / k_i)^(1 / (1 + p)) (E_j / E_i)^(p / (1 + p))

    E is the energy that a contact stores.  With the closing speed u it changes by ``dE = u dP`` in
    compression (u > 0) and by ``dE = u dP / e^2`` in expansion (u < 0), so it is used up when the
    part e^2 of the work absorbed has been given back.  With e = 0 it is lost at u = 0: the contact
    ends there, and closes anew if a neighbour pushes on.  A contact that has ended leaves a gap,
    which must close before it acts again.

    A spring with the force ``F = k x^p`` stores ``E = k x^(p+1) / (p + 1)``.  So impulses grow like
    those of springs, ``dP = F dt`` with a common t, where ``dx/dt = u`` in compression and
    ``u / e^2`` in expansion; in this form, regular at E = 0, the model is solved.  A value outside
    its range raises a ValueError, and so does a chain that does not suit the values.

    Parameters
    ----------
    stiffness : float or sequence, length N - 1
        k of each contact, above 0; only ratios count.
    exponent : float
        p, at least 1: 1 a linear spring, 3/2 the contact of two elastic spheres (Hertz).
    rtol : float
        Relative tolerance of the integration, 3e-14 to 0.1.  When all speeds that are left lie
        below rtol times the fastest closing speed, the impact is ended plastically.
    max_evaluations : int
        How often dP_j / dP_i may be evaluated; beyond that `ImpactNotFinished` is raised.

    Examples
    --------
    >>> from cradle import Chain, EnergyDistribution, collide
    >>> collide(Chain([1, 1, 1], [1, 0, 0], 1), EnergyDistribution(1.0)).velocities.round(6)
    array([-0.070952,  0.076403,  0.994549])
    """

    stiffness: float | Sequence[float] = 1.0
    exponent: float = 1.5
    rtol: float = field(default=1e-9, kw_only=True)
    max_evaluations: int = field(default=1_000_000, kw_only=True)

    def __post_init__(self) -> None:
        vars(self).update(
            stiffness=asked.number_or_row("stiffness", self.stiffness, "N - 1", *asked.ABOVE_ZERO),
            exponent=asked.one_number("exponent", self.exponent, "must be at least 1", 1.0),
            rtol=asked.one_number("rtol", self.rtol, "must lie in [3e-14, 0.1]", 3e-14, 0.1),
            max_evaluations=asked.whole_number("max_evaluations", self.max_evaluations),
        )

    def solve(self, chain: Chain) -> EnergyTrace:
        """Solve the impact of `chain`; see `collide`."""
        n = len(asked.must_be(Chain, "chain", chain))
        k = asked.row_of("stiffness", self.stiffness, n - 1, n)
        # In units of the contact that closes fastest; its speed is 1 if none moves.
        u = chain.closing_speeds
        c = int(u.argmax())
        left, right = chain.masses[c : c + 2].tolist()
        mass, speed = left / (left + right) * right, abs(float(u[c])) or 1.0
        if mass < np.finfo(np.float64).tiny:
            raise ValueError(f"masses[{c}] = {left!r}; {BEYOND.format([c + 1], right)}")
        scaled = chain.masses / mass, u / speed, k / k[c]
        process, reason = _Process(*scaled, chain.restitution, self), ""
        try:
            process.run()
        except _Stopped as stopped:
            count = len(process.record) - 1
            reason = f"the impact was not finished after {count} events: {stopped}"
        kinds, contacts, states = zip(*process.record, strict=True)
        seen = []  # velocities and impulses in the chain's own units
        for y in (process.y, np.array(states).T, np.concatenate(process.steps, axis=1)):
            change, _, impulses = process.parts(y)
            seen += [chain.velocities + speed * change.T, mass * speed * impulses.T]
        events = tuple(map(Event, kinds[1:], contacts[1:]))
        v, impulses, path, path_impulses, step_v, step_impulses = seen
        trace = EnergyTrace(
            chain, self, v, impulses, mass * speed * speed * process.absorbed, process.collisions,
            path, path_impulses, events, process.collapsed, step_velocities=step_v,
            step_impulses=step_impulses, evaluations=process.evaluations,
        )  # fmt: skip
        if reason:
            raise ImpactNotFinished(reason, trace)
        return trace


class _Stopped(Exception):
    """Why the motion could not be followed to its end."""


class _Process:
    """The motion of springs that give back a part of what they absorb, in their own units."""

    # The state of N balls is one vector y: changes of velocity (N), the x of `EnergyDistribution`
    # (N - 1; below zero they are gaps) and impulses (N - 1).

    def __init__(self, m: Vector, u: Vector, k: Vector, e: Vector, model: EnergyDistribution):
        n, p = len(m), model.exponent
        self.m, self.u, self.k, self.e, self.p = m, u, k, e, p
        self.rtol, self.most = model.rtol, model.max_evaluations
        self.reduced = m[:-1] / (m[:-1] + m[1:]) * m[1:]
        self.t, self.y = 0.0, np.zeros(3 * n - 2)
        # Absolute tolerance, in units of the first collision, but of each contact's own stiffness.
        own = np.concatenate([np.ones(n), k ** (-1 / (p + 1)), np.ones(n - 1)])
        self.atol = 0.1 * self.rtol * own
        self.closed, self.loading = np.zeros((2, n - 1), dtype=bool)  # loading: x grows
        self.weights, self.absorbed = np.zeros((2, n - 1))  # dx / (u dt) up to an event; work
        self.collisions = np.zeros(n - 1, dtype=np.int64)
        self.evaluations, self.collapsed = 0, False
        self.largest = np.zeros(n)  # change of each velocity at an event: what rounding was left by
        self.record, self.steps = [("", -1, self.y)], [self.y[:, None]]

    def parts(self, y: Vector) -> tuple[Vector, Vector, Vector]:
        """Return changes of velocity, compressions and impulses, as views of y."""
        n = len(self.m)
        return y[:n], y[n : 2 * n - 1], y[2 * n - 1 :]

    def depths(self, y: Vector) -> Vector:
        return self.parts(y)[1]

    def speeds(self, y: Vector) -> Vector:
        """Return the closing speeds; what is no more than rounding is zero."""
        change = y[: len(self.m)]
        u, size = self.u - np.diff(change), np.maximum(self.largest, np.abs(change))
        rounding = 2.0**-50 * (np.abs(self.u) + size[:-1] + size[1:])
        return np.where(np.abs(u) <= rounding, 0.0, u)

    def stored(self, y: Vector) -> Vector:
        """Return the energy that each contact stores."""
        depth = np.maximum(self.depths(y), 0.0)
        return np.asarray(self.k * depth ** (self.p + 1.0) / (self.p + 1.0))

    def rate(self, _: float, y: Vector) -> Vector:
        """Return dy/dt while no contact opens, closes or turns."""
        if self.evaluations == self.most:
            raise _Stopped(f"max_evaluations = {self.most} reached")
        self.evaluations += 1
        d, out = np.where(self.closed, self.depths(y), 0.0), np.zeros_like(y)
        change, growth, force = self.parts(out)
        # A closed contact that a trial step draws apart pulls, so that the step sees no kink.
        force[:] = self.k * np.copysign(np.abs(d) ** self.p, d)
        change[1:] = force
        change[:-1] -= force
        change /= self.m
        growth[:] = self.speeds(y) * self.weights
        return out

    def run(self) -> None:
        """Run to the last separation."""
        self.settle([])
        self.record = self.record[:1]  # what touches from the start does not close
        while self.closed.any() or (self.speeds(self.y) > self.rtol).any():
            self.integrate()
        self.part()

    def integrate(self) -> None:
        """Integrate to the next event."""
        from scipy.integrate import solve_ivp  # slow to import

        released = np.divide(1.0, self.e**2, out=np.ones_like(self.e), where=self.e > 0.0)
        self.weights = np.where(self.closed & ~self.loading, released, 1.0)
        # Balls at rest together that nothing touches have no events.
        moving = (self.depths(self.y) != 0.0) | (self.speeds(self.y) != 0.0)
        contacts = np.flatnonzero(self.closed | moving).tolist()
        crossings, extremes = zip(*map(self.watched, contacts), strict=True)
        options = {"rtol": self.rtol, "atol": self.atol, "dense_output": True}
        options["events"] = crossings + extremes
        side, end = np.where(self.closed, 1.0, -1.0), np.inf
        # A contact that opens and closes again (or the reverse) within one step goes unnoticed,
        # but for its extreme: a second run that ends there has to cross zero before.
        for _ in range(2):
            # For a large p a trial step far too long overflows, and is rejected.
            with np.errstate(over="ignore", invalid="ignore"):
                found = solve_ivp(self.rate, (self.t, end), self.y, "DOP853", **options)
            times, half = found.t_events, len(contacts)
            turns = zip(contacts, times[half:], found.y_events[half:], strict=True)
            missed = [
                t for c, ts, ys in turns for t, y in zip(ts, ys, strict=True)
                if side[c] * self.depths(y)[c] < 0.0
            ]  # fmt: skip
            if not missed:
                break
            end = min(missed)
        if found.status < 0:
            raise _Stopped(found.message)
        k = 16 * np.arange(len(found.t))
        fine = found.sol(np.interp(np.arange(k[-1] + 1), k, found.t))
        u = self.u[:, None] - np.diff(self.parts(fine)[0], axis=0)
        faster = u.max(axis=1) > u[:, k].max(axis=1) + self.rtol
        self.steps.append(fine[:, np.union1d(k, u.argmax(axis=1)[faster])])
        self.t, self.y = float(found.t[-1]), found.y[:, -1].copy()
        self.turn([c for k, c in enumerate(contacts) if len(times[half + k])])
        self.settle([c for k, c in enumerate(contacts) if len(times[k])])

    def watched(self, c: int) -> tuple[Any, Any]:
        """Return SciPy's events of contact c: it opens or closes; and it turns."""
        crossing = _leaving(1.0 if self.closed[c] else -1.0, self.depths, c)
        # Where a closed contact turns the rate has a kink, unless e = 1: no step may cross it.
        if self.closed[c]:
            return crossing, _leaving(1.0 if self.loading[c] else -1.0, self.speeds, c)
        return crossing, lambda _, y: self.speeds(y)[c]

    def turn(self, turned: list[int]) -> None:
        """Book extremes of compressions: the energy stored there, and maxima as events."""
        # Where several turn at one instant, only one has ended the integration.
        # A root has an error: one that has turned may still have its old sign, but goes on.
        gain = -np.diff(self.parts(self.rate(self.t, self.y))[0])
        turning = (self.loading == (self.speeds(self.y) < 0.0)) & (self.loading == (gain < 0.0))
        turning[turned] = True
        turning &= self.closed & (self.depths(self.y) > 0.0)
        self.absorbed += np.where(turning, self.stored(self.y) * np.where(self.loading, 1, -1), 0.0)
        self.note("maximum_compression", turning & self.loading)
        self.loading ^= turning

    def settle(self, crossed: list[int]) -> None:
        """Open the contacts that have ended, close those that approach, and record both."""
        self.y = self.y.copy()
        change, d, _ = self.parts(self.y)
        self.largest = np.maximum(self.largest, np.abs(change))
        d[crossed] = 0.0
        # The limit of e to zero: what is stored is lost at u = 0.
        plastic = self.closed & ~self.loading & (self.e == 0.0)
        d[plastic] = 0.0
        u, touching = self.speeds(self.y), d >= 0.0
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
        self.record += [(kind, c, self.y) for c in np.flatnonzero(where).tolist()]

    def part(self) -> None:
        """Give a common velocity to balls that are left with closing speeds above zero."""
        from scipy.optimize import isotonic_regression

        u = self.speeds(self.y)
        self.y = self.y.copy()
        change, _, impulses = self.parts(self.y)
        # Nearest in kinetic energy among the velocities in order: groups that collide plastically.
        groups = isotonic_regression(-np.cumsum([0.0, *u]), weights=self.m).blocks
        for first, last in pairwise(groups.tolist()):
            if not (u[first : last - 1] > 0.0).any():
                continue  # in order, and apart by less than the sum resolves
            # From the heaviest ball of the group: of a larger sum its mass would show the rounding.
            m, lag = self.m[first:last], -np.cumsum([0.0, *u[first : last - 1]])
            lag -= lag[np.argmax(m)]
            jump = m @ lag / m.sum() - lag
            change[first:last] += jump
            impulses[first : last - 1] -= np.cumsum(m * jump)[:-1]
        self.record[-1] = (*self.record[-1][:2], self.y)


def _leaving(side: float, values: Callable[[Vector], Vector], c: int) -> Any:
    """Return SciPy's event, an end, of a contact's value leaving its side of zero, itself in."""

    def event(_: float, y: Vector) -> float:
        return float(values(y)[c]) or side

    vars(event).update(terminal=True, direction=-side)
    return event
