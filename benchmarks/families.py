"""Families of random chains that need more than continuous numbers: ties, zeros, light balls.

Numbers are made by choices, products, sums and divisions of whole numbers, which round alike
everywhere; printed, they are short.  Of `random.Random` nothing but `random` is used, the same on
every platform.
"""

import random
from functools import partial

import chains
import numpy as np
from problem import Problem

PAPER_MASSES = [0.045, 0.053, 0.053, 0.166]


class Draw(random.Random):
    """Numbers and choices."""

    def below(self, n):
        return int(self.random() * n)

    def choice(self, values):
        return values[self.below(len(values))]

    def some(self, values, count):
        return [self.choice(values) for _ in range(count)]

    def ways(self, values, n):
        """Ratios, forward and backward."""
        return [self.some(values, n - 2) for _ in range(2)]

    def decimal(self, low, high, places):
        """A number of a few decimals, as it is printed."""
        scale = 10**places
        return (round(low * scale) + self.below(round((high - low) * scale) + 1)) / scale

    def chance(self, percent):
        return self.below(100) < percent


def within_bounds(masses, part):
    """Ratios as parts of their bounds, which `part` gives one by one."""
    ways = chains.within_bounds(masses, lambda shape: np.array([part() for _ in range(*shape)]))
    return [way.tolist() for way in ways]


def struck(n):
    return [1.0] + [0.0] * (n - 1)


def ties(draw, n):
    """Equal or the paper's masses, few different numbers: everything coincides."""
    kind = draw.below(3)
    masses = (
        draw.some((PAPER_MASSES, [1.0, 1.0, 1.0, 3.0, 0.3])[kind - 1], n) if kind else [1.0] * n
    )
    velocities = struck(n) if draw.chance(40) else draw.some([-0.5, 0, 0.5, 1], n)
    coefficients = draw.choice([[1], [1], [0, 0.5, 0.9, 1], [0.5, 0.9, 1], [0.9]])
    restitution = [float(e) for e in draw.some(coefficients, n - 1)]
    ways = draw.ways(draw.choice([[0.0, 1.0], [0.0, 0.1], [0.0, 0.1, 1.0]]), n)
    return Problem(masses, velocities, restitution, *ways, draw.choice([0.0, 0.5, 1.0]))


def bounded_ties(draw, n):
    """The same, with no ratio above its bound."""
    given = ties(draw, n)
    forward, backward = within_bounds(given.masses, lambda: draw.choice([0.0, 0.5]))
    return given._replace(forward=forward, backward=backward)


def tiny_ratios(draw, n, size=1e-20):
    """Ratios of this size among those of ties: they decide whether a contact has been touched."""
    given = ties(draw, n)
    values = draw.choice([[0.0, size], [0.0, size, 0.1], [0.0, size, 0.1, 1.0]])
    forward, backward = draw.ways(values, n)
    return given._replace(forward=forward, backward=backward)


def mixed_zeros(draw, n):
    """Generic balls in decreasing order of velocity; a tenth to a half of the ratios are zero."""
    masses = [draw.decimal(0.3, 3, 2) for _ in range(n)]
    velocities = sorted((draw.decimal(0, 1, 2) for _ in range(n)), reverse=True)
    restitution = [draw.decimal(0.5, 1, 2) for _ in range(n - 1)]
    zeros = 10 + draw.below(41)

    def part():
        return 0.0 if draw.chance(zeros) else draw.decimal(0.05, 0.95, 2)

    # Printed, and still within their bounds.
    ways = ([int(x * 100) / 100 for x in way] for way in within_bounds(masses, part))
    return Problem(masses, velocities, restitution, *ways)


def light_balls(draw, n):
    """Balls a thousand to a million times lighter among the others; elastic or nearly so."""
    masses = draw.some([1.0, 1.0, 1.7, 1e-3, 1e-6], n)
    restitution = draw.some([1.0, 1.0, 0.99, 0.9], n - 1)
    return Problem(masses, struck(n), restitution, *draw.ways([0.0, 0.05, 0.1], n))


def any_number(draw, low, high):
    """With all its digits, or with two decimals."""
    return low + (high - low) * draw.random() if draw.chance(50) else draw.decimal(low, high, 2)


def any_masses(draw, n, decades=2):
    """Equal, the paper's, or random over some decades."""
    kind = draw.below(4)
    if kind < 2:
        return draw.some(PAPER_MASSES, n) if kind else [1.0] * n
    octaves = round(decades * 1.66)  # on either side of 1
    powers = [2.0 ** (draw.below(2 * octaves) - octaves) for _ in range(n)]
    return [x * any_number(draw, 1, 2) for x in powers]


