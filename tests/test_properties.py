"""What must hold for every chain: conservation, order, invariance, an end."""

import math
from decimal import Decimal

import numpy as np
import pytest
from chains import magnitudes, uniform, within_bounds
from extreme_chains import faults
from hypothesis import given, settings
from hypothesis import strategies as st
from truth import meaning

from cradle import Chain, ImpactNotFinished, ImpulseCorrelation, collide

unit = st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0, 1))
exponent = st.floats(-3, 3)
speed = st.one_of(st.sampled_from([0.0, 0.0, 1.0]), st.floats(-1, 1))


@st.composite
def impacts(draw):
    """Chain of 2 to 8 balls, masses over six decades, e in [0, 1], ratios up to their bounds."""
    n = draw(st.integers(2, 8))
    m = 10.0 ** np.array(draw(st.lists(exponent, min_size=n, max_size=n)))
    v = np.array(draw(st.lists(speed, min_size=n, max_size=n)))
    v[np.abs(v) < 1e-100] = 0.0  # scaled by powers of two below, these would be subnormal
    e = [x if x >= 1e-30 else 0.0 for x in draw(st.lists(unit, min_size=n - 1, max_size=n - 1))]
    parts = iter([*draw(st.lists(unit, min_size=2 * n, max_size=2 * n))])
    forward, backward = within_bounds(
        m, lambda shape: np.array([next(parts) for _ in range(shape[-1])])
    )
    return Chain(m, v, e), forward, backward, draw(unit)


def means_its_bits(x):
    return meaning(x) == Decimal(x)


def as_bits(numbers, power):
    """The next numbers that mean their bits, here and in other units: there .1 is no tenth."""
    found = []
    for x in numbers.tolist():
        while not (means_its_bits(x) and means_its_bits(math.ldexp(x, power))):
            x = math.nextafter(x, math.inf)
        found.append(x)
    return found


def outcome(chain, forward, backward, meeting, limit=20_000):
    """None where the impact is too long for a property: millions of impacts are legitimate."""
    # A bound computed from masses in other units may differ by an ulp: "raise" admits that.
    model = ImpulseCorrelation(forward, backward, meeting=meeting, max_events=limit)
    try:
        return collide(chain, model)
    except ImpactNotFinished:
        return None


@settings(max_examples=400)
@given(impacts())
def test_momentum_energy_order_and_ledger(impact):
    """In exact arithmetic, as far as rounding allows."""
    trace = outcome(*impact)
    assert trace is None or faults(trace) == []


#: Small powers of two, and those that bring velocities around 1e-135 or 1e135 m/s, masses around
#: 1e-90 or 1e90 kg.
powers = st.tuples(st.integers(-40, 40), st.integers(-40, 40)) | st.tuples(
    st.sampled_from([-450, 450]), st.sampled_from([-300, 300])
)


@settings(max_examples=200)
@given(impacts(), powers)
def test_units_that_are_powers_of_two_change_no_bit(impact, powers):
    (chain, *ratios), (speeds, masses) = impact, powers
    chain = Chain(
        as_bits(chain.masses, masses), as_bits(chain.velocities, speeds), chain.restitution
    )
    trace = outcome(chain, *ratios)
    m, v = np.ldexp(chain.masses, masses), np.ldexp(chain.velocities, speeds)
    try:
        chain = Chain(m, v, chain.restitution)
    except ValueError:  # the kinetic energy itself overflows
        assert 2 * speeds + masses > 900
        return
    scaled = outcome(chain, *ratios)
    if trace is None:
        assert scaled is None
        return
    assert scaled.velocities.tobytes() == np.ldexp(trace.velocities, speeds).tobytes()
    if abs(speeds) <= 40:  # beyond, impulses and works may underflow
        assert scaled.impulses.tobytes() == np.ldexp(trace.impulses, speeds + masses).tobytes()
        assert scaled.absorbed.tobytes() == np.ldexp(trace.absorbed, 2 * speeds + masses).tobytes()
    assert scaled.events == trace.events
    assert scaled.collapsed == trace.collapsed
    assert scaled.saturated == trace.saturated


def generic_chains(seed, count, striker=False):
    """Chains without ties and with few events, and how far each moves with 1e-13 of its inputs.

    Boosts, other units and mirrors round differently: that far, and no farther, outcomes may part.
    """
    rng = np.random.default_rng(seed)
    for _ in range(count):
        n = int(rng.integers(2, 9))
        m = magnitudes(rng, 6, n)
        v = np.eye(n)[0] if striker else uniform(rng, -1, 1, n)
        e = uniform(rng, 0.02, 0.98, n - 1)
        f, b = within_bounds(m, lambda shape: uniform(rng, 0.02, 0.98, shape))
        meeting = rng.choice([0.5, rng.random()])
        trace = outcome(Chain(m, v, e), f, b, meeting, limit=100)
        if trace is None or trace.collapsed:
            continue
        # The condition of the chain.
        moved = 0.0
        for _ in range(4):
            nudge = [part * (1 + 1e-13 * uniform(rng, -1, 1, np.shape(part))) for part in (m, v, e)]
            near = outcome(Chain(*nudge), f, b, meeting)
            same = near is not None and near.events == trace.events
            moved = max(moved, np.abs(near.velocities - trace.velocities).max() if same else np.inf)
        if moved < 1e-9:
            yield trace, (m, v, e, f, b, meeting), 1e-13 + moved


@pytest.mark.parametrize(
    ("mass", "speed", "boost"), [(1, 1, 0.375), (1000, 3.6, 0)], ids=["boost", "units"]
)
def test_frames_and_units(mass, speed, boost):
    checked = 0
    for trace, (m, v, e, f, b, meeting), tolerance in generic_chains(1 + (mass > 1), 500):
        other = outcome(Chain(mass * m, speed * v + boost, e), f, b, meeting)
        after = (other.velocities - boost) / speed
        np.testing.assert_allclose(after, trace.velocities, rtol=0, atol=tolerance)
        assert other.events == trace.events
        checked += 1
    assert checked > 300


def test_mirror_of_a_single_striker():
    """Balls reversed, velocities negated, directions exchanged, meeting -> 1 - meeting."""
    checked = met = 0
    for trace, (m, v, e, f, b, meeting), tolerance in generic_chains(3, 500, striker=True):
        mirror = outcome(Chain(m[::-1], -v[::-1], e[::-1]), b[::-1], f[::-1], 1 - meeting)
        seen = -mirror.velocities[::-1]
        np.testing.assert_allclose(seen, trace.velocities, rtol=0, atol=tolerance)
        assert mirror.collisions[::-1].tolist() == trace.collisions.tolist()
        checked += 1
        met += any(
            np.abs(row[c] - row[c + 1]) < 1e-13 and 0 < c < len(m) - 2
            for row, (kind, c) in zip(trace.path[1:], trace.events)
            if kind == "close"
        )
    assert checked > 200
    assert met > 50
