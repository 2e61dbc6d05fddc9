"""Sphinx extension: figures that follow the theme and can be read on a phone.

Notebooks store their figures as SVG on white, which is right for Jupyter and for paper. The build
writes each one a second time for dark mode: black becomes the colour of the text, white that of
the page, greys and pale tints change sides, and colours that tell lines apart stay. Where a map of
coloured cells lies under lines and letters, all colours change sides, so that these can be seen on
it; a map whose letters are drawn in `KEPT` colours stays as it is. A page carries both drawings;
the theme's classes `only-light` and `only-dark` show one of them.

The box around them knows how wide the figure was drawn. On a narrow screen the style sheet lets the
figure scroll in this box rather than shrink to nothing.
"""

import base64
import colorsys
import io
import re
from collections.abc import Iterable
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
CELLS = re.compile(r'(?<=href="data:image/png;base64,)[^"]+')
NAMED = {"white": "#ffffff", "black": "#000000"}


def turned(channels: Iterable[float]) -> tuple[float, ...]:
    """Return a colour of the same hue on the other side: what was light is dark."""
    hue, lightness, saturation = colorsys.rgb_to_hls(*channels)
    lightness = TEXT + lightness * (GROUND - TEXT)
    return colorsys.hls_to_rgb(hue, lightness, saturation)


def dark(colour: str, colourful: float = COLOURFUL) -> str:
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
    if max(channels) - min(channels) >= colourful:
        return f"#{digits}"
    return "#" + "".join(
        f"{round(255 * channel):02x}" for channel in turned(channels)
    )


def dark_cells(match: re.Match[str]) -> str:
    """Return the cells of a map with all colours on the other side."""
    import numpy as np
    from PIL import Image

    picture = Image.open(io.BytesIO(base64.b64decode(match[0])))
    pixels = np.asarray(picture.convert("RGBA"))
    colours, place = np.unique(
        pixels.reshape(-1, 4), axis=0, return_inverse=True
    )
    for colour in colours:
        channels = turned(colour[:3] / 255)
        colour[:3] = [round(255 * channel) for channel in channels]
    stored = io.BytesIO()
    changed = colours[place.reshape(pixels.shape[:2])]
    Image.fromarray(changed).save(stored, format="PNG", optimize=True)
    return base64.b64encode(stored.getvalue()).decode("ascii")


def darkened(svg: str) -> str:
    """Return a drawing in the colours of dark mode."""
    map_turns = CELLS.search(svg) and not any(kept in svg for kept in KEPT)
    colourful = 2 if map_turns else COLOURFUL
    drawing = COLOUR.sub(lambda match: dark(match[0], colourful), svg)
    if map_turns:
        drawing = CELLS.sub(dark_cells, drawing)
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
