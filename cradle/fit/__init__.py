"""Measure your own cradle: coefficients of restitution and ratios from measured velocities.

    read_shots -> restitution (pairs) -> ratio (triplets and longer chains) -> predict

Modules: `shots` reads what was measured; `tracks` and `film` make velocities of positions.
`parameters` says how well values explain shots, `search` finds all that do, `estimate` fits, and
`result` is what comes back.  `laws` fits any other law to shots, and `swings` a whole swing.
"""

from cradle.fit.estimate import ratio, restitution
from cradle.fit.film import Velocities, velocities_from_tracks
from cradle.fit.laws import LawFit, fit_law
from cradle.fit.result import Estimate, Fit, Prediction
from cradle.fit.search import Mode
from cradle.fit.shots import Shots, ShotSet, read_shots
from cradle.fit.swings import SwingFit, fit_swing
from cradle.fit.tracks import Track, Tracks, frames, read_tracker

__all__ = [
    "Estimate", "Fit", "LawFit", "Mode", "Prediction", "ShotSet", "Shots", "SwingFit", "Track",
    "Tracks", "Velocities", "fit_law", "fit_swing", "frames", "ratio", "read_shots", "read_tracker",
    "restitution", "velocities_from_tracks",
]  # fmt: skip
