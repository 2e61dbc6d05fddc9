"""What the tables and figures of book/experiments.ipynb show, by truth.py and by bisection."""

import itertools
import re
from functools import cache

import mpmath
import numpy as np
import pytest
from chains import uniform
from chapters import Chapter, floats, lines, points
from truth import solve

from cradle import (
    collide,
    paper_chain,
    paper_sequences,
    post_impact_velocities,
    ratio_table,
    restitution_table,
    textbook,
)

#: Of the appendix; its values are named after the chapter.
BESIDE = Chapter("reading_table_2")
BESIDE.glued = {name.removeprefix("experiments-"): x for name, x in BESIDE.glued.items()}
SUSPECTS = ("DBB", "BBD", "DBC", "CBD")
TABLE_2 = ratio_table().set_index("triplet")


@cache
def predicted(sequence, meeting="0.5"):
    """Outcome of one of the ten chains in thirty digits, with decimals as printed."""
    with mpmath.workdps(30):
        chain, model = paper_chain(sequence, excess="saturate")
        texts = [[str(x) for x in values] for values in (chain.masses, chain.restitution)]
        ratios = [[str(x) for x in values] for values in (model.forward, model.backward)]
        start = ["1"] + ["0"] * (len(sequence) - 1)
        return solve(texts[0], start, texts[1], *ratios, meeting=meeting)


def interchanged():
    table = TABLE_2.ratio.copy()
    for one, other in (("DBB", "BBD"), ("DBC", "CBD")):
        table[one], table[other] = table[other], table[one]
    return table


def test_table_2_interchange_brings_b_and_c_into_line():
    pairs = [(x + "B" + z, x + "C" + z) for x in "ABCD" for z in "ABCD"]

    def spread(table):
        return np.std([table[c] - table[b] for b, c in pairs])

    swapped = interchanged()
    assert spread(swapped) < spread(TABLE_2.ratio) / 3
    assert (swapped[list(SUSPECTS)] <= TABLE_2.bound[list(SUSPECTS)]).all()


def test_no_other_two_interchanges_do_as_well():
    """Of entries with B or C in the middle, in exact decimals: one interchange after the other."""
    names = [x + y + z for x in "ABCD" for y in "BC" for z in "ABCD"]
    table = {t: round(1000 * TABLE_2.ratio[t]) for t in names}
    others = {t: t[0] + ("C" if t[1] == "B" else "B") + t[2] for t in names}
    gap = {t: (table[t] - table[others[t]]) * (1 if t[1] == "C" else -1) for t in names}

    def spread(changed):
        """Sum of squares of the differences, and their sum, after some entries have changed."""
        now = dict(gap)
        for t, value in changed.items():
            step = (value - table[t]) * (1 if t[1] == "C" else -1)
            now[t] += step
            now[others[t]] += step
        found = [now[t] for t in names if t[1] == "C"]
        return 16 * sum(x * x for x in found) - sum(found) ** 2

    proposed = [("DBB", "BBD"), ("DBC", "CBD")]

    def swapped(pairs):
        return {a: table[b] for one in pairs for a, b in (one, one[::-1])}

    limit, ways, found = spread(swapped(proposed)), 0, []
    every = list(itertools.combinations(names, 2))
    for first, second in itertools.combinations(every, 2):
        if not {*first} & {*second}:
            ways += 1
            if spread(swapped([first, second])) <= limit:
                found.append(swapped([first, second]))
    kept = [x for x in found if all(v <= 1000 * TABLE_2.bound[t] for t, v in x.items())]
    assert kept == [swapped([("BBD", "DBB"), ("CBD", "DBC")])]
    one, other = ("DBB BBD", "DCB BCD"), ("DBC CBD", "DCC CCD")
    assert {" ".join(sorted(x)) for x in found} == {
        " ".join(sorted(f"{a} {b}".split())) for a in one for b in other
    }
    BESIDE.tells({"ways": ways, "as-good": len(found)})
    above = {t: 100 * (a / TABLE_2.bound[t] - 1) for t, a in TABLE_2.ratio.items()}
    above = {t: size for t, size in above.items() if size > 0}
    assert set(above) == {"CCA", "DBB", "DBC"}
    BESIDE.tells({"cca-percent": above["CCA"], "gross-least": above["DBB"],
                  "gross-most": above["DBC"]})  # fmt: skip
    alike = [gap[t] for t in names if t[1] == "C" and t[0] + "B" + t[2] not in SUSPECTS]
    assert max(map(abs, alike)) == table["ACB"] - table["ABB"]
    BESIDE.tells({"alike": len(alike), "abb": table["ABB"] / 1000, "acb": table["ACB"] / 1000,
                  "alike-by": max(map(abs, alike)) / 1000})  # fmt: skip


