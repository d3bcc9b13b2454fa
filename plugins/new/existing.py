"""Find the plugin package in a folder, and name one more entry point in its ``pyproject.toml``."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from core.errors import UserError
from core.hooks import PROJECT

_TABLE = re.compile(rf"^\[project\.entry-points\.[\"']?{PROJECT}[\"']?\][^\n]*\n", re.MULTILINE)


def find_package(folder: Path) -> Path:
    """The folder of the package's code, with its ``__init__.py``; its name is the package's.

    Raises:
        UserError: there is none to which a part can be added; says why.
    """
    project = folder / "pyproject.toml"
    if not project.is_file():
        what = "is there already and holds no pyproject.toml, so it is no package to add to"
        raise UserError(f"{folder} {what}; choose another folder with output=DIR")
    try:
        data = tomllib.loads(_read(project)).get("project", {})
    except tomllib.TOMLDecodeError as error:
        raise UserError(f"{project} is malformed: {error}") from error
    modules = data.get("entry-points", {}).get(PROJECT, {})
    name = next(iter(modules.values()), str(data.get("name", "")).replace("-", "_").lower()).partition(".")[0]
    for base in (folder, folder / "src"):
        if (base / name / "__init__.py").is_file():
            return base / name
    raise UserError(f"{folder} holds no package {name!r} with an __init__.py; its code is expected there")


def with_entry_point(project: Path, name: str, module: str) -> str:
    """The text of a ``pyproject.toml`` with one more entry point.

    Raises:
        UserError: it can't be added; says what to write by hand.
    """
    text, line = _read(project), f'{name} = "{module}"\n'
    found = _TABLE.search(text)
    if found is None:
        new = f"{text.rstrip()}\n\n[project.entry-points.{PROJECT}]\n{line}"
    else:
        new = f"{text[: found.end()]}{line}{text[found.end() :]}"
    try:
        tomllib.loads(new)
    except tomllib.TOMLDecodeError as error:
        what = f"add {line.strip()} to [project.entry-points.{PROJECT}] by hand"
        raise UserError(f"{project} can't be extended ({error}); {what}") from error
    return new


def _read(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"can't read {file}: {error}") from error
