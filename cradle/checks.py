"""What is asked of input: limits, masses, whole numbers, types; and the words of a refusal."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from cradle.kernel.state import LIMITS
from cradle.reals import Vector, numbers, refusal, shown

#: Mass of the lightest ball of a chain, as a part of the heaviest: beyond it squares vanish.
LIGHTEST = 1e-150

__all__ = [
    "Vector",
    "a",
    "checked",
    "checked_masses",
    "must_be",
    "numbers",
    "one_number",
    "refusal",
    "refuse_overflow",
    "shown",
    "whole_number",
]

_Thing = TypeVar("_Thing")


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
        bad = float(array[at])
        raise refusal(name, at, f" = {bad!r}; {rule if np.isfinite(bad) else 'must be finite'}")
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
        raise ValueError(f"{name} = {shown(value)}; must be one number")
    return float(number)


def checked_masses(masses: ArrayLike) -> Vector:
    """Return masses as floats: positive, and none too light beside the heaviest of its chain.

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
        small = array < LIGHTEST * array.max(axis=-1, keepdims=True)
        if small.any():
            at = np.unravel_index(int(np.argmax(small)), array.shape)
            rule = f"must be at least {LIGHTEST} of the heaviest ball of its chain"
            raise refusal("masses", at, f" = {float(array[at])!r}; {rule}")
    return array


def checked_restitution(restitution: ArrayLike) -> Vector:
    """Return coefficients of restitution as floats: in [0, 1], and if above 0 not too small.

    Parameters
    ----------
    restitution : array_like
        Coefficients of any shape.

    Returns
    -------
    ndarray
        The coefficients, same shape.

    Raises
    ------
    ValueError
        Naming the first bad coefficient and the rule.

    Examples
    --------
    >>> checked_restitution([0.5, 1e-300])
    Traceback (most recent call last):
    ...
    ValueError: restitution[1] = 1e-300; must be 0 or at least 1e-30
    """
    array = checked("restitution", restitution, "must lie in [0, 1]", 0.0, 1.0)
    small = (array > 0.0) & (array < LIMITS.least_restitution)
    if small.any():
        at = np.unravel_index(int(np.argmax(small)), array.shape)
        rule = f"must be 0 or at least {LIMITS.least_restitution}"
        raise refusal("restitution", at, f" = {float(array[at])!r}; {rule}")
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
            rest = f" = {float(v[at])!r}; {what} overflows: choose larger units"
            raise refusal("velocities", at, rest)


def whole_number(name: str, value: object) -> int:
    """Return `value` as a whole number of at least 1.

    Parameters
    ----------
    name : str
        What the value is called in an error.
    value : object
        A whole number of Python's or NumPy's.

    Returns
    -------
    int
        The value.

    Raises
    ------
    ValueError
        If it is anything else.

    Examples
    --------
    >>> whole_number("max_evaluations", 1e6)
    Traceback (most recent call last):
    ...
    ValueError: max_evaluations = 1000000.0; must be a whole number, at least 1
    """
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise ValueError(f"{name} = {shown(value)}; must be a whole number, at least 1")
    return int(value)


def must_be(kind: type[_Thing], name: str, thing: object) -> _Thing:
    """Return `thing` if it is of the type `kind`.

    Parameters
    ----------
    kind : type
        What it must be.
    name : str
        What it is called in an error.
    thing : object
        Anything.

    Returns
    -------
    object
        `thing` itself.

    Raises
    ------
    TypeError
        If it is of another type; a sentence says which.

    Examples
    --------
    >>> must_be(float, "speed", [1.0])
    Traceback (most recent call last):
    ...
    TypeError: speed is a list; must be a float
    """
    if not isinstance(thing, kind):
        what = f"the class {thing.__name__}" if isinstance(thing, type) else a(type(thing).__name__)
        raise TypeError(f"{name} is {what}; must be {a(kind.__name__)}")
    return thing


def a(name: str) -> str:
    """Return a name with its indefinite article.

    Parameters
    ----------
    name : str
        A name in English.

    Returns
    -------
    str
        With "a" or "an" before it.

    Examples
    --------
    >>> a("Trace"), a("ImpulseCorrelation")
    ('a Trace', 'an ImpulseCorrelation')
    """
    return f"{'an' if name[:1].lower() in tuple('aeiou') else 'a'} {name}"
