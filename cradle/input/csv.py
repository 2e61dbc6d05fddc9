"""Small tables; what is wrong with one is named by file, row and column."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

from cradle.input.values import one_number

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable


class Line(NamedTuple):
    """One row of a table."""

    #: File and number of the row, counted from 1 as in an editor; the names of columns are row 1.
    place: str
    #: Text of each cell by the name of its column.
    cells: dict[str, str]

    def number(
        self, column: str, rule: str, low: float, high: float = math.inf, open_low: bool = False
    ) -> float:
        """Return a cell as a number inside its limits."""
        text = self.cells[column]
        try:
            value = float(text)
        except ValueError:
            self.refuse(column, "must be a number with a decimal point")
        name = f"{self.place}, column {column}"
        return one_number(name, value, rule, low, high, open_low)

    def refuse(self, column: str, rule: str) -> NoReturn:
        """Raise, naming a cell and the rule that it breaks."""
        text = self.cells[column]
        raise ValueError(f"{self.place}, column {column} = {text!r}; {rule}")


def read_table(
    file: Traversable, columns: Sequence[str], keys: Collection[str] | None = None
) -> dict[str, Line]:
    """Read a table whose first column names its rows."""
    name = file.name
    if not file.is_file():
        raise FileNotFoundError(f"{name} is missing: there is no file {file}")
    try:
        text = file.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"{name} is no UTF-8 text: byte {error.start}") from None
    if text.startswith("\ufeff"):
        raise ValueError(f"{name} begins with a byte-order mark; save it as UTF-8 without one")
    names = ", ".join(columns)
    head, *lines = list(csv.reader(text.splitlines())) or [[]]
    if head != list(columns):
        raise ValueError(f"{name}, row 1 is {head}; must be {names}, with commas between")
    rows: dict[str, Line] = {}
    for number, cells in enumerate(lines, start=2):
        place = f"{name}, row {number}"
        if len(cells) != len(columns):
            raise ValueError(f"{place} is {cells}; must have {len(columns)} cells: {names}")
        row = Line(place, dict(zip(columns, cells, strict=True)))
        if keys is not None and cells[0] not in keys:
            row.refuse(columns[0], f"must be one of {', '.join(keys)}")
        if cells[0] in rows:
            row.refuse(columns[0], f"must be there once, and is in {rows[cells[0]].place} too")
        rows[cells[0]] = row
    for key in keys or ():
        if key not in rows:
            raise ValueError(f"{name} has no row {key!r} in column {columns[0]}")
    return rows


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
