"""Make bodies and joints of an MJCF file, as MuJoCo's own compiler reads it, in a process of its own."""

from __future__ import annotations

import io
import math
import re
import zipfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import tostring

import numpy as np
from scipy.spatial.transform import Rotation

from core.errors import UserError
from core.geometry import Box, Capsule, Cylinder, Mesh, Pose, Shape, Sphere
from core.robot.meshes import MAX_CORNERS
from core.scene import Body, Geom, Joint
from core.support.sandbox import isolated
from core.support.text import clean
from core.values.urdf import MAX_BYTES, NAME, read_xml
from plugins.tasks.file.imports import Imported
from plugins.tasks.file.imports.bodies import joined_body
from plugins.tasks.file.imports.solids import read_inside

try:
    import mujoco
except (ImportError, RuntimeError) as error:  # it reads MUJOCO_GL when it is imported
    raise UserError(
        f"MuJoCo reads MJCF files, but can't be imported ({error}): pip install 'mujoco>=4,<5'"
    ) from error

LIMIT_S = 60
MAX_DEPTH = 64
MAX_BODIES = 500
MAX_ELEMENTS = 20_000  # with all copies of a replicate
_READ = {"compiler", "default", "asset", "mesh", "material", "worldbody"}
_READ |= {"body", "frame", "replicate", "inertial", "joint", "freejoint", "geom"}
_MESHES = (".obj", ".stl", ".msh")
_JOINTS = ("free", "ball", "slider", "hinge")  # in MuJoCo's order
_SHAPES: dict[str, Callable[[float, float, float], Shape]] = {
    "SPHERE": lambda x, y, z: Sphere(x),
    "CAPSULE": lambda x, y, z: Capsule(x, 2 * y),
    "CYLINDER": lambda x, y, z: Cylinder(x, 2 * y),
    "BOX": lambda x, y, z: Box((2 * x, 2 * y, 2 * z)),
    "ELLIPSOID": lambda *radii: Mesh.from_trimesh(
        Sphere(1.0).to_trimesh().apply_scale(radii)
    ),
}
_GREY = (
    0.5,
    0.5,
    0.5,
    1.0,
)  # of a shape that names no colour, so that its material's counts


def read_mjcf(
    file: str | Path, *, prefix: str = "", folder: Path | None = None
) -> Imported:
    """Make bodies and joints of an MJCF file, as they stand at the start (``qpos0``).

    A body without joints becomes part of the one that it hangs from, or fixed if that is the world. As in MuJoCo a mesh
    collides as its convex hull, a body that hangs from a fixed one collides with it, and shapes with a ``contype`` and
    a ``conaffinity`` of 0 are only drawn.

    Args:
        file: the MJCF file.
        prefix: put before all names.
        folder: where all files must lie; None: where the MJCF file is.

    Raises:
        UserError: says what can't be used, where, and how to mend it.
    """
    file = Path(file).expanduser().absolute()
    left = Counter[str]()
    try:
        made = isolated(
            compile_model,
            "the model",
            _packed(file, folder or file.parent, left),
            limit_s=LIMIT_S,
        )
        model = mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": made})
        return _Reading(model, prefix, left).read()
    except (
        UserError,
        ValueError,
        RuntimeError,
    ) as error:  # the last is Qhull's, of what is flat
        raise UserError(f"{file}: {clean(str(error), 300)}") from error


def compile_model(packed: bytes) -> bytes:
    """Compile a zipped model to MuJoCo's binary format.

    Raises:
        UserError: MuJoCo refuses it.
    """
    try:
        model = mujoco.MjSpec.from_zip(io.BytesIO(packed)).compile()
    except (
        ValueError,
        mujoco.FatalError,
    ) as error:  # the lines that it names are not those of the file
        raise UserError(
            "is refused by MuJoCo: " + re.sub(", line [0-9-]+", "", str(error))
        ) from error
    made = np.zeros(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, made)
    return made.tobytes()


