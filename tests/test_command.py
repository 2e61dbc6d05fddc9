"""The command line: tables, formats, exit codes, and every example of its help."""

import contextlib
import csv
import functools
import io
import json
import math
import os
import pickle
import re
import shlex
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from commands import call, examples, film_of_lifted
from shots import columns, outcome
from tqdm import tqdm

from cradle import (
    Chain,
    EnergyDistribution,
    ImpulseCorrelation,
    Pendulums,
    SequentialCollisions,
    SpringChain,
    TimedTrace,
    collide,
    paper_chain,
    recommend,
    textbook,
    viscosity_from,
)
from cradle import swing as swung
from cradle.command.console import text as shown
from cradle.command.solve import main, run
from cradle.fit import ratio, read_shots
from cradle.runtime import compile as runtime
from cradle.runtime import job as drive
from cradle.swinging import swing

DATA = Path(__file__).parents[1] / "data"


FITS = {}


def fitted(*given, **options):
    """A fit that is made once of the same shots: each takes a second."""
    key = pickle.dumps((given, options))
    if key not in FITS:
        FITS[key] = ratio(*given, **options)
    return replace(FITS[key], shots=given[0])


def swinging(size=1.0, slower=1.0):
    """A film of three balls that swing for 1.5 s and collide by a ratio of 0.2, as text."""
    times, chain = np.arange(0, 1.5, 0.03), Chain([45, 53, 45], [0, 0, 0], 0.9)
    hanging = Pendulums(9.81 * (0.6 / math.tau) ** 2)
    run = swung(chain, ImpulseCorrelation(0.2), [-0.05, 0, 0], times, pendulums=hanging)
    places = run.positions + 0.03 * np.arange(3)
    places += np.random.default_rng(1).normal(0, 1e-4, places.shape)
    rows = np.column_stack([slower * times, size * places])
    lines = ["\t".join(f"{x:.7f}" for x in row) for row in rows]
    return "\n".join(["t\tA/x\tB/x\tC/x", *lines])


@pytest.fixture(scope="module")
def files():
    """Tables of shots, the first of each set of the synthetic example, and films.

    `shots.csv` has pairs and triplets, `long.csv` a chain of five too.
    """
    table = pd.read_csv(DATA / "shots_synthetic.csv", comment="#")
    table = table[table.shot.isin([1, 5, 9])]
    shots = table[table["set"] != "ABACA"]
    pairs, speeds = shots[shots["set"].isin(["AB", "AC"])], list(table.columns[5:])
    tables = {
        "long": table,
        "shots": shots,
        "pairs": pairs,
        "grams": shots.assign(mass=1000 * shots.mass),
        "fast": pairs.assign(**100 * pairs[speeds]),
        "exact": pairs.assign(sigma=0),
    }
    film = (DATA / "video_synthetic.txt").read_text(encoding="utf-8")
    return {
        **{f"{name}.csv": rows.to_csv(index=False).encode() for name, rows in tables.items()},
        "film.txt": film.encode(),
        "wide.txt": film.encode("utf-16"),
        "swing.txt": swinging().encode(),
    }


@pytest.fixture
def folder(files, tmp_path, monkeypatch):
    """A folder with these files."""
    for name, held in files.items():
        (tmp_path / name).write_bytes(held)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(runtime.VARIABLE, "plain")
    monkeypatch.setattr("cradle.fit.ratio", fitted)
    return tmp_path


@pytest.fixture
def ended(capsys):
    """What a line prints until it exits, with this code if one is given: `out` and `err`."""

    def ended(line, code=None):
        with pytest.raises(SystemExit) as stopped:
            run(shlex.split(line))
        assert code in (None, stopped.value.code)
        return capsys.readouterr()

    return ended


def test_every_example_of_the_help_works(folder):
    lines = examples()
    assert len(lines) >= 14
    for line in lines:
        # The file of the example in grams is the one in grams.
        line = line.replace("shots.csv", "grams.csv") if "--mass-unit g" in line else line
        assert call(line).strip(), line
    for name in ("fit.png", "impact.svg"):
        assert (folder / name).stat().st_size > 1000


def test_solve_agrees_with_the_solver():
    chain, model = paper_chain("ABACA", 1.5)
    after = collide(chain, model).velocities
    answer = json.loads(call("solve ABACA --speed 1.5 --json"))
    assert [row["after"] for row in answer["rows"]] == pytest.approx(after.tolist(), abs=1e-15)
    assert [(row["ball"], row["type"]) for row in answer["rows"]] == list(enumerate("ABACA", 1))
    assert answer["collisions"] == collide(chain, model).collisions.tolist()
    rows = list(csv.DictReader(io.StringIO(call("solve ABACA --speed 1.5 --csv"))))
    assert [float(row["after"]) for row in rows] == pytest.approx(after.tolist(), abs=1e-15)
    text = call("solve ABACA --speed 1.5").splitlines()
    assert text[0].split() == ["ball", "type", "mass", "before", "after"]
    ends = [float(line.split()[-1]) for line in text[1:6]]
    assert ends == pytest.approx(after.tolist(), abs=5.1e-5)


