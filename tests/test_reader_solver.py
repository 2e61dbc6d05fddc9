"""The reader's own solver: the lines of its page, right, wrong, endless and broken."""

import operator
import re
import sys

import numpy as np
import pytest
from explorer import Tab
from pages import PATIENCE, visiting

import reader_solver  # isort: skip
import solver_numpy  # isort: skip  (both are found by way of pyproject.toml)

WHOLE = ".reader-solver:not([data-piece])"


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
    for act in ("iadd", "isub", "imul", "itruediv"):
        for y in (other, 2.0):
            row, true = solver_numpy.array(one), np.array(one)
            held, right = row, true
            row = getattr(operator, act)(row, y)
            true = getattr(operator, act)(true, y)
            assert row is held, act  # as in numpy, whoever holds the row sees the change
            assert true is right
            assert (row, type(row)) == (true.tolist(), solver_numpy.Row), act
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


def test_who_drives_matters_where_both_contacts_approach(solver):
    """The page asks which check fails if 2-3 drives at the start."""
    names: dict = {}
    assert solver.count("v, tau, owed)], 0\n") == 1
    exec(solver.replace("v, tau, owed)], 0\n", "v, tau, owed)], 1\n"), names)
    for check in reader_solver.checks(reader_solver.cells()):
        before = check["given"][1]
        off = np.abs(names["three_balls"](*check["given"])[-1][2] - check["expected"]).max()
        assert (off > 0.05) == (before[0] > before[1] > before[2]) == (off > 1e-12)


def test_a_piece_is_left_to_the_reader(solver):
    texts = reader_solver.texts(reader_solver.cells())
    assert texts.pop("") == {"own": solver, "rest": ""}
    assert [*texts] == [*reader_solver.PIECES]
    for piece, text in texts.items():
        own, rest = text["own"], text["rest"]
        compile(own, piece, "exec")
        assert f"def {piece}(" in own
        assert own.count('raise NotImplementedError("Your lines come here.")') == 1
        told = own.partition("        raise Not")[0].splitlines()[-6:]  # the longest in six steps
        assert all("# " in line for line in told) == (piece == "three_balls")
        assert len(own) < len(reader_solver.parts(reader_solver.cells())[piece])
        for other in reader_solver.PIECES:
            assert (f"def {other}(" in rest) == (other != piece) != (f"def {other}(" in own)
    with pytest.raises(ValueError, match="defines not each of"):
        reader_solver.lines(["def rates():\n    pass"])


class Editor:
    """One of the editors of the page: types lines, presses Run, reads what is told."""

    def __init__(self, tab, place=WHOLE):
        self.tab, self.host, self.place = tab, tab.locator(place), place
        self.area = self.host.locator("textarea")

    def __call__(self, lines: str | None = None):
        if lines is not None:
            self.area.fill(lines)
        self.host.locator("button").first.click()
        return self

    def stop(self):
        self.host.locator("button").nth(1).click()
        return self

    def told(self, words: str) -> tuple[int, int]:
        """Wait for these words, and return how many checks have passed and how many have not."""
        self.tab.wait_for_function(
            "([told, words]) => document.querySelector(told).textContent.includes(words)",
            arg=[f"{self.place} .told", words],
        )
        return self.counted("ol")

    def counted(self, place: str) -> tuple[int, int]:
        """How many impacts (ol) or single calls (ul) have passed, and how many have not."""
        kinds = "passed", "missed"
        return tuple(self.host.locator(f"{place} .{kind}").count() for kind in kinds)


@pytest.fixture(scope="module")
def page(browser, idle, html):
    """The page for all tests that do not ask how it begins: each has an editor of its own."""
    with visiting(browser, idle, html) as visit:
        yield with_whole(Tab(visit(chapter="own_solver")))


def with_whole(tab):
    """Open the fold with the whole program."""
    tab.locator(f".admonition:has({WHOLE}) .toggle-button").click()
    return tab


