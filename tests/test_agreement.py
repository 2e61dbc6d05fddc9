"""The solver against two independent programs: the reference solver and the march."""

import functools

import mpmath
import numpy as np
import pytest
from chains import local_orders, random_chains, with_ends, within_bounds
from march import march
from reference import EventLimit, solve

from cradle import Chain, ImpulseCorrelation, collide


def solved(chain, **options):
    masses, velocities, restitution, forward, backward = chain
    options.setdefault("excess", "saturate")
    model = ImpulseCorrelation(forward, backward, **options)
    return collide(Chain(masses, velocities, restitution), model)


def referee(chain, **options):
    options.setdefault("excess", "saturate")
    return solve(*(np.asarray(part).tolist() for part in chain), **options)


def meetings(trace):
    """How often a contact closed between two active ones."""
    started = trace.collisions.copy()
    for kind, c in trace.events:
        started[c] -= kind == "close"
    active, count = set(np.flatnonzero(started).tolist()), 0
    for kind, c in trace.events:
        if kind == "close":
            count += {c - 1, c + 1} <= active
            active.add(c)
        elif kind != "maximum_compression":
            active.discard(c)
    return count


# --- the reference solver ------------------------------------------------------------------


@functools.cache
def generic_chains(n, bounded):
    """Chains of continuous random numbers with the outcomes of both solvers.

    No ties, so that events, path and outcome are all determined.  Ratios stay 2 % off their
    bounds: there, the speed that an ulp of the ratio releases is of the order of its square root.
    """
    rng = np.random.default_rng(n)
    found = []
    for _ in range(120):
        masses = 10 ** rng.uniform(-0.7, 0.7, n)
        velocities = rng.normal(size=n) if rng.random() < 0.7 else np.eye(n)[0]
        restitution = rng.uniform(0.05, 0.95, n - 1)
        if bounded:
            ratios = within_bounds(masses, lambda shape: rng.uniform(0.02, 0.98, shape))
        else:
            ratios = rng.random((2, n - 2))
        chain = masses, velocities, restitution, *ratios
        meeting = rng.choice([0.5, rng.random()])
        try:
            expected = referee(chain, meeting=meeting, number=float, max_events=200)
        except EventLimit:
            continue
        if not expected.collapsed:
            found.append((chain, solved(chain, meeting=meeting), expected))
    return found


both = pytest.mark.parametrize("bounded", [True, False], ids=["within bounds", "saturated"])


@pytest.mark.parametrize("n", [2, 3, 4, 5, 6])
@both
def test_generic_chains_in_every_event(n, bounded):
    assert len(generic_chains(n, bounded)) > 50
    for (masses, velocities, *_), trace, expected in generic_chains(n, bounded):
        speed = np.abs(velocities).max()
        momentum = speed * masses.max()
        np.testing.assert_allclose(
            trace.velocities, expected.velocities, rtol=0, atol=1e-11 * speed
        )
        np.testing.assert_allclose(trace.impulses, expected.impulses, rtol=0, atol=1e-10 * momentum)
        np.testing.assert_allclose(
            trace.absorbed, expected.absorbed, rtol=0, atol=1e-10 * momentum * speed
        )
        assert local_orders(trace.events, n - 1) == local_orders(expected.events, n - 1)
        assert trace.collisions.tolist() == expected.collisions
        assert not trace.collapsed


@pytest.mark.parametrize("n", [3, 4, 5, 6])
@both
def test_held_contacts_are_reported(n, bounded):
    """Held means: kept at u = 0 while it had an impulse, not only for an instant between events."""
    held = [
        (trace.saturated, tuple(sorted(expected.held)))
        for _, trace, expected in generic_chains(n, bounded)
    ]
    assert [one for one, _ in held] == [other for _, other in held]
    assert bounded or any(one for one, _ in held)


