"""Settings that all tests share."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

# The same examples at every run of the same sources. Hypothesis also draws the numbers that it
# finds in the modules loaded so far: other sources, or a part of the tests, may give others. The
# weekly run against the newest dependencies sets HYPOTHESIS_PROFILE=random and looks for new ones.
settings.register_profile("same", derandomize=True, deadline=None, print_blob=True)
settings.register_profile("random", deadline=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))


@pytest.fixture(scope="session")
def root() -> Path:
    """The top of the repository."""
    return Path(__file__).parents[1]
