"""The built book: no warning, no request to another server."""

import csv
import re
from pathlib import Path

import nbformat
import pytest
import yaml

# What a browser would load from another server by itself: of tags, styles and scripts. <a href> and
# <form action> wait for a click; what a page asks for as it opens, `test_layout.py` hears.
FAR = r"\s*(?:https?:|wss?:)?//"
LOADS = re.compile(
    rf"""<(?:audio|embed|iframe|image|img|input|object|script|source|track|use|video)\b[^>]*
        \s(?:src|srcset|data|poster|(?:xlink:)?href)=["'](?:[^"']*,)?{FAR}
      | <link\b(?=[^>]*\srel=["'][^"']*(?:icon|manifest|pre(?:connect|fetch|load)|sheet))[^>]*
        \shref=["']{FAR}
      | <meta\b[^>]*refresh[^>]*url={FAR}
      | (?:@import\s*(?:url\()?|url\()\s*["']?{FAR}
      | (?:\bfetch|\bimport|importScripts|new\s+(?:Worker|WebSocket|EventSource)|sendBeacon)
        \s*\(?\s*["'`]{FAR}
      | \bfrom\s*["'`]https?://
      | \.(?:src|href)\s*=\s*["'`]{FAR}
      | \.open\(\s*["'`][A-Z]+["'`]\s*,\s*["'`]https?://""",
    re.VERBOSE | re.IGNORECASE,
)


@pytest.fixture(scope="module")
def chapters(html: Path) -> dict[Path, str]:
    """The text of the pages below book/."""
    return {path: path.read_text(encoding="utf-8") for path in (html / "book").glob("*.html")}


def test_every_chapter_is_built(html: Path, root: Path):
    toc = (root / "_toc.yml").read_text(encoding="utf-8")
    chapters = re.findall(r"(?:root|file):\s*(\S+)", toc)
    assert chapters
    assert [chapter for chapter in chapters if not (html / f"{chapter}.html").is_file()] == []


def test_nothing_is_asked_of_the_network(html: Path):
    for kind, least in (("html", 25), ("css", 5), ("js", 5)):
        # No page loads live code; Sphinx copies the file all the same.
        paths = [path for path in html.glob(f"**/*.{kind}") if path.name != "sphinx-thebe.js"]
        assert len(paths) > least
        for path in paths:
            text = path.read_text(encoding="utf-8")
            assert [found[0] for found in LOADS.finditer(text)] == [], path
            assert not re.search(r"<script[^>]*thebe", text), path


def test_mathjax_is_served_where_there_are_equations_and_nowhere_else(html: Path, chapters):
    loads = {path.stem for path, text in chapters.items() if "mathjax/tex-svg-full.js" in text}
    math = re.compile(r'class="[^"]*\bmath notranslate')
    assert loads == {path.stem for path, text in chapters.items() if math.search(text)}
    assert not {"intro", "explorer", "api"} & loads
    assert len(loads) > 10
    assert (html / "_static" / "mathjax" / "tex-svg-full.js").stat().st_size > 1_000_000


def test_equations_keep_their_tags(chapters):
    """MathJax refuses a tag inside `split`, in which Sphinx wraps equations of several lines."""
    for path, text in chapters.items():
        for equation in re.findall(r"(?s)\\begin\{split\}.*?\\end\{split\}", text):
            assert r"\tag" not in equation, f"{path.name}: {equation}"


def test_figures_of_the_appendices_carry_a_letter(html: Path, chapters):
    for name, numbers in (("notation", ["A.1", "A.2", "A.3"]), ("problem", ["1.1", "1.2"])):
        text = chapters[html / "book" / f"{name}.html"]
        assert re.findall(r'caption-number">Fig\. ([\w.]+) ', text) == numbers


def test_own_equations_are_numbered_without_holes(html: Path, root: Path, chapters):
    """In each chapter, and with a letter through all appendices, in the order of the contents."""
    toc = (root / "_toc.yml").read_text(encoding="utf-8")
    found: dict[str, list[int]] = {}
    for page in re.findall(r"file:\s*(\S+)", toc):
        text = chapters[html / f"{page}.html"]
        for part, number in re.findall(r'class="eqno">\((\w+)\.(\d+)\)', text):
            found.setdefault(part, []).append(int(number))
    assert {"3", "A"} <= set(found)
    for part, numbers in found.items():
        assert numbers == list(range(1, len(numbers) + 1)), part


