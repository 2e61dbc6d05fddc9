"""Sphinx extension: figures that follow the theme and can be read on a phone.

Notebooks store their figures as SVG on white, which is right for Jupyter and for paper. The build
writes each one a second time for dark mode: black becomes the colour of the text, white that of
the page, greys and pale tints change sides, and colours that tell lines apart stay. A page carries
both; the theme's classes `only-light` and `only-dark` show one of them. In both, letters in a
colour are as dark or as bright as it takes to read them.

The colours of a map, of its picture of points or its mesh, are a scale from pale to strong: each
stands out from the dark page as much as from the white one, so that strong remains strong.

A moving picture is part of its page. A style sheet gives it the same colours as figures have.

The box around a figure knows how wide the figure has to be for its smallest letters to be read. On
a narrow screen the style sheet lets a wider one scroll in this box. On a desk small letters of all
figures have one size.
"""

import base64
import colorsys
import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from docutils import nodes
from matplotlib.image import imread, imsave
from sphinx.application import Sphinx

#: Ground and text of the theme's dark mode.
GROUND, TEXT = 0x12 / 255, 0xE0 / 255
#: A moving picture in its page, and what the style of a part of it says of colours.
MOVING = re.compile(r'<div class="animation">.*?</div>', re.S)
PAINT = re.compile(r"\b(fill|stroke): (#\w{6})\b")
#: From this difference of its channels on, a colour is one that tells lines apart.
COLOURFUL = 0.3
#: From this one on, a pale one is a tint that tells areas apart; its contrast with the dark page.
TINTED, AREA = 0.1, 2.5
#: Contrast of coloured letters with the page (WCAG 2.1, 1.4.3, is 4.5). On a dark one thin blue
#: letters need more.
READ, READ_IN_DARK = 4.6, 6.0

IMAGE = re.compile(
    r'<img(?P<other>[^>]*?)\bsrc="(?P<path>[^"]*_images/[^"/]+)\.svg"(?P<rest>[^>]*)>'
)
COLOUR = re.compile(
    r"#(?:[0-9a-fA-F]{6}|[0-9a-fA-F]{3})\b|(?<=[\"' :])(?:white|black)(?=[\"';])"
)
NAMED = {"white": "#ffffff", "black": "#000000"}

#: What a map paints: pictures of points, and meshes.
POINTS = re.compile(r"data:image/png;base64,([^\"]+)")
MESH = re.compile(r'^   <g id="QuadMesh_\d+">\n.*?^   </g>\n', re.M | re.S)
#: Letters and their colour.
COLOURED = re.compile(r'(?<=<g style="fill: )#\w{6}(?=[^>]*\bscale\(0\.)')

#: Pixels that the smallest letters of a figure have on a phone, at least. (Indices are smaller.)
LEGIBLE = 11
#: Their size on a desk, at least, where the column has room for it.
EASY = 16
#: Sizes of letters: Matplotlib draws them as curves in units of a hundredth of a point.
LETTERS = re.compile(r"\bscale\((0\.\d+) -0\.\d+\)")
FONT_SIZE = re.compile(r'\bfont-size[:=]"?\s*([\d.]+)')


def channels(colour: str) -> list[float]:
    """Return red, green and blue, each from 0 to 1."""
    digits = NAMED.get(colour, colour)[1:]
    if len(digits) == 3:
        digits = "".join(2 * digit for digit in digits)
    return [int(digits[k : k + 2], 16) / 255 for k in (0, 2, 4)]


def written(rgb: tuple[float, float, float]) -> str:
    """Write red, green and blue as a colour."""
    return "#" + "".join(f"{round(255 * part):02x}" for part in rgb)


def spread(colour: str) -> float:
    """Return how far the channels of a colour are apart: 0 for a grey."""
    return max(channels(colour)) - min(channels(colour))


def light(colour: str) -> float:
    """Return relative luminance plus 0.05: quotients of two are contrasts (WCAG 2.1)."""
    linear = [
        p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4
        for p in channels(colour)
    ]
    return 0.05 + float(np.dot((0.2126, 0.7152, 0.0722), linear))


PAPER = light("white")
PAGE = light(written((GROUND,) * 3))


