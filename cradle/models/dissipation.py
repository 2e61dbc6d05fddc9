"""One convex problem for the whole impact: Moreau, Frémond and Cholet's quadratic dissipation."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cradle.chain import Chain
from cradle.input import values as asked
from cradle.input.values import Vector
from cradle.trace import Event, ImpactNotFinished, Trace

_LARGEST, _LIGHTEST = 1e9, 1e-6  # beyond these the equations of a problem keep too few digits


@dataclass(frozen=True, eq=False, repr=False)
class DissipationTrace(Trace):
    """The trace of an impact by `QuadraticDissipation`: all contacts end at one instant.

    Here `absorbed` is the net work that each contact takes from the balls, J: its impulse times the
    mean of its closing speeds before and after.  It is below zero if a contact does work on them.
    """

    @property
    def energy_loss(self) -> float:
        """Kinetic energy lost, in joules, whatever the restitution of the chain."""
        return float(np.sum(self.absorbed))


@dataclass(frozen=True)
class QuadraticDissipation:
    """Velocities after the impact from one convex problem (Moreau; Frémond; Cholet).

    D_c is the mean of the closing speeds of contact c before and after.  The velocities v make ::

        1/2 sum_i m_i (v_i - v_i^-)^2 + sum_c k_c D_c^2

    as small as possible while no two balls go on approaching.  So the impulse of a contact is
    ``k_c D_c``, with a reaction added where the balls would still approach; it can also hold back
    balls that part.  Contacts whose balls part before the impact are left out; if these balls
    approach after it, another such problem follows.

    Two balls of reduced mass mu have ``e = (kappa - 1) / (kappa + 1)`` with kappa = k / (2 mu), or
    e = 0 where kappa is below 1.  A value outside its range raises a ValueError; so does, on
    solving, a chain that does not suit the values, or one with light balls between heavy ones,
    which leave the equations too few digits.

    Parameters
    ----------
    coefficients : float or sequence, length N - 1, optional
        kappa of each contact, 0 to 1e9, in place of the restitution e of the chain; if left out,
        (1 + e) / (1 - e), for which e must be below 1.
    max_problems : int
        Number of problems; if balls still approach after them, `ImpactNotFinished` is raised.

    References
    ----------
    Frémond, Non-Smooth Thermomechanics, Springer (2002); Moreau, in: Unilateral Problems in
    Structural Analysis (1988).

    Examples
    --------
    >>> from cradle import Chain, QuadraticDissipation, collide
    >>> collide(Chain([1, 1, 1], [1, 0, 0], 1), QuadraticDissipation(1e9)).velocities.round(6)
    array([-0.333333,  0.666667,  0.666667])
    """

    coefficients: float | Sequence[float] | None = None
    max_problems: int = field(default=10_000, kw_only=True)

    def __post_init__(self) -> None:
        rule, given = f"must lie in [0, {_LARGEST:g}]", self.coefficients
        if given is not None:
            given = asked.number_or_row("coefficients", given, "N - 1", rule, 0.0, _LARGEST)
        most = asked.whole_number("max_problems", self.max_problems)
        vars(self).update(coefficients=given, max_problems=most)

    def solve(self, chain: Chain) -> DissipationTrace:
        """Solve the impact of `chain`; see `collide`."""
        n, v = len(asked.must_be(Chain, "chain", chain)), chain.velocities
        # In units in which no product of masses is beyond the range of floats.
        unit = np.ldexp(1.0, int(np.frexp(chain.masses.max())[1]) - 1)
        m = chain.masses / unit
        if self.coefficients is None:
            e, least = chain.restitution, 2.0 / _LARGEST
            rule = f"must be below 1 - {least:g} for QuadraticDissipation: e = 1 is a limit only"
            asked.refuse_where("restitution", e, 1.0 - e < least, rule)
            kappa = (1.0 + e) / (1.0 - e)
        else:
            kappa = asked.row_of("coefficients", self.coefficients, n - 1, n)
        left, right = np.maximum.accumulate(m), np.maximum.accumulate(m[::-1])[::-1]
        light = m < _LIGHTEST * np.minimum(left, right)
        rule = f"must be at least {_LIGHTEST} of the heaviest ball on one of its sides for this law"
        asked.refuse_where("masses", chain.masses, light, rule)
        change, impulses, absorbed = np.zeros(n), *np.zeros((2, n - 1))
        path, path_impulses, events = [v], [impulses], []
        # Closing speeds are known no better than the velocities that they are differences of.
        u, rounding = v[:-1] - v[1:], 1e-14 * np.abs(v - v.mean()).max() + 4e-16 * np.abs(v).max()
        problems = 0
        while (u > rounding).any() and problems < self.max_problems:
            problems += 1
            u = np.where(np.abs(u) <= rounding, 0.0, u)
            jump, passed = np.zeros(n), np.zeros(n - 1)
            stretch, after = np.cumsum(u < 0.0), u.copy()
            active = (u >= 0.0) & np.isin(stretch, stretch[u > 0.0])
            for at in (np.flatnonzero(active & (stretch == k)) for k in np.unique(stretch[active])):
                balls = slice(at[0], at[-1] + 2)
                jump[balls], parting = _parted(m[balls], u[at], kappa[at])
                passed[at], after[at] = -np.cumsum((m * jump)[balls])[:-1], -parting
            after = np.where(active, after, u - np.diff(jump))
            absorbed += passed * unit * 0.5 * (u + after)
            u, impulses, change = after, impulses + passed, change + jump
            contacts = np.flatnonzero(active).tolist()
            events += [Event("end", c) for c in contacts]
            path += [v + change] * len(contacts)
            path_impulses += [impulses] * len(contacts)
        collisions = np.bincount([event.contact for event in events], minlength=n - 1)
        trace = DissipationTrace(
            chain, self, path[-1], impulses * unit, absorbed, collisions,
            np.array(path), np.array(path_impulses) * unit, tuple(events),
        )  # fmt: skip
        if (u > rounding).any():
            told = f"the impact was not finished after max_problems = {self.max_problems}"
            raise ImpactNotFinished(told, trace, 0.0)  # between two problems nothing is stored
        return trace


def _parted(m: Vector, u: Vector, kappa: Vector) -> tuple[Vector, Vector]:
    """Return how velocities of touching balls with closing speeds u change, and how they part."""
    from scipy.optimize import nnls

    # With w = - u+ >= 0 the problem is one of least squares: sum m dv^2 + sum kappa mu (u - w)^2,
    # where dv grows by u + w from ball to ball and moves no centre of mass: a contact parts what is
    # on its left from what is on its right, in proportion to the mass on the other side.
    left, right = np.cumsum(m)[:-1], np.cumsum(m[::-1])[-2::-1]
    parted = np.where(np.tri(len(m), len(u), -1) > 0.0, left, -right) / m.sum()
    inertia = np.sqrt(m)[:, None] * parted
    loss = np.diag(np.sqrt(kappa * (m[:-1] / (m[:-1] + m[1:]) * m[1:])))
    w, _ = nnls(np.vstack([inertia, loss]), np.concatenate([-inertia @ u, loss @ u]))
    return parted @ (u + w), w
