"""Fits to the film of a swing: by closed form, against the truth, where a law or a film fails."""

import re

import matplotlib.pyplot as plt
import numpy as np
import pytest
from chains import uniform
from real_cradles import table
from stored import read

from cradle import (
    Chain,
    ConstantLoss,
    ImpulseCorrelation,
    Pendulums,
    SequentialCollisions,
    SpeedDependent,
    swing,
)
from cradle.fit import fit_swing, frames, read_tracker
from cradle.fit.swings import _Film

LAW = ImpulseCorrelation(0.1)
NUMBERS = ("period", "damping", "restitution", "gaps")
LOSS = SpeedDependent(SequentialCollisions(), ConstantLoss(1e-3))
TRUE = dict(zip(NUMBERS, (0.8, 0.02, 0.98, 1e-4)))


def filmed(true, pulled, seconds, rate, noise=0.0, seed=0, law=LAW, masses=None):
    """Times and places of a swing, each place moved at random."""
    length = 9.81 * (true["period"] / 2 / np.pi) ** 2
    hanging = Pendulums(length, gaps=true["gaps"], damping=true["damping"])
    times, n = np.arange(0, seconds, 1 / rate), len(pulled)
    chain = Chain(masses or [1] * n, [0] * n, true["restitution"])
    run = swing(chain, law, pulled, times, pendulums=hanging)
    moved = np.random.default_rng(seed).standard_normal((len(times), n))
    return times, run.positions + noise * moved


def wander(shape, size, rate, seed):
    """Errors of a tracker that last for a tenth of a second."""
    kept, moved = np.exp(-10 / rate), np.zeros(shape)
    steps = np.random.default_rng(seed).standard_normal(shape)
    for k in range(1, len(moved)):
        moved[k] = kept * moved[k - 1] + size * np.sqrt(1 - kept**2) * steps[k]
    return moved


def held(fit, true, times=1.0):
    """Names of the numbers whose intervals, made so many times wider, hold the true ones."""
    ends = fit.intervals.items()
    return {k for k, (a, b) in ends if abs(true[k] - (a + b) / 2) <= times * (b - a) / 2}


@pytest.fixture(scope="module")
def two_balls():
    """A film of two balls with its fit."""
    film = filmed(TRUE, [-0.03, 0], 4, 60, 2e-4)
    return *film, fit_swing(*film, LAW)


def test_two_balls_by_closed_form():
    """Touching balls: the mean is a cosine, and the distance shrinks by e each half swing."""
    e, period, size = 0.9, 1.1, 0.04
    times = np.arange(0, 3, 0.03)
    wave = size * np.cos(2 * np.pi * times / period)
    apart = e ** np.floor(2 * times / period + 0.5) * np.abs(wave)
    places = np.stack([-wave - apart, -wave + apart], axis=1) / 2
    fit = fit_swing(times, places, LAW)
    assert fit.values["period"] == pytest.approx(period, rel=1e-6)
    assert fit.values["restitution"] == pytest.approx(e, rel=1e-6)
    assert max(fit.values["damping"], fit.values["gaps"] / size) < 1e-5
    assert not fit.poor  # rounding alone is left


def test_a_computed_film_that_a_swing_follows_to_the_bit():
    times, law = np.arange(0, 2.5, 0.05), ImpulseCorrelation(0)
    film = swing(Chain([1, 1], [0, 0], 0.9), law, [-0.05, 0], times).positions
    fit = fit_swing(times, film, law)
    assert fit.values["restitution"] == pytest.approx(0.9, rel=1e-12)
    assert not fit.poor
    assert 0 < fit.reading < 1e-12


def test_two_balls_and_what_is_said(two_balls):
    _, places, fit = two_balls
    assert held(fit, TRUE, 2) == {*NUMBERS}
    assert not fit.poor
    assert set(fit.widened.values()) == {1.0}
    assert fit.reading == pytest.approx(2e-4, rel=0.1)
    freedom = places.size - 2 - 6  # a constant for each ball; four numbers, a place and a speed
    assert fit.reading == pytest.approx(np.sqrt(np.square(fit.residuals).sum() / freedom))
    assert np.nanmax(np.abs(fit.residuals.mean(axis=0))) < 1e-12
    offset = places - fit.swing.positions - fit.residuals
    assert np.ptp(offset, axis=0).max() < 1e-12  # one number for each ball
    assert fit.chi_square is None  # the residuals themselves made the reading
    assert "chi-square" not in fit.summary()
    lines = fit.summary().splitlines()
    assert [line.split()[1] for line in lines[:4]] == [*NUMBERS]
    told, low, high, unit = re.fullmatch(r".* = (\S+) \[(\S+), (\S+)\] (\S+)", lines[3]).groups()
    micrometres = 1e6 * np.array([fit.values["gaps"], *fit.intervals["gaps"]])
    assert [told, low, high] == [f"{x:.2f}" for x in micrometres]  # two digits of the error
    assert unit == "µm"
    assert "poor" not in fit.summary()
    assert str(fit) == f"SwingFit({'; '.join(lines)})"


