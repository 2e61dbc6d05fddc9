"""What the text of book/laws.ipynb says, by second routes."""

import re

import convex
import numpy as np
import pytest
from chains import ELASTIC, HERTZ, LINEAR
from chapters import Chapter, floats, number
from energy_law import strike
from measured_table import find, fused, sequential
from page import WORDS
from stored import read
from truth import solve

from cradle import Chain, ImpulseCorrelation, SpringChain, collide, spring_velocities

CHAPTER = Chapter("laws")


def angle(scene, v):
    """Where outcomes lie on the arc: by the law of cosines in the plane of y = m^(1/2) v."""
    m = np.array(ELASTIC[scene] if isinstance(scene, str) else scene, float)
    y = np.sqrt(m) * (np.asarray(v) - m @ v / m.sum())
    meeting = np.sqrt(m) * np.array([-m[2], -m[2], m[0] + m[1]])  # v1 = v2
    cosine = y @ meeting / np.linalg.norm(y) / np.linalg.norm(meeting)
    return np.degrees(np.arccos(min(cosine, 1.0)))


def rigid(ratio, restitution=1):
    """Three equal balls by the exact solver."""
    return floats(solve([1, 1, 1], [1, 0, 0], restitution, ratio).velocities)


#: Velocities by other routes, in the order of the table.
ANSWERS = {
    "pairs": sequential("three equal"),
    "ratio 0.1325": rigid(0.132503287),
    "energy law, spheres": HERTZ["three equal"],
    "energy law, linear springs": LINEAR["three equal"],
    "convex dissipation": fused("three equal"),
}


def test_the_table_of_outcomes():
    """In the table, and in their order on the arc; those of the first four are near pairs."""
    (output,) = CHAPTER.cells["laws-outcomes"].outputs
    rows = re.findall(r"<tr>(.*?)</tr>", output.data["text/html"], flags=re.S)
    rows = [re.findall(r"<td>(.*?)</td>", row) for row in rows]
    told = {name: v for name, *v in filter(None, rows)}
    assert list(told) == list(ANSWERS)
    for name, v in ANSWERS.items():
        assert told[name] == [f"{x:z.2f}" for x in v], name
    at = [angle("three equal", v) for v in ANSWERS.values()]
    np.testing.assert_allclose(np.diff(at).clip(max=0), 0, atol=1e-4)
    assert at[-1] == pytest.approx(60, abs=1e-6)
    assert max(at[:4]) < 15  # near pairs


def test_fig_laws_paths_ends_on_the_arc():
    """Every end: its impulses from velocities by other routes, and on the curve without losses."""
    (ax,) = CHAPTER.figures["fig-laws-paths"].axes
    x, y = ax.get_lines()[0].get_xydata().T
    np.testing.assert_allclose((1 - x) ** 2 + (x - y) ** 2 + y**2, 1, rtol=0, atol=1e-12)
    np.testing.assert_allclose(x**2 - x * y + y**2, x, rtol=0, atol=1e-12)
    np.testing.assert_allclose([x[0], y[0]], [1, 1], rtol=0, atol=1e-7)
    np.testing.assert_allclose([x[-1], y[-1]], [4 / 3, 2 / 3], rtol=0, atol=1e-7)
    drawn = {line.get_label(): line.get_xydata()[0] for line in ax.get_lines()
             if line.get_marker() != "None"}  # fmt: skip
    assert list(drawn) == ["pairs", "spheres", "convex dissipation"]
    names = "pairs", "energy law, spheres", "convex dissipation"
    for end, name in zip(drawn.values(), names, strict=True):
        v = ANSWERS[name]
        np.testing.assert_allclose(end, [1 - v[0], v[2]], rtol=0, atol=2e-5)
    # Each leader ends at what it names: a way, the arc, a mark.
    ways = {line.get_label(): line.get_xydata() for line in ax.get_lines()
            if line.get_marker() == "None"}  # fmt: skip
    ends = {text.get_text().replace("\n", " "): text.xy for text in ax.texts}
    assert ends.keys() == {*ways, "outcomes without losses", "convex dissipation"} - {"_arc"}
    assert np.linalg.norm(ends.pop("convex dissipation") - drawn["convex dissipation"]) < 0.03
    ways["outcomes without losses"] = ways.pop("_arc")
    for name, end in ends.items():
        at = np.arange(len(ways[name]))
        fine = np.linspace(0, at[-1], 100 * len(at))
        off = [np.interp(fine, at, drawn_to) - x for drawn_to, x in zip(ways[name].T, end)]
        assert np.hypot(*off).min() < 0.03, name


