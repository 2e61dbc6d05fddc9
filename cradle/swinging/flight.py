"""Pendulums between impacts: motion in closed form or by SciPy, and when balls next meet."""

import cmath
import functools
import math
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from cradle.input.values import Vector
from cradle.swinging.pendulums import TIE, Hanging, mean

#: Of each contact, whether its balls touch and move together, or touch and part.
Marks = tuple[bool, ...]
#: The next event of a flight: when it is, s since the flight began, infinite if never; the contacts
#: whose balls meet; and those whose balls were pressed together and are drawn apart from now on.
Meeting = tuple[float, list[int], list[int]]
#: A term Re(C exp(rate t)) of a sum: C and its rate.
Wave = tuple[complex, complex]
#: What falls to zero when the balls of a contact meet, or are drawn apart that move together (a
#: gap, a force): a constant, and what is to be added for either ball's amplitude.
Fall = tuple[float, complex, complex]
_ROUNDING = 1e-11  # below this part of what it is made of a force is a rounding error
_RTOL = 1e-12
# Nodes of polynomials in [-1, 1], and what makes terms of values there; of degree 14, as the next
# term of a swing in a radian is below 1e-17.
_NODES: Vector = chebyshev.chebpts1(15)
_TERMS: Vector = np.asarray(np.linalg.inv(chebyshev.chebvander(_NODES, 14)))


def first_fall(level: float, waves: list[Wave], parting: bool, horizon: float) -> float:
    """Return when ``level + sum Re(C exp(rate t))`` falls to zero; parting, it starts there."""
    moving = [wave for wave in waves if wave[0]]
    if len(moving) != 1:
        return _search(level, moving, parting, horizon) if moving else math.inf
    c, rate = moving[0]
    if parting:
        c = complex(-level, -abs(c.imag))
    if level == 0.0 or rate.real == 0.0:
        if abs(level) >= abs(c):
            return math.inf if level > 0.0 else 0.0
        # Below zero, it meets now, and rounding says that it has just met.
        return max(math.acos(-level / abs(c)) - cmath.phase(c), 0.0) / rate.imag

    def value(time: float) -> float:
        return level + (c * cmath.exp(rate * time)).real

    # With decay the turning points have a closed form, and the first minimum is the lowest.
    low = (-0.5 * math.pi - cmath.phase(c * rate)) % (2.0 * math.pi) / rate.imag
    high = max(low - math.pi / rate.imag, 0.0)
    if value(low) >= -4e-16 * (abs(level) + abs(c)):
        return math.inf
    if value(high) <= 0.0:
        return 0.0
    from scipy.optimize import brentq  # slow to import

    return float(brentq(value, high, low, xtol=1e-16, rtol=1e-15))


def _search(level: float, waves: list[Wave], parting: bool, horizon: float) -> float:
    """Return the same by all roots of polynomials that follow a radian to the last digit."""
    c, rate = np.array(waves).T
    size, radian = np.abs(c), 1.0 / float(np.abs(rate).max())
    if (left := float(size.sum())) > level > 0.0 > (decay := float(rate.real.max())):
        horizon = min(horizon, math.log(level / left) / decay)  # from then on it stays above zero

    def value(time: Vector) -> Vector:
        return np.asarray(level + (np.exp(np.multiply.outer(time, rate)) @ c).real)

    def rise(time: Vector) -> Vector:  # from a start at zero, over the time: without that root
        return np.asarray((np.expm1(np.multiply.outer(time, rate)) @ c).real * radian / time)

    # How far it may lie below its values at nodes: beyond the last one; less between two of them.
    dip = 0.5 * float(1.0 + _NODES[0]) * float(size @ np.abs(rate)) * radian
    for k in range(math.ceil(horizon / radian)):
        begin, told_by = k * radian, rise if parting and k == 0 else value
        values = told_by(begin + 0.5 * radian * (1.0 + _NODES))
        if values.min() > dip:
            continue
        terms = _TERMS @ values
        roots = chebyshev.chebroots(chebyshev.chebtrim(terms, 1e-15 * np.abs(terms).max()))
        real = np.sort(roots.real[(roots.imag == 0.0) & (np.abs(roots.real) < 1.0)])
        marks = begin + 0.5 * radian * (1.0 + np.array([-1.0, *real, 1.0]))
        below = told_by(0.5 * (marks[1:] + marks[:-1])) < -4e-16 * (abs(level) + left)
        if below.any():
            # A contact that is to part and does not closes a moment later.
            return float(marks[below.argmax()]) or TIE * radian * parting
    return math.inf


