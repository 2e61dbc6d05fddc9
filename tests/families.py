"""Families of random chains that need more than continuous numbers: ties, zeros, light balls.

Every number is made by choices, products, sums and divisions of whole numbers, operations that
round alike everywhere; printed, it is short.  Draws come from `random.Random`, whose `random` and
`getrandbits` are the same on every platform; nothing else of it is used.
"""

import random

from problem import Problem

PAPER_MASSES = [0.045, 0.053, 0.053, 0.166]


class Draw:
    """Numbers and choices."""

    def __init__(self, seed):
        self.source = random.Random(seed)

    def below(self, n):
        """A whole number below n."""
        return int(self.source.random() * n)

    def choice(self, values):
        return values[self.below(len(values))]

    def decimal(self, low, high, places):
        """A number of a few decimals, as it is printed."""
        scale = 10**places
        return (round(low * scale) + self.below(round((high - low) * scale) + 1)) / scale

    def chance(self, percent):
        return self.below(100) < percent


def within_bounds(masses, parts):
    """One way's ratios as parts of Eq. 53, for a chain driven to the right."""
    ratios, onward = [], 0.0
    for here, beyond, part in reversed(list(zip(masses[1:], masses[2:], parts))):
        onward = part * (beyond / (beyond + here * (1 - onward)))
        ratios.insert(0, onward)
    return ratios


def ties(draw, n):
    """Equal or the paper's masses, few different numbers: everything coincides."""
    kind = draw.below(3)
    masses = [1.0] * n
    if kind == 1:
        masses = [draw.choice(PAPER_MASSES) for _ in range(n)]
    elif kind == 2:
        masses = [draw.choice([1.0, 1.0, 1.0, 3.0, 0.3]) for _ in range(n)]
    first = [1.0] + [0.0] * (n - 1)
    velocities = first if draw.chance(40) else [draw.choice([-0.5, 0, 0.5, 1]) for _ in range(n)]
    coefficients = draw.choice([[1], [1], [0, 0.5, 0.9, 1], [0.5, 0.9, 1], [0.9]])
    restitution = [float(draw.choice(coefficients)) for _ in range(n - 1)]
    values = draw.choice([[0.0, 1.0], [0.0, 0.1], [0.0, 0.1, 1.0]])
    forward, backward = ([draw.choice(values) for _ in range(n - 2)] for _ in range(2))
    return Problem(masses, velocities, restitution, forward, backward, draw.choice([0.0, 0.5, 1.0]))


def bounded_ties(draw, n):
    """The same, with no ratio above its bound."""
    given = ties(draw, n)
    m, count = given.masses, len(given.forward)
    forward = within_bounds(m, [draw.choice([0.0, 0.5]) for _ in range(count)])
    backward = within_bounds(m[::-1], [draw.choice([0.0, 0.5]) for _ in range(count)])
    return given._replace(forward=forward, backward=backward[::-1])


def tiny_ratios(draw, n):
    """Ratios of 1e-20 among those of ties.

    What they do cannot be seen in doubles, but it decides whether a contact has been touched.
    Products of several of them need hundreds of digits: no outcome is demanded, only invariants.
    """
    given = ties(draw, n)
    values = draw.choice([[0.0, 1e-20], [0.0, 1e-20, 0.1], [0.0, 1e-20, 0.1, 1.0]])
    forward, backward = ([draw.choice(values) for _ in range(n - 2)] for _ in range(2))
    return given._replace(forward=forward, backward=backward)


def mixed_zeros(draw, n):
    """Generic balls in decreasing order of velocity; a tenth to a half of the ratios are zero."""
    masses = [draw.decimal(0.3, 3, 2) for _ in range(n)]
    velocities = sorted((draw.decimal(0, 1, 2) for _ in range(n)), reverse=True)
    restitution = [draw.decimal(0.5, 1, 2) for _ in range(n - 1)]
    zeros = 10 + draw.below(41)

    def part():
        return 0.0 if draw.chance(zeros) else draw.decimal(0.05, 0.95, 2)

    ways = []
    for m in (masses, masses[::-1]):
        bounds = within_bounds(m, [part() for _ in range(n - 2)])
        ways.append([int(x * 100) / 100 for x in bounds])  # printed, and still within its bound
    return Problem(masses, velocities, restitution, ways[0], ways[1][::-1])


def light_balls(draw, n):
    """Balls a thousand to a million times lighter among the others; elastic or nearly so."""
    masses = [draw.choice([1.0, 1.0, 1.7, 1e-3, 1e-6]) for _ in range(n)]
    velocities = [1.0] + [0.0] * (n - 1)
    restitution = [draw.choice([1.0, 1.0, 0.99, 0.9]) for _ in range(n - 1)]
    forward, backward = ([draw.choice([0.0, 0.05, 0.1]) for _ in range(n - 2)] for _ in range(2))
    return Problem(masses, velocities, restitution, forward, backward)


#: name: generator, least and largest number of balls
FAMILIES = {
    "ties": (ties, 2, 20),
    "ties within bounds": (bounded_ties, 3, 20),
    "tiny ratios": (tiny_ratios, 3, 20),
    "mixed zeros": (mixed_zeros, 7, 12),
    "light balls": (light_balls, 3, 5),
}


def family(name, count, seed=2001):
    """Yield problems of a family; the same for the same seed, everywhere."""
    draw = Draw(seed)
    generate, least, largest = FAMILIES[name]
    for _ in range(count):
        yield generate(draw, least + draw.below(largest - least + 1))
