"""A row in an engine: against `swing`, its energy, its rests, what it tells and refuses."""

import math
import warnings

import numpy as np
import pytest

from cradle import (
    Chain,
    FusedChain,
    ImpulseCorrelation,
    Pendulums,
    SpringChain,
    collide,
    swing,
)
from cradle.row import Row, step_rows
from cradle.runtime import compile as runtime

RADIUS, LENGTH, GRAVITY = 0.1, 1.0, 9.81
MODEL = ImpulseCorrelation(0.1325)


class Free:
    """Balls in a plane on which no force acts."""

    def __init__(self, x, v, masses):
        self.x, self.v = np.array(x, float), np.array(v, float)
        self.masses = np.array(masses, float)

    def motion(self):
        return self.x.tolist(), self.v.tolist()

    def push(self, ball, impulse):
        self.v[ball] += np.array(impulse) / self.masses[ball]

    def advance(self, step):
        self.x += step * self.v


class Hanging(Free):
    """Pendulums in angles: so many kicks of gravity a step, a part of each before the move.

    As they stand, velocity Verlet in steps of at most a millisecond.
    """

    def __init__(
        self, angles, masses=None, spacing=2 * RADIUS, length=LENGTH, first=0.5, kicks=None
    ):
        n = len(angles)
        self.angles, self.rates = np.array(angles, float), np.zeros(n)
        self.masses = np.ones(n) if masses is None else np.array(masses, float)
        self.pivots = np.column_stack([spacing * np.arange(n), np.zeros(n)])
        self.length, self.first, self.kicks = length, first, kicks

    def tangents(self):
        return np.column_stack([np.cos(self.angles), np.sin(self.angles)])

    def motion(self):
        arms = self.length * np.column_stack([np.sin(self.angles), -np.cos(self.angles)])
        v = self.length * self.rates[:, None] * self.tangents()
        return (self.pivots + arms).tolist(), v.tolist()

    def push(self, ball, impulse):
        tangent = self.tangents()[ball]
        # The impulse has no part along the string.
        assert abs(impulse[0] * tangent[1] - impulse[1] * tangent[0]) < 1e-12
        self.rates[ball] += np.array(impulse) @ tangent / (self.masses[ball] * self.length)

    def advance(self, step):
        count = self.kicks or math.ceil(step / 1e-3)
        kick = step / count * GRAVITY / self.length
        for _ in range(count):
            self.rates -= self.first * kick * np.sin(self.angles)
            self.angles += step / count * self.rates
            self.rates -= (1.0 - self.first) * kick * np.sin(self.angles)

    def energy(self):
        height = 2 * self.length * np.sin(self.angles / 2) ** 2
        return self.masses * (0.5 * (self.length * self.rates) ** 2 + GRAVITY * height)


def hung(bodies, e=1.0, model=MODEL, **options):
    n = len(bodies.angles)
    return Row(bodies, Chain(bodies.masses, [0] * n, e), model, RADIUS, bodies.pivots, **options)


def steps(row, count, duration):
    for _ in range(count):
        row.step(duration)


def gaps(bodies, reach=2 * RADIUS):
    x = np.array(bodies.motion()[0])
    return np.hypot(*np.diff(x, axis=0).T) - reach


@pytest.mark.parametrize("pulled", [1, 2])
def test_a_row_swings_as_swing_does(pulled: int):
    """Two routes: steps of a fixed length and looks here, events in continuous time there."""
    angles = [-0.5] * pulled + [0.0] * (5 - pulled)
    bodies = Hanging(angles)
    row, step = hung(bodies), 1 / 500
    hanging = Pendulums(length=LENGTH, gravity=GRAVITY, angle="full")
    times = np.arange(0, 10, 0.1)
    run = swing(Chain([1] * 5, [0] * 5), MODEL, angles, times, pendulums=hanging)
    total, found, least = bodies.energy().sum(), [], 0.0
    for _ in times:
        found.append(bodies.angles.copy())
        for _ in range(50):
            row.step(step)
            least = min(least, gaps(bodies).min())
    # Balls that a look may take for touching (a gap below 1e-4 m) shift small impacts.
    assert np.abs(np.array(found) - run.positions).max() < 0.01
    assert bodies.energy().sum() == pytest.approx(total, rel=1e-5)
    assert least > -2 * row.touching
    assert row.impacts < 200


