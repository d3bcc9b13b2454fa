"""Say what replaces a name of this program that a plugin looks for in vain; read only where an import has failed."""

from __future__ import annotations

import re
from importlib import import_module
from types import ModuleType
from typing import Any

from core.errors import in_line

FLAT = tuple(
    f"core.{name}"
    for name in (
        "interfaces",
        "hooks",
        "events",
        "task",
        "scene",
        "goals",
        "design",
        "trial",
        "geometry",
        "errors",
    )
)
"""What a plugin imports; a name that went from one of them and is in another needs no line below."""

MOVED = {
    "core.design.content_of": "core.values.contents.content_of",
    "core.goals.NAMED": "core.goals.Goal.names",
    "core.goals.needs_trace": "core.interfaces.Task.reads_trace",
    "core.interfaces.Evaluate": "core.interfaces.Fitness.score",
    "core.interfaces.Guards": "core.interfaces.Reactions",
    "core.scene.JointState": "core.scene.State",
    "core.scene.needs_trace": "core.interfaces.Task.reads_trace",
    "core.support.progress": "core.support.progress_display",
    "core.task.default_robot": "core.plugins.Plugins.default_robot",
    "core.trial.CONFIDENCE": "core.values.efforts.CONFIDENCE",
    "core.values.urdf": "core.imports.urdf",
}
"""What is called otherwise now, or done by something else, by the name that it had."""

_NOT_THERE = re.compile(r"cannot import name '(\w+)' from '([\w.]+)'")


def explain(error: BaseException) -> str:
    """Describe an error in one line, and say what replaces the name that it did not find."""
    name = _find_name(error)
    if name is None:
        return in_line(error)

    now = MOVED.get(name) or _find_flat(name)
    if now is None:
        return f"{in_line(error)}; {name} is no more: CHANGELOG.md says what is instead"

    return f"{in_line(error)}; {name} is {now} now"


def _find_name(error: BaseException) -> str | None:
    """Return the whole name in ``core`` that was not found; None: an error of another kind."""
    if isinstance(error, ImportError):
        found = _NOT_THERE.match(str(error))
        name = f"{found[2]}.{found[1]}" if found else str(error.name)
    elif isinstance(error, AttributeError) and isinstance(error.obj, ModuleType):
        name = f"{error.obj.__name__}.{error.name}"
    else:
        return None

    return name if name.startswith("core.") else None


def _find_flat(name: str) -> str | None:
    """Find a name in the modules that plugins import: where it is defined, else the first that hands it on."""
    last = name.rpartition(".")[2]
    having = []
    for flat in FLAT:
        value: Any = getattr(import_module(flat), last, None)
        if value is not None:
            is_home = str(getattr(value, "__module__", "")).startswith(flat)
            having.append((not is_home, f"{flat}.{last}"))

    return min(having, default=(False, None), key=lambda pair: pair[0])[1]
