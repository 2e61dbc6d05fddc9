"""Every curve of the landing page and the first three chapters, against a second route."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from chapters import BOOK, Chapter, after, code, drawn, panel, solved
from test_book_compliance import (
    constant_ratio,
    first_loss,
    outcome,
    printed_7_to_9,
    printed_10_and_11,
)

from cradle import Chain, ImpulseCorrelation, collide, textbook

EQUAL = [1, 1, 1], [1, 0, 0], 1
THREE = [1.0, 1.0, 1.0], [1.0, 0.0, 0.0], [0.9, 0.8]  # of three_balls, ratio 0.15
FIVE = [1, 1, 1], [1, 0.8, 0], 0.25  # of multiple_impacts, ratio 0.15
LIGHT = [100, 1, 100], [1, 0, 0], 1  # Fig. 7, ratio 0.15
CLOSE = {"rtol": 0, "atol": 1e-12}


#: Drawings without numbers, what moves (tested by its cell), and names that tests put together.
OTHERS = {
    *("fig-p1", "fig-p2", "fig-p9", "fig-own-notation-chain", "fig-own-notation-ratio"),
    "fig-own-solver-phases",
    *("fig-flight", "fig-recipe-film", "fig-toy-film"),
    *("fig-p10", "fig-p11", "fig-p12"),
}


def test_every_figure_is_checked():
    """What no test names has no check."""
    text = "".join(
        path.read_text(encoding="utf-8") for path in Path(__file__).parent.glob("test_*.py")
    )
    named = (
        cell.metadata.get("mystnb", {}).get("figure", {}).get("name")
        for path in BOOK.glob("*.ipynb")
        for cell in code(path.stem)
    )
    for name in set(filter(None, named)) - OTHERS:
        assert f'"{name}"' in text, name


@pytest.mark.parametrize(
    ("chapter", "figure", "chain", "ratio"),
    [
        ("three_balls", "fig-own-three-opening", THREE, 0.15),
        ("patterns", "fig-own-patterns-light", LIGHT, 0.15),
        ("n_balls", "fig-own-n-balls-toy", ([1] * 5, [1, 0, 0, 0, 0], 1), 0.15),
    ],
)
def test_opening_figures(chapter, figure, chain, ratio):
    follows(panel(chapter, figure), *solved(chain, ratio))


def follows(shown, path, impulses):
    """The lines of all balls go through these points."""
    assert list(shown) == [f"$v_{i + 1}$" for i in range(path.shape[1])]
    for ball, line in enumerate(shown.values()):
        expected = np.column_stack([impulses.sum(axis=1), path[:, ball]])
        np.testing.assert_allclose(line, expected, **CLOSE)


def test_six_events_at_equal_distances():
    """Each velocity at each event; bars: who acts between two, and dark who sets the pace."""
    done = textbook.solve(*FIVE, 0.15)
    rows = [0, *(k for k, (kind, _) in enumerate(done.events, 1) if kind in ("end", "close"))]
    path, impulses = np.array(done.path)[rows], np.array(done.path_impulses)[rows]
    shown = panel("multiple_impacts", "fig-own-multiple-opening")
    assert list(shown) == ["$v_1$", "$v_2$", "$v_3$"]
    for ball, line in enumerate(shown.values()):
        np.testing.assert_allclose(line, np.column_stack([range(7), path[:, ball]]), **CLOSE)
    upper, bars = drawn("multiple_impacts")["fig-own-multiple-opening"].axes
    (lens,) = upper.child_axes
    for ball, line in zip((1, 2), lens.get_lines()):
        np.testing.assert_allclose(line.get_ydata(), path[:, ball], **CLOSE)
    # Dots: two neighbours are equally fast, between the events where that happens.
    dots = upper.get_lines()[-1].get_xydata()
    kinds = [(row, c) for row, (kind, c) in enumerate(done.events, 1) if kind[0] == "m"]
    assert [int(x) for x, _ in dots] == [np.searchsorted(rows, row) - 1 for row, _ in kinds]
    for (x, y), (row, c) in zip(dots, kinds, strict=True):
        there = [np.interp(x, range(7), path[:, ball]) for ball in (c, c + 1)]
        assert [*there, done.path[row][c]] == pytest.approx([y] * 3, abs=1e-12)
    found = {}
    for bar in bars.collections:
        if bar.get_label() == "_child0":  # the dotted lines of the events
            continue
        ((left, low),) = [shape.vertices.min(axis=0) for shape in bar.get_paths()]
        found[round(left), round(low + 0.3)] = bar.get_facecolor()[0, 0]
    acts = np.diff(impulses, axis=0)
    assert set(found) == {(k, c) for k, step in enumerate(acts) for c in (0, 1) if step[c] > 0}
    for k, step in enumerate(acts):
        dark = min((0, 1), key=lambda c: found.get((k, c), 1.0))
        assert step[dark] == step.max()
        if (step > 0).all():
            assert min(step) == pytest.approx(0.15 * max(step), rel=1e-12)
    told = [text.get_text() for text in bars.texts if text.get_text()]
    assert told == ["drives", "driven", "alone"] * 3


def test_two_runs_are_drawn_without_bends_between_events():
    """Lines bend where a contact ends or closes, and nowhere else: one run does not wait."""
    done = textbook.solve([1] * 4, [1, 0.5, 0, 0], 1, 0.15)
    rows = [0, *(k for k, (kind, _) in enumerate(done.events, 1) if kind in ("end", "close"))]
    path, impulses = np.array(done.path)[rows], np.array(done.path_impulses)[rows]
    follows(panel("n_balls", "fig-own-n-balls-opening"), path, impulses)
    assert len(done.events) + 1 - len(rows) > 0


@pytest.mark.parametrize("contact", [0, 1])
@pytest.mark.parametrize(
    ("chapter", "figure", "chain"),
    [
        ("reading_three_balls", "fig-p3", THREE),
        ("reading_multiple_impacts", "fig-p5", FIVE),
        ("reading_patterns", "fig-p7", LIGHT),
    ],
)
def test_velocity_impulse_diagrams(chapter, figure, chain, contact):
    path, impulses = solved(chain, 0.15)
    shown = panel(chapter, figure, contact)
    for ball in (contact, contact + 1):
        expected = np.column_stack([impulses[:, contact], path[:, ball]])
        np.testing.assert_allclose(shown[f"$v_{ball + 1}$"], expected, rtol=0, atol=1e-10)


def test_fig_p5_who_acts_and_who_drives():
    strip = drawn("reading_multiple_impacts")["fig-p5"].axes[3]
    bars = {
        (round(box.x0 + 0.5), 1 - round((box.y0 + box.y1) / 2))
        for bar in strip.collections
        for box in [bar.get_paths()[0].get_extents()]
    }
    _, impulses = solved(FIVE, 0.15)
    pushes = np.diff(impulses, axis=0)
    acts = [tuple(row) for row in pushes > 1e-12]
    acts = [row for row, before in zip(acts, [None, *acts]) if row != before]
    assert bars == {(k, c) for k, row in enumerate(acts, 1) for c in (0, 1) if row[c]}
    arrows = [(text.xy[0], text.xy[1] < text.xyann[1]) for text in strip.texts]
    assert arrows == [(1, True), (3, False), (5, True)]  # dtau_3 = a dtau_2: down


def test_fig_flight():
    """Start, end and words of the moving picture; its description, too."""
    cell = Chapter("intro").cells["flight"]
    (picture,) = [o.data["text/html"] for o in cell.outputs]
    moves = re.findall(r"#?b(\d)(\d) \{ 0% \{ transform: translateX\((.*?)px.*?100% \{ transform: "
                       r"translateX\((.*?)px", picture, re.DOTALL)  # fmt: skip
    alt = cell.metadata.mystnb.image.alt
    outcomes = [after(EQUAL, ratio) for ratio in (0, 0.15, 0.5)]
    assert len(moves) == 9
    ways = re.findall(r'<line id="w(\d)(\d)" x1="(.*?)" x2="(.*?)"', picture)
    assert len(ways) == 9
    for row, ball, start, end in ways:
        expected = 220 * outcomes[int(row)][int(ball)]
        assert float(end) - float(start) == pytest.approx(expected, abs=0.006)
    for row, ball, start, end in moves:
        row, ball = int(row), int(ball)
        speed = outcomes[row][ball]
        assert float(start) == pytest.approx(-110 * EQUAL[1][ball], abs=0.006)
        assert float(end) == pytest.approx(220 * speed, abs=0.006)
    stated = [float(x) for x in re.findall(r"\d\.\d\d(?!\d)", alt.replace("Ratio 0.15", ""))]
    expected = [*abs(outcomes[1]), abs(outcomes[2][0]), outcomes[2][1]]
    assert stated == [float(f"{x:.2f}") for x in expected]


def test_fig_problem_family():
    """The ellipse, the arc on it, and the points; the printed velocities."""
    shown = panel("problem", "fig-own-problem-family")
    u2, u3 = shown["momentum and energy conserved"].T
    np.testing.assert_allclose(u2**2 + u2 * u3 + u3**2, 1, rtol=1e-13)
    arc = shown["possible outcomes"]
    np.testing.assert_allclose((arc**2).sum(axis=1) + arc.prod(axis=1), 1, rtol=1e-13)
    assert arc.max() < 1e-12
    np.testing.assert_allclose(arc[[0, -1]], [[-1, 0], [0, -1]], atol=1e-12)
    (dots,) = [line for name, line in shown.items() if name.startswith("this model")]
    expected = [-np.diff(after(EQUAL, ratio)) for ratio in np.linspace(0, 0.5, 6)]
    np.testing.assert_allclose(dots, expected, rtol=0, atol=1e-7)
    example = [-np.diff(after(EQUAL, 0.15))]
    np.testing.assert_allclose(shown["the example"], example, **CLOSE)
    for name, point in (
        ("before the impact", (1, 0)),
        ("Eq. 5: fused rest", (-1, 0)),
        ("Eq. 6: sequential", (0, -1)),
    ):
        np.testing.assert_array_equal(shown[name], [point])
    _, *told = Chapter("problem").printed("cradle-answers-code").splitlines()
    for ratio, line in zip((0, 0.15, 0.5), told, strict=True):
        assert line.startswith(f"ratio {ratio:g} ")
        speeds = [float(x) for x in line.partition("[")[2].rstrip("]").split()]
        np.testing.assert_allclose(speeds, after(EQUAL, ratio), rtol=0, atol=5.1e-4)


def test_fig_own_problem_bend():
    """The line is the solver's path; each end by its own definition; the grey triangle."""
    (ax,) = drawn("reading_problem")["fig-own-problem-bend"].axes
    shown = {line.get_label(): line.get_xydata() for line in ax.get_lines()}
    trace = collide(Chain([1, 1, 1], [1, 0, 0], 1), ImpulseCorrelation(0.2))
    path = np.column_stack([trace.path_impulses[:, 1], trace.path[:, 1] - trace.path[:, 2]])
    (impulse, speed), (end, last), (full, lowest) = shown["$u_3$"][1], path[-1], shown["$u_3$"][2]
    for at, u in path:
        assert u == pytest.approx(np.interp(at, *shown["$u_3$"].T), abs=1e-12)
    (zero, closing), (by_impulses, _) = shown["by speeds"][0], shown["by impulses"][0]
    assert closing == pytest.approx(0, abs=1e-12)  # as before the impact
    assert by_impulses == pytest.approx(2 * zero) == pytest.approx(full)
    np.testing.assert_allclose(shown["by work"][0], (end, last), rtol=1e-12)
    assert impulse == pytest.approx(0.2 * trace.impulses[0])
    grey = ax.patches[0].get_xy()[:3]
    missing = abs(np.linalg.det([grey[1] - grey[0], grey[2] - grey[0]])) / 2
    work = impulse * speed / 2 + (zero - impulse) * speed / 2
    assert work + missing == pytest.approx(full * -lowest / 4)


