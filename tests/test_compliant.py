"""Chains of springs: closed forms, converged values, conservation laws, invariances, events."""

import dataclasses
import math
import re
import subprocess
import sys

import numpy as np
import pytest
from chains import HERTZ, SPRINGS, striking
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.special import gamma

from cradle import Chain, ImpactNotFinished, Trace, collide
from cradle.models.compliant import SpringChain, TimedTrace

KINDS = ("maximum_compression", "end", "close")


# --- outcomes ------------------------------------------------------------------------------


@pytest.mark.parametrize(("masses", "exponent", "velocities"), SPRINGS)
@pytest.mark.parametrize("rtol", [1e-9, 1e-12])
def test_converged_values(masses, exponent, velocities, rtol):
    """Rounded to nine decimals, so the last of them is all that may differ once converged."""
    trace = collide(striking(masses), SpringChain(1.0, exponent, rtol=rtol))
    atol = 1e-8 if rtol == 1e-9 else 6e-10
    np.testing.assert_allclose(trace.velocities, velocities, rtol=0, atol=atol)


@pytest.mark.parametrize("ratio", [0.2, 1.0, 4.0])
def test_three_linear_balls_follow_equations_7_to_11(ratio):
    """Equal balls, springs k and ratio k: two harmonics while both contacts are closed."""
    k = np.array([2.0, 2.0 * ratio])
    trace = collide(striking(), SpringChain(k, 1, rtol=1e-11))
    rows = [event.kind for event in trace.events].index("end") + 2
    assert rows > 2
    # Displacements q: q'' = -K q. The eigenvalues of K are those of Eqs. 7-9, and zero; the initial
    # velocity (1, 0, 0) is 1/3 for all plus its parts along the other two eigenvectors.
    matrix = np.array([[k[0], -k[0], 0], [-k[0], k.sum(), -k[1]], [0, -k[1], k[1]]])
    root = math.sqrt(1 - ratio + ratio**2)
    values = np.array([1 + ratio - root, 1 + ratio + root])
    vectors = np.array([np.ones(2), 1 - values, values - 2])
    omega = np.sqrt(k[0] * values)
    np.testing.assert_allclose(matrix @ vectors, vectors * omega**2, rtol=0, atol=1e-13)
    parts = vectors * vectors[0] / (vectors**2).sum(axis=0)
    phase = np.outer(trace.times[:rows], omega)
    velocities = 1 / 3 + np.cos(phase) @ parts.T
    np.testing.assert_allclose(trace.path[:rows], velocities, rtol=0, atol=1e-10)
    closer = parts[:-1] - parts[1:]
    forces = k * (np.sin(phase) @ (closer / omega).T)
    np.testing.assert_allclose(trace.forces[:rows], forces, rtol=0, atol=1e-10)
    # Eqs. 10 and 11, with the sign that makes a push positive.
    impulses = k * ((1 - np.cos(phase)) @ (closer / omega**2).T)
    np.testing.assert_allclose(trace.path_impulses[:rows], impulses, rtol=0, atol=1e-10)


