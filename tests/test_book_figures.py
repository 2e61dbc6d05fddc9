"""Every curve of the landing page, chapters 1 to 6 and the notation, against a second route.

The chapters draw from the package's solver; here the textbook solver, formulas that the paper
prints, or short computations of their own say where each line must lie.
"""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from chapters import Chapter, code, drawn, lines
from matplotlib.text import Text
from test_book_compliance import first_loss, outcome, printed_10_and_11
from test_book_n_balls import FIG_8, contact_work
from test_book_patterns import by_turns, edge, turn

from cradle import ImpulseCorrelation, collide, paper_chain, textbook
from cradle.measures import bouncing_pattern

CHAPTERS = [
    "intro",
    "problem",
    "compliance",
    "three_balls",
    "multiple_impacts",
    "patterns",
    "n_balls",
    "notation",
]
EQUAL = [1, 1, 1], [1, 0, 0], 1
THREE = [1.0, 1.5, 1.0], [1.0, 0.2, 0.0], [0.8, 0.7]  # the example of chapter 3, ratio 0.25
FIVE = [1, 1, 1], [1, 0.8, 0], 0.3  # that of chapter 4, ratio 0.05
LIGHT = [100, 1, 100], [1, 0, 0], 1  # Fig. 7, ratio 0.15
CLOSE = {"rtol": 0, "atol": 1e-12}


def solved(chain, ratio, **options):
    """Path of velocities and of impulses by the textbook solver."""
    done = textbook.solve(*chain, ratio, **options)
    return np.array(done.path), np.array(done.path_impulses)


def after(chain, ratio, **options):
    return solved(chain, ratio, **options)[0][-1]


def panel(chapter, figure, number=0):
    return lines(drawn(chapter)[figure].axes[number])


def texts(figure):
    """All words of a figure: titles, labels, legends, notes."""
    return " ".join(text.get_text() for text in figure.findobj(Text))


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_decimals_of_descriptions_are_in_the_figure(chapter):
    for cell in code(chapter):
        settings = cell.metadata.get("mystnb", {})
        figure = drawn(chapter).get(settings.get("figure", {}).get("name"))
        if figure is None:  # the landing page's moving picture has a test of its own
            continue
        limits = [x for ax in figure.axes for x in (*ax.get_xlim(), *ax.get_ylim())]
        said = [float(x) for x in re.findall(r"\d+\.\d+", texts(figure))] + limits
        for number in re.findall(r"\d+\.\d+", settings["image"]["alt"]):
            assert float(number) in said, (cell.id, number)


def test_every_figure_is_checked_here():
    """A figure that this file does not name has no check; drawings without data need none."""
    text = Path(__file__).read_text(encoding="utf-8")
    drawings = {"fig-p1", "fig-p2", "fig-own-notation-chain", "fig-own-notation-ratio"}
    for chapter in CHAPTERS:
        for name in drawn(chapter).keys() - drawings:
            assert f'"{name}"' in text, name


@pytest.mark.parametrize(
    ("chapter", "figure", "chain", "ratio"),
    [
        ("intro", "fig-inside", EQUAL, 0.15),
        ("three_balls", "fig-own-three-opening", THREE, 0.25),
        ("multiple_impacts", "fig-own-multiple-opening", FIVE, 0.05),
        ("n_balls", "fig-own-n-balls-opening", ([1] * 4, [1, 0.5, 0, 0], 1), 0.1),
    ],
)
def test_opening_figures(chapter, figure, chain, ratio):
    path, impulses = solved(chain, ratio)
    shown = panel(chapter, figure)
    assert list(shown) == [f"$v_{i + 1}$" for i in range(path.shape[1])]
    for ball, line in enumerate(shown.values()):
        expected = np.column_stack([impulses.sum(axis=1), path[:, ball]])
        np.testing.assert_allclose(line, expected, **CLOSE)


