"""Pictures by matplotlib of which parts move: as SVG with keyframes in CSS, or as pixels.

The solver's own events are the keyframes, and between them a browser interpolates linearly, as
velocities go: the motion is exact, sharp at any size, and a few kilobytes long.  A style sheet,
unlike SMIL, also gives the still to paper and to readers who ask for less motion.
"""

import io
import zlib
from bisect import insort
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D

from cradle.input.values import ArrayLike, NDArray, Vector

#: Pictures a second of a film; a GIF counts hundredths of a second.
RATE = 25
# What the numbers of a part do, as CSS.
SEEN = "opacity:{}"
TURN = "transform:rotate({}deg)"
SHIFT = "transform:translate({}px,{}px)"
STRETCH = "transform:translate({}px) scaleX({})"
# How matplotlib does the same, and how far straight lines may be off.
_FORMS: dict[str, tuple[Callable[..., Any], list[float]]] = {
    TURN: (Affine2D.rotate_deg, [0.1]),
    SHIFT: (Affine2D.translate, [0.03, 0.03]),
    STRETCH: (lambda moved, x, share: moved.scale(share, 1).translate(x, 0), [0.03, 0.0005]),
}
# Before the name of every moving part, until a key of the picture's own takes its place: in a page
# the names of all pictures share one space.
_KEY = "moving-part-"
_STYLE_OF_ALL = '<style type="text/css">*{stroke-linejoin: round; stroke-linecap: butt}</style>'


