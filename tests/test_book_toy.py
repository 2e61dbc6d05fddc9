"""Numbers of the chapter on the toy, by other routes than the chapter's."""

import math
import re

import numpy as np
import pytest
import real_cradles
from chains import HERTZ
from chapters import Chapter, drawn, floats, number, panel
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from truth import solve

CHAPTER = Chapter("toy")
INVENTORY = Chapter("extremes_inventory").glued
LENGTH, BACK, G, RATIO = 0.12, 0.04, 9.81, 0.15
PERIOD, STRIKE = 2 * math.pi * math.sqrt(LENGTH / G), BACK * math.sqrt(G / LENGTH)
#: Steel balls of 45 g: Hertz's stiffness of a contact, from their radius.
MASS = 0.045
RADIUS = (3 * MASS / (4 * np.pi * 7800)) ** (1 / 3)
STIFFNESS = 4 / 3 * 210e9 / (2 * (1 - 0.3**2)) * np.sqrt(RADIUS / 2)


def glued(name):
    return number(CHAPTER.glued[name])


def strokes(count, v, e=1.0, ratio=RATIO):
    """Velocities after each stroke by the independent solver and the map of reversal."""
    found, v = [], floats(v)
    for _ in range(count):
        found.append(floats(solve([1.0] * len(v), v.tolist(), e, ratio, number=float).velocities))
        v = -found[-1]
    return np.array(found)


def rows(cell):
    """Numbers after the colon of each printed line."""
    return [
        [float(x) for x in line.split(":")[1].strip(" []").split()]
        for line in CHAPTER.printed(cell).splitlines()
        if ":" in line
    ]


def test_minute():
    impacts = math.floor((60 - PERIOD / 4) / (PERIOD / 2)) + 1
    CHAPTER.tells({"strike": STRIKE, "degrees": math.degrees(math.asin(BACK / LENGTH))})
    first, energy = CHAPTER.printed("minute").splitlines()
    assert first == f"{impacts} impacts"
    assert energy.endswith(": 1.000000")


def test_several():
    story, two = rows("several")
    assert story == [0, 0, 0, 1, 1]
    expected = strokes(1, [1, 1, 0, 0, 0])[0]
    np.testing.assert_allclose(two, expected, rtol=0, atol=5.1e-4)
    CHAPTER.tells(dict(zip(("two-third", "two-fourth", "two-fifth"), expected[2:])))


def test_strokes_and_fig_toy_models():
    """Twenty strokes and many more; then the end of a lossy minute."""
    after = strokes(173, [1, 0, 0, 0, 0])
    for row, stroke in zip(rows("strokes"), (1, 2, 3, 20, 173), strict=True):
        np.testing.assert_allclose(row, after[stroke - 1], rtol=0, atol=5.1e-4)
    inner = 100 * (after[:, 1:4] ** 2).sum(axis=1)
    CHAPTER.tells({
        "inner-first": inner[0], "inner-twenty": inner[19], "inner-most": inner.max(),
        "second-first": -after[1, 0], "second-next": -after[1, 1],
        "late-fifth": after[172, 4], "late-fourth": after[172, 3],
        "lossy-last": 1 / 5,
    })  # fmt: skip


def test_mirror():
    """The map from either side, by the independent solver."""
    one, other = strokes(20, [1, 0, 0, 0, 0]), -strokes(20, [0, 0, 0, 0, -1])[:, ::-1]
    apart = np.abs(one - other).max(axis=1)
    assert glued("mirror-worst") > apart.max() - 0.006
    CHAPTER.tells({"mirror-first": -other[1, 0], "mirror-next": -other[1, 1]})


@pytest.mark.parametrize(("name", "e"), [("ninety", 0.9), ("ninetynine", 0.99)])
def test_fig_toy_drift(name, e):
    after = strokes(41, [1, 0, 0, 0, 0], e)
    pace = (after[40].var() / after[20].var()) ** (1 / 40)
    assert glued(f"pace-{name}") == pytest.approx(pace, abs=5.1e-4)
    assert pace < e  # faster than two balls
    assert glued("left") == 20


