"""Velocities of balls around an impact, from their positions."""

import warnings
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import scipy

from cradle.fit.tracks import Track
from cradle.input import values as asked
from cradle.input.values import ABOVE_ZERO, Vector, checked, must_be, one_number, whole_number
from cradle.trace import compared_as_objects

_GRAVITY = 9.81
_LEAST, _LONGEST = 5, 0.25  # marks on each side of the impact; window on a level track, s
_CHANCE = 1e-5  # part of right films that is refused, because their marks happen to bend
_Stray = tuple[int, float, float]


@compared_as_objects
class Velocities(NamedTuple):
    """Velocities of N balls just before and just after an impact, from their tracks."""

    time: float  #: When the impact happened, s.
    before: Vector  #: Velocities before the impact, shape (N,), m/s.
    after: Vector  #: Velocities after the impact, shape (N,), m/s.
    sigma: Vector  #: Standard errors of `after`, shape (N,), m/s.
    sigma_before: Vector  #: Standard errors of `before`, shape (N,), m/s.
    scatter: float  #: Standard deviation of the marks about the motion fitted, m.
    window: float  #: How much time on either side was used, s.
    probability: float  #: Chance that marks are off at least as much if the motion fitted is right.
    #: Marks off by more than chance allows, each as (ball, from 0; time, s; how far off, m).
    strays: tuple[_Stray, ...] = ()


def velocities_from_tracks(
    tracks: Mapping[str, Track], *, length: float | None = None, window: float | None = None,
    striker: int | Sequence[int] | None = None, scatter: float | None = None,
) -> Velocities:  # fmt: skip
    """Find the impact in the tracks, and the velocities just before and just after it.

    First the moment is fitted at which all tracks bend, then the velocity of each ball by itself on
    either side of it, so that the errors are independent.  Before the impact all balls that do not
    strike must rest.  A mark farther off than chance allows is named in a warning.  Fewer than two
    balls, times that do not rise, too few marks on either side, and marks that do not lie on such a
    motion raise a ValueError (of right films, one in a hundred thousand is refused).

    Parameters
    ----------
    tracks : mapping of str to Track
        One track for each ball, left to right, from one origin.
    length, scatter : float, optional
        Length of the pendulums, m (none: balls that roll on a level track); standard deviation of
        a mark, m, if it is known from many shots (else that of these tracks is taken).
    window : float, optional
        How much time before and after the impact is used, s.  If left out, the longest one that the
        marks agree with: at most a quarter of a swing, or a quarter of a second on a track.
    striker : int or sequence of int, optional
        Index of the ball that moves first, or of several, as (0, 1); else the one that moves most.

    Examples
    --------
    >>> from cradle.fit import read_tracker, velocities_from_tracks
    >>> from cradle.tables import data_folder
    >>> tracks = read_tracker(data_folder() / "video_synthetic.txt")
    >>> velocities_from_tracks(tracks, length=0.3, window=0.05).sigma.round(3).tolist()
    [0.009, 0.009, 0.009]
    """
    tracks = {name: Track(*checked(f"tracks[{name!r}]", ball))
              for name, ball in must_be(Mapping, "tracks", tracks).items()}  # fmt: skip
    balls = list(tracks.values())
    if len(balls) < 2:
        raise ValueError(f"{len(balls)} tracks; needs two balls and more")
    some = striker if isinstance(striker, Sequence) else [] if striker is None else [striker]
    last = len(balls) - 1
    movers = [whole_number("striker", k, f"from 0 to {last}", 0, last) for k in some]
    given = {"length": length, "window": window, "scatter": scatter}
    length, window, scatter = (None if value is None else one_number(name, value, *ABOVE_ZERO)
                               for name, value in given.items())  # fmt: skip
    for name, (t, x) in tracks.items():
        asked.refuse_where(f"times of {name}", t, np.diff(t, prepend=-np.inf) <= 0.0, "must rise")
        if t.size < _LEAST:
            raise ValueError(f"track {name!r} has {t.size} marks; needs {_LEAST} and more")
        if length is not None and (span := float(np.ptp(x))) > 2.0 * length:
            told = f"track {name!r} spans {span:.3g} m, more than a pendulum of {length:g} m"
            raise ValueError(f"{told}; say the unit of the positions")
    frame = max(float(np.median(np.diff(ball.times))) for ball in balls)
    least = window or max(0.05, (_LEAST + 0.5) * frame)
    coarse, movers = _coarse(balls, movers, least)
    longest = _LONGEST if length is None else 0.5 * np.pi * float(np.sqrt(length / _GRAVITY))
    tried = [window or max(longest, least)]
    for away in (ball.times - coarse for ball in balls):  # frames may be missing
        for side in (-away[away < 0], away[away >= 0]):
            least = max(least, float(np.sort(side)[:_LEAST][-1]) + 0.5 * frame)
    while 0.8 * tried[-1] >= least:
        tried.append(0.8 * tried[-1])
    fits = list[Velocities]()
    for wide in tried:
        fits.append(_around(tracks, coarse, wide, length, movers))
        if fits[-1].probability > (0.2 if fits[1:] else 0.01):
            break
    first, found, k = fits[0], fits[-1], len(fits) - 1
    # Three windows on, what bends the marks is not yet seen: a bias falls as the window to the
    # power 3.5.  Without so many the shortest will do if chance may have bent the longest.
    safe = not k or k + 3 < len(tried)
    if k and found.window > (wide := tried[k + 3] if safe else tried[-1]):
        found = _around(tracks, coarse, wide, length, movers)
    refused = found.probability < _CHANCE or not (safe or first.probability >= _CHANCE)
    wrong = "; ".join(f"the mark of {list(tracks)[ball]} at {moment:.4g} s is off by {off:.2g} m"
                      for ball, moment, off in (first if refused else found).strays)  # fmt: skip
    if refused:
        rather = "are length and frame rate right, is there one impact, are all strikers named"
        told = f"window = {tried[0]:.3g} s; the marks bend otherwise than by such a motion: if the "
        told += f"balls hang, {rather if length else 'give their length'}; else give a shorter"
        raise ValueError(f"{told} window{wrong and '; or '}{wrong}")
    fastest = float(np.abs([found.before, found.after]).max())
    if length is not None and fastest > 2.0 * np.sqrt(_GRAVITY * length):  # over the top
        raise ValueError(f"{fastest:.3g} m/s is unlikely; see time_scale")
    if wrong:
        warnings.warn(f"{wrong}: more than chance allows", stacklevel=2)
    ratio = 1.0 if scatter is None else scatter / found.scatter
    sigma, sigma_before = ratio * found.sigma, ratio * found.sigma_before
    if not safe:  # what the window changes is added
        sigma = np.hypot(sigma, found.after - first.after)
        sigma_before = np.hypot(sigma_before, found.before - first.before)
    return found._replace(sigma=sigma, sigma_before=sigma_before)