@pytest.mark.parametrize("first", [0.5, 1.0], ids=["velocity Verlet", "semi-implicit Euler"])
@pytest.mark.parametrize("masses", [(1, 2, 0.5, 1, 3), (3, 1, 2, 0.5, 1), (0.2, 1, 0.3, 2, 1)])
def test_the_first_stroke_of_spheres_of_different_masses(masses, first):
    """As `swing` has it; later ones differ, as there an impact lasts, and a row takes no time."""
    angles, model = [-0.5, 0.0, 0.0, 0.0, 0.0], SpringChain(1e10)
    bodies = Hanging(angles, masses, first=first, kicks=1)
    steps(hung(bodies, model=model), 1000, 1e-3)  # to the turning point
    hanging = Pendulums(length=LENGTH, gravity=GRAVITY, angle="full")
    run = swing(Chain(masses, [0] * 5), model, angles, [1.0], pendulums=hanging)
    np.testing.assert_allclose(bodies.angles, run.positions[0], atol=1e-3)


def test_balls_that_fly_to_and_fro_between_others_are_struck_one_by_one():
    """A light ball is near both neighbours, but touches one at a time."""
    masses, angles = [1.0, 1.0, 0.1, 1.0, 1.0], [-0.5, 0.0, 0.0, 0.0, 0.0]
    hanging = Pendulums(length=LENGTH, gravity=GRAVITY, angle="full")
    model = SpringChain(accuracy=1e-5)
    run = swing(Chain(masses, [0] * 5), model, angles, [2.0], pendulums=hanging)
    after = 0.5 * run.velocities**2 + GRAVITY * (1 - np.cos(run.positions))
    for rate in (240, 300, 500):
        bodies = Hanging(angles, masses)
        steps(hung(bodies, model=model), 2 * rate, 1 / rate)
        off = np.abs(bodies.energy() - masses * after[0]).sum() / bodies.energy().sum()
        assert off < 0.08


def test_three_strikers_have_gaps_at_the_first_stroke_only():
    """A law with gaps between the three that are lifted: on the way back they have none."""
    bodies = Hanging([-math.radians(30)] * 3 + [0.0] * 2)
    row = hung(bodies, model=SpringChain(1e10, gaps=[4e-4, 4e-4, 0, 0]))
    ends = []
    for _ in range(2):
        steps(row, 1000, 1e-3)  # to the turning point
        ends.append(np.sqrt(bodies.energy() / (GRAVITY * (1 - math.cos(math.radians(30))))))
    np.testing.assert_allclose(ends[0][2:], 1, atol=0.01)
    assert ends[1][0] > 1.07
    assert ends[1][2] < 0.93


@pytest.mark.parametrize("rate", [60, 500])
def test_balls_that_hang_side_by_side_move_as_one_body(rate: int):
    """In an engine they never have quite the same velocity, as this law demands."""
    angles = [-0.5, 0.0, 0.0, 0.0, 0.0]
    bodies = Hanging(angles)
    row = hung(bodies, model=FusedChain())
    hanging = Pendulums(length=LENGTH, gravity=GRAVITY, angle="full")
    run = swing(Chain([1] * 5, [0] * 5), FusedChain(), angles, [10.0], pendulums=hanging)
    steps(row, 10 * rate, 1 / rate)
    assert row.impacts == len(run.impacts) == 10
    assert np.abs(bodies.angles - run.positions[-1]).max() < 5e-3


@pytest.mark.parametrize("rate", [60, 240])
def test_what_counts_as_resting_may_be_fast_and_gives_no_energy(rate: int):
    """Slow balls may enter each other; they part no faster than they do by default."""
    bodies = Hanging([-0.5, 0.0, 0.0, 0.0, 0.0], spacing=0.04, length=0.2)
    chain = Chain([1] * 5, [0] * 5)
    row = Row(bodies, chain, MODEL, 0.02, bodies.pivots, resting=0.1)
    total = bodies.energy().sum()
    steps(row, 20 * rate, 1 / rate)
    assert row.impacts > 20
    assert bodies.energy().sum() < 1.05 * total


