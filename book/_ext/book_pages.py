r"""Sphinx extension: what Jupyter Book leaves to be put right in the pages.

- MathJax is served with the book. The files come from sphinx-mathjax-offline, whose own extension
  would copy 18 MB of alternatives; one of 2 MB is all a page needs, and a small one by which an
  equation waits until it is about to be seen. In one page of the whole book, made for print, none
  waits. A page without equations loads neither.
- sphinx-thebe, which Jupyter Book always loads, writes scripts that name a server even when live
  code is off. They are dropped.
- Sphinx wraps an equation of several lines in `split`, where MathJax refuses the `\tag` that
  carries the paper's number. Such an equation is passed on as it is.
- An equation that is not set yet says about how large it will be; custom.css keeps the place.
- A line does not break between a formula and the comma behind it, nor behind the bracket before it.
- A table of pandas names its row labels in a row of their own; they go into that of column names.
- In such a table numbers and their heads stand at the right, words at the left, and a minus is one.
- In a table a name of the code breaks after a point, a bracket or a comma, and nowhere else.
- Figures of the appendices carry a letter: Fig. A.1.
- The list of references says, in place of a number, which pages cite each.
- The summary of what is folded is read as it is written; a box is called by its title, and opens
  for a link into it. A notebook is kept, not shown.
- A page that is linked from elsewhere shows a title, a sentence and a picture.
- Until the project has a public address, buttons that lead there are left out. `book_published` in
  `_config.yml` is the one switch.
"""

import re
from html import escape
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.environment import BuildEnvironment
from sphinx.util.fileutil import copy_asset_file

#: Options of the theme that lead to the project's address.
ADDRESSED = (
    "launch_buttons",
    "use_edit_page_button",
    "use_issues_button",
    "use_repository_button",
    "use_source_button",
)


#: What may stand before a formula, and behind it, without a space.
OPENING, CLOSING = re.compile(r"[(\[]+$"), re.compile(r"^[)\].,;:!?]+")

#: The space before a unit; its number may stand in a node of its own.
UNIT = re.compile(
    r"(?:^|(?<=\d)) (?=(?:%|[cmµ]?m(?:/s)?|[mµn]?s|kg|g)(?![\w/]))"
)

#: The button that gives a page's notebook.
NOTEBOOK = re.compile(
    r'(<a href="[^"]*_sources/[^"]*\.ipynb") target="_blank"'
)

#: The head of a table of pandas, and one of its cells.
HEAD = re.compile(r"<thead>.*?</thead>", re.DOTALL)
HEAD_CELL = re.compile(r"<th([^>]*)>(.*?)</th>", re.DOTALL)
#: Its rows, their cells, and what is a number in one.
ROW = re.compile(r"<tr.*?</tr>", re.DOTALL)
CELL = re.compile(
    r'<(t[hd])((?: colspan="(\d+)")?[^>]*)>(.*?)</\1>', re.DOTALL
)
NUMBER = re.compile(
    r"(?:&[lg]t; ?|[≤≥±≈] ?)?[-−+]?\.?\d[\d.,\s·±⁻⁰¹²³⁴⁵⁶⁷⁸⁹]*(?:e[-+]?\d+)?"
    r"(?:%|million|billion|[kmµn]?[smg]|m/s|J)?"
)
#: What a column of numbers may hold as well.
NEITHER = ("", "NaN", "none")
#: An equation as MathJax will find it; of TeX, what takes the place of one letter, and of none.
EQUATION = re.compile(
    r'<(div|span) class="(?:amsmath |output text_latex )?math [^>]*(?=>(.*?)</\1>)',
    re.DOTALL,
)
COMMAND, UNSEEN = re.compile(r"\\[a-zA-Z]+"), re.compile(r"[\s{}_^\\()]")
#: Code up to where it may break: behind a point, an opening bracket or a comma.
JOINTS = re.compile(r"[^.(\[,]*[.(\[,]+\s*|[^.(\[,]+")


def hide_what_needs_an_address(app: Sphinx, config: Config) -> None:
    """Leave out the buttons that would lead nowhere before the book is published."""
    if not config.book_published:
        for option in ADDRESSED:
            config.html_theme_options.pop(option, None)


#: The part of MathJax by which an equation is set when it is about to be seen.
LAZY = "ui/lazy"


