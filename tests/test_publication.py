"""What is published: one address and version everywhere, pinned tools, a complete source."""

import json
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path

import pytest
import release
import set_address
import yaml

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def project():
    with (ROOT / "pyproject.toml").open("rb") as file:
        return tomllib.load(file)["project"]


def text(name):
    return (ROOT / name).read_text(encoding="utf-8")


def test_one_address(project):
    """Whatever looks like an address of the project is the one in pyproject.toml."""
    address = project["urls"]["Repository"]
    home = set_address.pages(address)
    for name, url in project["urls"].items():
        assert url.startswith((address, home)), name
    host = re.escape(address.rsplit("/", 1)[0])
    found = 0
    for path in set_address.files():
        if path.name in ("release.py", "set_address.py"):
            continue
        content = path.read_text(encoding="utf-8")
        for other in re.findall(rf"{host}/[\w-]+(?:\.[\w-]+)*", content):
            assert other.removesuffix(".git") == address, path
            found += 1
        for other in re.findall(r"https://[\w-]+\.github\.io/[\w-]+/", content):
            # The project's own pages; others are cited.
            if "cradle" in other:
                assert other == home, path
    assert found > 4
    assert home in text("_config.yml")


def test_another_address_reaches_every_copy(tmp_path):
    old = set_address.repository()
    for path in (*set_address.files(), ROOT / "pyproject.toml"):
        copy = tmp_path / path.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, copy)
    before = {path: path.read_bytes() for path in set_address.files(tmp_path)}
    new = "https://github.com/somebody/newtons-cradle"
    changed = set_address.change(new, tmp_path)
    assert {"pyproject.toml", "_config.yml", "CITATION.cff", "README.md"} <= {
        p.name for p in changed
    }
    assert set_address.repository(tmp_path) == new
    for path in before:
        content = path.read_text(encoding="utf-8")
        assert old not in content, path
        assert set_address.pages(old) not in content, path
    set_address.change(old, tmp_path)
    assert {path: path.read_bytes() for path in before} == before


@pytest.mark.parametrize("address", ["github.com/a/b", "https://github.com/a", "https://a.org/b/c"])
def test_a_wrong_address_is_refused(address, tmp_path):
    with pytest.raises(ValueError, match="OWNER/NAME"):
        set_address.change(address, tmp_path)


def test_one_version(project, ready):
    """All that a release asks for is there, but for what only its authors can fill in."""
    allowed = "names no authors|placeholder|no public address|CHANGELOG.md does not begin"
    missing = release.missing(f"v{project['version']}")
    assert [fault for fault in missing if not re.search(allowed, fault)] == []
    (only,) = release.missing("v9.9", ready[0])
    assert only.startswith("tag v9.9 is not version")


@pytest.fixture
def ready(tmp_path):
    """A copy of all that a release looks at, as its authors would have filled it in."""
    version = release.project()["version"]
    names = "pyproject.toml CITATION.cff .zenodo.json README.md CHANGELOG.md _config.yml "
    names += "publication/conda/recipe.yaml publication/npm/package.json"
    for name in names.split():
        copy = tmp_path / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        content = text(name).replace(release.PLACEHOLDER, "/somebody/cradle")
        content = content.replace(release.NOBODY, "Some Body").replace("placeholder", "place")
        copy.write_text(content.replace(f"{version} (unreleased)", f"{version} (2026-11-21)"))
    return tmp_path, f"v{version}"


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("pyproject.toml", 'version = "0', 'version = "1'),
        ("CITATION.cff", "\nversion: 0", "\nversion: 1"),
        ("CITATION.cff", "date-released", "date-made"),
        (".zenodo.json", '"version": "0', '"version": "1'),
        ("README.md", "version 0", "version 1"),
        ("CHANGELOG.md", "(2026-11-21)", "(unreleased)"),
        ("CHANGELOG.md", "(2026-11-21)", "(2026-11-20)"),
        ("CHANGELOG.md", "\n## 0", "\n## 9.9.9 (2026-12-01)\n\n## 0"),
        ("publication/conda/recipe.yaml", 'version: "0', 'version: "1'),
        ("publication/npm/package.json", '"version": "0', '"version": "1'),
        ("_config.yml", "place ", "placeholder "),
    ],
)
def test_a_release_that_is_not_ready(ready, name, old, new):
    """Each file is looked at: the tag against the version, citation, changelog, both recipes."""
    folder, tag = ready
    assert release.missing(tag, folder) == []
    content = (folder / name).read_text(encoding="utf-8")
    assert old in content
    (folder / name).write_text(content.replace(old, new, 1), encoding="utf-8")
    assert any(name in fault or f"tag {tag}" in fault for fault in release.missing(tag, folder))


