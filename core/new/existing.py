"""Add a part to a plugin package that is there: to its hooks, its configs, and if need be to its pyproject.toml."""

from __future__ import annotations

import ast
import re
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from core.errors import UserError
from core.hooks import PROJECT

IMPORT = "from core.hooks import hookimpl"
HOOK = "@hookimpl\ndef {hook}() -> {type}:\n    return {value}\n"


@dataclass
class Package:
    """A plugin package in ``folder``: its import name, and the folders of its code and its configs.

    ``texts`` are the files that change, with what they are to hold.
    """

    folder: Path
    name: str
    code: Path
    config: Path
    texts: dict[Path, str] = field(default_factory=dict)

    @classmethod
    def find(cls, folder: Path) -> Package:
        """The plugin package in a folder.

        Raises:
            UserError: there is none that a part can be added to; says why.
        """
        project = folder / "pyproject.toml"
        if not project.is_file():
            what = "is there already and holds no pyproject.toml, so it is no package to add to"
            raise UserError(f"{folder} {what}; choose another folder with output=DIR")
        text = _read(project)
        try:
            data: dict[str, Any] = tomllib.loads(text).get("project", {})
        except tomllib.TOMLDecodeError as error:
            raise UserError(f"{project} is malformed: {error}") from error
        modules = data.get("entry-points", {}).get(PROJECT, {})
        name = next(iter(modules.values()), str(data.get("name", "")).replace("-", "_").lower())
        places = [base.joinpath(*name.split(".")) for base in (folder, folder / "src")]
        code = next((place for place in places if (place / "__init__.py").is_file()), None)
        if code is None:
            raise UserError(f"{folder} holds no package {name!r} with an __init__.py; its hooks are expected there")
        package = cls(folder, name, code, code / "conf")
        if not modules:
            entry = f'{name} = "{name}"'
            package.texts[project] = f"{text.rstrip()}\n\n[project.entry-points.{PROJECT}]\n{entry}\n"
            try:
                tomllib.loads(package.texts[project])
            except tomllib.TOMLDecodeError as error:
                what = f"add {entry} to [project.entry-points.{PROJECT}] by hand"
                raise UserError(f"{project} can't be extended ({error}); {what}") from error
        return package

    def offer(self, hook: str, name: str, factory: str) -> None:
        """Make ``hook`` offer ``name``, which ``factory`` makes, and let its config be found.

        Raises:
            UserError: the hook is there and can't be extended; says what to write by hand.
        """
        hooks = self.code / "__init__.py"
        text = _read(hooks)
        entry = f'"{name}": "{factory}"'
        text = self._with_hook(text, hook, "dict[str, str]", f"{{{entry}}}", entry)
        path = _returned(text, "config_path")
        if path is None:
            text = self._with_hook(text, "config_path", "str", f'"pkg://{self.name}.conf"')
            if not (self.config / "__init__.py").exists():
                self.texts[self.config / "__init__.py"] = ""
        elif isinstance(path, ast.Constant) and str(path.value).startswith(f"pkg://{self.name}."):
            inside = str(path.value).removeprefix(f"pkg://{self.name}.")
            self.config = self.code.joinpath(*re.split(r"[./]", inside))
        else:
            raise UserError(f"{hooks}: config_path names no folder of {self.name}; add the part by hand")
        self.texts[hooks] = text

    def _with_hook(self, text: str, hook: str, kind: str, value: str, entry: str = "") -> str:
        """The hooks' source with a hook that returns ``value``, or with ``entry`` in the mapping of the one there."""
        returned = _returned(text, hook)
        if returned is not None:
            if not isinstance(returned, ast.Dict):
                raise UserError(
                    f"{self.code / '__init__.py'}: {hook} returns no mapping in braces; add {entry} to it by hand"
                )
            lines = text.splitlines(keepends=True)
            last = returned.values[-1] if returned.values else None
            row, column = (last.end_lineno, last.end_col_offset) if last else (returned.lineno, returned.col_offset + 1)
            assert row is not None
            assert column is not None
            line = lines[row - 1].encode()  # columns of the syntax tree count bytes
            comma = ", " if last else ""
            lines[row - 1] = (line[:column] + f"{comma}{entry}".encode() + line[column:]).decode()
            return "".join(lines)
        if not re.search(r"^from core\.hooks import .*\bhookimpl\b", text, re.M):
            text = _with_import(text)
        return f"{text.rstrip()}\n\n\n{HOOK.format(hook=hook, type=kind, value=value)}"


def _read(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"can't read {file}: {error}") from error


def _returned(text: str, function: str) -> ast.expr | None:
    """The expression that a function of a source returns last; None: there is no such function.

    Raises:
        UserError: the source can't be parsed.
    """
    try:
        tree = ast.parse(text)
    except SyntaxError as error:
        raise UserError(f"the package's hooks can't be read: line {error.lineno}: {error.msg}") from error
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and node.name == function:
            last = node.body[-1]
            return last.value if isinstance(last, ast.Return) and last.value else ast.Constant(None)
    return None


def _with_import(text: str) -> str:
    """The source with the import of ``hookimpl`` below its docstring and its imports from ``__future__``."""
    head = 0
    for node in ast.parse(text).body:
        docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if not docstring and not (isinstance(node, ast.ImportFrom) and node.module == "__future__"):
            break
        head = node.end_lineno or 0
    lines = text.splitlines(keepends=True)
    return "".join([*lines[:head], "\n" * bool(head), f"{IMPORT}\n", *lines[head:]])
