"""Moving pictures: every keyframe is the solver's, and stillness is kept where it is asked for."""

import re
import subprocess
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from PIL import Image

from cradle import Chain, ImpulseCorrelation, Pendulums, SequentialCollisions, swing
from cradle.pictures.animation import RATE, _thin, animate_swing
from cradle.pictures.impacts import PALETTE

RUN = swing(
    Chain([1, 2, 1], [0] * 3, 0.9), ImpulseCorrelation(0.1), [-0.03, 0, 0], np.linspace(0, 3, 91),
    pendulums=Pendulums(gaps=0.001),
)  # fmt: skip


def keyframes(svg, name):
    """Times and numbers of the keyframes of one part."""
    ((key, name),) = set(re.findall(rf"@keyframes (m[0-9a-f]{{8}}-)({name})\{{", svg))
    name = key + name
    ((body,),) = [re.findall(rf"@keyframes {name}\{{((?:[^{{}}]*\{{[^}}]*\}})*)\}}", svg)]
    rows = re.findall(r"([\d.]+)%\{([^}]*)\}", body)
    number = r"-?\d+(?:\.\d+)?"
    (seconds,) = re.findall(rf"animation:{name} ({number})s", svg)
    times = np.array([float(at) for at, _ in rows]) / 100 * float(seconds)
    return times, np.array([[float(x) for x in re.findall(number, css)] for _, css in rows])


def test_swing_angles_are_those_of_the_run():
    svg = animate_swing(RUN).svg
    for ball in range(3):
        times, angle = keyframes(svg, f"s0b{ball}")
        expected = -np.degrees(RUN.positions[:, ball] / 0.1)
        np.testing.assert_allclose(np.interp(RUN.times, times, angle[:, 0]), expected, atol=0.15)
    # Impacts lie between the times; there too the angle is the run's.
    hits = np.array([hit.time for hit in RUN.impacts if hit.time < 3])
    expected = [-np.degrees(hit.positions[1] / 0.1) for hit in RUN.impacts if hit.time < 3]
    times, angle = keyframes(svg, "s0b1")
    assert len(hits) > 5
    np.testing.assert_allclose(np.interp(hits, times, angle[:, 0]), expected, atol=0.15)


def test_the_still_of_a_swing_is_the_instant_asked_for():
    svg = animate_swing(RUN, still=RUN.times[20]).svg
    for ball in range(3):
        (angle,) = re.findall(rf"-s0b{ball}-\]\{{transform:rotate\(([-\d.]+)deg\);", svg)
        assert float(angle) == pytest.approx(-np.degrees(RUN.positions[20, ball] / 0.1), abs=1e-3)


def test_speed():
    slow = keyframes(animate_swing(RUN, speed=0.25).svg, "s0b0")[0]
    assert slow[-1] == pytest.approx(12)


def test_still_for_print_and_reduced_motion():
    for svg in (animate_swing(RUN).svg, animate_swing(RUN, ["a < b"]).svg):
        ElementTree.fromstring(svg)  # well-formed
        for media in ("print", "(prefers-reduced-motion: reduce)"):
            still = rf"@media {re.escape(media)} {{ \[id\^=m\w+-\] {{ animation: none"
            assert re.search(still, svg)
        assert "<script" not in svg
        assert "http" not in re.sub(
            r'xmlns(:\w+)?="[^"]*"', "", re.sub(r"<!DOCTYPE[^>]*>", "", svg)
        )


def test_same_picture_every_time():
    assert animate_swing(RUN).svg == animate_swing(RUN).svg


def test_two_pictures_of_a_page_share_no_name():
    names = [
        set(re.findall(r"@keyframes ([\w-]+)", picture.svg))
        for picture in (animate_swing(RUN), animate_swing(RUN, speed=0.5))
    ]
    assert all(names)
    assert not names[0] & names[1]
    # And no style reaches beyond its picture.
    html = animate_swing(RUN)._repr_html_()
    selectors = re.findall(r"(?:^|[};])\s*([#.*\[][^{};]*)\{", html)
    assert selectors
    assert all(re.match(r"[#.][mp][0-9a-f]{8}|\[id\^=m[0-9a-f]{8}-", s) for s in selectors)


def test_words_for_those_who_do_not_see_it():
    svg = animate_swing(RUN, alt='"A" & b').svg
    assert ElementTree.fromstring(svg).attrib["aria-label"] == '"A" & b'
    assert "aria-label" not in animate_swing(RUN).svg


