"""The chapter on extremes: the numbers in its text and figures, from the maps and anew."""

import math
import re
from decimal import Decimal, localcontext

import extreme_chains as x
import mpmath
import nbformat
import numpy as np
import pytest
from chains import uniform
from chapters import BOOK, Chapter, floats, number, points, shows
from families import JUDGED, family
from page import said
from problem import Problem
from stored import read

from cradle import Chain, ImpulseCorrelation, collide, outcomes, spring_velocities
from cradle.measures import condition_number
from cradle.textbook import solve


def test_lessons_are_referred_to_by_their_numbers():
    heads = (x.source for page in BOOK.glob("*.ipynb") for x in nbformat.read(page, 4).cells)
    text = "\n".join(heads)
    numbers = dict(re.findall(r"^\(([\w-]+)\)=\n## Lesson (\d)", text, flags=re.MULTILINE))
    told = re.findall(r"[Ll]esson (\d)[^`<]*<([\w-]+)>", text)
    assert len(told) > len(numbers) == 4
    assert {(numbers[name], name) for _, name in told} == {*told}


def stored(part, **equal):
    """Rows of a stored table of the study whose columns have these values."""
    return read(f"extremes_{part}.csv", **equal)


def exactly(problem, which, k, value):
    """Velocities by fifty digits with one input moved by so much."""
    return floats(x.moved(problem, which, k, value).exact().velocities)


CHAPTER, MAPS = Chapter("extremes"), Chapter("extremes_maps")
glued = MAPS.glued


def test_jumps_behind_the_first_edge():
    """The stored jumps, the largest by fifty digits on both sides, and one input scanned anew."""
    rows = stored("jumps")
    largest = max(rows, key=lambda row: float(row["jump"]))
    name, k, change = largest["sequence"], int(largest["index"]), float(largest["change"])
    assert glued["largest-input"] == f"mass of ball {k + 1} of {name}"
    problem = x.sequence(name)
    scale = problem.masses[k]
    sides = [exactly(problem, "masses", k, (change + d) * scale) for d in (-1e-4, 1e-4)]
    jump = np.abs(sides[1] - sides[0]).max() / sides[0].max()
    assert 100 * jump == pytest.approx(float(glued["largest-jump"]), abs=0.1)
    assert number(glued["largest-at"]) == pytest.approx(-100 * change, abs=0.5)
    again = x.jumps(problem, "masses", k, scale)
    here = stored("jumps", sequence=name, input="masses", index=str(k))
    assert len(again) == len(here) > 1
    expected = [(float(r["change"]), float(r["jump"])) for r in here]
    np.testing.assert_allclose(again, expected, rtol=2e-3)


def test_the_nearest_jump_of_the_papers_chains():
    """By fifty digits on both sides."""
    jumps = [row for row in stored("edges") if float(row["jump"]) > 1e-8]
    edge = min(jumps, key=lambda row: float(row["distance"]))
    far, jump = float(edge["distance"]), float(edge["jump"])
    MAPS.tells({"first-jump": 100 * far, "first-jump-size": 100 * jump})
    assert edge["sequence"] in glued["jumping"]
    problem, which, k = x.sequence(edge["sequence"]), edge["input"], int(edge["index"])
    moved = int(edge["side"]) * far * getattr(problem, which)[k]
    sides = [exactly(problem, which, k, part * moved) for part in (0.999, 1.001)]
    assert np.abs(sides[1] - sides[0]).max() / sides[0].max() == pytest.approx(jump, rel=0.1)


def test_fig_extremes_edge():
    """The border by the closed form, by the eigenvalues of the cycle, and by the solver."""
    for e, part in ((0.3, 0.99), (0.3, 1.01), (0.8, 0.99), (0.8, 1.01)):
        a = 1 / (1 + x.infinite_below(e) * part)
        cycle = np.array([[1, (1 + e) * a], [0, -e]]) @ np.array([[-e, 0], [(1 + e) * a, 1]])
        assert np.linalg.det(cycle) == pytest.approx(e * e)
        assert np.trace(cycle) == pytest.approx((1 + e) ** 2 * a * a - 2 * e)
        # From NumPy 2.5 on all are of a complex type.
        eigenvalues = np.linalg.eigvals(cycle)
        assert np.isreal(eigenvalues).all() == (part < 1)
        if part > 1:  # they turn by twice the angle of the chapter on patterns; here r1 = r2
            r = x.infinite_below(e) * part
            turn = 2 * math.acos((1 + e) / (2 * math.sqrt(e) * (1 + r)))
            assert np.abs(np.angle(eigenvalues)) == pytest.approx([turn, turn], rel=1e-9)
    found = [
        outcomes([1, light, 1], [1, 0, 0], e, 0.15).collisions.sum()
        for light in (1e-3, 1e-6, 1e-12)
        for e in (0.0, 1e-16, 0.3, 0.7, 0.9)
    ]
    assert number(glued["bounded"]) == max(found)


