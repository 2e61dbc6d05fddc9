"""Random chains, shared by the tests."""

import numpy as np


def within_bounds(masses, part):
    """Forward and backward ratios as parts of their bounds, Eq. 53 and its mirror image.

    `masses` (..., N); `part(shape)` gives numbers in [0, 1].
    """

    def one_way(m):
        ratios = np.zeros((*m.shape[:-1], m.shape[-1] - 2))
        parts = part(ratios.shape)
        onward = np.zeros(m.shape[:-1])
        for i in reversed(range(m.shape[-1] - 2)):
            here, beyond = m[..., i + 1], m[..., i + 2]
            onward = parts[..., i] * np.minimum(beyond / (beyond + here * (1 - onward)), 1)
            ratios[..., i] = onward
        return ratios

    masses = np.asarray(masses, float)
    return one_way(masses), one_way(masses[..., ::-1])[..., ::-1]


def with_ends(rng, share=0.15):
    """Numbers in [0, 1], 0 and 1 among them."""

    def numbers(shape):
        kind = rng.random(shape)
        return np.where(kind < share, 0, np.where(kind > 1 - share, 1, rng.random(shape)))

    return numbers


def random_chains(rng, count, n, decades=6, speed=None):
    """Masses, velocities, restitution, forward, backward of `count` chains of `n` balls."""
    masses = 10 ** rng.uniform(-decades / 2, decades / 2, (count, n))
    velocities = rng.normal(size=(count, n)) if speed is None else speed(count, n)
    part = with_ends(rng)
    return masses, velocities, part((count, n - 1)), *within_bounds(masses, part)


def local_orders(events, contacts):
    """Events as each pair of neighbouring contacts sees them.

    Events of separate runs have no common clock: only the order among neighbours means anything.
    """
    events = [tuple(event) for event in events]
    return [[event for event in events if event[1] in (c, c + 1)] for c in range(contacts)]
