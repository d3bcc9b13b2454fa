"""Take from source files what a prompt needs."""

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
from core.values.layouts import NONE

_SECTION = re.compile(r"\n\n +(Args|Raises):.*?(?=\n? *\"\"\"\n)", re.DOTALL)


@lru_cache
def function_source(function: Callable[..., Any]) -> str:
    """Take a function's source without its docstring."""
    lines, (node,) = inspect.getsource(function).splitlines(), ast.parse(inspect.getsource(function)).body
    assert isinstance(node, ast.FunctionDef)
    if ast.get_docstring(node) is not None:
        del lines[node.body[0].lineno - 1 : node.body[0].end_lineno]
    return "\n".join(lines)


@lru_cache
def class_source(part: type, *members: str) -> str:
    """Take a class's head, its docstring without sections, and these members."""
    text = _SECTION.sub("", inspect.getsource(part), count=1)
    lines, (node,) = text.splitlines(), ast.parse(text).body
    assert isinstance(node, ast.ClassDef)
    kept = lines[: node.body[0].end_lineno]
    for child in node.body[1:]:
        target = child.target if isinstance(child, ast.AnnAssign) else None
        name = target.id if isinstance(target, ast.Name) else getattr(child, "name", None)
        if name in members:
            decorators = getattr(child, "decorator_list", [])
            first = min(each.lineno for each in (child, *decorators))
            kept += [*[""] * bool(decorators), *lines[first - 1 : child.end_lineno]]
    return "\n".join(kept)


def task_source(task: Task) -> str:
    """Return the task's file, without its short description, and without variations where the task has none of them."""
    text = task.source()
    left_out = {"in_words", *(("variations",) if task.variation == NONE else ())}
    if task.language != "python":
        keys = "|".join(sorted(left_out))
        return re.sub(rf"^({keys}):.*?(?=^[^\s#]|\Z)", "", text, flags=re.MULTILINE | re.DOTALL)
    lines = text.splitlines(keepends=True)
    members = [m for part in ast.parse(text).body if isinstance(part, ast.ClassDef) for m in part.body]
    for member in reversed(members):
        targets = member.targets if isinstance(member, ast.Assign) else []
        if any(isinstance(target, ast.Name) and target.id in left_out for target in targets):
            del lines[member.lineno - 1 : member.end_lineno]
    return "".join(lines)


def helpers(task: Task) -> str:
    """Take the heads and docstrings of the functions that a task's file imports from its own package.

    A function without a docstring is taken whole.
    """
    module = sys.modules[type(task).__module__]
    package = module.__name__.partition(".")[0]
    functions = [inspect.unwrap(value) for value in vars(module).values() if callable(value)]
    taken = [
        _head(function)
        for function in functions
        if inspect.isfunction(function)
        and function.__module__ != module.__name__
        and function.__module__.partition(".")[0] == package != "core"
        and function.__name__.isidentifier()  # no lambda
    ]
    return "\n\n".join(taken)


def _head(function: Callable[..., Any]) -> str:
    text = textwrap.dedent(inspect.getsource(function))
    (node,) = ast.parse(text).body
    assert isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    documented = ast.get_docstring(node) is not None
    return "\n".join(text.splitlines()[: node.body[0].end_lineno if documented else None])
