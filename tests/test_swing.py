"""The swinging cradle against formulas, the independent solver, and springs under gravity."""

import cmath
import math
import re
from functools import partial

import numpy as np
import pandas
import pytest
from numpy.polynomial import chebyshev
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk, ellipkinc
from truth import solve

from cradle import (
    Chain,
    FusedChain,
    ImpulseCorrelation,
    Pendulums,
    SequentialCollisions,
    SpringChain,
    TimedTrace,
    collide,
    swing,
    textbook,
)
from cradle.swinging import swing as swinging
from cradle.swinging.flight import FullFlight, SmallAngleFlight, first_fall

ONE_HERTZ = Pendulums(length=9.81 / (4 * math.pi**2))  # sqrt(g/l) = 2 pi / s: a period of 1 s


def balls(n, e=1.0):
    return Chain([1] * n, [0] * n, e)


def pulled(n, k=1, by=0.02):
    return [-by] * k + [0] * (n - k)


# Periods


@pytest.mark.parametrize("amplitude", [0.1, 1.0, 2.5])
def test_period_any_angle(amplitude):
    """Two equal balls exchange their motion: in turn each swings half a full pendulum's period."""
    length = 0.2
    k = math.sin(amplitude / 2)
    quarter = math.sqrt(length / 9.81) * ellipk(k * k)
    pendulums = Pendulums(length, angle="full")
    times = np.linspace(0, 0.99 * quarter, 7)
    run = swing(balls(2), SequentialCollisions(), [-amplitude * length, 0],
                [*times, 8 * quarter], pendulums=pendulums)  # fmt: skip
    found = [impact.time for impact in run.impacts]
    np.testing.assert_allclose(found, quarter * np.arange(1, 8, 2), rtol=1e-10)
    sine = ellipj(quarter / math.sqrt(length / 9.81) - math.sqrt(9.81 / length) * times, k * k)[0]
    swung = -2 * length * np.arcsin(k * sine)
    np.testing.assert_allclose(run.positions[:-1, 0], swung, rtol=0, atol=1e-11)


def test_a_gap_at_any_angle_is_met_where_elliptic_functions_say():
    """Ball 2 hangs at rest at the far side of the gap; then it swings as ball 1 would have."""
    length, gap, amplitude, w = 0.2, 0.03, 1.2, math.sqrt(9.81 / 0.2)
    k = math.sin(amplitude / 2)
    met = (ellipk(k * k) + ellipkinc(math.asin(math.sin(gap / length / 2) / k), k * k)) / w
    run = swing(balls(2), SequentialCollisions(), [-amplitude * length, 0], [1.01 * met],
                pendulums=Pendulums(length, gaps=gap, angle="full"))  # fmt: skip
    (hit,) = run.impacts
    assert hit.time == pytest.approx(met, rel=1e-11)
    cosines = math.cos(gap / length) - math.cos(amplitude)
    assert hit.after == pytest.approx([0, w * length * math.sqrt(2 * cosines)], rel=1e-10)


@pytest.mark.parametrize("beyond", [1e-4, -1e-4])
def test_a_gap_that_closes_and_opens_within_a_step(beyond):
    """Two balls that swing nearly alike: they overlap for a fortieth of a radian, or not."""
    size, w = 1e-6, math.sqrt(9.81 / 0.1)
    hanging = Pendulums(0.1, gaps=0.01 * size, angle="full")
    lag = 0.01 * size * (1 + beyond) * w
    run = swing(Chain([1, 1], [size + lag, size]), SequentialCollisions(), [0, 0], [0.3],
                pendulums=hanging)  # fmt: skip
    met = [math.asin(1 / (1 + beyond)) / w] if beyond > 0 else []
    assert [hit.time for hit in run.impacts] == pytest.approx(met, abs=1e-9)


def test_balls_that_just_come_near_enough_to_touch_swing_on():
    """Ball 1 is let go where it touches ball 2, comes back there at rest, and so on."""
    times, gap = np.linspace(0, 3, 31), 1e-3
    hang = {"length": 0.1, "gaps": gap, "angle": "full"}
    run = swing(balls(2), SequentialCollisions(), [gap, 0], times, pendulums=Pendulums(**hang))
    k, w = math.sin(gap / 0.1 / 2), math.sqrt(9.81 / 0.1)
    sine = ellipj(ellipk(k * k) + w * times, k * k)[0]
    np.testing.assert_allclose(run.positions[:, 0], 0.2 * np.arcsin(k * sine), rtol=0, atol=1e-13)
    np.testing.assert_allclose(run.positions[:, 1], 0, rtol=0, atol=1e-13)


@pytest.mark.parametrize("count", [2, 50])
def test_a_ball_with_gaps_may_not_be_thrown_beyond_a_quarter_circle(count):
    """Also where it turns between two of the times."""
    hanging, times = Pendulums(0.3, gaps=1e-3, angle="full"), np.linspace(0, 1, count)
    words = r"after t = 0\.2935 s positions\[1\] = 0\.635.*; must be within 0\.4712 m: .* a quarter"
    with pytest.raises(ValueError, match=words):
        swing(Chain([1, 0.1], [0, 0]), SequentialCollisions(), [-0.3, 0], times, pendulums=hanging)


@pytest.mark.parametrize("gaps", [0, [0.1, 0.2]])
@pytest.mark.parametrize("size", [1e-8, 1e-12, 1e-100])
def test_tiny_amplitudes_of_any_angle_are_as_exact(size, gaps):
    arguments = balls(3, 0.9), ImpulseCorrelation(0.1), [-size, 0, 0], [3.0]
    hang = {"gaps": np.multiply(size, gaps)}
    full = swing(*arguments, pendulums=Pendulums(**hang, angle="full"))
    small = swing(*arguments, pendulums=Pendulums(**hang))
    assert len(full.impacts) == len(small.impacts) > 5
    for one, other in zip(full.impacts, small.impacts, strict=True):
        assert one.time == pytest.approx(other.time, rel=1e-11)
        np.testing.assert_allclose(one.after, other.after, rtol=0, atol=1e-10 * size)


