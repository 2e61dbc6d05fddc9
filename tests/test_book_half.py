"""Half a minute of a cradle: what its page prints, says and draws, by second routes."""

import re

import numpy as np
import pytest
import real_cradles
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


def viscous(loss, speed, mass=0.044756, k=1e10):
    """Restitution of two spheres, by an integrator of its own."""
    length = (mass * speed**2 / k) ** 0.4
    return np.ptp(real_cradles.spheres([1, 0], [0], loss * speed / length))


def best_fit(gap=None):
    """The stored constant loss, run by the script that fitted it; when the ball is let go."""
    row = read("cradle_fits.csv", law="constant loss")[0]
    p = [float(row[name]) for name in real_swing.COLUMNS[1:6]]
    p[1] = p[1] if gap is None else gap
    return real_swing.swung("constant loss", p, real_swing.common()[1]), p


def test_what_gaps_do_to_the_swing():
    run, (lost, gap, place, start, period) = best_fit()
    omega = 2 * np.pi / period
    length = 9.81 / omega**2
    fall = 2 * 9.81 * length * (1 - np.cos(place / length))
    u = np.sqrt(fall) * np.exp(-real_swing.common()[1] * period / 4)
    assert float(HALF.glued["u-first"]) == pytest.approx(1000 * u, rel=5e-3)
    HALF.tells({"e-first": 1 - lost / u, "cross-first": 3000 * gap / u})
    # A strike is four impacts, until the balls swing together.
    after_20 = int(np.argmin([abs(x.time + start - 20) for x in run.impacts])) // 4 * 4
    strike = run.impacts[after_20 : after_20 + 4]
    assert [x.contacts[0] for x in strike] in ([0, 1, 2, 3], [3, 2, 1, 0])
    c = strike[0].contacts[0]
    u = abs(strike[0].before[c] - strike[0].before[c + 1])
    HALF.tells({"u-last": 1000 * u, "e-last": 1 - lost / u})
    took = strike[3].time - strike[0].time
    row = abs(np.interp(strike[0].time, run.times, run.positions[:, 2]))
    HALF.tells({"cross-last": 1000 * took, "row": 1000 * row})
    # Gravity pulls it back with omega^2 x; half swings of half a period.
    slowed = 1000 * omega**2 * row * took / omega / (period / 2)
    assert float(HALF.glued["by-gaps-last"]) == pytest.approx(slowed, rel=0.05)
    assert float(HALF.glued["by-gaps-first"]) < 0.05 * slowed
    # Without gaps.
    touching, _ = best_fit(0.0)
    strikes = [[x.time for x in a.impacts if 0 in x.contacts] for a in (run, touching)]
    number = int(np.argmin(np.abs(np.array(strikes[0]) + start - 10)))
    early = 1000 * (strikes[0][number] - strikes[1][number])
    assert float(HALF.glued["early"]) == pytest.approx(early, abs=4)  # of contact 2-3 or so
    late = [
        abs(x.before[x.contacts[0]] - x.before[x.contacts[0] + 1])
        for x in run.impacts
        if x.time + start > 23
    ]
    HALF.tells({"late": np.median(late) / lost})


def test_fig_half():
    *windows, top = HALF.figures["fig-real-half"].axes
    ball, time, place, *_ = real_swing.peaks()
    for k, marker in ((0, "o"), (4, "s")):
        own = ball == k
        assert marked(top, marker) == pytest.approx(
            np.column_stack([time[own], 1000 * np.abs(place[own])])
        )
    assert len(time) == int(HALF.glued["turns"])
    _, _, _, u_time, u_place = real_swing.peaks()
    HALF.tells({"error-mm": 1000 * np.median(u_place), "error-ms": 1000 * np.median(u_time)})
    # The mean of all five: cosine and sine fitted in two seconds, beside the whole.
    size, damping, period, first = real_swing.common()
    diamonds = marked(HALF.figures["fig-real-mean"].axes[0], "d")
    assert diamonds[:, 0] == pytest.approx(np.arange(1.8, 30, 2))
    t, *x = table("cradle_trace.csv").values()
    mean = 1000 * np.mean(x, axis=0)
    whole = np.isfinite(mean) & (t > 0.8)
    for middle, shown_size in diamonds:
        own = whole & (abs(t - middle) <= 1)
        turn = 2 * np.pi * (t[own] - first) / period
        waves = np.column_stack([np.cos(turn), np.sin(turn), np.ones(own.sum())])
        along, aside, _ = np.linalg.lstsq(waves, mean[own], rcond=None)[0]
        assert shown_size == pytest.approx(np.hypot(along, aside), abs=0.2)
        assert shown_size == pytest.approx(1000 * size * np.exp(-damping * middle), abs=0.5)
    shown = {}
    for line in HALF.printed("runs").splitlines()[2:]:
        law, kept, *found = re.split(r"\s{2,}", line.strip())
        law = {"… any law, touching": "touching"}.get(law, law.removeprefix("… "))
        shown[law] = kept, *(float(x) for x in found)
    for row in read("cradle_fits.csv"):
        expected = [float(row["chi_places"]), float(row["chi_times"])]
        kept, gap, *chi, total = shown[row["law"]]
        shown[row["law"]] = [gap, *chi]
        assert gap == round(1e6 * float(row["gap_m"]))
        assert chi == pytest.approx(expected, rel=0.02)
        assert total == sum(chi)
        ends = [float(x) for x in kept.split(" to ")]
        rules = {"constant loss": lambda loss, u: 1 - loss / u, "viscous loss": viscous}
        rule = rules.get(row["law"].split(",")[0], lambda loss, _: loss)
        for told, name in zip((ends[0], ends[-1]), ("first", "last")):
            u = float(HALF.glued[f"u-{name}"]) / 1000
            assert told == pytest.approx(rule(float(row["loss"]), u), abs=6e-4)
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
    strings = 1000 * damping * np.mean(ends, axis=0)
    HALF.tells({"by-impacts": impacts})
    for name, by_strings in zip(("first", "last"), strings, strict=True):
        total = impacts + by_strings + float(HALF.glued[f"by-gaps-{name}"])
        HALF.tells({f"by-strings-{name}": by_strings})
        HALF.tells({f"estimate-{name}": total}, off=0.006)
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
