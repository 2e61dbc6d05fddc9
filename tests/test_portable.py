"""Random inputs, and the solver's answers to them, have the same bits on every machine.

`PYTHONPATH=benchmarks python tests/test_portable.py` prints what `DIGESTS` holds, for a change of
the inputs or of the rounding of the solver that is meant.
"""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import extreme_chains as x
import numpy as np
from chains import magnitudes, power_of_ten, random_chains, uniform

from cradle import post_impact_velocities

ROOT = Path(__file__).parents[1]

DIGESTS = {
    "magnitudes": "f4212c360ee85056",
    "uniform": "22a6fdfdcf6de7b0",
    "power_of_ten": "cdf9f01391b58cf5",
    "random_chains": "6fb295d85680ac11",
    "batch": "086260db1d0ed7a7",
    "one by one": "41e58e3715381950",
}


def inputs():
    """Yield (generator, what it made) for the generators that all random inputs are made with."""
    rng = np.random.default_rng(1)
    for decades in (0.5, 1, 2, 3, 6):
        yield "magnitudes", magnitudes(rng, decades, 1000)
    for low, high in ((-1, 1), (0.3, 1.7), (0.02, 0.98)):
        yield "uniform", uniform(rng, low, high, 1000)
    yield "power_of_ten", [power_of_ten(quarters) for quarters in range(-1200, 1200)]
    for n in range(2, 9):
        for part in random_chains(rng, 300, n):
            yield "random_chains", part


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


def test_same_bits_as_on_every_other_machine():
    assert digests() == DIGESTS


def test_same_bits_without_vector_code():
    """In a process without vector code in NumPy, C library and solver."""
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
    assert json.loads(run.stdout) == DIGESTS


if __name__ == "__main__":
    print(json.dumps(digests(), indent=4))