# The toy


@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_as_many_fly_off_as_are_pulled_back(k):
    times = np.arange(0, 61) * 0.5
    run = swing(balls(5), ImpulseCorrelation(0), pulled(5, k), times, pendulums=ONE_HERTZ)
    assert len(run.impacts) == 60
    for stroke, impact in enumerate(run.impacts):
        moving = np.abs(impact.after) > 1e-12
        expected = [False] * (5 - k) + [True] * k
        assert moving.tolist() == (expected if stroke % 2 == 0 else expected[::-1])
    out = np.abs(run.positions[1::2]).max()
    assert out == pytest.approx(0.02, rel=1e-13)
    np.testing.assert_allclose(run.positions[1], -np.array(pulled(5, k))[::-1], atol=1e-15)


@pytest.mark.parametrize(("ratio", "e"), [(0.15, 1.0), (0.15, 0.9), (0.4, 1.0), (0.05, 0.7)])
def test_second_third_and_twentieth_stroke(ratio, e):
    """All meet again at the lowest point, velocities reversed: strokes are a map, solved anew."""
    n = 4
    run = swing(balls(n, e), ImpulseCorrelation(ratio), pulled(n), [10.2], pendulums=ONE_HERTZ)
    v = [0.02 * 2 * math.pi, 0, 0, 0]
    for stroke in range(20):
        v = solve([1.0] * n, v, [e] * (n - 1), ratio).velocities
        v = [float(a) for a in v]
        if stroke in (0, 1, 2, 19):
            np.testing.assert_allclose(run.impacts[stroke].after, v, rtol=0, atol=2e-15 * 4**3)
        v = [-a for a in v]


# Energy

PENDULUMS = {
    "plain": Pendulums(),
    "gaps": Pendulums(gaps=[0.001, 0, 0.0005]),
    "lengths": Pendulums(length=[0.1, 0.11, 0.1, 0.13]),
    "any angle": Pendulums(angle="full"),
    "any angle, gaps": Pendulums(gaps=[0.001, 0, 0.0005], angle="full"),
}


@pytest.mark.parametrize("how", PENDULUMS)
@pytest.mark.parametrize("e", [1.0, 0.8])
def test_energy_ledger(how, e):
    """What is missing at any time is what the contacts kept back; nothing for e = 1."""
    pendulums = PENDULUMS[how]
    chain = Chain([1, 2, 0.5, 1], [0.1, 0, 0, -0.2], e)
    times = np.linspace(0, 4, 101)
    run = swing(chain, ImpulseCorrelation(0.1), [-0.03, -0.01, 0, 0.01], times, pendulums=pendulums)
    assert len(run.impacts) > 10
    start = run.energy[0]
    if "any angle" not in how:
        raised = 9.81 / pendulums.row("length", 4) * run.positions[0] ** 2
        assert start == pytest.approx(0.5 * chain.masses @ (chain.velocities**2 + raised))
    losses = np.array([[impact.time, impact.energy_loss] for impact in run.impacts])
    booked = np.array([losses[losses[:, 0] <= t, 1].sum() for t in times])
    tolerance = 1e-10 if "any angle" in how else 1e-13
    np.testing.assert_allclose(run.energy + booked, start, rtol=tolerance)
    for impact in run.impacts:
        kinetic = 0.5 * chain.masses @ (impact.before**2 - impact.after**2)
        assert kinetic == pytest.approx(impact.energy_loss, abs=1e-14 * start)
    assert (losses[:, 1] != 0).any() == (e < 1)
    # Nobody passes: neighbours overlap by no more than rounding.
    distance = pendulums.row("gaps", 3) + np.diff(run.positions, axis=1)
    assert distance.min() > -1e-12


def test_damping_between_impacts():
    """Equal damping shrinks every velocity by one factor from stroke to stroke."""
    rate = 0.3
    w = 2 * math.pi
    half = math.pi / math.sqrt(w * w - rate * rate)
    pendulums = Pendulums(9.81 / w**2, damping=rate)
    run = swing(balls(4), ImpulseCorrelation(0.15), pulled(4), [6.0], pendulums=pendulums)
    first, *later = run.impacts
    v = first.after
    for k, impact in enumerate(later, start=1):
        assert impact.time == pytest.approx(first.time + k * half, rel=1e-13)
        np.testing.assert_allclose(impact.before, -math.exp(-rate * half) * v, atol=1e-14)
        v = impact.after


def springs(y, span, m, k, pendulums, viscosity=0.0, **options):
    """Pendulums with spheres that push each other, integrated in time: places, then velocities."""
    m, n = np.asarray(m, float), len(m)
    square, gaps = 9.81 / pendulums.row("length", n), pendulums.row("gaps", n - 1)

    def rate(_, y):
        x, v = np.split(y, 2)
        deep = np.maximum(x[:-1] - x[1:] - gaps, 0.0)
        slope = 1.5 * viscosity * (v[:-1] - v[1:])
        force = np.maximum(k * np.sqrt(deep) * (deep + slope), 0.0)
        return np.concatenate([v, -square * x - np.diff(force, prepend=0, append=0) / m])

    return solve_ivp(rate, span, y, "DOP853", **options).y