SHORT = 0.2
FIVE, MIXED, LIGHT = [1.0] * 5, [0.5, 1.0, 2.0], [1.0, 0.2, 1.0]


def game(masses, first, kicks=1):
    """Pendulums as a game has them, on strings of 20 cm."""
    angles = [-0.5] + [0.0] * (len(masses) - 1)
    return Hanging(angles, masses, 0.04, SHORT, first, kicks)


class Strings(Free):
    """Balls that a solver puts back onto their strings at each step: what they turn costs speed."""

    def __init__(self, masses, sub):
        n, self.sub = len(masses), sub
        self.pivots = np.column_stack([0.04 * np.arange(n), np.zeros(n)])
        arms = np.array([[math.sin(a), -math.cos(a)] for a in (-0.5, *[0.0] * (n - 1))])
        super().__init__(self.pivots + SHORT * arms, np.zeros((n, 2)), masses)

    def arms(self):
        arms = self.x - self.pivots
        return arms / np.hypot(*arms.T)[:, None]

    def advance(self, step):
        for _ in range(self.sub):
            self.v[:, 1] -= step / self.sub * GRAVITY
            self.v -= (self.v * self.arms()).sum(axis=1)[:, None] * self.arms()
            self.x += step / self.sub * self.v
            self.x = self.pivots + SHORT * self.arms()

    def energy(self):
        height = SHORT + self.x[:, 1] - self.pivots[:, 1]
        return self.masses * (0.5 * (self.v**2).sum(axis=1) + GRAVITY * height)


# Kicks first: the speed of a step is that after it; four kicks: the mean of 1/4, 2/4, 3/4 and 1.
# Strings that are put back keep of a velocity the cosine of its turn; four times of a quarter of
# it, a quarter of that loss.
@pytest.mark.parametrize(
    ("engine", "how", "masses", "lag", "loss"),
    [
        *((game, (1.0,), masses, 1.0, 0.0) for masses in (FIVE, LIGHT)),
        (game, (0.0,), MIXED, 0.0, 0.0),
        (game, (0.5,), MIXED, 0.5, 0.0),
        (game, (1.0, 4), FIVE, 0.625, 0.0),
        (Strings, (1,), LIGHT, 1.0, 0.5),
        (Strings, (4,), FIVE, 0.625, 0.125),
    ],
)
def test_half_a_minute_at_60_hz_leaves_what_one_pendulum_keeps(engine, how, masses, lag, loss):
    """The mean over the last ten seconds: energy swings with the phase of each ball.

    Where swings lose by their height, a row loses somewhat less: its balls share the energy.
    """
    means = []
    for alone in (True, False):
        bodies = engine(masses, *how)
        row = Row(bodies, Chain(masses, [0] * len(masses)), MODEL, 0.02, bodies.pivots)
        start, total = bodies.energy().sum(), 0.0
        for k in range(1800):
            (bodies.advance if alone else row.step)(1 / 60)
            total += bodies.energy().sum() / start if k >= 1200 else 0.0
        means.append(total / 600)
    assert row.impacts > 100
    assert row.lag == pytest.approx(lag, abs=2e-3)
    assert row.loss == pytest.approx(loss, abs=0.02)
    assert means[1] == pytest.approx(means[0], abs=0.014 if loss else 5e-3)


def test_a_step_is_one_of_the_engine_and_never_compiles(monkeypatch):
    """However much plain work was done, and whatever is on disk."""
    asked, taken = [], []
    monkeypatch.setattr(runtime, "_spent", 1e9)
    monkeypatch.setattr(runtime, "available", lambda: True)
    monkeypatch.setattr(runtime, "loaded", lambda *_: False)
    monkeypatch.setattr(runtime, "compiled", lambda *_: asked.append("compiled"))
    bodies = Hanging([-0.5, 0.0, 0.0])
    advance = bodies.advance
    bodies.advance = lambda step: taken.append(step) or advance(step)
    row = hung(bodies)
    steps(row, 60, 1 / 60)
    assert row.impacts > 0
    assert taken == [1 / 60] * 60
    assert asked == []
    # Elsewhere it would have been compiled by now.
    collide(Chain([1, 1], [1, 0]), ImpulseCorrelation([]))
    assert asked == ["compiled"]


