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
    return np.where(np.abs(values) < 1e-12 * np.abs(values).max(initial=0.0), 0.0, values) + 0.0


def as_html(columns: Mapping[str, NDArray[Any]]) -> str:
    """Return a table of balls; of many the first and the last.  A column may be shorter."""
    import pandas as pd

    table = pd.DataFrame({name: pd.Series(column) for name, column in columns.items()})
    form: dict[str, Any] = {"float_format": "{:.6g}".format, "na_rep": "", "max_rows": 12}
    return str(table.rename_axis("ball", axis=1).to_html(**form))
