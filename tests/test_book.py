"""The built book: no warning, no request to another server, no missing file."""

import operator
import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import nbformat
import pytest
import yaml
from stored import read

import cradle.fit
import cradle.row

# Attributes whose address a browser loads by itself: not that of <a>, which waits for a click, nor
# that of a <link> which only says how pages belong together.
LOADS = {"data", "href", "poster", "src", "srcset", "xlink:href"}
POINTERS = {"canonical", "index", "next", "prev", "search"}
# Another server, as an address or inside a script or a style.
ELSEWHERE = re.compile(r"(?:https?|wss?)://|(?:^|[\"'(`=])//", re.IGNORECASE)
# In scripts: an address from which something is loaded, as opposed to one that is only mentioned.
SCRIPT_LOADS = re.compile(
    r"""(?:\bfetch|\bimport|importScripts|new\s+(?:Worker|WebSocket|EventSource)|sendBeacon)
        \s*\(?\s*["'`](?:https?:|wss?:)?//
      | \bfrom\s*["'`]https?://
      | \.(?:src|href)\s*=\s*["'`](?:https?:)?//
      | \.open\(\s*["'`][A-Z]+["'`]\s*,\s*["'`]https?://""",
    re.VERBOSE,
)
STYLE_LOADS = re.compile(r"(?:@import\s*(?:url\()?|url\()\s*[\"']?\s*(?:https?:)?//", re.IGNORECASE)


