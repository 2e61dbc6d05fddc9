"""What one row of the table is, and how its time is taken."""

import importlib.util
import math
import os
import platform
import statistics
import time
from dataclasses import make_dataclass
from functools import partial
from importlib import metadata
from typing import NamedTuple
from unittest import mock

import numpy as np
from scenes import random_chains

from cradle import post_impact_velocities
from cradle.runtime import compile as runtime
from cradle.runtime.job import warm_up

#: The unit of time of the whole table: one impact of three balls, solved in a batch.
REFERENCE = "one impact of three balls, in a batch of 2000 random chains"
_BATCH = random_chains(3, 2000)

#: data/README.md says what they are; errors of the two kinds are never mixed.
COLUMNS = [
    "group", "model", "setting", "chain", "parameter", "velocities", "numerical_error",
    "numerical_reference", "model_error", "model_reference", "momentum_error", "energy_change",
    "time_ratio", "microseconds", "repeats", "evaluations", "needs", "gives", "versions", "note",
]  # fmt: skip
#: One line of the table; an empty field does not apply.
Row = make_dataclass("Row", [(name, object, "") for name in COLUMNS])


class Engine(NamedTuple):
    """A physics engine and two settings of it."""

    name: str
    module: str
    scene: object  #: makes the balls in the engine
    default: dict
    refined: dict
    note: str = ""

    @property
    def distribution(self):
        """As it is installed."""
        return self.module.lower()


#: What takes corrections and margins from the engine.
BULLET = {"restitutionVelocityThreshold": 0.0, "contactSlop": 0.0, "contactERP": 0.0, "erp": 0.0}
RAPIER = {"normalized_prediction_distance": 1e-6, "contact_recycling": False}


def named_engines(scenes):
    """Return the five engines from {scene: (default, refined, note)}, in this order."""
    names = ("Chipmunk", "Box2D", "Bullet", "Rapier", "MuJoCo")
    modules = ("pymunk", "Box2D", "pybullet", "rapier3d", "mujoco")
    given = zip(names, modules, scenes.items(), strict=True)
    return [Engine(name, module, scene, *rest) for name, module, (scene, rest) in given]


def absent(engines):
    """Return the names of engines that are not installed, and what to do about each."""
    return {
        engine.name: f'{engine.distribution} is not installed; pip install -e ".[engines]"'
        for engine in engines
        if importlib.util.find_spec(engine.module) is None
    }


def present(engines):
    return [engine for engine in engines if engine.name not in absent(engines)]


def distance(velocities, reference):
    return float(np.max(np.abs(np.asarray(velocities, float) - np.asarray(reference, float))))


def outcome(masses, before, after):
    """Return the fields that every outcome has: velocities, momentum, energy."""
    m, before, after = (np.asarray(x, float) for x in (masses, before, after))
    energy = float(m @ before**2)
    return {
        "velocities": " ".join(f"{v:.12g}" for v in after / np.abs(before).max()),
        "momentum_error": abs(float(m @ (after - before))) / float(m @ np.abs(before)),
        "energy_change": float(m @ after**2) / energy - 1.0,
    }


def seconds(function, calls=1, clock=time.perf_counter):
    """Return the time of a call."""
    begin = clock()
    for _ in range(calls):
        function()
    return (clock() - begin) / calls


cpu = partial(seconds, clock=time.process_time)


def in_turn(clocks, repeats):
    """Return the times that each of some clocks takes, one after the other, so many times."""
    return zip(*([clock() for clock in clocks] for _ in range(repeats)))


def quotient(these, those):
    """Return the median quotient of times that were taken in turn."""
    return statistics.median(a / b for a, b in zip(these, those, strict=True))


class Clock:
    """Takes times beside those of the reference: a busy machine, or another speed, changes both.

    What is kept is the ratio; `unit` turns all ratios of a table into times of one speed.
    """

    def __init__(self, repeats):
        self.repeats = repeats
        self.units = []  # seconds of the reference, whenever it was taken

    def unit(self):
        return statistics.median(self.units)

    def __call__(self, function, impacts=1, prepare=None, kernel=None):
        """Return the fields of a row that tell the time of `function`, which solves `impacts`.

        `prepare` makes the argument of each call, outside the measured time. `kernel` names that
        of `function`, if it is not the one in force.
        """
        reference = partial(post_impact_velocities, *_BATCH)

        def measured(calls):
            given = [prepare()] if prepare else []
            with mock.patch.dict(os.environ, {runtime.VARIABLE: kernel} if kernel else {}):
                return seconds(lambda: function(*given), calls)

        warm_up()  # else the reference, as small work, would run plain at first
        measured(1)
        once = measured(1)
        calls = 1 if prepare else max(1, math.ceil(1e-3 / once))  # a millisecond at least
        reference()
        # As long as the row itself, within limits: what interrupts one interrupts the other.
        units = min(20, max(2, math.ceil(once * calls / seconds(reference))))
        clocks = partial(measured, calls), partial(seconds, reference, units)
        taken, beside = in_turn(clocks, self.repeats)
        chains = len(_BATCH[0])
        self.units += [time / chains for time in beside]
        ratio = quotient(taken, beside) * chains / impacts
        return {"time_ratio": ratio, "repeats": self.repeats}


def versions(*packages):
    named = [f"{name} {metadata.version(name)}" for name in packages]
    return "; ".join([*named, f"CPython {platform.python_version()}"])


def ours(*more):
    """Return the versions behind the package's own models."""
    compiler = [] if runtime.compiled() is None else ["numba"]
    return versions("cradle-companion", "numpy", *compiler, *more)
