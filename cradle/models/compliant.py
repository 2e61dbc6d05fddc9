"""Chains of springs: the contact forces, and the one model here that has a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cradle.chain import Chain
from cradle.input.values import (
    Vector,
    must_be,
    number_or_row,
    refuse_where,
    row_of,
    whole_number,
)
from cradle.kernel.kinks import Forces, Law
from cradle.models import springs
from cradle.models.energy import CurvedTrace, fastest
from cradle.runtime.springs import room, solve
from cradle.trace import Event


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class TimedTrace(CurvedTrace):
    """The path of an impact that has a time; N balls, K events, S steps of the integration.

    Its events are joined by smooth curves, not by the straight lines of a rigid model.  The outcome
    has the accuracy asked for; what happens on the way is less exact near a closing or an opening.

    Attributes
    ----------
    times : ndarray, shape (K + 1,)
        Time of each row of the path, s; the first is 0.
    forces : ndarray, shape (K + 1, N - 1)
        Contact forces at each row of the path, N; the largest of a contact is at a maximum
        compression.
    durations : ndarray, shape (N - 1,)
        Time that each contact was closed, over all its collisions, s.
    step_times : ndarray, shape (S,)
        Times of the steps, s.
    step_forces : ndarray, shape (S, N - 1)
        Contact forces there, N: curves of the force over the time.
    step_velocities : ndarray, shape (S, N)
        Velocities there, m/s.
    step_impulses : ndarray, shape (S, N - 1)
        Impulses so far, there, N s.
    evaluations : int
        How many steps were taken, in all runs.
    error : float
        Estimated error of a velocity, relative to the fastest closing.

    References
    ----------
    Ceanga and Hurmuzlu, J. Appl. Mech. 68 (2001) 575-583, section 2.2.

    Examples
    --------
    The duration of a contact of two balls on a linear spring is pi sqrt(mu / k):

    >>> from cradle import Chain, collide
    >>> trace = collide(Chain([2, 2], [1, 0], 1), SpringChain(1.0, exponent=1))
    >>> trace.durations.round(6)
    array([3.141593])
    """

    times: Vector
    forces: Vector
    durations: Vector
    step_times: Vector
    step_forces: Vector
    error: float

    @property
    def energy_loss(self) -> float:
        """Kinetic energy that the viscosity of the contacts has taken, in joules."""
        if not np.any(self.model.viscosity):
            return 0.0
        m, v = self.chain.masses, self.chain.velocities
        centre = self.chain.momentum / m.sum()
        lost = m * (v - self.velocities) * (0.5 * (v - centre) + 0.5 * (self.velocities - centre))
        return float(lost.sum())

    def _clock(self) -> dict[str, Vector]:
        """Return the times of the rows of the path."""
        return {"time": self.times}


@dataclass(frozen=True)
class SpringChain:
    """Balls on massless springs: contacts push with k (delta^p + A d(delta^p)/dt), never pull.

    delta is the compression of the contact, p = 1 a linear spring, p = 3/2 the contact of two
    spheres (Hertz); A is the time of their losses, 0 for elastic ones.  Contacts that do not open
    start at delta = 0.  So do those that open: in the limit of rigid balls every gap is nothing
    beside the balls, but it counts beside the compressions, and it must close before the contact
    pushes.  Without losses and gaps the outcome depends on the ratios of masses, stiffnesses and
    closing speeds alone.

    The motion is followed in time by velocity Verlet with two corrections, which make the outcome
    exact to the fourth power of the step, with losses to about the third
    (`cradle.kernel.forces`).  `absorbed` is the energy stored at each maximum of a compression,
    less that at a minimum between two of them.

    Speeds below a hundredth of the accuracy, times that of the fastest closing, are too little to
    matter.  So are collisions at such speeds: long chains leave balls behind that hardly move, and
    how often those touch depends on the accuracy.

    Parameters
    ----------
    stiffness : float or sequence, length N - 1
        k of each contact, N/m^p; above 0.  If left out, 1 for all: velocities depend on the ratios
        of stiffnesses alone, but times and forces are then no one's.
    exponent : float
        p, from 1 to 10.
    viscosity : float or sequence, length N - 1
        A of each contact, s.
    gaps : float or sequence, length N - 1
        Distance of two balls before the impact, m; below zero a lean, as for `spring_velocities`.
    accuracy : float
        Largest error of a velocity after the impact, relative to the fastest closing.
    max_steps : int
        Steps of one run after which the impact is given up.

    Raises
    ------
    ValueError
        If a value is outside its range; on solving, if a restitution is below 1, or a value is too
        small or large beside the others to be resolved.
    ImpactNotFinished
        On solving, if `max_steps` is reached, or finer and finer runs do not agree.

    References
    ----------
    Hinch and Saint-Jean, Proc. R. Soc. A 455 (1999) 3201-3220; Ceanga and Hurmuzlu, J. Appl. Mech.
    68 (2001) 575-583, Eqs. 7-11; Brilliantov, Spahn, Hertzsch and Poeschel, Phys. Rev. E 53 (1996)
    5382-5392.

    Examples
    --------
    >>> from cradle import Chain, collide
    >>> collide(Chain([1, 1, 1], [1, 0, 0]), SpringChain()).velocities.round(6)
    array([-0.070952,  0.076403,  0.994549])
    """

    stiffness: float | Sequence[float] = 1.0
    exponent: float = 1.5
    viscosity: float | Sequence[float] = field(default=0.0, kw_only=True)
    gaps: float | Sequence[float] = field(default=0.0, kw_only=True)
    accuracy: float = field(default=1e-9, kw_only=True)
    max_steps: int = field(default=springs.MOST_STEPS, kw_only=True)

    def __post_init__(self) -> None:
        p, accuracy = springs.exponent_and_accuracy(self.exponent, self.accuracy)
        object.__setattr__(self, "exponent", p)
        object.__setattr__(self, "accuracy", accuracy)
        for name, rule, low in (
            ("stiffness", "must be above 0", 0.0),
            ("viscosity", "must be at least 0", 0.0),
            ("gaps", "must be finite", -np.inf),
        ):
            row = getattr(self, name), "N - 1", rule, low, np.inf, name == "stiffness"
            object.__setattr__(self, name, number_or_row(name, *row))
        whole_number("max_steps", self.max_steps)

    def solve(self, chain: Chain) -> TimedTrace:
        """Solve the impact of `chain`; see `collide`."""
        n = len(must_be(Chain, "chain", chain))
        rule = "must be 1 for SpringChain, whose losses are its viscosity"
        refuse_where("restitution", chain.restitution, chain.restitution < 1.0, rule)
        fastest(chain)  # is within the range of floats
        k, loss, gap = (
            row_of(name, getattr(self, name), n - 1, n)
            for name in ("stiffness", "viscosity", "gaps")
        )
        rows = chain.masses, chain.velocities, k, loss, gap
        springs.admit(springs.Problem(*rows, self.exponent, self.accuracy))
        m, v, k, loss, gap = (row[None] for row in rows)
        problem = springs.Problem(m, v, k, loss, gap, self.exponent, self.accuracy)
        own = forces, *units = problem.own(timed=True)
        springs.refuse_beyond(problem, own)
        mass, speed, length = (float(unit[0, 0]) for unit in units)
        law = springs.law_of(forces, self.exponent, self.accuracy, self.max_steps)
        found = springs.run(forces, law)
        if found.defect[0]:
            reached = chain.velocities + speed * (found.v[0] - forces.v[0])
            springs.refuse(problem, int(found.defect[0]), reached, self)
        path = _Path(forces, law, found.h)
        times, kinds, contacts, v, force = path.events(found.v[0])
        joule = mass * speed * speed
        newton, second = joule / length, length / speed
        return TimedTrace(
            chain=chain,
            model=self,
            velocities=chain.velocities + speed * (v[-1] - v[0]),
            impulses=mass * speed * path.impulses(v[-1]),
            absorbed=joule * path.absorbed,
            collisions=path.collisions,
            path=chain.velocities + speed * (v - v[0]),
            path_impulses=mass * speed * path.impulses(v),
            events=tuple(map(Event, kinds, contacts)),
            step_velocities=chain.velocities + speed * (path.v - v[0]),
            step_impulses=mass * speed * path.impulses(path.v),
            evaluations=int(found.steps[0]),
            times=second * times,
            forces=newton * force,
            durations=second * path.durations,
            step_times=second * path.t,
            step_forces=newton * path.force,
            error=float(found.error[0]),
        )


class _Path:
    """The motion of one chain in its own units: at the nodes of a run, and what happens between.

    The run gives velocities between nodes.  By the sum of Euler and Maclaurin they are those at the
    node before, half a step and a twelfth of its square of the rates later.
    """

    def __init__(self, chain: Forces, law: Law, h: Vector) -> None:
        record: list[Any] = []
        solve(chain._replace(h=h), law, room(*chain.v.shape), record=record)
        pages, n = np.concatenate(record), chain.v.shape[1]
        t, low, high = (pages[:, 0, k, None] for k in range(3))
        v, (d, y, f, seen) = pages[:, 1, :n], (pages[:, k, : n - 1] for k in range(2, 6))
        self.p, self.w, self.k, self.loss = law.p, chain.w[0], chain.k[0], chain.loss[0]
        inside = ((low <= np.arange(len(self.k))) & (np.arange(len(self.k)) < high)) | law.leans
        pull = self.pushes(chain.d[0])
        if not law.lossy:
            y = d - h**2 / 12.0 * np.diff(self.driven(np.where(inside, f - pull, 0.0)))
        y = np.where(inside, y, d + (t - seen) * (v[:, :-1] - v[:, 1:]))
        #: Times, compressions, and whether contacts are closed, at the start and at the nodes.
        self.t, self.y = np.append(0.0, t), np.vstack([chain.d, y])
        self.closed = np.vstack([chain.d > 0.0, inside & (f > 0.0)])
        e = np.where(self.closed, self.pushes(self.y), 0.0) - pull
        slope = self.p * np.where(
            self.closed, self.k * np.maximum(self.y, 0.0) ** (self.p - 1.0), 0.0
        )
        v = np.vstack([chain.v, v - 0.5 * h * self.driven(e[1:])]) + self.driven(self.loss * e)
        rate = slope * (v[:, :-1] - v[:, 1:])
        v[1:] -= h**2 / 12.0 * self.driven(rate)[1:]
        #: Velocities, accelerations, forces.
        self.v, self.force = v, np.maximum(e + pull + self.loss * rate, 0.0)
        self.a = self.driven(e + self.loss * rate)
        self.collisions = np.zeros(len(self.k), np.int64)
        self.durations, self.absorbed = np.zeros((2, len(self.k)))

    def pushes(self, y: Vector) -> Vector:
        """Return what closed contacts push with at rest."""
        push: Vector = self.k * np.maximum(y, 0.0) ** self.p
        return push

    def driven(self, push: Vector) -> Vector:
        """Return what pushes of the contacts do to the balls."""
        driven: Vector = -np.diff(np.pad(push, [(0, 0), (1, 1)])) * self.w
        return driven

    def impulses(self, v: Vector) -> Vector:
        """Return the impulses of the contacts, from velocities; none of one that never closed."""
        passed = np.cumsum((self.v[0] - v) / self.w, axis=-1)[..., :-1]
        return np.where(self.collisions > 0, passed, 0.0)

    def between(self, j: int, s: float, x: Vector, rate: Vector) -> Any:
        """Return x at the part s of the step after node j."""
        return _cubic(s, self.t[j + 1] - self.t[j], x[j], x[j + 1], rate[j], rate[j + 1])

    def zero(self, j: int, x: Vector, rate: Vector) -> float:
        """Return the part of the step after node j at which x, of one contact, is zero."""
        low, high, (before, after) = 0.0, 1.0, x[j : j + 2].tolist()
        step, rates = float(self.t[j + 1] - self.t[j]), rate[j : j + 2].tolist()
        while low < (s := 0.5 * (low + high)) < high:
            falls = _cubic(s, step, before, after, *rates) < 0.0
            low, high = (s, high) if falls == (after > before) else (low, s)
        return s

    def events(self, last: Vector) -> tuple[Vector, list[str], list[int], Vector, Vector]:
        """Return times, kinds and contacts, and velocities and forces, these from the start on.

        At the end the velocities are `last`.  Collisions, durations and works are booked beside.
        """
        closing = np.diff(self.closed.astype(int), axis=0)
        if len(closing):
            closing[-1][self.closed[-1]] = -1  # what is left is too little to matter
        u, grow = -np.diff(self.v), -np.diff(self.a)
        early, touching = self.p * self.loss, np.minimum.accumulate(self.y, axis=0) >= -1e-12
        turned = ((u[:-1] > 0.0) != (u[1:] > 0.0)) & (self.closed[:-1] | self.closed[1:])
        found: list[Any] = []
        for kind, where, x, rate in (
            ("maximum_compression", turned, u, grow),
            ("end", closing < 0, self.y + early * u, u + early * grow),
            ("close", closing > 0, self.y, u),
        ):
            for j, c in zip(*(at.tolist() for at in np.nonzero(where)), strict=True):
                began = kind == "close" and bool(touching[j, c])
                s = 0.0 if began else self.zero(j, x[:, c], rate[:, c])
                t = 0.0 if began else self.t[j] + s * (self.t[j + 1] - self.t[j])
                y = self.between(j, s, self.y, u)
                push = np.where(self.closed[j] | self.closed[j + 1], self.pushes(y), 0.0)
                self.collisions[c] += kind == "close"
                if kind == "maximum_compression":
                    stored = push[c] * y[c] / (self.p + 1.0)
                    self.absorbed[c] += stored if u[j, c] > 0.0 else -stored
                    if u[j, c] <= 0.0:
                        continue
                else:
                    push[c] = 0.0
                    self.durations[c] += t if kind == "end" else -t
                if not began:
                    found.append((t, kind, c, self.between(j, s, self.v, self.a), push))
        self.collisions += self.closed[0]
        found.sort(key=lambda event: (event[0], event[1] != "maximum_compression"))
        if found:
            found[-1] = (*found[-1][:3], last, found[-1][4])
        times, kinds, contacts, v, force = zip(
            (0.0, "", -1, self.v[0], self.force[0]), *found, strict=True
        )
        return np.array(times), [*kinds[1:]], [*contacts[1:]], np.array(v), np.array(force)


def _cubic(s: float, h: float, x: Any, y: Any, rate: Any, end: Any) -> Any:
    """Return what goes from x to y in a step h, with these rates there, at the part s of it."""
    rise = y - x
    return x + s * (rise + (1.0 - s) * ((1.0 - s) * (rate * h - rise) - s * (end * h - rise)))
