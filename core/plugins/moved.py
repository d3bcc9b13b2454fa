"""Say where modules and names went that a plugin may know, as ``moved.yaml`` lists them."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import cast

SEE = "see What moved in CHANGELOG.md"
_LACKS = re.compile(r"cannot import name '(?P<name>\w+)' from '(?P<module>[\w.]+)'|"
                    r"module '(?P<module2>[\w.]+)' has no attribute '(?P<name2>\w+)'")  # fmt: skip


@cache
def places() -> dict[str, str]:
    """Return where each module, or attribute of one, is now."""
    import yaml  # seldom needed

    return cast(dict[str, str], yaml.safe_load(Path(__file__).with_name("moved.yaml").read_text(encoding="utf-8")))


def new_place(name: str) -> str | None:
    """Say in a line where a module or attribute, or the package around it, is now; None: it did not move."""
    steps = name.split(".")
    for count in range(len(steps), 1, -1):
        old = ".".join(steps[:count])
        if old in places():
            return f"{old} moved to {places()[old]}; {SEE}"
    return None


def describe_import_error(error: BaseException) -> str:
    """Describe what importing a plugin raised; where it lacks a name that moved, say where that is now."""
    text = f"{type(error).__name__}: {error}"
    lacks = _LACKS.search(str(error))
    if lacks is None:
        return text
    module, name = lacks["module"] or lacks["module2"], lacks["name"] or lacks["name2"]
    moved = places().get(f"{module}.{name}")
    return text if moved is None else f"{text}; {module}.{name} moved to {moved}; {SEE}"
