"""The pages in a browser: nothing is cut, pale, out of order or said in error."""

import base64
import io
import re
from pathlib import Path
from types import SimpleNamespace

import book_figures
import numpy as np
import pytest
from explorer import EXPLORER
from matplotlib import colormaps
from matplotlib.colors import to_hex
from matplotlib.image import imread
from pages import (
    ALL_SET,
    FRAMES,
    MISFITS,
    PATIENCE,
    code,
    contrast,
    listened,
    luminance,
    shape,
    show,
)

from cradle.pictures.impacts import PALETTE

#: Widths of a desk, of the smallest phone, and of two others.
DESK, SMALLEST, PHONES = 1280, 320, {360, 390}
#: Widths and modes of the window.  Widths decide what fits, modes which pictures are shown; pages
#: take long to load, and the weekly tests look at the other pairs.
VIEWS = ((DESK, "dark"), (360, "light"))
OTHER_VIEWS = ((DESK, "light"), (360, "dark"), (390, "light"), (390, "dark"))
#: Pages of each kind.  On a desk in light colours others have nothing new but the bars at their
#: sides, and those are the same on all pages.
KINDS = {"explorer", "intro", "toy", "own_solver", "search", "genindex"}
#: The window is low: only what is in it is painted.
HEIGHT = 200
#: Contrast that letters need, and lines and marks (WCAG 2.1: 1.4.3, 1.4.6 and 1.4.11).
READABLE, LETTERS, LINES = 4.5, 7.0, 3.0

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
  const grounds = new Map([[null, [255, 255, 255]]]);
  const groundOf = (node) => {
    if (!grounds.has(node)) {
      const own = parse(getComputedStyle(node).backgroundColor);
      grounds.set(node, over(own, groundOf(node.parentElement)));
    }
    return grounds.get(node);
  };
  const found = {};
  const look = (node, colour, words) => {
    const ground = groundOf(node);
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
STOPS = """[...document.querySelectorAll('mjx-container[tabindex], mjx-container [tabindex="0"]')]
  .map((node) => node.textContent)"""

# Misfits that no change of the window may mend.
AS_IT_CAME = "equation", "no sign of more"

STILL = "*, *::before { transition: none !important; animation: none !important; }"
FOUND = "/found \\d+ page/.test(document.body.innerText)"


def looked_at(tab, page: Path, views) -> dict[str, list]:
    """Open a page; list its faults by kind, and the numbers of its equations on phones."""
    tab.goto("about:blank")
    shape(tab, SMALLEST, "light")
    searched = page.stem == "search"
    tab.goto(page.as_uri() + ("?q=restitution" if searched else ""))
    if searched:
        tab.wait_for_function(FOUND)
        assert tab.locator("#search-results li").count() > 10
    tab.add_style_tag(content=STILL)
    tab.evaluate(ALL_SET)
    tab.evaluate(FRAMES)
    wide = tab.evaluate("document.scrollingElement.scrollWidth")
    found = {"wide": [wide] * (wide > SMALLEST), "misfits": [], "numbers": [], "pale": []}
    # As the page came, before any change of the window.
    found["misfits"] += [cut for cut in tab.evaluate(MISFITS) if cut[0] in AS_IT_CAME]
    found["headings"], found["stops"] = tab.evaluate(SKIPPED), tab.evaluate(STOPS)
    tagged = re.search(r'\\tag|class="eqno"', page.read_text(encoding="utf-8"))
    pale = {*views, *((DESK, mode) for mode in ("light", "dark") if page.stem in KINDS)}
    sights = {*pale, *((width, "light") for width, _ in views if tagged and width in PHONES)}
    # Each change takes long: first the light ones, narrow to wide, then the dark ones.
    for width, mode in sorted(sights, key=lambda sight: (sight[1] == "dark", sight)):
        show(tab, width, mode)
        if (width, mode) in views and page.parent.name == "book":
            found["misfits"] += [[width, mode, *misfit] for misfit in tab.evaluate(MISFITS)]
        if (width, mode) in pale:
            found["pale"] += [[width, mode, *cut] for cut in tab.evaluate(PALE, READABLE)]
        if width in PHONES and tagged and mode == "light":
            found["numbers"] += [(width, *number) for number in tab.evaluate(NUMBERS)]
    return found


@pytest.fixture(
    scope="module",
    params=[
        pytest.param((2, VIEWS), id="2"),
        *(
            pytest.param(
                (density, OTHER_VIEWS), id=f"{density}, others", marks=pytest.mark.exhaustive
            )
            for density in (1, 2, 3)
        ),
    ],
)
def seen(request, html: Path, browser):
    """Every page once, by its name.

    Letters of formulas are rounded to device pixels: of these there are 1, 2 or 3 a pixel.
    """
    density, views = request.param
    context = browser.new_context(
        device_scale_factor=density, viewport={"width": SMALLEST, "height": HEIGHT}
    )
    context.set_default_timeout(PATIENCE)
    tab = context.new_page()
    said, found = listened(tab), {}
    for page in [*sorted((html / "book").glob("*.html")), *sorted(html.glob("*.html"))]:
        if page.name != "index.html":  # leads to the first page
            said.clear()
            found[page.stem] = looked_at(tab, page, views) | {"said": said.copy()}
    context.close()
    assert len(found) > 25
    assert found.keys() > KINDS
    return found


@pytest.mark.parametrize("kind", ["said", "misfits", "wide", "headings", "stops", "pale"])
def test_pages(seen, kind: str):
    """No error, no cut, no bar sideways, no heading left out, no false stop, no pale words."""
    faults = [f"{page}: {fault}" for page, view in seen.items() for fault in view[kind]]
    assert not faults, "\n".join(faults)


def test_numbers_of_equations_on_a_phone(seen):
    """None is cut, and none needs letters that are smaller than those of figures."""
    numbers = [(page, *number) for page, view in seen.items() for number in view["numbers"]]
    widths = {number[1] for number in numbers}
    assert widths <= PHONES
    assert len(numbers) >= 53 * len(widths) > 0  # of the paper alone
    cut = [number for number in numbers if number[3] > number[4] + 0.5 or number[5] < 7.8]
    assert not cut, "\n".join(map(str, cut))


SPOILT = {
    "page": "<p style='width: 500px'>wide</p>",
    "code": f"<div style='overflow: hidden'><pre style='overflow: auto'>{90 * 'x'}</pre></div>",
    "turned map": "<span class='figure-box' data-letters='12'><img class='map' width='100' "
    "style='width: 100px; height: 9px; filter: invert(0.93)'></span>",
    "no sign of more": "<p style='overflow: auto'><b style='display: block; width: 500px'>more",
    "squeezed column": f"<table><td style='width: 2em'>{40 * 'word '}</td></table>",
    "broken word": "<table style='width: 1px'><td><p style='overflow-wrap: anywhere'>R1</table>",
    "formula over its column": "<table style='table-layout: fixed; width: 4em'><td>"
    "<mjx-container display='true'><svg style='width: 20em'></svg></mjx-container></td></table>",
}


def test_what_is_spoilt_is_seen(browser):
    """The lists above are not empty because they cannot find anything."""
    tab = browser.new_page(viewport={"width": 390, "height": 900})
    for kind, body in SPOILT.items():
        tab.set_content(
            "<!DOCTYPE html><h1>page</h1>"
            f"<main class='bd-content' style='line-height: 20px'>{body}</main>"
        )
        assert kind in [misfit[0] for misfit in tab.evaluate(MISFITS)]
    for style, pale in (
        ("color: #777", True), ("color: #767676", False), ("background: #176de8", True),
        ("opacity: 1; color: rgb(0 0 0 / 50%)", True), ("color: color(srgb 0.5 0.5 0.5)", True),
    ):  # fmt: skip
        tab.set_content(f"<!DOCTYPE html><p style='color: #000; {style}'>words</p>")
        assert bool(tab.evaluate(PALE, READABLE)) is pale, style
    tab.close()


def test_areas_in_dark_mode_can_be_seen(visit):
    """Those of the live map and of figures, and the letters on them."""
    style = "getComputedStyle(document.querySelector('.cradle-explorer'))"
    tab = visit(color_scheme="dark")
    live = [tab.evaluate(f"{style}.getPropertyValue('--pattern-{k}')").strip() for k in (1, 2, 3)]
    tints = [book_figures.dark(tint) for tint in ("#d0e6f5", "#fae2bb", "#d9b3cf")]
    assert live == tints
    for area in (*tints, *map(book_figures.dark, ("#9ecae1", "#fee6ce"))):
        assert contrast(area, book_figures.dark("white")) >= 2.49, area
        assert contrast(area, book_figures.dark("black")) >= READABLE, area


LETTERS_OF_FIGURES = re.compile(r'<g style="fill: (#\w{6})[^>]*scale\(0\.')


def test_coloured_letters_of_figures_can_be_read(html: Path):
    """In both colourings; greys are looked at elsewhere."""
    found = set()
    for path in (html / "_images").glob("fig-*.svg"):
        ground = book_figures.dark("white") if path.stem.endswith("-dark") else "#ffffff"
        for colour in LETTERS_OF_FIGURES.findall(path.read_text(encoding="utf-8")):
            if book_figures.spread(colour) > book_figures.COLOURFUL:
                found.add((colour, ground))
                least = READABLE if ground == "#ffffff" else 5.9
                assert contrast(colour, ground) >= least, (path, colour)
    assert len(found) > 10


def test_colours_of_dark_mode_can_be_seen():
    ground = book_figures.dark("white")
    assert contrast(book_figures.dark("black"), ground) > LETTERS
    for colour in PALETTE:
        assert contrast(book_figures.dark(colour), ground) > LINES, colour
    # A scale of a map goes from pale to strong: from the ground on.
    for name in ("Blues", "Oranges", "cividis_r"):
        scale = [to_hex(colormaps[name](share)) for share in np.linspace(0, 1, 9)]
        for one in scale:
            there = min(contrast(one, "#ffffff"), contrast("#e0e0e0", ground))
            assert contrast(book_figures.turned(one), ground) == pytest.approx(there, rel=0.03)
    # Greys and tints change sides and keep their order.
    greys = ["#000000", "#666666", "#b0b0b0", "#e8eef4", "#ffffff"]
    light = [luminance(book_figures.dark(grey)) for grey in greys]
    assert light == sorted(light, reverse=True)


def light_of(image: str) -> float:
    """The middle brightness of a picture of points."""
    points = imread(io.BytesIO(base64.b64decode(image)))
    return float(np.median(points[points[..., 3] > 0][:, :3]))


def test_every_figure_has_both_colourings(html: Path):
    drawings = [
        path for path in (html / "_images").glob("*.svg") if not path.stem.endswith("-dark")
    ]
    assert len(drawings) > 40
    assert all(path.stem.startswith("fig-") for path in drawings)  # who saves one finds it again
    maps = [path for path in drawings if "<image" in path.read_text(encoding="utf-8")]
    assert 2 < len(maps) < 15
    for path in maps:
        points, turned = (
            np.array([light_of(image) for image in book_figures.POINTS.findall(text)])
            for text in (
                path.read_text(encoding="utf-8"),
                path.with_name(f"{path.stem}-dark.svg").read_text(encoding="utf-8"),
            )
        )
        assert len(points) == len(turned) > 0, path
        assert (turned[points > 0.5] < 0.5).all(), path  # pale ones are dark
    for path in drawings:
        drawing = path.with_name(f"{path.stem}-dark.svg").read_text(encoding="utf-8")
        colours = {match.lower() for match in book_figures.COLOUR.findall(drawing)}
        assert not colours & {"#ffffff", "#fff", "#000000", "#000", "white", "black"}, path
        # Colours alone differ.
        points = book_figures.POINTS.pattern
        blank = re.compile(f'fill="#e0e0e0" |{book_figures.COLOUR.pattern}|{points}')
        assert blank.sub("", drawing) == blank.sub("", path.read_text(encoding="utf-8")), path
    shown = "".join(page.read_text(encoding="utf-8") for page in (html / "book").glob("*.html"))
    for path in drawings:
        dark = shown.count(f"{path.stem}-dark.svg")
        assert shown.count(path.name) > 0, path
        assert dark == shown.count(path.name), path


def test_figures_of_a_second_build_are_those_of_the_first(tmp_path):
    """Colours are made from what a notebook stores, not from what was made of it."""
    letters = '<g style="fill: #e69f00" transform="translate(1 1) scale(0.1 -0.1)"/>'
    (tmp_path / "stored.svg").write_text(f"<svg >{letters}</svg>", encoding="utf-8")
    (tmp_path / "_images").mkdir()
    builder = SimpleNamespace(format="html", images={"stored.svg": "fig-a.svg"})
    app = SimpleNamespace(builder=builder, srcdir=tmp_path, outdir=tmp_path)
    built = tmp_path / "_images" / "fig-a.svg"
    built.write_bytes((tmp_path / "stored.svg").read_bytes())
    found = []
    for _ in range(2):
        book_figures.write_colourings(app, None)
        found.append([path.read_bytes() for path in sorted(built.parent.iterdir())])
    assert found[0] == found[1]
    assert len(set(found[0])) == len(found[0]) == 2


def test_a_ball_of_a_film_looks_as_in_the_figures(visit):
    """Both modes: its own colour, on the ground of the page; on a phone its letters can be read."""
    tab = visit(chapter="toy", width=375)
    assert tab.locator(".animation svg").count() == 1
    for mode, ground in (("light", "#ffffff"), ("dark", book_figures.dark("white"))):
        show(tab, 375, mode)
        painted, filters, sizes = tab.evaluate("""(() => {
          const films = [...document.querySelectorAll(".animation svg")];
          const style = (query) => getComputedStyle(document.querySelector(".animation " + query));
          const rims = [0, 1, 2, 3, 4].map((k) => style(`[id$="-s0b${k}-0"] use`).stroke);
          const sizes = films.flatMap((svg) => {
            const unit = svg.getBoundingClientRect().width / svg.viewBox.baseVal.width;
            return [...svg.querySelectorAll("g[transform*=scale]")].map((node) =>
              100 * unit * /scale\\(([\\d.]+)/.exec(node.getAttribute("transform"))[1]);
          });
          const filters = films.map((svg) => getComputedStyle(svg).filter);
          return [[...rims, style("#patch_1 path").fill], filters, sizes];
        })()""")
        assert [*map(code, painted)] == [*map(str.lower, PALETTE[:5]), ground]
        assert set(filters) == {"none"}
        assert len(sizes) == 18  # numbers of the balls, and a title for each cradle
        assert min(sizes) > book_figures.LEGIBLE


def with_equations(visit, chapter: str, width: int):
    """Open a page whose equations are set as they come into sight; wait for the first ones."""
    tab = visit(chapter=chapter, width=width, height=800, equations=True)
    tab.wait_for_function("document.querySelector('mjx-container svg')")
    tab.evaluate("MathJax.startup.promise")
    return tab


def test_equations_wait_until_they_are_seen(visit):
    """At first those in sight are set, and a voice can read all of them; on paper all are set."""
    tab = with_equations(visit, "reading_counting", 390)
    count = "document.querySelectorAll('mjx-container{}').length"
    everything, first = (tab.evaluate(count.format(end)) for end in ("", " > svg"))
    assert everything > 100
    assert 0 < first < everything / 4
    assert tab.evaluate(count.format(" math")) == everything
    formulas = "[...document.querySelectorAll('.bd-article mjx-container')]"
    shown = f"{formulas}.filter((node) => node.checkVisibility())"
    tab.evaluate(f"{shown}.pop().scrollIntoView({{ behavior: 'instant' }})")
    tab.wait_for_function(f"{shown}.pop().firstElementChild?.matches('svg')")
    tab.pdf()
    assert tab.evaluate(count.format(" > svg")) == everything


@pytest.mark.parametrize("width", [390, 1400])
def test_equations_keep_about_their_place(visit, width: int):
    """A page is about as high before they are set as after."""
    tab, heights = with_equations(visit, "three_balls", width), []
    for _ in range(2):
        heights.append(tab.evaluate("document.scrollingElement.scrollHeight"))
        tab.evaluate(ALL_SET)
        tab.evaluate(FRAMES)
    assert heights[0] == pytest.approx(heights[1], rel=0.03)


def test_folds_and_boxes(visit, html: Path):
    """They show who has the key, have names, room for a finger and for the lines of their code; a
    link into one opens it."""
    tab = visit(chapter="measure", width=390, height=800, has_touch=True, is_mobile=True)
    summaries = tab.locator(".bd-content details > summary")
    assert summaries.count() > 2
    for summary in summaries.all():
        if summary.is_visible():
            assert summary.bounding_box()["height"] >= 36
    folds = tab.locator(".bd-content details.hide:visible").all()
    assert len(folds) > 2
    for fold in folds:  # open, as wide as the text
        fold.locator("summary").click()
        text = fold.evaluate("(node) => node.closest('section').clientWidth")
        assert fold.bounding_box()["width"] == pytest.approx(text, abs=2)
        fold.locator("summary").click()
    first = tab.locator(".bd-content details > summary:visible").first
    first.focus()
    tab.keyboard.press("Shift+Tab")
    tab.keyboard.press("Tab")
    drawn = "(node) => [node === document.activeElement, getComputedStyle(node).outlineStyle]"
    assert first.evaluate(drawn) == [True, "solid"]
    tab.wait_for_function("!document.querySelector('[aria-label*=\"hidden content\"]')")
    box = tab.locator(".toggle-hidden", has_text="What error to expect")
    assert tab.get_by_role("button", name="What error to expect").is_visible()
    place = box.locator("[id]:not(.toggle-button)").first.get_attribute("id")
    assert not tab.locator(f"#{place}").is_visible()
    tab.evaluate("(place) => (location.hash = place)", place)
    tab.wait_for_function("(place) => document.getElementById(place).checkVisibility()", arg=place)
    tab.wait_for_function("document.querySelector('.toggle-hidden :target') === null")
    for name, parts in (("own_code", ".copybtn"), ("own_solver", ".reader-solver button"),
                        ("toy", ".animation label")):  # fmt: skip
        tab.goto((html.with_name("light") / "book" / f"{name}.html").as_uri())
        tab.wait_for_selector(parts)
        for part in tab.locator(parts).all():
            if part.is_visible():
                assert part.bounding_box()["height"] >= 40, name


SHIFTS = """
  globalThis.shifts = [];
  new PerformanceObserver((list) => shifts.push(...list.getEntries().map(({ value }) => value)))
    .observe({ type: "layout-shift", buffered: true });
"""


def test_pages_do_not_jump(browser, html: Path):
    """The live cradle comes late, into its own place. Below .1 a shift counts as good."""
    tab = browser.new_page()
    tab.set_default_timeout(PATIENCE)
    tab.add_init_script(SHIFTS)
    for name in ("explorer", "intro", "patterns"):
        for width in (320, 390, 1400):
            tab.set_viewport_size({"width": width, "height": 800})
            tab.goto((html / "book" / f"{name}.html").as_uri())
            tab.wait_for_function("globalThis.cradleExplorer?.live?.length > 0")
            tab.evaluate(ALL_SET.replace("lazyTypesetAll", "none"))
            tab.evaluate("new Promise((done) => setTimeout(done, 300))")
            assert sum(tab.evaluate("shifts")) < 0.1, (name, width)
    tab.close()


def test_a_cradle_is_drawn_before_a_frame_can_be_painted(browser, html: Path):
    """Else what a reader is to see after the first hit alone flashes up."""
    tab = browser.new_page()
    # Nor does the page's theme, once it is set, draw it anew.
    tab.add_init_script(
        "requestAnimationFrame = () => 1; MutationObserver.prototype.observe = () => {}"
    )
    tab.goto((html.with_name("light") / "book" / "explorer.html").as_uri())
    assert tab.evaluate("document.querySelector('.cradle-explorer').className").endswith("calm")
    tab.close()


def test_print_from_dark_mode(still):
    """Black on white, with all that is still to be computed; then the page is as it was."""
    tab = still("#scene=map", color_scheme="dark", stopped=True)
    tab.later(50)
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
    tab.later(50)
    assert tab.evaluate(f"[{ground}, {ink}]") == dark
    assert tab.evaluate(painted)[1] < 0.5


def test_a_question_fits_on_the_first_sheet(still):
    """A part that is too high for what is left of it leaves a blank there."""
    sheet = {"width": 718, "height": 1047}  # A4 less the margins that Chromium gives it, pixels
    tab = still(chapter="intro", **sheet)
    tab.drawn()
    tab.emulate_media(media="print")
    tab.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert tab.locator(".outcome .drawn").is_visible()
    for part in (".stage", ".outcome", ".settings"):
        box = tab.locator(part).bounding_box()
        assert box["y"] + box["height"] < sheet["height"], part


# Colours of the names of lines; of letters on the bar of energy and under them, ball by ball.
COLOURS = f"""() => {{
  const pen = document.createElement("canvas").getContext("2d");
  const code = (node) => {{
    pen.fillStyle = getComputedStyle(node).fill;
    pen.fillRect(0, 0, 1, 1);
    return `rgb(${{[...pen.getImageData(0, 0, 1, 1).data].slice(0, 3).join()}})`;
  }};
  const names = [...document.querySelectorAll(".pictures .name")].map(code);
  const host = {EXPLORER}.panels.outcome.node.querySelectorAll(".plot")[1];
  const setting = {{ ...{EXPLORER}.state.setting, masses: [1, 1, 1, 1, 1, 1, 1] }};
  return [names, setting.masses.map((_, ball) => {{
    const now = setting.masses.map((_, k) => +(k === ball));
    host.innerHTML = cradleExplorer.energy({{ width: 300, em: 16 }}, setting, now, now);
    return [host.querySelector("text"), host.querySelectorAll(".part")[ball]].map(code);
  }})];
}}"""


def test_numbers_in_colours_can_be_read(still):
    """Of seven balls, beside their lines and on the bar of energy, in both modes."""
    tab = still("#speeds=1,0,0,0,0,0,0&masses=1,2,3,4,3,2,1&forward=0.3")
    for mode, ground in (("light", "#ffffff"), ("dark", "#121212")):
        show(tab, 1400, mode)
        tab.drawn()
        names, bars = tab.evaluate(COLOURS)
        assert len(names) == len(set(names)) == len(bars) == 7
        assert min(contrast(code(name), ground) for name in names) >= READABLE
        assert min(contrast(*map(code, pair)) for pair in bars) >= READABLE


def test_notes_and_places_can_be_read(still):
    """The soft colour of notes, places and small letters."""
    tab = still("#scene=ABCCAB")
    tab.drawn()
    for mode in ("light", "dark"):
        show(tab, 1400, mode)
        assert tab.evaluate(PALE, READABLE) == []