def test_exercises():
    """Masses 1, 1/12, 1: tan of the angle is 5/12, and 180 / 22.62 is 7.96; a border by trace."""
    assert math.sqrt(1 / 12 * 25 / 12) == pytest.approx(5 / 12, rel=1e-15)
    assert number(glued["twelfth"]) == math.ceil(math.pi / math.atan(5 / 12)) - 1 == 7
    # The figure has masses 1, 1/4, 1, and tan 3/4.
    assert math.sqrt(0.25 * 2.25) == 0.75
    assert math.ceil(math.pi / math.atan(0.75)) - 1 == 4
    dots = points(MAPS.figures["fig-maps-wedge"].axes[0], marker="o")[0]
    assert len(dots) == 4  # the walls that the path crosses
    assert glued["border-times"] == f"{1 / x.infinite_below(0.9):.0f}"
    e1, e2, r = 0.3, 0.8, float(glued["two-border"])
    a = 1 / (1 + r)
    assert (1 + e1) * (1 + e2) * a * a == pytest.approx((math.sqrt(e1) + math.sqrt(e2)) ** 2, 2e-3)
    assert (glued["two-below"], glued["two-above"]) == ("infinite", "finite")


@pytest.mark.parametrize(
    ("figure", "part", "column"),
    [
        ("fig-maps-unequal", "unequal", "median"),
        ("fig-maps-growth", "growth", "largest"),
        ("fig-maps-edges", "edges", "distance"),
        ("fig-extremes-edge", "limits", "edge"),
    ],
)
def test_figures_show_their_column_of_a_table(figure, part, column):
    """What is infinite or below 1e-15 is not drawn as it stands, and of some tables only a part."""
    equal = {"size": "1e-12", "spread": "0"}
    some = {"limits": {"ratio": "0"}, "growth": equal}.get(part, {})
    values = floats(row[column] for row in stored(part, **some))
    values = values[np.isfinite(values) & (values > 1e-15)]
    assert len(values) > 5
    figures = CHAPTER.figures | MAPS.figures
    assert shows(figures[figure].axes, values)


def test_fig_maps_jumps():
    """Each number stands in the row and column of its masses and ratio; of 20 balls all are 0."""
    rows = stored("unequal")
    assert {r["jumps"] for r in rows if r["balls"] == "20" or float(r["ratio"]) < 0.25} == {"0"}
    unknown = [int(r["unfinished"]) for r in rows if int(r["unfinished"]) > 12]
    assert [int(glued["unknown"])] == unknown
    assert int(glued["unfinished"]) == sum(int(r["unfinished"]) for r in rows)
    for ax, balls in zip(MAPS.figures["fig-maps-jumps"].axes, ("40", "80"), strict=True):
        assert ax.get_title() == f"{balls} balls"
        shown = {tuple(x.get_position()): x.get_text() for x in ax.texts}
        ratios = ["0.1", "0.2", "0.3", "0.45"]
        names = [x.get_text() for x in ax.get_yticklabels()]
        for r in (r for r in rows if r["balls"] == balls):
            (row,) = (k for k, name in enumerate(names) if r["family"].startswith(name + ",")
                      or r["family"] == name)  # fmt: skip
            told = "?" if int(r["unfinished"]) > 12 else r["jumps"]
            assert shown.pop((ratios.index(r["ratio"]) + 0.5, row + 0.5)) == told
        assert not shown
    assert [x.get_text() for x in ax.get_xticklabels()] == ratios


def test_fig_extremes_map_shows_the_fewest_digits():
    axes = MAPS.figures["fig-maps-digits"].axes[:4]
    for ax, shape in zip(axes, ("middle", "striker", "last", "taper"), strict=True):
        rows = [row for row in stored("map", shape=shape) if int(row["compared"])]
        errors = [float(row["error"]) for row in rows if float(row["condition"]) <= 1e12]
        least = -math.log10((max(errors) + 0.5) * 2.0**-52)
        assert ax.collections[0].get_array().min() == pytest.approx(least)


