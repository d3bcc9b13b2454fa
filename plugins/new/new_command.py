"""``vlmgineer new KIND NAME``: write a plugin package to start from, or a scene file."""

from __future__ import annotations

import importlib.util
import json
import keyword
import re
from importlib import resources
from pathlib import Path
from typing import NamedTuple

import jinja2

from core.errors import UsageError, UserError, choices
from core.plugins import KINDS, installed
from core.support.cli import say, write_bytes


class Template(NamedTuple):
    """What a package for a kind of part is made of.

    Attributes:
        group: the kind's config group.
        what: the kind, for people.
        module: in which the part stands.
        cls: the part's class, with ``{}`` for the name in camel case.
    """

    group: str
    what: str
    module: str
    cls: str


TEMPLATES = {
    "task": Template("task", "a task", "task", "{}"),
    "robot": Template("robot", "a robot", "robot", "make_robot"),
    "sim": Template("sim", "a simulator", "simulator", "{}Simulator"),
    "vlm": Template("vlm", "a model", "model", "{}Model"),
    "tool": Template("tool", "a tool representation", "tools", "{}Tools"),
    "action": Template("action", "an action representation", "actions", "{}Actions"),
    "strategy": Template("evolution", "a search strategy", "search", "{}Strategy"),
    "fitness": Template("fitness", "a fitness", "fitness", "{}Fitness"),
    "executor": Template("executor", "an executor", "executor", "{}Executor"),
    "listener": Template("listener", "a listener", "listener", "{}Listener"),
    "command": Template("command", "a command", "command", "main"),
}
SCHEMA = "scene.schema.json"
USAGE = f"""\
usage: vlmgineer new {{{"|".join(TEMPLATES)}}} NAME [output=NEW_FOLDER]
       vlmgineer new scene NAME [output=NEW_FILE.yaml]"""


def write(
    kind: str,
    name: str,
    output: Path | None = None,
) -> tuple[Path, Path]:
    """Write a package into the folder ``output`` (default: one of its name, here); return that and the part's module.

    Raises:
        UserError: an unknown kind, a name that can't be used, or a folder that holds something or can't be written.
    """
    if kind not in TEMPLATES:
        raise choices("kind", kind, (*TEMPLATES, "scene"), "vlmgineer new")

    template = TEMPLATES[kind]
    package = check_name(template.group, name)
    folder = output or Path(package)

    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserError(
            f"{folder} is there already; choose another folder with output=DIR"
        )

    if importlib.util.find_spec(package) is not None:
        raise UsageError(
            f"{name!r} can't be a name: a module {package!r} is there already; choose another name"
        )

    camel_case = re.sub(r"_+(\w)", lambda found: found[1].upper(), name)
    values = {
        "name": name,
        "kind": template.group,
        "what": template.what,
        "module": template.module,
        "package": package,
        "hook": KINDS[template.group].hook,
        "cls": template.cls.format(camel_case[0].upper() + camel_case[1:]),
    }

    for file, source in _files(kind, name, package).items():
        write_bytes(folder / file, render(source, values).encode())

    return folder, folder / package / f"{template.module}.py"


def _files(
    kind: str,
    name: str,
    package: str,
) -> dict[str, str]:
    """Return the files of a package, each with its template."""
    template = TEMPLATES[kind]
    files = {
        "pyproject.toml": "pyproject.toml",
        f"tests/test_{package}.py": "test.py",
        f"{package}/__init__.py": "init.py",
        f"{package}/{template.module}.py": f"{kind}.py",
    }

    if kind == "listener":
        files[f"tests/test_{package}.py"] = "listener_test.py"

    if kind == "robot":
        files[f"{package}/arm.urdf"] = "robot.urdf"

    if kind != "command":  # which has no settings
        files[f"{package}/conf/__init__.py"] = "empty.py"
        files[f"{package}/conf/{template.group}/{name}.yaml"] = f"{kind}.yaml"

    return files


def check_name(group: str, name: str) -> str:
    """Return the name in small letters with underscores, for modules.

    Raises:
        UserError: it can't be a name, or is taken.
    """
    snake = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
    is_word = keyword.iskeyword(name) or keyword.iskeyword(snake)
    if is_word or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise UsageError(
            f"{name!r} can't be a name: letters, digits and underscores are possible, a letter first, and no word of "
            "Python's"
        )

    taken = installed().offers.get((group, name))
    if taken is not None:
        raise UsageError(
            f"{group} {name!r} is taken: {taken.distribution} offers it; choose another name"
        )

    return snake


def render(source: str, values: dict[str, str]) -> str:
    """Fill in a template."""
    file = resources.files("plugins.new") / "templates" / f"{source}.jinja"
    # Nothing is escaped: it is code, of names that were checked.
    template = jinja2.Template(
        file.read_text(encoding="utf-8"),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
    )

    return str(template.render(values))


def write_scene(name: str, output: Path | None = None) -> Path:
    """Write the scene ``name`` into the file ``output`` (default: one of its name, here), and return that.

    Beside it comes `SCHEMA`, by which editors check the file and complete its keys.

    Raises:
        UserError: a name that can't be used, or a file that is there already or can't be written.
    """
    snake = check_name("task", name)
    file = output or Path(f"{snake}.yaml")

    if file.exists():
        raise UserError(
            f"{file} is there already; choose another name, or another file with output=FILE"
        )

    values = {"name": name, "schema": SCHEMA}
    write_bytes(file, render("scene.yaml", values).encode())
    schema = installed().factory("task", "file").json_schema()  # type: ignore[attr-defined]
    write_bytes(file.parent / SCHEMA, json.dumps(schema, indent=1).encode())

    return file


def main(words: list[str]) -> None:
    """Write the part, and print how to use it.

    Raises:
        UserError: see `write`.
    """
    if {"--help", "-h"} & set(words):
        say(*USAGE.splitlines())
        return

    named = [word for word in words if not word.startswith("output=")]
    outputs = [word.partition("=")[2] for word in words if word not in named]
    unknown = [word for word in named if word.startswith("-") or "=" in word]
    if len(named) != 2 or len(outputs) > 1 or unknown:
        raise UsageError(f"a kind and a name are needed; {' '.join(USAGE.split())}")

    kind, name = named
    output = Path(outputs[0]) if outputs else None
    values = {"kind": kind, "name": name}

    if kind == "scene":
        values["file"] = str(write_scene(name, output))
    else:
        folder, file = write(kind, name, output)
        template = TEMPLATES[kind]
        values |= {"file": str(file), "folder": str(folder)}
        values |= {"group": template.group, "what": template.what}

    say(*render("next_steps.txt", values).splitlines())
