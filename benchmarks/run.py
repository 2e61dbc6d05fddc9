"""Measure speed against accuracy: all models, two fixed-step schemes, today's physics engines.

Usage::

    python benchmarks/run.py             # two to five minutes; writes data/benchmarks.csv
    python benchmarks/run.py --quick     # half a minute; prints only, unless --output is given

Every time stands beside that of one reference impact, taken at the same moment: read the ratios.
Numerical errors and errors of a model are separate columns. Engines that are not installed
(``pip install -e ".[engines]"``) are skipped and named; their old rows are not kept.
"""

import argparse
import csv
import sys
import time
from pathlib import Path

import engines
import savings
import solvers
from measure import COLUMNS, REFERENCE, Clock, absent

DATA = Path(__file__).parents[1] / "data" / "benchmarks.csv"


def write(rows, path):
    """Write rows as CSV."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(row.as_text() for row in rows)


def show(row):
    """Print the little that fits on a line."""
    error = row.numerical_error if row.numerical_error != "" else row.model_error
    error = f"{error:9.1e}" if error != "" else " " * 9
    time_ratio = f"{row.time_ratio:11.3g}" if row.time_ratio != "" else " " * 11
    name = f"{row.group}: {row.model}, {row.setting}, {row.chain}"
    print(f"{name:95.95} {time_ratio} {error}", flush=True)


def main(arguments=None):
    """Run the suite."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer settings and repetitions")
    parser.add_argument(
        "--output", type=Path, help="where to write; data/benchmarks.csv unless quick"
    )
    options = parser.parse_args(arguments)
    clock = Clock(repeats=3 if options.quick else 9)
    output = options.output or (None if options.quick else DATA)
    begin = time.perf_counter()
    print(f"times over: {REFERENCE}")
    rows = []
    for part in (solvers.rows, savings.rows, engines.rows):
        for row in part(clock, options.quick):
            show(row)
            rows.append(row)
    unit = 1e6 * clock.unit()
    for row in rows:
        if row.time_ratio != "":
            row.microseconds = unit * row.time_ratio
    for name, reason in absent(engines.ENGINES).items():
        print(f"skipped {name}: {reason}")
    if output:
        write(rows, output)
        print(f"{len(rows)} rows in {output}")
    print(f"{time.perf_counter() - begin:.0f} s", file=sys.stderr)
    return rows


if __name__ == "__main__":
    main()
