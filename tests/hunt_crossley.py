"""The law of Hunt and Crossley, F = k d^p (1 + A dd/dt): closed form, and another integrator."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq


def closed(x, e):
    """Zero for balls that close at x / A and part at e x / A: the integral of u du / (1 + A u)."""
    return x - np.log1p(x) + e * x + np.log1p(-e * x)


def kept(x):
    """Restitution of two balls that close at x / A."""
    return brentq(lambda e: closed(x, e), 1e-9, min(1.0, (1.0 - 1e-12) / x))


def motion(m, v, k, loss, gaps, times):
    """Velocities and forces of spheres on strings that pull all the time, by SciPy."""
    rest = k * np.maximum(-gaps, 0.0) ** 1.5

    def forces(y):
        d, w = np.split(y, [len(m) - 1])
        return np.maximum(k * np.maximum(d, 0.0) ** 1.5 * (1.0 - loss * np.diff(w)), 0.0)

    def rate(_, y):
        push = np.concatenate([[0.0], forces(y) - rest, [0.0]])
        return np.concatenate([-np.diff(y[len(m) - 1 :]), -np.diff(push) / m])

    start, bounds = np.concatenate([-gaps, v]), {"rtol": 1e-12, "atol": 1e-13, "max_step": 0.01}
    y = solve_ivp(rate, (0.0, times[-1]), start, "DOP853", t_eval=times, **bounds).y.T
    return y[:, len(m) - 1 :], np.array([forces(one) for one in y])
