"""Give the project another address, everywhere.

Usage::

    python publication/set_address.py https://github.com/OWNER/NAME

The one place is `Repository` in pyproject.toml. All other copies, and the address of the pages that
GitHub serves (https://OWNER.github.io/NAME/), follow from it; a test keeps them equal.
"""

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: Files that may hold a copy.
PLACES = (
    *("*.md", "*.toml", "*.yml", "*.cff", ".zenodo.json", ".binder/*", ".ci/*", "data/*.md"),
    *("book/*.md", "book/*.ipynb", "book/*.py", "book/_ext/*.py", "cradle/**/*.py"),
    *(".github/**/*.md", ".github/**/*.yml", "publication/**/*.*"),
)


def repository(root: Path = ROOT) -> str:
    """Return the address in force."""
    with (root / "pyproject.toml").open("rb") as file:
        return tomllib.load(file)["project"]["urls"]["Repository"]


def pages(address: str) -> str:
    """Return the address of the published book."""
    owner, name = address.removeprefix("https://github.com/").split("/")
    return f"https://{owner}.github.io/{name}/".lower()


def files(root: Path = ROOT) -> list[Path]:
    """Return all files that may hold a copy."""
    found = {path for place in PLACES for path in root.glob(place) if path.is_file()}
    return sorted(path for path in found if "__pycache__" not in path.parts)


def change(new: str, root: Path = ROOT) -> list[Path]:
    """Replace the address by a new one; return the files that changed."""
    if not re.fullmatch(r"https://github\.com/[\w.-]+/[\w.-]+", new):
        raise ValueError(f"address = {new!r}; must be https://github.com/OWNER/NAME")
    old = repository(root)
    changed = []
    for path in files(root):
        before = path.read_bytes()
        after = before.replace(pages(old).encode(), pages(new).encode())
        after = re.sub(re.escape(old.encode()) + rb"(?![\w-])", new.encode(), after)
        if after != before:
            path.write_bytes(after)
            changed.append(path)
    return changed


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    for path in change(sys.argv[1]):
        print(path.relative_to(ROOT))
