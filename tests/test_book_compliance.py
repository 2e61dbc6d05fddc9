"""Three balls and two springs, Eqs. 7-16 and Fig. 2; second route: SciPy's integration."""

import math

import numpy as np
import pytest
from chains import HERTZ, LINEAR
from chapters import Chapter, floats
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from truth import solve

from cradle import Chain, ImpulseCorrelation, collide, ratio_table

GAMMAS = (0.05, 0.5, 1.0, 2.0, 7.0, 60.0)
THREE = Chain([1, 1, 1], [1, 0, 0], 1)
CHAPTER, READING = Chapter("compliance"), Chapter("reading_compliance")


def springs(*stiffness, pull=False, until=None):
    """State (x, v, impulses) of equal balls on springs, k = 1, which with `pull` never let go.

    Up to the time `until`, or to 1 after the last contact.
    """
    stiffness = np.array(stiffness, dtype=float)
    n = len(stiffness) + 1

    def rates(_, y):
        force = -stiffness * np.diff(y[:n])
        if not pull:
            force = force.clip(min=0)
        return np.concatenate([y[n : 2 * n], -np.diff(force, prepend=0, append=0), force])

    # All contacts are over within half a period of the softest spring and of the stiffest.
    end = until or 3 * math.pi * sum(1 / np.sqrt(stiffness))
    # A short step, or the integrator overlooks the kink where a contact opens.
    start = np.concatenate([np.zeros(n), np.eye(n)[0], np.zeros(n - 1)])
    return solve_ivp(
        rates, (0, end), start, method="DOP853", rtol=1e-12, atol=1e-13, dense_output=True,
        max_step=0.2 / math.sqrt(max(stiffness)),
    )  # fmt: skip


def outcome(*stiffness):
    y = springs(*stiffness).y[:, -1]
    n = len(stiffness) + 1
    assert (np.diff(y[:n]) > 0).all()  # everything has come apart
    return y[n : 2 * n]


def eigenvalues(gamma):
    """gamma_1 and gamma_2."""
    root = math.sqrt(1 - gamma + gamma**2)
    return 1 + gamma + root, 1 + gamma - root


def printed_7_to_9(gamma, k, t):
    """Eqs. 7, 8, 9, as the paper prints them."""
    g1, g2 = eigenvalues(gamma)

    def swing(lam):
        return k * math.sin(math.sqrt(k * lam) * t) / ((k * lam) ** 1.5 * (g1 - g2))

    return np.array(
        [
            t / 3 - (2 * gamma - g1) * swing(g1) + (2 * gamma - g2) * swing(g2),
            t / 3 + (gamma - g1) * swing(g1) - (gamma - g2) * swing(g2),
            t / 3 + gamma * swing(g1) - gamma * swing(g2),
        ]
    )


def printed_10_and_11(gamma, k, t):
    """The right-hand sides of Eqs. 10 and 11, as the paper prints them."""
    g1, g2 = eigenvalues(gamma)
    w1, w2 = math.sqrt(k * g1), math.sqrt(k * g2)
    eq_10 = (3 * gamma - 2 * g1) * g2**2 * math.sin(w1 * t / 2) ** 2
    eq_10 -= (3 * gamma - 2 * g2) * g1**2 * math.sin(w2 * t / 2) ** 2
    eq_11 = (1 - math.cos(w1 * t)) * gamma * g2 - (1 - math.cos(w2 * t)) * gamma * g1
    return np.array([eq_10 / (0.5 * g1**2 * g2**2 * (g1 - g2)), eq_11 / (g1 * g2 * (g1 - g2))])


def printed_13(gamma, k, t, alpha_2):
    """The right-hand side of Eq. 13, as the paper prints it."""
    first, second = (
        2 * (3 * alpha_2 * gamma + (gamma - 2 * alpha_2) * lam) / lam**2
        * math.sin(math.sqrt(k * lam) * t / 2) ** 2
        for lam in eigenvalues(gamma)
    )  # fmt: skip
    return (first - second) / (eigenvalues(gamma)[0] - eigenvalues(gamma)[1])


