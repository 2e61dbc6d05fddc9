"""The chains of the benchmark: the first ball strikes the others, which rest and touch."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from chains import magnitudes, uniform
from march import march
from truth import in_fifty_digits

from cradle import Chain, EnergyDistribution, ImpulseCorrelation, collide, paper_chain

__all__ = ["SCENES", "Scene", "march", "random_chains", "random_truth"]


@dataclass(frozen=True)
class Scene:
    """A chain and its ratios."""

    name: str
    masses: tuple[float, ...]
    restitution: tuple[float, ...]
    forward: tuple[float, ...]
    backward: tuple[float, ...]
    source: str

    @property
    def elastic(self):
        """Whether Hertz springs apply."""
        return min(self.restitution) == 1.0

    @property
    def velocities(self):
        """The first ball has speed one."""
        return (1.0,) + (0.0,) * (len(self.masses) - 1)

    @property
    def chain(self):
        """As the package takes it."""
        return Chain(self.masses, self.velocities, self.restitution)

    @property
    def model(self):
        """The paper's model with the measured ratios; CCA is above its bound."""
        return ImpulseCorrelation(self.forward, self.backward, excess="saturate")

    @cache  # noqa: B019  (a handful of scenes)
    def truth(self):
        """Return the outcome of the paper's model from another solver, in fifty digits."""
        parts = (self.masses, self.velocities, self.restitution, self.forward, self.backward)
        return in_fifty_digits(*parts, excess="saturate")[0]

    @cache  # noqa: B019
    def springs(self, exponent=1.5):
        """Return the converged outcome of elastic springs, equal stiffness; 3/2 is Hertz."""
        # Without losses the energy law is the spring chain, in SciPy's hands.
        model = EnergyDistribution(1.0, exponent, rtol=3e-14)
        return collide(self.chain, model).velocities


def _elastic(name, masses):
    """Return an elastic scene with the ratio that the paper measured for three steel balls."""
    balls = len(masses)
    ratios = (0.167,) * (balls - 2)
    return Scene(name, tuple(masses), (1.0,) * (balls - 1), ratios, ratios, "Table 2, AAA")


def _measured(sequence):
    chain, model = paper_chain(sequence, excess="saturate")
    parts = (chain.masses, chain.restitution, model.forward, model.backward)
    return Scene(sequence, *(tuple(float(x) for x in part) for part in parts), "Tables 1 and 2")


SCENES = {
    scene.name: scene
    for scene in (
        _elastic("three equal", [1.0] * 3),
        _elastic("five equal", [1.0] * 5),
        _elastic("light middle", [1.0, 0.01, 1.0]),
        _measured("ABCCA"),
    )
}


def random_chains(balls, count):
    """Return random chains of that many balls, ratios within the bounds."""
    rng = np.random.default_rng(balls)
    masses = magnitudes(rng, 1, (count, balls))
    velocities = np.zeros((count, balls))
    velocities[:, 0] = 1.0
    restitution = uniform(rng, 0.3, 1.0, (count, balls - 1))
    # Eq. 34 with any onward ratio: the bound of Eq. 53 is never below it, forward or backward.
    part = uniform(rng, 0.0, 1.0, (count, balls - 2))
    forward = part * masses[:, 2:] / (masses[:, 2:] + masses[:, 1:-1])
    backward = part * masses[:, :-2] / (masses[:, :-2] + masses[:, 1:-1])
    return masses, velocities, restitution, forward, backward


def random_truth(chains, count):
    """Return the outcomes of the first of these chains from another solver, in fifty digits."""
    rows = zip(*(part[:count].tolist() for part in chains), strict=True)
    return np.array([in_fifty_digits(*row, excess="saturate")[0] for row in rows])
