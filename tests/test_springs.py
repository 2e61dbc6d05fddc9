"""Contact forces: closed forms, an independent integrator, published values, accuracy, bits."""

import csv
import itertools
import math
from pathlib import Path

import numpy as np
import pytest
import tqdm
from chains import SPRINGS, magnitudes, striking, uniform
from dop853 import integrated
from families import struck
from hypothesis import given
from hypothesis import strategies as st
from kernels import needs_numba
from mpmath import zeta
from scipy.integrate import quad
from scipy.special import gamma

from cradle import (
    Chain,
    EnergyDistribution,
    ImpactNotCertified,
    ImpactNotFinished,
    SpringChain,
    collide,
    hertz_stiffness,
    spring_outcomes,
    spring_velocities,
    viscosity_from,
)
from cradle.kernel import accuracy as control
from cradle.kernel import kinks
from cradle.kernel.state import REFUSED, UNFINISHED, UNSOUND
from cradle.models import compliant
from cradle.runtime import compile as runtime
from cradle.runtime import job


def read(cells):
    """Masses, velocities, stiffness, exponent, viscosity, gaps: a number alone is one for all."""
    parts = ([float(x) for x in cells[name].split()] for name in list(cells)[3:])
    return [part if len(part) > 1 else part[0] for part in parts]


with Path(__file__).with_name("spring_chains.csv").open(encoding="utf-8", newline="") as file:
    ROWS = list(csv.DictReader(file))
#: By law and name.
CHAINS = {law: {} for law in ("plain", "missed its accuracy once", "fourth order")}
for row in ROWS:
    CHAINS[row["law"]][row["chain"]] = read(row)
PLAIN, MISSED, LOSSY = CHAINS.values()


@pytest.mark.parametrize("case", (PLAIN | MISSED).values(), ids=PLAIN | MISSED)
def test_another_integrator_agrees_to_the_accuracy_asked_for(case):
    m, v, k, p, loss, gaps = case
    exact, law = integrated(*case), {"exponent": p, "viscosity": loss, "gaps": gaps}
    scale = max(a - b for a, b in itertools.pairwise(v))
    for accuracy in (1e-2, 1e-4, 1e-6, 1e-8):
        found = spring_velocities(m, v, k, **law, accuracy=accuracy)
        assert abs(found - exact).max() <= accuracy * scale
    trace = collide(Chain(m, v), SpringChain(k, **law, accuracy=1e-8))
    assert abs(trace.velocities - exact).max() <= 1e-8 * scale
    assert 0 < trace.error <= 1e-8
    passed = np.concatenate([[0], trace.impulses, [0]])
    np.testing.assert_allclose(trace.velocities - v, (passed[:-1] - passed[1:]) / m, atol=1e-12)
    # What the viscosity takes and what the springs give back is what the balls have lost.
    before, after = 0.5 * np.dot(m, np.square(v)), 0.5 * np.dot(m, np.square(trace.velocities))
    if np.min(gaps) >= 0:
        assert trace.energy_loss == pytest.approx(before - after, abs=1e-7)


# --- closed forms and published values ------------------------------------------------------


@pytest.mark.parametrize(("masses", "exponent", "velocities"), SPRINGS)
def test_converged_values(masses, exponent, velocities):
    """Five equal ones are Herrmann and Schmaelzle's, Am. J. Phys. 49 (1981) 761."""
    for accuracy in (1e-9, 1e-12):
        trace = collide(striking(masses), SpringChain(1.0, exponent, accuracy=accuracy))
        np.testing.assert_allclose(trace.velocities, velocities, rtol=0, atol=1.6e-9)


@pytest.mark.parametrize("ratio", [0.2, 1.0, 4.0])
def test_three_linear_balls_follow_equations_7_to_11(ratio):
    """Equal balls, springs k and ratio k: two harmonics while both contacts are closed."""
    k = np.array([2.0, 2.0 * ratio])
    trace = collide(striking(), SpringChain(k, 1, accuracy=1e-12))
    rows = [event.kind for event in trace.events].index("end") + 2
    # Displacements q: q'' = -K q. The eigenvalues of K are those of Eqs. 7-9, and zero; the initial
    # velocity (1, 0, 0) is 1/3 for all plus its parts along the other two eigenvectors.
    root = math.sqrt(1 - ratio + ratio**2)
    values = np.array([1 + ratio - root, 1 + ratio + root])
    vectors = np.array([np.ones(2), 1 - values, values - 2])
    omega = np.sqrt(k[0] * values)
    parts = vectors * vectors[0] / (vectors**2).sum(axis=0)
    phase = np.outer(trace.times[:rows], omega)
    velocities = 1 / 3 + np.cos(phase) @ parts.T
    # A kink leaves h^3 on the way.
    np.testing.assert_allclose(trace.path[:rows], velocities, rtol=0, atol=2e-9)
    closer = parts[:-1] - parts[1:]
    forces = k * (np.sin(phase) @ (closer / omega).T)
    np.testing.assert_allclose(trace.forces[:rows], forces, rtol=0, atol=2e-9)
    # Eqs. 10 and 11, with the sign that makes a push positive.
    impulses = k * ((1 - np.cos(phase)) @ (closer / omega**2).T)
    np.testing.assert_allclose(trace.path_impulses[:rows], impulses, rtol=0, atol=2e-9)


@pytest.mark.parametrize("exponent", [1, 1.2, 1.5, 2, 3])
def test_two_balls(exponent):
    """Relative velocity reversed; depth and duration, those of Hertz for p = 3/2."""
    m1, m2, k, speed = 2.0, 3.0, 50.0, 0.7
    chain = Chain([m1, m2], [1 + speed, 1], 1)
    trace = collide(chain, SpringChain(k, exponent, accuracy=1e-12))
    mu = m1 * m2 / (m1 + m2)
    assert trace.velocities[1] - trace.velocities[0] == pytest.approx(speed, rel=1e-11)
    assert trace.impulses[0] == pytest.approx(2 * mu * speed, rel=1e-11)
    assert trace.absorbed[0] == pytest.approx(mu * speed**2 / 2, rel=1e-9)
    assert trace.path[1, 0] == pytest.approx(trace.path[1, 1], abs=1e-12)
    # Energy: mu u^2 / 2 + k d^(p+1) / (p+1) = mu U^2 / 2, so the largest compression is
    deepest = ((exponent + 1) * mu * speed**2 / (2 * k)) ** (1 / (exponent + 1))
    assert trace.forces[1, 0] == pytest.approx(k * deepest**exponent, rel=1e-9)
    assert trace.step_forces.max() <= trace.forces[1, 0] * (1 + 1e-9)
    # and the time is twice the integral of dd / u with u = U sqrt(1 - (d / deepest)^(p+1)): a beta
    # function. For p = 3/2 the factor is Hertz's 2.943, for p = 1 it is pi.
    beta = gamma(1 + 1 / (exponent + 1)) / gamma(0.5 + 1 / (exponent + 1))
    factor = 2 * math.sqrt(math.pi) * beta
    assert round(factor, 3) == {1: 3.142, 1.5: 2.943}.get(exponent, round(factor, 3))
    assert trace.durations[0] == pytest.approx(factor * deepest / speed, rel=1e-9)
    assert trace.times.tolist()[1:] == pytest.approx([trace.durations[0] / 2, trace.durations[0]])


