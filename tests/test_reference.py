"""The reference: every public name has an entry, and every example runs when it is pasted."""

import doctest
import importlib
import pkgutil
import re
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from api_reference import HOMES, RESULTS, public

import cradle
import cradle.kernel
from cradle.fit.shots import COLUMNS

BOOK = Path(__file__).parents[1] / "book"
MODULES = sorted(
    name
    for _, name, _ in pkgutil.walk_packages(cradle.__path__, "cradle.")
    if not name.endswith("__main__")
)
ENTRIES = sorted({entry for home in HOMES for entry in public(home).values()})


def text(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def test_every_public_name_has_one_entry(html: Path):
    assert len(ENTRIES) > 80
    pages = "".join(text(page) for page in sorted((html / "book").glob("api_*.html")))
    assert [entry for entry in ENTRIES if pages.count(f'id="{entry}"') != 1] == []


def test_the_first_page_leads_to_every_entry_and_says_what_it_is(html: Path):
    page = text(html / "book" / "api.html")
    assert [entry for entry in ENTRIES if f'#{entry}"' not in page] == []
    told = re.findall(r"(?s)<td><p>(.*?)</p>", page)
    assert [words for words in told if re.search(r"(Eq|Eqs|Fig|Figs|Table)\.$", words)] == []


def test_names_in_docstrings_lead_to_their_entries(html: Path):
    page = text(html / "book" / "api_motion.html")
    assert re.search(r'href="[^"]*#cradle\.SpringChain"', page)
    assert re.search(r'href="[^"]*#cradle\.collide"', page)


def test_results_do_not_tell_how_they_are_made(html: Path):
    assert {f"cradle.{name}" for name in RESULTS} <= set(ENTRIES)
    pages = "".join(text(page) for page in (html / "book").glob("api_*.html"))
    for entry in ENTRIES:
        head = re.search(rf'(?s)<dt [^>]*id="{re.escape(entry)}">(.*?)</dt>', pages)
        if entry.removeprefix("cradle.") in RESULTS:
            assert "sig-paren" not in head[1], entry


@pytest.mark.parametrize("name", ["cradle", *MODULES])
def test_examples_run_when_they_are_pasted(name: str):
    """With no name of the module that they stand in."""
    module = importlib.import_module(name)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    for test in doctest.DocTestFinder(exclude_empty=True).find(module, name):
        test.globs = {"__name__": "pasted"}
        assert runner.run(test).failed == 0, test.name
    plt.close("all")


def test_what_the_pages_list_is_there():
    fits, inside = text(BOOK / "api_fit.md"), text(BOOK / "api_inside.md")
    for column, what in COLUMNS.items():
        assert f"| `{column}` | {what} |" in fits
    tops = {name.split(".")[1] for name in MODULES}
    rows = re.findall(r"(?m)^\| (`.*?) \|", inside)
    listed = [name for row in rows for name in re.findall(r"`(\w+)`", row)]
    assert sorted(listed) == sorted([*tops, *cradle.kernel.ROOMS])


def test_every_word_of_the_glossary_leads_to_the_place_that_explains_it():
    words = re.split(r"\n(?=\S)", text(BOOK / "glossary.md").split(":sorted:")[1].split("```")[0])
    told = [entry for entry in words if "\n  " in entry]
    assert len(told) > 60
    place = r"\{(?:ref|numref|doc|eq|term)\}"
    assert [entry for entry in told if not re.search(place, entry.split("\n  ", 1)[1])] == []


def test_each_letter_above_the_glossary_leads_to_its_first_word():
    bar, words = text(BOOK / "glossary.md").split(":sorted:")
    first = {}
    for word in sorted(re.findall(r"(?m)^(\S.*)\n  ", words), key=str.lower):
        first.setdefault(word[0].upper(), word)
    assert re.findall(r"\{term\}`(.) <(.+)>`", bar) == list(first.items())
