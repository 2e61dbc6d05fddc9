"""What a swing must keep, checked before it is returned: order, momentum, energy and ledger."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cradle.checks import Vector
from cradle.flight import TIE
from cradle.pendulums import Pendulums

#: Part of the momentum that an instant may make or lose, and of the energy beside its impacts: what
#: balls lose that come to rest against each other, or are moved to where they touch.
INSTANT = 1e-10
#: Part of the energy that a flight may make or lose while the fastest ball swings by a radian;
#: pendulums of any angle are integrated to a tenth of it, the others are known to rounding.
RADIAN = 1e-11


@dataclass
class Account:
    """What the balls of a swing have, and what an unsound flight or instant would change.

    Attributes
    ----------
    masses, gaps : ndarray, shapes (N,) and (N - 1,)
        kg and m.
    pendulums : Pendulums
        How the balls hang.
    frequency : float
        Of the fastest ball, rad/s.
    size : float
        Of the swing, m.
    energy : float
        Where the present flight began, J.

    Examples
    --------
    >>> account = Account(np.ones(2), np.zeros(1), Pendulums(length=9.81), 1.0, 1.0)
    >>> account.settle(0.0, np.zeros((2, 2)), np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 1.0]]))
    >>> account.fly(0.0, np.array([9.0]), np.array([[0.1, 0.0]]), np.array([[0.0, 1.0]]))
    Traceback (most recent call last):
    ...
    RuntimeError: the swing is not certified: at t = 9.0 s balls overlap by 0.1 m
    """

    masses: Vector
    gaps: Vector
    pendulums: Pendulums
    frequency: float
    size: float
    energy: float = 0.0

    def fly(self, begin: float, times: Vector, x: Vector, v: Vector) -> None:
        """Demand of a flight that no ball passes another, and that energy is only damped.

        Parameters
        ----------
        begin : float
            When it began, s.
        times : ndarray, shape (T,)
            s since then.
        x, v : ndarray, shape (T, N)
            m and m/s.

        Raises
        ------
        RuntimeError
            If it is not so.
        """
        if not len(times):
            return
        overlap = -(self.gaps + np.diff(x, axis=-1)).min(axis=-1)
        _demand(overlap <= TIE * self.size, begin + times, "balls overlap by {:g} m", overlap)
        gain = self.pendulums.energy(self.masses, x, v) - self.energy
        wrong = gain if np.any(self.pendulums.damping) else np.abs(gain)
        sound = wrong <= RADIAN * (1.0 + times * self.frequency) * self.energy
        _demand(sound, begin + times, "a flight has made or lost {:g} J", gain)

    def settle(self, time: float, x: Vector, v: Vector) -> None:
        """Demand of an instant that all but its impacts keeps the energy, and all the momentum.

        How much energy an impact keeps is told by its own trace.

        Parameters
        ----------
        time : float
            s.
        x : ndarray, shape (2, N)
            Where the balls came to be, and where they were put, m.
        v : ndarray, shape (3, N)
            Velocities with which they came, after the impacts, and at last, m/s.

        Raises
        ------
        RuntimeError
            If it is not so.
        """
        momenta = self.masses * v[::2]
        gain = abs(float((momenta[1] - momenta[0]).sum()))
        sound = gain <= INSTANT * np.abs(momenta).sum()
        _demand(sound, time, "impacts have made or lost {:g} kg m/s", gain)
        struck, self.energy = self.pendulums.energy(self.masses, x, v[1:]).tolist()
        gain = abs(self.energy - struck)
        sound = gain <= INSTANT * max(self.energy, struck)
        _demand(sound, time, "{:g} J are made or lost beside the impacts", gain)


def _demand(sound: Any, times: Any, what: str, defect: Any) -> None:
    if not np.all(sound):
        k = int(np.argmin(sound))
        time, size = np.ravel(times)[k], np.ravel(defect)[k]
        raise RuntimeError(f"the swing is not certified: at t = {time} s {what.format(size)}")
