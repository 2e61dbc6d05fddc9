"""From the kernel's Python to a script: numbers, translation, and what is refused."""

import ast
import math
import random
import struct
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from script import Script, bits

from cradle.runtime import compile as runtime

import explorer_engine  # isort: skip  (found by way of `script`)


@pytest.fixture(scope="module")
def source():
    return explorer_engine.engine()


def some_doubles(count, seed=1):
    """Any bits: all sizes, numbers below 2 ** -1022, zeros."""
    draw = random.Random(seed)
    numbers = [struct.unpack("<d", draw.getrandbits(64).to_bytes(8, "little"))[0]
               for _ in range(count)]  # fmt: skip
    numbers += [math.ldexp(draw.getrandbits(53), -1074 - draw.getrandbits(6)) for _ in range(count)]
    return [x for x in numbers if math.isfinite(x)] + [0.0, -0.0, 1.0, 5e-324, 2.0**1023]


def test_frexp_and_ldexp(source):
    # They are inside the script's one function: look at them from there.
    script = Script(source.replace("globalThis.cradle = {", "globalThis.cradle = { frexp, ldexp,"))
    numbers = some_doubles(2000)
    parts = script.each("cradle.frexp", numbers)
    assert bits(parts) == bits([math.frexp(x) for x in numbers])
    draw = random.Random(2)
    # Python raises where the result is too large.
    pairs = [(x, draw.randrange(-2200, 2200)) for x in numbers]
    pairs += [(x, draw.randrange(-1080, -1000)) for x in numbers]
    pairs = [(x, k) for x, k in pairs if math.frexp(x)[1] + k <= 1023]
    powers = script.each("([x, k]) => cradle.ldexp(x, k)", pairs)
    script.context.close()
    assert bits(powers) == bits([math.ldexp(x, k) for x, k in pairs])


def test_numbers_as_python_prints_them(source):
    numbers = [*some_doubles(2000), 0.1, 1e16, 1e15, 123456789.0, 1e-4, 9.999e-5, 1e22, -2.5]
    script = Script(source)
    printed = script.each("cradle.shown", numbers)
    script.context.close()
    assert printed == [repr(float(x)) for x in numbers]


ALIKE = {
    "a loop keeps its own count": """
def f(n):
    total = 0
    for i in range(n):
        total = 10 * total + i
        i += 5
        n -= 1
    return total, i, n
""",
    "the counter stays at its last value": """
def f(n):
    for i in range(n):
        for j in range(n - 1, -1, -1):
            if j == 1:
                break
    return i, j
""",
    "a shift beyond 32 bits, divisions, powers": """
def f(n):
    return (1 << 40) - n, -n // 2, n / 2, 2.0 ** -53 * n, -(1 << 40) // 3
""",
    "the first of equals": """
def f(n):
    return max(0.0, -0.0 * n), max(-0.0 * n, 0.0), min(0.0, -0.0 * n), max(1, n, 2), min(1, n, 2)
""",
    "truth values are numbers": """
def f(n):
    known = n > 1
    x = y = 7 if known and n != 0 or n == 2 else 8
    for k in (n - 1, n + 1):
        if k == (n > 1):
            continue
        x += k
    return x, y, known == 1
""",
}


@pytest.mark.parametrize("name", ALIKE)
def test_what_looks_alike_means_the_same(name):
    code = ALIKE[name].replace("math.", "")
    names = {}
    exec(code, names)
    helpers = (Path(explorer_engine.__file__).parent / "engine_numbers.js").read_text("utf-8")
    script = Script(f'"use strict";\n{helpers}\n{explorer_engine.translate(code)}')
    for n in (1, 2, 3, 5, 8):
        assert bits(script("f", n)) == bits(names["f"](n)), n
    script.context.close()


REFUSED = [
    "x[-1] = 2", "y = x[n:]", "y = x % n", "y = n ** 2", "y = 0 < f(x, n) < 2",
    "y = 1 << 60", "y = [n]", "y = x is None", "y = n in x", "y = x == n",
    "y = f(x, n) != f(n, x)", "y = f(x, n=n)", "y = x.pop()", "y = 'word'", "for y in x: pass",
    "for y in range(0, n, 2): pass", "while n: break\n    else: n = 1", "del x", "n @= x",
    "y = lambda: 0", "import os", "raise ValueError",
]  # fmt: skip


@pytest.mark.parametrize("line", REFUSED)
def test_anything_else_is_refused(line):
    with pytest.raises(ValueError, match=r".+: "):
        explorer_engine.translate(f"def f(x, n):\n    {line}\n    return 0")


RECORDS = """
class Wide:
    u: complex
    left: complex
    hits: int

class Narrow:
    left: int

ZERO = complex(0.0, 0.0)
ONCE = 1
"""


def test_equal_pairs_are_refused():
    """Python compares their parts, JavaScript would compare references."""

    def translated(comparison):
        return explorer_engine.translate(f"{RECORDS}\ndef f(x, y):\n    return {comparison}")

    for fine in ("x.u.real == y.u.real", "x.left == y.hits", "x == ONCE", "x.hits != y"):
        assert "return (x" in translated(fine)
    for wrong in (
        "x.u == y.u", "x.u == 0.0", "x.hits != y.u", "x.left == y.left", "x == ZERO", "x == y",
    ):  # fmt: skip
        with pytest.raises(ValueError, match="may compare pairs"):
            translated(wrong)
    assert "{u: ZERO, left: ZERO, hits: 0}" in translated("ONCE")


def test_the_build_writes_it(tmp_path, root, source):
    def build(kind, exception=None):
        app = SimpleNamespace(builder=SimpleNamespace(format=kind), outdir=tmp_path)
        explorer_engine.write_engine(app, exception)

    build("latex")
    build("html", RuntimeError())
    assert not list(tmp_path.iterdir())
    build("html")
    assert (tmp_path / "_static" / "explorer_engine.js").read_text("utf-8") == source
    spheres = explorer_engine.spheres()
    assert (tmp_path / "_static" / "explorer_spheres.js").read_text("utf-8") == spheres
    config = yaml.safe_load((root / "_config.yml").read_text("utf-8"))
    assert config["sphinx"]["local_extensions"]["explorer_engine"] == "book/_ext"


def test_one_name_for_one_function(monkeypatch):
    monkeypatch.setattr(runtime, "unit", lambda *_: "def frexp(x):\n    return x")
    with pytest.raises(ValueError, match="function frexp is there twice"):
        explorer_engine.engine()


def test_one_name_for_one_thing_in_all_rooms():
    """They are joined to one source, where a second FAINT would overwrite the first."""
    names = []
    for node in ast.parse(runtime.unit()).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.append(node.name)
        elif isinstance(node, ast.Assign):
            names += [part.id for target in node.targets for part in ast.walk(target)
                      if isinstance(part, ast.Name)]  # fmt: skip
    assert len(names) > 150
    assert {name for name in names if names.count(name) > 1} == set()


def test_only_one_name_is_left_and_nothing_is_asked_for(source):
    script = Script("var before = Object.getOwnPropertyNames(globalThis)")
    script.context.eval(source)
    names = "() => Object.getOwnPropertyNames(globalThis).filter(name => !before.includes(name))"
    assert script(names) == ["cradle"]
    script.context.close()
    for word in ("import", "export", "fetch", "Worker", "XMLHttpRequest", "http"):
        assert f"{word}(" not in source
        assert f"\n{word} " not in source
    # From a file a page reads what it is told to be; plain ASCII is the same in every encoding.
    assert source.isascii()
