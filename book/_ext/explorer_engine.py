"""The live explorer's engine: the package's own event loop as a script for the browser.

`cradle.runtime.compile.unit` joins the rooms of the kernel to one plain source: functions of
numbers, loops, sequences and records. This module writes that source out as JavaScript, statement
by statement, between hand-written parts (`engine_*.js`). Both languages count in the same doubles,
so the script's answers are those of Python, to the last bit (tests/test_explorer_engine.py).

It knows what the kernel is made of and refuses anything else. What looks alike in the two languages
and means something else is not passed on as it stands:

- an expression of constants, such as `1 << 40`, is worked out here: JavaScript shifts 32 bits;
- `max` and `min` keep the first of two equals, so that 0.0 and -0.0 stay what they are;
- a loop over a range knows its limits from the start and keeps its own count;
- in `a < b < c` the middle is written twice, so it must have no effect;
- `==` of two pairs (`complex`) would ask whether they are one object (`explorer_pairs`).
"""

import ast
import json
import re
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from explorer_pairs import equal_pairs

from cradle import kernel
from cradle.kernel import state
from cradle.runtime import compile as runtime
from cradle.runtime import job as drive

if TYPE_CHECKING:  # the npm package is built without it
    from sphinx.application import Sphinx

#: Hand-written parts, beside this file: before the event loop, and after it.
PARTS = ("engine_numbers.js", "engine_collide.js")
#: The part after the contact forces, and all that these need before.
SPHERES = "engine_spheres.js"
CODES = (
    "FINISHED", "UNFINISHED", "REFUSED", "PAUSED", "UNSOUND", "UNDECIDED",
    "MOMENTUM", "ORDER", "ENERGY", "LEDGER",
)  # fmt: skip
NUMBERS = """const max = (a, b) => (b > a ? b : a);
const min = (a, b) => (b < a ? b : a);"""
#: The scripts in the built book.
SCRIPT, SPHERES_SCRIPT = (
    "_static/explorer_engine.js",
    "_static/explorer_spheres.js",
)

OPERATORS: dict[type, str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/",
    ast.USub: "-", ast.Not: "!", ast.And: "&&", ast.Or: "||",
    # Loose on purpose: truth values and numbers compare as in Python.
    ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=",
}  # fmt: skip
#: Words of JavaScript alone.
RESERVED = {
    "case", "catch", "const", "default", "delete", "do", "enum", "export", "extends", "function",
    "let", "new", "super", "switch", "this", "throw", "typeof", "var", "void",
}  # fmt: skip
#: Functions without an effect, and their names in the script.
PURE = {
    "abs": "Math.abs", "max": "max", "min": "min", "sqrt": "Math.sqrt", "log": "Math.log",
    "frexp": "frexp", "ldexp": "ldexp",
}  # fmt: skip


def free(name: str) -> str:
    """Return a name of Python's that may be a word of JavaScript's."""
    return f"{name}$" if name in RESERVED else name


def refuse(node: ast.AST, why: str) -> NoReturn:
    """Raise: the kernel is not made of this."""
    raise ValueError(f"{ast.unparse(node)}: {why}")


def indented(lines: list[str]) -> list[str]:
    """Return lines one step further in."""
    return [f" {line}" for line in lines]


def constant(node: ast.expr) -> str | None:
    """Return what an expression of constants is worth, as JavaScript writes it; None for others."""
    if any(
        isinstance(part, ast.Name | ast.Attribute | ast.Tuple)
        for part in ast.walk(node)
    ):
        return None
    value = eval(ast.unparse(node), {})
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) or (
        isinstance(value, int) and abs(value) <= 2**53
    ):
        return repr(value).removesuffix(".0")
    refuse(node, "a constant that is no double")


