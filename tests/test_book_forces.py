"""Numbers and curves of the chapter on contact forces, by other routes than the chapter's."""

import matplotlib.pyplot as plt
import mpmath
import numpy as np
import pytest
from chains import HERTZ
from chapters import Chapter, code, in_memory, number, panel, run
from truth import solve

CHAPTER = Chapter("forces")


def test_zeta_is_hurwitzs():
    cells = code("forces")
    last = next(k for k, cell in enumerate(cells) if "def zeta" in cell.source)
    with in_memory(plt.close):
        zeta = run(cells[: last + 1], {})["zeta"]
    for q in (1, 1.5):
        for x in (1e-6, 0.3, 0.5, 1):
            assert zeta(q, x) == pytest.approx(float(mpmath.zeta(-q, x)), abs=1e-7)


def test_the_curves_have_their_orders():
    shown = panel("forces", "fig-own-forces")
    for label, order, name in zip(
        shown, (2, 2.5, 3.5), ("verlet", "better", "corrected"), strict=True
    ):
        work, error = np.log(shown[label]).T
        assert -np.polyfit(work, error, 1)[0] == pytest.approx(order, abs=0.25)
        assert label.endswith(f": {CHAPTER.glued[name]}")
        assert float(CHAPTER.glued[name]) == pytest.approx(order, abs=0.25)


def test_the_work_for_an_error():
    shown = list(panel("forces", "fig-own-forces").values())
    for name, which, error in (
        ("verlet_work", 0, 1e-3), ("better_work", 1, 1e-3),
        ("corrected_work", 2, 1e-3), ("corrected_fine", 2, 1e-5),
    ):  # fmt: skip
        points = shown[which].tolist()
        while points[-1][1] <= error:
            work, within = points.pop()
        more, beyond = points[-1]
        work *= (more / work) ** (np.log(error / within) / np.log(beyond / within))
        assert CHAPTER.glued[name.replace("_", "-")] == f"{work:.0f}"


def test_the_rule_is_per_cents_from_spheres():
    first = HERTZ["three equal"][0]
    ratio = -2 * first / (1 - first)
    assert CHAPTER.glued["ratio"] == f"{ratio:.3f}"
    done = solve([1] * 5, [1, 0, 0, 0, 0], 1, ratio, number=float)
    off = np.abs(np.array(done.velocities, float) - HERTZ["five equal"]).max()
    assert number(CHAPTER.glued["rule"]) == pytest.approx(off, abs=0.005)
    (line,) = [
        line.get_ydata()[0]
        for line in CHAPTER.figures["fig-own-forces"].axes[0].get_lines()
        if line.get_linestyle() == "--"
    ]
    assert line == pytest.approx(off, abs=1e-8)
