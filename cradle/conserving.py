"""The outcomes of three balls that keep momentum and energy: an arc, and the angle on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from cradle.chain import Chain
from cradle.input.values import Vector, checked

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
