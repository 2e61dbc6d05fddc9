"""What is read off outcomes: bouncing patterns, conditioning, effective ratios, conservation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cradle.chain import Chain
from cradle.closed_form import largest_ratios
from cradle.conserving import conserving_angle, conserving_outcomes
from cradle.input.values import Vector, checked, must_be, one_number
from cradle.models import Model, collide
from cradle.models.batch import post_impact_velocities
from cradle.trace import Event, Trace

__all__ = [
    "Condition", "bouncing_pattern", "condition_number", "conserving_angle", "conserving_outcomes",
    "effective_ratio",
]  # fmt: skip

#: Pattern by the number of balls that bounce back: none, the first, the first two.
_PATTERNS = np.array([2, 1, 3])

#: Ratios that are tried to bracket an effective ratio.
_RATIOS = 257


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
        raise ValueError(f"velocities has shape {v.shape}; must be (..., 3): those of three balls")
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
    TypeError
        If `chain` is no `Chain` or `model` no impact model.
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
    step = one_number("step", step, "must lie in [1e-12, 0.1]", 1e-12, 0.1)
    base = collide(chain, model)
    own = {name: getattr(chain, name) for name in ("masses", "velocities", "restitution")}
    ratios: dict[str, Any] = {}
    if hasattr(model, "forward") and hasattr(model, "backward"):
        backward = model.forward if model.backward is None else model.backward
        for name, values in (("forward", model.forward), ("backward", backward)):
            ratios[name] = np.broadcast_to(np.asarray(values, float), (len(chain) - 2,))
    law: Any = model
    sequence = _events_at_balls(base)
    total, largest, most, same = 0.0, -1.0, "", True
    for name, values in (own | ratios).items():
        for k in np.flatnonzero(values):
            change = 0.0
            for factor in (1.0 - step, 1.0 + step):
                moved = values.copy()
                moved[k] *= factor
                given = own | ratios | {name: moved}
                try:
                    changed = replace(law, **{n: given[n] for n in ratios}) if ratios else law
                    trace = collide(Chain(*(given[n] for n in own)), changed)
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


def effective_ratio(trace: Trace, *, tolerance: float = 1e-6) -> float:
    """Return the constant ratio that gives the outcome of an impact of three balls.

    The outcome may come from any model.  The ratio lies between 0 and its bound (Eq. 34); the
    restitution is that of the chain.  It is the ratio at the middle ball in both directions, as in
    `ImpulseCorrelation(ratio)`, held at its bound where one is smaller.  If several ratios give the
    outcome, the smallest is returned.  Two outcomes that lose no energy differ by one number, so
    that there one ratio often suffices; with losses there is in general none.

    Parameters
    ----------
    trace : Trace
        An impact of three balls.
    tolerance : float
        How far velocities may be from those of the ratio, as a part of the fastest closing speed.

    Returns
    -------
    float
        The ratio.

    Raises
    ------
    TypeError
        If `trace` is no `Trace`.
    ValueError
        If `tolerance` is no number of at least 0, there are not three balls, none approach, or no
        ratio gives the outcome: then the message has the one that comes nearest.

    References
    ----------
    Ceanga and Hurmuzlu, J. Appl. Mech. 68 (2001) 575-583, Eqs. 16 and 34.

    Examples
    --------
    >>> from cradle import Chain, SpringChain, collide
    >>> three = Chain([1, 1, 1], [1, 0, 0], 1)
    >>> for exponent in (1, 1.5):
    ...     print(round(effective_ratio(collide(three, SpringChain(1.0, exponent))), 6))
    0.230498
    0.132503
    """
    tolerance = one_number("tolerance", tolerance, "must be at least 0", 0.0)
    # SciPy is slow to import, and only this measure needs it.
    from scipy.optimize import brentq, minimize_scalar

    chain, target = must_be(Trace, "trace", trace).chain, trace.velocities
    u = chain.closing_speeds
    if len(chain) != 3:
        raise ValueError(f"trace has {len(chain)} balls; an effective ratio is that of three")
    if not (u > 0.0).any():
        what = f"closing_speeds = {u.tolist()}"
        raise ValueError(f"{what}; any ratio fits balls that do not approach")
    # The leftmost approaching contact drives (forward), or the right one alone (backward).
    bounds = largest_ratios(chain.masses, np.zeros(1), np.zeros(1))
    bound = float(bounds[0 if u[0] > 0.0 else 1][0])

    def distances(ratio: ArrayLike) -> Vector:
        ratios = np.asarray(ratio, dtype=np.float64)[..., None]
        after = post_impact_velocities(
            chain.masses, chain.velocities, chain.restitution, ratios, excess="saturate"
        )
        return np.asarray((after - target) / u.max())

    grid = np.linspace(0.0, bound, _RATIOS)
    missed = distances(grid)
    ball = int(np.argmax(np.ptp(missed, axis=0)))  # the one that tells most
    side = np.sign(missed[:, ball])
    found = [
        brentq(lambda ratio: float(distances(ratio)[ball]), grid[k], grid[k + 1], xtol=1e-15)
        for k in np.flatnonzero(side[:-1] * side[1:] < 0.0)
    ]
    # The outcome can be that of an end, and rounding hide the change of sign there.
    candidates = np.array([*found, *grid[side == 0.0], 0.0, bound])
    far = np.abs(distances(candidates)).max(axis=1)
    if (far <= tolerance).any():
        # The smallest that fits; but an end that fits beside a root gives way to the root.
        beside = candidates <= candidates[far <= tolerance].min() + grid[1]
        return float(candidates[np.argmin(np.where(beside, far, np.inf))])
    near = int(np.argmin(np.abs(missed).max(axis=1)))
    best = minimize_scalar(
        lambda ratio: float(np.abs(distances(ratio)).max()),
        bounds=(grid[max(near - 1, 0)], grid[min(near + 1, _RATIOS - 1)]),
        method="bounded",
    )
    raise ValueError(
        f"no ratio in [0, {bound:.6g}] gives the velocities {target.tolist()}; the nearest, "
        f"{best.x:.6g}, misses by {best.fun:.3g} of the fastest closing speed"
    )