@pytest.mark.parametrize("exponent", [1, 1.2, 1.5, 2, 3])
def test_two_balls(exponent):
    """Relative velocity reversed; peak force and duration from the energy of the spring."""
    m1, m2, k, speed = 2.0, 3.0, 50.0, 0.7
    chain = Chain([m1, m2], [1 + speed, 1], 1)
    trace = collide(chain, SpringChain(k, exponent, rtol=1e-12))
    mu = m1 * m2 / (m1 + m2)
    closing = trace.velocities[0] - trace.velocities[1]
    assert closing == pytest.approx(-speed, rel=1e-11)
    assert chain.masses @ trace.velocities == pytest.approx(chain.momentum, rel=1e-14)
    assert trace.impulses[0] == pytest.approx(2 * mu * speed, rel=1e-11)
    assert trace.absorbed[0] == pytest.approx(mu * speed**2 / 2, rel=1e-9)
    assert trace.events == (("maximum_compression", 0), ("end", 0))
    # Energy: mu u^2 / 2 + k d^(p+1) / (p+1) = mu U^2 / 2, so the largest compression is
    deepest = ((exponent + 1) * mu * speed**2 / (2 * k)) ** (1 / (exponent + 1))
    assert trace.forces[1, 0] == pytest.approx(k * deepest**exponent, rel=1e-9)
    # and the time is twice the integral of dd / u with u = U sqrt(1 - (d / deepest)^(p+1)): a beta
    # function. For p = 3/2 the factor is Hertz's 2.943, for p = 1 it is pi.
    factor = (
        2 * math.sqrt(math.pi) * gamma(1 + 1 / (exponent + 1)) / gamma(0.5 + 1 / (exponent + 1))
    )
    if exponent == 1.5:
        assert round(factor, 3) == 2.943
    if exponent == 1:
        assert factor * deepest / speed == pytest.approx(math.pi * math.sqrt(mu / k), rel=1e-14)
    assert trace.durations[0] == pytest.approx(factor * deepest / speed, rel=1e-10)
    assert trace.times[-1] == pytest.approx(trace.durations[0], rel=1e-14)
    assert trace.times[1] == pytest.approx(trace.durations[0] / 2, rel=1e-8)


@pytest.mark.parametrize("exponent", [1, 1.5])
def test_error_falls_with_rtol(exponent):
    chain = striking([1, 0.3, 1, 2])
    exact = collide(chain, SpringChain([1, 2, 3], exponent, rtol=1e-13)).velocities

    def error(rtol):
        after = collide(chain, SpringChain([1, 2, 3], exponent, rtol=rtol)).velocities
        return abs(after - exact).max()

    errors = [error(rtol) for rtol in (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)]
    assert all(finer < coarser / 5 for coarser, finer in zip(errors, errors[1:]))
    assert errors[-1] < 1e-10


@pytest.mark.parametrize("method", ["RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA"])
def test_every_method(method):
    trace = collide(striking(), SpringChain(1.0, rtol=1e-6, method=method))
    np.testing.assert_allclose(trace.velocities, HERTZ["three equal"], rtol=0, atol=1e-4)
    assert trace.evaluations > 50


def test_stiff_second_spring_makes_one_body():
    """Eq. 5 is the limit of a second spring much stiffer than the first."""
    fused = np.array([-1, 2, 2]) / 3
    distances = [
        abs(collide(striking(), SpringChain([1, g], 1)).velocities - fused).max()
        for g in (1e2, 1e4, 1e6)
    ]
    assert distances[0] > 5 * distances[1] > 25 * distances[2]


# --- laws that every outcome keeps ---------------------------------------------------------


@st.composite
def chains(draw):
    """Chain, stiffnesses, exponent: two to five balls, some of them touching at rest."""
    n = draw(st.integers(2, 5))
    part = st.floats(-1, 1)
    masses = [10.0 ** draw(part) for _ in range(n)]
    velocities = [
        draw(st.sampled_from([0.0, 1.0, -1.0]) | st.floats(-1, 1).map(lambda v: round(v, 3)))
        for _ in range(n)
    ]
    stiffness = [10.0 ** draw(part) for _ in range(n - 1)]
    return Chain(masses, velocities, 1), stiffness, draw(st.sampled_from([1, 1.5, 2.5]))


