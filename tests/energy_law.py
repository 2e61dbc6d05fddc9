"""The energy law by small steps of time: a second route, without events."""

import numpy as np


def strike(masses, velocities, restitution, steps, stiffness=1.0, exponent=1.5):
    """Velocities afterwards and the impulses (steps, N - 1) of springs stiffer in release.

    A spring pushes with k x^p; x follows the closing speed u in compression and u / e^2 in
    release.  A contact that has ended leaves a gap.
    """
    n, h, rows = len(masses), 1 / steps, []
    e, k = (np.broadcast_to(one, n - 1).tolist() for one in (restitution, stiffness))
    v, impulse, closed = [float(one) for one in velocities], [0.0] * (n - 1), [True] * (n - 1)
    x, gap, push = [0.0] * (n - 1), [0.0] * (n - 1), [0.0] * (n - 1)
    while any(closed) or any(v[c] > v[c + 1] for c in range(n - 1)):
        for c in range(n - 1):
            u = v[c] - v[c + 1]
            if closed[c]:
                x[c] += h * (u if u > 0 else u / e[c] ** 2)
                gap[c], closed[c] = 0.0, x[c] > 0
            else:
                x[c], gap[c] = 0.0, gap[c] - h * u
                closed[c] = gap[c] < 0
            push[c] = h * k[c] * x[c] ** exponent if closed[c] else 0.0
        for c in range(n - 1):
            v[c] -= push[c] / masses[c]
            v[c + 1] += push[c] / masses[c + 1]
            impulse[c] += push[c]
        rows.append(tuple(impulse))
    return np.array(v), np.array(rows)
