"""Run notebooks from top to bottom and store their outputs, without traces of when and where.

Usage::

    python book/execute.py                       # every notebook of the book
    python book/execute.py book/intro.ipynb      # one of them
"""

import os
import sys
import tomllib
from pathlib import Path

import nbformat
import yaml
from nbclient import NotebookClient

BOOK = Path(__file__).parent
COLAB = "install-in-colab"


def execute(path: Path) -> None:
    """Run the notebook at `path` in its own folder, as the tests do, and write it back."""
    notebook = nbformat.read(path, as_version=4)
    put_colab_cell(notebook, colab_source())
    # record_timing would store when each cell ran: a difference at every run.
    client = NotebookClient(
        notebook,
        timeout=120,
        kernel_name="python3",
        record_timing=False,
        coalesce_streams=True,  # one output, however the text arrives
        resources={"metadata": {"path": str(path.parent)}},
    )
    client.execute()
    drop_stderr(notebook)
    strip(notebook)
    nbformat.validate(notebook)
    nbformat.write(notebook, path)


def colab_source() -> str | None:
    """Return the cell that installs the package in Colab, once the project has an address."""
    with (BOOK.parent / "_config.yml").open(encoding="utf-8") as file:
        if not yaml.safe_load(file)["sphinx"]["config"]["book_published"]:
            return None
    with (BOOK.parent / "pyproject.toml").open("rb") as file:
        address = tomllib.load(file)["project"]["urls"]["Repository"]
    return (
        'if "google.colab" in str(get_ipython()):\n'
        f'    %pip install -q "cradle-companion[book] @ git+{address}"'
    )


def put_colab_cell(
    notebook: nbformat.NotebookNode, source: str | None
) -> None:
    """Begin the notebook's code with this cell, which the built book does not show."""
    notebook.cells = [cell for cell in notebook.cells if cell.id != COLAB]
    if source is not None:
        notebook.cells.insert(
            1,
            nbformat.v4.new_code_cell(
                source, id=COLAB, metadata={"tags": ["remove-cell"]}
            ),
        )


def drop_stderr(notebook: nbformat.NotebookNode) -> None:
    """Pass on to the terminal what cells wrote to stderr: a compiler's or a library's remarks."""
    for number, cell in enumerate(notebook.cells):
        kept = []
        for output in cell.get("outputs", ()):
            if output.get("name") == "stderr":
                print(f"cell {number}: {output.text}", file=sys.stderr)
            else:
                kept.append(output)
        if "outputs" in cell:
            cell.outputs = kept


def strip(notebook: nbformat.NotebookNode) -> None:
    """Drop what changes from run to run or from machine to machine but says nothing."""
    notebook.metadata = nbformat.from_dict(
        {
            "kernelspec": {
                "display_name": "Python 3",
                "language": "python",
                "name": "python3",
            },
            "language_info": {"name": "python"},
        }
    )
    for cell in notebook.cells:
        for key in ("execution", "collapsed", "scrolled"):
            cell.metadata.pop(key, None)


def main(arguments: list[str]) -> None:
    """Execute the notebooks named, or all."""
    # A backend chosen outside would keep figures out of the notebooks.
    os.environ.pop("MPLBACKEND", None)
    # Matplotlib writes this instead of the date into an SVG file.
    os.environ.setdefault("SOURCE_DATE_EPOCH", "0")
    for path in [Path(name) for name in arguments] or sorted(
        BOOK.glob("*.ipynb")
    ):
        print(path)
        execute(path)


if __name__ == "__main__":
    main(sys.argv[1:])