def test_two_clicks_from_the_landing_page_to_any_item(html: Path, root: Path, chapters):
    """Landing page, ledger, item: the verdict on the way, the code within two cells of the item."""
    book = html / "book"
    landing = chapters[book / "intro.html"]
    assert 'href="ledger.html"' in landing.partition("<article")[2].partition("</article>")[0]
    with (root / "data" / "ledger.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        link = f'<a href="{row["cell"]}">{row["item"]}</a>'
        (line,) = (one for one in chapters[book / "ledger.html"].split("<tr>") if link in one)
        assert f'<td data-name="verdict">{row["status"]}</td>' in line, row["item"]
        page, _, label = row["cell"].partition("#")
        assert f'id="{label}"' in chapters[book / page], row["item"]
        notebook = root / "book" / page.replace(".html", ".ipynb")
        cells = nbformat.read(notebook, as_version=4).cells
        at = next(
            number
            for number, cell in enumerate(cells)
            if f"({label})=" in cell.source
            or cell.metadata.get("mystnb", {}).get("figure", {}).get("name") == label
        )
        assert "code" in [cell.cell_type for cell in cells[at : at + 3]], row["item"]


def test_pages_say_what_a_link_to_them_may_show(html: Path, chapters):
    for path, text in chapters.items():
        assert re.search(r'property="og:title" content="[^<"]+"', text), path
        picture = re.search(r'property="og:image" content="[^"]*/(_static/[^"]+)"', text)
        assert (html / picture[1]).is_file()


def test_folded_cells_are_named_by_their_words(chapters):
    """A label would hide them: there are hundreds of cells, and each says what it holds."""
    summaries = re.findall(r"<summary[^>]*>", "".join(chapters.values()))
    assert len(summaries) > 200
    assert [summary for summary in summaries if "aria-label" in summary] == []


def test_notebooks_are_saved(html: Path, chapters):
    links = re.findall(r'<a [^>]*_sources[^>]*\.ipynb"[^>]*>', "".join(chapters.values()))
    assert len(links) > 15
    assert [link for link in links if not re.search(r"\bdownload\b(?!-)", link)] == []
    for link in links:
        assert (html / "book" / re.search(r'href="([^"]*)"', link)[1]).resolve().is_file()


def test_a_request_is_seen():
    for text in (
        '<script src="//example.org/a.js"></script>',
        '<link rel="preconnect" href="https://example.org">',
        '<img alt="a" src="a.png" srcset="a.png, https://example.org/a.png 2x">',
        '<meta http-equiv="refresh" content="0; url=https://example.org">',
        "<p style=\"background: url('https://example.org/a.png')\">a</p>",
        "import('https://example.org/a.js')",
        'tag.src = "https://example.org/a.js"',
        'request.open("GET", "https://example.org")',
    ):
        assert LOADS.search(text), text
    for text in ('<a href="https://example.org">', '<link rel="next" href="//example.org">'):
        assert not LOADS.search(text), text


def published(root: Path) -> bool:
    with (root / "_config.yml").open(encoding="utf-8") as file:
        return yaml.safe_load(file)["sphinx"]["config"]["book_published"]


def test_no_button_leads_to_the_placeholder(root: Path, chapters):
    """Launch, repository and issue buttons are there if, and only if, the book is published."""
    for path, text in chapters.items():
        header = text.partition("bd-header-article")[2].partition("<article")[0]
        assert header, path
        buttons = [
            address in header for address in ("colab.research", "mybinder.org", "github.com")
        ]
        if not published(root):
            assert not any(buttons), path
        elif (root / "book" / path.name).with_suffix(".ipynb").is_file():
            assert all(buttons), path


def test_notebooks_install_the_package_in_colab_once_published(root: Path, monkeypatch):
    monkeypatch.syspath_prepend(root / "book")
    import execute

    for path in (root / "book").glob("*.ipynb"):
        cells = nbformat.read(path, as_version=4).cells
        assert (execute.COLAB in [cell.id for cell in cells]) == published(root), path
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell("# title")])
    execute.put_colab_cell(notebook, "%pip install x")
    execute.put_colab_cell(notebook, "%pip install y")
    assert [cell.source for cell in notebook.cells] == ["# title", "%pip install y"]
    execute.put_colab_cell(notebook, None)
    assert len(notebook.cells) == 1


def test_the_pdf_is_linked_once_it_is_there(html: Path, root: Path, tmp_path: Path, monkeypatch):
    monkeypatch.syspath_prepend(root / "book")
    import make_pdf

    page = tmp_path / "book" / "cite.html"
    page.parent.mkdir()
    page.write_bytes((html / "book" / "cite.html").read_bytes())
    link = '<a href="../cradle-companion.pdf">'
    assert link not in page.read_text(encoding="utf-8")
    make_pdf.show_link(tmp_path / "cradle-companion.pdf")
    assert link in page.read_text(encoding="utf-8")


def test_a_formula_keeps_its_punctuation(chapters):
    """MathJax lets a line break at both ends of a formula, before a comma too."""
    formula = r'<span class="math notranslate nohighlight">[^<]*</span>'
    whole = re.compile(rf'<span class="nowrap">[(\[]*{formula}[)\].,;:!?]*</span>')
    assert sum(len(whole.findall(text)) for text in chapters.values()) > 300
    for path, text in chapters.items():
        loose = re.findall(rf".{{20}}{formula}[)\].,;:!?].{{9}}", whole.sub("", text))
        assert not loose, path