def first_loss(gamma):
    """Time of the first loss of contact, from Eqs. 7-9, and the contact that opens."""

    def shortened(t):
        return -np.diff(printed_7_to_9(gamma, 1, t))

    step = 0.01 / math.sqrt(max(1, gamma))
    t = step
    while (shortened(t) > 0).all():
        t += step
    contact = int(np.argmin(shortened(t)))
    return brentq(lambda x: shortened(x)[contact], t - step, t, xtol=1e-14), contact


def constant_ratio(velocities):
    """The ratio with this outcome, three equal elastic balls: v1 = -ratio/(2 - ratio)."""
    return -2 * velocities[0] / (1 - velocities[0])


@pytest.mark.parametrize("gamma", GAMMAS)
def test_eqs_7_to_9_solve_the_motion(gamma: float):
    path = springs(1, gamma, pull=True, until=3)
    for t in (0.1, 0.7, 1.9, 3.0):
        np.testing.assert_allclose(path.sol(t)[:3], printed_7_to_9(gamma, 1, t), rtol=0, atol=1e-9)
    # k sets the unit of time.
    np.testing.assert_allclose(
        printed_7_to_9(gamma, 4, 0.9) * 2, printed_7_to_9(gamma, 1, 1.8), rtol=1e-13
    )


@pytest.mark.parametrize("gamma", GAMMAS)
def test_eqs_10_and_11_are_minus_the_impulses(gamma: float):
    loss, _ = first_loss(gamma)
    path = springs(1, gamma, until=loss)
    for t in np.linspace(0.05, 1, 8) * loss:
        v, impulses = path.sol(t)[3:6], path.sol(t)[6:]
        printed_ones = printed_10_and_11(gamma, 1, t)
        np.testing.assert_allclose(printed_ones, -impulses, rtol=0, atol=1e-9)
        np.testing.assert_allclose(impulses, [1 - v[0], v[2]], rtol=0, atol=1e-9)  # Eqs. 1, 3
        assert (printed_ones < 0).all()


@pytest.mark.parametrize("gamma", GAMMAS)
def test_eqs_12_and_13(gamma: float):
    for t in (0.2, 1.1, 2.3):
        for alpha_2 in (-1.0, -0.5, -gamma, 0.3):
            minus_2, minus_3 = printed_10_and_11(gamma, 1, t)
            delta = alpha_2 * minus_2 + minus_3  # Eq. 12
            assert delta == pytest.approx(printed_13(gamma, 1, t, alpha_2), rel=0, abs=1e-12)


def test_eq_13_has_no_constant_ratio():
    """The alpha_2 that stops one mode lets the other go on."""
    for gamma in GAMMAS:
        first, second = (gamma * lam / (2 * lam - 3 * gamma) for lam in eigenvalues(gamma))
        assert first - second == pytest.approx(2 * math.sqrt(1 - gamma + gamma**2), rel=1e-12)
    assert "2*sqrt(gamma**2 - gamma + 1)" in READING.printed("compliance-sympy-delta")


