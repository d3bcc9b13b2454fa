"""Find meshes that are nearly where a file says."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path

from core.support.text import visible

_ABOVE = 3  # folders of and above the file in which a mesh is looked for
_DEEPEST = 16  # parts of a path that are looked for: an untrusted one may be long


def describe_near(near: Mapping[str, Path]) -> list[str]:
    """Say which files are taken for those that are not where a file says, if there are some."""
    if not near:
        return []
    named, taken = next(iter(near.items()))
    return [
        f"{len(near)} meshes are not where the file says, such as {visible(named)}, which is taken to be {taken}"
    ]


def find_near(name: str, file: Path) -> Path | None:
    """Find a mesh of which the end of the path, with other capitals or not, leads to a file near another."""
    parts = [part for part in name.split("/") if part not in ("", ".", "..")]
    parts = parts[-_DEEPEST:]
    for start in range(len(parts)):
        for folder in list(file.parents)[:_ABOVE]:
            near: Path | None = folder
            for part in parts[start:]:
                near = near and _find_alike(near, part)
            if near is not None and near.is_file():
                return near
    return None


def _find_alike(folder: Path, name: str) -> Path | None:
    """Find what a folder has under a name, whatever its capitals."""
    exact = folder / name
    with contextlib.suppress(OSError):
        if exact.exists():
            return exact
        for entry in folder.iterdir():
            if entry.name.lower() == name.lower():
                return entry
    return None