@pytest.mark.parametrize(
    ("chapter", "figure", "formulas", "tolerance"),
    [
        ("reading_problem", "fig-own-problem-definitions", {
            "Poisson: impulses": lambda a: (4 + a**2) / (2 - a) ** 2,
            "Stronge: work": lambda a: 1 + 0 * a,
            "Newton: speeds": lambda a: (2 + a**2) / (2 - a) ** 2,
        }, {"rtol": 1e-12}),
        ("three_balls", "fig-p4", {
            "$v_1^+$": lambda a: -2 * a / (4 - 2 * a),
            "$v_2^+$": lambda a: 2 * (1 - np.sqrt(1 - 2 * a)) / (4 - 2 * a),
            "$v_3^+$": lambda a: 2 * (1 + np.sqrt(1 - 2 * a)) / (4 - 2 * a),
        }, {"rtol": 0, "atol": 1e-7}),
    ],
)  # fmt: skip
def test_curves_with_a_formula(chapter, figure, formulas, tolerance):
    shown = panel(chapter, figure)
    for name, formula in formulas.items():
        x, y = shown[name].T
        np.testing.assert_allclose(y, formula(x), err_msg=name, **tolerance)


def test_fig_compliance_ratio():
    figures = (
        ("compliance", "fig-own-compliance-ratio"),
        ("reading_compliance", "fig-own-compliance-soft"),
    )
    for number, figure in enumerate(figures):
        shown = panel(*figure)
        for name, line in shown.items():
            if name.startswith(r"$\gamma$ = "):
                gamma = float(name.rpartition("=")[2])
                loss, _ = first_loss(gamma)
                assert line[-1, 0] == pytest.approx(1 if number else loss, rel=1e-9)
                for at, value in line[::40]:
                    time = at * loss if number else at
                    minus_2, minus_3 = printed_10_and_11(gamma, 1, time)
                    expected = minus_3 / minus_2 / gamma**number
                    # The printed forms subtract nearly equal numbers at the start.
                    assert value == pytest.approx(expected, rel=1e-8, abs=1e-10), name
    part, limit = shown[r"limit $\gamma \to 0$"].T
    theta = np.pi * part
    np.testing.assert_allclose(limit, theta**2 / (4 * (1 - np.cos(theta))) - 0.5, rtol=1e-9)
    assert (shown["Eq. 14"][:, 1] == 1).all()
    # The rate is the quotient of the two forces: gamma (q2 - q3) / (q1 - q2), gamma small.
    gamma = 1e-5
    loss, _ = first_loss(gamma)
    for part, rate in shown["rate"][20:180:40]:
        q = printed_7_to_9(gamma, 1, part * loss)
        assert rate == pytest.approx((q[1] - q[2]) / (q[0] - q[1]), rel=1e-4)
    assert shown["rate"][-1, 1] > 50


