"""Take a file of things for a scene, a mesh, a URDF or MJCF: write a scene file in which they stand."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import yaml
from omegaconf import DictConfig, OmegaConf

from core.errors import UsageError, UserError
from core.geometry import Array
from core.hooks import Taken
from core.imports.documents import MAX_BYTES, read_root
from core.imports.kinds import find_radians
from core.imports.meshes import KINDS
from core.imports.mjcf import list_files
from core.imports.urdf import read_urdf
from core.interfaces import JsonObject
from core.scene import Body, Joint
from core.solids.standing import bound
from core.support.cli import expand, write_bytes
from core.support.files import read_untrusted
from core.support.templates import fill
from plugins.tasks.file.imports import Imported, read_bodies, read_mesh
from plugins.tasks.file.task import FileTask

_ABOVE_M = 1e-4  # the table, things begin
_MILLI = 0.001
_NEAR_M = 0.6  # from the arm's base, the near face of what is large
_MIDDLE_M = 0.6  # the middle of what is small
_SMALL_M = 0.3
_MOST_FRAMES = 12
_OPENS = 0.5  # of a joint's range, the goal to begin with
_TURNS_RAD = 1.0  # the same of a joint without limits


@dataclass(frozen=True)
class _Placed:
    """What a scene file says of a file.

    Attributes:
        section: ``bodies`` or ``imports``.
        entry: in it.
        held: the bodies and joints.
        lines: what was assumed.
    """

    section: str
    entry: JsonObject
    held: Imported
    lines: list[str]


def take_scene(file: Path, cfg: DictConfig) -> Taken:
    """Write a scene file in which the things of a file stand on the table, with a goal to begin with.

    Args:
        file: of the things.
        cfg: the settings of ``vlmgineer import``.

    Raises:
        UserError: the file can't be used; says what mends it.
    """
    if file.suffix.lower() in KINDS:
        placed = _place_mesh(file, cfg)
        folder = file.parent
    else:
        folder = _find_folder(file)
        placed = _place_bodies(file, folder, cfg)

    output = (
        expand(cfg.output).absolute() if cfg.output else folder / f"{file.stem}.yaml"
    )
    if output.exists():
        raise UsageError(
            f"{output} is there already; name another file: output=FILE.yaml"
        )
    if not file.is_relative_to(output.parent):
        raise UsageError(
            f"a scene's files lie in its folder; write it to output={folder / output.name}"
        )

    entry = {"file": str(file.relative_to(output.parent)), **placed.entry}
    low, high = _bound_all(placed.held.bodies)
    size = high - low
    entry["position"] = _choose_place(low, high)
    goal, wanted = _choose_goal(placed)
    scene = {
        "name": _choose_name(file),
        "description": f"{wanted} Say here what is to be done.",
        placed.section: [entry],
        "goals": [goal],
    }
    text = yaml.safe_dump(scene, sort_keys=False, default_flow_style=None, width=110)
    write_bytes(output, text.encode())
    task = FileTask(str(output))
    lines = fill(
        "plugins.tasks.file",
        "taken",
        held=placed.held,
        size=size,
        lines=placed.lines,
        output=output,
        wanted=wanted,
    ).splitlines()
    words = ["task=file", f"task.file={output}"]
    if cfg.robot.name != "panda":
        words.append(f"robot={cfg.robot.name}")

    taken = {body.name for body in placed.held.bodies}
    bodies = [body for body in task.scene(0).bodies if body.name in taken]
    frames = {body.name: body.pose for body in bodies[:_MOST_FRAMES]}
    return Taken(lines, words, frames)


def _choose_name(file: Path) -> str:
    """Make a name of a task of a file's."""
    words = re.findall(r"[A-Za-z0-9]+", file.stem)
    name = "".join(word[0].upper() + word[1:] for word in words)
    return name if name[:1].isalpha() else f"Use{name}"


def _place_mesh(file: Path, cfg: DictConfig) -> _Placed:
    """Read a mesh, in millimetres where metres are too large to be meant."""
    lines = []
    scale = 1.0
    try:
        held = read_mesh(file)
    except UserError as error:
        scale = _MILLI
        try:
            held = read_mesh(file, scale)
        except UserError:
            raise error from None
        lines.append("its numbers are taken for millimetres: scale: 0.001")

    name = re.sub(r"[^A-Za-z0-9_-]", "_", file.stem)[:50]
    name = name if name[:1].isalpha() else f"body_{name}"
    entry: JsonObject = {"name": name, "density": cfg.density}
    if scale != 1:
        entry["scale"] = scale

    (body,) = held.bodies
    lines.append(f"a mesh has no mass; density: {cfg.density:g} weighs it, kg/m³")
    named = replace(held, bodies=(replace(body, name=name),))
    return _Placed("bodies", entry, named, lines)


