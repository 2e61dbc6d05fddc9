"""What the notebooks of the book share and a reader need not see: numbers as people write them."""

import inspect
import textwrap

import numpy as np
import pandas as pd
from IPython.display import Markdown, display
from myst_nb import glue

#: Whole numbers as words.
WORDS = [
    "no", "one", "two", "three", "four", "five", "six", "seven", "eight",
    "nine", "ten", "eleven", "twelve", "thirteen", "fourteen", "fifteen", "sixteen",
]  # fmt: skip
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def tell(chapter: str, **values: object) -> None:
    """Hand values to the text: `name` becomes the label `chapter-name`, with - for _."""
    for name, value in values.items():
        glue(
            f"{chapter}-{name.replace('_', '-')}", str(value), display=False
        )


def people(value: float, digits: int = 2) -> str:
    """Write a number as in a sentence: 2.2 million, 37 000, 10⁻⁷, 0.031.

    `digits` significant digits are kept. An integer below one million is written out in full.
    """
    if float(value).is_integer() and abs(value) < 1_000_000:
        return _grouped(int(value))
    for size, word in ((1e9, "billion"), (1e6, "million")):
        if size <= abs(value) < 1e12:
            return f"{_rounded(value / size, digits)} {word}"
    if 1e-3 <= abs(value) < 1e6:
        return _rounded(value, digits)
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    power = "10" + str(int(exponent)).translate(_SUPERSCRIPT)
    mantissa = f"{float(mantissa):g}".replace("-", "−")
    return power if mantissa == "1" else f"{mantissa}·{power}"


def said(value: float, digits: int = 2) -> str:
    """Write a number as in a sentence, and a small whole number as a word."""
    if isinstance(value, (int, np.integer)) and 0 <= value <= 12:
        return WORDS[value]
    return people(value, digits)


def count(number: int, thing: str, things: str = "") -> str:
    """Write how many there are: no chains, one chain, twelve chains, 35 chains."""
    return f"{said(int(number))} {thing if number == 1 else things or thing + 's'}"


def _rounded(value: float, digits: int) -> str:
    """Write a number in significant digits, without a power of ten."""
    rounded = float(f"{value:.{digits}g}")
    if abs(rounded) >= 10_000:
        return _grouped(int(rounded))
    return f"{rounded:g}".replace("-", "−")


def _grouped(value: int) -> str:
    """Write an integer, a large one in groups of three digits."""
    text = f"{value:,}" if abs(value) >= 10_000 else f"{value}"
    return text.replace(",", "\N{NARROW NO-BREAK SPACE}").replace("-", "−")


def aligned(values: np.ndarray, digits: int = 3) -> str:
    """Write velocities side by side, as a line of a table: no minus before a zero."""
    return "".join(
        f" {round(float(value), digits) + 0.0:{digits + 3}.{digits}f}"
        for value in values
    )


def below(value: float, limit: float = 1e-12) -> str:
    """Write a difference that is rounding as "< 10⁻¹²", any other one as it is."""
    return (
        f"< {people(limit, 1)}" if abs(value) < limit else people(value, 1)
    )


class _Table:
    """A table as a page shows it, and as plain text."""

    def __init__(self, frame: pd.DataFrame, **options: object) -> None:
        self.frame, self.options = frame, options

    def __repr__(self) -> str:
        return self.frame.to_string(**self.options)

    def _repr_html_(self) -> str:
        return self.frame.to_html(border=0, **self.options)


def show(
    frame: pd.DataFrame, *, index: bool = False, **options: object
) -> None:
    """Show a table whose columns stay in line on a narrow screen, too.

    `options` are those that `to_string` and `to_html` share.
    """
    display(_Table(frame, index=index, **options))


def listing(*functions: object, width: int = 80) -> Markdown:
    """Show the source of functions as it stands in the package, so that text and code agree.

    Where a line is wider than the page, its comment goes on a line of its own.
    """
    lines: list[str] = []
    for function in functions:
        if lines:
            lines += ["", ""]
        for line in (
            textwrap.dedent(inspect.getsource(function))
            .rstrip()
            .splitlines()
        ):
            lines += _narrow(line, width)
    return Markdown("```python\n" + "\n".join(lines) + "\n```")


def _narrow(line: str, width: int) -> list[str]:
    """Break a comment or a docstring of one line, and nothing else."""
    indent = " " * (len(line) - len(line.lstrip()))
    code, mark, comment = line.partition("# ")
    if len(line) <= width:
        return [line]
    if mark:
        above = textwrap.wrap(comment, width - len(indent) - 2)
        return [f"{indent}# {part}" for part in above] + (
            [code.rstrip()] if code.strip() else []
        )
    if '"""' in line:
        return textwrap.wrap(line, width, subsequent_indent=indent)
    return [line]


def name_lines(
    ax: object, *, side: str = "right", apart: float = 11
) -> None:
    """Write the name of each line at its last point that is seen (or its first), in its colour.

    Names that would lie on one another are lifted, `apart` points each.
    """
    end, sign = (-1, 1) if side == "right" else (0, -1)
    ax.figure.canvas.draw()
    point, box, placed = ax.figure.dpi / 72, ax.bbox.padded(1), []
    for line in sorted(
        ax.get_lines(), key=lambda one: one.get_ydata()[end]
    ):
        if line.get_label()[0] == "_":
            continue
        places = line.get_xydata()
        seen = ax.transData.transform(places)
        inside = [box.contains(*xy) for xy in seen]
        x, y = seen[inside][end]
        lifted = y
        for other_x, other_y in placed:
            if abs(x - other_x) < 60 * point:
                lifted = max(lifted, other_y + apart * point)
        placed.append((x, lifted))
        ax.annotate(
            line.get_label(), places[inside][end], (5 * sign, (lifted - y) / point),
            textcoords="offset points", color=line.get_color(), fontsize=9.5,
            ha="left" if sign > 0 else "right", va="center",
        )  # fmt: skip
