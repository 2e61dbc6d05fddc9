"""Impulses shared out by the energy that the contacts store: Liu, Zhao and Brogliato's model."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cradle.chain import Chain
from cradle.input.values import Vector, one_number, refuse_where
from cradle.models.compliant import SpringChain
from cradle.models.motion import CurvedTrace, Motion, TooManyEvaluations, own_units
from cradle.trace import ImpactNotFinished

# Smallest restitution above 0.
_SMALLEST = 1e-6


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EnergyTrace(CurvedTrace):
    """The path of an impact whose ratios of impulses change all the time; N balls, S steps.

    Its events are joined by smooth curves, not by the straight lines of a constant ratio.

    Attributes
    ----------
    step_velocities : ndarray, shape (S, N)
        Velocities at each step of the integration, m/s.
    step_impulses : ndarray, shape (S, N - 1)
        Impulses so far at each step, N s.
    evaluations : int
        How often the ratios were evaluated; with a fixed step, the number of steps.

    References
    ----------
    Liu, Zhao and Brogliato, Proc. R. Soc. A 464 (2008) 3193-3211.

    Examples
    --------
    >>> from cradle import Chain, collide
    >>> trace = collide(Chain([1, 1], [1, 0], 0.5), EnergyDistribution(1.0, step=0.03))
    >>> trace.evaluations, trace.step_impulses[-1].round(6)
    (51, array([0.75]))
    """


@dataclass(frozen=True)
class EnergyDistribution:
    """Impulses grow in proportions set by stored energies (Liu, Zhao and Brogliato).

    While contacts i and j are closed, their impulses P grow by ::

        dP_j / dP_i = (k_j / k_i)^(1 / (1 + p)) (E_j / E_i)^(p / (1 + p))

    E is the energy that a contact stores.  With the closing speed u it changes by ``dE = u dP`` in
    compression (u > 0) and by ``dE = u dP / e^2`` in release (u < 0), so it is used up when the
    part e^2 of the work absorbed has been given back.  A contact that is compressed again before
    its end keeps what it stores: the rule then holds for the totals, and the loss of kinetic energy
    is the sum of ``(1 - e^2)`` times the work absorbed.  With e = 0 the stored energy is lost at
    u = 0; the contact ends there, and closes anew if a neighbour pushes on.

    *Where the springs come in.*  A spring with the force ``F = k x^p`` stores
    ``E = k x^(p+1) / (p + 1)``, so F is ``k^(1/(1+p)) ((p + 1) E)^(p/(1+p))``: the law above says
    that impulses grow like forces of springs, ``dP = F dt`` with a common t.  The variable x then
    obeys ``dx/dt = u`` in compression and ``u / e^2`` in release.  Nothing is singular at E = 0,
    where the law itself reads 0/0.  With e = 1 this is the spring chain, t its time; with e < 1,
    springs that are stiffer in release and leave a dent.

    After the end of a contact there are two readings.  With `gaps` a gap opens, and must close
    before the contact acts again, as between the springs.  Without, the balls are rigid and
    impulses take no time: the contact acts as soon as its balls approach, as in the authors'
    program (OSNSMultipleImpact of the Siconos library).  The two differ only where a contact acts
    that was open before.

    Parameters
    ----------
    stiffness : float or sequence, length N - 1
        k of each contact; only ratios count, so they are all 1 if left out.
    exponent : float
        p, at least 1: 1 a linear spring, 3/2 the contact of two elastic spheres (Hertz).
    step : float, optional
        Without it the error is controlled (`rtol`).  With it, explicit steps of this impulse at the
        contact whose impulse grows fastest, in units of reduced mass times closing speed of the
        fastest closing.  The shares within a step follow from the law with the closing speeds of
        its start; ends and zeros of u cut a step short.  The energies add up to rounding, but for
        what a plastic end takes (see `rtol`): up to the part 1e-4 step^2.
    gaps : bool
        Whether a gap must close before an open contact acts.
    rtol : float
        Relative tolerance of the integration.  An impact that goes on with speeds alone below rtol
        (or 0.01 step) times that of the fastest closing is ended plastically: `Trace.collapsed`, if
        contacts that have acted would act on.
    max_evaluations : int
        How often the ratios may be evaluated before the impact is given up; with `step` at least
        1 / step.

    Raises
    ------
    ValueError
        If a value is outside its range; the message names the value and the rule.
    ImpactNotFinished
        On solving, if `max_evaluations` is reached.

    References
    ----------
    Liu, Zhao and Brogliato, Proc. R. Soc. A 464 (2008) 3193-3211; Siconos, https://siconos.org.

    Examples
    --------
    >>> from cradle import Chain, collide
    >>> collide(Chain([1, 1, 1], [1, 0, 0], 1), EnergyDistribution(1.0)).velocities.round(6)
    array([-0.070952,  0.076403,  0.994549])
    >>> collide(Chain([1, 1, 1], [1, 0, 0], 0.9), EnergyDistribution(1.0)).velocities.round(6)
    array([-0.008615,  0.104143,  0.904473])
    """

    stiffness: float | Sequence[float] = 1.0
    exponent: float = 1.5
    step: float | None = None
    gaps: bool = field(default=True, kw_only=True)
    rtol: float = field(default=1e-9, kw_only=True)
    max_evaluations: int = field(default=1_000_000, kw_only=True)

    def __post_init__(self) -> None:
        springs = SpringChain(  # the same checks
            self.stiffness, self.exponent, rtol=self.rtol, max_evaluations=self.max_evaluations
        )
        for name in ("stiffness", "exponent", "rtol"):
            object.__setattr__(self, name, getattr(springs, name))
        if self.step is not None:
            step = one_number("step", self.step, "must lie in (0, 1]", 0.0, 1.0, open_low=True)
            object.__setattr__(self, "step", step)
            # The fastest closing ends after an impulse of 1 in these units, or more.
            if self.max_evaluations < 1.0 / step:
                raise ValueError(
                    f"step = {step!r}; with max_evaluations = {self.max_evaluations} it must be at "
                    f"least {1.0 / self.max_evaluations:g}, to reach the end of a compression"
                )
        if not isinstance(self.gaps, bool):
            raise ValueError(f"gaps = {self.gaps!r}; must be True or False")

    def solve(self, chain: Chain) -> EnergyTrace:
        """Solve the impact of `chain`; see `collide`."""
        k, unit, mass, speed = own_units(chain, self.stiffness)
        small = (chain.restitution > 0.0) & (chain.restitution < _SMALLEST)
        rule = (
            f"must be 0 or at least {_SMALLEST} for EnergyDistribution: such a release is too "
            "short to follow"
        )
        refuse_where("restitution", chain.restitution, small, rule)
        scaled = (chain.masses / mass, chain.closing_speeds / speed, k / unit)
        process = Process(*scaled, chain.restitution, self)
        reason = process.run("DOP853", math.inf, self.max_evaluations)
        if not reason:
            process.part()
        trace = EnergyTrace(
            **process.account(chain, mass, speed), model=self, collapsed=process.collapsed
        )
        if reason:
            raise ImpactNotFinished(
                f"the impact was not finished after {len(trace.events)} events: {reason}",
                trace,
            )
        return trace


_EPSILON = float(np.finfo(np.float64).eps)


class Process(Motion):
    """The motion of springs that give back only the part e^2 of what they absorb.

    The compressions of the state are the x of `EnergyDistribution`, below zero gaps.
    """

    def __init__(self, m: Vector, u: Vector, k: Vector, e: Vector, model: EnergyDistribution):
        super().__init__(m, u, k, model.exponent, model.rtol)
        self.e, self.q, self.step, self.gaps = e, self.p + 1.0, model.step, model.gaps
        self.reduced = m[:-1] / (m[:-1] + m[1:]) * m[1:]
        self.weights = np.zeros_like(e)  # dx / (u dt) of each contact, up to the next event
        self.collapsed = False
        #: Largest change of each velocity at an event so far: what rounding was left by.
        self.largest = np.zeros(len(m))
        #: Speeds that are no more than errors of the integration.
        self.tiny = self.rtol if self.step is None else 0.01 * self.step

    def speeds(self, y: Vector) -> Vector:
        """Return the closing speeds; what is no more than rounding is zero."""
        n, u = len(self.m), super().speeds(y)
        change = np.maximum(self.largest, np.abs(y[:n]))
        rounding = 4.0 * _EPSILON * (np.abs(self.u) + change[:-1] + change[1:])
        return np.where(np.abs(u) <= rounding, 0.0, u)

    def stored(self, y: Vector) -> Vector:
        """Return the energy that each contact stores."""
        return self.k * np.maximum(self.parts(y)[1], 0.0) ** (self.p + 1.0) / (self.p + 1.0)

    def rate(self, t: float, y: Vector) -> Vector:
        """Return dy/dt while no contact opens, closes or turns."""
        out = super().rate(t, y)
        self.parts(out)[1][:] *= self.weights
        return out

    def crossing(self, c: int) -> Any:
        """Return SciPy's event of contact c opening or closing."""
        if self.closed[c] or self.gaps:
            return super().crossing(c)
        return self.zero_speed(c, -1.0)

    def extreme(self, c: int) -> Any:
        """Return SciPy's event of contact c turning from compression to release or back."""
        # The rate has a kink there, unless e = 1: no step may cross it.  Without a kink the
        # integration goes on, and may meet several extremes, of both kinds.
        if not (self.closed[c] and self.e[c] < 1.0):
            return super().extreme(c)
        return self.zero_speed(c, 1.0 if self.loading[c] else -1.0)

    def zero_speed(self, c: int, side: float) -> Any:
        """Return SciPy's event of the closing speed of contact c leaving its side of zero."""

        def event(t: float, y: Vector) -> float:
            return float(self.speeds(self.exact(t, y))[c]) or side

        vars(event).update(terminal=True, direction=-side)
        return event

    def integrate(self, method: str, limit: float) -> str:
        """Integrate to the next event; return why it failed, or nothing."""
        released = np.divide(1.0, self.e**2, out=np.ones_like(self.e), where=self.e > 0.0)
        self.weights = np.where(self.closed & ~self.loading, released, self.closed | self.gaps)
        return super().integrate(method, limit) if self.step is None else self.march(self.step)

    def advice(self) -> str:
        """Return what makes the steps short: the one that is given, or the integration."""
        return super().advice() if self.step is None else f" by step = {self.step!r}"

    def march(self, step: float) -> str:
        """Make one explicit step of the fastest growing impulse, to the next event at most."""
        if self.evaluations == self.most:
            raise TooManyEvaluations
        self.evaluations += 1
        closed, loading = self.closed, self.loading
        self.y = self.y.copy()
        change, d, impulses = self.parts(self.y)
        u, energy = self.speeds(self.y), self.stored(self.y)
        time, growth = self.shares(d, u, step)
        pace = time / step if self.gaps else 0.0
        # At the part h of the step: speeds u + a h, works (u + a h / 2) h growth.
        passed = np.concatenate([[0.0], growth, [0.0]])
        pushes = (passed[:-1] - passed[1:]) / self.m
        a = pushes[:-1] - pushes[1:]
        side = np.where(loading, 1.0, -1.0)
        limits = np.where(closed, _zero(side * u, side * a, 0.0 * a), math.inf)
        ends = _zero(self.e**2 * energy, growth * u, growth * a)
        ends = np.where(closed & ~loading, ends, math.inf)
        closings = _zero(-d, -pace * u, -pace * a) if self.gaps else _zero(-u, -a, 0.0 * a)
        closings = np.where(closed, math.inf, closings)
        h = min(step, limits.min(), ends.min(), closings.min())

        mean, before = u + 0.5 * a * h, energy.copy()
        energy += self.weights * growth * mean * h
        # What rounding leaves of an energy takes steps too short to be counted.
        ends[closed & ~loading & (energy <= 4.0 * _EPSILON * before)] = 0.0
        change += pushes * h
        impulses += growth * h
        compression = (self.q * np.maximum(energy, 0.0) / self.k) ** (1.0 / self.q)
        d[:] = np.where(closed, compression, d + pace * mean * h)
        self.t += time * h / step
        self.steps.append((np.array([self.t]), self.y[:, None]))
        for c in np.flatnonzero(limits <= h).tolist():
            self.absorbed[c] += energy[c] if loading[c] else -energy[c]
            if loading[c]:
                self.record.append((self.t, "maximum_compression", c, self.y))
            loading[c] = not loading[c]
        self.settle(np.flatnonzero((ends <= h) | (closings <= h)).tolist())
        return ""

    def shares(self, d: Vector, u: Vector, step: float) -> tuple[float, Vector]:
        """Return the time of a step, and the impulses by the law, u frozen, as parts of the step.

        With x = d + s and s = w u t, w = dx / (u dt), the integral of k x^p over the time is
        P = k (x^q - d^q) / (q w u), q = p + 1.  At d = 0 this is the limit in which the law is 0/0.
        """
        k, q, pushed, growing = self.k, self.q, self.closed & (d > 0.0), self.closed & (u > 0.0)
        d, rate = np.where(pushed, d, 0.0), self.weights * u
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            part = q * rate * step / (k * d**q)
            times = np.where(
                rate == 0.0, step / (k * d**self.p), np.expm1(np.log1p(part) / q) * d / rate
            )
            times = np.where(pushed, times, (q * step / (k * rate**self.p)) ** (1.0 / q))
            times = np.where(pushed & (part <= -1.0), -d / rate, times)  # it ends before
            time = float(times[pushed | growing].min())
            s = rate * time / d
            mean = np.where(s == 0.0, 1.0, np.expm1(q * np.log1p(np.maximum(s, -1.0))) / (q * s))
            passed = np.where(pushed, k * d**self.p * time * mean, 0.0)
            started = k * rate**self.p * time**q / q
        return time, np.where(growing & ~pushed, started, passed) / step

    def fly(self) -> bool:
        """Fly with all contacts open to the next closing; False if there is none."""
        return bool(self.gaps and (self.speeds(self.y) > self.tiny).any() and super().fly())

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
        # Balls that touch at rest feel a push on their neighbour: their contact closes as well.
        resting = ~closed & touching & ((u == 0.0) | plastic)
        resting[crossed] |= ~self.closed[crossed]
        for c in [*range(1, len(u)), *range(len(u) - 2, -1, -1)]:
            closed[c] |= resting[c] & closed[max(c - 1, 0) : c + 2].any()
        stay = self.closed & closed & ~plastic
        opens, closes = self.closed & ~stay, closed & ~stay
        self.record += [(self.t, "end", c, self.y) for c in np.flatnonzero(opens).tolist()]
        # What goes on with speeds below the errors of the integration alone may go on for ever.
        speeds = np.maximum(u, np.sqrt(2.0 * self.stored(self.y) / self.reduced))
        if (speeds <= self.tiny).all():
            self.collapsed = bool(stay.any() or (closes & (self.collisions > 0)).any())
            self.record += [(self.t, "collapse", c, self.y) for c in np.flatnonzero(stay).tolist()]
            self.closed = np.zeros_like(closed)
            return
        self.record += [(self.t, "close", c, self.y) for c in np.flatnonzero(closes).tolist()]
        self.collisions += closes
        self.loading = (self.loading & stay) | closes
        self.closed = closed

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
        self.record[-1] = (*self.record[-1][:3], self.y)


def _zero(value: Vector, slope: Vector, curvature: Vector) -> Vector:
    """Return the first h >= 0 at which value + slope h + curvature h^2 / 2 falls through zero.

    A value below zero is rounding, and counts as zero; infinity where there is no such h.
    """
    value = np.maximum(value, 0.0)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        root = np.sqrt(slope**2 - 2.0 * curvature * value)
        h = np.where(slope < 0.0, 2.0 * value / (root - slope), -(root + slope) / curvature)
    falls = (slope < 0.0) | (curvature < 0.0)
    return np.where(falls & ~np.isnan(h), h, math.inf)
