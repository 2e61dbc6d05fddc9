"""Pixels of an `Animation`: its figure by matplotlib, every part moved to where it is then."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.transforms import Affine2D

from cradle.pictures.keyframes import SEEN, Animation, Move

#: Pictures a second; a GIF counts hundredths of a second.
RATE = 25
_MAPS: dict[str, Callable[..., Affine2D]] = {
    "rotate({}deg)": lambda degrees: Affine2D().rotate_deg(degrees),
    "translateX({}px)": lambda x: Affine2D().translate(x, 0.0),
    "translate({}px,{}px)": lambda x, y: Affine2D().translate(x, y),
    "scaleX({})": lambda share: Affine2D().scale(share, 1.0),
    "translateX({}px) scaleX({})": lambda x, share: Affine2D().scale(share, 1.0).translate(x, 0.0),
}


def at(move: Move, time: float | None) -> list[float]:
    """Return the numbers of a part at a time, s; None is the still."""
    if time is None:
        return [float(one) for one in move.values[move.still]]
    if move.form == SEEN:
        return [float(move.values[np.searchsorted(move.times, time, side="right") - 1, 0])]
    return [float(np.interp(time, move.times, column)) for column in move.values.T]


def show(animation: Animation, time: float | None) -> None:
    """Bring every part of the figure to where it is at a time, s; None is the still."""
    figure = animation.figure
    assert figure is not None
    # From the figure's pixels, up, to units of the file, down: there are 72 in an inch.
    unit = 72 / figure.dpi
    page = Affine2D().scale(unit, -unit).translate(0.0, unit * figure.bbox.height)
    moves: dict[str | None, Move] = {move.part: move for move in animation.moves}
    for artist in figure.findobj(lambda one: one.get_gid() in moves):
        move = moves[artist.get_gid()]
        values = at(move, time)
        if move.form == SEEN:
            artist.set_visible(values[0] > 0.5)
        elif artist.axes:
            x, y = move.origin
            moved = Affine2D().translate(-x, -y) + _MAPS[move.form](*values).translate(x, y)
            artist.set_transform(artist.axes.transData + page + moved + page.inverted())


def save_pixels(animation: Animation, path: Path) -> None:
    """Write an animation as a film, .gif or .mp4, or its still as a .png."""
    figure, kind = animation.figure, path.suffix.lower()
    if figure is None:
        raise ValueError(f"{path} needs the figure of an animation, and this one has none")
    if kind == ".mp4" and not FFMpegWriter.isAvailable():
        raise ValueError(f"{path} needs the program ffmpeg, which is not here; .gif needs nothing")
    figure.dpi = 72 if kind == ".gif" else 144
    figure.draw_without_rendering()
    figure.set_layout_engine(None)  # parts that move leave the others where they are
    if kind == ".png":
        show(animation, None)
        figure.savefig(path, dpi=figure.dpi)
        return
    writer = (FFMpegWriter if kind == ".mp4" else PillowWriter)(fps=RATE)
    duration = max((float(move.times[-1]) for move in animation.moves), default=0.0)
    with writer.saving(figure, str(path), dpi=figure.dpi):
        for k in range(max(1, round(RATE * duration))):
            show(animation, k / RATE)
            writer.grab_frame()
