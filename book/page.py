"""What the notebooks of the book share and a reader need not see: numbers and drawings."""

import ast
import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from IPython.display import display
from matplotlib.axes import Axes
from myst_nb import glue

from cradle.pictures.impacts import PALETTE, velocities
from cradle.trace import Trace

#: Whole numbers as words.
WORDS = [
    "no", "one", "two", "three", "four", "five", "six", "seven", "eight",
    "nine", "ten", "eleven", "twelve", "thirteen", "fourteen", "fifteen", "sixteen",
]  # fmt: skip
#: Areas under a closing speed: work that a contact absorbs, and work that it gives back.
ABSORBED = {
    "facecolor": PALETTE[4],
    "edgecolor": PALETTE[0],
    "hatch": "//",
    "alpha": 0.55,
    "lw": 0,
}
GIVEN_BACK = {
    "facecolor": PALETTE[5],
    "edgecolor": PALETTE[1],
    "hatch": "..",
    "alpha": 0.55,
    "lw": 0,
}
#: Inches of a figure that fits a phone, with letters of nine points or more.
WIDTH = 3.97
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def tell(chapter: str, **values: object) -> None:
    """Hand values to the text: `name` becomes the label `chapter-name`, with - for _.

    A minus is one there: −0.027.
    """
    for name, value in values.items():
        text = re.sub(r"(?<!\w)-(?=[\d.])", "−", str(value))
        glue(f"{chapter}-{name.replace('_', '-')}", text, display=False)


def borrow(chapter: str, names: str, into: dict[str, Any]) -> list[Any]:
    """Return functions that the cells of another chapter define, made among a notebook's names."""
    path = Path(__file__).with_name(f"{chapter}.ipynb")
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        lines = [
            line for line in cell["source"] if not line.startswith("%")
        ]
        if cell["cell_type"] == "code":
            for node in ast.parse("".join(lines)).body:
                if (
                    isinstance(node, ast.FunctionDef)
                    and node.name in names.split()
                ):
                    exec(
                        compile(ast.Module([node], []), path.name, "exec"),
                        into,
                    )
    return [into[name] for name in names.split()]


def people(value: float, digits: int = 2) -> str:
    """Write a number as in a sentence: 2.2 million, 37 000, 10⁻⁷, 0.031.

    `digits` significant digits are kept. An integer below one million is written out in full.
    """
    if float(value).is_integer() and abs(value) < 1_000_000:
        return _grouped(int(value))
    for size, word in ((1e9, "billion"), (1e6, "million")):
        if size <= abs(value) < 1e12:
            return f"{_rounded(value / size, digits)} {word}"
    if 1e-3 <= abs(value) < 1e6:
        return _rounded(value, digits)
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    power = "10" + str(int(exponent)).translate(_SUPERSCRIPT)
    mantissa = f"{float(mantissa):g}".replace("-", "−")
    return power if mantissa == "1" else f"{mantissa}·{power}"


def said(value: float, digits: int = 2) -> str:
    """Write a number as in a sentence, and a small whole number as a word."""
    if isinstance(value, (int, np.integer)) and 0 <= value <= 12:
        return WORDS[value]
    return people(value, digits)


def count(number: int, thing: str, things: str = "") -> str:
    """Write how many there are: no chains, one chain, twelve chains, 35 chains."""
    return f"{said(int(number))} {thing if number == 1 else things or thing + 's'}"


def _rounded(value: float, digits: int) -> str:
    """Write a number in significant digits, without a power of ten."""
    rounded = float(f"{value:.{digits}g}")
    if abs(rounded) >= 10_000:
        return _grouped(int(rounded))
    return f"{rounded:g}".replace("-", "−")


def _grouped(value: int) -> str:
    """Write an integer, a large one in groups of three digits."""
    text = f"{value:,}" if abs(value) >= 10_000 else f"{value}"
    return text.replace(",", "\N{NARROW NO-BREAK SPACE}").replace("-", "−")


def aligned(values: np.ndarray, digits: int = 3) -> str:
    """Write velocities side by side, as a line of a table: no minus before a zero."""
    return "".join(
        f" {round(float(value), digits) + 0.0:{digits + 3}.{digits}f}"
        for value in values
    )


def below(value: float, limit: float = 1e-12) -> str:
    """Write a difference that is rounding as "< 10⁻¹²", any other one as it is."""
    return (
        f"< {people(limit, 1)}" if abs(value) < limit else people(value, 1)
    )


class _Table:
    """A table as a page shows it, and as plain text."""

    def __init__(self, frame: pd.DataFrame, **options: object) -> None:
        self.frame, self.options = frame, options

    def __repr__(self) -> str:
        return self.frame.to_string(**self.options)

    def _repr_html_(self) -> str:
        return self.frame.to_html(border=0, **self.options)


def show(
    frame: pd.DataFrame, *, index: bool = False, **options: object
) -> None:
    """Show a table whose columns stay in line on a narrow screen, too.

    `options` are those that `to_string` and `to_html` share.
    """
    display(_Table(frame, index=index, **options))


