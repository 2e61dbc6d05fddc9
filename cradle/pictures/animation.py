"""Moving pictures of an impact, drawn by matplotlib, and of a swing; see `keyframes`."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from html import escape
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Rectangle
from matplotlib.text import Text

from cradle.input.values import Vector, must_be, one_number, whole_number
from cradle.pictures.impacts import PALETTE, velocities, velocity_impulse
from cradle.pictures.keyframes import KEY, SEEN, Animation, Move, number, with_style
from cradle.swinging.record import Swing
from cradle.trace import Trace

__all__ = ["Animation", "animate", "animate_swing"]

# Seconds of the flight before the impact, of the impact, of the flight after it, and of a rest.
_ACTS = (1.5, 5.0, 2.0, 1.5)


def animate(trace: Trace, contact: int | None = None, *, alt: str = "") -> Animation:
    """Show an impact in slow motion: the balls, and their velocities being drawn.

    The balls fly in.  Then the clock stands still, for an impact takes no time: the diagram grows
    with the impulses, a star marks each contact that is pressed, and the bars on the balls are
    their velocities at that point of the diagram.  At last the balls fly off.

    Parameters
    ----------
    trace : Trace
        The impact.
    contact : int, optional
        Draw this contact's velocity-impulse diagram.  If left out, the velocities of all balls
        against the sum of all impulses.
    alt : str
        What the picture shows, for those who do not see it.

    Returns
    -------
    Animation
        The still shows the whole diagram, and the velocities after the impact.

    Examples
    --------
    >>> from cradle import Chain, ImpulseCorrelation, collide
    >>> trace = collide(Chain([1, 1, 1], [1, 0, 0], 1), ImpulseCorrelation(0.15))
    >>> animate(trace).save("impact.svg")  # doctest: +SKIP
    """
    must_be(Trace, "trace", trace)
    must_be(str, "alt", alt)
    with mpl.rc_context({"svg.hashsalt": "cradle", "svg.fonttype": "path", "font.size": 10}):
        # At 72 dots an inch, points of the figure are units of the file.
        figure = Figure(figsize=(6.4, 5.4), dpi=72, layout="constrained", facecolor="white")
        row, diagram = figure.subplots(2, 1, height_ratios=[1, 2.6])
        centres = _draw_balls(trace, row)
        impulses, _ = trace.curve()
        if contact is None:
            velocities(trace, diagram)
            along, shown = impulses.sum(axis=1), range(len(trace.chain))
        else:
            velocity_impulse(trace, contact, diagram)
            along, shown = impulses[:, contact], range(contact, contact + 2)
        x, y = diagram.get_xlim(), diagram.get_ylim()
        cover = Rectangle((x[0], y[0]), x[1] - x[0], y[1] - y[0], fc="white", alpha=0.9, zorder=4)
        cover.set_gid(f"{KEY}cover")
        diagram.add_patch(cover)
        for ball in shown:
            (dot,) = diagram.plot(
                along[-1], trace.velocities[ball], "o", ms=9, mfc="white",
                mec=PALETTE[ball % len(PALETTE)], mew=2.5, zorder=6, clip_on=False,
            )  # fmt: skip
            dot.set_gid(f"{KEY}dot{ball}")
        diagram.set(xlim=x, ylim=y)
        file, nothing = io.StringIO(), dict.fromkeys(("Creator", "Date", "Format", "Type"))
        figure.savefig(file, format="svg", metadata=nothing)
    moves = tuple(_impact_moves(trace, centres, (row, diagram), along, shown))
    style = "".join(move.css() for move in moves)
    return Animation(with_style(file.getvalue(), style, alt), figure, moves)


def _draw_balls(trace: Trace, ax: Axes) -> Vector:
    """Draw the balls as they touch, a star on each contact, and a bar of unit length on each."""
    radii = 0.5 * np.cbrt(trace.chain.masses / trace.chain.masses.max())
    centres = np.cumsum(2 * radii) - radii
    for ball, (x, radius) in enumerate(zip(centres.tolist(), radii.tolist(), strict=True)):
        colour = PALETTE[ball % len(PALETTE)]
        parts: list[tuple[str, Any]] = [
            ("ball", ax.add_patch(Circle((x, 0), radius, fc="0.95", ec=colour, lw=2))),
            ("ballname", ax.text(x, -0.02, f"{ball + 1}", ha="center", va="center", size=12)),
            ("bar", ax.add_patch(Rectangle((x, 0.68), 1, 0.1, fc=colour, ec="none"))),
            ("tip", ax.add_patch(Circle((x, 0.73), 0.09, fc="white", ec=colour, lw=2))),
        ]
        for name, part in parts:
            part.set_gid(f"{KEY}{name}{ball}")
    for contact, x in enumerate((centres + radii)[:-1].tolist()):
        (star,) = ax.plot(x, 0, "*", ms=15, mfc="#F0E442", mec="black", mew=0.8, zorder=5)
        star.set_gid(f"{KEY}star{contact}")
    reach = 2.6
    ax.set(xlim=(-reach, centres[-1] + radii[-1] + reach), ylim=(-0.6, 0.95), aspect="equal")
    ax.set_axis_off()
    return np.asarray(centres)


def _impact_moves(
    trace: Trace, centres: Vector, axes: tuple[Axes, Axes], along: Vector, shown: Sequence[int]
) -> Iterator[Move]:
    """Yield how all move, at each point of the curves, and at the ends of the flights."""
    row, diagram = axes
    before, slow, after, rest = _ACTS
    impulses, path = trace.curve()
    points, done = len(path), impulses.sum(axis=1)
    share = done / done[-1] if done[-1] else np.linspace(0, 1, points)
    times = np.concatenate(
        [[0.0], before + slow * share, [before + slow + after, sum(_ACTS[:3]) + rest]]
    )
    index = np.clip(np.arange(-1, points + 2), 0, points - 1)
    still = points  # the end of the impact
    # Where each ball is drawn, in units of the file: it moves in the flights alone.
    unit = float(row.transData.transform((1, 0))[0] - row.transData.transform((0, 0))[0])
    per_speed = 1.9 / (float(np.abs(trace.path[[0, -1]]).max()) or 1.0)
    come = 0.0 if (trace.chain.closing_speeds < 0.0).any() else -per_speed
    shift = np.zeros((len(times), len(trace.chain)))
    shift[0] = come * unit * trace.path[0]
    shift[-2:] = per_speed * unit * trace.velocities
    shift[-1] = shift[-2]
    bar = 0.95 / (float(np.abs(path).max()) or 1.0)  # diameters of the largest ball, for 1 m/s
    places = row.transData.transform(np.column_stack([centres, np.full(len(centres), 0.73)]))
    for ball, centre in enumerate(places[:, 0].tolist()):
        x, v = shift[:, ball], path[index, ball] * bar
        for name, values in (("ball", x), ("ballname", x), ("tip", x + unit * v)):
            yield Move(
                f"{KEY}{name}{ball}", times, values[:, None], "translateX({}px)", 0.03, still
            )
        both, form = np.column_stack([x, v]), "translateX({}px) scaleX({})"
        yield Move(f"{KEY}bar{ball}", times, both, form, 0.001, still, (centre, 0.0))
    # The diagram: dots on the curves, and a cover that draws back to the right.
    curves = np.dstack(np.broadcast_arrays(along[:, None], path))
    drawn = diagram.transData.transform(curves.reshape(-1, 2)).reshape(curves.shape)
    for ball in shown:
        way = (drawn[:, ball] - drawn[-1, ball]) * [1, -1]
        yield Move(f"{KEY}dot{ball}", times, way[index], "translate({}px,{}px)", 0.03, still)
    box, height = diagram.bbox, row.get_figure().bbox.height  # type: ignore[union-attr]
    hidden = (box.x1 - drawn[index, 0, 0]) / box.width
    hidden[still + 1 :] = 0.0  # beyond the last point too
    edge = float(box.x1), float(height)
    yield Move(f"{KEY}cover", times, hidden[:, None], "scaleX({})", 0.0005, still + 1, edge)
    # A star is seen while the impulse of its contact grows.
    lit = np.zeros((len(times), impulses.shape[1]))
    lit[1:points] = np.diff(impulses, axis=0) > 0.0
    for contact in range(impulses.shape[1]):
        yield Move(f"{KEY}star{contact}", times, lit[:, contact, None], SEEN, 0.0, 0)


def animate_swing(
    runs: Swing | Sequence[Swing],
    labels: Sequence[str] = (),
    *,
    speed: float = 1.0,
    still: float = 0.0,
    columns: int = 1,
    alt: str = "",
) -> Animation:
    """Show one swing or several, one below the other or in columns, by the same clock.

    Parameters
    ----------
    runs : Swing or sequence of Swing
        Their times are the keyframes, with the impacts in between: twenty in a swing suffice.
    labels : sequence of str
        A line of text above each.
    speed : float
        1 plays in real time, less in slow motion.
    still : float
        Which instant stands still in print and for readers who ask for less motion, s after the
        first of the times.
    columns : int
        How many stand side by side, from left to right and from top to bottom.
    alt : str
        What the picture shows, for those who do not see it.

    Returns
    -------
    Animation
        The picture.

    Raises
    ------
    ValueError
        If a run has no duration, there are not as many labels as runs, `speed` or `still` is out
        of range, or `columns` is no whole number above 0.

    Examples
    --------
    >>> from cradle import Chain, ImpulseCorrelation, swing
    >>> balls = Chain([1] * 5, [0] * 5, 1)
    >>> run = swing(balls, ImpulseCorrelation(0), [-0.03, 0, 0, 0, 0], np.linspace(0, 4, 161))
    >>> animate_swing(run).svg.count("@keyframes")
    5
    """
    must_be(str, "alt", alt)
    given = runs if isinstance(runs, Sequence) else [runs]
    several = [must_be(Swing, "runs", run) for run in given]
    duration = min((np.ptp(run.times) for run in several), default=0.0)
    if not duration > 0.0:
        raise ValueError("runs has no swing, or one without a duration")
    given_lines = labels if isinstance(labels, (list, tuple)) else [labels]
    lines = [must_be(str, "labels", line) for line in given_lines]
    if lines and len(lines) != len(several):
        raise ValueError(f"labels has {len(lines)} lines; {len(several)} swings need as many")
    one_number("speed", speed, "must lie in [1e-6, 1e6]", 1e-6, 1e6)
    one_number("still", still)
    beside = min(whole_number("columns", columns), len(several))
    swings = [
        _draw_swing(run, f"{KEY}s{k}b", duration, speed, still) for k, run in enumerate(several)
    ]
    # Side by side they stand closer: the room beside the balls is cut to what the swings need, and
    # letters are larger, for a page shows the whole smaller.
    cell = 480.0 if beside == 1 else max(300.0, *(2 * one.half_width for one in swings))
    edge, letters = 240.0 - cell / 2, 15 if beside == 1 else 20
    rows, places, top, lines = [], [], 0.0, lines or [""] * len(several)
    for first in range(0, len(several), beside):
        heights = []
        for k, one in enumerate(swings[first : first + beside]):
            places.append((k * cell - edge, top))
            text, place = escape(lines[first + k]), " ".join(map(number, places[-1]))
            if text:
                text = f'<text x="{number(edge + 12)}" y="20" font-size="{letters}">{text}</text>'
            rows.append(f'<g transform="translate({place})">{text}{one.svg}</g>')
            heights.append(one.height + (14 if text else 0))
        top += max(heights)
    size = f'width="{number(cell * beside)}" height="{number(top)}"'
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {number(cell * beside)} '
        f'{number(top)}" {size} font-family="sans-serif"><rect {size} fill="white"/>'
        f"{''.join(rows)}</svg>"
    )
    style = "".join(move.css() for one in swings for move in one.moves)
    figure, moves = Figure((cell * beside / 72, top / 72), dpi=72), []
    wide, high = figure.bbox.size
    for line, (x, y), one in zip(lines, places, swings, strict=True):
        box = x / wide, 1 - (y + one.height) / high, 480 / wide, one.height / high
        ax = figure.add_axes(box, xlim=(0, 480), ylim=(one.height, 0))
        ax.set_axis_off()
        ax.text(edge + 12, 20, line, size=letters, parse_math=False)
        for artist in one.artists:
            ax.add_artist(artist)
        for move in one.moves:
            moves.append(move._replace(origin=(move.origin[0] + x, move.origin[1] + y)))
    return Animation(with_style(svg, style, alt), figure, tuple(moves))


class _Drawn(NamedTuple):
    """A swing's picture, twice, and how it moves, in units of the file."""

    svg: str
    artists: list[Artist]
    moves: list[Move]
    height: float
    #: How far the balls reach from the middle, with a margin.
    half_width: float


