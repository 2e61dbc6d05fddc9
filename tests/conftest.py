"""Settings that all tests share: processes, random examples, what is made once for all."""

import collections
import functools
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from built_book import SHARED, built
from explorer import Tab
from hypothesis import HealthCheck, settings
from kept_figures import in_kernels
from kernel_copies import copied
from pages import launched, visiting

# The same examples at every run of the same sources. Hypothesis also draws the numbers that it
# finds in the modules loaded so far: other sources, or a part of the tests, may give others. The
# weekly run against the newest dependencies sets HYPOTHESIS_PROFILE=random and looks for new ones.
# Nothing hangs on how fast the machine is.
any_speed = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow], "print_blob": True}
settings.register_profile("same", derandomize=True, **any_speed)
settings.register_profile("random", **any_speed)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))


@pytest.fixture(scope="session")
def root() -> Path:
    """The top of the repository."""
    return Path(__file__).parents[1]


#: Processor time of the whole suite in minutes, compiling included, as measured when last changed.
MINUTES = 9


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


#: Files that take longest, in this order: begun first, so that no process is left alone with one.
#: The first of them leave time to build the book, before others open its pages.
#: Notebooks come before the tests that look at what they draw.
LONG = (
    "tests/test_book_parameters.py", "tests/test_fit_swing.py", "tests/test_layout.py",
    "tests/test_explorer_reading.py", "book/toy.ipynb", "book/measure.ipynb",
    "book/real_cradles.ipynb", "book/", "tests/test_book_real_cradles.py",
    "tests/test_explorer_guess.py", "tests/test_explorer_touch.py", "tests/test_explorer_page.py",
    "tests/test_command.py", "tests/test_fit_law.py", "tests/test_real_cradles.py",
    "tests/test_reader_solver.py", "tests/test_kernel.py", "tests/test_extremes.py",
    "tests/test_fit.py", "tests/test_swing.py", "tests/test_explorer_spheres.py",
    "tests/test_speed.py", "tests/test_springs.py", "tests/test_work_area.py",
    "tests/test_explorer_engine.py", "tests/test_book_experiments.py", "tests/test_book_figures.py",
)  # fmt: skip


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the files that take longest first, in the order in which processes take them."""
    files = {item.nodeid.partition("::")[0] for item in items}
    places = {
        file: next((k for k, name in enumerate(LONG) if file.startswith(name)), len(LONG))
        for file in files
    }
    items.sort(key=lambda item: places[item.nodeid.partition("::")[0]])


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile, and list the fonts, before several processes would; they find the result on disk.

    Beside it, as the compiler keeps but one processor busy, the book is built if it will be needed.
    """
    option = session.config.option
    if hasattr(session.config, "workerinput"):
        session.config.add_cleanup(copied())
    if not session.config.getoption("numprocesses", None) or option.collectonly:
        return
    shared = tempfile.TemporaryDirectory(prefix="cradle-tests-", ignore_cleanup_errors=True)
    session.config.add_cleanup(shared.cleanup)
    os.environ[SHARED] = shared.name
    in_kernels(shared.name)
    everything = option.markexpr == "not exhaustive" and not option.keyword
    if everything and "tests" in session.config.args:
        book = subprocess.Popen(
            [sys.executable, Path(__file__).with_name("built_book.py"), shared.name]
        )
        session.config.add_cleanup(book.wait)
    code = "import matplotlib.font_manager; from cradle.runtime.job import warm_up; warm_up()"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.fixture(scope="session")
def html(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages of the book, built once for all processes."""
    return built(Path(os.environ.get(SHARED) or tmp_path_factory.mktemp("built")))


@pytest.fixture(scope="module")
def browser():
    """A Chromium for the tests of one file: the loop of its driver ends before others begin."""
    with launched() as browser:
        yield browser


@pytest.fixture(scope="module")
def idle() -> dict[tuple, list]:
    """Windows of the file's browser that no test uses at present, by their kind."""
    return collections.defaultdict(list)


@pytest.fixture
def visit(browser, idle, html: Path):
    """What opens the explorer's page, or a chapter."""
    with visiting(browser, idle, html) as visit:
        yield lambda *given, **options: Tab(visit(*given, **options))


@pytest.fixture(scope="module")
def linked(browser, idle, html: Path):
    """What follows a link on one page that tests share: those that look at a setting's answers."""
    with visiting(browser, idle, html) as visit:
        tab = Tab(visit(reduced_motion="reduce"))

        def follow(fragment="scene=example"):
            for address in ("speeds=0,0", fragment):  # the page hears of a change alone
                tab.go_to(address)
            return tab

        yield follow


@pytest.fixture
def still(visit):
    """The same for a reader who asked for less motion: nothing moves by itself."""
    return functools.partial(visit, reduced_motion="reduce")
