"""Random inputs, and the solver's answers to them, have the same bits on every machine.

`PYTHONPATH=benchmarks python tests/test_portable.py` prints what `DIGESTS` holds, for a change of
the inputs or of the rounding of the solver that is meant.
"""

import hashlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import extreme_chains as x
import implied_ratio
import long_chains
import numpy as np
import pytest
import scenes
import test_closed_form
import test_kernel
import test_speed
from chains import magnitudes, power_of_ten, random_chains, uniform

from cradle import post_impact_velocities

ROOT = Path(__file__).parents[1]

DIGESTS = {
    "magnitudes": "f4212c360ee85056",
    "uniform": "22a6fdfdcf6de7b0",
    "power_of_ten": "cdf9f01391b58cf5",
    "random_chains": "6fb295d85680ac11",
    "any_chain": "87dfa8052a172419",
    "map_case": "bbd9219024af0b70",
    "rows_of_balls": "c612d597425685ea",
    "mixed_chains": "c66e75d3b56d4584",
    "batches": "555f86c323e3f8a1",
    "closed form": "7d3aac996dcd8716",
    "scenes": "13088f12c81b4e35",
    "long_chains": "eef8777637e3f854",
    "implied_ratio": "617f9eed01d94458",
    "batch": "086260db1d0ed7a7",
    "one by one": "41e58e3715381950",
}


def inputs():
    """Yield (generator, what it made) for every generator of random inputs."""
    rng = np.random.default_rng(1)
    for decades in (0.5, 1, 2, 3, 6):
        yield "magnitudes", magnitudes(rng, decades, 1000)
    for low, high in ((-1, 1), (0.3, 1.7), (0.02, 0.98)):
        yield "uniform", uniform(rng, low, high, 1000)
    yield "power_of_ten", [power_of_ten(quarters) for quarters in range(-1200, 1200)]
    for n in range(2, 9):
        for part in random_chains(rng, 300, n):
            yield "random_chains", part
    for family, decades in x.FAMILIES:
        for index in range(100):
            for part in x.any_chain(family, decades, index):
                yield "any_chain", part
    for shape in x.SHAPES:
        for power in x.POWERS:
            for ratio in x.RATIOS:
                for part in x.map_case(shape, power, 0.3, ratio, "row"):
                    yield "map_case", part
    for spread, e in ((0.0, 0.9), (0.1, 1.0)):
        for part in (*x.rows_of_balls(spread, 30, e, 1e-9), *x.rows_of_balls(spread, 3, e, 1e-12)):
            yield "rows_of_balls", np.concatenate([each.ravel() for each in part])
    for chain, _ in test_kernel.mixed_chains(2, 70):
        for part in chain:
            yield "mixed_chains", part
    for part in (*test_speed.mixed_batch(500), *test_speed.batch_of_three(50, 50)):
        yield "batches", part
    for part in test_closed_form.random_three_balls(5, 500):
        yield "closed form", part
    for part in scenes.random_chains(5, 500):
        yield "scenes", part
    for part in long_chains.copies(0.9, 200):
        yield "long_chains", part
    yield "implied_ratio", implied_ratio.STIFFNESS_RATIOS


def answers():
    """Yield ("batch" or "one by one", what the solver answers)."""
    rng = np.random.default_rng(2)
    for n in range(2, 9):
        yield "batch", post_impact_velocities(*random_chains(rng, 30, n, decades=2))
    for family, decades in x.FAMILIES:
        for index in range(25):
            trace, _ = x.any_chain(family, decades, index).attempt(500)
            for name in ("path", "path_impulses", "absorbed", "collisions"):
                yield "one by one", getattr(trace, name)


def digests():
    """Return a digest by name."""
    found = {}
    for part in (inputs(), answers()):
        for name, numbers in part:
            array = np.asarray(numbers, dtype="<f8")
            found.setdefault(name, hashlib.sha256()).update(array.tobytes())
    return {name: digest.hexdigest()[:16] for name, digest in found.items()}


@pytest.fixture(scope="module")
def without_vector_code():
    """Return the same from a process without vector code in NumPy, C library and solver."""
    found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    # Two names each: they changed in version 2.33 of the library.
    units = [unit for name in ("AVX512F", "AVX2", "FMA") for unit in (name, f"{name}_Usable")]
    path = str(ROOT / "benchmarks"), os.environ.get("PYTHONPATH")
    environment = {
        **os.environ,
        "NPY_DISABLE_CPU_FEATURES": " ".join(found),
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=" + ",".join(f"-{unit}" for unit in units),
        "CRADLE_KERNEL": "plain",
        "PYTHONPATH": os.pathsep.join(filter(None, path)),
    }
    run = subprocess.run(
        [sys.executable, __file__], env=environment, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def test_same_bits_as_on_every_other_machine():
    assert digests() == DIGESTS


def test_same_bits_without_vector_code(without_vector_code):
    assert without_vector_code == DIGESTS


#: Draws that a compiler, a vector unit or a C library may round in its own way.
UNEVEN = re.compile(
    r"rng\.(?:uniform|normal|standard_normal|exponential|lognormal)\("
    r"|(?:\b10(?:\.0)? ?\*\* ?|np\.(?:exp|power|sin|cos|log\w*)\()\(?(?:rng\.|uniform\(rng)"
)


def test_no_draw_rounds_unevenly():
    files = [*(ROOT / "tests").glob("*.py"), *(ROOT / "benchmarks").glob("*.py")]
    found = [
        f"{path.name}: {match[0]}"
        for path in files
        for match in UNEVEN.finditer(path.read_text(encoding="utf-8"))
    ]
    assert found == []


if __name__ == "__main__":
    print(json.dumps(digests(), indent=4))
