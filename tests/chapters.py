"""Chapters of the book: as they are stored, run with other numbers, and what they draw."""

import ast
import contextlib
import decimal
import functools
import io
import re
from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import nbformat
import numpy as np
from kept_figures import keep, kept
from matplotlib.figure import Figure
from page import WORDS

from cradle import textbook

BOOK = Path(__file__).parents[1] / "book"

GLUED = "application/papermill.record/text/plain"
A_RATIO = re.compile("ratio|alpha|gamma|tried|nominal|asked|backward|forward", re.IGNORECASE)


class Chapter:
    """The cells of a chapter by id, and the values that its text takes from them."""

    def __init__(self, name):
        self.name = name
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
                    self.glued[key] = ast.literal_eval(text) if text[0] in "'\"" else text

    @property
    def figures(self):
        """Run the cells, and return what they draw: figures by name."""
        return drawn(self.name)

    def printed(self, cell_id):
        """What a cell prints, and its tables as text."""
        texts = []
        for output in self.cells[cell_id].outputs:
            if output.output_type == "stream":
                texts.append(output.text)
            elif "text/html" in output.get("data", ()):
                texts.append(output.data["text/plain"] + "\n")
        return "".join(texts)

    def tells(self, values: dict[str, object], off: float = 0.0) -> None:
        """Check that the text shows these values: words as they are, numbers rounded to its digits.

        `off` is what the route to the values may itself be wrong by.
        """
        for name, value in values.items():
            told = self.glued[name]
            if isinstance(value, str):
                assert told == value, name
            else:
                digits = re.search(r"[.](\d+)", told)
                unit = 10.0 ** -len(digits[1] if digits else "")
                assert abs(number(told) - value) <= (0.5 + 1e-9) * unit + off, (name, told, value)


def code(chapter: str) -> list:
    """Return the code cells of a chapter."""
    cells = nbformat.read(BOOK / f"{chapter}.ipynb", as_version=4).cells
    return [cell for cell in cells if cell.cell_type == "code"]


def shown(chapter: str) -> list:
    """Return the code cells that a reader sees without opening a fold, or is to write."""
    hidden = {"hide-input", "hide-cell", "remove-cell"}
    return [
        cell
        for cell in code(chapter)
        if "solution" in (tags := set(cell.metadata.get("tags", ()))) or not hidden & tags
    ]


def parsed(cell) -> ast.Module:
    """Return the syntax tree of a code cell, without IPython's own commands."""
    lines = [line for line in cell.source.splitlines() if not line.startswith("%")]
    return ast.parse("\n".join(lines))


def written_ratios(tree: ast.AST) -> Iterator[ast.Constant]:
    """Find the ratios above 0 that code writes as numbers: in models, assignments and loops."""
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Name(id="ImpulseCorrelation")):
                keywords = [k.value for k in node.keywords if A_RATIO.search(k.arg or "")]
                places, named = [*node.args, *keywords], True
            case ast.For() | ast.comprehension():
                places, named = [node.iter], A_RATIO.search(ast.unparse(node.target))
            case ast.Assign():
                places, named = [node.value], A_RATIO.search(ast.unparse(node.targets[0]))
            case _:
                continue
        for place in places if named else []:
            for number in ast.walk(place):
                if isinstance(number, ast.Constant) and isinstance(number.value, float):
                    yield number


def run(
    cells: list, changes: dict[str, object], factor: float = 1.0, names: dict | None = None
) -> dict[str, object]:
    """Execute cells from top to bottom with other numbers; return all names."""
    names = {} if names is None else names
    names["__name__"] = "__main__"
    for number, cell in enumerate(cells, start=1):
        names["__cell__"] = cell
        tree = parsed(cell)
        for written in set(written_ratios(tree)):
            written.value *= factor
        exec(compile(tree, f"code cell {number}", "exec"), names)
        if "parameters" in cell.metadata.get("tags", []):
            names.update({name: changes[name] for name in changes.keys() & names.keys()})
    return names