def test_conda_asks_for_what_pip_asks_for(project):
    """The same packages from the same versions on, the command, and both licences."""
    recipe = yaml.safe_load(text("publication/conda/recipe.yaml"))
    names = {"matplotlib-base": "matplotlib"}  # without the windows that nobody opens here
    asked = dict(one.split(" >=") for one in recipe["requirements"]["run"])
    assert asked.pop("python") == project["requires-python"].removeprefix(">=")
    wanted = dict(re.match(r"([\w-]+)>=([\w.]+)", one).groups() for one in project["dependencies"])
    assert {names.get(name, name): version for name, version in asked.items()} == wanted
    commands = [f"{name} = {target}" for name, target in project["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == commands
    assert recipe["about"]["license_file"] == project["license-files"]


def test_every_python_is_tested(project):
    """Those that pyproject.toml names, and no others; the lock is made for them."""
    named = [one.rsplit(" ", 1)[1] for one in project["classifiers"] if ":: 3." in one]
    workflow = yaml.safe_load(text(".github/workflows/test.yml"))
    assert workflow["jobs"]["everything"]["strategy"]["matrix"]["python"] == named
    newest = yaml.safe_load(text(".github/workflows/weekly.yml"))["jobs"]["newest"]["steps"][1]
    assert newest["with"]["python-version"] == named[-1]
    said = f"CPython {named[0]} to {named[-1]}"
    assert said in text("requirements-lock.txt").splitlines()[0]


def test_one_bot_renews_the_lock():
    """Its command is the one that is explained, and nothing else writes the lock."""
    workflow = yaml.safe_load(text(".github/workflows/lock.yml"))
    script = "\n".join(step.get("run", "") for step in workflow["jobs"]["renew"]["steps"])
    (command,) = re.findall(r"uv pip compile .*", script)
    explained = " ".join(text("environment-notes.md").split())
    assert command.removesuffix(" --upgrade") in explained
    may = workflow["jobs"]["renew"]["permissions"]
    assert may == dict.fromkeys(("contents", "pull-requests"), "write")
    updates = yaml.safe_load(text(".github/dependabot.yml"))["updates"]
    assert [one["package-ecosystem"] for one in updates] == ["github-actions"]
    workflows = (ROOT / ".github/workflows").glob("*.yml")
    compiling = [one.name for one in workflows if "pip compile" in one.read_text(encoding="utf-8")]
    assert compiling == ["lock.yml"]


def test_chapters_have_the_names_that_the_readmes_give():
    pages = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "book").glob("*.ipynb"))
    for name in ("README.md", "data/README.md", "environment-notes.md"):
        told = re.findall(r'(?:chapter|appendix) "([^"]+)"', " ".join(text(name).split()))
        assert [title for title in told if f'"# {title}' not in pages] == [], name


def test_readme_on_pypi_has_no_relative_link():
    shown = release.absolute(text("README.md"))
    assert re.search(r"!\[[^\]]+\]\(https://[^)]+/cradle\.png\)", shown)
    for link in re.findall(r"\]\(([^)]+)\)", shown):
        assert link.startswith(("https://", "#")), link
    for path in re.findall(r"/(?:raw|blob)/v[\d.]+/([^)#]+)", shown):
        assert (ROOT / path).exists(), path


