"""The truth at any number of digits: `cradle.textbook` with rule R9 by a plain threshold.

Contacts whose closing speed and store have both become negligible, and that alone keep making
events, end plastically.  It knows no cycles: every impact of a sequence is made, down to a
threshold that leaves thirty of fifty digits.
"""

import decimal
from functools import partial
from itertools import groupby

import mpmath
import numpy as np

from cradle import textbook
from cradle.textbook import EventLimit

__all__ = ["EventLimit", "Impact", "as_meant", "in_fifty_digits", "meaning", "solve"]


def meaning(x):
    """The number that a float means: of 15 digits at most, from 1e-7 to 1e15, what it prints as.

    Every other float means its exact value, and a decimal means itself.
    """
    if isinstance(x, decimal.Decimal):
        return x
    exact, printed = decimal.Decimal(x), decimal.Decimal(repr(float(x)))
    digits = printed.normalize(decimal.Context(prec=17)).as_tuple().digits
    short = len(digits) <= 15 and decimal.Decimal("1e-7") <= abs(printed) < decimal.Decimal("1e15")
    return printed if short else exact


def as_meant(x):
    """Return what a number means, in the digits in force."""
    return mpmath.mpf(x) if isinstance(x, str | mpmath.mpf) else mpmath.mpf(str(meaning(x)))


class Impact(textbook.Impact):
    """R1 to R9, with counts of what tests look for."""

    def __init__(self, *given):
        super().__init__(*given)
        self.reduced = [a * b / (a + b) for a, b in zip(self.m, self.m[1:])]
        self.tiny = (self.collapse_below() * max([*self.u, self.zero])) ** 2
        # Largest squared speed of a contact since its last event; its events in a row with this
        # below `tiny`; the contacts of the latest events, as long as all of these were calm.
        self.peak = [u * u for u in self.u]
        self.calm, self.streak = [0] * len(self.u), []
        self.collapsed, self.meetings, self.recompressions = False, 0, 0

    def collapse_below(self):
        """Threshold of R9, relative to the largest initial closing speed: by the type of a number.

        It is six tenths of the digits in force.
        """
        if isinstance(self.zero, float):
            return 1e-12
        decimals = isinstance(self.zero, decimal.Decimal)
        digits = decimal.getcontext().prec if decimals else mpmath.mp.dps
        return (self.zero + 1) / 10 ** int(0.6 * digits)

    def speed_squared(self, c):
        """Larger of closing speed and speed equivalent of the store, squared."""
        store = self.e[c] * self.e[c] * self.gained[c] - self.given[c]
        return max(self.u[c] * self.u[c], 2 * store / self.reduced[c])

    def record(self, kind, c):
        super().record(kind, c)
        if kind in ("end", "close"):
            self.calm[c] = self.calm[c] + 1 if self.peak[c] < self.tiny else 0
            self.peak[c] = self.speed_squared(c)
            self.streak = [*self.streak, c] if self.calm[c] > 4 else []

    def close(self, c):
        super().close(c)
        self.meetings += self.direction[c] != 0 and self.direction[c + 1] != 0

    def move(self, run, s):
        before = list(self.gained)
        super().move(run, s)
        for c in run.slope:
            self.peak[c] = max(self.peak[c], self.speed_squared(c))
            self.recompressions += self.given[c] > 0 and self.gained[c] > before[c]

    def progress(self, runs):
        if len(self.streak) < 8 * max(len(set(self.streak)), 1):
            super().progress(runs)
        else:
            self.collapse()

    def exhausted(self, c):
        return self.calm[c] > 0 and max(self.peak[c], self.speed_squared(c)) < self.tiny

    def collapse(self):
        """R9: exhausted contacts that alone make events end plastically."""
        spent = set(self.streak)
        for step in (1, -1):  # exhausted contacts that adjoin them go with them
            for c in range(len(self.u))[::step]:
                if c - step in spent and self.exhausted(c):
                    spent.add(c)
        for _, group in groupby(enumerate(sorted(spent)), key=lambda item: item[1] - item[0]):
            self.fuse([c for _, c in group])
        self.u = [u if active else min(u, self.zero) for u, active in zip(self.u, self.active)]
        self.streak, self.collapsed = [], True

    def fuse(self, contacts):
        """Plastic end of neighbouring contacts: their balls take the common velocity."""
        balls, v = range(contacts[0], contacts[-1] + 2), self.velocities
        common = sum(self.m[i] * v[i] for i in balls) / sum(self.m[i] for i in balls)
        passed = self.zero
        for i in balls:
            change, v[i] = common - v[i], common
            passed -= self.m[i] * change
            if i > 0:
                self.u[i - 1] -= change
            if i < len(self.u):
                self.u[i] += change
            if i in contacts:
                self.impulses[i] += passed
        for c in contacts:
            self.u[c] = self.near[c] = self.peak[c] = self.zero
            self.active[c], self.calm[c] = False, 0
            self.direction[c] = self.direction[c + 1] = 0
            self.record("collapse", c)


#: As `textbook.solve`, by R1 to R9: a float means what it prints as, a string that decimal number.
solve = partial(textbook.solve, number=as_meant, max_events=1_000_000, impact=Impact)


def in_fifty_digits(*chain):
    """Velocities, as floats, of an impact in fifty digits."""
    with mpmath.workdps(50):
        return np.array([float(v) for v in solve(*chain).velocities])
