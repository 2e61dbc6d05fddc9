"""Restitution that depends on the closing speed."""

import itertools

import numpy as np
import pytest
from chains import magnitudes, uniform

from cradle import (
    Chain,
    ConstantLoss,
    EnergyDistribution,
    ImpactNotFinished,
    ImpulseCorrelation,
    Pendulums,
    SequentialCollisions,
    SpeedDependent,
    ViscousLoss,
    collide,
    spring_velocities,
    swing,
)
from cradle.models import correlation

STEEL = {"masses": [0.045, 0.03], "stiffness": 1e10}


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("model", [ImpulseCorrelation(0.1), SequentialCollisions()], ids=repr)
def test_two_balls_part_as_the_law_says(model, seed):
    rng = np.random.default_rng(seed)
    m, v = magnitudes(rng, 6, 2), [uniform(rng, 0, 1), -uniform(rng, 0, 1)]
    u = v[0] - v[1]
    for law, parts in ((ConstantLoss(0.1), max(u - 0.1, 0)), (lambda u: u / 3, u * u / 3)):
        trace = collide(Chain(m, v), SpeedDependent(model, law))
        assert trace.velocities[1] - trace.velocities[0] == pytest.approx(parts, abs=1e-14)
        assert trace.velocities @ m == pytest.approx(np.dot(v, m), abs=1e-13 * m.max())


@pytest.mark.parametrize("seed", range(10))
def test_each_contact_has_the_restitution_of_its_fastest_closing(seed):
    """Solved once more with the restitutions that were found, the impact has just those speeds."""
    rng = np.random.default_rng(seed)
    model, law = ImpulseCorrelation(0.1, excess="saturate"), ConstantLoss(0.05)
    chain = Chain(uniform(rng, 0.5, 2, 5), [1, 0, 0, 0, 0])
    trace = collide(chain, SpeedDependent(model, law))
    again = collide(Chain(chain.masses, chain.velocities, trace.chain.restitution), model)
    assert again.velocities.tolist() == trace.velocities.tolist()
    fastest = (again.path[:, :-1] - again.path[:, 1:]).max(axis=0)
    assert again.chain.restitution == pytest.approx([law(u) if u > 0 else 1 for u in fastest])
    assert trace.energy_loss == pytest.approx(
        chain.kinetic_energy - 0.5 * (chain.masses * trace.velocities) @ trace.velocities
    )


def test_energy_distribution_tells_speeds_within_its_steps():
    """Linear springs: after t the second contact closes at (cos t - cos(3^.5 t)) / 2."""
    t = np.linspace(0, 2, 100_001)
    fastest, told = 0.5 * (np.cos(t) - np.cos(np.sqrt(3) * t)).max(), []
    for rtol in (1e-9, 1e-13):
        law = SpeedDependent(EnergyDistribution(1.0, 1, rtol=rtol), lambda u: told.append(u) or 1.0)
        collide(Chain([1, 1, 1], [1, 0, 0]), law)
        assert (1 - 1e-4) * fastest < told[-1] < fastest * (1 + 1e-9)


def test_restitutions_agree_no_better_than_integrations():
    """Their errors change the speeds anew in each run; the law of the last one is nearly exact."""
    rng, law = np.random.default_rng(5), ConstantLoss(0.03)
    for n in [5, 6, 7] * 3:
        chain = Chain(magnitudes(rng, 1, n), np.eye(n)[0])
        model = EnergyDistribution(magnitudes(rng, 1, n - 1))
        trace = collide(chain, SpeedDependent(model, law))
        fastest = -np.diff(trace.curve()[1]).min(axis=0)
        exact = [law(u) if u > 0 else 1.0 for u in fastest]
        np.testing.assert_allclose(trace.chain.restitution, exact, rtol=0, atol=1e-8)


def test_restitutions_that_never_agree_are_said():
    fickle = itertools.cycle([0.2, 0.3, 0.4])
    law = SpeedDependent(SequentialCollisions(), lambda _: next(fickle))
    with pytest.raises(ImpactNotFinished, match="do not agree after 50 runs"):
        collide(Chain([1, 1], [1, 0]), law)


def test_a_path_that_is_cut_tells_no_speeds(monkeypatch):
    """What is left out could be faster; so it is said after the first run."""
    monkeypatch.setattr(correlation, "_MOST_NUMBERS", 11)
    with pytest.raises(ImpactNotFinished, match="its path was cut"):
        collide(Chain([1, 1, 1], [1, 0, 0]), SpeedDependent(ImpulseCorrelation(0.1), lambda _: 0.9))


def test_a_part_of_a_swinging_row_has_its_part_of_the_inner_law():
    """Balls 0 to 2 touch and are struck, with the ratio of ball 1; the others hang apart."""
    hanging = Pendulums(0.1, gaps=[0, 0, 0.02, 0])
    law = ImpulseCorrelation((0.05, 0.1, 0.15))
    runs = [
        swing(Chain([1] * 5, [0] * 5), model, [-0.02, 0, 0, 0, 0], [0, 0.2], pendulums=hanging)
        for model in (law, SpeedDependent(law, lambda _: 1.0))
    ]
    assert runs[0].positions.tolist() == runs[1].positions.tolist()
    wrong = SpeedDependent(ImpulseCorrelation((0.1, 0.2)), abs)
    with pytest.raises(ValueError, match="forward has 2 values; 5 balls need 3"):
        swing(Chain([1] * 5, [0] * 5), wrong, [0] * 5, [0])


@pytest.mark.parametrize("exponent", [1, 1.5, 2.5])
@pytest.mark.parametrize("u", [1e-3, 0.1, 0.7])
def test_viscous_balls_part_as_contact_forces_say(exponent, u):
    for viscosity in (1e-5, 1e-7, 1e-9):
        balls = STEEL | {"exponent": exponent, "viscosity": viscosity}
        left, right = spring_velocities(velocities=[u, 0], **balls, accuracy=1e-9)
        assert ViscousLoss(**balls)(u) == pytest.approx((right - left) / u, abs=3e-9)


def test_one_mass_is_that_of_both_balls():
    one, two = (ViscousLoss(**STEEL | {"viscosity": 1e-7, "masses": m}) for m in (0.1, [0.1] * 2))
    assert one == two


def test_a_viscous_ball_may_be_too_fast():
    law = ViscousLoss(2e-5, **STEEL)
    assert 0.5 < law(1e-2) < law(1e-3) < 1
    with pytest.raises(ValueError, match=r"viscosity = 2e-05; must be at most \d.* at u = 1e\+10"):
        law(1e10)