def test_fig_compliance_paths():
    """Springs by the printed Eqs. 10 and 11, then straight up; two pieces of a constant ratio."""
    shown = panel("compliance", "fig-own-compliance-paths")
    end = outcome(1, 1)
    left, right = 1 - end[0], end[2]
    loss, _ = first_loss(1)
    together, alone = np.split(shown["springs"], 2)
    expected = [-printed_10_and_11(1, 1, t) for t in np.linspace(0, loss, len(together))]
    np.testing.assert_allclose(together, expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(alone[:, 0], left, rtol=0, atol=1e-8)
    ratio = constant_ratio(end)
    *first, last = shown["constant ratio"]
    first = np.array([point for point in first if point[1] <= ratio * left + 1e-8])
    np.testing.assert_allclose(first[:, 1], ratio * first[:, 0], rtol=0, atol=1e-8)
    assert first[-1, 0] == pytest.approx(left, abs=1e-8)
    for point in (alone[-1], last):
        np.testing.assert_allclose(point, [left, right], rtol=0, atol=1e-8)
    assert (np.diff(alone[:, 1]) >= 0).all()


def test_fig_compliance_effective():
    shown = panel("reading_compliance", "fig-own-compliance-effective")
    (at_end, at_loss, effective, law, eq_14, eq_15, dot) = shown.values()
    gammas = effective[:, 0]
    np.testing.assert_allclose(eq_14, np.column_stack([gammas, gammas]))
    np.testing.assert_allclose(law[:, 1], (math.pi**2 / 8 - 1) * gammas, rtol=1e-12)
    assert (eq_15[:, 1] == 0.5).all()
    for gamma, ratio in at_loss[[20, 80, 100, 130]]:
        minus_2, minus_3 = printed_10_and_11(gamma, 1, first_loss(gamma)[0])
        assert ratio == pytest.approx(minus_3 / minus_2, rel=1e-8)
    for k in (4, 16, 20, 26):
        v = outcome(1, gammas[k])
        assert at_end[k, 1] == pytest.approx(v[2] / (1 - v[0]), abs=1e-6)
        assert effective[k, 1] == pytest.approx(-2 * v[0] / (1 - v[0]), abs=1e-6)
    v = outcome(1, 1)
    assert dot[0] == pytest.approx([1, -2 * v[0] / (1 - v[0])], abs=1e-6)


def test_fig_three_triangle_and_extended():
    m, v, e = map(np.array, THREE)
    g = (1 + e[0]) * m[0] * (v[0] - v[1]) / (0.85 * m[0] + m[1])
    ends = m[1] * g
    u = v[0] - v[1]
    line = panel("three_balls", "fig-own-three-triangle")["closing speed $u_2$"]
    expected = [(0, u), (ends / (1 + e[0]), 0), (ends, -e[0] * u)]
    np.testing.assert_allclose(line, expected, **CLOSE)
    for number, speed in enumerate((0, 0.15)):  # of ball 2: the example, and in general
        start = np.array([1, speed, 0])
        push = ends * (1 - speed)  # tau_2^f
        path, impulses = solved((m, start, e), 0.15)
        line = np.column_stack([impulses[:, 1], path[:, 1] - path[:, 2]])
        shown = panel("three_balls", "fig-own-three-extended", number)
        np.testing.assert_allclose(shown["closing speed $u_3$"], line, **CLOSE)
        bend = [0.15 * push, speed + 0.85 * push / m[1] - 0.15 * push / m[2]]
        extended = [(0, speed + push / m[1]), bend]
        np.testing.assert_allclose(shown["second piece, extended"], extended, **CLOSE)
    # What the axes say: the impulses of the text, and G.
    top = drawn("three_balls")["fig-own-three-extended"].axes[0]
    done = textbook.solve(*THREE, 0.15).impulses[1]
    told = [text.get_text().rpartition("\n")[2] for text in top.get_xticklabels()]
    assert set(told[1:]) == {f"{x:.3f}" for x in (0.15 * ends, g / 2, done)}
    assert top.get_yticklabels()[1].get_text() == f"{g:.3f}"


def test_rings_of_the_opening_figure():
    """Where each contact is compressed most its two balls are equally fast: Eqs. 22 and 28."""
    ax = drawn("three_balls")["fig-own-three-opening"].axes[0]
    rings = [line.get_xydata()[0] for line in ax.get_lines() if line.get_marker() == "o"]
    tau_2c, push = 1 / 1.85, 1.9 / 1.85
    expected = [(1.15 * tau_2c, 1 - tau_2c), (1.5 * push, push / 2)]
    np.testing.assert_allclose(rings, expected, **CLOSE)


def test_fig_4_ends():
    shown = panel("three_balls", "fig-p4")
    np.testing.assert_allclose(shown["Eq. (6)"], [(0, 0), (0, 0), (0, 1)])
    np.testing.assert_allclose(shown["Eq. (5)"], [(0.5, -1 / 3), (0.5, 2 / 3), (0.5, 2 / 3)])


def test_fig_three_ranges():
    """The dots: what contact 2-3 does, and by how much Eq. 30 is off, by the textbook solver."""
    page = Chapter("reading_three_balls")
    shown = panel("reading_three_balls", "fig-own-three-ranges")
    *curves, dots = shown.values()
    for curve, power, slope in zip(curves, (1, 1, 1, 2), (0, 1, 1.5, 1)):
        v2, a = curve.T
        X = v2 * (3 - a) / (2 * (1 - v2))  # with g = 2 (1 - v2) / (3 - a), by Eq. 24
        np.testing.assert_allclose(3 * a, (1 + slope * X) ** power, rtol=1e-12)
    closes = np.interp(0.5, *shown["$1+X$"].T)
    page.tells({"three-balls-closes-to": closes})
    assert np.interp(0.5, *shown["$(1+X)^2$"].T) > 1  # a real root at every ratio
    _, *told = page.printed("three-ranges").splitlines()
    m, v, e = [1, 2, 1], [1, 0.5, 0], [1, 0.5]
    for dot, line in zip(dots, told, strict=True):
        ratio, *words, off = re.split(r"\s{2,}", line.strip().replace(" < ", "  < "))
        a = float(ratio)
        assert tuple(dot) == (0.5, a)
        g = 2 * 0.5 / (3 - a)
        X, part = 0.5 / g, 3 * a
        done = textbook.solve(m, v, e, a)
        before = done.events[: done.events.index(("end", 0))]
        state = "still closes"
        if ("maximum_compression", 1) in before:
            state = "has ended" if ("end", 1) in before else "already opens"
        assert words == [state]
        assert (part > 1 + X) == (state != "still closes")
        assert (part > 1 + 1.5 * X) == (state == "has ended")
        last = 2 / 3 * (g + 0.5) * (1 + 0.5 * math.sqrt(1 - 3 * a / (1 + X) ** 2))  # Eq. 30
        wrong = abs(last - done.velocities[2])
        if state == "still closes":
            assert off == "< 10⁻¹²"
            assert wrong < 1e-12
        else:
            assert float(off) == pytest.approx(wrong, abs=5.1e-5)
    page.tells({"three-balls-off": wrong})


def test_fig_three_ratio():
    for number, (masses, e) in enumerate((([1, 1, 1], 0.5), ([2, 1, 1], 1))):
        shown = panel("reading_three_balls", "fig-own-three-ratio", number)
        for k in (0, 137, 900, 1500, 1900):
            v = after((masses, [1, 0, 0], e), shown["$v_1^+$"][k, 0])
            values = [shown[f"$v_{i}^+$"][k, 1] for i in (1, 2, 3)]
            assert values == pytest.approx(v, abs=1e-10)
        (low,), (high,) = shown["least $v_2^+$"], shown["largest $v_3^+$"]
        v2, v3 = shown["$v_2^+$"], shown["$v_3^+$"]
        assert low.tolist() == v2[v2[:, 1].argmin()].tolist()
        assert high.tolist() == v3[v3[:, 1].argmax()].tolist()