@pytest.mark.parametrize(
    ("chapter", "figure", "number", "contact", "chain", "ratio"),
    [
        ("three_balls", "fig-p3", 0, 0, THREE, 0.25),
        ("three_balls", "fig-p3", 1, 1, THREE, 0.25),
        ("multiple_impacts", "fig-p5", 0, 0, FIVE, 0.05),
        ("multiple_impacts", "fig-p5", 1, 1, FIVE, 0.05),
        ("patterns", "fig-p7", 0, 0, LIGHT, 0.15),
        ("patterns", "fig-p7", 1, 1, LIGHT, 0.15),
    ],
)
def test_velocity_impulse_diagrams(chapter, figure, number, contact, chain, ratio):
    path, impulses = solved(chain, ratio)
    shown = panel(chapter, figure, number)
    for ball in (contact, contact + 1):
        expected = np.column_stack([impulses[:, contact], path[:, ball]])
        np.testing.assert_allclose(shown[f"$v_{ball + 1}$"], expected, rtol=0, atol=1e-10)


def test_fig_flight():
    """Start, end and words of the moving picture; its description, too."""
    cell = Chapter("intro").cells["flight"]
    (picture,) = [o.data["image/svg+xml"] for o in cell.outputs if "image/svg+xml" in o.data]
    moves = re.findall(r"#?b(\d)(\d) \{ 0% \{ transform: translateX\((.*?)px.*?100% \{ transform: "
                       r"translateX\((.*?)px", picture, re.DOTALL)  # fmt: skip
    alt = cell.metadata.mystnb.image.alt
    outcomes = [after(EQUAL, ratio) for ratio in (0, 0.15, 0.5)]
    assert len(moves) == 9
    for row, ball, start, end in moves:
        row, ball = int(row), int(ball)
        speed = outcomes[row][ball]
        assert float(start) == pytest.approx(-110 * EQUAL[1][ball], abs=0.006)
        assert float(end) == pytest.approx(220 * speed, abs=0.006)
    stated = [float(x) for x in re.findall(r"\d\.\d\d(?!\d)", alt.replace("Ratio 0.15", ""))]
    expected = [*abs(outcomes[1]), abs(outcomes[2][0]), outcomes[2][1]]
    assert stated == [float(f"{x:.2f}") for x in expected]


def test_fig_five_balls():
    shown = panel("intro", "fig-five-balls")
    for k in (0, 30, 60, 137, 200):
        ratio = shown["ball 1"][k, 0]
        v = after(([1] * 5, [1, 0, 0, 0, 0], 1), ratio)
        assert [shown[f"ball {i + 1}"][k, 1] for i in range(5)] == pytest.approx(v, abs=1e-7)


def test_fig_problem_family():
    shown = panel("problem", "fig-own-problem-family")
    u2, u3 = shown["momentum and energy conserved"].T
    np.testing.assert_allclose(u2**2 + u2 * u3 + u3**2, 1, rtol=1e-13)
    arc = shown["and no ball passes through another"]
    np.testing.assert_allclose((arc**2).sum(axis=1) + arc.prod(axis=1), 1, rtol=1e-13)
    assert arc.max() < 1e-12
    np.testing.assert_allclose(arc[[0, -1]], [[-1, 0], [0, -1]], atol=1e-12)
    (dots,) = [line for name, line in shown.items() if name.startswith("this model")]
    expected = [-np.diff(after(EQUAL, ratio)) for ratio in np.linspace(0, 0.5, 6)]
    np.testing.assert_allclose(dots, expected, rtol=0, atol=1e-7)
    for name, point in (
        ("before the impact", (1, 0)),
        ("Eq. 5: fused rest", (-1, 0)),
        ("Eq. 6: sequential", (0, -1)),
    ):
        np.testing.assert_array_equal(shown[name], [point])