@pytest.mark.parametrize(
    ("m", "x", "pendulums"),
    [
        ([1, 3], [-0.02, 0], ONE_HERTZ),
        ([1, 2, 1], [-0.02, 0, 0.01], Pendulums(ONE_HERTZ.length, gaps=[0.003, 0.004])),
        ([1, 2], [-0.02, 0], Pendulums([0.2, 0.3])),
    ],
)
def test_two_balls_at_a_time_are_the_limit_of_stiff_springs(m, x, pendulums):
    """With a contact time that goes to zero like k^(-2/5), so does the difference."""
    times = np.linspace(0, 2, 21)
    run = swing(Chain(m, np.zeros(len(m)), 1), ImpulseCorrelation(0), x, times, pendulums=pendulums)
    assert len(run.impacts) >= 3
    y, exact = [*x, *np.zeros(len(m))], {"t_eval": times, "rtol": 1e-10, "atol": 1e-14}
    ways = [springs(y, (0, 2), m, k, pendulums, max_step=0.01, **exact) for k in (1e7, 1e9, 1e11)]
    apart = [np.abs(way[: len(m)].T - run.positions).max() / 0.02 for way in ways]
    assert apart[2] < 0.005
    for coarse, fine in zip(apart, apart[1:]):
        assert 0.5 < math.log(coarse / fine) / math.log(100**0.4) < 1.5


# Contact forces

#: Viscosity, s, gaps, m, and which balls are pulled to which side.
FORCES = {
    "touching": (0.0, 0.0, [-1, 0, 0, 0, 0]),
    "gaps that close while others push": (0.0, 1e-6, [-1, 0, 0, 0, 0]),
    "losses": (4e-7, 0.0, [-1, 0, 0, 0, 0]),
    "losses and gaps": (4e-7, 1e-6, [-1, -1, 0, 0, 0]),
    "two strikes at once": (4e-7, 3e-6, [-1, 0, 0, 0, 1]),
}


@pytest.mark.parametrize(("viscosity", "gaps", "side"), FORCES.values(), ids=FORCES)
def test_contact_forces_move_the_balls_as_their_equations_of_motion_do(viscosity, gaps, side):
    """By SciPy, in three strikes a micrometre of 3 cm apart; a strike in no time is 1 mm off."""
    m, w, x0 = [0.045] * 5, math.sqrt(9.81 / 0.14), 0.03 * np.array(side)
    hanging = Pendulums(0.14, gaps=gaps)
    exact = {"max_step": 2e-5, "rtol": 1e-9, "atol": 1e-12}
    # Pendulums of one length swing alike: all meet near the middle of each stroke, and only there.
    times = 2 * math.pi / w * np.array([0.248, 0.256, 0.748, 0.756, 1.248, 1.256, 1.5])
    y, found = np.concatenate([x0, np.zeros(5)]), []
    for strike, (begin, end) in enumerate(zip([0.0, *times], times)):
        if strike % 2:
            y = springs(y, (begin, end), m, 1e10, hanging, viscosity, **exact)[:, -1]
        else:
            (x, v), c, s = np.split(y, 2), math.cos(w * (end - begin)), math.sin(w * (end - begin))
            y = np.concatenate([x * c + v / w * s, v * c - w * x * s])
        found.append(y[:5])
    law = SpringChain(1e10, viscosity=viscosity, accuracy=1e-7)
    run = swing(Chain(m, [0] * 5), law, x0, times, pendulums=hanging)
    assert len(run.impacts) >= 3
    np.testing.assert_allclose(run.positions, found, atol=2e-6)


def test_strings_pull_while_contacts_push():
    """Else half a millisecond of each stroke is lost: in ten seconds 3 % of energy and beat."""
    chain, law = Chain([0.045] * 5, [0] * 5), SpringChain(1e10, accuracy=1e-6)
    hanging = Pendulums(0.12, gaps=1e-6)
    run = swing(chain, law, pulled(5, by=0.04), [0, 10.0], pendulums=hanging)
    before, after = run.energy
    assert after == pytest.approx(before, rel=1e-3)
    beat = math.cos(10.0 * math.sqrt(9.81 / 0.12))
    assert run.positions[-1].sum() == pytest.approx(-0.04 * beat, rel=1e-3)


@pytest.mark.parametrize(
    ("stiffness", "viscosity", "k", "end", "hanging"),
    [
        # A contact that is open, pressed and closing again when all others open is no resting one.
        (1e9, 1e-6, 3, 0.5, Pendulums([0.14, 0.16, 0.12, 0.12])),
        # What is left of a compression is no overlap: a contact may take long to come apart.
        (1e10, 2e-6, 1, 1.5, Pendulums(0.14, gaps=1e-6)),
    ],
)
def test_contacts_that_losses_open_early(stiffness, viscosity, k, end, hanging):
    law = SpringChain(stiffness, viscosity=viscosity, accuracy=1e-4)
    run = swing(Chain([0.05] * 4, [0] * 4), law, pulled(4, k, 0.03), [end], pendulums=hanging)
    assert run.ended == "times"


def test_strings_pull_as_long_as_a_strike_that_they_shorten():
    """Before strings have pulled, strikes seem to last a tenth longer: that lost .6 % of energy."""
    chain, law = Chain([0.09, 0.09, 0.045], [0] * 3), SpringChain(1e8, accuracy=1e-6)
    hanging = Pendulums([0.1, 0.2, 0.16], gaps=1e-6)
    run = swing(chain, law, pulled(3, 2, by=0.03), [0, 0.5], pendulums=hanging)
    assert len(run.impacts) > 15
    assert run.energy[1] == pytest.approx(run.energy[0], rel=1e-3)


@pytest.mark.parametrize("stiffness", [2e5, 1e6, 1e10])
def test_elastic_balls_keep_their_energy_for_a_minute(stiffness):
    """Soft ones too: strikes that last a large part of the swing made energy sixfold."""
    chain = Chain([0.045] * 5, [0] * 5)
    run = swing(chain, SpringChain(stiffness, accuracy=1e-6), pulled(5), [0, 20.0, 60.0])
    assert run.energy == pytest.approx(run.energy[0], rel=1e-4)
    assert run.lasting is (stiffness == 1e10)


