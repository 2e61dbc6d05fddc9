"""Tables of measurements; what is wrong with one is named by its line and column."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any


def table_lines(source: Any) -> list[tuple[str, dict[str, Any]]]:
    """Return the rows of a file or of columns by name, each with a name of its place."""
    if isinstance(source, (str, Path)) or hasattr(source, "open"):
        path = Path(source) if isinstance(source, str) else source
        return _file_lines(path.name, path.read_bytes())
    if hasattr(source, "read"):
        return _file_lines(getattr(source, "name", "the file"), source.read())
    if not (isinstance(source, Mapping) or hasattr(source, "columns")):
        raise TypeError(f"source is a {type(source).__name__}; must be a path or a table")
    names = [str(name) for name in source]
    _refuse_repeated(names)
    columns = [list(source[name]) for name in source]
    lengths = {len(values) for values in columns}
    if len(lengths) > 1:
        raise ValueError(f"columns have different lengths: {sorted(lengths)}")
    rows = zip(*columns, strict=True)
    return [(f"row {k}", dict(zip(names, row, strict=True))) for k, row in enumerate(rows, 1)]


def _file_lines(name: str, content: bytes) -> list[tuple[str, dict[str, Any]]]:
    """Return the rows of a CSV file; comments and rows without any cell filled are left out."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(
            f"{name} is no UTF-8 text (byte {error.start}); save it as CSV in UTF-8"
        ) from None
    kept = {
        number: line for number, line in enumerate(re.split("\r\n|\n|\r", text), 1)
        if line.strip(", \t") and not line.lstrip().startswith("#")
    }  # fmt: skip
    first = next(iter(kept.values()), "")
    for mark, word in ((";", "semicolon"), ("\t", "tab")):
        if mark in first and "," not in first:
            if any(re.search(r"\d,\d", line) for line in kept.values()):
                raise ValueError(
                    f"{name} has {word}s between the columns and commas in the decimals; "
                    f"first turn every comma into a point, then every {word} into a comma"
                )
            raise ValueError(f"{name} has {word}s; put commas between the columns")
    header, *rows = list(csv.reader(kept.values())) or [[]]
    header = [name.strip() for name in header]
    _refuse_repeated(header)
    lines = []
    for number, cells in zip(list(kept)[1:], rows, strict=True):
        if len(cells) != len(header):
            raise ValueError(
                f"line {number}: {len(cells)} values; the header has {len(header)} columns "
                "(decimals need a point)"
            )
        lines.append((f"line {number}", dict(zip(header, cells, strict=True))))
    return lines


def _refuse_repeated(names: Sequence[str]) -> None:
    """Refuse a column that is there twice: which one counts is not said."""
    for name in names:
        if name and names.count(name) > 1:  # a spreadsheet may add columns without a name
            raise ValueError(f"column {name!r} is there {names.count(name)} times; keep one")
