"""Losses by Hunt and Crossley, F = k d^p (1 + A dd/dt): closed form, another integrator, words."""

import itertools

import numpy as np
import pytest
from chains import magnitudes
from hunt_crossley import kept, motion

from cradle import (
    Chain,
    ImpactNotFinished,
    SpringChain,
    collide,
    spring_outcomes,
    spring_velocities,
    viscosity_from,
)
from cradle.kernel.accuracy import MOST_HUNT

LAW = {"damping": "hunt-crossley"}


@pytest.mark.parametrize(("x", "p"), [*itertools.product((0.05, 0.9, 1.5, 9.9), (1.0, 1.5, 2.2))])
def test_two_balls_by_closed_form(x, p):
    """Whatever the masses, the stiffness and the exponent."""
    (left, right), error = spring_outcomes(
        [1.0, 2.5], [0.5, -1.5], 3.0, exponent=p, viscosity=x / 2.0, **LAW, accuracy=1e-9
    )
    assert (right - left) / 2.0 == pytest.approx(kept(x), abs=1e-9)
    assert 0 < error <= 1e-9


@pytest.mark.parametrize("e", [0.11, 0.49, 0.63, 0.9, 1 - 1e-6, 1.0])
def test_viscosity_that_gives_a_restitution(e):
    viscosity = viscosity_from([e, 0.8], speed=2.0, masses=[1, 3, 1], stiffness=1e6, **LAW)
    if e < 0.9999:
        assert kept(2.0 * viscosity[0]) == pytest.approx(e, abs=1e-9)
    law = {"viscosity": viscosity[0], **LAW, "accuracy": 1e-9}
    left, right = spring_velocities([1, 3], [2, 0], 1e6, **law)
    assert (right - left) / 2.0 == pytest.approx(e, abs=1e-9)


@pytest.mark.parametrize("gaps", [(0.0, 0.0), (0.1, 0.3), (-0.1, 0.05), (-0.2, -0.2)])
def test_another_integrator_agrees_on_the_way(gaps):
    """Velocities and forces at every step, as long as the strings' pull acts."""
    m, v, k, loss = np.array([1.0, 0.7, 1.3]), np.array([1.0, 0.0, 0.0]), 2.0, 0.5
    law = SpringChain(k, viscosity=loss, gaps=gaps, **LAW)
    trace = collide(Chain(m, v), law)
    pulled = trace.times[-1] if min(gaps) < 0.0 else np.inf
    some = (trace.step_times >= 0.0) & (trace.step_times < 0.9 * pulled)
    velocities, forces = motion(m, v, k, loss, np.array(gaps), trace.step_times[some])
    assert abs(trace.step_velocities[some] - velocities).max() < 1e-7
    assert abs(trace.step_forces[some] - forces).max() < 1e-5
    lost = 0.5 * (m @ v**2 - m @ trace.velocities**2)
    assert trace.energy_loss == pytest.approx(lost, abs=1e-12)
    assert lost > 0.1
    if pulled == np.inf:
        assert abs(trace.velocities - velocities[-1]).max() < 1e-8


def random_chains(count, seed):
    """Masses and stiffnesses over a decade and a half, losses up to the most, gaps, leans."""
    rng = np.random.default_rng(seed)
    for n in rng.integers(3, 7, count).tolist():
        m, k = (magnitudes(rng, 1.5, size) for size in (n, n - 1))
        gaps = np.full(n - 1, rng.choice([0.0, 0.1, 1.0]))
        gaps[0] = rng.choice([gaps[0], -0.1])
        yield m, k, MOST_HUNT * rng.random(), gaps


def test_accuracy_is_kept():
    """Against a run a hundred times finer; the last one is what SciPy gives, see above."""
    checked = 0
    for m, k, loss, gap in random_chains(60, seed=4):
        law = {"stiffness": k, "viscosity": loss, "gaps": gap, **LAW}
        v = np.eye(len(m))[0]
        try:
            exact = spring_velocities(m, v, **law, accuracy=1e-8)
        except (ValueError, ImpactNotFinished):  # it would pull; leans hold balls together
            continue
        checked += 1
        for accuracy in (1e-2, 1e-4, 1e-6):
            found, error = spring_outcomes(m, v, **law, accuracy=accuracy)
            assert abs(found - exact).max() <= accuracy
            assert 0 < error <= accuracy
    assert checked > 50


def test_one_run_is_enough():
    """Its losses end with the force: no contact opens while it is deep, as viscoelastic ones do."""
    chain = Chain(np.ones(5), np.eye(5)[0])
    runs = {}
    for damping in ("viscoelastic", "hunt-crossley"):
        law = SpringChain(1.0, viscosity=1.0, damping=damping, accuracy=1e-2)
        trace = collide(chain, law)
        runs[damping] = trace.evaluations / len(trace.step_times)
    assert runs["hunt-crossley"] < 1.0 < 1.5 < runs["viscoelastic"]


def test_a_contact_that_would_pull_is_refused():
    """A light ball is hit away from its neighbour faster than 1 / A, while it is still pressed."""
    m, v, k = [30, 0.04, 30, 0.24], [1, 1, -1, 1], [0.76, 1.4, 0.23]
    words = r"viscosity\[0\] = 0.4; must be lower: this contact would pull"
    with pytest.raises(ValueError, match=words):
        spring_velocities(m, v, k, viscosity=0.4, **LAW)
    with pytest.raises(ValueError, match=words):
        collide(Chain(m, v), SpringChain(k, viscosity=0.4, **LAW))
