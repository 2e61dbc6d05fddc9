"""Choose the model: refuse what is impossible, then take the cheapest that does what is wanted."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, fields
from html import escape
from typing import Any, NamedTuple

import numpy as np

from cradle.advice.measured import LAWS, evidence, measured_chain, rows
from cradle.chain import Chain
from cradle.input.values import PART, ArrayLike, must_be, one_number, one_of, whole_number
from cradle.models import Model
from cradle.models.compliant import SpringChain
from cradle.models.correlation import ImpulseCorrelation
from cradle.models.energy import EnergyDistribution
from cradle.models.sequential import SequentialCollisions
from cradle.models.speed import viscosity_from

WANTED = ("velocities", "impulses", "path", "forces", "times", "fastest ball")

_NOISE = 1.5  # two measurements of a time differ by less: so it does not decide between models
#: What solves a batch.
_BATCH = {
    "event": "post_impact_velocities(masses, velocities, restitution, forward, backward)",
    "many springs": "spring_velocities(masses, velocities, advice.model.stiffness, "
    "viscosity=advice.model.viscosity, accuracy=advice.model.accuracy)",
}

# By the group of the table.
_REASONS = {
    "event": "The ratios are known, so the impact is solved event by event: without a step, all "
    "digits have one price.",
    "springs": "Elastic balls push each other as springs do. Velocities depend on ratios of "
    "stiffnesses alone: for equal contacts any stiffness will do.",
    "timed": "Forces and times come from springs alone; they are those of the stiffness given.",
    "lossy": "The balls push each other as viscous spheres do. Their viscosity is that with which "
    "two of them, closing as fast as here, part with the restitution given; for another speed make "
    "the model anew. It takes the losses: advice.chain has restitution 1.",
    "energy": "The restitution is too low for viscous springs; the energy law shares losses out by "
    "the energy that contacts store. How near it comes to real balls was not measured. At .02 "
    "both can be had; they differ on the last of five equal balls by .03 of the closing speed.",
    "outcome": "Restitution alone does not determine the impact; of the models that need no more, "
    "this one is nearest to Hertz springs. On the elastic chains measured it has the right fastest "
    "ball; on others it can be wrong.",
    "two balls": "Two balls have no ratio: restitution alone determines them.",
}


@dataclass(frozen=True, repr=False)
class Recommendation:
    """A model for a scene, and what to expect of it.  What was not measured is None."""

    chain: Chain = field(compare=False)  #: The balls, as the model takes them.
    model: Model  #: The model, ready for `collide`.
    setting: str  #: Its setting, that is integrator and tolerance, one call or a batch.
    call: str  #: The call to write.
    #: Largest distance of a velocity from the exact answer of the same model on the chains of
    #: `measured_on`, as a part of the closing speed; another chain may have a few times as much.
    numerical_error: float | None
    #: Its distance from Hertz springs, the theory of elastic spheres (equal ones, unless
    #: `stiffness` says otherwise); no setting makes it smaller.  With losses it is None.
    model_error: float | None
    seconds: float | None  #: Time of one impact where it was measured, to a factor of two.
    #: The chains measured, this very one or those around it, of which the worst counts.
    measured_on: tuple[str, ...]
    reason: str  #: Why it is this model.

    def _lines(self) -> dict[str, str]:
        """Return what is shown, by its title."""
        numerical, apart = (
            "not measured" if error is None else f"{error:.1e}"
            for error in (self.numerical_error, self.model_error)
        )
        if self.model_error == 0.0:
            apart = "0 from spheres that touch and strike as one"
        if self.numerical_error is None and isinstance(self.model, SpringChain):
            numerical = f"{self.model.accuracy:g} at most by its own estimate; not measured"
        time = "not measured" if self.seconds is None else lasting(self.seconds)
        slow = self.setting.startswith("plain") or isinstance(self.model, EnergyDistribution)
        if self.seconds is not None and not slow:
            time += " once compiled; small work runs in plain Python, many times slower"
        return {
            "setting": self.setting,
            "call": self.call,
            "numerical error": numerical,
            "model error": apart,
            "time": time,
            "measured on": "; ".join(self.measured_on) or "nothing like this",
            "reason": self.reason,
        }

    def __repr__(self) -> str:
        lines = [f"  {title + ':':<17}{text}" for title, text in self._lines().items()]
        return "\n".join([f"Recommendation: {made(self.model)}", *lines])

    def _repr_html_(self) -> str:
        lines = {"model": made(self.model), **self._lines()}.items()
        style = ' style="overflow-wrap: anywhere"'  # on a phone, too, nothing is cut
        rows = [f"<tr><th>{escape(a)}</th><td{style}>{escape(b)}</td></tr>" for a, b in lines]
        return f'<table class="dataframe">{"".join(rows)}</table>'  # pages style it as a table


def recommend(
    chain: Chain, wanted: str | Collection[str] = "velocities", *,
    accuracy: float = 1e-6, model_error: float | None = None, impacts: int = 1,
    ratios: ImpulseCorrelation | ArrayLike | None = None,
    stiffness: float | Sequence[float] | None = None,
) -> Recommendation:  # fmt: skip
    """Recommend the cheapest model that gives what is wanted from what is known.

    If a value is wrong or no model fits, a `ValueError` says what is missing.

    Parameters
    ----------
    chain : Chain
        The balls, with their restitution.
    wanted : str or collection of str
        One or several of "velocities", "impulses", "path", "forces", "times" (how long contacts
        last) and "fastest ball" (which one it is).
    accuracy, model_error : float
        Largest numerical error of a velocity, as a part of the closing speed, 1e-15 to 1; and in
        the same unit the largest distance from elastic spheres (Hertz springs), any if left out.
    impacts : int
        How many impacts of such chains are to be solved; if several, a call that takes many chains
        is recommended where a model has one (measured with 2000).
    ratios : ImpulseCorrelation, float or sequence of length N - 2, optional
        Impulse Correlation Ratios, if they are known, as a model or as its `forward`.
    stiffness : float or sequence of length N - 1, optional
        k of the contacts of spheres, N/m^(3/2), if it is known.  For spheres that are all alike
        give 1, unless forces or times are wanted.

    Notes
    -----
    Measured were errors of velocities, on rows that touch, struck at one end, with equal springs.
    For a chain between those the worst error counts, and must be at most a tenth of `accuracy`.

    Examples
    --------
    >>> from cradle import Chain, recommend
    >>> chain = Chain([1, 1, 1], [1, 0, 0])
    >>> advice = recommend(chain, ("forces", "times"), accuracy=1e-3, stiffness=1e10)
    >>> advice.numerical_error <= 1e-3, advice.model_error, advice.measured_on
    (True, 0.0, ('three equal',))
    """
    must_be(Chain, "chain", chain)
    one_number("accuracy", accuracy, "must lie in [1e-15, 1]", 1e-15, 1.0)
    one_number("model_error", 0.0 if model_error is None else model_error, *PART)
    whole_number("impacts", impacts)
    if ratios is not None and not isinstance(ratios, ImpulseCorrelation):
        ratios = ImpulseCorrelation(ratios)
    if stiffness is not None:
        stiffness = SpringChain(stiffness).stiffness
    several = isinstance(wanted, Collection) and not isinstance(wanted, (str, np.ndarray))
    wishes = tuple(one_of("wanted", x, WANTED) for x in (several and [*wanted]) or [wanted])
    like = chain if len({*np.ravel(stiffness or 1.0)}) == 1 else None
    elastic = bool((chain.restitution == 1.0).all())
    wish = _Wish(chain, wishes, accuracy, model_error, impacts, ratios, stiffness, like, elastic)
    found = []
    failures: dict[str, list[str]] = {}
    for group, make in _models(wish).items():
        try:
            found.append(_best(group, make, wish))
        except _Unfit as why:
            failures.setdefault(why.args[0], []).append(why.args[1])
    if not found:
        told = [f"{one}; {', '.join(reasons)}" for one, reasons in failures.items()]
        if model_error is not None and stiffness is None:
            told.append("give stiffness=1 for springs, which have no model error")
        raise ValueError("; ".join(told))
    unmeasured, least = min(order for order, _ in found)
    return next(advice for order, advice in found if order <= (unmeasured, _NOISE * least))


class _Wish(NamedTuple):
    """What is wanted of which chain, and what is known of it."""

    chain: Chain
    wanted: tuple[str, ...]
    accuracy: float
    model_error: float | None
    impacts: int
    ratios: ImpulseCorrelation | None
    stiffness: float | Sequence[float] | None
    like: Chain | None  # the chain, if its contacts are equal springs, as all that were measured
    elastic: bool


class _Unfit(Exception):
    """A wish, and why a model does not fulfil it."""


def _models(wish: _Wish) -> dict[str, Callable[[float], Model]]:
    """Return what is known allows, by group: how to make it in a setting.  Or nothing can do it."""
    chain, wanted, _, model_error, _, ratios, stiffness, like, elastic = wish
    lossy = int(np.argmin(chain.restitution))
    loss = f"restitution[{lossy}] = {float(chain.restitution[lossy])!r}"
    timed = next((name for name in wanted if name in ("forces", "times")), "")
    # Nothing but restitution is known, and it is not enough; and where that may do all the same.
    bare = ratios is None and stiffness is None and len(chain) > 2
    modest = set(wanted) == {"fastest ball"} or model_error is not None
    errors = [row.model_error for row in rows("outcome") if row.model_error is not None]
    refused = {
        f"velocities = {chain.velocities.tolist()}; no balls approach: no impact":
            not (chain.closing_speeds > 0.0).any(),
        f"wanted = {timed!r}; needs stiffness: rigid models have impulses alone; give that of the "
        "contacts in N/m^(3/2), for two steel balls of radius 1 cm stiffness=1e10":
            timed and stiffness is None,
        f"model_error = {model_error!r}, {loss}; must be left out unless all are 1: models were "
        "not measured against balls with losses":
            model_error is not None and not elastic,
        f"wanted = {wanted[0]!r}; needs ratios or stiffness: restitution alone does not determine "
        f"the impact of {len(chain)} balls.  Give stiffness=1 if all contacts are equal spheres, "
        "or the ratios that were measured.  SequentialCollisions, which needs neither, was off by "
        f"{min(errors):.2g} to {max(errors):.2g} of the closing speed on the elastic chains "
        "measured; it may tell the 'fastest ball'":
            bare and not modest,
    }  # fmt: skip
    for words, wrong in refused.items():
        if wrong:
            raise ValueError(words)
    models: dict[str, Callable[[float], Model]] = {}
    if ratios is not None or len(chain) == 2:
        models["event"] = lambda _: ratios or ImpulseCorrelation(0.0)
    if stiffness is not None:
        try:
            lost = own_viscosity(chain, stiffness)
        except ValueError:  # the restitution is too low for springs
            if timed:
                raise
            models["energy"] = lambda at: EnergyDistribution(stiffness, rtol=at)
        else:
            for group in ("many springs", "springs")[wish.impacts == 1 :]:
                models[group] = lambda at: SpringChain(stiffness, viscosity=lost, accuracy=at)
    if modest and (bare or (elastic and like and measured_chain(chain))):
        models["outcome"] = lambda _: SequentialCollisions()
    return models


def own_viscosity(chain: Chain, stiffness: float | Sequence[float]) -> float | tuple[float, ...]:
    """Return the viscosity that belongs to a chain's restitution at its own speed."""
    speed, masses = float(chain.closing_speeds.max()), chain.masses
    if (chain.restitution == 1.0).all() or speed <= 0.0:
        return 0.0
    found = viscosity_from(chain.restitution, speed=speed, masses=masses, stiffness=stiffness)
    lost = float(found[0]) if len({*found}) == 1 else tuple(found.tolist())
    # It may be more than springs can have beside the quickest of the chain.
    SpringChain(stiffness, viscosity=lost, accuracy=0.02).solve(Chain(masses, chain.velocities))
    return lost


