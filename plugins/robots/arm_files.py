"""Read an arm's file, URDF or MJCF, and find the files of its meshes."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

from core.errors import UserError, choices
from core.support.cli import expand
from core.support.files import read_untrusted
from core.values.descriptions import Description
from core.values.urdf import MAX_BYTES, find_mesh, read_tree
from plugins.robots.kinds import list_arms, read_root
from plugins.robots.near import describe_near, find_near
from plugins.robots.normalise import Problems
from plugins.robots.settings import ArmSettings


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
    path = expand(chosen.path).absolute()
    without = chosen.without or ()
    if path.is_dir():
        files = list_arms(path) or "it has no URDF or MJCF"
        raise UserError(f"{path} is a folder; name the file in it: {files}")

    root = read_root(read_untrusted(path, MAX_BYTES), path)
    try:
        if root.tag == "mujoco":
            from plugins.robots.mjcf import SPEED, read_mjcf_arm  # imports MuJoCo

            source = Source(*read_mjcf_arm(path, without))
            if chosen.velocity is None:
                source.notes.append(
                    f"MJCF has no limits of speed, {SPEED} rad/s is taken; robot.velocity=[...] says others"
                )

            return source

        leave_out(root, without)
        notes = find_meshes(root, path, chosen.collision == "file")
        return Source(read_tree(root, path.stem), notes)
    except UserError as error:
        raise type(error)(f"{path}: {error}") from error


def leave_out(root: Element, names: Collection[str]) -> None:
    """Remove links of a URDF, and all that they bear, before it is read: they may be wrong in any way.

    Raises:
        UserError: there is no such link.
    """
    links = [link.get("name", "") for link in root.findall("link")]
    for name in names:
        if name not in links:
            raise choices("link", name, links)

    borne: dict[str, list[str]] = {}
    for joint in root.findall("joint"):
        child = _find_end(joint, "child")
        borne.setdefault(_find_end(joint, "parent"), []).append(child)

    waiting = [*names]
    removed = set[str]()
    while waiting:
        name = waiting.pop()
        removed.add(name)
        waiting += borne.pop(name, ())

    for link in root.findall("link"):
        if link.get("name") in removed:
            root.remove(link)

    for joint in root.findall("joint"):
        if _find_end(joint, "child") in removed:
            root.remove(joint)


def _find_end(joint: Element, tag: str) -> str:
    end = joint.find(tag)
    return "" if end is None else end.get("link", "")


def find_meshes(root: Element, file: Path, may_lack: bool) -> list[str]:
    """Put the paths of all mesh files into a URDF.

    Args:
        root: of the URDF.
        file: where it lies.
        may_lack: whether meshes that are only drawn may be missing; else only those of links that collide otherwise.

    Returns:
        what is not where the file says, or missing, a line each.

    Raises:
        UserError: names all that are needed and missing.
    """
    notes = list[str]()
    near: dict[str, Path] = {}
    wrong = Problems()
    for link in root.findall("link"):
        solid = link.findall("collision")
        drawn = link.findall("visual")
        for element in (*solid, *drawn):
            mesh = element.find("geometry/mesh")
            if mesh is None:
                continue

            where = f"link {link.get('name')!r}: {element.tag}"
            try:
                mesh.set("filename", str(_find(mesh, file, near)))
            except UserError as error:
                if element in drawn and (solid or may_lack):
                    notes.append(f"not drawn: {where}: {error}")
                    link.remove(element)
                else:
                    wrong.append(UserError(f"{where}: {error}"))

    wrong.report()
    return notes + describe_near(near)


def _find(mesh: Element, file: Path, near: dict[str, Path]) -> Path:
    """Find the file of a mesh; what is found elsewhere is noted in ``near``."""
    named = mesh.get("filename", "")
    plain = named.strip().replace("\\", "/")
    try:
        return find_mesh(plain, file)
    except UserError:
        alike = find_near(plain, file)
        if alike is None:
            raise

    near[named] = alike
    return alike