def set_all_for_print(app: Sphinx) -> None:
    """Let no equation wait where the whole book is one page."""
    if app.builder.name == "singlehtml":
        loader = app.config.mathjax3_config["loader"]
        loader["load"] = [part for part in loader["load"] if part != LAZY]


def copy_mathjax(app: Sphinx, exception: Exception | None) -> None:
    """Put the file that `mathjax_path` names, and what it loads later, into the built book."""
    if exception is not None or app.builder.format != "html":
        return
    whole = Path(app.config.mathjax_path)
    for path in (whole, whole.parent / f"{LAZY}.js"):
        target = Path(app.outdir, "_static", path)
        target.parent.mkdir(parents=True, exist_ok=True)
        with as_file(
            files("sphinx-mathjax-offline") / "static" / path.as_posix()
        ) as source:
            copy_asset_file(str(source), str(target))


def drop_mathjax(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Remove MathJax from a page that has no equation itself; Sphinx asks its chapters as well."""
    equations = app.env.get_domain("math").data["has_equations"]
    if app.builder.name == "html" and not equations.get(page):
        context["script_files"] = [
            asset
            for asset in context["script_files"]
            if "mathjax" not in _text(asset).lower()
        ]


def measured(match: re.Match[str]) -> str:
    """Say how many lines an equation has, and how many letters one in a line of text."""
    kind, tex = match.groups()
    if kind == "div":
        rows = 1 + tex.count(r"\\")
        return f'{match[0]} style="--rows: {rows}"'
    letters = len(UNSEEN.sub("", COMMAND.sub("x", tex)))
    return f'{match[0]} style="--letters: {letters}"'


def mend_body(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Measure equations; remove the label of MyST-NB that hides the words of all summaries."""
    if "body" in context:
        body = context["body"].replace(
            '<summary aria-label="Toggle hidden content">', "<summary>"
        )
        context["body"] = EQUATION.sub(measured, body)


def keep_notebooks(app: Sphinx, exception: Exception | None) -> None:
    """Let the button for a notebook save it; a browser would show its source."""
    if exception is None and app.builder.format == "html":
        for path in Path(app.outdir).glob("**/*.html"):
            text = path.read_text(encoding="utf-8")
            kept = NOTEBOOK.sub(r"\1 download", text)
            if kept != text:
                path.write_text(kept, encoding="utf-8")


def drop_thebe(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Remove sphinx-thebe's script files and style sheet from a page."""
    for kind in ("script_files", "css_files"):
        if kind in context:
            context[kind] = [
                asset for asset in context[kind] if not _is_thebe(asset)
            ]


def drop_thebe_settings(
    app: Sphinx, doctree: nodes.document, page: str
) -> None:
    """Remove the settings that sphinx-thebe writes into the text of a page."""
    for raw in [
        node
        for node in doctree.findall(nodes.raw)
        if "x-thebe-config" in node.astext()
    ]:
        raw.parent.remove(raw)


def keep_tags(app: Sphinx, doctree: nodes.document, page: str) -> None:
    r"""Mark equations with a `\tag`, so that MyST writes them without Sphinx's `split`."""
    for equation in doctree.findall(nodes.math_block):
        if r"\tag" in equation.astext():
            # MyST passes blocks of this class on as they are, if its amsmath extension is on.
            equation["classes"].append("amsmath")


def keep_punctuation(
    app: Sphinx, doctree: nodes.document, page: str
) -> None:
    """Let no line break between a formula and its punctuation, where MathJax would allow it."""
    for formula in list(doctree.findall(nodes.math)):
        parent, at = formula.parent, formula.parent.index(formula)
        before = parent[at - 1] if at else None
        after = parent[at + 1] if at + 1 < len(parent) else None
        opening = _end_of(before, OPENING)
        closing = _end_of(after, CLOSING)
        if not (opening or closing):
            continue
        whole = nodes.inline("", "", classes=["nowrap"])
        # By place: another text of the paragraph may be the same.
        parent[at] = whole
        whole += [nodes.Text(opening), formula, nodes.Text(closing)]
        if opening:
            parent[at - 1] = nodes.Text(before[: -len(opening)])
        if closing:
            parent[at + 1] = nodes.Text(after[len(closing) :])


def keep_units(app: Sphinx, doctree: nodes.document, page: str) -> None:
    """Let no line break between a number and its unit."""
    for text in list(doctree.findall(nodes.Text)):
        if isinstance(
            text.parent,
            (nodes.literal, nodes.literal_block, nodes.raw, nodes.math),
        ):
            continue
        kept = UNIT.sub("\N{NO-BREAK SPACE}", text)
        if kept != text:
            text.parent.replace(text, nodes.Text(kept))


def _end_of(node: nodes.Node | None, pattern: re.Pattern[str]) -> str:
    """Return what a text has of a pattern; nothing if it is no text."""
    found = pattern.search(node) if isinstance(node, nodes.Text) else None
    return found[0] if found else ""


def mend_tables_of_pandas(
    app: Sphinx, doctree: nodes.document, page: str
) -> None:
    """Give a table one row of heads, and each of its columns a side."""
    for raw in list(doctree.findall(nodes.raw)):
        if 'class="dataframe' in raw.astext():
            table = line_up(HEAD.sub(_one_row_less, raw.astext()))
            raw.replace_self(nodes.raw("", table, **raw.attributes))


def line_up(table: str) -> str:
    """Mark the columns of numbers, heads and all, and write their minus as one.

    >>> line_up("<tr><th>v</th></tr><tr><td>-1</td></tr>")
    '<tr><th class="number">v</th></tr><tr><td class="number">−1</td></tr>'
    """
    words: set[int] = set()
    numbers: set[int] = set()
    for row in ROW.findall(table):
        cells = CELL.findall(row)
        for column, (_, _, _, text) in zip(
            _columns(cells), cells, strict=True
        ):
            if "<td" in row and text.strip(" -–—") not in NEITHER:
                (numbers if NUMBER.fullmatch(text) else words).add(column)

    def mended(row: re.Match[str]) -> str:
        columns = iter(_columns(CELL.findall(row[0])))

        def cell(found: re.Match[str]) -> str:
            kind, other, span, text = found.groups()
            if NUMBER.fullmatch(text):
                text = re.sub(r"(?<!\d)-", "−", text)
            right = next(columns) in numbers - words and not span
            side = ' class="number"' * right
            return f"<{kind}{other}{side}>{text}</{kind}>"

        return CELL.sub(cell, row[0])

    return ROW.sub(mended, table)


def _columns(cells: list[tuple[str, ...]]) -> list[int]:
    """Count the columns of a row from its end: a label may reach down over the next rows."""
    spans = [int(span or 1) for _, _, span, _ in cells]
    return [-sum(spans[k:]) for k in range(len(spans))]


def _one_row_less(head: re.Match[str]) -> str:
    """Join the last two rows of a table's head, if no column has a word in both of them."""
    rows = list(re.finditer(r"<tr.*?</tr>", head[0], re.DOTALL))
    if len(rows) < 2:
        return head[0]
    above, below = (HEAD_CELL.findall(row[0]) for row in rows[-2:])
    names = [text for _, text in below if text]
    if len(above) != len(below) or any(
        text for _, text in above[: len(names)] + below[len(names) :]
    ):
        return head[0]
    words = iter(names)
    row = HEAD_CELL.sub(
        lambda cell: f"<th{cell[1]}>{cell[2] or next(words, '')}</th>",
        rows[-2][0],
    )
    start, end = rows[-2].start(), rows[-1].end()
    return head[0][:start] + row + head[0][end:]


def break_code_in_tables(
    app: Sphinx, doctree: nodes.document, page: str
) -> None:
    """Let a name of the code in a table break where it has a joint."""
    for table in doctree.findall(nodes.table):
        for literal in list(table.findall(nodes.literal)):
            code = literal.astext()
            # A short one, as forward[i - 2], stays whole.
            pieces = JOINTS.findall(code) if len(code) > 16 else [code]
            literal.clear()
            for number, piece in enumerate(pieces):
                if number:
                    literal += nodes.raw("", "<wbr>", format="html")
                literal += nodes.inline("", piece, classes=["nowrap"])


def lead_back(app: Sphinx, doctree: nodes.document, page: str) -> None:
    """Say in the list of references which pages cite each; nobody cites its number."""
    listed = list(doctree.findall(nodes.citation))
    if not listed:
        return
    domain = app.env.get_domain("cite")
    keys = {one.citation_id: one.key for one in domain.citations}
    citing: dict[str, dict[str, None]] = {}
    for ref in domain.citation_refs:
        for target in ref.targets:
            citing.setdefault(target.key, {})[ref.docname] = None
    for entry in listed:
        for number in list(entry.findall(nodes.label)):
            number.parent.remove(number)
        pages = nodes.inline(classes=["cited"])
        for name in citing[keys[entry["ids"][0]]]:
            pages += nodes.Text(", " if pages.children else " Cited in: ")
            address = app.builder.get_relative_uri(page, name)
            title = app.env.titles[name].astext()
            pages += nodes.reference(
                "", title, refuri=address, internal=True
            )
        entry[-1] += [pages, nodes.Text(".")]


def number_equations(app: Sphinx, env: BuildEnvironment) -> list[str]:
    r"""Count only equations that show a number of ours: Sphinx counts the paper's, too.

    An equation of the paper has a place to which links lead, and its own number in a `\tag`.
    """
    changed = []
    for page, kinds in env.toc_fignumbers.items():
        numbers = kinds.get("displaymath", {})
        ours = {name for name in numbers if name.startswith("equation-")}
        if len(ours) < len(numbers):
            places = sorted(numbers.items(), key=lambda item: item[1])
            first = min(numbers.values())
            kept = [name for name, _ in places if name in ours]
            kinds["displaymath"] = {
                name: (*first[:-1], first[-1] + k)
                for k, name in enumerate(kept)
            }
            changed.append(page)
    return changed


def letter_figures(app: Sphinx, env: BuildEnvironment) -> list[str]:
    """Give figures and equations of the appendices the numbers A.1, A.2, ..., through all pages."""
    appendices = [
        page
        for page in env.toc_fignumbers
        if page != app.config.root_doc and not env.toc_secnumbers.get(page)
    ]
    for kind in ("figure", "displaymath"):
        names = [
            (page, name)
            for page in appendices
            for name in env.toc_fignumbers[page].get(kind, ())
        ]
        for number, (page, name) in enumerate(names, start=1):
            env.toc_fignumbers[page][kind][name] = ("A", number)
    return appendices


def describe(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Say in the page's head what a link to it may show (the Open Graph properties)."""
    if doctree is None:
        return
    title, text = (
        next((_words(node) for node in doctree.findall(kind)), "")
        for kind in (nodes.title, nodes.paragraph)
    )
    properties = {
        "og:type": "article",
        "og:title": f"{title} - {app.config.html_title}",
        "og:description": " ".join(text.split())[:200],
        "og:image": f"{app.config.html_baseurl}_static/cradle.png",
    }
    context["metatags"] = context.get("metatags", "") + "".join(
        f'\n<meta property="{name}" content="{escape(value, quote=True)}" />'
        for name, value in properties.items()
    )


def _words(node: nodes.Element) -> str:
    """Return the text of a node, without the tags of HTML in it."""
    return "".join(
        text.astext()
        for text in node.findall(nodes.Text)
        if not isinstance(text.parent, nodes.raw)
    )


def _text(asset: Any) -> str:
    """Return the address of a script or style sheet, and what stands in it."""
    return f"{asset.filename or ''} {getattr(asset, 'attributes', {}).get('body', '')}"


def _is_thebe(asset: Any) -> bool:
    return "thebe" in _text(asset).lower()


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the callbacks."""
    app.add_config_value("book_published", False, "env", types=(bool,))
    # Before the theme reads its options.
    app.connect("config-inited", hide_what_needs_an_address, priority=100)
    # Late, so that every other extension has added its part.
    app.connect("doctree-resolved", drop_thebe_settings, priority=900)
    app.connect("html-page-context", drop_thebe, priority=900)
    app.connect("html-page-context", drop_mathjax, priority=900)
    app.connect("html-page-context", mend_body)
    app.connect("html-page-context", describe)
    app.connect("build-finished", keep_notebooks)
    app.add_js_file("boxes.js", loading_method="defer")
    app.connect("builder-inited", set_all_for_print)
    app.connect("doctree-resolved", keep_tags)
    app.connect("doctree-resolved", keep_punctuation)
    app.connect("doctree-resolved", keep_units)
    app.connect("doctree-resolved", mend_tables_of_pandas)
    app.connect("doctree-resolved", break_code_in_tables)
    app.connect("doctree-resolved", lead_back)
    # After Sphinx has numbered all figures.
    app.connect("env-get-updated", number_equations, priority=890)
    app.connect("env-get-updated", letter_figures, priority=900)
    app.connect("build-finished", copy_mathjax)
    return {
        "version": "1",
        "parallel_read_safe": True,
        "parallel_write_safe": True,
    }
