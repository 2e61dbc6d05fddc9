"""How well can a ratio be fitted?  Synthetic shots of all 64 triplets; tables as CSV.

Usage::

    python benchmarks/fit_study.py              # writes data/fit_study.csv and
                                                # data/fit_precision.csv, minutes

Nothing here was measured.  The true values are those of Tables 1 and 2 (three ratios above their
bound are taken at it); the balls have the paper's masses, the first strikes at .5, 1, 1.5 and
2 m/s, and every velocity is off by a random amount, `noise` times the striker's speed.
"""

import numpy as np
from scipy.optimize import least_squares, minimize_scalar
from stored import options, write

from cradle import paper_chain, post_impact_velocities, ratio_table
from cradle.fit import ratio, read_shots
from cradle.fit.parameters import pair_keys

SPEEDS = (0.5, 1.0, 1.5, 2.0)
NOISES = (0.003, 0.01, 0.03)
REPEATS, DATASETS = 3, 25  # shots at each speed; experiments of each triplet and noise
SHOTS = 20  # of the experiment whose precision is worked out
GRID = 401
STUDY = ["triplet", "noise", "ratio", "bound", "datasets", "covered", "width", "bias",
         "not_identified", "several_intervals", "wrong_least_squares", "wrong_bounded",
         "wrong_five_starts"]  # fmt: skip
PRECISION = ["triplet", "ratio", "bound", "backward_acts", "sensitivity", "third_digit", "second",
             "second_excess", "trap_low", "trap_high", "trap_misfit", "detectable"]  # fmt: skip


def truth(triplet):
    """Return chain, ratio, reverse ratio and bound of a triplet; no ratio is above its bound."""
    chain, model = paper_chain(triplet, excess="saturate")
    left, middle, right = chain.masses
    bound = float(right / (middle + right))
    return (chain, min(model.forward[0], bound),
            min(model.backward[0], float(left / (middle + left))), bound)  # fmt: skip


def outcomes(chain, ratios, backward, restitution=None):
    """Return velocities after the impact at unit speed of the striker, for many ratios."""
    e = chain.restitution if restitution is None else restitution
    before = [1.0, 0.0, 0.0]
    return post_impact_velocities(
        chain.masses, before, e, np.asarray(ratios)[:, None], backward, excess="saturate"
    )


def table(triplet, chain, after, noise, random):
    """Return the rows of an experiment as columns."""
    columns = {name: [] for name in ("set", "shot", "ball", "type", "mass", "before", "after",
                                     "sigma", "sigma_before")}  # fmt: skip
    for shot, speed in enumerate(np.repeat(SPEEDS, REPEATS)):
        errors = noise * speed * random.standard_normal(4)
        for ball in range(3):
            moving = ball == 0
            row = (triplet, shot, ball + 1, triplet[ball], chain.masses[ball],
                   speed + errors[3] if moving else 0.0, speed * after[ball] + errors[ball],
                   noise * speed, noise * speed if moving else 0.0)  # fmt: skip
            for name, value in zip(columns, row, strict=True):
                columns[name].append(value)
    return columns


def wrong_minima(shots, chain, backward, bound, noise):
    """Return whether three common searches miss the lowest sum of squares."""
    ratios = bound * (1 - np.linspace(1, 0, 2001) ** 2)
    unit = outcomes(chain, ratios, backward)
    speed, after = shots.before[:, 0], shots.after

    def residuals(value):
        at = np.array([np.interp(value, ratios, unit[:, k]) for k in range(3)]).reshape(3)
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
    known = None if triplet == triplet[::-1] else {triplet[::-1]: backward}
    covered, widths, errors, unknown, several, wrong = 0, [], [], 0, 0, np.zeros(3)
    for _ in range(DATASETS):
        shots = read_shots(table(triplet, chain, after, noise, random))
        measured = {
            name: (float(np.clip(e + 0.5 * noise * random.standard_normal(), 0, 1)), 0.5 * noise)
            for name, e in pairs.items()
        }
        found = ratio(shots, measured, known=known)[triplet]
        covered += any(low - 1e-9 <= true <= high + 1e-9 for low, high in found.intervals)
        widths.append(sum(high - low for low, high in found.intervals))
        unknown += not found.identified
        several += len(found.intervals) > 1
        if found.value is not None:
            errors.append(found.value - true)
        if noise == NOISES[1]:
            tied = backward if known else None
            wrong += wrong_minima(shots.sets[0], chain, tied, bound, noise)
    counts = [f"{w:.0f}" if noise == NOISES[1] else "" for w in wrong]
    return [triplet, noise, f"{true:.4f}", f"{bound:.4f}", DATASETS, covered,
            f"{np.median(widths):.5f}", f"{np.mean(errors):.5f}" if errors else "", unknown,
            several, *counts]  # fmt: skip