def test_fig_problem_definitions():
    shown = panel("problem", "fig-own-problem-definitions")
    a = shown["Stronge: work"][:, 0]
    for name, energy in (
        ("Poisson: impulses", (4 + a**2) / (2 - a) ** 2),
        ("Stronge: work", np.ones_like(a)),
        ("Newton: speeds", (2 + a**2) / (2 - a) ** 2),
    ):
        np.testing.assert_allclose(shown[name], np.column_stack([a, energy]), rtol=1e-12)


def test_fig_compliance_ratio():
    for number in (0, 1):
        shown = panel("compliance", "fig-own-compliance-ratio", number)
        for name, line in shown.items():
            if name.startswith(r"$\gamma$ = "):
                gamma = float(name.rpartition("=")[2])
                loss, _ = first_loss(gamma)
                for part, value in line[::40]:
                    minus_2, minus_3 = printed_10_and_11(gamma, 1, part * loss)
                    expected = minus_3 / minus_2 / gamma**number
                    # The printed forms subtract nearly equal numbers at the start.
                    assert value == pytest.approx(expected, rel=1e-8, abs=1e-10), name
    part, limit = shown[r"limit $\gamma \to 0$"].T
    theta = np.pi * part
    np.testing.assert_allclose(limit, theta**2 / (4 * (1 - np.cos(theta))) - 0.5, rtol=1e-9)
    assert (shown["Eq. 14"][:, 1] == 1).all()


def test_fig_compliance_effective():
    shown = panel("compliance", "fig-own-compliance-effective")
    (at_end, at_loss, effective, law, eq_14, eq_15, dot) = shown.values()
    gammas = effective[:, 0]
    np.testing.assert_allclose(eq_14, np.column_stack([gammas, gammas]))
    np.testing.assert_allclose(law[:, 1], (math.pi**2 / 8 - 1) * gammas, rtol=1e-12)
    assert (eq_15[:, 1] == 0.5).all()
    for k in (20, 80, 100, 130):
        minus_2, minus_3 = printed_10_and_11(gammas[k], 1, first_loss(gammas[k])[0])
        assert at_loss[k, 1] == pytest.approx(minus_3 / minus_2, rel=1e-8)
        v = outcome(1, gammas[k])
        assert at_end[k, 1] == pytest.approx(v[2] / (1 - v[0]), abs=1e-6)
        assert effective[k, 1] == pytest.approx(-2 * v[0] / (1 - v[0]), abs=1e-6)
    v = outcome(1, 1)
    assert dot[0] == pytest.approx([1, -2 * v[0] / (1 - v[0])], abs=1e-6)


def test_fig_three_triangle_and_extended():
    m, v, e = map(np.array, THREE)
    g = (1 + e[0]) * m[0] * (v[0] - v[1]) / (0.75 * m[0] + m[1])
    ends = m[1] * g
    u = v[0] - v[1]
    line = panel("three_balls", "fig-own-three-triangle")["closing speed $u_2$"]
    expected = [(0, u), (ends / (1 + e[0]), 0), (ends, -e[0] * u)]
    np.testing.assert_allclose(line, expected, **CLOSE)
    shown = panel("three_balls", "fig-own-three-extended")
    path, impulses = solved(THREE, 0.25)
    bend = [0.25 * ends, v[1] + 0.75 * g - v[2] - 0.25 * ends / m[2]]
    np.testing.assert_allclose(
        shown["closing speed $u_3$"],
        np.column_stack([impulses[:, 1], path[:, 1] - path[:, 2]]), **CLOSE
    )  # fmt: skip
    extended = [(0, g + v[1] - v[2]), bend]
    np.testing.assert_allclose(shown["second piece, extended"], extended, **CLOSE)