def _best(
    group: str, make: Callable[[float], Model], wish: _Wish
) -> tuple[tuple[bool, float], Recommendation]:
    """Return a model in its cheapest setting that fulfils a wish, after what orders models."""
    chain, name = wish.chain, LAWS[group].partition(",")[0]
    gives = {"velocities" if one == "fastest ball" else one for one in wish.wanted}
    found = tuple(row for row in rows(group) if gives <= row.gives
                  and (wish.impacts > 1 or "batch" not in row.setting)
                  and not (wish.elastic and "lossy" in row.chains[0]))  # fmt: skip
    if not found:
        lacks = gives.difference(*(row.gives for row in rows(group))) or gives
        raise _Unfit(f"wanted = {wish.wanted!r}", f"{name} has no {' and '.join(sorted(lacks))}")
    # What a model refuses it refuses now: the same balls at rest cost it no work.
    springs = group in ("springs", "many springs")
    e = 1.0 if springs else chain.restitution  # springs have their viscosity
    make(found[0].parameter).solve(Chain(chain.masses, 0.0 * chain.velocities, e))
    where, settings = evidence(found, wish.like, wish.ratios if group == "event" else None)
    # A chain among the measured ones can be worse than each of them, by a few times.
    errors = [(1.0 if where == "here" else 10.0) * (row.numerical_error or 0.0) for row in settings]
    if min(errors) > wish.accuracy:
        least = settings[int(np.argmin(errors))]
        told = f"the least numerical error of {name} measured is {least.numerical_error:.2g}"
        other = "; on other chains it must be 10 times better" * (where != "here")
        on = f"({', '.join(least.chains)}){other}: ask for {1.05 * min(errors):.1e} or more"
        raise _Unfit(f"accuracy = {wish.accuracy!r}", f"{told} {on}")
    fit = [row for row, error in zip(settings, errors, strict=True) if error <= wish.accuracy]
    row = min(fit, key=lambda row: row.seconds)
    two = len(chain) == 2
    here = row.model_error if where == "here" else None
    apart = 0.0 if wish.elastic and (springs or two) else here
    if wish.model_error is not None and (apart is None or apart > wish.model_error):
        known = "was not measured here" if apart is None else f"is {apart:.2g}"
        raise _Unfit(f"model_error = {wish.model_error!r}", f"that of {name} {known}")
    measured = where != "elsewhere"
    kind = ("timed" if {"forces", "times"} & gives else "springs") if springs else group
    if springs and not wish.elastic:
        kind, chain = "lossy", Chain(chain.masses, chain.velocities)
    return (not measured, row.seconds), Recommendation(
        chain=chain,
        model=make(row.parameter),
        setting=row.setting,
        call=_BATCH[group] if "batch" in row.setting else "collide(advice.chain, advice.model)",
        numerical_error=row.numerical_error if measured else None,
        model_error=apart,
        seconds=row.seconds if measured else None,
        measured_on=row.chains if measured else (),
        reason=_REASONS["two balls" if group == "event" and two else kind],
    )


def lasting(seconds: float) -> str:
    """Return a time in two digits; microseconds are us, for terminals without the letter mu."""
    units = {"us": 1e-6, "ms": 1e-3, "s": 1.0}
    name = next((unit for unit, size in units.items() if seconds < 999.5 * size), "s")
    return f"{np.format_float_positional(float(f'{seconds / units[name]:.1e}'), trim='-')} {name}"


def made(model: Any) -> str:
    """Return the call that makes a model, without what is as usual."""
    values = {one.name: (getattr(model, one.name), one.default) for one in fields(model)}
    given = [f"{name}={value!r}" for name, (value, usual) in values.items() if value != usual]
    return f"{type(model).__name__}({', '.join(given)})"
