"""data/implied_ratio.csv: the ratio that springs imply, computed again by other means."""

from functools import cache

import implied_ratio
import numpy as np
import pytest
from stored import read

from cradle import post_impact_velocities
from cradle.closed_form import one_collision_each, three_balls


@cache
def table():
    return read("implied_ratio.csv")


def numbers(row, names):
    return np.array([float(row[name]) for name in names.split()])


def masses(row):
    return np.cumprod([1.0, *numbers(row, "m2_over_m1 m3_over_m2")])


def test_map_is_whole():
    rows = table()
    keys = {tuple(numbers(r, "exponent m2_over_m1 m3_over_m2 k2_over_k1")) for r in rows}
    assert len(keys) == len(rows) == 2 * 5 * 5 * 25
    for row in rows:
        assert bool(row["ratio"]) != bool(row["note"])
        bound = float(row["m3_over_m2"]) / (1 + float(row["m3_over_m2"]))
        assert float(row["bound"]) == pytest.approx(bound, abs=1e-9)
        # Elastic springs: each of these outcomes can be had from an admissible ratio.
        assert 0 <= float(row["ratio"]) <= bound * (1 + 1e-14)


def test_ratios_give_the_outcomes():
    """By the solver for all, by the closed form where it holds."""
    rows = table()
    m = np.array([masses(row) for row in rows])
    ratios = np.array([[float(row["ratio"])] for row in rows])
    after = np.array([numbers(row, "v1 v2 v3") for row in rows])
    solved = post_impact_velocities(m, [1, 0, 0], 1, ratios, excess="saturate")
    np.testing.assert_allclose(solved, after, rtol=0, atol=1e-6)
    once = one_collision_each(m, [1, 0, 0], [1, 1], ratios[:, 0])
    assert once.sum() > 400
    closed = three_balls(m[once], [1, 0, 0], [1, 1], ratios[once, 0])
    np.testing.assert_allclose(closed, after[once], rtol=0, atol=1e-6)


@pytest.mark.parametrize("number", [312, 937])
def test_script_makes_the_rows(number):
    row = table()[number]
    made = implied_ratio.row(*numbers(row, "exponent m2_over_m1 m3_over_m2 k2_over_k1"))
    assert list(row) == implied_ratio.COLUMNS
    np.testing.assert_allclose(
        [float(x) for x in made[:-1]],
        [float(row[name]) for name in implied_ratio.COLUMNS[:-1]],
        rtol=0,
        atol=2e-8,
    )
