"""The pages in a browser: nothing cut, nothing wider than its window, in both widths and modes."""

import os
import re
import shutil
from pathlib import Path

import book_figures
import pytest

#: Widths and modes of the window.  Widths decide what fits, modes which pictures are shown; pages
#: take long to load, and the weekly tests look at the other pairs.
VIEWS = ((1280, "dark"), (360, "light"))
OTHER_VIEWS = ((1280, "light"), (360, "dark"), (390, "light"), (390, "dark"))
#: The window is low: only what is in it is painted.
HEIGHT = 200
#: Widths of phones.
PHONES = (390, 360)
#: Contrast that letters need, and lines and marks (WCAG 2.1: 1.4.6 and 1.4.11).
LETTERS, LINES = 7.0, 3.0
#: Milliseconds until a browser that does not answer is given up: far above any slow machine's need.
PATIENCE = 300_000

# What a page shows that does not fit: [kind, beginning of its text, has, needs].
MISFITS = """() => {
  const found = [];
  const say = (kind, node, has, needs) =>
    found.push([kind, (node.textContent || node.alt || "").trim().slice(0, 70), has, needs]);
  if (document.scrollingElement.scrollWidth > innerWidth)
    say("page", document.querySelector("h1"), innerWidth, document.scrollingElement.scrollWidth);
  const wide = (node) => node.checkVisibility() && node.scrollWidth > node.clientWidth + 1;
  // Code and messages: every line is seen as a whole, without scrolling.
  for (const node of document.querySelectorAll(".bd-content pre"))
    if (wide(node)) say("code", node, node.clientWidth, node.scrollWidth);
  // Equations on a line of their own: whole, or in a box that scrolls and starts at its left end.
  for (const node of document.querySelectorAll('.bd-content mjx-container[display="true"]')) {
    for (const box of [node, node.parentElement]) {
      if (!wide(box)) continue;
      const scrolls = ["auto", "scroll"].includes(getComputedStyle(box).overflowX);
      const left = node.querySelector("svg").getBoundingClientRect().left;
      if (innerWidth > 600 || !scrolls || left < box.getBoundingClientRect().left - 1)
        say("equation", node, box.clientWidth, box.scrollWidth);
    }
    const number = node.parentElement.querySelector(".eqno");
    if (number && node.checkVisibility()) {
      const end = node.getBoundingClientRect().right, start = number.getBoundingClientRect().left;
      if (start < end - 1) say("number on equation", node, start, end);
    }
  }
  // Formulas in a line of text: their box does not cut them.
  for (const node of document.querySelectorAll('.bd-content mjx-container:not([display])'))
    if (wide(node) && getComputedStyle(node).overflowX !== "visible")
      say("formula", node, node.clientWidth, node.scrollWidth);
  // Tables of numbers: on a desk no column is cut.
  for (const node of document.querySelectorAll(".bd-content table.dataframe")) {
    const box = node.closest(".output") ?? node.parentElement;
    if (innerWidth > 1200 && wide(box)) say("table", node, box.clientWidth, box.scrollWidth);
  }
  // Formulas in a table: they stay in their column.
  for (const node of document.querySelectorAll(".bd-content td mjx-container > svg")) {
    if (!node.checkVisibility()) continue;
    const end = node.getBoundingClientRect().right, column = node.closest("td");
    const edge = column.getBoundingClientRect().right;
    if (end > edge + 1) say("formula over its column", column, edge, end);
  }
  // Figures: one of the two is shown, and its letters can be read.
  for (const box of document.querySelectorAll(".figure-box")) {
    const shown = [...box.children].filter((image) => image.checkVisibility());
    const closed = !box.checkVisibility();
    if (!closed && shown.length !== 1) say("figures shown", box, 1, shown.length);
    for (const image of shown) {
      const share = image.getBoundingClientRect().width / image.getAttribute("width");
      const letters = share * box.dataset.letters;
      if (!(letters > 10.9)) say("small letters", image, letters, 10.9);
      // Colours of a map are a scale, and mean the same in both modes.
      const filters = [];
      for (let node = image; node && image.matches(".map"); node = node.parentElement)
        filters.push(getComputedStyle(node).filter);
      if (filters.some((filter) => filter !== "none")) say("turned map", image, filters, "none");
    }
  }
  // Columns of tables: none is squeezed to a word or two a line.
  for (const node of document.querySelectorAll(".bd-content td")) {
    if (!node.checkVisibility()) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    const line = parseFloat(getComputedStyle(node).lineHeight);
    const lines = range.getBoundingClientRect().height / line;
    const letters = node.textContent.trim().length;
    if (lines > 6.5 && letters / lines < 8) say("squeezed column", node, letters / lines, 8);
  }
  // Words in tables: whole, where the table does not say otherwise.
  for (const node of document.querySelectorAll(".bd-content :is(td, th)")) {
    if (!node.checkVisibility() || getComputedStyle(node).overflowWrap === "anywhere") continue;
    const texts = document.createTreeWalker(node, NodeFilter.SHOW_TEXT);
    for (let text; (text = texts.nextNode());) {
      if (!text.parentElement.checkVisibility() || text.parentElement.closest("mjx-container"))
        continue;
      for (const { 0: word, index } of text.data.matchAll(/[\\p{L}\\p{N}_]+/gu)) {
        const range = document.createRange();
        range.setStart(text, index);
        range.setEnd(text, index + word.length);
        const boxes = [...range.getClientRects()].filter(({ width }) => width > 0);
        const lines = new Set(boxes.map(({ top }) => Math.round(top / 4)));
        if (lines.size > 1) say("broken word", text, word, lines.size);
      }
    }
  }
  return found;
}"""

