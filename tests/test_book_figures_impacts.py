"""Every curve of multiple_impacts, patterns, n_balls and notation, against a second route."""

import math
import re
from itertools import pairwise

import numpy as np
import pytest
from chapters import Chapter, after, drawn, lines, panel, points, solved
from matplotlib.colors import to_hex
from test_book_n_balls import FIG_8, contact_work
from turns import by_turns, edge, last_with, turn

from cradle import ImpulseCorrelation, collide, ratio_table, textbook
from cradle.measures import bouncing_pattern

CLOSE = {"rtol": 0, "atol": 1e-12}
PAPER = [("end", 0), ("close", 0), ("end", 1), ("close", 1), ("end", 0), ("end", 1)]


def test_fig_sequence_map():
    """Above all areas: no forward impact; one of them: the sequence of Fig. 5."""
    ax = drawn("multiple_impacts")["fig-own-sequence"].axes[0]
    areas = {area.get_label(): area.get_paths()[0] for area in ax.collections}
    for ratio, e in panel("multiple_impacts", "fig-own-sequence")["2-3 drives"][5::9]:
        behind = [textbook.solve([1] * 3, [0, -0.8, -1], e + d, ratio) for d in (-1e-3, 1e-3)]
        assert [sum(done.collisions) > 3 for done in behind] == [True, False]
    assert len(areas) == 3
    for row in range(7, 120, 14):  # e; below, the textbook solver would have no limit to go to
        for column in range(3, 120, 9):
            e, ratio = (row + 0.5) / 240, (column + 0.5) / 240
            drawn_as = [name for name, area in areas.items() if area.contains_point((ratio, e))]
            if drawn_as == ["infinite"]:
                continue
            done = textbook.solve([1, 1, 1], [1, 0.8, 0], e, ratio)
            events = [x for x in done.events if x[0] != "maximum_compression"]
            found = events == PAPER
            short = not found and done.collisions[0] <= 2 and events.count(("close", 1)) == 0
            assert (drawn_as == ["the six events"]) == found
            assert (drawn_as == []) == short


def in_ratios(r1, r2):
    return [1 / r1, 1.0, 1 / r2], [1, 0, 0]


def test_fig_patterns_three():
    points = ((1.0, 1.0), (2.5, 1.0), (2.5, 0.25))
    for number, (r1, r2) in enumerate(points):
        v = after((*in_ratios(r1, r2), 0.5), 0.15)
        for ball, line in enumerate(panel("patterns", "fig-patterns-three", number).values()):
            places = 0.6 * ball + np.array([-1.0 * (ball == 0), 0, 2 * v[ball]])
            np.testing.assert_allclose(line, np.column_stack([places, [-1, 0, 2]]), **CLOSE)
    chart = drawn("patterns")["fig-p6"].axes[0]
    shown = [line.get_xydata().tolist() for line in chart.get_lines()]
    for r1, r2 in points:
        assert [[r2, r1]] in shown


def test_one_point_of_the_map_with_a_pencil():
    """The numbers of the text, from another solver; the three patterns are those it names."""
    done = textbook.solve([1, 1, 1], [1, 0, 0], 0.5, 0.15)
    assert list(done.collisions) == [1, 1]
    tau_2, tau_3 = done.impulses
    told = {"tau2": tau_2, "tau3": tau_3, "late": tau_3 - 0.15 * tau_2, "lead": 0.5}
    told |= {f"v{k}": v for k, v in enumerate(done.velocities[:2], start=1)}
    told["height"] = eq_44(1.0)
    Chapter("patterns").tells({f"point-{name}": value for name, value in told.items()})
    tau_2 = 1.5 * 0.4 / (0.85 * 0.4 + 1)  # Eq. 24
    tau_3 = tau_2 * 0.8 * (1 + 0.5 * math.sqrt(1 - 0.15 * 1.25))  # Eq. 30
    Chapter("patterns").tells({"light-tau2": tau_2, "heavy-tau3": tau_3})
    found = [
        bouncing_pattern(np.array(after((*in_ratios(r1, r2), 0.5), 0.15)))
        for r1, r2 in ((1.0, 1.0), (2.5, 1.0), (2.5, 0.25))
    ]
    assert found == [2, 1, 3]


def eq_44(r2, e=0.5, a=0.15):
    return (1 + e) * (1 + e * np.sqrt(1 - a * (1 + r2))) / (e * (1 + r2)) - (1 + a / e)