def _place_bodies(file: Path, folder: Path, cfg: DictConfig) -> _Placed:
    """Read a URDF or MJCF file: free to move if nothing in it has a joint, and weighed where it has no mass."""
    root = read_root(read_untrusted(file, MAX_BYTES), file)
    without: Any = OmegaConf.to_container(cfg.without)
    lines = []
    empty = [name for name in _list_empty(root) if name not in without]
    if empty:
        without = [*without, *empty]
        lines.append(
            f"left out, as they move and have neither a mass nor a shape: {', '.join(empty)}"
        )

    options: JsonObject = {"without": without} if without else {}
    if root.tag == "mujoco" and find_radians(root):
        lines.append(
            'its ranges look like radians, and count as degrees: add <compiler angle="radian"/> if they are'
        )

    def read(**more: Any) -> Imported:
        return read_bodies(file, folder=folder, **{"without": (), **options, **more})

    held = read(density=cfg.density)
    if not held.joints and all(not body.mass for body in held.bodies):
        free = read(density=cfg.density, fixed=False)
        options["fixed"] = False
        held = free
        lines.append(
            "nothing in it has a joint, so that it is free to move: fixed: false"
        )

    try:
        read()
    except UserError:
        options["density"] = cfg.density
        lines.append(
            f"what moves has no mass in the file; density: {cfg.density:g} weighs it, kg/m³"
        )

    return _Placed("imports", options, held, lines)


def _list_empty(root: Element) -> list[str]:
    """List the links of a URDF that move, and have neither a mass nor a shape, nor a link that hangs from them."""
    ends: dict[str, dict[str, str]] = {"parent": {}, "child": {}}
    for joint in root.findall("joint"):
        for end, names in ends.items():
            for element in joint.findall(end):
                names[element.get("link", "")] = joint.get("type", "fixed")

    return [
        link.get("name", "")
        for link in root.findall("link")
        if not len(link)
        and link.get("name") not in ends["parent"]
        and ends["child"].get(link.get("name", ""), "fixed") != "fixed"
    ]


def _find_folder(file: Path) -> Path:
    """Find the folder that holds a file, and all meshes and models that it names."""
    root = read_root(read_untrusted(file, MAX_BYTES), file)
    named = [str(file.parent)]
    if root.tag == "mujoco":
        named += [str(path.resolve().parent) for path in list_files(root, file)]
    else:
        try:
            description, _ = read_urdf(root, file, may_lack=True)
        except UserError:  # it is said when its bodies are read
            return file.parent

        for link in description.links.values():
            for shape in (*link.collisions, *link.visuals):
                if isinstance(shape.shape, Path):
                    named.append(str(shape.shape.parent))

    return Path(os.path.commonpath(named))


def _bound_all(bodies: Sequence[Body]) -> tuple[Array, Array]:
    """Bound what collides, in the file's frame."""
    boxes = np.array([bound(body) for body in bodies if body.collisions])
    if not len(boxes):
        raise UserError("nothing in the file collides")

    return boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)


def _choose_place(low: Array, high: Array) -> list[float]:
    """Choose where a file's frame stands, so that what it holds stands on the table before the arm."""
    middle = (low + high) / 2
    x = _MIDDLE_M - middle[0]
    if high[0] - low[0] > _SMALL_M:
        x = _NEAR_M - low[0]

    place = [x, -middle[1], _ABOVE_M - low[2]]
    return [round(float(value), 4) + 0.0 for value in place]


def _choose_goal(placed: _Placed) -> tuple[JsonObject, str]:
    """Choose a goal to begin with: a joint that moves through half of its range, or a body that is pushed aside.

    Returns:
        the goal as a scene file has it, and what it wants in words.
    """
    held = placed.held
    if held.joints:
        joint = held.joints[0]
        way = _find_way(joint)
        sign = ">" if way > 0 else "<"
        unit = "m" if joint.kind == "slider" else "rad"
        goal: JsonObject = {"joint": joint.name, "change": f"{sign} {way:.3g}"}
        return goal, f"Move {joint.name} by {abs(way):.3g} {unit}."

    movable = [body for body in held.bodies if body.mass]
    if not movable:
        raise UserError(
            "nothing in the file can move; a scene's goal needs something that does: write it by hand, with the file "
            "under imports"
        )

    name = movable[0].name
    goal = {"bodies": [name], "moved": [None, 0.2, None], "tolerance": 0.03}
    return goal, f"Push {name} 0.2 m to the left."


def _find_way(joint: Joint) -> float:
    """Choose how far a joint is to move, rad or m: toward the farther end of its range."""
    up = joint.upper - joint.start
    down = joint.lower - joint.start
    way = up if up >= -down else down
    return _OPENS * way if np.isfinite(way) else _TURNS_RAD
