"""The ledger: one row for every numbered item of the paper, and a check behind every row."""

import ast
import csv
import re
from pathlib import Path

import nbformat
import pytest

ROOT = Path(__file__).parents[1]
ITEMS = (
    [f"Eq. {k}" for k in range(1, 54)]
    + [f"Fig. {k}" for k in range(1, 13)]
    + [f"Table {k}" for k in (1, 2)]
)
VERDICTS = {
    "derived, equal",
    "derived, misprint",
    "reproduced",
    "reproduced, differs",
    "reproduced in part",
    "schematic",
    "hypothesis",
    "not reproducible",
}
with (ROOT / "data" / "ledger.csv").open(encoding="utf-8", newline="") as file:
    ROWS = list(csv.DictReader(file))


def labels(page: str) -> set[str]:
    """Return the labels that a page of the book defines, in its text and on its figures."""
    path = ROOT / "book" / f"{page}.ipynb"
    found = set()
    for cell in nbformat.read(path, as_version=4).cells:
        if cell.cell_type == "markdown":
            found |= set(re.findall(r"^\(([\w-]+)\)=\s*$", cell.source, flags=re.MULTILINE))
        name = cell.metadata.get("mystnb", {}).get("figure", {}).get("name")
        found |= {name} if name else set()
    return found


def functions(path: Path) -> set[str]:
    """Return the names of the tests in a file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def covers(name: str, item: str) -> bool:
    """Whether the name of a test names the item: test_eqs_35_to_38_..., test_fig_7_..."""
    kind, number = item.rstrip("0123456789. ").lower(), int(item.split()[1])
    named = re.match(rf"test_{kind}s?((?:_(?:\d+|to|and))+)", name)
    if not named:
        return False
    words = named[1].strip("_").split("_")
    numbers = [int(word) for word in words if word.isdigit()]
    return numbers[0] <= number <= numbers[-1] if "to" in words else number in numbers


def test_a_name_covers_its_items_alone():
    assert covers("test_eqs_35_to_38_slope", "Eq. 36")
    assert covers("test_eqs_45_46_balls_at_rest", "Eq. 46")
    assert not covers("test_eqs_35_to_38_slope", "Eq. 39")
    assert not covers("test_fig_10_prediction", "Fig. 1")
    assert not covers("test_fig_5_region", "Eq. 5")
    assert not covers("test_stored_form", "Fig. 9")


def test_every_item_has_one_row_in_order():
    assert [row["item"] for row in ROWS] == ITEMS


def test_the_page_explains_every_verdict():
    cells = nbformat.read(ROOT / "book" / "ledger.ipynb", as_version=4).cells
    rows = re.findall(r"^\| ([a-z, ]+) \|", cells[0].source, flags=re.MULTILINE)
    assert set(rows) == VERDICTS | {"verdict"}


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["item"])
def test_row(row):
    assert row["status"] in VERDICTS
    assert None not in row.values(), "too few columns"
    assert all(row.values()), "an empty field"
    page, _, label = row["cell"].partition(".html#")
    assert label in labels(page)
    file, _, name = row["test"].partition("::")
    assert covers(name, row["item"])
    assert name in functions(ROOT / file)
    if row["status"] in {"derived, misprint", "reproduced, differs"}:
        assert row["difference"] != "0"


def test_fig_9_and_all_schematics_are_drawn_and_described():
    """A schematic has no numbers to check: it must be drawn by its cell, with words beside it."""
    for row in ROWS:
        if row["status"] != "schematic":
            continue
        page, _, label = row["cell"].partition(".html#")
        notebook = nbformat.read(ROOT / "book" / f"{page}.ipynb", as_version=4)
        settings = [cell.metadata.get("mystnb", {}) for cell in notebook.cells]
        names = [one.get("figure", {}).get("name") for one in settings]
        at = names.index(label)
        kinds = {kind for output in notebook.cells[at].outputs for kind in output.get("data", {})}
        assert any(kind.startswith("image/") for kind in kinds), label
        assert len(settings[at]["image"]["alt"]) > 60, label
        assert row["item"] in settings[at]["figure"]["caption"], label