@pytest.mark.parametrize(
    ("damping", "taken", "most"),
    [("viscoelastic", 0.015, "0.0166 s"), ("hunt-crossley", 40, "50.5")],
)
def test_viscosities_suit_the_speeds_that_occur(damping, taken, most):
    """Not 1 m/s, a bound a quarter lower, or fivefold: no ball closes yet, then they are slower."""
    law = partial(SpringChain, 1e7, damping=damping, accuracy=1e-4)
    assert (collide(Chain([1, 1], [0, 0]), law(viscosity=1e9)).velocities == 0).all()
    start = pulled(3), [0, 0.3]
    before, after = swing(balls(3), law(viscosity=taken), *start).energy
    assert 1 / 3 < after / before < 0.4
    with pytest.raises(
        ValueError, match=rf"viscosity\[0\] = .*; must be at most {most}"
    ) as refused:
        swing(balls(3), law(viscosity=1.5 * taken), *start)
    assert refused.value.__notes__ == [
        f"at the impact at t = {0.15859349623048533} s, balls 0 to 2"
    ]


def test_a_strike_that_lasts_long_is_taken_for_none():
    """Of many lossy balls; strings that pull as long are no kick, and made energy in the end."""
    chain, law = Chain([0.045] * 20, [0] * 20), SpringChain(1e8, viscosity=6e-6, accuracy=1e-4)
    run = swing(chain, law, pulled(20), [0, 45.0])
    assert run.ended == "times"
    assert run.energy[-1] < 0.1 * run.energy[0]


@pytest.mark.parametrize("law", [ImpulseCorrelation(0), SpringChain(1e9)])
def test_damped_balls_come_to_rest(law):
    """Their strikes come to last long, and what is left is no energy that can be told."""
    run = swing(balls(3), law, pulled(3), [0, 30.0], pendulums=Pendulums(0.1, damping=1.0))
    assert run.ended == "times"
    assert run.energy[-1] < 1e-20 * run.energy[0]


@pytest.mark.parametrize("angle", ["small", "full"])
def test_what_is_asked_for_within_a_strike_is_told_as_at_its_end(angle):
    chain, law, hanging = balls(2), SpringChain(1e10), Pendulums(0.1, angle=angle)
    strike = swing(chain, law, [-0.01, 0], [0.5], pendulums=hanging).impacts[0].time
    run = swing(chain, law, [-0.01, 0], strike + np.array([1e-5, 2e-5]), pendulums=hanging)
    assert run.ended == "times"
    assert (run.positions[0] == run.positions[1]).all()
    assert run.velocities[0] == pytest.approx([0.0, run.impacts[0].after[1]], abs=1e-5)


def test_springs_too_soft_for_a_strike_collide_in_no_time():
    """Then ratios of stiffness alone count, as in `collide`."""
    runs = [swing(balls(3), SpringChain(k), pulled(3), [0.3, 0.9]) for k in (1.0, 2.0)]
    assert len(runs[0].impacts) == len(runs[1].impacts) > 1
    assert [run.lasting for run in runs] == [False, False]
    np.testing.assert_allclose(runs[0].positions, runs[1].positions, rtol=1e-8)


# Resting contacts


def test_pressed_balls_move_as_one_until_pulled_apart():
    """The left pendulum is shorter: it pushes while it falls, and stays behind when it rises."""
    length, a = np.array([0.2, 0.3]), 0.02
    m = np.array([1.0, 2.0])
    w2 = 9.81 / length
    joint = math.sqrt(m @ w2 / m.sum())
    part = math.pi / (2 * joint)
    times = np.array([0.5 * part, part + 0.1])
    run = swing(Chain(m, [0, 0], 0.5), ImpulseCorrelation(0), [-a, -a], times,
                pendulums=Pendulums(length))  # fmt: skip
    np.testing.assert_allclose(run.positions[0], -a * math.cos(math.pi / 4), rtol=1e-14)
    # At the lowest point the force is zero: from there on each swings alone.
    w = np.sqrt(w2)
    np.testing.assert_allclose(run.positions[1], a * joint / w * np.sin(w * 0.1), rtol=1e-12)
    assert not run.impacts


def bounces(m, e, length, x, least):
    """Two pendulums by SciPy's events, bounce after bounce, until they are slower than `least`."""
    w2 = 9.81 / np.asarray(length)
    y, t, count, step = np.array([*x, 0, 0], float), 0.0, 0, 0.01
    touch = lambda _, y: y[1] - y[0]  # noqa: E731
    touch.terminal, touch.direction = True, -1
    while True:
        found = solve_ivp(
            lambda _, y: np.concatenate([y[2:], -w2 * y[:2]]), (t, t + 30 * step), y, "DOP853",
            events=touch, rtol=1e-12, atol=1e-15, max_step=step,
        )  # fmt: skip
        assert found.status == 1
        t, y, count = found.t[-1], found.y[:, -1].copy(), count + 1
        u, common = y[2] - y[3], m @ y[2:] / m.sum()
        if u < least:
            return t, common, count
        y[:2] = m @ y[:2] / m.sum()
        y[2:] = common + np.array([-m[1], m[0]]) / m.sum() * e * u
        # Short enough that SciPy sees the whole of the next bounce.
        step = 0.2 * e * u / abs(w2[1] * y[1] - w2[0] * y[0])


def test_infinite_bounces_of_pressed_balls_have_the_limit_of_an_independent_run():
    m, e, length, x = np.array([1.0, 2.0]), 0.5, [0.1, 0.4], [-0.03, -0.0295]
    limit, common, count = bounces(m, e, length, x, 1e-6)
    run = swing(Chain(m, [0, 0], e), ImpulseCorrelation(0), x, [limit, limit + 0.01, 0.5],
                pendulums=Pendulums(length))  # fmt: skip
    early = [impact for impact in run.impacts if impact.time < limit + 0.01]
    assert len(early) > count > 12
    np.testing.assert_allclose(run.velocities[0], common, rtol=0, atol=2e-6)
    # From the limit on they move as one; past the lowest point the left one stays behind.
    assert run.positions[1, 0] == run.positions[1, 1]
    assert early[-1].time == pytest.approx(limit, abs=1e-6)
    assert run.positions[2, 1] > run.positions[2, 0] + 0.01