def name_lines(ax: Axes, *, side: str = "right", apart: float = 11) -> None:
    """Write the name of each line at its last point that is seen (or its first), in its colour.

    They take the place of a legend.
    Names that would lie on one another are lifted, `apart` points each.
    """
    if ax.get_legend():
        ax.get_legend().remove()
    end, sign = (-1, 1) if side == "right" else (0, -1)
    ax.figure.canvas.draw()
    point, box, placed = ax.figure.dpi / 72, ax.bbox.padded(1), []
    ends = []
    for line in ax.get_lines():
        if line.get_label()[0] != "_":
            places = line.get_xydata()
            at = ax.transData.transform(places)
            seen = [k for k, xy in enumerate(at) if box.contains(*xy)][end]
            ends.append((*at[seen], places[seen], line))
    for x, y, place, line in sorted(ends, key=lambda one: one[1]):
        lifted = y
        for other_x, other_y in placed:
            if abs(x - other_x) < 60 * point:
                lifted = max(lifted, other_y + apart * point)
        placed.append((x, lifted))
        ax.annotate(
            line.get_label(), place, (5 * sign, (lifted - y) / point),
            textcoords="offset points", color=line.get_color(), fontsize=9.5,
            ha="left" if sign > 0 else "right", va="center",
        )  # fmt: skip


def turns(trace: Trace) -> list[int]:
    """Rows of the path at which a contact ends or closes: the events that the book numbers."""
    return [
        row
        for row, event in enumerate(trace.events, start=1)
        if event.kind != "maximum_compression"
    ]


def number_events(
    ax: Axes,
    places: Iterable[float],
    numbers: Iterable[int],
    most: int = 12,
) -> None:
    """Write the numbers of events above the axes, at most `most`, with dotted lines down.

    Events that are too near for two numbers share one: 5, 6 or 3–6.
    """
    left, right = ax.get_xlim()
    digit = 0.084 / ax.figure.get_figwidth() * (right - left)
    groups: list[tuple[list[float], list[int]]] = []
    for at, number in list(zip(places, numbers, strict=True))[:most]:
        ax.axvline(at, color="0.7", lw=0.8, ls=":", zorder=0)
        group = ([float(at)], [number])
        if groups:
            before, found = groups[-1]
            reach = digit * (2 if len(found) == 1 else 3)
            if at - (before[0] + before[-1]) / 2 < reach:
                group = (before + group[0], found + group[1])
                groups.pop()
        groups.append(group)
    for where, together in groups:
        dash = ", " if len(together) == 2 else "–"
        ax.annotate(
            dash.join(map(str, dict.fromkeys((together[0], together[-1])))),
            ((where[0] + where[-1]) / 2, 1),
            (0, 3),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            ha="center",
            fontsize=9,
        )


def inside(trace: Trace) -> None:
    """Draw an impact from the inside: velocities, numbered events, and when each contact acts."""
    contacts = len(trace.impulses)
    _, (ax, below) = plt.subplots(
        2,
        1,
        figsize=(WIDTH, 3.5 + 0.22 * contacts),
        sharex=True,
        layout="constrained",
        height_ratios=(10, 1 + 0.6 * contacts),
    )
    velocities(trace, ax)
    ax.set(xlabel="")
    rows = turns(trace)
    along = trace.path_impulses.sum(axis=1)
    number_events(ax, along[rows], range(1, len(rows) + 1))
    grows = np.diff(trace.path_impulses, axis=0) > 0
    # A contact between its start and its end waits while another run is drawn.
    waits, active = np.zeros_like(grows), np.zeros(contacts, dtype=bool)
    for piece, (kind, contact) in enumerate(trace.events):
        active |= grows[piece]
        waits[piece] = active & ~grows[piece]
        active[contact] = kind not in ("end", "collapse")
    for pieces, look in (
        (grows, {"color": "0.35"}),
        (waits, {"fc": "none", "ec": "0.35", "hatch": "////", "lw": 0}),
    ):
        for contact, acts in enumerate(pieces.T):
            spans = np.column_stack([along[:-1], np.diff(along)])[acts]
            below.broken_barh(spans, (contact - 0.35, 0.7), **look)
    below.set_yticks(
        range(contacts), [f"{c + 1}-{c + 2} acts" for c in range(contacts)]
    )
    below.invert_yaxis()
    below.set(xlabel="sum of all impulses (N s)", xlim=along[[0, -1]])
    name_lines(ax)
    for side in ("top", "right", "left"):
        below.spines[side].set_visible(False)
    below.tick_params(axis="y", length=0)


def works(trace: Trace, contact: int, ax: Axes, *, most: int = 12) -> None:
    """Draw work as areas: the closing speed of a contact over its impulse, its events numbered."""
    tau = trace.path_impulses[:, contact]
    u = trace.path[:, contact] - trace.path[:, contact + 1]
    ax.axhline(0, color="0.3", lw=0.8)
    ax.fill_between(tau, u, where=u >= 0, interpolate=True, **ABSORBED)
    ax.fill_between(tau, u, where=u <= 0, interpolate=True, **GIVEN_BACK)
    ax.plot(tau, u, color="black", lw=1.6, label=f"$u_{contact + 2}$")
    ax.set(
        xlabel=rf"impulse $\tau_{contact + 2}$ (N s)",
        ylabel=rf"closing speed $u_{contact + 2}$ (m/s)",
    )
    ax.margins(x=0.02)
    own = {
        number: tau[row]
        for number, row in enumerate(turns(trace), start=1)
        if trace.events[row - 1].contact == contact and tau[row] > 0
    }
    number_events(ax, own.values(), own, most)
