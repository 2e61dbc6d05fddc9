"""The pages for every reader: contrast, names, headings, small and slow phones, print."""

import re
from pathlib import Path

import pytest
from explorer import EXPLORER, address_of_page, drawn, later, still, visits  # noqa: F401
from test_layout import ALL_SET, PATIENCE, browser, contrast, shape, show  # noqa: F401

#: WCAG 2.1, 1.4.3 (AA).
READABLE = 4.5

# Letters whose contrast with their ground is below what is asked: [contrast, its colours, words].
# Pictures have a ground of their own that no style names; they are looked at elsewhere.
PALE = """(least) => {
  const parse = (colour) => {
    const srgb = colour.startsWith("color(srgb");
    const parts = (colour.match(/-?[\\d.]+(e-?\\d+)?/g) ?? []).map(Number);
    const [r, g, b, alpha = 1] = parts;
    return [...[r, g, b].map((p) => (srgb ? 255 * p : p)), alpha];
  };
  const over = ([r, g, b, a], ground) => [r, g, b].map((p, k) => p * a + ground[k] * (1 - a));
  const luminance = (colour) => {
    const linear = colour.map((p) => p / 255)
      .map((p) => (p <= 0.04045 ? p / 12.92 : ((p + 0.055) / 1.055) ** 2.4));
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
  };
  const found = {};
  const look = (node, colour, words) => {
    const above = [];
    for (let at = node; at; at = at.parentElement) above.unshift(at);
    const ground = above.reduce(
      (under, at) => over(parse(getComputedStyle(at).backgroundColor), under), [255, 255, 255]);
    const letters = over(parse(colour), ground);
    const [low, high] = [luminance(letters), luminance(ground)].sort((a, b) => a - b);
    const ratio = (high + 0.05) / (low + 0.05);
    if (ratio < least) found[`${node.tagName}.${node.className} ${colour}`] =
      [ratio, ground.map(Math.round).join(), words.trim().slice(0, 30)];
  };
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let text = texts.nextNode(); text; text = texts.nextNode()) {
    const node = text.parentElement;
    if (!text.textContent.trim()) continue;
    if (node.closest("svg, :disabled, noscript, script, style")) continue;
    if (node.checkVisibility({ visibilityProperty: true, opacityProperty: true }))
      look(node, getComputedStyle(node).color, text.textContent);
  }
  for (const box of document.querySelectorAll("input[placeholder]"))
    if (box.checkVisibility())
      look(box, getComputedStyle(box, "::placeholder").color, "placeholder");
  return Object.entries(found);
}"""

# A heading more than one step below the one before it.
SKIPPED = """() => {
  const levels = [...document.querySelectorAll("h1, h2, h3, h4, h5, h6")]
    .filter((node) => node.checkVisibility()).map((node) => [+node.tagName[1], node.innerText]);
  return levels.filter(([level], k) => level > (k ? levels[k - 1][0] : 0) + 1);
}"""

# Tabs go from one control to the next; a formula is none.
STOPS = (
    """document.querySelectorAll('mjx-container[tabindex], mjx-container [tabindex="0"]').length"""
)

STILL = "*, *::before { transition: none !important; animation: none !important; }"


@pytest.fixture(scope="module")
def seen(html: Path, browser):  # noqa: F811
    """Every page once: what is pale, which headings are skipped, what is wider than a phone."""
    context = browser.new_context(viewport={"width": 320, "height": 640})
    context.set_default_timeout(PATIENCE)
    tab, found = context.new_page(), {}
    for page in [*sorted((html / "book").glob("*.html")), *sorted(html.glob("*.html"))]:
        if page.name == "index.html":
            continue  # leads to the first page
        tab.goto("about:blank")
        shape(tab, 320, "light")
        tab.goto(page.as_uri() + ("?q=restitution" if page.stem == "search" else ""))
        if page.stem == "search":
            tab.wait_for_function("/found \\d+ page/.test(document.body.innerText)")
        tab.add_style_tag(content=STILL)
        tab.evaluate(ALL_SET)
        view = {"wide": tab.evaluate("document.scrollingElement.scrollWidth")}
        view["headings"], view["stops"] = tab.evaluate(SKIPPED), tab.evaluate(STOPS)
        for mode in ("light", "dark"):
            show(tab, 1280, mode)
            view[mode] = tab.evaluate(PALE, READABLE)
        found[page.stem] = view
    context.close()
    assert len(found) > 25
    return found


def faults(seen, name, right):
    return [(page, view[name]) for page, view in seen.items() if view[name] != right]


def test_the_smallest_phone(seen):
    """320 pixels: none scrolls sideways."""
    assert faults(seen, "wide", 320) == []


