"""What an impact that is not finished has decided all the same."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from families import FAMILIES, family
from scipy.optimize import minimize

from cradle import (
    Chain,
    EnergyDistribution,
    ImpactNotFinished,
    ImpulseCorrelation,
    QuadraticDissipation,
    SequentialCollisions,
    SpringChain,
    collide,
)

FIVE = Chain([1, 0.3, 0.6, 0.2, 0.9], [1, 0.4, 0, 0, -0.3], [0.9, 0.8, 1, 0.7])
ELASTIC = Chain(FIVE.masses, FIVE.velocities)


def stopped(chain, model):
    """The exception with which a model stops, or None."""
    try:
        collide(chain, model)
    except ImpactNotFinished as found:
        return found
    return None


@pytest.mark.parametrize("name", FAMILIES)
def test_bounds_hold(name):
    looked = 0
    for problem in family(name, 10 if name == "tiny ratios" else 40, seed=11):
        trace, finished = problem.attempt(5000)
        for steps in (1, 2, 4, 8, 16, 64, 256):
            early, done = problem.attempt(steps)
            if done or not finished:
                break
            found = stopped(early.chain, early.model)
            least, largest = found.bounds
            assert (least <= trace.velocities).all(), problem
            assert (trace.velocities <= largest).all(), problem
            looked += 1
    assert looked > 20


def widest(found, i, sign):
    """The same by an optimiser: the largest sign * velocity of ball i."""
    chain, v = found.trace.chain, found.trace.velocities
    m = chain.masses
    largest = np.abs(chain.velocities).max()
    energy = m @ v**2 / 2 + found.stored * m.max() * largest**2
    rules = [
        {"type": "eq", "fun": lambda x: m @ (x - v), "jac": lambda _: m},
        {"type": "ineq", "fun": lambda x: energy - m @ x**2 / 2, "jac": lambda x: -m * x},
        {"type": "ineq", "fun": np.diff, "jac": lambda _: np.diff(np.eye(len(m)), axis=0)},
    ]
    start = np.full(len(m), m @ v / m.sum())
    best = minimize(
        lambda x: -sign * x[i], start, jac=lambda _: -sign * np.eye(len(m))[i],
        method="SLSQP", constraints=rules, options={"ftol": 1e-10, "maxiter": 500},
    )  # fmt: skip
    assert best.success
    return best.x[i]


@pytest.mark.parametrize("steps", [1, 3, 5])
def test_bounds_are_the_narrowest(steps):
    """Momentum, order and energy allow as much, says an optimiser."""
    found = stopped(FIVE, ImpulseCorrelation(0.2, excess="saturate", max_events=steps))
    for i in range(len(FIVE)):
        assert found.bounds[0, i] == pytest.approx(widest(found, i, -1), abs=1e-6)
        assert found.bounds[1, i] == pytest.approx(widest(found, i, 1), abs=1e-6)


def test_what_contacts_still_store_counts():
    """Without it the bounds would be broken."""
    chain = Chain([1, 1, 1], [1, 0, 0], [0.0, 1.0])
    model, one_step = ImpulseCorrelation(0.4), ImpulseCorrelation(0.4, max_events=1)
    found = stopped(chain, one_step)
    assert found.stored > 0.01
    after = collide(chain, model).velocities
    without = ImpactNotFinished("", found.trace, 0.0).bounds
    assert ((found.bounds[0] <= after) & (after <= found.bounds[1])).all()
    assert not ((without[0] <= after) & (after <= without[1])).all()


@pytest.mark.parametrize(
    ("model", "less", "chain"),
    [
        (SpringChain(), {"max_steps": 20}, ELASTIC),
        (EnergyDistribution(), {"max_evaluations": 100}, FIVE),
        (QuadraticDissipation(9.0), {"max_problems": 2}, Chain([10, 0.1, 10], [0, 1, 0], 1)),
        (SequentialCollisions(), {"max_events": 2}, FIVE),
        (SequentialCollisions("right"), {"max_events": 2}, FIVE),
    ],
)
def test_bounds_of_other_models(model, less, chain):
    found, after = stopped(chain, replace(model, **less)), collide(chain, model).velocities
    assert ((found.bounds[0] <= after) & (after <= found.bounds[1])).all()
    assert (found.bounds[1] - found.bounds[0] < 4.0).all()
    assert found.stored == 0.0 or not isinstance(model, QuadraticDissipation)


def test_bounds_narrow_as_the_impact_comes_to_rest():
    chain = Chain([1, 1e-3, 1, 1e-3, 1], [1, 0, 0, 0, 0], 0.1)
    widths = []
    for steps in (10, 100, 1000):
        found = stopped(chain, ImpulseCorrelation(0.1, excess="saturate", max_events=steps))
        widths.append(np.ptp(found.bounds, axis=0).max())
    assert widths[0] > widths[1] > widths[2] > 0.0


def test_bounds_in_any_units_and_frame():
    model = ImpulseCorrelation(0.2, excess="saturate", max_events=2)
    here = stopped(FIVE, model).bounds
    for mass, speed in ((2.0**-700, 2.0**520), (2.0**300, 2.0**-400), (1.0, 2.0**-700)):
        chain = Chain(FIVE.masses * mass, FIVE.velocities * speed, FIVE.restitution)
        np.testing.assert_array_equal(stopped(chain, model).bounds, here * speed)
    moving = Chain(FIVE.masses, FIVE.velocities + 1024.0, FIVE.restitution)
    np.testing.assert_allclose(stopped(moving, model).bounds - 1024.0, here, rtol=0, atol=1e-11)


def test_the_message_says_what_is_decided():
    model = ImpulseCorrelation(0.2, excess="saturate", max_events=2)
    for light in (0.2, 0.17974, 0.07518, 0.1234):
        chain = Chain([1, 0.3, light], [1, 0, 0], 1)
        found = stopped(chain, replace(model, max_events=1))
        change = np.abs(found.bounds - found.trace.velocities).max()
        told = float(str(found).split(" by more than ")[1].split()[0])
        assert change <= told < 1.02 * change
        again = pickle.loads(pickle.dumps(found))
        assert str(again) == str(found)
        np.testing.assert_array_equal(again.bounds, found.bounds)


@pytest.mark.parametrize("order", ["left", "right"])
def test_closing_speeds_in_the_message_are_those_of_the_chain(order):
    chain = Chain([1, 2, 1, 3], [1, 0, -1, -1.5], 1)
    found = stopped(chain, SequentialCollisions(order, max_events=1))
    assert found.stored is not None  # what its event loop knows is handed on
    assert f"closing speeds so far {(-np.diff(found.trace.velocities)).tolist()};" in str(found)
