"""Chains and impacts for people: as text, and for notebooks as a table."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cradle.input.values import NDArray, Vector


def as_text(values: Vector) -> str:
    """Return a row of velocities or impulses as people write it, six digits of each."""
    return f"[{', '.join(f'{value:.6g}' for value in without_rounding(values).tolist())}]"


def without_rounding(values: Vector) -> Vector:
    """Return velocities or impulses without what is left of sums that should be zero."""
    small = np.abs(values) < 1e-12 * np.abs(values).max(initial=0.0)
    return np.where(small, 0.0, values) + 0.0


def as_html(n: int, columns: Mapping[str, NDArray[Any]]) -> str:
    """Return a table of n balls; of many, the first and the last ones."""
    balls = list(range(n)) if n <= 12 else [*range(8), *range(n - 4, n)]
    rows = [["ball", *columns]]
    for ball in balls:
        if ball and ball - 1 not in balls:
            rows.append(["…"] * len(rows[0]))
        cells = [f"{v[ball]:.6g}" if ball < len(v) else "" for v in columns.values()]
        rows.append([str(ball), *cells])
    head, *body = (
        f"<tr>{''.join(f'<{tag}>{cell}</{tag}>' for cell in row)}</tr>"
        for row, tag in zip(rows, ["th"] + ["td"] * len(rows), strict=False)
    )
    return f"<table><thead>{head}</thead><tbody>{''.join(body)}</tbody></table>"
