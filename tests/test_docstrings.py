"""What docstrings, comments and pages name in backticks is there."""

import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("core", "plugins", "tasks")
MENTION = re.compile(
    r"(?<!`)`([A-Za-z_]\w*(?:\.(?!py`)\w+)+)`(?!`)"
)  # `a.b`, not ``a.b``
PATH = re.compile(r"`((?:core|plugins|tasks|tests|prompts|conf)/[\w/]+(?:\.\w+)?/?)`")


def dotted(file):
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


@cache
def modules():
    """Every module of the program, by its dotted name."""
    files = [file for folder in FOLDERS for file in (ROOT / folder).rglob("*.py")]
    return {dotted(file): ast.parse(file.read_text("utf-8")) for file in files}


@cache
def classes():
    """All classes of one name, by that name."""
    found = defaultdict(list)
    for tree in modules().values():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                found[node.name].append(node)
    return found


def names_of(body):
    """What statements define, import or assign, also within branches."""
    names = set()
    for node in body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign):
            targets = [part for target in node.targets for part in ast.walk(target)]
            names |= {part.id for part in targets if isinstance(part, ast.Name)}
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            names.add(node.target.id)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, ast.If | ast.Try):
            names |= names_of(node.body)
    return names


@cache
def members(name, heirs=()):
    """What all classes of a name have, with what they inherit; None: not known, for they inherit from others.

    Two modules may have classes of one name: ``heirs`` are those that were looked at already.
    """
    found = set()
    for node in classes()[name]:
        found |= names_of(node.body)
        for inner in ast.walk(node):
            is_own = isinstance(inner, ast.Attribute) and isinstance(
                inner.ctx, ast.Store
            )
            if is_own and ast.unparse(inner.value) == "self":
                found.add(inner.attr)
        for base in map(ast.unparse, node.bases):
            plain = base.partition("[")[0].rpartition(".")[2]
            if plain in (name, *heirs):
                continue
            known = plain in classes()
            inherited = members(plain, (*heirs, name)) if known else None
            if inherited is None and plain not in ("ABC", "Protocol", "Generic"):
                return None
            found |= inherited or set()
    return found


def is_there(name):
    """Report whether a dotted name leads somewhere; so does each whose first part is none of ours."""
    parts = name.split(".")
    if parts[0] not in FOLDERS:
        own, member, *_ = parts
        if own not in classes():
            return True
        known = members(own)
        return known is None or member in known

    for count in range(len(parts), 0, -1):
        module = ".".join(parts[:count])
        if module not in modules():
            continue
        rest = parts[count:]
        if not rest:
            return True
        if rest[0] not in names_of(modules()[module].body):
            return False
        if len(rest) == 1 or rest[0] not in classes():
            return len(rest) == 1
        known = members(rest[0])
        return known is None or rest[1] in known
    return False


@pytest.mark.parametrize("folder", FOLDERS)
def test_what_a_docstring_names_is_there(folder):
    missing = []
    for file in sorted((ROOT / folder).rglob("*.py")):
        # In Python a backtick stands in texts and comments alone.
        for line, text in enumerate(file.read_text("utf-8").splitlines(), start=1):
            names = MENTION.findall(text)
            missing += [
                f"{file.relative_to(ROOT)}:{line}: {name}"
                for name in names
                if not is_there(name)
            ]
    assert not missing, "\n".join(missing)


def test_what_a_page_names_is_there():
    pages = {*(ROOT / "docs").rglob("*.md"), *ROOT.glob("*.md")}
    missing = []
    for page in sorted(pages - {ROOT / "CHANGELOG.md"}):  # that names what went, too
        text = page.read_text("utf-8")
        where = page.relative_to(ROOT)
        names = MENTION.findall(text)
        missing += [f"{where}: {name}" for name in names if not is_there(name)]
        paths = PATH.findall(text)
        missing += [f"{where}: {path}" for path in paths if not (ROOT / path).exists()]
    assert not missing, "\n".join(missing)


@pytest.mark.parametrize(
    ("name", "there"),
    [
        ("core.trial.Evaluation", True),
        ("core.trial.Evaluation.finals", True),
        ("core.trial.Evaluation.final", False),
        ("core.trial.Nothing", False),
        ("core.nowhere.Evaluation", False),
        ("Evaluation.finals", True),
        ("Evaluation.final", False),
        ("numpy.nothing", True),
    ],
)
def test_a_stale_name_is_found(name, there):
    assert is_there(name) == there