@given(chains())
def test_laws(case):
    chain, stiffness, exponent = case
    m, v = chain.masses, chain.velocities
    trace = collide(chain, SpringChain(stiffness, exponent, rtol=1e-8))
    scale = max(chain.closing_speeds.max(), 0)
    after = trace.velocities
    # Momentum, ball by ball and in all; energy; order.
    passed = np.concatenate([[0], trace.impulses, [0]])
    np.testing.assert_allclose(
        m * (after - v), passed[:-1] - passed[1:], rtol=0, atol=1e-12 * scale * m.sum()
    )
    available = 0.5 * m @ (v - chain.momentum / m.sum()) ** 2
    assert 0.5 * m @ after**2 == pytest.approx(
        chain.kinetic_energy, abs=1e-5 * available + 1e-15 * chain.kinetic_energy
    )
    assert (np.diff(after) >= -1e-15).all()
    # The record: the path ends at the outcome, time goes on, every collision ends.
    np.testing.assert_array_equal(trace.path[0], v)
    np.testing.assert_array_equal(trace.path[-1], after)
    np.testing.assert_array_equal(trace.path_impulses[-1], trace.impulses)
    assert (np.diff(trace.times) >= 0).all()
    assert (trace.forces >= 0).all()
    assert (trace.step_forces >= 0).all()
    assert (trace.durations <= trace.times[-1] * (1 + 1e-12)).all()
    assert trace.step_times.shape == trace.step_forces.shape[:1]
    ends = [sum(event == ("end", c) for event in trace.events) for c in range(len(chain) - 1)]
    assert ends == trace.collisions.tolist()
    assert {event.kind for event in trace.events} <= set(KINDS)
    assert ((trace.impulses > 0) == (trace.collisions > 0)).all()
    assert trace.energy_loss == 0
    assert not trace.collapsed


@given(chains(), st.integers(-9, 9), st.integers(-9, 9), st.integers(-5, 5))
def test_units_change_nothing_else(case, mass, speed, length):
    """Powers of two (of four, for the length) as units change no digit; stiffness has N/m^p."""
    chain, stiffness, exponent = case
    mass, speed, length = 2.0**mass, 2.0**speed, 4.0**length
    second, newton = length / speed, mass * speed**2 / length
    trace = collide(chain, SpringChain(stiffness, exponent, rtol=1e-8))
    other = collide(
        Chain(mass * chain.masses, speed * chain.velocities, 1),
        SpringChain(np.array(stiffness) * newton / length**exponent, exponent, rtol=1e-8),
    )
    for name, unit in (
        ("velocities", speed),
        ("impulses", mass * speed),
        ("absorbed", mass * speed**2),
    ):
        np.testing.assert_array_equal(getattr(other, name) / unit, getattr(trace, name))
    # A second has a root of order p + 1, which rounds.
    for name, unit in (("times", second), ("durations", second), ("forces", newton)):
        np.testing.assert_allclose(getattr(other, name) / unit, getattr(trace, name), rtol=1e-13)


@given(chains(), st.integers(-8, 8))
def test_a_common_velocity_changes_nothing_else(case, boost):
    chain, stiffness, exponent = case
    # Powers of two: the sums are exact, so the closing speeds are the same to the last bit.
    velocities = np.round(chain.velocities * 1024) / 1024
    model = SpringChain(stiffness, exponent, rtol=1e-8)
    still = collide(Chain(chain.masses, velocities, 1), model)
    moving = collide(Chain(chain.masses, velocities + boost, 1), model)
    np.testing.assert_array_equal(moving.impulses, still.impulses)
    np.testing.assert_allclose(moving.velocities - boost, still.velocities, rtol=0, atol=1e-14)


# At rtol = 1e-9 this outcome has an error of 1e-8.
HARD = (
    Chain([5.424690937011326, 1, 10**-0.5, 1, 10**0.75], [1, 0, 0, 1, 0], 1),
    [1, 10, 10, 10**0.25],
    2.5,
)


@given(chains())
@example(HARD)
def test_mirror(case):
    chain, stiffness, exponent = case
    trace = collide(chain, SpringChain(stiffness, exponent, rtol=1e-10))
    mirrored = collide(
        Chain(chain.masses[::-1], 0 - chain.velocities[::-1], 1),
        SpringChain(stiffness[::-1], exponent, rtol=1e-10),
    )
    np.testing.assert_allclose(-mirrored.velocities[::-1], trace.velocities, rtol=0, atol=1e-8)
    np.testing.assert_allclose(mirrored.impulses[::-1], trace.impulses, rtol=0, atol=1e-7)


