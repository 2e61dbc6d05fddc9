"""How well can a ratio be fitted?  Synthetic shots of all 64 triplets; tables as CSV.

Writes `data/fit_precision.csv` and `data/fit_study.csv` in ten minutes.
The true values are those of Tables 1 and 2, three ratios taken at their bound.
"""

import numpy as np
from scipy.optimize import least_squares, minimize_scalar
from stored import make

from cradle import paper_chain, post_impact_velocities, ratio_table
from cradle.fit import ratio, read_shots
from cradle.fit.parameters import pair_keys

SPEEDS = (0.5, 1.0, 1.5, 2.0)
NOISES = (0.003, 0.01, 0.03)
REPEATS, DATASETS = 3, 25  # shots at each speed; experiments of each triplet and noise
SHOTS = 20  # of the experiment whose precision is worked out
GRID = 401
PRECISION = ["triplet", "ratio", "bound", "backward_acts", "sensitivity", "third_digit", "second",
             "second_excess", "trap_low", "trap_high", "trap_misfit", "detectable"]  # fmt: skip


def truth(triplet):
    """Return chain, ratio, reverse ratio and bound of a triplet; no ratio is above its bound."""
    chain, model = paper_chain(triplet, excess="saturate")
    left, middle, right = map(float, chain.masses)
    bound, back = right / (middle + right), left / (middle + left)
    return chain, min(model.forward[0], bound), min(model.backward[0], back), bound


def outcomes(chain, ratios, backward):
    """Return velocities after the impact at unit speed of the striker, for many ratios."""
    given = chain.masses, [1.0, 0.0, 0.0], chain.restitution, np.reshape(ratios, (-1, 1))
    return post_impact_velocities(*given, backward, excess="saturate")


def table(triplet, chain, after, noise, random):
    """Return the rows of an experiment as columns."""
    speed = np.repeat(SPEEDS, REPEATS)[:, None]
    shots, striking = len(speed), np.array([1, 0, 0])
    errors = noise * speed * random.standard_normal((shots, 4))
    columns = {
        "set": np.full((shots, 3), triplet),
        "shot": np.arange(shots)[:, None],
        "ball": [1, 2, 3],
        "type": list(triplet),
        "mass": chain.masses,
        "before": striking * (speed + errors[:, 3:]),
        "after": speed * after + errors[:, :3],
        "sigma": noise * speed,
        "sigma_before": striking * noise * speed,
    }
    return {name: np.broadcast_to(x, (shots, 3)).ravel() for name, x in columns.items()}


def wrong_minima(shots, chain, backward, bound, noise):
    """Return whether three common searches miss the lowest sum of squares."""
    ratios = bound * (1 - np.linspace(1, 0, 2001) ** 2)
    unit = outcomes(chain, ratios, backward)
    speed, after = shots.before[:, 0], shots.after

    def residuals(value):
        at = np.array([np.interp(value, ratios, one) for one in unit.T]).reshape(3)
        return ((after - speed[:, None] * at) / (noise * speed[:, None])).ravel()

    def squares(value):
        return float(residuals(value) @ residuals(value))

    lowest = min(squares(value) for value in ratios[::4])
    starts = bound * (np.arange(5) + 0.5) / 5
    ends = [least_squares(residuals, [s], bounds=([0], [bound])).fun for s in starts]
    sums = [float(end @ end) for end in ends]
    bounded = minimize_scalar(squares, bounds=(0, bound), method="bounded").fun
    return [value > lowest + 0.5 for value in (sums[2], bounded, min(sums))]


