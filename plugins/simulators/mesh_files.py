"""Write meshes to files, for engines that read nothing else."""

from __future__ import annotations

from pathlib import Path

from core.geometry import Mesh
from core.support.scratch import write_once


def mesh_file(mesh: Mesh, folder: Path) -> Path:
    """Return a file of a mesh in a folder; equal meshes share one, which is written once."""
    return write_once(
        folder / f"{mesh.content}.obj",
        lambda: str(mesh.to_trimesh().export(file_type="obj")),
    )
