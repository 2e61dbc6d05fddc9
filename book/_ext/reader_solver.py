"""Sphinx extension: the reader's own solver of three balls, run in the page.

A page asks for it by `<div class="reader-solver" data-piece="rates"></div>`. The editor holds this
function without what the reader is to write, and without `data-piece` the whole program. All lines
are read from the page's notebook, so there is no second copy of them. Single calls are compared
with what the page's own lines give, and whole impacts with `cradle`, asked here.

Python runs in the browser by Brython, which comes from PyPI. Interpreter, `math` and the little of
numpy that the lines use are one script, loaded when the reader first presses Run. It holds a text
from which a worker is made: pages from a disk may start workers in no other way, and a worker can
be stopped.
"""

import ast
import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

HERE = Path(__file__).parent
PLACE = '<div class="reader-solver"'
#: The functions that the page builds up.
PIECES = ("rates", "way_to_stop", "three_balls")
#: What they need.
HEAD = "import numpy as np"
#: What each of them computes, told where the reader's lines come.
TOLD = {
    "rates": ("Eqs. 16 to 19; the bound is Eq. 34",),
    "way_to_stop": ("One way for each phase",),
    "three_balls": (
        "1 Who acts? Ask rates: push, dv",
        "2 u and slope of both contacts",
        "3 way_to_stop, twice: the nearer",
        "4 Work, and with it owed",
        "5 New tau, v (no +=); a row of path",
        "6 Next phase; who drives",
    ),
}
#: Calls of each of them that are checked first.
CALLS = {
    "rates": (
        "rates([1, 1, 1], 0.15, [True, True], 0)",
        "rates([1, 3, 1], 0.5, [True, True], 1)",
        "rates([1, 2, 1], 0.15, [False, True], 1)",
    ),
    "way_to_stop": (
        'way_to_stop("compression", 1, -2, 0)',
        'way_to_stop("expansion", 0, -2, 0.16)',
        'way_to_stop("expansion", 0, -2, 0)',
        'way_to_stop("idle", -1, 4, 0)',
        'way_to_stop("idle", -1, -4, 0)',
    ),
    "three_balls": (
        "three_balls([1, 1, 1], [1, 0, 0], [0.9, 0.8], 0.15)[1][2:]",
    ),
}
#: Title; masses, velocities, restitution, ratio. The page's own example is put in front.
CASES = (
    ("Equal balls, ratio 0: one leaves", ([1, 1, 1], [1, 0, 0], [1, 1], 0)),
    ("Both contacts lose energy", ([1, 2, 0.5], [1, 0.3, 0.1], [0.6, 0.9], 0.1)),
    ("A light ball rattles in the middle", ([1, 0.05, 1], [1, 0, 0], [1, 1], 0.2)),
    ("A ratio above its bound (Eq. 34)", ([1, 3, 1], [1, 0, 0], [0.9, 0.8], 0.5)),
)  # fmt: skip


def cells() -> list[str]:
    """Return the code of the page's cells."""
    path = HERE.parent / "own_solver.ipynb"
    found = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return [
        "".join(cell["source"])
        for cell in found
        if cell["cell_type"] == "code"
    ]


def parts(codes: list[str]) -> dict[str, str]:
    """Return the cells that define the pieces of the page's solver, by the name of the piece."""
    wanted = re.compile(rf"^def ({'|'.join(PIECES)})\(", re.MULTILINE)
    found = [
        (name, code.strip())
        for code in codes
        for name in wanted.findall(code)
    ]
    if sorted(name for name, _ in found) != sorted(PIECES):
        raise ValueError(
            f"book/own_solver.ipynb defines not each of {PIECES} once"
        )
    return dict(found)


def joined(codes: Iterable[str]) -> str:
    """Return cells as one program."""
    return "\n\n\n".join([HEAD, *codes]) + "\n"


def lines(codes: list[str]) -> str:
    """Return the page's solver: the cells that define its pieces."""
    return joined(parts(codes).values())


def without(code: str, piece: str) -> str:
    """Return lines with the body of one function, or that of its loop, left to the reader."""
    (function,) = (
        node
        for node in ast.parse(code).body
        if isinstance(node, ast.FunctionDef) and node.name == piece
    )
    told = ast.get_docstring(function) is not None
    left = function.body[told:]
    for node in function.body:
        if isinstance(node, ast.While):
            left = node.body
    margin = " " * left[0].col_offset
    rows = code.splitlines()
    rows[left[0].lineno - 1 : left[-1].end_lineno] = [
        *(f"{margin}# {line}" for line in TOLD[piece]),
        f'{margin}raise NotImplementedError("Your lines come here.")',
    ]
    return "\n".join(rows) + "\n"


