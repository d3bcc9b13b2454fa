"""Where numbers of a scene file come from: marks at the ends of lines, ``# seen``, ``# told`` or ``# assumed``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from plugins.tasks.file.tree import Tree, Where

MARKED = ("bodies", "marks", "joints")
"""The parts of a file whose numbers need a mark."""

_MARKS = re.compile(r" # *((?:(?:seen|told|assumed)[, ]*)+)")


class Numbers:
    """The numbers of a scene file by their paths, such as ``bodies.mug.position.x``, and where they come from.

    Attributes:
        values: of all.
        marks: ``seen``, ``told`` or ``assumed``, of those that have one.
        unmarked: a line for each line of the file whose numbers need a mark.
    """

    def __init__(self, tree: Tree, text: str) -> None:
        self.values: dict[str, float] = {}
        self.marks: dict[str, str] = {}
        self.unmarked: list[str] = []
        self._text = text
        self._spans: dict[str, tuple[int, int]] = {}
        lines = dict[int, list[str]]()
        for where, span in tree.spans.items():
            value, path = _follow(tree.data, where)
            if isinstance(value, int | float) and not isinstance(value, bool):
                self.values[path] = float(value)
                self._spans[path] = span
                if where[0] in MARKED:
                    lines.setdefault(tree.lines[where], []).append(path)

        rows = text.splitlines()
        for line, paths in lines.items():
            found = _MARKS.search(rows[line - 1])
            if found is None:
                mend = "end the line with # seen, # told or # assumed"
                self.unmarked.append(f"line {line}: {paths[0]} has no mark; {mend}")
                continue

            words = found[1].replace(",", " ").split()
            if len(words) < len(paths):
                words = words[:1] * len(paths)

            self.marks |= zip(paths, words, strict=False)

    def write(self, values: Mapping[str, float]) -> str:
        """Return the file's text with other numbers; all else stays as it is."""
        text = self._text
        for path in sorted(values, key=lambda path: -self._spans[path][0]):
            begin, end = self._spans[path]
            text = f"{text[:begin]}{round(values[path], 5) + 0.0:.8g}{text[end:]}"

        return text


def _follow(data: Any, where: Where) -> tuple[Any, str]:
    """Return what stands somewhere, and the path to it."""
    names = list[str]()
    for step in where:
        name = str(step)
        data = data[step]
        if isinstance(step, int) and isinstance(data, Mapping):
            name = str(data.get("name", step))
        elif isinstance(step, int) and step < 3 and not isinstance(data, list):
            axes = ("roll", "pitch", "yaw") if "rpy_deg" in where else "xyz"
            name = axes[step]

        names.append(name)

    return data, ".".join(names)