def two_rows():
    """Two rows in one world; each adapter steps it."""
    one, other = Hanging([-0.5, 0.0, 0.0]), Hanging([0.0, 0.0, 0.4])
    worlds = one.advance, other.advance
    one.advance = other.advance = lambda step: [advance(step) for advance in worlds]
    return (one, hung(one)), (other, hung(other))


def test_two_rows_of_one_world_that_step_it_twice_are_refused():
    rows = [row for _, row in two_rows()]

    def each():
        for _ in range(60):
            for row in rows:
                row.step(1 / 60)

    with pytest.raises(RuntimeError, match=r"stepped together, by cradle\.row\.step_rows"):
        each()


@pytest.mark.parametrize(
    ("told", "factor", "words"),
    [
        (2.0, 1.0, r"ball 4 gains 2 times .*; its mass is 1 where masses\[4\] is 2"),
        (0.5, 1.0, r"ball 4 gains 0\.5 times .*; its mass is 1 where masses\[4\] is 0\.5"),
        (1.0, -1.0, "must be in the axes and the sense of `motion`"),
        (1.0, 0.75, None),  # a body in one piece with its arm, before the joint has acted
    ],
)
def test_masses_that_are_not_the_engines_are_seen_at_the_first_impacts(told, factor, words):
    bodies = Hanging([-0.5, 0.0, 0.0, 0.0, 0.0])
    push = bodies.push
    bodies.push = lambda ball, impulse: push(ball, tuple(factor * part for part in impulse))
    row = Row(bodies, Chain([1, 1, 1, 1, told], [0] * 5), MODEL, RADIUS, bodies.pivots)
    if words is None:
        return steps(row, 70, 1 / 120)
    with pytest.raises(RuntimeError, match=words):
        steps(row, 240, 1 / 120)


def test_pushes_that_an_engine_keeps_for_its_next_step_tell_nothing_of_masses():
    bodies, kept = Hanging([-0.5, 0.0, 0.0, 0.0, 0.0]), []
    push, advance = bodies.push, bodies.advance
    bodies.push = lambda *one: kept.append(one)
    bodies.advance = lambda step: ([push(*one) for one in kept], kept.clear(), advance(step))
    steps(hung(bodies), 70, 1 / 120)
    assert bodies.angles[-1] > 0.05


def test_a_row_is_stepped_once():
    """Twice in one step its balls would be pushed twice."""
    row = two_rows()[0][1]
    for rows in ([row, row], [], [None], row):
        with pytest.raises(ValueError, match=r"^rows = .*; must be different Rows: the first has"):
            step_rows(rows, 1 / 60)


def test_two_rows_of_one_world_are_stepped_together():
    together = two_rows()
    for _ in range(120):
        step_rows([row for _, row in together], 1 / 60)
    for (bodies, row), angles in zip(together, [[-0.5, 0, 0], [0, 0, 0.4]], strict=True):
        single = Hanging(angles)
        alone = hung(single)
        steps(alone, 120, 1 / 60)
        np.testing.assert_array_equal(bodies.angles, single.angles)
        assert row.impacts == alone.impacts > 0


def test_a_hit_is_told_when_the_step_is_made():
    bodies = Free([[-0.45, 0], [0, 0], [0.2, 0]], [[1, 0], [0, 0], [0, 0]], [1, 2, 1])
    row, told = Row(bodies, Chain([1, 2, 1], [0] * 3), MODEL, RADIUS), []
    row.on_hit = lambda hit: told.append((hit, bodies.v[:, 0].copy()))
    steps(row, 4, 0.1)
    ((hit, then),) = told
    assert hit.time == pytest.approx(0.25, abs=1e-12)  # gap .25 m at 1 m/s
    assert (hit.balls, hit.loudest) == (range(3), 0)
    expected = collide(Chain([1, 2, 1], [1, 0, 0]), MODEL)
    np.testing.assert_allclose(hit.before, [1, 0, 0], atol=1e-14)
    np.testing.assert_allclose(hit.after, expected.velocities, atol=1e-14)
    np.testing.assert_allclose(then, hit.after, atol=1e-14)
    assert hit.impulse == pytest.approx(max(expected.impulses), rel=1e-12)


