"""One source, two runtimes: the rooms compiled and as they stand give the same bits."""

import ast
import builtins
import contextlib
import functools
import logging
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
import tqdm
from chains import random_chains, with_ends
from families import JUDGED, family
from kernels import needs_numba, runtimes
from plain import solve

from cradle import (
    Chain,
    ImpactNotCertified,
    ImpactNotFinished,
    ImpulseCorrelation,
    SequentialCollisions,
    SpringChain,
    collide,
    kernel,
    outcomes,
)
from cradle import post_impact_velocities as batch
from cradle.kernel import numbers
from cradle.runtime import compile as runtime
from cradle.runtime import job as drive

FIELDS = ("velocities", "impulses", "absorbed", "collisions", "path", "path_impulses")


@pytest.fixture
def plain(monkeypatch):
    """Switch to the kernel as it stands when called; to the compiled one with `plain(False)`."""

    def switch(on=True):
        monkeypatch.setenv(runtime.VARIABLE, "plain" if on else "compiled")

    switch(False)
    return switch


@pytest.fixture
def fresh_runtime(monkeypatch):
    """Let the runtime find out anew what there is; afterwards too."""
    monkeypatch.delenv(runtime.VARIABLE, raising=False)
    monkeypatch.setattr(runtime, "_spent", 0.0)
    # The caches of this process are kept: to load compiled code again would take seconds.
    for name in ("available", "compiled", "_stored", "_announce", "_found"):
        monkeypatch.setattr(runtime, name, functools.cache(vars(runtime)[name].__wrapped__))


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


def outcome(chain, options, **record):
    """The trace, unfinished or not: the limit is low, and both must reach it alike."""
    m, v, e, f, b = chain
    options = {"max_events": 2000, **options}
    try:
        return True, collide(Chain(m, v, e), ImpulseCorrelation(f, b, **options), **record)
    except ImpactNotFinished as stopped:
        return False, stopped.trace


def same(one, other):
    """Assert that two traces agree in every bit."""
    for name in FIELDS:
        left, right = getattr(one, name), getattr(other, name)
        assert left.dtype == right.dtype
        assert left.shape == right.shape
        assert left.tobytes() == right.tobytes(), name
    assert one.events == other.events
    assert one.collapsed is other.collapsed
    assert one.saturated == other.saturated
    assert one.energy_loss == other.energy_loss
    assert one.margin == other.margin


# --- plain and compiled -------------------------------------------------------------------------


@needs_numba
def test_compiled_and_plain_traces_are_equal_to_the_last_bit(plain):
    finished = 0
    for chain, options in mixed_chains(1, 250):
        plain(False)
        assert runtime.chosen() is runtime.compiled()
        done, one = outcome(chain, options)
        plain(True)
        assert runtime.chosen() is kernel
        also_done, other = outcome(chain, options)
        assert done == also_done
        finished += done
        same(one, other)
    assert finished > 225


@needs_numba
@pytest.mark.parametrize("n", [2, 3, 5])
def test_compiled_and_plain_batches_are_equal_to_the_last_bit(plain, n):
    m, v, e, f, b = random_chains(np.random.default_rng(n), 60, n, decades=2)
    arguments = m.reshape(6, 10, n), v[:10], e[:10], f.reshape(6, 10, n - 2), b[0]
    compiled = outcomes(*arguments, excess="saturate")
    plain()
    for one, other in zip(outcomes(*arguments, excess="saturate"), compiled, strict=True):
        assert one.tobytes() == other.tobytes()


@needs_numba
@pytest.mark.parametrize("name", JUDGED)
@pytest.mark.parametrize("count", [6, pytest.param(600, marks=pytest.mark.exhaustive)])
def test_compiled_and_plain_agree_on_what_the_judge_is_asked(plain, name, count):
    """Ties, zeros, light balls; a division by zero would be an error in plain work alone."""
    finished = 0
    for problem in family(name, count, seed=15):
        answers = []
        for on in (False, True):
            plain(on)
            with contextlib.suppress(ImpactNotFinished, ImpactNotCertified):
                found = problem.solve(batch, excess="saturate", max_events=300)
                answers.append(found.tobytes())
        assert len(answers) != 1
        assert answers[:1] == answers[1:]
        finished += len(answers) == 2
    assert finished > 0


# --- what is compiled, and when -----------------------------------------------------------------


LIGHT = [1, 0.01, 1], [1, 0, 0], 0.9
LIGHT_MODEL = ImpulseCorrelation(0.15)


