"""What is read off an outcome: which balls bounce back."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cradle.chain import Chain, checked
from cradle.models import Model, collide
from cradle.trace import Event, Trace

#: Pattern by the number of balls that bounce back: none, the first, the first two.
_PATTERNS = np.array([2, 1, 3])


def bouncing_pattern(velocities: ArrayLike) -> NDArray[np.int64]:
    """Return which balls of three bounce back: pattern 1, 2 or 3 (the paper's I, II, III).

    Ball 1 strikes two balls at rest and comes from the left.  As balls never overtake each other,
    the number of balls that go back (velocity below zero) names them:

    - pattern 1: ball 1 alone bounces back;
    - pattern 2: no ball bounces back;
    - pattern 3: balls 1 and 2 bounce back.

    A ball at rest counts as one that does not go back.

    Parameters
    ----------
    velocities : array_like, shape (..., 3)
        Velocities after the impact, m/s.

    Returns
    -------
    ndarray of int, shape (...)
        1, 2 or 3.

    Raises
    ------
    ValueError
        If the last axis is not three balls long, a velocity is not finite, or the last ball goes
        back: then momentum did not come from the left.

    References
    ----------
    Ceanga and Hurmuzlu, J. Appl. Mech. 68 (2001) 575-583, section 2.5, Fig. 6.

    Examples
    --------
    >>> bouncing_pattern([[-0.1, 0.1, 0.9], [0.1, 0.2, 0.7], [-0.3, -0.1, 0.8]]).tolist()
    [1, 2, 3]
    """
    v = checked("velocities", velocities)
    if v.shape[-1:] != (3,):
        raise ValueError(f"velocities has shape {v.shape}; must be (..., 3)")
    checked("velocities of ball 3", v[..., 2], "must be at least 0: ball 1 came from the left", 0.0)
    return np.asarray(_PATTERNS[np.count_nonzero(v < 0.0, axis=-1)])


class Condition(NamedTuple):
    """How much an outcome amplifies relative changes of its inputs; see `condition_number`.

    Examples
    --------
    >>> from cradle import Chain, ImpulseCorrelation
    >>> condition_number(Chain([1, 1, 1], [1, 0, 0], 1), ImpulseCorrelation(0.5)).most
    'forward[0]'
    """

    #: Relative change of the outcome over relative change of the inputs.
    number: float
    #: The input that contributes most.
    most: str
    #: Whether the sequence of events stayed the same throughout.
    same_events: bool


def condition_number(chain: Chain, model: Model, step: float = 1e-6) -> Condition:
    """Measure how much an outcome amplifies relative changes of its inputs.

    Every input in turn, each mass, velocity, restitution and ratio, is moved by the part `step` of
    itself, up and down, and the impact is solved again.  The largest change of any velocity counts,
    relative to the largest speed after the impact; the changes are added over all inputs and
    divided by `step`.  A number of 1000 says: inputs known to seven digits give an outcome known to
    about four.

    A condition number holds near the chain, at the distance `step`.  Where `same_events` is False,
    an edge lies within that distance: another sequence of events follows, and the outcome may jump,
    so that the number grows as 1 / `step`; ask again with the accuracy of your own inputs as
    the step.  An edge that only several inputs together reach is not seen.  Inputs that are
    zero stay zero, so balls that touch go on touching.  A side on which an input would leave its
    range is left out.

    Parameters
    ----------
    chain : Chain
        The balls at the instant before.
    model : Model
        The impact law; the ratios of `ImpulseCorrelation` are inputs too.
    step : float
        Relative change of each input, above 1e-12 so that rounding does not count.

    Returns
    -------
    Condition
        The number, the input that contributes most, and whether the events stayed the same.

    Raises
    ------
    ValueError
        If `step` is no number from 1e-12 to 0.1, or the model cannot treat the chain.
    ImpactNotFinished
        If one of the impacts takes too long.

    References
    ----------
    Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed. (2002), section 1.6.

    Examples
    --------
    At its bound (Eq. 34) a ratio acts through a square root, so its sixth digit counts:

    >>> from cradle import Chain, ImpulseCorrelation
    >>> chain = Chain([1, 1, 1], [1, 0, 0], 1)
    >>> for ratio in (0.15, 0.5):
    ...     number, most, same_events = condition_number(chain, ImpulseCorrelation(ratio))
    ...     print(f"{number:.2g}", most, same_events)
    3.7 velocities[0] True
    2.4e+03 forward[0] True
    """
    if np.ndim(step):
        raise ValueError(f"step = {step!r}; must be one number")
    checked("step", step, "must lie in [1e-12, 0.1]", 1e-12, 0.1)
    own = {name: getattr(chain, name) for name in ("masses", "velocities", "restitution")}
    ratios: dict[str, Any] = {}
    if hasattr(model, "forward") and hasattr(model, "backward"):
        backward = model.forward if model.backward is None else model.backward
        for name, values in (("forward", model.forward), ("backward", backward)):
            ratios[name] = np.broadcast_to(np.asarray(values, float), (len(chain) - 2,))
    model_of: Any = model

    def solve(**moved: Any) -> Trace:
        changed = {name: moved.get(name, values) for name, values in ratios.items()}
        return collide(
            Chain(*(moved.get(name, values) for name, values in own.items())),
            replace(model_of, **changed) if changed else model,
        )

    base = solve()
    sequence = _events_at_balls(base)
    total, largest, most, same = 0.0, -1.0, "", True
    for name, values in (own | ratios).items():
        for k in np.flatnonzero(values):
            change = 0.0
            for factor in (1.0 - step, 1.0 + step):
                moved = values.copy()
                moved[k] *= factor
                try:
                    trace = solve(**{name: moved})
                except ValueError:
                    continue
                change = max(change, float(np.abs(trace.velocities - base.velocities).max()))
                same = same and _events_at_balls(trace) == sequence
            total += change
            if change > largest:
                largest, most = change, f"{name}[{k}]"
    speed = float(np.abs(base.velocities).max()) or 1.0
    return Condition(total / speed / step, most, same)


def _events_at_balls(trace: Trace) -> list[list[Event]]:
    """Return ends, closings and collapses as each ball sees them: others have no common clock."""
    seen: list[list[Event]] = [[] for _ in range(len(trace.chain))]
    for event in trace.events:
        if event.kind != "maximum_compression":
            seen[event.contact].append(event)
            seen[event.contact + 1].append(event)
    return seen