@pytest.mark.parametrize("loss", [0.005, 0.01, 0.02, 0.04])
def test_viscoelastic_spheres_follow_their_expansion(loss):
    """Ramirez, Poeschel, Brilliantov and Schwager 1999: e = 1 - C1 x + C2 x^2 - C3 x^3 + C4 x^4.

    x = 3/2 A (k / mu)^(2/5) u^(1/5).  They let the contact pull until d = 0.  Here it ends at
    d = 3/2 A u, which spares x^(5/2) / (15/4), to first order (Schwager and Poeschel 2008).
    """
    v = spring_velocities([1, 1], [1, 0], viscosity=loss, accuracy=1e-8)
    x = 1.5 * loss * 2**0.4
    lost = quad(lambda d: math.sqrt(d) * math.sqrt(1 - d**2.5), 0, 1)[0]
    c1 = 2 * (5 / 4) ** 0.6 * lost
    assert c1 == pytest.approx(1.15344, abs=1e-5)
    series = 1 - c1 * x + 0.6 * (c1 * x) ** 2 - 0.315119 * (c1 * x) ** 3 + 0.161167 * (c1 * x) ** 4
    assert v[1] - v[0] == pytest.approx(series + x**2.5 / 3.75, abs=x**3.5)


def test_viscosity_from_a_restitution_at_a_speed():
    """Each pair alone parts with it, by the loop and on linear springs by the closed form."""
    e, speed, masses = [0.97, 0.7, 1.0], 0.3, np.array([0.045, 0.1, 0.02, 0.02])
    stiffness = [1e10, 2e9, 1e10]
    found = viscosity_from(e, speed=speed, masses=masses, stiffness=stiffness)
    for c, wanted in enumerate(e):
        law = {"stiffness": stiffness[c], "viscosity": found[c], "accuracy": 1e-9}
        left, right = spring_velocities(masses[c : c + 2], [speed, 0], **law)
        assert (right - left) / speed == pytest.approx(wanted, abs=1e-8)
    # Rows of chains have what each of them has alone, to the last bit.
    rows = viscosity_from(e, speed=speed, masses=[masses, 2 * masses], stiffness=stiffness)
    alone = viscosity_from(e, speed=speed, masses=2 * masses, stiffness=stiffness)
    assert rows.tolist() == [found.tolist(), alone.tolist()]
    # d'' + w^2 (d + A d') = 0 with z = A w / 2: d ~ exp(-z w t) sin(q w t), q = sqrt(1 - z^2).  The
    # bracket is zero where tan(q w t) = -2 z q / (1 - 2 z^2), and there d' is -exp(-z w t).
    m, k, wanted = 1.5, 7.0, 0.8
    damping = viscosity_from(wanted, speed=2, masses=[2 * m] * 2, stiffness=k, exponent=1)[0]
    zeta = 0.5 * damping * math.sqrt(k / m)
    angle = math.pi - math.atan2(2 * zeta * math.sqrt(1 - zeta**2), 1 - 2 * zeta**2)
    parting = math.exp(-zeta * angle / math.sqrt(1 - zeta**2))
    assert parting == pytest.approx(wanted, abs=1e-9)


def test_stiffness_of_spheres_of_a_material():
    """Hertz: F = 4/3 E* R*^(1/2) d^(3/2), 1/R* = 1/R + 1/R', 1/E* likewise of E/(1 - nu^2)."""
    radii = np.array([[0.011, 0.02, 1e-3], [0.3, 0.3, 0.5]])
    k = hertz_stiffness(radii, 70e9, 0.33)
    for row, found in zip(radii, k, strict=True):
        for left, right, one in zip(row, row[1:], found, strict=False):
            size, modulus = 1 / (1 / left + 1 / right), 1 / (2 * (1 - 0.33**2) / 70e9)
            assert one == pytest.approx(4 / 3 * modulus * math.sqrt(size), rel=1e-14)
    assert hertz_stiffness([0.01, 0.01])[0] == pytest.approx(1.0878e10, rel=1e-4)


@pytest.mark.parametrize("n", [10, 20, 40])
def test_fast_balls_of_a_long_chain(n):
    """Hinch and Saint-Jean 1999: about 1.5 N^(1/3) balls fly off, the others rebound slowly."""
    after = spring_velocities([1] * n, struck(n), accuracy=1e-6)
    assert (after > 0).sum() == pytest.approx(1.5 * n ** (1 / 3), abs=0.3)
    trace = collide(Chain([1] * n, struck(n)), SpringChain())
    assert trace.collisions.tolist() == [1] * (n - 1)


# --- accuracy and laws on random chains -----------------------------------------------------


def random_chains(seed, count, n, loss=0.0):
    """Masses over two decades, stiffnesses over one, gaps in a third of the contacts."""
    rng = np.random.default_rng(seed)
    m, k = magnitudes(rng, 2, (count, n)), magnitudes(rng, 1, (count, n - 1))
    v = np.where(rng.random((count, 1)) < 0.5, struck(n), uniform(rng, -1, 1, (count, n)))
    v[:, 0], v[:, 1] = 1.0, np.minimum(v[:, 1], 0.5)  # somebody closes
    gaps = np.where(rng.random((count, n - 1)) < 0.3, uniform(rng, 0, 0.3, (count, n - 1)), 0.0)
    # Gaps and losses in the units of the contact that closes fastest.
    at = np.arange(count), (v[:, :-1] - v[:, 1:]).argmax(axis=1)
    speed, mass = (v[:, :-1] - v[:, 1:])[at], 1 / (1 / m[:, :-1] + 1 / m[:, 1:])[at]
    depth = (mass * speed**2 / k[at]) ** 0.4
    times = loss * uniform(rng, 0.3, 1, (count, n - 1))
    return m, v, k, gaps, times * (depth / speed)[:, None]