def test_fig_6_drawn():
    (ax,) = drawn("patterns")["fig-p6"].axes
    (enlarged,) = drawn("patterns")["fig-patterns-below"].axes
    shown = lines(ax)
    r2, r1 = shown["Eq. (44): back impact"].T
    np.testing.assert_allclose(r1, eq_44(r2), rtol=1e-13)
    rest_2 = 0.5 * math.sqrt(0.85 + 0.0375**2) - 0.01875  # Eq. 46
    np.testing.assert_allclose(shown["Eq. (45): $v_1^+ = 0$"], [(rest_2, 1.7), (3.2, 1.7)])
    np.testing.assert_allclose(shown["Eq. (46): $v_2^+ = 0$"], [(rest_2, 1.7), (rest_2, 3.2)])
    np.testing.assert_allclose(shown["all three meet"], [(rest_2, 1.7)])
    for number in (4, 5):  # a further collision sets in
        for r2, r1 in lines(enlarged)[f"{number} collisions"][60::40]:
            for side, expected in ((1 - 1e-6, number), (1 + 1e-6, number - 1)):
                if r1 > 0.01:
                    assert by_turns(r1 * side, r2, 0.5, 0.15)[0] == expected
    (endless,) = (area for area in enlarged.collections if area.get_label() == "endless")
    corner = endless.get_paths()[0].vertices
    for r2, r1 in corner[(corner[:, 0] > 0.001) & (corner[:, 1] > 0.01)][::7]:
        assert r1 == pytest.approx(edge(r2, 0.5, 0.15), abs=1e-3)
    for number in range(4, 9):  # and more of them in the corner
        for r2, r1 in lines(enlarged)[f"{number} collisions"][40:110:25]:
            for side, expected in ((1 - 1e-6, number), (1 + 1e-6, number - 1)):
                assert r1 > 0.01
                assert by_turns(r1 * side, r2, 0.5, 0.15)[0] == expected
    # Shaded: where balls 1 and 2 go back.
    back = set()
    for chart, right, top in ((ax, 3.05, 3.05), (enlarged, 0.29, 1.05)):
        shades = [x.get_paths()[0] for x in chart.collections if getattr(x, "filled", False)]
        assert len(shades) == 2
        for r1 in np.linspace(0.15, top, 8):
            for r2 in np.linspace(right / 20, right, 8):
                v = by_turns(r1, r2, 0.5, 0.15)[1]
                shown = [path.contains_point((r2, r1)) for path in shades]
                assert shown == [v[0] < 0, v[1] < 0], (r1, r2)
                back |= {(chart is enlarged, sum(shown))}
    assert len(back) == 6  # none, ball 1, both: in either


def test_fig_patterns_turns():
    """The curves, and the turns of an impact on them; by another map."""
    drawn_lines = drawn("reading_counting")["fig-patterns-turns"].axes[0].get_lines()
    dots = [x.get_xydata() for x in drawn_lines if x.get_marker() == "o"]
    found = []
    for name, line in panel("reading_counting", "fig-patterns-turns").items():
        r = float(re.search(r"r = ([\d.]+)", name)[1])
        if "border" in name:
            r, _ = last_with(lambda r: edge(r, 0.5, 0.15) > r, 0.03, 0.08)
            assert abs(line[:, 1].min()) < 1e-4
        for zeta, rise in line[::50]:
            x, _, y, a = turn(zeta, r, 0.5, 0.15)
            assert rise == pytest.approx(a * y / (y - x) - zeta, rel=1e-9, abs=1e-12)
        if "none" in name or "two" in name:
            turns = dots[len(found)]
            assert turns[0, 0] == pytest.approx(0.5 * (0.85 + r) / 1.5, rel=1e-12)
            np.testing.assert_allclose(turns[1:, 0], turns[:-1].sum(axis=1), **CLOSE)
            found.append(len(turns))
            assert (line[:, 1].min() > 0) == ("none" in name)
            assert (turns[-1, 1] < 1e-6) == ("two" in name)
    assert len(found) == 2