def _packed(file: Path, folder: Path, left: Counter[str]) -> bytes:
    """Zip the bodies of a model and their meshes, under names of our own, and count what is left out."""
    root = read_xml(read_inside(file, folder, "MJCF", MAX_BYTES / 1e6), file)
    if root.tag != "mujoco":
        raise UserError(
            f"it is no MJCF: its root is <{clean(root.tag, 40)}> instead of <mujoco>"
        )
    waiting = [(root, 0, 1)]
    included = {file.resolve()}
    total = 0
    while waiting:
        element, depth, copies = waiting.pop()
        if element.tag == "replicate":
            count = element.get("count", "").strip()
            if not re.fullmatch("[0-9]{1,3}", count) or int(count) > MAX_BODIES:
                raise UserError(
                    f"a replicate has count={clean(count, 20)}; it must be a number up to {MAX_BODIES}"
                )
            copies *= int(count)
        total += copies
        if depth > MAX_DEPTH:
            raise UserError(f"elements are nested more than {MAX_DEPTH} deep")
        if total > MAX_ELEMENTS:
            raise UserError(
                f"there are more than {MAX_ELEMENTS} elements, with all copies; leave some out"
            )
        children = [*reversed(element)]
        element[:] = []
        while children:
            child = children.pop()
            if child.tag == "include":
                other = (file.parent / child.get("file", "")).resolve()
                if other in included:
                    raise UserError(f"{other} is included twice; leave one of them out")
                included.add(other)
                children += reversed(
                    read_xml(read_inside(other, folder, "MJCF", MAX_BYTES / 1e6), other)
                )
            elif child.tag in _READ and child.get("type") not in ("hfield", "sdf"):
                element.append(child)
                waiting.append((child, depth + 1, copies))
            else:
                left[clean(f"{child.tag} {child.get('type', '')}", 40)] += 1
    options = {
        key: value
        for compiler in root.iter("compiler")
        for key, value in compiler.items()
    }
    meshes = file.parent / options.get("meshdir", options.get("assetdir", ""))
    for element in root.iter():
        for key in ("assetdir", "meshdir", "texturedir", "texture", "builtin"):
            element.attrib.pop(key, None)
    stream = io.BytesIO()
    names = dict[Path, str]()
    with zipfile.ZipFile(stream, "w") as archive:
        for mesh in root.iterfind(".//mesh[@file]"):
            path = (meshes / mesh.attrib["file"]).resolve()
            if (kind := path.suffix.lower()) not in _MESHES:
                raise UserError(
                    f"mesh {path} is of no kind that is read: {', '.join(_MESHES)}"
                )
            if path not in names:
                names[path] = f"{len(names)}{kind}"
                archive.writestr(names[path], read_inside(path, folder, "mesh"))
            mesh.attrib |= {
                "name": mesh.get("name", path.stem),
                "file": names[path],
                "maxhullvert": str(MAX_CORNERS),
            }
        archive.writestr("model.xml", tostring(root))
    return stream.getvalue()