def test_errors_by_the_slopes(two_balls):
    """Where all is smooth the profile is that of a parabola: errors by the inverse matrix."""
    times, _, fit = two_balls
    place, rate = fit.swing.positions[0, 0], 0.0
    best, columns = np.array([*fit.values.values(), place, rate]), []
    for step in np.diag([1e-5, 1e-4, 1e-4, 1e-6, 1e-5, 1e-3]):
        sides = []
        for period, damping, e, gap, start, rate in (best + step, best - step):
            hanging = Pendulums(9.81 * (period / 2 / np.pi) ** 2, gaps=gap, damping=damping)
            chain = Chain([1, 1], [rate * start, 0], e)
            places = swing(chain, LAW, [start, 0], times, pendulums=hanging).positions
            sides.append(places - places.mean(axis=0))
        columns.append((sides[0] - sides[1]).ravel() / (2 * step.sum()))
    slopes = np.stack(columns, axis=1)
    errors = fit.reading * np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    for error, (low, high) in zip(errors, fit.intervals.values()):
        assert (high - low) / 3.92 == pytest.approx(error, rel=0.1)


def test_from_a_wrong_minimum(two_balls, monkeypatch):
    """Gaps of 6 mm fit better than any near them; the profiles find what fits best."""
    times, places, fit = two_balls
    begin, far = _Film.begin, np.array([0.8, 0.02, 0.9, 6e-3, -0.03, 0])
    monkeypatch.setattr(_Film, "begin", lambda film: 0 * begin(film) + far)
    assert fit_swing(times, places, LAW).values == pytest.approx(fit.values, rel=1e-4)


def test_a_given_reading(two_balls):
    times, places, fit = two_balls
    same = fit_swing(times, places, LAW, reading=2e-4)
    assert not same.poor
    assert same.chi_square == pytest.approx((np.array(same.residuals) ** 2).sum() / 2e-4**2)
    wrong = fit_swing(times, places, LAW, reading=1e-4)
    assert wrong.poor
    assert wrong.chi_square == pytest.approx(4 * same.chi_square, rel=1e-3)
    for name, (low, high) in wrong.intervals.items():
        assert high - low > 0.9 * np.ptp(fit.intervals[name])


def test_five_balls_of_which_some_are_hidden():
    times, places = filmed(TRUE, [-0.03, -0.03, 0, 0, 0], 3, 60, 2e-4, seed=1)
    seen = np.random.default_rng(2).random(places.shape) < 0.9
    fit = fit_swing(times, np.where(seen, places, np.nan), LAW)
    assert held(fit, TRUE, 2) == {*NUMBERS}
    assert (np.isfinite(fit.residuals) == seen).all()
    given = {"free": [], "known": fit.values}
    one = fit_swing(times, np.where(seen, places, np.nan), LAW, **given)
    other = fit_swing(times, np.where(seen, places, 9.0), LAW, seen=seen, **given)
    np.testing.assert_array_equal(one.residuals, other.residuals)


THREE_PULLED = filmed(TRUE, [-0.03] * 3 + [0, 0], 2, 40, 3e-4, 3, SequentialCollisions())


@pytest.mark.exhaustive
def test_three_balls_pulled():
    fit = fit_swing(*THREE_PULLED, SequentialCollisions())
    assert held(fit, TRUE, 2) == {*NUMBERS}
    assert not fit.poor


def test_readings_that_overlap():
    """Each counts, or nothing says where a ball is."""
    film = _Film(*THREE_PULLED, LAW, None, None, NUMBERS, {"period": 0.8, "gaps": 1e-4}, None)
    film.begin()
    pooled = film.swung(np.array([0.02, 0.98, -0.03, -0.031, -0.029, 0])).positions[0]
    assert pooled[:3] == pytest.approx([-0.03045, -0.03055, -0.029], abs=1e-12)