@pytest.mark.usefixtures("fresh_runtime")
@pytest.mark.parametrize("cause", ["no numba", "switched off"])
def test_without_numba_everything_works(cause, monkeypatch):
    """Where no wheel of numba exists the import fails; the kernel then runs as it stands."""
    monkeypatch.setenv(runtime.VARIABLE, "plain")
    expected = collide(Chain(*LIGHT), LIGHT_MODEL)
    monkeypatch.setenv(runtime.VARIABLE, "compiled")  # a wish that cannot be granted
    if cause == "no numba":
        monkeypatch.setitem(sys.modules, "numba", None)
    else:
        monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
        assert not runtime.available()
    assert runtime.compiled() is None
    assert runtime.chosen(large=True) is kernel
    drive.warm_up.__wrapped__()
    assert runtime.chosen() is kernel
    same(collide(Chain(*LIGHT), LIGHT_MODEL), expected)
    after = batch([1, 0.01, 1], [[1, 0, 0], [2, 0, 0]], 0.9, 0.15)
    assert after[0].tobytes() == expected.velocities.tobytes()


@pytest.mark.usefixtures("fresh_runtime")
@needs_numba
def test_small_work_runs_plain_and_more_work_compiled(monkeypatch):
    """Nothing is loaded before plain work has taken as long as loading, nor compiled before."""
    ready = []
    monkeypatch.setattr(runtime, "loaded", lambda *_: False)
    monkeypatch.setattr(runtime, "on_disk", lambda *_: bool(ready))
    monkeypatch.setattr(runtime, "compiled", lambda: "compiled")
    for on_disk, spent, large, expected in (
        ([], 0.0, False, kernel),
        ([], 0.0, True, "compiled"),
        ([], 0.9 * runtime.PAYS_AFTER, False, kernel),
        ([], 1.1 * runtime.PAYS_AFTER, False, "compiled"),
        ([1], 0.9 * runtime.LOADS_AFTER, False, kernel),
        ([1], 1.1 * runtime.LOADS_AFTER, False, "compiled"),
    ):
        ready[:] = on_disk
        runtime._found.cache_clear()
        monkeypatch.setattr(runtime, "_spent", spent)
        assert runtime.chosen(large) is expected
    monkeypatch.setenv(runtime.VARIABLE, "plain")
    assert runtime.chosen(large=True) is kernel


def test_plain_work_is_counted(plain, monkeypatch):
    monkeypatch.setattr(runtime, "_spent", 0.0)
    plain()
    begun = time.perf_counter()
    batch([1, 0.01, 1], [1, 0, 0], 0.9, [[0.1], [0.15]])
    collide(Chain(*LIGHT), LIGHT_MODEL)
    assert 0.0 < runtime._spent <= time.perf_counter() - begun


@pytest.mark.usefixtures("fresh_runtime")
@needs_numba
@pytest.mark.parametrize(
    ("folder", "loaded", "said"),
    [
        (Path("somewhere"), False, ["once on this machine"]),
        (None, False, ["in this process, as no folder for it is writable (set NUMBA_CACHE_DIR)"]),
        (Path("somewhere"), True, []),  # what is ready is loaded without a word
    ],
)
def test_a_compilation_says_so_once(monkeypatch, caplog, folder, loaded, said):
    monkeypatch.setenv(runtime.VARIABLE, "compiled")
    monkeypatch.setattr(runtime, "compiled", lambda: "compiled")
    monkeypatch.setattr(runtime, "on_disk", lambda *_: False)
    monkeypatch.setattr(runtime, "loaded", lambda *_: loaded)
    monkeypatch.setattr(runtime, "_stored", lambda: folder)
    with caplog.at_level(logging.WARNING, "cradle"):
        runtime.chosen()
        runtime.chosen()
    assert [record.getMessage() for record in caplog.records] == [
        f"compiling the event loop, {when}: up to a minute" for when in said
    ]


@pytest.mark.usefixtures("fresh_runtime")
@needs_numba
def test_compiled_code_is_looked_for_once(monkeypatch):
    """Not before each of many small impacts, which take less time than a look."""
    looks = []
    monkeypatch.setattr(runtime, "loaded", lambda *_: False)
    monkeypatch.setattr(runtime, "on_disk", lambda *_: bool(looks.append(runtime._spent)))
    for _ in range(1000):
        assert runtime.chosen() is kernel
        runtime._spent += 4 * runtime.LOADS_AFTER / 1000
    assert len(looks) == 1
    assert looks[0] > runtime.LOADS_AFTER


