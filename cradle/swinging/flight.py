"""Pendulums between impacts: motion in closed form or by SciPy, and when balls next meet."""

from __future__ import annotations

import cmath
import functools
import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from cradle.input.values import Vector
from cradle.swinging.pendulums import TIE, Hanging, mean

# Below this part of its largest value a derivative is a rounding error.
_ROUNDING = 1e-11
_RTOL = 1e-12
_MOST_STEPS = 1_000_000


class Meeting(NamedTuple):
    """The next event of a flight."""

    #: Time since the flight began, s; infinite if nothing happens.
    time: float
    #: Contacts whose balls meet.
    closing: list[int]
    #: Contacts whose balls were pressed together and are drawn apart from now on.
    releasing: list[int]


class Start(NamedTuple):
    """All that a flight needs to know of its start."""

    positions: Vector
    velocities: Vector
    #: Of each contact, whether its balls touch and move together.
    together: tuple[bool, ...]
    #: Of each contact, whether its balls touch and part.
    parting: list[bool]


def _first_balls(together: Sequence[bool]) -> list[int]:
    """Return the first ball of each body: balls that move together are one."""
    return [0, *(c + 1 for c, one in enumerate(together) if not one)]


def first_fall(
    level: float, terms: Sequence[tuple[complex, complex]], parting: bool, horizon: float
) -> float:
    """Return when ``level + sum Re(C exp(rate t))`` first falls to zero.

    One term without decay, or about the level zero, has a root in closed form.  Otherwise the
    search marches from below: with a bound K on the second derivative from now on, the parabola
    ``f + f' h - K h^2 / 2`` lies below the function, so a step to its root passes no root of the
    function.  Near a crossing this is Newton's method.
    """
    terms = [(c, rate) for c, rate in terms if c != 0.0]
    if not terms:
        return math.inf
    if len(terms) == 1 and (level == 0.0 or terms[0][1].real == 0.0):
        c, rate = terms[0]
        if parting:
            c = complex(-level, -abs(c.imag))
        if level >= abs(c):
            return math.inf
        angle = math.acos(max(-level / abs(c), -1.0))
        wait = angle - cmath.phase(c)
        if not parting:
            wait %= 2.0 * math.pi
            # It meets now, and rounding says that it has just met.
            if wait > 2.0 * math.pi - TIE:
                wait = 0.0
        return wait / rate.imag
    return _march(level, terms, parting, horizon)


def _march(
    level: float, terms: Sequence[tuple[complex, complex]], parting: bool, horizon: float
) -> float:
    size = sum(abs(c) for c, _ in terms)
    decay = min(-rate.real for _, rate in terms)
    bounds = _Bounds(terms)
    time = min(_first_step(terms, bounds), bounds.radian) if parting else 0.0
    for _ in range(_MOST_STEPS):
        left = math.exp(-decay * time)
        if time > horizon or size * left < level:
            return math.inf
        waves = [(c, rate, cmath.exp(rate * time)) for c, rate in terms]
        if parting:  # f(0) = 0: the difference from the start keeps its digits
            value = sum((c * complex(np.expm1(rate * time))).real for c, rate in terms)
            noise = 4e-16 * bounds.plain[0] * time
        else:
            value = level + sum((c * wave).real for c, _, wave in waves)
            noise = 4e-16 * (abs(level) + size)
        slope, *higher = (
            sum((c * rate**n * wave).real for c, rate, wave in waves) for n in (1, 2, 3)
        )
        if value <= noise and (slope < 0.0 or value < -noise):
            return time
        second, *others = (left * bound for bound in bounds.after(time))
        value = max(value, noise)
        root = math.sqrt(slope * slope + 2.0 * second * value)
        step = (root + slope) / second if slope > 0.0 else 2.0 * value / (root - slope)
        # Where it rises more and more, the next terms of Taylor's series carry further.
        for order, (derivative, bound) in enumerate(zip(higher, others, strict=True), start=2):
            if min(slope, derivative) < 0.0:
                break
            step = max(step, (order + 1) * derivative / bound)
        # Next to the root a step can be too small for the last digit of the time.
        time = max(time + min(step, bounds.radian), math.nextafter(time, math.inf))
    raise RuntimeError(f"no end of the search for a meeting after {_MOST_STEPS} steps")


