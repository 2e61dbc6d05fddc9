"""Moving pictures of swings: drawn by matplotlib, parts that turn by keyframes in CSS.

The solver's own events are the keyframes, and between them a browser interpolates linearly: the
motion is exact to a tenth of a degree, sharp at any size, and a few kilobytes long.  A style sheet,
unlike SMIL, also gives the still to paper and to readers who ask for less motion.
"""

import io
import math
import zlib
from bisect import insort
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D

from cradle.input.values import Vector, must_be, one_number, whole_number
from cradle.pictures.impacts import PALETTE
from cradle.swinging.record import Swing

#: Pictures a second of a film; a GIF counts hundredths of a second.
RATE = 25
_OFF = 0.1  # degrees by which straight lines between keyframes may be off
# Before the name of every moving part, until a key of the picture's own takes its place: in a page
# the names of all pictures share one space.
_KEY = "moving-part-"
_STYLE_OF_ALL = '<style type="text/css">*{stroke-linejoin: round; stroke-linecap: butt}</style>'


def animate_swing(
    runs: Swing | Sequence[Swing], labels: Sequence[str] = (), *,
    speed: float = 1.0, still: float = 0.0, columns: int = 1, alt: str = "",
) -> "Animation":  # fmt: skip
    """Show one swing or several, one below the other or in columns, by the same clock.

    A run of no duration, other than one label a run, and a wrong number raise a ValueError.

    Parameters
    ----------
    runs : Swing or sequence of Swing
        Their times and impacts are the keyframes: twenty times in each swing suffice.
    labels, alt : sequence of str, str
        A line of text above each run; and what the picture shows, for those who do not see it.
    speed : float
        1 plays in real time, less in slow motion.
    still : float
        The moment that print shows, and readers who ask for less motion; s after the first time.
    columns : int
        How many runs stand side by side.

    Examples
    --------
    >>> from cradle import Chain, ImpulseCorrelation, swing
    >>> from cradle.pictures.animation import animate_swing
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
    return _moving(figure, moves, alt)


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
) -> "Iterator[Move]":
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


@dataclass(frozen=True)
class Animation:
    """A moving picture: its text `svg`, and a `figure` of matplotlib with the `moves` of its parts.

    A notebook shows it with a box to tick for a pause.  Put the text itself into a web page: an
    image file would not stop for print or for readers who ask for less motion.
    """

    svg: str
    figure: Figure = field(repr=False, compare=False)
    moves: "tuple[Move, ...]" = field(repr=False, compare=False)

    def _repr_html_(self) -> str:
        key = f"p{zlib.crc32(self.svg.encode()):08x}"
        return (
            f'<div class="animation"><style>#{key}:checked ~ svg * {{ animation-play-state: paused '
            f"!important }}\n@media print, (prefers-reduced-motion: reduce) {{ .{key} {{ display: "
            f'none }} }}</style><input type="checkbox" id="{key}" class="{key}">'
            f'<label for="{key}" class="{key}"> pause</label><br>{self.svg}</div>'
        )

    def __repr__(self) -> str:
        return f"Animation({len(self.svg.encode()) / 1000:.0f} kB)"

    def save(self, path: str | Path) -> None:
        """Write a file by the end of its name: .svg, .html, .gif, .mp4, or .png for the still.

        Another end, or a film that needs a program that is missing, raises a ValueError.
        """
        file = Path(path)
        kind = file.suffix.lower()
        if kind in (".svg", ".html"):
            page = f"<!doctype html>\n<meta charset='utf-8'>\n{self._repr_html_()}\n"
            file.write_text(page if kind == ".html" else self.svg, encoding="utf-8")
        elif kind == ".png":
            self.show(None)
            self.figure.savefig(file, dpi=144)
        elif kind not in (".gif", ".mp4"):
            raise ValueError(f"path = {str(path)!r}; must end in .svg, .html, .gif, .mp4 or .png")
        elif kind == ".mp4" and not FFMpegWriter.isAvailable():
            raise ValueError(f"{file} needs the program ffmpeg, which is not here; .gif does not")
        else:
            writer, dpi = (PillowWriter, 72) if kind == ".gif" else (FFMpegWriter, 144)
            count = max(1, round(RATE * max(float(move.times[-1]) for move in self.moves)))
            show: Any = self.show
            film = FuncAnimation(self.figure, show, np.arange(count) / RATE)
            film.save(file, writer(RATE), dpi=dpi)

    def show(self, time: float | None) -> None:
        """Bring every part of the figure to where it is at a time, s; None is the still."""
        for move in self.moves:
            angle = move.at(move.still if time is None else time)
            for artist in move.artists:
                turn = Affine2D().rotate_deg_around(*move.origin, angle)
                artist.set_transform(turn + artist.axes.transData)


class Move(NamedTuple):
    """How artists turn together about a point, in the data units of their axes."""

    part: str
    artists: Sequence[Any]
    times: Vector  # s
    angles: Vector  # degrees, one at each time
    origin: tuple[float, float]
    still: float = 0.0  # the time of the still, s

    def at(self, time: float) -> float:
        """Return the angle at a time, s."""
        return float(np.interp(time, self.times, self.angles))

    def css(self) -> str:
        """Return the style of the part: where it rests, and its keyframes; a point is a px."""
        ax, name, times = self.artists[0].axes, f"{_KEY}{self.part}", self.times
        x, y = ax.transData.transform(self.origin).tolist()
        frames = (f"{_number(100 * times[k] / times[-1])}%{{{_turned(self.angles[k])}}}"
                  for k in _thin(times, self.angles))  # fmt: skip
        about = f"transform-origin:{_number(x)}px {_number(ax.figure.bbox.height - y)}px"
        moves = f"animation:{name} {_number(times[-1])}s linear infinite"
        rest = f"[id^={name}-]{{{_turned(self.at(self.still))};{about};{moves}}}"
        return f"{rest}\n@keyframes {name}{{{' '.join(frames)}}}\n"


def _thin(times: Vector, angles: Vector) -> list[int]:
    """Return the rows that straight lines need to stay within the tolerance."""
    rows = [0, len(times) - 1]
    while True:
        off = np.abs(angles - np.interp(times, times[rows], angles[rows]))
        off[rows] = 0.0
        if off.max() <= _OFF:
            return rows
        insort(rows, int(off.argmax()))


def _turned(angle: float) -> str:
    return f"transform:rotate({_number(angle)}deg)"


def _number(value: float) -> str:
    """Return a number as CSS, to a thousandth."""
    return f"{round(value, 3) + 0.0:.7g}"  # no -0


def _moving(figure: Figure, moves: Sequence[Move], alt: str) -> Animation:
    """Return a figure of 72 dots an inch as a picture that moves."""
    for move in moves:
        for k, artist in enumerate(move.artists):
            artist.set_gid(f"{_KEY}{move.part}-{k}")
    file, nothing = io.StringIO(), dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with mpl.rc_context({"svg.hashsalt": "cradle", "svg.fonttype": "path"}):
        figure.savefig(file, format="svg", metadata=nothing)
    figure.set_layout_engine("none")  # parts that move leave the others where they are
    # Matplotlib sets a style for `*`: in a page that would be every picture.
    svg = file.getvalue().replace(_STYLE_OF_ALL, "").replace('pt"', 'px"', 2)
    style = "".join(move.css() for move in moves) + "".join(
        f"@media {media} {{ [id^={_KEY}] {{ animation: none !important }} }}\n"
        for media in ("print", "(prefers-reduced-motion: reduce)")
    )
    root = 'style="max-width:100%;height:auto;stroke-linejoin:round;stroke-linecap:butt"'
    root += f' role="img" aria-label="{escape(alt)}"' if alt else ""
    head, body = svg[svg.index("<svg") :].split(">", 1)
    svg = f"{head} {root}>\n<style>\n{style}</style>{body}"
    return Animation(svg.replace(_KEY, f"m{zlib.crc32(svg.encode()):08x}-"), figure, tuple(moves))
