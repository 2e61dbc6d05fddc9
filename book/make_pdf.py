"""Print the whole book to one PDF with a headless Chromium or Chrome.

Usage::

    python book/make_pdf.py [FILE]     # default: _build/html/cradle-companion.pdf

Chromium is found on the path, or named by the environment variable CHROMIUM.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
DEFAULT = ROOT / "_build" / "html" / "cradle-companion.pdf"
NAMES = (
    "chromium",
    "chromium-headless-shell",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
)


def browser() -> str:
    """Return the command of a browser that can print."""
    for name in (os.environ.get("CHROMIUM", ""), *NAMES):
        found = shutil.which(name) if name else None
        if found:
            return found
    raise SystemExit(
        f"no browser to print with: install one of {', '.join(NAMES)}"
    )


def main(target: Path) -> None:
    """Build the book as one page and print it."""
    command = browser()
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [sys.executable, "-c", "from jupyter_book.cli.main import main; main()", "build", ROOT,
             "--path-output", folder, "--builder", "singlehtml"],
            check=True,
        )  # fmt: skip
        html = Path(folder, "_build", "singlehtml")
        # The page is written as if it stood at the top of its folder.
        page = html / "all.html"
        shutil.copy(html / "book" / "intro.html", page)
        target.parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(
            [command, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run",
             "--disable-background-networking", f"--user-data-dir={folder}/profile",
             "--virtual-time-budget=120000", "--no-pdf-header-footer",
             f"--print-to-pdf={target.resolve()}", page.as_uri()],
            check=True,
        )  # fmt: skip
    show_link(target)
    print(f"{target}: {target.stat().st_size / 1e6:.1f} MB")


def show_link(target: Path) -> None:
    """Write the link to the file into the book that it was put into, if there is one."""
    page = target.parent / "book" / "cite.html"
    if page.is_file() and target.name == DEFAULT.name:
        text = page.read_text(encoding="utf-8")
        page.write_text(
            text.replace(
                '<p id="pdf" hidden></p>',
                '<p id="pdf">The whole book in one file: '
                f'<a href="../{target.name}">PDF of all pages</a>.</p>',
            ),
            encoding="utf-8",
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT)