def test_impacts_by_the_wedge_and_fig_extremes_edge_by_the_eigenvalues():
    rows = stored("elastic", ratio="0")
    for row in rows:
        light = 10 ** -float(row["power"])
        walls = math.ceil(math.pi / math.atan(math.sqrt(light * (2 + light)))) - 1
        assert int(row["impacts"]) == pytest.approx(walls, abs=1.001)
    assert number(glued["most"]) == max(int(row["impacts"]) for row in rows)
    assert int(glued["tried"]) == len(rows) > 40
    # A ratio slows the light ball down: by a root.
    fewer = 100 * (1 - math.sqrt(1 - float(glued["other"])))
    assert int(glued["fewer"]) == pytest.approx(fewer, abs=0.6)
    theory, *_ = points(MAPS.figures["fig-extremes-edge"].axes[0])
    for e, border in theory[::30]:
        assert border == pytest.approx(x.infinite_below(e), rel=1e-9)


def test_fig_extremes_shortest_as_drawn():
    """The least of all ratios; the textbook's outcome jumps there, too."""
    rows = [r for r in stored("shortest", spread="0") if float(r["restitution"]) < 1]
    least = {}
    for r in rows:
        if int(r["balls"]):
            e = float(r["restitution"])
            least[e] = min(least.get(e, 99), int(r["balls"]))
    (ax,) = CHAPTER.figures["fig-extremes-shortest"].axes
    np.testing.assert_array_equal(points(ax, marker="o")[0], sorted(least.items()))
    told = CHAPTER.glued
    assert (told["lossy"], told["springs-rows"]) == ("0.6", "5 to 40")
    many = min(n for e, n in least.items() if e > 0.6)
    assert (told["least"], told["many"]) == (said(min(least.values())), said(many))
    assert told["percent"] == f"{100 * max(float(r['largest']) for r in rows):.1g}"
    worst = max(rows, key=lambda row: float(row["largest"]))
    assert told["percent-e"] == worst["restitution"] == "0.68"
    near = [float(r["largest"]) for r in rows if float(r["restitution"]) >= float(told["last-e"])]
    assert told["percent-near"] == f"{100 * max(near):.1g}"
    for name, low in ("last", 0), ("last-near", float(told["last-e"])):
        most = max(float(r["last"]) for r in rows if float(r["restitution"]) >= low)
        assert told[name] == said(most, 1)
    one, other = x.copies(np.random.default_rng(1), np.ones((6, 8)), 0.42, 0.2, 1e-12)
    with mpmath.workdps(50):
        off = [
            np.subtract(*(floats(solve(*row, number=mpmath.mpf).velocities) for row in pair))
            for pair in zip(zip(*one), zip(*other))
        ]
    assert np.abs(off).max() > 1e-4


def admissible(three):
    """Whether three balls are in range, no ratio above its bound, Eq. 34."""
    m1, m2, m3 = three.masses if three else (math.nan,) * 3
    return three and three.forward[0] * (m2 + m3) <= m3 and three.backward[0] * (m1 + m2) <= m1


def test_the_condition_number_and_how_it_grows():
    """By fifty digits: a few units, near the largest ratio as one over a root, then level."""
    chain, found = Chain([1, 1, 1], [1, 0, 0], 1), {}
    for step in (1e-2, 1e-4, 1e-8):
        for part in (1, 10**-1.5, 1e-4, 1e-6, 1e-10):
            law = ImpulseCorrelation(0.5 * (1 - part))
            value = found[step, part] = condition_number(chain, law, step=step).number
            problem = x.case([1] * 3, [1, 0, 0], 1, 0.5 * (1 - part))
            base, total = floats(problem.exact().velocities), 0.0
            for which in Problem._fields[:-1]:  # all but `meeting`
                for k, given in enumerate(getattr(problem, which)):
                    near = (x.moved(problem, which, k, side * given) for side in (-step, step))
                    sides = [floats(p.exact().velocities) for p in near if admissible(p)]
                    total += max([0.0, *(np.abs(side - base).max() for side in sides)])
            assert value == pytest.approx(total / np.abs(base).max() / step, rel=1e-3)
    assert 2 < found[1e-2, 1] < 5
    told = re.findall(r": ([\d.]+), ", CHAPTER.printed("extremes-13"))
    for kappa, ratio, name in zip(told, (0.15, 0.49), ("here", "near"), strict=True):
        value = condition_number(chain, ImpulseCorrelation(ratio), step=1e-3).number
        assert float(kappa) == pytest.approx(value, rel=0.02)
        CHAPTER.tells({f"kappa-{name}": 0.1 * value}, off=0.051)
    assert found[1e-8, 1e-6] == pytest.approx(10 * found[1e-8, 1e-4], rel=0.1)
    assert found[1e-4, 1e-10] == pytest.approx(found[1e-4, 1e-6], rel=0.2)  # h reaches it