def test_tasks_for_tests_and_marks():
    """Their answers, printed and by the command; only the last one has a back impact."""
    text = (DATA.parent / "book" / "instructors.md").read_text(encoding="utf-8")
    tasks = re.findall(r"(?m)^\| ([\d, ]+) \| ([\d/, ]+) \| ([\d/]+) \|$", text)
    collisions, velocities = [], []
    for task in tasks:
        rows = [[float(Fraction(number)) for number in numbers.split(", ")] for numbers in task]
        found = textbook.solve(rows[0], [1, 0, 0], rows[1] * (2 // len(rows[1])), rows[2])
        m, e, a = (",".join(f"{number:g}" for number in row) for row in rows)
        told = json.loads(call(f"solve --masses {m} --restitution {e} --ratio {a} --json"))
        assert [row["after"] for row in told["rows"]] == pytest.approx(found.velocities, abs=1e-14)
        collisions.append(told["collisions"])
        velocities.append([float(v) for v in found.velocities])
    assert collisions == [[1, 1]] * 5 + [[2, 1]]
    program = re.search(r"```python\n(.*?)```", text, re.DOTALL)[1]
    for student in range(10):  # of each one again: only the last task has a back impact
        said, ran = io.StringIO(), {}
        with contextlib.redirect_stdout(said):
            exec(program.replace("student = 0 ", f"student = {student} "), ran)
        assert ran["student"] == student
        assert (ran["trace"].collisions == [2, 1]).all()
        if student == 0:
            assert f"```text\n{said.getvalue()}```" in text
        lines = said.getvalue().splitlines()
        answers = [[float(v) for v in re.split(r"[\[\]\s]+", line) if v] for line in lines]
        for k, ((masses, e, a), (used, *after)) in enumerate(zip(ran["tasks"], answers)):
            assert used == pytest.approx(a * (1 - student / 40), abs=5.1e-5)
            e = [e] * 2 if np.isscalar(e) else e
            found = textbook.solve(masses, [1, 0, 0], e, [a * (1 - student / 40)])
            v = [float(v) for v in found.velocities]
            impulses = [masses[0] * (1 - v[0]), masses[2] * v[2]]
            assert after == pytest.approx(v + impulses, abs=5.1e-5)
            assert sum(kind == "end" for kind, _ in found.events) == 2 + (k == 5)
            if student == 0:
                assert v == pytest.approx(velocities[k], abs=5.1e-5)


# --- what is assumed ---------------------------------------------------------------------------

LOSSY = "--restitution 0.9"
VISCOUS = SpringChain(viscosity=viscosity_from(0.9, speed=2, masses=[1, 1, 1])[0])
BAC = "film film.txt --set BAC --masses 1,1,1 --length 0.3"


@pytest.mark.parametrize(
    ("options", "model", "assumed"),
    [
        ("", SpringChain(),
         ["the first ball strikes at 1 m/s", "contacts lose no energy", "elastic sp"]),
        (f"--speed 2 {LOSSY}", VISCOUS, ["strikes at 2 m/s", "viscous spheres; restitution at 2 "]),
        ("--restitution 0.01", EnergyDistribution(),
         ["strikes at 1", "than viscous ones can, by the energy"]),
        ("--stiffness 1e9,2e9", SpringChain((1e9, 2e9)),
         ["strikes", "no energy", "elastic sphere"]),
        ("--velocities 1,1,0 --ratio 0.1", ImpulseCorrelation(0.1), ["no energy", "strike as one"]),
        ("--velocities 1,1,0 --model sequential", SequentialCollisions(),
         ["contacts lose no energy"]),
        ("--velocities 1,1,0 --model spheres --stiffness 1e9 --gaps 1e-4,0",
         SpringChain(1e9, gaps=(1e-4, 0.0)), ["contacts lose no energy"]),
        (f"--velocities 1,0,0 {LOSSY} --ratio 0.1", ImpulseCorrelation(0.1), []),
        (f"{LOSSY} --velocities 2,0,0 --model spheres", VISCOUS, []),
        ("--velocities 1,0,0 --model sequential", SequentialCollisions(),
         ["contacts lose no energy"]),
    ],
)  # fmt: skip
def test_what_is_not_given_is_said(options, model, assumed):
    """The model is the one that is named, and each assumption is said once."""
    line = f"solve --masses 1,1,1 {options}"
    answer = json.loads(call(f"{line} --json"))
    assert eval(answer["model"]) == model
    assert len(answer["assumed"]) == len(assumed)
    for said, words in zip(answer["assumed"], assumed, strict=True):
        assert words in said
    e = next((e for e in (0.9, 0.01) if f"{e}" in line and model != VISCOUS), 1)
    chain = Chain([1] * 3, [row["before"] for row in answer["rows"]], e)
    after = collide(chain, model).velocities
    np.testing.assert_allclose([row["after"] for row in answer["rows"]], after, atol=1e-12)
    text = call(line)
    assert f"model: {answer['model']}" in text
    assert ("assumed: " in text) == bool(assumed)


@pytest.mark.parametrize(
    ("line", "same"),
    [
        ("", "--help"),
        ("-h", "--help"),
        ("solve -h", "solve --help"),
        ("solve aaaaa", "solve AAAAA"),
        ("solve abAcA", "solve ABACA"),
        ("solve 5 --csv", "solve --masses 1,1,1,1,1 --csv"),
        ("solve 3 --unit g --ratio 0.1 --csv", "solve --masses 1,1,1 --unit g --ratio 0.1 --csv"),
        ("solve --masses 1,1 --velocities 0,\N{MINUS SIGN}1",
         "solve --masses 1,1 --velocities 0,-1"),
        ("swing 3 --pull 1 --csv", "swing --masses 1,1,1 --csv"),
        ("swing --ratio 0.1 --steps 3", "swing 5 --ratio 0.1 --steps 3"),
        ("swing 2 --period 2 --steps 3", f"swing 2 --length {9.81 / math.pi**2} --steps 3"),
        ("swing 2 --gaps 0.001 --csv", "swing 2 --gaps 0.001 --damping 0 --csv"),
    ],
)  # fmt: skip
def test_short_words_mean_what_long_ones_mean(line, same):
    assert call(line) == call(same)


@pytest.mark.parametrize(
    ("pull", "start"), [("1", [-1, 0, 0, 0]), ("2", [-1, -1, 0, 0]), ("0,1", [0, 0, 0, 1]),
                        ("1,2", [-1, 0, 1, 1]), ("4", [-1] * 4)],
)  # fmt: skip
def test_the_balls_that_are_pulled(pull, start):
    """By half the gap less: the first row is the release."""
    line = f"swing 4 --pull {pull} --by 0.02 --seconds 0.1 --ratio 0.1 --json"
    first = json.loads(call(line))["rows"][0]
    assert [first[f"ball {k}"] for k in range(1, 5)] == [0.02 * one for one in start]


def test_losses_of_a_swing_belong_to_the_first_strike():
    """At the lowest point a ball has its pull times the frequency."""
    told = json.loads(call("swing 3 --by 0.02 --length 0.2 --restitution 0.9 --steps 2 --json"))
    speed = 0.02 * math.sqrt(9.81 / 0.2)
    law = SpringChain(viscosity=viscosity_from(0.9, speed=speed, masses=[1, 1, 1])[0])
    assert eval(told["model"]).viscosity == pytest.approx(law.viscosity, rel=1e-12)
    first = told["impacts"][0]
    after = collide(Chain([1, 1, 1], [speed, 0, 0]), law).velocities
    np.testing.assert_allclose(first["after"], after, atol=1e-9)
    assert f"restitution at {speed:.3g} m/s" in told["assumed"][-1]


SWING = "swing 3 --steps 2"
ALIKE, EQUAL = "balls that move alike strike as one", "equally stiff contacts (--stiffness)"
CLOSES, SOFT = "strikes are over before a gap closes (--stiffness)", "strikes take no time"
LEFT, NONE = "driven by the left contact (rule R2)", "no balls approach: no impact"
#: What is told of by one line, and not by others.
TOLD = [
    # Of balls let go together, unless gaps part them.
    (ALIKE, f"{SWING} --ratio 0.1 --pull 2", f"{SWING} --ratio 0.1",
     f"{SWING} --ratio 0.1 --pull 2 --gaps 0.001", f"{SWING} --pull 2 --model sequential"),
    ("times in s; gaps 0.001 m", f"{SWING} --ratio 0.1 --pull 2 --gaps 0.001"),
    # A stiffness matters between unequal balls, and for gaps, which close during a strike or not.
    (EQUAL, "solve --masses 1,8,1", "solve --masses 1,8,1 --stiffness 1e9", "solve 3",
     "solve --masses 1,8,1 --ratio 0.1"),
    (CLOSES, f"{SWING} --gaps 1e-7", f"{SWING} --gaps 1e-7 --stiffness 1e9"),
    # Contacts too soft to be followed; the last line has no springs.
    (SOFT, f"{SWING} --stiffness 1e6", f"{SWING} --stiffness 1e11", SWING,
     f"{SWING} --stiffness 1e6 --restitution 0.01"),
    # Who drives what is struck from both sides, by a rule of ours; two runs each have their own.
    (LEFT, "solve 4 --velocities 1,0,0,-1 --ratio 0.2", "solve 4 --velocities 1,0,0,-1",
     "solve 4 --velocities 1,0,0,0 --ratio 0.2", "solve 4 --velocities 1,0,1,0 --ratio 0.2"),
    (LEFT, "solve 3 --velocities 1,0,-1 --ratio 0.2"),
    (NONE, "solve --masses 1,1,1 --velocities -1,0,0", "solve --masses 1,1,1 --velocities 0,0,-1"),
    ("3 equal balls of 1 g", "solve 3 --unit g"),
]  # fmt: skip


@pytest.mark.parametrize(("words", "line", "others"), [(a, b, c) for a, b, *c in TOLD])
def test_what_is_told_of(words, line, others):
    assert words in call(line)
    assert [other for other in others if words in call(other)] == []


def test_a_path_that_nobody_sees_is_not_kept():
    """Of a part of it Python warns, which here is an error."""
    assert call("solve 2000 --ratio 0.3 --csv").count("\n") == 2001


def test_a_long_swing_is_told_of(monkeypatch, ended):
    def stop(*_, **__):
        raise ValueError("enough")

    monkeypatch.setattr("cradle.swing", stop)
    for seconds, told in ("1000", False), ("10000", True):
        assert ("swings take a while" in ended(f"swing 3 --seconds {seconds}").err) == told


def test_a_swing_that_fails_ends_in_one_line(monkeypatch, ended):
    """Also where it is the solver that fails, not the input."""
    stop = RuntimeError("the swing does not get beyond t = 1 s")
    monkeypatch.setattr("cradle.swing", lambda *_, **__: (_ for _ in ()).throw(stop))
    assert ended("swing 3", 1).err == "cradle: the swing does not get beyond t = 1 s\n"


def test_a_long_row_of_springs_needs_no_way(monkeypatch):
    """Its collisions are counted on the way, which would fill the memory."""
    monkeypatch.setattr(TimedTrace, "_way", lambda *_: pytest.fail("the way was followed"))
    assert json.loads(call("solve 21 --json"))["collisions"] is None
    assert "energy lost: 0.00 %\nmodel" in call("solve 21")


def test_gaps_and_damping_of_a_swing():
    """As in Python."""
    line = "swing --masses 1,1 --by 0.02 --gaps 0.01 --damping 0.4 --length 0.2 --seconds 0.4"
    rows = json.loads(call(f"{line} --ratio 0.1 --json"))["rows"]
    hanging, times = Pendulums(0.2, gaps=0.01, damping=0.4), [row["time"] for row in rows]
    model = ImpulseCorrelation(0.1)
    run = swing.swing(Chain([1, 1], [0, 0]), model, [-0.02, 0], times, pendulums=hanging)
    assert len(run.impacts) == 1
    np.testing.assert_array_equal([[row["ball 1"], row["ball 2"]] for row in rows], run.positions)
    assert "time" in call("swing 3 --damping 0.1,0.1,0.2 --ratio 0.1 --seconds 0.4 --csv")


@pytest.mark.parametrize(("name", "begins"), [("toy.gif", b"GIF89a"), ("toy.svg", b"<svg")])
def test_a_swing_is_drawn(folder, name, begins):
    said = call(f"swing 3 --pull 2 --seconds 0.4 --ratio 0.1 -o {name}")
    assert said.startswith(f"drawn to {name}; impacts: 1\nmodel: ")
    assert (folder / name).read_bytes().startswith(begins)


def test_the_papers_balls_by_another_law():
    answer = json.loads(call("solve AAAAA --model sequential --json"))
    chain, _ = paper_chain("AAAAA")
    after = collide(chain, SequentialCollisions()).velocities
    np.testing.assert_allclose([row["after"] for row in answer["rows"]], after, atol=1e-15)
    assert json.loads(call("solve AAAAA --json"))["assumed"] == []


def test_contacts_that_are_held_and_limits_are_told():
    """Counted from 1, as the balls are."""
    trace = collide(*paper_chain("ABCCA", excess="saturate"))
    line = "solve ABCCA --saturate"
    (contact,) = trace.saturated
    assert json.loads(call(f"{line} --json"))["held_contacts"] == [contact + 1]
    held = "held closed at their largest ratio: contact "
    assert f"{held}{contact + 1} (--saturate)\n" in call(line)
    limit = "an infinite sequence of impacts was taken to its limit\n"
    text = call("solve --masses 1,1,1 --restitution 0 --ratio 0")
    assert limit in text
    assert held not in text
    assert limit not in call(line)


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
    *told, assumed = text.splitlines()
    assert told == repr(recommend(chain, "forces", accuracy=1e-3, stiffness=1)).splitlines()
    usual = "the first ball strikes at 1 m/s; contacts lose no energy (--restitution)"
    assert assumed.split(":")[1].strip() == usual
    text = call("recommend --masses 1,1,1,1,1 --ratio 0.1 --impacts 500")
    assert text.startswith(repr(recommend(chain, ratios=0.1, impacts=500)))
    assert text.isascii()  # as a terminal may be
    said = call("recommend 5 --restitution 0.9 --accuracy 1e-3")
    lossy = Chain([1] * 5, [1, 0, 0, 0, 0], 0.9)
    assert said.startswith(repr(recommend(lossy, accuracy=1e-3, stiffness=1)))
    assert said.splitlines()[-1].endswith("; equal spheres (--stiffness, --ratio)")
    two = call("recommend --masses 1,1,1,1,1 --ratio 0.1 --wanted velocities,path")
    assert two.startswith(repr(recommend(chain, ("velocities", "path"), ratios=0.1)))
    text = call("recommend ABACA --stiffness 1,2,2,1")
    balls, ratios = paper_chain("ABACA")
    assert text.strip() == repr(recommend(balls, ratios=ratios, stiffness=[1, 2, 2, 1]))
    assert call("recommend --masses 1,2").startswith(repr(recommend(Chain([1, 2], [1, 0]))))


@pytest.mark.parametrize(
    ("loaded", "words"),
    [
        (False, "not compiled: numba is missing or switched off"),
        (True, r"compiled, and loaded in \d+\.\d s"),
    ],
)
def test_warm_up_says_what_was_done(monkeypatch, loaded, words):
    monkeypatch.setattr(drive, "warm_up", lambda: None)
    monkeypatch.setattr(runtime, "loaded", lambda: loaded)
    assert re.match(words, call("warm-up"))


def test_a_confidence_set_of_two_pieces_is_shown_in_two_pieces(tmp_path, monkeypatch):
    """In the table, CSV and JSON of the command, as Python has them."""
    monkeypatch.chdir(tmp_path)
    table = columns("DAA", [0.75, 1.0, 1.25, 1.5], outcome("DAA"), 0.02)
    pd.DataFrame(table).to_csv("two.csv", index=False)
    found = ratio(read_shots(table), {"AD": 0.94, "AA": 0.97}, known={"AAD": 0.131})["DAA"]
    assert len(found.intervals) == 2
    line = "fit two.csv --restitution AD=0.94 --restitution AA=0.97 --known AAD=0.131"
    (row,) = json.loads(call(f"{line} --json"))["rows"]
    assert row["intervals"] == [list(piece) for piece in found.intervals]
    assert not {"lower", "upper"} & set(row)
    assert any(low <= row["value"] <= high for low, high in row["intervals"])
    (cells,) = csv.DictReader(io.StringIO(call(f"{line} --csv")))
    parsed = [[float(end) for end in part.split("..")] for part in cells["intervals"].split("; ")]
    assert parsed == row["intervals"]
    text = " or ".join(f"{low:.4f}-{high:.4f}" for low, high in row["intervals"])
    assert text in call(line).splitlines()[1]
    assert "intervals in pieces: DAA; " in call(f"{line} --predict DAA")


def test_narrow_intervals_have_the_digits_they_need():
    rows = [{"intervals": ((0.78138, 0.78152),)}, {"intervals": ((0.0, 0.5), (0.6, 1.0))}]
    assert shown(rows).split("\n")[1:] == [
        "                   0.78138-0.78152", "0.00000-0.50000 or 0.60000-1.00000"]  # fmt: skip


# --- what is left out, predicted and compared ---------------------------------------------------


@pytest.mark.usefixtures("folder")
def test_a_set_left_out_is_compared_with_its_prediction():
    """Predictions are those of a file without the set."""
    line = "--predict ABACA --speed 2 --json"
    without = json.loads(call(f"fit long.csv --without ABACA {line}"))
    alone = json.loads(call(f"fit shots.csv {line}"))
    assert without["rows"] == alone["rows"]
    assert without["prediction"] == alone["prediction"]
    assert without["without"] == ["ABACA"]
    assert alone["without"] == alone["measured"] == []
    (measured,) = without["measured"]
    assert (measured["set"], measured["shots"], measured["fitted"]) == ("ABACA", 2, False)
    mean, error = read_shots("long.csv")["ABACA"].mean_after(2.0)
    assert (measured["measured"], measured["error"]) == (mean.tolist(), error.tolist())
    text = call("fit long.csv --without ABACA --predict ABACA")
    assert "mean of 2 shots of set ABACA, each scaled to 1 m/s; the set was left out of" in text
    assert "momentum: chi-square" in text
    assert "20 shots (all of the file)" in text


def test_a_set_with_a_comma_in_its_name_is_left_out(folder):
    table = (folder / "shots.csv").read_text(encoding="utf-8")
    named = table.replace("\nACA,", '\n"ACA, steel",')
    assert named != table
    (folder / "named.csv").write_text(named, encoding="utf-8")
    answer = json.loads(call("fit named.csv --without 'ACA, steel' --json"))
    alone = json.loads(call("fit shots.csv --without ACA --json"))
    assert answer["without"] == ["ACA, steel"]
    assert answer["rows"] == alone["rows"]


@pytest.mark.usefixtures("folder")
def test_what_was_fitted_is_no_check():
    line = "fit shots.csv --without ACA,CAB --without BAC --predict ABA"
    answer = json.loads(call(f"{line} --json"))
    assert answer["measured"][0]["fitted"] is True
    assert answer["without"] == ["BAC", "CAB", "ACA"]
    assert answer["shots"] == 18
    assert len(answer["chi_square"]) == 2
    assert [row["name"] for row in answer["rows"]] == ["AB", "AC", "ABA"]
    text = call(line)
    assert "the set was part of the fit: this is no check\n" in text
    header = ["ball", "type", "velocity", "lower", "upper", "measured", "error"]
    assert header in [line.split() for line in text.splitlines()]


def filmed(line):
    """The cells of the rows that a film gives."""
    return [row.split(",") for row in call(line).splitlines()]


def test_film_gives_the_rows_of_the_table(folder):
    """The film of the example, with the scatter of its own marks."""
    line = "film film.txt --set BAC --masses 53,45,53 --unit g --length 0.3 --window 0.05 --header"
    (folder / "one.csv").write_text(call(line), encoding="utf-8")
    one = read_shots(folder / "one.csv")["BAC"]
    stored = read_shots(folder / "shots.csv")["BAC"]
    assert one.masses == pytest.approx(stored.masses)
    np.testing.assert_allclose(one.after[0], stored.after[0], atol=1e-4)
    np.testing.assert_allclose(one.before[0], stored.before[0], atol=1e-4)
    np.testing.assert_allclose(one.sigma[0], stored.sigma[0], rtol=0.3)
    period = 2 * math.pi * math.sqrt(0.3 / 9.81)
    slow = line.replace("--length 0.3", f"--slower 0.5 --period {2 * period}")
    (folder / "two.csv").write_text(call(slow.replace("0.05", "0.1")), encoding="utf-8")
    two = read_shots(folder / "two.csv")["BAC"]
    np.testing.assert_allclose(2 * two.after[0], one.after[0], atol=1e-3)


def test_several_films_in_any_unit(folder, ended):
    """A film a shot, named by its file; positions in pixels, mm, or as the file says itself."""
    text = (folder / "film.txt").read_text(encoding="utf-8")
    (folder / "px.txt").write_text(scaled(text, 2000), encoding="utf-8")
    (folder / "mm.txt").write_text(scaled(text, 1000), encoding="utf-8")
    (folder / "cm.txt").write_text(scaled(text, 100).replace("x", "x (cm)"), encoding="utf-8")
    named = filmed(f"{BAC} film.txt cm.txt")
    assert [row[1] for row in named] == ["film"] * 6 + ["cm"] * 3
    assert named[:3] == named[3:6]
    metres = np.array([row[5:] for row in named[:3]], float)
    px = filmed(f"{BAC} --position-unit px --scale 2000".replace("film.txt", "px.txt"))
    mm = filmed(f"{BAC} --position-unit mm".replace("film.txt", "mm.txt"))
    for rows in (named[6:], px, mm):
        others = np.array([row[5:] for row in rows], float)
        np.testing.assert_allclose(others, metres, rtol=1e-4, atol=1e-5)
    for how, words in (("--length 0.3", "than a pendulum of 0.3 m"), ("--level", "is unlikely")):
        said = ended(BAC.replace("film.txt", "px.txt").replace("--length 0.3", how)).err
        assert re.search(rf"{words}; say --position-unit", said)


@pytest.mark.usefixtures("folder")
def test_a_pendulum_does_not_swing_over_the_top(ended):
    """Where the film plays slower than is told."""
    said = ended(f"{BAC} --slower 100".replace("--length 0.3", "--length 0.2")).err
    assert re.search(r"film.txt: \S+ m/s is unlikely; see --slower", said)


def test_a_film_of_two_lifted(folder, ended):
    """As by pairs, the last two leave."""
    (folder / "two.txt").write_text(film_of_lifted(4, 2), encoding="utf-8")
    line = "film two.txt --set ABCD --masses 1,1,1,1 --length 0.3"
    printed = ended(f"{line} --name '2 lifted' --striker 2 --striker 1 --striker 2 --header")
    one = read_shots(io.StringIO(printed.out))["2 lifted"]
    before, after = one.before[0], one.after[0]
    np.testing.assert_allclose(before, [0.7, 0.7, 0, 0], atol=2e-3)
    np.testing.assert_allclose(after, [0, 0, 0.7, 0.7], atol=2e-3)
    assert "two.txt: balls 1 and 2 strike at " in printed.err
    for wrong, words in (
        ("", "if several balls were lifted, name all strikers"),
        ("--striker 0", "--striker = 0; must be a whole number, from 1 to 4"),
    ):
        assert words in ended(f"{line} {wrong}").err


def test_fit_of_a_swing(folder):
    """In pixels, and at a third of its speed; by the law of the film, and by another one."""
    (folder / "px.txt").write_text(swinging(2000, 3), encoding="utf-8")
    line = "fit-swing px.txt --masses 45,53,45 --position-unit px --scale 2000 --slower 3 --json"
    line += " --known period=0.6 --known damping=0 --known gaps=0"
    told = json.loads(call(f"{line} --ratio 0.2"))
    (found,) = told["rows"]
    ((low, high),) = found["intervals"]
    assert found["name"] == "restitution"
    assert found["value"] == pytest.approx(0.9, abs=1e-3)  # three standard errors
    assert low < found["value"] < high < low + 2e-3
    assert told["reading"] == pytest.approx(1e-4, rel=0.2)
    pairs = json.loads(call(line))
    assert [told["poor"], pairs["poor"]] == [False, True]
    assert told["assumed"] == pairs["assumed"][:1] == ["equal gaps"]
    assert pairs["assumed"][1:] == ["one pair collides after the other (--ratio)"]


def scaled(text, size):
    """An export with its positions in another unit."""
    *head, first = text.split("\n", 3)
    lines = [line.split("\t") for line in first.strip().split("\n")]
    rows = [[t, *(str(size * float(x)) if x else "" for x in cells)] for t, *cells in lines]
    return "\n".join([*head, *("\t".join(row) for row in rows)]) + "\n"


def test_one_wrong_film_of_several(folder, ended):
    """It is named, and so is a wrong mark; the others have their rows."""
    text = (folder / "film.txt").read_text(encoding="utf-8")
    (folder / "odd.txt").write_text(text.replace("0.03477", "0.04477"), encoding="utf-8")
    (folder / "here.txt").write_text(text.replace("0.03477", "here"), encoding="utf-8")
    (folder / "px.txt").write_text(scaled(text, 2000), encoding="utf-8")
    printed = ended(f"{BAC} here.txt px.txt odd.txt --header", 1)
    rows = printed.out.splitlines()
    assert [row.split(",")[1] for row in rows] == ["shot"] + ["film"] * 3 + ["odd"] * 3
    assert "here.txt, line 6, column x: 'here'; must be a number" in printed.err
    assert re.search("px.txt: track 'B' spans .* say --position-unit cm .* --scale", printed.err)
    assert "odd.txt: ball 1 strikes at" in printed.err
    assert "the mark of A at 0.008333 s is off by 0.0" in printed.err
    assert "assumed: masses in kg (--unit)" in printed.err


@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        ("solve ABXA", 1, "SEQUENCE, ball 3: 'X'; must be one of A, B, C, D"),
        ("solve a", 1, "cradle: SEQUENCE = 'A'; must name at least 2 balls"),
        ("solve ABCCA", 1, "--saturate holds the contact closed"),
        ("solve 5 --masses 1,1", 2,
         "a sequence of the paper's balls, such as ABCCA; --masses, not both"),
        ("solve", 2, "give one of: how many equal balls, such as 5; a sequence of the "),
        ("solve 5 --gaps 1e-6", 2, "--gaps need --stiffness, about 1e10 for steel"),
        ("solve 5 --ratio 0.1 --stiffness 1", 2, "--stiffness and --gaps are those of --model sph"),
        ("solve 3 --stiffness 1,-1", 1, "cradle: --stiffness, value 2: -1.0; must be above 0"),
        ("solve 3 --restitution 0.01 --stiffness 1 --gaps 1", 1,
         "--restitution, value 1: 0.01; must"),
        ("solve 1", 1, "cradle: SEQUENCE = 1; must be a whole number, 2 to 1000000 balls"),
        (f"solve {'9' * 5000}", 1, "cradle: SEQUENCE = '9999"),
        (f"solve {'9' * 5000}", 1, "; must be a whole number, 2 to 1000000 balls"),
        ("solve 0000000051", 1, "cradle: SEQUENCE = '0000000051'; must be a whole number, 2 to"),
        ("solve --masses ''", 2, "write numbers with commas"),
        ("solve ABA --ratio 0.1", 2, "--ratio goes with --masses"),
        ("solve --masses 1,1 --velocities 1,0 --speed 3", 2, "give one of --speed and --velocit"),
        ("solve --masses 1,x", 2, "write numbers with commas"),
        ("solve --masses 1,-1", 1, "cradle: --masses, value 2: -1.0; must be above 0"),
        ("solve --masses 1,1 --restitution 1.2", 1, "cradle: --restitution = 1.2; must lie in"),
        ("solve --masses 1,1,1 --velocities 1,0", 1, "--velocities, 2 given: one velocity for ea"),
        ("solve --masses 1,1,1 --model ratio", 2, "ratios need --ratio, such as 0.1"),
        ("solve --masses 1,1,1 --model spheres --ratio 0.1", 2, "--model spheres has no ratios"),
        ("solve ABCCA --model sequential --saturate", 2, "--model sequential has no ratios"),
        ("solve DBB", 1, "cradle: the ratio of ball 2 is 0.71; it must not exceed 0.5"),
        ("solve --masses 1,1,1 --ratio 0.6", 1,
         "the ratio of ball 2 is 0.6; it must not exceed 0.5 (Eq. 53):"),
        ("solve --masses 1,1,1 --ratio 0 --backward 1", 1, "the backward ratio of ball 2 is 1.0; "),
        ("solve --masses 1,1,1 --ratio 0.1,0.1", 1, "--ratio has 2 values; 3 balls need 1"),
        ("swing --masses 1,1,1 --by 5", 1, "--by = 5.0; must be above 0 and at most a quarter"),
        ("swing 3 --pull 0.05", 2,
         "--pull 0.05: it says how many of the 3 balls are pulled, 2 or 1"),
        ("swing 3 -o toy.gif --json", 2, "--output draws a film; --json, --csv and --steps are of"),
        ("swing 3 -o toy.gif --steps 9", 2, "--output draws a film; --json, --csv and --steps "),
        ("swing 3 --pull 2,2", 2, "--pull 2.0, 2.0: it says how many of the 3 balls are pulled"),
        ("swing 3 --length 1 --period 1", 2, "give one of --length and --period"),
        ("swing 3 --gaps 1,1,1", 1, "--gaps has 3 values; 3 balls need 2, or one number"),
        ("swing 3 -o toy.bmp", 1,
         "--output 'toy.bmp'; must end in .svg, .html, .gif, .mp4 or .png"),
        ("swing 3 -o toy", 1, "'toy'; must end in .svg, .html, .gif, .mp4 or .png"),
        ("swing --masses 1,0.1 --by 0.3 --length 0.2", 1, "after t = 0.2243 s ball 2 at 0.545"),
        ("swing --masses 1,1,1 --length 0", 1, "cradle: --length 0.0; must be above 0"),
        ("swing 3 --seconds 0", 1, "cradle: --seconds = 0.0; must be above 0"),
        ("recommend 3 --wanted 'path,fastest ball'", 1,
         "Give --stiffness 1 if all contacts are equal spheres"),
        ("recommend --masses 1,1,1 --wanted path,x", 1, "--wanted 'x'; must be one of"),
        ("swing ABA --speed 2", 2, "No such option '--speed'"),
        ("solve ABA --plot a.xyz", 2, "'a.xyz'; must end in .png, .svg or .pdf"),
        ("fit pairs.csv --plot a.xyz", 2, "'a.xyz'; must end in .png, .svg or .pdf"),
        ("solve 5.5", 1, "SEQUENCE = '5.5'; must be a whole number, 2 to 1000000 balls"),
        ("solve ABA --plot -", 2, "'-'; a picture goes to a file: give its name"),
        ("swing 5 --output nowhere/toy.gif", 2, "'nowhere/toy.gif'; its folder is not there"),
        (f"{BAC} --slower 0", 1, "--slower = 0.0; must be above 0"),
        (f"{BAC} --window 0", 1, "cradle: --window 0.0; must be above 0"),
        (f"{BAC} --level", 2, "give --length or --period of the pendulums, or --level: one"),
        ("film film.txt --set BAC --masses 1,1,1", 2, "give --length or --period of the pendulum"),
        (f"{BAC} --window 0.01", 1, "no moment has 4 marks of every ball within 0.01 s"),
        (f"{BAC} --position-unit px --scale 0", 1, "--scale = 0.0; must be above 0"),
        (f"{BAC} --position-unit px", 2, "--position-unit px and --scale, pixels in a metre, go t"),
        (f"{BAC} wide.txt --shot 1", 2, "--shot names one film; several have the names of their f"),
        (BAC.replace("BAC", "CAB"), 1, "track 1 is named B, --set CAB has C there"),
        (BAC.replace("film.txt", "wide.txt"), 1, "wide.txt is no UTF-8 text (byte 0); save"),
        (BAC.replace("BAC", "BA"), 1, "has 3 tracks, --set 2 types"),
        ("fit-swing swing.txt --known perod=3", 1, "--known 'perod'; must be one of period, damp"),
        ("fit-swing swing.txt --known damping=-1", 1, "--known damping: -1.0; must be at least"),
        ("fit-swing swing.txt --known gaps=0:1", 2, "--known gaps=0:1: write NAME=VALUE, once, wi"),
        ("fit-swing swing.txt --known gaps=0 --known gaps=1", 2, "--known gaps=0 gaps=1: write NA"),
        ("fit-swing swing.txt --reading 0", 1, "cradle: --reading 0.0; must be above 0"),
        ("fit-swing swing.txt --scale 2", 2, "--position-unit px and --scale, pixels in a metre, "),
        ("fit-swing swing.txt --masses 1,2", 1, "--masses has 2 values; 3 balls need 3, or one n"),
        ("recommend --masses 1,1,1 --model spheres", 2, "No such option '--model'"),
        ("fit nothing.csv", 2, "does not exist"),
        ("fit shots.csv --mass-unit g --restitution AB", 2, "write NAME=NUMBER"),
        ("fit grams.csv", 1, "grams: say --mass-unit g (or in kg indeed: say --mass-unit kg)"),
        ("fit fast.csv", 1, "cm/s: say --velocity-unit cm/s (or in m/s indeed: say --velocity-un"),
        ("fit shots.csv --without AC --predict ABX", 1, "set BAC needs the restitution of AC: sh"),
        ("fit shots.csv --without AC", 1, "give --restitution AC=E:ERROR (there are: AB)"),
        ("fit shots.csv --without ABX", 1, "no set 'ABX' to leave out; there are AB, AC, ABA, B"),
        ("fit shots.csv --without AB,AC,ABA,BAC,CAB,ACA", 1, "no set is left without AB, AC, AB"),
        ("fit shots.csv --without AB --restitution AB=1:-1", 1, "--restitution AB: -1.0; a stand"),
        ("fit shots.csv --known ABX=0.1", 2, "--known ABX: no chain has this triplet; there are"),
        ("fit pairs.csv --restitution AX=1", 2, "--restitution AX: no chain has this pair; there "),
        ("fit shots.csv --known ABA=1.2", 1, "cradle: --known ABA: 1.2; must be 0 to the bound"),
        ("fit shots.csv --predict ABA --csv", 2, "--csv prints the fitted values alone"),
        ("fit shots.csv --summary --csv", 2, "give one of --summary, --json and --csv"),
        ("fit grams.csv --json --csv", 2, "Error: give one of --json and --csv"),
        ("fit shots.csv --speed 2", 2, "--speed is that of the chain to --predict; give both"),
        ("fit exact.csv", 1, "line 2, column sigma = 0.0; must be above 0"),
        ("fit shots.csv --sigma 0.01", 1, "--sigma 0.01; the table has a column sigma: leave out"),
        ("fit shots.csv --known ABA=0.6 --predict ABA", 1, "--known ABA: 0.6; must be 0 to"),
        ("fit shots.csv --known ABA=0.1:0.2", 2, "write TRIPLET=RATIO; a known ratio has no error"),
        ("fit shots.csv --known ABA=0.1 --known ABA=0.2", 2, "--known ABA: given twice"),
        ("fit shots.csv --restitution BA=0.2", 2, "--restitution BA: set AB is fitted for it; lea"),
        ("fit pairs.csv --predict ABA", 1, "the ratio of ABA is not known (--known ABA=RATIO)"),
        ("frobnicate", 2, "No such command"),
    ],
)  # fmt: skip
@pytest.mark.usefixtures("folder")
def test_errors_end_in_one_line_and_a_code(ended, line, code, message):
    captured = ended(line, code)
    assert message in captured.err.replace("\n", " ")
    assert not captured.out
    assert "Traceback" not in captured.err


