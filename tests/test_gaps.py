"""data/gaps_*.csv: spheres with gaps and leans, computed again by other means."""

import gaps
import numpy as np
import pytest
from chains import HERTZ
from chapters import Chapter, drawn
from stored import numbers, read

from cradle import (
    Chain,
    EnergyDistribution,
    SequentialCollisions,
    SpringChain,
    collide,
    paper_chain,
    ratio_table,
)

CHAPTER = Chapter("table_2")


def test_touching_spheres_are_the_energy_law_and_wide_gaps_are_pairs():
    np.testing.assert_allclose(
        gaps.strike([1] * 5, np.eye(5)[0], 1.0, [0] * 4), HERTZ["five equal"], atol=5e-6
    )
    masses, e = np.array([[1, 3, 0.5], [1, 1, 1]]), np.array([[0.5, 0.8], [0.3, 0.9]])
    found = {gap: gaps.strike(masses, [1, 0, 0], e, [0, gap]) for gap in (0, 6)}
    for k, (m, r) in enumerate(zip(masses, e, strict=True)):
        for gap, law in ((0, EnergyDistribution(1.0)), (6, SequentialCollisions())):
            after = collide(Chain(m, [1, 0, 0], r), law).velocities
            np.testing.assert_allclose(found[gap][k], after, atol=1e-3)


def test_lean_between_two_balls_at_rest_by_scipy():
    """A lean of .1 with its constant force; read when both contacts have opened, and when."""
    from scipy.integrate import solve_ivp

    lean, held = 0.1, 0.1**1.5

    def rate(_, y):
        push = np.maximum([y[0] - y[1], y[1] - y[2] + lean], 0) ** 1.5 - [0, held]
        return [*y[3:], -push[0], push[0] - push[1], push[1]]

    def opened(_, y):
        return max(y[0] - y[1], y[1] - y[2] + lean)

    opened.terminal, opened.direction = True, -1
    run = solve_ivp(rate, (0, 9), [0, 0, 0, 1, 0, 0], events=opened, rtol=1e-10, atol=1e-12)
    found = gaps.strike([1] * 3, [1, 0, 0], 1.0, [0, -lean])
    np.testing.assert_allclose(found, run.y[3:, -1], atol=2e-3)
    law = SpringChain(gaps=[0, -lean])
    way = collide(Chain([1] * 3, [1, 0, 0]), law)
    assert way.times[-1] == pytest.approx(run.t[-1], rel=1e-5)


@pytest.mark.parametrize("triplet", ["AAA", "ADD", "BCB", "DAC", "CDB"])
def test_rows_of_triplets(triplet):
    row = next(r for r in read("gaps_triplets.csv") if r["triplet"] == triplet)
    chain, model = paper_chain(triplet, excess="saturate")
    listed = collide(chain, model).velocities
    for name in ("sequential", "energy_hertz", "fused"):
        after = collide(chain, gaps.LAWS[name]).velocities
        assert float(row[name]) == pytest.approx(np.abs(after - listed).max(), abs=1e-3)
    masses, e, _ = gaps.of_triplets([triplet])
    for shift, error in (("own_gap", "with_own_gap"), ("own_shift", "with_own_shift")):
        after = gaps.strike(masses, [1, 0, 0], e, [[0, float(row[shift])]])
        assert float(row[error]) == pytest.approx(np.abs(after - listed).max(), abs=2e-4)
    law = EnergyDistribution([1.0, float(row["own_quotient"])])
    after = collide(chain, law).velocities
    assert float(row["with_own_quotient"]) == pytest.approx(np.abs(after - listed).max(), abs=3e-3)


def test_what_the_chapter_says():
    """One number each beats a shared one."""
    rows = numbers("gaps_triplets.csv")
    assert len(rows) == 64
    rms = {name: np.sqrt(np.mean([row[name] ** 2 for row in rows])) for name in list(rows[0])[1:]}
    chain = ["one_gap", "gap_of_pair", "with_own_gap", "with_own_shift", "with_own_quotient"]
    assert sorted(chain, key=rms.get, reverse=True) == chain
    assert rms["with_own_quotient"] < rms["stiffness_of_pair"] / 2 < rms["one_ratio"] / 2
    *few, gap, quotient = (line.split()[-1] for line in CHAPTER.printed("scored").splitlines()[2:])
    (ax,) = drawn("table_2", ("setup", "fig-scored"))["fig-table-2-scored"].axes
    assert [f"{bar.get_width():g}" for bar in ax.patches] == [*few, gap, quotient]
    bars = [bar.get_y() + bar.get_height() / 2 for bar in ax.patches]
    named = zip(ax.get_yticks(), (x.get_text() for x in ax.get_yticklabels()), strict=True)
    printed = [line.rsplit(maxsplit=4)[0] for line in CHAPTER.printed("scored").splitlines()[2:]]
    assert [name for _, name in named] == printed
    np.testing.assert_allclose(ax.get_yticks(), bars)
    assert gap == str(sum(row["with_own_gap"] <= 0.05 for row in rows))
    assert quotient == str(sum(row["with_own_quotient"] <= 0.05 for row in rows))
    assert int(quotient) > 55
    own = [row["own_quotient"] for row in rows]
    ends = min(own), max(own)
    assert ends == (gaps.QUOTIENTS[0], gaps.QUOTIENTS[-1]) == (1e-4, 1e4)
    told = CHAPTER.glued["scored-quotient-least"], CHAPTER.glued["scored-quotient-most"]
    assert told == ("10⁻⁴", "10 000".replace(" ", "\u202f"))
    assert CHAPTER.glued["scored-pair"] == max(few, key=int)
    assert max(few, key=int) == str(sum(row["stiffness_of_pair"] <= 0.05 for row in rows))


def test_ratios_of_touching_spheres():
    """The largest of each triplet: every contact collides once, so Eqs. 24 and 31 tell it."""
    listed = ratio_table().set_index("triplet")["ratio"]
    masses = gaps.of_triplets(list(listed.index))[0]
    after = gaps.strike(masses, [1, 0, 0], 1.0, [[0, 0]])
    once = 1 - (2 / (1 - after[:, 0]) - 1) * masses[:, 1] / masses[:, 0]
    assert int(CHAPTER.glued["scored-above-spheres"]) == (listed > once).sum()
    largest = dict(zip(listed.index, once))
    smallest = {r["triplet"]: float(r["implied"]) for r in read("gaps_triplets.csv")}
    assert all(smallest[t] < a + 1e-3 for t, a in largest.items())
