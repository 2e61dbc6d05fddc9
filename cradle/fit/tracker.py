"""Positions exported by the video tool Tracker.

Three layouts of Tracker's text export are read; the facts come from files that people published
and from the program's source (github.com/OpenSourcePhysics/tracker, `ExportDataDialog.java`):

- one track, older versions: a line with its name, spaces as underscores (``mass_A``), a line with
  the columns (``t  x  y``), then the numbers;
- one track, version 6: the same, but the name comes after a delimiter, and lines end with one;
- several tracks, version 6: a line ``#multi:``, a line with the names above their columns, a line
  with ``t`` once and the columns of each track.

Tabs, commas and semicolons delimit; a cell is empty where a ball was not marked.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from cradle.checks import Vector, one_number


class Track(NamedTuple):
    """Marks of one ball: times in s and positions along the row in m, both of shape (T,)."""

    times: Vector
    positions: Vector


#: Marks of every ball, by the names of the tracks, in the order of the file.
Tracks = dict[str, Track]


def read_tracker(
    path: str | Path, *, column: str = "x", time_scale: float = 1.0, unit: float = 1.0
) -> Tracks:
    """Read a text file exported by Tracker.

    Parameters
    ----------
    path : str or Path
        The file.
    column : str
        Which column holds the position along the row.
    time_scale : float
        True time over the time of the video: 30 / 240 for a video that shows 240 frames a second
        slowed down to 30.
    unit : float
        Length of Tracker's unit in m: 0.01 if the calibration stick was given in cm.

    Returns
    -------
    Tracks
        By name; frames where a ball was not marked are left out.

    Raises
    ------
    ValueError
        If the file has another layout, or a cell is no number; the message names line and column.

    Examples
    --------
    >>> from cradle.tables import data_folder
    >>> tracks = read_tracker(data_folder() / "video_synthetic.txt")
    >>> {name: track.times.size for name, track in tracks.items()}
    {'B': 49, 'A': 49, 'C': 49}
    """
    one_number("time_scale", time_scale, "must be above 0", 0.0, open_low=True)
    one_number("unit", unit, "must be above 0", 0.0, open_low=True)
    file = Path(path) if isinstance(path, str) else path
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise ValueError(
            f"{file.name} is no UTF-8 text (byte {error.start}); export it from Tracker, or save "
            "it as text in UTF-8"
        ) from None
    first = 1 if lines and lines[0].strip().rstrip(",;").strip() == "#multi:" else 0
    if len(lines) < first + 3:
        raise ValueError(f"{file.name}: too short for an export of Tracker")
    header = lines[first + 1]
    delimiter = next((mark for mark in "\t;," if mark in header), None)
    columns = [name.strip() for name in header.split(delimiter)] if delimiter else []
    if delimiter is None or columns[0] != "t" or column not in columns:
        raise ValueError(
            f"{file.name}, line {first + 2}: {header!r}; an export of Tracker has its columns "
            f"there, t first, and {column} among them"
        )
    names = [name.strip() for name in lines[first].split(delimiter)]
    owners = _owners(names, columns, several=first == 1)
    tracks: Tracks = {}
    for place, title in enumerate(columns):
        if title == column:
            marks = _marks(file.name, lines, first + 2, (delimiter, place, column))
            times, positions = np.array(marks).reshape(-1, 2).T
            tracks[owners[place]] = Track(times * time_scale, positions * unit)
    return tracks


def _owners(names: list[str], columns: list[str], several: bool) -> list[str]:
    """Return the track that each column belongs to."""
    if not several:
        return [next((name for name in names if name), "track").replace("_", " ")] * len(columns)
    # Of several tracks, the name stands above the first of its columns.
    filled = names + [""] * (len(columns) - len(names))
    owners = [""]
    for name in filled[1 : len(columns)]:
        owners.append(name or owners[-1])
    return owners


def _marks(
    name: str, lines: list[str], begin: int, where: tuple[str, int, str]
) -> list[tuple[float, float]]:
    delimiter, place, column = where
    marks = []
    for number, line in enumerate(lines[begin:], begin + 1):
        cells = [cell.strip() for cell in line.split(delimiter)]
        if place >= len(cells) or not cells[place]:
            continue
        pair = []
        for title, cell in (("t", cells[0]), (column, cells[place])):
            # Tracker can be told to write decimal commas, with another delimiter then.
            text = cell if delimiter == "," else cell.replace(",", ".")
            try:
                pair.append(float(text))
            except ValueError:
                raise ValueError(
                    f"{name}, line {number}, column {title}: {cell!r}; must be a number"
                ) from None
        marks.append((pair[0], pair[1]))
    return marks
