"""Balls that touch: which of them collide, which rest against each other, which are drawn apart.

The rules, in the order in which `swing` applies them at every event:

1. *Touching.* Contacts touch that close at this instant or have a gap below `NEAR`.  Each stretch
   of them with one that approaches faster than `RESTING` is a chain, solved by `collide`.
2. *Resting.* Touching balls whose relative speed is then below `RESTING` take their common
   velocity.  Otherwise balls pressed against each other would collide for ever in a finite time.
3. *Pressing.* Resting balls that, left alone, would not separate move on as one body: neighbours
   are pooled while the left one would accelerate no less than the right one.  Equal pendulums
   without gaps swing alike, so they keep together, without a force, until a ball strikes them.
4. *Pulling apart.* When the force in a contact of a body falls to zero, the contact opens, and
   stays open for this instant, whatever else happens in it, and then until its balls meet.
"""

import numpy as np

from cradle.input.values import NDArray, Vector
from cradle.swinging.pendulums import mean

#: Balls whose relative speed is below this part of the swing's speed rest against each other.
RESTING = 1e-10
#: Balls whose gap is below this part of the swing's size touch.
NEAR = 1e-12


def stretches(contacts: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first ball of each stretch of marked contacts, and the one after its last."""
    marked = [False, *contacts.tolist(), False]
    edges = [c for c in range(len(marked) - 1) if marked[c] != marked[c + 1]]
    return [(first, end + 1) for first, end in zip(edges[::2], edges[1::2], strict=True)]


def common_velocities(
    masses: Vector, velocities: Vector, touching: NDArray[np.bool_], least: float
) -> tuple[Vector, NDArray[np.bool_]]:
    """Give touching balls that hardly move against each other their common velocity (rule 2)."""
    v, resting = velocities.copy(), np.zeros(len(touching), dtype=bool)
    while True:
        found = resting | (touching & (v[1:] - v[:-1] <= least))
        if not np.count_nonzero(found != resting):
            return v, resting
        # The common velocity may be as slow against the next ball: look again.
        resting = found
        for body in (slice(*ends) for ends in stretches(resting)):
            v[body] = mean(v[body], masses[body])


def pressed(masses: Vector, accelerations: Vector, resting: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the resting contacts whose balls, left alone, would not separate (rule 3)."""
    # Of all accelerations without passing, contacts that push and do not pull give those nearest to
    # the balls left alone, in the mean square by mass (Gauss's principle of least constraint).  For
    # a row that is isotonic regression.
    from scipy.optimize import isotonic_regression  # slow to import

    kept = np.zeros(len(resting), dtype=bool)
    for first, last in stretches(resting):
        nearest = isotonic_regression(accelerations[first:last], weights=masses[first:last]).x
        kept[first : last - 1] = np.diff(nearest) <= 0.0
    return kept
