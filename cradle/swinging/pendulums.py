"""How the balls hang: strings, gravity, gaps, damping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cradle.input.values import (
    Vector,
    first,
    number_or_row,
    one_number,
    one_of,
    refuse_where,
    row_of,
)

#: Events nearer than this part of a swing (over 2 pi) are one; so are lengths, of the amplitude.
TIE = 1e-9


@dataclass(frozen=True, eq=False, init=False)
class Pendulums:
    """How the balls hang: strings, gravity, gaps, and the damping of the swing.

    Parameters
    ----------
    length : float or sequence, length N
        Distance from each pivot to the centre of its ball, m; above 0.
    gravity : float
        m/s^2; above 0.
    gaps : float or sequence, length N - 1
        Distance between the surfaces of neighbours at rest, m; 0 if they just touch.
    damping : float or sequence, length N
        Rate at which the amplitude of a ball that swings alone decays, 1/s; below its natural
        frequency sqrt(g/l), or it would not swing.
    angle : {"small", "full"}
        Pendulums of any angle need equal lengths, no gaps and one damping: then contacts stay
        horizontal.  Small-angle ones swing too fast by about the square of the amplitude over 16:
        by 1 % at 0.4 rad, by 7 % at 1 rad.

    Raises
    ------
    ValueError
        If a value is outside its range; the message names the value and the rule.

    Examples
    --------
    >>> Pendulums(length=0.1).natural_frequency(5).round(3).tolist()
    [9.905, 9.905, 9.905, 9.905, 9.905]
    """

    length: float | tuple[float, ...]
    gravity: float
    gaps: float | tuple[float, ...]
    damping: float | tuple[float, ...]
    angle: str

    def __init__(
        self,
        length: ArrayLike = 0.1,
        *,
        gravity: float = 9.81,
        gaps: ArrayLike = 0.0,
        damping: ArrayLike = 0.0,
        angle: str = "small",
    ) -> None:
        g = one_number("gravity", gravity, "must be above 0", 0.0, open_low=True)
        least = "must be at least 0"
        values = {
            "length": number_or_row("length", length, "N", "must be above 0", 0.0, open_low=True),
            "gaps": number_or_row("gaps", gaps, "N - 1", least, 0.0),
            "damping": number_or_row("damping", damping, "N", least, 0.0),
        }
        one_of("angle", angle, ("small", "full"))
        if angle == "full":
            for name, value in values.items():
                if len(set(np.ravel(value))) > 1 or (name == "gaps" and np.any(value)):
                    rule = "must be 0" if name == "gaps" else "must be equal"
                    raise ValueError(f"{name} = {value!r}; {rule} with angle='full'")
        vars(self).update(values, gravity=g, angle=angle)

    def row(self, name: str, size: int) -> Vector:
        """Return `length`, `gaps` or `damping` for each of `size` balls or contacts."""
        return row_of(name, getattr(self, name), size, size + (name == "gaps"))

    def reach(self, size: int) -> Vector:
        """Return how far each of `size` balls may be pulled aside for a release, m along its arc.

        A quarter of a circle: above its pivot a string is slack.  Others may hang on rods: half a
        circle, not quite to the top, where a ball would stand.
        """
        part = 0.5 if self.angle == "small" else 1.0 - 2.0**-20
        return part * np.pi * self.row("length", size)

    def natural_frequency(self, size: int) -> Vector:
        """Return sqrt(g/l) of each of `size` balls, rad/s.

        Examples
        --------
        >>> Pendulums(length=9.81).natural_frequency(2).tolist()
        [1.0, 1.0]
        """
        frequency: Vector = np.sqrt(self.gravity / self.row("length", size))
        damping = self.row("damping", size)
        slow = damping >= frequency
        if slow.any():
            least = float(frequency[first(slow)])
            rule = f"must be below the natural frequency sqrt(g/l) = {least!r}"
            refuse_where("damping", damping, slow, rule)
        return frequency


def mean(values: Vector, masses: Vector) -> float:
    """Return the mean over the mass; equal values stay what they are, to the bit."""
    return float(values[0] if (values == values[0]).all() else masses @ values / masses.sum())


class Hanging:
    """The pendulums of one chain: a row of each kind, and what follows from them alone."""

    def __init__(self, pendulums: Pendulums, masses: Vector) -> None:
        n = len(masses)
        self.masses, self.gravity = masses, pendulums.gravity
        self.small = pendulums.angle == "small"
        self.gaps = pendulums.row("gaps", n - 1)
        self.frequency = pendulums.natural_frequency(n)
        self.length, self.damping = pendulums.row("length", n), pendulums.row("damping", n)
        self.fastest = float(self.frequency.max())
        self.tie = TIE / self.fastest  # events nearer than this are one, s
        self._half_masses = 0.5 * masses
        self._half_pulls = 0.5 * masses * self.gravity / self.length

    def offsets(self, first: int, last: int) -> Vector:
        """Return how far the balls of a body hang from its first one, where they touch, m."""
        return np.concatenate([[0.0], np.cumsum(self.gaps[first : last - 1])])

    def accelerations(self, positions: Vector, velocities: Vector) -> Vector:
        """Return the acceleration of each ball if it swung alone, m/s^2."""
        angle = positions / self.length
        sine = angle if self.small else np.sin(angle)
        return np.asarray(0.0 - self.gravity * sine - 2.0 * self.damping * velocities)

    def energy(self, positions: Vector, velocities: Vector) -> Vector:
        """Return kinetic and potential energy, J; the last axis is summed."""
        away = positions
        if not self.small:  # 1 - cos a = 2 sin^2(a/2), without cancellation
            away = 2.0 * self.length * np.sin(0.5 * positions / self.length)
        each = self._half_masses * velocities**2 + self._half_pulls * away**2
        return np.asarray(each.sum(axis=-1))
