"""Numbers and curves of the chapter on contact forces, by other routes than the chapter's."""

import matplotlib.pyplot as plt
import mpmath
import numpy as np
import pytest
from chains import HERTZ
from chapters import Chapter, code, in_memory, panel, run
from hunt_crossley import closed
from scipy import optimize
from stored import read
from truth import solve

from cradle import viscosity_from

CHAPTER, METHOD = Chapter("forces"), Chapter("forces_method")


def test_zeta_is_hurwitzs():
    cells = code("forces_method")
    last = next(k for k, cell in enumerate(cells) if "def zeta" in cell.source)
    with in_memory(plt.close):
        zeta = run(cells[: last + 1], {})["zeta"]
    for q in (1, 1.5):
        for x in (1e-6, 0.3, 0.5, 1):
            assert zeta(q, x) == pytest.approx(float(mpmath.zeta(-q, x)), abs=1e-7)


def test_fig_kink():
    """Below: Hurwitz's zeta, from mpmath. Above: bars and curve, whose areas differ by it."""
    above, below = METHOD.figures["fig-own-forces-kink"].axes
    _, curve, dot = (line.get_xydata() for line in below.get_lines())
    (theta, marked), (at, off) = dot[0], curve.T
    assert off == pytest.approx([float(mpmath.zeta(-1.5, x)) for x in [1, *at[1:]]], abs=1e-6)
    assert marked == pytest.approx(np.interp(theta, at, off), abs=1e-5)
    force, nodes = (line.get_xydata() for line in above.get_lines())
    assert nodes[:, 0] == pytest.approx(theta + np.arange(3))
    kicks = sum(bar.get_width() * bar.get_height() for bar in above.patches)
    end = nodes[-1, 0]
    assert force[-1] == pytest.approx([end, end**1.5])
    difference = kicks - np.trapezoid(force[:, 1], force[:, 0])
    of_end = end**0.5 / 8 + end**-1.5 / 1920
    assert difference == pytest.approx(marked + of_end, abs=2e-5)


def test_the_curves_have_their_orders():
    shown = panel("forces_method", "fig-own-forces")
    for label, order, name in zip(
        shown, (2, 2.5, 3.5), ("verlet", "better", "corrected"), strict=True
    ):
        work, error = np.log(shown[label]).T
        assert -np.polyfit(work, error, 1)[0] == pytest.approx(order, abs=0.25)
        assert float(label.split()[-1]) == pytest.approx(order, abs=0.25)
        assert name == "verlet" or label.endswith(f": {METHOD.glued[name]}")


def test_the_work_for_an_error():
    shown = list(panel("forces_method", "fig-own-forces").values())
    for name, curve in zip(("verlet", "better", "corrected"), shown, strict=True):
        points = curve.tolist()
        while points[-1][1] <= 1e-3:
            work, within = points.pop()
        more, beyond = points[-1]
        work *= (more / work) ** (np.log(1e-3 / within) / np.log(beyond / within))
        assert METHOD.glued[f"{name}-work"] == f"{work:.0f}"
    # Each ring is where its number says, on the line of a thousandth.
    (ax,) = METHOD.figures["fig-own-forces"].axes
    rings = [ring.get_offsets()[0].tolist() for ring in ax.collections]
    three = [METHOD.glued[f"{name}-work"] for name in ("verlet", "better", "corrected")]
    assert rings == [[float(work), 1e-3] for work in three]
    assert {*three} < {text.get_text() for text in ax.texts}