@contextlib.contextmanager
def in_memory(show):
    """Draw without a screen and let `show` take the place of plt.show; undo everything after."""
    backend, shown = mpl.get_backend(), plt.show
    plt.switch_backend("agg")
    plt.show = show
    try:
        with mpl.rc_context(), decimal.localcontext():
            yield
    finally:
        plt.close("all")
        plt.show = shown
        plt.switch_backend(backend)


def figure_name(cell) -> str | None:
    return cell.metadata.get("mystnb", {}).get("figure", {}).get("name")


def shows_image(cell) -> bool:
    return any(
        kind.startswith("image/") for output in cell.outputs for kind in output.get("data", {})
    )


@functools.cache
def drawn(chapter: str, cells: tuple[str, ...] | None = None) -> dict[str, Figure]:
    """Return the figures of a chapter as stored, by name: if nobody has drawn them it is run.

    Of some `cells`, by their ids, only these are run; else all up to the last figure.
    """
    chosen = [cell for cell in code(chapter) if cells is None or cell.id in cells]
    while not figure_name(chosen[-1]):
        chosen.pop()
    pictures = {figure_name(cell): cell.source for cell in chosen if shows_image(cell)}
    figures = {name: kept(source) for name, source in pictures.items()}
    if all(figures.values()):
        return figures
    figures, names = {}, {}

    def show():
        cell, figure = names["__cell__"], plt.gcf()
        figures[figure_name(cell)] = figure
        figure.canvas.draw()
        plt.close(figure)

    with in_memory(show), contextlib.redirect_stdout(io.StringIO()):
        run(chosen, {}, names=names)
    for name, figure in figures.items():
        keep(pictures[name], figure)
    return figures


def lines(ax) -> dict[str, np.ndarray]:
    """The lines of a panel that have a name, by that name: points, shape (n, 2)."""
    return {
        line.get_label(): line.get_xydata()
        for line in ax.get_lines()
        if not line.get_label().startswith("_")
    }


def panel(chapter: str, figure: str, number: int = 0) -> dict[str, np.ndarray]:
    """The named lines of one panel of a chapter's figure."""
    return lines(drawn(chapter)[figure].axes[number])


def solved(chain, ratio, **options):
    """Path of velocities and of impulses by the textbook solver: not the one that draws."""
    done = textbook.solve(*chain, ratio, **options)
    return np.array(done.path), np.array(done.path_impulses)


def after(chain, ratio, **options):
    """Velocities after the impact, by the textbook solver."""
    return solved(chain, ratio, **options)[0][-1]


RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def number(text):
    """Read a number as a sentence has it: one, 222 144, −0.3, 2.2 million, 0.004, 3·10⁻⁷."""
    if text in WORDS:
        return WORDS.index(text)
    plain = text.replace("\u202f", "").replace("−", "-").removesuffix(" million")
    factor, _, power = (
        plain.rpartition("10") if set(plain) & set("⁻⁰¹²³⁴⁵⁶⁷⁸⁹") else (plain, "", "0")
    )
    scale = 1e6 if text.endswith(" million") else 10.0 ** int(power.translate(RAISED))
    return float(factor.removesuffix("·") or 1) * scale


def numbers(text):
    """Read all numbers with a point in a text."""
    return [float(x) for x in re.findall(r"-?\d+\.\d*", text.replace("−", "-"))]


def floats(values):
    """Numbers of any kind as an array of floats."""
    return np.array([float(x) for x in values])


def points(ax, size=None, marker=None):
    """Points of lines, in rows of x and y: of all, of so many points, or with this marker."""
    drawn = [line for line in ax.get_lines() if marker is None or line.get_marker() == marker]
    found = [np.column_stack(line.get_data()).astype(float) for line in drawn]
    return [xy for xy in found if size is None or len(xy) == size]


def shows(axes, values) -> bool:
    """Whether all of these numbers are among those of the lines drawn in some axes."""
    shown = np.concatenate([line.ravel() for ax in axes for line in points(ax)])
    return all(np.isclose(shown, value, rtol=1e-9, atol=0).any() for value in values)
