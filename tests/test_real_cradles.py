"""The measured cradles: readings agree, spheres are spheres, stored fits fit as they state."""

from functools import cache

import numpy as np
import pytest
import real_cradles
import real_swing
from chains import uniform
from real_cradles import by_spheres, chi_square, first_strikes, ratios, spheres, table
from stored import numbers, read

from cradle import Chain, SequentialCollisions, SpringChain, collide

FITS, SWINGS = read("film_fits.csv"), read("cradle_fits.csv")
MEAN = real_swing.common()


def test_the_readings_of_the_film_agree():
    all_readings = [first_strikes(reading) for reading in (1, 2, 3, 4)]
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


@pytest.mark.parametrize("law", real_cradles.LAWS)
def test_stored_fits_have_the_chi_square_that_they_state(law):
    rows = [row for row in FITS if row["law"] == law]
    assert {(row["reading"], row["fitted"]) for row in rows} >= {("4", "both"), ("2", "both")}
    for row in rows:
        data, p = first_strikes(int(row["reading"])), [float(x) for x in row["parameters"].split()]
        for release, column in enumerate(real_cradles.SUMS, 1):
            if release not in data:
                assert row[column] == ""
                continue
            chi = chi_square(law, p, row["strikers"] == "apart", data, (release,))
            assert chi == pytest.approx(float(row[column]), rel=2e-3, abs=2e-3), row


@pytest.mark.parametrize("law", ["one ratio, e", "three ratios, e"])
@pytest.mark.parametrize("strikers", ["together", "apart"])
def test_a_stored_fit_to_both_is_a_minimum(law, strikers):
    (row,) = [
        row
        for row in FITS
        if (row["law"], row["strikers"], row["fitted"], row["reading"])
        == (law, strikers, "both", "4")
    ]
    p, data = np.array([float(x) for x in row["parameters"].split()]), first_strikes(4)
    least = chi_square(law, p, strikers == "apart", data, (1, 2))
    for change in (*np.eye(len(p)), *-np.eye(len(p))):
        # Half a percent of each number: above the rounding of what is stored.
        assert chi_square(law, p * (1 + 0.005 * change), strikers == "apart", data, (1, 2)) > least


@pytest.mark.parametrize("at", [10, 23, 44, 60])
def test_no_gaps_are_better_at_a_distance_than_those_stored(at):
    """From starts that the search has not seen."""
    row, rng = numbers("film_distances.csv")[at], np.random.default_rng(at)
    starts = [[*gaps, 0.006] for gaps in uniform(rng, 0.01, 0.4, (12, 3))]
    found, _ = real_cradles.best_at(row["apart"], first_strikes(4), starts)
    assert found > row["both"] - 0.02


def test_every_law_is_fitted_and_freedom_counts_its_numbers():
    assert {row["law"] for row in FITS} == set(real_cradles.LAWS)
    for row in FITS:
        count = len(row["parameters"].split())
        fitted = {"both": 10 - count, "one": 5, "all": 15 - count}
        assert int(row["freedom"]) == fitted[row["fitted"].split(",")[0]]


def test_strikers_that_come_one_by_one():
    v = ratios([0, 0, 0], 1.0, 2, apart=True)
    assert v == pytest.approx([0, 0, 0, 1, 1], abs=1e-12)
    lone = collide(Chain(np.ones(4), [1, 0, 0, 0], 1), SpringChain()).velocities
    late = collide(Chain(np.ones(5), [1, *lone], 1), SequentialCollisions()).velocities
    v = by_spheres([0, 0, 0, 0, 0], 2, apart=True)
    assert v == pytest.approx(late, abs=2e-4)


@pytest.mark.parametrize("row", SWINGS, ids=lambda row: row["law"])
def test_stored_fits_of_the_half_minute(row):
    p = [float(row[key]) for key in real_swing.COLUMNS[1:6]]
    run, found = swung(row["law"], row["law"]), real_swing.peaks()
    chi = (real_swing.misfits(run, p[3], found) ** 2).sum(axis=1)
    assert chi == pytest.approx([float(row["chi_places"]), float(row["chi_times"])], rel=1e-2)
    (places, times), stored = real_swing.turns(run, p[3], found), turns_of(row["law"])
    assert stored["ball"] == pytest.approx(found[0] + 1)
    # A tenth of the error of reading: where a ball turns twice, the digits of a machine choose.
    assert (np.abs(stored["x_m"] - places) < 0.1 * found[4]).all()
    assert (np.abs(stored["t_s"] - times) < 0.1 * found[3]).all()


@cache
def swung(law, fitted):
    """The run of a law with the numbers that were fitted to another one, or to it."""
    (row,) = (row for row in SWINGS if row["law"] == fitted)
    return real_swing.swung(law, [float(row[key]) for key in real_swing.COLUMNS[1:6]], MEAN[1])


def turns_of(law):
    """Turning points of one fit, as stored, by column."""
    rows = read("cradle_turns.csv", law=law)
    return {name: np.array([float(x[name]) for x in rows]) for name in real_swing.TURNS[1:]}


def test_with_gaps_a_ratio_changes_nothing_in_half_a_minute():
    law = "constant restitution"
    pairs, ratio = (swung(x, law) for x in (law, law + ", ratio"))
    assert np.abs(pairs.positions - ratio.positions).max() < 1e-9
    assert read("cradle_turns.csv", law=law + ", ratio") == [
        {**x, "law": law + ", ratio"} for x in read("cradle_turns.csv", law=law)
    ]
