"""What counts as a real number, and how an error names a value that does not."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cradle.refusals import first, place, refusal, shown

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
        If a value is no real number or beyond the range of floats, or the rows of a list differ in
        length; it names the first such value.

    Examples
    --------
    >>> from fractions import Fraction
    >>> numbers("ratio", [0.5, Fraction(1, 8)]).tolist()
    [0.5, 0.125]
    >>> numbers("ratio", [0.5, "x"])
    Traceback (most recent call last):
    ...
    ValueError: ratio[1] = 'x'; must be a real number
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
    if strange or array.dtype.kind not in "iuf":
        # One by one, each as it was given.
        cells = list(_cells(values))
        floats = [_as_float(name, at, cell) for at, cell in cells]
        _refuse_ragged(name, values)
        return np.array(floats, dtype=np.float64).reshape(np.shape(given))
    if array.itemsize <= 8:
        return array.astype(np.float64)
    # Long doubles go further than floats.
    with np.errstate(over="ignore"):
        result = array.astype(np.float64)
    lost = np.isinf(result) & np.isfinite(array)
    if lost.any():
        at = first(lost)
        raise _beyond_floats(name, at, array[at])
    return result


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
