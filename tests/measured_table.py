"""The stored table of times and errors (benchmarks/run.py), and textbook answers beside it."""

from functools import cache

import numpy as np
from chains import ELASTIC
from stored import numbers
from truth import solve

from cradle import paper_chain


@cache
def table():
    rows = numbers("benchmarks.csv", "velocities", "versions")
    for row in rows:
        row["velocities"] = np.array([float(v) for v in row["velocities"].split()])
    return rows


def find(group, text="", **equal):
    """Rows of a group whose setting contains a text and whose columns have given values."""
    return [
        row
        for row in table()
        if row["group"] == group
        and text in row["setting"]
        and all(row[name] == value for name, value in equal.items())
    ]


def masses_and_restitution(scene):
    if scene in ELASTIC:
        return np.array(ELASTIC[scene], float), np.ones(len(ELASTIC[scene]) - 1)
    chain, _ = paper_chain(scene, excess="saturate")
    return chain.masses, chain.restitution


@cache
def sequential(scene):
    m, e = masses_and_restitution(scene)
    start = [1] + [0] * (len(m) - 1)
    solved = solve(m.tolist(), start, e.tolist(), 0.0)
    return np.array([float(v) for v in solved.velocities])


def fused(scene):
    """The first ball strikes one body of all the others."""
    m, e = masses_and_restitution(scene)
    rest = m[1:].sum()
    first = (m[0] - e[0] * rest) / (m[0] + rest)
    return np.array([first] + [(1 + e[0]) * m[0] / (m[0] + rest)] * (len(m) - 1))
