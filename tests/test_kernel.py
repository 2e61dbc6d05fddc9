"""One source, two runtimes: the kernel compiled and as it stands give the same bits."""

import ast
import builtins
import sys
from pathlib import Path

import numpy as np
import pytest
from chains import random_chains, uniform, with_ends

from cradle import Chain, ImpactNotFinished, ImpulseCorrelation, collide, kernel, runtime
from cradle import post_impact_velocities as batch

FIELDS = ("velocities", "impulses", "absorbed", "collisions", "path", "path_impulses")


@pytest.fixture
def plain(monkeypatch):
    """Switch to the kernel as it stands when called; back with `plain(False)`."""

    def switch(on=True):
        if on:
            monkeypatch.setenv(runtime.VARIABLE, "plain")
        else:
            monkeypatch.delenv(runtime.VARIABLE, raising=False)

    switch(False)
    return switch


needs_numba = pytest.mark.skipif(runtime.compiled() is None, reason="numba is not installed")


def mixed_chains(seed, count):
    """Chains of 2 to 8 balls over two decades of mass, with ends of all ranges and ties."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        n = 2 + k % 7
        chain = [part[0] for part in random_chains(rng, 1, n, decades=2)]
        if k % 3 == 0:
            chain[0], chain[1] = np.ones(n), rng.choice([0.0, 0.0, 0.5, 1.0, -1.0], n)
        if k % 2:
            chain[3], chain[4] = with_ends(rng)((2, n - 2))
        yield chain, {"meeting": [0.5, 0.0, 1.0, 0.3][k % 4], "excess": "saturate"}


def outcome(chain, options):
    """The trace, unfinished or not: the limit is low, and both must reach it alike."""
    m, v, e, f, b = chain
    try:
        return True, collide(Chain(m, v, e), ImpulseCorrelation(f, b, max_events=2000, **options))
    except ImpactNotFinished as stopped:
        return False, stopped.trace


@needs_numba
def test_compiled_and_plain_traces_are_equal_to_the_last_bit(plain):
    finished = 0
    for chain, options in mixed_chains(1, 500):
        plain(False)
        assert runtime.chosen() is runtime.compiled()
        done, one = outcome(chain, options)
        plain(True)
        assert runtime.chosen() is kernel
        also_done, other = outcome(chain, options)
        assert done == also_done
        finished += done
        for name in FIELDS:
            left, right = getattr(one, name), getattr(other, name)
            assert left.dtype == right.dtype
            assert left.shape == right.shape
            assert left.tobytes() == right.tobytes(), name
        assert one.events == other.events
        assert one.collapsed is other.collapsed
        assert one.saturated == other.saturated
        assert one.energy_loss == other.energy_loss
    assert finished > 450


@needs_numba
@pytest.mark.parametrize("n", [2, 3, 5])
def test_compiled_and_plain_batches_are_equal_to_the_last_bit(plain, n):
    m, v, e, f, b = random_chains(np.random.default_rng(n), 60, n, decades=2)
    arguments = m.reshape(6, 10, n), v[:10], e[:10], f.reshape(6, 10, n - 2), b[0]
    compiled = batch(*arguments, excess="saturate")
    plain()
    assert batch(*arguments, excess="saturate").tobytes() == compiled.tobytes()


@needs_numba
def test_both_give_up_in_a_batch(plain):
    for on in (False, True):
        plain(on)
        with pytest.raises(ImpactNotFinished, match="max_events = 20"):
            batch([[1, 1, 1], [1, 1e-6, 1]], [1, 0, 0], 1, 0.0, max_events=20)


def test_without_numba_everything_works(monkeypatch):
    """Where no wheel of numba exists the import fails; the kernel then runs as it stands."""
    expected = collide(Chain([1, 0.01, 1], [1, 0, 0], 0.9), ImpulseCorrelation(0.15))
    monkeypatch.delenv(runtime.VARIABLE, raising=False)
    monkeypatch.setitem(sys.modules, "numba", None)
    runtime.compiled.cache_clear()
    try:
        assert runtime.compiled() is None
        assert runtime.chosen() is kernel
        trace = collide(Chain([1, 0.01, 1], [1, 0, 0], 0.9), ImpulseCorrelation(0.15))
        assert trace.velocities.tobytes() == expected.velocities.tobytes()
        assert trace.events == expected.events
        after = batch([1, 0.01, 1], [[1, 0, 0], [2, 0, 0]], 0.9, 0.15)
        assert after[0].tobytes() == expected.velocities.tobytes()
    finally:
        runtime.compiled.cache_clear()


# What the kernel is made of: scalars, loops, sequences and `math`. No classes, exceptions,
# containers, slices, comprehensions or keyword arguments: numba or MicroPython lacks them, or they
# allocate.
PLAIN = (
    *(ast.Module, ast.FunctionDef, ast.arguments, ast.arg, ast.Return, ast.Import, ast.alias),
    *(ast.For, ast.While, ast.If, ast.Break, ast.Continue, ast.Pass),
    *(ast.Expr, ast.Assign, ast.AugAssign, ast.Name, ast.Constant, ast.Tuple, ast.Subscript),
    *(ast.BinOp, ast.BoolOp, ast.UnaryOp, ast.Compare, ast.IfExp, ast.Call, ast.Attribute),
    *(ast.operator, ast.boolop, ast.unaryop, ast.cmpop, ast.expr_context),
)
# All names in MicroPython's `math`; the built-in functions that the kernel needs.
MATH = {
    *("acos", "asin", "atan", "atan2", "ceil", "copysign", "cos", "degrees", "e", "exp", "fabs"),
    *("floor", "fmod", "frexp", "inf", "isfinite", "isinf", "isnan", "ldexp", "log", "modf"),
    *("nan", "pi", "pow", "radians", "sin", "sqrt", "tan", "trunc"),
}
BUILT_IN = {"abs", "globals", "len", "max", "min", "range"}
# Without `_`, which running examples of docstrings leave there.
OTHER_BUILT_IN = set(dir(builtins)) - BUILT_IN - {"_"}


def not_plain(source):
    """What a source has that the kernel may not have."""

    def plain(node):
        match node:
            case ast.Import(names=names):
                return [alias.name for alias in names] == ["math"]
            case ast.Attribute(value=value, attr=name):
                return isinstance(value, ast.Name) and value.id == "math" and name in MATH
            case ast.Name(id=name):
                return name not in OTHER_BUILT_IN
            case ast.Call(func=function):
                return isinstance(function, ast.Name | ast.Attribute)
            case ast.Constant(value=value):
                return isinstance(value, int | float | str)
            case ast.MatMult():
                return False
        return isinstance(node, PLAIN)

    return [ast.unparse(node) for node in ast.walk(ast.parse(source)) if not plain(node)]


def test_the_kernel_stays_plain():
    """What lets one file run in three places."""
    assert not_plain(Path(kernel.__file__).read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "source",
    [
        "import numpy", "import math, sys", "from math import sqrt", "class A: pass", "raise f",
        "try:\n    f\nexcept A:\n    g", "with f:\n    g", "assert f", "x = [1]", "x = {}",
        "x = [y for y in z]", "x = lambda: 1", "x = y[1:2]", "def f(*, x): return f(x=1)",
        "x = math.hypot(1, 2)", "x = y.copy()", "x = sum(y)", "x = f(y)[0]()", "x = 1j",
        "x = f'{y}'", "def f():\n    yield 1", "def f():\n    global x", "x = (y := 1)",
        "x @ y",
    ],
)  # fmt: skip
def test_what_is_not_plain_is_seen(source):
    assert not_plain(source)


def test_work_area_need_not_be_cleared():
    """Outputs and work area are the caller's: what an earlier impact left must not matter."""
    rng = np.random.default_rng(3)
    n = 5
    area = [np.full(n, 7.5), *(np.full(n - 1, 7.5) for _ in range(2))]
    counts = [np.full(n - 1, 3) for _ in range(2)]
    floats = uniform(rng, -1, 1, (kernel.FLOATS, n))
    ints = rng.integers(-1, 2, (kernel.INTS, n))
    for chain, options in mixed_chains(9, 70):
        m, v, e, f, b = chain
        if len(m) != n:
            continue
        expected = collide(Chain(m, v, e), ImpulseCorrelation(f, b, **options))
        lists = [part.tolist() for part in (*area, *counts, floats, ints)]
        empty = [[], [], [[0.0] * n], [[0.0] * (n - 1)]]
        inputs = [part.tolist() for part in (m, v, e, f, b)]
        status, count, collapsed = kernel.impact(
            n, *inputs, options["meeting"], 10**6, *lists, *empty
        )
        assert status == kernel.FINISHED
        # Without a record the maximum compressions are not looked for.
        assert count == sum(event.kind != "maximum_compression" for event in expected.events)
        assert bool(collapsed) == expected.collapsed
        assert lists[0] == expected.velocities.tolist()
        assert lists[1] == expected.impulses.tolist()
        assert lists[2] == expected.absorbed.tolist()
        assert lists[3] == expected.collisions.tolist()
        assert [c for c in range(n - 1) if lists[4][c]] == list(expected.saturated)