def study(triplet, noise):
    """Return one row: how often and how narrowly the confidence set holds the true ratio."""
    chain, true, backward, bound = truth(triplet)
    letters = sum(ord(letter) * 7**k for k, letter in enumerate(triplet))
    random = np.random.default_rng([letters, round(1e4 * noise)])
    after = outcomes(chain, [true], backward)[0]
    pairs = {"".join(key): e for key, e in zip(pair_keys(triplet), chain.restitution, strict=True)}
    reverse = triplet[::-1]
    tied = None if triplet == reverse else backward
    found, errors, wrong = [], [], np.zeros(3, int)
    for _ in range(DATASETS):
        shots = read_shots(table(triplet, chain, after, noise, random))
        measured = {
            name: (float(np.clip(e + 0.5 * noise * random.standard_normal(), 0, 1)), 0.5 * noise)
            for name, e in pairs.items()
        }
        known = None if tied is None else {reverse: backward}
        found.append(ratio(shots, measured, known=known)[triplet])
        if found[-1].value is not None:
            errors.append(found[-1].value - true)
        if noise == NOISES[1]:
            wrong += wrong_minima(shots.sets[0], chain, tied, bound, noise)
    sets = [one.intervals for one in found]
    covered = sum(any(low - 1e-9 <= true <= high + 1e-9 for low, high in one) for one in sets)
    width = np.median([sum(high - low for low, high in one) for one in sets])
    unknown, several = sum(not one.identified for one in found), sum(len(one) > 1 for one in sets)
    bias = f"{np.mean(errors):.5f}" if errors else ""
    counts = wrong if noise == NOISES[1] else [""] * 3
    return [triplet, noise, f"{true:.4f}", f"{bound:.4f}", DATASETS, covered, f"{width:.5f}", bias,
            unknown, several, *counts]  # fmt: skip


def distances(unit):
    """Squared distances of outcomes that a shot can see, the striker's speed profiled over."""
    difference = unit[:, None] - unit[None, :]
    along = (difference * unit[:, None]).sum(axis=-1)
    return (difference**2).sum(axis=-1) - along**2 / (1 + (unit**2).sum(axis=-1))[:, None]


def precision(triplet):
    """Return one row: what an experiment without luck can tell about the ratio of a triplet."""
    chain, true, backward, bound = truth(triplet)
    tied = backward if triplet != triplet[::-1] else None
    ratios = np.union1d(bound * (1 - np.linspace(1, 0, GRID) ** 2), [true])
    seen = distances(outcomes(chain, ratios, tied))
    # Where the distance is that of 20 shots with noise 1: the slope of outcomes per ratio.
    step = max(0.002, 0.01 * bound)
    ends = np.clip([true - step, true + step], 0, bound)
    off = distances(outcomes(chain, ends, tied))[0, 1]
    sensitivity = float(np.sqrt(off)) / float(ends[1] - ends[0])
    error = NOISES[1] / (sensitivity * np.sqrt(10))
    excess = SHOTS / NOISES[1] ** 2 * seen[:, int(np.searchsorted(ratios, true))]
    others = [k for k in minima(excess) if abs(ratios[k] - true) > 0.01]
    second = ["", ""]
    if others:
        k = min(others, key=lambda k: excess[k])
        second = [f"{ratios[k]:.4f}", f"{excess[k]:.4g}"]
    # True ratios for which the printed value is a minimum, but not the lowest.
    traps = [
        (other, np.sqrt(seen[k, j]))
        for j, other in enumerate(ratios)
        for k in minima(seen[:, j])
        if abs(other - true) > 0.02 and abs(ratios[k] - true) < 0.003
    ]
    trap = [""] * 3
    if traps:
        others, misfits = zip(*traps)
        trap = [f"{x:.4f}" for x in (min(others), max(others), min(misfits))]
    none = outcomes(chain, ratios, 0.0)
    acts = any(np.abs(outcomes(chain, ratios, b) - none).max() > 1e-9 for b in (0.1, 0.25, 0.5))
    return [triplet, f"{true:.4f}", f"{bound:.4f}", int(acts), f"{sensitivity:.4f}",
            f"{0.0005 / 1.96 * sensitivity * np.sqrt(SHOTS):.3g}", *second, *trap,
            f"{(1.960 + 0.842) * np.sqrt(2) * error:.4f}"]  # fmt: skip


def minima(values):
    """Return where the lowest of their neighbours are."""
    padded = np.concatenate([[np.inf], values, [np.inf]])
    return np.flatnonzero((padded[1:-1] < padded[:-2]) & (padded[1:-1] < padded[2:]))


def fit_precision():
    yield PRECISION
    yield from map(precision, ratio_table().triplet)


def fit_study():
    yield (
        "triplet noise ratio bound datasets covered width bias not_identified several_intervals "
        "wrong_least_squares wrong_bounded wrong_five_starts"
    )
    yield from (study(triplet, noise) for noise in NOISES for triplet in ratio_table().triplet)


if __name__ == "__main__":
    make(__doc__, fit_precision, fit_study)