def test_struck_balls_that_touch_collide_as_one_chain():
    """Balls that hang still and touch take part although nothing moves them."""
    run = swing(balls(4), ImpulseCorrelation(0.15), pulled(4), [0.3], pendulums=ONE_HERTZ)
    assert [impact.contacts for impact in run.impacts] == [(0, 1, 2)]
    apart = swing(balls(4), ImpulseCorrelation(0.15), pulled(4), [0.3],
                  pendulums=Pendulums(ONE_HERTZ.length, gaps=[0, 1e-4, 0]))  # fmt: skip
    assert [impact.contacts for impact in apart.impacts[:2]] == [(0,), (1, 2)]


def test_a_long_path_is_cut_without_advice_that_a_swing_cannot_take(monkeypatch):
    """Nothing is warned of: `swing` has no `record`."""
    whole = swing(balls(5), ImpulseCorrelation(0.1), pulled(5), [1.2])
    monkeypatch.setattr("cradle.models.correlation._MOST_NUMBERS", 9 * 4)
    run = swing(balls(5), ImpulseCorrelation(0.1), pulled(5), [1.2])
    assert run.positions.tobytes() == whole.positions.tobytes()
    for cut, full in zip(run.impacts, whole.impacts, strict=True):
        assert cut.after.tobytes() == full.after.tobytes()
        for part, trace in zip(cut.traces, full.traces, strict=True):
            assert part.events == trace.events[:4]
            assert part.left_out == len(trace.events[4:])


# Several contacts at one instant


@pytest.mark.parametrize(
    ("m", "e", "x", "length", "damping"),
    [
        ([3, 0.5, 3], 0.3, [0, 0.01, 0.03], [0.2, 0.15, 0.1], 0.5),
        ([2, 2, 1, 3], 0.0, [-0.03, -0.01, 0.01, 0.03], 0.1, [0.2, 0, 0.5, 0.2]),
        ([2, 2, 2, 2], 0.5, [-0.01, 0, 0.01, 0.02], 0.1, [0.1, 1, 0.5, 0]),
        ([2, 2, 2, 1], 0.0, [-0.01, 0.02, 0.02, 0.02], 0.1, [1, 0.1, 0, 0.5]),
        ([1, 0.5, 2], 0.0, [-0.01] * 3, 0.1, [0.2, 1, 0.5]),
    ],
)
def test_an_instant_comes_to_an_end(m, e, x, length, damping):
    """Contacts that open or close together, again and again: no event must undo another."""
    hanging = Pendulums(length, damping=damping)
    times = np.linspace(0, 2, 401)
    run = swing(
        Chain(m, [0] * len(m), e), ImpulseCorrelation(0), x, times, pendulums=hanging,
        max_impacts=1000,
    )  # fmt: skip
    assert run.ended == "times"
    assert np.diff(run.positions, axis=1).min() > -1e-10
    assert np.diff(run.energy).max() <= 1e-12 * run.energy[0]


@pytest.mark.parametrize("part", [1, 3e-5])
def test_contacts_that_open_and_close_at_a_turning_point(part):
    """Without restitution, forces of unequal dampings all change their sign where the row turns."""
    hanging = Pendulums(0.15, damping=np.multiply(part, [0.6, 0.4, 0.5, 0.3]))
    run = swing(balls(4, 0), SequentialCollisions(), pulled(4, by=0.05), [40], pendulums=hanging)
    assert run.ended == "times"


@pytest.mark.parametrize(
    ("k", "length", "e"),
    [
        (1, [0.1000002, 0.1000005, 0.1000003, 0.1, 0.1000008], 0.2),
        (3, [0.1000002, 0.1, 0.1000008, 0.1], 0),
    ],
)
def test_strings_that_differ_by_less_than_a_micrometre(k, length, e):
    """Where no force is left to speak of, a contact that pulls was held beside one that pushes."""
    n = len(length)
    run = swing(balls(n, e), SequentialCollisions(), pulled(n, k), [3], pendulums=Pendulums(length))
    assert run.ended == "times"


def test_balls_that_swing_alike_touch_all_the_time():
    """Balls 1 and 2 never part, so ball 3 strikes both: in one run, and handed over in two."""
    hanging, model = Pendulums(0.1, damping=[0, 0, 0.5]), ImpulseCorrelation(0.3)
    whole = swing(balls(3), model, [-0.02] * 3, [0.6, 0.9], pendulums=hanging)
    state = Chain([1] * 3, whole.velocities[0], 1)
    rest = swing(state, model, whole.positions[0], [0.3], pendulums=hanging)
    (impact,), (again,) = whole.impacts, rest.impacts
    assert impact.contacts == again.contacts == (0, 1)
    np.testing.assert_allclose(impact.after, again.after, rtol=0, atol=1e-13)
    by_textbook = textbook.solve([1.0] * 3, impact.before.tolist(), [1.0] * 2, [0.3], [0.3])
    np.testing.assert_allclose(impact.after, by_textbook.velocities, rtol=0, atol=1e-13)
    np.testing.assert_allclose(whole.positions[1], rest.positions[0], rtol=0, atol=1e-13)


