"""Write what pages list of the code: ``python docs/names.py``.

``docs/api.md`` lists what plugins import of core. Names of the flat files have a line each, with the first sentence of
their docstring. Names of inner rooms, which only the built-in plugins use, are listed without one.
Tables of other pages are those of `docs.tables`.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from collections import defaultdict
from pathlib import Path

from docs.tables import goal_tables, refusal_table, shape_table

ROOT = Path(__file__).parent.parent
BEGIN = "<!-- names: python docs/names.py -->\n"
END = "<!-- end of names -->\n"


def names_in_use() -> dict[str, set[str]]:
    """Return what files of plugins and tasks import of core, by the module that they import it from."""
    names = defaultdict[str, set[str]](set)
    for folder in ("plugins", "tasks"):
        for file in (ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text("utf-8"))):
                module = getattr(node, "module", None) or ""
                if module == "core" or module.startswith("core."):
                    names[module] |= {alias.name for alias in node.names}
    return names


def is_flat(module: str) -> bool:
    """Report whether a module is a file directly in core, or the package of goals, which is as public."""
    if module == "core.goals":
        return True

    return (ROOT / (module.replace(".", "/") + ".py")).is_file() and (
        module.count(".") == 1
    )


def describe(module: str, name: str) -> str:
    """Return the first sentence of a name's docstring; empty: it has none."""
    found = getattr(importlib.import_module(module), name)
    if not (inspect.isclass(found) or inspect.isfunction(found)):
        return ""
    text = " ".join((inspect.getdoc(found) or "").partition("\n\n")[0].split())
    generated = text.startswith(f"{name}(")
    return "" if generated else re.split(r"(?<=\.)\s", text)[0]


def listing() -> str:
    """Write the lists, as Markdown."""
    used = names_in_use()
    lines = []
    for module in sorted(filter(is_flat, used)):
        lines += ["", f"`{module}`", ""]
        for name in sorted(used[module]):
            text = describe(module, name)
            lines.append(f"- `{name}`: {text}" if text else f"- `{name}`")

    lines += ["", "Built-in plugins also use, of inner rooms:", ""]
    for module in sorted(used):
        if not is_flat(module):
            names = ", ".join(f"`{name}`" for name in sorted(used[module]))
            lines.append(f"- `{module}`: {names}")
    return "\n".join(lines).lstrip() + "\n"


def split_page(page: str) -> tuple[str, str, str]:
    """Return what stands before the lists, the lists, and what stands after them."""
    before, _, others = page.partition(BEGIN)
    lists, _, after = others.partition(END)
    return before, lists.strip() + "\n", after


WRITTEN = {
    "api": listing,
    "scene_types": shape_table,
    "scene_goals": goal_tables,
    "refusals": refusal_table,
}
"""What is written on each page of docs."""


def page_of(name: str) -> Path:
    """Return the file of a page."""
    return ROOT / "docs" / f"{name}.md"


def main() -> None:
    for name, write in WRITTEN.items():
        before, _, after = split_page(page_of(name).read_text("utf-8"))
        text = f"{before}{BEGIN}\n{write()}\n{END}{after}"
        page_of(name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
