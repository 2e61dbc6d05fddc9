"""Every public entry point, called with what it cannot take: each argument in turn, in words.

An answer is fine where a value can be read as one that is meant.  A refusal must come from a
`raise` of the package itself: an error that Python, NumPy or SciPy meets on the way names neither
the argument nor the rule.
"""

import ast
import functools
import inspect
import traceback
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

import cradle
from cradle import (
    Chain,
    EnergyDistribution,
    FusedChain,
    ImpactNotFinished,
    ImpulseCorrelation,
    Pendulums,
    QuadraticDissipation,
    SequentialCollisions,
    SpringChain,
    closed_form,
    collide,
    fit,
    measures,
)
from cradle.pictures import animation
from cradle.pictures import impacts as figures
from cradle.row import Row, step_rows

PACKAGE = Path(cradle.__file__).parent
DATA = Path(__file__).parents[1] / "data"

THREE = Chain([1, 1, 1], [1, 0, 0])
MODEL = ImpulseCorrelation(0.15)
TRACE = collide(THREE, MODEL)
RUN = cradle.swing(THREE, MODEL, [-0.02, 0, 0], [0.0, 0.1, 0.2])


class Still:
    """Bodies that no engine moves."""

    def motion(self):
        return [[0.0, 0.0], [0.3, 0.0], [0.6, 0.0]], [[0.0, 0.0]] * 3

    def push(self, ball, impulse):
        raise AssertionError

    def advance(self, step):
        pass


BALLS = {"masses": [1, 1, 1], "velocities": [1, 0, 0], "restitution": 1}
RATIOS = {"forward": 0.1, "backward": 0.1, "meeting": 0.5, "excess": "raise", "max_events": 100}
SPRINGS = {"stiffness": 1, "exponent": 1.5}
MANY = {"masses": [1, 1, 1], "velocities": [1, 0, 0], "progress": False}
FORCES = SPRINGS | {"viscosity": 0.01, "gaps": 0.1, "accuracy": 1e-2}
PENDULUMS = {"length": 0.1, "gravity": 9.81, "gaps": 0.0, "damping": 0.0, "angle": "small"}
SHOTS = fit.read_shots(DATA / "shots_synthetic.csv", velocity_unit="m/s")

#: Entry points and arguments that they can take.
ENTRIES = {
    Chain: BALLS,
    collide: {"chain": THREE, "model": MODEL, "record": True, "progress": False},
    ImpulseCorrelation: RATIOS,
    SequentialCollisions: {"order": "left", "max_events": 100},
    FusedChain: {},
    cradle.SpeedDependent: {"model": MODEL, "restitution": cradle.ConstantLoss(0.1)},
    cradle.ConstantLoss: {"speed": 0.1},
    cradle.ViscousLoss: {"viscosity": 1e-3, "masses": [1, 1]} | SPRINGS,
    SpringChain: FORCES | {"max_steps": 10_000},
    EnergyDistribution: SPRINGS | {"rtol": 1e-6, "max_evaluations": 10_000},
    cradle.spring_velocities: MANY | FORCES,
    cradle.spring_outcomes: MANY | FORCES,
    cradle.hertz_stiffness: {"radii": [0.01, 0.01], "young": 1e9, "poisson": 0.3},
    cradle.viscosity_from: {"restitution": 0.9, "speed": 1, "masses": [1, 1], "stiffness": 1},
    QuadraticDissipation: {"coefficients": 3, "max_problems": 10},
    cradle.post_impact_velocities: BALLS | RATIOS | {"progress": False},
    cradle.outcomes: BALLS | RATIOS | {"progress": False},
    cradle.paper_chain: {"sequence": "ABC", "speed": 1.0, "excess": "saturate"},
    cradle.recommend: {
        "chain": THREE, "wanted": "velocities", "accuracy": 1e-3, "model_error": 0.5, "impacts": 1,
        "ratios": 0.167, "stiffness": 1.0,
    },
    Pendulums: PENDULUMS,
    cradle.swing: {
        "chain": THREE, "model": MODEL, "positions": [-0.02, 0, 0], "times": [0, 0.1],
        "pendulums": Pendulums(), "max_impacts": 10,
    },
    Row: {
        "bodies": Still(), "chain": THREE, "model": MODEL, "radii": 0.1,
        "pivots": [[0, 1], [0.3, 1], [0.6, 1]], "touching": 1e-4, "resting": 1e-4,
        "acceleration": 9.81,
    },
    Row(Still(), THREE, MODEL, 0.1).step: {"duration": 0.01},
    step_rows: {"rows": [Row(Still(), THREE, MODEL, 0.1)], "duration": 0.01},
    TRACE.plot: {"ax": Figure().subplots(), "contact": 0},
    measures.bouncing_pattern: {"velocities": [0, 0, 1]},
    measures.condition_number: {"chain": THREE, "model": MODEL, "step": 1e-6},
    measures.effective_ratio: {"trace": TRACE},
    closed_form.three_balls: BALLS | {"restitution": [1, 1], "ratio": 0.1},
    closed_form.final_impulses: BALLS | {"restitution": [1, 1], "ratio": 0.1},
    closed_form.one_collision_each: BALLS | {"restitution": [1, 1], "ratio": 0.1},
    closed_form.largest_ratios: {"masses": [1, 1, 1], "forward": [0.1], "backward": [0.1]},
    closed_form.back_impact_line: {"r2": 1, "e2": 1, "e3": 1, "ratio": 0.1},
    closed_form.first_ball_stops: {"e2": 0.9, "ratio": 0.1},
    closed_form.middle_ball_stops: {"e3": 0.9, "ratio": 0.1},
    animation.animate_swing: {
        "runs": RUN, "labels": ["a"], "speed": 1.0, "still": 0.0, "columns": 1, "alt": "a",
    },
    figures.velocities: {"trace": TRACE, "ax": Figure().subplots()},
    figures.velocity_impulse: {"trace": TRACE, "contact": 0, "ax": Figure().subplots()},
}  # fmt: skip

