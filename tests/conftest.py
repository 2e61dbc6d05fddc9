"""Settings that all tests share: processes, random examples, what is made once for all."""

import os
import subprocess
import sys
import time
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


#: Processor time of the whole suite in minutes, compiling included, as measured when last changed.
MINUTES = 13


def pytest_report_header(config: pytest.Config) -> str | None:
    """Say how long it will take."""
    whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS
    if not whole or config.option.markexpr != "not exhaustive":
        return None
    workers = config.getoption("numprocesses", None) or 1
    return (
        f"the whole suite takes some {MINUTES} minutes of processor time: about "
        f"{max(round(MINUTES / workers), 1)} minutes with {workers} idle processor(s)"
    )


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Return how many processes: none beside this one for single files, else up to four.

    Each one takes half a gigabyte.
    """
    if all(Path(argument.partition("::")[0]).is_file() for argument in config.args):
        return 0
    own = getattr(os, "sched_getaffinity", None)
    return min(len(own(0)) if own else os.cpu_count() or 1, 4)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile before several processes would do it at once; they find the result on disk."""
    if session.config.getoption("numprocesses", None) and not session.config.option.collectonly:
        code = "from cradle.drive import warm_up; warm_up()"
        subprocess.run([sys.executable, "-c", code], check=True)


@pytest.fixture(scope="session")
def html(tmp_path_factory: pytest.TempPathFactory, root: Path) -> Path:
    """Build the book, warnings as errors: once, by the first of several processes that asks."""
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent
    folder, report = shared / "book", shared / "book.txt"
    try:
        folder.mkdir()
    except FileExistsError:
        for _ in range(600):
            if report.exists():
                break
            time.sleep(1)
    else:
        command = "from jupyter_book.cli.main import main; main()"
        build = subprocess.run(
            [sys.executable, "-c", command, "build", root, "--path-output", folder, "-W", "-n",
             "--keep-going"],
            cwd=root,
            capture_output=True,
            text=True,
            check=False,
        )  # fmt: skip
        text = "done" if build.returncode == 0 else build.stdout + build.stderr
        (shared / "book.part").write_text(text, encoding="utf-8")
        (shared / "book.part").replace(report)
    text = report.read_text(encoding="utf-8")
    assert text == "done", text
    return folder / "_build" / "html"
