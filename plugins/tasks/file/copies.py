"""Name the copies of a repeated body in variations, each with numbers of its own."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from core.interfaces import JsonObject
from core.support.inputs import check_plain
from plugins.tasks.file.body_building import build_body, place_copies, read_pose
from plugins.tasks.file.named_files import Files
from plugins.tasks.file.spec import BodySpec, Range
from plugins.tasks.file.tree import follow

_GLOB = re.compile(r"[*?\[]")
_COPY = re.compile(r"(.+)_[0-9]+")

Values = dict[str, Range]
"""By path, the lowest and the highest, or the values of layouts."""


def unfold(data: JsonObject, paths: Iterable[str], files: Files) -> JsonObject:
    """Write out the copies of those repeated bodies of ``data`` that paths name, such as ``bodies.ball_3.mass``.

    Args:
        data: of the whole file, read and sound.
        paths: to numbers.
        files: of the scene's folder.
    Returns:
        The same data where no path names a copy.
    """
    named = set[str]()
    for path in paths:
        first, _, rest = path.partition(".")
        copy = _COPY.fullmatch(rest.partition(".")[0])
        if first == "bodies" and copy:
            named.add(copy[1])

    bodies = list[Any]()
    for body in data.get("bodies", ()):
        if body["name"] in named and "repeat" in body:
            bodies += _write_copies(body, files)
        else:
            bodies.append(body)

    return {**data, "bodies": bodies}


def _write_copies(body: JsonObject, files: Files) -> Iterator[JsonObject]:
    """Yield the copies of a repeated body, each as a body of the file."""
    spec = check_plain(BodySpec, body)
    assert spec.repeat is not None
    first = read_pose(spec)
    alike = {key: value for key, value in body.items() if key != "repeat"}

    for number, offset in enumerate(place_copies(spec.repeat, build_body(spec, files))):
        pose = first @ offset
        yield {
            **alike,
            "name": f"{spec.name}_{number}",
            "position": pose.position.round(9).tolist(),
            "rpy_deg": np.degrees(pose.rpy).round(9).tolist(),
        }


def read_range(
    data: JsonObject, path: str, wanted: Range | float, files: Files
) -> Values:
    """Read a path of a variation: a pattern such as ``bodies.ball_*.mass`` stands for all bodies that fit it.

    Args:
        data: of the whole file, read and sound.
        path: to a number, or to several.
        wanted: its range, or by how much it may be off what the file says.
        files: of the scene's folder.
    Raises:
        LookupError: a pattern fits no body, or there is no such number.
        ValueError: likewise.
    """
    named = [path]
    if _GLOB.search(path):
        repeated = [body for body in data.get("bodies", ()) if "repeat" in body]
        named = [f"bodies.{body['name']}_0" for body in repeated]

    whole = unfold(data, named, files)
    ranges = Values()
    for single in _find_paths(whole, path):
        holder, key = follow(whole, single)
        if isinstance(wanted, tuple):
            ranges[single] = wanted
        else:
            ranges[single] = (holder[key] - wanted, holder[key] + wanted)

    return ranges


def _find_paths(data: JsonObject, path: str) -> list[str]:
    """List the paths that a path with a pattern stands for; itself, where it has none."""
    if not _GLOB.search(path):
        return [path]

    kind, _, rest = path.partition(".")
    pattern, _, below = rest.partition(".")
    names = [entry.get("name", "") for entry in data.get(kind, ())]
    fitting = [name for name in names if fnmatchcase(name, pattern)]
    if not fitting:
        raise KeyError(path)

    return [f"{kind}.{name}.{below}" for name in fitting]