def piece_of(name: str) -> str:
    return f".reader-solver[data-piece={name}]"


def test_right_wrong_and_endless(visit, solver):
    """Nothing is loaded before the click; what is right passes, the rest is told with its line."""
    tab, asked = with_whole(visit(chapter="own_solver")), []
    tab.on("request", lambda request: asked.append(request.url))
    for piece, text in reader_solver.texts(reader_solver.cells()).items():
        editor = Editor(tab, piece_of(piece) if piece else WHOLE)
        assert editor.area.input_value() == text["own"]
        assert editor.host.locator("ol").is_hidden()
    editor = Editor(tab)
    assert not any("solver_python" in url for url in asked)
    assert editor().told("5 of 5 checks passed") == (5, 0)
    assert sum("solver_python" in url for url in asked) == 1
    # Each wrong line is noticed by the checks that it concerns.
    for right, wrong, passed in (
        ("min(a, bound)", "a", 4),
        ("min(a, bound)", "0.0", 1),
        ("np.square(e)", "np.array(e)", 2),
    ):
        assert solver.count(right) == 1
        counts = editor(solver.replace(right, wrong)).told(f"{passed} of 5 checks passed")
        assert counts == (passed, 5 - passed)
        assert "cradle has" in editor.host.locator(".missed").first.inner_text()
    # Errors name their line, and select it.
    lost = solver.index("p2, p3 = push")
    for broken, error in (
        (solver.replace("p2, p3 = push", "p2, p3 = pushed"), "NameError: name 'pushed'"),
        (solver.replace("p2, p3 = push", "p2, p3 = = push"), "SyntaxError"),
        (solver.replace("p2, p3 = push", "import random"), "No module named 'random'"),
    ):
        line = solver[:lost].count("\n") + 1
        assert editor(broken).told(f"An error in line {line}.") == (0, 0)
        words = editor.host.locator(".wrong").inner_text()
        assert error in words
        assert f"Line {line}" in words
        chosen = "(node) => node.value.slice(node.selectionStart, node.selectionEnd)"
        assert editor.area.evaluate(chosen) == broken.split("\n")[line - 1]
    # An error in one check leaves the others; a hint says what may be missing.
    some = solver.replace(
        "    v = np.array(v, dtype",
        "    m[1] == 2 and m[7]\n    v = np.array(v, dtype",
    )
    assert editor(some).told("An error in line") == (4, 0)
    assert editor.host.locator("li p:has-text('an error: no answer')").count() == 1
    for right, wrong, hint in (
        ("    return push, np", "    push, np", "Is a return missing?"),
        (
            "    m1, m2, m3 = m\n",
            "    rates(m, a, acting, driver)\n",
            "calls itself without end",
        ),
    ):
        editor(solver.replace(right, wrong)).told("An error")
        assert hint in editor.host.locator(".wrong").inner_text()
    # What is printed is shown, and a loop without end is stopped; then all goes on.
    editor("print('here')\nwhile True:\n    pass")
    tab.wait_for_selector(f"{WHOLE} .printed:has-text('here')", timeout=PATIENCE)
    (worker,) = tab.workers
    with worker.expect_event("close"):  # the loop does not go on unseen
        editor.stop()
    assert editor.told("Stopped.") == (0, 0)
    assert editor(solver).told("5 of 5 checks passed") == (5, 0)
    nothing = "def three_balls(*given):\n    return [(0, 0, [float('nan')] * 3)]"
    assert editor(nothing).told("0 of 5") == (0, 5)


