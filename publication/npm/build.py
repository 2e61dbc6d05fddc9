"""Make the npm package `newtons-cradle-impacts` from the book's own engine.

Usage::

    python publication/npm/build.py FOLDER     # then: npm publish FOLDER

The engine is the event loop of the package `cradle`, translated (book/_ext/explorer_engine.py). It
is a script that leaves its functions on the global object; the module gives it one of its own.
"""

import shutil
import sys
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT / "book" / "_ext")]

#: What the module exports; index.d.ts describes the same.
EXPORTS = ("collide", "outcome", "largestRatios")
FILES = ("package.json", "index.d.ts", "README.md", "example.html")


def module() -> str:
    """Return the ES module."""
    from explorer_engine import engine

    names = ", ".join(EXPORTS)
    return f"const globalThis = {{}};\n{engine()}export const {{ {names} }} = globalThis.cradle;\n"


def build(folder: Path) -> None:
    """Write the package's files into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in (*(HERE / name for name in FILES), ROOT / "LICENSE"):
        shutil.copy(path, folder)
    (folder / "index.js").write_text(module(), encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    build(Path(sys.argv[1]))