def distances(unit):
    """Return the squared distance of outcomes i from outcome j that a shot can see.

    The striker's speed is measured with the same error as the others, and profiled over.
    """
    difference = unit[:, None] - unit[None, :]
    along = (difference * unit[:, None]).sum(axis=-1)
    return (difference**2).sum(axis=-1) - along**2 / (1 + (unit**2).sum(axis=-1))[:, None]


def precision(triplet):
    """Return one row: what an experiment without luck can tell about the ratio of a triplet."""
    chain, true, backward, bound = truth(triplet)
    tied = backward if triplet != triplet[::-1] else None
    ratios = np.union1d(bound * (1 - np.linspace(1, 0, GRID) ** 2), [true])
    unit = outcomes(chain, ratios, tied)
    seen = distances(unit)
    at = int(np.searchsorted(ratios, true))
    # Where the distance is that of 20 shots with noise 1: the slope of outcomes per ratio.
    step = max(0.002, 0.01 * bound)
    ends = np.clip([true - step, true + step], 0, bound)
    near = outcomes(chain, ends, tied)
    sensitivity = float(np.sqrt(distances(near)[0, 1])) / float(ends[1] - ends[0])
    excess = SHOTS / NOISES[1] ** 2 * seen[:, at]
    others = [k for k in _minima(excess) if abs(ratios[k] - true) > 0.01]
    second = min(others, key=lambda k: excess[k], default=None)
    # True ratios for which the printed value is a minimum, but not the lowest.
    traps, misfits = [], []
    for j, other in enumerate(ratios):
        for k in _minima(seen[:, j]):
            if abs(other - true) > 0.02 and abs(ratios[k] - true) < 0.003:
                traps.append(other)
                misfits.append(np.sqrt(seen[k, j]))
    acts = any(
        (np.abs(outcomes(chain, ratios, b) - outcomes(chain, ratios, 0.0)) > 1e-9).any()
        for b in (0.1, 0.25, 0.5)
    )
    error = NOISES[1] / (sensitivity * np.sqrt(10))
    return [triplet, f"{true:.4f}", f"{bound:.4f}", int(acts), f"{sensitivity:.4f}",
            f"{0.0005 / 1.96 * sensitivity * np.sqrt(SHOTS):.3g}",
            "" if second is None else f"{ratios[second]:.4f}",
            "" if second is None else f"{excess[second]:.4g}",
            *(f"{x:.4f}" if traps else ""
              for x in (min(traps, default=0), max(traps, default=0), min(misfits, default=0))),
            f"{(1.960 + 0.842) * np.sqrt(2) * error:.4f}"]  # fmt: skip


def _minima(values):
    padded = np.concatenate([[np.inf], values, [np.inf]])
    return np.flatnonzero((padded[1:-1] < padded[:-2]) & (padded[1:-1] < padded[2:]))


def main(arguments=None):
    """Write the tables."""
    folder = options(__doc__).parse_args(arguments).output
    triplets = list(ratio_table().triplet)
    write("fit_precision.csv", PRECISION, map(precision, triplets), folder)
    rows = (study(triplet, noise) for noise in NOISES for triplet in triplets)
    write("fit_study.csv", STUDY, rows, folder)


if __name__ == "__main__":
    main()