@needs_numba
@pytest.mark.parametrize(
    ("p", "loss"),
    [(1.5, 0), (1.5, 0.5), (1.5, 9), (1.0, 0), (1.0, 0.5), (1.0, 3), (2.2, 0), (2.2, 0.4)],
)
@pytest.mark.parametrize("n", [3, 5, 8])
def test_accuracy_is_kept_on_random_chains(monkeypatch, p, loss, n):
    """Against the same loop asked for a hundred times more; the seeds were not used for tuning."""
    monkeypatch.setenv(runtime.VARIABLE, "compiled")
    m, v, k, gaps, lost = random_chains(300 + n, 200, n, loss)
    options = {"exponent": p, "viscosity": lost, "gaps": gaps}
    finer = spring_velocities(m, v, k, **options, accuracy=1e-7 if not loss else 1e-6)
    speed = (v[:, :-1] - v[:, 1:]).max(axis=1)
    for accuracy in (1e-2, 1e-3, 1e-4):
        found, told = spring_outcomes(m, v, k, **options, accuracy=accuracy)
        off = abs(found - finer).max(axis=1) / speed
        assert off.max() <= accuracy >= told.max()
        assert (off > told).mean() < 0.02  # an estimate, hardly ever too low
        np.testing.assert_allclose((m * (found - v)).sum(axis=1), 0, atol=1e-12)
        assert (np.diff(found, axis=1) >= -0.01 * accuracy * speed[:, None]).all()


@pytest.mark.parametrize("count", [4, pytest.param(100, marks=pytest.mark.exhaustive)])
@pytest.mark.parametrize("p", [1.0, 1.5, 2.2])
@pytest.mark.parametrize("leans", [False, True])
def test_another_integrator_agrees_on_random_chains(leans, p, count):
    """A finer run of the same loop may be as wrong: with leans and losses every fourth was."""
    checked = 0
    for m, v, k, gaps, lost in zip(*random_chains(17, count, 4, 0.3), strict=True):
        gap = np.where(gaps > 0, 0.0, -0.01) if leans else gaps
        law = {"exponent": p, "viscosity": lost, "gaps": gap}
        try:
            found = spring_velocities(m, v, k, **law, accuracy=1e-5)
            exact = integrated(m, v, k, p, lost, gap)
        except (ImpactNotFinished, AssertionError):  # leans hold balls together
            continue
        speed = (v[:-1] - v[1:]).max()
        if leans and np.diff(found).min() < 1e-6 * speed:  # when two are called at rest decides
            continue
        checked += 1
        assert abs(found - exact).max() <= 1e-5 * speed
    assert checked > 0.7 * count


def test_a_batch_tells_the_error_of_each_chain():
    m, v, k, gaps, lost = random_chains(5, 4, 4, 0.1)
    options = {"exponent": 1.5, "accuracy": 1e-5}
    found = spring_outcomes(m, v, k, viscosity=lost, gaps=gaps, **options)
    assert found[1].shape == (4,)
    for row, velocities, error in zip(zip(m, v, k, lost, gaps, strict=True), *found, strict=True):
        model = SpringChain(row[2], viscosity=row[3], gaps=row[4], **options)
        alone = collide(Chain(*row[:2]), model)
        assert (alone.velocities.tolist(), alone.error) == (velocities.tolist(), error)


@needs_numba
def test_runs_that_hardly_agree_are_no_answer_where_balls_swing_long(monkeypatch):
    """With a margin as without leans the first was off by 2.8 thousandths.

    The second, of which few kinks but many radians warn, changes by .03 with its last digits.
    """
    monkeypatch.setenv(runtime.VARIABLE, "compiled")
    k = [0.97221032, 0.78741852, 0.51519862, 0.69822231, 1.6037132, 0.40883794, 0.57152675]
    gaps = [0, 0.11185776, 0.2203687, -0.019546423, -0.22297702, 0.092287725, 0]
    with pytest.raises(ImpactNotFinished, match="or leans hold balls together"):
        spring_velocities([1] * 8, struck(8), k, gaps=gaps, accuracy=1e-3)
    k, gaps = [0.33, 0.97, 0.61, 0.95], [0, -0.0042, -0.1, 0]
    with pytest.raises(ImpactNotFinished, match="or leans hold balls together"):
        spring_velocities([0.76, 6.3, 0.18, 2.2, 2.5], struck(5), k, gaps=gaps, accuracy=1e-2)


def test_a_chain_of_a_batch_that_is_refused_is_solved_once_more(monkeypatch):
    follow, calls = compliant.follow, []
    monkeypatch.setattr(compliant, "follow", lambda *a, **q: calls.append(a) or follow(*a, **q))
    with pytest.raises(ImpactNotFinished, match="or leans hold balls together"):
        spring_velocities([1] * 5, struck(5), exponent=1, gaps=-0.03)
    assert len(calls) == 2


def test_what_still_swings_is_not_at_rest_while_another_contact_comes_back():
    m, gaps = [0.157, 1.43, 0.452, 0.125], [0, -0.221, -0.000739]
    law = {"stiffness": [0.902, 0.356, 1.95], "viscosity": 0.0654, "gaps": gaps}
    rough, fine = (spring_velocities(m, struck(4), **law, accuracy=x) for x in (1e-2, 1e-4))
    assert abs(rough - fine).max() <= 1e-2


