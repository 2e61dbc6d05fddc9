"""Measure speed against accuracy: all models, a fixed-step scheme, today's physics engines.

Writes `data/benchmarks.csv` in some minutes; `--quick` prints alone, in half a minute.
Engines that are not installed are skipped and named; their old rows are not kept.
"""

import engines
import savings
import solvers
from measure import COLUMNS, REFERENCE, Clock, absent
from stored import DATA, options, text, write


def main(arguments=None):
    parser = options(__doc__)
    parser.set_defaults(output=None)
    parser.add_argument("--quick", action="store_true", help="fewer settings and repetitions")
    given = parser.parse_args(arguments)
    clock = Clock(repeats=3 if given.quick else 9)
    folder = given.output or (None if given.quick else DATA)
    print(f"times over: {REFERENCE}")
    rows = []
    for part in (solvers.rows, savings.rows, engines.rows):
        for row in part(clock, given.quick):
            name = f"{row.group}: {row.model}, {row.setting}, {row.chain}"
            errors = row.numerical_error, row.model_error
            print(f"{name:95.95}", *map(text, (row.time_ratio, *errors)), flush=True)
            rows.append(row)
    unit = 1e6 * clock.unit()
    for row in rows:
        if row.time_ratio != "":
            row.microseconds = unit * row.time_ratio
    for name, reason in absent(engines.ENGINES).items():
        print(f"skipped {name}: {reason}")
    if folder:
        lines = (map(text, vars(row).values()) for row in rows)
        write("benchmarks.csv", COLUMNS, lines, folder)


if __name__ == "__main__":
    main()