def test_fig_extremes_jump_as_drawn():
    """By the textbook over fifty digits: what rests is at the filled circle, what moves beyond."""
    by_ratio, on_springs = CHAPTER.figures["fig-extremes-jump"].axes
    lines = [line for line in points(by_ratio) if len(line) > 20]
    ends, left = {}, {}
    for line, ball in zip(lines, (4, 4, 0, 0), strict=True):
        for moves, after in (line[0], line[10], line[-1]):
            row = [1] * 5, [1, 0, 0, moves, -1], "0.98", "0.15"
            with localcontext(prec=50):
                found = solve(*row, number=lambda x: Decimal(str(x)))
            right = found.velocities
            assert after == pytest.approx(float(right[ball]) * (1 if ball else -1), abs=1e-9)
            ends[ball, moves], left[moves] = right[ball], float(sum(v * v for v in right))
            if not moves:
                started = [
                    contact for kind, contact in found.events if kind == "maximum_compression"
                ]
                assert said(len(started)) == CHAPTER.glued["ends-hits"]
    CHAPTER.tells({"ends-lost": 50 * (2 - left[0.0])}, off=0.5)
    five, one = (line[:, 1] for line in points(on_springs, 13))  # alike at rest, no step
    assert five[6] == pytest.approx(one[6], abs=1e-6)
    assert np.abs(np.diff([five, one])).max() < 0.02
    CHAPTER.tells({"ends-jump": float(ends[4, 0.0] - ends[4, 1e-12])})
    CHAPTER.tells({"ends-speed": float(ends[4, 0.0]), "ends-first": float(ends[0, 0.0])})


def test_a_light_ball_amplifies_by_half_the_number_of_its_impacts():
    """Between balls of mass 1, by powers of the map of two impacts over fifty digits."""
    with mpmath.workdps(50):

        def struck(m):
            """Velocities after all impacts of elastic balls, and how many there are."""
            v, count = [mpmath.mpf(1), mpmath.mpf(0), mpmath.mpf(0)], 0
            masses = [mpmath.mpf(1), m, mpmath.mpf(1)]
            while v[0] > v[1] or v[1] > v[2]:
                c = 0 if v[0] > v[1] else 1
                a, b = masses[c : c + 2]
                common = 2 * (a * v[c] + b * v[c + 1]) / (a + b)
                v[c], v[c + 1], count = common - v[c], common - v[c + 1], count + 1
            return v, count

        m, part = mpmath.mpf("1e-6"), mpmath.mpf("1e-9")
        (here, impacts), (there, _) = struck(m), struck(m * (1 + part))
        grown = [float(abs(b - a) / part) for a, b in zip(here, there)]
    told = CHAPTER.glued
    assert number(told["light-impacts"]) == impacts
    assert grown[1] == pytest.approx(impacts / 2, rel=0.01)
    assert number(told["light-grown"]) == pytest.approx(1e-9 * grown[1], rel=0.05)
    v = [spring_velocities([1, 1e-6 * (1 + x), 1], [1, 0, 0], accuracy=1e-8) for x in (0, 1e-5)]
    assert number(told["light-springs"]) == pytest.approx(1e5 * abs(v[1] - v[0])[1], rel=0.05)
    assert number(told["heavy-grown"]) == pytest.approx(1e-9 * max(grown[0], grown[2]), rel=0.2)


def test_rows_on_springs_do_not_jump():
    for n in 5, 40:
        m = np.vstack([np.ones(n), 1 + 1e-5 * uniform(np.random.default_rng(n), -1, 1, (8, n))])
        v = spring_velocities(m, np.eye(n)[0] * m[:, ::-1], viscosity=0.17, accuracy=1e-9)
        moved = 1e5 * np.abs(v[1:] - v[0]).max()
        assert 0.1 < moved < 1.2 * float(CHAPTER.glued["springs-moved"])


