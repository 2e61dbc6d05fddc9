"""The chain: what is accepted, what is refused, and in which words."""

import copy
import pickle
import re

import numpy as np
import pytest

from cradle import (
    Chain,
    ImpulseCorrelation,
    SequentialCollisions,
    collide,
    post_impact_velocities,
)

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
        values[:] = 0.25
    assert chain.masses.tolist() == GOOD["masses"]
    assert chain.velocities.tolist() == GOOD["velocities"]
    assert chain.restitution.tolist() == GOOD["restitution"]
    given["masses"][0] = 7  # the caller's arrays stay writable


def test_one_restitution_for_all_contacts():
    assert Chain([1, 1, 1], [1, 0, 0], 0.25).restitution.tolist() == [0.25, 0.25]


def test_derived_values():
    chain = Chain(**GOOD)
    assert len(chain) == 3
    assert chain.closing_speeds.tolist() == [1, 1]
    assert chain.momentum == 1 * 1 + 3 * -1
    assert chain.kinetic_energy == 0.5 * (1 * 1 + 3 * 1)


def test_repr_makes_the_chain_again():
    chain = Chain([0.045, 1 / 3], [0.1, -2], 0.7)
    again = eval(repr(chain))
    for name in GOOD:
        assert getattr(again, name).tolist() == getattr(chain, name).tolist()


BAD = [
    ({"masses": [1, 0, 1]}, "masses[1] = 0.0; must be above 0"),
    ({"masses": [1, 1, -2]}, "masses[2] = -2.0; must be above 0"),
    ({"masses": [1, np.nan, 1]}, "masses[1] = nan; must be finite"),
    ({"masses": [np.inf, 1, 1]}, "masses[0] = inf; must be finite"),
    ({"masses": [1, 1, -np.inf]}, "masses[2] = -inf; must be finite"),
    (
        {"masses": [1, 1e-151, 1]},
        "masses[1] = 1e-151; must be at least 1e-150 of the heaviest ball of its chain",
    ),
    ({"masses": 1.0}, "masses has shape (); a chain needs (N,) with N >= 2"),
    ({"masses": [1.0]}, "masses has shape (1,); a chain needs (N,) with N >= 2"),
    ({"masses": []}, "masses has shape (0,); a chain needs (N,) with N >= 2"),
    ({"masses": [[1, 1, 1]]}, "masses has shape (1, 3); a chain needs (N,) with N >= 2"),
    ({"masses": [1, 1]}, "velocities has shape (3,); 2 masses need (2,)"),
    ({"velocities": [1, 0]}, "velocities has shape (2,); 3 masses need (3,)"),
    ({"velocities": 1.0}, "velocities has shape (); 3 masses need (3,)"),
    ({"velocities": [[1], [0], [0]]}, "velocities has shape (3, 1); 3 masses need (3,)"),
    ({"velocities": [1, np.nan, 0]}, "velocities[1] = nan; must be finite"),
    ({"velocities": [1, 0, -np.inf]}, "velocities[2] = -inf; must be finite"),
    (
        {"velocities": [0, 1e200, 0]},
        "velocities[1] = 1e+200; kinetic energy overflows: choose larger units",
    ),
    ({"restitution": [0.5, 1.2]}, "restitution[1] = 1.2; must lie in [0, 1]"),
    ({"restitution": [-0.1, 1]}, "restitution[0] = -0.1; must lie in [0, 1]"),
    ({"restitution": 1 + 2**-52}, "restitution = 1.0000000000000002; must lie in [0, 1]"),
    ({"restitution": [np.nan, 1]}, "restitution[0] = nan; must be finite"),
    ({"restitution": [1, 1, 1]}, "restitution has shape (3,); 3 balls need () or (2,)"),
    ({"restitution": [1]}, "restitution has shape (1,); 3 balls need () or (2,)"),
    ({"restitution": [[1, 1]]}, "restitution has shape (1, 2); 3 balls need () or (2,)"),
    ({"masses": "heavy"}, "masses = 'heavy'; must be real numbers, one shape"),
    ({"masses": ["1", "2", "3"]}, "masses[0] = '1'; must be a real number"),
    ({"masses": [1, [2, 3], 4]}, "masses[1] has shape (2,), masses[0] has (); must have one shape"),
    ({"masses": [1, None, 1]}, "masses[1] = None; must be a real number"),
    ({"velocities": [1j, 0, 0]}, "velocities[0] = 1j; must be a real number"),
    ({"velocities": None}, "velocities = None"),
    ({"restitution": "1"}, "restitution = '1'; must be real numbers, one shape"),
    ({"restitution": None}, "restitution = None; must be real numbers, one shape"),
]