@pytest.mark.parametrize(
    ("piece", "right", "wrong", "missed", "words"),
    [
        ("rates", "min(a, bound)", "a", [1], "expected 0.25, 1; \u22120.25, \u22120.25, 1"),
        ("rates", "min(a, bound)", "1.0", [0, 1], "expected 1, 0.15; \u22121, 0.85, 0.15"),
        ("way_to_stop", "return inf", "return 9.0", [4], "9 came out; expected inf"),
        ("three_balls", "dv * way", "dv", [0], "came out; expected 0.4"),
        # As in numpy, the earlier rows change, too: the last velocities are in the first row.
        ("three_balls", "v = v + dv", "v += dv", [0], "0.169805, 0.857222; 0.540541"),
    ],
)
def test_single_calls_tell_what_is_wrong(page, piece, right, wrong, missed, words):
    editor = Editor(page, piece_of(piece))
    lines = "import numpy as np\n" + reader_solver.parts(reader_solver.cells())[piece]
    assert lines.count(right) == 1
    calls = f"but {len(missed)} of {len(reader_solver.CALLS[piece])} calls failed."
    editor(lines.replace(right, wrong)).told(f"of 5 checks passed, {calls}")
    kinds = editor.host.locator("ul p").evaluate_all("all => all.map((p) => p.className)")
    assert [k for k, kind in enumerate(kinds) if kind == "missed"] == missed
    assert words in editor.host.locator("ul").inner_text()


@pytest.mark.parametrize("kind", ["list", "tuple"])
def test_lists_in_the_place_of_arrays(page, kind):
    editor = Editor(page, piece_of("rates"))
    lines = reader_solver.parts(reader_solver.cells())["rates"]
    lists = lines.replace("return push, np.array", f"return {kind}(push), {kind}")
    editor(f"import numpy as np\n{lists}").told("An error")
    assert "Make it one: np.array" in editor.host.locator(".wrong").inner_text()


def test_a_browser_without_a_language(page):
    """WebKit without a locale says "C", for which browsers have no calendar."""
    assert Editor(page)().told("5 of 5 checks passed") == (5, 0)  # Python is loaded
    answers = page.evaluate(
        """async () => {
          const prelude = 'Object.defineProperty(navigator, "language", { value: "C" });\\n';
          const code = new Blob([prelude, globalThis.cradlePython], { type: "text/javascript" });
          const worker = new Worker(URL.createObjectURL(code));
          const heard = [];
          await new Promise((done) => {
            worker.onerror = ({ message }) => done(heard.push(message));
            worker.onmessage = ({ data }) => heard.push(data) && data.done && done();
            worker.postMessage({ code: "print(6 * 7)", asked: [] });
          });
          worker.terminate();
          return heard;
        }"""
    )
    assert [answer.get("printed", "").strip() for answer in answers[:-1]] == ["42"]
    assert answers[-1] == {"done": True}


@pytest.mark.parametrize("piece", reader_solver.PIECES)
def test_a_piece_by_itself(page, piece):
    """Empty, right, broken in the reader's lines, and wrong where only the page's lines notice."""
    editor = Editor(page, piece_of(piece))
    right = reader_solver.parts(reader_solver.cells())[piece]
    stub = reader_solver.texts(reader_solver.cells())[piece]["own"]
    begin = 1 + stub[: stub.index("raise NotImplementedError")].count("\n")
    assert editor(stub).told(f"Write your lines at line {begin}.") == (0, 0)
    assert editor.host.locator("ol").is_hidden()
    with_numpy = f"import numpy as np\n{right}"
    assert editor(with_numpy).told("5 of 5 checks passed") == (5, 0)
    assert editor.host.locator("ol").is_visible()
    assert editor.counted("ul") == (len(reader_solver.CALLS[piece]), 0)
    assert editor(f"{with_numpy}\nx = (1,").told("An error") == (0, 0)
    assert "SyntaxError" in editor.host.locator(".wrong").inner_text()
    nothing = re.sub(r"return .*", "return None", with_numpy)
    assert editor(nothing).told("An error.") == (0, 0)  # no line of the reader's
    words = editor.host.locator(".wrong").inner_text()
    assert "Is a return missing?" in words
    assert "Line" not in words