class _Reading:
    def __init__(self, model: Any, prefix: str, left: Counter[str]) -> None:
        if model.nbody > MAX_BODIES + 1:
            raise UserError(f"there are more than {MAX_BODIES} bodies; leave some out")
        self._model = model
        self._data = mujoco.MjData(model)
        self._prefix = prefix
        self._left = left
        mujoco.mj_kinematics(model, self._data)
        self._meshes = [self._mesh(model.mesh(number)) for number in range(model.nmesh)]
        self._notes: list[str] = []
        self._names = [
            prefix + (model.body(number).name or f"body{number}")
            for number in range(model.nbody)
        ]
        numbers = np.arange(model.nbody)
        welded = model.body_weldid
        self._moves = (welded == numbers) & (numbers > 0)
        self._heads = np.where(welded > 0, welded, numbers)

    def read(self) -> Imported:
        bodies = [body for head in np.unique(self._heads) if (body := self._body(head))]
        joints = [
            self._joint(self._model.joint(number))
            for number in np.flatnonzero(self._model.jnt_type)
        ]  # 0: free
        left = [
            f"left out: {count} {what}"
            for what, count in sorted(self._left.items())
            if count
        ]
        return Imported(tuple(bodies), tuple(joints), (*left, *self._notes))

    def _mesh(self, mesh: Any) -> tuple[Shape, Shape]:
        """Make what is drawn of a mesh, and its hull, from the lists of numbers that MuJoCo keeps of it."""
        corners = self._model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]]
        drawn = Mesh(
            corners, self._model.mesh_face[mesh.faceadr[0] :][: mesh.facenum[0]]
        )
        if mesh.graphadr[0] < 0:  # it does not collide
            return drawn, drawn
        graph = self._model.mesh_graph[mesh.graphadr[0] :]
        count, faces = graph[:2]
        used, numbers = np.unique(
            graph[2 + 3 * (count + faces) :][: 3 * faces], return_inverse=True
        )
        return drawn, Mesh(corners[used], numbers.reshape(-1, 3))

    def _body(self, head: int) -> Body | None:
        """Make a body of all that is rigidly joined; None: nothing is there."""
        model = self._model
        data = self._data
        name = self._names[head]
        if not NAME.fullmatch(name.removeprefix(self._prefix)):
            raise UserError(
                f"body {name[:64]!r}: its name is not 1 to 64 letters, digits, '_', '.' or '-'; rename it"
            )
        if (joints := model.body_jntnum[head]) > 1:
            raise UserError(
                f"body {name!r} has {joints} joints; one is read: put a body with mass and shape between"
            )
        at = _pose(data.body(head))
        visuals = list[Geom]()
        collisions = list[Geom]()
        frictions = set[float]()
        for number in np.flatnonzero(self._heads[model.geom_bodyid] == head):
            geom = model.geom(number)
            kind = mujoco.mjtGeom(model.geom_type[number]).name.removeprefix("mjGEOM_")
            if kind not in (*_SHAPES, "MESH"):
                self._left[f"geom {kind.lower()}"] += 1
                continue
            drawn, solid = (
                self._meshes[geom.dataid[0]]
                if kind == "MESH"
                else (_SHAPES[kind](*geom.size.tolist()),) * 2
            )
            plain = geom.matid[0] >= 0 and np.allclose(geom.rgba, _GREY)
            red, green, blue, opacity = np.clip(
                model.mat_rgba[geom.matid[0]] if plain else geom.rgba, 0, 1
            ).tolist()
            place = at.inverse() @ _pose(data.geom(number))
            if geom.group[0] < 3 and opacity:  # as in MuJoCo's viewer
                visuals.append(Geom(drawn, place, (red, green, blue, opacity)))
            if geom.contype[0] or geom.conaffinity[0]:
                collisions.append(Geom(solid, place, (red, green, blue, opacity)))
                frictions.add(float(geom.friction[0]))
        if len(frictions) > 1:
            self._notes.append(
                f"body {name!r}: its shapes have several frictions; all get the largest"
            )
        if not (self._moves[head] or visuals or collisions):
            return None
        mass = (
            float(model.body_mass[self._heads == head].sum())
            if self._moves[head]
            else None
        )
        return joined_body(
            name, at, mass, visuals, collisions, max(frictions, default=1.0)
        )

    def _joint(self, joint: Any) -> Joint:
        body = self._names[joint.bodyid[0]]
        kind = _JOINTS[joint.type[0]]
        parent = self._heads[self._model.body_parentid[joint.bodyid[0]]]
        self._left["armature of a joint"] += bool(joint.armature[0])
        self._left["range of a ball"] += bool(kind == "ball" and joint.limited[0])
        lower, upper = joint.range.tolist()
        if (
            not joint.limited[0]
            or kind == "ball"
            or (kind == "hinge" and upper - lower >= 2 * math.pi)
        ):
            lower = -math.inf
            upper = math.inf
        return Joint(
            self._prefix + joint.name if joint.name else f"{body}_joint",
            kind,  # type: ignore[arg-type]  # one of three
            body,
            self._names[parent] if self._moves[parent] else None,
            axis=joint.axis,
            origin=joint.pos.tolist(),
            lower=lower,
            upper=upper,
            start=0.0 if kind == "ball" else float(joint.qpos0[0]),
            damping=float(joint.damping[0]),
            friction=float(joint.frictionloss[0]),
            stiffness=float(joint.stiffness[0]),
            rest=0.0 if kind == "ball" else float(joint.qpos_spring[0]),
        )


def _pose(thing: Any) -> Pose:
    return Pose.from_rotation(
        thing.xpos, Rotation.from_matrix(thing.xmat.reshape(3, 3))
    )