def test_fig_cost():
    """The stored times and errors; those of the text are among them."""
    for method, shown in panel("forces", "fig-own-forces-cost").items():
        rows = list(read("forces.csv", chain="5 equal", method=method))
        found = [[float(row[name]) for name in ("microseconds", "error")] for row in rows]
        assert shown == pytest.approx(np.array(found))
        if method == "this package":  # errs about ten times less than asked
            asked = [float(row["asked"]) for row in rows]
            assert asked == [1e-2, 1e-3, 1e-4, 1e-6]
            assert all(7 < bound / off < 16 for bound, (_, off) in zip(asked, found, strict=True))
        told = {
            "velocity Verlet": ("batch-verlet", "batch-verlet-four"),
            "this package": ("batch", "batch-four"),
        }
        for name, (time, error) in zip(told.get(method, ()), found[1:]):  # asked for 1e-3, 1e-4
            CHAPTER.tells({name: time})
            assert error < {"batch": 1.3e-4, "batch-verlet": 1e-3}.get(name, 1e-4)
        lossy = list(read("forces.csv", chain="5 equal, A = .03", method=method))
        label = {"velocity Verlet": "lossy-verlet", "this package": "lossy"}.get(method)
        for asked, end in (("1e-03", ""), ("1e-04", "-four")) if label else ():
            (row,) = (row for row in lossy if row["asked"] == asked)
            assert float(row["error"]) < float(asked)
            CHAPTER.tells({label + end: float(row["microseconds"])})
    (ring,) = CHAPTER.figures["fig-own-forces-cost"].axes[0].collections
    CHAPTER.tells({"batch": ring.get_offsets()[0][0]})


def test_the_error_of_the_last_ball():
    lines = METHOD.printed("forces-use").splitlines()
    for line in lines:
        last, error = (line.split(word)[1].split(",")[0] for word in ("last ball ", "error "))
        off = abs(float(last) - HERTZ["five equal"][-1])
        assert float(error) == pytest.approx(off, rel=0.5, abs=6e-7)
    assert len(lines) == 3


@pytest.mark.parametrize(
    ("name", "damping"), [("least", "viscoelastic"), ("least-hunt", "hunt-crossley")]
)
def test_the_least_restitutions(name, damping):
    least = float(CHAPTER.glued[name])
    assert viscosity_from(least, speed=1, masses=[1, 1], damping=damping).size == 1
    with pytest.raises(ValueError, match=f"must lie in .{least:.3f}, 1"):
        viscosity_from(least - 0.001, speed=1, masses=[1, 1], damping=damping)


def test_the_rule_is_per_cents_from_spheres():
    first = HERTZ["three equal"][0]
    ratio = -2 * first / (1 - first)
    done = solve([1] * 5, [1, 0, 0, 0, 0], 1, ratio, number=float)
    off = np.abs(np.array(done.velocities, float) - HERTZ["five equal"]).max()
    (line,) = [
        line.get_ydata()[0]
        for line in METHOD.figures["fig-own-forces"].axes[0].get_lines()
        if line.get_linestyle() == "--"
    ]
    assert line == pytest.approx(off, abs=1e-8)


def test_fig_loss():
    """Hunt and Crossley's by its closed form, the spheres' by the series of Ramirez and others."""
    (ax,) = CHAPTER.figures["fig-own-forces-loss"].axes
    level, spheres, hunt, steady = (line.get_xydata() for line in ax.get_lines()[:4])
    speeds = level[:, 0]
    assert (level[:, 1] == 0.9).all()
    assert steady[:, 1] == pytest.approx(np.maximum(1 - 0.05 / speeds, 0), abs=1e-12)
    for name in (spheres, hunt, steady):
        assert np.interp(0.5, *name.T) == pytest.approx(0.9, abs=1e-5)
    u, e = hunt.T
    a = optimize.brentq(lambda x: closed(x, 0.9), 0.1, 0.2) / 0.5
    assert [closed(a * s, k) / (a * s) ** 2 for s, k in zip(u, e, strict=True)] == pytest.approx(
        [0] * len(u), abs=2e-6
    )
    # e = 1 - C1 A u^(1/5) + 3/5 C1^2 A^2 u^(2/5) - ..., in units of its own.
    part = 1 - spheres[:, 1]
    few = part < 0.12
    slope = np.polyfit(np.log(spheres[few, 0]), np.log(part[few]), 1)[0]
    assert slope == pytest.approx(0.2, abs=0.015)
