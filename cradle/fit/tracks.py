"""Positions of balls in a film: text exported by Tracker, Kinovea, Logger Pro or Capstone."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cradle.input.csv import text_rows
from cradle.input.values import ABOVE_ZERO, Vector, checked, must_be, one_number
from cradle.trace import compared_as_objects


@compared_as_objects
class Track(NamedTuple):
    """Marks of one ball in a film."""

    times: Vector  #: When it was marked, shape (T,), s.
    positions: Vector  #: Where it was along the row, shape (T,), m.


#: A dictionary: the `Track` of every ball by its name, in the order of the file.
Tracks = dict[str, Track]

# What programs write, by files that people published and by the source of Tracker
# (`ExportDataDialog.java`) and Kinovea (`ExporterTXTTrajectory.cs`, `ExporterCSVTrajectory.cs`):
# Tracker        a name, spaces as underscores (``mass_A``); ``t  x  y``; numbers.  Several tracks:
#                ``#multi:``, the names above their columns, ``t`` once and the columns of each
# Kinovea        ``#T X Y``, then of each ball ``# name`` and numbers; or ``Time``, ``name/0/X``
# Logger Pro     ``Latest: Time (s)``, ``Latest: X (m)``, ``Latest: X 2 (m)``; as text ``Time  X``,
#                ``t  x``, and a line of units
# Capstone       ``Time (s) Run #1``, ``Position (m) Run #1``
# A title less what stands before a colon, its unit in brackets and its run.
_TITLE = re.compile(r"^(?:.*:)?\s*(.*?)\s*(?:\(([^)]*)\))?\s*(?:Run.*)?$", re.IGNORECASE)
_CLOCKS = ("t", "time")
_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "s": 1.0, "ms": 1e-3, "px": 1.0, "": 1.0}


def read_tracker(path: str | Path, *, time_scale: float = 1.0, unit: float = 1.0) -> Tracks:
    """Read a text file exported by Tracker, Kinovea, Logger Pro or Capstone.

    The tracks come in the order of the titles; frames where a ball was not marked (no number, or
    NaN) are left out of its track.  Another layout raises a ValueError, and so does a cell that is
    no number; the message names line and column.

    Parameters
    ----------
    path : str or Path
        The file; tabs, semicolons or commas between the columns, decimals with a point or a comma.
    time_scale : float
        True time over the time of the video: 30 / 240 if 240 frames a second are shown as 30.
    unit : float
        Length of the file's unit in m, such as 0.01, if it is not named there as in ``X (cm)``.

    Examples
    --------
    >>> from cradle.fit import read_tracker
    >>> from cradle.tables import data_folder
    >>> tracks = read_tracker(data_folder() / "video_synthetic.txt")
    >>> {name: track.times.size for name, track in tracks.items()}
    {'B': 49, 'A': 49, 'C': 49}
    """
    one_number("time_scale", time_scale, *ABOVE_ZERO)
    one_number("unit", unit, *ABOVE_ZERO)
    file = Path(path) if isinstance(path, str) else path
    rows = text_rows(file.name, file.read_bytes(), comments=True)
    titles, above, block = list[tuple[str, str]](), list[str](), ""
    marks: dict[str, list[tuple[float, float]]] = {}
    for number, (first, *others) in rows.items():
        cells = [first.lstrip("# "), *others]
        bare = [cell.strip("() ") for cell in cells]
        if cells[0] and _TITLE.findall(cells[0])[0][0].casefold() in _CLOCKS:
            titles = [_TITLE.findall(cell)[0] for cell in cells]
        elif titles and {*bare} <= _UNITS.keys() and any(bare):
            titles = [(text, unit) for (text, _), unit in zip(titles, bare, strict=False)]
        elif titles and not first.startswith("#"):
            where = f"{file.name}, line {number}"
            if any(cells[len(titles) :]):
                told = f"{where}: {len(cells)} values under {len(titles)} titles"
                raise ValueError(f"{told} (between commas, decimals need a point)")
            for at, (name, clock) in _owners(titles, above, block).items():
                found = marks.setdefault(name, [])  # of a ball that is marked later only, too
                if "".join(cells[at : at + 1]).casefold() not in ("", "nan"):
                    time = time_scale * _number(where, cells[clock], titles[clock])
                    found.append((time, _number(where, cells[at], titles[at], unit)))
        else:
            above, block = cells, " ".join(cells).strip()
    tracks = {name: Track(*np.array(found).T) for name, found in marks.items() if found}
    if not tracks and _owners(titles, above, block):
        raise ValueError(f"{file.name} has no marks below its titles")
    if not tracks:
        balls = "/x, ".join(text for text, _ in titles[1:] if text)
        told = f"{file.name} has no column of positions: a line of titles must begin with t or Time"
        told += " and name x too, as Tracker, Kinovea, Logger Pro and Capstone do"
        raise ValueError(told + f"; if each column is a ball, write {balls}/x" * bool(balls))
    for name, (times, _) in tracks.items():
        if (np.diff(times) <= 0.0).any():
            told = f"{file.name}: the times of {name} do not rise; where one ball follows the other"
            raise ValueError(f"{told}, write its name, '# A', above; or columns named A/x, B/x")
    apart = max(float(np.median(np.diff(t))) if t.size > 1 else 0.0 for t, _ in tracks.values())
    if apart > 0.5:
        told = f"{file.name} has marks {apart:g} s apart"
        raise ValueError(f"{told}; if the times are in ms, divide time_scale by 1000")
    return tracks


def frames(tracks: Mapping[str, Track]) -> tuple[Vector, Vector]:
    """Return the times of a film and the places of its balls, as `fit_swing` takes them.

    From tracks as `read_tracker` gives them, left to right, come the times, s, shape (K,), and the
    positions, m, shape (K, N), nan where a ball was not marked.  Places of a ball are counted from
    their median, which is near where it hangs.

    Examples
    --------
    >>> from cradle.fit import Track, frames
    >>> tracks = {"A": Track([0, 1, 2], [0.1, 0.2, 0.4]), "B": Track([1, 2], [0.5, 0.5])}
    >>> frames(tracks)[1].round(3).tolist()
    [[-0.1, nan], [0.0, 0.0], [0.2, 0.0]]
    """
    balls = [Track(*checked(f"tracks[{name!r}]", ball))
             for name, ball in must_be(Mapping, "tracks", tracks).items()]  # fmt: skip
    times = np.unique(np.concatenate([ball.times for ball in balls]))
    positions = np.full((times.size, len(balls)), np.nan)
    for k, (t, x) in enumerate(balls):
        positions[np.searchsorted(times, t), k] = x - np.median(x)
    return times, positions


def _owners(
    titles: list[tuple[str, str]], above: list[str], block: str
) -> dict[int, tuple[str, int]]:
    """Return the ball of each column of positions, and the column of its times."""
    form = re.compile(r"(?:(.+?)/.*)?(?:x|position)(?:\W*(?:ch )?\d+)?", re.I)
    found = {at: match for at, (text, _) in enumerate(titles) if (match := form.fullmatch(text))}
    names = {titles[at][0].casefold() for at in found}
    owners, name = {}, ""
    over = [*above, *[""] * len(titles)]
    for at, match in found.items():
        if match[1]:  # Kinovea: the ball's name, and that of its point
            name = match[1]
        elif len(names) == len(found) > 1:
            name = titles[at][0]
        elif len(found) > 1:  # the name stands above the first of its columns
            name = next(filter(None, over[at::-1]), name or titles[at][0])
        else:
            name = block.replace("_", " ") or "track"
        owners[at] = name, max(k for k in range(at) if titles[k][0].casefold() in _CLOCKS)
    return owners


def _number(where: str, cell: str, title: tuple[str, str], told: float = 1.0) -> float:
    """Return a time in s or a position in m; `told` is the unit where the title has none."""
    where, unit = f"{where}, column {title[0]}", title[1]
    if unit not in _UNITS:
        raise ValueError(f"{where}: unit {unit!r}; must be in s, ms, m, cm, mm or px")
    if unit == "px" and told == 1.0:
        raise ValueError(f"{where}: px; say how large a pixel is, in m: unit")
    try:
        value = float(cell)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise ValueError(f"{where}: {cell!r}; must be a number, its decimals after a point")
    return value * (told if unit in ("", "px") else _UNITS[unit])
