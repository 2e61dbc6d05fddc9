"""Moving pictures of swings."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cradle.input.values import Vector, must_be, one_number, whole_number
from cradle.pictures.impacts import PALETTE
from cradle.pictures.keyframes import Animation, Move, moving
from cradle.swinging.record import Swing

__all__ = ["Animation", "animate_swing"]


def animate_swing(
    runs: Swing | Sequence[Swing], labels: Sequence[str] = (), *,
    speed: float = 1.0, still: float = 0.0, columns: int = 1, alt: str = "",
) -> Animation:  # fmt: skip
    """Show one swing or several, one below the other or in columns, by the same clock.

    A run without a duration, another number of labels than of runs, and a number out of range are
    a ValueError.

    Parameters
    ----------
    runs : Swing or sequence of Swing
        Their times are the keyframes, with the impacts in between: twenty in a swing suffice.
    labels, alt : sequence of str, str
        A line of text above each; what the picture shows, for those who do not see it.
    speed : float
        1 plays in real time, less in slow motion.
    still : float
        What print and readers who ask for less motion see, s after the first of the times.
    columns : int
        How many stand side by side.

    Examples
    --------
    >>> from cradle import Chain, ImpulseCorrelation, swing
    >>> run = swing(Chain([1] * 3, [0] * 3), ImpulseCorrelation(0), [-0.03, 0, 0], [0, 0.1, 0.2])
    >>> animate_swing(run).svg.count("@keyframes")
    3
    """
    must_be(str, "alt", alt)
    given = runs if isinstance(runs, Sequence) else [runs]
    several = [must_be(Swing, "runs", run) for run in given]
    words = labels if isinstance(labels, (list, tuple)) else [labels]
    lines = [must_be(str, "labels", line) for line in words]
    duration = min((np.ptp(run.times) for run in several), default=0.0)
    if not duration > 0.0:
        raise ValueError("runs has no swing, or one without a duration")
    if lines and len(lines) != len(several):
        raise ValueError(f"labels has {len(lines)} lines; {len(several)} swings need as many")
    one_number("speed", speed, "must lie in [1e-6, 1e6]", 1e-6, 1e6)
    one_number("still", still)
    beside = min(whole_number("columns", columns), len(several))
    # Side by side they stand closer: the room beside the balls is cut to what the swings need.
    cell = 480.0 if beside == 1 else max(300.0, *(2 * _hung(run)[-1] for run in several))
    high = 178.0 if lines else 164.0
    wide, deep = cell * beside, high * math.ceil(len(several) / beside)
    figure = Figure((wide / 72, deep / 72), dpi=72, facecolor="white")
    ax = figure.add_axes((0, 0, 1, 1), xlim=(0, wide), ylim=(deep, 0))
    ax.set_axis_off()
    moves: list[Move] = []
    for k, run in enumerate(several):
        left, top = k % beside * cell, k // beside * high
        if lines:
            ax.text(left + 12, top + 20, lines[k], size=min(wide / 29, 26), parse_math=False)
        for move in _swing(run, f"s{k}b", ax, (left + cell / 2, top + 34), duration):
            moves.append(move._replace(times=move.times / speed, still=still / speed))
    return moving(figure, moves, alt)


def _hung(run: Swing) -> tuple[float, Vector, Vector, float]:
    """Return a metre, radii, pivots from their middle, and the reach, in units of the file."""
    lengths = run.pendulums.row("length", len(run.chain))
    metre = 105.0 / float(lengths.max())
    # The model needs no sizes: these leave room for the widest swing.
    radii = 17.0 * np.cbrt(run.chain.masses / run.chain.masses.max())
    apart = radii[:-1] + radii[1:] + metre * run.pendulums.row("gaps", len(lengths) - 1)
    pivots = np.concatenate([[0.0], np.cumsum(apart)])
    pivots -= (pivots[-1] + radii[-1] - radii[0]) / 2
    out = metre * np.abs(np.sin(run.positions / lengths) * lengths).max()
    return metre, radii, pivots, float(pivots[-1] + radii[-1] + out + 10.0)


def _swing(
    run: Swing, name: str, ax: Axes, place: tuple[float, float], duration: float
) -> Iterator[Move]:
    """Draw a swing below the middle of its beam, and how each ball turns about its pivot."""
    # Between two of the times an impact is a kink: it needs a keyframe of its own.
    times = np.array([*run.times, *(hit.time for hit in run.impacts)]) - run.times[0]
    rows = [k for k in np.argsort(times, kind="stable") if 0.0 <= times[k] <= duration]
    places = np.vstack([run.positions, *(hit.positions for hit in run.impacts)])[rows]
    lengths = run.pendulums.row("length", len(run.chain))
    angles = -np.degrees(places / lengths)  # positive turns what hangs to the left
    metre, radii, pivots, _ = _hung(run)
    (middle, beam), size = place, min(ax.get_xlim()[1] / 29, 26)
    look: dict[str, Any] = {"marker": "o", "markevery": [1], "mfc": "#f2f2f2", "mew": 2.5}
    for ball, x in enumerate((middle + pivots).tolist()):
        y = beam + lengths[ball] * metre
        look |= {"mec": PALETTE[ball % len(PALETTE)], "ms": 2 * radii[ball] - 2.5}
        hanging = ax.plot([x, x], [beam, y], "#555", lw=1, clip_on=False, **look)
        parts = [*hanging, ax.text(x, y + size / 3, f"{ball + 1}", size=size, ha="center")]
        yield Move(f"{name}{ball}", parts, times[rows], angles[:, ball], (x, beam))
    ends = middle + pivots[[0, -1]] + [-30, 30]
    ax.plot(ends, [beam, beam], "#333", lw=4, solid_capstyle="butt", clip_on=False)
