"""The programs in examples/: a mended cradle in each engine, against `swing` and `collide`."""

import ast
import importlib
import json
import math
import re
import runpy
from pathlib import Path

import numpy as np
import pytest

from cradle import Chain, ImpulseCorrelation, Pendulums, SpringChain, collide, swing
from cradle.row import Row

EXAMPLES = Path(__file__).parents[1] / "examples"
PROGRAMS = {
    "pymunk_cradle": "pymunk",
    "box2d_cradle": "Box2D",
    "bullet_cradle": "pybullet",
    "rapier_cradle": "rapier3d",
    "mujoco_cradle": "mujoco",
}
DISTRIBUTIONS = {"Box2D": "box2d"}
STEP, GRAVITY = 1e-3, 9.81
LAW = ImpulseCorrelation(0.1325)
#: Relative rounding of an engine's numbers: Box2D and Rapier have single precision.
SINGLE = 1e-5

# Box2D's bindings, made by SWIG, warn when they are imported.
pytestmark = pytest.mark.filterwarnings("ignore:builtin type:DeprecationWarning")


def test_every_program_is_here():
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(PROGRAMS)


def motion(bodies):
    """Positions and velocities as arrays."""
    return (np.array(part, float) for part in bodies.motion())


@pytest.fixture(params=PROGRAMS)
def program(request):
    """A program as a module, if its engine is installed."""
    module = PROGRAMS[request.param]
    name = DISTRIBUTIONS.get(module, module)
    pytest.importorskip(module, reason=f'{name} is not installed; pip install -e ".[engines]"')
    return importlib.import_module(request.param)


def energies(program, bodies):
    """Each ball's energy above its lowest point, J."""
    x, v = motion(bodies)
    height = x[:, 1] + program.LENGTH
    return program.MASS * (0.5 * (v**2).sum(axis=1) + GRAVITY * height)


def closed(bodies):
    getattr(bodies, "close", lambda: None)()


def test_an_adapter_tells_and_does_what_a_row_asks(program):
    bodies = program.hang(pulled=2, angle=0.3)
    x, v = motion(bodies)
    angle = np.array([-0.3, -0.3, 0, 0, 0])
    arms = program.LENGTH * np.column_stack([np.sin(angle), -np.cos(angle)])
    pivots = np.column_stack([2 * program.RADIUS * np.arange(5), np.zeros(5)])
    np.testing.assert_allclose(x, pivots + arms, atol=SINGLE)
    np.testing.assert_allclose(v, 0, atol=SINGLE)
    # Along the arc: the string takes no part of these.
    bodies.push(4, (0.25, 0.0))
    bodies.push(1, (0.5 * math.cos(0.3), -0.5 * math.sin(0.3)))
    _, v = motion(bodies)
    expected = np.zeros((5, 2))
    expected[4, 0] = 0.25 / program.MASS
    expected[1] = 0.5 * math.cos(0.3) / program.MASS, -0.5 * math.sin(0.3) / program.MASS
    np.testing.assert_allclose(v, expected, atol=SINGLE)
    bodies.advance(STEP)
    moved = np.array(bodies.motion()[0], float)[4] - x[4]
    np.testing.assert_allclose(moved, [0.25 * STEP, 0], atol=0.05 * 0.25 * STEP)
    closed(bodies)


def test_one_impact_is_that_of_collide(program):
    """Velocities, and with them momentum and energy, from the model and back into the engine."""
    bodies = program.hang(pulled=0)
    row = program.mended(bodies, LAW)
    bodies.push(0, (1.5, 0.0))
    row.step(STEP)
    _, v = motion(bodies)
    expected = collide(Chain([1] * 5, [1.5, 0, 0, 0, 0]), LAW).velocities
    np.testing.assert_allclose(v[:, 0], expected, atol=5e-5)
    rise = expected**2 / program.LENGTH * STEP  # up the arc, for one step
    np.testing.assert_allclose(v[:, 1], 0, atol=2 * rise.max())
    assert row.impacts == 1
    closed(bodies)


@pytest.mark.parametrize("pulled", [1, 2])
def test_ten_strokes(program, pulled):
    """Energy, order and who moves: as `swing` has it, but for what the engine itself loses."""
    period = Pendulums(length=program.LENGTH, gravity=GRAVITY).natural_frequency(1)[0]
    duration = 10.5 * math.pi / period
    alone = program.hang(pulled=5)
    bodies = program.hang(pulled)
    row = program.mended(bodies, LAW)
    start, started = energies(program, bodies), energies(program, alone)
    least = 0.0
    for _ in range(round(duration / STEP)):
        row.step(STEP)
        alone.advance(STEP)
        x = np.array(bodies.motion()[0], float)
        least = min(least, (np.hypot(*np.diff(x, axis=0).T) - 2 * program.RADIUS).min())
    lost = 1 - energies(program, alone).sum() / started.sum()
    kept = energies(program, bodies) / start.sum()
    assert kept.sum() == pytest.approx(1 - lost, abs=3e-3)
    hanging = Pendulums(length=program.LENGTH, gravity=GRAVITY, angle="full")
    angles = [-program.ANGLE] * pulled + [0.0] * (5 - pulled)
    run = swing(
        Chain([1] * 5, [0] * 5), LAW, angles, [0, duration],
        pendulums=hanging,
    )  # fmt: skip
    each = 0.5 * run.velocities[-1] ** 2 + 2 * GRAVITY * np.sin(run.positions[-1] / 2) ** 2
    np.testing.assert_allclose(kept / kept.sum(), each / each.sum(), atol=0.015)
    # No ball passes its neighbour, nor enters it by more than is taken for touching.
    assert least > -3 * row.touching
    assert row.impacts < 20 * 10
    closed(bodies)
    closed(alone)


