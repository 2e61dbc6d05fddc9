"""Balls that touch: which of them collide, which rest against each other, which are drawn apart.

The rules, in the order in which `swing` applies them at every event:

1. *Touching.* Those contacts touch that close at this instant (within `TIE`), and those whose gap
   is no more than a rounding error (`NEAR`).  Each stretch of touching contacts with one that
   approaches faster than `RESTING` of the swing's speed is a chain of its own, solved by `collide`.
2. *Resting.* Touching balls whose relative speed is then below `RESTING` of the swing's speed take
   their common velocity: from now on they touch and move together.  Without this rule balls that
   are pressed against each other would collide for ever, ever more softly, in a finite time.
3. *Pressing.* Of the contacts that move together those stay so in which the balls, left alone,
   would not separate: neighbouring balls are pooled while the left one would accelerate no less
   than the right one.  A pool moves as one body.  Equal pendulums without gaps swing alike, so
   they keep together, without a force, until another ball strikes them.
4. *Pulling apart.* When the force in a contact of a body falls to zero, the contact opens, and
   stays open for this instant, whatever else happens in it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cradle.input.values import Vector

#: Speeds below this part of the swing's speed are none: they carry 1e-20 of its energy.
RESTING = 1e-10
#: Gaps below this part of the swing's size are none.
NEAR = 1e-12


def stretches(contacts: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first ball of each stretch of marked contacts, and the one after its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], contacts, [False]]).astype(int)))
    return [(int(a), int(b) + 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def common_velocities(
    masses: Vector, velocities: Vector, touching: NDArray[np.bool_], least: float
) -> tuple[Vector, NDArray[np.bool_]]:
    """Give touching balls that hardly move against each other their common velocity (rule 2)."""
    v, resting = velocities.copy(), np.zeros_like(touching)
    while True:
        slow = touching & (v[:-1] - v[1:] >= -least)
        if not (slow & ~resting).any():
            return v, resting
        # The common velocity may be as slow against the next ball: look again.
        resting |= slow
        for first, last in stretches(resting):
            body = slice(first, last)
            if (v[body] != v[first]).any():
                v[body] = masses[body] @ v[body] / masses[body].sum()


def pressed(
    masses: Vector, accelerations: Vector, resting: NDArray[np.bool_], least: float
) -> NDArray[np.bool_]:
    """Return the resting contacts whose balls, left alone, would not separate (rule 3).

    The contact forces are those under which no ball passes its neighbour and no contact pulls.
    Among all accelerations without passing, these come nearest to those of the balls left alone,
    in the mean square weighted by mass (Gauss's principle of least constraint).  For a row of
    balls that is isotonic regression, which pooling solves exactly.
    """
    kept = np.zeros_like(resting)
    for first, last in stretches(resting):
        pools: list[tuple[float, float, int]] = []  # mass, acceleration, number of balls
        for m, alone in zip(masses[first:last], accelerations[first:last], strict=True):
            pools.append((m, alone, 1))
            while len(pools) > 1 and pools[-2][1] >= pools[-1][1] - least:
                (m1, a1, n1), (m2, a2, n2) = pools.pop(-2), pools.pop(-1)
                pools.append((m1 + m2, (m1 * a1 + m2 * a2) / (m1 + m2), n1 + n2))
        kept[first : last - 1] = True
        cuts = first + np.cumsum([count for _, _, count in pools[:-1]], dtype=int)
        kept[cuts - 1] = False
    return kept