def test_one_impact_of_free_balls_is_that_of_collide():
    """Along the row; across it each ball keeps its velocity, as without friction."""
    masses, e, model = [1.0, 3.0, 2.0, 1.0], [1.0, 0.5, 0.25], ImpulseCorrelation(0.2)
    along, aside = np.array([2.0, 0.0, 0.0, 0.0]), np.array([0.25, -0.5, 0.1, 0.0])
    axis = np.array([math.cos(0.3), math.sin(0.3)])  # the row lies askew in the plane
    across = np.array([-axis[1], axis[0]])
    v = np.outer(along, axis) + np.outer(aside, across)
    bodies = Free(np.outer([-0.2, 0.0, 0.2, 0.4], axis), v, masses)
    row = Row(bodies, Chain(masses, [0] * 4, e), model, RADIUS)
    row.step(1e-6)
    expected = collide(Chain(masses, along, e), model).velocities
    np.testing.assert_allclose(bodies.v @ axis, expected, atol=1e-12)
    np.testing.assert_allclose(bodies.v @ across, aside, atol=1e-12)
    assert row.impacts == 1


def test_an_impact_up_the_arc_keeps_the_energy():
    """Off the lowest point the strings take a part of the impulse, and no work."""
    bodies = Hanging([-0.4, 0.3, 0.3], masses=[1.0, 2.0, 0.5])
    bodies.angles[:] = 0.3
    bodies.rates[:] = [1.0, 0.0, 0.0]
    x, v = (np.array(part) @ [1, 1j] for part in bodies.motion())
    row = hung(bodies)
    own = row.own(v, x)
    after = own + row.fly(x, own, 1e-9)[0]
    assert bodies.masses @ after**2 == pytest.approx(bodies.masses @ own**2, rel=1e-14)
    # All arcs are parallel: as on a straight line.
    chain = Chain(bodies.masses, [1.0, 0.0, 0.0])
    np.testing.assert_allclose(after, collide(chain, MODEL).velocities, atol=1e-13)


@pytest.mark.parametrize(
    ("model", "part"),
    [
        (ImpulseCorrelation([0.1, 0.2, 0.3]), ImpulseCorrelation([0.2, 0.3])),
        (SpringChain(1.0), SpringChain(1.0)),
    ],
)
def test_a_part_of_the_row_gets_its_part_of_the_model(model, part):
    """Ball 0 is far away: balls 1 to 4 collide."""
    v = np.eye(5)[1]
    x = [[-9, 0], [0, 0], [0.2, 0], [0.4, 0], [0.6, 0]]
    bodies = Free(x, np.column_stack([v, 0 * v]), [1] * 5)
    Row(bodies, Chain([1] * 5, [0] * 5), model, RADIUS).step(1e-6)
    expected = collide(Chain([1] * 4, v[1:]), part).velocities
    np.testing.assert_allclose(bodies.v[1:, 0], expected, atol=1e-14)


@pytest.mark.parametrize("together", [False, True])
def test_balls_at_rest_are_looked_at_every_hundredth_of_a_second(together):
    """And cost no impact, also in a world of several rows."""
    bodies, looks = Hanging([0.0] * 5), []
    row, motion = hung(bodies), bodies.motion
    bodies.motion = lambda: looks.append(1) or motion()
    for _ in range(2000):
        step_rows([row], 1e-3) if together else row.step(1e-3)
    assert row.impacts == 0
    np.testing.assert_array_equal(bodies.angles, 0)
    assert len(looks) <= 220


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("step", [1 / 60, 1e-3])
def test_balls_that_press_each_other_rest(e: float, step: float):
    """Pivots nearer than two radii: every ball leans on its neighbour for ever."""
    spacing = 1.9 * RADIUS
    wide = np.arcsin((2 * RADIUS - spacing) * np.arange(-2, 3) / LENGTH)
    bodies = Hanging(wide, spacing=spacing)
    row = hung(bodies, e)
    least = 0.0
    for _ in range(round(10 / step)):
        row.step(step)
        least = min(least, gaps(bodies).min())
    assert row.impacts < 20
    assert least > -10 * row.touching
    assert np.abs(bodies.angles - wide).max() < 0.01


