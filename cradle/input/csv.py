"""Tables of measurements; what is wrong with one is named by its line and column."""

import csv
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def table_lines(source: Any) -> list[tuple[str, dict[str, Any]]]:
    """Return the rows of a file or of columns by name, each with a name of its place."""
    source = Path(source) if isinstance(source, str) else source
    if isinstance(source, Mapping) or hasattr(source, "columns"):
        names = _once([str(name) for name in source])
        columns = [list(source[name]) for name in source]
        if len(lengths := {len(values) for values in columns}) > 1:
            raise ValueError(f"columns have different lengths: {sorted(lengths)}")
        rows = enumerate(zip(*columns, strict=True), 1)
        return [(f"row {k}", dict(zip(names, row, strict=True))) for k, row in rows]
    read = getattr(source, "read_bytes", getattr(source, "read", None))
    if read is None:
        raise TypeError(f"source has the type {type(source).__name__}; must be a path or a table")
    lines = text_rows(getattr(source, "name", "the file"), read())
    names = _once(lines.pop(min(lines)) if lines else [])
    for number, cells in lines.items():
        if len(cells) != len(names):
            told = f"line {number}: {len(cells)} values; the header has {len(names)} columns"
            raise ValueError(f"{told} (between commas, decimals need a point)")
    return [(f"line {n}", dict(zip(names, cells, strict=True))) for n, cells in lines.items()]


def _once(names: list[str]) -> list[str]:
    """Return the names of columns, or refuse one that is there twice: which counts is not said."""
    for name in names:
        if name and names.count(name) > 1:  # a spreadsheet may add columns without a name
            raise ValueError(f"column {name!r} is there {names.count(name)} times; keep one")
    return names


def text_rows(name: str, content: bytes | str, comments: bool = False) -> dict[int, list[str]]:
    """Return the cells of each filled line of a text file by its number, as points and ASCII."""
    try:
        content = content.encode() if isinstance(content, str) else content
        text = content.decode("utf-8-sig").replace("\N{MINUS SIGN}", "-")
    except UnicodeDecodeError as error:
        told = f"{name} is no UTF-8 text (byte {error.start}); save it as CSV in UTF-8"
        raise ValueError(told) from None
    lines = {
        number: line for number, line in enumerate(re.split("\r\n|\n|\r", text), 1)
        if line.strip(",; \t") and not line.startswith("sep=")  # for a spreadsheet
        and (comments or not line.lstrip().startswith("#"))
    }  # fmt: skip
    seen = "".join(lines.values()) if comments else next(iter(lines.values()), "")
    mark = next((one for one in "\t;," if one in seen), " ")  # a table has it in its header
    if mark != ",":
        comma = next((n for n, line in lines.items() if re.search(r",\d", line)), None)
        point = next((n for n, line in lines.items() if re.search(r"\d\.\d", line)), None)
        if comma and point:
            told = f"decimals with a comma in line {comma} and with a point in line {point}"
            raise ValueError(f"{name} has {told}; write all with a point")
        lines = {number: re.sub(r",(?=\d)", ".", line) for number, line in lines.items()}
    return {number: [cell.strip() for row in csv.reader([line], delimiter=mark,
            skipinitialspace=True) for cell in row] for number, line in lines.items()}  # fmt: skip
