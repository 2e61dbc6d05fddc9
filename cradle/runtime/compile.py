"""How the event loop runs: as it stands, or compiled by numba, with the same bits.

The rooms of `cradle.kernel` are joined to one source file, named after a hash of their text and of
how they are compiled, and compiled as one unit, kept on disk by numba: an edit anywhere makes a new
unit, where numba alone would ask of each function its own file only.
"""

import ast
import contextlib
import contextvars
import functools
import importlib.util
import logging
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from cradle import kernel as plain
from cradle.input.values import one_of

#: Environment variable: ``plain`` runs the kernel as it stands, ``compiled`` compiles at once.
VARIABLE = "CRADLE_KERNEL"
#: Seconds of plain work after which compiling pays, and loading what is compiled already: about as
#: long as these take.  Until then work runs plain.
PAYS_AFTER, LOADS_AFTER = 10.0, 0.5

# The same arithmetic as Python's: no reordering, no contraction; a division by zero gives infinity,
# and the kernel makes none.  It allocates nothing, so arrays need no reference counts (`_nrt`),
# without which the loop runs several times faster.  Only the door is called from Python.  A
# function that says nothing about `forceinline` would take it over from its caller.
_APART: dict[str, Any] = {
    "nogil": True, "error_model": "numpy", "_nrt": False, "forceinline": False,
    "no_cfunc_wrapper": True, "no_cpython_wrapper": True,
}  # fmt: skip
#: What numba is told about the marks of the kernel's functions.
_MEANINGS: dict[str, dict[str, Any]] = {
    "jit": {**_APART, "forceinline": True},
    "apart": _APART,
    "door": {**_APART, "no_cpython_wrapper": False},
}

logger = logging.getLogger("cradle")
_spent = 0.0  # seconds of plain work so far, in this process
_hurry = contextvars.ContextVar("hurry", default=False)  # a frame of a game cannot wait
_deciding = threading.Lock()


@functools.cache
def unit(rooms: tuple[str, ...] = plain.ROOMS) -> str:
    """Return rooms of the kernel as one source, without comments and docstrings."""
    body: list[ast.stmt] = []
    documented = ast.Module | ast.ClassDef | ast.FunctionDef
    for room in rooms:
        tree = ast.parse(Path(plain.__file__).with_name(f"{room}.py").read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, documented) and ast.get_docstring(node):
                del node.body[0]
        for part in tree.body:
            if not (isinstance(part, ast.ImportFrom) and f"{part.module}".startswith("cradle.")):
                body.append(part)
    return ast.unparse(ast.Module(body, [])) + "\n"


class _Numba(ast.NodeTransformer):
    """Write every index that is worked out as a number without a sign, and what is inlined."""

    # An index below zero would count from the end.  The kernel has none, but numba would ask at
    # each of them, which takes a quarter of an impact's time.

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        self.generic_visit(node)
        node.decorator_list = node.decorator_list or [ast.Name("jit", ast.Load())]
        return node

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        self.generic_visit(node)
        if not isinstance(node.slice, ast.Constant):
            node.slice = ast.Call(ast.Name("unsigned", ast.Load()), [node.slice], [])
        return node


@functools.cache
def _for_numba(source: str) -> str:
    """Return a source in the form in which it is compiled."""
    return ast.unparse(ast.fix_missing_locations(_Numba().visit(ast.parse(source)))) + "\n"


def _name() -> str:
    """Return the name of the unit: a hash of its text and of how it is compiled."""
    import hashlib

    told = f"{_for_numba(unit())}{_MEANINGS}"
    return f"cradle_kernel_{hashlib.sha256(told.encode()).hexdigest()[:16]}"


def _folder() -> Path:
    """Return where the unit and its compiled code are kept: not where a wheel would take them."""
    if wish := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(wish)
    home = os.environ.get("LOCALAPPDATA") or os.environ.get("XDG_CACHE_HOME")
    usual = "~/Library/Caches" if sys.platform == "darwin" else "~/.cache"
    return (Path(home) if home else Path(usual).expanduser()) / "cradle-companion"


