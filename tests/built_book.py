"""The book, built once for all tests that look at its pages, warnings as errors.

`python tests/built_book.py FOLDER` builds it there, unless somebody has begun to.
"""

import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: Names the folder that the processes of a session share; the first one sets it.
SHARED = "CRADLE_TESTS_SHARED"
#: Seconds; on an idle machine it takes less than one minute.
LONGEST = 1800
#: Scripts that take seconds of a page: of icons, and of equations.
HEAVY = "fontawesome.js", "tex-svg-full.js"


def build(shared: Path) -> None:
    """Build the book below this folder, and leave a report there."""
    folder = shared / "book"
    try:
        folder.mkdir()
    except FileExistsError:
        return
    text = "not built: interrupted"
    try:
        command = "from jupyter_book.cli.main import main; main()"
        done = subprocess.run(
            [sys.executable, "-c", command, "build", ROOT, "--path-output", folder, "-W", "-n",
             "--keep-going"],
            cwd=ROOT,
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            check=False,
        )  # fmt: skip
        text = "done" if done.returncode == 0 else done.stdout + done.stderr
        if text == "done":
            lighten(folder / "_build" / "html")
    finally:
        part = shared / "book.part"
        part.write_text(text, encoding="utf-8")
        part.replace(shared / "book.txt")


def lighten(html: Path) -> None:
    """Leave a copy of the pages beside them, `light`, with heavy scripts empty."""
    light = shutil.copytree(html, html.with_name("light"))
    for name in HEAVY:
        (script,) = light.rglob(name)
        script.write_bytes(b"")


def built(shared: Path) -> Path:
    """Build the book or wait for who does, and return the folder of its pages."""
    build(shared)
    report, begun = shared / "book.txt", time.monotonic()
    while not report.exists():
        assert time.monotonic() - begun < LONGEST, "whoever builds the book does not finish"
        time.sleep(0.2)
    text = report.read_text(encoding="utf-8")
    assert text == "done", text
    return shared / "book" / "_build" / "html"


if __name__ == "__main__":
    build(Path(sys.argv[1]))