def test_fig_4():
    shown = panel("three_balls", "fig-p4")
    a = shown["$v_1^+$"][:, 0]
    s = np.sqrt(1 - 2 * a)
    for name, value in (
        ("$v_1^+$", s**2 - 1), ("$v_2^+$", 2 * (1 - s)), ("$v_3^+$", 2 * (1 + s)),
    ):  # fmt: skip
        expected = np.column_stack([a, value / (3 + s**2)])
        np.testing.assert_allclose(shown[name], expected, rtol=0, atol=1e-7)
    np.testing.assert_allclose(shown["Eq. (6)"], [(0, 0), (0, 0), (0, 1)])
    np.testing.assert_allclose(shown["Eq. (5)"], [(0.5, -1 / 3), (0.5, 2 / 3), (0.5, 2 / 3)])


def test_fig_three_ranges():
    shown = panel("three_balls", "fig-own-three-ranges")
    x = shown["$1+X$"][:, 0]
    for name, bound in (
        ("Eq. 34", 1 + 0 * x), ("$1+X$", 1 + x), ("$1+(1+e_3)X$", 1 + 1.5 * x),
        ("$(1+X)^2$: radical real below", (1 + x) ** 2),
    ):  # fmt: skip
        np.testing.assert_allclose(shown[name], np.column_stack([x, bound]), rtol=1e-14)
    x, y = shown["solver: contact 2-3 still closes"].T
    assert (y <= 1 + x).all()
    x, y = shown["solver: contact 2-3 already opens"].T
    assert ((1 + x < y) & (y <= 1 + 1.5 * x)).all()
    x, y = shown["solver: contact 2-3 ends first"].T
    assert (y > 1 + 1.5 * x).all()


def test_fig_three_ratio():
    for number, (masses, e) in enumerate((([1, 1, 1], 0.5), ([2, 1, 1], 1))):
        shown = panel("three_balls", "fig-own-three-ratio", number)
        for k in (0, 137, 900, 1500, 1900):
            v = after((masses, [1, 0, 0], e), shown["$v_1^+$"][k, 0])
            values = [shown[f"$v_{i}^+$"][k, 1] for i in (1, 2, 3)]
            assert values == pytest.approx(v, abs=1e-10)
        (low,), (high,) = shown["least $v_2^+$"], shown["largest $v_3^+$"]
        v2, v3 = shown["$v_2^+$"], shown["$v_3^+$"]
        assert low.tolist() == v2[v2[:, 1].argmin()].tolist()
        assert high.tolist() == v3[v3[:, 1].argmax()].tolist()


PAPER = [("end", 0), ("close", 0), ("end", 1), ("close", 1), ("end", 0), ("end", 1)]


def test_fig_sequence_map():
    (mesh,) = drawn("multiple_impacts")["fig-own-sequence"].axes[0].collections
    regions = mesh.get_array().reshape(120, 120)
    for row in range(7, 120, 14):  # e; below, the textbook solver would have no limit to go to
        for column in range(3, 120, 9):
            e, ratio = (row + 0.5) / 240, (column + 0.5) / 240
            if regions[row, column] == 4:
                continue
            done = textbook.solve([1, 1, 1], [1, 0.8, 0], e, ratio)
            events = [x for x in done.events if x[0] != "maximum_compression"]
            found = events == PAPER
            assert (regions[row, column] in (1, 2)) == found
            assert (regions[row, column] == 0) == (not found and done.collisions[0] <= 2
                                                   and events.count(("close", 1)) == 0)  # fmt: skip


def in_ratios(r1, r2):
    return [1 / r1, 1.0, 1 / r2], [1, 0, 0]


def test_fig_patterns_three():
    for number, (r1, r2) in enumerate(((2.5, 1.5), (1.0, 1.5), (2.5, 0.2))):
        v = after((*in_ratios(r1, r2), 0.5), 0.15)
        for ball, line in enumerate(panel("patterns", "fig-patterns-three", number).values()):
            places = 0.6 * ball + np.array([-1.0 * (ball == 0), 0, 2 * v[ball]])
            np.testing.assert_allclose(line, np.column_stack([places, [-1, 0, 2]]), **CLOSE)


