"""How dense the code is: one line, one thought."""

import ast
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)


@dataclass
class Density:
    """The lines of a folder, and what is dense in them."""

    lines: int = 0
    packed: int = 0
    nested: int = 0
    conditional: int = 0
    chained: int = 0

    def add(self, text):
        self.lines += text.count("\n")
        for node in ast.walk(ast.parse(text)):
            self.packed += is_packed(node)
            self.nested += is_nested(node)
            self.conditional += isinstance(node, ast.IfExp)
            self.chained += is_chained(node)

    def by_thousand_lines(self, count):
        return 1000 * count / self.lines


def is_packed(node):
    """As ``a, b = x, y``."""
    return (
        isinstance(node, ast.Assign)
        and isinstance(node.value, ast.Tuple)
        and any(isinstance(target, ast.Tuple) for target in node.targets)
    )


def is_nested(node):
    """A comprehension with two loops, or within another."""
    if not isinstance(node, COMPREHENSIONS):
        return False
    inside = chain.from_iterable(map(ast.walk, ast.iter_child_nodes(node)))
    return len(node.generators) > 1 or any(
        isinstance(inner, COMPREHENSIONS) for inner in inside
    )


def is_chained(node):
    """As ``a if b else c if d else e``."""
    return isinstance(node, ast.IfExp) and any(
        isinstance(inner, ast.IfExp) for inner in (node.body, node.orelse)
    )


def measure(folder):
    density = Density()
    for file in (ROOT / folder).rglob("*.py"):
        density.add(file.read_text(encoding="utf-8"))
    return density


@pytest.mark.parametrize("folder", ["core", "plugins"])
def test_a_line_has_one_thought(folder):
    density = measure(folder)
    assert density.by_thousand_lines(density.packed) <= 0.5
    assert density.by_thousand_lines(density.nested) <= 1.1
    assert density.by_thousand_lines(density.conditional) <= 9
    assert density.chained == 0


@pytest.mark.parametrize(
    ("code", "wrong"),
    [
        ("a, b = x, y", [is_packed]),
        ("a, b = pair", []),
        ("[a for b in c for a in b]", [is_nested]),
        ("[max(a for a in b) for b in c]", [is_nested]),
        ("[a for a in b]", []),
        ("a if b else c", []),
        ("a if b else c if d else e", [is_chained]),
        ("(a if b else c) if d else e", [is_chained]),
    ],
)
def test_dense_code_is_found(code, wrong):
    nodes = list(ast.walk(ast.parse(code)))
    rules = [is_packed, is_nested, is_chained]
    assert [rule for rule in rules if any(map(rule, nodes))] == wrong
