"""Pixels of moving pictures: what is drawn at an instant is where the solver has it then."""

import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from PIL import Image
from test_animation import RUN, TRACE

from cradle import Chain, SequentialCollisions, swing
from cradle.pictures.animation import animate, animate_swing
from cradle.pictures.impacts import PALETTE
from cradle.pictures.keyframes import RATE

TIMES = np.arange(RATE + 1) / RATE


def middle(animation, part):
    """Where the shape of a part is, in units of the file: the end of a line, else its middle."""
    (shape, *_) = next(move.artists for move in animation.moves if move.part == part)
    if isinstance(shape, Line2D):
        x, y = shape.get_transform().transform(shape.get_xydata()[-1])
    else:
        x, y = shape.get_window_extent().corners().mean(axis=0)
    return x, animation.figure.bbox.height - y


@pytest.mark.parametrize("row", [0, 17, 45, 77])
def test_balls_of_a_swing_hang_where_they_are(row):
    """Pivot + l sin and cos of the angle, as the run has it; 105 units are a length."""
    animation = animate_swing([RUN] * 4, columns=2)
    width, height = animation.figure.bbox.size / 2
    animation.show(RUN.times[row])
    hanging = {}
    for k, ball in np.ndindex(4, 3):
        x, y = middle(animation, f"s{k}b{ball}")
        angle = RUN.positions[row, ball] / 0.1
        hanging[k, ball] = x - 105 * np.sin(angle)
        assert y - k // 2 * height == pytest.approx(34 + 105 * np.cos(angle), abs=0.3)
    animation.show(None)  # at rest at the release, but for the first
    for k, ball in np.ndindex(4, 3):
        (x, _), first = middle(animation, f"s{k}b{ball}"), hanging[k % 2, ball]
        assert hanging[k, ball] == pytest.approx(first, abs=1e-6)
        assert ball == 0 or x == pytest.approx(hanging[k, ball], abs=0.3)
        assert hanging[k, ball] - hanging[0, ball] == pytest.approx(k % 2 * width, abs=1e-6)


@pytest.mark.parametrize("k", [0, 7])
def test_pixels_of_a_film_show_the_ball_where_it_is(k, tmp_path):
    """Picture k of a GIF: the rim of ball 3 has a colour of its own, the ball is in its middle."""
    run = swing(Chain([1, 1, 1], [0] * 3, 1), SequentialCollisions(), [-0.05, 0, 0], TIMES)
    animate_swing(run).save(tmp_path / "a.gif")
    with Image.open(tmp_path / "a.gif") as film:
        assert film.n_frames == RATE
        film.seek(k)
        pixels = np.asarray(film.convert("RGB"), float) / 255
    rows, columns = np.nonzero(np.abs(pixels - to_rgb(PALETTE[2])).max(axis=2) < 0.12)
    x = run.positions[np.searchsorted(TIMES, k / RATE), 2]
    middle = 240 + 34 + 105 * np.sin(x / 0.1), 34 + 105 * np.cos(x / 0.1)
    found = (columns.min() + columns.max() + 1) / 2, (rows.min() + rows.max() + 1) / 2
    np.testing.assert_allclose(found, middle, atol=1)
    assert k == 0 or x > 0.02  # the last ball has left


def test_bars_dots_and_stars_of_an_impact():
    """The picture of a middle instant: half of all impulses, by the trace itself."""
    animation = animate(TRACE)
    stars = [move.artists[0] for move in animation.moves if move.part.startswith("star")]
    along = TRACE.path_impulses.sum(axis=1)
    half = [np.interp(along[-1] / 2, along, TRACE.path[:, ball]) for ball in range(3)]
    animation.show(0.0)
    assert len(stars) == 2
    assert not any(star.get_visible() for star in stars)
    ends = {}
    for time in (1.5, 4.0, 6.5):
        animation.show(time)
        ends[time] = [middle(animation, f"dot{ball}") for ball in range(3)]
        # The bar from the middle of its ball to its tip, which has the velocity's sign.
        if time == 4.0:
            unit = np.diff([middle(animation, f"ball{ball}")[0] for ball in (0, 1)])[0]
            for ball in range(3):
                foot, tip = (middle(animation, f"{part}{ball}")[0] for part in ("ball", "tip"))
                assert tip - foot == pytest.approx(0.95 * unit * half[ball], abs=0.1)
                bar = middle(animation, f"bar{ball}")[0]
                assert bar == pytest.approx((foot + tip) / 2, abs=0.1)
    for ball in range(3):
        a, b, c = (ends[time][ball] for time in (1.5, 4.0, 6.5))
        # Along the axis half of the way; up as the velocities are, on the scale of their ends.
        assert b[0] == pytest.approx((a[0] + c[0]) / 2, abs=0.1)
        scale = (ends[1.5][0][1] - ends[1.5][1][1]) / (TRACE.path[0, 0] - TRACE.path[0, 1])
        assert b[1] - a[1] == pytest.approx(scale * (half[ball] - TRACE.path[0, ball]), abs=0.2)
    animation.show(1.6)
    assert any(star.get_visible() for star in stars)


def test_files_of_every_kind(tmp_path):
    film = animate_swing(RUN, ["three balls"])
    for name, begins in (("a.svg", "<svg"), ("a.HTML", "<!doctype html>"), ("a", "<svg")):
        film.save(tmp_path / name)
        assert (tmp_path / name).read_text(encoding="utf-8").startswith(begins)
    film.save(tmp_path / "a.gif")
    film.save(tmp_path / "a.png")
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
        animate_swing(RUN).save(tmp_path / "a.bmp")
    assert not list(tmp_path.iterdir())
