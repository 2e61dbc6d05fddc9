"""Which form of `kernel.py` runs: compiled by numba where numba is installed, else as it stands."""

from __future__ import annotations

import functools
import importlib.util
import os
import sys
from types import ModuleType
from typing import Any

from cradle import kernel as plain

#: Set this environment variable to ``plain`` to run the kernel as it stands.
VARIABLE = "CRADLE_KERNEL"


@functools.cache
def compiled() -> ModuleType | None:
    """Return the kernel's functions compiled, or None where numba is absent.

    The file is run a second time with `jit` replaced by the compiler, so that importing cradle
    costs no compiler.  Compiled code is kept on disk: only the first call on a machine compiles.
    """
    try:
        import numba
    except ImportError:
        return None
    spec = importlib.util.spec_from_file_location("cradle._compiled", plain.__file__)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # The same arithmetic as Python's: no reordering, no contraction; a division by zero gives
    # infinity, and the kernel makes none.  It allocates nothing, so arrays need no reference counts
    # (`_nrt`); without these and with its functions inlined the loop runs ten times faster.
    options: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
    options.update(forceinline=True, _nrt=False)
    vars(module)["jit"] = numba.njit(**options)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def chosen() -> ModuleType:
    """Return the kernel in force: compiled unless numba is absent or the user asks for plain."""
    if os.environ.get(VARIABLE) == "plain":
        return plain
    return compiled() or plain