@pytest.mark.usefixtures("fresh_runtime")
@needs_numba
def test_threads_share_what_is_compiled(monkeypatch):
    """Threads that need compiled code at the same time get one module, so it compiles once."""
    monkeypatch.setattr(runtime, "_stored", lambda: time.sleep(0.2))
    together = threading.Barrier(4)

    def choose(_):
        together.wait()
        return runtime.chosen(large=True)

    with ThreadPoolExecutor(4) as pool:
        modules = set(pool.map(choose, range(4)))
    assert len(modules) == 1


@needs_numba
@pytest.mark.usefixtures("fresh_runtime")
def test_one_thread_at_a_time_looks_for_compiled_code(monkeypatch):
    """A look parses the source: in Python 3.11 two threads at once can trip each other up."""
    inside, most = [], []

    def look(door):
        inside.append(door)
        most.append(len(inside))
        time.sleep(0.02)
        inside.pop()
        return False

    monkeypatch.setattr(runtime, "_found", look)
    monkeypatch.setattr(runtime, "_spent", (runtime.LOADS_AFTER + runtime.PAYS_AFTER) / 2)
    with ThreadPoolExecutor(4) as pool:
        assert [*pool.map(lambda _: runtime.chosen() is kernel, range(4))] == [True] * 4
    assert most == [1] * 4


@needs_numba
@pytest.mark.usefixtures("plain")
def test_warm_up_compiles_what_calls_take():
    """A chain's own arrays, which nobody may write to, would be compiled for a second time."""
    drive.warm_up.__wrapped__()
    for door, model in (("batch", ImpulseCorrelation(0.0)), ("follow", SpringChain())):
        assert runtime.loaded(door)
        assert runtime.chosen(door=door) is runtime.compiled()
        collide(Chain([1, 1, 1], [1, 0, 0]), model)
        assert "readonly" not in str([*vars(runtime.compiled())[door].overloads])


@needs_numba
def test_compiled_code_is_found_on_disk():
    """In a new process, and by the name that numba gives it."""
    drive.warm_up()
    code = "import cradle.runtime.compile as one; print(one.loaded(), one.on_disk())"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    if runtime._stored() is None:
        pytest.skip("no folder for compiled code")
    assert found.stdout.split() == ["False", "True"]


@pytest.mark.usefixtures("fresh_runtime")
def test_an_edit_and_another_way_to_compile_make_new_units(monkeypatch):
    names, source = [runtime._name()], runtime.unit()
    with monkeypatch.context() as other:
        other.setattr(runtime, "unit", lambda: source + "\nLAST = 1\n")
        names.append(runtime._name())
    monkeypatch.setitem(runtime._MEANINGS, "apart", {**runtime._APART, "error_model": "python"})
    names.append(runtime._name())
    assert len(set(names)) == 3


@pytest.mark.usefixtures("fresh_runtime")
@needs_numba
def test_what_cannot_be_written_is_not_on_disk(monkeypatch, tmp_path):
    """Nothing can be written below a regular file, whoever one is."""
    file = tmp_path / "file"
    file.write_text("no folder")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(file / "below"))
    assert runtime._stored() is None
    assert not runtime.on_disk()
    assert runtime.compiled() is not None


@pytest.mark.usefixtures("fresh_runtime")
@needs_numba
def test_code_on_disk_that_cannot_be_read_is_removed_once(monkeypatch, tmp_path, caplog):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(runtime, "_folder", lambda: tmp_path)
    monkeypatch.setattr(runtime, "loaded", lambda *_: False)
    folder, name = tmp_path / "__pycache__", f"{runtime._name()}.batch-1.py311"
    folder.mkdir()
    files = [folder / f"{name}.{end}" for end in ("nbi", "1.nbc")]
    other = folder / "another_unit.batch-1.py311.nbi"
    for file in (*files, other):
        file.write_bytes(b"half")

    def follow(value):
        raise TimeoutError(value)

    # What interrupts a compilation, as an alarm, spoils no file of the other loop.
    made = runtime.compiled()
    with pytest.raises(TimeoutError):
        runtime.call(follow, 1)
    assert files[0].exists()
    assert runtime.compiled() is not made

    def batch(value):
        if value < 0 or files[0].exists():
            raise EOFError("Ran out of input")
        return value

    with caplog.at_level(logging.WARNING, "cradle"):
        assert runtime.call(batch, 3) == 3
        with pytest.raises(EOFError):  # nothing is left to remove
            runtime.call(batch, -1)
    assert not any(file.exists() for file in files)
    assert other.exists()
    (said,) = caplog.records
    assert "cannot be read (EOFError('Ran out of input')); compiled anew" in said.getMessage()


