"""What happened: the path of an impact from the first touch to the last separation."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cradle.chain import Chain
from cradle.formatting import as_html, as_text, without_rounding
from cradle.input.values import NDArray, Vector, shown

if TYPE_CHECKING:  # at run time these are imported by the methods that need them
    import pandas as pd
    from matplotlib.axes import Axes


def compared_as_objects(kind: Any) -> Any:
    """Let a tuple of arrays equal itself alone, like other results: arrays have no one truth."""
    kind.__eq__, kind.__ne__, kind.__hash__ = object.__eq__, object.__ne__, object.__hash__
    return kind


class Event(NamedTuple):
    """One event of an impact, at the contact that joins balls `contact` and `contact` + 1.

    Its kind is "maximum_compression", "end", "close", "collapse" (the limit of an infinite
    sequence) or "repetition" (a cycle of events that has been repeated many times at once).
    """

    kind: str
    contact: int


@dataclass(frozen=True, eq=False)
class Trace:
    """What happened in an impact of N balls: the velocities after it, and its path of K events.

    Attributes
    ----------
    velocities, impulses : ndarray, shapes (N,) and (N - 1,)
        Velocities after the impact, m/s, and the total impulse of each contact, N s.
    absorbed : ndarray, shape (N - 1,)
        Work that each contact absorbed in compression, J, over all its collisions.  If the impact
        collapsed, `energy_loss` is exact all the same, and each of these is good to 1e-4.
    collisions : ndarray of int, shape (N - 1,)
        How often each contact became active.  Do not rely on collisions slower than the last digit
        of the velocities: an endless sequence may stop there, without `collapsed`.
    path, path_impulses : ndarray, shapes (K + 1, N) and (K + 1, N - 1)
        Velocities, m/s, and impulses so far, N s: a row before the impact and one at every event.
        Straight lines join them, not before a "collapse" or "repetition", nor for springs: `curve`.
    events : tuple of Event, length K
        What happened at each row of the path but the first.
    collapsed : bool
        Whether an endless sequence of collisions was taken to its limit.
    saturated : tuple of int
        Contacts that were held closed for a time, at the largest admissible ratio (Eqs. 34, 53).
    margin : float
        How near another sequence of events came, from 0 to 1: the least relative distance of two
        events of one run, of two meetings, or of a ratio from its bound.  Exact ties do not count.
        Below about 1e-12 a change in the last digit of the input may change the outcome.  It is 0
        in three cases, which the book's reference explains: ratios are tiny, two or more balls at
        rest are struck from both sides, or one part collapsed while others still collided.  Models
        that `ImpulseCorrelation` does not solve leave it 1, not measured.
    left_out : int
        Number of events missing in a path that was cut; it stays 0 with ``record=False``.

    Examples
    --------
    >>> from cradle import Chain, ImpulseCorrelation, collide
    >>> trace = collide(Chain([1, 1, 1], [1, 0, 0], 1), ImpulseCorrelation(0.5))
    >>> trace.velocities.round(3)
    array([-0.333,  0.667,  0.667])
    """

    chain: Chain
    model: Any
    velocities: Vector
    impulses: Vector
    absorbed: Vector
    collisions: NDArray[np.int64]
    path: Vector
    path_impulses: Vector
    events: tuple[Event, ...]
    collapsed: bool = False
    saturated: tuple[int, ...] = ()
    margin: float = 1.0
    left_out: int = 0

    @property
    def energy_loss(self) -> float:
        """Kinetic energy lost, in joules; each contact keeps back (1 - e^2) of what it absorbed."""
        return float(((1.0 - self.chain.restitution**2) * self.absorbed).sum())

    def to_frame(self) -> "pd.DataFrame":
        """Return the path as a table, a row for each ball at each row of the path.

        Velocities are in m/s; ``left`` and ``right`` are the impulses so far, N s, of the contacts
        on both sides of the ball.  Models that follow time add a column ``time``, s.

        Examples
        --------
        >>> from cradle import Chain, ImpulseCorrelation, collide
        >>> trace = collide(Chain([1, 1], [1, 0]), ImpulseCorrelation(0.0))
        >>> print(trace.to_frame().tail(2).to_string(index=False))
         step event  contact  ball  velocity  left  right
            2   end        0     0       0.0   0.0    1.0
            2   end        0     1       1.0   1.0    0.0
        """
        import pandas as pd

        rows: dict[str, Any] = {"step": np.arange(len(self.path))}
        if hasattr(self, "times"):
            rows["time"] = self.times
        rows["event"] = ["before", *(event.kind for event in self.events)]
        rows["contact"] = pd.array([None, *(e.contact for e in self.events)], dtype="Int64")
        impulses = np.pad(self.path_impulses, ((0, 0), (1, 1)))
        parts = {"velocity": self.path, "left": impulses[:, :-1], "right": impulses[:, 1:]}
        table = {name: np.repeat(values, len(self.chain)) for name, values in rows.items()}
        table["ball"] = np.tile(np.arange(len(self.chain)), len(self.path))
        return pd.DataFrame(table | {name: part.ravel() for name, part in parts.items()})

    def curve(self) -> tuple[Vector, Vector]:
        """Return impulses, N s, and velocities, m/s: a row for each point of a drawn line."""
        return self.path_impulses, self.path

    def plot(self, ax: "Axes | None" = None, *, contact: int | None = None) -> "Axes":
        """Draw the velocities over the impact, or the velocity-impulse diagram of a contact.

        The work is done by `velocities` and `velocity_impulse` of `cradle.pictures.impacts`.
        """
        from cradle.pictures import impacts as figures

        if contact is None:
            return figures.velocities(self, ax)
        return figures.velocity_impulse(self, contact, ax)

    def _repr_html_(self) -> str:
        return as_html({
            "mass (kg)": self.chain.masses,
            "before (m/s)": self.chain.velocities + 0.0,
            "after (m/s)": without_rounding(self.velocities),
            "impulse with the next (N s)": without_rounding(self.impulses),
            "collisions with the next": self.collisions,
        })  # fmt: skip

    def __repr__(self) -> str:
        counts = f"collisions={self.collisions.tolist()}, collapsed={self.collapsed}"
        return f"Trace(velocities={as_text(self.velocities)}, {counts})"


class ImpactNotFinished(RuntimeError):
    """The end of an impact was not reached: its model allows no more steps, or runs do not agree.

    Its `trace` holds what was reached.  Its `stored` is the work that contacts can still give back,
    in units of the heaviest mass times the square of the largest speed before the impact; or it is
    None where that is not known, and `bounds` then counts all energy that is not lost yet.

    Examples
    --------
    >>> from cradle import Chain, ImpactNotFinished, ImpulseCorrelation, collide
    >>> try:
    ...     collide(Chain([1, 1, 1], [1, 0, 0], 0.9), ImpulseCorrelation(0.1, max_events=1))
    ... except ImpactNotFinished as stopped:
    ...     print(stopped.bounds.round(3).tolist())
    [[-0.273, 0.03, 0.333], [0.333, 0.637, 0.94]]
    """

    def __init__(self, message: str, trace: Trace, stored: float | None = None) -> None:
        super().__init__(message, trace, stored)  # all of them, so that it can be pickled
        self.trace, self.stored = trace, stored

    @property
    def bounds(self) -> Vector:
        """Least and largest velocity that each ball can end with, m/s, shape (2, N).

        They follow from three facts: momentum stays, energy does not grow (for `SpringChain` and
        `EnergyDistribution` to the tolerance of their integration), and in the end no ball is
        faster than the next one on its right.
        """
        # Count velocities from that of the centre of mass.  If ball i ends at x > 0, the balls from
        # i on, of mass A, are at least as fast: they have a momentum of A x or more, and the
        # others, of mass B, the opposite one.  The least energy of that is (A + A^2 / B) x^2 / 2;
        # where it equals what is left, x is largest.
        chain, v, left = self.trace.chain, self.trace.velocities, self.stored
        heaviest, unit = chain.masses.max(), np.abs(chain.velocities).max()
        if left is None:
            v, left = chain.velocities, -self.trace.energy_loss / unit / heaviest / unit
        m, v = chain.masses / heaviest, v / unit
        centre = v[0] + m @ (v - v[0]) / m.sum()
        rounding = 2.0**-50
        twice = max(m @ (np.abs(v - centre) + rounding) ** 2 + 2.0 * left, 0.0)
        after, until = np.cumsum(m[::-1])[::-1], np.cumsum(m)
        largest = np.sqrt(twice * (until - m) / after / m.sum())
        least = np.sqrt(twice * (after - m) / until / m.sum())
        return float(unit) * np.array([centre - least - rounding, centre + largest + rounding])

    def __str__(self) -> str:
        v = self.trace.velocities
        change = 1.0051 * np.abs(self.bounds - v).max()  # three digits, up
        told = f"{self.args[0]}; closing speeds so far {(v[:-1] - v[1:]).tolist()}"
        return f"{told}; no velocity can change by more than {change:.3g} m/s any more"


class ImpactNotCertified(RuntimeError):
    """An outcome failed the check that every answer has to pass, so it is not returned.

    This is a defect of the solver: please report the error's `chain`, `model` and `defect`.
    """

    def __init__(self, chain: Any, model: Any, defect: str) -> None:
        super().__init__(chain, model, defect)  # all, so that it can be pickled
        self.chain, self.model, self.defect = chain, model, defect

    def __str__(self) -> str:
        return f"{self.defect}: {shown(self.chain)}, {shown(self.model)}"
