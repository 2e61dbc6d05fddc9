"""Contact forces: chains of springs in their own units, each followed as finely as is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from cradle.input.values import Vector, first, refusal
from cradle.kernel.kinks import Forces, Law
from cradle.kernel.state import ENERGY, FINISHED, LEDGER, MOMENTUM, ORDER, UNFINISHED
from cradle.runtime.springs import room, solve
from cradle.trace import Event

#: Least and largest error that can be asked for; steps of one run after which it is given up.
FINEST, COARSEST, MOST_STEPS = 1e-12, 0.02, 20_000_000
_FAINT = 0.01  # what is too little to matter, over the accuracy
# A step times the largest frequency from which on a run shows whether it was short enough; a
# coarser one that only measures the frequency; and what it may measure too little.
_ENOUGH, _COARSE, _SPARE = 0.2, 0.5, 1.05
# Kinks of a contact and radians of the quickest ball, on average, from which on runs are compared.
_OFTEN, _LONG = 2.4, 30.0
_TRIALS = 16  # runs of a chain, each finer than the one before
_DAMPED = 0.5  # step times A times the square of a frequency, at most
_SMALLEST = 1e-9  # lightest ball and softest contact, as a part of the largest
LONGEST = 0.3  # A, in contact times
_TINY = 1e-300  # the least depth, and one over the largest
# The widest gap and the narrowest, in depths; the widest whose last digit is below this accuracy.
_WIDEST, _NARROWEST, _BLURRED = 1e9, 1e-12, 1e13


def scaled(
    given: Sequence[Vector], p: float, accuracy: float, lead: tuple[int, ...] = (), begin: int = 0
) -> tuple[Forces, Vector, Vector, Vector]:
    """Return chains in their own units; and the mass, speed and length of these, (rows, 1).

    `given` are masses, velocities, stiffnesses, viscosities and gaps, a row for each or one for
    all: those from number `begin` on of chains with these leading axes.  The units are those of the
    contact that closes fastest, the speed is 1 if none closes; all the balls together are at rest.
    What is too small or large beside the rest of its chain to be resolved is refused.
    """
    rows, n = max(map(len, given)), given[0].shape[1]
    m, v = (np.broadcast_to(part, (rows, n)) for part in given[:2])
    k, lost, gap = (np.broadcast_to(part, (rows, n - 1)) for part in given[2:])
    u = v[:, :-1] - v[:, 1:]
    at = np.arange(rows)[:, None], u.argmax(axis=-1)[:, None]
    left, right = m[at], m[:, 1:][at]
    with np.errstate(all="ignore"):  # what is beyond floats is refused
        mass, speed = left / (left + right) * right, np.where(u[at] > 0.0, u[at], 1.0)
        energy = np.log(mass) + 2.0 * np.log(speed) - np.log(k[at])
        length = np.exp(energy / (p + 1.0))
        w, v, loss, d = mass / m, (v - v[at]) / speed, lost * (speed / length), -gap / length
        v -= (m * v).sum(axis=-1, keepdims=True) / m.sum(axis=-1, keepdims=True)
    most = min(_WIDEST, _BLURRED * accuracy)
    far = ~((mass > 0.0) & (length >= _TINY) & (length <= 1.0 / _TINY)) | np.isnan(d)
    of, late = "the depth of the fastest closing", "contact times, depth over speed of the fastest"
    light, soft = (part < _SMALLEST * part.max(axis=-1, keepdims=True) for part in (m, k))
    least = f"must be at least {_SMALLEST} of the"
    for name, values, wrong, rule in (
        ("masses", m, light, f"{least} heaviest ball of its chain"),
        ("stiffness", k, soft, f"{least} stiffest contact of its chain"),
        ("stiffness", k, far, "a contact's time is beyond floats: choose other units"),
        ("viscosity", lost, loss > LONGEST, f"must be at most {LONGEST} {late} closing"),
        ("gaps", gap, -d > most, f"must be at most {most:g} times {of} at this accuracy"),
        ("gaps", gap, (d != 0.0) & (abs(d) < _NARROWEST), f"must be 0, or {_NARROWEST} of {of}"),
        ("gaps", gap, d > 1.0, f"must be a lean of at most {of}"),
    ):
        if wrong.any():
            row, c = first(wrong)
            place = *map(int, np.unravel_index(begin + row, lead)), c
            raise refusal(name, place, f" = {float(values[row, c])!r}; {rule}")
    return Forces(w, v, k / k[at], loss, d, speed[:, 0]), mass, speed, length


class Solved(NamedTuple):
    """What chains come to, in their own units, and how."""

    v: Vector
    error: Vector  # estimate, relative to the fastest closing
    h: Vector  # the last step
    steps: Any  # of all runs
    defect: Any  # what an outcome breaks, 0 for nothing; or, below zero, why it was not reached


def law_of(chains: Forces, p: float, accuracy: float, most: int = MOST_STEPS) -> Law:
    """Return how chains are to be run."""
    lossy, leans = bool(chains.loss.any()), bool((chains.d > 0.0).any())
    if leans:  # balls that strings hold together after all swing for ever
        most = min(most, int(2e4 / accuracy**0.25))
    return Law(p, accuracy * _FAINT, most, lossy, leans)


def run(chains: Forces, law: Law, large: bool = False, stop: Any = None) -> Solved:
    """Run chains, each as finely as needed.

    The step bounds the error where a contact collides about once and loses nothing: measured on
    random chains, it was C (h omega)^4, at very small steps K (h omega)^3.5.  Balls that collide
    again and again amplify it, losses and leans add to it: then finer and finer runs tell.
    """
    (count, n), lossy, accuracy = chains.v.shape, law.lossy, law.slow / _FAINT
    c = 0.03 + 0.94 * max(0.0, 1.5 - law.p)
    eta = min((accuracy / c) ** 0.25, (4.0 * accuracy / c) ** (1.0 / 3.5), 0.6)
    eta = min(1.6 * eta, 0.6) if lossy else eta
    # Near by luck, two runs can agree: with losses it takes three.
    finer, doubt = (2.0**0.5, 6.0) if lossy else (2.0, 0.5)
    top = _highest(chains, law.p)
    damped = _DAMPED / np.maximum(chains.loss.max(axis=-1), 1e-300)
    h = np.minimum((eta if eta >= _ENOUGH else _COARSE) / np.sqrt(top), damped / top)
    out = Solved(chains.v.copy(), np.zeros(count), h, *np.zeros((2, count), np.int64))
    # Of the run before, if it was fine enough: its outcome counts, and its change from another.
    known, changes = np.zeros(count, bool), np.full(count, np.inf if lossy else 0.0)
    todo = np.flatnonzero((chains.v[:, :-1] > chains.v[:, 1:]).any(axis=-1))
    for _ in range(_TRIALS):
        if not todo.size:
            return out._replace(defect=_defects(chains, law, out))
        part = chains if todo.size == count else Forces(*(array[todo] for array in chains))
        moved, h = room(todo.size, n), out.h[todo]
        at, status = solve(part._replace(h=h), law, moved, large, stop)
        out.steps[todo] += moved.steps
        change = abs(moved.v - out.v[todo]).max(axis=-1)
        out.v[todo] = moved.v
        if status != FINISHED:
            todo = todo[at:]
            break
        phase = h * np.sqrt(moved.top)
        off = phase / eta
        fine = off <= 1.0
        many = (moved.kinks > _OFTEN * (n - 1)) | (moved.steps * phase > _LONG * (n - 1))
        compare = fine & (many | lossy | law.leans)
        told = np.where(known[todo], doubt * change / accuracy, np.inf)
        changed = np.maximum(told, 0.25 * changes[todo])
        error = np.maximum(off**4, np.where(compare, changed, 0.0))
        changes[todo] = np.where(known[todo] | lossy, told, 0.0)
        out.error[todo] = accuracy * error
        again = error > 1.0
        known[todo] = fine
        h = np.where(fine, h / finer, h / (off * _SPARE))
        todo, h, top = todo[again], h[again], moved.top[again]
        out.h[todo] = np.minimum(h, damped[todo] / top)
    out.defect[todo[0]] = -UNFINISHED
    return out


def _defects(chains: Forces, law: Law, out: Solved) -> Any:
    """Return what each outcome breaks, or 0: momentum, order, energy."""
    m, rounding = 1.0 / chains.w, 2.0**-52 * (64.0 + out.steps)
    change = out.v - chains.v
    size = (m * (abs(out.v) + abs(chains.v))).sum(axis=-1)
    gained = (m * change * 0.5 * (out.v + chains.v)).sum(axis=-1)
    slack = law.slow / _FAINT * size + rounding * (m * chains.v * chains.v).sum(axis=-1)
    defect = np.where(gained <= slack, 0, ENERGY)
    if not (law.lossy or law.leans):
        defect[~(gained >= -slack)] = LEDGER
    defect[~(abs((m * change).sum(axis=-1)) <= rounding * size)] = MOMENTUM
    defect[~(np.diff(out.v) >= -law.slow).all(axis=-1)] = ORDER
    return defect


def _highest(chains: Forces, p: float) -> Vector:
    """Return a bound of the square of a ball's frequency: two contacts store no more than all E.

    By Hoelder, k d^(p - 1) + k' d'^(p - 1) <= (k + k')^(2/(p + 1)) ((p + 1) E)^((p - 1)/(p + 1)).
    """
    energy = 0.5 * (chains.v * chains.v / chains.w).sum(axis=-1)
    if chains.d.any():
        energy += (chains.k * np.maximum(chains.d, 0.0) ** (p + 1.0)).sum(axis=-1) / (p + 1.0)
    both = np.pad(chains.k, [(0, 0), (0, 1)])
    both[:, 1:] += chains.k
    part = (both ** (2.0 / (p + 1.0)) * chains.w).max(axis=-1)
    most = p * part * ((p + 1.0) * energy) ** ((p - 1.0) / (p + 1.0))
    return np.where(most > 0.0, most, 1.0)


class Path:
    """The motion of one chain in its own units: at the nodes of a run, and what happens between.

    The run gives velocities between nodes.  By the sum of Euler and Maclaurin they are those at the
    node before, half a step and a twelfth of its square of the rates later.
    """

    def __init__(self, chain: Forces, law: Law, h: Vector) -> None:
        record: list[Any] = []
        solve(chain._replace(h=h), law, room(*chain.v.shape), record=record)
        pages, loss = np.concatenate(record), chain.loss[0]
        self.p, self.w, self.k, self.early = law.p, chain.w[0], chain.k[0], law.p * loss
        v, y, f = pages[:, 1], pages[:, 2, :-1], pages[:, 3, :-1]
        pull = self.pushes(chain.d[0])
        if not law.lossy:
            y = y - h**2 / 12.0 * np.diff(self.driven(f - pull))
        #: Times, compressions, and whether contacts are closed, at the start and at the nodes.
        self.t, self.y = np.append(0.0, pages[:, 0, 0]), np.vstack([chain.d, y])
        self.closed = np.vstack([chain.d > 0.0, f > 0.0])
        push = np.where(self.closed, self.pushes(self.y), 0.0)
        slope = self.p * push / np.where(push > 0.0, self.y, 1.0)
        held = push - pull
        v = np.vstack([chain.v, v - 0.5 * h * self.driven(held[1:])]) + self.driven(loss * held)
        rate = slope * (v[:, :-1] - v[:, 1:])
        v[1:] -= h**2 / 12.0 * self.driven(rate)[1:]
        #: Velocities, accelerations, forces.
        self.v, self.force = v, np.maximum(push + loss * rate, 0.0)
        self.a = self.driven(held + loss * rate)

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

    def events(self, last: Vector) -> tuple[Vector, tuple[Event, ...], Vector, Vector]:
        """Return times, events, velocities and forces, these and the times from the start on.

        At the end the velocities are `last`.  Collisions, durations and works are booked beside.
        """
        from scipy.interpolate import CubicHermiteSpline  # slow to import

        self.collisions = self.closed[0].astype(np.int64)
        self.durations, self.absorbed = np.zeros((2, len(self.k)))
        if len(self.t) == 1:
            return self.t, (), self.v, self.force
        closing = np.diff(self.closed.astype(int), axis=0)
        u, grow = -np.diff(self.v), -np.diff(self.a)
        touching = np.minimum.accumulate(self.y, axis=0) >= -1e-12
        turned = ((u[:-1] > 0.0) != (u[1:] > 0.0)) & (self.closed[:-1] | self.closed[1:])
        where = []
        for kind, wanted, x, rate in (
            ("maximum_compression", turned, u, grow),
            ("end", closing < 0, self.y + self.early * u, u + self.early * grow),
            ("close", closing > 0, self.y, u),
        ):
            pieces = CubicHermiteSpline(self.t, x, rate).c
            for j, c in np.argwhere(wanted).tolist():
                began = kind == "close" and touching[j, c]
                t = 0.0 if began else self.t[j] + _zero(pieces[:, j, c], self.t[j + 1] - self.t[j])
                where.append((t, kind, j, c))
        where.sort(key=lambda event: (event[0], event[1] != "maximum_compression"))
        found: list[Any] = [(0.0, None, self.v[0], self.force[0])]
        times = [t for t, *_ in where]
        depths = CubicHermiteSpline(self.t, self.y, u)(times)
        velocities = CubicHermiteSpline(self.t, self.v, self.a)(times)
        for (t, kind, j, c), y, v in zip(where, depths, velocities, strict=True):
            push = np.where(self.closed[j] | self.closed[j + 1], self.pushes(y), 0.0)
            if kind == "maximum_compression":
                shown = bool(u[j, c] > 0.0)  # between two maxima is a minimum
                self.absorbed[c] += (1 if shown else -1) * push[c] * y[c] / (self.p + 1.0)
            else:
                shown, push[c] = kind == "end" or t > 0.0, 0.0
                self.collisions[c] += kind == "close"
                self.durations[c] += t if kind == "end" else -t
            if shown:
                found.append((t, Event(kind, c), v, push))
        at, events, path, force = map(list, zip(*found, strict=True))
        path[-1] = last
        return np.array(at), tuple(events[1:]), np.array(path), np.array(force)


def _zero(cubic: Vector, h: float) -> float:
    """Return where a cubic is zero between 0 and h; at the end that is nearer to it, if nowhere."""
    from scipy.optimize import brentq

    a, b, c, d = cubic.tolist()
    end = ((a * h + b) * h + c) * h + d
    if d * end >= 0.0:
        return h if abs(end) < abs(d) else 0.0
    return float(brentq(lambda s: ((a * s + b) * s + c) * s + d, 0.0, h, xtol=1e-300, rtol=1e-15))
