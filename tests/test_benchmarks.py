"""The benchmark suite: its quick form runs, its rows are sound, engines repeat what is stored."""

import csv
import importlib.util

import engines
import measure
import numpy as np
import pytest
import run
import savings
import scenes
import solvers
from chains import HERTZ, LINEAR
from stored import read
from verlet import verlet

from cradle.closed_form import three_balls

CLOCK = measure.Clock(repeats=1)


@pytest.fixture(scope="module")
def rows():
    """All rows of the quick form but those of the engines, each timed once."""
    return [*solvers.rows(CLOCK, True), *savings.rows(CLOCK, True)]


def test_every_group_has_rows_and_errors_are_those_of_its_kind(rows):
    """Rigid models are exact and keep momentum; error control keeps what it is asked for."""
    groups = {row.group for row in rows}
    assert groups == {
        "event", "march", "springs", "penalty", "stiffness", "energy", "outcome", "saving",
        "many springs",
    }  # fmt: skip
    for row in rows:
        assert row.time_ratio > 0
        assert "" not in (row.gives, row.needs, row.versions)
        if row.group in ("event", "saving"):
            assert row.numerical_error < (1e-6 if "float32" in row.setting else 1e-13), row.setting
            assert row.momentum_error == "" or row.momentum_error < 1e-13
        if row.group == "springs":
            assert row.numerical_error < 10 * row.parameter, row.setting


@pytest.mark.parametrize(
    ("group", "text", "order"),
    [("march", "three equal", 0.8), ("penalty", "a contact", 1.8), ("energy", "step", 0.8)],
)
def test_fixed_steps_converge(rows, group, text, order):
    found = [r for r in rows if r.group == group and text in r.setting + r.chain]
    for law in {row.model for row in found}:
        series = [row for row in found if row.model == law]
        steps, errors = np.log([[r.parameter, r.numerical_error] for r in series]).T
        assert len(series) > 1
        assert np.polyfit(steps, errors, 1)[0] > order, law


@pytest.mark.parametrize("step", [0.5, 0.1, 0.01])
def test_penalty_gives_the_outcome_of_velocity_verlet(step):
    """Half a kick, the drift, half a kick, as textbooks have it."""
    m, start = np.array([1.0, 0.5, 2.0]), np.array([1.0, 0.0, 0.0])
    v, d, force, steps = start.copy(), np.zeros(2), np.zeros(2), 0
    while steps == 0 or (d > 0).any() or (np.diff(v) < 0).any():
        steps += 1
        v += 0.5 * step * np.diff(-force, prepend=0, append=0) / m
        d -= step * np.diff(v)
        force = np.maximum(d, 0.0) ** 1.5
        v += 0.5 * step * np.diff(-force, prepend=0, append=0) / m
    (after,), count = verlet(m[None], start[None], 1.0, 1.5, 0.0, step, 0.0)
    np.testing.assert_allclose(after, v, rtol=0, atol=1e-13)
    assert count == steps


def test_truths_by_a_second_route():
    """Eqs. 30-33 for three balls; converged springs for the elastic scenes, from elsewhere."""
    scene = scenes.SCENES["three equal"]
    exact = three_balls(scene.masses, scene.velocities, scene.restitution, 0.167)
    np.testing.assert_allclose(scene.truth(), exact, rtol=0, atol=1e-15)
    for name, expected in HERTZ.items():
        np.testing.assert_allclose(scenes.SCENES[name].springs(), expected, rtol=0, atol=6e-10)
    linear = scenes.SCENES["three equal"].springs(1)
    np.testing.assert_allclose(linear, LINEAR["three equal"], atol=6e-10)