def test_fig_patterns_turn():
    """Work and momentum of the new contact, phase by phase, and its end if it went on alone."""
    shown = panel("reading_counting", "fig-patterns-turn")
    names = "new contact", "old contact", "alone"
    new, old, alone = (shown[name] for name in names)
    assert (new[:, 0] == old[:, 0]).all()
    a, e, r = 0.4, 0.5, 0.5
    push = np.diff(new[:, 0]), np.diff(new[:, 1]), np.diff(old[:, 1])
    moved = {  # by unit impulse of the new contact: its u and that of the old one
        0: (1 / a - 1 - r, 1 - (1 + r) / a),
        1: (-1 - r, 1),
        2: (a - 1 - r, 1 - a * (1 + r)),
    }
    for k, (own, other) in moved.items():
        assert push[1][k] == pytest.approx(own * push[0][k], rel=1e-12)
        assert push[2][k] == pytest.approx(other * push[0][k], rel=1e-12)
    for line in (new, np.vstack([new[:3], alone[1]])):  # e^2 of the work taken in is given back
        (zero,) = [t + u * (s - t) / (u - w) for (t, u), (s, w) in pairwise(line) if u > 0 > w]
        taken = new[1, 1] * zero / 2
        steps = [(zero, 0.0), *line[2:]]
        back = -sum((s - t) * (u + w) / 2 for (t, u), (s, w) in pairwise(steps))
        assert back == pytest.approx(e**2 * taken, rel=1e-12)


def test_fig_patterns_corner():
    (ax,) = drawn("reading_counting")["fig-patterns-corner"].axes
    shades = [x.get_paths()[0] for x in ax.collections if getattr(x, "filled", False)]
    back = set()
    for r1 in np.geomspace(0.15, 2.9, 9):
        for r2 in np.geomspace(0.0055, 2.5, 15):
            v = by_turns(r1, r2, 0.5, 0.15)[1]
            if min(abs(v[0]), abs(v[1])) > 0.003:
                shown = [path.contains_point((r2, r1)) for path in shades]
                assert shown == [v[0] < 0, v[1] < 0], (r1, r2)
                back |= {tuple(shown)}
    assert len(back) == 3
    curves = [x for x in ax.get_lines() if x.get_marker() != "o"]
    border, closed = [x.get_xydata() for x in curves if x.get_color() != "0.35"]
    for r2, r1 in border[:20:6]:
        assert r1 == pytest.approx(edge(r2, 0.5, 0.15), rel=1e-6)
    np.testing.assert_allclose((1 + closed).prod(axis=1), 1.5**2 / 2, rtol=1e-6)
    # The thin borders, from the third collision on: the map of turns counts one more below.
    thin = [x.get_xydata() for x in ax.get_lines() if x.get_color() == "0.35"]
    assert len(thin) == 8
    for number, line in enumerate(thin, start=3):
        for r2, r1 in line[~np.isnan(line[:, 1])][20::60]:
            assert by_turns(r1 * (1 - 1e-7), r2, 0.5, 0.15)[0] == number
            assert by_turns(r1 * (1 + 1e-7), r2, 0.5, 0.15)[0] == number - 1
    dots = [x.get_xydata()[0] for x in ax.get_lines() if x.get_marker() == "o"]
    assert len(dots) == 3
    for r2, r1 in dots:
        np.testing.assert_allclose(by_turns(r1, r2, 0.5, 0.15)[1][:2], 0, atol=1e-9)
    names = [x.get_text() for x in ax.texts if x.get_text().isdigit()]
    assert names == ["3", "4", "5", "6", "10"]


def test_fig_patterns_parameters():
    """Areas: blue where ball 1 goes back, orange where ball 2 does; the border of the hatching."""
    cases = [(0.5, 0.15), (1.0, 0.15), (0.1, 0.15), (0.4, 0.5)]
    axes = drawn("reading_patterns")["fig-patterns-parameters"].axes
    seen = set()
    for ax, (e, a) in zip(axes, cases, strict=True):
        shades = {
            to_hex(shade.get_facecolor()[0]): shade.get_paths()[0]
            for shade in ax.collections
            if getattr(shade, "filled", False)
        }
        some = np.linspace(0, min(ax.get_xlim()[1], 1 / a - 1 if a else np.inf), 14)[1:-1]
        for r1 in some:
            for r2 in some:
                number, v = by_turns(r1, r2, e, a)
                if number < 60 and min(abs(v[0]), abs(v[1])) > 0.01:
                    for speed, colour in zip(v, ("#d0e6f5", "#fae2bb")):
                        area = shades.get(colour)
                        assert (area and area.contains_point((r2, r1))) == (area and speed < 0)
                        assert area or speed > 0
                        seen |= {(colour, speed < 0)}
        (curve,) = [x.get_xydata() for x in ax.get_lines()]
        r2, r1 = curve[~np.isnan(curve[:, 1])].T
        np.testing.assert_allclose(r1, eq_44(r2, e, a), rtol=1e-12)
        assert len(ax.patches) == (e < 1)
        for corner in ax.patches:
            for r2, r1 in corner.get_xy()[1:24:4]:
                assert r1 == pytest.approx(edge(r2, e, a), rel=1e-6)
    assert len(seen) == 4