def test_ten_sequences_five_three_two():
    assert [sum(len(s) == n for s in paper_sequences()) for n in (4, 5, 6)] == [5, 3, 2]


def check_prediction(sequence):
    exact = predicted(sequence)
    for speed in (0.5, 1.0, 1.5, 2.0):
        trace = collide(*paper_chain(sequence, speed=speed, excess="saturate"))
        expected = floats(exact.velocities)
        np.testing.assert_allclose(trace.velocities / speed, expected, rtol=1e-12, atol=1e-14)
        path, impulses = np.array(exact.path, float), np.array(exact.path_impulses, float)
        np.testing.assert_allclose(trace.path / speed, path, rtol=0, atol=2e-15)
        np.testing.assert_allclose(trace.path_impulses / speed, impulses, rtol=0, atol=2e-16)
        absorbed = floats(exact.absorbed)
        np.testing.assert_allclose(trace.absorbed / speed**2, absorbed, rtol=0, atol=2e-16)
        assert trace.collisions.tolist() == exact.collisions
        assert [tuple(event) for event in trace.events] == exact.events
        assert set(trace.saturated) == exact.held


@pytest.mark.parametrize("sequence", [s for s, n in paper_sequences().items() if n == 10])
def test_fig_10_prediction(sequence):
    check_prediction(sequence)


@pytest.mark.parametrize("sequence", [s for s, n in paper_sequences().items() if n == 11])
def test_fig_11_prediction(sequence):
    check_prediction(sequence)
    assert predicted(sequence).velocities[0] < 0  # the light striker bounces back


@pytest.mark.parametrize("sequence", [s for s, n in paper_sequences().items() if n == 12])
def test_fig_12_prediction(sequence):
    check_prediction(sequence)


def outcome(triplet, ratio):
    chain, _ = paper_chain(triplet)
    return post_impact_velocities(
        chain.masses,
        chain.velocities,
        chain.restitution,
        np.atleast_1d(ratio)[:, None],
        [TABLE_2.ratio[triplet[::-1]]],
        excess="saturate",
    )


def climb(v):
    return v * abs(v) / (2 * 9.81)


def distance(triplet, ratio, by=np.asarray):
    """Largest difference of a velocity (or height) from the outcome at the printed ratio."""
    asked = min(TABLE_2.ratio[triplet], TABLE_2.bound[triplet])
    return float(np.abs(by(outcome(triplet, ratio)) - by(outcome(triplet, asked))).max())


def test_table_2_most_open_entries():
    """No other entry is open over more than .2; by bisection outwards from the printed ratio."""

    def edge(triplet, far, error, by):
        near = min(TABLE_2.ratio[triplet], TABLE_2.bound[triplet])
        if distance(triplet, far, by) <= error:
            return far
        for _ in range(16):
            middle = (near + far) / 2
            fits = distance(triplet, middle, by) <= error
            near, far = (middle, far) if fits else (near, middle)
        return near

    def widths(*size):
        return {t: edge(t, top, *size) - edge(t, 0.0, *size) for t, top in TABLE_2.bound.items()}

    width = widths(0.01, np.asarray)
    assert {t for t, w in width.items() if w > 0.2} == {"BBD", "CBD"}
    middle = np.median(list(width.values()))
    high = np.median([*widths(5e-4, climb).values()])
    AS_MEASURED.tells({"span-median-h": high, "half-span-h": high / 2}, 1e-3)
    AS_MEASURED.tells({"span-median": middle, "half-span": middle / 2}, 1e-3)


