"""The ratio that springs imply: three elastic balls at rest, the first struck; a map as a CSV.

Writes `data/implied_ratio.csv` in minutes.
Near the bound v2 and v3 vary like the square root of what is left to it: all digits count.
"""

import itertools

import numpy as np
from stored import make

from cradle import Chain, SpringChain, collide
from cradle.measures import effective_ratio

EXPONENTS = (1.0, 1.5)  # linear, Hertz
MASS_RATIOS = (0.1, 0.3, 1.0, 3.0, 10.0)
# Six digits, because the last one of a power depends on the C library.
STIFFNESS_RATIOS = tuple(float(f"{10.0 ** (k / 4):.6g}") for k in range(-12, 13))
COLUMNS = [
    "exponent", "m2_over_m1", "m3_over_m2", "k2_over_k1", "v1", "v2", "v3", "bound", "ratio", "note"
]  # fmt: skip


def row(exponent, m2_over_m1, m3_over_m2, k2_over_k1):
    masses = np.cumprod([1.0, m2_over_m1, m3_over_m2])
    model = SpringChain([1.0, k2_over_k1], exponent, accuracy=1e-11)
    trace, ratio, note = collide(Chain(masses, [1.0, 0.0, 0.0], 1.0), model), "", ""
    try:
        ratio = f"{effective_ratio(trace):.15g}"
    except ValueError as error:
        note = str(error).split("; ")[-1]
    numbers = [exponent, m2_over_m1, m3_over_m2, k2_over_k1]
    velocities = [f"{v:.10f}" for v in trace.velocities + 0.0]
    bound = m3_over_m2 / (1.0 + m3_over_m2)
    return [*(f"{x:.9g}" for x in numbers), *velocities, f"{bound:.9f}", ratio, note]


def implied_ratio():
    yield COLUMNS
    cases = itertools.product(EXPONENTS, MASS_RATIOS, MASS_RATIOS, STIFFNESS_RATIOS)
    yield from itertools.starmap(row, cases)


if __name__ == "__main__":
    make(__doc__, implied_ratio)
