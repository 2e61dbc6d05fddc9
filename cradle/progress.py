"""The bar that shows how far long work has come."""

from __future__ import annotations

import importlib.util
from typing import Any


def progress_bar(**options: Any) -> Any:
    """Return a bar of tqdm: a notebook's own where it can be drawn, else letters.

    A notebook draws its own with ipywidgets; without them `tqdm.auto` would warn.
    """
    if importlib.util.find_spec("ipywidgets") is None:
        from tqdm import tqdm
    else:
        from tqdm.auto import tqdm
    return tqdm(**options)
