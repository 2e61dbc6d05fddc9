"""Chapters of the book as they are stored."""

from ast import literal_eval
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
                    text = output.data[GLUED]
                    self.glued[key] = literal_eval(text) if text[0] in "'\"" else text

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
