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
    """Return the error that refuses a value; it knows its place, so that it can be moved.

    Parameters
    ----------
    name : str
        What the values are called.
    at : tuple of int
        Index of the value; empty for a single number.
    rest : str
        What follows: the value and the rule.

    Returns
    -------
    ValueError
        With `name`, `index` and `rest` as attributes.

    Examples
    --------
    >>> error = refusal("masses", (2,), " = 0.0; must be above 0")
    >>> print(error, error.index)
    masses[2] = 0.0; must be above 0 (2,)
    """
    index = tuple(int(k) for k in at)
    error = ValueError(f"{name}{place(index)}{rest}")
    vars(error).update(name=name, index=index, rest=rest)
    return error


def place(at: tuple[Any, ...]) -> str:
    """Return an index as an error names it.

    Parameters
    ----------
    at : tuple of int
        The index; empty for a single number.

    Returns
    -------
    str
        The index in brackets, or nothing.

    Examples
    --------
    >>> "masses" + place((2, 0))
    'masses[2, 0]'
    """
    return f"[{', '.join(str(int(k)) for k in at)}]" if at else ""


def shown(value: object) -> str:
    """Return a value as an error repeats it: on one line, and cut if it is long.

    Parameters
    ----------
    value : object
        Anything.

    Returns
    -------
    str
        Its repr, at most 80 characters of it.

    Examples
    --------
    >>> shown("x" * 1000)[-10:]
    'xxxxxxx...'
    """
    # NumPy's own scalars as plain numbers; of a long list no more than is shown.
    if isinstance(value, (np.floating, np.complexfloating)):
        return str(value)
    if isinstance(value, (list, tuple)) and len(value) > _SHOWN:
        value = [*value[:_SHOWN]]
    text = " ".join(repr(value).split())
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."


def first(true: NDArray[np.bool_]) -> tuple[int, ...]:
    """Return the index of the first true value.

    Parameters
    ----------
    true : ndarray of bool
        One at least is true.

    Returns
    -------
    tuple of int
        The index.

    Examples
    --------
    >>> first(np.array([[False, False], [True, True]]))
    (1, 0)
    """
    return tuple(int(k) for k in np.unravel_index(int(np.argmax(true)), true.shape))


def refuse_where(
    name: str, values: NDArray[np.float64], wrong: NDArray[np.bool_], rule: str
) -> None:
    """Raise if any value is wrong.

    Parameters
    ----------
    name : str
        What the values are called in the error.
    values : ndarray
        The values; they broadcast to the shape of `wrong`.
    wrong : ndarray of bool
        Which of them are wrong.
    rule : str
        What the error says of the first one.

    Raises
    ------
    ValueError
        Naming the first wrong value and the rule.

    Examples
    --------
    >>> speeds = np.array([1.0, 3.0])
    >>> refuse_where("speeds", speeds, speeds > 2.0, "must be at most 2")
    Traceback (most recent call last):
    ...
    ValueError: speeds[1] = 3.0; must be at most 2
    """
    if wrong.any():
        at = first(wrong)
        value = float(np.broadcast_to(values, wrong.shape)[at])
        raise refusal(name, at, f" = {value!r}; {rule}")


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


def one_of(name: str, value: object, choices: Sequence[str]) -> str:
    """Return `value` if it is one of some words.

    Parameters
    ----------
    name : str
        What it is called in an error.
    value : object
        Anything.
    choices : sequence of str
        The words.

    Returns
    -------
    str
        `value` itself.

    Raises
    ------
    ValueError
        If it is none of them.

    Examples
    --------
    >>> one_of("order", "up", ("left", "right"))
    Traceback (most recent call last):
    ...
    ValueError: order = 'up'; must be 'left' or 'right'
    """
    if not isinstance(value, str) or value not in choices:
        two = len(choices) == 2
        rule = " or ".join(map(repr, choices)) if two else f"one of {', '.join(choices)}"
        raise ValueError(f"{name} = {shown(value)}; must be {rule}")
    return value


def place_in(name: str, value: object, size: int) -> int:
    """Return `value` as the place of a thing in a row.

    Parameters
    ----------
    name : str
        What it is called in an error.
    value : object
        A whole number of Python's or NumPy's.
    size : int
        How many things there are, counted from 0.

    Returns
    -------
    int
        The value.

    Raises
    ------
    ValueError
        If there is no such thing.

    Examples
    --------
    >>> place_in("contact", 2, 2)
    Traceback (most recent call last):
    ...
    ValueError: contact = 2; must be one of 0 to 1
    """
    if is_whole(value) and 0 <= value < size:
        return int(value)
    raise ValueError(f"{name} = {shown(value)}; must be one of 0 to {size - 1}")


def is_whole(value: object) -> TypeGuard[int]:
    """Tell whether a value is a whole number: an int or NumPy's, but no bool.

    Parameters
    ----------
    value : object
        Anything.

    Returns
    -------
    bool
        Whether it counts.

    Examples
    --------
    >>> is_whole(2), is_whole(2.0), is_whole(True)
    (True, False, False)
    """
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def whole_rule(value: object) -> str:
    """Return what an error says of a value that is no whole number, or not of that type.

    Parameters
    ----------
    value : object
        Anything.

    Returns
    -------
    str
        The rule.

    Examples
    --------
    >>> whole_rule(1.5), whole_rule(1e6)
    ('must be a whole number', 'must be an int (1000000)')
    """
    if isinstance(value, float) and value.is_integer() and abs(value) < 2.0**53:
        return f"must be an int ({int(value)})"
    return "must be a whole number"


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