def expression(node: ast.expr) -> str:
    """Return an expression, in brackets where it has an operator."""
    known = constant(node)
    if known is not None:
        return known
    match node:
        case ast.Name(name):
            return free(name)
        case ast.Attribute(ast.Name("math"), "inf"):
            return "Infinity"
        case ast.Attribute(owner, name):
            return f"{expression(owner)}.{name}"
        case ast.Subscript(owner, index) if not isinstance(
            index, ast.Slice | ast.UnaryOp
        ):
            return f"{expression(owner)}[{expression(index)}]"
        case ast.Tuple(parts):
            return f"[{', '.join(map(expression, parts))}]"
        case ast.BinOp(left, ast.FloorDiv(), right):
            return f"Math.floor({expression(left)} / {expression(right)})"
        case ast.BinOp(left, ast.Pow(), right) if not isinstance(
            getattr(right, "value", None), int
        ):  # a power's last bit may differ, a square's must not
            return f"Math.pow({expression(left)}, {expression(right)})"
        case ast.BinOp(left, op, right) if type(op) in OPERATORS:
            return f"({expression(left)} {OPERATORS[type(op)]} {expression(right)})"
        case ast.UnaryOp(op, operand) if type(op) in OPERATORS:
            return f"({OPERATORS[type(op)]}{expression(operand)})"
        case ast.BoolOp(op, values):
            return f"({f' {OPERATORS[type(op)]} '.join(map(expression, values))})"
        case ast.IfExp(test, yes, no):
            return f"({expression(test)} ? {expression(yes)} : {expression(no)})"
        case ast.Compare(left, operators, others):
            return comparison(node, [left, *others], operators)
        case ast.Call(func, given, []):
            return call(func, [expression(argument) for argument in given])
    refuse(node, f"{type(node).__name__} is not translated")


def comparison(
    node: ast.Compare, sides: list[ast.expr], operators: list[ast.cmpop]
) -> str:
    """Return a comparison, a chain of them as pairs."""
    for side in sides[1:-1]:
        for part in ast.walk(side):
            if isinstance(part, ast.Call) and called(part.func) not in PURE:
                refuse(node, "a call in the middle would be made twice")
    pairs = []
    for left, op, right in zip(
        sides[:-1], operators, sides[1:], strict=True
    ):
        if type(op) not in OPERATORS:
            refuse(node, "not a comparison of numbers")
        pairs.append(
            f"{expression(left)} {OPERATORS[type(op)]} {expression(right)}"
        )
    return f"({' && '.join(pairs)})"


def called(function: ast.expr) -> str:
    """Return the name of a function that is called."""
    match function:
        case ast.Name(name) | ast.Attribute(ast.Name("math"), name):
            return name
    refuse(function, "not a function of the kernel or of math")


def call(function: ast.expr, given: list[str]) -> str:
    """Return a call."""
    name = called(function)
    if name == "len":
        return f"{given[0]}.length"
    if name in ("max", "min"):
        while len(given) > 2:
            given[:2] = [f"{name}({given[0]}, {given[1]})"]
    return f"{PURE.get(name, name)}({', '.join(given)})"


def assignment(targets: list[ast.expr], value: ast.expr) -> list[str]:
    """Return an assignment; the parts of a tuple are all made before the first is stored."""
    match targets:
        case [ast.Tuple(parts)]:
            stores = [
                f"{expression(part)} = $parts[{at}];"
                for at, part in enumerate(parts)
                if not (isinstance(part, ast.Name) and part.id == "_")
            ]
            return [f"$parts = {expression(value)};", *stores]
    for target in targets:
        if not isinstance(target, ast.Name | ast.Attribute | ast.Subscript):
            refuse(target, "not assigned to")
    # Python stores the first target first, JavaScript the last: they are different places.
    return [f"{' = '.join(map(expression, [*targets, value]))};"]


def loop(node: ast.For) -> list[str]:
    """Return a loop over a range, or over some given numbers."""
    target, body = expression(node.target), indented(block(node.body))
    match node.iter:
        case ast.Tuple():
            return [
                f"for ({target} of {expression(node.iter)}) {{",
                *body,
                "}",
            ]
        case ast.Call(ast.Name("range"), limits, []):
            given = [expression(limit) for limit in limits]
            start, stop, step = {
                1: ["0", *given, "1"],
                2: [*given, "1"],
                3: given,
            }[len(given)]
            if step not in ("1", "-1"):
                refuse(node.iter, "a step other than 1 and -1")
            more, move = ("<", "++") if step == "1" else (">", "--")
            head = f"let $at = {start}, $stop = {stop}; $at {more} $stop; $at{move}"
            return [f"for ({head}) {{", f" {target} = $at;", *body, "}"]
    refuse(node.iter, "not a range")


def statement(node: ast.stmt) -> list[str]:
    """Return the lines of a statement."""
    match node:
        case ast.Assign(targets, value):
            return assignment(targets, value)
        case ast.AugAssign(target, op, value) if type(op) in OPERATORS:
            return [
                f"{expression(target)} {OPERATORS[type(op)]}= {expression(value)};"
            ]
        case ast.If(test, body, other):
            rest = ["} else {", *indented(block(other))] if other else []
            return [
                f"if ({expression(test)}) {{",
                *indented(block(body)),
                *rest,
                "}",
            ]
        case ast.While(test, body, []):
            return [
                f"while ({expression(test)}) {{",
                *indented(block(body)),
                "}",
            ]
        case ast.For(orelse=[]):
            return loop(node)
        case ast.Return(value):
            return [f"return {expression(value)};" if value else "return;"]
        case ast.Expr(ast.Call() as value):
            return [f"{expression(value)};"]
        case ast.Break():
            return ["break;"]
        case ast.Continue():
            return ["continue;"]
    refuse(node, f"{type(node).__name__} is not translated")


