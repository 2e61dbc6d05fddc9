"""The drawings show the numbers of the trace, where the trace has them."""

import io
import re
import struct

import draw_readme
import numpy as np
import pytest
from chapters import numbers
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from cradle import Chain, EnergyDistribution, ImpulseCorrelation, SpringChain, collide
from cradle.pictures import impacts as figures


@pytest.fixture
def ax():
    return Figure().subplots()


@pytest.fixture
def trace():
    """A chain whose first contact closes again, driven by the second (as in the paper's Fig. 5)."""
    return collide(Chain([1, 1, 1], [1, 0.8, 0], 0.2), ImpulseCorrelation(0.1))


def test_velocities_draws_the_whole_path(ax, trace):
    lines = figures.velocities(trace, ax).get_lines()
    for ball, line in enumerate(lines):
        np.testing.assert_array_equal(line.get_xdata(), trace.path_impulses.sum(axis=1))
        np.testing.assert_array_equal(line.get_ydata(), trace.path[:, ball])
    assert np.all(np.diff(line.get_xdata()) >= 0)
    assert line.get_xdata()[-1] == pytest.approx(trace.impulses.sum())


@pytest.mark.parametrize(
    "model", [SpringChain(), EnergyDistribution()], ids=lambda m: type(m).__name__
)
def test_springs_are_drawn_as_curves(ax, model):
    """Through all steps of the integration, each a state that the impulses so far explain."""
    trace = collide(Chain([1, 2, 1], [1, 0, 0]), model)
    assert len(trace.step_velocities) > 2 * len(trace.path)
    ends = np.zeros((len(trace.step_impulses), 1))
    gained = -np.diff(np.hstack([ends, trace.step_impulses, ends]), axis=1)
    change = trace.chain.masses * (trace.step_velocities - trace.chain.velocities)
    np.testing.assert_allclose(change, gained, atol=1e-12)
    for ball, line in enumerate(figures.velocities(trace, ax).get_lines()):
        np.testing.assert_array_equal(line.get_ydata()[:-1], trace.step_velocities[:, ball])
        assert line.get_ydata()[-1] == trace.velocities[ball]
        assert line.get_xdata()[-1] == trace.impulses.sum()
        assert np.all(np.diff(line.get_xdata()) > -1e-12)
    for contact in range(2):
        lines = figures.velocity_impulse(trace, contact, Figure().subplots()).get_lines()[:2]
        for ball, line in enumerate(lines, start=contact):
            np.testing.assert_array_equal(line.get_ydata()[:-1], trace.step_velocities[:, ball])
            np.testing.assert_array_equal(line.get_xdata()[:-1], trace.step_impulses[:, contact])


@pytest.mark.parametrize("contact", [0, 1])
def test_velocity_impulse_marks_each_event_of_its_contact(ax, trace, contact):
    figures.velocity_impulse(trace, contact, ax)
    left, right = ax.get_lines()[:2]
    np.testing.assert_array_equal(left.get_xdata(), trace.path_impulses[:, contact])
    np.testing.assert_array_equal(left.get_ydata(), trace.path[:, contact])
    np.testing.assert_array_equal(right.get_ydata(), trace.path[:, contact + 1])
    marked = {
        (line.get_marker(), *line.get_ydata())
        for line in ax.get_lines()[2:]
        if line.get_marker() != "None"
    }
    expected = {
        (figures.EVENT_STYLES[event.kind][0], *trace.path[row, contact : contact + 2])
        for row, event in enumerate(trace.events, start=1)
        if event.contact == contact
    }
    assert marked == expected


#: Contact 1-2 is idle at first and closes then.
LATE = collide(Chain([1, 0.2, 1], [0.5, 1, 0]), ImpulseCorrelation(0.1))


@pytest.mark.parametrize("late", [False, True])
def test_letters_carry_the_number_of_the_collision(ax, trace, late):
    figures.velocity_impulse(LATE if late else trace, 0, ax)
    letters = " ".join(text.get_text() for text in ax.texts)
    assert letters.split() == [*["s1"] * late, "c1", "f1", "s2", "c2", "f2"]