def lit(colour: str, wanted: float, vivid: float = 1.0) -> str:
    """Return the shade of a colour that is so light, and so vivid beside it.

    >>> lit("#e69f00", light("#767676"))
    '#9e6d00'
    """
    hue, _, saturation = colorsys.rgb_to_hls(*channels(colour))

    def shade(lightness: float) -> str:
        return written(
            colorsys.hls_to_rgb(hue, lightness, vivid * saturation)
        )

    low, high = 0.0, 1.0
    for _ in range(20):
        middle = (low + high) / 2
        if light(shade(middle)) < wanted:
            low = middle
        else:
            high = middle
    return shade(high)


def dark(colour: str) -> str:
    """Return the colour that takes the place of `colour` in dark mode.

    >>> dark("#000000"), dark("white"), dark("#0072b2")
    ('#e0e0e0', '#121212', '#0072b2')
    """
    if spread(colour) >= COLOURFUL:
        return written(channels(colour))
    hue, lightness, saturation = colorsys.rgb_to_hls(*channels(colour))
    lightness = TEXT + lightness * (GROUND - TEXT)
    turned = written(colorsys.hls_to_rgb(hue, lightness, saturation))
    if spread(colour) >= TINTED and light(turned) < AREA * PAGE:
        # Less vivid than lines, which are seen on it.
        return lit(colour, AREA * PAGE, 0.6)
    return turned


def turned(colour: str) -> str:
    """Return the colour that stands out from the dark page as `colour` does from the white one.

    >>> turned("#ffffff"), turned("#000000")
    ('#121212', '#e0e0e0')
    """
    return lit(
        colour,
        min(PAPER / light(colour) * PAGE, light(written((TEXT,) * 3))),
    )


def repainted_points(match: re.Match[str]) -> str:
    """Return a picture of points in the colours of dark mode."""
    points = imread(io.BytesIO(base64.b64decode(match[1])))
    found, place = np.unique(
        points[..., :3].reshape(-1, 3), axis=0, return_inverse=True
    )
    colours = [written(tuple(one)) for one in found]
    # Pale tints alone are those of areas, as in other figures.
    scale = max(map(spread, colours)) >= COLOURFUL
    change: Callable[[str], str] = turned if scale else dark
    painted = np.array([channels(change(colour)) for colour in colours])
    points[..., :3] = painted[place.ravel()].reshape(points[..., :3].shape)
    file = io.BytesIO()
    imsave(file, points, metadata={"Software": None})
    return match[0][: -len(match[1])] + base64.b64encode(
        file.getvalue()
    ).decode("ascii")


def darkened(svg: str) -> str:
    """Return a drawing in the colours of dark mode."""
    parts = []
    end = 0
    for mesh in MESH.finditer(svg):
        parts += [(svg[end : mesh.start()], dark), (mesh[0], turned)]
        end = mesh.end()
    drawing = "".join(
        COLOUR.sub(lambda match, change=change: change(match[0]), part)
        for part, change in [*parts, (svg[end:], dark)]
    )
    drawing = POINTS.sub(repainted_points, drawing)
    # What names no colour, such as black letters, is black.
    return drawing.replace("<svg ", f'<svg fill="{dark("black")}" ', 1)


def readable(svg: str, ground: float) -> str:
    """Return a drawing whose coloured letters can be read on a ground that is so light."""

    def shade(match: re.Match[str]) -> str:
        colour = match[0]
        high, low = sorted((light(colour), ground), reverse=True)
        enough = READ if ground > 0.5 else READ_IN_DARK
        if spread(colour) < COLOURFUL or high / low >= enough:
            return colour
        return lit(
            colour, ground / enough if ground > 0.5 else ground * enough
        )

    return COLOURED.sub(shade, svg)


