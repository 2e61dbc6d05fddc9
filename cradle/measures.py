"""What is read off outcomes: bouncing patterns, conditioning, effective ratios."""

from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from cradle.chain import Chain
from cradle.closed_form import largest_ratios
from cradle.input.values import ArrayLike, NDArray, Vector, checked, must_be, one_number
from cradle.models import Model, collide
from cradle.models.batch import post_impact_velocities
from cradle.models.correlation import ImpulseCorrelation
from cradle.trace import Event, Trace


def bouncing_pattern(velocities: ArrayLike) -> NDArray[np.int64]:
    """Return which balls of three bounce back: pattern 1, 2 or 3 (the paper's I, II, III).

    Ball 1 comes from the left and strikes two balls at rest.  In pattern 1 it alone goes back
    (velocity below zero), in pattern 2 no ball does, in pattern 3 balls 1 and 2 do (Ceanga and
    Hurmuzlu, J. Appl. Mech. 68 (2001) 575-583, section 2.5).  The velocities after the impact, m/s,
    shape (..., 3), are in order, so those below zero are just counted; the patterns have the shape
    (...).  Another shape, a velocity that is not finite, or ball 3 going back is a `ValueError`.

    Examples
    --------
    >>> from cradle.measures import bouncing_pattern
    >>> bouncing_pattern([[-0.1, 0.1, 0.9], [0.1, 0.2, 0.7], [-0.3, -0.1, 0.8]]).tolist()
    [1, 2, 3]
    """
    v = checked("velocities", velocities)
    if v.shape[-1:] != (3,):
        raise ValueError(f"velocities has shape {v.shape}; must be (..., 3): those of three balls")
    checked("velocities of ball 3", v[..., 2], "must be at least 0: ball 1 came from the left", 0.0)
    back = np.count_nonzero(v < 0.0, axis=-1)  # none, the first, or the first two
    return np.asarray(np.array([2, 1, 3])[back])


class Condition(NamedTuple):
    """How much an outcome amplifies relative changes of its inputs; see `condition_number`."""

    number: float  #: Relative change of the outcome over relative change of the inputs.
    most: str  #: The input that contributes most.
    same_events: bool  #: Whether the sequence of events stayed the same throughout.


def condition_number(chain: Chain, model: Model, step: float = 1e-6) -> Condition:
    """Measure how much an outcome amplifies relative changes of its inputs.

    Each mass, velocity, restitution and ratio of `ImpulseCorrelation` in turn is moved by the part
    `step` of itself (1e-12 to 0.1, else a `ValueError`), up and down, within its range, and the
    impact is solved again, with the errors of `collide`.  The largest change of any velocity
    counts, relative to the largest speed after the impact; the changes are added over all inputs
    and divided by `step` (Higham, Accuracy and Stability of Numerical Algorithms, 2002, section
    1.6).  A number of 1000 says: inputs known to seven digits give an outcome known to about four.
    Where `same_events` is False, a change within `step` leads to other events, and the outcome may
    jump; ask again with the accuracy of your own inputs as the step.  Zeros are not moved, and only
    one input at a time: a jump that takes two changes, or a ball at rest to move, is not seen.

    Examples
    --------
    >>> from cradle import Chain, ImpulseCorrelation
    >>> from cradle.measures import condition_number
    >>> found = condition_number(Chain([1, 1, 1], [1, 0, 0]), ImpulseCorrelation(0.5))
    >>> print(f"{found.number:.2g}", found.most, found.same_events)
    2.4e+03 forward[0] True
    """
    step = one_number("step", step, "must lie in [1e-12, 0.1]", 1e-12, 0.1)
    base = collide(chain, model)
    own = {name: getattr(chain, name) for name in ("masses", "velocities", "restitution")}
    ratios: dict[str, Any] = {}
    if isinstance(model, ImpulseCorrelation):
        ratios["forward"], ratios["backward"] = model.ratios(len(chain))
    law: Any = model
    sequence, same, changes = _events_at_balls(base), True, dict[str, float]()
    for name, values in (own | ratios).items():
        for k, factor in product(np.flatnonzero(values), (1.0 - step, 1.0 + step)):
            moved = values.copy()
            moved[k] *= factor
            given = own | ratios | {name: moved}
            try:
                changed = replace(law, **{n: given[n] for n in ratios}) if ratios else law
                trace = collide(Chain(*(given[n] for n in own)), changed)
            except ValueError:
                continue
            change = float(np.abs(trace.velocities - base.velocities).max())
            changes[f"{name}[{k}]"] = max(change, changes.get(f"{name}[{k}]", 0.0))
            same = same and _events_at_balls(trace) == sequence
    speed = float(np.abs(base.velocities).max()) or 1.0
    most = max(changes, key=changes.__getitem__)
    return Condition(sum(changes.values()) / speed / step, most, same)