@functools.lru_cache(64)
def _bodies(hanging: Hanging, together: Marks) -> tuple[list[int], Vector, Vector, list[Fall]]:
    """Return the first ball of each ball's body, where it hangs, its rate; what falls to zero."""
    # A ball is at centre + Re(amplitude exp(rate t)); of a body both are means over the mass.
    n, square = len(hanging.masses), hanging.gravity / hanging.length
    centre, rates = np.zeros(n), np.zeros(n, dtype=complex)
    first, forces = list[int](), {}
    for a, b in pairwise([0, *(c + 1 for c, one in enumerate(together) if not one), n]):
        m, w2, d = (row[a:b] for row in (hanging.masses, square, hanging.damping))
        offset, pull, damping = -hanging.offsets(a, b), mean(w2, m), mean(d, m)
        lowest = -mean(w2 * offset, m) / pull
        rate = complex(-damping, math.sqrt(pull - damping * damping))
        centre[a:b], rates[a:b] = lowest + offset, rate
        first += [a] * (b - a)
        for k in range(1, b - a):  # what stops the balls before k from moving as they would alone
            level, weight = -float(m[:k] @ (w2 * (lowest + offset))[:k]), float(m[:k] @ w2[:k])
            wave = -complex(m[:k] @ (w2 + 2.0 * d * rate + rate * rate)[:k])
            far = float(np.abs(centre[a : a + k]).max())
            alike = abs(wave) <= _ROUNDING * weight and abs(level) <= _ROUNDING * weight * far
            # Balls that swing together by themselves need no force.
            forces[a + k - 1] = (math.inf, 0j, 0j) if alike else (level, wave, 0j)
    gaps = (hanging.gaps + centre[1:] - centre[:-1]).tolist()
    falls = [forces.get(c, (gap, -1.0 + 0j, 1.0 + 0j)) for c, gap in enumerate(gaps)]
    return first, centre, rates, falls


class SmallAngleFlight:
    """Damped harmonic motion of bodies of one or more balls: x'' = -w^2 x - 2 d x'."""

    def __init__(
        self, hanging: Hanging, x: Vector, v: Vector, together: Marks, parting: Marks
    ) -> None:
        self.together, self.parting, self.tie = together, parting, hanging.tie
        first, self.centre, self.rate, self.falls = _bodies(hanging, together)
        start = (x - self.centre)[first]
        self.amplitude = start - 1j * ((v[first] - self.rate.real * start) / self.rate.imag)

    def next_meeting(self, horizon: float) -> Meeting:
        """Return the first event within `horizon` seconds."""
        times, first, rates = list[float](), math.inf, self.rate.tolist()
        swings = zip(pairwise(self.amplitude.tolist()), pairwise(rates), strict=True)
        falls = zip(self.falls, swings, self.parting, strict=True)
        for (level, one, other), ((a, b), (rate, near)), parts in falls:
            waves = [(one * a + other * b, rate)]
            if rate != near:
                waves = [(other * b, near), (one * a, rate)]
            # None need be sought after the first of those found.
            times.append(first_fall(level, waves, parts, min(horizon, first + self.tie)))
            first = min(first, times[-1])
        if first > horizon:
            return math.inf, [], []
        met = [c for c, time in enumerate(times) if time <= first + self.tie]
        closing = [c for c in met if not self.together[c]]
        return first, closing, [c for c in met if self.together[c] and times[c] == first]

    def turning(self, duration: float) -> Vector:
        """Return where each ball first turns, or is after that time, shape (N,)."""
        rate, wave = self.rate, self.amplitude
        wait = (0.5 * np.pi - np.angle(rate * wave)) % np.pi / rate.imag
        return np.asarray(self.centre + (wave * np.exp(rate * np.minimum(wait, duration))).real)

    def at(self, times: Vector) -> tuple[Vector, Vector]:
        """Return positions and velocities at T times since the start, shapes (T, N)."""
        wave = self.amplitude * np.exp(np.multiply.outer(times, self.rate))
        return self.centre + wave.real + 0.0, (self.rate * wave).real + 0.0  # no -0.0


