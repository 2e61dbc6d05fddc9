"""What a release needs.

Usage::

    python publication/release.py check v0.1.0   # is everything filled in? exits with what is not
    python publication/release.py readme         # links of README.md become absolute, for PyPI
"""

import json
import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: The end of the address that stands in for one.
PLACEHOLDER = "/cradle-companion/cradle-companion"
NOBODY = "The cradle companion's authors"


def project(root: Path = ROOT) -> dict:
    """Return the table of pyproject.toml."""
    with (root / "pyproject.toml").open("rb") as file:
        return tomllib.load(file)["project"]


def missing(tag: str, root: Path = ROOT) -> list[str]:
    """Return what forbids the release of this tag."""

    def text(name):
        return (root / name).read_text(encoding="utf-8")

    version = project(root)["version"]
    newest = re.search(r"^## (.*)$", text("CHANGELOG.md"), re.MULTILINE)
    citation = text("CITATION.cff")
    date = re.search(r'^date-released: "?(\d{4}-\d\d-\d\d)"?$', citation, re.MULTILINE)
    checks = {
        f"tag {tag} is not version {version}": tag == f"v{version}",
        f"CITATION.cff has another version than {version}": f"\nversion: {version}\n" in citation,
        f".zenodo.json has another version than {version}": json.loads(text(".zenodo.json"))[
            "version"
        ]
        == version,
        f"README.md does not name version {version}": f"version {version}" in text("README.md"),
        "CITATION.cff has no date": date is not None,
        "CHANGELOG.md does not begin with this version and the date of CITATION.cff": None
        not in (date, newest)
        and newest[1] == f"{version} ({date[1]})",
        f"publication/conda/recipe.yaml has another version than {version}": (
            f'version: "{version}"\n' in text("publication/conda/recipe.yaml")
        ),
        f"publication/npm/package.json has another version than {version}": json.loads(
            text("publication/npm/package.json")
        )["version"]
        == version,
        "pyproject.toml has no public address": not project(root)["urls"]["Repository"].endswith(
            PLACEHOLDER
        ),
        **{
            f"{name} speaks of a placeholder": "placeholder" not in text(name)
            for name in ("pyproject.toml", "CITATION.cff", "README.md", "_config.yml")
        },
        **{
            f"{name} names no authors": NOBODY not in text(name)
            for name in ("pyproject.toml", "CITATION.cff", ".zenodo.json")
        },
    }
    return [fault for fault, passed in checks.items() if not passed]


def absolute(text: str) -> str:
    """Return a text whose relative links and pictures lead into the repository at this version."""
    address, version = project()["urls"]["Repository"], project()["version"]
    text = re.sub(r"(!\[[^\]]*\]\()(?!https?:|#)", rf"\1{address}/raw/v{version}/", text)
    return re.sub(r"((?<!!)\[[^\]]*\]\()(?!https?:|#)", rf"\1{address}/blob/v{version}/", text)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["check", tag]:
            sys.exit("\n".join(missing(tag)))
        case ["readme"]:
            readme = ROOT / "README.md"
            readme.write_text(absolute(readme.read_text(encoding="utf-8")), encoding="utf-8")
        case _:
            sys.exit(__doc__)
