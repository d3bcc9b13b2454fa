"""``vlmgineer new KIND NAME``: write a plugin package to start from, or a scene file.

Covered by `tests/plugins/new/test_packages.py`.
"""

from __future__ import annotations

from pathlib import Path

from core.errors import UsageError
from core.support.cli import say
from plugins.new.packages import TEMPLATES, write, write_scene

USAGE = f"""\
usage: vlmgineer new {{{"|".join(TEMPLATES)}}} NAME [output=NEW_FOLDER]
       vlmgineer new scene NAME [output=NEW_FILE.yaml]"""


def main(words: list[str]) -> None:
    """Write the part, and print how to use it.

    Raises:
        UserError: see `write`.
    """
    if {"--help", "-h"} & set(words):
        say(*USAGE.splitlines())
        return
    outputs = [word.removeprefix("output=") for word in words if word.startswith("output=")]
    named = [word for word in words if not word.startswith("output=")]
    if len(named) != 2 or len(outputs) > 1 or any(word.startswith("-") or "=" in word for word in named):
        raise UsageError(f"a kind and a name are needed; {' '.join(USAGE.split())}")
    kind, name = named
    output = Path(outputs[0]) if outputs else None
    if kind == "scene":
        file = write_scene(name, output)
        say(
            f"{file}: a scene, ready to be changed",
            f"  vlmgineer render task=file task.file={file}",
            f"  vlmgineer conformance task=file task.file={file}",
            f"  python -m core.run task=file task.file={file}",
        )
        return
    (folder, code), template = write(kind, name, output), TEMPLATES[kind]
    say(
        f"{code}: {template.what}, ready to be changed",
        f"  pip install -e '{folder}[test]'",
        f"  vlmgineer conformance {template.group}={name}",
        f"  vlmgineer {name}"
        if kind == "command"
        else f"  python -m core.run {template.group}={template.choice.format(name)}",
        f"  python -m pytest {folder}",
    )
