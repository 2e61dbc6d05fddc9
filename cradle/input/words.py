"""Refuse input in words: the value by name and place, and the rule."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeGuard, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "a", "first", "must_be", "one_of", "place", "place_in", "refusal", "refuse_where", "shown",
]  # fmt: skip

# The longest value that an error repeats, in characters.
_SHOWN = 80

_Thing = TypeVar("_Thing")


def refusal(name: str, at: tuple[Any, ...], rest: str) -> ValueError:
    """Return the error that refuses a value; it knows its place, so that it can be moved."""
    index = tuple(int(k) for k in at)
    error = ValueError(f"{name}{place(index)}{rest}")
    vars(error).update(name=name, index=index, rest=rest)
    return error


def place(at: tuple[Any, ...]) -> str:
    """Return an index as an error names it."""
    return f"[{', '.join(str(int(k)) for k in at)}]" if at else ""


def shown(value: object) -> str:
    """Return a value as an error repeats it: on one line, and cut if it is long."""
    # NumPy's own scalars as plain numbers; of a long list no more than is shown.
    if isinstance(value, (np.floating, np.complexfloating)):
        return str(value)
    if isinstance(value, (list, tuple)) and len(value) > _SHOWN:
        value = [*value[:_SHOWN]]
    text = " ".join(repr(value).split())
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."


def first(true: NDArray[np.bool_]) -> tuple[int, ...]:
    """Return the index of the first true value."""
    return tuple(int(k) for k in np.unravel_index(int(np.argmax(true)), true.shape))


def refuse_where(
    name: str, values: NDArray[np.float64], wrong: NDArray[np.bool_], rule: str
) -> None:
    """Raise if any value is wrong."""
    if wrong.any():
        at = first(wrong)
        value = float(np.broadcast_to(values, wrong.shape)[at])
        raise refusal(name, at, f" = {value!r}; {rule}")


def must_be(kind: type[_Thing], name: str, thing: object) -> _Thing:
    """Return `thing` if it is of the type `kind`."""
    if not isinstance(thing, kind):
        what = f"the class {thing.__name__}" if isinstance(thing, type) else a(type(thing).__name__)
        raise TypeError(f"{name} is {what}; must be {a(kind.__name__)}")
    return thing


def one_of(name: str, value: object, choices: Sequence[str]) -> str:
    """Return `value` if it is one of some words."""
    if not isinstance(value, str) or value not in choices:
        two = len(choices) == 2
        rule = " or ".join(map(repr, choices)) if two else f"one of {', '.join(choices)}"
        raise ValueError(f"{name} = {shown(value)}; must be {rule}")
    return value


def place_in(name: str, value: object, size: int) -> int:
    """Return `value` as the place of a thing in a row."""
    if is_whole(value) and 0 <= value < size:
        return int(value)
    raise ValueError(f"{name} = {shown(value)}; must be one of 0 to {size - 1}")


def is_whole(value: object) -> TypeGuard[int]:
    """Tell whether a value is a whole number: an int or NumPy's, but no bool."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def whole_rule(value: object) -> str:
    """Return what an error says of a value that is no whole number, or not of that type."""
    if isinstance(value, float) and value.is_integer() and abs(value) < 2.0**53:
        return f"must be an int ({int(value)})"
    return "must be a whole number"


def a(name: str) -> str:
    """Return a name with its indefinite article."""
    return f"{'an' if name[:1].lower() in tuple('aeiou') else 'a'} {name}"