@pytest.mark.exhaustive
@needs_numba
def test_half_a_file_of_compiled_code_is_compiled_anew(tmp_path):
    command = [sys.executable, "-W", "error", "-m", "cradle", "warm-up"]
    options = {"capture_output": True, "text": True, "check": True}
    own = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    warm_up = functools.partial(subprocess.run, command, env=own, **options)
    warm_up()
    for pattern in ("*batch-*.nbc", "*batch-*.nbi"):
        (file,) = tmp_path.rglob(pattern)
        file.write_bytes(file.read_bytes()[:100])
        assert "cannot be read" in warm_up().stderr
        assert "loaded in" in warm_up().stdout


@pytest.mark.parametrize("power", range(-7, 15))
@pytest.mark.parametrize("digits", ["1", "107", "123456789012345", "999999999999999"])
def test_a_number_means_the_decimal_that_it_prints_as(power, digits):
    """Of up to fifteen digits, to the last bit of two floats."""
    text = f"{digits[0]}.{digits[1:]}e{power}"
    found = numbers.read(float(text))
    off = abs(Decimal(found.real) + Decimal(found.imag) - Decimal(text))
    assert off <= Decimal(text) * Decimal(2) ** -104


@pytest.mark.usefixtures("fresh_runtime")
@pytest.mark.parametrize("large", [False, True])
def test_the_wish_for_a_kernel_is_one_of_two_words(monkeypatch, large):
    monkeypatch.setenv(runtime.VARIABLE, "bogus")
    with pytest.raises(ValueError, match="CRADLE_KERNEL = 'bogus'; must be 'plain' or 'compiled'"):
        runtime.chosen(large)
    monkeypatch.setenv(runtime.VARIABLE, "")  # as good as none
    assert runtime.chosen() is kernel


HOME = "USERPROFILE" if sys.platform == "win32" else "HOME"


@pytest.mark.usefixtures("fresh_runtime")
@pytest.mark.parametrize("variable", ["XDG_CACHE_HOME", "LOCALAPPDATA", HOME])
def test_compiled_code_stays_out_of_the_package(monkeypatch, tmp_path, variable):
    """A wheel or a source distribution built afterwards would take it along."""
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(variable, str(tmp_path))
    package = Path(runtime.__file__).parent
    before = set(package.rglob("*"))
    stored = runtime._stored()
    assert stored.parent.name == "cradle-companion"
    assert stored.is_relative_to(tmp_path)
    assert stored.read_text(encoding="utf-8") == runtime._for_numba(runtime.unit())
    assert set(package.rglob("*")) == before


@pytest.mark.usefixtures("fresh_runtime")
def test_a_user_without_a_home_has_no_folder(monkeypatch):
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)

    def unknown(_):
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "expanduser", unknown)
    assert runtime._stored() is None


@needs_numba
def test_no_function_is_inlined_that_is_meant_to_stand_apart():
    """numba hands `forceinline` on to what a function calls, unless this says otherwise.

    Then all of the event loop would be one function, which takes minutes to compile.
    """
    module = runtime.compiled()
    inlined = {"jit": True, "apart": False, "door": False}
    for node in ast.parse(runtime._for_numba(runtime.unit())).body:
        if isinstance(node, ast.FunctionDef) and hasattr(getattr(module, node.name), "py_func"):
            (mark,) = (ast.unparse(part) for part in node.decorator_list)
            options = getattr(module, node.name).targetoptions
            assert options["forceinline"] is inlined[mark], node.name
            assert mark == "door" or options["no_cpython_wrapper"], node.name


# --- pauses -------------------------------------------------------------------------------------


#: A chain of many events: its path outgrows the first room, and its solution several pauses.
LONG = np.ones(30), np.eye(30)[0], np.full(29, 0.9), np.full(28, 0.1), np.full(28, 0.1)


