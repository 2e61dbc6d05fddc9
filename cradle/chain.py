"""The chain before the impact: masses, velocities, restitution; checked once, then frozen."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cradle.formatting import as_html
from cradle.input import values as asked
from cradle.input.values import ArrayLike, Vector
from cradle.kernel.state import LIMITS


def _within(values: Vector, low: float, high: float) -> bool:
    return all(low <= value <= high for value in values.ravel().tolist())


@dataclass(frozen=True, eq=False, init=False)
class Chain:
    """A straight chain of balls at the instant before an impact.

    Velocities are positive to the right; contact c joins balls c and c + 1.  Neighbours that move
    apart do not touch; all others do.  A wrong value or length raises a `ValueError` that names it.

    Parameters
    ----------
    masses, velocities : array_like, shape (N,)
        Masses, kg, above 0, and velocities, m/s, of two or more balls from left to right.
    restitution : float or array_like, shape (N - 1,)
        Energetic coefficient of restitution of each contact (Stronge, 1990), from 1e-30 to 1, or 0.
        If left out, it is 1: the balls are elastic and lose nothing.

    Examples
    --------
    >>> from cradle import Chain
    >>> Chain(masses=[1, 1, 1], velocities=[1, 0, 0])
    Chain(masses=[1.0, 1.0, 1.0], velocities=[1.0, 0.0, 0.0], restitution=[1.0, 1.0])
    """

    masses: Vector
    velocities: Vector
    restitution: Vector

    def __init__(
        self, masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike = 1.0
    ) -> None:
        m, v = asked.numbers("masses", masses), asked.numbers("velocities", velocities)
        e = asked.numbers("restitution", restitution)
        # Of usual values nothing more need be asked.
        usual = _within(m, 1e-70, 1e70) and _within(v, -1e70, 1e70)
        if not (usual and _within(e, LIMITS.least_restitution, 1.0)):
            m, v = asked.checked_masses(m), asked.checked("velocities", v)
            e = asked.checked_restitution(e)
        if m.ndim != 1 or m.size < 2:
            rule = "a chain needs (N,) with N >= 2: one row of two or more numbers"
            raise ValueError(f"masses has shape {m.shape}; {rule}")
        if v.shape != m.shape:
            rule = f"{m.size} masses need ({m.size},): one velocity for each of {m.size} balls"
            raise ValueError(f"velocities has shape {v.shape}; {rule}")
        if e.shape not in ((), (m.size - 1,)):
            rule = f"need () or ({m.size - 1},): one number, or one for each contact"
            raise ValueError(f"restitution has shape {e.shape}; {m.size} balls {rule}")
        if not usual:
            asked.refuse_overflow(v, m)
        self._keep(np.array(m), np.array(v), np.full(m.size - 1, e))

    @classmethod
    def _of(cls, masses: Vector, velocities: Vector, restitution: Vector) -> "Chain":
        """Return the chain of new arrays, or parts of a chain's, without asking them again."""
        chain = object.__new__(cls)
        chain._keep(masses, velocities, restitution)
        return chain

    def _keep(self, *values: Vector) -> None:
        for name, value in zip(("masses", "velocities", "restitution"), values, strict=True):
            value.flags.writeable = False
            vars(self)[name] = value

    def __reduce__(self) -> tuple[Any, tuple[Vector, ...]]:
        """Make copies through the constructor: they are frozen too."""
        return type(self), (self.masses, self.velocities, self.restitution)

    def __repr__(self) -> str:
        values = [f"{name}={(value + 0.0).tolist()}" for name, value in vars(self).items()]  # no -0
        return f"Chain({', '.join(values)})"

    def _repr_html_(self) -> str:
        return as_html({
            "mass (kg)": self.masses,
            "velocity (m/s)": self.velocities + 0.0,  # no -0
            "restitution with the next": self.restitution,
        })  # fmt: skip

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Chain):
            return NotImplemented
        return all(map(np.array_equal, self.__reduce__()[1], other.__reduce__()[1]))

    def __hash__(self) -> int:
        return hash(tuple(tuple(values.tolist()) for values in self.__reduce__()[1]))

    def __len__(self) -> int:
        return int(self.masses.size)

    @property
    def closing_speeds(self) -> Vector:
        """Closing speed v_c - v_{c+1} of each contact, shape (N - 1,), m/s."""
        return self.velocities[:-1] - self.velocities[1:]

    @property
    def momentum(self) -> float:
        """Total momentum, kg m/s."""
        return float(self.masses @ self.velocities)

    @property
    def kinetic_energy(self) -> float:
        """Total kinetic energy, J."""
        return float(0.5 * (self.masses * self.velocities) @ self.velocities)
