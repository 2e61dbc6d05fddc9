"""What all models have in common: types, two balls, ends, units, defaults."""

import re
from functools import partial

import numpy as np
import pytest

import cradle
from cradle import (
    Chain,
    EnergyDistribution,
    FusedChain,
    ImpactNotFinished,
    ImpulseCorrelation,
    QuadraticDissipation,
    SequentialCollisions,
    SpringChain,
    collide,
)

DISSIPATION = QuadraticDissipation
LAWS = [
    SpringChain(), EnergyDistribution(), DISSIPATION(3), SequentialCollisions("left"),
    SequentialCollisions("right"), FusedChain(), ImpulseCorrelation(0.1),
]  # fmt: skip


@pytest.mark.parametrize("model", LAWS, ids=repr)
def test_what_is_no_chain(model):
    for thing, words in (([1, 0, 0], "a list"), (Chain, "the class Chain"), (None, "a NoneType")):
        for call in (lambda chain: collide(chain, model), model.solve):
            with pytest.raises(TypeError, match=f"^chain is {words}; must be a Chain$"):
                call(thing)


@pytest.mark.parametrize(
    "caption",
    [
        "SequentialCollisions(order='right', max_events=5000000)",
        "FusedChain()",
        "SpringChain(stiffness=(1.0, 2.0), exponent=1.0, viscosity=0.0, gaps=0.0, "
        "damping='viscoelastic', accuracy=1e-09, max_steps=20000000)",
        "EnergyDistribution(stiffness=(1.0, 2.0), exponent=1.0, "
        "rtol=1e-09, max_evaluations=1000000)",
        "QuadraticDissipation(coefficients=(1.0, 2.0), max_problems=10000)",
        "ImpulseCorrelation(forward=(0.1, 0.2), backward=0.3, meeting=0.25, excess='saturate', "
        "max_events=9)",
    ],
)
def test_models_compare_by_value_and_their_repr_makes_them_again(caption):
    model = eval(caption, vars(cradle))
    assert repr(model) == caption
    arrays = re.sub(r"\(([\d., ]+)\)", r"np.array([\1])", caption)
    arrays = re.sub(r"=(\d+[.e][-\d]+)", r"=np.float64(\1)", arrays)
    arrays = re.sub(r"(max_\w+)=(\d+)", r"\1=np.int64(\2)", arrays)
    same = eval(arrays, vars(cradle) | {"np": np})
    assert (same, repr(same)) == (model, caption)
    assert model != ImpulseCorrelation([0.1, 0.2], 0.3)


@pytest.mark.parametrize("model", LAWS, ids=repr)
@pytest.mark.parametrize("velocities", [[0.1, 0.2, 0.3], [0.1] * 3, [-0.3, -0.3, 1e-300]])
def test_balls_that_do_not_approach_keep_their_velocities_to_the_last_bit(model, velocities):
    trace = collide(Chain([1 / 3, 0.7, 0.2], velocities, 1), model)
    assert trace.path.tolist() == [trace.velocities.tolist()] == [velocities]
    assert trace.path_impulses.tolist() == [[0, 0]]
    assert trace.impulses.tolist() == trace.absorbed.tolist() == [0, 0]
    assert trace.collisions.tolist() == [0, 0]
    assert not trace.events
    assert (trace.energy_loss, trace.collapsed, trace.saturated) == (0, False, ())
    assert getattr(trace, "evaluations", 0) == 0


@pytest.mark.parametrize("e", [0, 1e-3, 0.5, 0.9, 1])
@pytest.mark.parametrize("masses", [[2, 3], [1e-3, 1e3]])
@pytest.mark.parametrize(
    "model",
    [*(EnergyDistribution(50.0, p) for p in (1, 1.5, 2.5)), DISSIPATION(), *LAWS[3:]],
    ids=repr,
)
def test_two_balls(model, masses, e):
    """Newton's restitution, by every law that takes it."""
    e = min(e, 0.999) if isinstance(model, DISSIPATION) else e
    trace = collide(Chain(masses, [1.7, 1], e), model)
    exact = not isinstance(model, EnergyDistribution)  # the adaptive error of a speed is 1e-9
    close = partial(pytest.approx, rel=1e-11 if exact else 1e-8, abs=1e-12 if exact else 1e-8)
    mu = np.prod(masses) / np.sum(masses)
    assert trace.velocities[0] - trace.velocities[1] == close(-0.7 * e)
    assert trace.impulses[0] == close((1 + e) * mu * 0.7)
    assert trace.energy_loss == close((1 - e * e) * mu * 0.49 / 2)
    assert trace.events[-1] == ("end", 0)
    if len(trace.events) > 1:
        assert trace.events[0] == ("maximum_compression", 0)
        assert trace.absorbed[0] == close(mu * 0.49 / 2)


