"""The energy law by small steps of time: a second route, without events."""

import numpy as np


def strike(masses, velocities, restitution, steps, stiffness=1.0, exponent=1.5):
    """Velocities afterwards and the impulses (steps, N - 1) of springs stiffer in release.

    A spring pushes with k x^p; x follows the closing speed u in compression and u / e^2 in
    release.  A contact that has ended leaves a gap.
    """
    m, v = np.array(masses, float), np.array(velocities, float)
    e, k = np.broadcast_to(restitution, len(m) - 1), np.broadcast_to(stiffness, len(m) - 1)
    x, gap, impulse = np.zeros((3, len(m) - 1))
    closed, h, rows = np.full(len(m) - 1, True), 1 / steps, []
    while closed.any() or (v[:-1] > v[1:]).any():
        u = v[:-1] - v[1:]
        x = np.where(closed, x + h * np.where(u > 0, u, u / e**2), 0.0)
        gap = np.where(closed, 0.0, gap - h * u)
        closed = np.where(closed, x > 0, gap < 0)
        push = h * np.where(closed, k * np.maximum(x, 0.0) ** exponent, 0.0)
        v = v - np.diff(push, prepend=0, append=0) / m
        impulse = impulse + push
        rows.append(impulse)
    return v, np.array(rows)
