"""Contact forces by another integrator: SciPy's DOP853, from event to event."""

import numpy as np
from scipy.integrate import solve_ivp


def integrated(m, v, k=1.0, p=1.5, loss=0.0, gaps=0.0):
    """Velocities after the impact; the force is that of the law, as it is written down."""
    m, v, n = np.asarray(m, float), np.asarray(v, float), len(m)
    k, loss, gaps = (np.broadcast_to(np.asarray(x, float), n - 1) for x in (k, loss, gaps))
    pull = k * np.maximum(-gaps, 0.0) ** p

    def push(d, u):
        viscous = np.where(d > 0, np.maximum(d, 1e-300) ** (p - 1), 0.0) * p * loss * u
        return np.maximum(k * (np.maximum(d, 0.0) ** p + viscous), 0.0)

    force = np.zeros(n + 1)  # on either side of each ball

    def rate(_, y):
        u = y[: n - 1] - y[1:n]
        force[1:-1] = push(y[n:], u) - pull
        return np.concatenate([(force[:-1] - force[1:]) / m, u])

    def kink(c, near, early):
        """Tell where the force ends, also where its losses outweigh it; or where balls turn."""
        found = lambda _, y: near * y[n + c] + early * (y[c] - y[c + 1]) or 1.0  # noqa: E731
        found.terminal = True
        return found

    kinks = [kink(c, 1.0, 0.0) for c in range(n - 1)]
    kinks += [kink(c, 1.0, p * loss[c]) for c in np.flatnonzero(loss)]
    if pull.any():  # it ends when the last ones turn
        kinks += [kink(c, 0.0, 1.0) for c in range(n - 1)]
    y, speed = np.concatenate([v, -gaps]), max(v[:-1] - v[1:])
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14 * speed}
    for _ in range(5000):
        v, d, u = y[:n], y[n:], -np.diff(y[:n])
        still = (abs(u) <= 1e-9 * speed) & (abs(push(d, u) - pull) <= 1e-9)
        # Where a contact opens its force is zero but for rounding.
        if (still | (push(d, u) <= 1e-12) & (u <= 1e-9 * speed)).all():
            return v
        if (d <= 0).all() and not pull.any():  # all fly to the next closing
            ahead = (u > 0) & (d < 0)
            if ahead.any() and not ((u > 0) & (d == 0)).any():
                y[n:] += u * (-d[ahead] / u[ahead]).min()
        y = solve_ivp(rate, (0, 1.0), y, events=kinks, **options).y[:, -1]
        after = (push(y[n:], -np.diff(y[:n])) <= 1e-12) & (np.diff(y[:n]) > -1e-12 * speed)
        if not (pull.any() and after.all()):
            y = solve_ivp(rate, (0, 1e-4), y, **options).y[:, -1]  # beyond the kink
    raise AssertionError("the reference is not finished")