class Page(HTMLParser):
    """Collect what a page loads, and what is inside it: scripts, styles, where it leads at once."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.inside: list[str] = []
        self._tag = ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self._tag = tag
        attributes = {name: value or "" for name, value in attrs}
        for name, value in attributes.items():
            if name in ("style", "content" * ("http-equiv" in attributes)) or name.startswith("on"):
                self.inside.append(value)
            elif name in LOADS and tag != "a" and attributes.get("rel") not in POINTERS:
                parts = value.split(",") if name == "srcset" else [value]
                self.loads += [part.split()[0] for part in parts if part.strip()]

    def handle_endtag(self, tag):
        self._tag = ""

    def handle_data(self, data):
        if self._tag in ("script", "style"):
            self.inside.append(data)


def requests(page: Page) -> list[str]:
    """List what asks another server for something when a page is opened."""
    return [text for text in page.loads + page.inside if ELSEWHERE.search(text)]


@pytest.fixture(scope="module")
def pages(html: Path) -> dict[Path, tuple[str, Page]]:
    """The pages, as text and read; _static/ holds fragments of the theme that are none."""
    texts = {
        path: path.read_text(encoding="utf-8")
        for path in html.glob("**/*.html")
        if "_static" not in path.parts
    }
    return {path: (text, Page(text)) for path, text in texts.items()}


@pytest.fixture(scope="module")
def chapters(html: Path, pages) -> dict[Path, str]:
    """The text of the pages below book/."""
    return {path: text for path, (text, _) in pages.items() if path.parent == html / "book"}


def test_pages_ask_nothing_of_the_network_and_find_what_they_load(html: Path, pages):
    assert html / "index.html" in pages
    for path, (_, page) in pages.items():
        assert requests(page) == [], path
        assert "thebe" not in " ".join(page.loads + page.inside).lower(), path  # live code
        for address in page.loads:
            parts = urlsplit(address)
            if parts.scheme != "data" and parts.path:
                assert (path.parent / unquote(parts.path)).is_file(), f"{path.name}: {address}"


def test_style_sheets_and_scripts_ask_nothing_of_the_network(html: Path):
    checked = 0
    for pattern, kind in [("**/*.css", STYLE_LOADS), ("**/*.js", SCRIPT_LOADS)]:
        for path in html.glob(pattern):
            # No page loads it (test above); Sphinx copies the file all the same.
            if path.name != "sphinx-thebe.js":
                assert kind.findall(path.read_text(encoding="utf-8")) == [], path
                checked += 1
    assert checked > 10


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
    """In each chapter, and through all appendices; every page of the contents is there."""
    toc = (root / "_toc.yml").read_text(encoding="utf-8")
    found: dict[str, list[int]] = {}
    for page in re.findall(r"(?:root|file):\s*(\S+)", toc):
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
    for row in read("ledger.csv"):
        link = f'<a href="{row["cell"]}">{row["item"]}</a>'
        lines = chapters[book / "ledger.html"].replace("&nbsp;", " ").replace("\xa0", " ")
        (line,) = (one for one in lines.split("<tr>") if link in one)
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
        (told,) = re.findall(r'property="og:description" content="([^"]*)"', text)
        assert "&lt;" not in told, path  # no tags
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


ASKED_BY_PAGES = [
    '<script src="https://example.org/a.js"></script>',
    '<script src="//example.org/a.js"></script>',
    '<link rel="stylesheet" href="https://example.org/a.css">',
    '<link rel="preconnect" href="https://example.org">',
    '<img alt="a" src="http://example.org/a.png">',
    '<img alt="a" src="a.png" srcset="https://example.org/a.png 2x">',
    '<iframe src="https://example.org"></iframe>',
    '<meta http-equiv="refresh" content="0; url=https://example.org">',
    "<style>@import url(https://example.org/a.css);</style>",
    "<p style=\"background: url('https://example.org/a.png')\">a</p>",
    '<script>const address = "https://example.org/a.js";</script>',
]
ASKED_BY_SCRIPTS = [
    'fetch("https://example.org")',
    "import('https://example.org/a.js')",
    'import "https://example.org/a.js"',
    'tag.src = "https://example.org/a.js"',
    'request.open("GET", "https://example.org")',
]


def test_a_request_is_seen():
    assert [text for text in ASKED_BY_PAGES if not requests(Page(text))] == []
    assert not requests(Page('<a href="https://example.org">a link waits for a click</a>'))
    assert [text for text in ASKED_BY_SCRIPTS if not SCRIPT_LOADS.search(text)] == []
    assert not SCRIPT_LOADS.search("// see https://example.org, fetch(address)")


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
    formula = r'<span class="math notranslate nohighlight"[^>]*>[^<]*</span>'
    whole = re.compile(rf'<span class="nowrap">[(\[]*{formula}[)\].,;:!?]*</span>')
    assert sum(len(whole.findall(text)) for text in chapters.values()) > 300
    for path, text in chapters.items():
        loose = re.findall(rf".{{20}}{formula}[)\].,;:!?].{{9}}", whole.sub("", text))
        assert not loose, path


def test_a_number_keeps_its_unit(chapters):
    """In the text, not in what code prints and in tables of pandas."""
    kept = 0
    for path, text in chapters.items():
        shown = re.sub(r'(?s)<table[^>]*class="dataframe.*?</table>', "", text)
        shown = re.sub(r"(?s)<(pre|code|svg|script|style|title)\b.*?</\1>|<[^>]+>", "", shown)
        assert not re.findall(r".{20}\d (?:%|µm|mm|m/s)(?!\w).{9}", shown), path
        kept += len(re.findall("\\d\N{NO-BREAK SPACE}(?:%|µm|mm|m/s)", shown))
    assert kept > 300


def test_no_table_has_a_second_head_for_its_row_labels_alone(chapters):
    heads = re.findall(r"(?s)<thead>.*?</thead>", "".join(chapters.values()))
    assert len(heads) > 50
    for head in heads:
        rows = re.findall(r"(?s)<tr.*?</tr>", head)
        assert len(rows) == 1 or re.findall(r"(?s)<th[^>]*>(.*?)</th>", rows[-1])[-1], head


def test_code_in_tables_breaks_at_its_joints(html: Path):
    text = (html / "book" / "notation.html").read_text(encoding="utf-8")
    pieces = re.findall(r'(?s)<code[^>]*>((?:<span class="nowrap">.*?)+)</code>', text)
    plain = [re.sub(r"<(?!wbr)[^>]*>", "", piece) for piece in pieces]
    assert "chain.<wbr>restitution[<wbr>i-2]" in plain
    assert any("<wbr>" not in piece for piece in plain)


def test_every_reference_names_the_pages_that_cite_it(html: Path):
    page = (html / "book" / "references.html").read_text(encoding="utf-8")
    entries = re.findall(r'(?s)<div class="citation" id="(\w+)".*?>(.*?)</div>', page)
    assert len(entries) > 60
    for key, entry in entries:
        cited = entry.split('class="cited"')[1]
        assert "fn-bracket" not in entry
        for name in re.findall(r'href="(\w+\.html)"', cited) or [""]:
            there = (html / "book" / name).read_text(encoding="utf-8")
            assert f'references.html#{key}"' in there, (key, name)


def test_the_reference_tells_every_field(html: Path):
    """Whole: what stands before a colon would be taken for a type."""
    text = "".join(page.read_text(encoding="utf-8") for page in (html / "book").glob("api_*.html"))
    for name in ("Outcomes", "Impact", "row.Hit", "fit.Velocities"):
        fields = operator.attrgetter(name)(cradle)._fields
        assert [field for field in fields if f'id="cradle.{name}.{field}"' not in text] == []
    assert not re.findall(r">Type<span", text)
