"""Restitution that depends on the closing speed: as a law of rigid impacts, and of viscosities."""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.polynomial import Chebyshev

from cradle.chain import Chain
from cradle.input import values as asked
from cradle.kernel.accuracy import LONGEST, MOST_HUNT
from cradle.models import Model, a_model
from cradle.models.compliant import DAMPING, SpringChain
from cradle.trace import ImpactNotFinished, Trace

_ROUNDS = 50  # until restitutions and speeds agree; two or three are common


@dataclass(frozen=True)
class SpeedDependent:
    """An impact law whose restitution is a law e(u) of the closing speed u, m/s.

    In one impact each contact has one restitution: e(u) at its largest closing speed during the
    impact.  That speed depends on the restitution, so it is solved again until both agree;
    ``trace.chain`` has the restitution found.  The chain given must have restitution 1.  Errors are
    those of `model`; if 50 runs do not agree or the path is cut, `ImpactNotFinished` is raised.

    Parameters
    ----------
    model : Model
        A law that leaves e to the chain: not `SpringChain`, and not `QuadraticDissipation`.
    restitution : callable
        Takes u above 0, returns e in [0, 1]: `ConstantLoss`, `ViscousLoss` or your own function.

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
        e, off = self._at(chain.closing_speeds), math.inf
        error = 10.0 * getattr(self.model, "rtol", 0.0)  # integrations agree no better than this
        for _ in range(_ROUNDS):
            trace = self.model.solve(Chain(chain.masses, chain.velocities, e))
            before, e = e, self._at(-np.diff(trace.curve()[1]).min(axis=0))
            if trace.left_out:  # what is left out could be faster
                raise ImpactNotFinished("the impact was not finished: its path was cut", trace)
            last, off = off, np.abs(e - before).max()
            if off <= 1e-14 or last <= off <= error:
                return replace(trace, model=self)
        told = "the impact was not finished: restitutions and closing speeds do not agree"
        raise ImpactNotFinished(f"{told} after {_ROUNDS} runs", trace)

    def _at(self, speeds: asked.Vector) -> asked.Vector:
        """Return the restitution at these closing speeds; 1 where balls do not close."""
        e = [self.restitution(u) if u > 0.0 else 1.0 for u in speeds.tolist()]
        return asked.checked("restitution(u)", e, *asked.PART)


@dataclass(frozen=True)
class ConstantLoss:
    """Restitution ``max(0, 1 - speed / u)``: balls part by `speed`, m/s, slower than they close.

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
        """Return e at the closing speed u, m/s, above 0."""
        return max(0.0, 1.0 - self.speed / asked.one_number("u", u, *asked.ABOVE_ZERO))