def texts(codes: list[str]) -> dict[str, dict[str, str]]:
    """Return what each editor begins with, by its piece, and the lines that are run after it."""
    pieces = parts(codes)
    found = {"": {"own": lines(codes), "rest": ""}}
    for piece, code in pieces.items():
        own = without(code, piece)
        rest = [other for name, other in pieces.items() if name != piece]
        found[piece] = {
            "own": f"{HEAD}\n\n\n{own}" if "np." in code else own,
            "rest": joined(rest),
        }
    return found


def example(codes: list[str]) -> tuple[list[float], list[float], list[float], float]:  # fmt: skip
    """Return the numbers of the page's example."""
    (parameters,) = (code for code in codes if code.startswith("masses = "))
    values: dict[str, Any] = {}
    exec(parameters, values)
    return tuple(
        values[name]
        for name in ("masses", "velocities", "restitution", "ratio")
    )


def calls(codes: list[str]) -> dict[str, list[dict[str, Any]]]:
    """Return the first calls of each piece, and the rows of numbers that the page's lines give."""
    names: dict[str, Any] = {}
    exec(lines(codes), names)

    def rows(found: Any) -> list[list[float]]:
        several = found if isinstance(found, tuple) else [[found]]
        return [[float(value) for value in row] for row in several]

    return {
        piece: [
            {"asked": call, "expected": rows(eval(call, names))}
            for call in several
        ]
        for piece, several in CALLS.items()
    }


def checks(codes: list[str]) -> list[dict[str, Any]]:
    """Return what is asked of the reader's solver, and the answers of `cradle`."""
    from cradle import Chain, ImpulseCorrelation, collide

    asked = []
    for title, (masses, velocities, restitution, ratio) in (
        ("The example of this page", example(codes)),
        *CASES,
    ):
        trace = collide(
            Chain(masses, velocities, restitution),
            ImpulseCorrelation(ratio, excess="saturate"),
        )
        asked.append(
            {
                "title": title,
                "given": [masses, velocities, restitution, ratio],
                "expected": trace.velocities.tolist(),
            }
        )
    return asked


def data() -> dict[str, Any]:
    """Return what the page shows: the texts to begin with, and the checks."""
    codes = cells()
    return {
        "texts": texts(codes),
        "calls": calls(codes),
        "checks": checks(codes),
    }


def interpreter() -> str:
    """Return the script of the worker: Brython, the modules it may import, and what it answers."""
    import brython

    folder = Path(brython.__file__).parent / "data"
    core, library = (
        (folder / f"{name}.js").read_text(encoding="utf-8")
        for name in ("brython", "brython_stdlib")
    )
    start = library.index("{", library.index("var scripts"))
    modules, _ = json.JSONDecoder().raw_decode(library[start:])
    kept = {name: modules[name] for name in ("$timestamp", "math")}
    numpy = (HERE / "solver_numpy.py").read_text(encoding="utf-8")
    kept["numpy"] = [".py", numpy, ["math"]]
    worker = (HERE / "solver_worker.js").read_text(encoding="utf-8")
    return (
        # A worker made from a text has no address, for which Brython asks. It asks for a language
        # too, and stops if that is none, as WebKit's "C" without a locale; this one comes first.
        'globalThis.__BRYTHON__ = {brython_path: "file:///"};\n'
        'navigator.userLanguage = "en";\n'
        f"{core}\n;globalThis.modules = {json.dumps(kept)};\n{worker}"
    )


def add_scripts(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Give a page with an editor its script and style."""
    if PLACE in context.get("body", ""):
        app.add_css_file("solver.css")
        for script in ("solver_data.js", "solver.js"):
            app.add_js_file(script, loading_method="defer")


def write_data(app: Sphinx, exception: Exception | None) -> None:
    """Write the data of the page, and the interpreter as a text."""
    if exception is not None or app.builder.format != "html":
        return
    for name, key, value in (
        ("data", "cradleSolver", data()),
        ("python", "cradlePython", interpreter()),
    ):
        Path(app.outdir, "_static", f"solver_{name}.js").write_text(
            f"globalThis.{key} = {json.dumps(value)};\n", encoding="utf-8"
        )


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the callbacks."""
    app.connect("html-page-context", add_scripts)
    app.connect("build-finished", write_data)
    return {
        "version": "1",
        "parallel_read_safe": True,
        "parallel_write_safe": True,
    }
