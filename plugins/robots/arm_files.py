"""Read an arm's file, URDF or MJCF, and find the files of its meshes."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

from core.errors import UserError
from core.imports.documents import MAX_BYTES, read_root
from core.imports.urdf import read_urdf
from core.support.cli import expand
from core.support.files import note_read, read_untrusted
from core.values.descriptions import Description
from plugins.robots.arm_settings import ArmSettings

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

            _note_assets(root, path.parent)
            description, notes = read_mjcf_arm(path, without)
            if chosen.velocity is None:
                notes.append(
                    f"MJCF has no limits of speed, {SPEED} rad/s is taken; robot.velocity=[...] says others"
                )

            return description, notes

        return read_urdf(root, path, without, may_lack=chosen.collision == "file")
    except UserError as error:
        raise type(error)(f"{path}: {error}") from error


def _note_assets(root: Element, folder: Path) -> None:
    """Note the files that an MJCF file names, which MuJoCo reads."""
    folders = [folder]
    for compiler in root.iter("compiler"):
        for key in ("meshdir", "assetdir", "texturedir"):
            folders.append(folder / compiler.get(key, ""))

    for element in root.iter():
        for there in folders:
            file = there / element.get("file", "")
            if file.is_file():
                note_read(file)


def list_arms(folder: Path) -> str:
    """List files of a folder that may be arms, as words to type."""
    found = [file for file in sorted(folder.rglob("*")) if file.suffix in ARMS]
    return " or ".join(f"robot.path={file}" for file in found[:_SHOWN])