def repainted(page: str) -> str:
    """Return the style sheet of a page's moving pictures: their colours in dark mode.

    >>> print(repainted('<div class="animation"><path style="fill: #ffffff"/></div>'))
    <style>
    html[data-theme="dark"] .animation svg { fill: #e0e0e0 }
    html[data-theme="dark"] .animation [style*="fill: #ffffff"] { fill: #121212 !important }
    </style>
    """
    paints = {
        found
        for film in MOVING.findall(page)
        for found in PAINT.findall(film)
    }
    in_dark = 'html[data-theme="dark"] .animation'
    rules = [f"{in_dark} svg {{ fill: {dark('black')} }}"]
    for what, colour in sorted(paints):
        if dark(colour) != colour:
            part = f'{in_dark} [style*="{what}: {colour}"]'
            rules.append(f"{part} {{ {what}: {dark(colour)} !important }}")
    return "\n".join(["<style>", *rules, "</style>"]) if paints else ""


def drawn_size(svg: str) -> tuple[int, int]:
    """Return width and height of a drawing in pixels."""
    tag = re.search(r"<svg[^>]*>", svg)[0]
    sides = (
        re.search(rf'\b{side}="([\d.]+)(pt)?', tag)
        for side in ("width", "height")
    )
    return tuple(
        round(float(side[1]) * (4 / 3 if side[2] else 1)) for side in sides
    )


def letters(svg: str) -> float:
    """Return the size of the smallest letters of a drawing in pixels.

    >>> letters('<g transform="translate(7 7) scale(0.09 -0.09)">')
    12.0
    """
    curves = (100 * float(size) * 4 / 3 for size in LETTERS.findall(svg))
    return round(min((*curves, *map(float, FONT_SIZE.findall(svg)))), 2)


def name_images(app: Sphinx, doctree: nodes.document) -> None:
    """Give each picture the name of its figure: a reader may save it."""
    images = app.env.images
    for figure in doctree.findall(nodes.figure):
        for image in figure.findall(nodes.image):
            path = image.get("candidates", {}).get("*")
            if figure["ids"] and path in images:
                name = figure["ids"][0] + Path(path).suffix
                images[path] = images[path][0], name


def originals(app: Sphinx) -> dict[str, Path]:
    """Return the pictures as notebooks store them, by their names in the built book.

    Sphinx copies them after it has written the pages; what it copied is then changed.
    """
    return {
        name: Path(app.srcdir, path)
        for path, name in app.builder.images.items()
    }


def pair_images(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Put every figure of a page into its box, in the colours of both modes."""
    there = originals(app)

    def box(match: re.Match[str]) -> str:
        original = there.get(Path(match["path"]).name + ".svg")
        if original is None:
            return match[0]
        svg = original.read_text(encoding="utf-8")
        (width, height), smallest = drawn_size(svg), letters(svg)
        colourings = {"only-light": "", "only-dark": "-dark"}
        # With its size given, a figure that is not loaded yet keeps its place.
        images = [
            f'<img class="{name}" width="{width}" height="{height}"'
            f'{match["other"]}src="{match["path"]}{ending}.svg"{match["rest"]}>'
            for name, ending in colourings.items()
        ]
        # A lazy picture is not loaded before it is shown.
        images[1:] = [
            image.replace("<img", '<img loading="lazy"')
            for image in images[1:]
        ]
        return (
            f'<span class="figure-box" data-letters="{smallest}"'
            f' style="--legible: {round(width * LEGIBLE / smallest)}px;'
            f' --easy: {round(width * max(1, EASY / smallest))}px">'
            f"{''.join(images)}</span>"
        )

    if "body" in context:
        body = context["body"]
        context["body"] = IMAGE.sub(box, body) + repainted(body)


def write_colourings(app: Sphinx, exception: Exception | None) -> None:
    """Write the pictures of both modes, with letters that can be read."""
    if exception is None and app.builder.format == "html":
        for name, original in originals(app).items():
            if original.suffix == ".svg":
                drawing = original.read_text(encoding="utf-8")
                path = Path(app.outdir, "_images", name)
                path.write_text(readable(drawing, PAPER), encoding="utf-8")
                path.with_name(f"{path.stem}-dark.svg").write_text(
                    readable(darkened(drawing), PAGE), encoding="utf-8"
                )


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the callbacks."""
    app.connect("doctree-read", name_images, priority=900)
    app.connect("html-page-context", pair_images)
    app.connect("build-finished", write_colourings)
    return {
        "version": "1",
        "parallel_read_safe": True,
        "parallel_write_safe": True,
    }