def test_fig_inventory_resting():
    """Bounce after bounce by root finding, then one oscillator of the joint frequency."""
    w = np.sqrt(G / np.array([0.10, 0.14]))
    x, v, t, e = np.array([-0.04, -0.0392]), np.zeros(2), 0.0, 0.5

    def at(tau):
        position = x * np.cos(w * tau) + v / w * np.sin(w * tau)
        return position, v * np.cos(w * tau) - x * w * np.sin(w * tau)

    def gap(tau):
        return float(np.diff(at(tau)[0])[0])

    for _ in range(14):  # later bounces are too low for this way of counting
        step = 1e-3 if t == 0 else 0.1 * (v[1] - v[0])
        low = step
        while gap(low + step) > 0:
            low += step
        tau = brentq(gap, low, low + step, xtol=1e-16, rtol=1e-15)
        (left, right), (v1, v2) = at(tau)
        flight = tau
        t += tau
        x = np.full(2, (left + right) / 2)
        v = (v1 + v2) / 2 + np.array([-1, 1]) * e * (v1 - v2) / 2
    end = t + flight * e / (1 - e)  # the flights shrink by e
    assert float(INVENTORY["crowd-end"]) == pytest.approx(end, abs=6e-5)
    joint = math.sqrt(np.mean(w**2))
    common = v.mean()
    falls = math.atan(-x[0] * joint / common) / joint
    assert float(INVENTORY["opens"]) == pytest.approx(t + falls, abs=1.5e-3)


def test_second_stroke_of_springs_by_another_integrator():
    def rate(_, y):
        force = 1e9 * np.maximum(y[:2] - y[1:3], 0) ** 1.5
        return [*y[3:], -y[0] - force[0], -y[1] + force[0] - force[1], -y[2] + force[1]]

    found = solve_ivp(
        rate, (0, 2 * np.pi), [-1, 0, 0, 0, 0, 0], "RK45", rtol=1e-9, atol=1e-12, max_step=0.02
    )  # fmt: skip
    lines = [line.split(":")[-1].split() for line in CHAPTER.printed("springs").splitlines()]
    stiff, touching = map(floats, lines[-2:])
    np.testing.assert_allclose([*found.y[:3, -1]] * 2, stiff, rtol=0, atol=2e-3)
    assert glued("second-off") == pytest.approx(np.abs(stiff[:3] - touching).max(), abs=6e-3)


def test_second_stroke_of_steel_by_another_integrator():
    """Strings pull all balls alike while they touch, so that only the forces count."""

    def rate(_, y):
        force = np.maximum(-np.diff(y[:5]), 0) ** 1.5
        return [*y[5:], *np.append(0, force) - np.append(force, 0)]

    def after(x, v):
        ends = solve_ivp(rate, (0, 60), [*x, *v], "RK45", rtol=1e-10, atol=1e-12).y[:, -1]
        return ends[:5] - 60 * ends[5:], ends[5:]  # as if they had always moved so

    x, v = after(np.zeros(5), np.eye(5)[0])
    # Half a period later all come back, at places and with velocities that are reversed.
    start = 30.0
    _, v = after(-x + start * v, -v)
    CHAPTER.tells({"steel-second-first": -v[0], "steel-second-next": -v[1]}, off=1e-3)


def test_contact_of_steel_balls_in_closed_form():
    deepest = (5 * (MASS / 2) * STRIKE**2 / (4 * STIFFNESS)) ** 0.4
    CHAPTER.tells({"contact-time": 1e6 * 2.94327 * deepest / STRIKE, "compression": 1e6 * deepest})


@pytest.mark.parametrize(("row", "gap"), [(0, 0), (1, 0.8e-6), (2, 1.2e-6)])
def test_first_stroke_of_the_minute_of_steel(row, gap):
    """By SciPy, without strings: each turns a velocity into as large a swing."""
    unit = (MASS * STRIKE**2 / STIFFNESS) ** 0.4
    after = real_cradles.spheres(np.eye(5)[0], [0, *[gap / unit] * 3], 0.0)
    swings = [line.get_ydata()[0] for line in drawn("toy")["fig-toy-steel"].axes[row].lines]
    assert swings == pytest.approx(after[:4], abs=2e-3)
    if not gap:  # the pale lines go on where the others end
        pale = drawn("toy")["fig-toy-steel"].axes[row].collections[0].get_segments()
        ends = [line.get_xydata()[-1] for line in drawn("toy")["fig-toy-steel"].axes[row].lines]
        assert np.array([way[0] for way in pale]) == pytest.approx(np.array(ends))
        assert {way[0, 0] for way in pale} == {glued("steel-thin")}
        assert glued("steel-parts") > 0.1


