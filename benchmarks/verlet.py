"""The plain rival of the contact forces: velocity Verlet with a fixed step, compiled."""

import math

import numpy as np
from numba import njit


@njit
def verlet(masses, velocities, stiffness, loss, step, faint, out):
    """Collide chains of spheres, a row each, and return the number of steps of all.

    With losses the closing speed is that between the nodes: of first order.
    """
    rows, n = velocities.shape
    steps = 0
    delta = np.empty(n - 1)
    for row in range(rows):
        v, w = out[row], 1.0 / masses[row]
        v[:] = velocities[row]
        delta[:] = 0.0
        h = step[row]
        going = True
        while going:
            steps += 1
            going = False
            push = 0.0
            drift = v[0]
            for c in range(n - 1):
                # All contacts drift at the speeds before the kicks of this step.
                following = v[c + 1]
                d = delta[c] + h * (drift - following)
                delta[c] = d
                force = 0.0
                if d > 0.0:
                    force = stiffness[c] * math.sqrt(d) * (d + 1.5 * loss * (drift - following))
                    force = max(force, 0.0)
                going |= d > faint or drift - following > faint
                drift = following
                v[c] += h * (push - force) * w[c]
                push = force
            v[n - 1] += h * push * w[n - 1]
    return steps
