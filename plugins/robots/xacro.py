"""Expand Xacro, whose expressions are Python's, where it reads no more than a description needs."""

from __future__ import annotations

import json
import os
import sys
import tempfile
from pathlib import Path

from core.errors import UserError
from core.values.urdf import PACKAGE_PATHS

_REFUSED = ("subprocess.", "socket.", "ctypes.", "os.system", "os.exec", "os.fork", "os.posix_spawn")


def expand(_: bytes, path: str, arguments: str) -> bytes:
    """Expand a file, with arguments as a JSON object: called in a process of its own, which may do no more afterwards.

    It has no environment but the paths of packages, so that ``$(env KEY)`` is an error. Files are opened in the folder
    of the description, in that around it if it is a package, and in the paths of packages; nothing is sent.

    Raises:
        UserError: it can't be expanded.
    """
    from xacrodoc import XacroDoc

    file = Path(path).resolve()
    paths = [Path(root) for name in PACKAGE_PATHS for root in os.environ.get(name, "").split(os.pathsep) if root]
    package = [file.parents[1]] if (file.parents[1] / "package.xml").is_file() else []
    roots = [os.path.realpath(root) for root in (file.parent, *package, *paths, Path.cwd())]
    code = [os.path.realpath(root) for root in (*sys.path, sys.prefix, sys.base_prefix)]
    for name in {*os.environ} - {*PACKAGE_PATHS}:
        del os.environ[name]
    tempfile.tempdir = str(Path.cwd())

    def guard(event: str, given: tuple[object, ...]) -> None:
        if event.startswith(_REFUSED):
            raise PermissionError(f"{event} is not allowed")
        if event == "open" and isinstance(given[0], str | bytes):
            opened = os.path.realpath(os.fsdecode(given[0]))
            allowed = [*roots, *(code if opened.endswith((".py", ".pyc", ".so")) else ())]
            if not any(Path(opened).is_relative_to(root) for root in allowed):
                raise PermissionError(f"{opened} is not of the description's package, and not read")

    sys.addaudithook(guard)
    try:
        document = XacroDoc.from_file(path, subargs=json.loads(arguments), resolve_packages=False)
        return bytes(document.to_urdf_string(), "utf-8")
    except Exception as error:  # it evaluates expressions, which may raise anything
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        raise UserError(f"can't be expanded: {reason}") from error