@dataclass(frozen=True)
class ViscousLoss:
    """Restitution of viscoelastic balls at a closing speed, by Ramirez and others (1999).

    Parameters
    ----------
    viscosity, stiffness, exponent : float
        A in s, k in N/m^p, and p, as for `spring_velocities`.
    masses : float or sequence of two floats
        Masses of the two balls, kg.

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
        m = asked.row_of("masses", asked.number_or_row("masses", self.masses, "2"), 2, 2)
        vars(self)["masses"] = tuple(asked.checked_masses(m).tolist())

    def __call__(self, u: float) -> float:
        """Return e at the closing speed u, m/s, above 0; ValueError if A is too large for u."""
        (left, right), p = self.masses, self.exponent
        mass, u = left / (left + right) * right, asked.one_number("u", u, *asked.ABOVE_ZERO)
        own = self.viscosity * (self.stiffness / mass * u ** (p - 1.0)) ** (1.0 / (p + 1.0))
        if not own <= LONGEST:
            rule = f"must be at most {LONGEST * self.viscosity / own:.3g} at u = {u:g}"
            raise ValueError(f"viscosity = {self.viscosity!r}; {rule}")
        return float(_kept(p)(math.sqrt(own / LONGEST)))


@functools.cache
def _kept(exponent: float) -> Any:
    """Return e over the square root, in which it is smooth, of the viscosity over the largest."""
    law: Any = np.vectorize(lambda root: parting(LONGEST * root**2, exponent))
    return Chebyshev.interpolate(law, 48, [0.0, 1.0])


def viscosity_from(
    restitution: asked.ArrayLike, *, speed: float, masses: asked.ArrayLike,
    stiffness: asked.ArrayLike = 1.0, exponent: float = 1.5, damping: str = DAMPING[0],
) -> asked.Vector:  # fmt: skip
    """Viscosity of contacts whose pairs of balls, alone, have a restitution at a stated speed.

    Such balls lose more the faster they close (except viscoelastic ones with p = 1), so a
    restitution belongs to one speed.  The viscosity that gives it is found by a search.  By Hunt
    and Crossley's law restitution depends on A times the speed only.  Leading axes broadcast.

    Parameters
    ----------
    restitution : array_like, shape (..., N - 1) or ()
        Speed at which each pair of neighbours parts, over `speed`.
    speed : float
        Closing speed, m/s, above 0.
    masses : array_like, shape (..., N)
        Masses, kg.
    stiffness, exponent, damping
        As for `spring_velocities`.

    Returns
    -------
    ndarray, shape (..., N - 1)
        A in s, or s/m by Hunt and Crossley, for `SpringChain` and `spring_velocities`.

    Raises
    ------
    ValueError
        If a value is wrong, or a restitution so low (below .014 for viscoelastic spheres, .1 by
        Hunt and Crossley) that it takes more viscosity than contacts may have.

    References
    ----------
    Ramirez, Poeschel, Brilliantov and Schwager, Phys. Rev. E 60 (1999) 4465-4472.

    Examples
    --------
    >>> from cradle import viscosity_from
    >>> viscosity_from(0.97, speed=0.3, masses=[0.045] * 3, stiffness=1e10).round(9)  # steel
    array([4.93e-07, 4.93e-07])
    """
    from scipy.optimize import brentq

    p, hunt = SpringChain(1.0, exponent, damping=damping).exponent, damping == DAMPING[1]
    u = asked.one_number("speed", speed, *asked.ABOVE_ZERO)
    part, most = (parting_hunt, MOST_HUNT) if hunt else (lambda a: parting(a, p), LONGEST)
    least = math.ceil(1000.0 * part(most)) / 1000.0
    rule = f"must lie in [{least:.3f}, 1]: less takes more viscosity than contacts may have"
    given: dict[str, asked.ArrayLike] = {"masses": asked.checked_masses(masses)}
    given |= {"restitution": asked.checked("restitution", restitution, rule, least, 1.0)}
    given |= {"stiffness": asked.checked("stiffness", stiffness, *asked.ABOVE_ZERO)}
    m, e, k = asked.shaped(given, (0, 1, 1))[0]
    found, place = np.unique(np.minimum(e, part(0.0)), return_inverse=True)  # 1, but for rounding
    sought = [brentq(lambda a, x=x: part(a) - x, 0.0, most, xtol=1e-12) for x in found.tolist()]
    mass = m[..., :-1] / (m[..., :-1] + m[..., 1:]) * m[..., 1:]
    own, mass, k = np.broadcast_arrays(np.array(sought)[place].reshape(e.shape), mass, k)
    if hunt:
        return np.asarray(own / u)
    return np.asarray(own * np.exp((np.log(mass) + 2.0 * np.log(u) - np.log(k)) / (p + 1.0)) / u)


@functools.cache
def parting(viscosity: float, exponent: float) -> float:
    """Return the speed at which two balls part that close with 1, in their own units."""
    # Their compression d has d'' = -d**(p - 1) (d + A p d'), until that would pull.
    from scipy.integrate import solve_ivp

    def opens(_: float, state: Any) -> float:
        return float(state[0] + viscosity * exponent * state[1])

    def course(_: float, state: Any) -> Any:
        return state[1], -(max(state[0], 0.0) ** (exponent - 1.0)) * opens(_, state)

    vars(opens).update(terminal=True, direction=-1.0)
    end = solve_ivp(course, (0.0, 20.0), [0.0, 1.0], "DOP853", events=opens, rtol=1e-11, atol=1e-12)
    return float(-end.y[1, -1])


@functools.cache
def parting_hunt(viscosity: float) -> float:
    """Return the same by Hunt and Crossley, for any exponent."""
    # With u = d', u du / (1 + A u) = -d^p dd: closing and parting, over one d, it sums to zero.
    from scipy.integrate import quad
    from scipy.optimize import brentq

    def left(e: float) -> float:
        return float(quad(lambda u: u / (1.0 + viscosity * u), -e, 1.0, epsabs=1e-13)[0])

    # By the integral's closed form 1 - A e is at least z exp(-z), with z = 1 + A.
    most = (1.0 - (1.0 + viscosity) * math.exp(-1.0 - viscosity)) / max(viscosity, 0.5)
    return float(brentq(left, 0.0, min(1.0, most), xtol=1e-14))
