"""What a newcomer meets first: the desk toy, the version, pictures, tables and plots."""

import pydoc
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from xml.etree.ElementTree import fromstring as tree_of

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from chapters import Chapter
from dop853 import integrated
from gaps import strike
from matplotlib.figure import Figure
from real_cradles import first_strikes

import cradle
from cradle import (
    Chain,
    EnergyDistribution,
    FusedChain,
    ImpulseCorrelation,
    QuadraticDissipation,
    SequentialCollisions,
    SpringChain,
    collide,
    paper_chain,
)

TOY = Chain([1] * 5, [1, 0, 0, 0, 0])


def test_the_toy_by_a_second_route(root: Path):
    """The numbers of README and landing page: from their texts, the model, another program."""
    readme = (root / "README.md").read_text(encoding="utf-8")
    sentence = readme.partition("**The last ball")[2].partition("**")[0]
    assert re.findall(r"\d+(?= %| and|,)", sentence) == ["99", "13", "7", "3", "1"]
    told = Chapter("intro").glued
    told = [told[f"desk-{ball}"] for ball in ("last", "fourth", "back", "fourth-by-ratio")]
    assert told == ["99", "13", "7", "9"]
    after = collide(TOY, SpringChain()).velocities
    assert (np.abs(after[::-1]) * 100).round().tolist() == [99, 13, 1, 3, 7]
    assert (after[:3] < 0).all()
    np.testing.assert_allclose(strike([1] * 5, np.eye(5)[0], 1, 0), after, rtol=0, atol=1e-6)
    # Mass, size, stiffness and speed cancel.
    steel = collide(Chain([0.045] * 5, [0.3, 0, 0, 0, 0]), SpringChain(1.3e10))
    np.testing.assert_allclose(steel.velocities / 0.3, after, rtol=0, atol=1e-9)


def test_the_ratio_of_three_spheres_on_five():
    """Spheres throw balls 2 and 3 back, a ratio leaves them; ball 4."""
    back, *_ = strike([1] * 3, np.eye(3)[0], 1, 0)
    five = collide(TOY, ImpulseCorrelation(-2 * back / (1 - back))).velocities
    after = strike([1] * 5, np.eye(5)[0], 1, 0)
    assert (after[1:3] < -0.01).all()
    assert abs(five[1:3]).max() < 1e-12  # and the ratio leaves them at rest
    Chapter("compliance").tells({"five-ratio": five[3], "five-spheres": after[3]})


def test_what_the_readme_says_of_the_other_answers():
    assert collide(TOY, SequentialCollisions()).velocities.tolist() == [0, 0, 0, 0, 1]
    elastic = collide(TOY, EnergyDistribution()).velocities
    np.testing.assert_allclose(elastic, collide(TOY, SpringChain()).velocities, atol=1e-7)
    lossy = Chain([1] * 5, [1, 0, 0, 0, 0], 0.97)
    assert collide(lossy, EnergyDistribution()).velocities[-1] < elastic[-1]
    with pytest.raises(ValueError, match="must be 1 for SpringChain"):
        collide(lossy, SpringChain())


def test_what_the_readme_says_of_a_filmed_cradle(root: Path):
    """Relative to the row, which still moved; and a gap of a tenth of the compression."""
    readme = " ".join((root / "README.md").read_text(encoding="utf-8").split())
    told = re.search(
        r"left with (\d+) %, its neighbour with (\d+) %, and no .* than (\d+) %", readme
    )
    *slow, fourth, last = 100 * abs(first_strikes(4)[1][0])
    assert [round(last), round(fourth)] == [int(v) for v in told.groups()[:2]]
    assert max(slow) < int(told[3]) < max(slow) + 1
    assert "a gap of a tenth of the depth" in readme
    deep, story = (5 * 0.5 / 4) ** 0.4, np.eye(5)[4]
    still, gap = (cradle.spring_velocities([1] * 5, np.eye(5)[0], gaps=g) for g in (0, deep / 10))
    assert np.mean((gap - still) / (story - still)) == pytest.approx(0.5, abs=0.1)


def test_springs_and_the_energy_law_with_high_losses():
    """Springs by SciPy as well; the least restitution that springs take."""
    least = 0.014
    for e in (0.5, 0.02):
        loss = cradle.viscosity_from(e, speed=1, masses=[1] * 5)
        after = collide(TOY, SpringChain(viscosity=loss)).velocities[-1]
        other = collide(Chain([1] * 5, TOY.velocities, e), EnergyDistribution()).velocities[-1]
        assert integrated([1] * 5, TOY.velocities, loss=loss)[-1] == pytest.approx(after, abs=1e-5)
        assert other < 0.9 * after
    assert cradle.viscosity_from(least, speed=1, masses=[1] * 5).size == 4
    with pytest.raises(ValueError, match=f"must lie in .{least}, 1"):
        cradle.viscosity_from(least - 0.001, speed=1, masses=[1] * 5)
    still = Chain([1] * 5, TOY.velocities, 0)
    assert collide(still, EnergyDistribution()).velocities == pytest.approx(0.2)


def test_version_has_one_source():
    assert cradle.__version__ == version("cradle-companion")
    with pytest.raises(AttributeError, match="module 'cradle' has no attribute 'version'"):
        _ = cradle.version