@pytest.mark.parametrize(
    ("best", "m", "k", "p", "loss"),
    [
        (1e-5, [1.42, 3.77, 0.182, 0.385], [1.52, 0.414, 3.84], 1.0, [0.179, 0.102, 0.18]),
        (1e-6, [1.7, 7.56, 2.92, 0.224], [0.354, 1.6, 2.82], 1.5, [0.725, 0.776, 0.675]),
        (1e-6, [0.318, 4.05, 1.17, 0.386, 0.138], [0.418, 0.362, 0.275, 1.02], 1.5,
         [0.4, 0.391, 0.397, 0.271]),
    ],
)  # fmt: skip
def test_a_swing_that_dies_out_ends_alike_at_any_accuracy(best, m, k, p, loss):
    """The last two lean and swing, while the first fly apart under the pull of their strings."""
    gaps = np.where(np.arange(len(k)) == len(k) - 2, 0.0, -0.01)
    law = {"stiffness": k, "exponent": p, "viscosity": loss, "gaps": gaps}
    best = spring_velocities(m, struck(len(m)), **law, accuracy=best)
    for accuracy in (1e-2, 1e-3, 1e-4):
        found = spring_velocities(m, struck(len(m)), **law, accuracy=accuracy)
        assert abs(found - best).max() <= accuracy


def test_what_the_pull_of_strings_takes_is_lost_too():
    """Elastic balls that lean lose motion, though no viscosity takes it."""
    chain = Chain([1] * 5, struck(5))
    trace = collide(chain, SpringChain(gaps=[-0.1, 0, 0, 0]))
    np.testing.assert_array_equal(trace.step_velocities[-1], trace.velocities)
    left = 0.5 * float(trace.velocities @ trace.velocities)
    assert trace.energy_loss == pytest.approx(chain.kinetic_energy - left, abs=1e-12)
    assert trace.energy_loss > 1e-3
    assert collide(chain, SpringChain(gaps=0.1)).energy_loss == 0.0


@needs_numba
@pytest.mark.parametrize("name", [*LOSSY, *(n for n in MISSED if n != "swings long")])
def test_losses_and_leans_leave_the_fourth_order(monkeypatch, name):
    """Of the largest error of runs that meet their kinks at any part of a step."""
    monkeypatch.setenv(runtime.VARIABLE, "compiled")
    m, v, k, p, loss, gaps = (LOSSY | MISSED)[name]
    exact = np.diff(integrated(m, v, k, p, loss, gaps))
    rows = (np.broadcast_to(np.array(x, float), (1, len(m) - 1)).copy() for x in (k, loss, gaps))
    row = kinks.Springs(np.array([m]), np.array([v]), *rows)

    def error(h):
        out, pages = job.motions(1, len(m)), []
        out.h[0], out.slow[0] = h, kinks.FAINT * 1e-7
        clock = job.follow(row, kinks.Law(1.5, 1e-7, 1e6), out, record=pages)[2]
        return abs(clock["speed"] * np.diff(pages[-1][-1, 1]) - exact).max(), clock["top"]

    omega = math.sqrt(error(0.1)[1])
    largest = [
        max(error(radians / omega * part)[0] for part in np.linspace(0.95, 1.05, 41))
        for radians in (0.16, 0.04)
    ]
    assert largest[0] <= (0.05 if name in LOSSY else 2.0) * 0.16**4
    assert largest[1] <= largest[0] / 4**3.3
    if name == "opened and closed within a step":
        assert max(error(h)[0] for h in np.linspace(0.13, 0.155, 40)) <= 0.01


@pytest.mark.parametrize("light", [1e-3, 1e-4])
def test_a_light_ball_that_swings_often_amplifies_no_error(light):
    """Each swing adds to the error: from some on two runs are compared."""
    chain = striking([1, light, 1])
    exact = collide(chain, EnergyDistribution(rtol=1e-13)).velocities
    found = collide(chain, SpringChain(accuracy=1e-4)).velocities
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-4)


def test_units_a_boost_and_a_mirror_change_nothing_else():
    m, v, k, gaps, loss = random_chains(7, 5, 4, 0.2)
    usual = spring_velocities(m, v, k, gaps=gaps, viscosity=loss)
    # kg, m/s, m: powers of two, of four for the length.
    mass, speed, length = 8.0, 0.5, 16.0
    second, unit = length / speed, mass * speed**2 / length**2.5
    other = {"gaps": length * gaps, "viscosity": second * loss}
    found = spring_velocities(mass * m, speed * v, k * unit, **other)
    np.testing.assert_allclose(found / speed, usual, rtol=0, atol=1e-12)
    moving = spring_velocities(m, v + 1000.0, k, gaps=gaps, viscosity=loss)
    np.testing.assert_allclose(moving - 1000.0, usual, rtol=0, atol=1e-9)
    m_, v_, k_, gaps_, loss_ = (x[:, ::-1] for x in (m, -v, k, gaps, loss))
    mirrored = spring_velocities(m_, v_, k_, gaps=gaps_, viscosity=loss_)
    np.testing.assert_allclose(-mirrored[:, ::-1], usual, rtol=0, atol=1e-10)
    trace = collide(Chain(m[0], v[0]), SpringChain(k[0], viscosity=loss[0], accuracy=1e-6))
    model = SpringChain(k[0] * unit, viscosity=second * loss[0], accuracy=1e-6)
    far = collide(Chain(mass * m[0], speed * v[0]), model)
    joule = mass * speed**2
    for name, scale in (("times", second), ("forces", joule / length), ("absorbed", joule)):
        expected = getattr(trace, name)
        np.testing.assert_allclose(getattr(far, name) / scale, expected, rtol=1e-9, atol=1e-12)


def test_far_scales_and_what_the_impact_does_not_reach():
    usual = spring_velocities([1, 2, 1], [1, 0, 0])
    far = spring_velocities(np.ldexp([1.0, 2, 1], 400), np.ldexp([1.0, 0, 0], -300), 1e-140)
    np.testing.assert_allclose(np.ldexp(far, 300), usual, rtol=0, atol=1e-14)
    # The square of the speed times m / k is too small or too large for a double.
    for mass, speed, k in (1e-250, 1e-40, 1.0), (1e250, 1e-30, 1e-200), (1.0, 1e-200, 1e-100):
        far = spring_velocities(mass * np.array([1.0, 2, 1]), [speed, 0, 0], k)
        np.testing.assert_allclose(far / speed, usual, rtol=0, atol=1e-13)
    assert spring_velocities([1, 2, 3], [-1, 0, 0.5]).tolist() == [-1, 0, 0.5]
    trace = collide(Chain([1] * 5, [0.7, 0.1, 1.1, 1.1, 1.1]), SpringChain())
    assert trace.velocities[2:].tolist() == [1.1, 1.1, 1.1]
    assert trace.collisions.tolist() == [1, 0, 0, 0]
    trace = collide(Chain([1, 2, 3], [-1, 0, 0]), SpringChain())
    assert (trace.path.tolist(), trace.times.tolist()) == ([[-1, 0, 0]], [0])
    assert (trace.events, trace.durations.any(), trace.evaluations) == ((), False, 0)