@functools.cache
def _stored() -> Path | None:
    """Write the unit where compiled code can be kept beside it; None if that cannot be written."""
    try:
        path = _folder() / f"{_name()}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        # Compiled code goes there too, so try to write even if the unit is there already.
        part = path.with_suffix(f".{os.getpid()}.{threading.get_ident()}.tmp")
        part.write_text(_for_numba(unit()), encoding="utf-8")
        # numba keeps compiled code as long as the time of its source does not change: the name says
        # enough, so the time is one for all, also where a cache is copied.
        os.utime(part, (0, 0))
        part.replace(path)
    except (OSError, RuntimeError):  # the latter where nobody knows a home
        return None
    return path


@functools.cache
def available() -> bool:
    """Tell whether numba is installed and not switched off."""
    off = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
    return not off and importlib.util.find_spec("numba") is not None


@functools.cache
def compiled() -> Any | None:
    """Return the kernel's door compiled (at its first call), or None where numba is absent."""
    if not available():
        return None
    try:
        import numba
    except ImportError:
        return None
    path, name = _stored(), _name()
    module = ModuleType(name)
    module.__file__ = str(path or name)
    for mark, options in _MEANINGS.items():
        vars(module)[mark] = numba.njit(**options, cache=mark == "door" and path is not None)
    vars(module)["unsigned"] = np.uint64
    sys.modules[name] = module
    exec(compile(_for_numba(unit()), module.__file__, "exec"), vars(module))
    # For numbers of its own numba does not compile a function anew at each call, as for Python's.
    for constant, value in vars(module).items():
        if type(value) is int:
            vars(module)[constant] = np.int64(value)
    return module


def _files(pattern: str) -> list[Path]:
    """Return the files that numba keeps of this very kernel."""
    path = _stored() if available() else None
    return [] if path is None else [*path.parent.rglob(f"{_name()}.{pattern}")]


def on_disk(door: str = "batch") -> bool:
    """Tell whether compiled code of this very kernel is on disk, from a door on."""
    return bool(_files(f"{door}-*.nbi"))


def loaded(door: str = "batch") -> bool:
    """Tell whether compiled code has run in this process, from a door on."""
    module = compiled() if compiled.cache_info().currsize else None
    return module is not None and bool(vars(module)[door].overloads)


def call(door: Callable[..., Any], *arguments: Any) -> Any:
    """Call the kernel; compiled code on disk that cannot be read is removed, and made anew."""
    global _spent
    if door in (plain.batch, plain.follow):
        begun = time.perf_counter()
        try:
            return door(*arguments)
        finally:
            _spent += time.perf_counter() - begun
    try:
        return door(*arguments)
    except Exception as error:  # half a file can raise anything; the kernel itself nothing
        if loaded(name := door.__name__):
            raise
        if not on_disk(name):
            compiled.cache_clear()  # what a signal interrupts begins anew
            raise
        broken = _files("*.nb[ci]")
        for file in broken:
            file.unlink(missing_ok=True)
        told = "compiled code in %s cannot be read (%r); compiled anew, up to a minute"
        logger.warning(told, broken[0].parent, error)
    return door(*arguments)


@contextlib.contextmanager
def without_waiting() -> Iterator[None]:
    """Neither compile nor load code meanwhile: what has not run yet in this process runs plain."""
    before = _hurry.set(True)
    try:
        yield
    finally:
        _hurry.reset(before)


# To look costs more than a small impact, so there is one look.
_found = functools.cache(lambda door: on_disk(door))


def chosen(large: bool = False, door: str = "batch") -> Any:
    """Return the kernel in force behind a door; `large` work is surely worth compiling for."""
    wish = os.environ.get(VARIABLE)
    if wish:
        one_of(VARIABLE, wish, ("plain", "compiled"))
    if wish != "plain" and loaded(door):
        return compiled()
    if wish == "plain" or not available() or _hurry.get():
        return plain
    # Threads that come here together share one module, which numba compiles once; and one at a time
    # parses source, as a look does: in Python 3.11 two can trip each other up.
    with _deciding:
        pays = wish == "compiled" or large or _spent > PAYS_AFTER
        if not (pays or (_spent > LOADS_AFTER and _found(door))):
            return plain
        module = compiled()
        if module is not None and not on_disk(door):
            _announce()
    return plain if module is None else module


@functools.cache
def _announce() -> None:
    alone = "in this process, as no folder for it is writable (set NUMBA_CACHE_DIR)"
    where = "once on this machine" if _stored() else alone
    logger.warning("compiling the event loop, %s: up to a minute", where)
