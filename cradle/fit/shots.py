"""What is measured: shots, velocities before and after impacts, in sets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cradle.input.values import Vector, one_number


@dataclass(frozen=True, eq=False)
class ShotSet:
    """All shots of one arrangement of N balls; K shots."""

    name: str
    types: tuple[str, ...]  #: Of the N balls, left to right.
    shots: tuple[str, ...]  #: Names of the K shots.
    masses: Vector  #: Shape (N,), kg.
    before: Vector  #: Velocities, shape (K, N), m/s; so are the next three.
    after: Vector
    sigma: Vector  #: Standard errors of `after`.
    sigma_before: Vector  #: Standard errors of `before`.

    @property
    def momentum_residuals(self) -> Vector:
        """Momentum gained in each shot over its standard error, shape (K,): about 1 in size."""
        gain = (self.after - self.before) @ self.masses
        error = np.sqrt((self.sigma**2 + self.sigma_before**2) @ self.masses**2)
        return np.asarray(gain / error)

    def mean_after(self, speed: float = 1.0) -> tuple[Vector, Vector]:
        """Return the mean velocities after the impact, each shot scaled to one speed.

        Parameters
        ----------
        speed : float
            Of the first ball before the impact, m/s.

        Returns
        -------
        mean, error : ndarray, shape (N,)
            m/s; the standard errors follow from those of the velocities before and after.

        Raises
        ------
        ValueError
            If a shot begins otherwise than with the first ball striking the others at rest.

        Examples
        --------
        >>> from cradle.fit import read_shots
        >>> from cradle.tables import data_folder
        >>> mean, error = read_shots(data_folder() / "shots_template.csv")["AB"].mean_after()
        >>> mean.round(3).tolist(), error.round(3).tolist()
        ([0.176, 0.7], [0.006, 0.007])
        """
        one_number("speed", speed, "must be above 0", 0.0, open_low=True)
        striker = self.before[:, :1]
        if (striker <= 0).any() or self.before[:, 1:].any():
            raise ValueError(
                f"set {self.name} has shots that do not begin with ball 1 striking the others at "
                "rest"
            )
        share = self.after / striker
        errors = np.hypot(self.sigma, share * self.sigma_before[:, :1]) / striker
        return speed * share.mean(axis=0), speed * np.sqrt((errors**2).sum(axis=0)) / len(striker)


@dataclass(frozen=True, eq=False)
class Shots:
    """Measured shots of one or several arrangements: `sets`, in the order of the table.

    Examples
    --------
    >>> from cradle.fit import read_shots
    >>> from cradle.tables import data_folder
    >>> shots = read_shots(data_folder() / "shots_template.csv")
    >>> shots
    Shots(AB: 2 shots of 2 balls, ABA: 1 shot of 3 balls)
    >>> shots["AB"].types, shots.without("ABA"), shots.momentum_check()[1]
    (('A', 'B'), Shots(AB: 2 shots of 2 balls), 3)
    """

    sets: tuple[ShotSet, ...]

    def __getitem__(self, name: str) -> ShotSet:
        """Return the set of that name."""
        for one in self.sets:
            if one.name == name:
                return one
        raise KeyError(f"no set {name!r}; there are {', '.join(s.name for s in self.sets)}")

    def __repr__(self) -> str:
        """Return the sets with their sizes."""
        parts = [
            f"{s.name}: {len(s.shots)} shot{'s' * (len(s.shots) > 1)} of {len(s.types)} balls"
            for s in self.sets
        ]
        return f"Shots({', '.join(parts)})"

    @property
    def masses(self) -> dict[str, float]:
        """Mass of each type of ball, kg."""
        return {t: float(m) for s in self.sets for t, m in zip(s.types, s.masses, strict=True)}

    def without(self, *names: str) -> Shots:
        """Return the shots less some sets: what is not to be fitted, but to be predicted.

        Raises
        ------
        ValueError
            If there is no set of that name, or no set is left.
        """
        there = [one.name for one in self.sets]
        for name in names:
            if name not in there:
                raise ValueError(f"no set {name!r} to leave out; there are {', '.join(there)}")
        kept = tuple(one for one in self.sets if one.name not in names)
        if not kept:
            raise ValueError(f"no set is left without {', '.join(names)}")
        return Shots(kept)

    def momentum_check(self) -> tuple[float, int]:
        """Return the sum of squares of all `ShotSet.momentum_residuals`, and the number of shots.

        Chi-square of the momentum gained: far above the number of shots it says that masses,
        velocities or their errors are wrong, whatever the model.
        """
        residuals = np.concatenate([s.momentum_residuals for s in self.sets])
        return float(residuals @ residuals), residuals.size


def chance(chi_square: float, degrees_of_freedom: int) -> float:
    """Return the chance of a chi-square at least as large if model and errors are right."""
    from scipy.special import chdtrc

    return float(chdtrc(max(degrees_of_freedom, 1), chi_square))
