"""Chapters of the book as they are stored."""

import contextlib
import io
from ast import literal_eval
from functools import cached_property
from pathlib import Path

import matplotlib.pyplot as plt
import nbformat
import numpy as np
import pytest

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
                    text = output.data[GLUED]
                    self.glued[key] = literal_eval(text) if text[0] in "'\"" else text

    @cached_property
    def figures(self):
        """Run the cells, and return what they draw: figures by name."""
        drawn = {}
        names = {"__name__": "__main__"}
        with plt.rc_context(), pytest.MonkeyPatch.context() as patch:
            plt.switch_backend("agg")
            patch.setattr(plt, "show", lambda: None)
            patch.setattr("myst_nb.glue", lambda *_, **__: None)
            for cell in self.cells.values():
                if cell.cell_type != "code":
                    continue
                lines = [line for line in cell.source.splitlines() if not line.startswith("%")]
                with contextlib.redirect_stdout(io.StringIO()):
                    exec("\n".join(lines), names)
                name = cell.metadata.get("mystnb", {}).get("figure", {}).get("name")
                if name:
                    drawn[name] = plt.gcf()
                plt.close("all")
        return drawn

    def printed(self, cell_id):
        """What a cell prints."""
        outputs = self.cells[cell_id].outputs
        return "".join(output.text for output in outputs if output.output_type == "stream")


WORDS = [
    "no",
    "one",
    "two",
    "three",
    "four",
    "five",
    "six",
    "seven",
    "eight",
    "nine",
    "ten",
    "eleven",
    "twelve",
]
RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def number(text):
    """Read a number as a sentence has it: one, 222 144, 2.2 million, 0.004, 3·10⁻⁷."""
    if text in WORDS:
        return WORDS.index(text)
    plain = text.replace("\u202f", "").removesuffix(" million")
    factor, _, power = (
        plain.rpartition("10") if set(plain) & set("⁻⁰¹²³⁴⁵⁶⁷⁸⁹") else (plain, "", "0")
    )
    scale = 1e6 if text.endswith(" million") else 10.0 ** int(power.translate(RAISED))
    return float(factor.removesuffix("·") or 1) * scale


def points(ax, size=None):
    """Points of the lines of some axes, in rows of x and y; of lines of so many points alone."""
    lines = [np.column_stack(line.get_data()) for line in ax.get_lines()]
    return [np.asarray(xy, float) for xy in lines if size is None or len(xy) == size]
