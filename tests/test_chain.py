"""The chain: what is accepted, what is refused, and in which words."""

import copy
import pickle
import re

import numpy as np
import pytest

from cradle import Chain, ImpulseCorrelation, Pendulums, SequentialCollisions, collide

GOOD = {"masses": [1, 2, 3], "velocities": [1, 0, -1], "restitution": [0.5, 1]}


def test_values_are_floats_and_frozen():
    chain = Chain(**GOOD)
    for name in GOOD:
        values = getattr(chain, name)
        assert values.dtype == np.float64
        assert values.tolist() == GOOD[name]
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 7
    with pytest.raises(AttributeError):
        chain.masses = np.ones(3)


def test_later_changes_of_the_input_do_not_matter():
    given = {name: np.array(values, float) for name, values in GOOD.items()}
    chain = Chain(**given)
    for values in given.values():
        values[:] = 0.25  # the caller's arrays stay writable
    assert chain == Chain(**GOOD)


def test_derived_values():
    chain = Chain(**GOOD)
    assert len(chain) == 3
    assert chain.closing_speeds.tolist() == [1, 1]
    assert chain.momentum == 1 * 1 + 3 * -1
    assert chain.kinetic_energy == 0.5 * (1 * 1 + 3 * 1)
    # One restitution for all contacts, and elastic balls unless said otherwise.
    assert Chain([1, 1, 1], [1, 0, 0], 0.25).restitution.tolist() == [0.25, 0.25]
    assert Chain([1, 2, 3], [1, 0, 0]).restitution.tolist() == [1.0, 1.0]


@pytest.mark.parametrize("mass", [1e-150, 1e-300])
def test_lightest_and_smallest_masses(mass):
    """Only the ratio to the heaviest ball counts."""
    heavy = mass * 1e150
    assert Chain([heavy, mass], [1, 0], 1).masses.tolist() == [heavy, mass]


def test_copies_are_frozen_too():
    chain = Chain([0.045, 1 / 3], [0.1, -2], 0.7)
    copies = copy.copy(chain), copy.deepcopy(chain), pickle.loads(pickle.dumps(chain))
    hanging = Pendulums([0.1, 0.2], gaps=1e-3)
    assert hanging == copy.deepcopy(hanging) == eval(repr(hanging)) != Pendulums([0.1, 0.3])
    for other in (*copies, eval(repr(chain))):
        assert other == chain
        with pytest.raises(ValueError, match="read-only"):
            other.masses[0] = -1.0


@pytest.mark.parametrize("name", GOOD)
def test_unusual_values_that_are_good_are_kept(name):
    value = {"masses": 1e-80, "velocities": 1e80, "restitution": 0.0}[name]
    values = [value] * len(GOOD[name])
    assert getattr(Chain(**(GOOD | {name: values})), name).tolist() == values


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ({"velocities": [1, np.nan, 0]}, "velocities[1] = nan; must be finite"),
        ({"velocities": [1e160, 0, 0]}, "velocities[0] = 1e+160; kinetic energy overflows"),
        ({"masses": [1, -1, 1]}, "masses[1] = -1.0; must be above 0"),
        ({"restitution": [1, 1.5]}, "restitution[1] = 1.5; must lie in [0, 1]"),
    ],
)
@pytest.mark.parametrize("model", [ImpulseCorrelation(0.1), SequentialCollisions("right")])
def test_a_chain_that_was_not_asked_is_refused_where_it_is_solved(part, words, model):
    """Such as a part of a swing: the event loop asks, and the words are those of `Chain`."""
    values = {name: np.array(value, float) for name, value in (GOOD | part).items()}
    vars(chain := object.__new__(Chain)).update(values)
    name = words[: words.index("[")]
    with pytest.raises(ValueError, match=f"^{name}.*" + re.escape(words[words.index(";") :])):
        collide(chain, model)


def test_chains_with_equal_values_are_equal():
    one, other = Chain(**GOOD), Chain(**{name: np.array(v, float) for name, v in GOOD.items()})
    assert one == other
    assert len({one, other}) == 1
    for name, values in [("masses", [1, 2, 4]), ("velocities", [1, 0, -2]), ("restitution", 1)]:
        assert one != Chain(**(GOOD | {name: values}))
    assert one != Chain([1, 2], [1, 0], 0.5)
    assert one != "Chain"
    # The two zeros are one number, so these chains are equal, and found under one key.
    zeros = {Chain([1, 1], [1, zero], 1) for zero in (0.0, -0.0)}
    assert len(zeros) == 1
