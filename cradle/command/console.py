"""What the command line shows: tables as text, CSV or JSON, and figures in files."""

from __future__ import annotations

import csv
import io
import json
import math
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click


def format_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of `show`."""
    command = click.option("--csv", "as_csv", is_flag=True, help="Print the table as CSV.")(command)
    return click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")(
        command
    )


def show(
    rows: Sequence[dict[str, Any]], extra: dict[str, Any], note: str, as_json: bool, as_csv: bool,
    names: Sequence[str] = (),
) -> None:  # fmt: skip
    """Print a table, as text with a note, as CSV, or as JSON with all there is."""
    names = names or list(rows[0])
    if as_json and as_csv:
        raise click.UsageError("give one of --json and --csv")
    if as_json:
        click.echo(json.dumps({"rows": list(rows), **extra}, indent=2))
    elif as_csv:
        table = io.StringIO()
        writer = csv.DictWriter(table, names, lineterminator="\n")
        writer.writeheader()
        writer.writerows({name: _plain(value) for name, value in row.items()} for row in rows)
        click.echo(table.getvalue(), nl=False)
    else:
        click.echo(f"{text(rows, names)}\n{note}")


def text(rows: Sequence[dict[str, Any]], names: Sequence[str] = ()) -> str:
    """Return rows as a table of text; its columns are those of the first row, if not `names`."""
    names = names or list(rows[0])
    columns = [_texts([row[name] for row in rows]) for name in names]
    table = [list(names), *map(list, zip(*columns, strict=True))]
    widths = [max(len(line[k]) for line in table) for k in range(len(table[0]))]
    return "\n".join(
        "  ".join(word.rjust(width) for word, width in zip(line, widths, strict=True)).rstrip()
        for line in table
    )


def _texts(column: Sequence[Any]) -> list[str]:
    """Return a column as text; four decimals or more, as show four digits of its largest float."""
    if column and isinstance(column[0], tuple):
        # Unions of intervals: two digits of the narrowest one can be told apart.
        widths = [high - low for pieces in column for low, high in pieces if high > low]
        decimals = min(12, max(4, 1 - math.floor(math.log10(min(widths, default=1.0)))))
        return [
            " or ".join(f"{low:.{decimals}f}-{high:.{decimals}f}" for low, high in pieces)
            for pieces in column
        ]
    floats = [abs(value) for value in column if isinstance(value, float) and math.isfinite(value)]
    largest = max(floats, default=0.0) or 1.0
    decimals = max(4, 3 - math.floor(math.log10(largest)))

    def cell(value: Any) -> str:
        if value is None:
            return "-"
        if isinstance(value, bool):
            return "yes" if value else "no"
        if not isinstance(value, float):
            return str(value)
        if decimals > 8 or largest >= 1e8:
            return f"{value:.4g}"
        return f"{value:z.{decimals}f}"

    return [cell(value) for value in column]


def _plain(value: Any) -> Any:
    """Return a value for a cell of CSV; a union of intervals as `0.1..0.2; 0.5..0.6`."""
    if not isinstance(value, tuple):
        return value
    return "; ".join(f"{low!r}..{high!r}" for low, high in value)


def picture(_: click.Context, __: click.Parameter, path: str | None) -> str | None:
    """Return where to draw; the sign for standard output is the name of no file."""
    if path == "-":
        raise click.BadParameter("'-'; a picture goes to a file: give its name")
    return path


def image_format(path: str) -> str:
    """Return the format of a picture by the ending of its file; without one matplotlib adds one."""
    return Path(path).suffix[1:] or "png"


@contextmanager
def waiting(hint: str, after: float = 2.0) -> Iterator[None]:
    """Say after some seconds that work goes on, and what would be faster; count the time."""
    done = threading.Event()

    def tell() -> None:
        if done.wait(after):
            return
        from cradle.progress import progress_bar

        click.echo(f"cradle: still working; {hint}", err=True)
        with progress_bar(bar_format="{elapsed}", disable=None) as bar:
            while not done.wait(0.5):
                bar.refresh()

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        done.set()
        teller.join()


def plot_fits(fits: Sequence[Any], path: str) -> None:
    """Draw every identified estimate to a file."""
    from matplotlib.figure import Figure

    drawn = [(one, name) for one in fits for name, e in one.estimates.items() if e.identified]
    if not drawn:
        raise ValueError("nothing was identified; there is nothing to draw")
    figure = Figure((9, 3.9 * len(drawn)), layout="constrained")
    for (one, name), row in zip(drawn, figure.subplots(len(drawn), 2, squeeze=False), strict=True):
        one.plot(name, row)
    figure.savefig(path, format=image_format(path))