@pytest.mark.parametrize("n", [3, 4, 5, 6])
def test_chains_at_the_ends_of_the_ranges(n):
    """e = 0 and 1, ratios 0 and 1, equal masses, balls at rest: ties and exact zeros everywhere."""
    rng = np.random.default_rng(10 + n)
    seen = dict.fromkeys(("finite", "collapsed", "held", "meetings"), 0)
    for _ in range(150):
        ends = with_ends(rng, 0.35)
        masses = np.ones(n) if rng.random() < 0.5 else 10 ** rng.uniform(-0.7, 0.7, n)
        velocities = rng.choice([0, 0, 1, 0.5, -1], n) if rng.random() < 0.5 else np.eye(n)[0]
        restitution = ends(n - 1)
        chain = masses, velocities, restitution, ends(n - 2), ends(n - 2)
        try:
            expected = referee(chain, number=float, max_events=2000)
        except EventLimit:
            continue
        # Like the reference, give up only after far more events than it needed.
        trace = solved(chain, max_events=1_000_000)
        if np.abs(trace.velocities - expected.velocities).max() > 1e-10:
            # In floats a rounding error of the reference may undo a tie; fifty digits know.
            with mpmath.workdps(50):
                exact = [float(v) for v in referee(chain, max_events=20_000).velocities]
            np.testing.assert_allclose(trace.velocities, exact, rtol=0, atol=1e-10)
        seen["finite"] += not expected.collapsed
        seen["collapsed"] += expected.collapsed
        seen["held"] += bool(expected.held)
        seen["meetings"] += expected.meetings > 0
    assert seen["finite"] > 60
    assert seen["held"] > 30
    if n > 3:
        assert min(seen.values()) > 5, seen


def test_fifty_digits():
    """The solver's own rounding: against ground truth, a few ulp for each of up to 60 events."""
    rng = np.random.default_rng(50)
    compared = 0
    with mpmath.workdps(50):
        for n in [3, 4, 5, 6] * 12:
            chain = [part[0] for part in random_chains(rng, 1, n, decades=1)]
            chain[2] = rng.uniform(0.1, 0.9, n - 1)
            chain[3:] = within_bounds(chain[0], lambda shape: rng.uniform(0.02, 0.95, shape))
            try:
                expected = referee(chain, max_events=60)
            except EventLimit:
                continue
            trace = solved(chain)
            compared += 1
            error = max(abs(v - float(w)) for v, w in zip(trace.velocities, expected.velocities))
            assert error < 1e-13 * np.abs(chain[1]).max()
            assert local_orders(trace.events, n - 1) == local_orders(expected.events, n - 1)
    assert compared > 35


# --- the march -----------------------------------------------------------------------------

STEPS = (200, 800, 3200)
ENOUGH = 16


def sample(kind, seed):
    """Random chains of a kind, each with the solver's outcome."""
    rng = np.random.default_rng(seed)
    found = []
    while len(found) < ENOUGH:
        n = kind if isinstance(kind, int) else int(rng.integers(3, 7))
        masses = 10 ** rng.uniform(-0.5, 0.5, n)
        velocities = rng.normal(size=n) if rng.random() < 0.5 else np.eye(n)[0]
        restitution = rng.uniform(0.2, 1, n - 1)
        if kind == "held":
            ratios = rng.random((2, n - 2))
        else:
            ratios = within_bounds(masses, lambda shape: rng.uniform(0, 0.95, shape))
        chain = masses, velocities, restitution, *ratios
        trace = solved(chain)
        # The march has no rule R9, and needs a step far smaller than the last of many collisions.
        if trace.collapsed or not 1 < len(trace.events) < 40:
            continue
        if (
            isinstance(kind, int)
            or (kind == "two runs meet" and meetings(trace))
            or (kind == "held" and trace.saturated)
            or (kind == "close many times" and trace.collisions.max() >= 4)
        ):
            found.append((chain, trace.velocities))
    return found


@pytest.mark.parametrize("kind", [2, 3, 4, 5, 6, "two runs meet", "held", "close many times"])
def test_march_converges_to_the_solver_at_first_order(kind):
    """The mean over chains: the error of one chain depends on where its steps fall."""
    chains = sample(kind, seed=11)
    errors = [
        np.mean([abs(march(*chain, steps=k).velocities - v).max() for chain, v in chains])
        for k in STEPS
    ]
    order = -np.polyfit(np.log(STEPS), np.log(errors), 1)[0]
    print(f"{kind}: errors {np.array(errors)}, order {order:.3f}")
    assert 0.8 < order < 1.2
    assert errors[-1] < 4e-4
