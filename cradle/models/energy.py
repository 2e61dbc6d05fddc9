"""Impulses shared out by the energy that the contacts store: Liu, Zhao and Brogliato's model."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cradle.chain import Chain
from cradle.input import values as asked
from cradle.input.values import Vector
from cradle.models.release import Process, Stopped
from cradle.trace import Event, ImpactNotFinished, Trace


def fastest(chain: Chain) -> tuple[int, float, float]:
    """Return the contact that closes fastest, its reduced mass and its speed, 1 if none moves."""
    u = chain.closing_speeds
    c = int(u.argmax())
    left, right = chain.masses[c : c + 2].tolist()
    mass = left / (left + right) * right
    if mass < np.finfo(np.float64).tiny:
        rule = f"its reduced mass with masses[{c + 1}] = {right!r} is beyond the range of floats"
        raise ValueError(f"masses[{c}] = {left!r}; {rule}: choose other units")
    return c, mass, abs(float(u[c])) or 1.0


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EnergyTrace(Trace):
    """The path of an impact whose ratios of impulses change all the time; N balls, S steps."""

    step_velocities: Vector  #: At each step of the integration, shape (S, N), m/s.
    step_impulses: Vector  #: Impulses so far at each step, shape (S, N - 1), N s.
    evaluations: int  #: How often the ratios were evaluated.

    def curve(self) -> tuple[Vector, Vector]:
        """Return impulses and velocities at the steps of the integration, and at the end."""
        impulses = np.vstack([self.step_impulses, self.impulses])
        return impulses, np.vstack([self.step_velocities, self.velocities])


@dataclass(frozen=True)
class EnergyDistribution:
    """Impulses grow in proportions set by stored energies (Liu, Zhao and Brogliato).

    While contacts i and j are closed, their impulses P grow by ::

        dP_j / dP_i = (k_j / k_i)^(1 / (1 + p)) (E_j / E_i)^(p / (1 + p))

    E is the energy that a contact stores.  With the closing speed u it changes by ``dE = u dP`` in
    compression (u > 0) and by ``dE = u dP / e^2`` in release (u < 0), so it is used up when the
    part e^2 of the work absorbed has been given back.  With e = 0 it is lost at u = 0; the contact
    ends there, and closes anew if a neighbour pushes on.

    A spring with the force ``F = k x^p`` stores ``E = k x^(p+1) / (p + 1)``, so impulses grow like
    forces of springs, ``dP = F dt`` with a common t, where ``dx/dt = u`` in compression and
    ``u / e^2`` in release.  So it is solved; nothing is singular at E = 0.

    Parameters
    ----------
    stiffness : float or sequence, length N - 1
        k of each contact, above 0; only ratios count.
    exponent : float
        p, at least 1: 1 a linear spring, 3/2 the contact of two elastic spheres (Hertz).
    gaps : bool
        Whether a contact that has ended leaves a gap that must close before it acts again, as
        between springs.  If not, it acts as soon as its balls approach, as in the authors' program
        (OSNSMultipleImpact of Siconos).
    rtol : float
        Relative tolerance of the integration.  An impact that goes on with speeds alone below rtol
        times that of the fastest closing is ended plastically.
    max_evaluations : int
        How often the ratios may be evaluated before the impact is given up.

    Raises
    ------
    ValueError
        If a value is outside its range; on solving, if the chain does not suit the values.
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
    """

    stiffness: float | Sequence[float] = 1.0
    exponent: float = 1.5
    gaps: bool = field(default=True, kw_only=True)
    rtol: float = field(default=1e-9, kw_only=True)
    max_evaluations: int = field(default=1_000_000, kw_only=True)

    def __post_init__(self) -> None:
        vars(self).update(
            stiffness=asked.number_or_row("stiffness", self.stiffness, "N - 1", *asked.ABOVE_ZERO),
            exponent=asked.one_number("exponent", self.exponent, "must be at least 1", 1.0),
            rtol=asked.one_number("rtol", self.rtol, "must lie in [3e-14, 0.1]", 3e-14, 0.1),
            gaps=asked.flag("gaps", self.gaps),
        )
        asked.whole_number("max_evaluations", self.max_evaluations)

    def solve(self, chain: Chain) -> EnergyTrace:
        """Solve the impact of `chain`; see `collide`."""
        n = len(asked.must_be(Chain, "chain", chain))
        k = asked.row_of("stiffness", self.stiffness, n - 1, n)
        c, mass, speed = fastest(chain)
        scaled = chain.masses / mass, chain.closing_speeds / speed, k / k[c]
        process, reason = Process(*scaled, chain.restitution, self), ""
        try:
            process.run()
        except Stopped as stopped:
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