def test_lossy_balls_come_to_rest_together():
    bodies = Hanging([-0.5, 0, 0, 0, 0])
    row = hung(bodies, 0.5)
    steps(row, 30_000, 1e-3)
    assert row.impacts < 500
    # At last all swing as one pendulum: with the momentum, a fifth of the velocity.
    assert np.ptp(bodies.rates) < 0.02
    assert bodies.energy().sum() < 0.25 * GRAVITY * 2 * math.sin(0.25) ** 2


def test_a_kick_is_seen_within_a_hundredth_of_a_second_or_when_woken():
    for wake, most in ((False, 10), (True, 1)):
        bodies = Hanging([0.0] * 3)
        row = hung(bodies)
        row.step(1e-3)
        bodies.rates[0] = 2.0
        if wake:
            row.wake()
        taken = 0
        while not row.impacts:
            row.step(1e-3)
            taken += 1
        assert taken <= most
        assert bodies.rates[0] < 0


def test_free_balls_that_are_accelerated_are_seen_in_time():
    """A ball that falls onto the next one, from rest: looked at before it can be there."""
    bodies = Free([[0, 0.0203], [0, 0]], [[0, 0], [0, 0]], [1, 1])
    fall = bodies.advance

    def advance(step):
        bodies.v[0, 1] -= GRAVITY * step
        fall(step)

    bodies.advance = advance
    row = Row(bodies, Chain([1, 1], [0, 0]), MODEL, 0.01, touching=1e-5)
    steps(row, 9, 1e-3)
    assert row.impacts == 1  # after sqrt(2 gap / g), 7.8 ms


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x": [[0, 0], [0.2, 0], [0.1, 0.17320508]]}, "balls 0 and 2 touch and .*; a row alone"),
        ({"x": [[0, 0], [0.2, 0]]}, r"positions has shape \(2, 2\); 3 balls need \(3, 2\)"),
        ({"radii": [0.1, 0.1]}, "radii has 2 values; 3 balls need 3, or one number"),
        ({"radii": [0.1, -0.1, 0.1]}, r"radii\[1\] = -0.1; must be above 0"),
        ({"pivots": [[0, 0]]}, r"pivots has shape \(1, 2\); 3 balls need \(3, 2\)"),
        ({"pivots": [[0, 1], [0.5, 1], [0.25, 1]]}, r"pivots\[2\] lies behind pivots\[1\]"),
        ({"pivots": [[0.4, 1], [0.2, 1], [0, 1]]}, r"pivots\[1\] lies behind pivots\[0\]"),
        ({"radii": 0.12}, r"balls 0 and 1 overlap by 0\.04 m; must be .* `touching` = 0\.00012"),
        ({"x": [[0, 0], [math.nan, 0], [0.4, 0]]}, r"motion: positions\[1, 0\] = nan; must be fi"),
        ({"touching": 0.0}, "touching = 0.0; must be above 0"),
        ({"resting": -1.0}, "resting = -1.0; must be above 0"),
        ({"acceleration": math.nan}, "acceleration"),
        ({"model": ImpulseCorrelation([0.1, 0.2])}, "forward"),
    ],
)
def test_what_is_no_row_is_refused(change: dict, message: str):
    given = {"x": [[0, 0], [0.2, 0], [0.4, 0]], "radii": RADIUS, "model": MODEL} | change
    bodies = Free(given.pop("x"), np.zeros((3, 2)), [1] * 3)
    with pytest.raises(ValueError, match=message):
        Row(bodies, Chain([1] * 3, [0] * 3), given.pop("model"), given.pop("radii"), **given)


@pytest.mark.parametrize("hung", [0.95, 1.05, 0.85, 1.2, 2.0])
def test_radii_that_do_not_fit_the_places_of_the_balls_are_told(hung: float):
    """Leans and gaps of a twentieth are usual; radii for diameters, or of other balls, are not."""
    bodies = Hanging([-0.5, -0.3, 0.1], spacing=2 * RADIUS * hung)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        Row(bodies, Chain([1] * 3, [0] * 3), MODEL, RADIUS, bodies.pivots)
    words = [str(one.message) for one in told]
    rule = f"should be within a tenth of {0.2 * hung:g}, as far as these balls hang apart"
    wrong = abs(hung - 1) > 0.1
    assert words == [f"radii[{c}] + radii[{c + 1}] = 0.2; {rule}" for c in range(2)][:wrong]
    assert all(one.filename == __file__ for one in told)


