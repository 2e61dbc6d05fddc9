"""How pytest treats the notebooks of the book."""

import os
from typing import Any

import nbval.kernel
import pytest

# A backend chosen outside would keep figures out of the notebooks' outputs.
os.environ.pop("MPLBACKEND", None)

_start = nbval.kernel.start_new_kernel


def start_again(**options: Any) -> Any:
    """Start a kernel; once more if another program has taken one of its ports meanwhile."""
    try:
        return _start(**options)
    except RuntimeError:
        return _start(**options)


nbval.kernel.start_new_kernel = start_again


def pytest_collectstart(collector: pytest.Collector) -> None:
    """Leave SVG out of nbval's comparison, like PNG: tests/ checks the plotted numbers."""
    if hasattr(collector, "skip_compare"):
        collector.skip_compare += ("image/svg+xml",)
