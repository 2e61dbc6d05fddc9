"""Kernels of notebooks as copies of one process that has imported already what chapters import.

`python tests/kernel_copies.py` makes them: it reads what a kernel is to be started with, a line
each, and answers with the number of its process.
"""

import builtins
import contextlib
import gc
import importlib
import json
import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

from jupyter_client.provisioning import local_provisioner

BOOK = Path(__file__).parents[1] / "book"
#: What most chapters import.
LOADED = (
    "ipykernel.kernelapp", "matplotlib.pyplot", "pandas", "scipy.integrate", "scipy.optimize",
    "sympy",
)  # fmt: skip


class Copy:
    """The process of a kernel, as far as its manager asks about it."""

    stdin = stdout = stderr = None

    def __init__(self, pid: int):
        self.pid = pid

    def poll(self) -> int | None:
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return 0
        return None

    def wait(self) -> int:
        while self.poll() is None:
            time.sleep(0.01)
        return 0

    def send_signal(self, number: int) -> None:
        os.kill(self.pid, number)


def copied() -> Callable[[], None]:
    """Let kernels that this process starts be copies; return what ends it.

    Elsewhere than on Linux they start as ever: copies made there may not work.
    """
    maker: subprocess.Popen | None = None
    launch = local_provisioner.launch_kernel

    def copy(command: list[str], *, cwd: str, env: dict[str, str], **_: object) -> Copy:
        nonlocal maker
        if maker is None:
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
            maker = subprocess.Popen([sys.executable, __file__], text=True, bufsize=1, **pipes)
        maker.stdin.write(json.dumps([command, cwd, env]) + "\n")
        return Copy(int(maker.stdout.readline()))

    def end() -> None:
        local_provisioner.launch_kernel = launch
        if maker is not None:
            with maker:
                maker.stdin.close()

    if sys.platform == "linux":
        local_provisioner.launch_kernel = copy
    return end


def load() -> None:
    """Import what is `LOADED`, where and as a kernel of a chapter would."""
    sys.path.remove(str(Path(__file__).parent))
    os.chdir(BOOK)  # where matplotlib finds its settings
    os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"
    # pandas asks at its import whether it is in a notebook.
    builtins.get_ipython = lambda: SimpleNamespace(kernel=None)
    for name in LOADED:
        importlib.import_module(name)
    del builtins.get_ipython
    importlib.import_module("cradle.runtime.job").warm_up()
    gc.freeze()  # collections would write to all that copies share


def become(command: list[str], cwd: str, env: dict[str, str]) -> None:
    """Turn this process into a kernel, until it ends."""
    from ipykernel.kernelapp import launch_new_instance

    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(nothing, stream)
    os.chdir(cwd)
    os.environ.clear()
    os.environ.update(env)
    end_with = f"--IPKernelApp.parent_handle={os.getppid()}"
    sys.argv = [*command[command.index("-m") + 1 :], end_with]
    launch_new_instance()


def forget(*_: object) -> None:
    """Let go of copies that have ended."""
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


def serve() -> None:
    """Make a copy for each line that comes, until none does."""
    signal.signal(signal.SIGCHLD, forget)
    for line in sys.stdin:
        with warnings.catch_warnings():
            # Python warns where there are threads; those of OpenBLAS end before a fork.
            warnings.simplefilter("ignore", DeprecationWarning)
            pid = os.fork()
        if pid:
            with contextlib.suppress(OSError):  # the copy has done it before
                os.setpgid(pid, pid)  # whoever signals to its group means it alone
            print(pid, flush=True)
        else:
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            os.setpgid(0, 0)
            become(*json.loads(line))
            os._exit(0)


if __name__ == "__main__":
    load()
    serve()