def _events_at_balls(trace: Trace) -> list[list[Event]]:
    """Return ends, closings and collapses as each ball sees them: others have no common clock."""
    seen = [event for event in trace.events if event.kind != "maximum_compression"]
    balls = range(len(trace.chain))
    return [[one for one in seen if ball - one.contact in (0, 1)] for ball in balls]


def effective_ratio(trace: Trace) -> float:
    """Return the constant ratio that gives the outcome of an impact of three balls.

    It lies between 0 and its bound (Eq. 34) and acts in both directions, as in
    ``ImpulseCorrelation(ratio)``; in a direction with a smaller bound it is held at that.  If
    several ratios give the outcome within 1e-6 of the fastest closing speed, it is the lowest that
    256 steps find (with a light middle ball there may be a lower one).  Outcomes that lose no
    energy differ by one number, so that one ratio often suffices; with losses there is in general
    none, and the `ValueError` names the one that comes nearest.  Other than three balls, and balls
    of which none approach, raise a `ValueError` too.

    Examples
    --------
    >>> from cradle import Chain, SpringChain, collide
    >>> from cradle.measures import effective_ratio
    >>> round(effective_ratio(collide(Chain([1, 1, 1], [1, 0, 0]), SpringChain(1.0))), 6)
    0.132503
    """
    from scipy.optimize import brentq  # slow to import

    chain, target = must_be(Trace, "trace", trace).chain, trace.velocities
    u = chain.closing_speeds
    if len(chain) != 3:
        raise ValueError(f"trace has {len(chain)} balls; an effective ratio is that of three")
    if not (u > 0.0).any():
        raise ValueError(f"closing_speeds = {u.tolist()}; any ratio fits where none approach")
    # The leftmost approaching contact drives (forward), or the right one alone (backward).
    bounds = largest_ratios(chain.masses, np.zeros(1), np.zeros(1))
    bound = float(bounds[0 if u[0] > 0.0 else 1][0])
    balls = chain.masses, chain.velocities, chain.restitution

    def distances(ratio: ArrayLike) -> Vector:
        ratios = np.asarray(ratio, dtype=np.float64)[..., None]
        after = post_impact_velocities(*balls, ratios, excess="saturate")
        return np.asarray((after - target) / u.max())

    grid = np.linspace(0.0, bound, 257)
    missed = distances(grid)
    ball = int(np.argmax(np.ptp(missed, axis=0)))  # the one that tells most
    side = np.sign(missed[:, ball])
    found = [
        brentq(lambda ratio: float(distances(ratio)[ball]), grid[k], grid[k + 1], xtol=1e-15)
        for k in np.flatnonzero(side[:-1] * side[1:] < 0.0)
    ]
    near = np.abs(missed).max(axis=1).argmin()
    finer = np.linspace(grid[max(near - 1, 0)], grid[min(near + 1, 256)], 257)
    # The outcome can be that of an end, and rounding hide the change of sign there; or turn back.
    candidates = np.array([*found, *grid[side == 0.0], 0.0, bound, *finer])
    far = np.abs(distances(candidates)).max(axis=1)
    if (far <= 1e-6).any():
        # The smallest that fits; but an end that fits beside a root gives way to the root.
        beside = candidates <= candidates[far <= 1e-6].min() + grid[1]
        return float(candidates[np.argmin(np.where(beside, far, np.inf))])
    told = f"no ratio in [0, {bound:.6g}] gives the velocities {target.tolist()}; the nearest"
    least = f"{far.min():.3g} of the fastest closing speed"
    raise ValueError(f"{told}, {candidates[far.argmin()]:.6g}, misses by {least}")
