"""Chains and impacts for people: as text, and for notebooks as a small picture and a table.

They have the colour of the text around them, for light pages and dark ones.
"""

from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np

from cradle.input.values import NDArray, Vector

# Of the picture of a chain, in pixels: a row for each state, the heaviest ball, the fastest ball's
# arrow, and the room of balls that are left out.
_ROW, _RADIUS, _ARROW, _OMITTED = 70, 18.0, 30.0, 28.0


def as_text(values: Vector) -> str:
    """Return a row of velocities or impulses as people write it, six digits of each."""
    return f"[{', '.join(f'{value:.6g}' for value in without_rounding(values).tolist())}]"


def without_rounding(values: Vector) -> Vector:
    """Return velocities or impulses without what is left of sums that should be zero."""
    small = np.abs(values) < 1e-12 * np.abs(values).max(initial=0.0)
    return np.where(small, 0.0, values) + 0.0


def as_html(
    masses: Vector, states: Mapping[str, Vector], columns: Mapping[str, NDArray[Any]]
) -> str:
    """Return a picture of a chain in one or several states, and a table below it."""
    n = len(masses)
    balls = list(range(n)) if n <= 12 else [*range(8), *range(n - 4, n)]
    rows = [["ball", *columns]]
    for ball in balls:
        if ball and ball - 1 not in balls:
            rows.append(["…"] * len(rows[0]))
        cells = [f"{v[ball]:.6g}" if ball < len(v) else "" for v in columns.values()]
        rows.append([str(ball), *cells])
    head, *body = (
        f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in row)}</tr>"
        for row, tag in zip(rows, ["th"] + ["td"] * len(rows), strict=False)
    )
    table = f"<table><thead>{head}</thead><tbody>{''.join(body)}</tbody></table>"
    return f"<div>{_picture(masses, states, balls)}{table}</div>"


def _picture(masses: Vector, states: Mapping[str, Vector], balls: list[int]) -> str:
    """Draw the chain once for each state, with an arrow above each ball that moves; in pixels."""
    # At least two pixels, or a light ball would not be seen.
    radii = np.maximum(_RADIUS * np.cbrt(masses[balls] / masses.max()), 2.0)
    omitted = _OMITTED * (np.diff(balls, prepend=-1) > 1)
    centres = 8.0 * max(map(len, states)) + 20.0 + np.cumsum(2.0 * radii + omitted) - radii
    width, height = centres[-1] + radii[-1] + 30.0, _ROW * len(states)
    fastest = max(float(np.abs(v).max()) for v in states.values()) or 1.0
    parts = []
    for y, (name, velocities) in zip(range(46, height, _ROW), states.items(), strict=True):
        parts.append(f'<text x="2" y="{y + 4}" stroke="none">{escape(name)}</text>')
        for x, r, gap, v in zip(centres, radii, omitted, velocities[balls], strict=True):
            parts.append(f'<circle cx="{x:.1f}" cy="{y}" r="{r:.1f}" fill-opacity="0.12"/>')
            if gap:
                parts.append(f'<text x="{x - r - 20:.1f}" y="{y + 4}" stroke="none">…</text>')
            # All arrows on one scale; shorter ones than a pixel tell nothing.
            length = float(_ARROW * (v / fastest))
            if abs(length) >= 1.0:
                head = np.copysign(min(5.0, abs(length)), length)
                parts.append(
                    f'<path fill="none" d="M {x - length / 2:.1f} {y - 30} h {length:.1f} '
                    f'm {-head:.1f} -4 l {head:.1f} 4 l {-head:.1f} 4"/>'
                )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height}" '
        f'width="{width:.0f}" height="{height}" role="img" aria-label="row of {len(masses)} balls" '
        'style="max-width: 100%" font-family="sans-serif" font-size="13" fill="currentColor">'
        f'<g stroke="currentColor" stroke-width="1.5">{"".join(parts)}</g></svg>'
    )
