"""How the balls hang."""

from dataclasses import KW_ONLY, dataclass

import numpy as np

from cradle.input import values as asked
from cradle.input.values import ArrayLike, Vector

#: Events nearer than this part of a swing (over 2 pi) are one; so are lengths, of the amplitude.
TIE = 1e-9


@dataclass(frozen=True)
class Pendulums:
    """How the balls hang: strings, gravity, gaps, and the damping of the swing.

    A value outside its range is a `ValueError`; `swing` refuses what does not suit its balls.

    Parameters
    ----------
    length, gravity : float; length also array_like of shape (N,)
        From each pivot to the centre of its ball, m; and g, m/s^2.  Both above 0.
    gaps : float or array_like of shape (N - 1,)
        Between the surfaces of neighbours at rest, m; 0 if they just touch.
    damping : float or array_like of shape (N,)
        Rate at which a ball's amplitude decays, 1/s; for `swing` below the frequency sqrt(g/l).
    angle : {"small", "full"}
        "small": harmonic swings, too fast by 1 % at 0.4 rad, 7 % at 1 rad.  "full": true swings, of
        equal lengths and one damping, so that contacts stay horizontal.  Gaps are counted along the
        arcs then, right near the lowest point; with gaps balls go aside a quarter circle at most.

    Examples
    --------
    >>> from cradle import Pendulums
    >>> Pendulums(length=0.1).natural_frequency(5).round(3).tolist()
    [9.905, 9.905, 9.905, 9.905, 9.905]
    """

    length: ArrayLike = 0.1
    _: KW_ONLY
    gravity: float = 9.81
    gaps: ArrayLike = 0.0
    damping: ArrayLike = 0.0
    angle: str = "small"

    def __post_init__(self) -> None:
        least = "must be at least 0", 0.0
        g = asked.one_number("gravity", self.gravity, *asked.ABOVE_ZERO)
        values = {
            "length": asked.number_or_row("length", self.length, "N", *asked.ABOVE_ZERO),
            "gaps": asked.number_or_row("gaps", self.gaps, "N - 1", *least),
            "damping": asked.number_or_row("damping", self.damping, "N", *least),
        }
        asked.one_of("angle", self.angle, ("small", "full"))
        for name, value in values.items() if self.angle == "full" else ():
            if len(set(np.ravel(value))) > 1 and name != "gaps":
                raise ValueError(f"{name} = {value!r}; must be equal with angle='full'")
        vars(self).update(values, gravity=g)

    def row(self, name: str, size: int) -> Vector:
        """Return `length`, `gaps` or `damping` for each of `size` balls or contacts."""
        return asked.row_of(name, getattr(self, name), size, size + (name == "gaps"))

    def reach(self, size: int) -> Vector:
        """Return how far each of `size` balls may be pulled aside, m along its arc."""
        # Above its pivot a string is slack; on a rod a ball would stand at the top.
        part = 0.5 if self.angle == "small" or np.any(self.gaps) else 1.0 - 2.0**-20
        return part * np.pi * self.row("length", size)

    def natural_frequency(self, size: int) -> Vector:
        """Return sqrt(g/l) of each of `size` balls, rad/s."""
        frequency: Vector = np.sqrt(self.gravity / self.row("length", size))
        damping = self.row("damping", size)
        slow = damping >= frequency
        rule = f"must be below the natural frequency sqrt(g/l) = {float(frequency[slow.argmax()])}"
        asked.refuse_where("damping", damping, slow, rule)
        return frequency


def mean(values: Vector, masses: Vector) -> float:
    """Return the mean over the mass; equal values stay what they are, to the bit."""
    return float(values[0] if len({*values.tolist()}) == 1 else masses @ values / masses.sum())


class Hanging:
    """The pendulums of one chain: a row of each kind, and what follows from them alone."""

    def __init__(self, pendulums: Pendulums, masses: Vector) -> None:
        n = len(masses)
        self.masses, self.gravity = masses, pendulums.gravity
        self.small = pendulums.angle == "small"
        self.gaps = pendulums.row("gaps", n - 1)
        self.frequency = pendulums.natural_frequency(n)
        self.length, self.damping = pendulums.row("length", n), pendulums.row("damping", n)
        self.reach = pendulums.reach(n)
        self.fastest = float(self.frequency.max())
        self.tie = TIE / self.fastest  # events nearer than this are one, s

    def offsets(self, first: int, last: int) -> Vector:
        """Return how far the balls of a body hang from its first one, where they touch, m."""
        away = np.zeros(last - first)
        self.gaps[first : last - 1].cumsum(out=away[1:])
        return away

    def within_reach(self, x: Vector, when: str = "") -> None:
        """Refuse that a ball is farther aside than it may be, m."""
        beyond = np.abs(x) > self.reach
        if beyond.any():
            most = "half" if self.reach[0] > 2.0 * self.length[0] else "a quarter of"
            far = f"{self.reach[beyond.argmax()]:.4g} m: pendulums of this length reach"
            rule = f"must be within {far} {most} a circle"
            asked.refuse_where(f"{when}positions", x, beyond, rule)

    def apart(self, x: Vector) -> Vector:
        """Return the nearest places at which no balls overlap, m; their centre stays."""
        from scipy.optimize import isotonic_regression  # slow to import

        hung = self.offsets(0, len(x))
        return np.asarray(isotonic_regression(x + hung, weights=self.masses).x - hung)

    def accelerations(self, positions: Vector, velocities: Vector) -> Vector:
        """Return the acceleration of each ball if it swung alone, m/s^2."""
        angle = positions / self.length
        sine = angle if self.small else np.sin(angle)
        return np.asarray(-self.gravity * sine - 2.0 * self.damping * velocities)

    def energy(self, positions: Vector, velocities: Vector) -> Vector:
        """Return kinetic and potential energy, J; the last axis is summed."""
        away = positions
        if not self.small:  # 1 - cos a = 2 sin^2(a/2), without cancellation
            away = 2.0 * self.length * np.sin(0.5 * positions / self.length)
        each = self.masses * (velocities**2 + self.gravity / self.length * away**2)
        return np.asarray(0.5 * each.sum(axis=-1))
