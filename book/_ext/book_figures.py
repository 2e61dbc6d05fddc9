"""Sphinx extension: figures that follow the theme and can be read on a phone.

Notebooks store their figures as SVG on white, which is right for Jupyter and for paper. The build
writes each one a second time for dark mode: black becomes the colour of the text, white that of
the page, greys and pale tints change sides, and colours that tell lines apart stay. A page carries
both; the theme's classes `only-light` and `only-dark` show one of them.

The box around them knows how wide the figure was drawn. On a narrow screen the style sheet lets the
figure scroll in this box rather than shrink to nothing.
"""

import colorsys
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

#: Ground and text of the theme's dark mode.
GROUND, TEXT = 0x12 / 255, 0xE0 / 255
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
    """Return a drawing in the colours of dark mode."""
    drawing = COLOUR.sub(lambda match: dark(match[0]), svg)
    # What names no colour, such as black letters, is black.
    return drawing.replace("<svg ", f'<svg fill="{dark("black")}" ', 1)


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
        width, height = drawn_size(original.read_text(encoding="utf-8"))
        # With its size given, a figure that is not loaded yet keeps its place.
        light, dark = (
            f'<img class="{name}" width="{width}" height="{height}"'
            f'{match["other"]}src="{match["path"]}{ending}.svg"{match["rest"]}>'
            for name, ending in (("only-light", ""), ("only-dark", "-dark"))
        )
        # A lazy picture is not loaded before it is shown.
        dark = dark.replace("<img", '<img loading="lazy"')
        return f'<span class="figure-box" style="--drawn: {width}px">{light}{dark}</span>'

    if "body" in context:
        context["body"] = IMAGE.sub(box, context["body"])


def write_dark(app: Sphinx, exception: Exception | None) -> None:
    """Write the pictures of dark mode beside the others."""
    if exception is None and app.builder.format == "html":
        for path in Path(app.outdir, "_images").glob("*.svg"):
            if not path.stem.endswith("-dark"):
                drawing = darkened(path.read_text(encoding="utf-8"))
                path.with_name(f"{path.stem}-dark.svg").write_text(
                    drawing, encoding="utf-8"
                )


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the callbacks."""
    app.connect("html-page-context", pair_images)
    app.connect("build-finished", write_dark)
    return {
        "version": "1",
        "parallel_read_safe": True,
        "parallel_write_safe": True,
    }