def test_eq_14_is_not_the_limit():
    """Printed form: gamma_2 = gamma instead of 3 gamma / 2; the ratio is never gamma."""
    gamma, alpha_2 = 1e-6, -0.3
    _, g2 = eigenvalues(gamma)
    assert g2 / gamma == pytest.approx(1.5, rel=1e-5)

    def slow_amplitude(lam):
        return 2 * (3 * alpha_2 * gamma + (gamma - 2 * alpha_2) * lam) / (lam**2 * 2)

    # With lam = gamma: Eq. 14, whose amplitude (with sin^2 = (1 - cos)/2) is (alpha_2+gamma)/gamma.
    assert slow_amplitude(gamma) == pytest.approx((alpha_2 + gamma) / gamma, rel=1e-9)
    assert slow_amplitude(g2) == pytest.approx((2 + alpha_2) / 3, rel=1e-4)
    # At the loss of contact the ratio of the impulses is (pi^2/8 - 1/2) gamma, at the end 1.
    factor = math.pi**2 / 8 - 0.5
    at = []
    for gamma in (1e-2, 5e-3):
        path = springs(1, gamma)
        tau_2, tau_3 = path.sol(first_loss(gamma)[0])[6:]
        at.append([tau_3 / tau_2 / gamma, path.y[7, -1] / path.y[6, -1]])
    # The error falls like gamma: two points give the limit.
    assert 2 * at[1][0] - at[0][0] == pytest.approx(factor, rel=1e-5)
    assert 2 * at[1][1] - at[0][1] == pytest.approx(1, abs=1e-4)
    assert READING.glued["compliance-loss-factor"] == f"{factor:.3f}"


def test_eq_15_is_a_clean_limit():
    """tau_3 - tau_2/2 vanishes like 1/gamma over the whole contact."""
    errors = []
    for gamma in (1e2, 1e3, 1e4):
        times = np.linspace(0, first_loss(gamma)[0], 400)
        tau = -np.array([printed_10_and_11(gamma, 1, t) for t in times])
        errors.append(gamma * abs(tau[:, 1] - tau[:, 0] / 2).max())
        g1, g2 = eigenvalues(gamma)
        assert g2 == pytest.approx(1.5, rel=1 / gamma)
        assert g1 / gamma == pytest.approx(2, rel=1 / gamma)
        # Eq. 15 against Eq. 13, for an alpha_2 at which it does not vanish.
        for t in (0.5, 1.5):
            eq_15 = -2 / 3 * (1 + 2 * 0.7) * math.sin(math.sqrt(3 / 8) * t) ** 2
            assert printed_13(gamma, 1, t, 0.7) == pytest.approx(eq_15, abs=3 / gamma)
    assert max(errors) < 0.6
    assert np.ptp(errors) < 0.01


def test_eq_16_is_what_the_model_does():
    """While the first contact lasts, the increments of the impulses keep the ratio."""
    for ratio in (0.1, 0.3, 0.45):
        trace = collide(THREE, ImpulseCorrelation(ratio))
        steps = np.diff(trace.path_impulses, axis=0)
        first = steps[:, 0] > 0
        assert first.sum() == 2  # compression and restitution
        np.testing.assert_allclose(steps[first, 1], ratio * steps[first, 0], rtol=1e-13)


def test_table_of_limits():
    heads, *lines = READING.printed("compliance-table-limits").splitlines()
    assert " ".join(heads.split()) == "γ τ₃/τ₂ off Eq. 14 off Eq. 15"
    assert len(lines) == 7
    for line in lines:
        gamma, *shown = line.split()
        loss, _ = first_loss(float(gamma))
        tau = -np.array([printed_10_and_11(float(gamma), 1, t) for t in np.linspace(0, loss, 1500)])
        worst = [abs(tau[:, 1] - a * tau[:, 0]).max() / tau[-1, 1] for a in (float(gamma), 0.5)]
        # Three digits are printed.
        dashes = ["–" in shown[k] for k in (1, 2)]  # each limit on its side of gamma = 1
        assert dashes == [float(gamma) > 1, float(gamma) < 1]
        for printed, exact in zip(shown, (tau[-1, 1] / tau[-1, 0], *worst), strict=True):
            if printed == "–":
                continue
            assert len(printed.lstrip("0.")) == 3
            unit = 10.0 ** (math.floor(math.log10(exact)) - 2)
            assert float(printed) == pytest.approx(exact, rel=1e-3, abs=0.5 * max(unit, exact > 99))


