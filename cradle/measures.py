"""What is read off an outcome: which balls bounce back."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cradle.chain import checked

#: Pattern by the number of balls that bounce back: none, the first, the first two.
_PATTERNS = np.array([2, 1, 3])


def bouncing_pattern(velocities: ArrayLike) -> NDArray[np.int64]:
    """Return which balls of three bounce back: pattern 1, 2 or 3 (the paper's I, II, III).

    Ball 1 strikes two balls at rest and comes from the left.  As balls never overtake each other,
    the number of balls that go back (velocity below zero) names them:

    - pattern 1: ball 1 alone bounces back;
    - pattern 2: no ball bounces back;
    - pattern 3: balls 1 and 2 bounce back.

    A ball at rest counts as one that does not go back.

    Parameters
    ----------
    velocities : array_like, shape (..., 3)
        Velocities after the impact, m/s.

    Returns
    -------
    ndarray of int, shape (...)
        1, 2 or 3.

    Raises
    ------
    ValueError
        If the last axis is not three balls long, a velocity is not finite, or the last ball goes
        back: then momentum did not come from the left.

    References
    ----------
    Ceanga and Hurmuzlu, J. Appl. Mech. 68 (2001) 575-583, section 2.5, Fig. 6.

    Examples
    --------
    >>> bouncing_pattern([[-0.1, 0.1, 0.9], [0.1, 0.2, 0.7], [-0.3, -0.1, 0.8]]).tolist()
    [1, 2, 3]
    """
    v = checked("velocities", velocities)
    if v.shape[-1:] != (3,):
        raise ValueError(f"velocities has shape {v.shape}; must be (..., 3)")
    checked("velocities of ball 3", v[..., 2], "must be at least 0: ball 1 came from the left", 0.0)
    return np.asarray(_PATTERNS[np.count_nonzero(v < 0.0, axis=-1)])
