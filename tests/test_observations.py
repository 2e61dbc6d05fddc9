"""The page of observations: its verdicts by other routes, and its sources."""

import functools
import re
from pathlib import Path

import gaps
import numpy as np
import pytest
from chapters import Chapter, after
from real_cradles import first_strikes, misfits, spheres
from scipy.optimize import brentq

PAGE = Chapter("observations")
BOOK = Path(__file__).parents[1] / "book"
#: Of two balls, in the unit of the integrators, (m v² / k)^0.4.
DEPTH = 0.625**0.4


def verdicts():
    """The table of verdicts: number of the observation to words by law."""
    found = {
        number: {law: words[number - 1] for law, *words in told("seen")} for number in (1, 2, 3)
    }
    return found | {4: {law: words[3] for law, *words in told("again")}}


def told(cell):
    """The lines of a table: law, and what it says of each observation."""
    return [re.split(r"\s{2,}", line.strip()) for line in PAGE.printed(cell).splitlines()[2:]]


#: By hand: which laws have what was seen, at least with little loss, and which have not.
KNOWN = {
    1: ({"one body", "convex", "ratio 0.15", "spheres"}, {"pairs"}),
    2: ({"ratio 0.15", "spheres"}, {"pairs"}),  # by the others the second contact stays closed
    3: ({"pairs", "one body", "convex", "ratio 0.15", "spheres"}, set()),
    4: ({"ratio 0.15", "spheres"}, {"pairs", "one body", "convex"}),
}


@pytest.mark.parametrize("row", KNOWN)
def test_which_law_agrees(row):
    """By hand from the verdicts."""
    yes, no = KNOWN[row]
    for law, words in verdicts()[row].items():
        agrees, fails = words[0] in "yaif✓e", words in ("no", "✗")
        assert (law in yes) == agrees, law
        assert (law in no) == fails, law
        at_the_end = {law: words[row - 1] for law, *words in told("again")}[law]
        shown = {
            "yes": "✓",
            "no": "✗",
            "at any gap": "any gap",
            "second stays closed": "stays closed",
        }
        if words[:2] == "if":
            words = f"e > {float(words.split()[-1]):.2f}"
        elif words[:4] == "from":
            words = f"gap > {words.split()[1]}"
        assert at_the_end == shown.get(words, words)


def test_the_table_of_the_page_has_every_law_once():
    """Of the pulse, only spheres say how long an impact takes."""
    rows = {law: words for law, *words in told("again")}
    assert list(rows) == ["pairs", "one body", "convex", "ratio 0.15", "spheres"]
    assert {len(words) for words in rows.values()} == {6}
    assert [law for law, words in rows.items() if words[5] == "✓"] == ["spheres"]
    assert {words[5] for law, words in rows.items() if law != "spheres"} == {"–"}
    assert {words[4] for words in rows.values()} == {"✓"}


E = np.round(np.arange(0.71, 1, 0.02), 2)


@functools.cache
def lossy(e):
    """The loss that gives two spheres this restitution, by another integrator."""
    return brentq(lambda a: np.ptp(spheres([1, 0], [0], a)) - e, 0, 0.4, xtol=1e-7)


def shown(name):
    """The numbers that the text takes from the page by a name."""
    return [float(x) for x in PAGE.glued[name].replace("−", "-").split(", ")]


def test_who_goes_back():
    """Pairs: means of velocities that are not negative. Ratio a: e > 1 - a, Eq. 24."""
    row = verdicts()[1]
    assert row["pairs"] == "no"
    assert row["one body"] == row["convex"] == "yes"
    limits = {name: float(row[name].removeprefix("if e > ")) for name in ("ratio 0.15", "spheres")}
    assert limits["ratio 0.15"] == 1 - 0.15
    limit = brentq(lambda e: spheres([1, 0, 0], [0, 0], lossy(e))[0], E[0], E[-1], xtol=1e-5)
    assert limits["spheres"] == pytest.approx(limit, abs=6e-4)
    assert PAGE.glued["limit"] == row["spheres"].removeprefix("if e > ")
    assert [law for law, words in verdicts()[2].items() if words[:6] == "second"] == [
        "one body", "convex"
    ]  # fmt: skip
    # The striker leaves the middle ball by every law: pairs, one body, and spheres at both ends.
    for e in (E[0], E[-1]):
        back = (1 - e) / 2, (1 + e) / 2 * (1 - e) / 2
        assert back[0] > back[1]  # it strikes once more, and they part: both still go on
        again = [(w * back[0] + (1 - w) * back[1]) for w in ((1 - e) / 2, (1 + e) / 2)]
        assert 0 < again[0] < again[1]
        assert again[1] - again[0] == pytest.approx(e * (back[0] - back[1]))
        assert (1 - 2 * e) / 3 < (1 + e) / 3
        v = spheres([1, 0, 0], [0, 0], lossy(e))
        assert v[0] < v[1]


