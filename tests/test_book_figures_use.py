"""Every curve of the chapters on the toy and on measuring, against a second route."""

import math
import re

import numpy as np
import pytest
from chapters import Chapter, drawn, floats, lines
from stored import DATA, read
from test_book_toy import strokes
from truth import solve

from cradle.tables import paper_chain

STRUCK = [1, 0, 0, 0, 0]
#: The cells of the page that its figures need; its fits of laws and swings take longer.
MEASURE = ("setup", "fig-setup", "phone", "track-call", "fig-tracks")
RATIOS = (
    "setup",
    "choose",
    "show-pairs",
    "show-ratios",
    "fig-fit",
    "check",
    "check-how",
    "fig-check",
)


def velocities(chain, forward, backward=None):
    """Velocities after an impact by the independent solver."""
    masses, before, restitution = (list(map(float, values)) for values in chain)
    done = solve(masses, before, restitution, forward, backward, number=float)
    return floats(done.velocities)


def test_fig_toy_models():
    axes = drawn("toy")["fig-toy-models"].axes
    shown = [[lines(ax)[f"ball {k}"] for k in range(1, 6)] for ax in axes]
    assert all(line[:3, 0].tolist() == [1, 3, 5] for panel in shown for line in panel)
    # With losses the impacts end before the minute does.
    ratio, lossy = np.array([[line[:20, 1] for line in panel] for panel in shown])
    for drawn_by, e, a in ((ratio, 1, 0.15), (lossy, 0.9, 0.15)):
        expected = strokes(20, STRUCK, e, a)[::2].T
        np.testing.assert_allclose(drawn_by[:, :10], expected, rtol=0, atol=1e-9)


def test_fig_toy_drift():
    axes = drawn("toy")["fig-toy-drift"].axes
    assert [ax.get_title() for ax in axes] == [f"e = {e:g}" for e in (0.9, 0.95, 0.99)]
    assert all(
        label[-len(ax.get_title()) :] == ax.get_title() for ax in axes for label in lines(ax)
    )
    shown = {label: line for ax in axes for label, line in lines(ax).items()}
    assert len(shown) == 6
    for e in (0.9, 0.95, 0.99):
        five, two = shown[f"five, e = {e:g}"], shown[f"two, e = {e:g}"]
        after = strokes(20, STRUCK, e)
        relative = 5 * after.var(axis=1) / 0.8
        np.testing.assert_allclose(five[:20, 1], relative, rtol=1e-6)
        np.testing.assert_allclose(two[:, 1], e ** (2 * two[:, 0]), rtol=1e-7)
        assert five[:3, 0].tolist() == two[:3, 0].tolist() == [1, 2, 3]


def test_fig_inventory_resting():
    """Up to the first impact both balls are free."""
    ax = drawn("extremes_inventory")["fig-inventory-resting"].axes[0]
    distance, hits = (line.get_xydata() for line in ax.get_lines()[:2])
    assert (distance[:, 1] > -1e-9).all()
    first = hits[0, 0]
    before = distance[distance[:, 0] < first]
    short, long = (np.sqrt(9.81 / length) for length in (0.10, 0.14))
    free = 40 * np.cos(short * before[:, 0]) - 39.2 * np.cos(long * before[:, 0])
    np.testing.assert_allclose(before[:, 1], free, rtol=0, atol=1e-9)
    assert 40 * math.cos(short * first) == pytest.approx(39.2 * math.cos(long * first), abs=1e-9)
    assert (hits[:, 1] == 0).all()


def test_fig_measure_setup():
    """A drawing: equal threads, a dot on each ball, phone and ruler where the text puts them."""
    front, side = drawn("measure", MEASURE)["fig-measure-setup"].axes
    balls = np.array([shape.center for shape in front.patches if hasattr(shape, "center")])
    dots = np.concatenate([x.get_xydata() for x in front.lines if x.get_marker() == "o"])
    np.testing.assert_allclose(dots, balls)
    _, *threads = (x.get_xydata() for x in front.lines if len(x.get_xydata()) == 2)
    assert len(threads) == len(balls) == 5
    for thread, ball in zip(threads, balls, strict=True):
        np.testing.assert_allclose(thread[1], ball)
        assert math.dist(*thread) == pytest.approx(4)
    lifted, *waiting = balls
    assert lifted[0] < -1
    assert lifted[1] > 0
    np.testing.assert_allclose(waiting, [[k, 0] for k in range(1, 5)], atol=1e-12)
    ball, ruler, phone, *_ = side.patches
    assert ruler.get_x() + ruler.get_width() / 2 == pytest.approx(ball.center[0])
    assert phone.get_y() + phone.get_height() / 2 == pytest.approx(ball.center[1])


def test_fig_measure_tracks():
    ax = drawn("measure", MEASURE)["fig-measure-tracks"].axes[0]
    shown = lines(ax)
    table = np.loadtxt(DATA / "row_film_synthetic.txt", skiprows=3, encoding="utf-8")
    for name, x in zip("12345", table[:, 1::2].T, strict=True):
        line = shown[f"ball {name}"]
        np.testing.assert_allclose(line[:, 1], 1000 * x, rtol=1e-12)
        np.testing.assert_allclose(np.diff(line[:, 0]), 1000 * np.diff(table[:, 0]), rtol=1e-9)
    # The struck balls begin to move at time zero.
    time, moved = shown["ball 5"].T
    assert moved[time < 0].max() < moved[time > 20].min()
    # The slopes drawn are those of the marks near the impact, and what is written beside them.
    told = [float(re.search(r"slope ([\d.]+)", x.get_text())[1]) for x in ax.texts[:2]]
    for name, slope, side in zip(("ball 1", "ball 5"), told, (-1, 1), strict=True):
        time, place = shown[name].T
        near = (side * time > 0) & (side * time < 60)
        assert np.polyfit(time[near], place[near], 1)[0] == pytest.approx(slope, rel=0.03)
        straight = [x.get_xydata() for x in ax.lines if len(x.get_xydata()) == 2]
        (drawn_slope,) = {
            round((y1 - y0) / (x1 - x0), 2)
            for (x0, y0), (x1, y1) in straight
            if x0 == 0 and x1 * side > 0
        }
        assert drawn_slope == slope