class _Bounds:
    """Bounds on the derivatives of ``sum Re(C exp(rate t))``, without their decay.

    Two bodies that swing nearly alike have nearly opposite C and nearly equal rates.  What is left
    of them is ``(C + C') exp(rate t) + C' (exp(rate' t) - exp(rate t))``, and the last bracket is
    at most ``abs(rate' - rate) t``.
    """

    def __init__(self, terms: Sequence[tuple[complex, complex]]) -> None:
        #: Of derivatives 1 to 4 at any time; `now` and `growth` are of derivatives 2 to 4.
        self.plain = [sum(abs(c) * abs(rate) ** n for c, rate in terms) for n in range(1, 5)]
        self.now, self.growth = self.plain[1:], [0.0] * 3
        #: What a step may not exceed.
        self.radian = 1.0 / abs(terms[0][1])
        if len(terms) == 2:
            orders, ((one, rate), (other, near)) = range(2, 5), terms
            self.now = [
                abs(one + other) * abs(rate) ** n + abs(other) * abs(near**n - rate**n)
                for n in orders
            ]
            self.growth = [abs(other) * abs(rate) ** n * abs(near - rate) for n in orders]

    def after(self, time: float) -> list[float]:
        """Return bounds on derivatives 2 to 4 from `time` on, for a radian."""
        until = time + self.radian
        return [
            min(plain, now + growth * until)
            for plain, now, growth in zip(self.plain[1:], self.now, self.growth, strict=True)
        ]


def _first_step(terms: Sequence[tuple[complex, complex]], bounds: _Bounds) -> float:
    """Return a step that passes no root, for a function that rises from exactly zero.

    If its first derivative that is not zero is the n-th, d, and the next one is at most K, the
    function stays above d h^n / n! - K h^(n+1) / (n+1)!, so up to h = (n + 1) d / K.
    """
    for order, bound in enumerate(bounds.after(0.0), start=1):
        derivative = sum((c * rate**order).real for c, rate in terms)
        if derivative > _ROUNDING * bounds.plain[order - 1]:
            return (order + 1) * derivative / bound
    return TIE / max(abs(rate) for _, rate in terms)


class _Bodies(NamedTuple):
    """How balls swing at small angles that move together or alone."""

    #: First ball of each body, the number of its balls, its lowest point and its rate.
    each: list[tuple[int, int, float, complex]]
    #: Of each ball, where it hangs, and its rate: it is at centre + Re(amplitude exp(rate t)).
    centre: Vector
    rate: Vector
    #: Of each contact between two bodies the gap at rest; of one inside a body the force at rest,
    #: that per amplitude, and what both are measured by.
    gaps: list[float]
    forces: dict[int, tuple[float, complex, float, float]]


@functools.lru_cache(64)
def _bodies(hanging: Hanging, together: tuple[bool, ...]) -> _Bodies:
    """Return the bodies: their frequencies, dampings and lowest points are means over the mass."""
    n, square, first = len(hanging.masses), hanging.gravity / hanging.length, _first_balls(together)
    centre, rates = np.zeros(n), np.zeros(n, dtype=complex)
    each, forces = [], {}
    for a, b in pairwise([*first, n]):
        m, w2, d = (row[a:b] for row in (hanging.masses, square, hanging.damping))
        offset, pull, damping = -hanging.offsets(a, b), mean(w2, m), mean(d, m)
        lowest = -mean(w2 * offset, m) / pull
        rate = complex(-damping, math.sqrt(pull - damping * damping))
        centre[a:b], rates[a:b] = lowest + offset, rate
        each.append((a, b - a, lowest, rate))
        for k in range(1, b - a):  # what stops the balls before k from moving as they would alone
            level, weight = -float(m[:k] @ (w2 * (lowest + offset))[:k]), float(m[:k] @ w2[:k])
            wave = complex(m[:k] @ (w2 + 2.0 * d * rate + rate * rate)[:k])
            forces[a + k - 1] = level, wave, weight, float(np.abs(centre[a : a + k]).max())
    gaps = (hanging.gaps + centre[1:] - centre[:-1]).tolist()
    return _Bodies(each, centre, rates, gaps, forces)


