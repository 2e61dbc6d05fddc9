"""Contact forces: why a chain of springs is refused, and what happens on its way."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cradle.input.values import Vector, refusal
from cradle.kernel import accuracy as limits
from cradle.kernel.forces import PULLS
from cradle.kernel.kinks import Law, Motions, Springs
from cradle.models.energy import BEYOND, EnergyTrace
from cradle.runtime.job import follow
from cradle.trace import Event

#: Least and largest error that can be asked for; steps of one run after which it is given up.
FINEST, COARSEST, MOST_STEPS = 1e-12, 0.02, 20_000_000


def refused(clock: Any, law: Law, place: Sequence[int], chain: Springs) -> ValueError:
    """Return the error that says why the kernel refuses a chain, one of a batch at this place."""
    unit, part = f"(m u^2 / k)^(1 / {law.p + 1:g})", limits.LONGEST
    of = f"{clock['length']:.3g} m, that is {unit} of the fastest closing"
    late = f"must be at most {part * clock['length'] / clock['speed']:.3g} s, {part:g} {unit} / u"
    if law.hunt:
        part = limits.MOST_HUNT
        late = f"must be at most {part / clock['speed']:.3g} s/m, {part:g} over the speed"
    widest = min(limits.WIDEST, limits.BLURRED * law.accuracy)
    least = f"must be at least {limits.SMALLEST} of the"
    at = int(clock["place"])
    after = min(at + 1, chain.m.shape[1] - 1)
    beyond = BEYOND.format([*place, after], float(chain.m[0, after]))
    name, values, words = {
        limits.LIGHT: ("masses", chain.m, f"{least} heaviest ball of its chain"),
        limits.SOFT: ("stiffness", chain.k, f"{least} stiffest contact of its chain"),
        limits.QUICK: ("stiffness", chain.k, "its time is beyond floats: choose other units"),
        limits.REDUCED: ("masses", chain.m, beyond),
        limits.LATE: ("viscosity", chain.loss, f"{late} of the fastest closing; was it found for "
                      "this stiffness, speed and damping?"),
        PULLS: ("viscosity", chain.loss, "must be lower: this contact would pull"),
        limits.WIDE: ("gaps", chain.gap, f"must at this accuracy be at most {widest:g} times {of}"),
        limits.NARROW: ("gaps", chain.gap, f"must be 0, or {limits.NARROWEST} of {of}"),
        limits.DEEP: ("gaps", chain.gap, f"must be a lean of at most {of}"),
    }[int(clock["rule"])]  # fmt: skip
    return refusal(name, (*place, at), f" = {float(values[0, at])!r}; {words}")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class TimedTrace(EnergyTrace):
    """The trace of an impact that takes time: forces and curves; N balls, K events, S steps.

    The outcome has the accuracy asked for; its path is less exact near a closing or an opening.

    Attributes
    ----------
    times, forces : ndarray, shapes (K + 1,) and (K + 1, N - 1)
        Time of each row of the path, s, from 0 on; and contact forces there, N.  The largest force
        is ``step_forces.max(axis=0)``: with losses it comes before the largest compression.
    durations : ndarray, shape (N - 1,)
        Time that each contact was closed, over all its collisions, s.
    step_times, step_forces, step_velocities, step_impulses : ndarray, (S,) and (S, N - 1 or N)
        The curves, at the steps of the solver: time, s; forces, N; velocities, m/s; impulses, N s.
    evaluations, error : int and float
        Steps of all runs; estimated error of a velocity, over the fastest closing speed.

    Examples
    --------
    >>> from cradle import Chain, SpringChain, collide
    >>> collide(Chain([2, 2], [1, 0]), SpringChain(1.0, exponent=1)).durations.round(6)  # pi
    array([3.141593])
    """

    times: Vector
    forces: Vector
    durations: Vector
    step_times: Vector
    step_forces: Vector
    error: float

    def __getattr__(self, name: str) -> Any:
        """Follow the way, when something of it is asked for the first time."""
        if name not in self.__dataclass_fields__ or "_ran" not in vars(self):
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        vars(self).update(vars(self._way(*vars(self)["_ran"])))  # at once: threads may read it
        return vars(self)[name]

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.__dataclass_fields__})

    def _way(self, row: Springs, law: Law, out: Motions) -> "TimedTrace":
        """Return this trace with all that belongs to it."""
        path, start = Path(row, law, out), self.chain.velocities
        mass, speed, length = path.mass, path.speed, path.length
        times, events, v, force = path.events()
        joule, second = mass * speed * speed, length / speed
        return TimedTrace(
            self.chain, self.model, self.velocities, mass * speed * path.impulses(v[-1]),
            joule * path.absorbed, path.collisions, start + speed * (v - v[0]),
            mass * speed * path.impulses(v), events, times=second * times,
            forces=joule / length * force, durations=second * path.durations,
            step_times=second * path.t, step_forces=joule / length * path.force,
            step_velocities=start + speed * (path.v - v[0]), error=self.error,
            step_impulses=mass * speed * path.impulses(path.v), evaluations=self.evaluations,
        )  # fmt: skip

    def _until_apart(self) -> tuple[float, Vector]:
        """Return how long it takes until no balls overlap, s, and how far each goes, m."""
        record: list[Any] = []
        row, law, out = vars(self)["_ran"]
        clock = follow(row, law, out, record=record)[2]
        begun, ended = record[0][0], record[-1][-1]
        time, y, u = ended[0, 0], ended[2, :-1], ended[1, :-1] - ended[1, 1:]  # u: closing
        late = np.divide(y, -u, out=np.zeros_like(u), where=(y > 0.0) & (y < -u * time)).max()
        length, time = clock["length"], time + late
        way = np.append(0.0, length * np.cumsum(begun[2, :-1] - y - late * u))
        m, seconds = self.chain.masses, float(length / clock["speed"] * time)
        return seconds, way + (seconds * self.chain.momentum - m @ way) / m.sum()

    @property
    def energy_loss(self) -> float:
        """Kinetic energy lost, J, to viscosities and, where balls lean, to the pull of strings."""
        if not np.any(self.model.viscosity) and np.min(self.model.gaps) >= 0.0:
            return 0.0
        m, v = self.chain.masses, self.chain.velocities
        centre = self.chain.momentum / m.sum()
        lost = m * (v - self.velocities) * (0.5 * (v - centre) + 0.5 * (self.velocities - centre))
        return float(lost.sum())


class Path:
    """The motion of one chain in its own units: at the nodes of a run, and what happens between.

    The run gives velocities between nodes.  By the sum of Euler and Maclaurin they are those at the
    node before, half a step and a twelfth of its square of the rates later.
    """

    def __init__(self, chain: Springs, law: Law, out: Motions) -> None:
        record: list[Any] = []
        clock = follow(chain, law, out, record=record)[2]
        pages = np.concatenate(record)
        self.mass, self.speed, self.length = (float(clock[x]) for x in ("mass", "speed", "length"))
        h, loss = clock["h"], chain.loss[0] * self.speed / (1.0 if law.hunt else self.length)
        self.p, self.w, self.early = law.p, self.mass / chain.m[0], (not law.hunt) * law.p * loss
        self.k = chain.k[0] / clock["stiffness"]
        self.last, pages = pages[-1, 1], pages[:-1]  # velocities after the impact
        v, y, f = pages[:, 1], pages[:, 2, :-1], pages[:, 3, :-1]
        #: Times, compressions, and whether contacts are closed, at the start and at the nodes.
        self.t, self.y, self.closed = pages[:, 0, 0], y, f > 0.0
        pull = self.pushes(y[0])
        if not clock["lossy"]:
            self.y[1:] -= h**2 / 12.0 * np.diff(self.driven(f - pull))[1:]
        push = np.where(self.closed, self.pushes(self.y), 0.0)
        slope = self.p * push / np.where(push > 0.0, self.y, 1.0)
        held = push - pull
        spent, grip = loss * held, loss * slope
        if law.hunt:
            spent, grip = loss / (self.p + 1.0) * (push * self.y - pull * y[0]), loss * push
        v[1:] -= 0.5 * h * self.driven(held[1:])
        v = v + self.driven(spent)
        u = v[:, :-1] - v[:, 1:]
        rate, damping = slope * u, grip * u
        v[1:] -= h**2 / 12.0 * self.driven(rate)[1:]
        v[-1] = self.last  # also where pulls ended within the last step
        self.v, self.force = v, np.maximum(push + damping, 0.0)
        self.a = self.driven(held + damping)

    def pushes(self, y: Vector) -> Any:
        """Return what closed contacts push with at rest."""
        return self.k * np.maximum(y, 0.0) ** self.p

    def driven(self, push: Vector) -> Any:
        """Return what pushes of the contacts do to the balls."""
        return -np.diff(np.pad(push, [(0, 0), (1, 1)])) * self.w

    def impulses(self, v: Vector) -> Vector:
        """Return the impulses of the contacts, from velocities; none of one that never closed."""
        passed = np.cumsum((self.v[0] - v) / self.w, axis=-1)[..., :-1]
        return np.where(self.collisions > 0, passed, 0.0)

    def events(self) -> tuple[Vector, tuple[Event, ...], Vector, Vector]:
        """Book collisions, durations, works; return times, events, velocities and forces there."""
        from scipy.interpolate import CubicHermiteSpline as Cubic  # slow to import

        self.collisions = self.closed[0].astype(np.int64)
        self.durations, self.absorbed = np.zeros((2, len(self.k)))
        u, grow = -np.diff(self.v), -np.diff(self.a)
        least = self.pushes(self.y[0]) * self.y[0] * (u[0] > 0.0) / (self.p + 1.0)
        closing = np.diff(self.closed.astype(int), axis=0)
        again, late, later = self.y[:-1] > 0.0, self.y + self.early * u, u + self.early * grow
        touching = np.minimum.accumulate(np.where(self.closed, -1.0, self.y), axis=0) >= -1e-12
        turned = ((u[:-1] > 0.0) != (u[1:] > 0.0)) & (self.closed[:-1] | self.closed[1:])
        where = []
        for kind, wanted, x, rate in (
            ("maximum_compression", turned, u, grow),
            ("end", closing < 0, late, later),
            ("close", (closing > 0) & again, late, later),  # losses had opened it
            ("close", (closing > 0) & ~again, self.y, u),
        ):
            for j, c in np.argwhere(wanted).tolist():
                two, began = slice(j, j + 2), kind == "close" and touching[j, c]
                piece = Cubic(self.t[two], x[two, c], rate[two, c]).c[:, 0]
                t = 0.0 if began else self.t[j] + _zero(piece, self.t[j + 1] - self.t[j])
                where.append((t, kind, j, c))
        where.sort(key=lambda event: (event[0], event[1] != "maximum_compression"))
        found: list[Any] = [(0.0, None, self.v[0], self.force[0])]
        for t, kind, j, c in where:
            two = slice(j, j + 2)
            y = Cubic(self.t[two], self.y[two], u[two])(t)
            v = Cubic(self.t[two], self.v[two], self.a[two])(t)
            push = np.where(self.closed[j] | self.closed[j + 1], self.pushes(y), 0.0)
            if kind == "maximum_compression":
                shown = bool(u[j, c] > 0.0)  # between two maxima is a minimum
                stored = push[c] * y[c] / (self.p + 1.0)
                self.absorbed[c] += (stored - least[c]) * shown
                least[c] = 0.0 if shown else stored  # where it begins to be compressed
            else:
                shown, push[c] = kind == "end" or t > 0.0, 0.0
                if self.p == 1.0 and not self.early.any():  # a kink that no cubic has
                    mean = 0.5 * (self.a[j] + self.driven((push - self.pushes(self.y[0]))[None])[0])
                    v = self.v[j] + (t - self.t[j]) * mean
                self.collisions[c] += kind == "close"
                self.durations[c] += t if kind == "end" else -t
            if shown:
                found.append((t, Event(kind, c), v, push))
        at, events, path, force = map(list, zip(*found, strict=True))
        path[-1] = self.last
        return np.array(at), tuple(events[1:]), np.array(path), np.array(force)


def _zero(cubic: Vector, h: float) -> float:
    """Return where a cubic is zero between 0 and h; at the end that is nearer to it, if nowhere."""
    from scipy.optimize import brentq

    start, end = cubic[3], np.polyval(cubic, h)
    if start * end >= 0.0:
        return h if abs(end) < abs(start) else 0.0
    return float(brentq(lambda s: np.polyval(cubic, s), 0.0, h, xtol=1e-300, rtol=1e-15))
