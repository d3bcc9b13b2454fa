"""Write what a prompt shows of a task's source and its vocabulary."""

from __future__ import annotations

import ast
import inspect
import re
import sys
import textwrap
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from core.interfaces import Task

BODY = (
    "name",
    "pose",
    "mass",
    "visuals",
    "collisions",
    "friction",
    "rolling_friction",
    "restitution",
)
"""Members of `Body` that are shown."""

_SECTION = re.compile(r"\n\n +(Args|Raises):.*?(?=\n? *\"\"\"\n)", re.DOTALL)
_HIDDEN_ENTRIES = re.compile(
    r"^(in_words|variations):.*?(?=^[^\s#]|\Z)", re.MULTILINE | re.DOTALL
)


@lru_cache
def class_source(part: type, *members: str) -> str:
    """Take a class's head, its docstring without sections, and these fields.

    Args:
        part: the class.
        members: names of its annotated fields.
    """
    text = _SECTION.sub("", inspect.getsource(part), count=1)
    lines = text.splitlines()
    (node,) = ast.parse(text).body
    assert isinstance(node, ast.ClassDef)
    docstring, *body = node.body
    kept = lines[: docstring.end_lineno]

    for child in body:
        if not isinstance(child, ast.AnnAssign):
            continue

        if isinstance(child.target, ast.Name) and child.target.id in members:
            kept += lines[child.lineno - 1 : child.end_lineno]

    return "\n".join(kept)


def task_source(task: Task) -> str:
    """Return the task's file without what the prompt says elsewhere, or what its reward does not read.

    Left out are its short description, its variations (what a design is judged by has their ranges) and goals that the
    reward does not name.

    Of a task that is a YAML file, the entries of that file are left out in the same way.
    """
    text = task.source()
    if task.language != "python":
        return _HIDDEN_ENTRIES.sub("", text)

    members: list[ast.stmt] = []
    for part in ast.parse(text).body:
        if isinstance(part, ast.ClassDef):
            members += part.body

    hidden = {"in_words", "variations"}
    rewards = [m for m in members if isinstance(m, ast.FunctionDef)]
    rewards = [method for method in rewards if method.name == "reward"]

    if rewards and "goals" not in ast.unparse(rewards[0]):
        hidden |= {"goals", "every"}

    lines = text.splitlines(keepends=True)
    for member in reversed(members):
        targets = member.targets if isinstance(member, ast.Assign) else []
        if any(isinstance(t, ast.Name) and t.id in hidden for t in targets):
            del lines[member.lineno - 1 : member.end_lineno]

    return "".join(lines)


def helpers(task: Task) -> str:
    """Take the heads and docstrings of the functions that a task's file imports from its own package.

    A function without a docstring is taken whole. A task whose text is no Python has none.
    """
    if task.language != "python":
        return ""

    module = sys.modules[type(task).__module__]
    package = module.__name__.partition(".")[0]

    heads = []

    for value in vars(module).values():
        function = inspect.unwrap(value) if callable(value) else value
        if not inspect.isfunction(function) or function.__name__ == "<lambda>":
            continue

        origin = function.__module__
        is_imported = origin != module.__name__

        if is_imported and origin.partition(".")[0] == package != "core":
            heads.append(_take_head(function))

    return "\n\n".join(heads)


def _take_head(function: Callable[..., Any]) -> str:
    """Take a function's lines up to the end of its docstring; all of them if it has none."""
    text = textwrap.dedent(inspect.getsource(function))
    (node,) = ast.parse(text).body
    assert isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    if ast.get_docstring(node) is None:
        return text.rstrip("\n")

    return "\n".join(text.splitlines()[: node.body[0].end_lineno])
