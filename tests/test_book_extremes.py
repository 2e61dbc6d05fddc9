"""The chapter on extremes: the numbers in its text and figures, from the maps and anew."""

import csv
import math
from pathlib import Path

import extremes as x
import numpy as np
import pytest
from chapters import Chapter, number

from cradle import Chain, ImpulseCorrelation, SpringChain, collide, paper_chain
from cradle.models.correlation import outcomes

ROOT = Path(__file__).parents[1]


def stored(part):
    with (ROOT / "data" / f"extremes_{part}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def glued():
    """Numbers that the text of the chapter shows."""
    return Chapter("extremes").glued


@pytest.fixture(scope="module")
def inventory():
    """Numbers that the text of the appendix shows."""
    return Chapter("extremes_inventory").glued


def test_fig_extremes_map(glued):
    rows = stored("map")
    assert number(glued["points"]) == 4 * len(rows)
    assert sum(int(row["faulty"]) for row in rows) == 0
    compared = [row for row in rows if int(row["compared"])]
    assert number(glued["compared"]) == sum(int(row["compared"]) for row in compared)
    assert int(glued["excess"]) == math.ceil(max(float(row["own"]) for row in compared))
    moving = [row for row in compared if float(row["condition"]) <= 1e12]
    thirteen = [row for row in moving if float(row["error"]) * x.EPS <= 1e-13 - x.EPS / 2]
    assert int(glued["thirteen"]) == round(100 * len(thirteen) / len(moving))


def test_fig_extremes_edges(glued):
    near = [row for row in stored("edges") if math.isfinite(float(row["distance"]))]
    jumps = [row for row in near if float(row["jump"]) > 1e-8]
    assert glued["jumping"] == " and ".join(sorted({row["sequence"] for row in jumps}))
    assert {len(row["sequence"]) for row in jumps} == {6}
    nearest = min(near, key=lambda row: float(row["distance"]))
    assert glued["nearest-chain"] == nearest["sequence"]
    assert number(glued["nearest"]) == pytest.approx(100 * float(nearest["distance"]), rel=0.05)
    assert float(nearest["jump"]) < 1e-8  # "harmless"
    first = min(jumps, key=lambda row: float(row["distance"]))
    assert glued["first-jump-input"] == f"{first['input']}[{first['index']}]"
    assert float(glued["first-jump"]) == pytest.approx(100 * float(first["distance"]), abs=0.051)


def test_fig_extremes_jump():
    """The two branches on either side of the nearest jump, solved anew with fifty digits."""
    rows = [row for row in stored("edges") if row["sequence"] == "BCACBA"]
    edge = min(
        (row for row in rows if float(row["jump"]) > 1e-8), key=lambda row: float(row["distance"])
    )
    chain, model = paper_chain("BCACBA", excess="saturate")
    own = chain.masses, chain.velocities, chain.restitution
    problem = x.case(*own, model.forward, model.backward)
    name, k = edge["input"], int(edge["index"])
    value = getattr(problem, name)[k] * float(edge["distance"]) * float(edge["side"])
    sides = [x.moved(problem, name, k, value * (1 + s)).exact().velocities for s in (-1e-3, 1e-3)]
    size = max(abs(a - b) for a, b in zip(*sides)) / max(map(abs, sides[0]))
    assert float(size) == pytest.approx(float(edge["jump"]), rel=0.05)


def test_fig_extremes_count(glued, inventory):
    rows = [row for row in stored("elastic") if float(row["ratio"]) == 0]
    most = max(rows, key=lambda row: int(row["impacts"]))
    assert number(glued["most"]) == int(most["impacts"])
    assert number(glued["lightest"]) == pytest.approx(10 ** -float(most["power"]))
    # The wedge, without fifty digits: the angle is arctan sqrt(r (2 + r)).
    for row in rows:
        r = 10 ** -float(row["power"])
        turns = math.pi / math.atan(math.sqrt(r * (2 + r)))
        assert abs(int(row["impacts"]) - (turns - 0.5)) <= 0.5 + 1e-6
    worst = max(float(r["error"]) / float(r["condition"]) for r in rows if float(r["condition"]))
    assert float(inventory["own-elastic"]) == pytest.approx(worst, abs=0.0051)


def test_fig_extremes_edge(glued):
    """The border by the closed form, by the eigenvalues of the cycle, and by the solver."""
    for row in stored("limits"):
        if float(row["ratio"]) == 0:
            e = float(row["restitution"])
            assert float(row["theory"]) == pytest.approx(x.infinite_below(e), rel=1e-3)
    for e, part in ((0.3, 0.99), (0.3, 1.01), (0.8, 0.99), (0.8, 1.01)):
        a = 1 / (1 + x.infinite_below(e) * part)
        cycle = np.array([[1, (1 + e) * a], [0, -e]]) @ np.array([[-e, 0], [(1 + e) * a, 1]])
        assert np.linalg.det(cycle) == pytest.approx(e * e)
        assert np.trace(cycle) == pytest.approx((1 + e) ** 2 * a * a - 2 * e)
        # From NumPy 2.5 on all are of a complex type.
        assert np.isreal(np.linalg.eigvals(cycle)).all() == (part < 1)
    found = [
        outcomes([1, light, 1], [1, 0, 0], e, 0.15).collisions.sum()
        for light in (1e-3, 1e-6, 1e-12)
        for e in (0.0, 1e-16, 0.3, 0.7, 0.9)
    ]
    assert number(glued["bounded"]) == max(found)
    made = [
        int(row[side]) for row in stored("limits") for side in ("half", "below", "above", "double")
    ]
    assert number(glued["border-most"]) == max(made)


def test_fig_extremes_growth(glued):
    rows = stored("growth")
    uneven = [r for r in rows if float(r["spread"]) > 0]
    assert int(glued["uneven"]) == round(
        max(float(r["largest"]) / float(r["size"]) for r in uneven)
    )
    broken = [
        r for r in rows
        if float(r["spread"]) == 0 and float(r["restitution"]) < 1 and float(r["largest"]) > 1e-6
    ]  # fmt: skip
    assert int(glued["breaks"]) == min(int(r["balls"]) for r in broken)
    # A jump does not care for the size of the perturbation.
    for r in broken:
        if float(r["median"]) > 1e-5:
            assert r["size"] in ("1e-12", "1e-09")


def test_table_of_cost():
    rows = stored("cost")
    for point, (masses, e, ratio) in x.POINTS.items():
        events = next(r for r in rows if r["point"] == point and r["method"] == "events")
        trace = collide(Chain(masses, [1, 0, 0], e), ImpulseCorrelation(ratio))
        assert len(trace.events) == int(events["evaluations"])
        assert float(events["error"]) < 1e-12
        march = [float(r["error"]) for r in rows if (r["point"], r["method"]) == (point, "march")]
        assert march[0] > march[-1] > 1e-6
    spring = next(
        r for r in rows if (r["point"], r["method"], r["effort"]) == ("equal", "springs", "1e-08")
    )
    again = collide(Chain([1, 1, 1], [1, 0, 0], 1), SpringChain(1.0, rtol=1e-8))
    assert again.evaluations == pytest.approx(int(spring["evaluations"]), rel=0.1)
    # A cell of the table is the best of its row: the event solver needs least, nearly everywhere.
    table = Chapter("extremes_inventory").cells["inventory-11"].outputs[0].data["text/plain"]
    for point in x.POINTS:
        assert point in table


def test_table_of_unfinished_chains(inventory):
    rows, never = stored("finish"), stored("unfinished")
    assert number(inventory["hundred"]) == sum(int(r["chains"]) for r in rows)
    assert number(inventory["unfinished"]) == len(never)
    assert number(inventory["periodic"]) == sum(int(r["period"]) > 0 for r in never)
    assert number(inventory["spent"]) == sum(float(r["energy"]) < 1e-12 for r in never)
    assert number(inventory["fewest"]) == min(int(r["balls"]) for r in never)
    left = [r["family"] for r in never if r["finished"] == "0"]
    for pattern in ("nested", "cycle", "irregular"):
        found = [r for r in never if r["finished"] == "0" and r["late_pattern"] == pattern]
        assert number(inventory[f"late-{pattern}"]) == len(found)
    for family in ("within", "saturate"):
        assert number(inventory[f"rest-{family}"]) == left.count(family)
    assert number(inventory["rest-share"]) == pytest.approx(len(left) / 1000, abs=0.005)
    done = [int(r["collisions"]) for r in never if r["finished"] == "1"]
    assert number(inventory["default-most"]) == pytest.approx(max(done), rel=0.05)


def test_exercise_of_the_wedge():
    """Masses 1, 1/4, 1: tan of the angle is 3/4, and 180 / 36.87 is 4.88."""
    assert math.sqrt(0.25 * 2.25) == 0.75
    printed = Chapter("extremes").printed("extremes-34")
    assert printed.split()[0] == str(math.ceil(math.pi / math.atan(0.75)) - 1) == "4"


def test_cells_show_what_they_claim():
    """Verdicts that a cell prints or tabulates, read back from the stored page."""
    page = Chapter("extremes_inventory")
    assert page.printed("inventory-13").count("True") == 2
    assert page.printed("inventory-05").count(": below ") == 2
    invariants = page.cells["inventory-03"].outputs[-1].data["text/plain"]
    assert invariants.count("never above") == 4
    elastic = page.cells["inventory-07"].outputs[-1].data["text/plain"]
    assert elastic.count("True") == 3
    lines = Chapter("extremes").printed("extremes-19").splitlines()
    for line, light in zip(lines, (1e-1, 1e-3, 1e-5), strict=True):
        walls = math.ceil(math.pi / math.atan(math.sqrt(light * (2 + light)))) - 1
        assert line.endswith(f"wedge {walls}, solver {walls}")
