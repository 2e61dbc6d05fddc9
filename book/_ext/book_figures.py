"""Sphinx extension: figures that follow the theme and can be read on a phone.

Notebooks store their figures as SVG on white, which is right for Jupyter and for paper. The build
writes each one a second time for dark mode: black becomes the colour of the text, white that of
the page, greys and pale tints change sides, and colours that tell lines apart stay. A page carries
both; the theme's classes `only-light` and `only-dark` show one of them.

A map, a figure that contains a picture of points, has colours all over, with letters and lines on
them, and its scale of colours is read from pale to strong. Turned round it would say something
else. So these stay, and what is around them follows the theme.

A moving picture is part of its page. A style sheet gives it the same colours as figures have.

The box around a figure knows how wide the figure has to be for its smallest letters to be read. On
a narrow screen the style sheet lets a wider one scroll in this box. On a desk small letters of all
figures have one size.
"""

import colorsys
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

#: Ground and text of the theme's dark mode.
GROUND, TEXT = 0x12 / 255, 0xE0 / 255
#: A moving picture in its page, and what the style of a part of it says of colours.
MOVING = re.compile(r'<div class="animation">.*?</div>', re.S)
PAINT = re.compile(r"\b(fill|stroke): (#\w{6})\b")
#: Black and white that stay: letters and lines on a coloured ground.
KEPT = {"#010101", "#fefefe"}
#: From this difference of its channels on, a colour is one that tells lines apart.
COLOURFUL = 0.3

IMAGE = re.compile(
    r'<img(?P<other>[^>]*?)\bsrc="(?P<path>[^"]*_images/[^"/]+)\.svg"(?P<rest>[^>]*)>'
)
COLOUR = re.compile(
    r"#(?:[0-9a-fA-F]{6}|[0-9a-fA-F]{3})\b|(?<=[\"' :])(?:white|black)(?=[\"';])"
)
NAMED = {"white": "#ffffff", "black": "#000000"}

#: Matplotlib's axes, their ground, and in a map what lies on it: all but ticks and frame.
AXES = re.compile(r'^  <g id="axes_\d+">\n.*?^  </g>\n', re.M | re.S)
GROUND_OF_AXES = re.compile(
    r"M ([\d.]+) ([\d.]+) \nL ([\d.]+) [\d.]+ \nL [\d.]+ ([\d.]+)"
)
ON_MAP = re.compile(
    r'^   <g id="(line2d|QuadContourSet|QuadMesh|LineCollection|text)_\d+">\n.*?^   </g>\n',
    re.M | re.S,
)
#: A colour of a map in its legend.
SWATCH = re.compile(r"fill: #\w+; stroke: #666666")
PLACE = re.compile(r"translate\(([\d.]+) ([\d.]+)\)")

#: Pixels that the smallest letters of a figure have on a phone, at least. (Indices are smaller.)
LEGIBLE = 11
#: Their size on a desk, at least, where the column has room for it.
EASY = 16
#: Sizes of letters: Matplotlib draws them as curves in units of a hundredth of a point.
LETTERS = re.compile(r"\bscale\((0\.\d+) -0\.\d+\)")
FONT_SIZE = re.compile(r'\bfont-size[:=]"?\s*([\d.]+)')


def dark(colour: str) -> str:
    """Return the colour that takes the place of `colour` in dark mode.

    >>> dark("#000000"), dark("white"), dark("#0072b2")
    ('#e0e0e0', '#121212', '#0072b2')
    """
    digits = NAMED.get(colour, colour)[1:]
    if len(digits) == 3:
        digits = "".join(2 * digit for digit in digits)
    if f"#{digits}" in KEPT:
        return f"#{digits}"
    channels = [int(digits[k : k + 2], 16) / 255 for k in (0, 2, 4)]
    if max(channels) - min(channels) >= COLOURFUL:
        return f"#{digits}"
    hue, lightness, saturation = colorsys.rgb_to_hls(*channels)
    lightness = TEXT + lightness * (GROUND - TEXT)
    channels = colorsys.hls_to_rgb(hue, lightness, saturation)
    return "#" + "".join(
        f"{round(255 * channel):02x}" for channel in channels
    )


def darkened(svg: str) -> str:
    """Return a drawing in the colours of dark mode; a map and what lies on it stay."""
    kept: list[str] = []

    def keep(part: str) -> str:
        kept.append(part)
        return f"<kept {len(kept) - 1}>"

    def keep_map(match: re.Match[str]) -> str:
        axes = match[0]
        if not is_map(axes) and "QuadMesh" not in axes:
            return axes
        left, low, right, high = map(
            float, GROUND_OF_AXES.search(axes).groups()
        )

        def on_map(part: re.Match[str]) -> str:
            if part[1] == "text":
                x, y = map(float, PLACE.search(part[0]).groups())
                if not (left < x < right and high < y < low):
                    return part[0]  # a title
            return keep(part[0].replace("<g ", '<g fill="#010101" ', 1))

        # Without a value the ground of a map is seen.
        return ON_MAP.sub(
            on_map, axes.replace("fill: #ffffff", "fill: #fefefe", 1)
        )

    if is_map(svg):
        svg = SWATCH.sub(
            lambda match: keep(match[0]), AXES.sub(keep_map, svg)
        )
    drawing = COLOUR.sub(lambda match: dark(match[0]), svg)
    drawing = re.sub(
        r"<kept (\d+)>", lambda match: kept[int(match[1])], drawing
    )
    # What names no colour, such as black letters, is black.
    return drawing.replace("<svg ", f'<svg fill="{dark("black")}" ', 1)


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


def is_map(svg: str) -> bool:
    """Return whether a drawing contains a picture of points."""
    return "<image" in svg


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


def pair_images(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Put every figure of a page into its box, in the colours of both modes."""
    # Sphinx copies the pictures after it has written the pages: look at the originals.
    originals = {
        name: Path(app.srcdir, path)
        for path, name in app.builder.images.items()
    }

    def box(match: re.Match[str]) -> str:
        original = originals.get(Path(match["path"]).name + ".svg")
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


def write_dark(app: Sphinx, exception: Exception | None) -> None:
    """Write the pictures of dark mode beside the others."""
    if exception is None and app.builder.format == "html":
        for path in Path(app.outdir, "_images").glob("*.svg"):
            drawing = path.read_text(encoding="utf-8")
            if not path.stem.endswith("-dark"):
                path.with_name(f"{path.stem}-dark.svg").write_text(
                    darkened(drawing), encoding="utf-8"
                )


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the callbacks."""
    app.connect("doctree-read", name_images, priority=900)
    app.connect("html-page-context", pair_images)
    app.connect("build-finished", write_dark)
    return {
        "version": "1",
        "parallel_read_safe": True,
        "parallel_write_safe": True,
    }
