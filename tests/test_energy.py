"""Energy-based distribution: springs at e = 1, two balls, ledger, small steps, other programs."""

import numpy as np
import pytest
from chains import magnitudes, striking, uniform
from energy_law import strike
from hypothesis import example, given, settings
from hypothesis import strategies as st
from laws import keeps

from cradle import Chain, EnergyDistribution, EnergyTrace, ImpactNotFinished, SpringChain, collide


@pytest.mark.parametrize("exponent", [1, 1.5])
@pytest.mark.parametrize("e", [[1, 1], [0.7, 0.9], [0.5, 1], [1, 0.5]])
def test_against_small_steps_of_time(e, exponent):
    chain, k = striking([1, 1.3, 0.8], e), [1, 2]
    found = collide(chain, EnergyDistribution(k, exponent)).velocities
    coarse, fine = (
        abs(strike(chain.masses, [1, 0, 0], e, steps, k, exponent)[0] - found).max()
        for steps in (200, 3200)
    )
    assert coarse > 4 * fine
    assert fine < 2e-3


def test_ten_balls_of_the_authors_program():
    """Siconos, examples MonodisperseChainOfBalls-LZBModel: its stored outcome, e = 1, p = 3/2.

    Its steps are 1e-6 N s, 6e-5 of the unit here, of first order: 1e-4 is its own error.
    """
    siconos = [-0.07105929, -0.03018624, -0.01574960, -0.00880806, -0.00506234]
    siconos += [-0.00293663, -0.00170186, 0.00262452, 0.14692339, 0.98595612]
    trace = collide(striking([0.0326] * 10), EnergyDistribution(1.0, rtol=1e-11))
    np.testing.assert_allclose(trace.velocities, siconos, rtol=0, atol=5e-4)
    assert abs(trace.velocities - siconos)[:8].max() < 1e-4


@st.composite
def chains(draw):
    """Chain, stiffness, exponent: two to four balls."""
    n = draw(st.integers(2, 4))
    part = st.floats(-1, 1)
    masses = [10.0 ** draw(part) for _ in range(n)]
    velocities = [
        draw(st.sampled_from([0.0, 1.0, -1.0]) | st.floats(-1, 1).map(lambda v: round(v, 3)))
        for _ in range(n)
    ]
    e = [draw(st.sampled_from([0.0, 1.0]) | st.floats(0.4, 1)) for _ in range(n - 1)]
    stiffness = [10.0 ** draw(part) for _ in range(n - 1)]
    return Chain(masses, velocities, e), stiffness, draw(st.sampled_from([1, 1.5, 2.5]))


@settings(max_examples=40)
@given(chains())
def test_laws(case):
    chain, stiffness, exponent = case
    trace = collide(chain, EnergyDistribution(stiffness, exponent, rtol=1e-8))
    keeps(trace, energy=1e-6)
    assert isinstance(trace, EnergyTrace)
    assert ((trace.impulses > 0) >= (trace.collisions > 0)).all()


@settings(max_examples=25)
@given(chains())
@example((Chain([2, 1, 1], [1, 0, 0]), [1, 1], 1))
@example((Chain([1, 2, 1, 3], [1, 0, 0, 0]), [1, 1, 1], 2))
@example((Chain([1, 1, 10**-0.5, 1], [1, 0, 0, -1]), [1, 1, 1], 1))  # a step ends at no maximum
def test_spring_chain_at_e_1(case):
    """Gaps count as for the springs, and each compression of a contact that is compressed again."""
    chain, stiffness, exponent = case
    chain = Chain(chain.masses, chain.velocities, 1)
    springs = collide(chain, SpringChain(stiffness, exponent, accuracy=1e-10))
    # Some hundred times the tolerance of a step is what an outcome can be off by.
    trace = collide(chain, EnergyDistribution(stiffness, exponent, rtol=3e-12))
    np.testing.assert_allclose(trace.velocities, springs.velocities, rtol=0, atol=1e-8)
    np.testing.assert_allclose(trace.absorbed, springs.absorbed, rtol=1e-6, atol=1e-8)


def test_what_touches_at_rest_and_is_not_pushed_does_not_act():
    trace = collide(Chain([1, 1, 1, 1], [0, 0, 1, 0], 0.5), EnergyDistribution(1.0))
    assert trace.collisions.tolist() == [0, 0, 1]
    assert trace.velocities[:2].tolist() == [0, 0]


@pytest.mark.parametrize("velocities", [[-1, 0, 1e-17], [-1e5, 0, 1e-12]])
def test_balls_in_order_get_nothing(velocities):
    """Also where the sum of what lies between them shows no difference."""
    trace = collide(Chain([1, 1, 1], velocities), EnergyDistribution())
    assert trace.velocities.tolist() == velocities
    assert not trace.impulses.any()


