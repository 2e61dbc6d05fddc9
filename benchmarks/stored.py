"""The tables of data/: read and written in one way, by scripts that are called in one way."""

import argparse
import csv
from pathlib import Path

DATA = Path(__file__).parents[1] / "data"


def options(document):
    """Return the options that every script has."""
    parser = argparse.ArgumentParser(description=document.splitlines()[0])
    parser.add_argument("--output", type=Path, default=DATA, help="folder of the tables")
    return parser


def read(name, **equal):
    """Return the rows of a table as texts by column: all, or those that have these texts."""
    with (DATA / name).open(encoding="utf-8", newline="") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return [row for row in rows if all(row[key] == text for key, text in equal.items())]


def numbers(name, *labels, **equal):
    """Return the same with numbers as numbers, empty fields as None; the columns `labels` stay."""

    def value(column, text):
        try:
            return text if column in labels else float(text) if text else None
        except ValueError:
            return text

    rows = [{key: value(key, x) for key, x in row.items()} for row in read(name)]
    return [row for row in rows if all(row[key] == given for key, given in equal.items())]


def text(value, digits=4):
    """Return a value as it is stored: floats in so many digits."""
    return f"{value:.{digits}g}" if isinstance(value, float) else value


def write(name, columns, rows, folder=DATA, comment=""):
    """Write rows as they come, and say how many there were; columns may be words in a text."""
    with (folder / name).open("w", encoding="utf-8", newline="") as file:
        file.write(comment)
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns.split() if isinstance(columns, str) else columns)
        count = 0
        for row in rows:
            count += 1
            writer.writerow(row)
            file.flush()
    print(f"{name}: {count} rows", flush=True)


def make(document, *tables, digits=4):
    """Write tables, all or those that are named: functions that give columns, then rows."""
    named = {table.__name__: table for table in tables}
    parser = options(document)
    parser.add_argument("tables", nargs="*", help=f"of {', '.join(named)}; all if none is named")
    given = parser.parse_args()
    for name in given.tables or named:
        rows = iter(named[name]())
        columns = next(rows)
        write(
            f"{name}.csv", columns, ([text(x, digits) for x in row] for row in rows), given.output
        )
