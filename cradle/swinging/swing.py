"""The swinging cradle; `resting` tells the rules of touching and resting balls."""

import copy
import functools
import math
from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from cradle.chain import Chain
from cradle.input.values import ArrayLike, Vector, checked, must_be, shown, whole_number
from cradle.models import Model, collide
from cradle.models.compliant import SpringChain
from cradle.swinging.flight import FullFlight, SmallAngleFlight
from cradle.swinging.pendulums import TIE, Hanging, Pendulums, mean
from cradle.swinging.record import Impact, Swing
from cradle.swinging.resting import NEAR, RESTING, common_velocities, pressed, stretches
from cradle.trace import Trace

#: Contact forces take their time while the depth of a contact over its speed is less than so much
#: of a radian, and a strike than that; from then on impacts take none, as by all other laws.
SHORT, LONGEST = 4e-3, 0.1
#: Events without an impact that one instant can have, for each ball: a contact has a few at most.
MOST_IDLE = 20


def swing(
    chain: Chain, model: Model, positions: ArrayLike, times: ArrayLike, *,
    pendulums: Pendulums | None = None, max_impacts: int = 100_000,
) -> Swing:  # fmt: skip
    """Let a cradle swing: pendulums between impacts, and the impacts by any law.

    Parameters
    ----------
    chain : Chain
        Masses, restitution, and the velocities at the release (usually zeros).
    model : Model
        The impact law, such as `ImpulseCorrelation`; for a part that collides alone with the values
        of that part, and ``excess="saturate"`` if it has that field.  Only impacts by `SpringChain`
        take time, in which gaps may close and strings are mere kicks: at unequal strings, balls
        that rattle are some per cent off, of steel .1 % if its `accuracy` is 1e-5 or less.  Beyond
        about .01 / w a contact and .1 / w a strike, with w = sqrt(g/l), they take none either:
        `Swing.lasting` tells.
    positions : array_like, shape (N,)
        Where the balls are released, along their arcs from their lowest points, m; positive to the
        right.  At most a quarter of a circle; with ``angle="full"`` and no gaps less than half one.
    times : array_like, shape (T,)
        When to report positions and velocities, s since the release; rising, from 0 on.  At times
        within a strike that takes time, those at its end are reported.
    pendulums : Pendulums, optional
        How the balls hang; if left out, at 0.1 m, without gaps and damping, for small angles.
    max_impacts : int
        End the run after this number of impacts.

    Raises
    ------
    TypeError, ImpactNotFinished, ImpactNotCertified
        As `collide`.
    ValueError
        If a value is wrong, balls overlap, a ball swings farther aside than it may be released, or
        the model cannot treat an impact.
    RuntimeError
        If contacts open and close without end at one instant; or if the check of the whole run
        fails: balls pass each other, energy or momentum is not kept.

    Examples
    --------
    >>> from cradle import Chain, ImpulseCorrelation, swing
    >>> balls = Chain([1] * 5, [0] * 5, 1)
    >>> run = swing(balls, ImpulseCorrelation(0), [-0.02, -0.02, 0, 0, 0], [0, 0.3])
    >>> abs(run.positions[-1] * 1000).round(1).tolist()  # two pulled back, two fly off
    [0.0, 0.0, 0.0, 19.7, 19.7]
    """
    n = len(must_be(Chain, "chain", chain))
    hanging = Pendulums() if pendulums is None else must_be(Pendulums, "pendulums", pendulums)
    collide(Chain(chain.masses, np.zeros(n), chain.restitution), model)  # do they fit?
    if isinstance(model, SpringChain) and np.any(model.gaps):
        raise ValueError(f"model.gaps = {model.gaps!r}; must be 0: those of a swing are Pendulums'")
    at = checked("times", times)
    if at.ndim != 1 or not at.size or at[0] < 0.0 or (np.diff(at) < 0.0).any():
        rule = "must be a row of rising numbers, none below 0, such as [0, 0.5, 1]"
        raise ValueError(f"times = {shown(times)}; {rule}")
    most = whole_number("max_impacts", max_impacts)
    x = checked("positions", positions)
    if x.shape != (n,):
        rule = f"{n} balls need ({n},): a place for each ball"
        raise ValueError(f"positions has shape {x.shape}; {rule}")
    run = _Run(chain, model, hanging, x)
    ended = run.to_the_end(at, most)
    x, v = (np.concatenate(parts) for parts in zip(*run.series, strict=True))
    at = at[: len(x)]
    certify(run, at, x, v)
    told = tuple(run.impacts), ended, run.t, tuple(np.flatnonzero(run.together).tolist())
    return Swing(chain, model, hanging, at, x, v, *told, run.lasting)