def test_fig_patterns_micro():
    rows = Chapter("reading_counting").printed("patterns-counts").splitlines()[1:]
    for row, r in zip(rows, np.repeat([1e-2, 1e-4, 1e-6], 3), strict=True):
        a, number, estimate = map(float, row.split()[1:])
        assert number == by_turns(r, r, 1, a)[0]
        assert estimate == pytest.approx(np.pi * np.sqrt((1 - a) / (2 * r)), abs=0.051)
    low = panel("patterns", "fig-patterns-micro")
    r, first = low["$v_1^+$"][:, 0], 4000 - len(low["$v_2^+$"])
    low["$v_2^+$"] = np.vstack([np.full((first, 2), np.nan), low["$v_2^+$"]])
    for k in range(100, 4000, 350):
        _, v = by_turns(r[k], r[k], 1, 0.15)
        for ball in range(3) if k >= first else (0, 2):
            assert low[f"$v_{ball + 1}^+$"][k, 1] == pytest.approx(v[ball], abs=1e-10)
    assert r[first] < 0.01
    assert low["Fig. 7"][0] == pytest.approx([0.01, by_turns(0.01, 0.01, 1, 0.15)[1][1]], abs=1e-9)


def test_fig_8_drawn():
    """Part (b) is the package's path; part (a) leaves it where the two runs would meet."""
    trace = collide(FIG_8, ImpulseCorrelation(0.1))
    rows = [0, *(k for k, x in enumerate(trace.events, 1) if x.kind != "maximum_compression")]
    path, impulses = trace.path[rows], trace.path_impulses[rows]
    met = [tuple(trace.events[k - 1]) for k in rows[1:]].index(("close", 1)) + 1
    # Each pair, left alone, ends with the relative motion that its contact has paid for.
    start = rows[met - 1]
    v = trace.path[start]
    back = impulses[met - 1, 0] - impulses[met - 2, 0]
    left = math.hypot(v[0] - v[1], math.sqrt(2 * back * (v[0] - v[1])))
    right = math.hypot(v[2] - v[3], math.sqrt(4 * contact_work(trace, 2, start)))
    ends = [v[0] + v[1] - left, v[0] + v[1] + left, v[2] + v[3] - right, v[2] + v[3] + right]
    for contact in range(3):
        both, apart = (panel("reading_n_balls", "fig-p8", 2 * contact + row) for row in (1, 0))
        for ball in (contact, contact + 1):
            name = f"$v_{ball + 1}$"
            expected = np.column_stack([impulses[:, contact], path[:, ball]])
            np.testing.assert_allclose(both[name], expected, **CLOSE)
            np.testing.assert_allclose(apart[name][:met], expected[:met], **CLOSE)
            np.testing.assert_allclose(apart[name][met:, 1], ends[ball] / 2, **CLOSE)


@pytest.mark.parametrize(
    ("chapter", "figure", "chain", "ratio"),
    [
        ("multiple_impacts", "fig-own-multiple-work", ([1] * 3, [1, 0.8, 0], 0.25), 0.15),
    ],
)
def test_works_are_areas(chapter, figure, chain, ratio):
    """The lines are the closing speeds; in each collision orange is e^2 times blue."""
    path, impulses = solved(chain, ratio)
    for contact in range(len(chain[0]) - 1):
        (line,) = panel(chapter, figure, contact).values()
        u = path[:, contact] - path[:, contact + 1]
        np.testing.assert_allclose(line, np.column_stack([impulses[:, contact], u]), **CLOSE)
        step = (u[1:] + u[:-1]) / 2 * np.diff(impulses[:, contact])
        blue, orange = step[step > 0].sum(), -step[step < 0].sum()
        assert orange == pytest.approx(chain[2] ** 2 * blue, rel=1e-9)


