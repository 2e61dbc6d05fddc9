"""Chains of springs: the contact forces, and the one model here that has a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cradle.chain import Chain
from cradle.input.values import (
    LIGHTEST,
    Vector,
    number_or_row,
    one_number,
    one_of,
    refuse_where,
    whole_number,
)
from cradle.models.motion import CurvedTrace, Motion, own_units
from cradle.trace import ImpactNotFinished

_METHODS = ("RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA")
# SciPy takes no smaller relative tolerance.
_SMALLEST_RTOL = 100 * float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class TimedTrace(CurvedTrace):
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
    step_velocities : ndarray, shape (S, N)
        Velocities there, m/s.
    step_impulses : ndarray, shape (S, N - 1)
        Impulses so far, there, N s.
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

    def _clock(self) -> dict[str, Vector]:
        """Return the times of the rows of the path."""
        return {"time": self.times}


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
        k of each contact, N/m^p; above 0.  If left out, 1 for all: velocities depend on the ratios
        of stiffnesses alone, but times and forces are then no one's.
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
    >>> collide(Chain([1, 1, 1], [1, 0, 0]), SpringChain()).velocities.round(6)
    array([-0.070952,  0.076403,  0.994549])
    """

    stiffness: float | Sequence[float] = 1.0
    exponent: float = 1.5
    rtol: float = field(default=1e-9, kw_only=True)
    method: str = field(default="DOP853", kw_only=True)
    max_time: float | None = field(default=None, kw_only=True)
    max_evaluations: int = field(default=1_000_000, kw_only=True)

    def __post_init__(self) -> None:
        above = "must be above 0"
        kept = number_or_row("stiffness", self.stiffness, "N - 1", above, 0.0, open_low=True)
        object.__setattr__(self, "stiffness", kept)
        k = np.asarray(kept)
        soft = k < LIGHTEST * k.max(initial=0.0)
        refuse_where("stiffness", k, soft, f"must be at least {LIGHTEST} of the stiffest contact")
        rules = {
            "exponent": ("must be at least 1", 1.0, math.inf),
            "rtol": (f"must lie in [{_SMALLEST_RTOL:.3g}, 0.1]", _SMALLEST_RTOL, 0.1),
        }
        for name, (rule, low, high) in rules.items():
            object.__setattr__(self, name, one_number(name, getattr(self, name), rule, low, high))
        one_of("method", self.method, _METHODS)
        if self.max_time is not None:
            limit = one_number("max_time", self.max_time, "must be at least 0", 0.0, math.inf)
            object.__setattr__(self, "max_time", limit)
        whole_number("max_evaluations", self.max_evaluations)

    def solve(self, chain: Chain) -> TimedTrace:
        """Solve the impact of `chain`; see `collide`."""
        k, unit, mass, speed = own_units(chain, self.stiffness)
        rule = "must be 1 for SpringChain: a spring gives back all the energy that it stores"
        refuse_where("restitution", chain.restitution, chain.restitution < 1.0, rule)
        logarithm = math.log(mass) + 2.0 * math.log(speed) - math.log(unit)
        logarithm = logarithm / (self.exponent + 1.0) - math.log(speed)
        if not abs(logarithm) <= 600.0:
            raise ValueError(
                f"stiffness = {self.stiffness!r}; a contact would last about exp({logarithm:.0f}) "
                "seconds: choose other units"
            )
        second = math.exp(logarithm)

        scaled = (chain.masses / mass, chain.closing_speeds / speed, k / unit)
        motion = Motion(*scaled, self.exponent, self.rtol)
        limit = math.inf if self.max_time is None else self.max_time / second
        reason = motion.run(self.method, limit, self.max_evaluations)
        times, _, _, states = zip(*motion.record, strict=True)
        step_times, steps = zip(*motion.steps, strict=True)
        newton = mass * speed / second
        trace = TimedTrace(
            **motion.account(chain, mass, speed),
            model=self,
            times=second * np.array(times),
            forces=newton * motion.forces(np.array(states).T).T,
            durations=second * motion.durations,
            step_times=second * np.concatenate(step_times),
            step_forces=newton * motion.forces(np.concatenate(steps, axis=1)).T,
        )
        if reason:
            raise ImpactNotFinished(
                f"the impact was not finished after {second * motion.t:.6g} s and "
                f"{len(trace.events)} events: {reason}",
                trace,
            )
        return trace