def test_a_profile_in_rough_country(two_balls, monkeypatch):
    """No interval is narrower than slopes say, though each swing near by leaves more."""
    film = _Film(*two_balls[:2], LAW, None, None, NUMBERS, {}, None)
    p, rest, slopes = film.descend(film.begin())
    film.judged(p, rest, slopes)
    left = _Film.left
    monkeypatch.setattr(_Film, "left", lambda self, q: left(self, q) * (2 - (q == p).all()))
    scan = film.profile(p, rest, slopes, 2, 1e-4, 3.84 * film.variance)
    assert np.ptp(scan.intervals[0]) == pytest.approx(2 * 1.96e-4, rel=1e-3)


def test_outer_balls_alone():
    times, places = filmed(TRUE, [-0.03, 0, 0, 0, 0], 4, 60, 2e-4, seed=1)
    fit = fit_swing(times, places, LAW, seen=[1, 0, 0, 0, 1], known={"damping": 0.02})
    assert held(fit, TRUE, 2) == {"period", "restitution", "gaps"}


@pytest.mark.parametrize("masses", [[2, 1], [1, 8]])
def test_unequal_balls(masses):
    """A plain mean goes to and fro in half of the period."""
    film = filmed(TRUE, [-0.03, 0], 4, 60, 2e-4, masses=masses)
    fit = fit_swing(*film, LAW, masses=masses)
    assert held(fit, TRUE, 2) == {*NUMBERS}
    assert not fit.poor


def test_film_without_an_impact_tells_no_restitution():
    times, places = filmed(TRUE, [-0.03, 0], 0.19, 240, 2e-4)
    fit = fit_swing(times, places, LAW, known={"period": 0.8, "gaps": 1e-4, "damping": 0.02})
    assert fit.intervals["restitution"] == (0.0, 1.0)
    assert fit.values["restitution"] is None
    assert "restitution: not identified" in fit.summary()


def test_a_law_that_does_not_fit_is_said_and_intervals_grow():
    """A constant loss of speed, and a tracker that wanders."""
    true = TRUE | {"restitution": 1.0}
    times, places = filmed(true, [-0.03, 0, 0, 0, 0], 6, 60, 2e-4, 3, LOSS)
    fit = fit_swing(times, places + wander(places.shape, 3e-4, 60, 3), LAW)
    assert fit.poor
    assert fit.correlation > 0.3
    assert "poor fit: intervals are too short" in fit.summary()
    assert min(fit.widened.values()) > 1.5
    assert held(fit, true) >= {"period", "damping", "gaps"}
    known = fit_swing(times, places, LAW, free=[], known=fit.values | {"restitution": 0.9})
    assert known.summary().endswith("though widened: none")


@pytest.mark.exhaustive
def test_twelve_seconds_of_the_real_cradle():
    """Intervals hold what the whole film gives: by turning points, and by others."""
    film = table("cradle_trace.csv")
    use = (film["t_s"] > 0.82) & (film["t_s"] < 12.82)
    places = np.stack([film[f"x{k}_m"][use] for k in range(1, 6)], axis=1)
    fit = fit_swing(film["t_s"][use], places, LAW)
    assert fit.poor
    laws = {one["law"]: one for one in read("cradle_fits.csv")}
    low, high = fit.intervals["restitution"]
    assert low < float(laws["constant restitution"]["loss"]) < high
    low, high = fit.intervals["gaps"]
    assert low < 81e-6 < high  # of half a minute, by this fit


@pytest.mark.exhaustive
@pytest.mark.parametrize("misfit", [False, True])
def test_forty_films(misfit):
    """Each interval holds the truth; a constant loss of speed has no true restitution."""
    count = dict.fromkeys(NUMBERS, 0)
    for seed in range(40):
        rng = np.random.default_rng(seed)
        ends = ((0.6, 0.9), (0.01, 0.04), (0.94, 0.997), (2e-5, 2e-4))
        true = {name: uniform(rng, *two) for name, two in zip(NUMBERS, ends)}
        true["restitution"] = 1.0 if misfit else true["restitution"]
        law = LOSS if misfit else SequentialCollisions()
        pulled = [-uniform(rng, 0.02, 0.03), 0, 0, 0, 0]
        times, places = filmed(true, pulled, 10, 60, 2e-4, seed, law)
        fit = fit_swing(times, places + misfit * wander(places.shape, 3e-4, 60, seed), LAW)
        assert fit.poor == misfit
        for name in held(fit, true):
            count[name] += 1
    if misfit:
        del count["restitution"]
    assert min(count.values()) >= 35