def test_fig_measure_swing():
    """Marks of the film; a line through them; and how late gaps make it, from strike to strike."""
    figure = drawn("measure", ("setup", "phone", "track-call", "swing-fit", "fig-swing"))
    ax = figure["fig-measure-swing"].axes[0]
    marks, fit, without = (line.get_xydata().T for line in ax.get_lines())
    table = np.loadtxt(DATA / "swing_synthetic.txt", skiprows=3, encoding="utf-8")
    off = marks[1] - 1000 * table[:, 1]
    np.testing.assert_allclose(marks[0], table[:, 0])
    np.testing.assert_allclose(off, off[0])  # from where it hangs
    seen = marks[1][:-1] - np.interp(marks[0][:-1], *fit)
    assert np.std(seen) < 0.35  # mm; marks are off by 0.3
    assert np.std(marks[1][:-1] - np.interp(marks[0][:-1], *without)) > 1
    # Each strike crosses four gaps of 80 um; it ends with `e**4` and the damping of its swing.
    speed, late = 0.03 * 2 * math.pi / 0.8, 0.0
    for _ in range(14):
        speed *= math.exp(-0.02 * 0.2)
        for _ in range(4):
            speed *= (1 + 0.985) / 2
            late += 80e-6 / speed
        speed *= math.exp(-0.02 * 0.2)
    turn = [x[0][(x[0] > 5.2)][x[1][x[0] > 5.2].argmin()] for x in (fit, without)]
    (told,) = (re.search(r"(\d+) ms", x.get_text())[1] for x in ax.texts if "ms" in x.get_text())
    assert f"{1000 * (turn[0] - turn[1]):.0f}" == told == Chapter("measure").glued["swing-late"]
    assert 1000 * late == pytest.approx(int(told), abs=3)


@pytest.mark.parametrize(
    ("figure", "printed"),
    [
        ("fig-measure-fit", [0.1139, 0.1325]),
    ],
)
def test_likelihoods_cross_their_limit_at_the_printed_ends(figure, printed):
    ax = drawn("measure_ratios", RATIOS)[figure].axes[0]
    x, y = ax.get_lines()[0].get_xydata().T
    assert y.min() == pytest.approx(0, abs=1e-3)
    above = y > 3.84
    k = np.flatnonzero(above[1:] != above[:-1])
    ends = x[k] + (3.84 - y[k]) / (y[k + 1] - y[k]) * (x[k + 1] - x[k])
    np.testing.assert_allclose(ends, printed, rtol=0, atol=2e-4)


def test_fig_measure_check():
    """Bars as printed; dots and their errors from the table of shots."""
    ax = drawn("measure_ratios", RATIOS)["fig-measure-check"].axes[0]
    printed = Chapter("measure_ratios").printed("check").splitlines()[2:7]
    low, high = np.transpose([line.split()[3:5] for line in printed]).astype(float)
    np.testing.assert_allclose([bar.get_y() for bar in ax.patches], low, atol=5.1e-4)
    tops = [bar.get_y() + bar.get_height() for bar in ax.patches]
    np.testing.assert_allclose(tops, high, atol=5.1e-4)
    rows = read("shots_synthetic.csv", set="ABACA")
    before, after, sigma = (
        floats(row[name] for row in rows).reshape(-1, 5) for name in ("before", "after", "sigma")
    )
    speed = before[:, :1]
    for k, (dots, _, (bars,)) in enumerate(ax.containers[1:]):
        np.testing.assert_allclose(dots.get_ydata(), (after / speed)[:, k], rtol=1e-12)
        heights = [np.ptp(one[:, 1]) for one in bars.get_segments()]
        np.testing.assert_allclose(heights, (2 * sigma / speed)[:, k], rtol=1e-9)
    assert len(ax.containers) == 6


def test_fig_measure_fold():
    upper, lower = (
        drawn("table_2")[name].axes[0] for name in ("fig-measure-fold", "fig-table-2-valleys")
    )
    chain, model = paper_chain("CBD")
    back = float(model.backward[0])
    balls = chain.masses, chain.velocities, chain.restitution
    for k in (0, 300, 600, 780):
        shown = [lines(upper)[f"ball {i}"][k] for i in (1, 2, 3)]
        expected = velocities(balls, float(shown[0][0]), back)
        np.testing.assert_allclose([v for _, v in shown], expected, rtol=0, atol=1e-10)
    chain, _ = paper_chain("DAD")
    balls = chain.masses, chain.velocities, chain.restitution
    line = lines(lower)["data of true ratio 0.22"]
    at = np.argmin(abs(line[:, 0] - 0.22))
    assert line[at, 1] == 0
    data = velocities(balls, float(line[at, 0]))
    for k in (0, 250, 500, 790):
        miss = np.linalg.norm(velocities(balls, float(line[k, 0])) - data)
        assert line[k, 1] == pytest.approx(miss, abs=1e-10)
