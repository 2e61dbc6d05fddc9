"""Maps of the chapter on extremes: errors, edges, long and infinite sequences.

Usage::

    python benchmarks/extremes.py                 # all parts, about half an hour
    python benchmarks/extremes.py map edges       # some of them
    python benchmarks/extremes.py map --keep exact.pickle    # keep exact outcomes for the next time

Every part writes one small file `data/extremes_<part>.csv`.  The measuring functions are those of
`benchmarks/extreme_chains.py`, and the tests compute a sample of the rows anew.
"""

import itertools
import math
import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import extreme_chains as x
import mpmath
import numpy as np
from chains import power_of_ten
from stored import options, write

from cradle import outcomes, paper_chain
from cradle.models.correlation import MAX_EVENTS
from cradle.tables import paper_sequences


def written(row):
    """Return a row as it is stored: four digits."""
    return [f"{v:.4g}" if isinstance(v, float) else v for v in row]


def the_map(given):
    """Worst of the velocities of each (shape, mass ratio, restitution, ratio)."""
    known, keep = {}, given.keep
    if keep and keep.exists():
        with keep.open("rb") as file:
            known = pickle.load(file)
    for labels in itertools.product(x.SHAPES, x.POWERS, x.RESTITUTION, x.RATIOS):
        worst = np.zeros(3)
        events, compared, faulty, unfinished = 0, 0, 0, 0
        for velocities in x.VELOCITIES:
            point = (*labels, velocities)
            problem = x.map_case(*point)
            trace, finished = problem.attempt()
            unfinished += not finished
            faulty += bool(x.faults(trace, finished))
            events = max(events, len(trace.events))
            if not finished:
                continue
            if point not in known:
                known[point] = x.truth(problem, trace)
            if known[point] is not None:
                compared += 1
                worst = np.fmax(worst, x.compare(trace, known[point]))
        yield (*labels, *map(float, worst), events, compared, faulty, unfinished)
    if keep:
        with keep.open("wb") as file:
            pickle.dump(known, file)


def growth(_):
    sizes = (3, 5, 10, 15, 20, 25, 30, 35, 40, 50, 60, 80)
    for spread, e, size, n in itertools.product((0.0, 0.1), (0.9, 0.97, 1.0), (1e-12, 1e-9), sizes):
        change, leading = x.perturbed(spread, n, e, size)
        yield spread, e, size, n, float(np.median(change)), float(change.max()), int(leading.min())


def unequal(_):
    cases = itertools.product(x.UNEQUAL, (20, 40, 80), (0.1, 0.2, 0.3, 0.45))
    for family, n, ratio in cases:
        change = x.unequal_jumps(family, n, ratio)
        yield (
            family,
            n,
            ratio,
            *map(float, np.nanquantile(change, [0, 0.5, 1])),
            int(sum(change > 1e-6)),
            int(sum(np.isnan(change))),
        )


def each_input():
    """Yield the inputs of the ten chains of the paper's test."""
    for name in paper_sequences():
        chain, model = paper_chain(name, excess="saturate")
        own = chain.masses, chain.velocities, chain.restitution
        problem = x.case(*own, model.forward, model.backward)
        for part, k, scale in x.inputs(problem):
            yield name, problem, part, k, scale


def edges(_):
    for name, problem, part, k, scale in each_input():
        for side in (-1, 1):
            distance, jump = x.nearest_edge(problem, part, k, side, scale)
            yield name, part, k, side, distance, jump


def jumps(_):
    for name, problem, part, k, scale in each_input():
        for change, jump in x.jumps(problem, part, k, scale):
            yield name, part, k, change, jump


def elastic(_):
    for quarters, ratio in itertools.product(range(41), (0.0, 0.15)):
        light = power_of_ten(-quarters)
        problem = x.case([1, light, 1], [1, 0, 0], 1, ratio)
        trace, finished = problem.attempt(5_000_000)
        assert finished
        defects = x.invariants(trace)
        theory = math.pi * math.sqrt((1 - ratio) / (2 * light))
        error = condition = own = math.nan
        if ratio == 0:
            with mpmath.workdps(50):
                theory, *known = x.elastic_impacts(light)
                error, condition, own = x.compare(trace, known)
        yield (quarters / 4, ratio, int(trace.collisions.sum()), theory, error,
               condition, own, max(defects["gain"], 0.0), int(trace.collapsed))  # fmt: skip


def limits(_):
    """Yield edges between finite and infinite sequences, and what both sides cost."""
    restitution = (0.05, 0.1, 0.3, 0.5, 0.7, 0.9, 0.95, 0.99)
    for e, ratio in itertools.product(
        restitution, (0.0, 0.05, 0.15, 0.3)
    ):  # all within 1/3, the bound at high
        at = x.edge(e, ratio)
        theory = x.infinite_below(e) if ratio == 0 else math.nan
        found = [outcomes([1, at * f, 1], [1, 0, 0], e, ratio) for f in (0.5, 0.99, 1.01, 2)]
        yield (e, ratio, at, theory, *(int(f.collisions.sum()) for f in found))


LONG = 50_000
#: How much of the largest closing speed is open in an unfinished chain, at most.
DECIDED = (1e-6, 1e-3, 0.1, 1.0)


def long_or_not(family, decades, index):
    """Return the number of balls of a chain, and what it adds to the columns of `finish`."""
    problem = x.any_chain(family, decades, index)
    collisions, collapsed, unfinished, _ = x.longer_than(problem, LONG)
    left = [False] * (1 + len(DECIDED))
    if unfinished:
        _, _, left[0], still_open = x.longer_than(problem, MAX_EVENTS)
        left[1:] = [left[0] and still_open <= part for part in DECIDED]
    longer = (collisions > 100, collisions > 1000, collisions > 10_000)
    return len(problem.masses), (1, collapsed, *longer, unfinished, *left)


def finish(_):
    """Count by family and number of balls."""
    with ProcessPoolExecutor(mp_context=multiprocessing.get_context("spawn")) as pool:
        for family, decades in x.FAMILIES:
            table = np.zeros((9, 7 + len(DECIDED)), dtype=int)
            chains = partial(long_or_not, family, decades)
            for n, row in pool.map(chains, range(x.CHAINS), chunksize=100):
                table[n] += row
            for n in range(2, 9):
                yield (family, decades, n, *table[n].tolist())


PARTS = {
    "map": (
        the_map,
        "shape power restitution ratio error condition own events compared faulty unfinished",
    ),
    "growth": (growth, "spread restitution size balls median largest leading"),
    "unequal": (unequal, "family balls ratio least median largest jumps unfinished"),
    "edges": (edges, "sequence input index side distance jump"),
    "jumps": (jumps, "sequence input index change jump"),
    "elastic": (elastic, "power ratio impacts theory error condition own gain collapsed"),
    "finish": (
        finish,
        "family decades balls chains collapsed above_100 above_1000 above_10000 unfinished left "
        "open_1e-6 open_1e-3 open_0.1 open_1",
    ),
    "limits": (limits, "restitution ratio edge theory half below above double"),
}


def main():
    parser = options(__doc__)
    parser.add_argument("parts", nargs="*", default=list(PARTS), choices=[*PARTS, []])
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    for part in given.parts or PARTS:
        rows, header = PARTS[part]
        lines = map(written, rows(given))
        write(f"extremes_{part}.csv", header.split(), lines, given.output)


if __name__ == "__main__":
    main()
