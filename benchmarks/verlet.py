"""Springs with a fixed step, as simulators follow them: velocity Verlet, compiled."""

import math

import numpy as np
from march import njit


@njit(cache=True)
def verlet(masses, velocities, stiffness, exponent, loss, step, faint):
    """Collide chains on springs, a row each; return velocities and the number of steps of all.

    The exponent is 1 or 3/2.  Forces start and end at zero: semi-implicit Euler, as written here,
    then gives Verlet's outcome.  With losses the closing speed is that between the nodes: of first
    order.  Compressions and speeds up to `faint` end the impact.
    """
    rows, n = velocities.shape
    out = velocities.copy()
    steps = 0
    delta = np.empty(n - 1)
    for row in range(rows):
        v, w = out[row], 1.0 / masses[row]
        delta[:] = 0.0
        going = True
        while going:
            steps += 1
            going = False
            push = 0.0
            drift = v[0]
            for c in range(n - 1):
                # All contacts drift at the speeds before the kicks of this step.
                closing = drift - v[c + 1]
                drift = v[c + 1]
                d = delta[c] + step * closing
                delta[c] = d
                force = 0.0
                if d > 0.0:
                    root = math.sqrt(d) if exponent > 1 else 1.0
                    force = max(stiffness * root * (d + exponent * loss * closing), 0.0)
                going |= d > faint or closing > faint
                v[c] += step * (push - force) * w[c]
                push = force
            v[n - 1] += step * push * w[n - 1]
    return out, steps
