"""What the paper gives in closed form (Ceanga and Hurmuzlu, J. Appl. Mech. 68 (2001) 575-583).

Balls 1, 2, 3 have masses m1, m2, m3, contacts 1-2 and 2-3 the impulses tau_2 and tau_3 and the
restitution e2 and e3; alpha is the forward ratio at ball 2.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cradle.input.values import ABOVE_ZERO, PART, Vector, checked, numbers, one_number, shaped
from cradle.kernel.state import LIMITS

#: What is asked of a restitution that divides.
_NO_ZERO = (f"must lie in [{LIMITS.least_restitution}, 1]", LIMITS.least_restitution, 1.0)


def _solved(
    masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike, ratio: ArrayLike
) -> tuple[Vector, Vector, tuple[Vector, ...], NDArray[np.bool_]]:
    """Return tau_2, tau_3, the velocities after, and where there is one collision per contact."""
    names = "masses", "velocities", "restitution", "ratio"
    values = zip(names, (masses, velocities, restitution, ratio), strict=True)
    given = {name: numbers(name, value) for name, value in values}
    for name, size in zip(names, (3, 3, 2), strict=False):
        if given[name].shape[-1:] != (size,):
            raise ValueError(f"{name} has shape {given[name].shape}; must be (..., {size})")
    *balls, alpha = given.values()
    (m1, m2, m3), (v1, v2, v3), (e2, e3) = (np.moveaxis(array, -1, 0) for array in balls)
    try:
        np.broadcast_shapes(m1.shape, v1.shape, e2.shape, alpha.shape)
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in given.items())
        raise ValueError(f"leading axes do not broadcast: {shapes}") from None
    gain = (1.0 + e2) * m1 * (v1 - v2) / ((1.0 - alpha) * m1 + m2)
    tau_2 = m2 * gain  # Eq. 24
    closing = gain + (v2 - v3)  # of contact 2-3, from the whole impulse tau_2 at once
    tau_3c = closing * m2 * m3 / (m2 + m3)  # Eq. 28
    with np.errstate(invalid="ignore"):
        root = np.sqrt(1.0 - alpha * (m2 / m3 + 1.0) * (gain / closing) ** 2)
    tau_3 = tau_3c * (1.0 + e3 * root)  # Eq. 30
    after = v1 - tau_2 / m1, v2 + (tau_2 - tau_3) / m2, v3 + tau_3 / m3
    once = (alpha * (m2 + m3) * gain <= closing * m3) & (after[0] <= after[1])
    return tau_2, tau_3, after, np.asarray(once)


def three_balls(
    masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike, ratio: ArrayLike
) -> Vector:
    """Return velocities after one collision per contact of three balls (equations 22 to 33), m/s.

    The result has the shape (..., 3); where the root in Eq. 30 is not real, balls 2 and 3 are NaN.
    `one_collision_each` tells where the equations hold.  A `ValueError` is raised if a shape is
    wrong or a value is no real number; whether values are in range is not checked.

    Parameters
    ----------
    masses, velocities : array_like, shape (..., 3)
        Masses, kg, above 0, and velocities before the impact, m/s, with v1 > v2 >= v3.
    restitution, ratio : array_like, shapes (..., 2) and (...)
        e2 and e3, and the forward Impulse Correlation Ratio alpha, 0 to 1.

    Examples
    --------
    >>> from cradle.closed_form import three_balls
    >>> three_balls([1, 1, 1], [1, 0, 0], [1, 1], [0.0, 0.5]).round(3)
    array([[ 0.   ,  0.   ,  1.   ],
           [-0.333,  0.667,  0.667]])
    """
    after = _solved(masses, velocities, restitution, ratio)[2]
    return np.stack(np.broadcast_arrays(*after), axis=-1)


def final_impulses(
    masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike, ratio: ArrayLike
) -> tuple[Vector, Vector]:
    """Return the final impulses of `three_balls`, N s, shapes (...) (equations 24 and 30).

    Arguments and errors are those of `three_balls`; where its balls 2 and 3 are NaN, tau_3 is.

    Examples
    --------
    >>> from cradle.closed_form import final_impulses
    >>> final_impulses([1, 1, 1], [1, 0, 0], [1, 1], 0.0)
    (np.float64(1.0), np.float64(1.0))
    """
    return _solved(masses, velocities, restitution, ratio)[:2]


def one_collision_each(
    masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike, ratio: ArrayLike
) -> NDArray[np.bool_]:
    """Tell where three balls collide once per contact, so that equations 30 to 33 hold.

    Contact 2-3 still closes when contact 1-2 ends, ball 2 does not fall back (Eqs. 34, 43, 44).
    Arguments and errors are those of `three_balls`; the answer, shape (...), is False for its NaN.

    Examples
    --------
    >>> from cradle.closed_form import one_collision_each
    >>> one_collision_each([1, 1, 1], [1, 0, 0], [1, 1], [0.1, 0.6])
    array([ True, False])
    """
    return _solved(masses, velocities, restitution, ratio)[3]


def largest_ratios(
    masses: ArrayLike, forward: ArrayLike, backward: ArrayLike
) -> tuple[Vector, Vector]:
    """Largest admissible ratios of a chain, forward (equations 34 and 53) and backward (mirrored).

    With a larger ratio a driven contact would give work without having absorbed any.  The bound at
    a ball depends on the ratio of the next ball in the direction of the drive; at the last inner
    ball there is none: Eq. 34.  Leading axes broadcast; wrong values or shapes are a `ValueError`.

    Parameters
    ----------
    masses : array_like, shape (..., N)
        Masses of two or more balls, kg, above 0.
    forward, backward : array_like, shape (..., N - 2) or ()
        Ratios at the interior balls, 0 to 1; their bounds are returned, each ball's in its place.

    Examples
    --------
    >>> from cradle.closed_form import largest_ratios
    >>> [bound.tolist() for bound in largest_ratios([1, 1, 1, 1], [0.5, 0.5], [0.5, 0.5])]
    [[0.6666666666666666, 0.5], [0.5, 0.6666666666666666]]
    """
    given = {"masses": checked("masses", masses, *ABOVE_ZERO)}
    given |= {"forward": checked("forward", forward, *PART)}
    given |= {"backward": checked("backward", backward, *PART)}
    (m, f, b), _ = shaped(given, (0, 2, 2))

    def bound(m: Vector, ratio: Vector) -> Vector:
        onward = np.zeros(ratio.shape)
        onward[..., :-1] = ratio[..., 1:]
        # A quotient of masses, as their sum could overflow.
        return np.asarray(1.0 / (1.0 + m[..., 1:-1] / m[..., 2:] * (1.0 - onward)))

    return bound(m, f), bound(m[..., ::-1], b[..., ::-1])[..., ::-1]


def back_impact_line(r2: ArrayLike, e2: ArrayLike, e3: ArrayLike, ratio: ArrayLike) -> Vector:
    """Mass ratio r1 = m2/m1 at and below which ball 2 falls back on ball 1 (equation 44, figure 6).

    The arguments broadcast: the mass ratio r2 = m2/m3, at least 0, the restitution of the two
    contacts, e2 at least 1e-30, and the forward ratio, all 0 to 1; others raise a `ValueError`.
    It is NaN where the ratio exceeds its bound (Eq. 34), below 0 if ball 2 cannot fall back.

    Examples
    --------
    >>> from cradle.closed_form import back_impact_line
    >>> float(back_impact_line(1.0, 0.5, 0.5, 0.15).round(4))
    0.8275
    """
    r2, e2 = checked("r2", r2, "must be at least 0", 0.0), checked("e2", e2, *_NO_ZERO)
    e3, ratio = checked("e3", e3, *PART), checked("ratio", ratio, *PART)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(1.0 - ratio * (1.0 + r2))
    return np.asarray((1.0 + e2) * (1.0 + e3 * root) / (e2 * (1.0 + r2)) - (1.0 + ratio / e2))


def first_ball_stops(e2: float, ratio: float) -> float:
    """Mass ratio r1 = m2/m1 at which ball 1 is left at rest (equation 45).

    The restitution of contact 1-2 is 1e-30 to 1, the forward ratio 0 to 1; else a `ValueError`.

    Examples
    --------
    >>> from cradle.closed_form import first_ball_stops
    >>> first_ball_stops(0.5, 0.15)
    1.7
    """
    return (1.0 - one_number("ratio", ratio, *PART)) / one_number("e2", e2, *_NO_ZERO)


def middle_ball_stops(e3: float, ratio: float) -> float:
    """Mass ratio r2 = m2/m3 at which ball 2 is left at rest (equation 46).

    The restitution of contact 2-3 and the forward ratio are 0 to 1; else a `ValueError`.

    Examples
    --------
    >>> from cradle.closed_form import middle_ball_stops
    >>> round(middle_ball_stops(0.5, 0.15), 6)
    0.442608
    """
    e3, ratio = one_number("e3", e3, *PART), one_number("ratio", ratio, *PART)
    half = 0.5 * ratio * e3
    return float(e3 * np.sqrt(1.0 - ratio + half * half) - half * e3)