def test_quick_form_writes_its_table(tmp_path, monkeypatch, rows, capsys):
    monkeypatch.setattr(run, "Clock", lambda **_: CLOCK)  # the one that timed these rows
    monkeypatch.setattr(run.solvers, "rows", lambda *_: iter(rows))
    monkeypatch.setattr(run.savings, "rows", lambda *_: iter(()))
    monkeypatch.setattr(engines, "ENGINES", ())
    run.main(["--quick", "--output", str(tmp_path)])
    with (tmp_path / "benchmarks.csv").open(encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    assert list(table[0]) == measure.COLUMNS
    assert len(table) == len(rows)
    # Times and ratios tell the same, whatever the processor's clock did meanwhile.
    units = [float(row["microseconds"]) / float(row["time_ratio"]) for row in table]
    np.testing.assert_allclose(units, units[0], rtol=2e-3)
    assert units[0] > 0
    assert f"{len(rows)} rows" in capsys.readouterr().out


def test_absent_engines_are_named_and_skipped(monkeypatch):
    find = importlib.util.find_spec
    hidden = {engine.module for engine in engines.ENGINES}
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *a: None if name in hidden else find(name, *a)
    )
    assert list(measure.absent(engines.ENGINES)) == [engine.name for engine in engines.ENGINES]
    assert all("is not installed" in reason for reason in measure.absent(engines.ENGINES).values())
    assert list(engines.rows(CLOCK, True)) == []


def named(name):
    """The engine of that name, if it is installed."""
    if name in measure.absent(engines.ENGINES):
        pytest.skip(measure.absent(engines.ENGINES)[name])
    return next(engine for engine in engines.ENGINES if engine.name == name)


@pytest.fixture(params=[engine.name for engine in engines.ENGINES])
def engine(request):
    return named(request.param)


# Box2D's bindings, made by SWIG, warn when they are imported.
@pytest.mark.filterwarnings("ignore:builtin type:DeprecationWarning")
def test_engine_exchanges_the_velocities_of_two_balls(engine):
    for scene in engines.CHECKS.values():
        e = scene.restitution[0]
        _, after = engines.solve(engine, scene, "touching", "refined")
        np.testing.assert_allclose(after, [(1 - e) / 2, (1 + e) / 2], atol=1e-3)


@pytest.mark.filterwarnings("ignore:builtin type:DeprecationWarning")
@pytest.mark.parametrize("setting", ["default", "refined"])
def test_engine_repeats_what_is_stored(engine, setting):
    """Same version, same velocities; another version may differ, and is only asked for momentum."""
    same_version = measure.versions(engine.distribution).split("; ")[0]
    for name in ("three equal", "five equal", "light middle"):
        scene = scenes.SCENES[name]
        _, after = engines.solve(engine, scene, "touching", setting)
        assert abs(np.dot(scene.masses, after) / scene.masses[0] - 1) < 1e-5
        same = {"model": engine.name, "setting": f"{setting}, touching", "chain": name}
        (row,) = read("benchmarks.csv", group="engine", **same)
        if row["versions"].startswith(same_version):
            expected = [float(v) for v in row["velocities"].split()]
            np.testing.assert_allclose(after, expected, rtol=0, atol=1e-4)


def energy(engine, scene, placement, **options):
    """Kinetic energy after an impact, over that before."""
    line = engines.Line(scene.masses, scene.restitution, placement)
    _, v = engines.run(engine.scene(line, **options), options["step"], 3.0)
    m = np.array(scene.masses)
    return m @ (v / engines.SPEED) ** 2 / m[0]


def test_bullet_gains_energy_by_its_correction_of_overlaps():
    bullet = named("Bullet")
    for scene in (engines.CHECKS["two equal, e = 1"], scenes.SCENES["light middle"]):
        assert energy(bullet, scene, "apart", **bullet.default) > 1.05
        without = bullet.default | {"contactERP": 0.0}
        assert energy(bullet, scene, "apart", **without) < 1 + 1e-6


@pytest.mark.parametrize(
    ("step", "iterations", "inner"), [(1e-2, 4, 1), (1e-3, 50, 1), (1e-3, 4, 100)]
)
def test_rapier_loses_a_sixth_whatever_the_step_and_iterations(step, iterations, inner):
    options = {"step": step, "iterations": iterations, "num_internal_pgs_iterations": inner}
    left = energy(named("Rapier"), scenes.SCENES["three equal"], "pressed", **options)
    assert left == pytest.approx(5 / 6, abs=2e-3)


@pytest.mark.filterwarnings("ignore:builtin type:DeprecationWarning")
def test_box2d_cuts_off_slow_rebounds():
    box2d, scene = named("Box2D"), engines.CHECKS["two equal, e = 1"]
    for faster, left in ((1.0, 1.0), (0.4, 0.5)):  # 2 m/s, and 0.8 m/s: below the threshold
        options = {"step": 1e-3, "iterations": 8, "faster": faster}
        assert energy(box2d, scene, "touching", **options) == pytest.approx(left, abs=1e-5)