def test_what_is_drawn(two_balls):
    *_, fit = two_balls
    film, left = fit.plot()
    dots, line = film.lines[:2]
    assert dots.get_ydata() - line.get_ydata() == pytest.approx(1000 * fit.residuals[:, 0])
    assert left.lines[1].get_ydata() == pytest.approx(1000 * fit.residuals[:, 1])
    plt.close("all")


WAYS = np.linspace(0, 3, 90)
PLACES = np.stack([-0.03 * np.cos(8 * WAYS), 0 * WAYS], axis=1)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"times": WAYS[:-1]}, r"shapes \(89,\), \(90, 2\)"),
        ({"times": WAYS[::-1]}, r"times\[1\] = .*; must rise"),
        ({"positions": PLACES[:, :1]}, "N at least 2"),
        ({"seen": [True]}, r"and \(1,\); must be"),
        ({"seen": [False, False]}, "^0 readings, 0 full frames; needs 30 and 10"),
        ({"reading": 0.0}, r"reading = 0.0; must be above 0"),
        ({"masses": [1, 0]}, r"masses\[1\] = 0.0; must be above 0"),
        ({"masses": [1]}, "^masses has 1 values; 2 balls need 2"),
        ({"free": ["gap"]}, "free or known = 'gap'; must be one of period"),
        ({"free": "gaps"}, "period is neither free nor known"),
        ({"free": ["gaps"]}, "period is neither free nor known"),
        ({"known": {"period": -1.0}}, r"known\['period'\] = -1.0; must lie in \[0.1, 30\]"),
        ({"known": {"restitution": 1.5}}, r"known\['restitution'\] = 1.5; must lie in"),
        ({"known": {"gaps": -1e-5}}, r"known\['gaps'\] = -1e-05; must be at least 0"),
        ({"positions": PLACES[::-1] * 0.0}, "no ball is seen on its way"),
        ({"positions": PLACES - PLACES[:, ::-1]}, "rests, and tells no period: give known"),
        ({"positions": 100 * PLACES}, "must be within .* a quarter of a circle; so no swing"),
        ({"times": 1000 * WAYS}, r"period that is seen, s, = 7\d\d.*; must lie in \[0.1, 30"),
        ({"positions": PLACES - [np.inf, 0]}, r"positions\[0, 0\] = -inf; must be finite, or nan"),
        ({"times": [], "positions": PLACES[:0]}, r"shapes \(0,\), \(0, 2\) and"),
    ],
)  # fmt: skip
def test_refused(changes, words):
    given = {"times": WAYS, "positions": PLACES, "model": LAW} | changes
    with pytest.raises(ValueError, match=words):
        fit_swing(**given)


@pytest.mark.parametrize(("name", "what"), [("free", "a Collection"), ("known", "a Mapping")])
def test_refused_by_type(name, what):
    with pytest.raises(TypeError, match=f"^{name} is a float; must be {what}$"):
        fit_swing(WAYS, PLACES, LAW, **{name: 0.9})


def test_a_film_as_a_tracker_exports_it(tmp_path):
    """Two unlike balls, in mm and slowed, two marks missing: what was given comes back."""
    times, hanging = np.arange(0, 3, 1 / 50), Pendulums(9.81 * (0.45 / np.pi) ** 2, gaps=1e-4)
    chain, law = Chain([1, 2], [0, 0], 0.95), ImpulseCorrelation(0)
    places = swing(chain, law, [-0.03, 0], times, pendulums=hanging).positions
    marks = [[f"{1000 * x:.7g}" for x in row] for row in np.add(places, [0.5, 0.53])]
    marks[20][1] = marks[31][0] = ""
    lines = [f"{8 * t:.6g}\t{a}\t{b}" for t, (a, b) in zip(times, marks, strict=True)]
    file = tmp_path / "swing.txt"
    file.write_text("\n".join(["t\tA/x\tB/x", *lines]), encoding="utf-8")
    seconds, seen = frames(read_tracker(file, time_scale=1 / 8, unit=1e-3))
    np.testing.assert_allclose(seconds, times, atol=1e-6)
    assert np.argwhere(np.isnan(seen)).tolist() == [[20, 1], [31, 0]]
    assert not np.nanmedian(seen, axis=0).any()
    values = fit_swing(seconds, seen, law, masses=[1, 2], known={"damping": 0}).values
    assert values["period"] == pytest.approx(0.9, rel=1e-6)
    assert values["restitution"] == pytest.approx(0.95, abs=1e-6)
    assert values["gaps"] == pytest.approx(1e-4, rel=1e-3)