class FullFlight:
    """Equal pendulums of any angle, integrated by SciPy; bodies swing like single balls."""

    def __init__(
        self, hanging: Hanging, x: Vector, v: Vector, together: Marks, parting: Marks
    ) -> None:
        self.gravity, self.tie = hanging.gravity, hanging.tie
        self.length, self.damping = float(hanging.length[0]), float(hanging.damping[0])
        # The difference f of two neighbours obeys f'' + 2 d f' + q f = 0 with q at most g/l, so by
        # Sturm's comparison its zeros are no closer than half a swing of the small angle: no step
        # misses one, and balls that part do not meet before.  In steps of a thirty-second part of
        # that SciPy's interpolation is as exact as its steps.
        self.half = math.pi / math.sqrt(hanging.fastest**2 - self.damping**2)
        #: The number of each ball's body, the first ball of each, and until when none meets it.
        self.body = np.cumsum([0, *(not one for one in together)])
        self.first = np.unique(self.body, return_index=True)[1]
        self.waits = self.half * (1.0 - TIE) * np.array(parting)[self.first[1:] - 1]
        self.gaps = hanging.gaps[self.first[1:] - 1]
        self.start = np.concatenate([x[self.first], v[self.first]])

    def _rate(self, _: float, y: Vector) -> Vector:
        n, rate = len(self.first), np.empty_like(y)  # lean: this is most of what a swing costs
        rate[:n] = y[n:]
        rate[n:] = -self.gravity * np.sin(y[:n] / self.length) - 2.0 * self.damping * y[n:]
        return rate

    def _apart(self, t: float, y: Vector) -> Vector:
        """Return how far bodies are from their neighbours; infinity where they part for long."""
        return np.where(t > self.waits, self.gaps + np.diff(y[: len(y) // 2]), np.inf)

    def _integrate(self, end: float, **options: Any) -> Any:
        from scipy.integrate import solve_ivp  # slow to import, and only needed here

        least = _RTOL * max(float(np.abs(self.start).max()), 1e-300)
        known = {"method": "DOP853", "rtol": _RTOL, "atol": least, "max_step": self.half / 32.0}
        found = solve_ivp(self._rate, (0.0, end), self.start, dense_output=True, **known, **options)
        if found.status < 0:
            raise RuntimeError(f"the integration of the pendulums failed: {found.message}")
        self.path, self.steps = found.sol, found
        return found

    def next_meeting(self, horizon: float) -> Meeting:
        """Return the first event within `horizon` seconds."""

        def nearest(t: float, y: Vector) -> float:
            return float(self._apart(t, y).min(initial=1.0))

        n = len(self.first)
        vars(nearest).update(terminal=True, direction=-1)
        turns = [lambda _, y, c=n + c: y[c + 1] - y[c] for c in np.flatnonzero(self.gaps)]
        found = self._integrate(horizon, events=[nearest, *turns])
        # A gap may close and open again within a step: where the balls turn they overlap then.
        turned = map(zip, found.t_events[1:], found.y_events[1:])
        if missed := [t for one in turned for t, y in one if nearest(t, y) < 0.0]:
            found = self._integrate(min(missed), events=nearest)
        elif found.status == 0:
            return math.inf, [], []
        time, y = float(found.t[-1]), found.y[:, -1]
        gaps = self._apart(time, y)
        met = (gaps + self.tie * np.diff(y[n:]) <= 0.0) | (gaps == gaps.min())
        return time, (self.first[1:][met] - 1).tolist(), []

    def turning(self, _: float) -> Vector:
        """Return where the balls are when one is farthest aside; steps miss that by .1 %."""
        x = self.steps.y[: len(self.first)]
        return np.asarray(x[self.body, np.abs(x).max(axis=0).argmax()])

    def at(self, times: Vector) -> tuple[Vector, Vector]:
        """Return positions and velocities at T times up to the meeting, shapes (T, N)."""
        x, v = np.split(self.path(times).T, 2, axis=1)
        return x[:, self.body], v[:, self.body]