def test_who_follows():
    fourth = [spheres(np.eye(5)[0], [0] * 4, lossy(e))[3] for e in E[[0, -1]]]
    row = {law: words[1] for law, *words in told("many")}
    assert row["spheres"] == f"{fourth[0]:.2f} to {fourth[1]:.2f}"
    fused = (1 + E[[0, -1]]) / 5  # four as one body of mass 4
    assert row["one body"] == f"{fused[0]:.2f} to {fused[1]:.2f}"
    for e in E:  # by pairs it is hardly ahead of ball 3
        _, _, third, fourth, _ = pairs(np.eye(5)[0], e)
        assert third < fourth < 1.2 * third
        _, _, third, fourth, _ = spheres(np.eye(5)[0], [0] * 4, lossy(e))
        assert fourth > 2 * third

    def ahead(e):
        *_, third, fourth, _ = after(([1] * 5, np.eye(5)[0], [e] * 4), 0.15)
        return fourth - 2 * third

    assert verdicts()[4]["ratio 0.15"] == f"e > {brentq(ahead, 0.8, 0.95):.2f}"
    ratio = [after(([1] * 5, np.eye(5)[0], [e] * 4), 0.15)[3] for e in E]
    assert row["ratio 0.15"] == f"{ratio[0]:.2f} to {ratio[-1]:.2f}"
    assert (ratio[0], ratio[-1]) == (max(ratio), min(ratio))


def test_no_restitution_makes_the_laws_that_agree_meet_the_film():
    """Chi-square of four velocities, by another solver and another integrator."""
    film = {1: first_strikes(4)[1]}
    for e in np.linspace(0.93, 0.999, 24):
        for v in (
            after(([1] * 5, np.eye(5)[0], [e] * 4), 0.15),
            spheres(np.eye(5)[0], [0] * 4, lossy(e)),
        ):
            assert (misfits(lambda _, v=v: v, film, (1,)) ** 2).sum() > 200


def test_a_gap_decides():
    """Rows 1 and 3 are one experiment, by another integrator and another law of loss."""
    assert gaps.strike([1] * 3, [1, 0, 0], 0.95, [0, 0])[0] < 0
    wide = gaps.strike([1] * 3, [1, 0, 0], 0.95, [0, 1.5])
    assert 0 < wide[0] < wide[1]

    def least(e):
        a = lossy(e)
        return brentq(lambda gap: spheres([1, 0, 0], [0, gap], a)[0], 0.05, 0.6)

    told = float(verdicts()[3]["spheres"].split()[1])
    assert told == pytest.approx(least(0.95) / DEPTH, abs=6e-3)
    assert PAGE.glued["least"] == verdicts()[3]["spheres"].split()[1]
    assert shown("more") + shown("less") == pytest.approx(
        [least(0.9) / DEPTH, least(0.99) / DEPTH], abs=6e-3
    )


def test_fig_gap():
    """Percent, and places: balls 1 and 2 have moved by their velocities, 3 is out of scale."""
    loss = lossy(0.95)
    axes = PAGE.figures["fig-observations-gap"].axes
    caption = PAGE.cells["fig-gap"].metadata.mystnb.figure.caption
    for later, gap in zip(axes[1::2], (0, 0.5 * DEPTH), strict=True):
        v = spheres([1, 0, 0], [0, gap], loss)
        told = [x.get_text() for x in later.texts if "%" in x.get_text()]
        assert told == [f"{100 * x:.0f} %".replace("-", "−") for x in v]
        first, second, third = (ball.center[0] for ball in later.patches[:3])
        assert [first, second - 1] == pytest.approx(14 * v[:2], abs=0.01)
        assert third < 2 + 14 * v[2]
        assert "ball 3 is farther out than drawn" in caption


def pairs(v, e):
    """Velocities after collisions of pairs, one after the other."""
    v = v.copy()
    while (meets := np.diff(v) < -1e-12).any():
        k = int(meets.argmax())
        push = (1 + e) / 2 * (v[k] - v[k + 1])
        v[k : k + 2] = v[k] - push, v[k + 1] + push
    return v


def test_common_motion():
    """Of spheres and of pairs, by other programs; a fifth at first."""
    table = {law: float(words[2]) for law, *words in told("many")}
    v = p = np.eye(5)[0]
    loss = lossy(0.9)
    for stroke in range(1, 41):
        v = -spheres(v, [0] * 4, loss)
        p = -pairs(p, 0.9)
        for law, w in (("spheres", v), ("pairs", p)):
            part = 5 * w.mean() ** 2 / (w @ w)
            assert stroke != 10 or table[law] == pytest.approx(part, abs=0.01)
            assert stroke < 40 or part > 0.9
    assert min(table.values()) > 0.2


def test_the_pulse_of_a_long_row():
    """A fifth root is what the force of spheres has; the other laws have no time."""
    assert [law for law, *words in told("again") if words[5] == "✓"] == ["spheres"]
    PAGE.tells({"power": 1 / 5})


def test_every_reference_is_cited():
    keys = set(re.findall(r"^@\w+\{(\w+),", (BOOK / "references.bib").read_text(), re.MULTILINE))
    text = "".join(
        p.read_text(encoding="utf-8") for ext in ("md", "ipynb") for p in BOOK.glob(f"*.{ext}")
    )
    cited = set(",".join(re.findall(r"\{cite:\w\}`([\w,]+)`", text)).split(","))
    assert cited == keys
    related = (BOOK / "related.ipynb").read_text(encoding="utf-8")
    assert len(set(re.findall(r"\{cite:t\}`(\w+)`", related))) >= 30


def test_no_loss_helps_ball_4():
    """Touching spheres send it off slowest without one, by another integrator."""
    film = Chapter("observations_film")
    least = 100 * spheres(np.eye(5)[0], [0] * 4, 0)[3]
    film.tells({"fourth": least})
    for e in (0.8, 0.9, 0.95, 0.99):
        assert 100 * spheres(np.eye(5)[0], [0] * 4, lossy(e))[3] > least
    v, error = (100 * x[3] for x in first_strikes(4)[1])
    assert film.glued["fourth-film"] == f"{v:.1f} ± {error:.1f}"
