"""Restitution that depends on the closing speed, for the laws of rigid impacts."""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.polynomial import Chebyshev

from cradle.chain import Chain
from cradle.input import values as asked
from cradle.kernel.accuracy import LONGEST
from cradle.models import Model, a_model
from cradle.models.compliant import SpringChain, parting
from cradle.trace import ImpactNotFinished, Trace

_ROUNDS = 50  # until restitutions and speeds agree; two or three are common


@dataclass(frozen=True)
class SpeedDependent:
    """An impact law whose restitution is a law e(u) of the closing speed u, m/s.

    In one impact each contact has one restitution: e(u) at its largest closing speed on the way.
    As the way depends on it, impacts are solved again until they agree; ``trace.chain`` has what is
    found.  The chain that is solved must have restitution 1.  Errors are those of `model`.

    Parameters
    ----------
    model : Model
        The law, such as `SequentialCollisions`.
    restitution : callable
        From u above 0 to e in [0, 1], for all contacts: `ConstantLoss`, `ViscousLoss`, a function.

    Examples
    --------
    >>> from cradle import Chain, ConstantLoss, SequentialCollisions, SpeedDependent, collide
    >>> law = SpeedDependent(SequentialCollisions(), ConstantLoss(0.001))
    >>> collide(Chain([1, 1], [0.1, 0]), law).velocities.round(4).tolist()
    [0.0005, 0.0995]
    """

    model: Model
    restitution: Callable[[float], float]

    def __post_init__(self) -> None:
        a_model(self.model)
        if not callable(self.restitution):
            given = f"restitution = {asked.shown(self.restitution)}"
            raise TypeError(f"{given}; must be a law e(u), such as ConstantLoss(0.001)")

    def solve(self, chain: Chain) -> Trace:
        """Solve the impact of `chain`; see `collide`."""
        e = asked.must_be(Chain, "chain", chain).restitution
        asked.refuse_where("restitution", e, e < 1.0, "must be 1: SpeedDependent has its own")
        e = self._at(chain.closing_speeds)
        for _ in range(_ROUNDS):
            trace = self.model.solve(Chain(chain.masses, chain.velocities, e))
            before, e = e, self._at(-np.diff(trace.curve()[1]).min(axis=0))
            if np.abs(e - before).max() <= 1e-14 and not trace.left_out:
                return replace(trace, model=self)
        told = f"restitutions and closing speeds do not agree after {_ROUNDS} runs"
        raise ImpactNotFinished(f"the impact was not finished: {told}", trace)

    def _at(self, speeds: asked.Vector) -> asked.Vector:
        """Return the restitution at these closing speeds; 1 where balls do not close."""
        e = [self.restitution(u) if u > 0.0 else 1.0 for u in speeds.tolist()]
        return asked.checked("restitution(u)", e, *asked.PART)


@dataclass(frozen=True)
class ConstantLoss:
    """Restitution ``e = max(0, 1 - speed / u)``: balls part more slowly by one `speed`, m/s.

    Examples
    --------
    >>> from cradle import ConstantLoss
    >>> ConstantLoss(0.001)(0.1)
    0.99
    """

    speed: float

    def __post_init__(self) -> None:
        vars(self)["speed"] = asked.one_number("speed", self.speed, "must be at least 0", 0.0)

    def __call__(self, u: float) -> float:
        """Return e at the closing speed u."""
        return max(0.0, 1.0 - self.speed / u)


@dataclass(frozen=True)
class ViscousLoss:
    """Restitution of viscoelastic balls at a closing speed, by Ramirez and others (1999).

    Parameters
    ----------
    viscosity, stiffness, exponent : float
        A, s, k, N/m^p, and p, as for `spring_velocities`; on a call the loss must be within theirs.
    masses : sequence of two floats
        kg.

    Examples
    --------
    >>> from cradle import ViscousLoss
    >>> round(ViscousLoss(4.93e-7, masses=[0.045, 0.045], stiffness=1e10)(0.3), 4)
    0.97
    """

    viscosity: float
    masses: tuple[float, float] = field(kw_only=True)
    stiffness: float = field(kw_only=True)
    exponent: float = field(default=1.5, kw_only=True)

    def __post_init__(self) -> None:
        law = SpringChain(self.stiffness, self.exponent, viscosity=self.viscosity)
        for name in ("stiffness", "exponent", "viscosity"):
            vars(self)[name] = asked.one_number(name, getattr(law, name))
        vars(self)["masses"] = tuple(Chain(self.masses, np.zeros(2)).masses.tolist())

    def __call__(self, u: float) -> float:
        """Return e at the closing speed u."""
        left, right = self.masses
        mass, p = left / (left + right) * right, self.exponent
        own = self.viscosity * (self.stiffness / mass * u ** (p - 1.0)) ** (1.0 / (p + 1.0))
        if not own <= LONGEST:
            rule = f"must be at most {LONGEST * self.viscosity / own:.3g} at u = {u:g}"
            raise ValueError(f"viscosity = {self.viscosity!r}; {rule}")
        return float(_kept(p)(math.sqrt(own / LONGEST)))


@functools.cache
def _kept(exponent: float) -> Any:
    """Return e over the square root, in which it is smooth, of the viscosity over the largest."""
    law: Any = np.vectorize(lambda root: parting(LONGEST * root**2, exponent))
    return Chebyshev.interpolate(law, 24, [0.0, 1.0])
