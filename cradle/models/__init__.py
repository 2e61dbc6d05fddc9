"""The impact models, one file each, and the verb they share: `collide`."""

import warnings
from typing import Protocol

from cradle.chain import Chain
from cradle.input.values import a, flag, must_be
from cradle.models.compliant import SpringChain
from cradle.models.correlation import ImpulseCorrelation
from cradle.trace import Trace


class Model(Protocol):
    """What every impact model offers: a method that solves the impact of a chain."""

    def solve(self, chain: Chain) -> Trace:
        """Return the path of the impact of `chain`."""


def a_model(model: object) -> None:
    """Raise if this is no impact model."""
    if isinstance(model, type):
        raise TypeError(f"model is the class {model.__name__}; must be made: {model.__name__}(...)")
    if not hasattr(model, "solve"):
        raise TypeError(f"model is {a(type(model).__name__)}; must be an impact model")


def collide(
    chain: Chain, model: Model, *, record: bool | None = None, progress: bool = False
) -> Trace:
    """Solve one impact; where no balls approach, nothing happens and the path has no events.

    Parameters
    ----------
    chain, model : Chain, Model
        The balls at the instant before, and the impact law, such as `ImpulseCorrelation`.
    record : bool, optional
        Whether to keep the path; for `ImpulseCorrelation` only.  If left out, a path of more than
        ten million numbers (2 N - 1 for each event) is cut, with a warning.
    progress : bool
        Count events (`ImpulseCorrelation`) or steps (`SpringChain`) on screen, after two seconds.

    Returns
    -------
    Trace
        Its `velocities` are those after the impact, m/s.

    Raises
    ------
    TypeError, ValueError
        If `chain` or `model` is of another type, or the model cannot treat this chain.
    ImpactNotFinished, ImpactNotCertified
        If the impact takes more steps than the model allows, or its outcome fails a check.

    Examples
    --------
    >>> from cradle import Chain, ImpulseCorrelation, collide
    >>> collide(Chain([1, 1, 1], [1, 0, 0], 1), ImpulseCorrelation(0.0)).velocities.tolist()
    [0.0, 0.0, 1.0]
    """
    must_be(Chain, "chain", chain)
    a_model(model)
    if isinstance(model, ImpulseCorrelation):
        trace = model.solve(chain, record=record, progress=progress)
        advice = "; record=True keeps all, record=False none"
    elif record is not None:
        raise TypeError(f"{type(model).__name__} has a path of its own: record does not apply")
    elif flag("progress", progress) and isinstance(model, SpringChain):
        trace, advice = model.solve(chain, progress=True), ""
    else:
        trace, advice = model.solve(chain), ""
    if record is None and trace.left_out:
        kept = len(trace.events)
        told = f"the path holds the first {kept} of {kept + trace.left_out} events{advice}"
        warnings.warn(told, stacklevel=2)
    return trace
