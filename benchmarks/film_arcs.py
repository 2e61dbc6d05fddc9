"""Arcs of pendulums through the places of filmed balls, and the velocities at the strikes.

Rows of a table: frame, release, ball from 1, x, y, blur (pixels), misfit (grey levels), visible
part.  The pivots, the length and the rate were fitted to all arcs of the film at once.
"""

import itertools
import warnings

import numpy as np
from scipy.optimize import least_squares

# Release (balls lifted): first strike, half period, first and last frame without the hand.
RELEASES = {
    1: (171.26, 12.86, 158, 300),
    2: (419.31, 12.81, 406, 522),
    3: (703.57, 12.81, 690, 884),
}
STRIKERS = {1: {5: 53.5}, 2: {4: 43.5, 5: 44.5}, 3: {3: 42.0, 4: 43.0, 5: 44.0}}  # a first guess
REST = np.array([603.46, 655.08, 706.36, 758.31, 810.06])  # under the pivots, frame 60
PIVOT = np.array([103.1, 105.1, 104.4, 105.1, 105.3])
LENGTH, RATE = 411.9, 0.2480  # to the centre of a ball; of small swings, radians a frame
EXPOSURE = 0.47  # of a frame


def pendulum(start, t, steps=100):
    """Return angle and rate of a free pendulum t frames after (angle, rate); leapfrog."""
    y, v, h = np.full(t.shape, start[0]), np.full(t.shape, start[1]), t / steps
    for _ in range(steps):
        v = v - h / 2 * RATE**2 * np.sin(y)
        y = y + h * v
        v = v - h / 2 * RATE**2 * np.sin(y)
    return y, v


def arc(rows, ball, at, slope=0.06):
    """Return (angle, rate) at a time, their errors, how many frames; None from one."""
    if len(rows) < 2:
        return None
    t, x, y = rows[:, 0] - at, rows[:, 3] - REST[ball], rows[:, 4] - PIVOT[ball]
    sigma = 0.25 + slope * rows[:, 5]  # a fast ball is a smear
    basis = np.column_stack([np.cos(RATE * t), np.sin(RATE * t) / RATE])
    start = np.linalg.lstsq(basis, x / LENGTH, rcond=None)[0]

    def residual(p):
        angle = pendulum(p, t)[0]
        across, down = LENGTH * np.sin(angle) - x, LENGTH * np.cos(angle) - y
        return np.concatenate([across / sigma, down / (3 * sigma)])

    fit = least_squares(residual, start, loss="soft_l1")
    off = np.abs(residual(fit.x)[: len(t)])
    if 2 <= (off < 4).sum() < len(t):
        return arc(rows[off < 4], ball, at, slope)
    return fit.x, np.sqrt(np.diag(np.linalg.pinv(fit.jac.T @ fit.jac))), len(t)


def chosen(table, release, ball, after, before, visible):
    """Return the rows of a ball between two times that can be trusted."""
    t, use = table[:, 0], (table[:, 1] == release) & (table[:, 2] == ball + 1)
    use &= (t > after + 0.24) & (t < before - 0.24)
    return table[use & (table[:, 6] < 25) & (table[:, 7] > visible)]


def strikes(table, release, times, window=12.5, slope=0.06, late=0.0):
    """Return angle, rate and its error of each strike, ball, before and after; (S, 5, 2, 3)."""
    out = np.full((len(times), 5, 2, 3), np.nan)
    for s, at in enumerate(times + late):
        last, _, then = np.pad(times, 1, constant_values=(-np.inf, np.inf))[s : s + 3]
        sides = (max(at - window, last), at), (at, min(at + window, then))
        for k, (side, between) in itertools.product(range(5), enumerate(sides)):
            seen = 0.35 if s == side == 0 else 0.6
            fit = arc(chosen(table, release, k, *between, seen), k, at, slope)
            if fit is not None:
                out[s, k, side] = *fit[0], fit[1][1]
    return out


def crossing(table, release, times):
    """Return the times where the arcs before and after each strike meet."""
    for _ in range(4):
        angle, rate, _ = np.moveaxis(strikes(table, release, times), 3, 0)
        step, gain = LENGTH * (np.sin(angle[..., 0]) - np.sin(angle[..., 1])), rate * LENGTH
        gain = np.where(np.isfinite(step), gain[..., 1] - gain[..., 0], 0)
        gain[np.abs(gain) < 8] = 0
        late = np.nansum(np.where(gain, step, 0) * gain, 1) / np.maximum((gain**2).sum(1), 1)
        times = times + np.clip(late, -0.3, 0.3)
    return times


def predict(i, release, times, arcs):
    """Return the guess (5, 3) of a frame from the arcs; a hidden ball goes with its neighbour."""
    s, guess = np.searchsorted(times, i) - 1, np.full((5, 3), np.nan)
    for k in range(5):
        at, start = times[max(s, 0)], arcs[max(s, 0), k, 1, :2].copy()
        near = k + 1 if s % 2 == 0 else k - 1
        if s < 0:
            speed = STRIKERS[release].get(k + 1, 0.0)
            first = min(STRIKERS[release]) - 1  # hangs where its arc after the strike begins
            hang = REST[first] + LENGTH * np.sin(arcs[0, first, 1, 0]) + 51.6 * (k - first)
            begins = (hang - REST[k]) / LENGTH if speed or np.isnan(start[0]) else start[0]
            start = np.array([begins, -speed / LENGTH])
        elif np.isnan(start[0]) and 0 <= near < 5:
            start = arcs[s, near, 1, :2]
        y, v = pendulum(start, np.array([i - at]))
        x = REST[k] + LENGTH * np.sin(y[0]), PIVOT[k] + LENGTH * np.cos(y[0])
        guess[k] = *x, EXPOSURE * abs(v[0]) * LENGTH
    return guess


def summary(release, reads):
    """Yield a row per strike and ball; velocities along the strike, over the striker's."""
    balls = np.arange(5)
    with np.errstate(invalid="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a ball that was never seen is nan
        means, spreads = np.nanmean(reads[..., 0], 0), np.nanstd(reads[..., 0], 0)
    for s, mean in enumerate(means):
        mean = mean * (-1) ** (s + 1)
        error = np.sqrt(reads[0, s, ..., 1] ** 2 + spreads[s] ** 2 + 0.04**2 + (0.005 * mean) ** 2)
        striking = balls >= 5 - release if s % 2 == 0 else balls < release
        total = mean[:, 1].sum() - mean[~striking, 0].sum()
        total_error = np.sqrt((error[:, 1] ** 2).sum() + (error[~striking, 0] ** 2).sum())
        speed = np.append(mean[striking, 0], total / release)
        sigma = np.append(error[striking, 0], total_error / release)
        weight = np.where(np.isfinite(speed), sigma, np.inf) ** -2.0
        if not weight.sum():
            continue
        unit = np.nansum(speed * weight) / weight.sum()
        own = weight.sum() ** -0.5 / unit
        for k in balls:
            values = np.stack([mean[k], np.hypot(error[k], own * mean[k])], 1).ravel() / unit
            numbers = ["" if np.isnan(x) else f"{x + 0.0:.4f}" for x in values]
            yield [release, s + 1, k + 1, int(striking[k]), f"{unit:.2f}", *numbers]