def few_velocities(draw, n):
    """The first ball strikes, or few different numbers."""
    return struck(n) if draw.chance(50) else draw.some([0.0, 1.0, 0.5, -0.5], n)


def losses(draw, n):
    """Chains with losses and few different ratios, in which ties decide."""
    values = draw.choice([[0.0, 0.1], [0.0, 0.05, 0.1], [0.05, 0.1], [0.0, 1e-20]])
    coefficients = draw.choice([[0.9], [0.8, 0.9, 0.95]])
    m, v, e = any_masses(draw, n), few_velocities(draw, n), draw.some(coefficients, n - 1)
    return Problem(m, v, e, *draw.ways(values, n), draw.choice([0.0, 0.5, 1.0]))


def wide(draw, n):
    """Every coefficient and ratio there is, masses over up to twelve decades."""

    def numbers(lists, size):
        values = draw.choice(lists)
        return [draw.choice(values) if values else any_number(draw, 0, 1) for _ in range(size)]

    ways = [numbers([[0.0, 0.1], [0.0, 0.1, 0.5, 1.0], [0.3], [1.0], []], n - 2) for _ in range(2)]
    if draw.chance(10) and n > 2:
        draw.choice(ways)[draw.below(n - 2)] = 1e-20
    m = any_masses(draw, n, draw.choice([2, 2, 12]))
    v = few_velocities(draw, n) if draw.chance(60) else numbers([[]], n)
    e = numbers([[0.9], [0.5, 0.8, 0.9], [0.0, 0.5, 0.9, 1.0], [1.0], []], n - 1)
    return Problem(m, v, e, *ways, draw.choice([0.0, 0.3, 0.5, 1.0]))


def generic(draw, n):
    """No ties: every number with all its digits."""

    def numbers(low, high, size):
        return [low + (high - low) * draw.random() for _ in range(size)]

    m = numbers(0.2, 4, n)
    ways = within_bounds(m, draw.random)
    return Problem(m, numbers(-1, 1, n), numbers(0.3, 1, n - 1), *ways, draw.random())


def at_bounds(draw, n):
    """Ratios exactly on their bounds where these are short decimals, or one digit beside them."""
    m = draw.some([1.0, 1.0, 1.5, 3.0, 4.0, 0.25], n)
    parts = draw.ways([0.0, 0.5, 1.0, 1.0], n)
    if draw.chance(60):  # no ratio beside another: all bounds are quotients of two masses
        parts = [[part * (i % 2) for i, part in enumerate(way)] for way in parts]
    ways = within_bounds(m, iter([*parts[0], *parts[1]]).__next__)
    e = draw.some(draw.choice([[1.0], [0.9], [0.5, 0.9, 1.0]]), n - 1)
    meeting = draw.choice([0.0, 0.5, 1.0])
    return Problem(m, few_velocities(draw, n), e, *ways, meeting)


def extremes(draw, n):
    """Nothing but ends: e and ratios 0 and 1, meeting 0 and 1, masses twelve decades apart."""
    masses = draw.choice([[1.0], [1.0, 2.0], [1.0, 1e-6, 1e6], [0.045, 0.053, 0.166]])
    ratios = draw.choice([[0.0, 1.0], [0.0], [1.0]])
    coefficients = draw.choice([[0.0, 1.0], [1.0], [0.5, 1.0]])
    m, v, e = draw.some(masses, n), few_velocities(draw, n), draw.some(coefficients, n - 1)
    return Problem(m, v, e, *draw.ways(ratios, n), draw.choice([0.0, 1.0]))


#: name: generator, least and largest number of balls
FAMILIES = {
    "ties": (ties, 2, 20),
    "ties within bounds": (bounded_ties, 3, 20),
    "tiny ratios": (tiny_ratios, 3, 20),
    "mixed zeros": (mixed_zeros, 7, 12),
    "light balls": (light_balls, 3, 5),
}

#: The same for the judge of `judge.py`.
JUDGED = {
    "losses": (losses, 4, 14),
    "wide": (wide, 2, 10),
    "generic": (generic, 2, 10),
    "at bounds": (at_bounds, 3, 10),
    "extremes": (extremes, 2, 10),
    **FAMILIES,
    # Products of five decide beyond the 32 digits of the solver.
    "small ratios": (partial(tiny_ratios, size=1e-8), 3, 20),
}


def family(name, count, seed=2001):
    """Yield problems of a family; the same for the same seed, everywhere."""
    draw = Draw(seed)
    generate, least, largest = JUDGED[name]
    for _ in range(count):
        yield generate(draw, least + draw.below(largest - least + 1))
