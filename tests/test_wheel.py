"""The package as a reader takes it home: a wheel, installed elsewhere, without the repository."""

import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import numpy as np
import pytest


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory, root: Path) -> Path:
    """Build a wheel from a copy of the sources, with the build tools at hand: no network."""
    folder = tmp_path_factory.mktemp("wheel")
    # A copy, because a build leaves files behind that a later build would pick up.
    source = folder / "source"
    for name in ("cradle", "data"):
        shutil.copytree(root / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE", "LICENSE-TEXT"):
        shutil.copy(root / name, source)
    run(
        [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index",
         "--wheel-dir", folder, source],
        cwd=folder,
    )  # fmt: skip
    (built,) = folder.glob("*.whl")
    return built


def run(command: list, cwd: Path) -> str:
    result = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def test_content(wheel: Path, root: Path):
    names = set(zipfile.ZipFile(wheel).namelist())
    package = {name for name in names if ".dist-info/" not in name}
    expected = {
        path.relative_to(root).as_posix()
        for path in (root / "cradle").glob("**/*")
        if path.suffix == ".py" or path.name == "py.typed"
    }
    expected |= {f"cradle/data/{path.name}" for path in (root / "data").iterdir()}
    assert package == expected
    assert "cradle/py.typed" in package
    # The code's licence, and that of README.md and data/README.md, which travel along.
    for licence in ("LICENSE", "LICENSE-TEXT"):
        (name,) = (name for name in names if name.endswith(f"licenses/{licence}"))
        assert zipfile.ZipFile(wheel).read(name) == (root / licence).read_bytes()


def test_works_from_elsewhere(wheel: Path, tmp_path: Path):
    """Install into a clean environment; the dependencies are this environment's."""
    environment = tmp_path / "venv"
    run([sys.executable, "-m", "venv", "--without-pip", environment], cwd=tmp_path)
    scripts = "Scripts" if sys.platform == "win32" else "bin"
    python = environment / scripts / "python"
    site = run([python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"], tmp_path)
    target = Path(site.strip())
    run(
        [sys.executable, "-m", "pip", "install", "--no-deps", "--no-index", "--target", target,
         wheel],
        cwd=tmp_path,
    )  # fmt: skip
    # A .pth file adds a folder behind the clean environment's own and, unlike the start of Python,
    # does not run the .pth files in it: an editable install of this repository stays out of reach.
    folders = {sysconfig.get_path("purelib"), str(Path(np.__file__).parents[1])}
    (target / "dependencies.pth").write_text("\n".join(folders), encoding="utf-8")

    code = """
import cradle, cradle.tables
chain, model = cradle.paper_chain("ABACA")
print(cradle.__file__)
print([float(mass) for mass in chain.masses])
print(cradle.ratio_table().shape, cradle.restitution_table().shape)
print(len(cradle.tables.paper_sequences()))
"""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    where, masses, shapes, sequences = run([python, "-I", "-c", code], elsewhere).splitlines()
    assert Path(where).is_relative_to(target)
    assert masses == "[0.045, 0.053, 0.045, 0.053, 0.045]"
    assert shapes == "(64, 4) (4, 4)"
    assert sequences == "10"