@dataclass(frozen=True)
class Animation:
    """A moving picture: `svg`, and the same as a figure of matplotlib with the moves of its parts.

    A notebook shows it with a box to tick for a pause.  In a page it is part of the page, not an
    image file: browsers tell image files neither that they are printed nor that they should pause.
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
        """Write ``.svg``, ``.html``, a film ``.gif`` or ``.mp4``, or the still as ``.png``.

        If `path` ends otherwise, or a film needs a program that is missing, a ValueError is raised.
        """
        file = Path(path)
        kind = file.suffix.lower()
        if kind in (".svg", ".html"):
            page = f"<!doctype html>\n<meta charset='utf-8'>\n{self._repr_html_()}\n"
            file.write_text(page if kind == ".html" else self.svg, encoding="utf-8")
        elif kind == ".png":
            self.show(None)
            self.figure.savefig(file, dpi=144)
        elif kind == ".gif":
            self._film(PillowWriter(RATE), file, 72)
        elif kind != ".mp4":
            raise ValueError(f"path = {str(path)!r}; must end in .svg, .html, .gif, .mp4 or .png")
        elif not FFMpegWriter.isAvailable():
            raise ValueError(f"{file} needs the program ffmpeg, which is not here; .gif does not")
        else:
            self._film(FFMpegWriter(RATE), file, 144)

    def _film(self, writer: AbstractMovieWriter, file: Path, dpi: float) -> None:
        duration = max((float(move.times[-1]) for move in self.moves), default=0.0)
        with writer.saving(self.figure, str(file), dpi):
            for k in range(max(1, round(RATE * duration))):
                self.show(k / RATE)
                writer.grab_frame()

    def show(self, time: float | None) -> None:
        """Bring every part of the figure to where it is at a time, s; None is the still."""
        for move in self.moves:
            values, (x, y) = move.at(move.still if time is None else time), move.origin
            for artist in move.artists:
                if move.form == SEEN:
                    artist.set_visible(values[0] > 0.5)
                else:
                    moved = _FORMS[move.form][0](Affine2D().translate(-x, -y), *values)
                    artist.set_transform(moved.translate(x, y) + artist.axes.transData)


class Move(NamedTuple):
    """How artists move together; lengths are in the data units of their axes."""

    part: str
    artists: Sequence[Any]
    times: Vector  # s
    values: NDArray[np.float64]  # a row at each time
    form: str  # what the values do
    still: float  # the time of the still, s
    origin: tuple[float, float] = (0.0, 0.0)  # what turns and stretches does so about this point

    def at(self, time: float) -> list[float]:
        """Return the values at a time, s."""
        if self.form == SEEN:  # it lasts until the next keyframe
            return [float(self.values[np.searchsorted(self.times, time, side="right") - 1, 0])]
        return [float(np.interp(time, self.times, column)) for column in self.values.T]

    def css(self) -> str:
        """Return the style of the part: where it rests, and its keyframes; a point is a px."""
        ax, name, times = self.artists[0].axes, f"{_KEY}{self.part}", self.times
        (x, y), far = ax.transData.transform([self.origin, np.add(self.origin, 1.0)])
        wide, high = far - (x, y)
        units = {TURN: [1], SHIFT: [wide, -high], STRETCH: [wide, 1], SEEN: [1]}[self.form]
        if self.form == SEEN:
            pace, rows = "step-end", [0, *(np.flatnonzero(np.diff(self.values[:, 0])) + 1)]
        else:
            pace, rows = "linear", thin(times, self.values * units, _FORMS[self.form][1])

        def state(values: Sequence[float]) -> str:
            return self.form.format(*map(number, np.multiply(values, units).tolist()))

        frames = (f"{number(100 * times[k] / times[-1])}%{{{state(self.values[k])}}}" for k in rows)
        about = f"transform-origin:{number(x)}px {number(ax.figure.bbox.height - y)}px"
        moves = f"animation:{name} {number(times[-1])}s {pace} infinite"
        rest = f"[id^={name}-]{{{state(self.at(self.still))};{about};{moves}}}"
        return f"{rest}\n@keyframes {name}{{{' '.join(frames)}}}\n"


def thin(times: Vector, values: NDArray[np.float64], tolerance: ArrayLike) -> list[int]:
    """Return the rows that straight lines need to stay within the tolerance of each column."""
    rows = [0, len(times) - 1]
    while True:
        lines = [np.interp(times, times[rows], column[rows]) for column in values.T]
        off = (np.abs(values - np.transpose(lines)) / tolerance).max(axis=1)
        off[rows] = 0.0
        if off.max() <= 1.0:
            return rows
        insort(rows, int(off.argmax()))


def number(value: float) -> str:
    """Return a number as CSS, to a thousandth."""
    return f"{round(value, 3) + 0.0:.7g}"  # no -0


def moving(figure: Figure, moves: Sequence[Move], alt: str, unit: str = "pt") -> Animation:
    """Return a figure of 72 dots an inch as a picture that moves."""
    for move in moves:
        for k, artist in enumerate(move.artists):
            artist.set_gid(f"{_KEY}{move.part}-{k}")
    file, nothing = io.StringIO(), dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with mpl.rc_context({"svg.hashsalt": "cradle", "svg.fonttype": "path"}):
        figure.savefig(file, format="svg", metadata=nothing)
    figure.set_layout_engine("none")  # parts that move leave the others where they are
    # Matplotlib sets a style for `*`: in a page that would be every picture.
    svg = file.getvalue().replace(_STYLE_OF_ALL, "").replace('pt"', f'{unit}"', 2)
    style = "".join(move.css() for move in moves) + "".join(
        f"@media {media} {{ [id^={_KEY}] {{ animation: none !important }} }}\n"
        for media in ("print", "(prefers-reduced-motion: reduce)")
    )
    root = 'style="max-width:100%;height:auto;stroke-linejoin:round;stroke-linecap:butt"'
    root += f' role="img" aria-label="{escape(alt)}"' if alt else ""
    head, body = svg[svg.index("<svg") :].split(">", 1)
    svg = f"{head} {root}>\n<style>\n{style}</style>{body}"
    return Animation(svg.replace(_KEY, f"m{zlib.crc32(svg.encode()):08x}-"), figure, tuple(moves))
