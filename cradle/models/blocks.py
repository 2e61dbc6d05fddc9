"""Batches cut into blocks, as by dask: errors name the place in the whole, not in the block."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cradle.input.values import Vector, refusal
from cradle.models.batch import post_impact_velocities
from cradle.trace import ImpactNotFinished

_NAMES = ("masses", "velocities", "restitution", "forward", "backward")


def post_impact_block(
    *arrays: ArrayLike, block_info: Mapping[Any, Any] | None = None, **options: Any
) -> Vector:
    """Solve one block of a batch: `post_impact_velocities` for `dask.array.map_blocks`.

    Parameters
    ----------
    *arrays : array_like
        Masses, velocities, restitution, forward and, if wanted, backward ratios; cut along leading
        axes, never along the last.
    block_info : mapping, optional
        Where the block lies; dask hands it over.
    **options
        As for `post_impact_velocities`.

    Returns
    -------
    ndarray, shape (..., N)
        Velocities after the impacts of this block, m/s.

    Raises
    ------
    ValueError, ImpactNotFinished
        As `post_impact_velocities`; the index is that in the whole array, or a note says where the
        block begins.

    Examples
    --------
    >>> info = {0: {"array-location": [(4, 8), (0, 3)]}, None: {"array-location": [(4, 8), (0, 3)]}}
    >>> masses = np.ones((4, 3))
    >>> masses[1, 2] = -1.0
    >>> post_impact_block(masses, [1, 0, 0], 1, 0.1, block_info=info)
    Traceback (most recent call last):
    ...
    ValueError: masses[5, 2] = -1.0; must be above 0
    """
    try:
        return post_impact_velocities(*arrays, **options)
    except (ValueError, ImpactNotFinished) as error:
        if not block_info:
            raise
        name, at = getattr(error, "name", None), getattr(error, "index", ())
        whole = block_info[None]["array-location"]
        if name in _NAMES and at:
            k = _NAMES.index(name)
            own = block_info[k]["array-location"] if block_info.get(k) else ()
            inside = len(at) == np.ndim(arrays[k]) and np.all(np.less(at, np.shape(arrays[k])))
            # An array that is not cut lies whole in every block.
            location = (own or [(0, 0)] * len(at)) if inside else whole
            moved = tuple(i + low for i, (low, _) in zip(at, location[-len(at) :], strict=True))
            raise refusal(name, moved, vars(error)["rest"]) from None
        error.add_note(f"in the block that begins at {tuple(int(low) for low, _ in whole[:-1])}")
        raise