def _coarse(balls: list[Track], movers: list[int], window: float) -> tuple[float, list[int]]:
    """Return the moment at which a bend in all tracks explains most, and who moves before."""
    moments = np.unique(np.concatenate([ball.times for ball in balls]))
    best, most = None, -np.inf
    for moment in 0.5 * (moments[:-1] + moments[1:]):
        near = (np.abs(ball.times - moment) <= window for ball in balls)
        marks = [(t[some] - moment, x[some]) for (t, x), some in zip(balls, near, strict=True)]
        if any(min((t < 0).sum(), (t >= 0).sum()) < 4 for t, _ in marks):
            continue
        gain, moved = 0.0, []
        for t, x in marks:
            earlier, later = np.minimum(t, 0.0), np.maximum(t, 0.0)
            still = _rest([later, later**2], x)
            gain += _rest([t, t**2], x) - still
            moved.append(still - _rest([later, later**2, earlier, earlier**2], x))
        first = movers or [int(np.argmax(moved))]
        if (gain := gain + sum(moved[k] for k in first)) > most:
            best, most = (float(moment), first), gain
    if best is None:
        raise ValueError(f"no moment has 4 marks of every ball within {window:g} s on either side")
    return best


def _rest(columns: Sequence[Vector], x: Vector) -> float:
    """Return the sum of squares that columns and a constant leave of x."""
    matrix = np.stack([np.ones(x.size), *columns], axis=-1)
    left = x - matrix @ np.linalg.lstsq(matrix, x, rcond=None)[0]
    return float(left @ left)


def _way(t: Vector, velocity: float, length: float | None) -> Vector:
    """Return the way from the place of the impact, of a ball with the velocity v there."""
    # Along the row a pendulum goes (v/w) sn(w t) dn(w t) from its lowest point, with Jacobi's
    # functions of modulus k = v/(2 w l), w^2 = g/l.
    if length is None:
        return velocity * t
    w = np.sqrt(_GRAVITY / length)
    sn, _, dn, _ = scipy.special.ellipj(w * t, min(1.0, (0.5 * velocity / (w * length)) ** 2))
    return np.asarray(velocity * sn * dn / w)


