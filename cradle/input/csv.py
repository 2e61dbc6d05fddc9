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


def text_rows(name: str, content: bytes, comments: bool = False) -> dict[int, list[str]]:
    """Return the cells of each filled line of a text file by its number, as points and ASCII.

    Tabs, semicolons or commas stand between the columns, else spaces; decimals may have commas
    where columns have none.
    """
    try:
        text = content.decode("utf-8-sig").replace("\N{MINUS SIGN}", "-")
    except UnicodeDecodeError as error:
        raise ValueError(
            f"{name} is no UTF-8 text (byte {error.start}); save it as CSV in UTF-8"
        ) from None
    lines = {
        number: line for number, line in enumerate(re.split("\r\n|\n|\r", text), 1)
        if line.strip(",; \t") and (comments or not line.lstrip().startswith("#"))
    }  # fmt: skip
    mark = next((one for one in "\t;," if any(one in line for line in lines.values())), " ")
    if mark != ",":
        comma = next((n for n, line in lines.items() if re.search(r",\d", line)), None)
        point = next((n for n, line in lines.items() if re.search(r"\d\.\d", line)), None)
        if comma and point:
            raise ValueError(
                f"{name} has decimals with a comma in line {comma} and with a point in line "
                f"{point}; write all with a point"
            )
        lines = {number: re.sub(r",(?=\d)", ".", line) for number, line in lines.items()}
    rows = csv.reader(lines.values(), delimiter=mark, skipinitialspace=True)
    return dict(zip(lines, ([cell.strip() for cell in row] for row in rows), strict=True))


def _file_lines(name: str, content: bytes) -> list[tuple[str, dict[str, Any]]]:
    """Return the rows of a table by the names of its columns."""
    (_, header), *rows = [*text_rows(name, content).items()] or [(1, list[str]())]
    _refuse_repeated(header)
    for number, cells in rows:
        if len(cells) != len(header):
            raise ValueError(
                f"line {number}: {len(cells)} values; the header has {len(header)} columns "
                "(between commas, decimals need a point)"
            )
    return [(f"line {n}", dict(zip(header, cells, strict=True))) for n, cells in rows]


def _refuse_repeated(names: Sequence[str]) -> None:
    """Refuse a column that is there twice: which one counts is not said."""
    for name in names:
        if name and names.count(name) > 1:  # a spreadsheet may add columns without a name
            raise ValueError(f"column {name!r} is there {names.count(name)} times; keep one")
