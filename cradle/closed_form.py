"""What the paper gives in closed form: one collision per contact, largest ratios, pattern lines.

Notation of the equations: balls 1, 2, 3 with masses m1, m2, m3; contact impulses tau_2 (balls 1-2)
and tau_3 (balls 2-3), restitution e2 and e3; alpha is the forward ratio at ball 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cradle.chain import Vector


def _split(*arrays: ArrayLike) -> list[tuple[Vector, ...]]:
    """Split each array along its last axis."""
    return [tuple(np.moveaxis(np.asarray(a, dtype=np.float64), -1, 0)) for a in arrays]


def three_balls(
    masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike, ratio: ArrayLike
) -> Vector:
    """Solve three balls with one collision per contact (Eqs. 22-33).

    Parameters
    ----------
    masses, velocities : array_like, shape (..., 3)
        kg and m/s, with v1 > v2 >= v3.
    restitution : array_like, shape (..., 2)
        e2 and e3.
    ratio : array_like, shape (...)
        Forward Impulse Correlation Ratio alpha.

    Returns
    -------
    ndarray, shape (..., 3)
        Velocities after the impact, m/s.  NaN where the radical of Eq. 30 is not real; see
        `one_collision_each` for where the result applies.

    References
    ----------
    Ceanga and Hurmuzlu (2001), Eqs. 22, 24, 26, 28, 30, 31-33.

    Examples
    --------
    >>> three_balls([1, 1, 1], [1, 0, 0], [1, 1], [0.0, 0.5]).round(3)
    array([[ 0.   ,  0.   ,  1.   ],
           [-0.333,  0.667,  0.667]])
    """
    (m1, m2, m3), (v1, v2, v3) = _split(masses, velocities)
    tau_2, tau_3 = final_impulses(masses, velocities, restitution, ratio)
    return np.stack(
        np.broadcast_arrays(v1 - tau_2 / m1, v2 + (tau_2 - tau_3) / m2, v3 + tau_3 / m3), axis=-1
    )


def final_impulses(
    masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike, ratio: ArrayLike
) -> tuple[Vector, Vector]:
    """Return the final impulses of three balls with one collision per contact (Eqs. 24 and 30).

    Parameters
    ----------
    masses, velocities, restitution, ratio : array_like
        As for `three_balls`.

    Returns
    -------
    tau_2, tau_3 : ndarray, shape (...)
        N s.

    References
    ----------
    Ceanga and Hurmuzlu (2001), Eqs. 22, 24, 28, 30.

    Examples
    --------
    >>> final_impulses([1, 1, 1], [1, 0, 0], [1, 1], 0.0)
    (np.float64(1.0), np.float64(1.0))
    """
    (m1, m2, m3), (v1, v2, v3), (e2, e3) = _split(masses, velocities, restitution)
    alpha = np.asarray(ratio, dtype=np.float64)
    # Speed that contact 2-3 would gain from the whole impulse tau_2 at once.
    gain = (1.0 + e2) * m1 * (v1 - v2) / ((1.0 - alpha) * m1 + m2)
    tau_2 = m2 * gain  # Eq. 24
    tau_3c = (gain + (v2 - v3)) * m2 * m3 / (m2 + m3)  # Eq. 28
    with np.errstate(invalid="ignore"):
        root = np.sqrt(1.0 - alpha * (m2 / m3 + 1.0) * (gain / (gain + (v2 - v3))) ** 2)
    return tau_2, tau_3c * (1.0 + e3 * root)  # Eq. 30


def one_collision_each(
    masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike, ratio: ArrayLike
) -> NDArray[np.bool_]:
    """Tell where three balls collide once per contact, so that Eqs. 30-33 hold.

    Two conditions: contact 2-3 still closes when contact 1-2 ends, and ball 2 does not fall back
    on ball 1 (for v2 = v3 = 0 the second is Eq. 44).

    Parameters
    ----------
    masses, velocities, restitution, ratio : array_like
        As for `three_balls`.

    Returns
    -------
    ndarray of bool, shape (...)

    References
    ----------
    Ceanga and Hurmuzlu (2001), Eqs. 34, 43, 44.

    Examples
    --------
    >>> one_collision_each([1, 1, 1], [1, 0, 0], [1, 1], [0.1, 0.6])
    array([ True, False])
    """
    (m1, m2, m3), (v1, v2, v3), (e2, _) = _split(masses, velocities, restitution)
    alpha = np.asarray(ratio, dtype=np.float64)
    gain = (1.0 + e2) * m1 * (v1 - v2) / ((1.0 - alpha) * m1 + m2)
    after = three_balls(masses, velocities, restitution, ratio)
    still_closes = alpha * (m2 + m3) * gain <= (gain + (v2 - v3)) * m3
    return np.asarray(still_closes & (after[..., 0] <= after[..., 1]))


def largest_ratios(
    masses: ArrayLike, forward: ArrayLike, backward: ArrayLike
) -> tuple[Vector, Vector]:
    """Largest admissible ratios of a chain, forward (Eq. 53) and backward (its mirror image).

    A contact cannot pull: a larger ratio would open a driven contact that has absorbed nothing.
    The bound at a ball needs the ratio of the next ball in the direction of the drive; there is
    none at the last, where the bound is Eq. 34.

    Parameters
    ----------
    masses : array_like, shape (..., N)
        kg.
    forward, backward : array_like, shape (..., N - 2)
        Ratios at the interior balls.

    Returns
    -------
    forward, backward : ndarray, shape (..., N - 2)
        The largest admissible ratios.

    References
    ----------
    Ceanga and Hurmuzlu (2001), Eqs. 34 and 53; the mirrored bound is not printed there.

    Examples
    --------
    >>> [bound.tolist() for bound in largest_ratios([1, 1, 1, 1], [0.5, 0.5], [0.5, 0.5])]
    [[0.6666666666666666, 0.5], [0.5, 0.6666666666666666]]
    """
    m = np.asarray(masses, dtype=np.float64)

    def bound(m: Vector, ratio: Vector) -> Vector:
        onward = np.concatenate([ratio[..., 1:], np.zeros_like(ratio[..., :1])], axis=-1)
        # A quotient of masses, as their sum could overflow.
        return np.asarray(1.0 / (1.0 + m[..., 1:-1] / m[..., 2:] * (1.0 - onward)))

    f, b = np.asarray(forward, dtype=np.float64), np.asarray(backward, dtype=np.float64)
    return bound(m, f), bound(m[..., ::-1], b[..., ::-1])[..., ::-1]


def back_impact_line(r2: ArrayLike, e2: float, e3: float, ratio: float) -> Vector:
    """Mass ratio r1 = m2/m1 at and below which ball 2 falls back on ball 1 (Eq. 44).

    Parameters
    ----------
    r2 : array_like
        Mass ratio m2/m3.
    e2, e3, ratio : float
        Restitution of the two contacts and the forward ratio.

    Returns
    -------
    ndarray
        r1, same shape; NaN where the ratio exceeds its bound (Eq. 34).

    References
    ----------
    Ceanga and Hurmuzlu (2001), Eq. 44 and Fig. 6 (its legend says Eq. 47).

    Examples
    --------
    >>> float(back_impact_line(1.0, 0.5, 0.5, 0.15).round(4))
    0.8275
    """
    r2 = np.asarray(r2, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(1.0 - ratio * (1.0 + r2))
    return np.asarray((1.0 + e2) * (1.0 + e3 * root) / (e2 * (1.0 + r2)) - (1.0 + ratio / e2))


def first_ball_stops(e2: float, ratio: float) -> float:
    """Mass ratio r1 = m2/m1 at which ball 1 is left at rest (Eq. 45).

    Examples
    --------
    >>> first_ball_stops(0.5, 0.15)
    1.7
    """
    return (1.0 - ratio) / e2


def middle_ball_stops(e3: float, ratio: float) -> float:
    """Mass ratio r2 = m2/m3 at which ball 2 is left at rest (Eq. 46).

    Examples
    --------
    >>> round(middle_ball_stops(0.5, 0.15), 6)
    0.442608
    """
    half = 0.5 * ratio * e3
    return float(e3 * np.sqrt(1.0 - ratio + half * half) - half * e3)
