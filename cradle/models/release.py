"""The motion of springs that give back only a part of what they absorb, for `energy`."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from cradle.input.values import Vector
from cradle.models.motion import Motion

if TYPE_CHECKING:
    from cradle.models.energy import EnergyDistribution

_EPSILON = float(np.finfo(np.float64).eps)


class Process(Motion):
    """The motion of springs that give back only the part e^2 of what they absorb.

    The compressions of the state are the x of `EnergyDistribution`, below zero gaps.
    """

    def __init__(self, m: Vector, u: Vector, k: Vector, e: Vector, model: EnergyDistribution):
        super().__init__(m, u, k, model.exponent, model.rtol)
        self.e, self.gaps = e, model.gaps
        self.reduced = m[:-1] / (m[:-1] + m[1:]) * m[1:]
        self.weights = np.zeros_like(e)  # dx / (u dt) of each contact, up to the next event
        self.collapsed = False
        #: Largest change of each velocity at an event so far: what rounding was left by.
        self.largest = np.zeros(len(m))

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
        return super().integrate(method, limit)

    def fly(self) -> bool:
        """Fly with all contacts open to the next closing; False if there is none."""
        return bool(self.gaps and (self.speeds(self.y) > self.rtol).any() and super().fly())

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
        self.pass_on(closed, resting)
        stay = self.closed & closed & ~plastic
        opens, closes = self.closed & ~stay, closed & ~stay
        self.record += [(self.t, "end", c, self.y) for c in np.flatnonzero(opens).tolist()]
        # What goes on with speeds below the errors of the integration alone may go on for ever.
        speeds = np.maximum(u, np.sqrt(2.0 * self.stored(self.y) / self.reduced))
        if (speeds <= self.rtol).all():
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
