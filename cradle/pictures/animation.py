"""Moving pictures of an impact and of swings."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from cradle.input.values import Vector, must_be, one_number, whole_number
from cradle.pictures.impacts import PALETTE, velocities, velocity_impulse
from cradle.pictures.keyframes import SEEN, SHIFT, STRETCH, TURN, Animation, Move, moving
from cradle.swinging.record import Swing
from cradle.trace import Trace

__all__ = ["Animation", "animate", "animate_swing"]

_END = 6.5  # of an impact in slow motion, s; the instant of the still


@mpl.rc_context({"font.size": 12, "legend.columnspacing": 1, "legend.handletextpad": 0.5})
def animate(trace: Trace, contact: int | None = None, *, alt: str = "") -> Animation:
    """Show an impact in slow motion: the balls, and their velocities being drawn.

    The balls fly in.  Then the clock stands still, for an impact takes no time: the diagram grows
    with the impulses, a star marks each contact that is pressed, and the bars on the balls are
    their velocities at that point of the diagram.  At last the balls fly off.  The still shows the
    end of the impact.  The diagram is the velocity-impulse diagram of `contact`, or if it is left
    out the velocities of all balls; `alt` says what the picture shows to those who do not see it.

    Examples
    --------
    >>> from cradle import collide, paper_chain
    >>> animate(collide(*paper_chain("AAA"))).save("impact.svg")  # doctest: +SKIP
    """
    must_be(Trace, "trace", trace)
    must_be(str, "alt", alt)
    figure = Figure(figsize=(4.8, 4.8), dpi=72, layout="constrained", facecolor="white")
    row, diagram = figure.subplots(2, 1, height_ratios=[1, 2.6])
    impulses, path = trace.curve()
    done = impulses.sum(axis=1)
    progress = done / done[-1] if done[-1] else np.linspace(0, 1, len(done))
    # A flight of 1.5 s, the impact, a flight of 2 s, and a rest.
    times = np.concatenate([[0.0], 1.5 + (_END - 1.5) * progress, [_END + 2.0, _END + 3.5]])
    impulses, path = (np.pad(rows, ((1, 2), (0, 0)), "edge") for rows in (impulses, path))
    moves = [*_balls(trace, row, times, impulses, path)]
    moves += _diagram(trace, contact, diagram, times, impulses, path)
    return moving(figure, moves, alt)


def _balls(trace: Trace, ax: Axes, times: Vector, impulses: Vector, path: Vector) -> Iterator[Move]:
    """Draw the balls as they touch, their velocities as bars, and a star on each contact."""
    # The balls move in the flights alone; bars are in diameters of the largest one.
    radii = 0.5 * np.cbrt(trace.chain.masses / trace.chain.masses.max())
    centres = np.cumsum(2 * radii) - radii
    ax.set(xlim=(-2.6, centres[-1] + radii[-1] + 2.6), ylim=(-0.6, 0.95), aspect="equal")
    ax.set_axis_off()
    per_speed = 1.9 / (float(np.abs(path[[0, -1]]).max()) or 1.0)
    flown = np.zeros(path.shape)
    if not (trace.chain.closing_speeds < 0.0).any():
        flown[0] = -per_speed * path[0]
    flown[-2:] = per_speed * path[-1]
    bars = 0.95 * path / (float(np.abs(path).max()) or 1.0)
    for ball, (x, radius) in enumerate(zip(centres.tolist(), radii.tolist(), strict=True)):
        colour, way, bar = PALETTE[ball % len(PALETTE)], flown[:, ball], bars[:, ball]
        disk = ax.add_patch(Circle((x, 0), radius, fc="0.95", ec=colour, lw=2))
        name = ax.text(x, -0.02, f"{ball + 1}", ha="center", va="center", size=12)
        line = ax.add_patch(Rectangle((x, 0.68), 1, 0.1, fc=colour, ec="none"))
        tip = ax.add_patch(Circle((x, 0.73), 0.09, fc="white", ec=colour, lw=2))
        along, end = np.column_stack([way, 0 * way]), np.column_stack([way + bar, 0 * way])
        yield Move(f"ball{ball}", [disk, name], times, along, SHIFT, _END)
        yield Move(f"tip{ball}", [tip], times, end, SHIFT, _END)
        both = np.column_stack([way, bar])
        yield Move(f"bar{ball}", [line], times, both, STRETCH, _END, (x, 0.0))
    # A star is seen while the impulse of its contact grows.
    lit = np.diff(impulses, axis=0, append=impulses[-1:]) > 0.0
    for contact, x in enumerate((centres + radii)[:-1].tolist()):
        star = ax.plot(x, 0, "*", ms=13, mfc="#F0E442", mec="black", mew=0.8, zorder=5)
        yield Move(f"star{contact}", star, times, lit[:, [contact]].astype(float), SEEN, _END)


def _diagram(
    trace: Trace, contact: int | None, ax: Axes, times: Vector, impulses: Vector, path: Vector
) -> Iterator[Move]:
    """Draw the diagram, dots on its curves, and a cover that draws back to the right."""
    if contact is None:
        velocities(trace, ax)
        along, shown = impulses.sum(axis=1), range(len(trace.chain))
    else:
        velocity_impulse(trace, contact, ax)
        along, shown = impulses[:, contact], range(contact, contact + 2)
    (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
    cover = ax.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fc="white", alpha=0.9, zorder=4))
    hidden = (x1 - along) / (x1 - x0)
    hidden[-2:] = 0.0  # beyond the last point too
    values = np.column_stack([0 * hidden, hidden])
    yield Move("cover", [cover], times, values, STRETCH, float(times[-1]), (x1, 0.0))
    ring: dict[str, Any] = {"ms": 9, "mfc": "white", "mew": 2.5, "zorder": 6, "clip_on": False}
    for ball in shown:
        curve = np.column_stack([along, path[:, ball]])
        dot = ax.plot(*curve[-1:].T, "o", mec=PALETTE[ball % len(PALETTE)], **ring)
        yield Move(f"dot{ball}", dot, times, curve - curve[-1], SHIFT, _END)
    ax.set(xlim=(x0, x1), ylim=(y0, y1))


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
    return moving(figure, moves, alt, "px")


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
        yield Move(f"{name}{ball}", parts, times[rows], angles[:, [ball]], TURN, 0.0, (x, beam))
    ends = middle + pivots[[0, -1]] + [-30, 30]
    ax.plot(ends, [beam, beam], "#333", lw=4, solid_capstyle="butt", clip_on=False)
