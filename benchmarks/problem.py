"""One impact as plain numbers: for the package, for any other solver, and seen from elsewhere."""

from typing import NamedTuple

import numpy as np
from truth import solve

from cradle import Chain, ImpactNotFinished, ImpulseCorrelation, collide


def case(masses, velocities, restitution, forward, backward=None, meeting=0.5):
    """A problem from arrays or scalars."""
    n = len(masses)
    backward = forward if backward is None else backward
    sizes = (n, n, n - 1, n - 2, n - 2)
    parts = zip((masses, velocities, restitution, forward, backward), sizes)
    return Problem(*(np.broadcast_to(np.float64(x), k).tolist() for x, k in parts), meeting)


class Problem(NamedTuple):
    """A chain and the parameters of its impact, as plain lists; ratios above bounds saturate."""

    masses: list
    velocities: list
    restitution: list
    forward: list
    backward: list
    meeting: float = 0.5

    @classmethod
    def of(cls, chain, model):
        """The problem of a chain and its model."""
        own = chain.masses, chain.velocities, chain.restitution
        return case(*own, model.forward, model.backward, model.meeting)

    def solve(self, solver, **options):
        """By `textbook.solve`, `truth.solve` or anything that is called like them."""
        return solver(*self[:5], meeting=self.meeting, **options)

    def collide(self, record=None, **options):
        """By the package."""
        options |= {"meeting": self.meeting, "excess": "saturate"}
        model = ImpulseCorrelation(*self[3:5], **options)
        return collide(Chain(*self[:3]), model, record=record)

    def attempt(self, max_events=200_000):
        """The package's trace, finished or not, and whether it finished."""
        try:
            return self.collide(max_events=max_events), True
        except ImpactNotFinished as stopped:
            return stopped.trace, False

    def exact(self, max_events=20_000, **options):
        """By the independent solver, at the digits in force."""
        return self.solve(solve, max_events=max_events, **options)

    def mirrored(self):
        m, v, e, forward, backward = (part[::-1] for part in self[:5])
        return Problem(m, [-x for x in v], e, backward, forward, 1 - self.meeting)

    def boosted(self, speed):
        """Seen from a moving frame; exact if velocities and speed are multiples of a power of 2."""
        return self._replace(velocities=[v + speed for v in self.velocities])

    def in_units(self, mass, velocity):
        """In other units; exact if these are powers of two."""
        m, v = [x * mass for x in self.masses], [x * velocity for x in self.velocities]
        return self._replace(masses=m, velocities=v)