def block(body: list[ast.stmt]) -> list[str]:
    """Return the lines of some statements."""
    return [line for node in body for line in statement(node)]


def function(node: ast.FunctionDef) -> list[str]:
    """Return a function; its variables are declared at its beginning, as in Python."""
    given = [free(argument.arg) for argument in node.args.args]
    stored = {
        free(part.id)
        for part in ast.walk(node)
        if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)
    }
    names = sorted({"$parts", *stored} - set(given))
    head = f"function {node.name}({', '.join(given)}) {{"
    return [
        head,
        *indented([f"let {', '.join(names)};", *block(node.body)]),
        "}",
    ]


def record(node: ast.ClassDef) -> list[str]:
    """Return what makes a record: of given parts for a named tuple, of zeros for the others."""
    names = [field.target.id for field in node.body]
    if node.bases:
        given = ", ".join(
            f"{field.target.id} = {expression(field.value)}"
            if field.value
            else field.target.id
            for field in node.body
        )
        return [
            f"function {node.name}({given}) {{",
            f" return {{{', '.join(names)}}};",
            "}",
        ]
    inside = ", ".join(
        f"{field.target.id}: {'ZERO' if ast.unparse(field.annotation) == 'complex' else 0}"
        for field in node.body
    )
    return [f"function {node.name}() {{", f" return {{{inside}}};", "}"]


def translate(source: str) -> str:
    r"""Return a kernel's source as JavaScript.

    >>> print(translate("def twice(x):\n    return 2.0 * x"))
    function twice(x) {
     let $parts;
     return (2 * x);
    }
    """
    lines: list[str] = []
    tree = ast.parse(source)
    for node in equal_pairs(tree):
        refuse(node, "may compare pairs")
    for node in tree.body:
        match node:
            case ast.Import() | ast.ImportFrom() | ast.If():
                pass  # math, typing, and the decorators that compile
            case ast.FunctionDef():
                lines += function(node)
            case ast.ClassDef():
                lines += record(node)
            case ast.Assign([target], value):
                lines.append(
                    f"const {expression(target)} = {expression(value)};"
                )
            case _:
                refuse(node, f"{type(node).__name__} is not translated")
    return "\n".join(lines)


def engine() -> str:
    """Return the whole script: one function that is called at once and leaves the name `cradle`."""
    before, after = (
        (Path(__file__).parent / name).read_text(encoding="utf-8")
        for name in PARTS
    )
    loop = (
        "// The event loop of the package cradle, translated.\n"
        + translate(runtime.unit(kernel.EVENT_LOOP))
        + f"\nconst DEFECTS = {json.dumps(drive.DEFECTS)};\n"
    )
    inside = "\n".join([before, loop, after])
    return room(inside)


def room(inside: str) -> str:
    """Return a script in a room of its own."""
    # A second function of a name would replace the first without a word.
    names = Counter(re.findall(r"^function (\w+)", inside, re.MULTILINE))
    if names.most_common(1)[0][1] > 1:
        raise ValueError(
            f"function {names.most_common(1)[0][0]} is there twice"
        )
    return f'(function () {{\n"use strict";\n{inside}}})();\n'


def spheres() -> str:
    """Return the script of the contact forces, which adds `cradle.spheres` to the page."""
    after = (Path(__file__).parent / SPHERES).read_text(encoding="utf-8")
    codes = [f"{name} = {getattr(state, name)}" for name in CODES]
    source = "\n".join([*codes, runtime.unit(kernel.CONTACT_FORCES)])
    return room(f"{NUMBERS}\n{translate(source)}\n{after}")


def write_engine(app: "Sphinx", exception: Exception | None) -> None:
    """Put the script into the built book."""
    if exception is None and app.builder.format == "html":
        for name, script in ((SCRIPT, engine), (SPHERES_SCRIPT, spheres)):
            target = Path(app.outdir, name)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(script(), encoding="utf-8")


def setup(app: "Sphinx") -> dict[str, Any]:
    """Register the callback."""
    app.connect("build-finished", write_engine)
    return {
        "version": "1",
        "parallel_read_safe": True,
        "parallel_write_safe": True,
    }