def test_pause():
    html = animate_swing(RUN)._repr_html_()
    (key,) = re.findall(r'<input type="checkbox" id="(\w+)"', html)
    assert f'<label for="{key}"' in html
    assert re.search(rf"#{key}:checked ~ svg \* {{ animation-play-state: paused", html)


def test_light_enough_for_a_page():
    times = np.arange(0, 12, 1 / 40)
    run = swing(Chain([1] * 5, [0] * 5, 1), ImpulseCorrelation(0.15), [-0.05, 0, 0, 0, 0], times)
    assert len(animate_swing(run).svg) < 80_000


def test_thinning_stays_within_a_tenth_of_a_degree():
    times = np.linspace(0, 1, 201)
    for angles in (10 * times * (1 - times), 10 * np.abs(times - 0.3)):
        rows = _thin(times, angles)
        assert np.abs(np.interp(times, times[rows], angles[rows]) - angles).max() <= 0.1
        assert 3 <= len(rows) < 15


def test_swings_side_by_side_are_the_same_swings():
    """Columns change where a swing stands, not how it moves; cells are wide enough for it."""
    below, beside = (animate_swing([RUN] * 3, ["a", "b", "c"], columns=k).svg for k in (1, 2))
    for swing_ in range(3):
        for ball in range(3):
            one, other = (keyframes(svg, f"s{swing_}b{ball}") for svg in (below, beside))
            np.testing.assert_array_equal(one[0], other[0])
            np.testing.assert_array_equal(one[1], other[1])
    (width, height) = map(float, re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', beside).groups())
    pivots = re.findall(r"-s.b1-\].*;transform-origin:([\d.]+)px ([\d.]+)px", beside)
    left, top = np.array(pivots, float).T
    assert (top - top[0]).tolist() == [0, 0, height / 2]
    # Balls 1 and 3 are alike, so ball 2 hangs in the middle of its cell; the swings are small.
    assert width == 2 * 300
    assert left.tolist() == [150, 450, 150]


def test_letters_of_two_columns_can_be_read_on_a_phone():
    """The widest film of the book, on the 327 pixels that a phone has for it: cells of 379."""
    run = swing(Chain([1] * 5, [0] * 5), SequentialCollisions(), [-0.113, 0, 0, 0, 0], TIMES)
    figure = animate_swing([run] * 2, ["a", "b"], columns=2).figure
    width = figure.bbox.width
    assert 750 < width < 780
    sizes = [words.get_size() for words in figure.axes[0].texts]
    assert len(sizes) == 12
    assert min(sizes) * 327 / width >= 11


# --- pixels: what is drawn at an instant is where the solver has it then ------------------------

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


@pytest.mark.parametrize(("kind", "k"), [("gif", 0), ("gif", 7), ("mp4", 7)])
def test_pixels_of_a_film_show_the_ball_where_it_is(kind, k, tmp_path):
    """Picture k: the rim of ball 3 has a colour of its own, the ball is in its middle."""
    run = swing(Chain([1, 1, 1], [0] * 3, 1), SequentialCollisions(), [-0.05, 0, 0], TIMES)
    if kind == "mp4" and not FFMpegWriter.isAvailable():
        pytest.skip("no ffmpeg")
    animate_swing(run).save(tmp_path / f"a.{kind}")
    if kind == "mp4":  # of twice the size
        cut = ["ffmpeg", "-v", "error", "-i", "a.mp4", "-vf", "scale=iw/2:-1", "%d.png"]
        subprocess.run(cut, cwd=tmp_path, check=True)
        assert len(list(tmp_path.glob("*.png"))) == RATE
        picture = Image.open(tmp_path / f"{k + 1}.png")
    else:
        picture = Image.open(tmp_path / "a.gif")
        assert picture.n_frames == RATE
        picture.seek(k)
    with picture:
        pixels = np.asarray(picture.convert("RGB"), float) / 255
    rows, columns = np.nonzero(np.abs(pixels - to_rgb(PALETTE[2])).max(axis=2) < 0.12)
    x = run.positions[np.searchsorted(TIMES, k / RATE), 2]
    middle = 240 + 34 + 105 * np.sin(x / 0.1), 34 + 105 * np.cos(x / 0.1)
    found = (columns.min() + columns.max() + 1) / 2, (rows.min() + rows.max() + 1) / 2
    np.testing.assert_allclose(found, middle, atol=1)
    assert k == 0 or x > 0.02  # the last ball has left


def test_files_of_every_kind(tmp_path):
    film = animate_swing(RUN, ["three balls"])
    for name, begins in (("a.svg", "<svg"), ("a.HTML", "<!doctype html>")):
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