def test_the_import_loads_only_what_it_needs():
    late = {"pandas", "matplotlib", "scipy", "numba", "importlib.metadata"}
    code = f"import sys, cradle; cradle.paper_chain('ABACA'); print({late} & sys.modules.keys())"
    loaded = subprocess.check_output([sys.executable, "-c", code], text=True)
    assert loaded.strip() == "set()"


def test_help_names_types():
    """`help` has a line of names in place of what they stand for."""
    for name in cradle.__all__:
        text = pydoc.plain(pydoc.render_doc(getattr(cradle, name)))
        assert not re.search(r"_Buffer|numpy\._typing", text), name


def test_no_minus_zero_and_no_seventeen_digits():
    """Also where an engine of impulses leaves a rounding error, or an input is minus zero."""
    chain = Chain([1, 1, 1], [1, -0.0, 0])
    for model in (ImpulseCorrelation(0.0), ImpulseCorrelation(0.15), SpringChain()):
        trace = collide(chain, model)
        shown = repr(trace), trace._repr_html_(), chain._repr_html_(), repr(chain)
        for text in shown:
            assert not re.search(r"-0(\.0*)?(?![.\d])", text), text
            assert not re.search(r"\d\.\d{8}", text), text
    told = re.findall(r"-?[\d.]+", repr(collide(chain, ImpulseCorrelation(0.15))).partition("]")[0])
    exact = collide(chain, ImpulseCorrelation(0.15)).velocities
    np.testing.assert_allclose([float(x) for x in told], exact, rtol=1e-5)
    light = Chain([1, 1e-11], [1, 0])  # a small mass is no rounding error
    assert "<td>1e-11</td>" in light._repr_html_()
    assert eval(repr(light)) == light


MODELS = [
    ImpulseCorrelation(0.15),
    SequentialCollisions(),
    FusedChain(),
    SpringChain(),
    EnergyDistribution(),
    QuadraticDissipation(3.0),
]


def cells(tree) -> list[list[str]]:
    return [[cell.text or "" for cell in row] for row in tree.iter("tr")]


def test_table_of_a_chain():
    """HTML that is well formed cannot spill into a page."""
    tree = tree_of(Chain([8, 1, 1], [1, 0, -2], [1, 0.5])._repr_html_())
    assert cells(tree) == [
        ["ball", "mass (kg)", "velocity (m/s)", "restitution with the next"],
        ["0", "8", "1", "1"],
        ["1", "1", "0", "0.5"],
        ["2", "1", "-2", ""],
    ]


@pytest.mark.parametrize("model", MODELS, ids=lambda model: type(model).__name__)
def test_table_of_a_trace(model):
    trace = collide(Chain([1, 1, 1], [1, 0, 0]), model)
    tree = tree_of(trace._repr_html_())
    head, *rows = cells(tree)
    assert head[2:4] == ["before (m/s)", "after (m/s)"]
    assert [row[3] for row in rows] == [f"{v + 0.0:.6g}" for v in trace.velocities]
    assert [row[5] for row in rows] == [*map(str, trace.collisions.tolist()), ""]


def test_long_chains_are_cut():
    tree = tree_of(Chain([1] * 500, [1] + [0] * 499)._repr_html_())
    names = [row[0] for row in cells(tree)[1:]]
    assert names == [*map(str, range(6)), "...", *map(str, range(494, 500))]


@pytest.mark.parametrize("model", MODELS, ids=lambda model: type(model).__name__)
def test_frame_holds_the_path_and_momentum(model):
    trace = collide(Chain([1, 2, 0.5], [1, 0, 0]), model)
    frame = trace.to_frame()
    steps, balls = trace.path.shape
    timed = isinstance(model, SpringChain)
    assert frame.shape == (steps * balls, 8 if timed else 7)
    if timed:
        assert frame["time"].tolist() == np.repeat(trace.times, balls).tolist()
    wide = frame.pivot(index="step", columns="ball", values="velocity")
    np.testing.assert_array_equal(wide.to_numpy(), trace.path)
    # Each ball's momentum against the impulses of its own two contacts.
    mass = trace.chain.masses[frame["ball"]]
    change = mass * (frame["velocity"] - trace.chain.velocities[frame["ball"]])
    np.testing.assert_allclose(change, frame["left"] - frame["right"], rtol=0, atol=1e-12)
    events = frame[(frame["ball"] == 0) & (frame["step"] > 0)]
    assert list(zip(events["event"], events["contact"])) == list(trace.events)
    assert frame["contact"].isna().sum() == balls
    assert frame["contact"].dtype == pd.Int64Dtype()


def test_frame_of_no_impact():
    frame = collide(Chain([1, 1], [0, 1]), ImpulseCorrelation(0)).to_frame()
    assert frame["event"].tolist() == ["before", "before"]
    assert frame["velocity"].tolist() == [0, 1]


def test_plot_draws_what_figures_draw():
    trace = collide(*paper_chain("ABACA"))
    ax = Figure().subplots()
    assert trace.plot(ax) is ax
    for line, velocity in zip(ax.get_lines(), trace.path.T):
        np.testing.assert_array_equal(line.get_ydata(), velocity)
    lines = trace.plot(Figure().subplots(), contact=np.int64(2)).get_lines()
    assert [line.get_label() for line in lines[:2]] == ["$v_3$", "$v_4$"]
    np.testing.assert_array_equal(lines[0].get_xdata(), trace.path_impulses[:, 2])
    fresh = trace.plot()
    plt.close(fresh.figure)
