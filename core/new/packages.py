"""``python -m core.new KIND NAME``: a plugin package to start from, which passes the checks of its kind as it is."""

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
    """Of a kind: its config group, what people call it, the module that its code goes to, how the class is called, the
    test, and what chooses it on the command line.
    """

    group: str
    what: str
    module: str
    cls: str
    test: str = "test.py"
    choice: str = "{}"


TEMPLATES = {
    "task": Template("task", "a task", "task", "{}"),
    "sim": Template("sim", "a simulator", "simulator", "{}Simulator"),
    "vlm": Template("vlm", "a model", "model", "{}Model"),
    "tool": Template("tool", "a tool representation", "tools", "{}Tools"),
    "strategy": Template("evolution", "a search strategy", "search", "{}Strategy"),
    "executor": Template("executor", "an executor", "executor", "{}Executor"),
    "listener": Template("listener", "a listener", "listener", "{}Listener", "listener_test.py", "[progress,{}]"),
}


def write(kind: str, name: str, output: Path | None = None) -> Path:
    """Write the package into the folder ``output`` (by default one of its name, here), and return that.

    Raises:
        UserError: a kind that there is not, a name that can't be one or is taken, or a folder that holds something.
    """
    if kind not in TEMPLATES:
        raise choices("kind", kind, TEMPLATES, "core.new")
    template = TEMPLATES[kind]
    package = _check_name(template.group, name)
    folder = output or Path(package)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserError(f"{folder} is there already; choose another folder with output=DIR")
    cls = template.cls.format(name[0].upper() + re.sub(r"_+(\w)", lambda found: found[1].upper(), name[1:]))
    values = {"name": name, "package": package, "kind": template.group, "what": template.what, "cls": cls}
    values |= {"hook": KINDS[template.group], "module": template.module}
    texts = {
        "pyproject.toml": "pyproject.toml",
        f"{package}/__init__.py": "init.py",
        f"{package}/{template.module}.py": f"{kind}.py",
        f"{package}/conf/{template.group}/{name}.yaml": f"{kind}.yaml",
        f"tests/test_{package}.py": template.test,
    }
    try:
        for path, source in texts.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_text(_render(source, values), encoding="utf-8")
        (folder / package / "conf/__init__.py").touch()
    except OSError as error:
        raise UserError(f"can't write {error.filename}: {error.strerror}") from error
    return folder


def _check_name(group: str, name: str) -> str:
    """The package's name, in small letters."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) or keyword.iskeyword(name):
        raise UsageError(f"{name!r} can't be a name: letters, digits and underscores are possible, a letter first")
    package = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
    taken = installed().offers.get((group, name))
    if taken is not None:
        raise UsageError(f"{group} {name!r} is taken: {taken.distribution} offers it; choose another name")
    if keyword.iskeyword(package) or importlib.util.find_spec(package) is not None:
        raise UsageError(f"{name!r} can't be a name: a module {package!r} is there already; choose another name")
    return package


def _render(source: str, values: dict[str, str]) -> str:
    text = (files("core.new") / "templates" / f"{source}.jinja").read_text(encoding="utf-8")
    # Nothing is escaped: it is code, of names that were checked.
    template = jinja2.Template(text, undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    return str(template.render(values))
