"""What nbval does not see: cleared outputs, warnings, timestamps, figures without a description."""

import contextlib
import copy
import io
import re
import subprocess
import sys
from pathlib import Path

import execute
import jupyter_client
import nbformat
import nbval.kernel
import pytest
from built_book import SHARED
from chapters import code, run, shown, shows_image
from jupyter_client.provisioning import local_provisioner
from kept_figures import in_kernels, kept
from kernel_copies import copied
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

BOOK = Path(__file__).parents[1] / "book"
NOTEBOOKS = sorted(BOOK.glob("**/*.ipynb"))

# Random ids (animations, styled tables) cannot be compared. A handful of cells in the whole book.
MOST_UNCOMPARED_CELLS = 5
UNCOMPARED = re.compile(r"nbval-ignore-output|NBVAL_IGNORE_OUTPUT|PYTEST_VALIDATE_IGNORE_OUTPUT")
UNRUN = re.compile(
    r"nbval-skip|NBVAL_SKIP|raises-exception|NBVAL_RAISES_EXCEPTION|nbval-check-output|skip-execution"
)


# Letters of a line of code that the page shows unbroken, where it is 1200 pixels wide.
WIDEST = 68


def marks(cell) -> str:
    """Return all that tells nbval how to treat a cell: its tags, and comments in its source."""
    comments = [line for line in cell.source.splitlines() if line.lstrip().startswith("#")]
    return "\n".join([*cell.metadata.get("tags", []), *comments])


def faults(notebook) -> list[str]:
    """List what is wrong with the stored form of a notebook."""
    found = []
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    counts = [cell.execution_count for cell in code]
    if counts != list(range(1, len(code) + 1)):
        found.append(f"execution counts {counts}: not run once from top to bottom")
    if "widgets" in notebook.metadata:
        found.append("widget state is stored")
    for number, cell in enumerate(code, start=1):
        where = f"code cell {number}: "
        kinds = [output.output_type for output in cell.outputs]
        if "error" in kinds:
            found.append(where + "ends in an error")
        if any(output.get("name") == "stderr" for output in cell.outputs):
            found.append(where + "writes to stderr (a warning?)")
        if "execution" in cell.metadata:
            found.append(where + "stores when it ran")
        if UNRUN.search(marks(cell)):
            found.append(where + "is not run, or may fail")
        if shows_image(cell):
            settings = cell.metadata.get("mystnb", {})
            if not settings.get("image", {}).get("alt", "").strip():
                found.append(where + "image without alt text")
            if not settings.get("figure", {}).get("caption", "").strip():
                found.append(where + "image without caption")
    for cell in notebook.cells:
        if cell.cell_type == "markdown" and re.search(r"!\[\s*\]\(", cell.source):
            found.append("an image in the text has no alt text")
    return found


def test_the_book_has_notebooks():
    assert NOTEBOOKS


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_stored_form(path: Path):
    assert faults(nbformat.read(path, as_version=4)) == []


def test_few_cells_escape_comparison():
    escaping = [
        f"{path.name}: {cell.source[:60]}"
        for path in NOTEBOOKS
        for cell in nbformat.read(path, as_version=4).cells
        if cell.cell_type == "code" and UNCOMPARED.search(marks(cell))
    ]
    assert len(escaping) <= MOST_UNCOMPARED_CELLS, escaping


@pytest.mark.parametrize(
    "chapter",
    [
        "problem",
        "compliance",
        "three_balls",
        "own_solver",
        "multiple_impacts",
        "patterns",
        "n_balls",
        "measure_ratios",
        pytest.param("measure", marks=pytest.mark.exhaustive),  # its fit takes seconds
    ],
)
def test_shown_cells_can_be_typed_in(chapter: str):
    """They use no name of a hidden cell, and their lines fit the page of a desk."""
    cells = shown(chapter)
    assert len(cells) > 1
    with contextlib.redirect_stdout(io.StringIO()):
        run(cells, {})
    wide = [line for cell in cells for line in cell.source.splitlines() if len(line) > WIDEST]
    assert not wide