def test_citation_is_complete(project):
    citation, deposit = yaml.safe_load(text("CITATION.cff")), json.loads(text(".zenodo.json"))
    asked = "cff-version message title type version date-released license repository-code url"
    for key in f"{asked} abstract keywords authors references".split():
        assert citation[key], key
    for key in ("creators", "description", "keywords", "version", "upload_type"):
        assert deposit[key], key
    assert deposit["license"] == project["license"] == "MIT"
    assert deposit["title"] == citation["title"]


def test_actions_are_pinned():
    """By the hash of a commit, with its version beside: a tag can be moved."""
    workflows = list((ROOT / ".github/workflows").glob("*.yml"))
    assert len(workflows) > 4
    pins = {}
    for path in workflows:
        for used in re.findall(r"uses: *(.+)", path.read_text(encoding="utf-8")):
            pin = re.fullmatch(r"([\w./-]+)@([0-9a-f]{40})  # (v[\d.]+)", used)
            assert pin, f"{path.name}: {used}"
            assert pins.setdefault(pin[1], pin[2]) == pin[2], used
        assert "permissions:\n  contents: read\n" in path.read_text(encoding="utf-8"), path.name


def test_the_lock_has_every_dependency_with_hashes_and_no_address(project):
    lock = text("requirements-lock.txt")
    assert "://" not in lock
    entries = re.split(r"^(?=[\w.-]+==)", lock, flags=re.MULTILINE)[1:]
    assert len(entries) > 100
    for entry in entries:
        assert "--hash=sha256:" in entry, entry
    locked = {entry.partition("==")[0].lower().replace("_", "-") for entry in entries}
    extras = project["optional-dependencies"]
    asked = [*project["dependencies"], *extras["book"], *extras["test"], *extras["dev"]]
    names = {re.match(r"[\w.-]+", one)[0].lower() for one in asked} - {project["name"]}
    assert names <= locked


def test_oldest_versions_are_those_declared(project):
    extras = project["optional-dependencies"]
    asked = [*project["dependencies"], *extras["book"], *extras["test"]]
    declared = {}
    for one in asked:
        if bound := re.match(r"([\w.-]+)(?:\[\w+\])?[>=]=([\w.]+)", one):
            declared[bound[1]] = bound[2]
    tested = dict(re.findall(r"^([\w.-]+)==([\w.]+)$", text(".ci/oldest.txt"), re.MULTILINE))
    assert tested == declared


def test_binder_has_a_python_that_the_package_takes(project):
    version = re.fullmatch(r"python-(3\.\d+)\n", text(".binder/runtime.txt"))[1]
    assert f"Programming Language :: Python :: {version}" in project["classifiers"]
    assert text(".binder/requirements.txt") == "-e .[book]\n"


@pytest.fixture(scope="module")
def sdist(tmp_path_factory):
    """Build a source distribution from a copy of the repository's files: no network."""
    folder = tmp_path_factory.mktemp("sdist")
    source = folder / "source"
    shutil.copytree(
        ROOT,
        source,
        ignore=shutil.ignore_patterns(
            *(".git", ".venv", "_build", "build", "dist", "*.egg-info", "__pycache__"),
            *(".*_cache", ".hypothesis", ".import_linter_cache"),
        ),
    )
    command = "from setuptools.build_meta import build_sdist; print(build_sdist('..'))"
    run = subprocess.run(
        [sys.executable, "-c", command], cwd=source, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    (built,) = folder.glob("*.tar.gz")
    return built


def test_a_source_distribution_is_the_whole_repository(sdist):
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    top = "CITATION.cff CHANGELOG.md LICENSE LICENSE-TEXT README.md requirements-lock.txt"
    assert {*top.split(), "_config.yml"} <= names
    for folder in ("cradle", "tests", "book", "data", "benchmarks", "publication", ".github"):
        expected = {
            path.relative_to(ROOT).as_posix()
            for path in (ROOT / folder).rglob("*")
            if path.is_file()
            and path.suffix not in (".pyc", ".nbi", ".nbc")
            and not any(part.startswith(".") for part in path.relative_to(ROOT / folder).parts)
        }
        assert expected <= names, folder
