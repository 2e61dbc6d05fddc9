"""The npm package: built here, imported as a module by its own example page, with true types."""

import functools
import http.server
import json
import re
import sys
import threading

import pytest
from pages import PATIENCE

from cradle import Chain, ImpulseCorrelation, collide

GIVEN = {"masses": [1, 2, 1, 0.5], "velocities": [1, 0, 0, 0], "restitution": 0.9, "forward": 0.2}


@pytest.fixture(scope="module")
def folder(tmp_path_factory, root):
    """Build the package."""
    sys.path.insert(0, str(root / "publication" / "npm"))
    try:
        import build
    finally:
        sys.path.pop(0)
    target = tmp_path_factory.mktemp("npm")
    build.build(target)
    return target


@pytest.fixture(scope="module")
def address(folder):
    """Serve the package: browsers load no modules from files."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        extensions_map = {".js": "text/javascript", ".html": "text/html"}  # noqa: RUF012

        def log_message(self, *given):
            pass

    handler = functools.partial(Quiet, directory=folder)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def test_files(folder):
    package = json.loads((folder / "package.json").read_text(encoding="utf-8"))
    there = {path.name for path in folder.iterdir()}
    always = {"package.json", "README.md", "LICENSE"}  # npm adds them by itself
    assert {*package["files"], *always} == there
    entry = package["exports"]["."]
    assert {entry["types"], entry["default"]} == {"./index.d.ts", "./index.js"}
    assert len((folder / "README.md").read_text(encoding="utf-8").splitlines()) <= 20


def test_module_and_example(browser, folder, address):
    """The same bits as Python; nothing left on the global object; what README shows runs."""
    tab, errors = browser.new_page(), []
    tab.set_default_timeout(PATIENCE)
    tab.on("pageerror", lambda error: errors.append(str(error)))
    tab.goto(f"{address}/example.html")
    tab.wait_for_function("document.getElementById('after').textContent")
    tab.evaluate("(ratio) => { ratio.value = 0.2; ratio.dispatchEvent(new Event('input')); }",
                 tab.query_selector("#ratio"))  # fmt: skip
    five = collide(Chain([1] * 5, [1, 0, 0, 0, 0], 0.97), ImpulseCorrelation(0.2)).velocities
    shown = [float(one) for one in re.findall(r"-?\d+\.\d+", tab.inner_text("#after"))]
    assert shown == pytest.approx(five.tolist(), abs=0.00051)
    names, given, readme = tab.evaluate(
        """async ([given, code]) => {
          const module = await import("./index.js");
          const said = [];
          const log = (words) => said.push(words);
          new Function("collide", "console", code)(module.collide, { log });
          const answers = [module.collide(given), module.outcome(given)];
          return [[Object.keys(module), "cradle" in window], answers, said];
        }""",
        [GIVEN, re.search(r"```js\nimport.*\n(?s:(.*?))```",
                          (folder / "README.md").read_text(encoding="utf-8"))[1]],
    )  # fmt: skip
    tab.close()
    assert errors == []
    assert names == [["collide", "largestRatios", "outcome"], False]
    chain = Chain(GIVEN["masses"], GIVEN["velocities"], GIVEN["restitution"])
    trace = collide(chain, ImpulseCorrelation(GIVEN["forward"]))
    for answer in given:
        assert answer["velocities"] == trace.velocities.tolist()
        assert answer["impulses"] == trace.impulses.tolist()
    assert readme == [
        collide(Chain([1] * 5, [1, 0, 0, 0, 0], 0.97), ImpulseCorrelation(0.15)).velocities.tolist()
    ]
    # The types name every part of an answer, and no other.
    types = (folder / "index.d.ts").read_text(encoding="utf-8")

    def members(name):
        body = re.search(rf"interface {name}\b[^{{]*{{(.*?)\n}}", types, re.DOTALL)[1]
        return set(re.findall(r"^  (\w+)\??:", body, re.MULTILINE))

    assert set(given[1]) == members("Outcome")
    assert set(given[0]) == members("Outcome") | members("Recorded")
    assert members("Impact") > set(GIVEN)
    assert set(re.findall(r"export function (\w+)", types)) == set(names[0])