def test_why_two_entries_are_open():
    """Ball 2 slows down to ball 1 while it pushes D; R7 holds the two until they leave."""
    speeds = []
    for name in ("BBD", "CBD"):
        chain, model = paper_chain(name, excess="saturate")
        exact = solve(
            chain.masses, [1, 0, 0], list(chain.restitution), model.forward, model.backward,
            number=float,
        )  # fmt: skip
        assert chain.masses.argmax() == 2
        closes = exact.events.index(("close", 0)) + 1
        before, met, after = exact.path[closes - 1], exact.path[closes], exact.path[-1]
        assert before[1] > met[1] == pytest.approx(met[0])  # ball 2 comes down to ball 1
        assert before[0] == pytest.approx(met[0])
        assert exact.held == {0}
        assert model.backward > TABLE_2.bound[name[::-1]]
        assert after[0] == pytest.approx(after[1])
        assert after[0] < met[0] < after[2]
        for ratio in np.linspace(0, TABLE_2.bound[name], 400):
            first, second, _ = textbook.solve(
                chain.masses, [1, 0, 0], list(chain.restitution), [ratio], model.backward
            ).velocities
            if float(second - first) < 1e-9:
                speeds.append(float(first))
    AS_MEASURED.tells({"together-low": min(speeds), "together-high": max(speeds)})


def test_landing_five_equal_balls():
    """At ratio .15 nearly one ball leaves; the landing page prints these digits."""
    with mpmath.workdps(30):
        five = floats(solve(["1"] * 5, ["1", "0", "0", "0", "0"], "1", "0.15").velocities)
    found = post_impact_velocities([1] * 5, [1, 0, 0, 0, 0], 1, 0.15)
    np.testing.assert_allclose(found, five, atol=1e-14)
    (line,) = (x for x in Chapter("intro").printed("desk-table").splitlines() if "0.15" in x)
    assert line.split()[2:] == [f"{v + 0.0:.2f}" for v in found.round(2)]


def test_cad_and_dad_would_fit_each_others_place():
    """As parts of the bounds, which are the same for both; and what each does in CDADB."""
    part = TABLE_2.ratio / TABLE_2.bound
    assert TABLE_2.bound["CAD"] == TABLE_2.bound["DAD"]
    for ball, row in zip("CD", BESIDE.printed("table-2-places").splitlines()[-2:]):
        expected = [part[f"{ball}A{last}"] for last in "ABCD"]
        assert [float(x) for x in row.split()[1:]] == pytest.approx(expected, abs=6e-3)
        *others, odd = expected
        assert (min(others) > 0.7 and odd < 0.2) if ball == "C" else max(others) < 0.5 < 0.9 < odd
    chain, model = paper_chain("CDADB")
    given = [list(x) for x in (chain.masses, chain.velocities, chain.restitution)]
    for name, ratio in (("printed", 0.782), ("interchanged", 0.129), ("other", 0.22)):
        forward, backward = ([a[0], ratio, a[2]] for a in (model.forward, model.backward))
        third = float(textbook.solve(*given, forward, backward).velocities[2])
        BESIDE.tells({f"third-{name}": third})


FIGURES, AS_MEASURED = Chapter("experiments"), Chapter("table_2")


def test_five_balls_a():
    """Exercise 2: the striker."""
    FIGURES.tells({"ex-five": float(predicted("AAAAA").velocities[0])})


def test_figs_10_to_12_as_drawn():
    """Each bar at the velocity of its ball in the second solver, each panel with its letters."""
    axes, per_unit = FIGURES.figures["fig-p10"].axes, set()
    for ax, sequence in zip(axes, paper_sequences(), strict=True):
        low, high = ax.get_ylim()
        per_unit.add(round(ax.get_window_extent().height / (high - low), 2))
        balls = np.arange(1, len(sequence) + 1)
        expected = np.column_stack([balls, 100 * floats(predicted(sequence).velocities)])
        drawn = [(bar.get_x() + bar.get_width() / 2, bar.get_height()) for bar in ax.patches]
        np.testing.assert_allclose(drawn, expected, rtol=0, atol=1e-10)
        if whiskers := points(ax, 2, "_"):
            ((line,), third) = whiskers, sequence == "CDADB"
            assert third
            assert (line[:, 0] == 3).all()
            told = [float(FIGURES.glued[name]) for name in ("band-low", "band-high")]
            assert line[:, 1].round().tolist() == told
        assert "".join(label.get_text() for label in ax.get_xticklabels()) == sequence
    assert max(per_unit) - min(per_unit) < 0.01 * max(per_unit)  # one scale for all