def test_each_editor_keeps_what_was_written(page):
    one, other = (Editor(page, piece_of(name)) for name in ("rates", "three_balls"))
    before = other.area.input_value()
    one.area.fill("mine:")
    one.area.press("End")
    one.area.press("Enter")
    assert one.area.input_value() == "mine:\n    "
    assert other.area.input_value() == before
    assert "def three_balls" in before
    assert one.host.locator(".count").inner_text() == "1\n2"


def test_a_run_without_end_is_stopped(visit, solver):
    """It may fill all memory, and the browser would then give up the page with what is written."""
    tab = with_whole(visit(chapter="own_solver", stopped=True))
    editor = Editor(tab)
    with tab.expect_event("worker") as begun:
        editor("path = []\nwhile True:\n    path.append(1)")
    editor.told("running")
    tab.clock.run_for(5000)
    editor.told("press Stop")
    with begun.value.expect_event("close"):
        tab.clock.run_for(15000)
    editor.told("Stopped after 20 s.")
    assert editor(solver).told("5 of 5 checks passed") == (5, 0)
    tab.clock.run_for(20000)
    editor.told("5 of 5 checks passed")


@pytest.mark.parametrize(
    ("lines", "line", "words"),
    [
        ("def f():\n    x = 1\n      y = 2\n    return x", 3, "unexpected indent"),
        ("  x = 1\nprint(x)", 1, "unexpected indent"),
        (
            "def f(n):\n    return g(n)\ndef g(n):\n    return f(n)\nf(0)",
            None,
            "A function calls itself without end.",
        ),
        ("def three_balls(*given):\n    return 5", None, "asked for three_balls([1,1,1], [1,0,0]"),
    ],
)
def test_errors_are_plain(page, lines, line, words):
    editor = Editor(page)
    editor(lines).told(f"An error in line {line}." if line else "An error")
    told = editor.host.locator(".wrong").inner_text()
    assert words in told
    assert told.count("\n") < 30


def test_long_output_says_that_there_is_more(page):
    editor = Editor(page)
    editor("for k in range(20000):\n    print(k)").told("An error.")
    printed = editor.host.locator(".printed")
    assert printed.inner_text().endswith("more is not shown")
    assert printed.bounding_box()["height"] < 400  # the checks stay near


def test_an_error_selects_nothing_in_other_lines(page):
    """Who goes on writing during a run would write over what an error selects."""
    editor = Editor(page)
    editor.area.fill("\n\n\nwrong")
    editor.host.evaluate(
        """async (host) => {
          host.querySelector("button").click();
          while (!/running/.test(host.querySelector(".told").textContent))
            await new Promise((done) => setTimeout(done));
          host.querySelector("textarea").value = "one\\ntwo\\nthree\\nfour";
        }"""
    )
    editor.told("An error in line 4.")
    assert editor.area.evaluate("(node) => node.selectionStart === node.selectionEnd")


def test_a_press_by_key_keeps_the_focus(page, solver):
    editor = Editor(page)
    editor.area.fill(solver)
    editor.host.locator("button").first.press("Space")
    editor.told("5 of 5 checks passed")
    page.keyboard.press("Space")  # without it this would scroll
    editor.told("5 of 5 checks passed")
    assert page.evaluate("document.activeElement.textContent") == "Run"


def test_what_was_written_is_there_after_a_way_back(visit):
    tab = visit(chapter="own_solver")
    editor = Editor(tab, piece_of("rates"))
    editor.area.fill("mine")
    tab.wait_for_function("history.state?.rates === 'mine'")
    tab.evaluate("location.hash = 'own-solver'")  # a link to a place in the page
    tab.wait_for_function("history.state?.rates === 'mine'")
    tab.locator("a.right-next").first.click()
    tab.wait_for_function("!document.querySelector('.reader-solver')")
    tab.go_back()
    assert editor.area.input_value() == "mine"
    tab.reload()
    assert editor.area.input_value() == "mine"
