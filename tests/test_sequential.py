"""One collision after another, and one solid body: the two ends that the ratio bridges."""

import numpy as np
import pytest
from chains import magnitudes, uniform
from laws import keeps

from cradle import Chain, collide, outcomes
from cradle.closed_form import largest_ratios
from cradle.models.sequential import FusedChain, SequentialCollisions

ARRAYS = ("velocities", "impulses", "absorbed", "collisions", "path", "path_impulses")


def binary(masses, velocities, restitution, c):
    """Velocities and impulse of one collision of balls c and c + 1 alone."""
    m1, m2 = masses[c : c + 2]
    impulse = (1 + restitution[c]) * m1 * m2 / (m1 + m2) * (velocities[c] - velocities[c + 1])
    after = velocities.copy()
    after[c] -= impulse / m1
    after[c + 1] += impulse / m2
    return after, impulse


@pytest.mark.parametrize("order", ["left", "right"])
@pytest.mark.parametrize("n", range(2, 9))
def test_outcome_is_that_of_its_collisions_one_by_one(n, order):
    """In any order, each collision is one of two balls alone, and none is missing."""
    rng = np.random.default_rng(n)
    for _ in range(50):
        e = uniform(rng, 0.9, 1, n - 1)
        chain = Chain(magnitudes(rng, 2, n), uniform(rng, -1, 1, n), e)
        trace = collide(chain, SequentialCollisions(order))
        assert not trace.collapsed
        keeps(trace)
        v, impulses = chain.velocities.copy(), np.zeros(n - 1)
        for kind, c in trace.events:
            if kind == "end":
                assert v[c] - v[c + 1] > -1e-12
                v, impulse = binary(chain.masses, v, e, c)
                impulses[c] += impulse
        np.testing.assert_allclose(trace.velocities, v, rtol=0, atol=1e-12)
        np.testing.assert_allclose(trace.impulses, impulses, rtol=1e-11, atol=1e-15)
        assert (np.diff(v) > -1e-12).all()


@pytest.mark.parametrize(("order", "first"), [("left", 0), ("right", 1)])
def test_order_names_the_end_that_collides_first(order, first):
    trace = collide(Chain([1, 2, 1.5], [1, 0, -0.5], [1, 0.8]), SequentialCollisions(order))
    assert trace.events[0] == ("maximum_compression", first)


def test_right_is_the_mirror_image_of_left():
    rng = np.random.default_rng(1)
    for _ in range(50):
        n = int(rng.integers(2, 7))
        m, v, e = uniform(rng, 0.1, 10, n), uniform(rng, -1, 1, n), uniform(rng, 0.3, 1, n - 1)
        left = collide(Chain(m, v, e), SequentialCollisions("left"))
        right = collide(Chain(m[::-1], -v[::-1], e[::-1]), SequentialCollisions("right"))
        for name in ARRAYS:
            mirrored = getattr(right, name)[..., ::-1]
            if name in ("velocities", "path"):
                mirrored = -mirrored
            np.testing.assert_array_equal(getattr(left, name), mirrored)
        assert [(kind, n - 2 - c) for kind, c in right.events] == list(left.events)


@pytest.mark.parametrize("order", ["left", "right"])
def test_endless_sequences_reach_their_limit(order):
    trace = collide(Chain([1, 1, 1], [2, 1, 0], 0), SequentialCollisions(order))
    assert trace.collapsed
    np.testing.assert_allclose(trace.velocities, 1, rtol=1e-12)


@pytest.mark.parametrize("n", range(2, 7))
def test_fused_bodies_collide_like_two_balls(n):
    rng = np.random.default_rng(n)
    for struck in range(n - 1):
        m, e = magnitudes(rng, 4, n), uniform(rng, 0, 1, n - 1)
        v = np.where(np.arange(n) <= struck, 1.7, -0.4)
        chain = Chain(m, v, e)
        trace = collide(chain, FusedChain())
        bodies = [m[: struck + 1].sum(), m[struck + 1 :].sum()]
        after, impulse = binary(bodies, np.array([1.7, -0.4]), [e[struck]], 0)
        expected = np.where(np.arange(n) <= struck, *after)
        np.testing.assert_allclose(trace.velocities, expected, rtol=0, atol=2e-14)
        assert trace.impulses[struck] == pytest.approx(impulse, rel=1e-14)
        keeps(trace)
        assert trace.events[:2] == (("maximum_compression", struck), ("end", struck))
        assert trace.path[1].tolist() == pytest.approx(np.full(n, m @ v / m.sum()).tolist())


@pytest.mark.parametrize("struck", [0, 3, 6])
@pytest.mark.parametrize("decades", [1, 3, 6])
def test_largest_ratios_fuse_rows(decades, struck):
    """A bound near 1 keeps few digits of what it lacks to 1, and so does the next one from it."""
    n, count = 8, 50
    masses = magnitudes(np.random.default_rng(decades), decades, (count, n))
    forward, backward = np.zeros((2, count, n - 2))
    for k in range(n - 2):  # one bound after the other, from the far ends
        forward[:, -1 - k] = largest_ratios(masses, forward, backward)[0][:, -1 - k]
        backward[:, k] = largest_ratios(masses, forward, backward)[1][:, k]
    v = np.where(np.arange(n) <= struck, 1.0, 0.0)
    found = outcomes(masses, v, 0.5, forward, backward)
    assert found.margin.min() > 1e-9
    fused = [collide(Chain(m, v, 0.5), FusedChain()).velocities for m in masses]
    np.testing.assert_allclose(found.velocities, fused, rtol=0, atol=1e-14)


def test_fused_masses_whose_sum_overflows():
    trace = collide(Chain([1.5e308] * 3, [1e-3, 0, 0], 1), FusedChain())
    np.testing.assert_allclose(trace.velocities, np.array([-1, 2, 2]) / 3e3, rtol=1e-14)
