"""What others may build on: ``python -m tests.contract`` writes the list of it, ``tests/contract.txt``.

Run it after a public name or key was added. What was taken away stays in the list until CHANGELOG.md names it.
"""

from __future__ import annotations

import ast
import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from core import geometry, goals
from core.config.compose import load
from core.config.sources import defaults
from core.plugins import KINDS, installed

ROOT = Path(__file__).parents[1]
LIST = ROOT / "tests" / "contract.txt"
# Files of core that are programs, not what a plugin imports.
PROGRAMS = {"__init__", "__main__", "run", "evaluate", "prompt"}


def current() -> set[str]:
    """Return a line for each public name, key, part, setting and column of today."""
    return {*names(), *keys(), *command_keys(), *parts(), *columns()}


def names() -> Iterator[str]:
    """Public names that the flat files of core, and its package of goals, define or hand on."""
    files = {file.stem: file for file in (ROOT / "core").glob("*.py")}
    files["goals"] = ROOT / "core" / "goals" / "__init__.py"
    for module in files.keys() - PROGRAMS:
        for name in public(ast.parse(files[module].read_text())):
            yield f"name core.{module}.{name}"


def public(module: ast.Module) -> Iterator[str]:
    for node in module.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            found = [node.name]
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found = [target.id for target in targets if isinstance(target, ast.Name)]
            if found == ["__all__"]:
                found = ast.literal_eval(node.value)
        elif isinstance(node, ast.ImportFrom):  # handed on: `X as X`
            found = [alias.asname for alias in node.names if alias.asname == alias.name]
        else:
            found = []
        yield from (name for name in found if name and not name.startswith("_"))


def kinds() -> set[str]:
    """Names of the kinds of goals and shapes: a new one joins the list when it is next written."""
    return {
        *(f"name core.goals.{kind.__name__}" for kind in goals.KINDS),
        *(f"name core.geometry.{kind.__name__}" for kind in geometry.KINDS),
    }


def keys() -> Iterator[str]:
    """Keys of the configuration of a run with default parts."""
    config = OmegaConf.to_container(load("config", []), resolve=False)
    for key in flat(config, ""):
        yield f"key {key}"


def flat(config: Any, prefix: str) -> Iterator[str]:
    for key, value in config.items():
        if isinstance(value, dict):
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}"


def command_keys() -> Iterator[str]:
    """Keys that schemas of commands define."""
    for file in (ROOT / "plugins").rglob("*.py"):
        for node in ast.parse(file.read_text()).body:
            if isinstance(node, ast.ClassDef) and node.name.endswith("Config"):
                yield from (f"key {node.name}.{key}" for key in public(node))


def parts() -> Iterator[str]:
    """Built-in parts by kind and name, and their settings; commands are among them."""
    for (kind, name), offer in installed().offers.items():
        if offer.distribution == "vlmgineer":
            yield f"part {kind}={name}"
            if kind in KINDS:
                yield from (
                    f"setting {kind}={name}.{key}" for key in defaults(kind, name)
                )


def columns() -> list[str]:
    """Columns of a run's store."""
    schema = (ROOT / "core/store/schema.sql").read_text()
    listed = "SELECT m.name, c.name FROM sqlite_master m, pragma_table_info(m.name) c"
    with closing(sqlite3.connect(":memory:")) as store:
        store.executescript(schema)
        rows = store.execute(listed).fetchall()
    return [f"column {table}.{column}" for table, column in rows]


def stored() -> set[str]:
    return set(LIST.read_text().splitlines())


def unnamed(lines: set[str]) -> set[str]:
    """Return those of the lines that CHANGELOG.md does not name between backticks."""
    words = re.findall(r"`([^`]+)`", (ROOT / "CHANGELOG.md").read_text())
    return {line for line in lines if line.partition(" ")[2] not in words}


if __name__ == "__main__":
    today = current()
    kept = unnamed(stored() - today)
    LIST.write_text("".join(f"{line}\n" for line in sorted(today | kept)))
