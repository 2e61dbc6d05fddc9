"""Pendulums between impacts: motion in closed form or by SciPy, and when balls next meet."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cradle.input.values import Vector
from cradle.swinging.pendulums import Pendulums

#: Events nearer than this part of a swing (over 2 pi) are one; so are lengths, of the amplitude.
TIE = 1e-9
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

    masses: Vector
    positions: Vector
    velocities: Vector
    #: Contacts whose balls touch and move together.
    together: NDArray[np.bool_]
    #: Contacts whose balls touch and part.
    parting: NDArray[np.bool_]

    def bodies(self) -> list[tuple[int, int]]:
        """Return the first ball of each body and the one after its last."""
        cuts = [0, *(np.flatnonzero(~self.together) + 1).tolist(), len(self.masses)]
        return list(pairwise(cuts))


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
            value = sum((c * _exp_minus_one(rate * time)).real for c, rate in terms)
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
        step = _safe_step(max(value, noise), slope, second)
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


def _safe_step(value: float, slope: float, bound: float) -> float:
    """Return how far the parabola ``value + slope h - bound h^2 / 2`` stays above zero."""
    root = math.sqrt(slope * slope + 2.0 * bound * value)
    return (root + slope) / bound if slope > 0.0 else 2.0 * value / (root - slope)


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


def _exp_minus_one(z: complex) -> complex:
    """Return exp(z) - 1 without cancellation."""
    return complex(np.expm1(z))


class SmallAngleFlight:
    """Damped harmonic motion of bodies of one or more balls.

    A ball swings alone as x'' = -w^2 x - 2 d x'.  Balls that rest against each other are one body:
    its frequency, damping and lowest point are means over its balls, weighted by mass.
    """

    def __init__(self, pendulums: Pendulums, state: Start) -> None:
        n = len(state.masses)
        self.state = state
        self.gaps = pendulums.row("gaps", n - 1)
        self.square = pendulums.gravity / pendulums.row("length", n)
        self.damping = pendulums.row("damping", n)
        self.slowest = float(pendulums.natural_frequency(n).max())
        # Ball k is at centre[k] + Re(amplitude[k] exp(rate[k] t)).
        self.centre = np.zeros(n)
        self.amplitude = np.zeros(n, dtype=complex)
        self.rate = np.zeros(n, dtype=complex)
        for first, last in state.bodies():
            self._hang(slice(first, last))

    def _hang(self, body: slice) -> None:
        m, square, damping = self.state.masses[body], self.square[body], self.damping[body]
        offset = -np.concatenate([[0.0], np.cumsum(self.gaps[body.start : body.stop - 1])])

        def mean(values: Vector) -> float:
            # Equal values stay what they are, to the bit.
            return float(values[0] if (values == values[0]).all() else m @ values / m.sum())

        w2, d = mean(square), mean(damping)
        lowest = -mean(square * offset) / w2
        rate = complex(-d, math.sqrt(w2 - d * d))
        start = self.state.positions[body.start] - lowest
        speed = float(self.state.velocities[body.start])
        self.centre[body] = lowest + offset
        self.amplitude[body] = complex(start, -(speed + d * start) / rate.imag)
        self.rate[body] = rate

    def next_meeting(self, horizon: float) -> Meeting:
        """Return the first event within `horizon` seconds."""
        times = np.full((2, len(self.gaps)), np.inf)
        for c, together in enumerate(self.state.together.tolist()):
            if together:
                times[1, c] = self._release(c, horizon)
            else:
                times[0, c] = self._meeting(c, horizon)
        first = float(times.min())
        if first > horizon:
            return Meeting(math.inf, [], [])
        due = times <= first + TIE / self.slowest
        return Meeting(
            first, np.flatnonzero(due[0]).tolist(), np.flatnonzero(times[1] == first).tolist()
        )

    def _meeting(self, c: int, horizon: float) -> float:
        """Return when the gap of contact c closes."""
        a, rate = self.amplitude[c : c + 2].tolist(), self.rate[c : c + 2].tolist()
        level = float(self.gaps[c] + self.centre[c + 1] - self.centre[c])
        terms = (
            [(a[1] - a[0], rate[0])] if rate[0] == rate[1] else [(a[1], rate[1]), (-a[0], rate[0])]
        )
        return first_fall(level, terms, bool(self.state.parting[c]), horizon)

    def _release(self, c: int, horizon: float) -> float:
        """Return when the force in contact c, whose balls move together, falls to zero."""
        first = next(a for a, b in self.state.bodies() if b > c)
        part = slice(first, c + 1)
        m, w2, d = self.state.masses[part], self.square[part], self.damping[part]
        rate, amplitude = complex(self.rate[c]), complex(self.amplitude[c])
        # The force stops the balls up to c from moving as they would alone.
        level = -float(m @ (w2 * self.centre[part]))
        wave = -amplitude * complex(m @ (w2 + 2.0 * d * rate + rate * rate))
        weight = float(m @ w2) * (abs(amplitude) + float(np.abs(self.centre[part]).max()))
        if abs(wave) + abs(level) <= _ROUNDING * weight:
            return math.inf  # they swing together by themselves
        return first_fall(level, [(wave, rate)], False, horizon)

    def at(self, times: Vector) -> tuple[Vector, Vector]:
        """Return positions and velocities at T times since the start, shapes (T, N)."""
        wave = self.amplitude * np.exp(np.multiply.outer(times, self.rate))
        return self.centre + wave.real + 0.0, (self.rate * wave).real + 0.0  # no -0.0


class FullFlight:
    """Equal pendulums of any angle, integrated by SciPy; bodies swing like single balls.

    The difference f of two neighbours obeys f'' + 2 d f' + q f = 0 with q at most g/l, so by
    Sturm's comparison two balls that part cannot meet before pi / sqrt(g/l - d^2), half a swing of
    the small angle.  For all others this bounds f'' by f and f', and the search marches as in
    `first_fall`.
    """

    def __init__(self, pendulums: Pendulums, state: Start) -> None:
        n = len(state.masses)
        self.state, self.pendulums = state, pendulums
        self.length = float(pendulums.row("length", n)[0])
        self.damping = float(pendulums.row("damping", n)[0])
        self.frequency = float(pendulums.natural_frequency(n)[0])
        bodies = state.bodies()
        self.first = np.array([a for a, _ in bodies])
        self.body = np.repeat(np.arange(len(bodies)), [b - a for a, b in bodies])
        self.start = np.concatenate([state.positions[self.first], state.velocities[self.first]])

    def _rate(self, _: float, y: Vector) -> Vector:
        x, v = np.split(y, 2)
        return np.concatenate(
            [v, -self.pendulums.gravity * np.sin(x / self.length) - 2.0 * self.damping * v]
        )

    def _integrate(self, begin: float, y: Vector, end: float, dense: bool) -> Any:
        # SciPy is slow to import, and only pendulums of any angle need it here.
        from scipy.integrate import solve_ivp

        scale = max(float(np.abs(self.start).max()), 1e-300)
        found = solve_ivp(
            self._rate, (begin, end), y, "DOP853", rtol=_RTOL, atol=_RTOL * scale,
            dense_output=dense,
        )  # fmt: skip
        if found.status < 0:
            raise RuntimeError(f"the integration of the pendulums failed: {found.message}")
        return found

    def next_meeting(self, horizon: float) -> Meeting:
        """Return the first event within `horizon` seconds."""
        half = math.pi / math.sqrt(self.frequency**2 - self.damping**2)
        open_ = np.flatnonzero(~self.state.together)
        blocked = np.where(self.state.parting[open_], half * (1.0 - TIE), 0.0)
        begin, y = 0.0, self.start
        while begin < horizon:
            end = min(begin + half / 4.0, horizon)
            found = self._integrate(begin, y, end, dense=True)
            times = [
                self._search(k, float(max(begin, blocked[k])), end, found.sol)
                for k in range(len(open_))
            ]
            first = min(times, default=math.inf)
            if first <= end:
                due = np.array(times) <= first + TIE / self.frequency
                return Meeting(first, open_[due].tolist(), [])
            begin, y = end, found.y[:, -1]
        return Meeting(math.inf, [], [])

    def _search(self, k: int, time: float, end: float, path: Any) -> float:
        """March to the closing of the k-th gap; infinite if it stays open up to `end`."""
        bodies = len(self.first)
        size = max(
            float(np.abs(self.start[:bodies]).max()),
            float(np.abs(self.start[bodies:]).max()) / self.frequency,
        )
        if size == 0.0:
            return math.inf
        # The length of (w f, f') grows by less than exp(rate h) in a time h, and rate times that
        # length bounds f''.  With five times the bound of now a step stays within ln 5 / rate.
        rate = self.frequency + 2.0 * self.damping
        for _ in range(_MOST_STEPS):
            if time > end:
                return math.inf
            y = path(time) / size
            value, slope = float(y[k + 1] - y[k]), float(y[bodies + k + 1] - y[bodies + k])
            if value <= _RTOL and slope < 0.0:
                return time
            value = max(value, _RTOL)
            bound = 5.0 * rate * math.hypot(self.frequency * value, slope)
            time += _safe_step(value, slope, bound)
        raise RuntimeError(f"no end of the search for a meeting after {_MOST_STEPS} steps")

    def at(self, times: Vector) -> tuple[Vector, Vector]:
        """Return positions and velocities at T times since the start, shapes (T, N)."""
        found, begin, y = [], 0.0, self.start
        for time in times.tolist():
            if time > begin:
                begin, y = time, self._integrate(begin, y, time, dense=False).y[:, -1]
            found.append(y)
        x, v = np.split(np.array(found).reshape(len(times), len(self.start)), 2, axis=1)
        return x[:, self.body], v[:, self.body]


Flight = SmallAngleFlight | FullFlight
