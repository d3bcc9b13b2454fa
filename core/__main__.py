"""``vlmgineer NAME ...``, or ``python -m core NAME ...``: every command of the project under one name.

The command ``vlmgineer`` does not look for modules in the working directory, as ``python -m`` does.
"""

from __future__ import annotations

import importlib
import sys
from typing import NoReturn

from core.cli import command, say
from core.errors import choices

COMMANDS = {
    "run": "search for the best tool and motion for a task, or go on with a run",
    "evaluate": "try the designs of a file, and print their rewards",
    "render": "draw a task's scene, with a tool if one is given",
    "prompt": "write the request that a model would receive, and estimate its cost",
    "transfer": "try the best designs in several engines and in perturbed scenes",
    "report": "write tables, figures and a page about runs",
    "export": "write what a real arm needs to run the best motion",
    "gallery": "write a page of the best tools, and files to print them",
    "view": "show the recording of a run",
    "plugins": "list the installed parts, or check one",
    "conformance": "check that a part does what its kind must do",
    "facts": "measure how exact the arm is in engines, and write a sheet about it",
    "new": "write a plugin package to start from",
}
USAGE = "usage: vlmgineer NAME [ARGUMENT ...]      (vlmgineer NAME --help: what a command takes)"


def main() -> NoReturn:
    """Run the command that the first word names, as ``python -m core.NAME`` does; without a word list them all."""
    command(_dispatch)


def _dispatch() -> None:
    if not sys.argv[1:] or sys.argv[1] in ("--help", "-h"):
        width = max(map(len, COMMANDS))
        lines = [USAGE, "", *(f"  {name:{width}}  {line}" for name, line in COMMANDS.items())]
        say(*lines)
        return
    name = sys.argv.pop(1)
    if name not in COMMANDS:
        raise choices("command", name, COMMANDS)
    module = importlib.import_module(f"core.{name}")
    if hasattr(module, "__path__"):
        module = importlib.import_module(f"core.{name}.__main__")
    module.main()


if __name__ == "__main__":
    main()
