"""Convex dissipation of three equal balls, ball 1 striking: the least sum, searched for."""

import numpy as np
from scipy.optimize import minimize


def strike(e):
    """Velocities in order, afterwards, of the least change and dissipation together."""
    kappa, before = (1 + e) / (1 - e), np.array([1.0, 0, 0])
    order = {"type": "ineq", "fun": np.diff}

    def cost(v):
        mean = -np.diff(before + v) / 2
        return 0.5 * ((v - before) ** 2).sum() + kappa * (mean**2).sum()

    return minimize(cost, [0.3, 0.3, 0.4], constraints=[order], tol=1e-14).x
