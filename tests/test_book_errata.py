"""The errata: their numbers by a second route, and the tests that they name."""

import ast
import csv
import math
import re
from pathlib import Path

import mpmath
import numpy as np
import pytest
import truth
from chapters import Chapter, floats, number
from march import march
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from test_book_n_balls import READINGS, outcome
from turns import by_turns, edge

from cradle import (
    Chain,
    ImpulseCorrelation,
    collide,
    paper_chain,
    paper_sequences,
)
from cradle.closed_form import back_impact_line

TESTS = Path(__file__).parent
BOOK = TESTS.parent / "book"
ENDINGS = (".ipynb", ".md")
CHAPTER = Chapter("errata")
TEXT = "\n".join(cell.source for cell in CHAPTER.cells.values() if cell.cell_type == "markdown")
GLUED = CHAPTER.glued


def exact(*chain, **options):
    """Outcome of the reference solver in fifty digits; strings are read as decimals."""
    with mpmath.workdps(50):
        return floats(truth.solve(*chain, **options).velocities)


def image(v):
    """Velocities in a mirror, as numbers or as decimals."""
    return ["-" + x if isinstance(x, str) else -x for x in v[::-1]]


def test_every_number_is_shown_and_every_test_exists():
    shown = re.findall(r"\{glue:text\}`errata-([\w-]+)`", TEXT)
    assert set(shown) == set(GLUED)
    defined = {
        node.name
        for path in TESTS.glob("test_*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
    }
    named = set(re.findall(r"`(test_\w+)`", TEXT))
    assert len(named) > 10
    assert named <= defined


#: An entry: its label, number, kind and line. A reference to one, from any page.
ENTRY = re.compile(r"\(erratum-([\w-]+)\)=(\\n\",\s+\"|\n)\*\*(\d*)\*\*")
REFERENCE = re.compile(r"\{ref\}`((?:erratum )?)(\d*) <erratum-([\w-]+)>`")


def numbered() -> dict[Path, str]:
    """The pages with entries and references numbered in the order of the page of errata."""
    pages = {p: p.read_text(encoding="utf-8") for p in BOOK.glob("*.*") if p.suffix in ENDINGS}
    names = [found[1] for found in ENTRY.finditer(pages[BOOK / "errata.ipynb"])]
    order = {name: number for number, name in enumerate(names, start=1)}
    assert len(order) == len(names)
    return {
        path: ENTRY.sub(
            lambda m: f"(erratum-{m[1]})={m[2]}**{order[m[1]]}**",
            REFERENCE.sub(lambda m: f"{{ref}}`{m[1]}{order[m[3]]} <erratum-{m[3]}>`", text),
        )
        for path, text in pages.items()
    }


def test_entries_are_numbered_as_they_stand_and_short():
    """`python tests/test_book_errata.py` numbers them and all references to them anew."""
    for path, text in numbered().items():
        assert path.read_text(encoding="utf-8") == text, path.name
    line = r"^\(erratum-[\w-]+\)=\n\*\*(\d+)\*\* · \*(\w+)\* · (.+)$"
    entries = re.findall(line, TEXT, flags=re.MULTILINE)
    assert [int(number) for number, *_ in entries] == list(range(1, len(entries) + 1))
    assert len(entries) == len(re.findall(r"^\*\*\d", TEXT, flags=re.MULTILINE))
    assert {kind for _, kind, _ in entries} == {"slip", "error", "unsaid", "open"}
    equations, choices, _ = re.split(r"^## (?=Four|What a program)", TEXT, flags=re.MULTILINE)
    _, equations = equations.split("## Six equations")
    for section in equations, choices:
        assert len(re.findall(r"^\*\*\d+\*\* · ", section, flags=re.MULTILINE)) == 4
    with (TESTS.parent / "data" / "ledger.csv").open(encoding="utf-8", newline="") as file:
        corrected = {r["item"] for r in csv.DictReader(file) if r["status"] == "derived, corrected"}
    bold = " ".join(re.findall(r"\*\*.*?\*\*", equations))
    assert {f"Eq. {n}" for n in re.findall(r"<eq-p(\d+)>", bold)} == corrected
    assert len(corrected) == 6
    assert max(len(words.split()) for *_, words in entries) <= 40


def test_where_the_sequences_of_a_light_ball_become_infinite():
    """By the map of turns, followed turn after turn; and where the solver sees no end any more."""
    border = brentq(lambda r: edge(r, 0.5, 0.15) - r, 0.04, 0.06, xtol=1e-7)
    CHAPTER.tells({"edge": border})
    seen = float(GLUED["solver-edge"])
    assert 100 < by_turns(seen, seen, 0.5, 0.15)[0] < 200
    for r, collapsed in (seen - 1e-4, True), (seen + 1e-4, False):
        trace = collide(Chain([1, r, 1], [1, 0, 0], 0.5), ImpulseCorrelation(0.15))
        assert trace.collapsed == collapsed
        assert np.ptp(trace.velocities) < 1e-12


def test_different_parameters_with_one_outcome():
    """That they have one is asked in test_book_three_balls.py."""
    for text in ("(0.9, 0.8, 0.15)", "(0.951351, 0.748331, 0.10)", "(0.848649, 0.864099, 0.20)"):
        assert text in TEXT
    outcome = exact([1, 1, 1], [1, 0, 0], ["0.9", "0.8"], "0.15")
    assert (
        GLUED["ambiguous"] == "(" + ", ".join(f"{v:.6f}" for v in outcome).replace("-", "−") + ")"
    )


def test_counts_of_sequences():
    assert number(GLUED["without-d"]) == sum("D" not in name for name in paper_sequences()) == 8


def test_groups_of_balls():
    """By the reference rules with ratios, and one collision after the other with none (R6)."""
    for name, first in ("ABCCAB", 1), ("BCACBA", 0):
        chain, model = paper_chain(name, excess="saturate")
        balls = chain.masses.tolist(), chain.velocities.tolist(), chain.restitution.tolist()
        ratios = [list(side) for side in model.ratios(len(chain))]
        for label, given in (f"group-{name}-ratio", ratios), (f"group-{name}", [0.0, 0.0]):
            spread = np.ptp(exact(*balls, *given)[first:])
            shown = number(GLUED[label]) if label in GLUED else 0.0
            assert shown == pytest.approx(spread, rel=0.06, abs=1e-9), label


def test_ends_of_eq_44_and_factors_of_eq_14():
    """By the closed form, and the ratios of a soft second spring."""
    assert float(GLUED["eq-44-r1"]) == pytest.approx(back_impact_line(0, 0.5, 0.5, 0.15), abs=6e-4)
    assert back_impact_line(float(GLUED["eq-44-r2"]), 0.5, 0.5, 0.15) == pytest.approx(0, abs=1e-3)
    soft = math.pi**2 / 8
    CHAPTER.tells({"loss-factor": soft - 0.5, "effective-factor": soft - 1})


def test_eq_10_against_the_motion_that_it_integrates():
    """Three balls on equal springs, by an integrator, until the first contact opens."""

    def slopes(_, y):
        q, v = y[:3], y[3:]
        return *v, q[1] - q[0], q[0] - 2 * q[1] + q[2], q[1] - q[2]

    def opens(_, y):
        return y[0] - y[1]

    opens.terminal, opens.direction = True, -1
    start = 0, 0, 0, 1, 0, 0
    run = solve_ivp(slopes, (0, 9), start, events=opens, rtol=1e-10, atol=1e-12, max_step=0.1)
    lost = 1 - run.y[3, -1]
    assert run.t[-1] > 2
    assert float(GLUED["lost"]) == pytest.approx(lost, abs=6e-4)
    assert number(GLUED["eq-10"]) == pytest.approx(-lost, abs=6e-4)
    assert float(GLUED["by-balls"]) == 1 / (1 + 1)


def test_eq_34_error_beyond_its_range():
    """Eq. 30 against the reference solver at two ratios for which its radical is real."""
    m1, m2, m3, v1, v2, e2, e3 = 1, 2, 1, 1, 0.5, 1, 0.5
    for a in ("0.8", "0.95"):
        ratio = float(a)
        d = (1 - ratio) * m1 + m2
        lead = (v1 - v2) * (1 + e2) * m1 + v2 * d
        root = math.sqrt(
            1 - ratio * (m2 / m3 + 1) * (1 + v2 * d / ((1 + e2) * m1 * (v1 - v2))) ** -2
        )
        eq_33 = lead * m2 / (d * (m2 + m3)) * (1 + e3 * root)
        missed = abs(eq_33 - exact([1, 2, 1], [1, "0.5", 0], [1, "0.5"], a)[2])
        assert float(GLUED[f"eq-30-at-{round(100 * ratio)}"]) == pytest.approx(missed, abs=5.1e-5)


def test_r2_source_on_the_other_side():
    for name, v, e, a in (
        ("fig-5", [1, "0.8", 0], "0.25", "0.15"),
        ("fig-8", [1, "0.5", 0, 0], 1, "0.1"),
    ):
        equal = [1] * len(v)
        size = abs(exact(equal, v, e, a) + exact(equal, image(v), e, a)[::-1]).max()
        CHAPTER.tells({f"source-{name}": size})


def test_r7_hold_that_drives_on():
    held = exact([1] * 4, [1, 0, 0, 0], 1, ["0.8", "0.3"])
    assert GLUED["hold"] == "(" + ", ".join(f"{v:.4f}" for v in held).replace("-", "−") + ")"
    # What small steps tend to without the rule (tests/test_textbook.py): balls 2 to 4 as one body.
    assert GLUED["chatter"] == f"(−{(3 - 1) / 4}, {2 / 4}, {2 / 4}, {2 / 4})"
    chatter = np.array([-0.5, 0.5, 0.5, 0.5])
    assert GLUED["hold-apart"] == f"{abs(held - chatter).max():.2f}"
    assert float(GLUED["hold-bound"]) == pytest.approx(1 / (1 + 1 - 0.3), abs=5e-4)
    ends = [outcome(way).velocities for way in READINGS.values()]
    assert GLUED["readings"] == f"{np.ptp(ends, axis=0).max():.2f}"


def test_a_bound_that_falls_leaves_no_choice():
    """Ratios within Eq. 53 that come to exceed it: held is what ever smaller steps tend to."""
    chain, model = paper_chain("ABCCAB")
    rows = [
        (chain.masses, chain.velocities, chain.restitution, *model.ratios(6)),
        ([1.8, 0.3, 0.8, 1.5], [1, 0, 0, 0], [0.5] * 3, [0.728, 0.01], [0.1] * 2),
        ([2.7, 0.4, 2, 0.4, 2.2], [1, 0, 0, 0, 0], [1] * 4, [0.852, 0.14, 0.845], [0.1] * 3),
        ([2.1, 0.3, 1.2, 1.5, 1.6], [1, 0, 0, 0, 0], [0.9] * 4, [0.809, 0.31, 0.489], [0.1] * 3),
    ]
    for masses, velocities, restitution, *ratios in rows:
        trace = collide(Chain(masses, velocities, restitution), ImpulseCorrelation(*ratios))
        assert trace.saturated
        given = [list(map(float, x)) for x in (masses, velocities, restitution, *ratios)]
        far, near = (
            abs(march(*given, steps=steps, hold=False).velocities - trace.velocities).max()
            for steps in (1000, 16_000)
        )
        assert near < far / 4
        assert near < 2e-4


def test_r7_square_root_at_the_bound():
    """Equal elastic balls at ratio a: v3 = 2 (1 + s) / (3 + s^2), s^2 = 1 - 2 a, and so on."""
    for digits in (6, 12):
        s = math.sqrt(2 * 10.0**-digits)
        after = np.array([s**2 - 1, 2 * (1 - s), 2 * (1 + s)]) / (3 + s**2)
        moved = abs(after - np.array([-1, 2, 2]) / 3).max()
        assert number(GLUED[f"root-{digits}"]) == pytest.approx(moved, rel=0.06)


def test_r8_ties_go_to_the_left():
    tie = exact([1] * 5, [1, "-0.1", 0, "0.1", -1], 1, "0.1")
    CHAPTER.tells({"tie": abs(tie + tie[::-1]).max()})
    # A generic chain and its mirror image, with a tie and without.
    masses = [1.185, 0.439, 1.470, 1.043, 1.045]
    for faster, differ in (0, True), (1e-9, False):
        v = np.array([1, -0.1, 0, 0.1 + faster, -0.7])
        here, there = (
            collide(Chain(m, u, 0.7), ImpulseCorrelation(0.1)).velocities
            for m, u in ((masses, v), (masses[::-1], -v[::-1]))
        )
        assert (abs(here + there[::-1]).max() > 0.1) == differ


class OneByOne(truth.Impact):
    """The reference rules, but of several closings due without progress the left one alone."""

    closed = 0

    def round(self):
        self.closed = 0
        return super().round()

    def close(self, c):
        if not self.closed:
            super().close(c)
        self.closed += 1


def test_closings_that_are_due_together():
    velocities = [1, -0.1, 0, 0, 0.1, -1]
    together = collide(Chain([1] * 6, velocities, 1), ImpulseCorrelation(0.1))
    np.testing.assert_allclose(together.velocities, -together.velocities[::-1], atol=1e-14)
    outcomes = [
        np.array(truth.solve([1] * 6, velocities, 1, 0.1, number=float, impact=kind).velocities)
        for kind in (truth.Impact, OneByOne)
    ]
    np.testing.assert_allclose(outcomes[0], together.velocities, atol=1e-14)
    assert 0.01 < abs(outcomes[1] - outcomes[0]).max() < 0.02
    assert abs(outcomes[1] + outcomes[1][::-1]).max() > 0.01


def test_simultaneous_within_rounding():
    """Where events tie: the tie undone in one direction makes a jump, in the other it does not."""
    rest = [1, 0, 0, 0, 0, 0], [1, "0.5", "0.25", 1, "0.75"], ["0.1", 0, 0, "0.1"]
    rest = *rest, ["0.1", "0.25", "0.25", 0]
    tied = exact([1] * 6, *rest)
    lighter = exact([1, 1, 1, "0.99999999999", 1, 1], *rest)
    heavier = exact([1, 1, 1, "1.00000000001", 1, 1], *rest)
    assert abs(tied - lighter).max() > 0.005
    assert abs(tied - heavier).max() < 1e-9


if __name__ == "__main__":
    for path, text in numbered().items():
        path.write_text(text, encoding="utf-8")
