"""The two answers that came before the ratio: one collision after another, or one solid body."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from cradle.chain import Chain
from cradle.input.values import Vector, must_be, one_of
from cradle.models.correlation import MAX_EVENTS, ImpulseCorrelation
from cradle.trace import Event, ImpactNotFinished, Trace


@dataclass(frozen=True)
class SequentialCollisions:
    """One collision of two balls after another (Johnson; Han and Gilmore's second answer).

    A contact gets no impulse while a neighbouring collision goes on: the Impulse Correlation
    Ratio is zero everywhere, and `ImpulseCorrelation` solves it.  For balls that touch, the order
    of collisions is a choice, and the outcome can depend on it.  Here it is:

    1. In each stretch of touching balls the approaching contact at the end named by `order`
       collides first; the others wait.
    2. When a collision ends, both neighbouring contacts may collide next, each on its own.
    3. A contact that waits between two collisions collides when both have ended.
    4. Collisions in different places have no common clock.  From six balls on it can matter which
       comes first; then it is as with ``ImpulseCorrelation(0, meeting=0.5)``.

    An infinite sequence is taken to its limit, and the trace says so (`Trace.collapsed`).

    Parameters
    ----------
    order : {"left", "right"}
        Which of several approaching contacts of a touching stretch collides first.
    max_events : int
        Largest number of steps before the impact is given up.

    Raises
    ------
    ValueError
        If a value is outside its range; the message names the value and the rule.

    References
    ----------
    Johnson, Int. J. Mech. Eng. Educ. 4 (1976); Han and Gilmore, J. Mech. Design 115 (1993)
    412-422; Ceanga and Hurmuzlu, J. Appl. Mech. 68 (2001) 575-583, Eq. 6.

    Examples
    --------
    >>> from cradle import Chain, collide
    >>> collide(Chain([1, 1, 1], [1, 0, 0], 1), SequentialCollisions()).velocities.tolist()
    [0.0, 0.0, 1.0]

    Balls struck from both sides: the order decides.

    >>> chain = Chain([1, 2, 1], [1, 0, -1], 1)
    >>> for order in ("left", "right"):
    ...     print(collide(chain, SequentialCollisions(order)).velocities.round(3).tolist())
    [-0.481, -0.37, 1.222]
    [-1.222, 0.37, 0.481]
    """

    order: str = "left"
    max_events: int = field(default=MAX_EVENTS, kw_only=True)

    def __post_init__(self) -> None:
        one_of("order", self.order, ("left", "right"))
        ImpulseCorrelation(0.0, max_events=self.max_events)  # checks max_events

    def solve(self, chain: Chain) -> Trace:
        """Solve the impact of `chain`; see `collide`."""
        seen, message, stored = must_be(Chain, "chain", chain), "", None
        if self.order == "right":
            # The leftmost contact of the mirror image is the rightmost of the chain.
            seen = Chain(chain.masses[::-1], 0.0 - chain.velocities[::-1], chain.restitution[::-1])
        try:
            trace = ImpulseCorrelation(0.0, max_events=self.max_events).solve(seen)
        except ImpactNotFinished as stopped:
            trace, message, stored = stopped.trace, stopped.args[0], stopped.stored
        if self.order == "right":
            trace = _mirrored(trace)
        trace = replace(trace, chain=chain, model=self)
        if message:
            raise ImpactNotFinished(message, trace, stored)
        return trace


def _mirrored(trace: Trace) -> Trace:
    """Return the trace as seen from the other side of the line of balls."""
    last = len(trace.impulses) - 1
    return replace(
        trace,
        velocities=0.0 - trace.velocities[::-1],  # no -0.0
        impulses=trace.impulses[::-1],
        absorbed=trace.absorbed[::-1],
        collisions=trace.collisions[::-1],
        path=0.0 - trace.path[:, ::-1],
        path_impulses=trace.path_impulses[:, ::-1],
        events=tuple(Event(kind, last - contact) for kind, contact in trace.events),
    )


@dataclass(frozen=True)
class FusedChain:
    """The balls on either side of the struck contact move as one body (Han and Gilmore's first).

    One contact approaches; all others touch at equal velocities.  The balls to its left and those
    to its right collide like two balls, with the energetic restitution of the struck contact.  The
    other contacts are neither compressed nor opened, so their own restitution has no say: they
    pass on just the impulse that keeps the balls of a body together.  That is the largest
    admissible ratio at every ball (Eq. 53), so `ImpulseCorrelation(1, 1, excess="saturate")`
    gives the same, and `Trace.saturated` names those contacts here as there.

    Raises
    ------
    ValueError
        On solving, for any other chain: where a second contact approaches, or one opens, it is
        undefined which balls are one body.

    References
    ----------
    Han and Gilmore, J. Mech. Design 115 (1993) 412-422; Ceanga and Hurmuzlu, J. Appl. Mech. 68
    (2001) 575-583, Eq. 5.

    Examples
    --------
    >>> from cradle import Chain, collide
    >>> collide(Chain([1, 1, 1], [1, 0, 0], 1), FusedChain()).velocities.round(3).tolist()
    [-0.333, 0.667, 0.667]
    """

    def solve(self, chain: Chain) -> Trace:
        """Solve the impact of `chain`; see `collide`."""
        n, u, v = len(must_be(Chain, "chain", chain)), chain.closing_speeds, chain.velocities
        c = _struck(u)
        path = np.tile(v, (n + 1 if c >= 0 else 1, 1))
        path_impulses = np.zeros((len(path), n - 1))
        absorbed = np.zeros(n - 1)
        events: list[Event] = []
        inner = [k for k in range(n - 1) if k != c] if c >= 0 else []
        if c >= 0:
            unit = np.ldexp(1.0, int(np.frexp(chain.masses.max())[1]) - 1)  # no sum overflows
            m = chain.masses / unit
            left, right = m[: c + 1].sum(), m[c + 1 :].sum()
            reduced = left / (left + right) * right
            # Each contact passes on the part of its body's mass that lies beyond it.
            part = np.concatenate(
                [np.cumsum(m[:c]) / left, [1.0], np.cumsum(m[: c + 1 : -1])[::-1] / right]
            )
            # Row 1 is the maximum compression, the others are the ends, at one instant.
            for row, impulse in enumerate(
                reduced * u[c] * np.array([1.0, 1.0 + chain.restitution[c]])
            ):
                path[row + 1 :, : c + 1] = v[0] - impulse / left
                path[row + 1 :, c + 1 :] = v[-1] + impulse / right
                path_impulses[row + 1 :] = impulse * part * unit
            absorbed[c] = 0.5 * reduced * unit * u[c] * u[c]
            events = [Event("maximum_compression", c), *(Event("end", k) for k in (c, *inner))]
        return Trace(
            chain=chain,
            model=self,
            velocities=path[-1],
            impulses=path_impulses[-1],
            absorbed=absorbed,
            collisions=np.full(n - 1, int(c >= 0)),
            path=path,
            path_impulses=path_impulses,
            events=tuple(events),
            saturated=tuple(inner),
        )


def _struck(u: Vector) -> int:
    """Return the one approaching contact, or -1 if no balls approach."""
    approaching, opening = (np.flatnonzero(where).tolist() for where in (u > 0.0, u < 0.0))
    if not approaching:
        return -1
    if len(approaching) > 1 or opening:
        what = f"contacts {approaching} approach" + (f" and {opening} open" if opening else "")
        raise ValueError(
            f"velocities leave it undefined which balls move as one body: {what}; FusedChain "
            "needs one approaching contact and equal velocities on either side of it"
        )
    return int(approaching[0])
