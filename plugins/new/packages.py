"""Write a plugin package or a scene file to start from."""

from __future__ import annotations

import importlib.util
import keyword
import re
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import jinja2

from core.errors import UsageError, UserError, choices
from core.plugins import KINDS, installed


@dataclass(frozen=True)
class Template:
    """A kind's config group, its name for people, its module and class, its test, and its word on the command line.

    ``data``: a file that is written beside the module.
    """

    group: str
    what: str
    module: str
    cls: str
    test: str = "test.py"
    choice: str = "{}"
    data: str | None = None


TEMPLATES = {
    "task": Template("task", "a task", "task", "{}"),
    "robot": Template("robot", "a robot", "robot", "make_robot", data="arm.urdf"),
    "sim": Template("sim", "a simulator", "simulator", "{}Simulator"),
    "vlm": Template("vlm", "a model", "model", "{}Model"),
    "tool": Template("tool", "a tool representation", "tools", "{}Tools"),
    "action": Template("action", "an action representation", "actions", "{}Actions"),
    "strategy": Template("evolution", "a search strategy", "search", "{}Strategy"),
    "fitness": Template("fitness", "a fitness", "fitness", "{}Fitness"),
    "executor": Template("executor", "an executor", "executor", "{}Executor"),
    "listener": Template("listener", "a listener", "listener", "{}Listener", "listener_test.py", "[progress,{}]"),
    "command": Template("command", "a command", "command", "main"),
}


def write(kind: str, name: str, output: Path | None = None) -> tuple[Path, Path]:
    """Write a package into the folder ``output`` (default: one of its name, here); return that and the part's module.

    Raises:
        UserError: an unknown kind, a name that can't be used, or a folder that holds something or can't be written.
    """
    if kind not in TEMPLATES:
        raise choices("kind", kind, (*TEMPLATES, "scene"), "vlmgineer new")
    template = TEMPLATES[kind]
    snake = check_name(template.group, name)
    folder = output or Path(snake)
    cls = template.cls.format(name[0].upper() + re.sub(r"_+(\w)", lambda found: found[1].upper(), name[1:]))
    values = {"name": name, "kind": template.group, "what": template.what, "cls": cls, "module": template.module}
    values |= {"hook": KINDS[template.group].hook, "package": snake}
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserError(f"{folder} is there already; choose another folder with output=DIR")
    if importlib.util.find_spec(snake) is not None:
        raise UsageError(f"{name!r} can't be a name: a module {snake!r} is there already; choose another name")
    code = folder / snake
    module = code / f"{template.module}.py"
    new = {
        folder / "pyproject.toml": render("pyproject.toml", values),
        code / "__init__.py": render("init.py", values),
        module: render(f"{kind}.py", values),
        folder / "tests" / f"test_{snake}.py": render(template.test, values),
    }
    if kind != "command":  # which has no settings
        new[code / "conf/__init__.py"] = ""
        new[code / "conf" / template.group / f"{name}.yaml"] = render(f"{kind}.yaml", values)
    if template.data is not None:
        new[code / template.data] = render(f"{kind}{Path(template.data).suffix}", values)
    try:
        for file, text in new.items():
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UserError(f"can't write {error.filename}: {error.strerror}") from error
    return folder, module


def check_name(group: str, name: str) -> str:
    """Return the name in small letters with underscores, for modules.

    Raises:
        UserError: it can't be a name, or is taken.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) or keyword.iskeyword(name):
        raise UsageError(f"{name!r} can't be a name: letters, digits and underscores are possible, a letter first")
    snake = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
    taken = installed().offers.get((group, name))
    if taken is not None:
        raise UsageError(f"{group} {name!r} is taken: {taken.distribution} offers it; choose another name")
    if keyword.iskeyword(snake):
        raise UsageError(f"{name!r} can't be a name: {snake!r} is a word of Python's; choose another name")
    return snake


def render(source: str, values: dict[str, str]) -> str:
    """Fill in a template."""
    text = (files("plugins.new") / "templates" / f"{source}.jinja").read_text(encoding="utf-8")
    # Nothing is escaped: it is code, of names that were checked.
    template = jinja2.Template(text, undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    return str(template.render(values))


def write_scene(name: str, output: Path | None = None) -> Path:
    """Write the scene ``name`` into the file ``output`` (default: one of its name, here), and return that.

    Raises:
        UserError: a name that can't be used, or a file that is there already or can't be written.
    """
    snake = check_name("task", name)
    file = output or Path(f"{snake}.yaml")
    try:
        with file.open("x", encoding="utf-8") as stream:
            stream.write(render("scene.yaml", {"name": name}))
    except FileExistsError as error:
        raise UserError(f"{file} is there already; choose another name, or another file with output=FILE") from error
    except OSError as error:
        raise UserError(f"can't write {file}: {error.strerror}") from error
    return file
