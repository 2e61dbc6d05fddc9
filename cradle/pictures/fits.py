"""Figures of fits: the likelihood of a parameter, the data with their predictions."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from cradle.fit.parameters import fitted_keys
from cradle.fit.result import Estimate, Fit
from cradle.fit.search import RISE
from cradle.fit.shots import ShotSet
from cradle.input.values import Vector
from cradle.pictures.impacts import PALETTE, ball_style
from cradle.swinging.record import Swing

_TOP = 25.0  # beyond this a value of chi-square is of no interest
_LEGEND: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.08), "frameon": False}


def draw_fit(fit: Fit, name: str | None, axes: Sequence[Axes] | None) -> Sequence[Axes]:
    """Draw one estimate of a fit and its data; see `Fit.plot`."""
    if not fit.estimates:
        raise ValueError("nothing was fitted; there is nothing to draw")
    estimate = fit[name or min(fit.estimates, key=lambda one: not fit[one].identified)]
    if axes is None:
        _, axes = plt.subplots(2, 1, figsize=(5.6, 7), layout="constrained")
    draw_likelihood(estimate, axes[0])
    data = next(one for one in fit.shots.sets if estimate.key in fitted_keys(one.types))
    _draw_data(fit, data, axes[1])
    return axes


def draw_likelihood(estimate: Estimate, ax: Axes) -> Axes:
    """Draw chi-square above its lowest value, the confidence set and all minima; return `ax`."""
    x, y = estimate.grid, estimate.excess
    cloud = x.size > 2 and bool((np.diff(x) <= 0).any())  # of several parameters
    ax.plot(x, y, "." if cloud else "-", ms=2, lw=2, color=PALETTE[0])
    if estimate.identified:
        for k, (low, high) in enumerate(estimate.intervals):
            ax.axvspan(low, high, color=PALETTE[4], alpha=0.3,
                       label=None if k else "95 % confidence set")  # fmt: skip
    ax.axhline(RISE, color="0.4", lw=1, ls=(0, (6, 2)), label="limit of the set, 3.84")
    modes = [mode for mode in estimate.modes if mode.excess < _TOP]
    ax.plot([m.value for m in modes], [m.excess for m in modes], "v", color=PALETTE[1], ms=8,
            clip_on=False, zorder=5, ls="none", label="minima")  # fmt: skip
    what = f"{estimate.kind} {estimate.name}"
    ax.set(xlim=(0, estimate.bound), ylim=(0, _TOP), xlabel=what,
           ylabel="chi-square above its lowest", title=f"likelihood of {what}")  # fmt: skip
    ax.legend(ncols=3, fontsize="small", **_LEGEND)
    return ax


def _draw_data(fit: Fit, shots: ShotSet, ax: Axes) -> None:
    """Draw measured velocities over the striker's against the striker's, and what is predicted."""
    # Shots that begin alike are predicted by lines, others by a dash each.
    speed = np.abs(shots.before).max(axis=1)
    begins = shots.before / speed[:, np.newaxis]
    predicted = fit.expected(replace(shots, before=begins))
    alike = np.ptp(begins, axis=0).max() < 1e-9
    for k, kind in enumerate(shots.types):
        style = ball_style(k)
        ax.errorbar(speed, shots.after[:, k] / speed, shots.sigma[:, k] / speed, fmt="o", ms=4,
                    color=style["color"], label=f"ball {k + 1} ({kind})", capsize=2)  # fmt: skip
        if predicted is not None and alike:
            ax.axhline(predicted[0, k], lw=1.5, label="_predicted", **style)
        elif predicted is not None:
            ax.plot(speed, predicted[:, k], "_", ms=14, mew=1.5, label="_predicted",
                    color=style["color"])  # fmt: skip
    ax.set(xlabel="speed of the striker (m/s)", ylabel="velocity after / striker's speed",
           title=f"data of set {shots.name}")  # fmt: skip
    ax.legend(ncols=len(shots.types), fontsize="small", **_LEGEND)


def draw_swing(run: Swing, residuals: Vector, axes: Sequence[Axes] | None) -> Sequence[Axes]:
    """Draw a film and the swing fitted to it, and the residuals, m; see `SwingFit.plot`."""
    if axes is None:
        _, axes = plt.subplots(2, 1, figsize=(5.6, 6), layout="constrained", sharex=True)
    times, places, rest = run.times, 1000 * run.positions, 1000 * residuals
    for k in range(len(run.chain)):
        style, x, left = ball_style(k), places[:, k], rest[:, k]
        axes[0].plot(times, x + left, ".", ms=3, color=style["color"])
        axes[0].plot(times, x, lw=1, label=f"ball {k + 1}", **style)
        axes[1].plot(times, left, ".", ms=3, color=style["color"])
    axes[0].set(ylabel="position (mm): film, fit")
    axes[1].set(xlabel="time (s)", ylabel="film less fit (mm)")
    axes[0].legend(ncols=len(run.chain), fontsize="small", **_LEGEND | {"bbox_to_anchor": (0.5, 1)})
    return axes