def test_the_front_of_a_wave_is_watched_from_where_it_is_felt(monkeypatch):
    """Ahead of it compressions fall by powers: watched as well, they would make long rows slow."""
    monkeypatch.setenv("CRADLE_KERNEL", "plain")
    n = 100
    ones, out = np.ones((1, n - 1)), job.motions(1, n)
    law = kinks.Law(1.5, 1e-2, 1e7)
    row = kinks.Springs(np.ones((1, n)), np.eye(n)[:1], ones, 0 * ones, 0 * ones)
    job.follow(row, law, out)
    assert out.steps[0] < 3.5 * n


def test_balls_that_fly_apart_far_faster_than_others_close():
    """Their energy bounds a frequency, by a power that no double holds."""
    for speed in (1e9, 1e15):
        v = spring_velocities([1e9, 1, 1, 1e9], [-speed, 1, 0, speed], exponent=10)
        assert v == pytest.approx([-speed, 0, 1, speed], rel=1e-15, abs=1e-3)


def test_a_step_has_half_the_digits_of_a_double(monkeypatch):
    """The last ones of a power may depend on the machine, and the outcome would with them."""
    monkeypatch.setenv(runtime.VARIABLE, "plain")
    steps, aim = [], control.aim

    def aimed(n, law, s, clock):
        aim(n, law, s, clock)
        steps.append(clock.h)

    monkeypatch.setattr(control, "aim", aimed)
    for p in (1.0, 1.2, 1.5, 2.2):
        spring_velocities([1, 2], [1, 0], exponent=p, accuracy=1e-2)
    assert [(math.frexp(h)[0] * 2**27) % 1 for h in steps] == [0, 0, 0, 0]


def test_most_short_rows_need_one_run(monkeypatch):
    """The first step is for balls that differ: with that for equal ones half of them need two."""
    monkeypatch.setenv(runtime.VARIABLE, "plain")
    runs, aim, begin = [], control.aim, control.begin
    monkeypatch.setattr(control, "aim", lambda *given: runs.append(0) or aim(*given))

    def begun(*given):
        runs[-1] += 1
        begin(*given)

    monkeypatch.setattr(control, "begin", begun)
    m = 0.5 + 1.5 * np.random.default_rng(3).random((60, 5))
    spring_velocities(m, struck(5), accuracy=1e-3)
    assert runs.count(1) > 0.85 * len(m)


@needs_numba
@pytest.mark.parametrize("n", [12, 20])
def test_long_rows_that_close_together_keep_their_accuracy(n, monkeypatch):
    """The error grows with how much all balls close, not with the fastest closing of a contact."""
    monkeypatch.setenv(runtime.VARIABLE, "compiled")
    rng = np.random.default_rng(5)
    v, m = np.sort(rng.random((200, n)), axis=1)[:, ::-1], magnitudes(rng, 1, (200, n))
    speed = (v[:, :-1] - v[:, 1:]).max(axis=1, keepdims=True)
    exact = spring_velocities(m, v, accuracy=1e-8)
    for accuracy in (1e-3, 1e-4):
        found, told = spring_outcomes(m, v, accuracy=accuracy)
        off = (abs(found - exact) / speed).max(axis=1)
        assert off.max() < 0.7 * accuracy
        assert (off < told).all()


@needs_numba
def test_a_run_that_is_compared_has_a_step_much_finer_than_the_one_before(monkeypatch):
    """Else the two agree by nearness; long rows, in which balls collide often, show it."""
    monkeypatch.setenv(runtime.VARIABLE, "compiled")
    m, k = (magnitudes(np.random.default_rng(21), 1, (60, n)) for n in (20, 19))
    v = np.tile(np.eye(20)[0], (60, 1))
    exact = spring_velocities(m, v, k, accuracy=1e-8)
    for accuracy in (1e-2, 1e-3):
        off = abs(spring_velocities(m, v, k, accuracy=accuracy) - exact).max()
        assert off < 0.5 * accuracy


@needs_numba
@pytest.mark.parametrize(("seed", "accuracy"), [(135, 1e-2), (348, 3e-3), (372, 1e-3)])
def test_rows_that_amplify_a_thousandfold(monkeypatch, seed, accuracy):
    """Two runs are compared with care; what they leave out as too slow shrinks with the step."""
    monkeypatch.setenv(runtime.VARIABLE, "compiled")
    rng, n = np.random.default_rng(seed), 30
    m, k = (uniform(rng, 0.8, 1.25, size) for size in (n, n - 1))
    gaps = uniform(rng, 0, 1, n - 1)
    law = {"stiffness": k, "gaps": gaps * gaps * gaps}
    v = (np.arange(n) < 3) * 1.0
    exact = spring_velocities(m, v, **law, accuracy=1e-6)
    found = spring_velocities(m, v, **law, accuracy=accuracy)
    assert abs(found - exact).max() < 0.5 * accuracy
    trace = collide(Chain(m, v), SpringChain(**law, accuracy=accuracy))
    np.testing.assert_array_equal(trace.path[-1], found)  # the run that is recorded is the last


@needs_numba
@pytest.mark.parametrize(
    ("light", "p", "accuracy"), [(1e-4, 1, 1e-2), (1e-5, 1, 1e-3), (1e-6, 1.5, 1e-2)]
)
def test_a_light_ball_passes_on_what_hardly_presses_it(monkeypatch, light, p, accuracy):
    """The contact behind it is compressed by less than is noticed, yet it is thrown ahead."""
    monkeypatch.setenv(runtime.VARIABLE, "compiled")
    m, v = [1, 1, light, 1], [1, 0, 0, 0]
    exact = spring_velocities(m, v, exponent=p, accuracy=1e-8)
    for order in (slice(None), slice(None, None, -1)):
        sign = 1 if order.step is None else -1
        found = spring_velocities(
            m[order], [sign * u for u in v[order]], exponent=p, accuracy=accuracy
        )
        assert abs(sign * found[order] - exact).max() < 0.1 * accuracy
    # The light ball is a spring: two contacts in a row, as soft together as half of one.
    three = spring_velocities([1, 1, 1], v[:3], [1.0, 0.5**p], exponent=p, accuracy=1e-8)
    assert exact[[0, 1, 3]] == pytest.approx(three, abs=20 * light)