def _draw_swing(run: Swing, name: str, duration: float, speed: float, still: float) -> _Drawn:
    lengths = run.pendulums.row("length", len(run.chain))
    scale = 105.0 / float(lengths.max())  # units of the file in a metre
    # Ball sizes are free: the model needs none.  Here they leave room for the widest swing.
    radii = 17.0 * np.cbrt(run.chain.masses / run.chain.masses.max())
    gaps = run.pendulums.row("gaps", len(lengths) - 1) * scale
    pivots = np.concatenate([[0.0], np.cumsum(radii[:-1] + radii[1:] + gaps)])
    pivots += 240.0 - (pivots[0] - radii[0] + pivots[-1] + radii[-1]) / 2
    row_width = pivots[-1] + radii[-1] - pivots[0] + radii[0]
    out = np.abs(np.sin(run.positions / lengths) * lengths).max() * scale
    beam = 34.0
    low = beam + 105.0 + float(radii.max()) + 8.0
    inside = (run.times > run.times[0]) & (run.times <= run.times[0] + duration)
    hits = [hit for hit in run.impacts if 0.0 < hit.time - run.times[0] < duration]
    # Between two of the times an impact is a kink: it needs a keyframe of its own.
    times = np.array([0.0, *run.times[inside], *(hit.time for hit in hits)])
    times[1:] -= run.times[0]
    places = np.vstack([run.positions[:1], run.positions[inside], *(hit.positions for hit in hits)])
    order = np.argsort(times, kind="stable")
    times, places = times[order], places[order]
    row = int(np.argmin(np.abs(times - still)))
    drawn, artists, moves = [], [], []
    for ball, (x, length, radius) in enumerate(zip(pivots, lengths, radii, strict=True)):
        y, part, colour = beam + length * scale, f"{name}{ball}", PALETTE[ball % len(PALETTE)]
        drawn.append(
            f'<g id="{part}"><path d="M{number(x)} {beam}V{number(y - radius)}" stroke="#555"/>'
            f'<circle cx="{number(x)}" cy="{number(y)}" r="{number(radius - 1.25)}" '
            f'fill="#f2f2f2" stroke-width="2.5" stroke="{colour}"/>'
            f'<text x="{number(x)}" y="{number(y + 5)}" font-size="14" '
            f'text-anchor="middle">{ball + 1}</text></g>'
        )
        # A positive angle of SVG turns what hangs to the left.
        angle = -np.degrees(places[:, ball] / length)
        turned = part, times / speed, angle[:, None], "rotate({}deg)", 0.1, row
        moves.append(Move(*turned, (float(x), beam)))
        artists += [
            Line2D([x, x], [beam, y - radius], color="#555", lw=1, gid=part),
            Circle((x, y), radius - 1.25, fc="#f2f2f2", ec=colour, lw=2.5, gid=part),
            Text(x, y + 5, f"{ball + 1}", fontsize=14, ha="center", gid=part),
        ]
    ends = pivots[0] - 30, pivots[-1] + 30
    drawn.append(
        f'<path d="M{number(ends[0])} {beam}H{number(ends[1])}" stroke="#333" stroke-width="4"/>'
    )
    artists.append(Line2D(ends, [beam, beam], color="#333", lw=4, solid_capstyle="butt"))
    return _Drawn("".join(drawn), artists, moves, low, float(row_width / 2 + out + 10.0))
