"""What the text of book/laws.ipynb says, by second routes."""

import numpy as np
import pytest
from chains import ELASTIC, HERTZ, LINEAR
from chapters import Chapter, floats, number, points
from energy_law import strike
from measured_table import find, fused, sequential
from scipy.optimize import minimize
from stored import read
from truth import solve

from cradle import Chain, SpringChain, collide

CHAPTER = Chapter("laws")


def angle(scene, v):
    """By the law of cosines in the plane of y, without the package's own angle."""
    m = np.array(ELASTIC[scene], float)
    y = np.sqrt(m) * (np.asarray(v) - m @ v / m.sum())
    meeting = np.sqrt(m) * np.array([-m[2], -m[2], m[0] + m[1]])  # v1 = v2
    cosine = y @ meeting / np.linalg.norm(y) / np.linalg.norm(meeting)
    return np.degrees(np.arccos(min(cosine, 1.0)))


def test_fig_laws_curve_drawn():
    """Every mark: on the circle, its angle by the law of cosines."""
    (ax,) = CHAPTER.figures["fig-laws-curve"].axes
    drawn = {line.get_label(): line.get_xydata()[0] for line in ax.get_lines()
             if line.get_marker() != "None"}  # fmt: skip
    answers = {"sequential": sequential("three equal"), "fused": fused("three equal")}
    answers |= {"Hertz": HERTZ["three equal"], "linear springs": LINEAR["three equal"]}
    answers |= {"AAA": floats(solve([1, 1, 1], [1, 0, 0], [1, 1], 0.167).velocities)}
    assert drawn.keys() == answers.keys()
    named = [text.get_text() for text in ax.texts]
    for name, v in answers.items():
        at = angle("three equal", v)
        assert f"{name}, {at:.0f}°" in named
        place = np.cos(np.radians(at)), np.sin(np.radians(at))
        np.testing.assert_allclose(drawn[name], place, rtol=0, atol=2e-5)


def test_fig_laws_curve_angles():
    """Those of the text, between the two ends of the arc."""
    assert angle("three equal", fused("three equal")) == pytest.approx(60, abs=1e-6)
    expected = {"Hertz": angle("three equal", HERTZ["three equal"])}
    expected |= {"linear": angle("three equal", LINEAR["three equal"])}
    measured = floats(solve([1, 1, 1], [1, 0, 0], [1, 1], 0.167).velocities)
    expected |= {"measured": angle("three equal", measured), "end": 60.0}
    assert 0 < expected["Hertz"] < expected["measured"] < expected["linear"] < 60
    for name, value in expected.items():
        assert CHAPTER.glued[f"angle-{name}"] == f"{value:.0f}"
    # Engines that keep the energy of three equal balls sit at an end of the arc.
    for row in find("engine", chain="three equal"):
        if abs(row["energy_change"]) < 1e-6 and row["model"] != "MuJoCo":
            at = angle("three equal", row["velocities"])
            assert min(abs(at), abs(at - 60)) < 0.1, row["model"]


def test_mujoco_on_the_arc():
    """Five of its six outcomes are near an end; the sixth one is near linear springs (engines)."""
    rows = find("engine", model="MuJoCo", chain="three equal")
    assert len(rows) == 6
    by_distance = []
    for row in rows:
        at = angle("three equal", row["velocities"])
        by_distance.append((min(at, 60 - at), at, row["setting"], row["velocities"]))
    *_, (second, *_), (_, at, setting, v) = sorted(by_distance, key=lambda found: found[0])
    assert setting == "default, apart"
    off = np.abs(v - np.array(LINEAR["three equal"])).max()
    assert second < 5 < at
    assert off < 0.015


NAMES = "exponent", "k2_over_k1", "m2_over_m1", "m3_over_m2"
#: Ratio that springs imply, by exponent, stiffness and both ratios of masses.
IMPLIED = {
    tuple(float(row[name]) for name in NAMES): float(row["ratio"] or "nan")
    for row in read("implied_ratio.csv")
}


