"""The table of chains that each need something of the event loop: `delicate_chains.csv`.

They went wrong once, or would without one line, or show one case of a rule: `once` says which.
Velocities and impulses are asked for within these of fifty digits, after at most so many events,
and in the mirror too.  `law` says which test asks.
"""

import csv
import math
from pathlib import Path
from typing import NamedTuple

from problem import Problem


class Row(NamedTuple):
    """A chain, and how close to fifty digits its answer must be."""

    law: str
    problem: Problem
    velocities: float
    impulses: float
    events: int
    mirrored: bool


def _row(cells):
    lists = ("masses", "velocities", "restitution", "forward", "backward")
    parts = ([float(x) for x in cells[name].split()] for name in lists)
    return Row(
        cells["law"],
        Problem(*parts, float(cells["meeting"])),
        float(cells["velocities_within"] or math.inf),
        float(cells["impulses_within"] or math.inf),
        int(cells["events"] or 5_000_000),
        cells["mirrored"] == "1",
    )


with Path(__file__).with_name("delicate_chains.csv").open(encoding="utf-8", newline="") as file:
    CHAINS = {cells["chain"]: _row(cells) for cells in csv.DictReader(file)}


def chains_of(law):
    """The names of the chains of a law."""
    return [name for name, row in CHAINS.items() if row.law == law]


def seen(names):
    """Each chain as it is and, where the table says so, in the mirror: (name, problem)."""
    found = [(name, CHAINS[name].problem) for name in names]
    twice = [(name, one) for name, one in found if CHAINS[name].mirrored]
    return found + [(f"{name}, mirrored", one.mirrored()) for name, one in twice]
