"""Pages in a Chromium: how tests open them, give them a shape, and look at them."""

import contextlib
import os
import re
import shutil
from pathlib import Path

import pytest

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
  // What scrolls sideways looks like it.
  for (const node of document.querySelectorAll(".bd-content *"))
    if (wide(node) && ["auto", "scroll"].includes(getComputedStyle(node).overflowX)
      && getComputedStyle(node).maskImage === "none")
      say("no sign of more", node, node.clientWidth, node.scrollWidth);
  // Equations on a line of their own: whole, or in a box that scrolls and starts at its left end
  // because their letters would be less than half of those of the text.
  for (const node of document.querySelectorAll('.bd-content mjx-container[display="true"]')) {
    for (const box of [node, node.parentElement]) {
      if (!wide(box)) continue;
      const scrolls = ["auto", "scroll"].includes(getComputedStyle(box).overflowX);
      const left = node.querySelector("svg").getBoundingClientRect().left;
      const [size, full] = [node, node.parentElement]
        .map((of) => parseFloat(getComputedStyle(of).fontSize));
      const cut = !scrolls || left < box.getBoundingClientRect().left - 1;
      if (innerWidth > 600 || cut || size > 0.6 * full)
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
      // Colours of a map are a scale, and mean the same in both modes: none is turned.
      const filters = [];
      for (let node = image; node; node = node.parentElement)
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

# Equations wait until they are about to be seen: set them all.
ALL_SET = """async () => {
  await window.MathJax?.startup?.promise;
  await window.MathJax?.startup?.document?.lazyTypesetAll?.();
}"""

FRAMES = """() => new Promise((done) =>
  requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done))))"""


@contextlib.contextmanager
def launched():
    """Start the Chromium of this machine; skip where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    # The first one draws no window, and takes a fifth less of a processor.
    names = "chromium-headless-shell", "chromium", "chromium-browser", "google-chrome"
    command = next(filter(None, map(shutil.which, names)), None)
    if command is None:
        if os.environ.get("CRADLE_REQUIRE_BROWSER"):
            pytest.fail("CRADLE_REQUIRE_BROWSER is set and there is no Chromium")
        pytest.skip("no Chromium on this machine")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=command,
            args=["--no-sandbox", "--renderer-process-limit=1"],  # none is begun ahead
            timeout=PATIENCE,
        )
        yield browser
        browser.close()


def listened(tab) -> list[str]:
    """Return a list into which the page's errors go, and requests that leave the disk."""
    faults = []
    tab.on("console", lambda said: said.type == "error" and faults.append(said.text))
    tab.on("pageerror", lambda error: faults.append(str(error)))
    here = "file:", "data:", "blob:"
    tab.on("request", lambda asked: asked.url.startswith(here) or faults.append(asked.url))
    return faults


@contextlib.contextmanager
def visiting(browser, idle: dict[tuple, list], html: Path):
    """Give what opens pages; at the end: no error on a console, no request that leaves the disk.

    They are those without heavy scripts, unless `equations` are asked for.

    A new window takes three times as long as a new page in an old one: those that are `idle`, of
    each kind, are used again.
    """
    used = []

    def window(stopped, options):
        context = browser.new_context(**dict(options))
        context.set_default_timeout(PATIENCE)
        tab = context.new_page()
        if stopped:  # for dates, timers and frames alike; `tab.clock.run_for` lets time pass
            tab.clock.install(time=0)
            tab.clock.pause_at(10**6)
        return tab, listened(tab)

    def visit(
        fragment=None, *, chapter="explorer", width=1400, height=900, stopped=False,
        equations=False, color_scheme="light", reduced_motion="no-preference", **options,
    ):  # fmt: skip
        kind = stopped, tuple(options.items())
        tab, faults = idle[kind].pop() if idle[kind] else window(*kind)
        used.append((kind, tab, faults))
        tab.set_viewport_size({"width": width, "height": height})
        tab.emulate_media(media="screen", color_scheme=color_scheme, reduced_motion=reduced_motion)
        if fragment is None:  # with a setting in the address nothing is covered
            fragment = "#scene=example" * (chapter == "explorer")
        pages = html if equations else html.with_name("light")
        tab.goto((pages / "book" / f"{chapter}.html").as_uri() + fragment)
        if options.get("java_script_enabled", True):
            tab.wait_for_function(
                "!document.querySelector('.cradle-explorer')"
                " || globalThis.cradleExplorer?.live?.length > 0"
            )
        return tab

    yield visit
    for kind, tab, faults in used:
        tab.mouse.up()
        tab.goto("about:blank")
        idle[kind].append((tab, faults))
    assert not any(faults for *_, faults in used), used


def shape(tab, width: int, mode: str) -> None:
    """Give the window this width and the page this mode."""
    tab.set_viewport_size({**tab.viewport_size, "width": width})
    tab.emulate_media(color_scheme=mode)


# Wait until the page has this width and this mode, and what follows the window has followed:
# fit_equations.js hears of it before the next frame.
FOLLOWED = f"""async ([width, mode]) => {{
  const frames = {FRAMES};
  const there = () => innerWidth === width && document.documentElement.dataset.theme === mode;
  for (let k = 0; k < 10000 && !there(); k += 1) await frames();
  await frames();
  return there();
}}"""


def show(tab, width: int, mode: str) -> None:
    """Give the window this width and the page this mode, and wait until it has followed."""
    # To give it again what it has takes as long: all styles are computed anew.
    if tab.viewport_size["width"] != width:
        tab.set_viewport_size({**tab.viewport_size, "width": width})
    if tab.evaluate("document.documentElement.dataset.theme") != mode:
        tab.emulate_media(color_scheme=mode)
    assert tab.evaluate(FOLLOWED, [width, mode]), "the page does not follow the window"


def luminance(colour: str) -> float:
    """Relative luminance as WCAG defines it."""
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return sum(k * p for k, p in zip((0.2126, 0.7152, 0.0722), linear))


def contrast(one: str, other: str) -> float:
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def colour(node, name: str) -> str:
    """Return a colour of an element as it is shown: #rrggbb."""
    return code(node.evaluate("(node, name) => getComputedStyle(node)[name]", name))


def code(style: str) -> str:
    """Return a colour of a style, rgb(r, g, b) or color(srgb r g b), as #rrggbb."""
    if style.startswith("color(srgb"):
        parts = [round(255 * float(part)) for part in re.findall(r"[\d.]+", style)[:3]]
        return "#" + "".join(f"{part:02x}" for part in parts)
    return "#" + "".join(f"{int(part):02x}" for part in re.findall(r"\d+", style)[:3])