@pytest.mark.parametrize(("m", "length", "damping"), [([1, 2], 0.3, 0.05), ([1, 2, 1], 0.1, 0.3)])
def test_rounding_draws_nothing_apart_that_swings_alike(m, length, damping):
    """Equal pendulums need no force to keep together, whatever rounding leaves of it."""
    balls, places = Chain(m, [0] * len(m), 0), [-0.05] + [0] * (len(m) - 1)
    hanging = Pendulums(length, damping=damping)
    run = swing(balls, SequentialCollisions(), places, [0, 3], pendulums=hanging)
    assert len(run.impacts) == 1
    assert run.together == tuple(range(len(m) - 1))


def test_a_run_that_stands_still_says_so(monkeypatch):
    monkeypatch.setattr(SmallAngleFlight, "next_meeting", lambda *_: (0.0, [0], [1]))
    with pytest.raises(RuntimeError, match=r"does not get beyond t = 0\.0 s: contacts \[0\] close"):
        swing(balls(3), ImpulseCorrelation(0), [0.0] * 3, [1.0])


@pytest.mark.parametrize("e", [0.5, 0.9])
def test_near_balls_of_any_angle_cost_what_their_time_costs(monkeypatch, e):
    """Lossy balls end up close to each other: the search for their meetings must not creep.

    A flight of half a swing takes some 500 evaluations, meetings or not, and every one 17 to begin.
    """
    searches, counts = [], [0]
    rate, search = FullFlight._rate, FullFlight.next_meeting

    def searched(self, horizon):
        begun = counts[0]
        meeting = search(self, horizon)
        searches.append((min(meeting[0], horizon), counts[0] - begun))
        return meeting

    def counted(self, time, y):
        counts[0] += 1
        return rate(self, time, y)

    monkeypatch.setattr(FullFlight, "next_meeting", searched)
    monkeypatch.setattr(FullFlight, "_rate", counted)
    swing(balls(3, e), ImpulseCorrelation(0), [-0.05, 0, 0], [6.0],
          pendulums=Pendulums(0.1, angle="full"))  # fmt: skip
    times, taken = np.array(searches).T
    half_swings = times / (math.pi * math.sqrt(0.1 / 9.81))
    assert (half_swings < 0.02).sum() > 20
    assert (taken <= 50 + 450 * half_swings).all()


# Roots


def test_first_fall_is_the_first():
    """Against values on a fine grid: positive up to the root, zero there."""
    rng = np.random.default_rng(13)
    found = 0
    for _ in range(300):
        rates = [complex(-0.05 * a, 0.5 + b) for a, b in rng.random((2, 2))]
        terms = [(complex(a, b), rate) for (a, b), rate in zip(rng.random((2, 2)) - 0.5, rates)]
        level = max(rng.random() - sum(c.real for c, _ in terms), 0.0)

        def value(t, level=level, terms=terms):
            return level + sum((c * np.exp(rate * t)).real for c, rate in terms)

        if value(0.0) < 0:
            continue
        root = first_fall(level, terms, False, 50.0)
        grid = np.linspace(0, min(root, 50.0), 20001)
        assert value(grid[:-1]).min() > 0 or value(0.0) == 0
        if root < 50:
            assert abs(value(root)) < 1e-14
            found += 1
    assert found > 100


@pytest.mark.parametrize(
    ("terms", "parting", "root"),
    [
        # A contact that opens at 1e-9 under a pull of 1, f'' = -1, f' = 1e-9, closes after 2e-9.
        ([(-1 / 3 - 1e-9j, 1j), (1 / 3, 2j)], True, pytest.approx(2e-9, rel=1e-6)),
        # cos 2t - cos t falls at once; at the start its value and slope are rounding errors.
        ([(1 + 5e-18j, 2j), (-(1 - 1.11e-16) + 0j, 1j)], False, pytest.approx(0.0, abs=1e-7)),
    ],
)
def test_a_root_next_to_the_start(terms, parting, root):
    assert first_fall(0.0, terms, parting, 10.0) == root


@pytest.mark.parametrize("early", np.geomspace(1e-7, 0.02, 12).tolist())
@pytest.mark.parametrize("radians", [1, 2])
def test_a_root_at_the_end_of_a_radian(radians, early):
    """The search goes radian by radian; before the end of one, the sum falls steeply."""
    root, terms = radians - early, [(1 + 0j, 1j), (-5e-3 + 0j, 0.7j)]
    level = 5e-3 * math.cos(0.7 * root) - math.cos(root)
    assert first_fall(level, terms, False, 3.0) == pytest.approx(root, abs=1e-14)


@pytest.mark.parametrize("decay", [0.0, 0.1])
def test_balls_that_meet_now_need_not_swing_once_more(decay):
    """The sum falls from zero; rounding, or a search, takes such starts for just after it."""
    for phase in np.linspace(0.1, 3.0, 50).tolist():
        wave = cmath.rect(1.0, phase)
        for level in (-wave.real, -wave.real - 1e-16, -wave.real - 1e-8):
            assert abs(first_fall(level, [(wave, complex(-decay, 1.0))], False, 9.0)) < 1e-12


@pytest.mark.parametrize("decay", [0.0, 0.1])
def test_what_is_below_zero_all_the_time_falls_now(decay):
    """As the force between balls that hang apart by a rounding and were found to move together."""
    for wave in (1j, -1.0 + 0j, cmath.rect(1.0, 2.0)):
        assert first_fall(-1.5, [(wave, complex(-decay, 1.0))], False, 9.0) == 0.0


def test_an_integration_that_fails_is_no_motion(monkeypatch):
    monkeypatch.setattr(FullFlight, "_rate", lambda *of: -1e3 * of[-1] ** 2)
    with pytest.raises(RuntimeError, match="the integration of the pendulums failed: Required"):
        swing(balls(2), ImpulseCorrelation(0), [-0.05, 0.0], [1.0],
              pendulums=Pendulums(0.1, angle="full"))  # fmt: skip


@pytest.fixture
def looked(monkeypatch):
    """The polynomials whose roots are sought."""
    found, roots = [], chebyshev.chebroots
    monkeypatch.setattr(chebyshev, "chebroots", lambda c: found.append(c) or roots(c))
    return found


