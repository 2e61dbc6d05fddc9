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
   stays open for this instant, whatever else happens in it.
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise

from cradle.input.values import Vector
from cradle.swinging.pendulums import mean

#: Speeds below this part of the swing's speed are none, as they carry 1e-20 of its energy.
RESTING = 1e-10
#: Gaps below this part of the swing's size are none.
NEAR = 1e-12


def stretches(contacts: Iterable[bool]) -> list[tuple[int, int]]:
    """Return the first ball of each stretch of marked contacts, and the one after its last."""
    edges = [
        c for c, (one, other) in enumerate(pairwise([False, *contacts, False])) if one != other
    ]
    return [(first, end + 1) for first, end in zip(edges[::2], edges[1::2], strict=True)]


def common_velocities(
    masses: Vector, velocities: Vector, touching: Sequence[bool], least: float
) -> tuple[Vector, list[bool]]:
    """Give touching balls that hardly move against each other their common velocity (rule 2)."""
    v, resting = velocities.copy(), [False] * len(touching)
    while True:
        slow = [b - a <= least for a, b in pairwise(v.tolist())]
        marks = zip(resting, touching, slow, strict=True)
        found = [rests or (touches and now) for rests, touches, now in marks]
        if found == resting:
            return v, resting
        # The common velocity may be as slow against the next ball: look again.
        resting = found
        for body in (slice(*ends) for ends in stretches(resting)):
            v[body] = mean(v[body], masses[body])


def pressed(
    masses: Vector, accelerations: Vector, resting: Sequence[bool], least: float
) -> list[bool]:
    """Return the resting contacts whose balls, left alone, would not separate (rule 3)."""
    # Of all accelerations without passing, contacts that push and do not pull give those nearest to
    # the balls left alone, in the mean square by mass (Gauss's principle of least constraint).  For
    # a row that is isotonic regression, which pooling solves exactly.
    kept, m, a = [False] * len(resting), masses.tolist(), accelerations.tolist()
    for first, last in stretches(resting):
        pools: list[tuple[float, float, int]] = []  # mass, acceleration, number of balls
        for ball in range(first, last):
            pools.append((m[ball], a[ball], 1))
            while len(pools) > 1 and pools[-2][1] >= pools[-1][1] - least:
                (m1, a1, n1), (m2, a2, n2) = pools.pop(-2), pools.pop(-1)
                pools.append((m1 + m2, (m1 * a1 + m2 * a2) / (m1 + m2), n1 + n2))
        for _, _, count in pools:
            kept[first : first + count - 1] = [True] * (count - 1)
            first += count
    return kept