def test_a_long_fit_is_told_of(folder, monkeypatch, ended):
    """How many points were tried, from two seconds on; and at once that six ratios need minutes."""
    bar = lambda delay, **options: tqdm(**options, mininterval=0.0, delay=delay - 2.0)  # noqa: E731
    monkeypatch.setattr("tqdm.tqdm", bar)
    monkeypatch.setattr("cradle.fit.ratio", ratio)
    assert re.search(r"\d{4,} points", ended("fit shots.csv --without BAC,CAB,ACA").err)
    monkeypatch.setattr("cradle.fit.ratio", lambda *_, **__: run(["frobnicate"]))
    rows = [f"ABCDE,1,{k + 1},{'ABCDE'[k]},0.03,{1 - min(k, 1)},{k / 5},0.1" for k in range(5)]
    table = "\n".join(["set,shot,ball,type,mass,before,after,sigma", *rows])
    (folder / "five.csv").write_text(table, encoding="utf-8")
    said = ended("fit five.csv").err
    assert "6 ratios are fitted together, which takes minutes" in said


@pytest.mark.parametrize("wrong", ["--predict A", "--predict ABA --speed 0"])
@pytest.mark.usefixtures("folder")
def test_a_wrong_prediction_is_refused_before_the_fit(monkeypatch, ended, wrong):
    for name in ("restitution", "ratio"):
        fails = lambda *_, **__: pytest.fail("fitted all the same")  # noqa: E731
        monkeypatch.setattr(f"cradle.fit.{name}", fails)
    assert "must " in ended(f"fit shots.csv {wrong}").err


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


