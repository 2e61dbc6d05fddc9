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

from cradle import Chain, Pendulums, SpringChain, swing

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
    """Velocities of the lines of a table, by what stands before them."""
    lines = CHAPTER.printed(cell).replace("−", "-").splitlines()[2:]
    return {first: [float(x) for x in more] for first, *more in map(str.split, lines)}


def test_minute():
    impacts = math.floor((60 - PERIOD / 4) / (PERIOD / 2)) + 1
    CHAPTER.tells({"strike": STRIKE, "degrees": math.degrees(math.asin(BACK / LENGTH))})
    first, energy = CHAPTER.printed("minute").splitlines()
    assert first == f"{impacts} impacts"
    assert energy.endswith(": 1.000000")


def test_several():
    story, two = (rows("several")[ratio] for ratio in ("0", f"{RATIO:g}"))
    assert story == [0, 0, 0, 1, 1]
    expected = strokes(1, [1, 1, 0, 0, 0])[0]
    np.testing.assert_allclose(two, expected, rtol=0, atol=5.1e-4)
    CHAPTER.tells({"two-third": expected[2]})


def test_strokes_and_fig_toy_models():
    after = strokes(173, [1, 0, 0, 0, 0])
    assert list(rows("strokes")) == ["1", "2", "3", "20", "173"]
    for stroke, row in rows("strokes").items():
        np.testing.assert_allclose(row, after[int(stroke) - 1], rtol=0, atol=5.1e-4)
    inner = 100 * (after[:, 1:4] ** 2).sum(axis=1)
    CHAPTER.tells({"inner-first": inner[0], "inner-twenty": inner[19]})
    # To the left balls 1 and 2 come to one speed, and keep it nearly.
    one, two = -after[1::2, :2].T
    pair = int(glued("pair-from")) // 2 - 1
    assert (np.diff(one[: pair + 1]) < 1e-3).all()
    assert (np.diff(two[: pair + 1]) > -1e-3).all()
    assert abs(one - two)[:pair].min() > 0.01 > abs(one - two)[pair]
    assert abs(one - two)[pair:].max() < 0.04
    CHAPTER.tells({"pair-speed": one[pair]})


def test_mirror():
    """The map from either side, by the independent solver."""
    one, other = strokes(20, [1, 0, 0, 0, 0]), -strokes(20, [0, 0, 0, 0, -1])[:, ::-1]
    apart = np.abs(one - other).max(axis=1)
    CHAPTER.tells({"mirror-second": apart[1]})
    assert glued("mirror-worst") > apart.max() - 0.006


def test_fig_toy_drift():
    after = strokes(41, [1, 0, 0, 0, 0], 0.99)
    pace = (after[40].var() / after[20].var()) ** (1 / 40)
    assert glued("pace-ninetynine") == pytest.approx(pace, abs=5.1e-4)
    assert pace < 0.99  # faster than two balls
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


def test_contact_of_steel_balls_in_closed_form():
    deepest = (5 * (MASS / 2) * STRIKE**2 / (4 * STIFFNESS)) ** 0.4
    CHAPTER.tells({"compression": 1e6 * deepest})
    contact, late = 2.94327 * deepest / STRIKE, 1e-3 * glued("spread")
    assert glued("spread-times") == round(late / contact, -1)
    assert late / 100 < contact


@pytest.mark.parametrize(("row", "gap"), [(0, 0), (1, 0.8e-6), (2, 1.2e-6)])
def test_first_stroke_of_the_minute_of_steel(row, gap):
    """By SciPy, without strings: each turns a velocity into as large a swing."""
    unit = (MASS * STRIKE**2 / STIFFNESS) ** 0.4
    after = real_cradles.spheres(np.eye(5)[0], [0, *[gap / unit] * 3], 0.0)
    swings = [line.get_ydata()[0] for line in drawn("toy")["fig-toy-steel"].axes[row].lines]
    assert swings == pytest.approx(after[:4], abs=2e-3)
    if not gap:  # the pale lines go on where the others end
        pale, again = (
            one.get_segments() for one in drawn("toy")["fig-toy-steel"].axes[row].collections
        )
        ends = [line.get_xydata()[-1] for line in drawn("toy")["fig-toy-steel"].axes[row].lines]
        assert np.array([way[0] for way in pale]) == pytest.approx(np.array(ends))
        assert {way[0, 0] for way in pale} == {glued("steel-thin")}
        assert glued("steel-parts") > 0.1
        # Two runs begin at one place and part.
        assert np.array([way[0] for way in again]) == pytest.approx(np.array(ends), abs=0.02)
        apart = np.abs(np.array(pale) - np.array(again))[..., 1].max()
        assert 0.1 < apart <= glued("steel-parts") + 0.006