# --- events --------------------------------------------------------------------------------


def test_events_of_three_hertz_balls():
    trace = collide(striking(), SpringChain(1.0))
    assert trace.events == (
        ("maximum_compression", 0),
        ("maximum_compression", 1),
        ("end", 0),
        ("end", 1),
    )
    assert trace.collisions.tolist() == [1, 1]
    # At a maximum compression the two balls have one velocity, and their force is at its largest.
    for row, (kind, c) in enumerate(trace.events, start=1):
        if kind == "maximum_compression":
            assert trace.path[row, c] == pytest.approx(trace.path[row, c + 1], abs=1e-12)
            assert trace.step_forces[:, c].max() <= trace.forces[row, c] * (1 + 1e-9)
        else:
            assert trace.forces[row, c] == 0


def test_forces_integrate_to_impulses():
    trace = collide(striking([1, 2, 1, 3]), SpringChain([1, 2, 3], rtol=1e-11))
    impulses = np.trapezoid(trace.step_forces, trace.step_times, axis=0)
    np.testing.assert_allclose(impulses, trace.impulses, rtol=0.01)


def test_a_contact_closes_again():
    """A light ball between heavy ones loses touch and comes back; gaps count from delta = 0."""
    trace = collide(Chain([1, 0.2, 3], [1, 0, -1], 1), SpringChain(1.0))
    kinds = [event.kind for event in trace.events if event.contact == 0]
    assert kinds.count("close") == trace.collisions[0] - 1
    open_ball = Chain([1, 1, 1], [1, 0, 0.5], 1)
    second = collide(open_ball, SpringChain(1.0))
    assert ("close", 1) in second.events
    assert second.collisions.tolist() == [1, 1]
    # The gap of balls 2 and 3 closes only after ball 2 has been faster than ball 3 for a while.
    closing = second.events.index(("close", 1)) + 1
    assert second.path[closing, 1] > 0.5


def test_balls_that_part_far_meet_after_an_exact_flight():
    """Two collisions one after the other, no ball touching two: the elastic pairs of Johnson."""
    chain = Chain([1, 1, 1], [1, 0, 0.999], 1)
    trace = collide(chain, SpringChain(1.0, rtol=1e-12))
    np.testing.assert_allclose(trace.velocities, [0, 0.999, 1], rtol=0, atol=1e-9)
    first_end = trace.events.index(("end", 0))
    assert trace.events[first_end + 1] == ("close", 1)
    gap = 0.999 * trace.times[first_end + 1] - trace.path_impulses[first_end + 1, 0]
    assert trace.times[first_end + 2] > trace.times[first_end + 1] + 100
    assert gap > 0


@pytest.mark.parametrize(
    ("masses", "velocities", "stiffness", "exponent", "collisions"),
    [
        ([5.0, 0.4, 3.2], [0.3, 1.3, -0.8], [0.126, 0.05], 2, [3, 1]),
        ([0.4, 0.16, 0.2], [1.2, -0.8, 0.1], [39.8, 0.0316], 1, [2, 1]),
    ],
)
def test_contact_shorter_than_a_step(masses, velocities, stiffness, exponent, collisions):
    """A loose tolerance takes steps longer than a contact: the contact is found all the same."""
    chain = Chain(masses, velocities, 1)
    exact = collide(chain, SpringChain(stiffness, exponent, rtol=1e-11))
    loose = collide(chain, SpringChain(stiffness, exponent, rtol=1e-3))
    assert exact.collisions.tolist() == loose.collisions.tolist() == collisions
    np.testing.assert_allclose(loose.velocities, exact.velocities, rtol=0, atol=5e-3)


