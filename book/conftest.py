"""How pytest treats the notebooks of the book."""

import os

import pytest

# A backend chosen outside would keep figures out of the notebooks' outputs.
os.environ.pop("MPLBACKEND", None)


def pytest_collectstart(collector: pytest.Collector) -> None:
    """Leave SVG out of nbval's comparison, like PNG: tests/ checks the plotted numbers."""
    if hasattr(collector, "skip_compare"):
        collector.skip_compare += ("image/svg+xml",)