@pytest.mark.parametrize(("change", "message"), BAD, ids=[message for _, message in BAD])
def test_bad_input_names_value_and_rule(change, message):
    with pytest.raises(ValueError, match="^" + re.escape(message)):
        Chain(**(GOOD | change))


def test_ragged_velocities_are_named_too():
    with pytest.raises(ValueError, match=r"^velocities"):
        Chain([1, 1, 1], [1, [0, 0], 0], 1)


@pytest.mark.parametrize("mass", [1e-150, 1e-300])
def test_lightest_and_smallest_masses(mass):
    """Only the ratio to the heaviest ball counts."""
    heavy = mass * 1e150
    assert Chain([heavy, mass], [1, 0], 1).masses.tolist() == [heavy, mass]
    with pytest.raises(ValueError, match=r"^masses\[1\] = .*; must be at least 1e-150"):
        Chain([heavy * 2, mass], [1, 0], 1)


@pytest.mark.parametrize("masses", [[1, 1e-20], [1e-20, 1], [1, 1, 1e-20], [1, 1e-16, 1]])
def test_every_door_refuses_a_ball_too_light_for_the_event_loop(masses):
    """Two or three balls that collide once take a short cut: it refuses what the loop refuses."""
    velocities, message = (
        [1.0] + [0.0] * (len(masses) - 1),
        "must be at least 1e-15 of the heaviest",
    )
    with pytest.raises(ValueError, match=message):
        collide(Chain(masses, velocities, 1), ImpulseCorrelation(0))
    with pytest.raises(ValueError, match=message):
        post_impact_velocities(masses, velocities, 1, 0)


def test_copies_are_frozen_too():
    chain = Chain([1, 2], [1, 0], 0.5)
    for other in (copy.copy(chain), copy.deepcopy(chain), pickle.loads(pickle.dumps(chain))):
        assert repr(other) == repr(chain)
        with pytest.raises(ValueError, match="read-only"):
            other.masses[0] = -1.0


def test_masked_numbers_are_refused():
    masked = np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False])
    for given in (masked, [1.0, np.ma.masked, 3.0]):
        with pytest.raises(ValueError, match=r"^masses\[1\] = masked; must be a real number$"):
            Chain(given, [1, 0, 0], 1)
        with pytest.raises(ValueError, match=r"^masses\[1\] = masked; must be a real number$"):
            post_impact_velocities(given, [1, 0, 0], 1, 0.1)


# --- words beside the exact message --------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"masses": [1.0]}, "one row of two or more numbers"),
        ({"velocities": [1, 0]}, "one velocity for each of 3 balls"),
        (
            {"restitution": [1, 1, 1]},
            "3 balls have 2 contacts, restitution needs one number or 2",
        ),
    ],
)
def test_lengths_are_told_without_shapes_too(values, words):
    with pytest.raises(ValueError, match=f": {words}$"):
        Chain(**(GOOD | values))
    with pytest.raises(ValueError, match="2 balls have 1 contact, restitution needs one number or"):
        Chain([1, 1], [1, 0], [1, 1])


#: Of usual values nothing more is asked; these lie just beyond, and have to be asked.
UNUSUAL = [
    ({"masses": [1e70, 1e71, 1e-81]}, "masses[2] = 1e-81; must be at least 1e-150 of the heaviest"),
    ({"velocities": [1, 0, -1e160]}, "velocities[2] = -1e+160; kinetic energy overflows"),
    ({"masses": [1e200] * 3, "velocities": [1e70, 0, 0]}, "velocities[0] = 1e+70; kinetic energy"),
    ({"restitution": [1, 1e-31]}, "restitution[1] = 1e-31; must be 0 or at least 1e-30"),
    ({"restitution": np.nextafter(1, 2)}, "restitution = 1.0000000000000002; must lie in [0, 1]"),
]


@pytest.mark.parametrize(("values", "words"), UNUSUAL)
def test_unusual_values_are_asked(values, words):
    with pytest.raises(ValueError, match="^" + re.escape(words)):
        Chain(**(GOOD | values))


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
    chain = Chain._of(*values.values())
    name = words[: words.index("[")]
    with pytest.raises(ValueError, match=f"^{name}.*" + re.escape(words[words.index(";") :])):
        collide(chain, model)


# --- equality, defaults --------------------------------------------------------------------


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


def test_balls_are_elastic_unless_said_otherwise():
    assert Chain([1, 2, 3], [1, 0, 0]).restitution.tolist() == [1.0, 1.0]