def test_a_run_leaves_out_less_than_the_one_it_is_compared_with(monkeypatch):
    """Also where that one was a little too coarse to count: else they agree on an error."""
    monkeypatch.setenv(runtime.VARIABLE, "plain")
    judge, left_out = control.judge, []

    def judged(n, law, change, s, clock):
        slow = clock.slow
        more = judge(n, law, change, s, clock)
        if more and clock.coarser > 0.0:
            left_out.append(clock.slow / slow)
        return more

    monkeypatch.setattr(control, "judge", judged)
    for accuracy in np.geomspace(1e-2, 1e-3, 8):
        spring_velocities([1000, 1, 1, 1000], [1, 0, 0, -1], gaps=5, accuracy=accuracy)
    assert len(left_out) >= 8
    assert max(left_out) < 0.5


@needs_numba
def test_balls_that_nothing_touches_spoil_no_answer(monkeypatch):
    """A long row may have more kinks before runs are compared; they do not make it long."""
    monkeypatch.setenv(runtime.VARIABLE, "compiled")
    rng, light = np.random.default_rng(3), [1e-5] * 95
    m, k = (magnitudes(rng, spread, (3000, size))[1181] for spread, size in ((2, 8), (1, 7)))
    root = uniform(rng, 0, 1, (3000, 7))[1181]
    gaps = root * root + 1e-6
    exact = spring_velocities(m, struck(8), k, gaps=gaps, accuracy=1e-6)
    v, ahead = [*struck(8), *(5 + 0.01 * np.arange(95))], [*gaps, *[1.0] * 95]
    found = spring_velocities([*m, *light], v, [*k, *light], gaps=ahead, accuracy=1e-2)
    assert abs(found[:8] - exact).max() < 5e-3


def test_leading_axes_broadcast():
    v = np.array([[1.0, 0, 0], [1.0, 0.5, 0], [0, 0, -1.0]])
    found = spring_velocities(np.ones((2, 1, 3)), v, [1.0, 2.0], gaps=[[[0.1, 0]], [[0.0, 0]]])
    assert found.shape == (2, 3, 3)
    alone = spring_velocities([1, 1, 1], v[1], [1.0, 2.0], gaps=[0.1, 0.0])
    assert found[0, 1].tobytes() == alone.tobytes()
    assert spring_velocities(np.ones((0, 3)), [1, 0, 0]).shape == (0, 3)


# --- the trace ------------------------------------------------------------------------------


@given(st.data())
def test_what_every_trace_keeps(data):
    n, part = data.draw(st.integers(2, 5)), st.floats(-1, 1)
    rows = [[10.0 ** data.draw(part) for _ in range(size)] for size in (n, n - 1)]
    speeds = st.sampled_from([0.0, 1.0, -1.0]) | part.map(lambda v: round(v, 3))
    v = [data.draw(speeds) for _ in rows[0]]
    chain, p = Chain(rows[0], v), data.draw(st.sampled_from([1, 1.5, 2.5]))
    trace = collide(chain, SpringChain(rows[1], p, accuracy=1e-6))
    m, after, scale = chain.masses, trace.velocities, max(chain.closing_speeds.max(), 0)
    passed = np.concatenate([[0], trace.impulses, [0]])
    atol = 1e-12 * scale * m.sum()
    np.testing.assert_allclose(m * (after - v), passed[:-1] - passed[1:], rtol=0, atol=atol)
    kept, most = abs(0.5 * m @ after**2 - chain.kinetic_energy), abs(after).max() + np.abs(v).max()
    assert kept - 1e-15 * chain.kinetic_energy <= 1e-6 * scale * m.sum() * most
    assert (np.diff(after) >= -1e-8 * scale).all()
    np.testing.assert_array_equal(trace.path[[0, -1]], [v, after])
    np.testing.assert_array_equal(trace.path_impulses[-1], trace.impulses)
    assert (np.diff(trace.times) >= 0).all()
    assert min(trace.forces.min(), trace.step_forces.min()) >= 0
    assert (trace.durations <= trace.times[-1] * (1 + 1e-12)).all()
    assert trace.step_times.shape == trace.step_forces.shape[:1]
    ends = [sum(event == ("end", c) for event in trace.events) for c in range(n - 1)]
    assert ends == trace.collisions.tolist()
    assert ((trace.impulses != 0) <= (trace.collisions > 0)).all()
    assert trace.energy_loss == 0


def test_what_was_handed_out_is_not_written_to_when_the_way_is_followed():
    trace = collide(Chain([1, 1], [1, 0]), SpringChain())
    trace.velocities[:] = 7.0
    assert len(trace.path) == 3
    assert trace.velocities.tolist() == [7.0, 7.0]


def test_events_forces_and_works():
    trace = collide(striking(), SpringChain(1.0))
    maximum = "maximum_compression"
    assert trace.events == ((maximum, 0), (maximum, 1), ("end", 0), ("end", 1))
    assert (trace.forces[3, 0], trace.forces[4, 1]) == (0, 0)
    # Forces integrate to impulses; works are the rises of the stored energy, at k = 1, p = 1.
    trace = collide(striking([1, 0.01, 1]), SpringChain(1.0, 1, accuracy=1e-12))
    impulses = np.trapezoid(trace.step_forces, trace.step_times, axis=0)
    np.testing.assert_allclose(impulses, trace.impulses, rtol=1e-5)
    rises = np.clip(np.diff(trace.step_forces**2 / 2, axis=0), 0, None).sum(axis=0)
    np.testing.assert_allclose(trace.absorbed, rises, rtol=1e-5)
    assert sum(event.kind == maximum for event in trace.events) > 4
    assert trace.collisions.tolist() == [1, 1]