def sample():
    """Return a small notebook without a fault."""
    picture = new_output("display_data", data={"image/png": "", "text/plain": "<Figure>"})
    described = {"mystnb": {"image": {"alt": "A line."}, "figure": {"caption": "A line."}}}
    return new_notebook(
        cells=[
            new_markdown_cell("![a ball](ball.svg)"),
            new_code_cell(
                "print(6 * 7)",
                execution_count=1,
                outputs=[new_output("stream", name="stdout", text="42\n")],
            ),
            new_code_cell("draw()", execution_count=2, outputs=[picture], metadata=described),
        ]
    )


def change(path, value):
    def spoil(notebook):
        target = notebook.cells
        for key in path[:-1]:
            target = target[key]
        target[path[-1]] = value

    return spoil


@pytest.mark.parametrize(
    ("spoil", "fault"),
    [
        (change([2, "execution_count"], 3), "not run once"),
        (change([1, "outputs", 0], new_output("error", ename="E", evalue="")), "an error"),
        (change([1, "outputs", 0, "name"], "stderr"), "stderr"),
        (change([1, "metadata", "execution"], {"iopub.execute_input": "..."}), "when it ran"),
        (change([1, "metadata", "tags"], ["nbval-skip"]), "not run"),
        (change([1, "metadata", "tags"], ["raises-exception"]), "may fail"),
        (change([1, "source"], "# NBVAL_SKIP\nprint(42)"), "not run"),
        (change([2, "metadata", "mystnb", "image", "alt"], " "), "without alt text"),
        (change([2, "metadata", "mystnb", "figure"], {}), "without caption"),
        (change([0, "source"], "![](ball.svg)"), "no alt text"),
        (lambda notebook: notebook.metadata.update(widgets={}), "widget state"),
    ],
)
def test_each_fault_is_seen(spoil, fault):
    notebook = copy.deepcopy(sample())
    assert faults(notebook) == []
    spoil(notebook)
    assert any(fault in line for line in faults(notebook))


# Decimals that the text may state: given by the paper, by an exercise, or chosen for an example.
# All others are computed by a cell, and the text takes them from there ({glue:text}`...`).
GIVEN = {
    "intro": "0.15",
    "problem": "0.15",
    "compliance": "0.15",
    "three_balls": "0.01 0.09 0.1 0.11 0.15 0.8 0.9",
    "own_solver": "0.02 0.1 0.15 0.3",
    "multiple_impacts": "0.15 0.2 0.25 0.8",
    "patterns": "0.01 0.15 0.25 0.3 0.4 0.5 0.9 2.5",
    "n_balls": "0.1 0.15 0.5 1.5 4.5",
    "experiments": "0.01 0.5",  # a step, and what is small beside it
    "toy": "0.975 0.99",
    "real_cradles": "0.01 0.1 0.2 0.4 25.3",  # errors, distances, frames
    "recipe": "",
    "scene": "0.1 0.97",  # a step, and a restitution of the run
    "measure": "0.3 0.35 0.5 0.7 1.4 1.5",
    "measure_ratios": "3.84",
    "table_2": "0.001 0.01 0.129 0.215 0.22 0.390 0.462 0.710 0.755 0.782",
    "forces": "0.5 0.9",  # what laws of loss are set to
    "forces_method": "",
    "trade": "",
    "engines": "",
    "laws": "0.5",
    "related": "0.072 0.15",
    "beyond": "0.01 0.9 0.99 0.999",
    "errata": "0.0001 0.001 0.01 0.018 0.1 0.10 0.1354936 0.15 0.171 0.17121 0.2 0.20 0.25"
    " 0.3 0.348 0.390 0.5 0.710 0.748331 0.755 0.8 0.848649 0.864099 0.9 0.95"
    " 0.951351",
    "extremes": "0.15 0.4 0.98",
    "extremes_maps": "0.1 0.3 0.8 0.9 22.6",
    "extremes_inventory": "0.01 0.1 0.5 0.9",
    "notation": "",
    "reading_problem": "0.2",
    "reading_compliance": "",
    "reading_three_balls": "0.5 0.95",
    "reading_multiple_impacts": "0.15 0.25 0.8",
    "reading_patterns": "0.003 0.01 0.15 0.3475 0.348 0.5 0.999",
    "reading_counting": "0.15 0.4 0.5",
    "reading_n_balls": "0.1 0.5",
    "reading_rules": "0.1 0.15 0.2 0.5 0.8",
    "reading_solver": "0.01 0.1 0.3 0.5 0.7",
    "reading_table_2": "0.22 0.390 0.710 0.755",
    "observations": "0.15 0.71 0.9 0.95 0.99",
    "observations_film": "0.1 0.2 0.5",  # a distance, an error, a speed
    "observations_half": "1.28 22.2 44.8",  # 50 pixels over 39; mm, grams
    "ledger": "",
}


