"""Read an arm's file, URDF or MJCF, and find the files of its meshes."""

from __future__ import annotations

from core.errors import UserError
from core.imports.documents import MAX_BYTES, read_root
from core.imports.mjcf import list_files
from core.imports.urdf import read_urdf
from core.support.cli import expand
from core.support.files import note_read, read_untrusted
from core.values.descriptions import Description
from plugins.robots.arm_settings import ArmSettings


def read_arm(chosen: ArmSettings) -> tuple[Description, list[str]]:
    """Read the file that is chosen, without what is left out.

    Returns:
        links and joints, under the names that they have there; and what was assumed or left out, a line each.

    Raises:
        UserError: the file can't be used, or meshes are missing; names all of them.
    """
    path = expand(chosen.path).absolute()
    without = chosen.without or ()
    root = read_root(read_untrusted(path, MAX_BYTES), path)
    try:
        if root.tag == "mujoco":
            from plugins.robots.mjcf import SPEED, read_mjcf_arm  # imports MuJoCo

            for named in list_files(root, path):  # MuJoCo reads them
                note_read(named)

            description, notes = read_mjcf_arm(path, without)
            if chosen.velocity is None:
                notes.append(
                    f"MJCF has no limits of speed, {SPEED} rad/s is taken; robot.velocity=[...] says others"
                )

            return description, notes

        return read_urdf(root, path, without, may_lack=chosen.collision == "file")
    except UserError as error:
        raise type(error)(f"{path}: {error}") from error
