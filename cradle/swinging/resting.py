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

from collections.abc import Iterable, Sequence
from itertools import pairwise

from cradle.input.values import Vector

#: Speeds below this part of the swing's speed are none: they carry 1e-20 of its energy.
RESTING = 1e-10
#: Gaps below this part of the swing's size are none.
NEAR = 1e-12


def stretches(contacts: Iterable[bool]) -> list[tuple[int, int]]:
    """Return the first ball of each stretch of marked contacts, and the one after its last."""
    found: list[tuple[int, int]] = []
    for c, marked in enumerate(contacts):
        if marked and found and found[-1][1] == c + 1:
            found[-1] = found[-1][0], c + 2
        elif marked:
            found.append((c, c + 2))
    return found


def common_velocities(
    masses: Vector, velocities: Vector, touching: Sequence[bool], least: float
) -> tuple[Vector, list[bool]]:
    """Give touching balls that hardly move against each other their common velocity (rule 2)."""
    v, resting = velocities.copy(), [False] * len(touching)
    while True:
        opening = [b - a > least for a, b in pairwise(v.tolist())]
        slow = [t and not opens for t, opens in zip(touching, opening, strict=True)]
        found = [s or rests for s, rests in zip(slow, resting, strict=True)]
        if found == resting:
            return v, resting
        # The common velocity may be as slow against the next ball: look again.
        resting = found
        for first, last in stretches(resting):
            body = slice(first, last)
            if (v[body] != v[first]).any():
                v[body] = masses[body] @ v[body] / masses[body].sum()


def pressed(
    masses: Vector, accelerations: Vector, resting: Sequence[bool], least: float
) -> list[bool]:
    """Return the resting contacts whose balls, left alone, would not separate (rule 3).

    The contact forces are those under which no ball passes its neighbour and no contact pulls.
    Among all accelerations without passing, these come nearest to those of the balls left alone,
    in the mean square weighted by mass (Gauss's principle of least constraint).  For a row of
    balls that is isotonic regression, which pooling solves exactly.
    """
    kept = [False] * len(resting)
    alone = list(zip(masses.tolist(), accelerations.tolist(), strict=True))
    for first, last in stretches(resting):
        pools: list[tuple[float, float, int]] = []  # mass, acceleration, number of balls
        for m, a in alone[first:last]:
            pools.append((m, a, 1))
            while len(pools) > 1 and pools[-2][1] >= pools[-1][1] - least:
                (m1, a1, n1), (m2, a2, n2) = pools.pop(-2), pools.pop(-1)
                pools.append((m1 + m2, (m1 * a1 + m2 * a2) / (m1 + m2), n1 + n2))
        for _, _, count in pools:
            kept[first : first + count - 1] = [True] * (count - 1)
            first += count
    return kept
