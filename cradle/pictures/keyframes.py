"""Moving pictures of an impact and of a swing, as SVG with keyframes in CSS.

A film of pixels would need some hundred frames.  Here the solver's own events are the keyframes:
between two events of an impact every velocity is linear in the progress, and a browser
interpolates linearly.  So the motion is exact, sharp at any size, and a few kilobytes long; of
springs the steps of the integration are the keyframes.  A style sheet, unlike SMIL, can also honour
a reader who asks for less motion, and paper: both get the still.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cradle.input.values import Vector

# Stands before the name of every moving part, until the picture's own key takes its place.
KEY = "moving-part-"
# What the number of a part does that comes and goes.
SEEN = "opacity:{}"
_STYLE_OF_ALL = '<style type="text/css">*{stroke-linejoin: round; stroke-linecap: butt}</style>'


@dataclass(frozen=True)
class Animation:
    """A moving picture; a notebook shows it with a box to tick for a pause.

    In a page it is part of the page, not an image file: browsers tell image files neither that
    they are printed nor that they should pause.

    Attributes
    ----------
    svg : str
        The picture as a file.
    figure, moves : Figure or None, tuple of Move
        For pixels: the same picture by matplotlib, and how its parts move, in units of the file.

    Examples
    --------
    >>> Animation("<svg/>")
    Animation(0 kB)
    """

    svg: str
    figure: Figure | None = field(default=None, repr=False, compare=False)
    moves: tuple[Move, ...] = field(default=(), repr=False, compare=False)

    def _repr_html_(self) -> str:
        key = f"p{zlib.crc32(self.svg.encode()):08x}"
        style = (
            f"#{key}:checked ~ svg * {{ animation-play-state: paused !important }}\n"
            f"@media print, (prefers-reduced-motion: reduce) {{ .{key} {{ display: none }} }}"
        )
        box = f'<input type="checkbox" id="{key}" class="{key}">'
        return (
            f'<div class="animation"><style>{style}</style>{box}'
            f'<label for="{key}" class="{key}"> pause</label><br>{self.svg}</div>'
        )

    def __repr__(self) -> str:
        """Return a short account."""
        return f"Animation({len(self.svg.encode()) / 1000:.0f} kB)"

    def save(self, path: str | Path) -> None:
        """Write the picture to a file; its ending says of what kind.

        Parameters
        ----------
        path : str or Path
            ``.svg``, ``.html``, a film ``.gif`` or ``.mp4``, or the still as ``.png``.

        Raises
        ------
        ValueError
            If the ending is another one, or a film needs a program that is missing.

        Examples
        --------
        >>> Animation("<svg/>").save("/dev/null")
        """
        file = Path(path)
        kind = file.suffix.lower()
        if kind in (".png", ".gif", ".mp4"):
            from cradle.pictures.frames import save_pixels

            save_pixels(self, file)
        elif kind in (".svg", ".html", ""):
            page = f"<!doctype html>\n<meta charset='utf-8'>\n{self._repr_html_()}\n"
            file.write_text(page if kind == ".html" else self.svg, encoding="utf-8")
        else:
            raise ValueError(f"path = {str(path)!r}; must end in .svg, .html, .gif, .mp4 or .png")


def thin(times: Vector, values: Vector, tolerance: float) -> NDArray[np.int64]:
    """Return the rows that straight lines need to stay within the tolerance (Douglas, Peucker)."""
    keep = np.zeros(len(times), dtype=bool)
    keep[[0, -1]] = True
    spans = [(0, len(times) - 1)]
    while spans:
        a, b = spans.pop()
        if b - a < 2:
            continue
        part = (times[a + 1 : b] - times[a]) / ((times[b] - times[a]) or 1.0)
        line = values[a] + part[:, None] * (values[b] - values[a])
        off = np.abs(values[a + 1 : b] - line).max(axis=1)
        if off.max() > tolerance:
            middle = a + 1 + int(np.argmax(off))
            keep[middle] = True
            spans += [(a, middle), (middle, b)]
    return np.flatnonzero(keep)


def number(value: float) -> str:
    """Return a number as CSS, to a thousandth."""
    value = round(value, 3) + 0.0  # no -0
    return f"{value:.3f}".rstrip("0").rstrip(".")


class Move(NamedTuple):
    """How a part moves: times in s, a row of numbers at each, and what they do, as CSS."""

    part: str
    times: Vector
    values: Vector
    form: str
    tolerance: float
    still: int  # the row of the still
    origin: tuple[float, float] = (0.0, 0.0)  # what turns and stretches does so about this point

    def css(self) -> str:
        """Return the style of the part: where it rests, and its keyframes."""

        def state(row: int) -> str:
            css = self.form.format(*map(number, self.values[row].tolist()))
            return css if self.form == SEEN else f"transform:{css}"

        part, times, pace = self.part, self.times, "linear"
        rows = thin(times, self.values, self.tolerance).tolist()
        if self.form == SEEN:  # it lasts until the next keyframe
            pace, rows = "step-end", [0, *(np.flatnonzero(np.diff(self.values[:, 0])) + 1)]
        frames = " ".join(f"{number(100 * times[k] / times[-1])}%{{{state(k)}}}" for k in rows)
        moves = f"animation:{part} {number(times[-1])}s {pace} infinite"
        x, y = self.origin
        about = f"#{part}{{transform-origin:{number(x)}px {f'{y}px' if y else 0}}}\n" if x else ""
        return f"{about}#{part}{{{state(self.still)};{moves}}}\n@keyframes {part}{{{frames}}}\n"


def with_style(svg: str, style: str, alt: str) -> str:
    """Put a style sheet into a picture; stillness for those who ask for it, and on paper.

    In a page the names of all pictures share one space, so each gets a key of its own in the
    place of `KEY`.
    """
    still = "".join(
        f"@media {media} {{ [id^={KEY}] {{ animation: none !important }} }}\n"
        for media in ("print", "(prefers-reduced-motion: reduce)")
    )
    start = svg.index("<svg")
    head = svg.index(">", start)
    # Matplotlib sets these two for `*`: in a page that would be every picture.
    root = 'style="max-width:100%;height:auto;stroke-linejoin:round;stroke-linecap:butt"'
    body = svg[head + 1 :].replace(_STYLE_OF_ALL, "")
    name = f'role="img" aria-label="{escape(alt)}"' if alt else ""
    moving = f"{svg[start:head]} {name} {root}>\n<style>\n{style}{still}</style>{body}"
    return moving.replace(KEY, f"m{zlib.crc32(moving.encode()):08x}-")
