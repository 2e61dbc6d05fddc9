"""The lines of a table, from a file or from columns."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any


def table_lines(source: Any) -> list[tuple[str, dict[str, Any]]]:
    """Return the rows of a table, each with a name of its place.

    Parameters
    ----------
    source : path, binary file, DataFrame or mapping of columns
        As for `read_shots`.

    Returns
    -------
    list of tuple
        "line 2" or "row 1", and the cells by their columns.

    Raises
    ------
    TypeError, ValueError
        If it is no table; the message says what to do.

    Examples
    --------
    >>> table_lines({"shot": [1, 2]})
    [('row 1', {'shot': 1}), ('row 2', {'shot': 2})]
    """
    if isinstance(source, (str, Path)) or hasattr(source, "open"):
        path = Path(source) if isinstance(source, str) else source
        return _file_lines(path.name, path.read_bytes())
    if hasattr(source, "read"):
        return _file_lines(getattr(source, "name", "the file"), source.read())
    if not (isinstance(source, Mapping) or hasattr(source, "columns")):
        raise TypeError(f"source is a {type(source).__name__}; must be a path or a table")
    _refuse_repeated([str(name) for name in source])
    columns = {str(name): list(source[name]) for name in source}
    lengths = {len(values) for values in columns.values()}
    if len(lengths) > 1:
        raise ValueError(f"columns have different lengths: {sorted(lengths)}")
    return [
        (f"row {k + 1}", {name: values[k] for name, values in columns.items()})
        for k in range(lengths.pop() if lengths else 0)
    ]


def _file_lines(name: str, content: bytes) -> list[tuple[str, dict[str, Any]]]:
    """Return the rows of a CSV file; comments and rows without any cell filled are left out."""
    try:
        file = io.StringIO(content.decode("utf-8-sig"), newline="")
    except UnicodeDecodeError as error:
        raise ValueError(
            f"{name} is no UTF-8 text (byte {error.start}); save it as CSV in UTF-8"
        ) from None
    numbered = [
        (number, text) for number, text in enumerate(file, 1)
        if text.strip(", \t\r\n") and not text.lstrip().startswith("#")
    ]  # fmt: skip
    for mark, word in ((";", "semicolon"), ("\t", "tab")):
        if numbered and mark in numbered[0][1] and "," not in numbered[0][1]:
            if any(re.search(r"\d,\d", text) for _, text in numbered):
                raise ValueError(
                    f"{name} has {word}s between the columns and commas in the decimals; "
                    f"first turn every comma into a point, then every {word} into a comma"
                )
            raise ValueError(f"{name} has {word}s; put commas between the columns")
    reader = csv.reader(text for _, text in numbered)
    header = [name.strip() for name in next(reader, [])]
    _refuse_repeated(header)
    lines = []
    for (number, _), cells in zip(numbered[1:], reader, strict=True):
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
