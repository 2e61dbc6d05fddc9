"""Where the time of the paper's rule goes in a batch: what is saved without each part of it.

Writes `data/parts.csv` in some minutes, most of which compile the event loop: as it is, and with a
few functions that do the least that lets the others run.
"""

import ast
import time
from functools import partial
from unittest import mock

import numpy as np
from measure import distance
from scenes import SCENES, random_chains
from stored import make

from cradle import ImpactNotCertified, post_impact_velocities
from cradle.kernel import EVENT_LOOP
from cradle.runtime import compile as runtime

#: The part, and the bodies of its functions without it.
WITHOUT = {
    "checks of the input": {"admissible": "return True"},
    "certificate": {"certify": "return 0"},
    "record of events": {"record": "return", "record_compressions": "return"},
    "numbers of 32 digits": {
        "pair": "return complex(high + low, 0.0)",
        "sum_of": "return complex(x + y, 0.0)",
        "product_of": "return complex(x * y, 0.0)",
        "over": "return complex(a.real / b.real, 0.0)",
        "root": "return complex(math.sqrt(max(a.real, 0.0)), 0.0)",
        "read": "return complex(x, 0.0)",
    },
}
COUNT = 200  # chains of a batch, on one thread: less than a millisecond


def source(bodies):
    """Return the event loop with other bodies of these functions."""
    tree = ast.parse(runtime.unit(EVENT_LOOP))
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and node.name in bodies:
            node.body = ast.parse(bodies[node.name]).body
    return ast.unparse(tree) + "\n"


def kernel(bodies):
    text = source(bodies)
    runtime._stored.cache_clear()
    with mock.patch.object(runtime, "unit", return_value=text):
        module = runtime.compiled.__wrapped__()
    runtime._stored.cache_clear()
    return module


def solved(module, chains):
    """Return velocities by an event loop, and how long it took."""
    with mock.patch.object(runtime, "chosen", return_value=module):
        begun = time.perf_counter()
        after = post_impact_velocities(*chains, excess="saturate")
        return after, time.perf_counter() - begun


def batches():
    for name in ("three equal", "five equal"):
        yield name, [np.tile(part, (COUNT, 1)) for part in SCENES[name].given]
    for balls in (3, 5):
        yield f"{balls} balls, random", random_chains(balls, COUNT)


def parts(repeats=1500):
    """Yield the table; a batch of which some are refused without a part has no numbers."""
    yield "chain part saved difference"
    whole = kernel({})
    for part, bodies in WITHOUT.items():
        less = kernel(bodies)
        for name, chains in batches():
            ways = [partial(solved, module, chains) for module in (whole, less)]
            try:
                exact, other = (way()[0] for way in ways)
            except ImpactNotCertified:
                yield name, part, "", ""
                continue
            times = np.array([[way()[1] for way in ways] for _ in range(repeats)])
            full, rest = times.reshape(-1, 50, 2).min(axis=1).T  # of fifty in a row the least
            saved = round(1 - np.median(rest / full), 2) + 0.0  # no -0
            yield name, part, f"{saved:.2f}", distance(exact, other)


if __name__ == "__main__":
    make(__doc__, parts, digits=2)