def test_a_picture_without_matplotlib_is_refused_in_words(tmp_path):
    code = (
        "import sys\n"
        "class Nowhere:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name.startswith('matplotlib'):\n"
        "            raise ModuleNotFoundError(f'No module named {name!r}', name=name)\n"
        "sys.meta_path.insert(0, Nowhere())\n"
        "from cradle.command.solve import run\n"
        "for line in ('solve 3 --plot a.png', 'swing 3 -o a.gif --seconds 1e6'):\n"
        "    try:\n        run(line.split())\n"
        "    except SystemExit as stopped:\n        assert stopped.code == 1\n"
    )
    result = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True,
                            text=True, check=True, timeout=100)  # fmt: skip
    words = "cradle: needs matplotlib, which is not installed: pip install matplotlib\n"
    assert (result.stdout, result.stderr) == ("", 2 * words)


def test_collisions_of_many_contacts_are_told_in_short():
    line = "solve --ratio 0.02 --masses 1,0.05" + ",1" * 20
    collisions = json.loads(call(f"{line} --json"))["collisions"]
    assert len(collisions) == 21
    assert f"contacts: {min(collisions)} to {max(collisions)}\n" in call(line)


def test_a_swing_that_ends_early_says_so(monkeypatch):
    """Of rows that are left out the table itself tells nothing."""
    few = functools.partial(swing.swing, max_impacts=3)
    monkeypatch.setattr("cradle.swing", few)
    arguments = shlex.split("swing --masses 1,1 --seconds 4 --steps 8 --csv")
    result = CliRunner().invoke(main, arguments, catch_exceptions=False)
    assert len(result.stdout.splitlines()) == 4  # the names, and 0, 0.5 and 1 s
    third = 5 / 4 * 2 * math.pi * math.sqrt(0.3 / 9.81)
    assert result.stderr == f"cradle: ended at {third:g} s, after 3 impacts\n"


@pytest.mark.usefixtures("folder")
def test_a_picture_has_the_name_that_was_given():
    for line in ("solve ABA --plot impact", "fit pairs.csv --plot fit"):
        call(line)
        name = line.split()[-1]
        assert Path(name).read_bytes().startswith(b"\x89PNG"), name
