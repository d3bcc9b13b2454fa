"""Turn mesh files of the usual kinds into what every engine reads alike: convex hulls, and what is drawn."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial import QhullError

from core.errors import UserError
from core.geometry import Color, Triple
from core.imports.meshes import (
    MAX_MB,
    check_size,
    find_color,
    hull_corners,
    kind_of,
    load_parts,
    used_corners,
    whole_content,
)
from core.robot.meshes import keep_file, kept_file
from core.support.files import read_untrusted
from core.support.sandbox import isolated
from core.values.descriptions import ONE, RobotLink, RobotShape

if TYPE_CHECKING:
    import trimesh

GREY: Color = (0.7, 0.7, 0.7, 1.0)  # of shapes without a colour
LIMIT_S = 120
MAX_DRAWN = 100_000  # triangles
_HEAD = 10_000  # bytes of a Collada file, of which the materials are the first


class Job(NamedTuple):
    """What is to be made of a mesh: its convex hull, or with a colour what is drawn.

    The hull is a binary STL file in metres; of more than `MAX_CORNERS` corners those stay that stick out the most. What
    is drawn is a Collada file, z up. It keeps its own colours, one for each of its parts; corners of more than
    `MAX_DRAWN` triangles are merged where they are close.

    Attributes:
        mesh: the path of the file.
        scale: multiplies x, y and z.
        color: of parts that have none, red, green, blue and opacity, 0..1.
    """

    mesh: str
    scale: Triple = ONE
    color: Color | None = None

    def kind(self) -> tuple[str, str]:
        """Name the folder and the kind of file of what is made."""
        return ("hulls", "stl") if self.color is None else ("visuals", "dae")

    def content(self) -> bytes:
        """Read the file's bytes, after what else tells what is made of it.

        Raises:
            UserError: it is missing, of another kind, or too large.
        """
        mesh = Path(self.mesh)
        key = f".{kind_of(mesh)} {[*self.scale, *(self.color or ())]}"
        try:
            data = read_untrusted(mesh, int(MAX_MB * 1_000_000))
            return key.encode() + whole_content(mesh, data)
        except UserError as error:
            raise UserError(
                f"mesh {error}; a large one needs fewer triangles, as MeshLab's edge collapse makes"
            ) from error

    def make(self, *, ours: bool = False) -> Path:
        """Make the file, or find it as it was made before.

        ``ours``: it comes with a package that this project needs, and so is read without a process of its own.

        Raises:
            UserError: the mesh can't be read, is too large or flat, or the file can't be written.
        """

        def run() -> bytes:
            data = json.dumps(self).encode()
            if ours:
                return build(data)

            return isolated(build, f"mesh {self.mesh}", data, limit_s=LIMIT_S)

        return keep_file(*self.kind(), self.content(), run)


def find_job(shape: RobotShape, *, drawn: bool) -> Job | None:
    """Say what is to be made of a shape; None: it is no mesh."""
    if not isinstance(shape.shape, Path):
        return None

    color = shape.color or GREY
    return Job(str(shape.shape), shape.scale, color if drawn else None)


def make_shape(shape: RobotShape, drawn: bool) -> RobotShape:
    """Replace a mesh by what is made of it: its hull, or what is drawn.

    Raises:
        UserError: see `Job.make`.
    """
    job = find_job(shape, drawn=drawn)
    if job is None:
        return shape

    file = job.make()
    color = shape.color
    if drawn:
        color = main_color(file) or job.color

    return RobotShape(file, shape.origin, color)


def make_all(links: Iterable[RobotLink]) -> None:
    """Make what is not there yet of all meshes in one process, so that `Job.make` finds it, or says what fails."""
    jobs = list[Job | None]()
    for link in links:
        jobs += [find_job(shape, drawn=False) for shape in link.collisions]
        jobs += [find_job(shape, drawn=True) for shape in link.visuals]

    waiting = []
    for job in filter(None, dict.fromkeys(jobs)):
        with contextlib.suppress(UserError):
            if not kept_file(*job.kind(), job.content()).is_file():
                waiting.append(job)

    if len(waiting) > 1:
        data = json.dumps(waiting).encode()
        with contextlib.suppress(UserError):
            isolated(build_all, "meshes", data, limit_s=LIMIT_S)


def build_all(data: bytes) -> bytes:
    """Keep what `make_all` asks for."""
    for words in json.loads(data):
        with contextlib.suppress(UserError):
            Job(*words).make(ours=True)

    return b""


def main_color(drawn: Path) -> Color | None:
    """Read the colour of the largest part of what was made to draw: PyBullet draws a link in one colour."""
    with drawn.open("rb") as file:
        found = re.search(rb"<diffuse>\s*<color>([^<]*)<", file.read(_HEAD))

    if found is None:
        return None

    return tuple(map(float, found[1].split()))


def build(data: bytes) -> bytes:
    """Make the hull of a mesh file as STL, or what is drawn of it as Collada: of a `Job` as JSON.

    Raises:
        UserError: it can't be made.
    """
    job = Job(*json.loads(data))
    parts = _load(Path(job.mesh), job.scale)
    return _hull(parts) if job.color is None else _collada(parts, job.color)


def _load(mesh: Path, scale: Triple) -> list[trimesh.Trimesh]:
    """Read a mesh file's parts in metres, each with triangles and a colour of its own.

    Raises:
        UserError: it can't be read, is empty, or far too large for a link.
    """
    parts = load_parts(mesh.read_bytes(), mesh)
    for part in parts:
        part.apply_transform(np.diag([*scale, 1.0]))

    corners = np.concatenate([used_corners(part) for part in parts])
    check_size(float(np.ptp(corners, axis=0).max()))
    return parts


def _hull(parts: list[trimesh.Trimesh]) -> bytes:
    import trimesh  # which takes half a second

    corners = np.concatenate([used_corners(part) for part in parts])
    try:
        hull = trimesh.Trimesh(hull_corners(corners), process=False).convex_hull
        return bytes(hull.export(file_type="stl"))
    except QhullError as error:
        mend = "a collision shape needs a volume: give it depth, or use a <box>"
        raise UserError(f"is flat; {mend}") from error


def _collada(parts: list[trimesh.Trimesh], color: Sequence[float]) -> bytes:
    import trimesh  # which takes half a second

    drawn = []
    for part in sorted(parts, key=lambda part: -part.area):  # see `main_color`
        painted = find_color(part) or color
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=painted)

        plain = _coarsen(part)
        plain.visual = trimesh.visual.TextureVisuals(material=material)
        drawn.append(plain)

    return bytes(trimesh.exchange.dae.export_collada(drawn)).replace(b"Y_UP", b"Z_UP")


def _coarsen(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Copy a mesh with at most `MAX_DRAWN` triangles: corners of one cell of a grid become one."""
    import trimesh  # which takes half a second

    coarse = trimesh.Trimesh(mesh.vertices, mesh.faces)
    cells = 256
    while len(coarse.faces) > MAX_DRAWN:
        width = mesh.extents.max() / cells
        cells = cells // 2
        corners = np.round(mesh.vertices / width) * width
        coarse = trimesh.Trimesh(corners, mesh.faces)  # merges what is equal
        whole = coarse.nondegenerate_faces() & coarse.unique_faces()
        coarse.update_faces(whole)

    return coarse