def test_two_things_to_see_in_the_ten_predictions():
    spreads = {4: [], 5: [], 6: []}
    for sequence in paper_sequences():
        after = predicted(sequence).velocities
        assert (min(after) < 0) == (sequence[1] == "D"), sequence
        spreads[len(sequence)].append(float(max(after) - min(after)))
    means = [np.mean(spreads[n]) for n in (4, 5, 6)]
    assert means[0] > 1.1 * means[1] > 1.3 * means[2]


def test_bands_of_the_ten_predictions():
    """Entries off by up to 0.01 at random: other draws, in the second solver."""
    rng, table_1 = np.random.default_rng(20), restitution_table()
    wide = {}
    for sequence in paper_sequences():
        chain, _ = paper_chain(sequence)
        pairs = [sequence[i : i + 2] for i in range(len(sequence) - 1)]
        triplets = [sequence[i : i + 3] for i in range(len(sequence) - 2)]
        # Entries of both tables, each under the name that it has wherever the chain uses it.
        same = [("".join(sorted(xy)), table_1.loc[xy[0], xy[1]]) for xy in pairs]
        ahead, back = (
            [(t[::step], TABLE_2.ratio[t[::step]]) for t in triplets] for step in (1, -1)
        )
        found = []
        for _ in range(1000):
            off = {}

            def entry(name, value, off=off):
                return max(0, value + off.setdefault(name, uniform(rng, -0.01, 0.01)))

            e = [min(1, entry(*one)) for one in same]
            forward, backward = ([entry(*one) for one in row] for row in (ahead, back))
            impact = textbook.solve(chain.masses, chain.velocities, e, forward, backward)
            found.append(np.array(impact.velocities, float))
        ends = 100 * np.quantile(found, [0.025, 0.975], axis=0)
        size = np.abs(ends - 100 * floats(predicted(sequence).velocities)).max(axis=0)
        wide |= {(sequence, ball): part for ball, part in enumerate(size)}
        (line,) = (x for x in FIGURES.printed("ten").splitlines() if x.startswith(sequence + " "))
        if sequence == "CDADB":  # its third ball has a range of its own
            told = [FIGURES.glued[name] for name in ("band-low", "band-high")]
            assert ends[:, 2] == pytest.approx([float(end) for end in told], abs=0.9)
            line, size = line.removesuffix(f"; ball 3: {' to '.join(told)}"), np.delete(size, 2)
        assert float(line.split()[-1]) == pytest.approx(size.max(), rel=0.08, abs=0.08)
    assert max(wide, key=wide.get) == ("CDADB", 2)
    assert sorted(wide.values())[-2] == pytest.approx(float(FIGURES.glued["band"]), abs=0.08)


def test_backward_ratios_and_half_a_gram():
    """In the second solver: backward ratios of zero, and masses within their rounding."""
    beside = Chapter("reading_table_2").glued
    change = []
    for sequence in paper_sequences():
        chain, model = paper_chain(sequence, excess="saturate")
        given = [list(x) for x in (chain.masses, chain.velocities, chain.restitution)]
        impact = textbook.solve(*given, list(model.forward), [0.0] * len(model.backward))
        off = np.array(impact.velocities, float) - floats(predicted(sequence).velocities)
        change.append(np.abs(off).max())
    assert float(beside["experiments-backward"]) == pytest.approx(max(change), abs=6e-4)
    chain, model = paper_chain("ABCCA", excess="saturate")
    masses = [m + {"A": 5e-4, "C": -5e-4}.get(k, 0) for k, m in zip("ABCCA", chain.masses)]
    rest = chain.velocities, chain.restitution, model.forward, model.backward
    v = textbook.solve(masses, *map(list, rest)).velocities
    last = BESIDE.printed("abcca-held").splitlines()[-1].split()[-2:]
    assert [float(x) for x in last] == pytest.approx([float(x) for x in v[3:]], abs=6e-5)
    bound = masses[4] / (masses[4] + masses[3])
    assert float(beside["experiments-half-gram-bound"]) == pytest.approx(bound, abs=6e-4)