@pytest.mark.parametrize("program", ["pymunk_cradle", "box2d_cradle"], indirect=True)
@pytest.mark.parametrize(
    "masses", [(1.0, 2.0, 0.5, 1.0, 3.0), (3.0, 1.0, 2.0, 0.5, 1.0), (0.2, 1.0, 0.3, 2.0, 1.0)]
)
def test_the_first_stroke_of_different_masses(program, masses):
    """The page "Newton's cradle in your engine" says so."""
    bodies, law = program.hang(), SpringChain(1e10)
    for ball, mass in zip(bodies.balls, masses, strict=True):
        ball.mass = mass
    pivots = [(2 * program.RADIUS * i, 0) for i in range(5)]
    row = Row(bodies, Chain(masses, [0] * 5), law, program.RADIUS, pivots)
    for _ in range(1000):  # to the turning point
        row.step(STEP)
    hanging = Pendulums(length=program.LENGTH, gravity=GRAVITY, angle="full")
    angles = [-program.ANGLE, 0, 0, 0, 0]
    run = swing(Chain(masses, [0] * 5), law, angles, [1.0], pendulums=hanging)
    x = np.array(bodies.motion()[0], float)[:, 0] - 2 * program.RADIUS * np.arange(5)
    np.testing.assert_allclose(np.arcsin(x / program.LENGTH), run.positions[0], atol=1e-3)


def test_an_engine_alone_moves_its_balls_otherwise(program):
    """Without the mend the engine's own contacts act: with the mend they are off."""
    own, mended = program.hang(mend=False), program.hang()
    for _ in range(1000):
        own.advance(STEP)
        mended.advance(STEP)  # by the engine alone: the balls pass through each other
    assert energies(program, own)[1:].sum() > 0.1
    assert energies(program, mended)[1:].sum() < 1e-6
    closed(own)
    closed(mended)


def test_hanging_balls_are_looked_at_every_hundredth_of_a_second(program):
    """A step with the row then costs little more than one of the engine."""
    bodies = program.hang(pulled=0)
    row = program.mended(bodies, LAW)
    looks, motion = [], bodies.motion
    bodies.motion = lambda: looks.append(1) or motion()
    for _ in range(1000):
        row.step(STEP)
    assert len(looks) <= 101
    assert row.impacts == 0
    closed(bodies)


def test_the_program_runs_as_it_stands(program, root, capsys):
    runpy.run_path(str(EXAMPLES / f"{program.__name__}.py"), run_name="__main__")
    table = np.array([line.split() for line in capsys.readouterr().out.splitlines()[-11:]], float)
    assert table.shape == (11, 5)
    np.testing.assert_allclose(table[0], [-0.5, 0, 0, 0, 0], atol=1e-3)
    # After a second the last ball is out, the first one is back with the others.
    assert table[2, 4] > 0.45
    assert np.abs(table[2, :4]).max() < 0.06
    assert np.abs(table).max() < 0.505
    if program.__name__ == "pymunk_cradle":  # the page has its first lines
        page = json.loads((root / "book" / "recipe.ipynb").read_text("utf-8"))
        text = "".join("".join(cell["source"]) for cell in page["cells"])
        (lines,) = re.findall(r"```text\n(.*?)```", text, flags=re.DOTALL)
        told = np.array([line.split() for line in lines.splitlines()], float)
        np.testing.assert_allclose(table[: len(told)], told, atol=2e-3)


@pytest.mark.parametrize("program", ["pymunk_cradle", "box2d_cradle"], indirect=True)
def test_pairs_take_the_place_of_the_row(program, root, capsys):
    """The page's lines, with all left out of the program that it says."""
    page = json.loads((root / "book" / "recipe.ipynb").read_text("utf-8"))
    text = "".join("".join(cell["source"]) for cell in page["cells"])
    (lines,) = re.findall(r"```python\n(bodies = hang.*?)```", text, flags=re.DOTALL)
    gap, told = re.search(r"gap=(\S+)\)  # \S+ of a diameter: (\d+) µm", lines).groups()
    assert 2e6 * program.RADIUS * float(gap) == pytest.approx(float(told))
    tree = ast.parse((EXAMPLES / f"{program.__name__}.py").read_text("utf-8"))
    kept = [
        part
        for part in tree.body
        if not isinstance(part, ast.If)
        and "cradle" not in getattr(part, "module", "")
        and getattr(part, "name", "") != "mended"
        and "TOY" not in ast.unparse(part)
    ]
    assert len(tree.body) - len(kept) >= 4
    exec(ast.unparse(ast.Module(kept, [])) + "\n" + lines, {})
    table = np.array([ast.literal_eval(line) for line in capsys.readouterr().out.splitlines()])
    assert table.shape == (11, 5)
    np.testing.assert_allclose(table[0], [-0.5, 0, 0, 0, 0], atol=1e-3)
    assert table[2, 4] > 0.45
    assert np.abs(table[2, :4]).max() < 0.06
