"""Drawings of impacts, on the axes that are given or on new ones.

Balls and impulses carry the paper's numbers here: ball i is B(i + 1) with velocity v(i + 1), and
the impulse of contact c is tau(c + 2). With a colour always goes a dash, a marker or a letter.
"""

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from cradle.input.values import Vector, must_be, whole_number
from cradle.trace import Trace

#: Colours of Okabe and Ito, which colour-blind readers can tell apart, in changing lightness.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")

_DASHES: tuple[Any, ...] = (
    "solid", (0, (6, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)), (0, (10, 3)),
    (0, (3, 1, 1, 1, 1, 1)), (0, (1, 3)),
)  # fmt: skip

#: Marker, letter and name of each kind of event.
EVENT_STYLES = {
    "maximum_compression": ("o", "c", "maximum compression"),
    "end": ("s", "f", "end"),
    "close": ("^", "s", "start of a further collision"),
    "collapse": ("D", "l", "limit of an infinite sequence"),
    "repetition": ("*", "r", "cycle, repeated many times"),
}


def ball_style(ball: int) -> dict[str, Any]:
    """Return the colour and dash of a ball for `Axes.plot`; they repeat after seven balls.

    Examples
    --------
    >>> from cradle.pictures.impacts import ball_style
    >>> ball_style(0)
    {'color': '#0072B2', 'linestyle': 'solid'}
    """
    return {"color": PALETTE[ball % len(PALETTE)], "linestyle": _DASHES[ball % len(_DASHES)]}


def _indexed(symbol: str, number: int) -> str:
    """Return a symbol with its index; TeX takes two digits for one index in braces alone."""
    return f"${symbol}_{number}$" if number < 10 else f"${symbol}_{{{number}}}$"


def _lines(ax: Axes | None, over: str, x: Vector, path: Vector, balls: Sequence[int]) -> Axes:
    """Draw the velocities of some balls over an impulse, on new axes if there are none."""
    ax = plt.subplots(figsize=(5.6, 3.9), layout="constrained")[1] if ax is None else ax
    for ball in balls:
        label = _indexed("v", ball + 1)
        must_be(Axes, "ax", ax).plot(x, path[:, ball], label=label, lw=2, **ball_style(ball))
    ax.set(xlabel=over, ylabel="velocity (m/s)")
    ax.grid(alpha=0.3)
    return ax


def velocities(trace: Trace, ax: Axes | None = None) -> Axes:
    """Draw the velocities of all balls against the progress of the impact.

    Those of springs are curves.  Without `ax` new axes are made.

    Examples
    --------
    >>> from cradle import collide, paper_chain
    >>> from cradle.pictures.impacts import velocities
    >>> ax = velocities(collide(*paper_chain("AAA")))
    >>> [line.get_label() for line in ax.get_lines()]
    ['$v_1$', '$v_2$', '$v_3$']
    """
    impulses, path = must_be(Trace, "trace", trace).curve()
    balls, over = range(path.shape[1]), "sum of all impulses (N s)"
    ax = _lines(ax, over, impulses.sum(axis=1), path, balls)
    ax.margins(x=0)
    beside = min(len(trace.chain), 6)  # a longer legend takes several lines
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=beside, frameon=False)
    return ax


def velocity_impulse(trace: Trace, contact: int, ax: Axes | None = None) -> Axes:
    """Draw the velocity-impulse diagram of one contact, as in the paper's figures 3, 5 and 8.

    It shows the velocities of the contact's two balls against its impulse (sections 2.3, 2.4, 3.2).
    Where other contacts act while this one rests, its impulse does not grow, and a velocity jumps.
    Markers and letters show the contact's events, as the legend says; after several collisions the
    letters carry numbers.  It draws on `ax` or on new axes; an unknown contact is a ValueError.

    Examples
    --------
    >>> from cradle import collide, paper_chain
    >>> from cradle.pictures.impacts import velocity_impulse
    >>> ax = velocity_impulse(collide(*paper_chain("AAA")), 1)
    >>> [line.get_label() for line in ax.get_lines()[:2]]
    ['$v_2$', '$v_3$']
    """
    last = len(must_be(Trace, "trace", trace).impulses) - 1
    contact = whole_number("contact", contact, f"0 to {last}", 0, last)
    impulses, path = trace.curve()
    over = "impulse " + _indexed(r"\tau", contact + 2) + " (N s)"
    ax = _lines(ax, over, impulses[:, contact], path, (contact, contact + 1))
    _mark_events(trace, contact, ax)
    return ax


def _mark_events(trace: Trace, contact: int, ax: Axes) -> None:
    """Mark a contact's events on its diagram, and put all names into a legend below it."""
    handles = ax.get_lines()[:2]
    several, collision = trace.collisions[contact] > 1, 1
    kinds: set[str] = set()
    names: dict[float, list[str]] = {}
    for row, event in enumerate(trace.events, start=1):
        if event.contact != contact:
            continue
        marker, letter, _ = EVENT_STYLES[event.kind]
        # A closing that comes before all else starts the first collision: the contact was idle.
        collision += event.kind == "close" and bool(kinds)
        kinds.add(event.kind)
        x, pair = float(trace.path_impulses[row, contact]), trace.path[row, contact : contact + 2]
        ax.plot([x, x], pair, marker, mfc="white", mec="black", ms=6, zorder=3)
        names.setdefault(x, []).append(f"{letter}{collision}" if several else letter)
    taken = -np.inf
    for x, letters in names.items():
        ax.axvline(x, color="0.6", lw=0.7, ls=":", zorder=0)
        if x > taken:
            place: dict[str, Any] = {"xycoords": ax.get_xaxis_transform(), "fontsize": 9}
            ax.annotate(" ".join(letters), (x, 0), (2, 3), textcoords="offset points", **place)
            taken = x + 0.035 * len(letters) * float(trace.impulses[contact])
    for kind, (marker, letter, name) in EVENT_STYLES.items():
        if kind in kinds:
            style: dict[str, Any] = {"marker": marker, "label": f"{letter}: {name}"}
            handles.append(Line2D([], [], ls="none", mfc="white", mec="black", **style))
    # Below the axes, where it hides no line.
    beside = 3 if ax.figure.bbox.width > 5 * ax.figure.dpi else 1
    ax.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=beside,
              frameon=False)  # fmt: skip
