"""Change a scene file that a person wrote: one entry, and all else stays as it is."""

from __future__ import annotations

import json
import re
import textwrap

from plugins.tasks.file.tree import Tree

_HEAD = re.compile(r"variations:[ \t]*(#.*)?")
_EMPTY = re.compile(r"variations:[ \t]*(?:\{[ \t]*\}|~|null)[ \t]*(#.*)?")


def set_variation(tree: Tree, text: str, name: str, block: str) -> str:
    """Write a variation into a scene file, in the place of one of that name.

    Args:
        tree: of the file.
        text: of the file.
        name: of the variation.
        block: its lines, of which the first has its name.
    """
    rows = text.splitlines()
    block = textwrap.dedent(block)
    if "variations" not in tree.data:
        return "\n".join([*rows, "variations:", *_indent(block, 2)]) + "\n"

    start = tree.lines["variations",] - 1
    head = rows[start].rstrip()
    empty = _EMPTY.fullmatch(head)
    if empty:
        rows[start] = f"variations:  {empty[1] or ''}".rstrip()
        rows[start + 1 : start + 1] = _indent(block, 2)
    elif _HEAD.fullmatch(head):
        _replace_block(tree, rows, name, block)
    else:
        _unfold(tree, rows, name, block)

    return "\n".join(rows) + "\n"


def _replace_block(tree: Tree, rows: list[str], name: str, block: str) -> None:
    """Replace a variation that has lines of its own, or put one before the others."""
    start = tree.lines["variations",] - 1
    firsts = [line for where, line in tree.lines.items() if _is_variation(where)]
    depth = 2
    if firsts:
        row = rows[min(firsts) - 1]
        depth = len(row) - len(row.lstrip())

    if ("variations", name) in tree.lines:
        first = tree.lines["variations", name] - 1
        last = first + 1
        while last < len(rows) and rows[last].startswith(" " * (depth + 1)):
            last += 1
        del rows[first:last]

    rows[start + 1 : start + 1] = _indent(block, depth)


def _unfold(tree: Tree, rows: list[str], name: str, block: str) -> None:
    """Write variations that stand in braces in lines of their own, with another one."""
    start = tree.lines["variations",] - 1
    keys = [line for where, line in tree.lines.items() if len(where) == 1]
    end = min([line - 1 for line in keys if line - 1 > start], default=len(rows))
    while end > start + 1 and re.fullmatch(r"\s*(#.*)?", rows[end - 1]):
        end -= 1

    others = []
    for other, ranges in tree.data["variations"].items():
        if other != name:
            others.append(f"  {other}: {json.dumps(ranges)}")

    rows[start:end] = ["variations:", *_indent(block, 2), *others]


def _is_variation(where: tuple[str | int, ...]) -> bool:
    return len(where) == 2 and where[0] == "variations"


def _indent(block: str, depth: int) -> list[str]:
    return textwrap.indent(block, " " * depth).splitlines()