def test_equal_springs():
    """Outcome, impulses at the loss of contact and at the end, and the ratio with that outcome."""
    velocities = outcome(1, 1)
    np.testing.assert_allclose(velocities, LINEAR["three equal"], rtol=0, atol=1e-8)
    loss, contact = first_loss(1)
    minus_2, minus_3 = printed_10_and_11(1, 1, loss)
    tau_2, tau_3 = springs(1, 1).y[6:, -1]
    tau_2_loss, tau_3_loss = -minus_2, -minus_3
    v2, v3 = tau_2_loss - tau_3_loss, tau_3_loss  # then; Eqs. 2 and 3
    ratio = constant_ratio(velocities)
    assert ratio == pytest.approx(0.230498292, rel=0, abs=1e-8)
    table = ratio_table().set_index("triplet").ratio
    CHAPTER.tells(
        {"first-quotient": tau_3_loss / tau_2_loss, "last-quotient": tau_3 / tau_2}
        | {"linear-ratio": ratio, "AAA": f"{table['AAA']:.3f}"},
        off=1e-8,
    )
    _, touch, first, last = CHAPTER.printed("equal-springs").splitlines()
    assert touch.split() == ["first", "touch", "0.000", "1.000", "0.000", "0.000"]
    names = [["1-2", "2-3"][k] for k in (contact, 1 - contact)]
    # Contact 2-3 alone is half a swing of frequency sqrt 2, which it enters compressed.
    q, v = springs(1, 1).sol(loss)[:3], springs(1, 1).sol(loss)[3:6]
    phase = math.atan2(math.sqrt(2) * (q[1] - q[2]), v[1] - v[2])
    over = loss + (math.pi - phase) / math.sqrt(2)
    for line, name, expected in (
        (first, names[0], [loss, 1 - tau_2_loss, v2, v3, tau_3_loss / tau_2_loss]),
        (last, names[1], [over, *velocities, tau_3 / tau_2]),
    ):
        pair, change, *shown = line.split()
        assert (pair, change) == (name, "ends")
        assert [float(x) for x in shown] == pytest.approx(expected, rel=0, abs=5.01e-4)
    # The model with that ratio: an independent solver gives the springs' outcome.
    again = floats(solve([1, 1, 1], [1, 0, 0], 1, ratio).velocities)
    np.testing.assert_allclose(again, velocities, rtol=0, atol=1e-9)
    # That of spheres, by another program; the measured ratio lies between the two.
    spheres = HERTZ["three equal"]
    CHAPTER.tells(dict(zip(("spheres-v1", "spheres-v2", "spheres-v3"), spheres)))
    CHAPTER.tells({"spheres-ratio": constant_ratio(spheres)})
    assert constant_ratio(spheres) < table["AAA"] < ratio


def test_effective_ratios():
    """The law for a soft second spring; towards 1/2 for a stiff one."""
    for gamma in (0.1, 0.01):
        ratio = constant_ratio(outcome(1, gamma))
        assert ratio / gamma == pytest.approx(math.pi**2 / 8 - 1, rel=0.03 * gamma + 1e-7)
        stored = f"gamma = {gamma}: effective ratio / gamma = {ratio / gamma:.6f}"
        assert stored in READING.printed("compliance-sympy-effective")
    for gamma, low in ((2, 0.394), (10, 0.497), (100, 0.4999)):
        velocities = outcome(1, gamma)
        assert low < constant_ratio(velocities) <= 0.5
        assert [velocities.sum(), (velocities**2).sum()] == pytest.approx([1, 1], abs=1e-9)


def test_energy_on_the_way():
    loss, _ = first_loss(1)
    q = printed_7_to_9(1, 1, loss)
    v = springs(1, 1, until=loss).y[3:6, -1]
    stored = f"{(q[1] - q[2]) ** 2:.1%}".replace("%", " %")
    CHAPTER.tells({"ex-kinetic": v @ v, "ex-stored": stored})