def test_endless_plastic_impacts_end_in_one_body():
    trace = collide(striking([1, 1, 1], 0), EnergyDistribution(1.0))
    assert trace.collapsed
    np.testing.assert_allclose(trace.velocities, 1 / 3, rtol=0, atol=1e-14)


def test_short_releases_are_followed_or_said_not_to_be():
    for e in (1e-6, 1e-9):
        after = collide(Chain([1, 1], [1, 0], e), EnergyDistribution(1.0)).velocities
        assert after[1] - after[0] == pytest.approx(e, rel=1e-5)
    with pytest.raises(ImpactNotFinished, match="after 1 events: Required step size is less"):
        collide(Chain([1, 1], [1, 0], 1e-12), EnergyDistribution(1.0))


@pytest.mark.parametrize(
    ("masses", "velocities", "restitution", "impulses"),
    [
        # A wall that moves at 2 m/s takes along 2 kg and 1 kg: 1 * (2 + 1) and 2 * (2 - 1) more.
        ([1e10, 1e16, 2, 1], [-1, 2, 1, -1], [0.3, 0, 0], [0, 5, 3]),
        # 1 kg comes to rest with the others; the last takes its part by mass, 1e10 / (1e12 + 1e10).
        ([1, 1e12, 1e10], [2, -1, -1], [0, 0], [3, 3 / 101]),
    ],
)
def test_impulses_beside_heavy_balls(masses, velocities, restitution, impulses):
    """The end of a plastic impact: of a velocity's last digit, times 1e16 kg, nothing is seen."""
    trace = collide(Chain(masses, velocities, restitution), EnergyDistribution())
    np.testing.assert_allclose(trace.impulses, impulses, rtol=1e-7)


def test_a_coarse_end_beside_a_heavy_ball():
    """Closing speeds that are left are counted from that ball: its last digit is 2000 N s."""
    chain = Chain([0.8, 0.6, 1.3e19, 0.6], [0.8, 0.5, -0.9, -0.9], 0)
    impulses = collide(chain, EnergyDistribution(rtol=0.1)).impulses
    np.testing.assert_allclose(impulses, [0.8 * 1.7, 0.8 * 1.7 + 0.6 * 1.4, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("masses", "e", "exponent", "rtol"),
    [
        ([1, 1, 1, 1, 1], 0.5, 1, 1e-9),
        ([1, 1, 1, 1, 1, 1], 1, 1.5, 1e-5),
        ([1, 1, 1, 1, 1], 0.5, 1.5, 1e-6),  # without an end, if the two contacts act in turn
        ([2, 0.5, 0.3, 0.5, 2], 0.7, 2, 1e-6),
        ([3, 0.5, 0.2, 0.5, 3], 0.5, 3, 1e-6),  # one that has turned still has its old sign
        ([3, 2, 1, 1, 1, 2, 3], 0.9, 2, 1e-6),
    ],
)
def test_rigid_balls_struck_from_both_sides_alike(masses, e, exponent, rtol):
    """Two contacts end and close at one instant, again and again; neither may be lost."""
    chain = Chain(masses, np.eye(len(masses))[0] - np.eye(len(masses))[-1], e)
    model = EnergyDistribution(1.0, exponent, rtol=rtol, max_evaluations=20_000)
    trace = collide(chain, model)
    np.testing.assert_allclose(trace.velocities, -trace.velocities[::-1], rtol=0, atol=10 * rtol)
    left = 0.5 * chain.masses @ trace.velocities**2 + trace.energy_loss
    assert left == pytest.approx(chain.kinetic_energy, abs=100 * rtol)


def test_a_contact_that_opens_and_closes_within_one_step_is_seen():
    """Among 236 events; overlooked, it costs eight digits."""
    chain = Chain([1, 0.25, 0.5, 1], [0, -1, 1, -1], [0, 0.7, 0])
    models = (EnergyDistribution([0.125, 0.5, 4], 1, rtol=rtol) for rtol in (1e-8, 1e-11))
    coarse, fine = (collide(chain, model) for model in models)
    np.testing.assert_allclose(coarse.velocities, fine.velocities, rtol=0, atol=1e-13)


def test_curves_have_the_largest_closing_speeds():
    """Speeds have maxima within steps: a law e(u) asks for them.  Springs take short steps."""
    rng = np.random.default_rng(3)
    for n in [3, 4, 5, 6] * 3:
        k, p = magnitudes(rng, 1, n - 1), float(uniform(rng, 1, 2))
        chain = Chain(magnitudes(rng, 1, n), np.eye(n)[0], 1)
        _, v = collide(chain, EnergyDistribution(k, p)).curve()
        exact = collide(chain, SpringChain(k, p)).step_velocities
        np.testing.assert_allclose(
            np.diff(v).min(axis=0), np.diff(exact).min(axis=0), rtol=0, atol=1e-4
        )
