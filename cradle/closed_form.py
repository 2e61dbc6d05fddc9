"""In closed form: one collision per contact, largest ratios, pattern lines, kept energy.

Notation of the equations: balls 1, 2, 3 with masses m1, m2, m3; contact impulses tau_2 (balls 1-2)
and tau_3 (balls 2-3), restitution e2 and e3; alpha is the forward ratio at ball 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cradle.chain import Chain
from cradle.input.values import Vector, checked, numbers, one_number
from cradle.kernel.state import LIMITS

_Balls = tuple[Vector, ...]
#: What is asked of a restitution that divides.
_NO_ZERO = (f"must lie in [{LIMITS.least_restitution}, 1]", LIMITS.least_restitution, 1.0)


def _split(
    masses: ArrayLike, velocities: ArrayLike, restitution: ArrayLike, ratio: ArrayLike
) -> tuple[_Balls, _Balls, _Balls, Vector]:
    """Check shapes; return masses, velocities and restitution one by one, and the ratio."""
    given = {
        "masses": numbers("masses", masses),
        "velocities": numbers("velocities", velocities),
        "restitution": numbers("restitution", restitution),
    }
    for name, array in given.items():
        size = 2 if name == "restitution" else 3
        if array.shape[-1:] != (size,):
            words = "one number for each of " + ("3 balls" if size == 3 else "their 2 contacts")
            raise ValueError(f"{name} has shape {array.shape}; must be (..., {size}): {words}")
    m, v, e = (tuple(array[..., k] for k in range(array.shape[-1])) for array in given.values())
    alpha = numbers("ratio", ratio)
    try:
        np.broadcast_shapes(m[0].shape, v[0].shape, e[0].shape, alpha.shape)
    except ValueError:
        shapes = [f"{name} {array.shape}" for name, array in {**given, "ratio": alpha}.items()]
        raise ValueError(f"leading axes do not broadcast: {', '.join(shapes)}") from None
    return m, v, e, alpha


def _impulses(m: _Balls, v: _Balls, e: _Balls, alpha: Vector) -> tuple[Vector, Vector, Vector]:
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
        Velocities after the impact, m/s.  NaN where the radical of Eq. 30 is not real or an input
        is NaN; see `one_collision_each` for where the result applies.  The ranges above are not
        checked, which would take longer than the formulas: outside them the result has no meaning.

    Raises
    ------
    ValueError
        If a value is no number, or a shape is wrong.

    References
    ----------
    Ceanga and Hurmuzlu (2001), Eqs. 22, 24, 26, 28, 30, 31-33.

    Examples
    --------
    >>> three_balls([1, 1, 1], [1, 0, 0], [1, 1], [0.0, 0.5]).round(3)
    array([[ 0.   ,  0.   ,  1.   ],
           [-0.333,  0.667,  0.667]])
    """
    m, v, e, alpha = _split(masses, velocities, restitution, ratio)
    _, tau_2, tau_3 = _impulses(m, v, e, alpha)
    return np.stack(np.broadcast_arrays(*_after(m, v, tau_2, tau_3)), axis=-1)


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
        N s; tau_3 is NaN where the velocities of `three_balls` are.

    Raises
    ------
    ValueError
        As `three_balls`.

    References
    ----------
    Ceanga and Hurmuzlu (2001), Eqs. 22, 24, 28, 30.

    Examples
    --------
    >>> final_impulses([1, 1, 1], [1, 0, 0], [1, 1], 0.0)
    (np.float64(1.0), np.float64(1.0))
    """
    _, tau_2, tau_3 = _impulses(*_split(masses, velocities, restitution, ratio))
    return tau_2, tau_3


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
        False where the result of `three_balls` is NaN.

    Raises
    ------
    ValueError
        As `three_balls`.

    References
    ----------
    Ceanga and Hurmuzlu (2001), Eqs. 34, 43, 44.

    Examples
    --------
    >>> one_collision_each([1, 1, 1], [1, 0, 0], [1, 1], [0.1, 0.6])
    array([ True, False])
    """
    m, v, e, alpha = _split(masses, velocities, restitution, ratio)
    gain, tau_2, tau_3 = _impulses(m, v, e, alpha)
    v1, v2, _ = _after(m, v, tau_2, tau_3)
    still_closes = alpha * (m[1] + m[2]) * gain <= (gain + (v[1] - v[2])) * m[2]
    return np.asarray(still_closes & (v1 <= v2))


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

    References
    ----------
    Ceanga and Hurmuzlu (2001), Eqs. 34 and 53; the mirrored bound is not printed there.

    Examples
    --------
    >>> [bound.tolist() for bound in largest_ratios([1, 1, 1, 1], [0.5, 0.5], [0.5, 0.5])]
    [[0.6666666666666666, 0.5], [0.5, 0.6666666666666666]]
    """
    m = numbers("masses", masses)
    if not m.ndim or m.shape[-1] < 2:
        raise ValueError(f"masses has shape {m.shape}; must be (..., N) with N >= 2")
    # The quick test of good values first: every impact asks for its bounds.
    if m.size and not (m.min() > 0.0 and m.max() < np.inf):
        checked("masses", m, "must be above 0", 0.0, open_low=True)
    f, b = numbers("forward", forward), numbers("backward", backward)
    size = m.shape[-1] - 2
    for name, ratio in (("forward", f), ("backward", b)):
        if ratio.shape[-1:] != (size,):
            raise ValueError(
                f"{name} has shape {ratio.shape}; must be (..., {size}) for {size + 2} balls: one "
                "number for each ball between two others"
            )
        if ratio.size and not (ratio.min() >= 0.0 and ratio.max() <= 1.0):
            checked(name, ratio, "must lie in [0, 1]", 0.0, 1.0)

    def bound(m: Vector, ratio: Vector) -> Vector:
        onward = np.zeros(ratio.shape)
        onward[..., :-1] = ratio[..., 1:]
        # A quotient of masses, as their sum could overflow.
        return np.asarray(1.0 / (1.0 + m[..., 1:-1] / m[..., 2:] * (1.0 - onward)))

    return bound(m, f), bound(m[..., ::-1], b[..., ::-1])[..., ::-1]


def back_impact_line(r2: ArrayLike, e2: ArrayLike, e3: ArrayLike, ratio: ArrayLike) -> Vector:
    """Mass ratio r1 = m2/m1 at and below which ball 2 falls back on ball 1 (Eq. 44).

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
        If a value is wrong; the message names the value and the rule.

    References
    ----------
    Ceanga and Hurmuzlu (2001), Eq. 44 and Fig. 6 (its legend says Eq. 47).

    Examples
    --------
    >>> float(back_impact_line(1.0, 0.5, 0.5, 0.15).round(4))
    0.8275
    """
    r2 = checked("r2", r2, "must be at least 0", 0.0)
    e2 = checked("e2", e2, *_NO_ZERO)
    e3 = checked("e3", e3, "must lie in [0, 1]", 0.0, 1.0)
    ratio = checked("ratio", ratio, "must lie in [0, 1]", 0.0, 1.0)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(1.0 - ratio * (1.0 + r2))
    return np.asarray((1.0 + e2) * (1.0 + e3 * root) / (e2 * (1.0 + r2)) - (1.0 + ratio / e2))


def first_ball_stops(e2: float, ratio: float) -> float:
    """Mass ratio r1 = m2/m1 at which ball 1 is left at rest (Eq. 45).

    Parameters
    ----------
    e2 : float
        Restitution of contact 1-2, 1e-30 to 1.
    ratio : float
        Forward ratio, 0 to 1.

    Returns
    -------
    float
        r1.

    Raises
    ------
    ValueError
        If a value is wrong; the message names the value and the rule.

    References
    ----------
    Ceanga and Hurmuzlu (2001), Eq. 45.

    Examples
    --------
    >>> first_ball_stops(0.5, 0.15)
    1.7
    """
    e2 = one_number("e2", e2, *_NO_ZERO)
    return (1.0 - one_number("ratio", ratio, "must lie in [0, 1]", 0.0, 1.0)) / e2


def middle_ball_stops(e3: float, ratio: float) -> float:
    """Mass ratio r2 = m2/m3 at which ball 2 is left at rest (Eq. 46).

    Parameters
    ----------
    e3 : float
        Restitution of contact 2-3, 0 to 1.
    ratio : float
        Forward ratio, 0 to 1.

    Returns
    -------
    float
        r2.

    Raises
    ------
    ValueError
        If a value is wrong; the message names the value and the rule.

    References
    ----------
    Ceanga and Hurmuzlu (2001), Eq. 46.

    Examples
    --------
    >>> round(middle_ball_stops(0.5, 0.15), 6)
    0.442608
    """
    e3 = one_number("e3", e3, "must lie in [0, 1]", 0.0, 1.0)
    ratio = one_number("ratio", ratio, "must lie in [0, 1]", 0.0, 1.0)
    half = 0.5 * ratio * e3
    return float(e3 * np.sqrt(1.0 - ratio + half * half) - half * e3)


_Three = tuple[float, float, float]


def conserving_outcomes(
    masses: ArrayLike, velocities: ArrayLike, angles: ArrayLike | None = None
) -> tuple[Vector, Vector]:
    """Return all outcomes of three balls that keep momentum, energy and the order of the balls.

    With s = v2 - v1, and w the velocity of ball 3 relative to the centre of mass of balls 1 and 2,
    momentum leaves s and w free, and energy the circle ``mu s^2 + M w^2 = const``; mu and M are the
    reduced masses.  v1 <= v2 <= v3 leaves an arc of it, from v1 = v2, angle 0, to v2 = v3 at
    ``arccos((m1 m3 / ((m1 + m2) (m2 + m3)))^(1/2))``, 60 degrees for equal balls.

    Parameters
    ----------
    masses, velocities : array_like, shape (3,)
        kg, and m/s before the impact.
    angles : array_like, shape (K,), optional
        Angles on the arc, rad; 181 from end to end if left out.

    Returns
    -------
    angles : ndarray, shape (K,)
        rad.
    velocities : ndarray, shape (K, 3)
        m/s.

    Raises
    ------
    ValueError
        If there are not three balls, a value is wrong, or an angle is off the arc.

    References
    ----------
    Walkiewicz and Newby, Am. J. Phys. 40 (1972) 133-137.

    Examples
    --------
    >>> angles, outcomes = conserving_outcomes([1, 1, 1], [1, 0, 0])
    >>> outcomes[[0, -1]].round(3) + 0.0
    array([[ 0.   ,  0.   ,  1.   ],
           [-0.333,  0.667,  0.667]])
    """
    m, v = _three(masses, velocities)
    m1, m2, m3 = m
    first, second = m1 / (m1 + m2), m2 / (m1 + m2)
    full = float(np.arctan2(*_polar(m, 1.0, first)))  # there v2 = v3
    if angles is None:
        angle = np.linspace(0.0, full, 181)
    else:
        angle = checked("angles", angles, f"must lie in [0, {full:.6g}]", 0.0, full)
    s, w, pair = _relative(m, v)
    radius, (one, other) = np.hypot(*_polar(m, s, w)), _polar(m, 1.0, 1.0)
    s_after = radius * np.sin(angle) / one
    # cos(angle) as what is missing to v2 = v3: near 90 degrees it has few digits itself.
    w_after = first * s_after + radius * (np.sin(full - angle) / np.sin(full)) / other
    pair = pair + m3 / (m1 + m2 + m3) * (w - w_after)
    balls = [pair - second * s_after, pair + first * s_after, pair + w_after]
    return angle, np.stack(balls, axis=-1)


def conserving_angle(masses: ArrayLike, velocities: ArrayLike) -> float:
    """Return the angle, in rad, of an outcome on the arc of `conserving_outcomes`.

    The angle is negative, or beyond the end of the arc, where the balls are not in order.

    Parameters
    ----------
    masses, velocities : array_like, shape (3,)
        kg, and m/s after the impact.

    Returns
    -------
    float
        The angle; 0 for balls that all have one velocity.

    Examples
    --------
    >>> from math import degrees
    >>> round(degrees(conserving_angle([1, 1, 1], [-1 / 3, 2 / 3, 2 / 3])), 6)
    60.0
    """
    m, v = _three(masses, velocities)
    s, w, _ = _relative(m, v)
    return float(np.arctan2(*_polar(m, s, w)))


def _three(masses: ArrayLike, velocities: ArrayLike) -> tuple[_Three, _Three]:
    """Return masses, in units in which no sum overflows, and velocities of three balls."""
    chain = Chain(masses, velocities)
    if len(chain) != 3:
        raise ValueError(f"masses has shape ({len(chain)},); must be (3,): three balls")
    m1, m2, m3 = np.ldexp(chain.masses, -int(np.frexp(chain.masses.max())[1])).tolist()
    v1, v2, v3 = chain.velocities.tolist()
    return (m1, m2, m3), (v1, v2, v3)


def _relative(m: _Three, v: _Three) -> _Three:
    """Return the velocities of ball 2 from ball 1, of ball 3 from these two, and of these two."""
    s = v[1] - v[0]
    pair = v[0] + m[1] / (m[0] + m[1]) * s
    return s, v[2] - pair, pair


def _polar(m: _Three, s: float, w: float) -> tuple[float, float]:
    """Return s and w times the roots of their reduced masses: sine and cosine of the arc."""
    m1, m2, m3 = m
    mu, both = m1 / (m1 + m2) * m2, m3 / (m1 + m2 + m3) * (m1 + m2)
    return np.sqrt(mu) * s, np.sqrt(both) * w
