"""Velocities of balls around an impact, from their positions or from heights."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cradle.fit.shots import Track
from cradle.input.values import Vector, checked, one_number

_GRAVITY = 9.81


class Velocities(NamedTuple):
    """Velocities of all balls around an impact, from their tracks.

    Attributes
    ----------
    time : float
        When the impact happened, s.
    before, after, sigma, sigma_before : ndarray, shape (N,)
        m/s; ball by ball, with standard errors.
    scatter : float
        Standard deviation of the marks about the motion fitted, m.
    """

    time: float
    before: Vector
    after: Vector
    sigma: Vector
    sigma_before: Vector
    scatter: float


def speeds_from_heights(
    heights: ArrayLike, sigma: float, gravity: float = _GRAVITY
) -> tuple[Vector, Vector]:
    """Turn drop or rise heights of hanging balls into velocities, as the paper did.

    Parameters
    ----------
    heights : array_like
        Heights above the lowest point, m; negative for a ball that swings to the left.
    sigma : float
        Standard error of a height, m.
    gravity : float
        m/s^2.

    Returns
    -------
    velocities, sigma : ndarray
        m/s, shapes of `heights`; the error is that towards larger speeds, and so finite at rest.

    Raises
    ------
    ValueError
        If a value is not finite, or the error or gravity not above 0.

    Examples
    --------
    >>> [values.round(3).tolist() for values in speeds_from_heights([0.051, 0.0], 0.001)]
    [[1.0, 0.0], [0.01, 0.14]]
    """
    h = checked("heights", heights)
    error = one_number("sigma", sigma, "must be above 0", 0.0, open_low=True)
    g = one_number("gravity", gravity, "must be above 0", 0.0, open_low=True)
    speed = np.sqrt(2 * g * np.abs(h))
    return np.sign(h) * speed, np.sqrt(2 * g * (np.abs(h) + error)) - speed


def velocities_from_tracks(
    tracks: Mapping[str, Track],
    *,
    length: float | None = None,
    window: float = 0.05,
    striker: int = 0,
    scatter: float | None = None,
) -> Velocities:
    """Find the impact in the tracks, and the velocities just before and just after it.

    All tracks bend at one moment, which is found first.  Then the velocity of each ball is fitted
    on either side of it by itself, so that the errors are independent.  The balls but the striker
    rest before.

    Parameters
    ----------
    tracks : mapping of str to Track
        One track a ball, left to right.
    length : float, optional
        Length of the pendulums, m; left out, the balls roll on a level track.
    window : float
        How much time before and after the impact is used, s.
    striker : int
        Index of the ball that moves before.
    scatter : float, optional
        Standard deviation of a mark, m, known from many shots; left out, that of these tracks.

    Returns
    -------
    Velocities

    Raises
    ------
    ValueError
        If there are fewer than two balls, or too few marks on either side.

    Notes
    -----
    A pendulum that passes its lowest point with velocity v is then, with w = g/l, u = (v/l)^2, at
    v t (1 - (w + u) t^2/6 + (w^2 + 11 w u + u^2) t^4/120) up to terms in t^7.

    Examples
    --------
    >>> from cradle.fit import read_tracker
    >>> from cradle.tables import data_folder
    >>> tracks = read_tracker(data_folder() / "video_synthetic.txt")
    >>> velocities_from_tracks(tracks, length=0.3).sigma.round(3).tolist()
    [0.009, 0.009, 0.009]
    """
    balls = list(tracks.values())
    if len(balls) < 2 or not 0 <= striker < len(balls):
        raise ValueError(f"{len(balls)} tracks, striker = {striker}; needs two balls and a striker")
    window = one_number("window", window, "must be above 0", 0.0, open_low=True)
    if length is not None:
        length = one_number("length", length, "must be above 0", 0.0, open_low=True)
    time = _coarse_time(balls, striker, window)
    for _ in range(3):  # the window moves with the moment that is found in it
        used = _window(tracks, time, window)
        time, places = _moment(used, time, length, striker)
    if (np.diff(places) <= 0).any():
        raise ValueError(
            f"the balls meet at {places.round(4).tolist()} m; the tracks must be in the order of "
            "the balls, left to right"
        )
    found = _velocities(used, time, length, striker)
    if scatter is None:
        return found
    ratio = one_number("scatter", scatter, "must be above 0", 0.0, open_low=True) / found.scatter
    return found._replace(sigma=ratio * found.sigma, sigma_before=ratio * found.sigma_before)


def _window(tracks: Mapping[str, Track], time: float, window: float) -> list[Track]:
    """Return the marks near the impact; there must be some on either side."""
    used = []
    for name, track in tracks.items():
        near = np.abs(track.times - time) <= window
        times = track.times[near]
        sides = [int((times < time).sum()), int((times >= time).sum())]
        if min(sides) < 5:
            raise ValueError(
                f"track {name!r} has {sides[0]} marks before and {sides[1]} after the impact at "
                f"{time:.4g} s within window = {window:g} s; needs 5 on each side"
            )
        used.append(Track(times, track.positions[near]))
    return used


def _coarse_time(balls: list[Track], striker: int, window: float) -> float:
    """Return the moment at which a bend in all tracks explains most."""
    moments = np.unique(np.concatenate([ball.times for ball in balls]))
    best, most = None, -np.inf
    for moment in 0.5 * (moments[:-1] + moments[1:]):
        near = [np.abs(ball.times - moment) <= window for ball in balls]
        marks = [(ball.times[some] - moment, ball.positions[some])
                 for ball, some in zip(balls, near, strict=True)]  # fmt: skip
        if any(min((t < 0).sum(), (t >= 0).sum()) < 4 for t, _ in marks):
            continue
        gain = 0.0
        for k, (t, x) in enumerate(marks):
            earlier, later = np.minimum(t, 0.0), np.maximum(t, 0.0)
            bent = [later, later**2] + [earlier, earlier**2] * (k == striker)
            gain += _rest([t, t**2], x) - _rest(bent, x)
        if gain > most:
            best, most = float(moment), gain
    if best is None:
        raise ValueError(f"no moment has 4 marks of every ball within {window:g} s on either side")
    return best


def _rest(columns: list[Vector], x: Vector) -> float:
    """Return the sum of squares that columns and a constant leave of x."""
    matrix = np.stack([np.ones(x.size), *columns], axis=-1)
    left = x - matrix @ np.linalg.lstsq(matrix, x, rcond=None)[0]
    return float(left @ left)


def _motion(t: Vector, velocity: float, length: float | None) -> Vector:
    """Return the way from the place of the impact."""
    if length is None:
        return velocity * t
    w, u = _GRAVITY / length, (velocity / length) ** 2
    bend = -(w + u) * t**2 / 6 + (w * w + 11 * w * u + u * u) * t**4 / 120
    return np.asarray(velocity * t * (1 + bend))


def _moment(
    balls: list[Track], time: float, length: float | None, striker: int
) -> tuple[float, Vector]:
    """Return the moment of the impact and the balls' places then: all tracks meet there."""
    from scipy.optimize import least_squares

    count = len(balls)

    def residuals(p: Vector) -> Vector:
        parts = []
        for k, ball in enumerate(balls):
            t = ball.times - p[0]
            way = _motion(np.maximum(t, 0.0), p[2 + count + k], length)
            if k == striker:
                way = way + _motion(np.minimum(t, 0.0), p[1], length)
            parts.append(ball.positions - p[2 + k] - way)
        return np.concatenate(parts)

    def line(ball: Track, some: NDArray[np.bool_]) -> Vector:
        return np.asarray(np.polyfit(ball.times[some] - time, ball.positions[some], 1))

    lines = np.transpose([line(ball, ball.times >= time) for ball in balls])
    before = line(balls[striker], balls[striker].times < time)[0]
    start = np.concatenate([[time, before], lines[1], lines[0]])
    found = least_squares(residuals, start, x_scale="jac").x
    return float(found[0]), found[2 : 2 + count]