def settled(gap, until):
    """Places of the balls when their mean turns at the right, by small steps, over the pull.

    In units of the pull, and of a radian of the swing.  Where no two can touch soon, a long step.
    """
    w2, pairs = G / LENGTH, range(4)
    stiff, gap = STIFFNESS * math.sqrt(BACK) / (MASS * w2), gap / BACK
    short = 1e-6 * math.sqrt(w2)

    def push(x):
        deep = [max(0.0, x[k] - x[k + 1] - gap) for k in pairs]
        force = [0.0, *(stiff * one * math.sqrt(one) for one in deep), 0.0]
        return [force[k] - force[k + 1] for k in range(5)]

    def step(x, v, h, pushed):
        if pushed:  # half a kick
            v = [b + 0.5 * h * a for b, a in zip(v, push(x), strict=True)]
        c, s = math.cos(h), math.sin(h)
        moved = [a * c + b * s for a, b in zip(x, v, strict=True)]
        v = [b * c - a * s for a, b in zip(x, v, strict=True)]
        if pushed:
            v = [b + 0.5 * h * a for b, a in zip(v, push(moved), strict=True)]
        return moved, v

    outer = 1 / (2 - 2 ** (1 / 3))  # three steps that make one of order four
    x, v, t, found = [-1.0, 0.0, 0.0, 0.0, 0.0], [0.0] * 5, 0.0, []
    for stroke in range(1, until + 1):
        while t < stroke * math.pi:
            soon = stroke * math.pi - t
            for k in pairs:  # no two come nearer faster than this
                quick = math.hypot(x[k] - x[k + 1], v[k] - v[k + 1])
                soon = min(soon, (x[k + 1] + gap - x[k]) / quick if quick else soon)
            h = max(soon, min(short, stroke * math.pi - t))
            for part in (outer, 1 - 2 * outer, outer) if soon <= short else (1,):
                x, v = step(x, v, part * h, soon <= short)
            t += h
        if stroke % 2:
            found.append(x)
    return np.array(found)


@pytest.mark.parametrize(("row", "gap"), [(1, 0.8e-6), (2, 1.2e-6)])
def test_where_inner_balls_settle(row, gap):
    """Half a micrometre decides, by a second route: small steps between free swings."""
    found = settled(gap, 31)
    shown = np.array([line.get_ydata() for line in drawn("toy")["fig-toy-steel"].axes[row].lines])
    np.testing.assert_allclose(shown[:, : len(found)].T, found[:, :4], atol=4e-3)
    # From then on hardly anything changes.
    assert np.ptp(shown[:, len(found) :], axis=1).max() < 0.011
    if row == 1:
        assert np.abs(shown[1:3, 20:]).max() < 0.02
    else:
        assert glued("steel-left") == pytest.approx(-shown[1, -1], abs=0.0051)
        assert shown[1, 20:].max() < -0.05


def by_momentum(row):
    """Where ball 5 is, from the other balls: no impact moves the mean."""
    lines = drawn("toy")["fig-toy-steel"].axes[row].lines
    return 1 - np.array([line.get_ydata() for line in lines]).sum(axis=0)


def test_ball_5_of_steel():
    touching, *gaps = (by_momentum(row) for row in range(3))
    last = int(glued("five-until")) // 2 + 1  # the first one, and each second
    assert last == len(touching) - 1
    least = touching[:last].min(), np.min(gaps)
    for name, ball in zip(("touching", "gaps"), least, strict=True):
        assert 0 < ball - glued(f"five-{name}") < 0.01
    # The rule has ball 5 far below.
    by_rule = strokes(173, [1, 0, 0, 0, 0])[::2, 4]
    assert by_rule[39] < 0.8
    CHAPTER.tells({"five-rule": by_rule.min()})


def test_two_runs_with_gaps_agree():
    turns = (np.arange(100) + 1) * PERIOD / 2
    run = swing(
        Chain([MASS] * 5, [0] * 5), SpringChain(STIFFNESS, accuracy=1e-5),
        [-BACK, 0, 0, 0, 0], turns, pendulums=Pendulums(length=LENGTH, gaps=0.8e-6),
    )  # fmt: skip
    found = run.positions[::2, :4].T / BACK
    shown = [line.get_ydata() for line in drawn("toy")["fig-toy-steel"].axes[1].lines]
    assert 0 < np.abs(found - shown).max() <= glued("steel-agree") <= 3e-4


