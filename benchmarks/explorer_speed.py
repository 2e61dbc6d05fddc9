"""How fast the live explorer's script is, beside the package itself, as a CSV.

Usage::

    python benchmarks/explorer_speed.py             # some minutes; writes data/explorer_speed.csv

The task is the page's own: the outcome of the first hit for every ratio from 0 to 1, of five equal
balls with e = 0.9. Times are processor times. Each is the least of several, taken in turn, and
divided by that of the compiled package with its path.
"""

import argparse
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from importlib import metadata
from pathlib import Path

from stored import DATA, options, write

sys.path.insert(0, str(DATA.parent / "book" / "_ext"))
COLUMNS = ("runtime", "record", "microseconds", "time_ratio", "repeats", "versions")

BALLS, RESTITUTION = 5, 0.9
RATIOS = [k / 1000 for k in range(1001)]
REPEATS = 3
WARM_UP = 10
PATH, OUTCOME, BATCH = "path", "outcome", "batch"

TASK = json.dumps({"balls": BALLS, "restitution": RESTITUTION, "ratios": RATIOS})

# Seconds of processor time for all ratios, in V8; the first few times it still compiles.
IN_SCRIPT = """({ balls, restitution, ratios }, record, seconds) => {
  const ask = record ? cradle.collide : cradle.outcome;
  const masses = Array(balls).fill(1);
  const velocities = masses.map((_, ball) => (ball ? 0 : 1));
  const sweep = () => {
    for (const forward of ratios) ask({ masses, velocities, restitution, forward });
  };
  if (!seconds) return sweep();
  for (let k = 0; k < %d; k += 1) sweep();
  const begun = seconds();
  sweep();
  return seconds() - begun;
}""".replace("%d", str(WARM_UP))


def in_package(how):
    """Return the seconds that the package needs, compiled or plain as `CRADLE_KERNEL` says."""
    from cradle import Chain, ImpulseCorrelation, collide, post_impact_velocities

    ratios = [[ratio] * (BALLS - 2) for ratio in RATIOS]
    masses, velocities = [1] * BALLS, [1] + [0] * (BALLS - 1)

    def sweep():
        if how == BATCH:
            post_impact_velocities(masses, velocities, RESTITUTION, ratios, excess="saturate")
            return
        for ratio in RATIOS:
            model = ImpulseCorrelation(ratio, excess="saturate")
            collide(Chain(masses, velocities, RESTITUTION), model, record=how == PATH)

    sweep()
    begun = time.process_time()
    sweep()
    return time.process_time() - begun


def in_mini_racer(record):
    """Return the seconds that V8 needs inside Python."""
    from explorer_engine import engine
    from py_mini_racer import MiniRacer

    context = MiniRacer()
    context.eval(engine())
    code = f"({IN_SCRIPT})({TASK}, {json.dumps(record)})"
    for _ in range(WARM_UP):
        context.eval(code)
    begun = time.process_time()
    context.eval(code)
    spent = time.process_time() - begun
    context.close()
    return spent


def in_node(record):
    """Return the seconds that Node.js needs."""
    from explorer_engine import engine

    clock = "() => { const used = process.cpuUsage(); return (used.user + used.system) / 1e6; }"
    code = f"{engine()}\nconsole.log(({IN_SCRIPT})({TASK}, {json.dumps(record)}, {clock}));"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "speed.js")
        path.write_text(code, encoding="utf-8")
        return float(subprocess.check_output(["node", path], text=True))


def in_process(kernel, how):
    """Return the seconds of the package in a process of its own."""
    answer = subprocess.check_output(
        [sys.executable, __file__, "--package", how],
        env={**os.environ, "CRADLE_KERNEL": kernel},
        text=True,
    )
    return float(answer)


def tasks():
    """Yield runtime, whether with a record, versions, and what takes the time."""
    python = f"{platform.python_implementation()} {platform.python_version()}"
    numba = f"{python}, numba {metadata.version('numba')}"
    racer = f"mini-racer {metadata.version('mini-racer')}"
    for record, how in ((True, PATH), (False, OUTCOME)):
        yield "Python, compiled", record, numba, lambda h=how: in_process("compiled", h)
        yield "Python, plain", record, python, lambda h=how: in_process("plain", h)
        yield "V8 in pytest", record, racer, lambda r=record: in_mini_racer(r)
        if shutil.which("node"):
            version = subprocess.check_output(["node", "--version"], text=True).strip()
            yield "V8 in Node.js", record, f"Node.js {version}", lambda r=record: in_node(r)
    yield "Python, compiled, in a batch", False, numba, lambda: in_process("compiled", BATCH)


def main():
    """Measure and write."""
    parser = options(__doc__)
    parser.add_argument("--package", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.package is not None:
        print(in_package(given.package))
        return
    every = list(tasks())
    spent = [[] for _ in every]
    for _ in range(REPEATS):
        for seconds, task in zip(spent, every, strict=True):
            seconds.append(task[3]())
    least = [min(seconds) / len(RATIOS) * 1e6 for seconds in spent]
    rows = [
        (name, int(record), f"{each:.3g}", f"{each / least[0]:.3g}", REPEATS, versions)
        for (name, record, versions, _), each in zip(every, least, strict=True)
    ]
    write("explorer_speed.csv", COLUMNS, rows, given.output)


if __name__ == "__main__":
    main()