def test_headings_follow_one_another(seen):
    assert faults(seen, "headings", []) == []


def test_formulas_are_no_stops_of_the_tab_key(seen):
    assert faults(seen, "stops", 0) == []


@pytest.mark.parametrize("mode", ["light", "dark"])
def test_letters_have_contrast(seen, mode):
    assert faults(seen, mode, []) == []


@pytest.mark.parametrize(
    ("style", "pale"),
    [("color: #777", True), ("color: #767676", False), ("background: #176de8", True),
     ("opacity: 1; color: rgb(0 0 0 / 50%)", True), ("color: color(srgb 0.5 0.5 0.5)", True)],
)  # fmt: skip
def test_pale_letters_are_seen(browser, style, pale):  # noqa: F811
    tab = browser.new_page()
    tab.set_content(f"<!DOCTYPE html><p style='color: #000; {style}'>words</p>")
    assert bool(tab.evaluate(PALE, READABLE)) is pale
    tab.close()


def test_folded_cells_are_named_by_their_words(html: Path):
    """A label would hide them: there are hundreds of cells, and each says what it holds."""
    summaries = [
        summary
        for page in (html / "book").glob("*.html")
        for summary in re.findall(r"<summary[^>]*>", page.read_text(encoding="utf-8"))
    ]
    assert len(summaries) > 200
    assert [summary for summary in summaries if "aria-label" in summary] == []


def test_notebooks_are_saved(html: Path):
    links = [
        link
        for page in (html / "book").glob("*.html")
        for link in re.findall(r"<a [^>]*\.ipynb\"[^>]*>", page.read_text(encoding="utf-8"))
        if "_sources" in link
    ]
    assert len(links) > 15
    assert [link for link in links if not re.search(r"\bdownload\b(?!-)", link)] == []
    for link in links:
        assert (html / "book" / re.search(r'href="([^"]*)"', link)[1]).resolve().is_file()


# --- a slow phone -------------------------------------------------------------------------------


def test_pages_without_equations_load_no_mathjax(html: Path):
    pages = {page.stem: page.read_text(encoding="utf-8") for page in (html / "book").glob("*.html")}
    loads = {name for name, text in pages.items() if "mathjax/" in text}
    has = {
        name for name, text in pages.items() if re.search(r'class="[^"]*\bmath notranslate', text)
    }
    assert loads == has
    assert not {"intro", "explorer", "api"} & loads
    assert len(loads) > 10


def test_equations_wait_until_they_are_seen(browser, html: Path):  # noqa: F811
    """At first those in sight are set, and a voice can read all of them; on paper all are set."""
    tab = browser.new_page(viewport={"width": 390, "height": 800})
    tab.set_default_timeout(PATIENCE)
    tab.goto((html / "book" / "reading.html").as_uri())
    tab.wait_for_function("document.querySelector('mjx-container svg')")
    tab.evaluate("MathJax.startup.promise")
    count = "document.querySelectorAll('mjx-container{}').length"
    everything, first = (tab.evaluate(count.format(end)) for end in ("", " > svg"))
    assert everything > 200
    assert 0 < first < everything / 4
    assert tab.evaluate(count.format(" math")) == everything
    formulas = "[...document.querySelectorAll('.bd-article mjx-container')]"
    shown = f"{formulas}.filter((node) => node.checkVisibility())"
    tab.evaluate(f"{shown}.pop().scrollIntoView({{ behavior: 'instant' }})")
    tab.wait_for_function(f"{shown}.pop().firstElementChild?.matches('svg')")
    tab.pdf()
    assert tab.evaluate(count.format(" > svg")) == everything
    tab.close()


SHIFTS = """
  globalThis.shifts = [];
  new PerformanceObserver((list) => shifts.push(...list.getEntries().map(({ value }) => value)))
    .observe({ type: "layout-shift", buffered: true });
"""


@pytest.mark.parametrize("width", [320, 390, 1400])
@pytest.mark.parametrize("name", ["explorer", "intro", "patterns"])
def test_a_page_does_not_jump(browser, html: Path, name: str, width: int):  # noqa: F811
    """The live cradle comes late, into its own place. Below .1 a shift counts as good."""
    tab = browser.new_page(viewport={"width": width, "height": 800})
    tab.set_default_timeout(PATIENCE)
    tab.add_init_script(SHIFTS)
    tab.goto((html / "book" / f"{name}.html").as_uri())
    tab.wait_for_function("globalThis.cradleExplorer?.live?.length > 0")
    tab.evaluate(ALL_SET.replace("lazyTypesetAll", "none"))
    tab.evaluate("new Promise((done) => setTimeout(done, 300))")
    assert sum(tab.evaluate("shifts")) < 0.1
    tab.close()