def eq_44(r2, e=0.5, a=0.15):
    return (1 + e) * (1 + e * np.sqrt(1 - a * (1 + r2))) / (e * (1 + r2)) - (1 + a / e)


def test_fig_6_drawn():
    ax = drawn("patterns")["fig-p6"].axes[0]
    shown = lines(ax)
    r2, r1 = shown["Eq. (44): back impact"].T
    np.testing.assert_allclose(r1, eq_44(r2), rtol=1e-13)
    rest_2 = 0.5 * math.sqrt(0.85 + 0.0375**2) - 0.01875  # Eq. 46
    np.testing.assert_allclose(shown["Eq. (45): $v_1^+ = 0$"], [(rest_2, 1.7), (3, 1.7)])
    np.testing.assert_allclose(shown["Eq. (46): $v_2^+ = 0$"], [(rest_2, 1.7), (rest_2, 3)])
    np.testing.assert_allclose(shown["all three meet"], [(rest_2, 1.7)])
    # The thin borders, from the fourth collision on: the map of turns counts one more below.
    thin = [x.get_xydata() for x in ax.get_lines() if x.get_color() == "0.35"]
    assert len(thin) == 7
    for number, line in enumerate(thin, start=4):
        for r2, r1 in line[~np.isnan(line[:, 1])][20::60]:
            assert by_turns(r1 * (1 - 1e-7), r2, 0.5, 0.15)[0] == number
            assert by_turns(r1 * (1 + 1e-7), r2, 0.5, 0.15)[0] == number - 1
    (mesh,) = [x for x in ax.collections if hasattr(x, "get_coordinates")]
    field = np.ma.getdata(mesh.get_array()).reshape(400, 400)
    grid = np.linspace(0, 3, 401)[1:] - 3 / 800
    for row in range(20, 400, 54):
        for column in range(20, 400, 54):
            v = by_turns(grid[row], grid[column], 0.5, 0.15)[1]
            assert field[row, column] == bouncing_pattern(np.array(v))


def test_fig_patterns_turns():
    for name, line in panel("patterns", "fig-patterns-turns").items():
        r = float(re.search(r"r = ([\d.]+)", name)[1])
        if "border" in name:
            r = edge_on_diagonal()
        for zeta, drawn_value in line[::50]:
            x, _, y, a = turn(zeta, r, 0.5, 0.15)
            assert drawn_value == pytest.approx(a * y / (y - x), rel=1e-9)


def edge_on_diagonal():
    low, high = 0.03, 0.08
    while high - low > 1e-14:
        middle = (low + high) / 2
        low, high = (middle, high) if edge(middle, 0.5, 0.15) > middle else (low, middle)
    return low


def test_fig_patterns_corner():
    left, right = drawn("patterns")["fig-patterns-corner"].axes[:2]
    log = np.geomspace(0.005, 3, 241)
    log = np.sqrt(log[1:] * log[:-1])
    (mesh,) = [x for x in left.collections if hasattr(x, "get_coordinates")]
    number = np.ma.filled(mesh.get_array(), np.nan).reshape(240, 240)
    for row in range(5, 240, 33):
        for column in range(5, 240, 33):
            turns = by_turns(log[row], log[column], 0.5, 0.15)[0]
            shown = number[row, column]
            assert turns > 100 if np.isnan(shown) else shown == turns
    solid = [x.get_xydata() for x in left.get_lines() if x.get_linestyle() == "-"]
    dots = [x.get_xydata()[0] for x in right.get_lines() if x.get_marker() == "o"]
    (border,) = solid
    for r2, r1 in border[:20:6]:
        assert r1 == pytest.approx(edge(r2, 0.5, 0.15), rel=1e-6)
    assert len(dots) == 3
    for r2, r1 in dots:
        np.testing.assert_allclose(by_turns(r1, r2, 0.5, 0.15)[1][:2], 0, atol=1e-9)


