"""What is asked of input: real numbers, limits, masses, whole numbers, rows; and how it is refused.

A refusal names the value, its place and the rule: `masses[1] = -1.0; must be above 0`.
"""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NewType, TypeVar

import numpy as np
from numpy.typing import ArrayLike as ArrayLike
from numpy.typing import NDArray as NDArray

from cradle.kernel.state import LIMITS

Vector = NDArray[np.float64]
if not TYPE_CHECKING:  # `help` has their names, not what they stand for
    ArrayLike, Vector = NewType("ArrayLike", object), np.ndarray
_Thing = TypeVar("_Thing")

#: Mass of the lightest ball of a chain, as a part of the heaviest: beyond it squares vanish.
LIGHTEST = 1e-150
#: A rule, its limits, and whether the lower one is excluded: of numbers above 0, and of parts.
ABOVE_ZERO: tuple[str, float, float, bool] = ("must be above 0", 0.0, math.inf, True)
PART: tuple[str, float, float] = ("must lie in [0, 1]", 0.0, 1.0)
_SHOWN = 80  # characters of a value that an error repeats
_USUAL = {float, int, np.float64}
# Python would turn these into floats, or NumPy with a warning, but they are no real numbers.
_NO_NUMBERS = (bool, np.bool_, str, bytes, complex, np.complexfloating, np.timedelta64)


def numbers(name: str, values: ArrayLike | None, at: tuple[int, ...] = ()) -> Vector:
    """Return `values` as floats of any size; an array of floats comes back as it is."""
    if type(values) is np.ndarray and values.dtype == np.float64:
        return values
    given: Any = values
    try:
        if _usual([values]):
            return np.array(values, dtype=np.float64)
        if not (isinstance(values, (list, tuple)) or _is_masked(values)):
            given = np.asarray(values)
            if given.dtype.kind in "iuf" and given.itemsize <= 8:  # long doubles go further
                return np.array(given, dtype=np.float64)
    except (OverflowError, TypeError, ValueError):
        given = values
    if not (isinstance(given, (list, tuple)) or (isinstance(given, np.ndarray) and given.ndim)):
        return np.array(_as_float(name, at, given[()] if type(values) is np.ndarray else values))
    # One by one, each as it was given.
    rows = [numbers(name, row, (*at, k)) for k, row in enumerate(given)]
    for k, row in enumerate(rows):
        if row.shape != rows[0].shape:
            other = f"{name}{[*at, 0]} has {rows[0].shape}"
            raise refusal(name, (*at, k), f" has shape {row.shape}, {other}; must have one shape")
    return np.array(rows, dtype=np.float64)


def _usual(values: Sequence[Any]) -> bool:
    """Tell whether nested lists hold nothing but Python's own numbers."""
    kinds = {*map(type, values)}
    return kinds <= _USUAL or (kinds <= {list, tuple} and all(map(_usual, values)))


def _is_masked(value: Any) -> bool:
    """Tell whether anything is masked, as `numpy.ma` would, without loading it."""
    mask = getattr(value, "_mask", False)
    return mask is not False and bool(np.any(mask))


def _as_float(name: str, at: tuple[int, ...], cell: Any) -> float:
    """Return one cell as a float, or refuse it."""
    try:
        number = hasattr(type(cell), "__float__") and not isinstance(cell, _NO_NUMBERS)
        if not number or _is_masked(cell):
            raise TypeError
        value = float(cell)
    except OverflowError:
        value = math.inf
    except (TypeError, ValueError):
        rule = f"must be {'a real number' if at else 'real numbers'}"
        known = type(cell).__module__.startswith(("builtins", "numpy"))
        what = "" if known else f" ({type(cell).__module__}.{type(cell).__qualname__})"
        raise refusal(name, at, f" = {shown(cell)}{what}; {rule}") from None
    if math.isinf(value) and cell != value:
        raise refusal(name, at, f" = {shown(cell)}; must be within the range of floats")
    return value


def checked(
    name: str, values: ArrayLike | None, rule: str = "must be finite",
    low: float = -np.inf, high: float = np.inf, open_low: bool = False,
) -> Vector:  # fmt: skip
    """Return `values` as floats, all finite and inside the limits."""
    within = type(values) is float and math.isfinite(values) and low <= values <= high
    if within and not (open_low and values == low):
        return np.array(values)  # nothing more need be asked
    array = numbers(name, values)
    if array is values:
        array = array.copy()
    refuse_where(name, array, ~np.isfinite(array), "must be finite")
    outside = (array < low) | (array > high) | (open_low & (array == low))
    refuse_where(name, array, outside, rule)
    return array


def one_number(name: str, value: ArrayLike, *limits: Any, **more: Any) -> float:
    """Return `value` as a float, all that `checked` asks fulfilled."""
    number = checked(name, value, *limits, **more)
    if number.ndim:
        raise ValueError(f"{name} = {shown(value)}; must be one number")
    return float(number)


def number_or_row(
    name: str, values: ArrayLike | None, length: str, *limits: Any
) -> float | tuple[float, ...]:
    """Return one number for all balls or contacts, or a row with one for each, to be kept."""
    array = checked(name, values, *limits)
    if array.ndim > 1:
        raise ValueError(f"{name} has shape {array.shape}; must be () or ({length},)")
    return tuple(array.tolist()) if array.ndim else float(array)


