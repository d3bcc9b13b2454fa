"""Write what a prompt shows of a task's source and its vocabulary."""

from __future__ import annotations

import ast
import inspect
import re
import sys
import textwrap
from collections.abc import Callable
from typing import Any

from core.interfaces import Task

_SECTION = re.compile(r"\n\n +(Args|Raises):.*?(?=\n? *\"\"\"\n)", re.DOTALL)
_EDITOR_COMMENT = re.compile(r"^# *yaml-language-server:.*\n", re.MULTILINE)
_HIDDEN_ENTRIES = re.compile(
    r"^(description|camera|in_words|variations):.*?(?=^[^\s#]|\Z)",
    re.MULTILINE | re.DOTALL,
)


def class_source(part: type) -> str:
    """Take a class's head, its docstring without sections, and its fields."""
    head, _, _ = inspect.getsource(part).partition("\n    def ")
    return _SECTION.sub("", head, count=1).rstrip()


def task_source(task: Task) -> str:
    """Return the task's file without what the prompt says elsewhere, or what its reward does not read.

    Left out are imports, its descriptions, its camera, its variations (what a design is judged by has their ranges),
    its margins (feedback names them) and goals that the reward does not name.

    Of a task that is a YAML file, the entries of that file are left out in the same way, and what an editor reads.
    """
    text = task.source()
    if task.language != "python":
        return _HIDDEN_ENTRIES.sub("", _EDITOR_COMMENT.sub("", text))

    parts = ast.parse(text).body
    members: list[ast.stmt] = []
    for part in parts:
        if isinstance(part, ast.ClassDef):
            members += part.body

    hidden = {"description", "camera", "in_words", "variations"}
    rewards = [m for m in members if isinstance(m, ast.FunctionDef)]
    rewards = [method for method in rewards if method.name == "reward"]

    if rewards and "goals" not in ast.unparse(rewards[0]):
        hidden |= {"goals", "every"}

    lines = text.splitlines(keepends=True)
    for member in reversed(members):
        targets = member.targets if isinstance(member, ast.Assign) else []
        if any(isinstance(t, ast.Name) and t.id in hidden for t in targets):
            del lines[member.lineno - 1 : member.end_lineno]
        elif isinstance(member, ast.FunctionDef) and member.name == "margins":
            del lines[member.lineno - 2 : member.end_lineno]  # with the line above it

    for part in reversed(parts):
        if isinstance(part, ast.Import | ast.ImportFrom):
            del lines[part.lineno - 1 : part.end_lineno]

    return "".join(lines).strip()


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