def _slope(t: Vector, x: Vector, length: float | None) -> tuple[float, float, float]:
    """Return velocity at time 0, its variance over that of a mark, and the squares left over.

    The place is free: the velocities of different balls and sides have independent errors.
    """
    velocity = float(np.polyfit(t, x, 1)[0])
    for _ in range(4):  # the way depends a little on the velocity itself
        way = t if length is None else _motion(t, velocity, length) / velocity
        matrix = np.stack([np.ones(t.size), way], axis=-1)
        solution = np.linalg.lstsq(matrix, x, rcond=None)[0]
        velocity = float(solution[1]) or np.finfo(float).tiny
    left = x - matrix @ solution
    return velocity, float(np.linalg.inv(matrix.T @ matrix)[1, 1]), float(left @ left)


def _velocities(balls: list[Track], time: float, length: float | None, striker: int) -> Velocities:
    """Fit the velocity of every ball on its own, on either side of the impact."""
    velocities, variances = np.zeros((2, 2, len(balls)))
    squares, freedom = 0.0, 0
    for k, ball in enumerate(balls):
        t = ball.times - time
        # The moment is known to a part of a frame: a mark nearer than half a frame may be of
        # either side, and is left out.
        near = 0.5 * float(np.median(np.diff(t)))
        sides = {1: t > near, 0: t < -near} if k == striker else {1: t > near}
        for side, some in sides.items():
            velocities[side, k], variances[side, k], left = _slope(
                t[some], ball.positions[some], length
            )
            squares, freedom = squares + left, freedom + int(some.sum()) - 2
    scatter = float(np.sqrt(squares / freedom))
    (before, after), (sigma_before, sigma) = velocities, scatter * np.sqrt(variances)
    return Velocities(time, before, after, sigma, sigma_before, scatter)