@pytest.mark.parametrize("angle", [-0.9, -1.5])
def test_a_short_string_may_be_lifted_beside_a_long_one(angle: float):
    """The line to the last ball then leans so far that the longer string's pivot lies behind."""
    lengths = np.array([0.1, 0.3])
    pivots = np.column_stack([[0.0, 0.04], lengths])
    arms = lengths[:, None] * np.array([[math.sin(angle), -math.cos(angle)], [0.0, -1.0]])
    bodies = Free(pivots + arms, np.zeros((2, 2)), [1, 1])
    along = bodies.x[1] - bodies.x[0]
    assert (pivots[1] - pivots[0]) @ along < 0
    row = Row(bodies, Chain([1, 1], [0, 0]), MODEL, 0.02, pivots)
    bodies.x = pivots - np.column_stack([[0.0, 0.0], lengths])
    bodies.v[0, 0] = 1.0
    row.step(1e-6)
    assert row.impacts == 1


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ([[1, 0, 0], [0, 0, 0]], r"velocities has shape \(2, 3\); 2 balls need \(2, 2\)"),
        ([1, 0], r"velocities has shape \(2,\)"),
        ([[1, 0]], r"velocities has shape \(1, 2\)"),
        ([[1, 0], [None, 0]], r"motion: velocities\[1, 0\] = None; must be a real number"),
        ([[1, 0], [math.nan, 0]], r"motion: velocities\[1, 0\] = nan; must be finite"),
    ],
)
def test_velocities_that_are_none_of_a_plane_are_refused_at_once(told, message):
    bodies = Free([[0, 0], [0.2, 0]], np.zeros((2, 2)), [1, 1])
    bodies.motion = lambda: (bodies.x.tolist(), told)
    with pytest.raises(ValueError, match=message):
        Row(bodies, Chain([1, 1], [0, 0]), MODEL, RADIUS)


def test_a_ball_that_a_hand_moves_unsaid_is_told_of_wake():
    """Each frame a hand carries the ball on, faster than the velocity that it leaves with it."""
    bodies = Hanging([-0.5, 0.0, 0.0])
    row = hung(bodies)

    def carry():
        for _ in range(20):
            bodies.angles[0] -= 0.02
            bodies.rates[0] = -0.3
            row.step(1 / 60)

    with pytest.raises(RuntimeError, match="between the steps of this row; call wake after"):
        carry()


class Colliding(Hanging):
    """An engine that foresees contacts, as Rapier does, and collides the balls of the row too."""

    def advance(self, step):
        kick = step * GRAVITY / self.length
        self.rates -= kick * np.sin(self.angles)
        before = self.length * self.rates
        near = np.array(gaps(self)) < 0.01
        for c in np.flatnonzero(near & (np.diff(before) < -1e-3)):
            self.rates[[c, c + 1]] = self.rates[[c + 1, c]]
        self.angles += step * self.rates


def test_an_engine_that_collides_the_balls_too_is_told_once():
    bodies = Colliding([-0.5, 0.0, 0.0])
    row = hung(bodies)
    words = r"balls \d and \d part by [\d.]+ m/s more than pushed; the engine must not collide"
    with pytest.warns(UserWarning, match=words) as told:
        steps(row, 1200, 1 / 120)
    assert len(told) == 1
    assert told[0].filename == __file__


def test_a_hand_that_pulls_a_ball_away_is_no_contact():
    """It acts within the step of a contact, as an engine would, but on one ball alone."""
    bodies = Hanging([-0.5, 0.0, 0.0])
    row, advance, pulled = hung(bodies), bodies.advance, []

    def driven(step):
        if 0 < gaps(bodies)[0] < 0.02 and bodies.rates[0] > 0.1:
            pulled.append(row.time)
            bodies.rates[0] -= 2.0
        advance(step)

    bodies.advance = driven
    steps(row, 1200, 1 / 120)
    assert len(pulled) > 5