class _Run:
    """The event loop: settle what touches, fly to the next event."""

    def __init__(self, chain: Chain, model: Model, pendulums: Pendulums, x: Vector) -> None:
        n = len(chain)
        self.chain, self.hanging = chain, (hanging := Hanging(pendulums, chain.masses))
        hanging.within_reach(x)
        self.model = functools.cache(functools.partial(part, model, n))
        self.t, self.x, self.v = 0.0, x.copy(), chain.velocities.copy()
        self.released = float(hanging.energy(self.x, self.v))
        self.speed = float(np.sqrt(2.0 * self.released / chain.masses.sum()))
        self.impacts: list[Impact] = []
        self.series: list[tuple[Vector, Vector]] = []
        self.size = max(float(np.abs(x).max()), self.speed / float(hanging.frequency.min()))
        # Events, as the certificate asks for them: when; where the balls came to be, and were put;
        # their velocities as they came, struck, and at last; how long it takes until the next one.
        self.instants: list[tuple[float, Vector, Vector, Vector, Vector, Vector, float]] = []
        distance = hanging.gaps + np.diff(x)
        if (distance < -TIE * self.size).any():
            c = int(np.argmin(distance))
            told = f"balls {c} and {c + 1} overlap by {-distance[c]:g} m"
            raise ValueError(f"positions = {x.tolist()}; {told}")
        self.freed = np.full(n - 1, -math.inf)  # when the force in each contact last fell to zero
        self.lasting, self.parting = False, (False,) * (n - 1)
        if isinstance(model, SpringChain):
            m, power = chain.masses, 1.0 / (model.exponent + 1.0)
            energy = m[:-1] / (m[:-1] + m[1:]) * m[1:] * self.speed**2
            deepest = float(np.max(energy / model.stiffness)) ** power
            self.lasting = deepest * hanging.fastest < SHORT * self.speed
        self.settle([], [])

    def to_the_end(self, times: Vector, most: int) -> str:
        """Fly from event to event; return why the run ended."""
        done, end, hanging = 0, float(times[-1]), self.hanging
        idle, kind = 0, SmallAngleFlight if hanging.small else FullFlight
        while len(self.impacts) < most:
            flight = kind(hanging, self.x, self.v, self.together, self.parting)
            wait, closing, opening = flight.next_meeting(left := max(end - self.t, 0.0))
            far = (1.0 - INSTANT) * flight.turning(min(wait, left))
            hanging.within_reach(far, f"after t = {self.t:.4g} s ")
            later = self.t + wait
            here = int(times.searchsorted(later, side="left"))
            if here > done or later > end:
                self.series.append(flight.at(np.maximum(times[done:here] - self.t, 0.0)))
            done = here
            if later > end:
                self.t = end
                return "times"
            x, v = flight.at(np.array([wait]))
            known = len(self.impacts)
            self.t, self.x, self.v = later, x[0], v[0]
            self.settle(closing, opening)
            idle = idle + 1 if wait <= hanging.tie and len(self.impacts) == known else 0
            if idle > MOST_IDLE * len(self.x):
                why = f"contacts {closing} close and {opening} open there, and none has an impact"
                raise RuntimeError(f"the swing does not get beyond t = {self.t} s: {why}")
        # The instant at which the run ends is reported if it was asked for.
        count = int(np.searchsorted(times[done:], self.t, side="right"))
        self.series.append((np.tile(self.x, (count, 1)), np.tile(self.v, (count, 1))))
        return "impacts"

    def settle(self, closing: list[int], opening: list[int]) -> None:
        """Apply the rules of touching, resting, pressing and pulling apart to this instant."""
        hanging, x, v = self.hanging, self.x, self.v
        touching = self.gaps() == 0.0
        touching[closing] = True
        self.x, self.v = x.copy(), v.copy()
        groups = stretches(touching)
        for first, last in groups:  # to where they touch but for rounding; their centre stays
            offset = hanging.offsets(first, last)
            self.x[first:last] = mean(x[first:last] + offset, hanging.masses[first:last]) - offset
        duration, way, kicked, early = self.collide(groups, v)
        if duration:  # of contact forces: what strings pull is a kick before, the rest after
            most = max(duration, 2.0 * early)
            self.instants.append((self.t, x, x, v, v, v, most))
            self.instants.append((self.t, x, self.x, kicked, self.v, self.v, most))
            x = hanging.apart(self.x + way)  # but for what is left of a compression, far too little
            v = self.v = self.v + (duration - early) * hanging.accelerations(x, self.v)
            self.t, self.x = self.t + duration, x
            touching = (self.gaps() == 0.0) & (v[1:] - v[:-1] >= -RESTING * self.speed)
        struck = self.v
        parted = np.array(self.parting) & (struck[1:] > struck[:-1])  # these go on, if none closes
        self.freed[opening], parted[closing] = self.t, False  # what opens rests no more just now
        kept = touching & ~parted & (self.t - self.freed > hanging.tie)
        self.v, resting = common_velocities(hanging.masses, struck, kept, RESTING * self.speed)
        self.instants.append((self.t, x, self.x, v, struck, self.v, 0.0))
        if np.count_nonzero(resting):
            alone = hanging.accelerations(self.x, self.v)
            resting = pressed(hanging.masses, alone, resting)
        self.together = tuple(resting.tolist())
        self.parting = tuple((touching & ~resting).tolist())

    def gaps(self) -> Vector:
        """Return the gaps of the contacts, m; 0 where balls touch."""
        gaps = self.hanging.gaps + (self.x[1:] - self.x[:-1])
        return np.where(gaps > NEAR * self.size, gaps, 0.0)

    def collide(self, groups: Sequence[Any], before: Vector) -> tuple[float, Vector, Vector, float]:
        """Solve impacts of an instant as one; return how long, how far, from which v, the kick."""
        closing = before[:-1] - before[1:] > RESTING * self.speed
        duration, early, way = 0.0, 0.0, 0.0 * before
        struck = [(first, last) for first, last in groups if closing[first : last - 1].any()]
        if not struck:
            return duration, way, before, early
        if self.lasting:  # about half, as the kick itself may decide whether more balls meet
            (first, last), _, duration, _ = self.followed(*struck[0], before)
            early, self.lasting = 0.5 * duration, duration * self.hanging.fastest < LONGEST
        if self.lasting:
            before = before + early * self.hanging.accelerations(self.x, before)
            balls, trace, duration, way = self.followed(first, last, before)
            self.v = before.copy()
            struck, traces = [balls], [trace]
        else:
            duration, traces = 0.0, [self.solved(*balls, before) for balls in struck]
        for balls, trace in zip(struck, traces, strict=True):
            self.v[slice(*balls)] = trace.velocities
        contacts = tuple(c for first, last in struck for c in range(first, last - 1))
        loss = sum(trace.energy_loss for trace in traces)
        self.impacts.append(Impact(self.t, contacts, self.x, before, self.v, loss, tuple(traces)))
        return duration, way, before, early

    def followed(self, first: int, last: int, before: Vector) -> tuple[Any, Any, float, Vector]:
        """Follow contact forces, of these balls and all that they meet, until contacts are open."""
        while True:
            trace: Any = self.solved(first, last, before)
            duration, own = trace._until_apart()
            way = duration * before
            way[first:last] = own
            met = np.flatnonzero(self.gaps() + (way[1:] - way[:-1]) < 0.0).tolist()
            begin, end = min([first, *met]), max([last, *(c + 2 for c in met)])
            if (begin, end) == (first, last):
                return (first, last), trace, duration, way
            first, last = begin, end

    def solved(self, first: int, last: int, before: Vector) -> Trace:
        """Solve the impact of a part of the chain; contact forces with the gaps that it has now."""
        m, e = self.chain.masses[first:last], self.chain.restitution[first : last - 1]
        law: Any = self.model(first, last)
        more: dict[str, Any] = {"once": True} if self.lasting else {}
        if self.lasting:
            law = copy.copy(law)  # whose gaps need not be asked about
            vars(law)["gaps"] = tuple(self.gaps()[first : last - 1].tolist())
        try:
            # Not by `collide`, whose advice on a long path cannot be taken here.
            trace: Trace = law.solve(Chain._of(m, before[first:last].copy(), e), **more)
        except ValueError as refused:
            refused.add_note(f"at the impact at t = {self.t} s, balls {first} to {last - 1}")
            raise
        return trace


