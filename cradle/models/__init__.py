"""The impact models, one file each, and the verb they share: `collide`."""

from __future__ import annotations

import functools
import inspect
import warnings
from typing import Protocol

from cradle.chain import Chain
from cradle.input.values import a, must_be
from cradle.trace import Trace


class Model(Protocol):
    """What every impact model offers: a rule from a chain to a path of contact impulses."""

    def solve(self, chain: Chain) -> Trace:
        """Return the path of the impact of `chain`."""
        ...


@functools.cache
def _takes(model: type[Model], option: str) -> bool:
    """Tell whether a kind of model has an option."""
    return option in inspect.signature(model.solve).parameters


def collide(
    chain: Chain, model: Model, *, record: bool | None = None, progress: bool = False
) -> Trace:
    """Solve one impact.

    Parameters
    ----------
    chain : Chain
        The balls at the instant before.
    model : Model
        The impact law, such as `ImpulseCorrelation`.
    record : bool, optional
        Whether to keep the path; for `ImpulseCorrelation`.  Left out, a path of more than ten
        million numbers is cut, with a warning.
    progress : bool
        Show how many events `ImpulseCorrelation` has counted so far; other models ignore it.

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
    options: dict[str, bool] = {}
    if record is not None:
        if not _takes(type(model), "record"):
            raise TypeError(f"{type(model).__name__} always keeps its path: record does not apply")
        options["record"] = record
    if progress and _takes(type(model), "progress"):
        options["progress"] = True
    trace = model.solve(chain, **options)
    if record is None and trace.left_out:
        kept = len(trace.events)
        advice = "; record=True keeps all, record=False none" * _takes(type(model), "record")
        told = f"the path holds the first {kept} of {kept + trace.left_out} events{advice}"
        warnings.warn(told, stacklevel=2)
    return trace
