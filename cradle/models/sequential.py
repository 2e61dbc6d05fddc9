"""The two answers that came before the ratio: one collision after another, or one solid body."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cradle.chain import Chain
from cradle.input.values import must_be, one_of
from cradle.models.correlation import MAX_EVENTS, ImpulseCorrelation
from cradle.trace import Event, ImpactNotFinished, Trace


@dataclass(frozen=True)
class SequentialCollisions:
    """One collision of two balls after another (equation 6): Han and Gilmore's second answer.

    While two balls collide, the contacts beside them get no impulse.  That is the ratio 0, and
    ``ImpulseCorrelation(0)`` solves it (Johnson, Int. J. Mech. Eng. Educ. 4 (1976); Han and
    Gilmore, J. Mech. Design 115 (1993) 412-422).  Afterwards either of these contacts may collide;
    one between two collisions waits until both have ended.  Collisions that share no ball have no
    common clock: rule R8 of the book decides which ends first.  Wrong values raise a `ValueError`.

    Parameters
    ----------
    order : {"left", "right"}
        The end of touching balls at which contacts collide first; outcomes can depend on it.
    max_events : int
        Number of steps after which the impact is given up.

    Examples
    --------
    >>> from cradle import Chain, SequentialCollisions, collide
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
        vars(self)["max_events"] = ImpulseCorrelation(0.0, max_events=self.max_events).max_events

    def solve(self, chain: Chain) -> Trace:
        """Solve the impact of `chain`; see `collide`."""
        seen = must_be(Chain, "chain", chain)
        if self.order == "right":
            # The leftmost contact of the mirror image is the rightmost of the chain.
            m, v, e = chain.masses[::-1], 0.0 - chain.velocities[::-1], chain.restitution[::-1]
            seen = Chain._of(m, v, e)
        try:
            return self._own(ImpulseCorrelation(0.0, max_events=self.max_events).solve(seen), chain)
        except ImpactNotFinished as stopped:
            message, reached, stored = stopped.args
            raise ImpactNotFinished(message, self._own(reached, chain), stored) from None

    def _own(self, trace: Trace, chain: Chain) -> Trace:
        """Return the trace as that of this model, seen from the side from which the chain is."""
        own: dict[str, Any] = {"chain": chain, "model": self}
        if self.order == "right":
            turned = ("impulses", "absorbed", "collisions", "path_impulses")
            own |= {name: getattr(trace, name)[..., ::-1] for name in turned}
            own |= {name: 0.0 - getattr(trace, name)[..., ::-1] for name in ("velocities", "path")}
            last = len(trace.impulses) - 1
            own["events"] = tuple(Event(kind, last - contact) for kind, contact in trace.events)
        return replace(trace, **own)


@dataclass(frozen=True)
class FusedChain:
    """The balls on each side of the struck contact move as one body (equation 5).

    This is Han and Gilmore's first answer (cited at `SequentialCollisions`).  All balls on the left
    of the contact that closes, and all on its right, collide like two bodies, with the restitution
    of that contact.  That is the largest admissible ratio at every ball (Eq. 53), and
    ``ImpulseCorrelation(1, excess="saturate")`` solves it.  If a second contact closes or one
    opens, it is not clear which balls are one body, and a `ValueError` is raised.

    Examples
    --------
    >>> from cradle import Chain, FusedChain, collide
    >>> collide(Chain([1, 1, 1], [1, 0, 0], 1), FusedChain()).velocities.round(3).tolist()
    [-0.333, 0.667, 0.667]
    """

    def solve(self, chain: Chain) -> Trace:
        """Solve the impact of `chain`; see `collide`."""
        u = must_be(Chain, "chain", chain).closing_speeds
        approaching, opening = (np.flatnonzero(where).tolist() for where in (u > 0.0, u < 0.0))
        if len(approaching) > 1 or (approaching and opening):
            what = f"contacts {approaching} approach" + (f" and {opening} open" if opening else "")
            told = f"velocities leave it undefined which balls move as one body: {what}"
            rule = "needs one approaching contact and equal velocities on either side of it"
            raise ValueError(f"{told}; FusedChain {rule}")
        return replace(ImpulseCorrelation(1.0, 1.0, excess="saturate").solve(chain), model=self)
