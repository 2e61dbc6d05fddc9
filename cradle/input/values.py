"""What is asked of input: real numbers, limits, masses, whole numbers, rows."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cradle.input.words import (
    a,
    first,
    is_whole,
    must_be,
    one_of,
    place,
    place_in,
    refusal,
    refuse_where,
    shown,
    whole_rule,
)  # fmt: skip
from cradle.kernel.state import LIMITS

Vector = NDArray[np.float64]


class _Masked:
    """Stands for the type of masked values."""


_USUAL = {float, int, np.float64}
# Python would turn these into floats, or NumPy with a warning, but they are no real numbers.
_NO_NUMBERS = (bool, np.bool_, str, bytes, complex, np.complexfloating, _Masked)


def numbers(name: str, values: ArrayLike | None) -> Vector:
    """Return `values` as floats of any size; an array of floats comes back as it is.

    A number is whatever `float` takes: fractions and decimals too.  Not so text, truth values,
    masked values, complex numbers, and numbers with an uncertainty.
    """
    if type(values) is np.ndarray and values.dtype == np.float64:
        return values
    if type(values) is float:
        return np.array(values)
    given: Any = values
    kinds = _types(values)
    strange = not kinds <= _USUAL and any(issubclass(kind, _NO_NUMBERS) for kind in kinds)
    if not strange:
        try:
            array = np.asarray(values)
        except (TypeError, ValueError):
            strange = True
    if strange or array.dtype.kind not in "iuf" or array.itemsize > 8:
        # One by one, each as it was given; long doubles go further than floats.
        cells = list(_cells(values))
        floats = [_as_float(name, at, cell) for at, cell in cells]
        _refuse_ragged(name, values)
        return np.array(floats, dtype=np.float64).reshape(np.shape(given))
    return array.astype(np.float64)


def _types(values: Any) -> set[type]:
    """Return the types of the cells of nested lists, of arrays those of their elements."""
    if isinstance(values, (list, tuple)):
        kinds = set(map(type, values))
        if kinds <= _USUAL:
            return kinds
        inner = [_types(value) for value in values if _holds_cells(type(value))]
        return {kind for kind in kinds if not _holds_cells(kind)}.union(*inner)
    if _is_masked(values):
        return {_Masked}
    return {values.dtype.type} if isinstance(values, np.ndarray) else {type(values)}


def _holds_cells(kind: type) -> bool:
    return issubclass(kind, (list, tuple, np.ndarray))


def _is_masked(value: Any) -> bool:
    """Tell whether anything is masked, without loading `numpy.ma` if nobody else has."""
    ma = sys.modules.get("numpy.ma")
    return ma is not None and bool(ma.is_masked(value))


def _cells(values: Any, at: tuple[int, ...] = ()) -> Iterator[tuple[tuple[int, ...], Any]]:
    """Yield the index and the value of each cell of nested lists and arrays."""
    if isinstance(values, (list, tuple)):
        for k, value in enumerate(values):
            yield from _cells(value, (*at, k))
    elif not hasattr(values, "__array__") or np.ndim(values) == 0:
        yield at, values
    elif _is_masked(values):
        for index in np.ndindex(values.shape):
            yield (*at, *index), values[index]  # `np.ma.masked` where it is masked
    else:
        for index, value in np.ndenumerate(np.asarray(values)):
            yield (*at, *index), value


def _as_float(name: str, at: tuple[int, ...], cell: Any) -> float:
    """Return one cell as a float, or refuse it."""
    try:
        number = hasattr(type(cell), "__float__") and not isinstance(cell, _NO_NUMBERS)
        if not number or _is_masked(cell):
            raise TypeError
        value = float(cell)
    except OverflowError:
        raise _beyond_floats(name, at, cell) from None
    except (TypeError, ValueError):
        rule = "must be a real number" if at else "must be real numbers, one shape, none masked"
        known = type(cell).__module__ in ("builtins", "numpy", "numpy.ma", "numpy.ma.core")
        what = "" if known else f" ({type(cell).__module__}.{type(cell).__qualname__})"
        raise refusal(name, at, f" = {shown(cell)}{what}; {rule}") from None
    if math.isinf(value) and cell != value:
        raise _beyond_floats(name, at, cell)
    return value


def _beyond_floats(name: str, at: tuple[int, ...], value: Any) -> ValueError:
    return refusal(name, at, f" = {shown(value)}; must be within the range of floats")


def _refuse_ragged(name: str, values: Any, at: tuple[int, ...] = ()) -> None:
    """Raise if rows beside each other differ in shape."""
    if not isinstance(values, (list, tuple)):
        return
    for k, row in enumerate(values):
        _refuse_ragged(name, row, (*at, k))
        shape, first = np.shape(row), np.shape(values[0])
        if shape != first:
            raise ValueError(
                f"{name}{place((*at, k))} has shape {shape}, {name}{place((*at, 0))} has {first}; "
                "must have one shape"
            )


#: Mass of the lightest ball of a chain, as a part of the heaviest: beyond it squares vanish.
LIGHTEST = 1e-150

__all__ = [
    "Vector", "a", "checked", "checked_masses", "checked_restitution", "first", "is_whole",
    "must_be", "number_or_row", "numbers", "one_number", "one_of", "place_in", "refusal",
    "refuse_overflow", "refuse_where", "row_of", "shown", "whole_number", "whole_rule",
]  # fmt: skip


def checked(
    name: str,
    values: ArrayLike | None,
    rule: str = "must be finite",
    low: float = -np.inf,
    high: float = np.inf,
    open_low: bool = False,
) -> Vector:
    """Return `values` as floats, all finite and inside the limits."""
    array = numbers(name, values)
    if array is values:
        array = array.copy()
    wrong = ~np.isfinite(array) | (array < low) | (array > high)
    if open_low:
        wrong |= array <= low
    if wrong.any():
        refuse_where(
            name, array, wrong, rule if np.isfinite(array[first(wrong)]) else "must be finite"
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
    """Return `value` as a float inside its limits."""
    number = checked(name, value, rule, low, high, open_low)
    if number.ndim:
        raise ValueError(f"{name} = {shown(value)}; must be one number")
    return float(number)


def checked_masses(masses: ArrayLike) -> Vector:
    """Return masses as floats: positive, and none too light beside the heaviest of its chain."""
    array = checked("masses", masses, "must be above 0", 0.0, open_low=True)
    if array.size and array.ndim:
        small = array < LIGHTEST * array.max(axis=-1, keepdims=True)
        rule = f"must be at least {LIGHTEST} of the heaviest ball of its chain"
        refuse_where("masses", array, small, rule)
    return array


def checked_restitution(restitution: ArrayLike) -> Vector:
    """Return coefficients of restitution as floats: in [0, 1], and if above 0 not too small."""
    array = checked("restitution", restitution, "must lie in [0, 1]", 0.0, 1.0)
    small = (array > 0.0) & (array < LIMITS.least_restitution)
    refuse_where("restitution", array, small, f"must be 0 or at least {LIMITS.least_restitution}")
    return array


def refuse_overflow(velocities: Vector, masses: Vector) -> None:
    """Raise if the kinetic energy or a momentum of a chain is no finite number."""
    v, m = np.broadcast_arrays(velocities, masses)
    with np.errstate(over="ignore"):
        sums = {
            "kinetic energy": (m * v * v).sum(axis=-1),
            "momentum": 2.0 * (m * np.abs(v)).sum(axis=-1),  # an impulse is no larger
        }
    for what, values in sums.items():
        if not np.isfinite(values).all():
            lead = first(~np.isfinite(values))
            at = (*lead, int(np.argmax(np.abs(v[lead]))))
            rest = f" = {float(v[at])!r}; {what} overflows: choose larger units"
            raise refusal("velocities", at, rest)


def whole_number(name: str, value: object) -> int:
    """Return `value` as a whole number of at least 1."""
    if is_whole(value) and value >= 1:
        return int(value)
    raise ValueError(f"{name} = {shown(value)}; {whole_rule(value)}, at least 1")


def number_or_row(
    name: str,
    values: ArrayLike | None,
    length: str,
    rule: str,
    low: float = -np.inf,
    high: float = np.inf,
    open_low: bool = False,
) -> float | tuple[float, ...]:
    """Return one number for all balls or contacts, or a row with one for each, to be kept."""
    array = checked(name, values, rule, low, high, open_low)
    if array.ndim > 1:
        raise ValueError(f"{name} has shape {array.shape}; must be () or ({length},)")
    return tuple(array.tolist()) if array.ndim else float(array)


def row_of(name: str, kept: float | Sequence[float], size: int, balls: int) -> Vector:
    """Return what `number_or_row` kept as a row for a chain."""
    row = np.asarray(kept, dtype=np.float64)
    if row.ndim and row.size != size:
        raise ValueError(f"{name} has {row.size} values; {balls} balls need {size}, or one number")
    return np.broadcast_to(row, (size,)).copy()