def test_balls_differ_in_colour_and_in_dash():
    styles = [figures.ball_style(ball) for ball in range(7)]
    assert len({style["color"] for style in styles}) == 7
    assert len({str(style["linestyle"]) for style in styles}) == 7
    # Told apart in grey as well: the first three, which most figures need.
    grey = [np.dot(to_rgb(style["color"]), [0.2126, 0.7152, 0.0722]) for style in styles[:3]]
    assert len(set(np.round(grey, 2))) == 3


def test_readme_picture_is_sharp_and_small(root):
    head = (root / "book" / "_static" / "cradle.png").read_bytes()
    width, height = struct.unpack(">II", head[16:24])
    assert width >= 1500
    assert height >= 700
    assert len(head) < 200_000


def test_readme_film_is_the_toys(root):
    """The stored film is what the script draws: its words, and its numbers to their last digits."""
    stored = (root / "book" / "_static" / "toy.svg").read_text(encoding="utf-8")
    made = draw_readme.film().svg
    key, number = r"m[0-9a-f]{8}-", r"-?\d+(?:\.\d+)?"
    words = [re.sub(number, "0", re.sub(key, "", svg)) for svg in (stored, made)]
    assert words[0] == words[1]
    values = [np.array(re.findall(number, re.sub(key, "", svg)), float) for svg in (stored, made)]
    np.testing.assert_allclose(*values, atol=0.002)
    assert len(stored) < 200_000
    assert "toy.svg" in (root / "README.md").read_text(encoding="utf-8")


def test_picture_of_the_lecture():
    """The stored one is what the script draws: three outcomes, and each of them on the arc."""
    made, figure = io.StringIO(), draw_readme.lecture()
    figure.savefig(made, format="svg")
    paths = [
        re.findall(r'd="([^"]*)"[^>]*?stroke: #(\w{6}); stroke-w', svg)
        for svg in (draw_readme.LECTURE.read_text(encoding="utf-8"), made.getvalue())
    ]
    assert [colour for _, colour in paths[0]] == [colour for _, colour in paths[1]]
    for (one, _), (other, _) in zip(*paths, strict=True):
        np.testing.assert_allclose(numbers(one), numbers(other), atol=0.01)
    *panels, arc, _ = figure.axes
    for ax, s in zip(panels, (1, np.sqrt(0.7), 0), strict=True):  # Eq. fig4
        v = np.array([s**2 - 1, 2 - 2 * s, 2 + 2 * s]) / (3 + s**2)
        assert [bar.get_height() for bar in ax.patches] == pytest.approx(v, abs=1e-12)
        u = [*v[:2] - v[1:]]
        assert any(line.get_xydata()[0] == pytest.approx(u, abs=1e-12) for line in arc.lines[3:])
        assert u[0] ** 2 + u[0] * u[1] + u[1] ** 2 == pytest.approx(1)


def drawn(draw):
    """Return the words of a picture, as matplotlib writes them into the file."""
    figure = Figure(layout="constrained")
    draw(figure.subplots())
    file = io.StringIO()
    figure.savefig(file, format="svg")
    return set(re.findall(r"<!-- (.+?) -->", file.getvalue()))


def test_two_digits_are_one_index():
    """Without braces TeX lowers the first digit alone."""
    trace = collide(Chain([1] * 12, np.eye(12)[0]), ImpulseCorrelation(0.1))
    words = drawn(lambda ax: figures.velocities(trace, ax))
    words |= drawn(lambda ax: figures.velocity_impulse(trace, 10, ax))
    assert words >= {"$v_9$", "$v_{12}$"}
    assert r"impulse $\tau_{12}$ (N s)" in words
    assert not [word for word in words if re.search(r"_\d\d", word)]


def test_a_long_chain_leaves_room_for_its_curves():
    """Its legend takes several lines; matplotlib warns where nothing is left, an error here."""
    trace = collide(Chain([1] * 40, np.eye(40)[0]), ImpulseCorrelation(0.1))
    drawn(lambda ax: figures.velocities(trace, ax))
