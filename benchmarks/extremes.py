"""Maps of the chapter on extremes: errors, edges, long and infinite sequences.

Writes `data/extremes_*.csv` in half an hour; `data/README.md` says what each row is.
"""

import math
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import product

import extreme_chains as x
import mpmath
import numpy as np
import pandas as pd
from chains import power_of_ten
from stored import make

from cradle import outcomes
from cradle.models.correlation import MAX_EVENTS
from cradle.tables import paper_sequences


def extremes_map():
    """Yield the worst of the velocities of each (shape, mass ratio, restitution, ratio)."""
    yield "shape power restitution ratio error condition own events compared faulty unfinished"
    for labels in product(x.SHAPES, x.POWERS, x.RESTITUTION, x.RATIOS):
        worst = np.zeros(3)
        events, compared, faulty, unfinished = 0, 0, 0, 0
        for velocities in x.VELOCITIES:
            problem = x.map_case(*labels, velocities)
            trace, finished = problem.attempt()
            unfinished += not finished
            faulty += bool(x.faults(trace, finished))
            events = max(events, len(trace.events))
            if finished and (known := x.truth(problem, trace)):
                compared += 1
                worst = np.fmax(worst, x.compare(trace, known))
        yield (*labels, *map(float, worst), events, compared, faulty, unfinished)


def extremes_growth():
    yield "spread restitution size balls median largest leading"
    sizes = (3, 5, 10, 15, 20, 25, 30, 35, 40, 50, 60, 80)
    for case in product((0.0, 0.1), (0.9, 0.97, 1.0), (1e-12, 1e-9), sizes):
        spread, e, size, n = case
        change, leading = x.perturbed(spread, n, e, size)
        yield *case, float(np.median(change)), float(change.max()), int(leading.min())


def extremes_unequal():
    yield "family balls ratio least median largest jumps unfinished"
    for case in product(x.UNEQUAL, (20, 40, 80), (0.1, 0.2, 0.3, 0.45)):
        change = x.unequal_jumps(*case)
        counts = int(sum(change > 1e-6)), int(sum(np.isnan(change)))
        yield *case, *map(float, np.nanquantile(change, [0, 0.5, 1])), *counts


def extremes_shortest():
    """Yield the shortest row that jumps, and largest changes, of equal and of unequal balls."""
    yield "spread restitution ratio balls short largest last"
    ratios = 0, 1, 2, 4, 6, 8, 10, 12, 15, 20, 30, 40  # in hundredths
    for spread, step in ((0.0, 2), (0.1, 10)):
        cases = [*product(range(40, 101, step), ratios)]
        e, ratio = np.array(cases).T / 100
        found = [x.changes_of_rows(spread, n, e, ratio) for n in range(3, 21)]
        any_ball, last_ball = np.swapaxes(found, 0, 1)
        jumps = any_ball > 1e-6
        least = np.where(jumps.any(axis=0), 3 + jumps.argmax(axis=0), 0)
        largest = (part.max(axis=0) for part in (any_ball[:5], any_ball, last_ball))
        columns = (column.tolist() for column in (e, ratio, least, *largest))
        yield from ((spread, *row) for row in zip(*columns, strict=True))


def each_input():
    """Yield the inputs of the ten chains of the paper's test."""
    for name in paper_sequences():
        problem = x.sequence(name)
        for part, k, scale in x.inputs(problem):
            yield name, problem, part, k, scale


def extremes_edges():
    yield "sequence input index side distance jump"
    for (name, problem, part, k, scale), side in product(each_input(), (-1, 1)):
        yield name, part, k, side, *x.nearest_edge(problem, part, k, side, scale)


def extremes_jumps():
    yield "sequence input index change jump"
    for name, problem, part, k, scale in each_input():
        for change, jump in x.jumps(problem, part, k, scale):
            yield name, part, k, change, jump


def extremes_elastic():
    """Yield the impacts of a light ball between two others, without losses."""
    yield "power ratio impacts theory error condition own gain collapsed"
    for quarters, ratio in product(range(41), (0.0, 0.15)):
        light = power_of_ten(-quarters)
        problem = x.case([1, light, 1], [1, 0, 0], 1, ratio)
        trace, finished = problem.attempt(5_000_000)
        assert finished
        gain = max(x.invariants(trace)["gain"], 0.0)
        theory, measured = math.pi * math.sqrt((1 - ratio) / (2 * light)), [math.nan] * 3
        if ratio == 0:
            with mpmath.workdps(50):
                theory, *known = x.elastic_impacts(light)
                measured = x.compare(trace, known)
        impacts = int(trace.collisions.sum())
        yield quarters / 4, ratio, impacts, theory, *measured, gain, int(trace.collapsed)


def extremes_limits():
    """Yield edges between finite and infinite sequences, and what both sides cost."""
    yield "restitution ratio edge theory half below above double"
    restitution = (0.05, 0.1, 0.3, 0.5, 0.7, 0.9, 0.95, 0.99)
    # All ratios are within 1/3, the bound of the heaviest middle ball of the search.
    for e, ratio in product(restitution, (0.0, 0.05, 0.15, 0.3)):
        at = x.edge(e, ratio)
        theory = x.infinite_below(e) if ratio == 0 else math.nan
        found = [outcomes([1, at * f, 1], [1, 0, 0], e, ratio) for f in (0.5, 0.99, 1.01, 2)]
        yield (e, ratio, at, theory, *(int(f.collisions.sum()) for f in found))


LONG = 50_000
DECIDED = (1e-6, 1e-3, 0.1, 1.0)  # parts of the largest closing speed that may still be open


def long_or_not(family, decades, index):
    """Return the number of balls of a chain, and what it adds to each count."""
    problem = x.any_chain(family, decades, index)
    collisions, collapsed, unfinished, _ = x.longer_than(problem, LONG)
    left = [False] * (1 + len(DECIDED))
    if unfinished:
        _, _, left[0], still_open = x.longer_than(problem, MAX_EVENTS)
        left[1:] = [left[0] and still_open <= part for part in DECIDED]
    longer = (collisions > 100, collisions > 1000, collisions > 10_000)
    return len(problem.masses), 1, collapsed, *longer, unfinished, *left


def extremes_finish():
    yield (
        "family decades balls chains collapsed above_100 above_1000 above_10000 unfinished left "
        "open_1e-6 open_1e-3 open_0.1 open_1"
    )
    with ProcessPoolExecutor(mp_context=multiprocessing.get_context("spawn")) as pool:
        for family, decades in x.FAMILIES:
            chains = partial(long_or_not, family, decades)
            rows = pd.DataFrame(pool.map(chains, range(x.CHAINS), chunksize=100))
            counts = rows.groupby(0).sum()
            yield from ((family, decades, *row) for row in counts.itertuples())


if __name__ == "__main__":
    make(__doc__, *(rows for name, rows in vars().copy().items() if name.startswith("extremes_")))