def test_the_second_stroke_of_steel():
    """Five balls on strings that push by Hertz's law, by SciPy: when ball 5 strikes a row."""
    w2, unit = G / LENGTH, (MASS * STRIKE**2 / STIFFNESS) ** 0.4
    x, v = np.zeros(5), np.eye(5)[0]  # in units of compression, of the striker's speed
    w2 *= (unit / STRIKE) ** 2

    def rate(_, y):
        push = np.concatenate([[0], np.maximum(y[:4] - y[1:5], 0) ** 1.5, [0]])
        return np.append(y[5:], -np.diff(push) - w2 * y[:5])

    def run(x, v, time, **options):
        return solve_ivp(rate, (0, time), [*x, *v], rtol=1e-9, atol=1e-10, max_step=0.05, **options)

    y = run(x, v, 12).y[:, -1]
    assert (np.diff(y[:5]) > 0).all()  # all apart
    free, w = math.pi / math.sqrt(w2) - 24, math.sqrt(w2)  # on until before the second stroke
    x = y[:5] * math.cos(w * free) + y[5:] / w * math.sin(w * free)
    v = y[5:] * math.cos(w * free) - y[:5] * w * math.sin(w * free)
    meet = [lambda _, y, k=k: y[k] - y[k + 1] for k in (0, 3)]
    for one in meet:
        one.direction = 1
    meet[1].terminal = True
    second = run(x, v, 40, events=meet)
    first, last = (times[0] for times in second.t_events)
    assert glued("steel-late") == pytest.approx(1e3 * (last - first) * unit / STRIKE, abs=0.006)
    pressed = second.y[2, -1] - second.y[3, -1]
    assert glued("steel-pressed") == pytest.approx(1e6 * unit * pressed, abs=0.51)


def gapped(share):
    """Five spheres by SciPy, with gaps of a part of the compression, (5/8)^0.4 units."""
    gap = share * (5 / 8) ** 0.4
    return real_cradles.spheres(np.eye(5)[0], [0, gap, gap, gap], 0.0)


def test_gaps_of_a_part_of_the_compression():
    touching = gapped(0)
    CHAPTER.tells({"gap-tenth-moves": np.abs(gapped(0.1) - touching).max()}, off=6e-4)
    assert glued("gap-tenth") == pytest.approx(0.1 * glued("compression"), rel=0.01)
    whole = np.abs(gapped(1.0) - touching).max()  # a gap of one depth makes pairs of all
    assert whole == pytest.approx(np.abs(np.eye(5)[4] - touching).max(), abs=6e-4)
    # As long as a gap is not known, it is one of those between none and far more than the depth.
    most = max(np.abs(gapped(share) - touching).max() for share in np.geomspace(0.01, 5, 25))
    assert glued("gap-most-moves") == pytest.approx(most, abs=0.0051)
    shown = panel("toy", "fig-toy-gaps")
    assert list(shown) == [f"ball {k}" for k in range(1, 5)]
    unit = 1e6 * (MASS * STRIKE**2 / STIFFNESS) ** 0.4  # µm
    for point in range(0, len(shown["ball 1"]), 2):
        gap = shown["ball 1"][point, 0] / unit
        expected = real_cradles.spheres(np.eye(5)[0], [0, gap, gap, gap], 0.0)
        drawn_there = [line[point, 1] for line in shown.values()]
        np.testing.assert_allclose(drawn_there, expected[:4], atol=3e-4)
        assert sum(drawn_there) == pytest.approx(1 - expected[4], abs=3e-4)
    assert 0 <= min(gapped(share)[4] for share in (0, 0.01, 1)) - glued("five-least") < 1e-3
    assert np.abs(gapped(0.1) - touching).argmax() == 3  # the velocity of ball 4


def test_spread_of_the_second_stroke_at_any_angle():
    """The slowest and the fastest ball come back half a period of their own amplitude later."""
    v = strokes(1, [1, 0, 0, 0, 0])[0]
    widest = BACK / LENGTH * np.abs(v).max()
    late = PERIOD / 2 * widest**2 / 16
    assert glued("spread") == pytest.approx(1e3 * late, abs=0.06)


def test_two_balls_back():
    """With losses all come to two fifths of the strikers' speed."""
    np.testing.assert_allclose(np.abs(strokes(60, [1, 1, 0, 0, 0], 0.9)[-1]), 2 / 5, atol=1e-4)


def test_fig_toy_film():
    """The stored film, as the independent solver says."""
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
