"""The reader's own solver: the lines of its page, right, wrong, endless and broken."""

import operator
import sys

import numpy as np
import pytest
from pages import PATIENCE

import reader_solver  # isort: skip
import solver_numpy  # isort: skip  (both are found by way of pyproject.toml)

RUN, STOP = ".reader-solver button >> nth=0", ".reader-solver button >> nth=1"
TOLD = ".reader-solver .told"


@pytest.fixture(scope="module")
def solver() -> str:
    return reader_solver.lines(reader_solver.cells())


def test_rows_are_those_of_numpy():
    one, other = [3.0, 1.0, 2.0, 5.0], [2.0, 1.0, 4.0, 0.5]
    for act in ("add", "sub", "mul", "truediv", "pow", "lt", "le", "gt", "ge"):
        work = getattr(operator, act)
        for y in (other, 2.0):
            ours = solver_numpy.array(y) if y is other else y
            found = work(solver_numpy.array(one), ours)
            assert found == work(np.array(one), np.array(y)).tolist(), act
    for work in (operator.add, operator.sub, operator.mul):
        assert work(2.0, solver_numpy.array(one)) == work(2.0, np.array(one)).tolist()
    row = solver_numpy.array([3, 1, 2], dtype=float)
    assert (row[1:], type(row[1:]), -row) == ([1, 2], solver_numpy.Row, [-3, -1, -2])
    assert solver_numpy.where(row > 1, row, 0) == np.where(np.array(row) > 1, row, 0).tolist()
    assert solver_numpy.square([2, 3]) == [4, 9]
    assert solver_numpy.argmin(row) == np.argmin(row)
    assert solver_numpy.zeros(2).copy().sum() == 0


def test_the_page_s_lines_pass(solver, monkeypatch):
    """In this Python, with the rows that the browser has."""
    checks = reader_solver.checks(reader_solver.cells())
    assert len(checks) == 5
    names: dict = {}
    with monkeypatch.context() as only:
        only.setitem(sys.modules, "numpy", solver_numpy)
        exec(solver, names)
    for check in checks:
        found = names["three_balls"](*check["given"])[-1][2]
        assert isinstance(found, solver_numpy.Row)
        np.testing.assert_allclose(found, check["expected"], atol=1e-12)


def test_a_piece_is_left_to_the_reader(solver):
    for piece in reader_solver.PIECES:
        rest = reader_solver.without(solver, piece)
        compile(rest, piece, "exec")
        assert f"def {piece}(" in rest
        assert rest.count('raise NotImplementedError("Your lines come here.")') == 1
        assert len(rest) < len(solver)
    with pytest.raises(ValueError, match="defines not each of"):
        reader_solver.lines(["def rates():\n    pass"])


@pytest.fixture
def editor(visit):
    """Open the page and return what types lines and presses Run; no other page is asked for."""
    tab = visit(chapter="own_solver")
    asked = []
    tab.on("request", lambda request: asked.append(request.url))

    def run(lines: str | None = None):
        if lines is not None:
            tab.locator(".reader-solver textarea").fill(lines)
        tab.click(RUN)
        return tab

    run.tab, run.asked = tab, asked
    return run


def told(tab, words: str) -> tuple[int, int]:
    """Wait for these words, and return how many checks have passed and how many have not."""
    tab.wait_for_function(
        f"(words) => document.querySelector('{TOLD}').textContent.includes(words)", arg=words
    )
    return tuple(tab.locator(f".reader-solver .{kind}").count() for kind in ("passed", "missed"))