def part(model: Any, n: int, first: int, last: int) -> Model:
    """Return the model of a part of the chain: its rows, cut to that part."""
    changes: dict[str, Any] = {}
    if last - first < n and is_dataclass(model):
        for name in (field.name for field in fields(model)):
            value = getattr(model, name)
            if hasattr(value, "solve"):  # a law within a law
                changes[name] = part(value, n, first, last)
            elif name == "excess":  # a ratio's bound may count on the next ball (Eq. 53)
                changes["excess"] = "saturate"
            elif isinstance(value, tuple | list) and len(value) in (n - 1, n - 2):
                changes[name] = tuple(value[first : last - n + len(value)])  # contacts, inner balls
    return replace(model, **changes) if changes else model  # type: ignore[no-any-return]


#: Part of the momentum that an instant may make or lose, and of the energy beside its impacts: what
#: balls lose that come to rest against each other, or are moved to where they touch.
INSTANT = 1e-10
#: Part of the energy that a flight may make or lose while the fastest ball swings by a radian;
#: pendulums of any angle are integrated to a tenth of it, the others are known to rounding.
RADIAN = 1e-11


def certify(run: _Run, times: Vector, seen_x: Vector, seen_v: Vector) -> None:
    """Demand order, momentum and energy of flights and instants; impacts are certified already."""
    hanging, m = run.hanging, run.hanging.masses
    instants, came, placed, v, struck, left, lasts = map(np.array, zip(*run.instants, strict=True))
    push = INSTANT * ((np.abs(left) + np.abs(v)) @ m)
    before, kept = hanging.energy(placed, struck), hanging.energy(placed, left)
    work = INSTANT * np.maximum(before, kept) + INSTANT**2 * run.released
    # Flights: to where they end, and to where they are looked at.
    begun = np.r_[: len(instants) - 1, instants.searchsorted(times, side="right") - 1]
    until = np.concatenate([instants[1:], times])
    x = np.concatenate([came[1:], seen_x])
    gain = hanging.energy(x, np.concatenate([v[1:], seen_v])) - kept[begun]
    most = RADIAN * (1.0 + (until - instants[begun]) * hanging.fastest) * kept[begun]
    most += lasts[begun] * hanging.fastest * kept[begun]  # of a strike: strings are kicks
    least = -math.inf if hanging.damping.any() else -most
    overlap = (x[:, :-1] - x[:, 1:] - hanging.gaps).max(axis=-1)
    for what, at, value, low, high in (
        ("impacts have made or lost {:g} kg m/s", instants, (left - v) @ m, -push, push),
        ("{:g} J are made or lost beside the impacts", instants, kept - before, -work, work),
        ("balls overlap by {:g} m", until, overlap, -math.inf, TIE * run.size),
        ("a flight has made or lost {:g} J", until, gain, least, most),
    ):
        wrong = ~((low <= value) & (value <= high))  # also what is no number
        if wrong.any():
            k = np.flatnonzero(wrong)[np.argmin(at[wrong])]
            told = f"at t = {at[k]} s {what.format(value[k])}"
            raise RuntimeError(f"the swing is not certified: {told}")