def test_a_slow_rise_is_followed_in_few_steps(looked):
    """A contact begins to part with hardly any acceleration; the rate of that carries it on."""
    rates = [complex(-0.1, 1.0), complex(-0.3, 1.2)]
    powers = np.array([[rate**n for rate in rates] for n in range(4)])
    columns = np.concatenate([powers.real, -powers.imag], axis=1)
    parts = np.linalg.solve(columns, [0, 0, 1e-10, 1])  # value and derivatives at the start
    terms = [(complex(parts[k], parts[2 + k]), rate) for k, rate in enumerate(rates)]
    root = first_fall(0.0, terms, True, 20.0)
    assert len(looked) < 10
    value = lambda t: sum((c * (np.exp(rate * t) - 1)).real for c, rate in terms)  # noqa: E731
    assert 1 < root < 20
    assert abs(value(root)) < 1e-13
    assert value(np.linspace(1e-3, root - 1e-6, 20001)).min() > 0


@pytest.mark.parametrize("difference", [1e-2, 1e-6, 1e-10, 1e-12])
@pytest.mark.parametrize("begin", [0.0, 1.0])
def test_periods_that_hardly_differ_are_followed_in_few_steps(looked, begin, difference):
    """cos t - cos(w t) = 2 sin((w + 1) t / 2) sin((w - 1) t / 2), first zero 2 pi / (w + 1)."""
    w = 1.0 + difference
    terms = [(1 + 0j, 1j), (-1 + 0j, w * 1j)]
    if begin:
        terms = [(c * np.exp(rate * begin), rate) for c, rate in terms]
    root = first_fall(0.0, terms, not begin, 1e5)
    # Values are known to the rounding of their terms.
    assert begin + root == pytest.approx(2 * np.pi / (w + 1), abs=1e-12 + 3e-15 / difference)
    assert len(looked) < 10


def test_bodies_whose_periods_differ_by_rounding():
    """Lengths 12, 12, 15, 10 as one body swing like 12 alone, but for the last digit."""
    run = swing(
        Chain([1, 1, 1, 1, 0.5, 0.5], [-5e-6, -5e-6, 5e-6, 5e-6, -5e-6, 0],
              [0.903096997790845, 0.5413840171222394, 0.01415760983467218, 0.1682179539137848,
               0.9091342920361836]),
        ImpulseCorrelation(0.1, excess="saturate"),
        [-8.879757196714637e-07, -8.747119221197388e-07, -6.101770535442485e-07,
         -5.839284452524474e-07, -1.2872856406189447e-07, 1.6491342754953653e-07],
        np.linspace(0, 6, 40), pendulums=Pendulums([0.12, 0.12, 0.15, 0.1, 0.1, 0.12]),
    )  # fmt: skip
    assert run.ended == "times"


def test_grazing_is_no_endless_loop():
    """The gap just closes, at no speed."""
    pendulums = Pendulums(9.81, gaps=0.02)
    run = swing(balls(2), ImpulseCorrelation(0), [-0.02, 0], [20.0], pendulums=pendulums)
    assert len(run.impacts) <= 4
    assert run.energy[-1] == pytest.approx(run.energy[0], rel=1e-12)


def faster(by):
    """Make a flight that multiplies velocities."""
    return lambda fly: lambda *given: (lambda x, v: (x, v * (1.0 + by)))(*fly(*given))


def pushed(join):
    return lambda m, v, *rest: join(m, v * (1.0 + 1e-9), *rest)


LOST = "a flight has made or lost"
#: Where something is broken, how, in which words it is refused, and how the balls hang.
BROKEN = [
    (SmallAngleFlight, "next_meeting", lambda _: lambda *_: (math.inf, [], []),
     r"balls overlap by 0\.0", {}),
    (SmallAngleFlight, "at", faster(3e-10), LOST, {}),
    (SmallAngleFlight, "at", faster(0.02), LOST, {"damping": 0.1}),
    (SmallAngleFlight, "at", faster(-3e-10), f"{LOST} -", {}),
    (FullFlight, "at", faster(3e-10), LOST, {"angle": "full"}),
    (FullFlight, "at", faster(0.02), LOST, {"angle": "full", "damping": 0.1}),
    (swinging, "common_velocities", pushed, "impacts have made or lost", {}),
    # Balls that part slowly are taken for resting: momentum is kept, energy is not.
    (swinging, "RESTING", lambda _: 0.8, "J are made or lost beside the impacts", {}),
]  # fmt: skip


@pytest.mark.parametrize(("where", "name", "how", "words", "hanging"), BROKEN)
def test_an_unsound_swing_is_refused(monkeypatch, where, name, how, words, hanging):
    monkeypatch.setattr(where, name, how(getattr(where, name)))
    with pytest.raises(RuntimeError, match=f"not certified: at t = .* {words}"):
        swing(balls(3), ImpulseCorrelation(0.2), [-0.02, 0, 0], [0.1, 1.0],
              pendulums=Pendulums(**hanging))  # fmt: skip


def test_a_strike_that_makes_energy_is_refused(monkeypatch):
    """The balls are left where no contact force can have brought them."""
    parted = TimedTrace._until_apart
    far = np.array([-0.01, 0.01])
    monkeypatch.setattr(TimedTrace, "_until_apart", lambda trace: (parted(trace)[0], far))
    with pytest.raises(RuntimeError, match=f"not certified: at t = .* {LOST}"):
        swing(balls(2), SpringChain(1e10), [-0.02, 0], [0.5])


# Ends and errors