# Numbers of equations: [number, its right end, that of the column], and how large its letters are.
NUMBERS = """() => [...document.querySelectorAll('.bd-content mjx-container[display="true"]')]
  .flatMap((node) => {
    const box = node.parentElement;
    const number = node.querySelector('g[id^="mjx-eqn"]') ?? box.querySelector(".eqno");
    if (!number || !node.checkVisibility()) return [];
    const { right } = number.getBoundingClientRect();
    const column = Math.min(...[node, box].map((edge) => edge.getBoundingClientRect().right));
    const end = number.matches(".eqno") ? box.getBoundingClientRect().right : column;
    const letters = parseFloat(getComputedStyle(node).fontSize);
    return [[number.id || number.textContent, right, end, letters]];
  })"""

# Equations wait until they are about to be seen: set them all.
ALL_SET = """async () => {
  await window.MathJax?.startup?.promise;
  await window.MathJax?.startup?.document?.lazyTypesetAll?.();
}"""

FRAMES = """() => new Promise((done) =>
  requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done))))"""


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    command = next(
        filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
    )
    if command is None:
        if os.environ.get("CRADLE_REQUIRE_BROWSER"):
            pytest.fail("CRADLE_REQUIRE_BROWSER is set and there is no Chromium")
        pytest.skip("no Chromium on this machine")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=command, args=["--no-sandbox"], timeout=PATIENCE
        )
        yield browser
        browser.close()


def shape(tab, width: int, mode: str) -> None:
    """Give the window this width and the page this mode."""
    tab.set_viewport_size({**tab.viewport_size, "width": width})
    tab.emulate_media(color_scheme=mode)


def show(tab, width: int, mode: str) -> None:
    """Give the window this width and the page this mode, and wait until it has followed."""
    shape(tab, width, mode)
    shown = "[innerWidth, document.documentElement.dataset.theme]"
    tab.wait_for_function(f"(asked) => `${{{shown}}}` === `${{asked}}`", arg=[width, mode])
    # fit_equations.js follows the window, and hears of it before the next frame.
    tab.evaluate(FRAMES)


@pytest.fixture(
    scope="module",
    params=[
        pytest.param((2, VIEWS), id="2"),
        pytest.param((1, OTHER_VIEWS), id="1", marks=pytest.mark.exhaustive),
        pytest.param((3, OTHER_VIEWS), id="3", marks=pytest.mark.exhaustive),
    ],
)
def looked_at(request, html: Path, browser):
    """Load every page once; return by page what does not fit, and the numbers of its equations.

    Letters of formulas are rounded to device pixels: of these there are 1, 2 or 3 a pixel.
    """
    density, views = request.param
    context = browser.new_context(
        device_scale_factor=density, viewport={"width": views[0][0], "height": HEIGHT}
    )
    context.set_default_timeout(PATIENCE)
    tab = context.new_page()
    said: list[str] = []
    tab.on("console", lambda entry: said.append(entry.text) if entry.type == "error" else None)
    tab.on("pageerror", lambda error: said.append(str(error)))
    found = {}
    for page in sorted((html / "book").glob("*.html")):
        said.clear()
        tab.goto("about:blank")  # so that nothing is laid out anew for the first view
        shape(tab, *views[0])
        tab.goto(page.as_uri())
        tab.evaluate(ALL_SET)
        faults, numbers = [], []
        for width, mode in views:
            show(tab, width, mode)
            faults += [[width, mode, *misfit] for misfit in tab.evaluate(MISFITS)]
        if re.search(r'\\tag|class="eqno"', page.read_text(encoding="utf-8")):
            for width in PHONES:
                show(tab, width, "light")
                numbers += [(width, *number) for number in tab.evaluate(NUMBERS)]
        found[page.stem] = faults + said, numbers
    context.close()
    return found


