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

    time: float  #: When it happened, s since the release.
    contacts: tuple[int, ...]  #: All contacts of the groups of touching balls that collided.
    positions: Vector  #: Where the balls were, shape (N,), m.
    before: Vector  #: Velocities just before, shape (N,), m/s.
    after: Vector  #: Velocities just after, shape (N,), m/s.
    energy_loss: float  #: Energy that the contacts kept back, J.
    traces: tuple[Trace, ...]  #: What `collide` returned for each group of touching balls.

    def __repr__(self) -> str:
        speeds = f"before={as_text(self.before)}, after={as_text(self.after)}"
        return f"Impact(time={self.time:.6g}, contacts={self.contacts}, {speeds})"


@dataclass(frozen=True, eq=False, repr=False)
class Swing:
    """What `swing` returns: N balls at T times, and the impacts; `chain`, `model` as given.

    Examples
    --------
    >>> from cradle import Chain, ImpulseCorrelation, swing
    >>> run = swing(Chain([1, 1], [-1, 0], 1), ImpulseCorrelation(0), [0, 0], [0, 0.5])
    >>> run
    Swing(2 times to 0.5 s, 1 impacts, ended by times)
    >>> run.impacts
    (Impact(time=0.317187, contacts=(0,), before=[1, 0], after=[0, 1]),)
    """

    chain: Chain
    model: Any
    pendulums: Pendulums
    times: Vector  #: The times asked for, up to the end of the run; s since the release, (T,).
    positions: Vector  #: Places along each ball's arc from its lowest point, shape (T, N), m.
    velocities: Vector  #: Velocities, after an impact at that instant, shape (T, N), m/s.
    impacts: tuple[Impact, ...]  #: All impacts, in the order in which they happened.
    ended: str  #: What ended the run, "times" or "impacts" (`max_impacts`).
    end: float  #: When the run ended, s.
    together: tuple[int, ...]  #: Contacts whose balls moved together at the end.
    lasting: bool = False  #: Whether strikes took time, by contact forces that are stiff enough.

    @property
    def energy(self) -> Vector:
        """Kinetic and potential energy of all balls at each time, shape (T,), J."""
        return Hanging(self.pendulums, self.chain.masses).energy(self.positions, self.velocities)

    def __repr__(self) -> str:
        told = f"{len(self.times)} times to {self.end:g} s, {len(self.impacts)} impacts"
        return f"Swing({told}, ended by {self.ended})"
