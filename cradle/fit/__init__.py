"""Measure your own cradle: coefficients of restitution and ratios from measured velocities.

    read_shots -> restitution (pairs) -> ratio (triplets and longer chains) -> predict

- `cradle.fit.shots`: measured velocities, in sets.
- `cradle.fit.reading`: tables of them, read and checked.
- `cradle.fit.tracks`: positions exported by video tools.
- `cradle.fit.film`: velocities from positions or heights.
- `cradle.fit.parameters`: what is fitted, and its names.
- `cradle.fit.likelihood`: how well parameters explain shots.
- `cradle.fit.search`: exhaustive search, confidence sets.
- `cradle.fit.estimate`: the fits.
- `cradle.fit.answers`, `cradle.fit.result`: what they return.
- `cradle.pictures.fits`: their figures; loads matplotlib when asked for.
"""

from cradle.fit.answers import Estimate, Prediction
from cradle.fit.estimate import ratio, restitution, restitution_from_heights
from cradle.fit.film import Velocities, speeds_from_heights, velocities_from_tracks
from cradle.fit.reading import read_shots
from cradle.fit.result import Fit
from cradle.fit.search import Mode
from cradle.fit.shots import Shots, ShotSet
from cradle.fit.tracks import Tracks, read_tracker

__all__ = [
    "Estimate", "Fit", "Mode", "Prediction", "ShotSet", "Shots", "Tracks", "Velocities", "ratio",
    "read_shots", "read_tracker", "restitution", "restitution_from_heights", "speeds_from_heights",
    "velocities_from_tracks",
]  # fmt: skip