@pytest.mark.parametrize("exponent", [1, 1.5])
def test_no_contact_opens_ahead_of_the_wave(exponent):
    """Compressions there are smaller than the errors of the integration."""
    n = 30
    trace = collide(striking([1] * n), SpringChain(1.0, exponent))
    assert trace.collisions.tolist() == [1] * (n - 1)
    first = [trace.events.index(("maximum_compression", c)) for c in range(n - 1)]
    assert first == sorted(first)


def test_absorbed_is_the_energy_at_the_extremes():
    """A light ball swings between heavy ones that stay in touch: many maxima, one collision."""
    trace = collide(striking([1, 0.01, 1]), SpringChain(1.0, 1, rtol=1e-11))
    assert trace.collisions.tolist() == [1, 1]
    # Between two maxima of a contact is a minimum; every one of them is a turn of the closing
    # speed, so the work absorbed is the integral of the power over the time of compression.
    fine = collide(striking([1, 0.01, 1]), SpringChain(1.0, 1, rtol=1e-13, method="RK45"))
    d = fine.step_forces  # k = 1, p = 1: the force is the compression
    energy = d**2 / 2
    rises = np.clip(np.diff(energy, axis=0), 0, None).sum(axis=0)
    np.testing.assert_allclose(trace.absorbed, rises, rtol=1e-5)
    maxima = [e.contact for e in trace.events if e.kind == "maximum_compression"]
    assert len(maxima) > 4


def test_balls_that_do_not_approach():
    trace = collide(Chain([1, 2, 3], [-1, 0, 0], 1), SpringChain(1.0))
    assert trace.velocities.tolist() == [-1, 0, 0]
    assert trace.path.tolist() == [[-1, 0, 0]]
    assert trace.times.tolist() == [0]
    assert not trace.events
    assert not trace.durations.any()
    assert trace.evaluations == 0


def test_balls_beyond_the_impact_keep_their_velocities():
    chain = Chain([1, 1, 1, 1, 1], [0.7, 0.1, 1.1, 1.1, 1.1], 1)
    trace = collide(chain, SpringChain(1.0))
    assert trace.velocities[2:].tolist() == [1.1, 1.1, 1.1]
    assert trace.collisions.tolist() == [1, 0, 0, 0]


# --- giving up -----------------------------------------------------------------------------


def test_max_time_shows_what_was_reached():
    model = SpringChain(1.0, 1, max_time=1.0)
    with pytest.raises(
        ImpactNotFinished, match=r"not finished after 1 s and 0 events: max_time"
    ) as e:
        collide(striking([1, 1]), model)
    # A linear contact of mu = 1/2: u = cos(omega t), omega = sqrt(2).
    v1, v2 = e.value.trace.velocities
    assert v1 - v2 == pytest.approx(math.cos(math.sqrt(2)), abs=1e-8)
    assert e.value.trace.impulses[0] == pytest.approx(v2, abs=1e-12)


@pytest.mark.parametrize("method", ["DOP853", "LSODA"])
def test_max_evaluations_bounds_the_work(method):
    model = SpringChain(1.0, max_evaluations=100, method=method)
    with pytest.raises(ImpactNotFinished, match="max_evaluations = 100 reached") as stopped:
        collide(striking([1, 1e-12, 1]), model)
    assert stopped.value.trace.evaluations == 100


def test_an_impact_that_is_given_up_says_how_far_it_came_and_what_would_help():
    chain = Chain([1, 1, 1e-9, 1], [1, 0, 0, 0], 1)
    with pytest.raises(ImpactNotFinished) as stopped:
        collide(chain, SpringChain(max_evaluations=1000))
    message = stopped.value.args[0]
    time = float(re.search(r"after (\S+) s and", message)[1])
    assert time > 0
    assert "reached; ball 2 on contact 1, the quickest of the springs, makes the steps" in message
    assert "SequentialCollisions and ImpulseCorrelation (with a ratio) take no steps" in message


