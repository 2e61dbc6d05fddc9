"""Pixels of an `Animation`: its own shapes and keyframes, drawn by matplotlib at any instant."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path as File
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.transforms import Affine2D, Transform

#: Pictures a second; a GIF counts hundredths of a second.
RATE = 25
_NUMBER = r"-?\d*\.?\d+(?:e-?\d+)?"
_CODES = {"M": (Path.MOVETO,), "L": (Path.LINETO,), "H": (Path.LINETO,), "V": (Path.LINETO,),
          "Q": (Path.CURVE3,) * 2, "C": (Path.CURVE4,) * 3}  # fmt: skip


class _Move(NamedTuple):
    """How a part moves: where it rests, times in s, a row of numbers for each, and their form."""

    rest: str
    times: list[float]
    frames: list[str]
    steps: bool
    origin: tuple[float, float]


class Frames:
    """A figure that shows an animation at any instant; shapes of our own pictures alone."""

    def __init__(self, svg: str) -> None:
        root = ElementTree.fromstring(svg)
        left, top, width, height = _numbers(root.get("viewBox", ""))
        # At 72 dots an inch a unit of the file is a point.
        self.figure = Figure((width / 72, height / 72), dpi=72, facecolor="white")
        self.axes = self.figure.add_axes((0, 0, 1, 1))
        self.axes.set(xlim=(left, left + width), ylim=(top + height, top))
        self.axes.set_axis_off()
        self.moves = dict(
            _moves("".join(one.text or "" for one in root.iter() if one.tag.endswith("style")))
        )
        self.duration = max((move.times[-1] for move in self.moves.values()), default=0.0)
        self.named = {one.get("id"): one for one in root.iter() if one.get("id")}
        self.parts: list[tuple[PathPatch | Text, str, tuple[float, float]]] = []
        self._add(root, {}, Affine2D(), "")

    def _add(
        self, element: ElementTree.Element, style: dict[str, str], place: Transform, part: str
    ) -> None:
        tag, given = element.tag.rpartition("}")[2], element.attrib
        if tag in ("defs", "style", "metadata"):
            return
        pairs = re.findall(r"([\w-]+)\s*:\s*([^;]+)", given.get("style", ""))
        style, part = style | given | dict(pairs), given.get("id", part)
        part = part if part in self.moves else style.get("part", "")
        style["part"] = part
        place = _affine(given.get("transform", "")) + place
        if tag == "use":
            at = Affine2D().translate(float(given.get("x", 0)), float(given.get("y", 0)))
            href = next(value for name, value in given.items() if name.endswith("href"))
            self._add(self.named[href[1:]], style | {"transform": ""}, at + place, part)
        elif tag in ("path", "circle", "rect"):
            self._shape(_outline(tag, given), style, place)
        elif tag == "text":
            self._text(element.text or "", style, place)
        for child in element:
            self._add(child, style, place, part)

    def _shape(self, path: Path, style: dict[str, str], place: Transform) -> None:
        scale = float(np.sqrt(abs(np.linalg.det(place.get_matrix()[:2, :2]))))
        dashes = _numbers(style.get("stroke-dasharray", ""))
        width = float(style.get("stroke-width", 1)) * scale
        patch = PathPatch(
            place.transform_path(path), fc=style.get("fill", "black"), lw=width,
            ec=style.get("stroke", "none"), alpha=float(style.get("opacity", 1)),
            ls=(0, [one / (width or 1) for one in dashes]) if dashes else "-",
            zorder=len(self.parts),
        )  # fmt: skip
        self.axes.add_patch(patch)
        self.parts.append((patch, style["part"], (0, 0)))

    def _text(self, words: str, style: dict[str, str], place: Transform) -> None:
        ha = "center" if style.get("text-anchor") == "middle" else "left"
        at = place.transform((float(style.get("x", 0)), float(style.get("y", 0))))
        size = float(style.get("font-size", 16))
        text = self.axes.text(
            float(at[0]), float(at[1]), words, ha=ha, size=size, zorder=len(self.parts)
        )
        self.parts.append((text, style["part"], tuple(at)))

    def show(self, time: float | None) -> None:
        """Bring every part to where it is at a time, s; None is the still."""
        for artist, name, at in self.parts:
            if not name:
                continue
            move = self.moves[name]
            values = _at(move, time)
            if "opacity" in move.rest:
                artist.set_visible(values[0] > 0.5)
                continue
            moved: Transform = Affine2D().translate(-move.origin[0], -move.origin[1])
            moved += _affine(re.sub(_NUMBER, "{}", move.rest).format(*values))
            moved += Affine2D().translate(*move.origin)
            if isinstance(artist, Text):
                x, y = moved.transform(at)
                artist.set_position((float(x), float(y)))
            else:
                artist.set_transform(moved + self.axes.transData)


def save_pixels(svg: str, path: File) -> None:
    """Write an animation as a film, .gif or .mp4, or its still as a .png."""
    frames = Frames(svg)
    if path.suffix.lower() == ".png":
        frames.show(None)
        frames.figure.savefig(path, dpi=144)
        return
    film = path.suffix.lower() == ".mp4"
    if film and not FFMpegWriter.isAvailable():
        raise ValueError(f"{path} needs the program ffmpeg, which is not here; .gif needs nothing")
    writer = FFMpegWriter(fps=RATE) if film else PillowWriter(fps=RATE)
    with writer.saving(frames.figure, str(path), dpi=144 if film else 72):
        for k in range(max(1, round(RATE * frames.duration))):
            frames.show(k / RATE)
            writer.grab_frame()


def _numbers(text: str) -> list[float]:
    return [float(one) for one in re.findall(_NUMBER, text)]


def _moves(style: str) -> Iterator[tuple[str, _Move]]:
    """Yield the moving parts of a style sheet as `keyframes` writes it."""
    origins = re.findall(r"#([\w-]+)\{transform-origin:(\S+?)(?:px)? (\S+?)(?:px)?\}", style)
    places = {name: (float(x), float(y)) for name, x, y in origins}
    form = (
        r"#([\w-]+)\{([^{}]*?);animation:\S+ (\S+)s ([\w-]+) infinite\}\s*@keyframes \S+?\{(.*)\}"
    )
    for name, rest, seconds, pace, frames in re.findall(form, style):
        found = re.findall(r"(\S+?)%\{([^}]*)\}", frames)
        times = [float(seconds) * float(share) / 100 for share, _ in found]
        texts = [text for _, text in found]
        times, texts = [*times, float(seconds)], [*texts, texts[-1]]
        yield name, _Move(rest, times, texts, pace == "step-end", places.get(name, (0.0, 0.0)))


def _at(move: _Move, time: float | None) -> list[float]:
    """Return the numbers of a part's state at a time."""
    if time is None:
        return _numbers(move.rest)
    after = int(np.searchsorted(move.times, time, side="right"))
    rows = np.array([_numbers(text) for text in move.frames[max(0, after - 1) : after + 1]])
    if move.steps or len(rows) == 1:
        return [float(one) for one in rows[0]]
    start, end = move.times[after - 1 : after + 1]
    return [float(one) for one in rows[0] + (time - start) / (end - start) * (rows[1] - rows[0])]