@pytest.mark.parametrize(("angle", "part"), [("small", 0.5), ("full", 1.0)])
def test_no_ball_is_released_beyond_its_reach(angle, part):
    """A quarter of a circle on strings; half a circle, but for the very top, on rods."""
    hanging, end = Pendulums(0.3, angle=angle), part * math.pi * 0.3
    law = ImpulseCorrelation(0.1)
    run = swing(balls(3), law, [-(1 - 1e-5) * end, 0, 0], [0, 0.5], pendulums=hanging)
    assert np.abs(run.positions).max() <= end
    for beyond in (-5.0, -(1 + 1e-9) * end):
        words = f"positions[0] = {beyond!r}; must be within {end:.4g} m: "
        with pytest.raises(ValueError, match="^" + re.escape(words)):
            swing(balls(3), law, [beyond, 0, 0], [1], pendulums=hanging)


@pytest.mark.parametrize("damping", [0.0, 0.5])
@pytest.mark.parametrize(("masses", "ball"), [([1, 1], 1), ([1, 0.1], 1), ([1, 100], 0)])
def test_no_ball_swings_beyond_its_reach(masses, ball, damping):
    """Small angles: what an impact at the lowest point throws turns between two of the times."""
    rate = math.sqrt(9.81 - damping**2)
    turn = math.atan2(rate, damping) / rate
    chain = Chain(masses, [1, 0])
    after = collide(chain, SequentialCollisions()).velocities[ball]
    far = after * math.exp(-damping * turn) * math.sin(rate * turn) / rate
    for part, at in ((1 - 1e-6, None), (1 + 1e-6, "0"), (1.5, "0")):
        speed = part * 0.5 * math.pi / abs(far)
        given = Chain(masses, [speed, 0]), SequentialCollisions(), [0, 0], [0.3 * turn, 1.8 * turn]
        run = partial(swing, *given, pendulums=Pendulums(1, damping=damping))
        if at is None:
            assert np.abs(run().positions).max() < 0.5 * math.pi
            continue
        words = (
            rf"^after t = 0 s positions\[{ball}\] = (.+); must be within 1\.571 m: pendulums of "
        )
        with pytest.raises(ValueError, match=words) as refused:
            run()
        found = float(re.match(words, str(refused.value))[1])
        assert found == pytest.approx(speed * far, rel=1e-9)


@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_no_ball_swings_over_the_top(damping):
    """It would pass its pivot and strike the row from behind."""
    hanging = Pendulums(0.3, angle="full", damping=damping)
    top = 2.0 * math.sqrt(9.81 * 0.3)

    def struck(speed):
        chain = Chain([1] * 3, [-speed, 0, 0])
        return swing(chain, ImpulseCorrelation(0.1), [0] * 3, [0, 4], pendulums=hanging)

    assert struck(0.99 * top).impacts
    with pytest.raises(
        ValueError, match=r"^after t = .* must be within 0\.9425 m: .* half a circle"
    ):
        struck(1.2 * top)


def test_ends():
    arguments = balls(2, 0.9), ImpulseCorrelation(0), [-0.02, 0.02], np.linspace(0, 5, 51)
    by_time = swing(*arguments, pendulums=ONE_HERTZ)
    assert (by_time.ended, by_time.end, len(by_time.times)) == ("times", 5.0, 51)
    by_count = swing(*arguments, pendulums=ONE_HERTZ, max_impacts=3)
    assert (by_count.ended, len(by_count.impacts)) == ("impacts", 3)
    assert by_count.end == by_count.impacts[-1].time == pytest.approx(1.25)
    assert by_count.times[-1] <= by_count.end < by_count.times[-1] + 0.1
    for run in (by_time, by_count):
        assert run.positions.shape == run.velocities.shape == (len(run.times), 2)


def test_a_model_that_refuses_says_when():
    """Two contacts approach at once: fused bodies are undefined there."""
    with pytest.raises(ValueError, match="FusedChain") as refused:
        swing(balls(3), FusedChain(), [-0.02, 0, 0.02], [1], pendulums=ONE_HERTZ)
    assert "t = 0.25" in refused.value.__notes__[0]


def test_parts_of_a_chain_take_their_part_of_the_model():
    """Balls 2 to 4 hang apart from the rest: their ratios are theirs alone."""
    ratios = [0.1, 0.2, 0.3, 0.4]
    pendulums = Pendulums(ONE_HERTZ.length, gaps=[1.0, 1.0, 0, 0, 1.0][:5])
    chain = Chain([1, 1, 1, 2, 1.5, 1], [0] * 6, [1, 1, 0.9, 0.8, 1])
    run = swing(chain, ImpulseCorrelation(ratios), [0, 0, -0.02, 0, 0, 0], [0.3],
                pendulums=pendulums)  # fmt: skip
    (impact,) = run.impacts
    expected = solve([1.0, 2.0, 1.5], [impact.before[2], 0, 0], [0.9, 0.8], ratios[2])
    after = [float(v) for v in expected.velocities]
    np.testing.assert_allclose(impact.after[2:5], after, atol=1e-15)


def test_mirror():
    """Seen from behind, everything is the same, if no two contacts approach at one instant."""
    times, pendulums = np.linspace(0, 5, 26), Pendulums(gaps=0.001)
    runs = [
        swing(Chain(m, [0] * 4, 0.9), ImpulseCorrelation(0.1), x, times, pendulums=pendulums)
        for m, x in (([1, 2, 1, 3], [-0.02, 0, 0, 0]), ([3, 1, 2, 1], [0, 0, 0, 0.02]))
    ]
    assert len(runs[0].impacts) > 20
    np.testing.assert_allclose(runs[1].positions[:, ::-1], -runs[0].positions, rtol=0, atol=1e-12)


def test_frames():
    run = swing(balls(3), ImpulseCorrelation(0), pulled(3), [0, 0.3, 0.6], pendulums=ONE_HERTZ)
    impacts = pandas.DataFrame(run.impacts)
    assert list(impacts.columns[:2]) == ["time", "contacts"]
    assert len(impacts) == len(run.impacts)
