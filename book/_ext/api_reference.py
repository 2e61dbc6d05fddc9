"""Sphinx extension: what autodoc leaves to be put right in the reference.

- A name of the package in a docstring, such as `collide`, leads to its entry.
- What a call returns is never made by a reader, so its entry does not list how it is made.
"""

import re
from importlib import import_module
from typing import Any

from sphinx.application import Sphinx

#: What is imported from where: modules whose public names have entries.
HOMES = (
    "cradle",
    "cradle.fit",
    "cradle.closed_form",
    "cradle.measures",
    "cradle.row",
    "cradle.tables",
    "cradle.pictures.impacts",
    "cradle.pictures.animation",
    "cradle.pictures.fits",
    "cradle.textbook",
)

#: Classes that a reader does not call.
RESULTS = {
    "Model", "Trace", "TimedTrace", "EnergyTrace", "DissipationTrace",
    "Outcomes", "Swing", "Impact", "Recommendation", "ImpactNotFinished",
    "ImpactNotCertified", "fit.Shots", "fit.ShotSet", "fit.Velocities",
    "fit.Fit", "fit.Estimate", "fit.Mode", "fit.Prediction", "fit.LawFit",
    "fit.SwingFit", "measures.Condition", "row.Hit", "row.Bodies",
    "pictures.animation.Animation", "textbook.Impact", "textbook.EventLimit",
    "textbook.Run",
}  # fmt: skip

NAME = re.compile(r"(?<![`:\w])`([A-Za-z_]\w*)((?:\.\w+)*)`(?!`)")


def public(home: str) -> dict[str, str]:
    """Return where the public names of a module have their entries.

    They are those that the module lists, or else the functions and classes that it defines.
    """
    module, top = import_module(home), import_module("cradle")
    names = getattr(module, "__all__", None) or [
        name
        for name, value in vars(module).items()
        if callable(value)
        and not name.startswith("_")
        and (
            value.__module__ == home
            or (home, name) == ("cradle.row", "Hit")
        )
    ]
    shared = {n for n in names if vars(top).get(n) is vars(module)[n]}
    return {
        name: f"{'cradle' if name in shared else home}.{name}"
        for name in names
    }


def link_names(
    app: Sphinx,
    what: str,
    name: str,
    obj: Any,
    options: Any,
    lines: list[str],
) -> None:
    """Make links of the names that are imported from `cradle`, or from the entry's own module."""
    entries = public("cradle")
    for home in HOMES:
        if name.startswith(f"{home}."):
            entries |= public(home)

    def link(match: re.Match[str]) -> str:
        word, rest = match.groups()
        if word not in entries or name.startswith(entries[word]):
            return match[0]
        return f":py:obj:`{word}{rest} <{entries[word]}>`"

    lines[:] = [
        line
        if line.lstrip().startswith((">>>", "..."))
        else NAME.sub(link, line)
        for line in lines
    ]


def leave_out_how_results_are_made(
    app: Sphinx,
    what: str,
    name: str,
    obj: Any,
    options: Any,
    signature: str | None,
    returned: str | None,
) -> tuple[str, str | None] | None:
    """Return an empty signature for what calls return."""
    return ("", None) if name.removeprefix("cradle.") in RESULTS else None


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the callbacks."""
    app.connect("autodoc-process-docstring", link_names, priority=100)
    app.connect("autodoc-process-signature", leave_out_how_results_are_made)
    return {
        "version": "1",
        "parallel_read_safe": True,
        "parallel_write_safe": True,
    }
