"""Read an arm's file, URDF or MJCF, and find the files of its meshes."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

from core.errors import UserError
from core.imports.documents import MAX_BYTES, read_root
from core.imports.urdf import find_mesh, leave_out, read_tree
from core.support.cli import expand
from core.support.files import read_untrusted
from core.values.descriptions import Description
from plugins.robots.near import describe_near, find_near
from plugins.robots.normalise import Problems
from plugins.robots.settings import ArmSettings

ARMS = (".urdf", ".xml", ".mjcf", ".xacro")
_SHOWN = 5  # files that a message lists


def read_arm(chosen: ArmSettings) -> tuple[Description, list[str]]:
    """Read the file that is chosen, without what is left out.

    Returns:
        links and joints, under the names that they have there; and what was assumed or left out, a line each.

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

            description, notes = read_mjcf_arm(path, without)
            if chosen.velocity is None:
                notes.append(
                    f"MJCF has no limits of speed, {SPEED} rad/s is taken; robot.velocity=[...] says others"
                )

            return description, notes

        leave_out(root, without)
        notes = find_meshes(root, path, chosen.collision == "file")
        return read_tree(root, path.stem), notes
    except UserError as error:
        raise type(error)(f"{path}: {error}") from error


def list_arms(folder: Path) -> str:
    """List files of a folder that may be arms, as words to type."""
    found = [file for file in sorted(folder.rglob("*")) if file.suffix in ARMS]
    return " or ".join(f"robot.path={file}" for file in found[:_SHOWN])


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