@runtimes
@pytest.mark.parametrize("effort", [1, 1000])
def test_pauses_do_not_change_a_bit(plain, monkeypatch, on, effort):
    plain(on)
    cases = [(LONG, {"max_events": 10**6}), *mixed_chains(5, 40)]
    expected = [outcome(*case) for case in cases]
    monkeypatch.setattr(drive, "_EFFORT", {False: effort, True: effort})
    for case, (done, trace) in zip(cases, expected, strict=True):
        also_done, paused = outcome(*case)
        assert done == also_done
        same(trace, paused)
        # Without a record too.
        _, alone = outcome(*case, record=False)
        assert alone.velocities.tobytes() == trace.velocities.tobytes()


@needs_numba
def test_the_same_bits_if_it_goes_on_compiled_midway(monkeypatch):
    monkeypatch.setenv(runtime.VARIABLE, "plain")
    _, expected = outcome(LONG, {"max_events": 10**6})
    alone = outcomes(*LONG)
    monkeypatch.delenv(runtime.VARIABLE)
    drive.warm_up()
    seen = []
    spent = iter([False, False, True])
    chosen = runtime.chosen

    def later(large=False):
        monkeypatch.setenv(runtime.VARIABLE, "compiled" if next(spent, True) else "plain")
        seen.append(chosen(large))
        return seen[-1]

    monkeypatch.setattr(runtime, "chosen", later)
    monkeypatch.setattr(drive, "_EFFORT", {False: 500, True: 10**6})
    _, trace = outcome(LONG, {"max_events": 10**6})
    assert kernel in seen
    assert runtime.compiled() in seen
    same(trace, expected)
    spent = iter([False, False, True])
    for one, other in zip(outcomes(*LONG), alone, strict=True):
        assert one.tobytes() == other.tobytes()


@runtimes
def test_a_path_grows_with_its_impact(plain, on):
    """Longer than the room made first; the same as in room enough from the start."""
    plain(on)
    _, trace = outcome(LONG, {"max_events": 10**6})
    count = len(trace.events)
    assert count > 4 * (64 + drive._ROUND * 30)
    assert trace.path.shape == (count + 1, 30)
    names = {"maximum_compression": 0, "end": 1, "close": 2, "collapse": 3, "repetition": 4}
    found = solve(*LONG, room=count)
    assert found.events == count
    kinds, contacts, velocities, impulses = (part.tolist() for part in found.state.record)
    assert contacts == [event.contact for event in trace.events]
    assert kinds == [names[event.kind] for event in trace.events]
    # The first row is the chain as it was given; the event loop does not write it.
    assert trace.path[0].tolist() == LONG[1].tolist()
    assert velocities[1:] == trace.path[1:].tolist()
    assert impulses == trace.path_impulses.tolist()


@runtimes
def test_the_path_is_kept_if_asked_for_or_up_to_a_bound(plain, on, monkeypatch):
    plain(on)
    chain, model = Chain(*LONG[:3]), ImpulseCorrelation(*LONG[3:])
    whole = collide(chain, model)
    monkeypatch.setattr("cradle.models.correlation._MOST_NUMBERS", 1000 * 59)
    words = f"the first 1000 of {len(whole.events)} events; record"
    with pytest.warns(UserWarning, match=words) as seen:
        part = collide(chain, model)
    assert seen[0].filename == __file__
    asked = collide(chain, model, record=True)
    alone = collide(chain, model, record=False)
    assert part.events == whole.events[:1000]
    assert part.path.tobytes() == whole.path[:1001].tobytes()
    same(asked, whole)
    assert not alone.events
    assert (whole.left_out, asked.left_out, alone.left_out) == (0, 0, 0)
    assert part.left_out == len(whole.events) - 1000
    for trace in (part, alone):
        assert trace.velocities.tobytes() == whole.velocities.tobytes()
        assert trace.impulses.tobytes() == whole.impulses.tobytes()


def test_a_path_holds_ten_million_numbers_unless_asked_for(monkeypatch):
    """However many balls: N velocities and N - 1 impulses at each event, at least one event."""
    chain, model = Chain(*LONG[:3]), ImpulseCorrelation(0)
    for room, kept in ((59 * 7, 7), (59 * 8 - 1, 7), (1, 1)):
        monkeypatch.setattr("cradle.models.correlation._MOST_NUMBERS", room)
        with pytest.warns(UserWarning, match=f"the first {kept} of"):
            assert len(collide(chain, model).events) == kept
        # This model takes no `record`, so it is not advised.
        with pytest.warns(UserWarning, match=r"events$"):
            collide(chain, SequentialCollisions())


