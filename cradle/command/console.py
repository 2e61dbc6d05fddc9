"""What the command line shows: tables as text, CSV or JSON, and figures in files."""

import csv
import json
import math
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click


def format_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of `show`, of which one may be given."""

    def alone(context: click.Context, _: click.Parameter, given: bool) -> bool:
        if given and (context.params.get("as_csv") or context.params.get("as_json")):
            raise click.UsageError("give one of --json and --csv")  # before any work
        return given

    flag = partial(click.option, is_flag=True, callback=alone)
    as_csv = flag("--csv", "as_csv", help="Print the table as CSV.")
    return flag("--json", "as_json", help="Print everything as JSON.")(as_csv(command))


def show(
    rows: Sequence[dict[str, Any]], extra: dict[str, Any], note: str, as_json: bool, as_csv: bool,
    names: Sequence[str] = (),
) -> None:  # fmt: skip
    """Print a table, as text with a note, as CSV, or as JSON with all there is."""
    names = names or list(rows[0])
    if as_json:
        click.echo(json.dumps({"rows": list(rows), **extra}, indent=2))
    elif as_csv:
        cells = ([_plain(row[name]) for name in names] for row in rows)
        csv.writer(sys.stdout, lineterminator="\n").writerows([names, *cells])
    else:
        click.echo(f"{text(rows, names)}\n{note}")


def text(rows: Sequence[dict[str, Any]], names: Sequence[str] = ()) -> str:
    """Return rows as a table of text; its columns are those of the first row, if not `names`."""
    columns = [[name, *_texts([row[name] for row in rows])] for name in names or rows[0]]
    widths = [max(map(len, column)) for column in columns]
    lines = (map(str.rjust, line, widths) for line in zip(*columns, strict=True))
    return "\n".join("  ".join(line).rstrip() for line in lines)


def _texts(column: Sequence[Any]) -> list[str]:
    """Return a column as text; four decimals or more, as show four digits of its largest float."""
    if column and isinstance(column[0], tuple):
        # Unions of intervals: two digits of the narrowest one can be told apart.
        widths = [high - low for pieces in column for low, high in pieces if high > low]
        decimals = min(12, max(4, 1 - math.floor(math.log10(min(widths, default=1.0)))))
        return [" or ".join(f"{low:.{decimals}f}-{high:.{decimals}f}" for low, high in pieces)
                for pieces in column]  # fmt: skip
    floats = [abs(value) for value in column if isinstance(value, float) and math.isfinite(value)]
    largest = max(floats, default=0.0) or 1.0
    decimals = max(4, 3 - math.floor(math.log10(largest)))
    form = ".4g" if decimals > 8 or largest >= 1e8 else f"z.{decimals}f"
    words = {None: "-", True: "yes", False: "no"}
    return [
        f"{value:{form}}" if isinstance(value, float) else
        words[value] if value is None or isinstance(value, bool) else str(value)
        for value in column
    ]  # fmt: skip


def _plain(value: Any) -> Any:
    """Return a value for a cell of CSV; a union of intervals as `0.1..0.2; 0.5..0.6`."""
    whole = not isinstance(value, tuple)
    return value if whole else "; ".join(f"{low!r}..{high!r}" for low, high in value)


def picture(_: click.Context, __: click.Parameter, path: str | None) -> str | None:
    """Return where to draw; the sign for standard output is the name of no file."""
    if path == "-":
        raise click.BadParameter("'-'; a picture goes to a file: give its name")
    if path and not Path(path).parent.is_dir():
        raise click.BadParameter(f"{path!r}; its folder is not there")
    return path


def plotted(context: click.Context, option: click.Parameter, path: str | None) -> str | None:
    """Return where to draw a figure, whose format is known by the ending."""
    if path := picture(context, option, path):
        from matplotlib.backend_bases import FigureCanvasBase  # what is missing is said before work

        if Path(path).suffix[1:].lower() not in ("", *FigureCanvasBase.filetypes):
            raise click.BadParameter(f"{path!r}; must end in .png, .svg or .pdf")
    return path


def save(path: str, size: tuple[float, float], draw: Callable[[Any], object]) -> None:
    """Save a figure of this size in inches, on which `draw` draws."""
    from matplotlib.figure import Figure

    figure = Figure(size, layout="constrained")
    draw(figure)
    figure.savefig(path, format=Path(path).suffix[1:] or "png")


def plot_fits(fits: Sequence[Any], path: str) -> None:
    """Draw every identified estimate to a file."""
    drawn = [(one, name) for one in fits for name, e in one.estimates.items() if e.identified]
    if not drawn:
        raise ValueError("nothing was identified; there is nothing to draw")

    def draw(figure: Any) -> None:
        rows = figure.subplots(len(drawn), 2, squeeze=False)
        for (one, name), row in zip(drawn, rows, strict=True):
            one.plot(name, row)

    save(path, (9, 3.9 * len(drawn)), draw)