def test_right_wrong_and_endless(editor, solver):
    """Nothing is loaded before the click; what is right passes, the rest is told with its line."""
    tab = editor.tab
    assert not any("solver_python" in url for url in editor.asked)
    tab.check(".reader-solver input[value='']")
    assert tab.locator(".reader-solver textarea").input_value() == solver
    assert told(editor(), "5 of 5 checks passed") == (5, 0)
    assert sum("solver_python" in url for url in editor.asked) == 1
    # Each wrong line is noticed by the checks that it concerns.
    for right, wrong, passed in (
        ("min(a, bound)", "a", 4),
        ("min(a, bound)", "0.0", 1),
        ("np.square(e)", "np.array(e)", 2),
    ):
        assert solver.count(right) == 1
        counts = told(editor(solver.replace(right, wrong)), f"{passed} of 5 checks passed")
        assert counts == (passed, 5 - passed)
        assert "cradle has" in tab.locator(".reader-solver .missed").first.inner_text()
    # Errors name their line, and select it.
    lost = solver.index("p2, p3 = push")
    for broken, error in (
        (solver.replace("p2, p3 = push", "p2, p3 = pushed"), "NameError: name 'pushed'"),
        (solver.replace("p2, p3 = push", "p2, p3 = = push"), "SyntaxError"),
        (solver.replace("p2, p3 = push", "import random"), "No module named 'random'"),
    ):
        line = solver[:lost].count("\n") + 1
        assert told(editor(broken), f"An error in line {line}.") == (0, 0)
        words = tab.locator(".reader-solver .wrong").inner_text()
        assert error in words
        assert f"Line {line}" in words
        chosen = "(node) => node.value.slice(node.selectionStart, node.selectionEnd)"
        assert (
            tab.locator(".reader-solver textarea").evaluate(chosen) == broken.split("\n")[line - 1]
        )
    # An error in one check leaves the others; a hint says what may be missing.
    some = solver.replace(
        "    v = np.array(v, dtype",
        "    m[1] == 2 and m[7]\n    v = np.array(v, dtype",
    )
    assert told(editor(some), "An error in line") == (4, 0)
    assert tab.locator(".reader-solver li p:has-text('an error: no answer')").count() == 1
    for right, wrong, hint in (
        ("    return push, np", "    push, np", "Is a return missing?"),
        (
            "    m1, m2, m3 = m\n",
            "    rates(m, a, acting, driver)\n",
            "calls itself without end",
        ),
    ):
        told(editor(solver.replace(right, wrong)), "An error")
        assert hint in tab.locator(".reader-solver .wrong").inner_text()
    # What is printed is shown, and a loop without end is stopped; then all goes on.
    editor("print('here')\nwhile True:\n    pass")
    tab.wait_for_selector(".reader-solver .printed:has-text('here')", timeout=PATIENCE)
    told(tab, "press Stop")
    tab.click(STOP)
    assert told(tab, "Stopped.") == (0, 0)
    assert told(editor(solver), "5 of 5 checks passed") == (5, 0)
    nothing = "def three_balls(*given):\n    return [(0, 0, [float('nan')] * 3)]"
    assert told(editor(nothing), "0 of 5") == (0, 5)


def test_a_browser_without_a_language(editor):
    """WebKit without a locale says "C", for which browsers have no calendar."""
    assert told(editor(), "Write your lines at line 8.") == (0, 0)  # Python is loaded
    answers = editor.tab.evaluate(
        """async () => {
          const prelude = 'Object.defineProperty(navigator, "language", { value: "C" });\\n';
          const code = new Blob([prelude, globalThis.cradlePython], { type: "text/javascript" });
          const worker = new Worker(URL.createObjectURL(code));
          const heard = [];
          await new Promise((done) => {
            worker.onerror = ({ message }) => done(heard.push(message));
            worker.onmessage = ({ data }) => heard.push(data) && data.done && done();
            worker.postMessage({ code: "print(6 * 7)", checks: [] });
          });
          worker.terminate();
          return heard;
        }"""
    )
    assert [answer.get("printed", "").strip() for answer in answers[:-1]] == ["42"]
    assert answers[-1] == {"done": True}


def test_each_piece_keeps_what_was_written(editor):
    tab = editor.tab
    area = tab.locator(".reader-solver textarea")
    first = area.input_value()
    assert told(editor(), "Write your lines at line 8.") == (0, 0)
    area.fill("mine:")
    area.press("End")
    area.press("Enter")
    assert area.input_value() == "mine:\n    "
    tab.check(".reader-solver input[value=three_balls]")
    assert "def three_balls" in area.input_value() != first
    tab.check(".reader-solver input[value=rates]")
    assert area.input_value() == "mine:\n    "
    assert tab.locator(".reader-solver .count").inner_text() == "1\n2"
