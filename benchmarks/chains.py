"""Chains that several tests use: given ones with their outcomes, and random ones."""

import math

import numpy as np

from cradle import Chain

# Elastic chains, struck with speed 1, on equal springs: converged velocities from another program.
ELASTIC = {"three equal": [1, 1, 1], "five equal": [1] * 5, "light middle": [1, 0.01, 1]}
HERTZ = {
    "three equal": [-0.070952354, 0.076403039, 0.994549315],
    "five equal": [-0.071085017, -0.030273764, -0.014463629, 0.127044986, 0.988777424],
    "light middle": [-0.003175725, 0.396855171, 0.999207173],
}
LINEAR = {"three equal": [-0.130261695, 0.150229569, 0.980032126]}
# Masses, exponent, velocities.
SPRINGS = [
    (ELASTIC[name], exponent, velocities)
    for exponent, table in ((1.5, HERTZ), (1, LINEAR))
    for name, velocities in table.items()
]

# Which contacts end and close under the paper's Fig. 8.
FIG_8 = [
    *(("end", 0), ("close", 0), ("end", 1), ("close", 1)),
    *(("end", 2), ("end", 0), ("end", 1)),
]


def striking(masses=(1, 1, 1), e=1.0, speed=1.0):
    """The first ball strikes the others at rest."""
    return Chain(masses, [speed] + [0] * (len(masses) - 1), e)


# Random numbers are made of operations that round alike everywhere: products, sums, powers of two.
# `10 ** x` rounds as the processor's vector unit or the C library does, and `Generator.uniform` and
# `normal` hold a product and a sum that some compilers join into one rounding.


def uniform(rng, low, high, size=None):
    """Numbers between two ends."""
    return low + (high - low) * rng.random(size)


def magnitudes(rng, decades, size=None):
    """Numbers around 1 over about so many decades: as many in every factor of two."""
    most = max(round(decades / 2 * math.log2(10)), 1)
    return np.ldexp(1 + rng.random(size), rng.integers(-most, most, size, dtype=np.int32))


def power_of_ten(quarters):
    """10 ** (quarters / 4)."""
    whole, rest = divmod(quarters, 4)
    root = math.sqrt(math.sqrt(10))
    return float(f"1e{whole}") * (1, root, math.sqrt(10), root * math.sqrt(10))[rest]


def one_way(masses, parts):
    """Forward ratios as parts of their bounds, Eq. 53."""
    ratios, onward = np.zeros(parts.shape), 0.0
    for i in reversed(range(parts.shape[-1])):
        here, beyond = masses[..., i + 1], masses[..., i + 2]
        onward = parts[..., i] * np.minimum(beyond / (beyond + here * (1 - onward)), 1)
        ratios[..., i] = onward
    return ratios


def within_bounds(masses, part):
    """Forward and backward ratios as parts of their bounds, Eq. 53 and its mirror image.

    `masses` (..., N); `part(shape)` gives numbers in [0, 1].
    """
    masses = np.asarray(masses, float)
    shape = (*masses.shape[:-1], masses.shape[-1] - 2)
    return one_way(masses, part(shape)), one_way(masses[..., ::-1], part(shape))[..., ::-1]


def with_ends(rng, share=0.15):
    """Numbers in [0, 1], 0 and 1 among them."""

    def numbers(shape):
        kind = rng.random(shape)
        return np.where(kind < share, 0, np.where(kind > 1 - share, 1, rng.random(shape)))

    return numbers


def random_chains(rng, count, n, decades=6, speed=None):
    """Masses, velocities, restitution, forward, backward of `count` chains of `n` balls."""
    masses = magnitudes(rng, decades, (count, n))
    velocities = uniform(rng, -1, 1, (count, n)) if speed is None else speed(count, n)
    part = with_ends(rng)
    return masses, velocities, part((count, n - 1)), *within_bounds(masses, part)


def changes(events):
    """Events that change which contacts are active."""
    return [tuple(event) for event in events if event[0] != "maximum_compression"]


def local_orders(events, contacts):
    """Events as each pair of neighbouring contacts sees them.

    Events of separate runs have no common clock: only the order among neighbours means anything.
    """
    events = [tuple(event) for event in events]
    return [[event for event in events if event[1] in (c, c + 1)] for c in range(contacts)]
