"""The page "Use it from your own code": its blocks are copied, run, and print what it shows."""

import contextlib
import csv
import io
import json
import re
import shlex
import subprocess
import sys
import types
from collections import namedtuple
from pathlib import Path

import pytest
from chapters import numbers
from script import Script

from cradle import (
    Chain,
    ImpulseCorrelation,
    collide,
    hertz_stiffness,
    textbook,
)
from cradle.tables import data_folder

ROOT = Path(__file__).parents[1]
SECTIONS = re.split(r"(?m)^## ", (ROOT / "book" / "own_code.md").read_text(encoding="utf-8"))[1:]
#: Title of the section -> its blocks, each one its language and its text.
BLOCKS = {
    section.partition("\n")[0]: re.findall(r"```(\w+)\n(.*?)```", section, re.DOTALL)
    for section in SECTIONS
}
ONE, ADVICE, SPHERES, MANY, ENGINE, WEB, FIT = BLOCKS
#: Python that prints, and what the page shows of it.
PAIRS = {
    title: [(code, told) for (kind, code), (_, told) in zip(parts, parts[1:]) if kind == "python"]
    for title, parts in BLOCKS.items()
}


def printed(code):
    """What a block prints, run alone."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(compile(code, "own_code.md", "exec"), {"__name__": "__main__"})
    return said.getvalue()


@pytest.mark.parametrize("title", [ONE, ADVICE, SPHERES, MANY])
def test_plain_blocks(title):
    ((code, told),) = PAIRS[title]
    assert printed(code) == told


def test_every_block_is_run_here():
    kinds = {title: " ".join(kind for kind, _ in parts) for title, parts in BLOCKS.items()}
    plain = "python text"
    assert [*kinds.values()][:5] == [plain] * 5
    assert [*kinds.values()][5:] == ["sh html text", "sh python text python text text sh text"]


def test_spheres_with_losses_have_no_need_of_their_stiffness():
    ((code, told),) = PAIRS[ADVICE]
    assert code.count("stiffness=1)") == 1
    assert printed(code.replace("stiffness=1)", "stiffness=1e10)")) == told
    spheres = collide(Chain([1] * 3, [1, 0, 0]), ImpulseCorrelation(0.13)).velocities
    assert spheres == pytest.approx(numbers(told.splitlines()[1]), abs=3e-3)


def test_another_material():
    section = next(section for section in SECTIONS if section.startswith(SPHERES))
    (call,) = re.findall(r"`(hertz_stiffness\(radii, .*?\))`", section)
    found = eval(call, {"radii": [0.01, 0.01], "hertz_stiffness": hertz_stiffness})
    assert found == pytest.approx(2 / 3 * 70e9 / (1 - 0.33**2) * 0.005**0.5)


def test_the_ratio_from_the_right_is_that_from_the_left():
    (_, html) = BLOCKS[WEB][1]
    assert "backward: the same" in html
    both = [{"forward": 0.15}, {"forward": 0.15, "backward": 0.15}]
    chain = Chain([1, 1, 1], [0, 0, -1], 0.95)
    one, other = (collide(chain, ImpulseCorrelation(**given)).velocities for given in both)
    assert one.tolist() == other.tolist()


def test_the_best_ball_between_two_others():
    """At ratio zero it is the geometric mean; each speed by the textbook."""
    rows = [numbers(line) for line in BLOCKS[MANY][1][1].splitlines()]
    assert rows[0] == [0, 0.5, round((2 / 1.5) * (1 / 0.75), 3)]
    assert [row[0] for row in rows] == [0, 0.05, 0.1, 0.15]
    for ratio, middle, speed in rows:
        found = [
            float(textbook.solve([1, m, 0.25], [1, 0, 0], [1, 1], [ratio]).path[-1][2])
            for m in (middle / 1.05, middle, middle * 1.05)
        ]
        assert found[1] == pytest.approx(speed, abs=6e-4)
        assert found[1] > max(found[0], found[2])


class Body:
    """A ball on which no force acts: as much of pymunk's as the page asks for."""

    def __init__(self, mass, moment):
        self.mass, self.position, self.velocity = mass, (0.0, 0.0), (0.0, 0.0)

    def __setattr__(self, name, value):
        pair = isinstance(value, tuple)
        super().__setattr__(name, Vec(*value) if pair else value)

    def apply_impulse_at_world_point(self, impulse, point):
        assert point == self.position
        self.velocity = tuple(v + p / self.mass for v, p in zip(self.velocity, impulse))


Vec = namedtuple("Vec", "x y")


class Space(list):
    """A world without contacts: shapes in it do nothing."""

    def add(self, *parts):
        self += [part for part in parts if isinstance(part, Body)]

    def step(self, duration):
        for body in self:
            body.position = tuple(x + duration * v for x, v in zip(body.position, body.velocity))