def decimals(text: str) -> set[str]:
    """Return the decimals typed in a text: none in code, roles, links or displayed formulas."""
    for nothing in (
        r"(?s)```.*?```|\$\$.*?\$\$",
        r"\{[\w:]+\}`[^`]*`|`[^`]*`|\]\([^)]*\)|\([\w-]+\)=|\\tag\{[^}]*\}",
        r"[Ss]ections? \d\.\d( and \d\.\d)?",
    ):
        text = re.sub(nothing, "", text)
    return set(re.findall(r"(?<![\w.])\d*\.\d+", text))


@pytest.mark.parametrize("chapter", GIVEN)
def test_no_computed_number_is_typed(chapter: str):
    typed = set()
    for cell in nbformat.read(BOOK / f"{chapter}.ipynb", as_version=4).cells:
        caption = cell.metadata.get("mystnb", {}).get("figure", {}).get("caption", "")
        typed |= decimals(cell.source if cell.cell_type == "markdown" else caption)
    assert typed == set(GIVEN[chapter].split())


def test_a_typed_number_is_seen():
    assert decimals("It leaves with 0.347 m/s, $e = .5$.") == {"0.347", ".5"}
    assert not decimals("It is {glue:text}`patterns-0.1`, `0.2`, section 2.5, $$ 0.3 $$")


def test_letters_of_the_chapters_have_one_line_on_the_notation_page():
    """Greek ones of chapters 1 to 7 and of the program; a letter without index has one meaning."""
    words = {
        name: "".join(
            cell.source
            for cell in nbformat.read(BOOK / f"{name}.ipynb", as_version=4).cells
            if cell.cell_type == "markdown"
        )
        for name in ("problem", "compliance", "three_balls", "own_solver", "multiple_impacts",
                     "patterns", "n_balls", "experiments", "notation")
    }  # fmt: skip
    # The modes of chapter 2 stand beside it.
    beside = nbformat.read(BOOK / "reading_compliance.ipynb", as_version=4).cells
    (words["modes"],) = (cell.source for cell in beside if cell.id == "compliance-modes")
    book_wide = words.pop("notation")
    rows = re.findall(r"(?m)^\| ([^|]*\$[^|]*) \|", book_wide)
    symbols = [symbol.strip() for row in rows for symbol in re.split(r",|\$", row)]
    symbols = [symbol.removeprefix("\\ ") for symbol in symbols if symbol]
    assert len(symbols) == len(set(symbols)) > 40
    greek = "alpha|gamma|delta|theta|kappa|lambda|mu|rho|sigma|tau|(?:var)?phi|omega|Delta|beta|eta"
    used = set(re.findall(rf"\\(?:{greek})(?![a-z])", "".join(words.values())))
    assert used == {letter for letter in used if any(letter in symbol for symbol in symbols)}
    assert len(used) > 8


DRAWS = """import importlib.util
assert not importlib.util.find_spec("chapters")
assert not {"note", "keep", "kept", "plt"} & {*globals()}
import matplotlib.pyplot as plt
plt.plot([3, 1, 2])
plt.show()"""


