"""Read the files that a scene names: meshes, URDF and MJCF of its own folder."""

from __future__ import annotations

from pathlib import Path

from core.errors import UserError
from core.imports.meshes import KINDS
from core.values.warnings import warn_once
from plugins.tasks.file.imports import Imported, read_bodies, read_mesh

HOLDING = (".urdf", ".xml", ".mjcf")


class Files:
    """The files of a folder, each read once, so that all layouts have the same."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._read: dict[tuple[object, ...], Imported] = {}

    def mesh(self, name: str, scale: float) -> Imported:
        """Read a mesh as a body of 1 kg/m^3 at the origin.

        Raises:
            UserError: it can't be used.
        """
        if Path(name).suffix.lower() in HOLDING:
            raise UserError(
                f"{name} holds bodies of its own; name it under imports, not as the shape of a body"
            )

        if (name, scale) not in self._read:
            found = read_mesh(self.folder / name, scale, self.folder)
            self._keep((name, scale), found)

        return self._read[name, scale]

    def bodies(
        self,
        name: str,
        prefix: str,
        *,
        fixed: bool,
        without: tuple[str, ...] = (),
        density: float | None = None,
    ) -> Imported:
        """Read the bodies and joints of a URDF or MJCF file, at the origin, without some.

        Raises:
            UserError: it can't be used.
        """
        file = self.folder / name
        if Path(name).suffix.lower() in KINDS:
            raise UserError(
                f"{name} is a mesh, the `file` of a body; an import is a URDF or MJCF file"
            )

        key = (name, prefix, fixed, without, density)
        if key not in self._read:
            found = read_bodies(
                file,
                fixed=fixed,
                prefix=prefix,
                folder=self.folder,
                without=without,
                density=density,
            )
            self._keep(key, found)

        return self._read[key]

    def _keep(self, key: tuple[object, ...], found: Imported) -> None:
        """Keep what was read, and report what is to be known of it."""
        self._read[key] = found
        for note in found.notes:
            warn_once(f"{self.folder / str(key[0])}: {note}")
