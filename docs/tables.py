"""Write the tables of pages that follow from the code, as Markdown: kinds of shapes, kinds of goals, codes."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, fields
from pathlib import Path

from core import geometry, goals
from core.errors import CATALOGUE
from core.goals import Goal, Limit, Reach
from core.support import inputs  # noqa: F401  # has codes

ROOT = Path(__file__).parent.parent
ATTRIBUTE = re.compile(r"^ {8}(\w+): (.*(?:\n {12}.*)*)", re.MULTILINE)
"""A field in a class's docstring."""


def write_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a table, a line for each row."""
    first, *others = [f"| {' | '.join(row)} |\n" for row in (head, *rows)]
    return "".join([first, "|", "---|" * len(head), "\n", *others])


def shape_table() -> str:
    """Write a row for each kind of shape."""
    rows = []
    for kind in geometry.KINDS:
        lengths = ", ".join(f"`{name}`" for name in kind.lengths())
        rows.append((f"`{kind.__name__}`", lengths, f"`{kind.kind}`", kind.means))

    return write_table(("type", "takes", "in scene files and designs", ""), rows)


def goal_tables() -> str:
    """Write the kinds of goals with their fields, those that all to reach have, and what scene files have more."""
    reaches = [kind for kind in goals.KINDS if issubclass(kind, Reach)]
    limits = [kind for kind in goals.KINDS if issubclass(kind, Limit)]
    shared = [(f"`{field.name}`", *_describe(Reach, field)) for field in fields(Reach)]
    return "\n".join(
        (
            "## Kinds\n",
            write_table(("to reach", "fields"), map(_kind_row, reaches)),
            write_table(("limit", "fields"), map(_kind_row, limits)),
            "## Reach\n\nEvery kind to reach also has these fields.\n",
            write_table(("field", "default", ""), shared),
            "## Keys\n\nIn a scene file the fields above are keys of an entry in `goals`. It has these keys, too.\n",
            write_table(("key", ""), _key_rows()),
        )
    )


def _key_rows() -> Iterator[tuple[str, str]]:
    """Yield a row for each key of a scene file's goals that is no field of its kind."""
    meanings: dict[str, list[str]] = {}
    for kind in (Reach, *goals.KINDS):
        own = {field.name for field in fields(kind)}
        for key, said in kind.keys.items():
            if key in own:
                continue

            known = meanings.setdefault(key, [])
            if said.means not in known:
                known.append(said.means)

    for key, known in meanings.items():
        yield f"`{key}`", "; or: ".join(known)


def refusal_table() -> str:
    """Write a row for each code by which designs, scenes and settings are refused."""
    for file in [
        *ROOT.glob("core/**/refusals.py"),
        *ROOT.glob("plugins/**/refusals.py"),
    ]:
        module = file.relative_to(ROOT).with_suffix("").as_posix()
        importlib.import_module(module.replace("/", "."))

    rows = []
    for code, words in sorted(CATALOGUE.items()):
        shown = re.sub(r"(?<!\{)\{(\w+)[^{}]*\}", r"{\1}", words)
        rows.append((f"`{code}`", shown.replace("<", "&lt;")))

    return write_table(("code", "words"), rows)


def _kind_row(kind: type[Goal]) -> tuple[str, str]:
    """Write what a kind of goal is, and its fields but those that all kinds to reach have."""
    shared = {field.name for field in fields(Reach)}
    what, described = read_docstring(kind)
    said = [
        f"`{name}`: {text}"
        for name, text in described.items()
        if not (issubclass(kind, Reach) and name in shared)
    ]
    return f"`{kind.__name__}`", " ".join([what, *said])


def _describe(kind: type, field: Field[object]) -> tuple[str, str]:
    """Return a field's default and what it is."""
    default = "needed" if field.default is MISSING else str(field.default)
    _, described = read_docstring(kind)
    return default, described[field.name]


def read_docstring(kind: type) -> tuple[str, Mapping[str, str]]:
    """Return the first sentence of a class's docstring, and what it and what it inherits from say of its fields."""
    names = {field.name for field in fields(kind)}  # type: ignore[arg-type]
    described = {}
    for part in reversed(kind.__mro__):
        _, _, section = (part.__doc__ or "").partition("\n    Attributes:\n")
        section, _, _ = section.partition("\n\n")
        for name, said in ATTRIBUTE.findall(section):
            if name in names:
                described[name] = _on_one_line(said)

    return _sentence(kind), described


def _sentence(found: object) -> str:
    """Return the first sentence of a docstring."""
    paragraph, _, _ = (inspect.getdoc(found) or "").partition("\n\n")
    return re.split(r"(?<=\.)\s", _on_one_line(paragraph))[0]


def _on_one_line(text: str) -> str:
    """Join the lines of a docstring, with code as Markdown has it."""
    return " ".join(text.split()).replace("``", "`")