@runtimes
def test_progress_of_one_long_impact_is_shown(plain, capsys, on, monkeypatch):
    plain(on)
    monkeypatch.setattr(drive, "_EFFORT", {False: 1000, True: 1000})
    chain, model = Chain(*LONG[:3]), ImpulseCorrelation(*LONG[3:])
    expected = collide(chain, model)
    assert not capsys.readouterr().err
    bar = tqdm.tqdm
    monkeypatch.setattr("tqdm.tqdm", lambda unit, delay: bar(unit=unit, delay=0 * delay))
    same(collide(chain, model, progress=True), expected)
    assert f"{len(expected.events)} events" in capsys.readouterr().err


SLOW = {
    "one": "cradle.ImpulseCorrelation(0.0, max_events=2**60).solve(cradle.Chain(m, v, 1))",
    "batch": "cradle.outcomes([m] * 40_000, v, 1, 0.0, max_events=2**60)",
}


@pytest.mark.skipif(sys.platform == "win32", reason="no interrupts between processes there")
@pytest.mark.parametrize(
    ("work", "wish"), [("one", "plain"), pytest.param("batch", "compiled", marks=needs_numba)]
)
def test_ctrl_c_works_at_once(work, wish):
    """Impacts of many millions of collisions each; counted in processor time, on any machine."""
    code = f"""if True:
        import signal, time
        signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs begin without
        import cradle
        from cradle.runtime.job import warm_up
        warm_up()
        m, v = [1, *[1e-14, 1] * 4], [1, *[0] * 8]
        begun = time.process_time()
        print("begins", flush=True)
        try:
            {SLOW[work]}
        except KeyboardInterrupt:
            print(time.process_time() - begun)
    """
    with subprocess.Popen(
        [sys.executable, "-c", code],
        env={**os.environ, runtime.VARIABLE: wish},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout.readline() == "begins\n"
            begun = time.perf_counter()
            time.sleep(0.4)
            assert process.poll() is None
            process.send_signal(signal.SIGINT)
            waited = time.perf_counter() - begun
            output, error = process.communicate(timeout=300)
        finally:
            process.kill()
    assert process.returncode == 0, error
    # All threads together. A second or less after the interrupt; without pauses it would be
    # minutes.
    assert float(output) < waited * (os.cpu_count() or 1) + 5


# --- the rooms stay plain -----------------------------------------------------------------------

MATH = {"frexp", "inf", "ldexp", "log", "sqrt"}
#: Complex numbers are pairs: they are made, and taken apart.  No operator adds or multiplies them.
PARTS = {"real", "imag"}
BUILT_IN = {"abs", "bool", "complex", "float", "globals", "int", "len", "max", "min", "range"}
# Without `_`, which running examples of docstrings leave there.
OTHER_BUILT_IN = set(dir(builtins)) - BUILT_IN - {"_"}


def is_plain(node):
    """Whether a room may have this name: other kinds of nodes are refused by the translation."""
    match node:
        case ast.Import(names=names):
            return [alias.name for alias in names] == ["math"]
        case ast.ImportFrom(module=module):
            return module == "typing" or module.startswith("cradle.kernel.")
        case ast.Attribute(value=ast.Name(id="math"), attr=name):
            return name in MATH
        case ast.Attribute(value=ast.Call(), attr=name):
            return name in PARTS
        case ast.Attribute(attr=name):
            return not name.startswith("_")
        case ast.Name(id=name):
            return name not in OTHER_BUILT_IN
    return True


@pytest.mark.parametrize("room", kernel.ROOMS)
def test_the_kernel_stays_plain(room):
    """What lets one source run in three places."""
    source = Path(kernel.__file__).with_name(f"{room}.py").read_text(encoding="utf-8")
    assert [ast.unparse(node) for node in ast.walk(ast.parse(source)) if not is_plain(node)] == []


def test_each_room_uses_only_those_before_it_and_no_name_twice():
    """In one unit the later of two would replace the earlier."""
    folder = Path(kernel.__file__).parent
    assert sorted(path.stem for path in folder.glob("[!_]*.py")) == sorted(kernel.ROOMS)
    for k, room in enumerate(kernel.ROOMS):
        tree = ast.parse((folder / f"{room}.py").read_text(encoding="utf-8"))
        used = {node.module for node in tree.body if isinstance(node, ast.ImportFrom)} - {"typing"}
        assert used <= {f"cradle.kernel.{other}" for other in kernel.ROOMS[:k]}, room
    made = [getattr(node, "name", None) for node in ast.parse(runtime.unit()).body]
    names = [name for name in made if name]
    assert len(names) == len(set(names))
