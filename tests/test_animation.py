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

from cradle import (
    Chain,
    ImpulseCorrelation,
    Pendulums,
    SequentialCollisions,
    SpringChain,
    collide,
    swing,
)
from cradle.pictures.animation import animate, animate_swing
from cradle.pictures.impacts import PALETTE
from cradle.pictures.keyframes import RATE, thin

TRACE = collide(Chain([1, 1, 1], [1, 0, 0], 1), ImpulseCorrelation(0.15))
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


def test_bars_are_the_velocities_at_every_event():
    svg = animate(TRACE).svg
    share = TRACE.path_impulses.sum(axis=1)
    share /= share[-1]
    for ball in range(3):
        times, values = keyframes(svg, f"bar{ball}")
        at = np.interp(1.5 + 5 * share, times, values[:, 1])
        np.testing.assert_allclose(at, 0.95 * TRACE.path[:, ball], atol=2e-3)


def test_bars_of_springs_follow_their_curves():
    """Three equal balls on linear springs, by their two modes, until the first contact opens."""
    trace = collide(Chain([1, 1, 1], [1, 0, 0]), SpringChain(1.0, 1, accuracy=1e-12))
    svg = animate(trace).svg
    t = np.linspace(0, 2.4, 13)[:, None]
    slow, fast = np.cos(t) * [1 / 2, 0, -1 / 2], np.cos(np.sqrt(3) * t) * [1 / 6, -1 / 3, 1 / 6]
    v = 1 / 3 + slow + fast
    moment = 1.5 + 5 * (1 - v[:, 0] + v[:, 2]) / trace.impulses.sum()
    for ball in range(3):
        times, values = keyframes(svg, f"bar{ball}")
        bars = np.interp(moment, times, values[:, 1])
        np.testing.assert_allclose(bars, 0.95 * v[:, ball], atol=5e-3)


def test_dots_and_cover_are_in_step():
    """Dot and cover are drawn from the same instant: the cover's edge is at every dot."""
    for contact in (None, 0, 1):
        svg = animate(TRACE, contact).svg
        moment = np.linspace(1.5, 6.5, 51)
        times, hidden = keyframes(svg, "cover")
        edge = np.interp(moment, times, hidden[:, 1])
        shown = range(3) if contact is None else (contact, contact + 1)
        for ball in shown:
            times, moved = keyframes(svg, f"dot{ball}")
            x = np.interp(moment, times, moved[:, 0])
            # Both are linear images of the impulse, so of each other.
            slope, offset = np.polyfit(edge, x, 1)
            np.testing.assert_allclose(x, offset + slope * edge, atol=0.3)
            assert slope < 0
        assert f"-dot{max(shown) + 1}-" not in svg


def test_nobody_moves_during_the_impact():
    """An impact takes no time: the balls are where they touch."""
    svg = animate(TRACE).svg
    for ball in range(3):
        times, x = keyframes(svg, f"ball{ball}")
        moment = np.linspace(1.5, 6.5, 21)
        np.testing.assert_allclose(np.interp(moment, times, x[:, 0]), 0, atol=0.05)
    came, went = (keyframes(svg, f"ball{ball}")[1][row, 0] for ball, row in ((0, 0), (2, -1)))
    assert went / -came == pytest.approx(TRACE.velocities[2], rel=1e-3)


def test_stars_show_the_contacts_that_press():
    svg = animate(TRACE).svg
    share = TRACE.path_impulses.sum(axis=1)
    ends = {event.contact: 1.5 + 5 * share[k] / share[-1]
            for k, event in enumerate(TRACE.events, 1) if event.kind == "end"}  # fmt: skip
    for contact in range(2):
        times, lit = keyframes(svg, f"star{contact}")
        assert lit[:, 0].tolist() == [0, 1, 0]
        assert times[1] == pytest.approx(1.5, abs=1e-3)
        assert times[2] == pytest.approx(ends[contact], abs=1e-3)


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
    for svg in (animate(TRACE).svg, animate_swing(RUN, ["a < b"]).svg):
        ElementTree.fromstring(svg)  # well-formed
        for media in ("print", "(prefers-reduced-motion: reduce)"):
            still = rf"@media {re.escape(media)} {{ \[id\^=m\w+-\] {{ animation: none"
            assert re.search(still, svg)
        assert "<script" not in svg
        assert "http" not in re.sub(
            r'xmlns(:\w+)?="[^"]*"', "", re.sub(r"<!DOCTYPE[^>]*>", "", svg)
        )


def test_the_still_of_an_impact_shows_its_end():
    svg = animate(TRACE).svg
    assert re.search(r"-cover-\]\{transform:translate\(0px\) scaleX\(0\);", svg)
    for ball in range(3):
        still = rf"-bar{ball}-\]\{{transform:translate\(0px\) scaleX\(([-\d.]+)\)"
        (length,) = re.findall(still, svg)
        assert float(length) == pytest.approx(0.95 * TRACE.velocities[ball], abs=1e-3)


def test_same_picture_every_time():
    assert animate(TRACE).svg == animate(TRACE).svg


def test_two_pictures_of_a_page_share_no_name():
    names = [
        set(re.findall(r"@keyframes ([\w-]+)", picture.svg))
        for picture in (animate(TRACE), animate(TRACE, 1), animate_swing(RUN))
    ]
    assert all(names)
    assert not names[0] & names[1]
    assert not names[1] & names[2]
    # And no style reaches beyond its picture.
    for picture in (animate(TRACE), animate_swing(RUN)):
        selectors = re.findall(r"(?:^|[};])\s*([#.*\[][^{};]*)\{", picture._repr_html_())
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
    assert len(animate(TRACE).svg) < 60_000
    times = np.arange(0, 12, 1 / 40)
    run = swing(Chain([1] * 5, [0] * 5, 1), ImpulseCorrelation(0.15), [-0.05, 0, 0, 0, 0], times)
    assert len(animate_swing(run).svg) < 80_000


def test_no_impact():
    still = collide(Chain([1, 1], [0, 1], 1), ImpulseCorrelation(0))
    assert "NaN" not in animate(still).svg
    assert "nan" not in re.sub(r"<path[^>]*>", "", animate(still).svg)


def test_thinning_stays_within_its_tolerance():
    times = np.linspace(0, 1, 201)
    values = np.column_stack([times * (1 - times), np.abs(times - 0.3)])
    rows = thin(times, values, 0.003)
    for k in range(2):
        line = np.interp(times, times[rows], values[rows, k])
        assert np.abs(line - values[:, k]).max() <= 0.003
    assert len(rows) < 15


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
