"""The impact models, one file each, and the verb they share: `collide`."""

from __future__ import annotations

from typing import Protocol

from cradle.chain import Chain
from cradle.checks import a, must_be
from cradle.trace import Trace


class Model(Protocol):
    """What every impact model offers: a rule from a chain to a path of contact impulses."""

    def solve(self, chain: Chain) -> Trace:
        """Return the path of the impact of `chain`."""
        ...


def collide(chain: Chain, model: Model) -> Trace:
    """Solve one impact.

    Parameters
    ----------
    chain : Chain
        The balls at the instant before.
    model : Model
        The impact law, such as `ImpulseCorrelation`.

    Returns
    -------
    Trace
        The path and the outcome.  If no balls approach, it is empty and nothing has changed.

    Raises
    ------
    TypeError
        If `chain` is no `Chain` or `model` no impact model.
    ValueError
        If the model cannot treat this chain; the message says why.
    ImpactNotFinished
        If the impact takes more steps than the model allows.

    Examples
    --------
    >>> from cradle import Chain, ImpulseCorrelation, collide
    >>> collide(Chain([1, 1, 1], [1, 0, 0], 1), ImpulseCorrelation(0.0)).velocities.tolist()
    [0.0, 0.0, 1.0]
    """
    must_be(Chain, "chain", chain)
    if isinstance(model, type):
        raise TypeError(f"model is the class {model.__name__}; must be made: {model.__name__}(...)")
    if not hasattr(model, "solve"):
        raise TypeError(f"model is {a(type(model).__name__)}; must be an impact model")
    return model.solve(chain)