def row_of(name: str, kept: Any, size: int, balls: int) -> Vector:
    """Return what `number_or_row` kept as a row for a chain."""
    if not isinstance(kept, float) and len(kept) != size:
        raise ValueError(f"{name} has {len(kept)} values; {balls} balls need {size}, or one number")
    return np.full(size, kept)


def shaped(
    given: Mapping[str, ArrayLike], missing: tuple[int, ...]
) -> tuple[list[Vector], tuple[int, ...]]:
    """Return inputs as rows, shorter than the balls by what is `missing`, and their other axes."""
    arrays = [numbers(name, values) for name, values in given.items()]
    n = arrays[0].shape[-1] if arrays[0].ndim else 0
    if n < 2:
        raise ValueError(f"masses has shape {arrays[0].shape}; must be (..., N) with N >= 2")
    if "velocities" in given and arrays[1].shape[-1:] != (n,):
        raise ValueError(f"velocities has shape {arrays[1].shape}; must be (..., {n}), as masses")
    for k, name in enumerate(given):
        size = n - missing[k]
        if arrays[k].ndim == 0:
            arrays[k] = arrays[k].repeat(size)
        elif arrays[k].shape[-1] != size:
            rule = f"must be () or (..., {size}) for {n} balls"
            raise ValueError(f"{name} has shape {arrays[k].shape}; {rule}")
    leads = {array.shape[:-1] for array in arrays}
    try:
        return arrays, leads.pop() if len(leads) == 1 else np.broadcast_shapes(*leads)
    except ValueError:
        shapes = ", ".join(f"{name} {a.shape}" for name, a in zip(given, arrays, strict=True))
        raise ValueError(f"leading axes do not broadcast: {shapes}") from None


def checked_masses(masses: ArrayLike) -> Vector:
    """Return masses as floats: positive, and none too light beside the heaviest of its chain."""
    array = numbers("masses", masses)
    rule = "must be finite: of a wall or a floor, a million times that of the heaviest ball"
    refuse_where("masses", array, array == np.inf, rule)
    array = checked("masses", array, *ABOVE_ZERO)
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
        energy = (m * v * v).sum(axis=-1)
        impulse = 2.0 * (m * np.abs(v)).sum(axis=-1)  # none is larger
    for what, sums in (("kinetic energy", energy), ("momentum", impulse)):
        if not np.isfinite(sums).all():
            fastest = np.abs(v) == np.abs(v).max(axis=-1, keepdims=True)
            wrong = fastest & ~np.isfinite(sums)[..., None]
            refuse_where("velocities", v, wrong, f"{what} overflows: choose larger units")


def whole_number(
    name: str, value: object, rule: str = "at least 1", low: int = 1, high: float = math.inf
) -> int:
    """Return `value` as a whole number inside the limits: an int or NumPy's, but no bool."""
    if isinstance(value, (int, np.integer)) and type(value) is not bool and low <= value <= high:
        return int(value)
    kind = "an int" if isinstance(value, float) and value.is_integer() else "a whole number"
    raise ValueError(f"{name} = {shown(value)}; must be {kind}, {rule}")


def one_of(name: str, value: object, choices: Sequence[str]) -> str:
    """Return `value` if it is one of some words."""
    if not isinstance(value, str) or value not in choices:
        rule = f"one of {', '.join(choices)}" if choices[2:] else " or ".join(map(repr, choices))
        raise ValueError(f"{name} = {shown(value)}; must be {rule}")
    return value


def flag(name: str, value: object) -> bool:
    """Return a switch that is on or off: a bool, or NumPy's."""
    if not isinstance(value, (bool, np.bool_)):
        raise ValueError(f"{name} = {shown(value)}; must be True or False")
    return bool(value)


def must_be(kind: type[_Thing], name: str, thing: object) -> _Thing:
    """Return `thing` if it is of the type `kind`."""
    if not isinstance(thing, kind):
        what = f"the class {thing.__name__}" if isinstance(thing, type) else a(type(thing).__name__)
        raise TypeError(f"{name} is {what}; must be {a(kind.__name__)}")
    return thing


def refusal(name: str, at: tuple[int, ...], rest: str) -> ValueError:
    """Return the error that refuses a value at its place."""
    return ValueError(f"{name}{[*at] or ''}{rest}")


def refuse_where(name: str, values: Vector, wrong: NDArray[np.bool_], rule: str) -> None:
    """Raise if any value is wrong."""
    if wrong.any():
        at = tuple(np.argwhere(wrong)[0].tolist())
        raise refusal(name, at, f" = {float(np.broadcast_to(values, wrong.shape)[at])!r}; {rule}")


def shown(value: object) -> str:
    """Return a value as an error repeats it: on one line, and cut if it is long."""
    if isinstance(value, (np.floating, np.complexfloating)):
        return str(value)  # as a plain number
    if isinstance(value, list | tuple) and len(value) > _SHOWN:
        value = value[:_SHOWN]  # enough; a long one takes long to write
    text = " ".join(repr(value).split())
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."


def a(name: str) -> str:
    """Return a name with its indefinite article."""
    return f"{'an' if name[:1].lower() in tuple('aeiou') else 'a'} {name}"