PLAIN = types.SimpleNamespace(
    Body=Body, Space=Space, Circle=lambda *given: types.SimpleNamespace(given=given),
    ShapeFilter=types.SimpleNamespace,
)  # fmt: skip


@pytest.mark.parametrize("engine", ["pymunk", "plain"])
def test_a_row_in_an_engine(engine, monkeypatch):
    """The block as it stands, in pymunk where it is installed, and in an engine of our own."""
    if engine == "plain":
        monkeypatch.setitem(sys.modules, "pymunk", PLAIN)
    else:
        pytest.importorskip("pymunk", reason='not installed; pip install -e ".[engines]"')
    ((code, told),) = PAIRS[ENGINE]
    assert printed(code) == told


def test_the_row_does_what_collide_does():
    hit, velocities = BLOCKS[ENGINE][1][1].splitlines()
    trace = collide(Chain([1] * 4, [2.5, 0, 0, 0], 0.95), ImpulseCorrelation(0.13))
    assert numbers(velocities) == trace.velocities.round(3).tolist()
    assert numbers(hit) == [0.3 / 2.5, round(float(trace.impulses.max()), 2)]


def test_a_web_page(tmp_path):
    """The folder that the page's command makes, and its script, in V8; a document stands in."""
    (_, command), (_, html), (_, told) = BLOCKS[WEB]
    program, *given, folder = shlex.split(command)
    assert (program, folder) == ("python", "my-page")
    subprocess.run([sys.executable, *given, str(tmp_path)], cwd=ROOT, check=True)
    assert {"index.js", "README.md", "example.html"} <= {path.name for path in tmp_path.iterdir()}
    start, name, end = re.search(r'<p>(.*?)<output id="(\w+)"></output>(.*?)</p>', html).groups()
    script = re.search(r'<script type="module">(.*?)</script>', html, re.DOTALL)[1]
    names, address, body = re.search(
        r'import (\{.*?\}) from "\./(.*?)";(.*)', script, re.S
    ).groups()
    module, count = re.subn(
        r"(?m)^export const ", "const ", (tmp_path / address).read_text(encoding="utf-8")
    )
    assert count == 1
    page = Script(f"""const parts = {json.dumps({name: {}})}; let hit = null;
        (() => {{ {module}
          const document = {{ getElementById: (id) => parts[id] }};
          (({names}) => {{ {body.replace("const hit", "hit")} }})({names}); }})();""")
    shown, velocities = page("() => [parts, hit.velocities]")
    page.context.close()
    assert f"{start}{shown[name]['textContent']}{end}\n" == told
    # "those of the first block above, to the last bit"
    trace = collide(Chain([1, 1, 1], [1, 0, 0], 0.95), ImpulseCorrelation(0.15))
    assert velocities == trace.velocities.tolist()
    assert numbers(told.replace("m/s.", "")) == numbers(BLOCKS[ONE][1][1])


def test_a_fit_and_a_film(tmp_path, monkeypatch):
    """From the template to a ratio, and from a film to velocities: by Python and by command."""
    monkeypatch.chdir(tmp_path)
    film = (data_folder() / "video_synthetic.txt").read_text(encoding="utf-8")
    Path("film.txt").write_text(film, encoding="utf-8")

    def run(command):
        program, *given = shlex.split(command)
        assert program == "cradle"
        *given, arrow, file = given
        with Path(file).open({">": "w", ">>": "a"}[arrow], encoding="utf-8") as out:
            subprocess.run([sys.executable, "-m", "cradle", *given], stdout=out, check=True)

    first, last = [code for kind, code in BLOCKS[FIT] if kind == "sh"]
    pair = BLOCKS[FIT][-3][1]
    run(first)
    for code, told in PAIRS[FIT]:
        assert printed(code) == told
    run(last)
    table = Path("shots.csv").read_text(encoding="utf-8").splitlines()
    with pytest.raises(ValueError, match="restitution has no 'AC', which set BAC needs"):
        printed(PAIRS[FIT][0][0])
    with Path("shots.csv").open("a", encoding="utf-8") as file:
        file.write(pair)
    assert printed(PAIRS[FIT][0][0]) == BLOCKS[FIT][-1][1]
    lines = [line for line in table if line[0] != "#"]
    rows = [row for row in csv.DictReader(lines) if row["set"] == "BAC"]
    before, after, error = map(numbers, PAIRS[FIT][1][1].splitlines())
    assert [round(float(row["before"]), 3) for row in rows] == before
    assert [round(float(row["after"]), 3) for row in rows] == after
    assert [round(float(row["sigma"]), 3) for row in rows] == error