class SmallAngleFlight:
    """Damped harmonic motion of bodies of one or more balls.

    A ball swings alone as x'' = -w^2 x - 2 d x'.  Balls that rest against each other are one body.
    """

    def __init__(self, hanging: Hanging, state: Start) -> None:
        self.state, self.tie = state, hanging.tie
        self.bodies = _bodies(hanging, state.together)
        x, v = state.positions.tolist(), state.velocities.tolist()
        #: Of each ball.
        self.amplitude: list[complex] = []
        for first, count, lowest, rate in self.bodies.each:
            start = x[first] - lowest
            swings = complex(start, -(v[first] - rate.real * start) / rate.imag)
            self.amplitude += [swings] * count

    def next_meeting(self, horizon: float) -> Meeting:
        """Return the first event within `horizon` seconds."""
        together, rates = self.state.together, self.bodies.rate.tolist()
        times = [
            (self._release if one else self._meeting)(c, rates, horizon)
            for c, one in enumerate(together)
        ]
        first = min(times)
        if first > horizon:
            return Meeting(math.inf, [], [])
        return Meeting(
            first,
            [c for c, t in enumerate(times) if t <= first + self.tie and not together[c]],
            [c for c, t in enumerate(times) if t == first and together[c]],
        )

    def _meeting(self, c: int, rates: list[complex], horizon: float) -> float:
        """Return when the gap of contact c closes."""
        (one, other), (rate, near) = self.amplitude[c : c + 2], rates[c : c + 2]
        terms = [(other - one, rate)] if rate == near else [(other, near), (-one, rate)]
        return first_fall(self.bodies.gaps[c], terms, self.state.parting[c], horizon)

    def _release(self, c: int, rates: list[complex], horizon: float) -> float:
        """Return when the force in contact c, whose balls move together, falls to zero."""
        level, wave, weight, far = self.bodies.forces[c]
        wave = -self.amplitude[c] * wave
        if abs(wave) + abs(level) <= _ROUNDING * (weight * (abs(self.amplitude[c]) + far)):
            return math.inf  # they swing together by themselves
        return first_fall(level, [(wave, rates[c])], False, horizon)

    def at(self, times: Vector) -> tuple[Vector, Vector]:
        """Return positions and velocities at T times since the start, shapes (T, N)."""
        wave = np.array(self.amplitude) * np.exp(np.multiply.outer(times, self.bodies.rate))
        return self.bodies.centre + wave.real + 0.0, (self.bodies.rate * wave).real + 0.0  # no -0.0


class FullFlight:
    """Equal pendulums of any angle, integrated by SciPy; bodies swing like single balls.

    The difference f of two neighbours obeys f'' + 2 d f' + q f = 0 with q at most g/l, so by
    Sturm's comparison its zeros are no closer than pi / sqrt(g/l - d^2), half a swing of the small
    angle: steps of a quarter of that miss none, and balls that part do not meet before.
    """

    def __init__(self, hanging: Hanging, state: Start) -> None:
        self.state, self.hanging, self.gravity = state, hanging, hanging.gravity
        self.length, self.damping = float(hanging.length[0]), float(hanging.damping[0])
        self.first = _first_balls(state.together)
        #: The number of each ball's body.
        self.body = np.cumsum([0, *(not one for one in state.together)])
        self.start = np.concatenate([state.positions[self.first], state.velocities[self.first]])

    def _rate(self, _: float, y: Vector) -> Vector:
        x, v = np.split(y, 2)
        return np.concatenate([v, -self.gravity * np.sin(x / self.length) - 2.0 * self.damping * v])

    def _integrate(self, begin: float, y: Vector, end: float, **options: Any) -> Any:
        # SciPy is slow to import, and only pendulums of any angle need it here.
        from scipy.integrate import solve_ivp

        scale = max(float(np.abs(self.start).max()), 1e-300)
        tolerances = {"rtol": _RTOL, "atol": _RTOL * scale}
        found = solve_ivp(self._rate, (begin, end), y, "DOP853", **tolerances, **options)
        if found.status < 0:
            raise RuntimeError(f"the integration of the pendulums failed: {found.message}")
        return found

    def next_meeting(self, horizon: float) -> Meeting:
        """Return the first event within `horizon` seconds."""
        half = math.pi / math.sqrt(self.hanging.fastest**2 - self.damping**2)
        contacts = [ball - 1 for ball in self.first[1:]]
        waits = [half * (1.0 - TIE) * self.state.parting[c] for c in contacts]

        def gap(k: int) -> Any:
            def event(t: float, y: Vector) -> float:
                # At the start a gap is open, or its balls are about to meet.
                return float(y[k + 1] - y[k]) if t > waits[k] else 1.0

            vars(event).update(terminal=True, direction=-1)
            return event

        events = [gap(k) for k in range(len(contacts))]
        found = self._integrate(0.0, self.start, horizon, events=events, max_step=half / 4.0)
        if found.status == 0:
            return Meeting(math.inf, [], [])
        time, (x, v) = float(found.t[-1]), np.split(found.y[:, -1], 2)
        soon = (np.diff(x) + self.hanging.tie * np.diff(v) <= 0.0) & (time > np.array(waits))
        met = [len(times) > 0 for times in found.t_events]
        return Meeting(time, [c for c, now in zip(contacts, met | soon, strict=True) if now], [])

    def at(self, times: Vector) -> tuple[Vector, Vector]:
        """Return positions and velocities at T times since the start, shapes (T, N)."""
        found, begin, y = [], 0.0, self.start
        for time in times.tolist():
            if time > begin:
                begin, y = time, self._integrate(begin, y, time).y[:, -1]
            found.append(y)
        x, v = np.split(np.array(found).reshape(len(times), len(self.start)), 2, axis=1)
        return x[:, self.body], v[:, self.body]