def _affine(text: str) -> Transform:
    """Return the map of a list of SVG's or CSS's transforms: the last one acts first."""
    total: Transform = Affine2D()
    for name, inside in re.findall(r"(\w+)\(([^)]*)\)", text):
        values = _numbers(inside)
        one = Affine2D()
        if name == "scaleX":
            one.scale(values[0], 1.0)
        elif name == "scale":
            one.scale(*values)
        elif name == "rotate":
            one.rotate_deg(values[0])
        else:
            one.translate(*[*values, 0.0][:2])
        total = one + total
    return total


def _outline(tag: str, given: dict[str, str]) -> Path:
    """Return the outline of a shape in units of the file."""
    if tag == "circle":
        centre = float(given["cx"]), float(given["cy"])
        return Path.circle(centre, float(given["r"]))
    if tag == "rect":
        box = Affine2D().scale(float(given["width"]), float(given["height"]))
        return box.transform_path(Path.unit_rectangle())
    points: list[tuple[float, float]] = []
    codes: list[np.uint8] = []
    for letter, inside in re.findall(r"([A-Za-z])([^A-Za-z]*)", given.get("d", "")):
        values = _numbers(inside)
        if letter in "Zz":
            points.append(points[-1])
            codes.append(Path.CLOSEPOLY)
            continue
        x, y = points[-1] if points else (0.0, 0.0)
        values = [values[0], y] if letter == "H" else [x, values[0]] if letter == "V" else values
        points += zip(values[::2], values[1::2], strict=True)
        codes += _CODES[letter]
    return Path(np.array(points).reshape(-1, 2), codes or None)  # a blank has none