def test_work_given_back_with_a_bend():
    """Contact 1-2 from its second maximum on: both areas are e^2 times what it absorbed."""
    path, impulses = solved(([1] * 3, [1, 0.8, 0], 0.25), 0.15)
    u, tau = path[:, 0] - path[:, 1], impulses[:, 0]
    shown = panel("multiple_impacts", "fig-own-multiple-back")
    (top,) = np.flatnonzero(abs(tau - shown["$u_2$"][0, 0]) < 1e-12)
    line = np.column_stack([tau, u])[top : top + 3]
    np.testing.assert_allclose(shown["$u_2$"], line, **CLOSE)
    (_, _), (x, height), (end, low) = line
    triangle, trapezium = height**2 / 4, -(height + low) * (end - x) / 2
    ends = np.flatnonzero(tau == tau[1:][np.diff(tau) == 0][0])[-1]  # of the first collision
    step = (u[1:] + u[:-1]) / 2 * np.diff(tau)
    absorbed = step[ends:top].sum()
    assert triangle + trapezium == pytest.approx(0.25**2 * absorbed, rel=1e-9)
    (_, start), (_, stop) = shown["slope 2, extended"]
    assert start - stop == pytest.approx(2 * (end - x))
    assert (height - low) / (end - x) == pytest.approx(2 - 0.15)
    told = Chapter("multiple_impacts").cells["event-5"].outputs[0].data["text/latex"]
    printed = [float(number) for number in re.findall(r"\d\.\d+", told)]
    top_speed, base, _, work, bend, _, sigma = printed
    assert work == pytest.approx(absorbed, abs=6e-5)
    assert [top_speed, base] == pytest.approx([u[top - 1], tau[top - 1] - tau[ends]], abs=6e-4)
    assert [bend, sigma] == pytest.approx([-height, end - x], abs=6e-5)


def test_fig_area_of_the_toy():
    """Contact 2-3 of five balls, its line extended back to what ball 2 gains; as much orange."""
    path, impulses = solved(([1] * 5, [1, 0, 0, 0, 0], 1), 0.15)
    shown = panel("n_balls", "fig-own-n-balls-area")
    line = np.column_stack([impulses[:, 1], path[:, 1] - path[:, 2]])
    np.testing.assert_allclose(shown["$u_3$"], line, **CLOSE)
    start, bend = shown["second piece, extended"]
    np.testing.assert_allclose(start, [0, 2 / 1.85], **CLOSE)
    assert abs(line - bend).sum(axis=1).min() < 1e-12
    assert line[-1, 0] == pytest.approx(2 / 1.85)


def test_fig_overlap():
    """Each bar ends where its run, left alone, would: by the works of the two pairs."""
    trace = collide(FIG_8, ImpulseCorrelation(0.15))
    row = trace.events.index(("end", 1)) + 1
    start, again = trace.path[row], trace.events.index(("close", 0)) + 1
    for ball, c, begun, way in ((2, 0, again, 1), (3, 2, 0, -1)):
        # Two balls of 1 kg: what their contact has stored gives back a relative velocity.
        work = contact_work(trace, c, row) - contact_work(trace, c, begun)
        apart = np.sqrt((start[c] - start[c + 1]) ** 2 + 4 * work)
        end = (start[c] + start[c + 1] + way * apart) / 2
        bar = panel("n_balls", "fig-own-overlap")[f"ball {ball}"][:, 0]
        assert bar == pytest.approx([start[ball - 1], end], abs=1e-12)
    ((low, high),) = [
        sorted({x for x, _ in patch.get_path().vertices})
        if not hasattr(patch, "get_width")
        else (patch.get_x(), patch.get_x() + patch.get_width())
        for patch in drawn("n_balls")["fig-own-overlap"].axes[0].patches[:1]
    ]
    met = trace.path[trace.events.index(("close", 1)) + 1, 1]
    assert (low + high) / 2 == pytest.approx(met, abs=1e-12)
    words = Chapter("n_balls").printed("fig8-overlap").replace(",", "").split()
    printed = words[words.index("overlap") + 1], words[words.index("midpoint") - 1]
    assert [float(x) for x in printed] == pytest.approx([low, high], abs=6e-5)


def test_fig_experiments_swap_as_drawn():
    table = ratio_table().set_index("triplet").ratio
    (ax,) = drawn("reading_table_2")["fig-experiments-swap"].axes
    shown = {tuple(np.round(line[0], 9)) for line in points(ax, 1)}
    printed = {(table[x + "C" + z], table[x + "B" + z]) for x in "ABCD" for z in "ABCD"}
    put_back = {(table[t[0] + "C" + t[2]], table[t[::-1]]) for t in ("DBB", "BBD", "DBC", "CBD")}
    assert shown == printed | put_back


def test_fig_notation_contact():
    (line,) = [
        x.get_xydata()
        for x in drawn("notation")["fig-own-notation-contact"].axes[0].get_lines()
        if len(x.get_xdata()) == 3
    ]
    np.testing.assert_allclose(line, [(0, 1), (0.5, 0), (0.85, -0.7)], **CLOSE)
