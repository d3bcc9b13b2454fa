"""``python -m core.new KIND NAME``: write a plugin package to start from."""

from __future__ import annotations

import sys
from pathlib import Path

from core.cli import command
from core.errors import UsageError
from core.new.packages import TEMPLATES, write

USAGE = f"usage: python -m core.new {{{'|'.join(TEMPLATES)}}} NAME [output=DIR]"


def main() -> None:
    """Write it, and say how it is used.

    Raises:
        UserError: see `write`.
    """
    words = sys.argv[1:]
    if {"--help", "-h"} & set(words):
        sys.stdout.write(f"{USAGE}\n")
        return
    outputs = [word.removeprefix("output=") for word in words if word.startswith("output=")]
    named = [word for word in words if not word.startswith("output=")]
    if len(named) != 2 or len(outputs) > 1 or any(word.startswith("-") for word in named):
        raise UsageError(f"a kind and a name are needed; {USAGE}")
    kind, name = named
    folder, template = write(kind, name, Path(outputs[0]) if outputs else None), TEMPLATES[kind]
    (code,) = folder.glob(f"*/{template.module}.py")
    sys.stdout.write(
        f"{code}: {template.what}, ready to be changed\n"
        f"  pip install -e '{folder}[test]'\n"
        f"  python -m core.plugins --check {name}\n"
        f"  python -m core.run {template.group}={template.choice.format(name)}\n"
        f"  python -m pytest {folder}\n"
    )


if __name__ == "__main__":
    command(main)