def test_the_table_of_the_inventory():
    """Verdicts of the judge, all of whose chains are in two lines."""
    told = Chapter("extremes_inventory").glued
    rows = read("judge.csv")
    right = sum(int(r["right"]) for r in read("judge_short.csv"))
    assert 1.1 * number(told["short"]) > right > number(told["short"]) == 1e6
    judged, longer = number(told["judged"]), number(told["longer"])
    assert judged + longer == sum(int(n) for r in rows for k, n in r.items() if k != "family")
    short = "right", "wrong", "other reading", "open", "unfinished"
    assert judged == sum(int(r[word]) for r in rows for word in short)
    for word, glued in (("wrong", "wrong"), ("unfinished", "refused")):
        count = sum(int(r[word]) for r in rows)
        assert told[glued] == (said(count) if count else "none")
    assert told["unlike"] == said(sum(int(r["unlike them"]) for r in rows))
    faint = [r for r in rows if r["family"] in ("tiny ratios", "small ratios")]
    plain = sum(int(r["unlike them"]) for r in rows if r not in faint)
    assert (told["unlike-plain"], plain) == ("three", 3)
    assert int(told["given-up"]) == sum(int(r["given up"]) for r in rows)
    assert int(told["not-judged"]) == sum(int(r["nobody knows"]) for r in rows)
    assert int(told["rest"]) == sum(int(r["left"]) for r in stored("finish"))


def test_families_in_which_the_textbook_solves_in_the_place_of_the_loop():
    """Most of two families and some of two others, as the inventory says."""
    part = {}
    for name in JUDGED:
        faint = [
            math.prod(small)
            for problem in family(name, 300)
            if (
                small := [x for x in map(float, problem.forward + problem.backward) if 0 < x < 1e-4]
            )
        ]
        part[name] = sum(product < 1e-11 for product in faint) / 300
    assert len(part) == 11
    assert {name for name, some in part.items() if some > 0.5} == {"tiny ratios", "small ratios"}
    assert {name for name, some in part.items() if 0 < some < 0.5} == {"losses", "wide"}


def test_the_thresholds_of_the_inventory():
    """Typed here, and by what chains on both sides of those meet that a user can cross."""
    printed = Chapter("extremes_inventory").printed("inventory-limits-table")
    told = re.findall(r"\b\d+⁻\S+|\d(?= roundings)", printed)
    assert " ".join(told) == "2⁻⁸⁴ 2⁻¹²⁰ 10⁻¹⁸ 10⁻¹³ 10⁻⁴ 10⁻¹¹ 10⁻³⁰ 10⁻¹⁵ 4"
    rows, still = [1.0, 1.0, 1.0], [1.0, 0.5, 0.0]
    for ratios, warned in (
        ((0.0, 0.0), False), ((0.9e-4, 1e-7), True), ((1.1e-4, 1e-7), False),
        ((0.9e-4, 1.2e-7), False), ((0.9e-4, 1.1e-4), False),
    ):  # fmt: skip
        trace = collide(Chain(rows, still, 0.5), ImpulseCorrelation(*ratios))
        assert (trace.margin == 0) == warned
    Chain([1, 1], [1, 0], 1.1e-30)
    with pytest.raises(ValueError, match="at least 1e-30"):
        Chain([1, 1], [1, 0], 0.9e-30)
    collide(Chain([1, 1.1e-15], [1, 0]), ImpulseCorrelation(0))
    with pytest.raises(ValueError, match="1e-15"):
        collide(Chain([1, 0.9e-15], [1, 0]), ImpulseCorrelation(0))


def test_rule_nine_says_who_drives_after_a_sequence_without_end():
    """Without it the digits end the sequence, with one contact or the other, and so the outcome."""
    row = [1, 1, "0.01", "0.1", 1], [1, "0.5", 0, 0, 0], [1, 1, "0.9", 1]
    ratios = ["0.9", "0.9", 0], [0, 1, 1]
    told = Chapter("extremes_inventory").printed("b5c1e0a3")
    for digits, last in ((30, 2), (40, 1), (60, 2), (100, 1)):
        with localcontext(prec=digits):
            end = solve(*row, *ratios, meeting="0.3", number=Decimal)
        # The next event is the greatest compression of the contact that pushes from behind.
        closed = end.events.index(("maximum_compression", 0)) - 1
        assert end.events[closed] == ("close", last)
        shown = re.search(rf"(?m)^ *{digits} digits: (.+) m/s$", told)[1].split()
        assert [*map(float, shown)] == pytest.approx([*map(float, end.velocities)], abs=6e-5)