def _around(
    tracks: Mapping[str, Track], time: float, window: float, length: float | None, movers: list[int]
) -> Velocities:
    """Fit the moment in a window, then every ball on its own, place free, on either side of it."""
    for _ in range(3):  # the window moves with the moment that is found in it
        used = []
        for name, (t, x) in tracks.items():
            near = np.abs(t - time) <= window
            marks = int((near & (t < time)).sum()), int((near & (t >= time)).sum())
            if min(marks) < _LEAST:
                told = f"{marks[0]} marks before and {marks[1]} after the impact at {time:.4g} s"
                told += f" within window = {window:g} s; needs {_LEAST} on each side"
                told += " (if several balls were lifted, name all strikers)" * (len(movers) == 1)
                raise ValueError(f"track {name!r} has {told}")
            used.append(Track(t[near], x[near]))
        time, places = _moment(used, time, length, movers)
    if (np.diff(places) <= 0).any():
        rule = "in the order of the balls, left to right, all from one origin, x to the right"
        told = f"the balls meet at {(0.0 + places.round(4)).tolist()} m"
        raise ValueError(f"{told}; the tracks must be {rule}")
    velocities, variances = np.zeros((2, 2, len(used)))
    squares, freedom, bent, bends, sides = 0.0, 0, 0.0, 0, []
    for k, ball in enumerate(used):
        t = ball.times - time
        # A mark nearer than half a frame may be of either side, and is left out.
        half = 0.5 * float(np.median(np.diff(t)))
        for side, some in enumerate([t > half, t < -half]):
            times, x, v = t[some], ball.positions[some], 0.0
            if side and k not in movers:
                sides.append((k, ball.times[some], times, x))
                continue
            for _ in range(12):  # Newton's steps: how a wide swing bends depends on its velocity
                left = x - _way(times, v, length)
                change = _way(times, v + 1e-4, length) - _way(times, v - 1e-4, length)
                off = (change - change.mean()) / 2e-4
                v += off @ left / (off @ off)
            sides.append((k, ball.times[some], off, left))
            velocities[side, k], variances[side, k] = v, 1.0 / (off @ off)
            squares, freedom = squares + _rest([off], left), freedom + x.size - 2
            # What would be left if the way could bend otherwise too.
            bent, bends = bent + _rest([off, times**2, times**3], left), bends + 2
    scatter = float(np.sqrt(squares / freedom))
    # Marks without scatter, as of a computed motion, leave rounding alone, and no question.
    exact, chance = 1e-5 * max(float(np.ptp(ball.positions)) for ball in used), 1.0
    if scatter >= exact and bent and (spare := freedom - bends) > 0:
        chance = float(scipy.special.fdtrc(bends, spare, (squares - bent) / bends * spare / bent))
    (after, before), (sigma, sigma_before) = velocities, scatter * np.sqrt(variances)
    strays = _strays(sides, exact)
    return Velocities(time, before, after, sigma, sigma_before, scatter, window, chance, strays)


def _moment(
    balls: list[Track], time: float, length: float | None, movers: list[int]
) -> tuple[float, Vector]:
    """Return the moment of the impact and the balls' places then: all tracks meet there."""
    end = 1 + 2 * len(balls)

    def residuals(p: Vector) -> Vector:  # moment, velocity after and place of each, then before
        ways = zip(balls, p[1:end].reshape(-1, 2), strict=True)
        left = [x - at - _way(np.maximum(t - p[0], 0.0), v, length) for (t, x), (v, at) in ways]
        for k, v in zip(movers, p[end:], strict=True):
            left[k] -= _way(np.minimum(balls[k].times - p[0], 0.0), v, length)
        return np.concatenate(left)

    lines = [np.polyfit(t[t >= time] - time, x[t >= time], 1) for t, x in balls]
    sides = [(t[t < time] - time, x[t < time]) for t, x in (balls[k] for k in movers)]
    begin = [time, *np.ravel(lines), *(np.polyfit(t, x, 1)[0] for t, x in sides)]
    found = scipy.optimize.least_squares(residuals, begin, x_scale="jac").x
    return float(found[0]), found[2:end:2]


def _strays(sides: list[tuple[int, Vector, Vector, Vector]], exact: float) -> tuple[_Stray, ...]:
    """Return the mark of each side that chance does not explain, if any: `Velocities.strays`."""
    # A side has its ball, times, and what bends with the velocity and is left of the positions.
    worst = []
    for k, times, column, left in sides:
        q = np.linalg.qr(np.stack([np.ones_like(left), column], axis=-1))[0]
        left, free = left - q @ (q.T @ left), 1.0 - (q**2).sum(axis=-1)
        at = int(np.argmax(left**2 / free))  # without this mark the squares fall by so much
        gain, spare = left[at] ** 2 / free[at], max(left.size - 3, 1)
        others = max(left @ left - gain, 0.0) / spare
        worst.append((k, times[at], abs(left[at] / free[at]), gain, others, spare))
    balls, moments, off, gains, variances, freedom = map(np.array, zip(*worst, strict=True))
    some = variances > exact**2  # marks of balls at rest may be equal
    usual = np.average(variances[some], weights=freedom[some]) if some.any() else np.inf
    beyond = np.sqrt(gains / np.maximum(usual, variances))
    chance = 2 * sum(one[1].size for one in sides) * scipy.special.stdtr(freedom.sum(), -beyond)
    odd = chance < _CHANCE
    return tuple(zip(balls[odd].tolist(), moments[odd].tolist(), off[odd].tolist(), strict=True))
