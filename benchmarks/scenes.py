"""The chains of the benchmark: the first ball strikes the others, which rest and touch."""

from functools import cache
from typing import NamedTuple

import numpy as np
from chains import ELASTIC, magnitudes, uniform
from dop853 import integrated
from truth import in_fifty_digits

import cradle
from cradle import Chain, collide


class Scene(NamedTuple):
    """A chain and its ratios."""

    name: str
    masses: tuple
    restitution: tuple
    forward: tuple
    backward: tuple
    source: str

    @property
    def elastic(self):
        return min(self.restitution) == 1.0

    @property
    def velocities(self):
        return (1.0,) + (0.0,) * (len(self.masses) - 1)

    @property
    def given(self):
        """As every solver of the paper's model takes it."""
        return self.masses, self.velocities, self.restitution, self.forward, self.backward

    @property
    def chain(self):
        return Chain(*self.given[:3])

    @property
    def model(self):
        """The paper's model with the measured ratios; CCA is above its bound."""
        return cradle.ImpulseCorrelation(self.forward, self.backward, excess="saturate")

    @cache  # noqa: B019  (a handful of scenes)
    def truth(self):
        """Return the outcome of the paper's model from another solver, in fifty digits."""
        return in_fifty_digits(*self.given)

    def viscosity(self):
        """Return that of spheres with this restitution at the striker's speed."""
        return cradle.viscosity_from(self.restitution, speed=1.0, masses=self.masses)

    @cache  # noqa: B019
    def springs(self, exponent=1.5):
        """Return the converged outcome of springs of equal stiffness; 3/2 is Hertz."""
        if not self.elastic:
            return integrated(self.masses, self.velocities, loss=self.viscosity())
        # Without losses the energy law is the spring chain, in SciPy's hands.
        model = cradle.EnergyDistribution(1.0, exponent, rtol=3e-14)
        return collide(self.chain, model).velocities


def _scenes():
    """Yield the elastic chains, with the ratio that the paper measured for steel balls; ABCCA."""
    for name, masses in ELASTIC.items():
        contacts = len(masses) - 1
        ratios = (0.167,) * (contacts - 1)
        balls = tuple(map(float, masses))
        yield Scene(name, balls, (1.0,) * contacts, ratios, ratios, "Table 2, AAA")
    chain, model = cradle.paper_chain("ABCCA", excess="saturate")
    parts = chain.masses, chain.restitution, model.forward, model.backward
    yield Scene("ABCCA", *(tuple(map(float, part)) for part in parts), "Tables 1 and 2")


SCENES = {scene.name: scene for scene in _scenes()}
#: Equal balls for viscous springs: those of least restitution that these have, nearly, and others.
LOSSY = {
    name: Scene(name, (1.0,) * n, (e,) * (n - 1), (), (), "")
    for name, n, e in (("three lossy", 3, 0.9), ("five lossy", 5, 0.7))
}


def random_chains(balls, count):
    """Return random chains, ratios within the bounds."""
    rng = np.random.default_rng(balls)
    masses = magnitudes(rng, 1, (count, balls))
    velocities = np.tile(np.eye(1, balls), (count, 1))
    restitution = uniform(rng, 0.3, 1.0, (count, balls - 1))
    # Eq. 34 with any onward ratio: the bound of Eq. 53 is never below it, forward or backward.
    part = uniform(rng, 0.0, 1.0, (count, balls - 2))
    forward = part * masses[:, 2:] / (masses[:, 2:] + masses[:, 1:-1])
    backward = part * masses[:, :-2] / (masses[:, :-2] + masses[:, 1:-1])
    return masses, velocities, restitution, forward, backward