def test_fig_laws_map():
    # Ratios that reproduce three equal balls, from another program.
    assert IMPLIED[1.5, 1, 1, 1] == pytest.approx(0.132503287, abs=2e-9)
    assert IMPLIED[1, 1, 1, 1] == pytest.approx(0.230498292, abs=2e-9)
    upper, lower = CHAPTER.figures["fig-laws-map"].axes[:2]
    curves = [np.array(line) for line in points(upper) if len(line) > 5]
    rigid = floats(solve([1, 1, 1], [1, 0, 0], [1, 1], 0.167).velocities)
    for p, name in ((1.0, "linear"), (1.5, "Hertz")):
        equal = ((k[1], r) for k, r in IMPLIED.items() if k[0] == p and k[2:] == (1, 1))
        curve = np.array(sorted(equal))
        assert any(x.shape == curve.shape and np.allclose(x, curve, rtol=1e-12) for x in curves)
        # Proportional to gamma where it is small, with a factor far from one; 1/2 where large.
        small = IMPLIED[p, 0.001, 1, 1] / 0.001
        assert small == pytest.approx(IMPLIED[p, 0.01, 1, 1] / 0.01, rel=0.02)
        assert small < 0.3
        assert IMPLIED[p, 1000, 1, 1] == pytest.approx(0.5, abs=1e-4)
        # The stiffness ratio that gives AAA does, by springs: solved here, not interpolated.
        gamma = float(CHAPTER.glued[f"crossing-{name}"])
        trace = collide(Chain([1] * 3, [1, 0, 0], 1), SpringChain([1.0, gamma], p))
        np.testing.assert_allclose(trace.velocities, rigid, rtol=0, atol=1.2e-3)
    image = np.asarray(lower.images[0].get_array())
    assert [text.get_text() for text in lower.texts] == [f"{value:.3f}" for value in image.ravel()]
    assert image[2, 2] == pytest.approx(IMPLIED[1.5, 1, 1, 1], abs=1e-12)
    ratios = sorted(ratio for key, ratio in IMPLIED.items() if key[:2] == (1.5, 1))
    assert sorted(image.ravel()) == ratios
    assert len(ratios) == 25
    CHAPTER.tells({"map-least": ratios[0], "map-most": ratios[-1]})
    assert ratios[-1] > 30 * ratios[0]


def paths_drawn():
    """The arc, and for each law its paths without and with losses."""
    ax = CHAPTER.figures["fig-laws-paths"].axes[0]
    arc, *rest = points(ax)
    names = [line.get_label() for line in ax.get_lines() if line.get_label()[0] != "_"][1:]
    return arc, {name: (rest[4 * k], rest[4 * k + 2]) for k, name in enumerate(names)}


def test_fig_laws_paths_of_the_energy_law_and_of_the_ratio():
    arc, laws = paths_drawn()
    (hertz, lossy), (line, lossy_line) = laws["energy law, Hertz"], laws["constant ratio"]
    x, y = arc.T
    np.testing.assert_allclose((1 - x) ** 2 + (x - y) ** 2 + y**2, 1, rtol=0, atol=1e-12)
    np.testing.assert_allclose(arc[[0, -1]], [[1, 1], [4 / 3, 2 / 3]], rtol=0, atol=1e-7)
    outcomes = {}
    for path, e in ((hertz, 1.0), (lossy, 0.5)):
        v, by_time = strike([1] * 3, [1, 0, 0], e, 3000)
        outcomes[e] = v
        # Each point drawn is near one of the small steps.
        apart = np.linalg.norm(path[:, None] - by_time[None, ::7], axis=-1).min(axis=1)
        assert apart.max() < 3e-3
        np.testing.assert_allclose(path[-1], by_time[-1], rtol=0, atol=1e-3)
    np.testing.assert_allclose(outcomes[1.0], HERTZ["three equal"], rtol=0, atol=1e-3)
    ratio = 0.132503287
    for path, e in ((line, 1), (lossy_line, 0.5)):
        done = solve([1] * 3, [1, 0, 0], e, ratio)
        end = [1 - float(done.velocities[0]), float(done.velocities[2])]
        np.testing.assert_allclose(path[-1], end, rtol=0, atol=1e-7)
        corner = path[path[:, 0] < end[0] - 1e-6]  # a straight line, then upwards
        np.testing.assert_allclose(corner[:, 1], ratio * corner[:, 0], rtol=0, atol=1e-7)
    other = floats(done.velocities)
    apart = np.abs(outcomes[0.5] - other).max()
    assert number(CHAPTER.glued["apart"]) == pytest.approx(apart, abs=1.5e-3)
    assert number(CHAPTER.glued["apart"]) > 0.01


def test_convex_dissipation_keeps_the_struck_balls_together():
    """The least sum of squares, searched for among velocities in order."""
    before = np.array([1.0, 0, 0])
    order = {"type": "ineq", "fun": np.diff}
    found = {}
    for e in (0.05, 0.3, 0.5, 0.9):
        kappa = (1 + e) / (1 - e)

        def cost(v, kappa=kappa):
            mean = -np.diff(before + v) / 2
            return 0.5 * ((v - before) ** 2).sum() + kappa * (mean**2).sum()

        v = minimize(cost, [0.3, 0.3, 0.4], constraints=[order], tol=1e-14).x
        by_hand = 4 * kappa / (4 + 3 * kappa) if e > 1 / 7 else 2 / 3
        np.testing.assert_allclose(v, [1 - by_hand, by_hand / 2, by_hand / 2], rtol=0, atol=1e-6)
        found[e] = 1 - v[0], v[2]
    elastic, lossy = paths_drawn()[1]["convex dissipation"]
    np.testing.assert_allclose(elastic[-1], [4 / 3, 2 / 3], rtol=0, atol=1e-7)
    np.testing.assert_allclose(lossy[-1], found[0.5], rtol=0, atol=1e-6)
    rebound = found[0.5][0] + found[0.5][1] - 1
    assert number(CHAPTER.glued["rebound"]) == pytest.approx(rebound, abs=5e-3)
