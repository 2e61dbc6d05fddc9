"""Small tables read from CSV files; what is wrong with one is named by file, row and column."""

from __future__ import annotations

import csv
import math
from collections.abc import Collection, Sequence
from importlib.resources.abc import Traversable
from typing import NamedTuple, NoReturn

from cradle.input.values import one_number


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
