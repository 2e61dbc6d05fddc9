"""Long chains and large maps: work, speed, and what can be trusted, as a CSV.

Writes `data/long_chains.csv` in three minutes.
"""

import statistics
from functools import partial
from itertools import product

import numpy as np
from measure import cpu, in_turn, quotient
from stored import make

from cradle import Chain, SpringChain, collide, outcomes

COLUMNS = [
    "group", "restitution", "ratio", "exponent", "balls", "chains", "collisions", "collapsed",
    "orders", "kept", "spread", "fast", "fast_least", "fast_most", "back", "first", "third_last",
    "second_last", "last", "cpu_seconds", "time_ratio", "repeats",
]  # fmt: skip
FAST = 0.01  # of the striker's speed: a ball counts as flying off
COPIES, CHANGE = 16, 1e-15  # by up to which part masses and restitutions differ, at random
KEPT = 1e-6  # no copy's velocity differs by more than this part of it
ELASTIC_RATIOS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.45, 0.5)
ELASTIC_BALLS = (100, 300, 1000, 3000, 10_000, 30_000, 100_000)
# Few enough balls that nothing collapses, but for the last ones at .9.
LOSSES = {
    0.9: (10, 20, 30, 40, 50, 60, 100),
    0.99: (10, 20, 30, 40, 60, 80, 120, 160, 240, 320),
    0.999: (20, 40, 80, 160, 320),
}
LOSSES_RATIOS = (0.0, 0.1, 0.3, 0.45)
SPRINGS = dict.fromkeys((1.5, 1.0), (3, 4, 5, 6, 8, 10, 15, 20, 30, 40, 60, 80, 100))
MAP_SIDE = 1000


def still_chain(balls):
    """Return masses and velocities: equal balls, the first at speed 1, the others at rest."""
    return np.ones(balls), np.eye(1, balls)[0]


def cost(function, repeats):
    """Return the fields of a row that tell the processor time of `function`, and of the unit."""
    three_on_springs = partial(collide, Chain(*still_chain(3), 1.0), SpringChain(1.0))
    function()
    calls = max(1, round(0.02 / max(cpu(function), 1e-6)))
    # As many units as outlast the clock's ticks and what the row itself has pushed from the caches.
    clocks = partial(cpu, function, calls), partial(cpu, three_on_springs, 400)
    times, units = in_turn(clocks, repeats)
    return {"units": units, "time_ratio": quotient(times, units), "repeats": repeats}


def leaving(velocities):
    """Return the fields of a row that tell which balls fly off."""
    counts = {"fast": int((velocities > FAST).sum()), "back": int((velocities < -FAST).sum())}
    names = "first", "third_last", "second_last", "last"
    return counts | dict(zip(names, velocities[[0, -3, -2, -1]]))


def solved(group, chain, e, ratio, repeats=9):
    """Return the outcomes, and a row of them."""
    found = (solve := partial(outcomes, *chain, e, ratio))()
    given = {"group": group, "restitution": e, "ratio": ratio, "balls": chain[0].shape[-1]}
    given["collisions"] = int(found.collisions[~found.collapsed].sum())
    given["collapsed"] = int(found.collapsed.sum())
    return found, given | cost(solve, repeats)


def large_map(side):
    """Return a row: collisions of three balls over the mass ratios m2/m1 and m2/m3 of Fig. 6."""
    ratios = (np.arange(side) + 0.5) * 3.0 / side
    masses = np.stack(np.broadcast_arrays(1.0 / ratios[:, None], 1.0, 1.0 / ratios), axis=-1)
    return solved("map", (masses, [1.0, 0.0, 0.0]), 0.5, 0.15)[1] | {"chains": side**2}


def elastic(ratio, balls):
    """Return a row: no losses, so every contact collides once, at any length."""
    repeats = 9 if balls <= 10_000 else 5
    found, row = solved("elastic", still_chain(balls), 1.0, ratio, repeats)
    return row | leaving(found.velocities)


def copies(restitution, balls):
    """Return masses, velocities and restitutions of a chain and of its copies."""
    rng = np.random.default_rng(balls)
    masses, velocities = np.ones((1 + COPIES, balls)), still_chain(balls)[1]
    restitutions = np.full((1 + COPIES, balls - 1), restitution)
    for values in (masses, restitutions):
        values[1:] *= 1.0 + CHANGE * (2.0 * rng.random(values[1:].shape) - 1.0)
    return masses, velocities, restitutions


def losses(restitution, ratio, balls):
    """Return a row: with losses, balls collide again and again, in an order that may be chance."""
    found = outcomes(*copies(restitution, balls), ratio)
    own = found.velocities[0]
    off = np.abs(found.velocities - own).max(axis=0)
    agrees = off <= KEPT * np.abs(own)
    fast = (found.velocities > FAST).sum(axis=-1)
    given = {"group": "losses", "restitution": restitution, "ratio": ratio, "balls": balls}
    counts = {
        "chains": 1 + COPIES,
        # That of the unchanged chain alone is chance where the order is.
        "collisions": int(np.median(found.collisions.sum(axis=-1))),
        "collapsed": int(found.collapsed.sum()),
        "orders": len(np.unique(found.collisions, axis=0)),
        "kept": int(np.argmin([*agrees[::-1], False])),
        "spread": off[-1] / abs(own[-1]),
        "fast_least": int(fast.min()),
        "fast_most": int(fast.max()),
    }
    return given | counts | leaving(own)


def springs(exponent, balls):
    """Return a row: the same chain on springs, without losses."""
    found = collide(Chain(*still_chain(balls), 1.0), SpringChain(1.0, exponent, accuracy=1e-10))
    given = {"group": "springs", "restitution": 1.0, "exponent": exponent, "balls": balls}
    return given | leaving(found.velocities)


def all_rows():
    """Yield all rows, without seconds."""
    yield large_map(MAP_SIDE)
    for ratio, balls in product(ELASTIC_RATIOS, ELASTIC_BALLS):
        yield elastic(ratio, balls)
    for restitution, lengths in LOSSES.items():
        for ratio, balls in product(LOSSES_RATIOS, lengths):
            yield losses(restitution, ratio, balls)
    for exponent, lengths in SPRINGS.items():
        for balls in lengths:
            yield springs(exponent, balls)


def long_chains():
    """Yield all rows, their seconds by the median of all units."""
    found = list(all_rows())
    timed = [row for row in found if "units" in row]
    unit = statistics.median(one for row in timed for one in row.pop("units"))
    for row in timed:
        row["cpu_seconds"] = row["time_ratio"] * unit
    yield COLUMNS
    yield from ([row.get(name, "") for name in COLUMNS] for row in found)


if __name__ == "__main__":
    make(__doc__, long_chains, digits=10)
