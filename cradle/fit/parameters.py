"""What is fitted, by the types of the balls: its names, and chains solved for many values of it."""

from __future__ import annotations

from collections.abc import KeysView, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from cradle.input.values import Vector, shown
from cradle.models.batch import post_impact_velocities

#: A parameter: the types of two balls (restitution, in alphabetical order) or of three (ratio).
Key = tuple[str, ...]
#: Parameters at P points: of shape (P,), or a number for all points.
Values = Mapping[Key, Any]


def label(key: Key) -> str:
    """Return the name of a parameter, such as "ABC" or "steel-brass"."""
    return ("" if all(len(name) == 1 for name in key) else "-").join(key)


def parameter_key(name: str | Key) -> Key:
    """Return the types of balls that a parameter's name joins."""
    if isinstance(name, tuple):
        return name
    return tuple(name.split("-")) if "-" in name else tuple(name)


def types_in_a_row(types: str | Sequence[str]) -> tuple[str, ...]:
    """Return the types of a row of balls, at least two."""
    row = parameter_key(types) if isinstance(types, str) else tuple(types)
    if len(row) < 2:
        raise ValueError(f"types = {shown(types)}; must name at least 2 balls")
    return row


def pair_keys(types: Sequence[str]) -> list[Key]:
    """Return the restitution parameter of each contact."""
    return [tuple(sorted(pair)) for pair in pairwise(types)]


def triplet_keys(types: Sequence[str]) -> tuple[list[Key], list[Key]]:
    """Return the forward and the backward ratio parameter of each interior ball."""
    forward = [tuple(types[i : i + 3]) for i in range(len(types) - 2)]
    return forward, [key[::-1] for key in forward]


def ratio_keys(types: Sequence[str]) -> KeysView[Key]:
    """Return the ratio parameters of a chain, of both ways, each once."""
    both = zip(*triplet_keys(types), strict=True)
    return dict.fromkeys(key for keys in both for key in keys).keys()


def fitted_keys(types: Sequence[str]) -> KeysView[Key]:
    """Return what shots of a chain are fitted for: of a pair its restitution, else its ratios."""
    return ratio_keys(types) or dict.fromkeys(pair_keys(types)).keys()


def outcomes(types: Sequence[str], masses: Vector, velocities: Vector, values: Values) -> Vector:
    """Solve a chain at P points; velocities (..., 1, N) -> (..., P, N)."""
    e, forward, backward = (
        np.stack(np.broadcast_arrays(*(values[key] for key in keys)), axis=-1)
        if keys else np.zeros((1, 0))
        for keys in (pair_keys(types), *triplet_keys(types))
    )  # fmt: skip
    return post_impact_velocities(masses, velocities, e, forward, backward, excess="saturate")
