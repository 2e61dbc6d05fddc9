"""Chains and impacts as HTML for notebooks: a small picture (SVG) and a table, without a plotter.

All is drawn in the colour of the text around it, so that it can be read on light and dark pages.
"""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

_Vector = NDArray[np.float64]

# Of a long chain this many balls are shown, from the left and from the right.
_LEFT, _RIGHT = 8, 4

# Pixels: height of a row, largest radius, arrow of the fastest ball, width of an omission.
_ROW, _RADIUS, _ARROW, _OMITTED = 70, 18.0, 30.0, 28.0


def as_html(
    masses: _Vector, states: Mapping[str, _Vector], columns: Mapping[str, NDArray[Any]]
) -> str:
    """Return a picture of a chain in one or several states, and a table below it."""
    n = len(masses)
    balls = list(range(n)) if n <= _LEFT + _RIGHT else [*range(_LEFT), *range(n - _RIGHT, n)]
    rows = []
    for ball in balls:
        if ball and ball - 1 not in balls:
            rows.append(["…"] * (len(columns) + 1))
        cells = [f"{v[ball]:.6g}" if ball < len(v) else "" for v in columns.values()]
        rows.append([str(ball), *cells])
    return f"<div>{_picture(masses, states, balls)}{_table(['ball', *columns], rows)}</div>"


def as_text(values: _Vector) -> str:
    """Return a row of velocities or impulses as people write it, six digits of each."""
    return f"[{', '.join(f'{value:.6g}' for value in without_rounding(values).tolist())}]"


def without_rounding(values: _Vector) -> _Vector:
    """Return velocities or impulses without what is left of sums that should be zero."""
    small = np.abs(values) < 1e-12 * np.abs(values).max(initial=0.0)
    return np.where(small, 0.0, values) + 0.0


def _picture(masses: _Vector, states: Mapping[str, _Vector], balls: list[int]) -> str:
    """Draw the chain once for each state, with an arrow above each ball that moves."""
    # At least two pixels, or a light ball would not be seen.
    radii = np.maximum(_RADIUS * np.cbrt(masses[balls] / masses.max()), 2.0)
    omitted = _OMITTED * (np.diff(balls, prepend=-1) > 1)
    label = 8.0 * max(map(len, states)) + 20.0
    centres = label + np.cumsum(2.0 * radii + omitted) - radii
    width = centres[-1] + radii[-1] + _ARROW
    fastest = max(float(np.abs(v).max()) for v in states.values()) or 1.0
    parts = []
    for row, (name, velocities) in enumerate(states.items()):
        y = _ROW * row + 46
        parts.append(f'<text x="2" y="{y + 4}" stroke="none">{escape(name)}</text>')
        for ball, x, r, gap in zip(balls, centres, radii, omitted, strict=True):
            parts.append(f'<circle cx="{x:.1f}" cy="{y}" r="{r:.1f}" fill-opacity="0.12"/>')
            if gap:
                parts.append(f'<text x="{x - r - 20:.1f}" y="{y + 4}" stroke="none">…</text>')
            # All arrows on one scale; shorter ones than a pixel tell nothing.
            length = float(_ARROW * (velocities[ball] / fastest))
            if abs(length) >= 1.0:
                head = np.copysign(min(5.0, abs(length)), length)
                parts.append(
                    f'<path fill="none" d="M {x - length / 2:.1f} {y - 30} h {length:.1f} '
                    f'm {-head:.1f} -4 l {head:.1f} 4 l {-head:.1f} 4"/>'
                )
    height = _ROW * len(states)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height}" '
        f'width="{width:.0f}" height="{height}" role="img" aria-label="row of {len(masses)} balls" '
        'style="max-width: 100%" font-family="sans-serif" font-size="13" fill="currentColor">'
        '<g stroke="currentColor" stroke-width="1.5">'
        f"{''.join(parts)}</g></svg>"
    )


def _table(head: list[str], rows: list[list[str]]) -> str:
    """Return a plain table; the page styles it."""

    def line(cells: list[str], tag: str) -> str:
        return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"

    body = "".join(line(row, "td") for row in rows)
    return f"<table><thead>{line(head, 'th')}</thead><tbody>{body}</tbody></table>"