def test_one_changed_digit_fails(tmp_path: Path, tmp_path_factory, root: Path, monkeypatch):
    """The project's own options compare stored outputs; a lax option would pass both.

    What cells draw is kept for other tests, and cells find nothing that helps with that.
    """
    for name, stored in (("right", "42\n"), ("wrong", "43\n")):
        notebook = sample()
        notebook.cells = notebook.cells[:2]
        notebook.cells[1].outputs[0].text = stored
        nbformat.write(notebook, tmp_path / f"{name}.ipynb")
    nbformat.write(new_notebook(cells=[new_code_cell(DRAWS)]), tmp_path / "drawn.ipynb")
    shared = str(tmp_path_factory.mktemp("shared"))
    monkeypatch.setenv(SHARED, shared)
    monkeypatch.setenv("IPYTHONDIR", "")  # put back afterwards
    in_kernels(shared)
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-n0", "-p", "no:cacheprovider",
         "--config-file", root / "pyproject.toml", tmp_path],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )  # fmt: skip
    assert "1 failed, 2 passed" in run.stdout
    assert re.search(r"(?s)right\.ipynb \. .*wrong\.ipynb F ", run.stdout)
    (line,) = kept(DRAWS).axes[0].lines
    assert line.get_ydata().tolist() == [3, 1, 2]


SURROUNDINGS = """print(dir())
import os, signal, sys, threading
import matplotlib.pyplot as plt, numpy, pandas
print(os.getcwd(), sys.path, sys.flags, sys.executable, sorted({*os.environ} - {"JPY_PARENT_PID"}))
print(plt.get_backend(), plt.rcParams, numpy.geterr(), pandas.get_option("display.max_columns"))
print([signal.getsignal(number) for number in (signal.SIGCHLD, signal.SIGINT, signal.SIGTERM)])
print(threading.active_count())"""


@pytest.mark.skipif(sys.platform != "linux", reason="kernels are copied on Linux only")
def test_a_copied_kernel_is_like_any_other(monkeypatch):
    def told() -> str:
        name = nbval.kernel.CURRENT_ENV_KERNEL_NAME
        manager, client = nbval.kernel.start_new_kernel(kernel_name=name, cwd=str(BOOK))
        said = []
        client.execute_interactive(
            SURROUNDINGS, output_hook=lambda message: said.append(message["content"].get("text"))
        )
        client.stop_channels()
        manager.shutdown_kernel(now=True)
        assert not manager.is_alive()
        return "".join(filter(None, said))

    monkeypatch.delenv("MPLBACKEND", raising=False)
    monkeypatch.setattr(local_provisioner, "launch_kernel", jupyter_client.launch_kernel)
    expected = told()
    end = copied()
    found = told(), told()
    end()
    assert found == (expected, expected)
    assert str(BOOK) in expected


def test_no_two_cells_draw_with_the_same_words():
    """Figures are kept by the sources of their cells."""
    sources = [cell.source for path in NOTEBOOKS for cell in code(path.stem) if shows_image(cell)]
    assert len(sources) == len(set(sources)) > 50


def test_no_number_is_typed_into_a_description():
    """It says higher, lower, near, far; the numbers of `flight` have a test of their own."""
    for path in NOTEBOOKS:
        for cell in nbformat.read(path, as_version=4).cells:
            alt = cell.metadata.get("mystnb", {}).get("image", {}).get("alt", "")
            assert cell.id == "flight" or not decimals(alt), (path.stem, cell.id)


def test_what_a_compiler_says_is_not_stored(capsys):
    """It goes to the terminal; what a cell prints stays."""
    notebook = sample()
    said = new_output("stream", name="stderr", text="ld: warning")
    notebook.cells[1].outputs.insert(0, said)
    execute.drop_stderr(notebook)
    assert faults(notebook) == []
    assert [output.name for output in notebook.cells[1].outputs] == ["stdout"]
    assert "cell 1: ld: warning" in capsys.readouterr().err
