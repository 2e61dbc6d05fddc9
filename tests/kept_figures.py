"""What the cells of notebooks draw, kept for all processes: nbval's kernels draw it first.

An extension of IPython, too: in a kernel `plt.show` keeps what it shows.
"""

import hashlib
import os
import pickle
import sys
from pathlib import Path

import matplotlib.pyplot as plt
from built_book import SHARED
from IPython.core.interactiveshell import InteractiveShell
from matplotlib.figure import Figure

_CONFIGURATION = """import sys
sys.path.append({tests!r})
c.InteractiveShellApp.extensions = ["kept_figures"]
"""


def _place(source: str) -> Path | None:
    """Return where the figure of a cell with this source is kept, in the whole suite."""
    shared = os.environ.get(SHARED)
    return Path(shared, hashlib.sha256(source.encode()).hexdigest()) if shared else None


def keep(source: str, figure: Figure) -> None:
    """Keep the figure that a cell has drawn."""
    if place := _place(source):
        part = place.with_suffix(f".{os.getpid()}")
        part.write_bytes(pickle.dumps(figure))
        part.replace(place)


def kept(source: str) -> Figure | None:
    """Return the figure of a cell with this source, if there is one by now."""
    place = _place(source)
    return pickle.loads(place.read_bytes()) if place and place.exists() else None


def in_kernels(shared: str) -> None:
    """Let kernels keep what they draw: those that this process and its children will start."""
    tests = str(Path(__file__).parent)
    profile = Path(shared, "profile_default")
    profile.mkdir()
    configuration = profile / "ipython_kernel_config.py"
    configuration.write_text(_CONFIGURATION.format(tests=tests), encoding="utf-8")
    os.environ["IPYTHONDIR"] = shared


def load_ipython_extension(shell: InteractiveShell) -> None:
    """Begin to keep figures; called by IPython."""
    # What a notebook imports shall not be found here.
    sys.path.remove(str(Path(__file__).parent))
    source, shown = "", plt.show

    def note(cell) -> None:
        nonlocal source
        source = cell.raw_cell

    def show(*arguments, **options) -> None:
        figure = plt.gcf()
        shown(*arguments, **options)
        figure.canvas.draw()
        keep(source, figure)

    shell.events.register("pre_run_cell", note)
    plt.show = show