STILL = [0, 0]
#: Places, velocities, pivots, the step, and the words in which a step of a hundred is refused.
REFUSED = [
    ([[-0.3, 0], [0, 0], [0.2 * 0.8, 0.2 * 0.6]], [[1, 0], STILL, STILL], None, 0.2,
     "balls 0 to 2 touch, but not in a straight row"),
    ([[0, 0], [0.3, 0], [0.6, 0]], [[0.3, 1], STILL, [-0.3, 1]], None, 0.01,
     "balls 0 and 2 touch and are no neighbours"),
    ([[-0.2, 0], [0, 0]], [[1, 0], STILL], [[-0.2, 1], [1, 0]], 0.01,
     "ball 1 is struck along its string"),
]  # fmt: skip


@pytest.mark.filterwarnings("ignore:radii")  # no row hangs like the last of them
@pytest.mark.parametrize(("x", "v", "pivots", "step", "words"), REFUSED)
def test_what_is_seen_to_be_no_row_in_a_step_is_refused(x, v, pivots, step, words):
    row = Row(Free(x, v, [1] * len(x)), Chain([1] * len(x), [0] * len(x)), MODEL, RADIUS, pivots)
    with pytest.raises(ValueError, match=words):
        steps(row, 100, step)


@pytest.mark.parametrize(("first", "words"), [(0.45, "0.15 m"), (0.2, "0.1")])
def test_balls_that_pass_each_other_are_an_error(first, words):
    """Moved by somebody, or in an engine that ignores impulses."""
    bodies = Free([[0, 0], [0.5, 0]], [[1, 0], STILL], [1, 1])
    bodies.push = lambda *_: None
    row = Row(bodies, Chain([1, 1], STILL), MODEL, RADIUS)
    bodies.x[0, 0] = first
    with pytest.raises(RuntimeError, match=f"balls 0 and 1 overlap by {words}"):
        steps(row, 100, 0.01)


def test_units_are_free():
    """The same scene in pixels: what touches and what rests is told by radius and gravity."""
    found = []
    for unit in (1.0, 256.0):
        bodies = Free(np.array([[-0.3, 0], [0, 0], [0.2, 0]]) * unit, np.zeros((3, 2)), [1] * 3)
        bodies.v[0, 0] = unit
        row = Row(
            bodies, Chain([1] * 3, [0] * 3), MODEL, RADIUS * unit, acceleration=GRAVITY * unit
        )
        steps(row, 30, 0.01)
        found.append((bodies.v / unit, row.touching / unit, row.resting / unit, row.impacts))
    for one, other in zip(*found):
        np.testing.assert_array_equal(one, other)


def test_a_step_with_too_many_impacts_is_an_error(monkeypatch):
    monkeypatch.setattr("cradle.swinging.stride._MOST_IMPACTS", 5)
    bodies = Free([[0, 0], [0.205, 0], [0.42, 0]], [[1, 0], [0, 0], [-1, 0]], [1, 1e-4, 1])
    row = Row(bodies, Chain(bodies.masses, [0] * 3), MODEL, RADIUS, touching=1e-9)
    with pytest.raises(RuntimeError, match=r"more than 5 impacts in a step of 0\.1 s"):
        row.step(0.1)


@pytest.mark.parametrize("pivots", [None, [[0, 1], [0.2, 1], [0.4, 1]]])
@pytest.mark.parametrize(("what", "value"), [("positions", math.nan), ("velocities", math.inf)])
def test_an_engine_that_tells_no_number_is_refused(what, value, pivots):
    bodies = Free([[0, 0], [0.2, 0], [0.4, 0]], np.zeros((3, 2)), [1] * 3)
    row = Row(bodies, Chain([1] * 3, [0] * 3), MODEL, RADIUS, pivots)
    (bodies.x if what == "positions" else bodies.v)[2, 1] = value
    with pytest.raises(ValueError, match=rf"motion: {what}\[2, 1\] = {value}; must be finite"):
        row.step(0.01)


@pytest.mark.parametrize("duration", [0.0, -1.0, math.nan])
def test_a_step_takes_time(duration: float):
    row = hung(Hanging([0.0, 0.0]))
    with pytest.raises(ValueError, match=r"duration = .*; must be (above 0|finite)"):
        row.step(duration)
