"""What the models and measures ask of chains, masses and types, in sentences."""

import re

import numpy as np
import pytest

import cradle
from cradle import (
    Chain,
    EnergyDistribution,
    FusedChain,
    ImpulseCorrelation,
    QuadraticDissipation,
    SequentialCollisions,
    SpringChain,
    collide,
)
from cradle.measures import condition_number, effective_ratio

SPRINGS = [SpringChain(), EnergyDistribution()]


# --- types ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "sentence"),
    [
        (ImpulseCorrelation, "model is the class ImpulseCorrelation; must be made: ImpulseCorre"),
        (0.5, "model is a float; must be an impact model"),
        ([0.1], "model is a list; must be an impact model"),
        (None, "model is a NoneType; must be an impact model"),
    ],
)
def test_what_is_no_model(model, sentence):
    chain = Chain([1, 1, 1], [1, 0, 0])
    for call in (collide, condition_number):
        with pytest.raises(TypeError, match="^" + sentence):
            call(chain, model)


@pytest.mark.parametrize(
    "model",
    [*SPRINGS, FusedChain(), SequentialCollisions(), QuadraticDissipation()],
    ids=lambda model: type(model).__name__,
)
def test_what_is_no_chain(model):
    for thing, words in (([1, 0, 0], "a list"), (Chain, "the class Chain"), (None, "a NoneType")):
        for call in (lambda chain: collide(chain, model), model.solve):
            with pytest.raises(TypeError, match=f"^chain is {words}; must be a Chain$"):
                call(thing)


def test_what_is_no_trace():
    chain = Chain([1, 1, 1], [1, 0, 0])
    for thing, words in ((chain, "a Chain"), ([1, 0, 0], "a list"), (cradle.Trace, "the class Tr")):
        with pytest.raises(TypeError, match=f"^trace is {words}.*; must be a Trace$"):
            effective_ratio(thing)


# --- masses --------------------------------------------------------------------------------


@pytest.mark.parametrize("model", SPRINGS, ids=repr)
@pytest.mark.parametrize("mass", [5e-324, 1e-309, 1.2e308])
def test_springs_refuse_masses_whose_reduced_mass_is_no_float(model, mass):
    words = f"masses[0] = {mass!r}; its reduced mass with masses[1] = {mass!r} is beyond the range"
    with pytest.raises(ValueError, match="^" + re.escape(words)):
        collide(Chain([mass] * 3, [1e-10, 0, 0]), model)


@pytest.mark.parametrize("model", [*SPRINGS, QuadraticDissipation(3)], ids=repr)
@pytest.mark.parametrize("power", [-1010, 1000])
def test_outcomes_have_no_unit_of_mass(model, power):
    chain = Chain([1, 2, 1], [2.0**-20, 0, 0])
    other = Chain(np.ldexp(chain.masses, power), chain.velocities)
    one, same = collide(chain, model), collide(other, model)
    assert same.velocities.tolist() == one.velocities.tolist()
    np.testing.assert_allclose(same.impulses, np.ldexp(one.impulses, power), rtol=1e-12)
    np.testing.assert_allclose(same.path_impulses, np.ldexp(one.path_impulses, power), rtol=1e-12)
    np.testing.assert_allclose(
        same.absorbed[one.absorbed > 0], np.ldexp(one.absorbed, power)[one.absorbed > 0], rtol=1e-12
    )


LAWS = [
    *SPRINGS, QuadraticDissipation(3), SequentialCollisions("right"), FusedChain(),
    ImpulseCorrelation(0.1),
]  # fmt: skip


@pytest.mark.parametrize("model", LAWS, ids=repr)
@pytest.mark.parametrize(("mass", "speed"), [(-660, 530), (600, -400)])
def test_works_of_speeds_whose_square_is_no_float(model, mass, speed):
    """The square of such a speed overflowed, though its energy does not."""
    chain = Chain([1, 2, 1], [1, 0, 0])
    other = Chain(np.ldexp(chain.masses, mass), np.ldexp(chain.velocities, speed))
    one, same = collide(chain, model), collide(other, model)
    assert same.velocities.tolist() == np.ldexp(one.velocities, speed).tolist()
    works = np.ldexp(one.absorbed, mass + 2 * speed)
    np.testing.assert_allclose(same.absorbed, works, rtol=1e-12, atol=works.max() * 1e-15)
    assert other.kinetic_energy == np.ldexp(chain.kinetic_energy, mass + 2 * speed)
    assert same.energy_loss == pytest.approx(
        np.ldexp(one.energy_loss, mass + 2 * speed), abs=works.max() * 1e-14
    )


@pytest.mark.parametrize("power", [-1074, -1030, 900])
def test_dissipation_has_no_unit_of_mass(power):
    """To the smallest floats, where the equations in kilograms were singular."""
    velocities = collide(Chain([1, 2, 1], [1, 0, 0], 0.5), QuadraticDissipation()).velocities
    same = Chain(np.ldexp([1.0, 2.0, 1.0], power), [1, 0, 0], 0.5)
    assert collide(same, QuadraticDissipation()).velocities.tolist() == velocities.tolist()


def test_dissipation_refuses_light_balls_between_heavy_ones():
    """A group of them too: each is near a neighbour, but the group is far from both its sides."""
    with pytest.raises(ValueError, match=r"^masses\[1\] = 1e-15; must be at least 1e-06 of the he"):
        collide(Chain([1e4, 1e-15, 2e-15, 1e13, 1e4], [1, 0, 0, 0, 0], 0.5), QuadraticDissipation())
    # Balls that grow lighter towards an end are none between heavy ones.
    light = collide(Chain([1, 1e-7, 1e-14], [1, 0, 0], 0.5), QuadraticDissipation())
    assert np.isfinite(light.velocities).all()


# --- defaults ------------------------------------------------------------------------------


def test_one_stiffness_for_all_needs_no_value():
    chain = Chain([1, 2, 1], [1, 0, 0])
    for kind in (SpringChain, EnergyDistribution):
        assert kind() == kind(1.0)
        other = collide(chain, kind(7.0)).velocities
        np.testing.assert_allclose(collide(chain, kind()).velocities, other, atol=1e-8)