def test_what_a_prediction_hangs_on():
    """By how much a change of 0.01 moves a velocity, in the second solver."""
    first, other, ratios = [], [], {}
    for sequence in paper_sequences():
        chain, model = paper_chain(sequence, excess="saturate")
        given = [list(chain.restitution), list(model.forward), list(model.backward)]

        def leave(e, forward, backward, chain=chain):
            found = textbook.solve(chain.masses, chain.velocities, e, forward, backward)
            return np.array(found.velocities)

        unchanged = leave(*given)
        for kind, values in enumerate(given):
            for k in range(len(values)):
                changed = [list(numbers) for numbers in given]
                changed[kind][k] += 0.01
                moved = abs(leave(*changed) - unchanged).max()
                if kind:
                    ratios[sequence, kind, k] = moved
                else:
                    (other if k else first).append(moved)
    worst = max(ratios, key=ratios.get)
    assert worst == ("CDADB", 1, 1)
    assert sorted(ratios.values())[-2] < 0.01
    FIGURES.tells(
        {
            "by-first-least": 100 * min(first),
            "by-first-most": 100 * max(first),
            "by-other-most": 100 * max(other),
            "by-ratio-most": 100 * ratios[worst],
            "dad-bound": 166 / (166 + 45 * (1 - TABLE_2.ratio["ADB"])),  # Eq. 53
            "wide": 100 * float(predicted("CDADB").velocities[2]),
        }
    )
    assert FIGURES.glued["ratios-all"] == str(len(ratios))
    assert FIGURES.glued["ratios-small"] == str(sum(x < 0.001 for x in ratios.values()))


def test_table_2_as_shown():
    """Each entry in its place, and framed above its bound."""
    (page,) = [output.data["text/html"] for output in FIGURES.cells["table-2"].outputs]
    found = re.findall(r'<td( style="outline[^"]*")?>([\d.]+)</td>', page)
    assert re.findall(r"<caption>(.)", page) == list("ABCD")
    triplets = [x + y + z for y in "ABCD" for x in "ABCD" for z in "ABCD"]
    for triplet, (frame, ratio) in zip(triplets, found, strict=True):
        part = TABLE_2.ratio[triplet] / TABLE_2.bound[triplet]
        assert (float(ratio), bool(frame)) == (TABLE_2.ratio[triplet], part > 1)


def test_fig_experiments_structure_shows_table_2():
    """Each ratio over its bound, above its first pair, and above its middle ball; the medians."""
    part = TABLE_2.ratio / TABLE_2.bound
    left, right = FIGURES.figures["fig-experiments-structure"].axes
    for ax, of in ((left, lambda t: "".join(sorted(t[:2]))), (right, lambda t: t[1])):
        names = [label.get_text() for label in ax.get_xticklabels()]
        expected = [(names.index(of(t)), part[t]) for t in part.index]
        np.testing.assert_allclose(lines(ax)["ratios"], expected, rtol=1e-12)
        bars = [bar for _, bar in points(ax, 2)[1:]]
        assert len(bars) == len(names) == len(set(names))
        for x, bar in enumerate(bars):
            assert bar[1] == pytest.approx(np.median([y for at, y in expected if at == x]))
    table_1 = restitution_table()
    e = [table_1.loc[x, y] for x, y in (label.get_text() for label in left.get_xticklabels())]
    assert len(e) == 10
    assert e == sorted(e)


def test_fig_experiments_identify_as_drawn():
    """Bars of four triplets: their ends agree within the error, and a step beyond they do not."""
    table = ratio_table().set_index("triplet")
    axes = AS_MEASURED.figures["fig-experiments-identify"].axes
    for triplet in ("AAA", "BBD", "CBD", "CAD", "DAA", "CDC"):
        ax = axes["ABCD".index(triplet[1])]
        row = [x + triplet[1] + z for x in "ABCD" for z in "ABCD"].index(triplet)
        bars = [
            (segment[:, 0].min(), segment[:, 0].max())
            for bar in ax.collections
            for segment in bar.get_segments()
            if segment[0, 1] == row
        ]
        assert bars[0] == pytest.approx((0, table.bound[triplet]))
        step = table.bound[triplet] / 2000
        for low, high in bars[1:]:
            for inside, outside in ((low, low - 1.01 * step), (high, high + 1.01 * step)):
                assert distance(triplet, inside) <= 0.01 + 1e-9
                if 0 <= outside <= table.bound[triplet]:
                    assert distance(triplet, outside) > 0.01
        assert len(bars) == 3 if triplet == "DAA" else len(bars) == 2
