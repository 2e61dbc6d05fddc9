"""Where the kernel may compare pairs: complex numbers, which are objects in JavaScript.

Python compares their parts, JavaScript would ask whether they are one object.
"""

import ast
from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise


def kinds_of_names(tree: ast.Module) -> dict[str, set[str]]:
    """Return what the fields of records, and the constants, are: pairs, numbers, or both."""
    kinds = defaultdict(set, real={"number"}, imag={"number"})
    for node in tree.body:
        match node:
            case ast.ClassDef(body=fields):
                for field in fields:
                    kind = ast.unparse(field.annotation)
                    if kind != "Any":
                        pair = kind == "complex"
                        kinds[field.target.id].add(
                            "pair" if pair else "number"
                        )
            case ast.Assign(targets, value):
                for part in ast.walk(targets[0]):
                    if isinstance(part, ast.Name):
                        pair = isinstance(value, ast.Call)
                        kinds[part.id].add("pair" if pair else "number")
    return kinds


def equal_pairs(tree: ast.Module) -> Iterator[ast.Compare]:
    """Yield each `==` and `!=` but those with a number on one side and no pair on the other."""
    names = kinds_of_names(tree)
    for part in tree.body:
        counters = {
            ast.unparse(node.target)
            for node in ast.walk(part)
            if isinstance(node, ast.For) and isinstance(node.iter, ast.Call)
        }
        for node in ast.walk(part):
            if not isinstance(node, ast.Compare):
                continue
            sides = [
                kinds(side, names, counters)
                for side in (node.left, *node.comparators)
            ]
            for op, both in zip(node.ops, pairwise(sides), strict=True):
                safe = {"number"} in both and {"pair"} not in both
                if isinstance(op, ast.Eq | ast.NotEq) and not safe:
                    yield node


def kinds(
    side: ast.expr, names: dict[str, set[str]], counters: set[str]
) -> set[str]:
    """Return what one side may be, as far as its own looks tell; nothing if they do not."""
    match side:
        case ast.Name(name) if name in counters:
            return {"number"}
        case ast.Name(name) | ast.Attribute(_, name):
            known = isinstance(side, ast.Attribute) or name.isupper()
            return names[name] if known else set()
        case ast.Constant() | ast.BinOp() | ast.UnaryOp() | ast.Compare():
            return {"number"}
        case ast.BoolOp(_, values):
            each = (kinds(value, names, counters) for value in values)
            return set.intersection(*each)
    return set()
