"""What the paper gives in closed form: one collision per contact, largest ratios, pattern lines.

Ceanga and Hurmuzlu, J. Appl. Mech. 68 (2001) 575-583.  Notation of its equations: balls 1, 2, 3
with masses m1, m2, m3; contact impulses tau_2 (balls 1-2) and tau_3 (balls 2-3), restitution e2 and
e3; alpha is the forward ratio at ball 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cradle.input.values import Vector, checked, numbers, one_number
from cradle.kernel.state import LIMITS

_Balls = tuple[Vector, ...]
_UNIT = ("must lie in [0, 1]", 0.0, 1.0)
#: What is asked of a restitution that divides.
_NO_ZERO = (f"must lie in [{LIMITS.least_restitution}, 1]", LIMITS.least_restitution, 1.0)


def _split(
    masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike, ratio: ArrayLike
) -> tuple[_Balls, _Balls, _Balls, Vector]:
    """Check shapes; return masses, velocities and restitution one by one, and the ratio."""
    sizes = {"masses": 3, "velocities": 3, "restitution": 2}
    arrays = map(numbers, sizes, (masses, velocities, restitution))
    given = dict(zip(sizes, arrays, strict=True))
    for name, array in given.items():
        if array.shape[-1:] != (sizes[name],):
            raise ValueError(f"{name} has shape {array.shape}; must be (..., {sizes[name]})")
    m, v, e = (tuple(array[..., k] for k in range(array.shape[-1])) for array in given.values())
    alpha = numbers("ratio", ratio)
    try:
        np.broadcast_shapes(m[0].shape, v[0].shape, e[0].shape, alpha.shape)
    except ValueError:
        shapes = [f"{name} {array.shape}" for name, array in {**given, "ratio": alpha}.items()]
        raise ValueError(f"leading axes do not broadcast: {', '.join(shapes)}") from None
    return m, v, e, alpha


def _taus(m: _Balls, v: _Balls, e: _Balls, alpha: Vector) -> tuple[Vector, Vector, Vector]:
    """Return what contact 2-3 would gain from the whole impulse tau_2 at once, tau_2 and tau_3."""
    (m1, m2, m3), (v1, v2, v3), (e2, e3) = m, v, e
    gain = (1.0 + e2) * m1 * (v1 - v2) / ((1.0 - alpha) * m1 + m2)
    tau_2 = m2 * gain  # Eq. 24
    tau_3c = (gain + (v2 - v3)) * m2 * m3 / (m2 + m3)  # Eq. 28
    with np.errstate(invalid="ignore"):
        root = np.sqrt(1.0 - alpha * (m2 / m3 + 1.0) * (gain / (gain + (v2 - v3))) ** 2)
    return gain, tau_2, tau_3c * (1.0 + e3 * root)  # Eq. 30


def _after(m: _Balls, v: _Balls, tau_2: Vector, tau_3: Vector) -> _Balls:
    """Return the velocities after the impact, ball by ball."""
    (m1, m2, m3), (v1, v2, v3) = m, v
    return v1 - tau_2 / m1, v2 + (tau_2 - tau_3) / m2, v3 + tau_3 / m3


def three_balls(
    masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike, ratio: ArrayLike
) -> Vector:
    """Solve three balls with one collision per contact (Eqs. 22-33).

    Ranges are not checked, which would take longer than the formulas: outside them the result has
    no meaning.  `one_collision_each` tells where it applies.

    Parameters
    ----------
    masses, velocities : array_like, shape (..., 3)
        kg, above 0, and m/s, with v1 > v2 >= v3.
    restitution : array_like, shape (..., 2)
        e2 and e3, 0 to 1.
    ratio : array_like, shape (...)
        Forward Impulse Correlation Ratio alpha, 0 to 1.

    Returns
    -------
    ndarray, shape (..., 3)
        Velocities after the impact, m/s; NaN where the radical of Eq. 30 is not real or an input
        is NaN.

    Raises
    ------
    ValueError
        If a value is no number, or a shape is wrong.

    Examples
    --------
    >>> three_balls([1, 1, 1], [1, 0, 0], [1, 1], [0.0, 0.5]).round(3)
    array([[ 0.   ,  0.   ,  1.   ],
           [-0.333,  0.667,  0.667]])
    """
    m, v, e, alpha = _split(masses, velocities, restitution, ratio)
    _, tau_2, tau_3 = _taus(m, v, e, alpha)
    return np.stack(np.broadcast_arrays(*_after(m, v, tau_2, tau_3)), axis=-1)


def final_impulses(
    masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike, ratio: ArrayLike
) -> tuple[Vector, Vector]:
    """Return the final impulses of three balls with one collision per contact (Eqs. 24 and 30).

    Parameters
    ----------
    masses, velocities, restitution, ratio : array_like
        As for `three_balls`, with the same errors.

    Returns
    -------
    tau_2, tau_3 : ndarray, shape (...)
        N s; tau_3 is NaN where the velocities of `three_balls` are.

    Examples
    --------
    >>> final_impulses([1, 1, 1], [1, 0, 0], [1, 1], 0.0)
    (np.float64(1.0), np.float64(1.0))
    """
    _, tau_2, tau_3 = _taus(*_split(masses, velocities, restitution, ratio))
    return tau_2, tau_3


def one_collision_each(
    masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike, ratio: ArrayLike
) -> NDArray[np.bool_]:
    """Tell where three balls collide once per contact, so that Eqs. 30-33 hold (Eqs. 34, 43, 44).

    Two conditions: contact 2-3 still closes when contact 1-2 ends, and ball 2 does not fall back
    on ball 1 (for v2 = v3 = 0 the second is Eq. 44).

    Parameters
    ----------
    masses, velocities, restitution, ratio : array_like
        As for `three_balls`, with the same errors.

    Returns
    -------
    ndarray of bool, shape (...)
        False where the result of `three_balls` is NaN.

    Examples
    --------
    >>> one_collision_each([1, 1, 1], [1, 0, 0], [1, 1], [0.1, 0.6])
    array([ True, False])
    """
    m, v, e, alpha = _split(masses, velocities, restitution, ratio)
    gain, tau_2, tau_3 = _taus(m, v, e, alpha)
    v1, v2, _ = _after(m, v, tau_2, tau_3)
    still_closes = alpha * (m[1] + m[2]) * gain <= (gain + (v[1] - v[2])) * m[2]
    return np.asarray(still_closes & (v1 <= v2))


def largest_ratios(
    masses: ArrayLike, forward: ArrayLike, backward: ArrayLike
) -> tuple[Vector, Vector]:
    """Largest admissible ratios of a chain, forward (Eqs. 34, 53) and backward (mirrored).

    A contact cannot pull: a larger ratio would open a driven contact that has absorbed nothing.
    The bound at a ball needs the ratio of the next ball in the direction of the drive; there is
    none at the last, where the bound is Eq. 34.

    Parameters
    ----------
    masses : array_like, shape (..., N)
        kg, above 0; N >= 2.
    forward, backward : array_like, shape (..., N - 2)
        Ratios at the interior balls, 0 to 1.

    Returns
    -------
    forward, backward : ndarray, shape (..., N - 2)
        The largest admissible ratios.

    Raises
    ------
    ValueError
        If a value or a shape is wrong; the message names the value and the rule.

    Examples
    --------
    >>> [bound.tolist() for bound in largest_ratios([1, 1, 1, 1], [0.5, 0.5], [0.5, 0.5])]
    [[0.6666666666666666, 0.5], [0.5, 0.6666666666666666]]
    """
    m = checked("masses", masses, "must be above 0", 0.0, open_low=True)
    if m.shape[-1:] < (2,):
        raise ValueError(f"masses has shape {m.shape}; must be (..., N) with N >= 2")
    f, b = checked("forward", forward, *_UNIT), checked("backward", backward, *_UNIT)
    size = m.shape[-1] - 2
    for name, ratio in (("forward", f), ("backward", b)):
        if ratio.shape[-1:] != (size,):
            raise ValueError(
                f"{name} has shape {ratio.shape}; must be (..., {size}) for {size + 2} balls: one "
                "number for each ball between two others"
            )

    def bound(m: Vector, ratio: Vector) -> Vector:
        onward = np.zeros(ratio.shape)
        onward[..., :-1] = ratio[..., 1:]
        # A quotient of masses, as their sum could overflow.
        return np.asarray(1.0 / (1.0 + m[..., 1:-1] / m[..., 2:] * (1.0 - onward)))

    return bound(m, f), bound(m[..., ::-1], b[..., ::-1])[..., ::-1]


def back_impact_line(r2: ArrayLike, e2: ArrayLike, e3: ArrayLike, ratio: ArrayLike) -> Vector:
    """Mass ratio r1 = m2/m1 at and below which ball 2 falls back on ball 1 (Eq. 44, Fig. 6).

    Parameters
    ----------
    r2 : array_like
        Mass ratio m2/m3, at least 0.
    e2, e3, ratio : array_like
        Restitution of the two contacts, e2 at least 1e-30, and the forward ratio; 0 to 1.

    Returns
    -------
    ndarray
        r1; NaN where the ratio exceeds its bound (Eq. 34).

    Raises
    ------
    ValueError
        If a value is out of its range.

    Examples
    --------
    >>> float(back_impact_line(1.0, 0.5, 0.5, 0.15).round(4))
    0.8275
    """
    r2, e2 = checked("r2", r2, "must be at least 0", 0.0), checked("e2", e2, *_NO_ZERO)
    e3, ratio = checked("e3", e3, *_UNIT), checked("ratio", ratio, *_UNIT)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(1.0 - ratio * (1.0 + r2))
    return np.asarray((1.0 + e2) * (1.0 + e3 * root) / (e2 * (1.0 + r2)) - (1.0 + ratio / e2))


def first_ball_stops(e2: float, ratio: float) -> float:
    """Mass ratio r1 = m2/m1 at which ball 1 is left at rest (Eq. 45).

    Parameters
    ----------
    e2, ratio : float
        Restitution of contact 1-2, 1e-30 to 1, and the forward ratio, 0 to 1; else a `ValueError`.

    Examples
    --------
    >>> first_ball_stops(0.5, 0.15)
    1.7
    """
    return (1.0 - one_number("ratio", ratio, *_UNIT)) / one_number("e2", e2, *_NO_ZERO)


def middle_ball_stops(e3: float, ratio: float) -> float:
    """Mass ratio r2 = m2/m3 at which ball 2 is left at rest (Eq. 46).

    Parameters
    ----------
    e3, ratio : float
        Restitution of contact 2-3 and the forward ratio, 0 to 1; else a `ValueError`.

    Examples
    --------
    >>> round(middle_ball_stops(0.5, 0.15), 6)
    0.442608
    """
    e3, ratio = one_number("e3", e3, *_UNIT), one_number("ratio", ratio, *_UNIT)
    half = 0.5 * ratio * e3
    return float(e3 * np.sqrt(1.0 - ratio + half * half) - half * e3)