@pytest.mark.parametrize(
    ("model", "masses", "velocities", "words", "reached"),
    [
        (SequentialCollisions("left", max_events=3), [100, 1, 100], [1, 0, -1], "3 steps",
         lambda trace: np.argmax(trace.collisions) == 0),
        (SequentialCollisions("right", max_events=3), [100, 1, 100], [1, 0, -1], "3 steps",
         lambda trace: np.argmax(trace.collisions) == 1),
        (SpringChain(max_steps=20), [1, 0.01, 1], [1, 0, 0], r"20\): contact 0, th",
         lambda trace: trace.velocities[0] < 1),
        (EnergyDistribution(max_evaluations=50), [1, 1, 1], [1, 0, 0], "50 reached",
         lambda trace: trace.evaluations == 50 and trace.step_impulses[-1, 0] >= 0),
        (DISSIPATION(9.0, max_problems=2), [10, 0.1, 10], [0, 1, 0], "2;",
         lambda trace: trace.collisions.tolist() == [1, 1]),
    ],
)  # fmt: skip
def test_unfinished_impacts_show_what_was_reached(model, masses, velocities, words, reached):
    chain = Chain(masses, velocities, 1)
    with pytest.raises(ImpactNotFinished, match=f"max_[a-z]+ = {words}") as stopped:
        collide(chain, model)
    trace = stopped.value.trace
    assert trace.chain is chain
    assert trace.model is model
    assert chain.masses @ trace.velocities == pytest.approx(chain.momentum, abs=1e-13)
    assert reached(trace)


@pytest.mark.parametrize("model", LAWS, ids=repr)
@pytest.mark.parametrize(("mass", "speed"), [(-660, 530), (600, -400), (-1010, 20)])
def test_outcomes_have_no_units(model, mass, speed):
    """Also where the square of a speed overflows, though its energy does not."""
    chain = Chain([1, 2, 1], [1, 0, 0])
    other = Chain(np.ldexp(chain.masses, mass), np.ldexp(chain.velocities, speed))
    one, same = collide(chain, model), collide(other, model)
    assert same.velocities.tolist() == np.ldexp(one.velocities, speed).tolist()
    works = np.ldexp(one.absorbed, mass + 2 * speed)
    np.testing.assert_allclose(same.absorbed, works, rtol=1e-12, atol=works.max() * 1e-15)
    assert other.kinetic_energy == np.ldexp(chain.kinetic_energy, mass + 2 * speed)
    lost = np.ldexp(one.energy_loss, mass + 2 * speed)
    assert same.energy_loss == pytest.approx(lost, abs=works.max() * 1e-14)


@pytest.mark.parametrize("power", [-1074, -1030, 900])
def test_dissipation_has_no_unit_of_mass(power):
    """To the smallest floats, where the equations in kilograms were singular."""
    velocities = collide(Chain([1, 2, 1], [1, 0, 0], 0.5), QuadraticDissipation()).velocities
    same = Chain(np.ldexp([1.0, 2.0, 1.0], power), [1, 0, 0], 0.5)
    assert collide(same, QuadraticDissipation()).velocities.tolist() == velocities.tolist()


@pytest.mark.parametrize("masses", [[1, 1e-6, 1], [1, 1e-7, 1e-14], [1e-12, 1, 1e12]])
def test_dissipation_takes_balls_that_grow_lighter_towards_an_end_and_just_heavy_ones(masses):
    after = collide(Chain(masses, [1, 0, 0], 0.5), DISSIPATION()).velocities
    if masses[2] == 1:
        np.testing.assert_allclose(after, 1 / (2 + 1e-6), rtol=1e-9)
    else:
        assert (np.diff(after) > -1e-14).all()


def test_one_stiffness_for_all_needs_no_value():
    chain = Chain([1, 2, 1], [1, 0, 0])
    for kind in (SpringChain, EnergyDistribution):
        assert kind() == kind(1.0)
        other = collide(chain, kind(7.0)).velocities
        np.testing.assert_allclose(collide(chain, kind()).velocities, other, atol=1e-8)
