"""How dense the code is, and how much a reader must hold. The limits are today's figures."""

import ast
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
MOST_NAMES = 25  # of this project, that a file imports
MANY_NAMES = {"core/interfaces.py"}  # it hands them on


@dataclass
class Density:
    """The syntax nodes of a folder, without docstrings; and lines, and what is dense in them."""

    nodes: int = 0
    lines: int = 0
    packed: int = 0
    nested: int = 0
    conditional: int = 0

    def add(self, text, tree):
        self.lines += text.count("\n")
        docstrings = set()
        for node in ast.walk(tree):
            body = getattr(node, "body", None)
            if isinstance(body, list):
                docstrings |= {id(inner) for inner in body if is_text(inner)}
        for node in ast.walk(tree):
            if isinstance(node, ast.expr_context) or id(node) in docstrings:
                continue
            self.nodes += 1
            self.packed += is_packed(node)
            self.nested += is_nested(node)
            self.conditional += isinstance(node, ast.IfExp)
        self.nodes -= len(docstrings)  # the texts themselves

    def by_thousand_lines(self, count):
        return 1000 * count / self.lines


def is_text(node):
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


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


def files_of(folder):
    return sorted((ROOT / folder).rglob("*.py"))


def measure(folder):
    density = Density()
    for file in files_of(folder):
        text = file.read_text(encoding="utf-8")
        density.add(text, ast.parse(text))
    return density


@pytest.mark.parametrize(
    ("folder", "nodes", "in_thousand_lines"),
    [
        ("core", 72_000, 3_500),
        ("plugins", 201_370, 3_800),
        ("tasks", 20_500, 4_450),
    ],
)
def test_no_folder_grows_or_gets_denser(folder, nodes, in_thousand_lines):
    density = measure(folder)
    assert density.nodes <= nodes
    assert density.by_thousand_lines(density.nodes) <= in_thousand_lines


@pytest.mark.parametrize("folder", ["core", "plugins"])
def test_a_line_has_one_thought(folder):
    density = measure(folder)
    assert density.by_thousand_lines(density.packed) <= 0.5
    assert density.by_thousand_lines(density.nested) <= 1.1
    assert density.by_thousand_lines(density.conditional) <= 9


@pytest.mark.parametrize("folder", ["core", "plugins", "tasks"])
def test_no_file_imports_too_much_of_the_project(folder):
    """A file that needs more names does two things."""
    wrong = {}
    for file in files_of(folder):
        names = set()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            module = getattr(node, "module", None) or ""
            if module.split(".")[0] in ("core", "plugins", "tasks"):
                names |= {f"{module}.{alias.name}" for alias in node.names}
        if len(names) > MOST_NAMES:
            wrong[file.relative_to(ROOT).as_posix()] = len(names)
    assert wrong.keys() <= MANY_NAMES, wrong


@pytest.mark.parametrize(
    ("code", "packed", "nested"),
    [
        ("a, b = x, y", True, False),
        ("a, b = pair", False, False),
        ("[a for b in c for a in b]", False, True),
        ("[max(a for a in b) for b in c]", False, True),
        ("[a for a in b]", False, False),
    ],
)
def test_dense_code_is_found(code, packed, nested):
    nodes = list(ast.walk(ast.parse(code)))
    assert any(map(is_packed, nodes)) == packed
    assert any(map(is_nested, nodes)) == nested
