"""The chain before the impact: masses, velocities, restitution; checked once, then frozen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cradle.kernel.state import LIMITS

Vector = NDArray[np.float64]


def numbers(name: str, values: ArrayLike | None) -> Vector:
    """Return `values` as floats of any size; an array of floats comes back as it is.

    Parameters
    ----------
    name : str
        What the values are called in an error.
    values : array_like
        Numbers of any shape.

    Returns
    -------
    ndarray of float64
        The values, same shape.

    Raises
    ------
    ValueError
        If a value is no number.

    Examples
    --------
    >>> numbers("ratio", [0.5, "x"])
    Traceback (most recent call last):
    ...
    ValueError: ratio = [0.5, 'x']; must be real numbers, one shape, none masked
    """
    if type(values) is np.ndarray and values.dtype == np.float64:
        return values
    try:
        array = np.asarray(values)
        if array.dtype.kind not in "biuf" or np.ma.is_masked(values):
            raise TypeError
        return array.astype(np.float64)
    except (TypeError, ValueError):
        raise ValueError(
            f"{name} = {values!r}; must be real numbers, one shape, none masked"
        ) from None


def checked(
    name: str,
    values: ArrayLike | None,
    rule: str = "must be finite",
    low: float = -np.inf,
    high: float = np.inf,
    open_low: bool = False,
) -> Vector:
    """Return `values` as floats, all finite and inside the limits.

    Parameters
    ----------
    name : str
        What the values are called in an error.
    values : array_like
        Numbers of any shape.
    rule : str
        What the error says of a value outside the limits.
    low, high : float
        Limits, included; `open_low` leaves the lower one out.

    Returns
    -------
    ndarray of float64
        The values, same shape.

    Raises
    ------
    ValueError
        If a value is no number, not finite, or outside; it names the first such value.

    Examples
    --------
    >>> checked("restitution", [0.5, 1.2], "must lie in [0, 1]", 0, 1)
    Traceback (most recent call last):
    ...
    ValueError: restitution[1] = 1.2; must lie in [0, 1]
    """
    array = numbers(name, values)
    if array is values:
        array = array.copy()
    wrong = ~np.isfinite(array) | (array < low) | (array > high)
    if open_low:
        wrong |= array <= low
    if wrong.any():
        at = np.unravel_index(int(np.argmax(wrong)), array.shape)
        place = f"[{', '.join(str(int(k)) for k in at)}]" if at else ""
        bad = float(array[at])
        raise ValueError(
            f"{name}{place} = {bad!r}; {rule if np.isfinite(bad) else 'must be finite'}"
        )
    return array


def one_number(
    name: str,
    value: ArrayLike,
    rule: str = "must be finite",
    low: float = -np.inf,
    high: float = np.inf,
    open_low: bool = False,
) -> float:
    """Return `value` as a float inside its limits.

    Parameters
    ----------
    name, value, rule, low, high, open_low
        As for `checked`.

    Returns
    -------
    float
        The value.

    Raises
    ------
    ValueError
        If it is more than one number, or as `checked`.

    Examples
    --------
    >>> one_number("step", [0.1, 0.2])
    Traceback (most recent call last):
    ...
    ValueError: step = [0.1, 0.2]; must be one number
    """
    number = checked(name, value, rule, low, high, open_low)
    if number.ndim:
        raise ValueError(f"{name} = {value!r}; must be one number")
    return float(number)


def checked_masses(masses: ArrayLike) -> Vector:
    """Return masses as floats: positive, none too light beside the heaviest of its chain.

    Parameters
    ----------
    masses : array_like, shape (..., N)
        Masses in kg.

    Returns
    -------
    ndarray, shape (..., N)
        The masses.

    Raises
    ------
    ValueError
        Naming the first bad mass and the rule.

    Examples
    --------
    >>> checked_masses([1.0, 0.0])
    Traceback (most recent call last):
    ...
    ValueError: masses[1] = 0.0; must be above 0
    """
    array = checked("masses", masses, "must be above 0", 0.0, open_low=True)
    if array.size and array.ndim:
        small = array < LIMITS.lightest * array.max(axis=-1, keepdims=True)
        if small.any():
            at = np.unravel_index(int(np.argmax(small)), array.shape)
            place = ", ".join(str(int(k)) for k in at)
            raise ValueError(
                f"masses[{place}] = {float(array[at])!r}; "
                f"must be at least {LIMITS.lightest} of the heaviest ball of its chain"
            )
    return array


def refuse_overflow(velocities: Vector, masses: Vector) -> None:
    """Raise if the kinetic energy or a momentum of a chain is no finite number.

    Parameters
    ----------
    velocities, masses : ndarray, shape (..., N)
        m/s and kg.

    Raises
    ------
    ValueError
        Naming the fastest ball of the first such chain and the rule.

    Examples
    --------
    >>> refuse_overflow(np.array([1e200, 0.0]), np.ones(2))
    Traceback (most recent call last):
    ...
    ValueError: velocities[0] = 1e+200; kinetic energy overflows: choose larger units
    """
    v, m = np.broadcast_arrays(velocities, masses)
    with np.errstate(over="ignore"):
        sums = {
            "kinetic energy": (m * v * v).sum(axis=-1),
            "momentum": 2.0 * (m * np.abs(v)).sum(axis=-1),  # an impulse is no larger
        }
    for what, values in sums.items():
        if not np.isfinite(values).all():
            lead = np.unravel_index(int(np.argmax(~np.isfinite(values))), values.shape)
            at = (*lead, np.argmax(np.abs(v[lead])))
            place = ", ".join(str(int(k)) for k in at)
            raise ValueError(
                f"velocities[{place}] = {float(v[at])!r}; {what} overflows: choose larger units"
            )


@dataclass(frozen=True, eq=False, init=False)
class Chain:
    """A straight chain of balls at the instant before an impact.

    Ball i has velocity ``velocities[i]``, positive to the right; contact c joins balls c and
    c + 1.  Contacts whose balls do not separate (closing speed at or above zero) touch.

    Parameters
    ----------
    masses : array_like, shape (N,)
        Masses in kg, left to right, N >= 2; above 0.
    velocities : array_like, shape (N,)
        Velocities in m/s.
    restitution : float or array_like, shape (N - 1,)
        Energetic coefficient of restitution of each contact, 0 to 1 (Stronge).

    Raises
    ------
    ValueError
        If a value or a length is wrong; the message names the value and the rule.

    References
    ----------
    Ceanga and Hurmuzlu, J. Appl. Mech. 68 (2001) 575-583, section 2.1; Stronge (1990).

    Examples
    --------
    >>> Chain(masses=[1, 1, 1], velocities=[1, 0, 0], restitution=1)
    Chain(masses=[1.0, 1.0, 1.0], velocities=[1.0, 0.0, 0.0], restitution=[1.0, 1.0])
    """

    masses: Vector
    velocities: Vector
    restitution: Vector

    def __init__(self, masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike) -> None:
        m = checked_masses(masses)
        if m.ndim != 1 or m.size < 2:
            raise ValueError(f"masses has shape {m.shape}; a chain needs (N,) with N >= 2")
        v = checked("velocities", velocities)
        if v.shape != m.shape:
            raise ValueError(f"velocities has shape {v.shape}; {m.size} masses need ({m.size},)")
        refuse_overflow(v, m)
        e = checked("restitution", restitution, "must lie in [0, 1]", 0.0, 1.0)
        if e.shape not in ((), (m.size - 1,)):
            raise ValueError(
                f"restitution has shape {e.shape}; {m.size} balls need () or ({m.size - 1},)"
            )
        e = np.broadcast_to(e, (m.size - 1,)).copy()
        for name, value in (("masses", m), ("velocities", v), ("restitution", e)):
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    def __reduce__(self) -> tuple[Any, ...]:
        """Make copies through the constructor: they are frozen too."""
        return type(self), (self.masses, self.velocities, self.restitution)

    def __repr__(self) -> str:
        """Return the call that makes this chain."""
        fields = ("masses", "velocities", "restitution")
        return f"Chain({', '.join(f'{name}={getattr(self, name).tolist()}' for name in fields)})"

    def __len__(self) -> int:
        """Return the number of balls, N."""
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
        return float(0.5 * self.masses @ self.velocities**2)