def test_nothing_is_cut(looked_at: dict):
    assert len(looked_at) > 15
    faults = [(page, fault) for page, (faults, _) in looked_at.items() for fault in faults]
    assert not faults, "\n".join(f"{page}: {fault}" for page, fault in faults)


def test_numbers_of_equations_on_a_phone(looked_at: dict):
    """None is cut, and none needs letters that are smaller than those of figures."""
    numbers = [(page, *number) for page, (_, numbers) in looked_at.items() for number in numbers]
    assert len(numbers) >= 53 * len(PHONES)  # of the paper alone
    cut = [number for number in numbers if number[3] > number[4] + 0.5 or number[5] < 7.8]
    assert not cut, "\n".join(map(str, cut))


@pytest.mark.parametrize(
    ("body", "kind"),
    [
        ("<p style='width: 500px'>wide</p>", "page"),
        (
            "<div style='overflow: hidden'><pre style='overflow: auto'>"
            + 90 * "x"
            + "</pre></div>",
            "code",
        ),
        (
            "<span class='figure-box' data-letters='12'><img class='map' width='100' "
            "style='width: 100px; height: 9px; filter: invert(0.93)'></span>",
            "turned map",
        ),
        ("<table><td style='width: 2em'>" + 40 * "word " + "</td></table>", "squeezed column"),
        (
            "<table style='width: 1px'><td><p style='overflow-wrap: anywhere'>R1</table>",
            "broken word",
        ),
        (
            "<table style='table-layout: fixed; width: 4em'><td><mjx-container display='true'>"
            "<svg style='width: 20em'></svg></mjx-container></td></table>",
            "formula over its column",
        ),
    ],
)
def test_a_misfit_is_seen(browser, body: str, kind: str):
    """The list above is not empty because it cannot find anything."""
    tab = browser.new_page(viewport={"width": 390, "height": 900})
    tab.set_content(
        "<!DOCTYPE html><h1>page</h1>"
        f"<main class='bd-content' style='line-height: 20px'>{body}</main>"
    )
    assert kind in [misfit[0] for misfit in tab.evaluate(MISFITS)]
    tab.close()


def test_search_from_a_disk(browser, html: Path):
    """It finds pages, and asks for nothing that the browser refuses to a page from a disk."""
    tab = browser.new_page()
    faults = []
    tab.on("console", lambda said: said.type == "error" and faults.append(said.text))
    tab.goto((html / "search.html").as_uri() + "?q=restitution")
    tab.wait_for_function("/found \\d+ page/.test(document.body.innerText)", timeout=PATIENCE)
    assert tab.locator("#search-results li").count() > 10
    assert not faults
    tab.close()


def luminance(colour: str) -> float:
    """Relative luminance as WCAG defines it."""
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return sum(k * p for k, p in zip((0.2126, 0.7152, 0.0722), linear))


def contrast(one: str, other: str) -> float:
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def test_colours_of_dark_mode_can_be_seen():
    from cradle.pictures.impacts import PALETTE

    ground = book_figures.dark("white")
    assert contrast(book_figures.dark("black"), ground) > LETTERS
    for colour in PALETTE:
        assert contrast(book_figures.dark(colour), ground) > LINES, colour
    # Letters on a coloured ground stay as they are.
    assert all(book_figures.dark(kept) == kept for kept in ("#010101", "#fefefe"))
    # Greys and tints change sides and keep their order.
    greys = ["#000000", "#666666", "#b0b0b0", "#e8eef4", "#ffffff"]
    light = [luminance(book_figures.dark(grey)) for grey in greys]
    assert light == sorted(light, reverse=True)


def test_every_figure_has_both_colourings(html: Path):
    drawings = [
        path for path in (html / "_images").glob("*.svg") if not path.stem.endswith("-dark")
    ]
    assert len(drawings) > 40
    maps = [path for path in drawings if "<image" in path.read_text(encoding="utf-8")]
    assert 5 < len(maps) < 15  # these stay as they are
    for path in set(drawings) - set(maps):
        drawing = path.with_name(f"{path.stem}-dark.svg").read_text(encoding="utf-8")
        colours = {match.lower() for match in book_figures.COLOUR.findall(drawing)}
        assert not colours & {"#ffffff", "#fff", "#000000", "#000", "white", "black"}, path
        # Colours alone differ.
        blank = re.compile(f'fill="#e0e0e0" |{book_figures.COLOUR.pattern}')
        assert blank.sub("", drawing) == blank.sub("", path.read_text(encoding="utf-8")), path
    shown = "".join(page.read_text(encoding="utf-8") for page in (html / "book").glob("*.html"))
    for path in drawings:
        dark = shown.count(f"{path.stem}-dark.svg")
        assert shown.count(path.name) > 0, path
        assert dark == (0 if path in maps else shown.count(path.name)), path
