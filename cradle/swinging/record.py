"""What happened in a swing: positions and velocities in time, and every impact."""

from dataclasses import dataclass
from typing import Any, NamedTuple

from cradle.chain import Chain
from cradle.formatting import as_text
from cradle.input.values import Vector
from cradle.swinging.pendulums import Hanging, Pendulums
from cradle.trace import Trace, compared_as_objects


@compared_as_objects
class Impact(NamedTuple):
    """One impact of a swing."""

    time: float  #: s since the release
    contacts: tuple[int, ...]  #: those that touched, in stretches with an approaching one
    positions: Vector  #: where the balls were, shape (N,), m
    before: Vector  #: velocities just before, shape (N,), m/s
    after: Vector  #: velocities just after, shape (N,), m/s
    energy_loss: float  #: what the contacts kept back, J
    traces: tuple[Trace, ...]  #: one of each chain that collided; see `Trace.left_out`

    def __repr__(self) -> str:
        speeds = f"before={as_text(self.before)}, after={as_text(self.after)}"
        return f"Impact(time={self.time:.6g}, contacts={self.contacts}, {speeds})"


@dataclass(frozen=True, eq=False, repr=False)
class Swing:
    """A swing of N balls at T times, and its impacts; `chain`, `model`, `pendulums` as given.

    Examples
    --------
    >>> from cradle import ImpulseCorrelation, swing
    >>> run = swing(Chain([1, 1], [-1, 0], 1), ImpulseCorrelation(0), [0, 0], [0, 0.5])
    >>> run
    Swing(2 times to 0.5 s, 1 impacts, ended by times)
    >>> run.impacts
    (Impact(time=0.317187, contacts=(0,), before=[1, 0], after=[0, 1]),)
    """

    chain: Chain
    model: Any
    pendulums: Pendulums
    times: Vector  #: s since the release, shape (T,); those asked for, up to the end of the run
    positions: Vector  #: along each ball's arc from its lowest point, shape (T, N), m
    velocities: Vector  #: shape (T, N), m/s; after an impact at that instant
    impacts: tuple[Impact, ...]  #: in the order in which they happened
    ended: str  #: what ended the run, "times" or "impacts" (`max_impacts`)
    end: float  #: when it ended, s
    together: tuple[int, ...]  #: contacts whose balls moved together at the end

    @property
    def energy(self) -> Vector:
        """Kinetic and potential energy of all balls at each time, shape (T,), J."""
        return Hanging(self.pendulums, self.chain.masses).energy(self.positions, self.velocities)

    def __repr__(self) -> str:
        told = f"{len(self.times)} times to {self.end:g} s, {len(self.impacts)} impacts"
        return f"Swing({told}, ended by {self.ended})"
