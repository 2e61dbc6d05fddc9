"""What the command line shows: tables as text, CSV or JSON, and figures in files."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from typing import Any

import click


def show(
    rows: Sequence[dict[str, Any]], extra: dict[str, Any], note: str, as_json: bool, as_csv: bool
) -> None:
    """Print a table, as text with a note, as CSV, or as JSON with all there is."""
    if as_json and as_csv:
        raise click.UsageError("give one of --json and --csv")
    if as_json:
        click.echo(json.dumps({"rows": list(rows), **extra}, indent=2))
    elif as_csv:
        table = io.StringIO()
        writer = csv.DictWriter(table, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        click.echo(table.getvalue(), nl=False)
    else:
        click.echo(f"{text(rows)}\n{note}")


def text(rows: Sequence[dict[str, Any]]) -> str:
    """Return rows as a table of text."""
    columns = [_cells([row[name] for row in rows]) for name in rows[0]]
    table = [list(rows[0]), *map(list, zip(*columns, strict=True))]
    widths = [max(len(line[k]) for line in table) for k in range(len(table[0]))]
    return "\n".join(
        "  ".join(word.rjust(width) for word, width in zip(line, widths, strict=True)).rstrip()
        for line in table
    )


def _cells(column: Sequence[Any]) -> list[str]:
    """Return a column as text; its floats have as many decimals as show four digits of the largest.

    Four at least, for people compare columns; and never minus zero.
    """
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


def plot_fits(fits: Sequence[Any], path: str) -> None:
    """Draw every identified estimate to a file."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    drawn = [(one, name) for one in fits for name, e in one.estimates.items() if e.identified]
    if not drawn:
        raise ValueError("nothing was identified; there is nothing to draw")
    figure, axes = plt.subplots(len(drawn), 2, figsize=(9, 3.9 * len(drawn)), squeeze=False,
                                layout="constrained")  # fmt: skip
    for (one, name), row in zip(drawn, axes, strict=True):
        one.plot(name, row)
    figure.savefig(path)
    plt.close(figure)