def test_a_leaning_contact_that_losses_open_and_that_pushes_again_is_booked_then():
    trace = collide(Chain([1, 1, 2], [1, 0, 0]), SpringChain(1.0, 1, viscosity=1.0, gaps=-0.1))
    assert (trace.durations <= trace.times[-1] * (1 + 1e-12)).all()
    assert trace.collisions.tolist() == [1, 2]
    kinds = [event.kind for event in trace.events if event.contact == 1 and event.kind[0] != "m"]
    assert kinds == ["end", "close", "end"]
    end, close = (1 + trace.events.index((kind, 1)) for kind in ("end", "close"))
    pushed, t = trace.step_forces[:, 1] > 0, trace.step_times
    first = t[np.flatnonzero(pushed & (t > trace.times[end]))[0]]
    assert first - np.diff(t).max() <= trace.times[close] <= first
    for accuracy in (1e-3, 1e-5):  # not only up to a step
        coarse = collide(
            trace.chain, SpringChain(1.0, 1, viscosity=1.0, gaps=-0.1, accuracy=accuracy)
        )
        at, step = (
            coarse.times[1 + coarse.events.index(("close", 1))],
            np.diff(coarse.step_times).max(),
        )
        assert at == pytest.approx(trace.times[close], abs=0.02 * step)
    lasted = trace.times[-1] - (trace.times[close] - trace.times[end])
    assert trace.durations[1] == pytest.approx(lasted, rel=1e-6)


def test_works_of_leaning_contacts_count_from_the_lean():
    opens = [1, 1, 1], [1, 0, 0.7]  # at once, and is struck then
    for masses, before in (([1, 1, 1], [1, 0, 0]), ([2, 1, 1, 1], [1, 1, 0, 0]), opens):
        chain = Chain(masses, before)
        trace = collide(chain, SpringChain(1.0, gaps=-0.2))
        stored = 0.4 * trace.step_forces ** (5 / 3)  # at k = 1
        rises = np.clip(np.diff(stored, axis=0), 0, None).sum(axis=0)
        np.testing.assert_allclose(trace.absorbed, rises, rtol=1e-5)
    # Two balls that come to rest on each other: y'' + 2 A y' + 2 y = 0, beside the lean.
    lean, A = 0.2, 3.0
    trace = collide(Chain([1, 1], [1, 0]), SpringChain(1.0, 1, viscosity=A, gaps=-lean))
    slow, quick = A - math.sqrt(A * A - 2), A + math.sqrt(A * A - 2)
    at = math.log(quick / slow) / (quick - slow)
    deepest = lean + (math.exp(-slow * at) - math.exp(-quick * at)) / (quick - slow)
    assert trace.absorbed[0] == pytest.approx((deepest**2 - lean**2) / 2, rel=1e-8)


@pytest.mark.parametrize("A", [0.5, 1.0, 1.2])
def test_works_of_a_contact_that_swings_into_its_lean(A):
    """A minimum that no maximum follows counts nothing: the last swings depend on the accuracy."""
    lean, w = 0.2, math.sqrt(2 - A * A)
    first = math.atan2(w, A) / w
    peaks = (
        math.exp(-A * first)
        * math.sin(w * first)
        / w
        * (-math.exp(-A * math.pi / w)) ** np.arange(40)
    )
    assert peaks.min() > -lean  # it does not open
    stored = (lean + peaks) ** 2 / 2
    expected = stored[0] - lean**2 / 2 + (stored[2::2] - stored[1:-2:2]).sum()
    for accuracy in (1e-3, 1e-5, 1e-6):
        law = SpringChain(1.0, 1, viscosity=A, gaps=-lean, accuracy=accuracy)
        found = collide(Chain([1, 1], [1, 0]), law).absorbed[0]
        assert found == pytest.approx(expected, rel=1e-3), accuracy


def test_balls_that_part_meet_after_a_flight():
    trace = collide(Chain([1, 1, 1], [1, 0, 0.999]), SpringChain(1.0, accuracy=1e-12))
    np.testing.assert_allclose(trace.velocities, [0, 0.999, 1], rtol=0, atol=1e-9)
    end = trace.events.index(("end", 0))
    assert trace.events[end + 1] == ("close", 1)
    assert trace.times[end + 2] > trace.times[end + 1] + 100
    again = collide(Chain([5.0, 0.4, 3.2], [0.3, 1.3, -0.8]), SpringChain([0.126, 0.05], 2))
    assert again.collisions.tolist() == [3, 1]
    kinds = [event.kind for event in again.events if event.contact == 0]
    assert kinds.count("close") == 3  # it opens first


def test_a_closing_of_rounding_size_is_none():
    """Balls that crossed wide gaps keep closing speeds of some 1e-16; the impact ends."""
    for n, gap, accuracy in ((5, 1.5, 1e-9), (5, 7.25, 1e-9), (6, 3.0, 1e-8), (8, 12.0, 1e-7)):
        chain = Chain([1] * n, np.eye(n)[0])
        after = collide(chain, SpringChain(gaps=gap, accuracy=accuracy)).velocities
        np.testing.assert_allclose(after, np.eye(n)[-1], rtol=0, atol=1e-5)
    way = collide(Chain([1] * 4, [1, 0, 0, 0]), SpringChain(gaps=1.5))
    two = collide(Chain([1, 1], [1, 0]), SpringChain())
    np.testing.assert_allclose(way.durations, two.durations[0], rtol=1e-4)  # to the last node
    steel = SpringChain(1e10, gaps=1e-4)
    after = collide(Chain([0.045] * 5, [0.3, 0, 0, 0, 0]), steel).velocities
    np.testing.assert_allclose(after, [0, 0, 0, 0, 0.3], rtol=0, atol=1e-9)


@pytest.mark.parametrize("gap", [0.0, 1e-3, 0.1])
def test_a_slow_closing_counts_while_others_are_still_to_come(gap):
    """In the long flight of the fast ball the slow one reaches its neighbour."""
    chain = Chain([1] * 4, [5e-6, 0, 0, -1])
    found = [
        collide(chain, SpringChain(gaps=[gap, 10, 5e5], accuracy=accuracy)).velocities
        for accuracy in (0.02, 1e-3, 1e-7)
    ]
    np.testing.assert_allclose(found[0], found[2], rtol=0, atol=0.02)
    np.testing.assert_allclose(found[1], found[2], rtol=0, atol=1e-3)


def test_once_ends_when_all_contacts_have_opened():
    """As in a swing: though others close later; a gap closes before."""
    law = SpringChain(gaps=[0.1, 3.0])
    first = law.solve(Chain([1, 1, 1], [1, 0, 0]), once=True)
    np.testing.assert_allclose(first.velocities, [0, 1, 0], atol=1e-9)
    np.testing.assert_allclose(law.solve(first.chain).velocities, [0, 0, 1], atol=1e-9)
    seconds, way = first._until_apart()
    late = seconds - (0.1 + first.durations[0])  # the first node after it
    assert 0.0 <= late < 0.01
    assert way[0] - way[1] == pytest.approx(0.1 - late, abs=1e-6)