def test_engines_on_the_arc():
    """Engines that keep the energy of three equal balls sit at an end of the arc."""
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
    """Each ratio drawn has the outcome of the springs, by the exact solver, and no other has."""
    # The ratio that reproduces three equal balls, from another program.
    assert IMPLIED[1.5, 1, 1, 1] == pytest.approx(0.132503287, abs=2e-9)
    (ax,) = CHAPTER.figures["fig-laws-map"].axes
    image = np.asarray(ax.images[0].get_array())
    sizes = [float(label.get_text()) for label in ax.get_xticklabels()]
    framed = {(box.get_y() + 0.46, box.get_x() + 0.46) for box in ax.patches}
    single = []
    for text in ax.texts:
        j, i = text.get_position()
        told = [float(x) for x in text.get_text().split("\n…\n")]
        pair = sizes[i], sizes[j]
        assert told[0] == pytest.approx(IMPLIED[1.5, 1, *pair], abs=5.1e-4)
        assert image[i, j] == pytest.approx(IMPLIED[1.5, 1, *pair], abs=1e-9)
        masses = np.cumprod([1, *pair])
        bound = pair[1] / (1 + pair[1])
        after = spring_velocities(masses, [1, 0, 0], accuracy=1e-10)
        aim = np.radians(angle(masses, after))
        angles = []
        for ratio in np.linspace(0, bound, 701):
            trace = collide(Chain(masses, [1, 0, 0]), ImpulseCorrelation(ratio, excess="saturate"))
            angles.append(np.radians(angle(masses, trace.velocities)))
        crossed = np.flatnonzero(np.diff(np.sign(np.array(angles) - aim)))
        assert abs(crossed[0] / 700 * bound - told[0]) < bound / 700 + 5e-4
        assert ((i, j) in {(round(y), round(x)) for y, x in framed}) == (len(told) == 2)
        if len(told) == 2:
            assert crossed.size > 1 or abs(angles[-1] - aim) < 1e-3
            at_end = told[1] > bound - 1e-3
            assert at_end or abs(crossed[-1] / 700 * bound - told[1]) < bound / 700 + 5e-4
        else:
            assert crossed.size == 1
            single.append(image[i, j])
    assert len(ax.texts) == 25
    CHAPTER.tells({"map-least": min(single), "map-most": max(single)})
    assert CHAPTER.glued["several"] == WORDS[len(framed)] == WORDS[25 - len(single)]


def test_springs_do_not_explain_the_ratio_of_three_balls_a():
    """AAA: beside the stiffness that would give it, and the energy law with its losses."""
    CHAPTER.tells({"aaa": 0.167, "aaa-e": 0.97, "map-equal": 0.132503287})
    gamma = float(CHAPTER.glued["crossing-Hertz"])
    assert gamma > 1.2
    trace = collide(Chain([1] * 3, [1, 0, 0], 1), SpringChain([1.0, gamma]))
    np.testing.assert_allclose(trace.velocities, rigid(0.167), rtol=0, atol=1.2e-3)
    stiffer = float(CHAPTER.glued["crossing-lossy"])
    misses = [
        np.abs(strike([1] * 3, [1, 0, 0], 0.97, 2000, [1, g])[0] - rigid(0.167, 0.97)).max()
        for g in (stiffer - 0.015, stiffer, stiffer + 0.015, gamma)
    ]
    assert min(misses) == misses[1] < 1.5e-3 < misses[3]
    lossy, _ = strike([1] * 3, [1, 0, 0], 0.97, 2000)
    told = float(CHAPTER.glued["lossy"])
    worst = {
        ratio: np.abs(lossy - rigid(ratio, 0.97)).max()
        for ratio in (told - 0.003, told, told + 0.003, 0.1325, 0.167)
    }
    assert min(worst, key=worst.get) == told
    assert told < 0.1325 < 0.167
    assert worst[0.167] > 20 * worst[told]


def test_fig_laws_paths_of_the_energy_law_and_of_the_ratio():
    (ax,) = CHAPTER.figures["fig-laws-paths"].axes
    lines = [line for line in ax.get_lines() if line.get_marker() == "None"]
    ways = {line.get_label(): line.get_xydata() for line in lines}
    assert ways["pairs"][[0, -1]].tolist() == [[0, 0], [1, 1]]
    assert [1, 0] in ways["pairs"].tolist()
    outcomes = {}
    for e in (1.0, 0.5):
        outcomes[e], by_time = strike([1] * 3, [1, 0, 0], e, 3000)
        if e == 1:  # each point drawn is near one of the small steps
            path = ways["energy law"]
            apart = np.linalg.norm(path[:, None] - by_time[None, ::7], axis=-1).min(axis=1)
            assert apart.max() < 3e-3
            np.testing.assert_allclose(path[-1], by_time[-1], rtol=0, atol=1e-3)
            assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() < 0.06  # smooth
    np.testing.assert_allclose(outcomes[1.0], HERTZ["three equal"], rtol=0, atol=1e-3)
    (line,) = CHAPTER.cells["laws-ratio"].source.splitlines()
    ratio, path = float(re.search(r"^ratio = (\S+)", line)[1]), ways["ratio"]
    assert ratio == pytest.approx(0.132503287, abs=5e-6)
    v = rigid(ratio)
    end = [1 - v[0], v[2]]
    np.testing.assert_allclose(path[-1], end, rtol=0, atol=1e-7)
    corner = path[path[:, 0] < end[0] - 1e-6]  # a straight line, then upwards
    np.testing.assert_allclose(corner[:, 1], ratio * corner[:, 0], rtol=0, atol=1e-7)
    assert end[0] == pytest.approx(2 / (2 - ratio), abs=1e-7)
    back = -HERTZ["three equal"][0]
    CHAPTER.tells({"back": back, "ratio": 2 * back / (1 + back)})
    apart = np.abs(outcomes[0.5] - rigid(ratio, 0.5))
    assert number(CHAPTER.glued["apart"]) == pytest.approx(apart.max(), abs=1.5e-3)


def test_convex_dissipation_keeps_the_struck_balls_together():
    """The least sum of squares, searched for among velocities in order."""
    found = {}
    for e in (0.05, 0.3, 0.5, 0.9):
        kappa, v = (1 + e) / (1 - e), convex.strike(e)
        by_hand = 4 * kappa / (4 + 3 * kappa) if e > 1 / 7 else 2 / 3
        np.testing.assert_allclose(v, [1 - by_hand, by_hand / 2, by_hand / 2], rtol=0, atol=1e-6)
        found[e] = 1 - v[0], v[2]
    rebound = found[0.5][0] + found[0.5][1] - 1
    assert number(CHAPTER.glued["rebound"]) == pytest.approx(rebound, abs=5e-3)