# --- paper --------------------------------------------------------------------------------------


def test_print_from_dark_mode(visit):
    """Black on white, with all that is still to be computed; then the page is as it was."""
    tab = still(visit, "#scene=map", color_scheme="dark", stopped=True)
    later(tab, 50)
    map_ = "document.querySelector('.map canvas')"
    ground = "getComputedStyle(document.body).backgroundColor"
    ink = "getComputedStyle(document.querySelector('.words')).color"
    painted = f"""(() => {{
      const canvas = {map_};
      const {{ data }} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      const light = (k) => data[k] + data[k + 1] + data[k + 2] > 3 * 127;
      const cells = data.filter((value, k) => k % 4 === 3);
      return [cells.every((value) => value === 255),
        cells.filter((value, k) => light(4 * k)).length / cells.length];
    }})()"""
    dark = tab.evaluate(f"[{ground}, {ink}]")
    tab.emulate_media(media="print")
    tab.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert tab.evaluate(ground) == "rgb(255, 255, 255)"
    assert sum(map(int, re.findall(r"\d+", tab.evaluate(ink))[:3])) < 200
    assert tab.evaluate(painted) == [True, 1]
    for name in ("Let go", "Copy link"):
        assert not tab.get_by_role("button", name=name).is_visible()
    assert not tab.locator("input[type=range]").first.is_visible()
    assert tab.get_by_label("ratio, as a number", exact=True).is_visible()
    tab.emulate_media(media="screen")
    tab.evaluate("dispatchEvent(new Event('afterprint'))")
    later(tab, 50)
    assert tab.evaluate(f"[{ground}, {ink}]") == dark
    assert tab.evaluate(painted)[1] < 0.5


# --- the live cradle's pictures -------------------------------------------------------------------


def test_numbers_in_colours_can_be_read(visit):
    """Of seven balls, beside their lines and on the bar of energy, in both modes."""
    masses = "speeds=1,0,0,0,0,0,0&masses=1,2,3,4,3,2,1&forward=0.3"
    tab = still(visit, f"#{masses}")
    drawn(tab)
    for mode, ground in (("light", "#ffffff"), ("dark", "#121212")):
        show(tab, 1400, mode)
        drawn(tab)
        found = tab.evaluate(
            """() => {
              const pen = document.createElement("canvas").getContext("2d");
              const code = (colour) => {
                pen.fillStyle = colour;
                pen.fillRect(0, 0, 1, 1);
                const [r, g, b] = pen.getImageData(0, 0, 1, 1).data;
                return "#" + [r, g, b].map((part) => part.toString(16).padStart(2, "0")).join("");
              };
              const fill = (node) => code(getComputedStyle(node).fill);
              const parts = [...document.querySelectorAll(".outcome .part, .outcome .gone")];
              return [
                [...document.querySelectorAll(".pictures .name")].map(fill),
                parts.filter((part) => part.nextElementSibling?.matches("text"))
                  .map((part) => [fill(part.nextElementSibling), fill(part)]),
              ];
            }"""
        )
        names, bars = found
        assert len(names) == 7
        assert min(contrast(name, ground) for name in names) >= READABLE
        assert len(set(names)) == 7
        assert len(bars) > 1
        assert min(contrast(*pair) for pair in bars) >= READABLE
    # On every colour of the palette, whether this hit shows it or not.
    for ball in range(7):
        letters, under = tab.evaluate(
            f"""() => {{
              const setting = {{ ...{EXPLORER}.state.setting, masses: [1, 1, 1, 1, 1, 1, 1] }};
              const now = [0, 0, 0, 0, 0, 0, 0].map((_, k) => +(k === {ball}));
              const host = {EXPLORER}.panels.outcome.node.querySelectorAll(".plot")[1];
              host.innerHTML = cradleExplorer.energy({{ width: 300, em: 16 }}, setting, now, now);
              const colour = (node) => getComputedStyle(node).fill;
              const part = host.querySelectorAll(".part")[{ball}];
              return [colour(host.querySelector("text")), colour(part)];
            }}"""
        )
        codes = (
            "#" + "".join(f"{int(part):02x}" for part in re.findall(r"\d+", one)[:3])
            for one in (letters, under)
        )
        assert contrast(*codes) >= READABLE, ball


def test_notes_and_places_can_be_read(visit):
    """The soft colour of notes, places and small letters."""
    tab = still(visit, "#scene=ABCCAB")
    drawn(tab)
    for mode in ("light", "dark"):
        show(tab, 1400, mode)
        assert tab.evaluate(PALE, READABLE) == []
