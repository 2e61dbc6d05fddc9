"""Pixels of moving pictures: what is drawn at an instant is where the solver has it then."""

import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter
from matplotlib.patches import PathPatch
from PIL import Image
from test_animation import RUN, TRACE

from cradle.pictures.animation import animate, animate_swing
from cradle.pictures.frames import RATE, Frames
from cradle.pictures.keyframes import Animation


def middles(frames, part):
    """Where the shapes of a part are, in units of the file."""
    found = [
        patch.get_transform().transform_path(patch.get_path()).get_extents()
        for patch, name, _ in frames.parts
        if isinstance(patch, PathPatch) and name.endswith(part)
    ]
    inverse = frames.axes.transData.inverted()
    return [inverse.transform(((box.x0 + box.x1) / 2, (box.y0 + box.y1) / 2)) for box in found]


@pytest.mark.parametrize("row", [0, 17, 45, 77])
def test_balls_of_a_swing_hang_where_they_are(row):
    """Pivot + l sin and cos of the angle, as the run has it; 105 units are a length."""
    frames = Frames(animate_swing(RUN).svg)
    assert frames.duration == 3.0
    frames.show(0.0 if row == 0 else RUN.times[row])
    pivots = []
    for ball, x in enumerate(RUN.positions[row]):
        ((_, _), (a, b)) = middles(frames, f"s0b{ball}")
        angle = x / 0.1
        pivots.append(a - 105 * np.sin(angle))
        assert b == pytest.approx(34 + 105 * np.cos(angle), abs=0.3)
    frames.show(None)  # at rest at the release, but for the first
    at = [middles(frames, f"s0b{ball}")[1][0] for ball in (1, 2)]
    np.testing.assert_allclose(pivots[1:], at, atol=0.3)


def test_bars_dots_and_stars_of_an_impact():
    """The picture of a middle instant: half of all impulses, by the trace itself."""
    frames = Frames(animate(TRACE).svg)
    assert frames.duration == 10.0
    along = TRACE.path_impulses.sum(axis=1)
    half = [np.interp(along[-1] / 2, along, TRACE.path[:, ball]) for ball in range(3)]
    frames.show(0.0)
    shown = lambda: [p.get_visible() for p, name, _ in frames.parts if "star" in name]  # noqa: E731
    assert not any(shown())
    ends = {}
    for time in (1.5, 4.0, 6.5):
        frames.show(time)
        ends[time] = [middles(frames, f"dot{ball}")[-1] for ball in range(3)]
    for ball in range(3):
        a, b, c = (ends[time][ball] for time in (1.5, 4.0, 6.5))
        # Along the axis half of the way; up as the velocities are, on the scale of their ends.
        assert b[0] == pytest.approx((a[0] + c[0]) / 2, abs=0.1)
        scale = (ends[1.5][0][1] - ends[1.5][1][1]) / (TRACE.path[0, 0] - TRACE.path[0, 1])
        assert b[1] - a[1] == pytest.approx(scale * (half[ball] - TRACE.path[0, ball]), abs=0.2)
    frames.show(1.6)
    assert any(shown())


def test_files_of_every_kind(tmp_path):
    swing = animate_swing(RUN, ["three balls"])
    for name, begins in (("a.svg", "<svg"), ("a.HTML", "<!doctype html>"), ("a", "<svg")):
        swing.save(tmp_path / name)
        assert (tmp_path / name).read_text(encoding="utf-8").startswith(begins)
    swing.save(tmp_path / "a.gif")
    swing.save(tmp_path / "a.png")
    with Image.open(tmp_path / "a.gif") as film, Image.open(tmp_path / "a.png") as still:
        assert film.n_frames == 3 * RATE
        assert film.info["duration"] == 1000 / RATE
        assert still.size == (2 * film.size[0], 2 * film.size[1])
        # The still is the first picture, but for its size and the colours of a GIF.
        small = np.asarray(still.resize(film.size).convert("L"), float)
        assert np.abs(small - np.asarray(film.convert("L"), float)).mean() < 2
        film.seek(20)
        assert np.abs(small - np.asarray(film.convert("L"), float)).mean() > 2


def test_what_cannot_be_written_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(FFMpegWriter, "isAvailable", lambda: False)
    with pytest.raises(ValueError, match=r"a\.mp4 needs the program ffmpeg, which is not here"):
        animate_swing(RUN).save(tmp_path / "a.mp4")
    with pytest.raises(ValueError, match=r"path = '.*a\.bmp'; must end in \.svg, \.html, \.gif"):
        Animation("<svg/>").save(tmp_path / "a.bmp")
    assert not list(tmp_path.iterdir())
