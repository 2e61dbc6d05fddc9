"""The built book: no warning, no request to another server, no missing file."""

import csv
import re
import tomllib
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import nbformat
import pytest
import yaml

# Attributes whose address a browser loads by itself. <a href> and <form action> wait for a click.
LOADS = {
    "audio": ("src",),
    "embed": ("src",),
    "iframe": ("src",),
    "image": ("href", "xlink:href"),
    "img": ("src", "srcset"),
    "input": ("src",),
    "object": ("data",),
    "script": ("src",),
    "source": ("src", "srcset"),
    "track": ("src",),
    "use": ("href", "xlink:href"),
    "video": ("src", "poster"),
}
# <link> loads a file for these relations only ("next", "search", "canonical" are plain pointers).
LOADING_LINKS = {
    "apple-touch-icon", "dns-prefetch", "icon", "manifest", "modulepreload", "preconnect",
    "prefetch", "preload", "shortcut", "stylesheet",
}  # fmt: skip
ELSEWHERE = re.compile(r"^\s*(?:https?:|wss?:)?//", re.IGNORECASE)
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
    """Collect what a page loads, and its inline scripts and styles."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.scripts: list[str] = []
        self.styles: list[str] = []
        self._inside: str | None = None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attributes = {name: value or "" for name, value in attrs}
        self._inside = tag
        names = LOADS.get(tag, ())
        if tag == "link" and LOADING_LINKS & set(attributes.get("rel", "").lower().split()):
            names = ("href",)
        for name in names:
            address = attributes.get(name, "")
            if name == "srcset":
                self.loads += [part.split()[0] for part in address.split(",") if part.strip()]
            elif address:
                self.loads.append(address)
        if tag == "meta" and attributes.get("http-equiv", "").lower() == "refresh":
            self.loads.append(attributes.get("content", "").partition("url=")[2].strip("'\" "))
        self.styles.append(attributes.get("style", ""))
        self.scripts += [value for name, value in attributes.items() if name.startswith("on")]

    def handle_endtag(self, tag):
        self._inside = None

    def handle_data(self, data):
        if self._inside == "script":
            self.scripts.append(data)
        elif self._inside == "style":
            self.styles.append(data)


def requests(text: str) -> list[str]:
    """List the requests to other servers that a page would make when opened."""
    page = Page(text)
    found = [address for address in page.loads if ELSEWHERE.match(address)]
    # An inline script of ours or of the theme has no business with any address.
    found += re.findall(r"https?://[^\s\"'`]+", "\n".join(page.scripts))
    found += STYLE_LOADS.findall("\n".join(page.styles))
    return found


def pages(html: Path) -> list[Path]:
    """List the pages; _static/ holds fragments of the theme that are not."""
    return [path for path in html.glob("**/*.html") if "_static" not in path.parts]


def test_every_chapter_is_built(html: Path, root: Path):
    toc = (root / "_toc.yml").read_text(encoding="utf-8")
    chapters = re.findall(r"(?:root|file):\s*(\S+)", toc)
    assert chapters
    for chapter in chapters:
        assert (html / f"{chapter}.html").is_file(), chapter


def test_pages_ask_nothing_of_the_network(html: Path):
    assert html / "index.html" in pages(html)
    for path in pages(html):
        assert requests(path.read_text(encoding="utf-8")) == [], path


def test_style_sheets_and_scripts_ask_nothing_of_the_network(html: Path):
    checked = 0
    for pattern, kind in [("**/*.css", STYLE_LOADS), ("**/*.js", SCRIPT_LOADS)]:
        for path in html.glob(pattern):
            # No page loads it (next test); Sphinx copies the file all the same.
            if path.name != "sphinx-thebe.js":
                assert kind.findall(path.read_text(encoding="utf-8")) == [], path
                checked += 1
    assert checked > 10


def test_live_code_is_dropped(html: Path):
    for path in pages(html):
        page = Page(path.read_text(encoding="utf-8"))
        assert "thebe" not in " ".join(page.loads + page.scripts).lower(), path


def test_whatever_a_page_loads_is_there(html: Path):
    for path in pages(html):
        for address in Page(path.read_text(encoding="utf-8")).loads:
            parts = urlsplit(address)
            if parts.scheme != "data" and parts.path:
                assert (path.parent / unquote(parts.path)).is_file(), f"{path.name}: {address}"


def test_mathjax_is_served_with_the_book(html: Path):
    texts = [path.read_text(encoding="utf-8") for path in pages(html)]
    with_equations = [text for text in texts if "math notranslate" in text]
    assert with_equations
    for text in with_equations:
        assert any(address.endswith("/mathjax/tex-svg-full.js") for address in Page(text).loads)
    assert (html / "_static" / "mathjax" / "tex-svg-full.js").stat().st_size > 1_000_000


def test_equations_keep_their_tags(html: Path):
    """MathJax refuses a tag inside `split`, in which Sphinx wraps equations of several lines."""
    for path in pages(html):
        for equation in re.findall(
            r"\\begin\{split\}.*?\\end\{split\}", path.read_text(encoding="utf-8"), re.DOTALL
        ):
            assert r"\tag" not in equation, f"{path.name}: {equation}"


def test_figures_of_the_appendices_carry_a_letter(html: Path):
    numbers = {}
    for name in ("notation", "problem"):
        text = (html / "book" / f"{name}.html").read_text(encoding="utf-8")
        numbers[name] = re.findall(r'caption-number">Fig\. ([\w.]+) ', text)
    assert numbers == {"notation": ["A.1", "A.2", "A.3"], "problem": ["1.1", "1.2"]}


def test_every_link_of_the_ledger_leads_somewhere(html: Path, root: Path):
    with (root / "data" / "ledger.csv").open(encoding="utf-8", newline="") as file:
        links = [row["cell"] for row in csv.DictReader(file)]
    table = (html / "book" / "ledger.html").read_text(encoding="utf-8")
    for link in links:
        page, _, label = link.partition("#")
        assert f'href="{link}"' in table, link
        assert f'id="{label}"' in (html / "book" / page).read_text(encoding="utf-8"), link


def test_two_clicks_from_the_landing_page_to_any_item(html: Path, root: Path):
    """Landing page, ledger, item: the verdict on the way, the code within two cells of the item."""
    landing = (html / "book" / "intro.html").read_text(encoding="utf-8")
    assert 'href="ledger.html"' in landing.partition("<article")[2].partition("</article>")[0]
    table = (html / "book" / "ledger.html").read_text(encoding="utf-8")
    with (root / "data" / "ledger.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        line = (
            f'<td data-name="item"><a href="{row["cell"]}">{row["item"]}</a></td>'
            f'<td data-name="verdict">{row["status"]}</td>'
        )
        assert line in table, row["item"]
        page, _, label = row["cell"].partition("#")
        notebook = root / "book" / page.replace(".html", ".ipynb")
        cells = nbformat.read(notebook, as_version=4).cells
        at = next(
            number
            for number, cell in enumerate(cells)
            if f"({label})=" in cell.source
            or cell.metadata.get("mystnb", {}).get("figure", {}).get("name") == label
        )
        assert "code" in [cell.cell_type for cell in cells[at : at + 3]], row["item"]


def test_pages_say_what_a_link_to_them_may_show(html: Path):
    for path in (html / "book").glob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert re.search(r'property="og:title" content="[^<"]+"', text), path
        picture = re.search(r'property="og:image" content="[^"]*/(_static/[^"]+)"', text)
        assert (html / picture[1]).is_file()


@pytest.mark.parametrize(
    "text",
    [
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
    ],
)
def test_a_request_is_seen(text: str):
    assert requests(text)
    assert not requests('<a href="https://example.org">a link waits for a click</a>')


@pytest.mark.parametrize(
    "text",
    [
        'fetch("https://example.org")',
        "import('https://example.org/a.js')",
        'import "https://example.org/a.js"',
        'tag.src = "https://example.org/a.js"',
        'request.open("GET", "https://example.org")',
    ],
)
def test_a_request_of_a_script_is_seen(text: str):
    assert SCRIPT_LOADS.search(text)
    assert not SCRIPT_LOADS.search("// see https://example.org, fetch(address)")


def published(root: Path) -> bool:
    with (root / "_config.yml").open(encoding="utf-8") as file:
        return yaml.safe_load(file)["sphinx"]["config"]["book_published"]


def test_no_button_leads_to_the_placeholder(html: Path, root: Path):
    """Launch, repository and issue buttons are there if, and only if, the book is published."""
    for path in (html / "book").glob("*.html"):
        header = path.read_text(encoding="utf-8").partition("bd-header-article")[2]
        header = header.partition("<article")[0]
        assert header, path
        buttons = [
            address in header for address in ("colab.research", "mybinder.org", "github.com")
        ]
        if not published(root):
            assert not any(buttons), path
        elif path.with_suffix(".ipynb").name in {p.name for p in (root / "book").glob("*.ipynb")}:
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
    hidden = re.compile(r'<p id="pdf" hidden[^>]*>[^<]*<a href="../cradle-companion.pdf">')
    assert hidden.search(page.read_text(encoding="utf-8"))
    make_pdf.show_link(tmp_path / "cradle-companion.pdf")
    assert not hidden.search(page.read_text(encoding="utf-8"))
    assert 'href="../cradle-companion.pdf"' in page.read_text(encoding="utf-8")


def test_one_address_of_the_project(root: Path):
    with (root / "pyproject.toml").open("rb") as file:
        address = tomllib.load(file)["project"]["urls"]["Repository"]
    host = "/".join(address.split("/")[:3])
    for name in ("_config.yml", "CITATION.cff", "README.md", "book/cite.md"):
        text = (root / name).read_text(encoding="utf-8")
        assert set(re.findall(rf"{re.escape(host)}/[\w.-]+/[\w.-]+", text)) == {address}, name


def test_a_formula_keeps_its_punctuation(html: Path):
    """MathJax lets a line break at both ends of a formula, before a comma too."""
    formula = r'<span class="math notranslate nohighlight">[^<]*</span>'
    kept = 0
    for page in (html / "book").glob("*.html"):
        text = page.read_text(encoding="utf-8")
        whole = re.compile(rf'<span class="nowrap">[(\[]*{formula}[)\].,;:!?]*</span>')
        kept += len(whole.findall(text))
        loose = re.findall(rf".{{20}}{formula}[)\].,;:!?].{{9}}", whole.sub("", text))
        assert not loose, page
    assert kept > 300


def test_no_table_has_a_second_head_for_its_row_labels_alone(html: Path):
    heads = 0
    for path in pages(html):
        for head in re.findall(r"(?s)<thead>.*?</thead>", path.read_text(encoding="utf-8")):
            rows = re.findall(r"(?s)<tr.*?</tr>", head)
            last = re.findall(r"(?s)<th[^>]*>(.*?)</th>", rows[-1])
            assert len(rows) == 1 or last[-1], f"{path.name}: {head}"
            heads += 1
    assert heads > 50


def test_code_in_tables_breaks_at_its_joints(html: Path):
    text = (html / "book" / "notation.html").read_text(encoding="utf-8")
    pieces = re.findall(r'(?s)<code[^>]*>((?:<span class="nowrap">.*?)+)</code>', text)
    plain = [re.sub(r"<(?!wbr)[^>]*>", "", piece) for piece in pieces]
    assert "chain.<wbr>restitution[<wbr>i-2]" in plain
    assert any("<wbr>" not in piece for piece in plain)