def test_progress_counts_the_steps_of_all_runs(monkeypatch, capsys):
    """After two seconds; here at once, and after every step or so."""
    begin = tqdm.tqdm.__init__
    monkeypatch.setattr(tqdm.tqdm, "__init__", lambda bar, **given: begin(bar, unit=given["unit"]))
    monkeypatch.setattr(job, "_STEPS", {False: 10, True: 10})
    chain, law = Chain([1] * 5, [1, 0, 0, 0, 0]), SpringChain(accuracy=1e-6)
    found = collide(chain, law, progress=True)
    assert f"{found.evaluations} steps" in capsys.readouterr().err
    assert found.velocities.tolist() == collide(chain, law).velocities.tolist()


# --- the kernel -----------------------------------------------------------------------------


@pytest.mark.parametrize("p", [1.0, 1.25, 1.5, 2.2, 5.0])
def test_hurwitz_zeta(p):
    for theta in (1e-3, 0.25, 0.75, 1.0, 7.3):
        for q, value in zip((p, p + 1), kinks.zetas(p, theta)):
            assert value == pytest.approx(float(zeta(-q, theta)), rel=1e-9, abs=2e-6)


@needs_numba
@pytest.mark.parametrize("p", [1.0, 1.5])
@pytest.mark.parametrize("loss", [0.0, 0.1])
@pytest.mark.parametrize("damping", ["viscoelastic", "hunt-crossley"])
def test_plain_and_compiled_agree_to_the_last_bit(monkeypatch, p, loss, damping):
    """Also of a path, and of runs that pause at every seventh step."""
    m, v, k, gaps, lost = random_chains(11, 12, 5, loss)
    gaps[:4] = -0.01 * (gaps[:4] == 0)
    law = {"exponent": p, "damping": damping}
    model = SpringChain(k[5], **law, viscosity=lost[5], gaps=gaps[5], accuracy=1e-5)
    found = []
    for kernel, pause in itertools.product(("plain", "compiled"), (None, 7)):
        monkeypatch.setenv(runtime.VARIABLE, kernel)
        if pause:
            monkeypatch.setattr(job, "_STEPS", {False: pause, True: pause})
            monkeypatch.setattr(job, "_PAGES", pause)
        many = spring_velocities(m, v, k, **law, gaps=gaps, viscosity=lost, accuracy=1e-2)
        trace = collide(Chain(m[5], v[5]), model)
        found.append((many.tobytes(), trace.step_forces.tobytes(), trace.events))
        monkeypatch.undo()
    assert found[1:] == found[:-1]


@needs_numba
def test_a_way_that_is_begun_plain_goes_on_compiled(monkeypatch):
    monkeypatch.setenv(runtime.VARIABLE, "compiled")
    chain, compiled = Chain([1, 2, 1], struck(3)), runtime.chosen(False, "follow")
    whole = collide(chain, SpringChain())
    monkeypatch.setattr(job, "_PAGES", 20)
    trace = collide(chain, SpringChain())
    kernels = itertools.chain([job.plain] * 3, itertools.repeat(compiled))
    monkeypatch.setattr(runtime, "chosen", lambda *_: next(kernels))
    doors, call = [], runtime.call
    monkeypatch.setattr(
        runtime, "call", lambda door, *rest: doors.append(door) or call(door, *rest)
    )
    assert trace.step_forces.tobytes() == whole.step_forces.tobytes()
    assert doors[:4] == [job.plain.follow] * 3 + [compiled.follow]


@pytest.mark.parametrize("kernel", ["plain", pytest.param("compiled", marks=needs_numba)])
def test_nan_ends_and_is_no_answer(monkeypatch, kernel):
    """No check of input stands before the loop here: it must refuse, and end at any step."""
    monkeypatch.setenv(runtime.VARIABLE, kernel)
    rows = [np.array([row]) for row in ([1.0, 1], [1.0, 0], [1.0], [0.1], [0.1])]
    row, law = kinks.Springs(*rows), kinks.Law(1.5, 1e-3, 1000.0)
    for name in row._fields:
        nan = {name: np.full_like(getattr(row, name), math.nan)}
        assert job.follow(row._replace(**nan), law, job.motions(1, 2))[1] == REFUSED
    out = job.motions(1, 2)
    out.h[0] = math.nan
    assert job.follow(row, law, out, record=[])[1] in (UNFINISHED, UNSOUND)


@pytest.mark.parametrize(
    ("change", "defect"),
    [([-1e-9, 0, 0], "momentum"), ([-0.004, 0, 0.004], "energy has grown"),
     ([0, 0.9, -0.9], "approach"), ([0.004, 0, -0.004], "keep back")],
)  # fmt: skip
@pytest.mark.parametrize("heavy", [1, 100])
def test_the_certificate_breaks(monkeypatch, heavy, change, defect):
    run, masses = control.run, [1, heavy, heavy]

    def wrong(n, law, effort, s, *rest):
        ended = run(n, law, effort, s, *rest)
        for a, b, mass in zip(s, change, masses, strict=True):
            a.v += 3 * b / mass
        return ended

    monkeypatch.setenv(runtime.VARIABLE, "plain")
    monkeypatch.setattr(control, "run", wrong)
    with pytest.raises(ImpactNotCertified, match=defect):
        spring_velocities(masses, [1, 0, 0])


def test_the_way_of_a_trace_is_there_for_all_who_read_it():
    """Its names are listed before it is followed; a thread that comes second finds it too."""
    trace = collide(Chain([1, 1, 1], struck(3)), SpringChain())
    assert {"times", "forces", "path", "impulses", "durations"} <= set(dir(trace))
    assert not hasattr(trace, "time")
    assert trace.times is not None
    # The second thread has looked for it in vain, and asks here when the first one is done.
    np.testing.assert_array_equal(trace.__getattr__("times"), trace.times)


def test_what_leans_hold_together_for_ever_is_given_up():
    with pytest.raises(ImpactNotFinished, match="or leans hold balls together"):
        spring_velocities([0.01, 1, 1], [1, 0, 0], gaps=[0, -0.1])
