"""Chapters of the book as they are stored."""

from pathlib import Path

import nbformat

BOOK = Path(__file__).parents[1] / "book"
GLUED = "application/papermill.record/text/plain"


class Chapter:
    """The cells of a chapter by id, and the values that its text takes from them."""

    def __init__(self, name):
        notebook = nbformat.read(BOOK / f"{name}.ipynb", as_version=4)
        self.cells = {cell.id: cell for cell in notebook.cells}
        #: By name, without that of the chapter before it.
        self.glued = {}
        for cell in notebook.cells:
            for output in cell.get("outputs", ()):
                if GLUED in output.get("data", ()):
                    key = output.metadata.scrapbook.name.removeprefix(f"{name}-")
                    assert key not in self.glued, f"{name}-{key} is glued twice"
                    self.glued[key] = output.data[GLUED].strip("'")

    def printed(self, cell_id):
        """What a cell prints."""
        outputs = self.cells[cell_id].outputs
        return "".join(output.text for output in outputs if output.output_type == "stream")
