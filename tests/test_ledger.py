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
    "derived, corrected",
    "copied",
    "reproduced, differs",
    "reproduced in part",
    "schematic",
    "hypothesis",
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


def loosest(path: Path, name: str) -> str:
    """Loosest tolerance of a test and of its file's functions: a number, words, or exact."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    local = {node.name: node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    named = {
        node.targets[0].id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    numbers, words, seen = [0.0], [], {name}
    waiting = [local[name]]
    while waiting:
        for node in ast.walk(waiting.pop()):
            allowed = []
            if isinstance(node, ast.Call):
                called = getattr(node.func, "id", getattr(node.func, "attr", ""))
                if called in local and called not in seen:
                    seen.add(called)
                    waiting.append(local[called])
                given = {word.arg: word.value for word in node.keywords}
                if isinstance(shared := named.get(getattr(given.get(None), "id", "")), ast.Dict):
                    given |= {key.value: value for key, value in zip(shared.keys, shared.values)}
                names = {"atol", "rtol", "abs", "rel"} & set(given)
                allowed = [given[word] for word in names]
                if called == "assert_allclose" and "rtol" not in names:
                    numbers.append(1e-7)  # NumPy's own
            elif isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Lt | ast.LtE):
                # Numbers from .1 on are bounds of a quantity, not of an error.
                limit = node.comparators[-1]
                small = isinstance(limit, ast.Constant) and isinstance(limit.value, float)
                allowed = [limit] if small and limit.value < 0.1 else []
            for value in allowed:
                if isinstance(value, ast.Constant):
                    numbers.append(float(value.value))
                else:
                    words.append(ast.unparse(value))
    parts = [f"{max(numbers):g}"] if max(numbers) else []
    return ", ".join([*parts, *sorted(set(words))]) or "exact"


def test_a_loose_tolerance_is_seen(tmp_path: Path):
    test = tmp_path / "test_x.py"
    test.write_text(
        "CLOSE = {'rtol': 1e-12, 'atol': 1e-13}\n"
        "def helper(): assert abs(x) < 1e-9\n"
        "def test_one(): assert a == approx(b, rel=1e-15)\n"
        "def test_two():\n  assert_allclose(a, b, **CLOSE)\n  helper()\n"
        "def test_three(): assert_allclose(a, b, atol=1e-14)\n"
        "def test_four(): assert a == b\n"
        "def test_five(): assert a == approx(b, abs=3 / gamma)\n",
        encoding="utf-8",
    )
    found = [loosest(test, f"test_{n}") for n in ("one", "two", "three", "four", "five")]
    assert found == ["1e-15", "1e-09", "1e-07", "exact", "3 / gamma"]


def test_numbers_of_differences_are_computed():
    """No digit of the column is typed but those that number an equation or a place."""
    shown = "".join(
        output.get("data", {}).get("text/html", "")
        for cell in nbformat.read(ROOT / "book" / "ledger.ipynb", as_version=4).cells
        for output in cell.get("outputs", ())
    )
    for row in ROWS:
        words = re.sub(r"\{[^}]*\}|\(1 - alpha\)", "", row["difference"])
        assert not re.search(r"\d", words), row["item"]
        assert "{" not in row["difference"] or row["difference"] not in shown, row["item"]
    assert "0.734 γ" in shown
    assert "0.0006 m/s" in shown


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
    words = "\n".join(cell.source for cell in cells if cell.cell_type == "markdown")
    rows = re.findall(r"^\| ([a-z, ]+) \|", words, flags=re.MULTILINE)
    assert set(rows) == VERDICTS | {"verdict"}


def test_every_corrected_item_links_to_its_erratum():
    cells = nbformat.read(ROOT / "book" / "ledger.ipynb", as_version=4).cells
    shown = "".join(
        output.get("data", {}).get("text/html", "")
        for cell in cells
        for output in cell.get("outputs", ())
    ).replace("&nbsp;", " ")
    for row in ROWS:
        if row["status"] in {"derived, corrected", "reproduced, differs"}:
            (line,) = (one for one in shown.split("<tr>") if f">{row['item']}</a>" in one)
            reason = re.search(r'href="errata\.html#([\w-]+)"', line)[1]
            assert reason in labels("errata"), row["item"]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["item"])
def test_row(row):
    """`python tests/test_ledger.py` writes the column of tolerances anew."""
    assert row["status"] in VERDICTS
    assert None not in row.values(), "too few columns"
    assert all(row.values()), "an empty field"
    page, _, label = row["cell"].partition(".html#")
    assert label in labels(page)
    file, _, name = row["test"].partition("::")
    assert covers(name, row["item"])
    assert name in functions(ROOT / file)
    assert row["tolerance"] == loosest(ROOT / file, name)
    if row["status"] in {"derived, corrected", "reproduced, differs"}:
        assert row["difference"] != "none"


def test_figs_1_2_and_9_and_all_schematics_are_drawn_and_described():
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


def write_tolerances():
    """Write the column `tolerance` from the tests as they stand."""
    for row in ROWS:
        file, _, name = row["test"].partition("::")
        row["tolerance"] = loosest(ROOT / file, name)
    with (ROOT / "data" / "ledger.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, ROWS[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(ROWS)


if __name__ == "__main__":
    write_tolerances()


def test_reading_the_paper_counts_the_equations_of_the_ledger():
    """So does the abstract of the article."""
    words = (ROOT / "book" / "reading.md").read_text(encoding="utf-8").partition("These pages")[0]
    verdicts = {row["item"]: row["status"] for row in ROWS if row["item"].startswith("Eq.")}
    equal = sum(status == "derived, equal" for status in verdicts.values())
    assert f"Of the {len(verdicts)} numbered equations of the paper, {equal} come out" in words
    corrected = [item[4:] for item, status in verdicts.items() if status == "derived, corrected"]
    assert "Six are corrected" in words
    assert len(corrected) == 6
    listed = words.partition("corrected")[2].partition("hypothesis")[0]
    assert re.findall(r"<eq-p(\d+)>", listed) == [*corrected, "16"]
    assert verdicts["Eq. 16"] == "hypothesis"
    article = (ROOT / "publication" / "rescience" / "metadata.yaml").read_text(encoding="utf-8")
    right = f"Of its {len(verdicts)} equations {equal} are right as printed"
    assert f"{right}, {len(corrected)} are corrected, and one" in article