def gapped(share):
    """Five spheres by SciPy, with gaps of a part of the compression, (5/8)^0.4 units."""
    gap = share * (5 / 8) ** 0.4
    return real_cradles.spheres(np.eye(5)[0], [0, gap, gap, gap], 0.0)


def test_gaps_of_a_part_of_the_compression():
    touching = gapped(0)
    for name, share in (("hundredth", 0.01), ("tenth", 0.1), ("whole", 1.0)):
        CHAPTER.tells({f"gap-{name}-moves": np.abs(gapped(share) - touching).max()}, off=6e-4)
        assert glued(f"gap-{name}") == pytest.approx(share * glued("compression"), rel=0.01)
    CHAPTER.tells({"gaps-most": np.abs(np.eye(5)[4] - touching).max()}, off=1e-4)
    assert glued("gap-tenth-moves") == pytest.approx(glued("gaps-most") / 2, rel=0.1)
    shown = panel("toy", "fig-toy-gaps", 1) | panel("toy", "fig-toy-gaps")
    assert list(shown) == [f"ball {k}" for k in range(1, 6)]
    velocities = np.array([line[:, 1] for line in shown.values()])
    np.testing.assert_allclose(velocities.sum(axis=0), 1, atol=3e-4)
    at = shown["ball 1"][12, 0]
    np.testing.assert_allclose(velocities[:, 12], gapped(at), atol=3e-4)


def test_spread_of_the_second_stroke_at_any_angle():
    """The slowest and the fastest ball come back half a period of their own amplitude later."""
    v = strokes(1, [1, 0, 0, 0, 0])[0]
    widest = BACK / LENGTH * np.abs(v).max()
    late = PERIOD / 2 * widest**2 / 16
    assert glued("spread") == pytest.approx(1e3 * late, rel=0.1)
    contact = glued("contact-time") * 1e-6
    assert glued("spread-times") == round(late / contact, -1)
    assert late / 100 < contact


def test_the_ball_that_never_hangs_still():
    always = np.abs(strokes(6, [1, 1, 1, 0, 0], ratio=0.0)) > 1e-9
    assert np.flatnonzero(always.all(axis=0)).tolist() == [glued("always") - 1]


def test_fig_toy_second_and_film():
    """Marks of the rule, and the stored film, as the independent solver says."""
    ways = strokes(2, [1, 0, 0, 0, 0])[1], -strokes(2, [0, 0, 0, 0, -1])[1, ::-1]
    shown = list(panel("toy", "fig-toy-second").values())
    for points, expected in zip(shown, ways, strict=False):
        np.testing.assert_allclose(points[:, 0], expected, atol=1e-9)
    assert -shown[2][:2, 0] == pytest.approx(
        [glued("steel-second-first"), glued("steel-second-next")], abs=0.006
    )
    film = CHAPTER.cells["film"].outputs[0].data["text/html"]
    for row, (ratio, e) in enumerate(((0, 1), (RATIO, 1), (RATIO, 0.9))):
        v = strokes(1, [1, 0, 0, 0, 0], e, ratio)[0]
        for ball in range(5):
            ((frames),) = re.findall(rf"@keyframes m\w+-s{row}b{ball}\{{(.*)\}}\n", film)
            found = np.array(
                re.findall(r"([\d.]+)%\{transform:rotate\(([-\d.]+)deg", frames), float
            )
            # At half speed, six periods less one frame: the widest angle after the first stroke.
            seconds = found[:, 0] / 100 * (6 - 1 / 40) * PERIOD * 2
            angle = np.interp(PERIOD, seconds, found[:, 1])
            assert angle == pytest.approx(-math.degrees(BACK / LENGTH * v[ball]), abs=0.3)


def test_the_first_stroke_parts_the_models_least():
    apart = np.abs(np.array(HERTZ["five equal"]) - strokes(1, [1, 0, 0, 0, 0])[0])
    CHAPTER.tells({"first-apart": apart.max()})