#: Formulas as they stand in the paper; their documentation says that ranges are not checked.
UNCHECKED = {closed_form.three_balls, closed_form.final_impulses, closed_form.one_collision_each}

#: What no argument takes as it is, or only few.
BAD = [
    None, True, "text", "", b"12", 1j, -1, 0, -0.5, 1.5, 2, 1e400, -1e400, float("nan"), 10**400,
    1e-320, 1e308, [], [[]], [None], ["a"], [1], [1, 2], [1, 2, 3, 4], [1, -1, 1], [[1, 2], [3]],
    [float("nan")] * 3, [1e300] * 3, [1, 1e-300, 1], np.ones((2, 2)), np.ones((0, 3)),
    np.array(["a"] * 3), np.ma.masked, {}, {"a": 1}, {1, 2}, object(), Chain, lambda: None, THREE,
    MODEL, TRACE, slice(None), range(3), (x for x in "ab"),
]  # fmt: skip


@functools.cache
def raising_lines(path: str) -> frozenset[int]:
    """Lines of a file that belong to a `raise`."""
    tree = ast.parse(Path(path).read_text(encoding="utf-8"))
    return frozenset(
        line
        for node in ast.walk(tree)
        if isinstance(node, ast.Raise)
        for line in range(node.lineno, node.end_lineno + 1)
    )


def fault(call, arguments) -> str:
    """Say what is wrong with how a call ends; nothing if it is right."""
    try:
        call(**arguments)
    except (ValueError, TypeError, ImpactNotFinished) as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        own = Path(last.filename).is_relative_to(PACKAGE)
        if own and last.lineno in raising_lines(last.filename):
            return ""
        return f"{Path(last.filename).name}:{last.lineno} {type(error).__name__}: {error}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


CASES = [
    pytest.param(call, arguments, name, id=f"{call.__qualname__}-{name}")
    for call, arguments in ENTRIES.items()
    for name in arguments
]


@pytest.mark.filterwarnings("ignore:radii")  # no row hangs so far apart
@pytest.mark.parametrize(("call", "arguments", "name"), CASES)
def test_what_is_wrong_is_refused_in_words(call, arguments, name, monkeypatch):
    monkeypatch.setenv("CRADLE_KERNEL", "plain")
    free = "ignore" if call in UNCHECKED else None
    with np.errstate(all=free), matplotlib.rc_context({"figure.max_open_warning": 0}):
        call(**arguments)
        faults = {}
        for bad in BAD:
            if found := fault(call, arguments | {name: bad}):
                faults[repr(bad)[:40]] = found[:160]
        matplotlib.pyplot.close("all")
    assert not faults


def own(thing):
    """The objects of the package's own classes in what a call returns."""
    if isinstance(thing, (tuple, list, dict)):
        for part in thing.values() if isinstance(thing, dict) else thing:
            yield from own(part)
    if type(thing).__module__.startswith("cradle"):
        yield thing
        yield from (one for field in getattr(thing, "__dict__", {}).values() for one in own(field))


@pytest.mark.filterwarnings("ignore:radii")
@pytest.mark.parametrize("call", ENTRIES)
def test_what_is_returned_can_be_compared(call):
    """By its values or as an object, but never by arrays, whose truth is ambiguous."""
    with matplotlib.rc_context({"figure.max_open_warning": 0}):
        found = [list(own(call(**ENTRIES[call]))) for _ in range(2)]
        matplotlib.pyplot.close("all")
    for one, other in zip(*found, strict=True):
        assert one in [one]
        assert (one == other) is not (one != other)


def test_no_entry_point_is_missing():
    """All that `cradle` exports is called here, but for results and what takes no argument."""
    results = {
        "DissipationTrace", "EnergyTrace", "Event", "Impact", "ImpactNotCertified", "Model",
        "ImpactNotFinished", "Outcomes", "Recommendation", "Swing",
        "TimedTrace", "Trace",
    }  # fmt: skip
    nothing = {"paper_sequences", "ratio_table", "restitution_table", "warm_up"}
    called = {call.__name__ for call in ENTRIES}
    assert set(cradle.__all__) - called == results | nothing
    for module in (measures, closed_form, animation):
        own = {
            name
            for name, thing in vars(module).items()
            if inspect.isfunction(thing) and thing.__module__ == module.__name__
        }
        assert {name for name in own if name[0] != "_"} <= called, module.__name__
