"""Read an arm's file, URDF or MJCF, and find the files of its meshes."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree.ElementTree import Element

from core.errors import UserError
from core.support.files import read_untrusted
from core.support.text import visible
from core.values.descriptions import Description, RobotShape
from core.values.urdf import MAX_BYTES, find_mesh, read_tree
from plugins.robots.kinds import list_arms, read_root
from plugins.robots.normalise import Problems
from plugins.robots.pruning import leave_out
from plugins.robots.settings import ArmSettings

_ABOVE = 3  # folders of and above the file in which a mesh is looked for


@dataclass(frozen=True)
class Source:
    """What was read of a file, under the names that it has.

    Attributes:
        description: links and joints.
        notes: what was assumed or left out, a line each.
        armature: the motors' inertias by joint, kg m^2, where the file has them.
    """

    description: Description
    notes: list[str] = field(default_factory=list)
    armature: Mapping[str, float] = field(default_factory=dict)


def read_source(chosen: ArmSettings) -> Source:
    """Read the file that is chosen, without what is left out.

    Raises:
        UserError: the file can't be used, or meshes are missing; names all of them.
    """
    path = chosen.path
    without = chosen.without or ()
    if path.is_dir():
        files = list_arms(path) or "it has no URDF or MJCF"
        raise UserError(f"{path} is a folder; name the file in it: {files}")

    root = read_root(read_untrusted(path, MAX_BYTES), path)
    try:
        if root.tag == "mujoco":
            from plugins.robots.mjcf import read_mjcf  # imports MuJoCo

            return Source(*read_mjcf(path, without))

        leave_out(root, without)
        description = read_tree(root, path)
        return _find_meshes(description, root, chosen)
    except UserError as error:
        raise type(error)(f"{path}: {error}") from error


def _find_meshes(
    description: Description, root: Element, chosen: ArmSettings
) -> Source:
    """Find the files of all meshes; what only a picture needs may be missing.

    Raises:
        UserError: names all that are missing.
    """
    source = Source(replace(description, links={}))
    near: dict[str, Path] = {}
    elements = {element.get("name"): element for element in root.findall("link")}
    wrong = Problems()
    for name, link in description.links.items():
        shapes: dict[str, list[RobotShape]] = {"collision": [], "visual": []}
        for shape, element in zip(
            (*link.collisions, *link.visuals),
            (*elements[name].findall("collision"), *elements[name].findall("visual")),
            strict=True,
        ):
            where = f"link {name!r}: {element.tag}"
            try:
                found = _find(shape, element, chosen.path, where, near)
                shapes[element.tag].append(found)
            except UserError as error:
                if element.tag == "collision" or not (
                    link.collisions or chosen.collision == "file"
                ):
                    wrong.append(error)
                else:
                    source.notes.append(f"not drawn: {error}")

        source.description.links[name] = replace(
            link,
            collisions=tuple(shapes["collision"]),
            visuals=tuple(shapes["visual"]),
        )

    wrong.report()
    if near:
        named, taken = next(iter(near.items()))
        source.notes.append(
            f"{len(near)} meshes are not where the file says, such as {visible(named)}, which is taken to be {taken}"
        )
    return source


def _find(
    shape: RobotShape, element: Element, file: Path, where: str, near: dict[str, Path]
) -> RobotShape:
    """Find the file of a shape, if it is a mesh; what is found elsewhere is noted in ``near``."""
    if not isinstance(shape.shape, Path):
        return shape
    mesh = element.find("geometry/mesh")
    assert mesh is not None
    named = mesh.get("filename", "")
    plain = named.strip().replace("\\", "/")
    try:
        return replace(shape, shape=find_mesh(plain, file, where))
    except UserError:
        alike = _find_near(plain, file)
        if alike is None:
            raise
    near[named] = alike
    return replace(shape, shape=alike)


def _find_near(name: str, file: Path) -> Path | None:
    """Find a mesh of which the end of the path, with other capitals or not, leads to a file near the URDF."""
    parts = [part for part in name.split("/") if part not in ("", ".", "..")]
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
