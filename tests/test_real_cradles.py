"""The measured cradles: the readings agree, and the fitting script's spheres are spheres."""

import numpy as np
import pytest
import real_cradles
from real_cradles import by_spheres, first_strikes, spheres, table

from cradle import Chain, SpringChain, collide


def test_the_readings_of_the_film_agree():
    all_readings = [first_strikes(reading) for reading in (1, *real_cradles.READINGS[1:])]
    for release in (1, 2):
        one, own = all_readings[0][release]
        for reading in all_readings[1:]:
            other, error = reading[release]
            assert (np.abs(one - other) < 2 * np.hypot(own, error)).all()


def test_momentum_is_kept_within_the_errors_of_the_blind_reading():
    t = table("film_strikes.csv")
    use = (t["reading"] == 3) & (t["strike"] == 1) & (t["release"] < 3)
    for release in (1, 2):
        rows = use & (t["release"] == release)
        error = np.sqrt((t["sigma_after"][rows] ** 2 + t["sigma_before"][rows] ** 2).sum())
        assert abs((t["after"] - t["before"])[rows].sum()) < 2 * error


@pytest.mark.parametrize("release", [1, 2])
def test_spheres_that_touch_are_the_spring_chain(release):
    chain = Chain(np.ones(5), [1.0] * release + [0.0] * (5 - release), 1.0)
    elastic = collide(chain, SpringChain()).velocities
    assert by_spheres([0, 0, 0, 0, 0], release) == pytest.approx(elastic, abs=1e-5)


def test_wide_gaps_pass_the_speed_on_and_losses_take_energy():
    assert spheres([1, 0, 0], [0, 5], 0.0) == pytest.approx([0, 0, 1], abs=1e-6)
    lossy = spheres([1, 0, 0], [0, 0], 0.01)
    assert lossy.sum() == pytest.approx(1)
    assert (lossy**2).sum() < 0.99


def test_the_half_minute_is_one_damped_cosine_in_the_mean():
    t = table("cradle_trace.csv")
    mean = np.mean([t[f"x{k}_m"] for k in range(1, 6)], axis=0)
    use = np.isfinite(mean) & (t["t_s"] > 0.8)
    time, mean = t["t_s"][use], mean[use]
    wave = np.exp(-0.027 * time) * np.exp(2j * np.pi * time / 0.7319)
    basis = np.stack([wave.real, wave.imag, np.ones_like(time)], 1)
    left = mean - basis @ np.linalg.lstsq(basis, mean, rcond=None)[0]
    assert left.std() < 0.1 * mean.std()
