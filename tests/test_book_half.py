"""Half a minute of a cradle: what its page prints, says and draws, by second routes."""

import re

import numpy as np
import pytest
import real_swing
from chapters import Chapter, points
from real_cradles import table
from stored import read

from cradle.pictures.impacts import ball_style

HALF = Chapter("observations_half")


def rows(cell):
    """Numbers at the end of each line of a printed table of the appendix, by the words before."""
    found = {}
    for line in HALF.printed(cell).splitlines()[1:]:
        words, numbers = re.fullmatch(r"(.*?)((?:\s+-?\d+(?:\.\d+)?)*)", line.strip()).groups()
        if numbers:
            found[" ".join(words.split())] = [float(x) for x in numbers.split()]
    return found


def marked(ax, marker):
    """Points drawn with one marker, in the order of x."""
    return np.array(sorted(map(tuple, np.concatenate(points(ax, marker=marker)))))


def test_swing_of_the_mean():
    size, damping, period, _ = real_swing.common()
    shown = [value for (value,) in rows("mean").values()]
    assert shown[:3] == [round(1000 * size, 2), round(period, 4), round(damping, 4)]
    # Air alone: the drag of Stokes for slow oscillations, over twice the mass.
    layer = np.sqrt(2 * 1.8e-5 / 1.2 * period / (2 * np.pi))
    air = 3 * np.pi * 1.8e-5 * 0.01109 * (1 + 0.01109 / layer) / 0.044756
    HALF.tells({"mean-loss": 100 * damping})
    assert np.exp(-30 * damping) == pytest.approx(0.5, abs=0.06)  # chapter 9: about half of it
    slow, fast = (float(x) for x in HALF.glued["air-loss"].split(" to "))
    assert slow == pytest.approx(100 * air, abs=6e-3)
    assert 1.5 * slow < fast < 0.05 * 100 * damping
    # After 23 s most of the motion is that of the mean.
    t, *x = table("cradle_trace.csv").values()
    late = np.array(x)[:, t > 23.5]
    assert 5 * np.nanvar(late.mean(axis=0)) > 0.8 * np.nanvar(late, axis=1).sum()


def test_fig_half():
    *windows, top = HALF.figures["fig-real-half"].axes
    ball, time, place, *_ = real_swing.peaks()
    for k, marker in ((0, "o"), (4, "s")):
        own = ball == k
        assert marked(top, marker) == pytest.approx(
            np.column_stack([time[own], 1000 * np.abs(place[own])])
        )
    assert len(time) == int(HALF.glued["turns"])
    shown = rows("runs")
    for row in read("cradle_fits.csv"):
        expected = [float(row["chi_places"]), float(row["chi_times"])]
        name = {"touching": "constant restitution, touching"}.get(row["law"], row["law"])
        assert shown[name][1:] == pytest.approx(expected, rel=0.02)
    panels = HALF.figures["fig-real-left"].axes  # of places
    for ax, law in zip(panels, ("constant loss", "constant restitution"), strict=True):
        assert ax.get_title(loc="left") == law
        drawn = np.concatenate([marked(ax, "o"), marked(ax, "s")])
        assert ax.get_ylim()[0] < drawn[:, 1].min()
        assert ax.get_ylim()[1] > drawn[:, 1].max()
        expected = np.concatenate([np.sort(time[ball == b]) for b in (0, 4)])
        assert drawn[:, 0] == pytest.approx(expected)
        assert (drawn[:, 1] ** 2).sum() == pytest.approx(shown[law][1], abs=0.6)
        late = drawn[:, 0] > 24
        assert (drawn[late, 1] ** 2).mean() > 4  # in the end every fit is off
    for law in ("constant loss", "constant restitution", "viscous loss"):
        assert min(shown[law][1:]) > 2 * len(time)  # no law is right
    rms = [np.sqrt(sum_ / len(time)) for sum_ in shown["constant loss"][1:]]
    HALF.tells({"off-places": rms[0], "clock": rms[1], "right": 2 * len(time) - 7})
    HALF.tells({"lost": 1000 * float(read("cradle_fits.csv", law="constant loss")[0]["loss"])})
    # Where an outer ball turns within a window, the curve in its colour has that place.
    colours = [ball_style(k)["color"] for k in range(5)]
    for ax in windows:
        curves = {colours.index(x.get_color()): x.get_xydata() for x in ax.get_lines()}
        assert sorted(curves) == list(range(5))
        low, high = ax.get_xlim()
        inside = (time > low + 0.1) & (time < high - 0.1)
        assert inside.sum() >= 4
        for k, t, x in zip(ball[inside], time[inside], place[inside]):
            near = curves[k][np.abs(curves[k][:, 0] - t) < 0.06, 1]
            assert near[np.nanargmax(np.abs(near))] == pytest.approx(1000 * x, abs=1)


def test_a_line_and_not_an_exponential():
    lines, exponentials = (
        [float(x) for x in HALF.glued[name].split(" and ")] for name in ("line", "exponential")
    )
    t, ends = table("cradle_peaks.csv"), []
    *_, ax = HALF.figures["fig-real-half"].axes
    drawn = [
        x.get_xydata().T for x in ax.get_lines() if x.get_ls() == "-" and len(x.get_xdata()) == 81
    ]
    for k, ball in enumerate((1, 5)):
        use = (t["ball"] == ball) & (t["kind"] == "flight") & (t["t_s"] < 20)
        x, size, error = t["t_s"][use], np.abs(t["x_m"][use]), t["u_x"][use]
        line = np.polyfit(x, size, 1, w=1 / error)
        least = (((size - np.polyval(line, x)) / error) ** 2).sum()
        assert lines[k] == pytest.approx(least, abs=0.51)
        assert drawn[k][1] == pytest.approx(1000 * np.polyval(line, drawn[k][0]), rel=1e-6)
        assert exponentials[k] > 5 * least
        assert int(HALF.glued["flights"]) == use.sum() - 2
        ends.append(np.polyval(line, [0, 20]))
    # With a pencil: 2 u0 of the speed each half swing, and the damping of the mean of the five.
    _, damping, *_ = real_swing.common()
    lost = float(read("cradle_fits.csv", law="constant loss")[0]["loss"])
    v = np.eye(5)[0]
    for k in range(4):  # they part by u - u0
        v[k : k + 2] = lost / 2, v[k] - lost / 2
    assert 1 - v[4] == pytest.approx(2 * lost)
    impacts = (1 - v[4]) * 2000 / (2 * np.pi)
    first, last = impacts + 1000 * damping * np.mean(ends, axis=0)
    HALF.tells({"by-impacts": impacts, "estimate-first": first, "estimate-last": last})
    assert (first + last) / 2 - impacts == pytest.approx(impacts, rel=0.2)  # about equal
    # The computed swing: from the first turn of the five seconds to the last.
    rows = read("cradle_turns.csv", law="constant loss")
    for name, low, high in (("first", 0, 5), ("last", 15, 20)):
        slopes = []
        for ball in ("1", "5"):
            own = [
                (float(x["t_s"]), 1000 * abs(float(x["x_m"]))) for x in rows if x["ball"] == ball
            ]
            (t0, x0), *_, (t1, x1) = [p for p in own if low + 0.5 < p[0] < high]
            slopes.append((x0 - x1) / (t1 - t0))
        assert float(HALF.glued[f"computed-{name}"]) == pytest.approx(np.mean(slopes), abs=0.09)