# --- input ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stiffness": 0}, "stiffness = 0.0; must be above 0"),
        ({"stiffness": [1, -2]}, "stiffness[1] = -2.0; must be above 0"),
        ({"stiffness": [1, np.nan]}, "stiffness[1] = nan; must be finite"),
        ({"stiffness": "soft"}, "stiffness = 'soft'; must be real numbers"),
        ({"stiffness": [[1, 2]]}, "stiffness has shape (1, 2); must be () or (N - 1,)"),
        ({"stiffness": [1, 1e-200]}, "stiffness[1] = 1e-200; must be at least 1e-150 of"),
        ({"exponent": 0.9}, "exponent = 0.9; must be at least 1"),
        ({"exponent": np.inf}, "exponent = inf; must be finite"),
        ({"exponent": [1, 2]}, "exponent = [1, 2]; must be one number"),
        ({"rtol": 0}, "rtol = 0.0; must lie in [2.22e-14, 0.1]"),
        ({"rtol": 0.2}, "rtol = 0.2; must lie in [2.22e-14, 0.1]"),
        ({"rtol": np.nan}, "rtol = nan; must be finite"),
        ({"method": "Euler"}, "method = 'Euler'; must be one of RK23, RK45, DOP853"),
        ({"max_time": -1}, "max_time = -1.0; must be at least 0"),
        ({"max_time": np.nan}, "max_time = nan; must be finite"),
        ({"max_evaluations": 0}, "max_evaluations = 0; must be a whole number, at least 1"),
        (
            {"max_evaluations": 1e6},
            "max_evaluations = 1000000.0; must be an int (1000000), at least 1",
        ),
        ({"max_evaluations": True}, "max_evaluations = True; must be a whole number"),
    ],
)
def test_bad_options_name_value_and_rule(options, message):
    with pytest.raises(ValueError, match="^" + re.escape(message)):
        SpringChain(**{"stiffness": 1.0} | options)


def test_a_spring_cannot_dissipate():
    message = "restitution[1] = 0.5; must be 1 for SpringChain: a spring gives back all the energy"
    with pytest.raises(ValueError, match="^" + re.escape(message)):
        collide(Chain([1, 1, 1], [1, 0, 0], [1, 0.5]), SpringChain(1.0))


def test_stiffness_of_the_wrong_length():
    with pytest.raises(ValueError, match=r"^stiffness has 3 values; 3 balls need 2"):
        collide(striking(), SpringChain([1, 2, 3]))


def test_scales_beyond_floats_are_refused():
    with pytest.raises(ValueError, match=r"^stiffness = 1e-300; .*choose other units"):
        collide(striking([1e300, 1e300], speed=1e-3), SpringChain(1e-300, 1))


def test_extreme_scales():
    """Nothing overflows on the way: units are the chain's own."""
    trace = collide(striking([1e-200, 1e-200], speed=1e120), SpringChain(1e-10, rtol=1e-12))
    np.testing.assert_allclose(trace.velocities, [0, 1e120], rtol=0, atol=1e110)


# --- the classes ---------------------------------------------------------------------------


def test_repr_is_the_caption():
    assert repr(SpringChain([1, 2], 1, rtol=1e-6)) == (
        "SpringChain(stiffness=(1.0, 2.0), exponent=1.0, rtol=1e-06, method='DOP853', "
        "max_time=None, max_evaluations=1000000)"
    )


def test_trace_is_a_frozen_trace_with_times():
    trace = collide(striking([1, 1]), SpringChain(1.0))
    assert isinstance(trace, TimedTrace)
    assert isinstance(trace, Trace)
    assert repr(trace).startswith("Trace(velocities=[")
    with pytest.raises(dataclasses.FrozenInstanceError):
        trace.times = trace.times
    with pytest.raises(dataclasses.FrozenInstanceError):
        SpringChain(1.0).rtol = 1e-3


def test_import_does_not_load_the_integrators():
    code = "import sys, cradle.models.compliant; sys.exit('scipy.integrate' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
