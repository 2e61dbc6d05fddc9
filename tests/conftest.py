"""Settings that all tests share."""

import os
import subprocess
import sys
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


@pytest.fixture(scope="session")
def html(tmp_path_factory: pytest.TempPathFactory, root: Path) -> Path:
    """Build the book, warnings as errors."""
    folder = tmp_path_factory.mktemp("book")
    command = "from jupyter_book.cli.main import main; main()"
    build = subprocess.run(
        [sys.executable, "-c", command, "build", root, "--path-output", folder, "-W", "-n",
         "--keep-going"],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )  # fmt: skip
    assert build.returncode == 0, build.stdout + build.stderr
    return folder / "_build" / "html"