def test_fig_patterns_parameters():
    cases = [(0.0, 0.15), (0.1, 0.15), (1.0, 0.15), (0.5, 0.0), (0.4, 0.5), (1.0, 0.5)]
    coarse = np.linspace(0, 3, 151)[1:] - 0.01
    for ax, (e, a) in zip(drawn("patterns")["fig-patterns-parameters"].axes, cases):
        some = coarse[coarse <= (1 / a - 1 if a else np.inf)]
        mesh = ax.collections[0]
        field = np.ma.getdata(mesh.get_array()).reshape(some.size, some.size)
        if e == 0:
            assert (field == 2).all()
            continue
        for row in range(9, some.size, 28):
            for column in range(4, some.size, 28):
                number, v = by_turns(some[row], some[column], e, a)
                if number < 60 and min(abs(v[0]), abs(v[1])) > 1e-9:
                    assert field[row, column] == bouncing_pattern(np.array(v))
        (curve,) = [x.get_xydata() for x in ax.get_lines()]
        r2, r1 = curve[~np.isnan(curve[:, 1])].T
        np.testing.assert_allclose(r1, eq_44(r2, e, a), rtol=1e-12)


def test_fig_patterns_micro():
    top, low = (panel("patterns", "fig-patterns-micro", k) for k in (0, 1))
    r = low["$v_1^+$"][:, 0]
    np.testing.assert_allclose(top["estimate"][:, 1], np.pi * np.sqrt(1 / (2 * r)), rtol=1e-12)
    for k in range(100, 4000, 350):
        for a in (0, 0.15, 0.5):
            assert top[f"$a$ = {a:g}"][k, 1] == by_turns(r[k], r[k], 1, a)[0]
        v = by_turns(r[k], r[k], 1, 0.15)[1]
        assert [low[f"$v_{i}^+$"][k, 1] for i in (1, 2, 3)] == pytest.approx(v, abs=1e-10)
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
        both, apart = (panel("n_balls", "fig-p8", 3 * row + contact) for row in (1, 0))
        for ball in (contact, contact + 1):
            name = f"$v_{ball + 1}$"
            expected = np.column_stack([impulses[:, contact], path[:, ball]])
            np.testing.assert_allclose(both[name], expected, **CLOSE)
            np.testing.assert_allclose(apart[name][:met], expected[:met], **CLOSE)
            np.testing.assert_allclose(apart[name][met:, 1], ends[ball] / 2, **CLOSE)


def test_fig_meeting():
    left, right = (panel("n_balls", "fig-own-meeting", k) for k in (0, 1))
    chain = [1] * 4, [1, 0.5, 0, 0], 1
    middle = after(chain, 0.1)
    for k in (0, 13, 40):
        moved = after(chain, 0.1, meeting=left["$v_1$"][k, 0]) - middle
        assert [left[f"$v_{i}$"][k, 1] for i in (1, 2, 3, 4)] == pytest.approx(moved, abs=1e-12)
    assert list(right) == ["ABCCAB", "BCACBA"]
    for name, line in right.items():
        balls, model = paper_chain(name, excess="saturate")
        chain = list(balls.masses), list(balls.velocities), list(balls.restitution)
        forward, backward = list(model.forward), list(model.backward)
        ends = [
            after(chain, forward, backward=backward, meeting=x)
            for x in (0.5, *line[[0, 13, 40], 0])
        ]
        moved = [abs(end - ends[0]).max() for end in ends[1:]]
        assert line[[0, 13, 40], 1] == pytest.approx(moved, abs=1e-12)


def test_fig_notation_contact():
    (line,) = [
        x.get_xydata()
        for x in drawn("notation")["fig-own-notation-contact"].axes[0].get_lines()
        if len(x.get_xdata()) == 3
    ]
    np.testing.assert_allclose(line, [(0, 1), (0.5, 0), (0.85, -0.7)], **CLOSE)
