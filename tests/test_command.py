"""The command line: tables, formats, exit codes, and every example of its help."""

import csv
import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from cradle import (
    Chain,
    EnergyDistribution,
    ImpulseCorrelation,
    SequentialCollisions,
    SpringChain,
    collide,
    drive,
    paper_chain,
    recommend,
    runtime,
)
from cradle.command import main, run
from cradle.console import text as shown
from cradle.fit import read_shots

ROOT = Path(__file__).parents[1]
COMMANDS = list(main.commands)


def call(line, expected=0):
    # What a command chooses for its own process must not reach the next one.
    free = {runtime.VARIABLE: None}
    result = CliRunner(env=free).invoke(main, shlex.split(line), catch_exceptions=False)
    assert result.exit_code == expected, result.output
    return result.output


def examples():
    found = []
    for name in COMMANDS:
        lines = re.findall(r"^\s+cradle (.+)$", call(f"{name} --help"), flags=re.M)
        assert lines, name
        found += lines
    return found


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a table of shots: the first of each set of the synthetic example."""
    lines = (ROOT / "data" / "shots_synthetic.csv").read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines[2:]
            if int(line.split(",")[1]) in (1, 5, 9) and not line.startswith("ABACA")]  # fmt: skip
    (tmp_path / "shots.csv").write_text("\n".join([*lines[:2], *kept]) + "\n", encoding="utf-8")
    shutil.copy(ROOT / "data" / "video_synthetic.txt", tmp_path / "film.txt")
    shutil.copy(tmp_path / "shots.csv", tmp_path / "grams.csv")
    rows = list(csv.reader(io.StringIO((tmp_path / "shots.csv").read_text().split("\n", 1)[1])))
    with (tmp_path / "grams.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(rows[0])
        writer.writerows([*r[:4], 1000 * float(r[4]), *r[5:]] for r in rows[1:])
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(runtime.VARIABLE, "plain")
    return tmp_path


def test_every_example_of_the_help_works(folder):
    lines = examples()
    assert len(lines) >= 14
    for line in lines:
        # The file of the example in grams is the one in grams.
        line = line.replace("shots.csv", "grams.csv") if "--mass-unit g" in line else line
        assert call(line).strip(), line
    for name in ("fit.png", "impact.png", "impact.svg"):
        assert (folder / name).stat().st_size > 1000


def test_solve_agrees_with_the_solver():
    chain, model = paper_chain("ABACA", 1.5)
    after = collide(chain, model).velocities
    answer = json.loads(call("solve ABACA --speed 1.5 --json"))
    assert [row["after"] for row in answer["rows"]] == pytest.approx(after.tolist(), abs=1e-15)
    assert answer["collisions"] == collide(chain, model).collisions.tolist()
    rows = list(csv.DictReader(io.StringIO(call("solve ABACA --speed 1.5 --csv"))))
    assert [float(row["after"]) for row in rows] == pytest.approx(after.tolist(), abs=1e-15)
    text = call("solve ABACA --speed 1.5").splitlines()
    assert text[0].split() == ["ball", "type", "mass", "before", "after"]
    assert [float(line.split()[-1]) for line in text[1:6]] == pytest.approx(
        after.tolist(), abs=5.1e-5
    )


def test_solve_by_masses():
    answer = json.loads(call("solve --masses 1,1,1 --velocities 1,0,-1 --ratio 0 --json"))
    assert [row["after"] for row in answer["rows"]] == pytest.approx([-1, 0, 1], abs=1e-12)
    assert answer["energy_lost"] == pytest.approx(0, abs=1e-12)


# --- what is assumed ---------------------------------------------------------------------------

LOSSY = "--restitution 0.9"


@pytest.mark.parametrize(
    ("options", "model", "assumed"),
    [
        ("", SpringChain(), ["the first ball strikes at 1 m/s", "no energy is lost", "elastic sp"]),
        (f"--speed 2 {LOSSY}", EnergyDistribution(), ["strikes at 2 m/s", "spheres with losses"]),
        (f"--velocities 1,0,0 {LOSSY} --ratio 0.1", ImpulseCorrelation(0.1), []),
        (f"{LOSSY} --velocities 1,0,0 --model spheres", EnergyDistribution(), []),
        ("--velocities 1,0,0 --model sequential", SequentialCollisions(), ["no energy is lost"]),
        ("--ratio 0.1,0.2", None, None),
    ],
)
def test_what_is_not_given_is_said(options, model, assumed):
    """The model is the one that is named, and each assumption is said once."""
    line = f"solve --masses 1,1,1 {options}"
    if model is None:
        with pytest.raises(ValueError, match="forward has 2 values"):
            call(line)
        return
    answer = json.loads(call(f"{line} --json"))
    assert eval(answer["model"]) == model
    assert len(answer["assumed"]) == len(assumed)
    for said, words in zip(answer["assumed"], assumed, strict=True):
        assert words in said
    chain = Chain([1] * 3, [row["before"] for row in answer["rows"]], 0.9 if "0.9" in line else 1)
    after = collide(chain, model).velocities
    np.testing.assert_allclose([row["after"] for row in answer["rows"]], after, atol=1e-12)
    text = call(line)
    assert f"model: {answer['model']}" in text
    assert ("assumed: " in text) == bool(assumed)


def test_the_toy_of_the_readme():
    text = call("solve --masses 1,1,1,1,1")
    after = [float(line.split()[-1]) for line in text.splitlines()[1:6]]
    assert np.round(after, 2).tolist() == [-0.07, -0.03, -0.01, 0.13, 0.99]


def test_the_papers_balls_by_another_law():
    answer = json.loads(call("solve AAAAA --model sequential --json"))
    chain, _ = paper_chain("AAAAA")
    after = collide(chain, SequentialCollisions()).velocities
    np.testing.assert_allclose([row["after"] for row in answer["rows"]], after, atol=1e-15)
    assert json.loads(call("solve AAAAA --json"))["assumed"] == []


def test_balls_that_do_not_approach_are_named():
    assert "no balls approach: no impact" in call("solve --masses 1,1,1 --velocities -1,0,0")
    assert "no balls approach" not in call("solve --masses 1,1,1 --velocities 0,0,-1")


def test_numbers_are_for_people():
    """Never minus zero; light balls have a mass; columns have as many decimals as they need."""
    text = call("solve --masses 1,1,1 --ratio 0")
    assert "-0.0" not in text
    rows = [line.split() for line in call("solve --masses 1e-7,2e-7 --ratio 0").splitlines()[1:3]]
    assert [row[2] for row in rows] == ["1e-07", "2e-07"]
    grams = call("solve --masses 45,166 --unit g").splitlines()[1:3]
    assert [float(line.split()[2]) for line in grams] == [0.045, 0.166]
    assert shown([{"x": -1e-6, "y": float("nan")}, {"x": 1.0, "y": 2.0}]).split()[2] == "0.0000"


def test_recommend_says_what_python_says():
    chain = Chain([1] * 5, [1, 0, 0, 0, 0])
    text = call("recommend --masses 1,1,1,1,1 --stiffness 1 --accuracy 1e-3 --wanted forces")
    assert text.strip() == repr(recommend(chain, "forces", accuracy=1e-3, stiffness=1))
    text = call("recommend --masses 1,1,1,1,1 --ratio 0.1 --impacts 500")
    assert text.strip() == repr(recommend(chain, ratios=0.1, impacts=500))
    text = call("recommend ABACA --stiffness 1,2,2,1")
    balls, ratios = paper_chain("ABACA")
    assert text.strip() == repr(recommend(balls, ratios=ratios, stiffness=[1, 2, 2, 1]))
    assert call("recommend --masses 1,2").strip() == repr(recommend(Chain([1, 2], [1, 0])))


@pytest.mark.parametrize(
    ("loaded", "before", "after", "words"),
    [
        (False, False, False, "not compiled: numba is missing or switched off"),
        (True, True, True, r"compiled already; loaded in \d+\.\d s"),
        (True, False, True, r"compiled in \d+ s, once on this machine"),
        (True, False, False, r"compiled in \d+ s for this process alone"),
    ],
)
def test_warm_up_says_what_was_done(monkeypatch, loaded, before, after, words):
    found = iter([before, after])
    monkeypatch.setattr(drive, "warm_up", lambda: None)
    monkeypatch.setattr(runtime, "on_disk", lambda: next(found))
    monkeypatch.setattr(runtime, "loaded", lambda: loaded)
    assert re.match(words, call("warm-up"))


@pytest.mark.usefixtures("folder")
def test_fit_finds_what_the_example_was_made_with():
    answer = json.loads(call("fit shots.csv --json --known CAB=0.499 --known BAC=0.088"))
    rows = {row["name"]: row for row in answer["rows"]}
    assert rows["AB"]["lower"] - 0.02 < 0.53 < rows["AB"]["upper"] + 0.02
    assert rows["ABA"]["lower"] - 0.03 < 0.127 < rows["ABA"]["upper"] + 0.03
    assert answer["shots"] == 18
    assert len(answer["chi_square"]) == 2


def test_film_gives_the_rows_of_the_table(folder):
    """The film of the example, with the scatter of its own marks."""
    line = "film film.txt --set BAC --masses 53,45,53 --unit g --length 0.3 --header"
    (folder / "one.csv").write_text(call(line), encoding="utf-8")
    one = read_shots(folder / "one.csv")["BAC"]
    stored = read_shots(folder / "shots.csv")["BAC"]
    np.testing.assert_allclose(one.after[0], stored.after[0], atol=1e-4)
    np.testing.assert_allclose(one.before[0], stored.before[0], atol=1e-4)
    np.testing.assert_allclose(one.sigma[0], stored.sigma[0], rtol=0.3)
    slow = line.replace("--length 0.3", "--slower 0.5 --window 0.1")
    (folder / "two.csv").write_text(call(slow), encoding="utf-8")
    two = read_shots(folder / "two.csv")["BAC"]
    np.testing.assert_allclose(2 * two.after[0], one.after[0], atol=0.05)


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        ("solve ABXA", 1, "sequence[2] = 'X'; must be one of A, B, C, D"),
        ("solve ABCCA", 1, "--saturate holds the contact closed"),
        ("solve", 2, "give either a sequence of ball types"),
        ("solve ABA --masses 1,1", 2, "give either a sequence of ball types"),
        ("solve ABA --ratio 0.1", 2, "--ratio goes with --masses"),
        ("solve --masses 1,x", 2, "write numbers with commas"),
        ("solve --masses 1,1 --json --csv", 2, "give one of --json and --csv"),
        ("solve --masses 1,-1", 1, "masses[1] = -1.0; must be above 0"),
        ("solve --masses 1,1,1 --model ratio", 2, "ratios need --ratio, such as 0.1"),
        ("solve --masses 1,1,1 --backward 0.1", 2, "ratios need --ratio"),
        ("solve --masses 1,1,1 --model spheres --ratio 0.1", 2, "--model spheres has no ratios"),
        ("solve ABCCA --model sequential --saturate", 2, "--model sequential has no ratios"),
        ("solve --masses 1,1,1 --ratio 0.6", 1, "--ratio[0] = 0.6; at ball 1"),
        ("solve --masses 1,1,1 --ratio 0.1,0.1", 1, "--ratio has 2 values; 3 balls need 1"),
        ("swing --masses 1,1,1 --pull 5", 1, "--pull = 5.0; must be above 0 and at most a quarter"),
        ("swing --masses 1,1,1 --pull -1", 1, "--pull = -1.0; must be above 0 and at most a quar"),
        ("swing --masses 1,1,1 --pull 0", 1, "--pull = 0.0; must be above 0 and at most a quarter"),
        ("swing --masses 1,1,1 --length 0", 1, "length = 0.0; must be above 0"),
        ("swing --masses 1,1,1 --seconds 0", 1, "--seconds = 0.0; must be above 0"),
        ("swing --masses 1,1,1 --steps 0", 1, "--steps = 0; must be a whole number, at least 1"),
        ("recommend --masses 1,1,1", 1, "Give --stiffness 1 if all contacts are equal spheres"),
        ("recommend --masses 1,1,1 --model spheres", 2, "leave --model out"),
        ("recommend --masses 1,1,1 --wanted speed", 1, "--wanted ('speed',); must be one or seve"),
        ("fit nothing.csv", 2, "does not exist"),
        ("fit shots.csv --mass-unit g --restitution AB", 2, "write NAME=NUMBER"),
        ("fit grams.csv", 1, "column mass: 45 kg is unlikely"),
        ("film film.txt --set BA --masses 1,1,1", 1, "has 3 tracks, --set 2 types"),
        ("frobnicate", 2, "No such command"),
    ],
)
@pytest.mark.usefixtures("folder")
def test_errors_end_in_one_line_and_a_code(capsys, line, code, message):
    with pytest.raises(SystemExit) as stopped:
        run(shlex.split(line))
    assert stopped.value.code == code
    captured = capsys.readouterr()
    assert message in captured.err.replace("\n", " ")
    assert not captured.out
    assert "Traceback" not in captured.err


def test_first_answer_within_a_second(tmp_path):
    """Processor time of a cold start: what the machine does besides does not count."""
    environment = {k: v for k, v in os.environ.items() if k != "CRADLE_KERNEL"}
    code = (
        "import os, runpy, sys\n"
        "sys.argv = ['cradle', 'solve', 'ABACA']\n"
        "try:\n    runpy.run_module('cradle', run_name='__main__')\n"
        "except SystemExit as stopped:\n    assert not stopped.code\n"
        "times = os.times()\n"
        "print(times.user + times.system)\n"
        "print({'numba', 'pandas', 'matplotlib', 'scipy'} & set(sys.modules))\n"
    )
    result = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=environment,
                            capture_output=True, text=True, check=True)  # fmt: skip
    *_, seconds, loaded = result.stdout.splitlines()
    assert float(seconds) < 1
    assert loaded == "set()"
    assert "0.2782" in result.stdout


def test_balls_at_rest_lose_nothing():
    assert json.loads(call("solve AAAAA --speed 0 --json"))["energy_lost"] == 0
