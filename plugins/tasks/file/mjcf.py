"""Make bodies and joints of an MJCF file, as MuJoCo's own compiler reads it, in a process of its own."""

from __future__ import annotations

import io
import math
import re
import zipfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, tostring

import numpy as np
from scipy.spatial.transform import Rotation

from core.errors import UserError
from core.geometry import Pose
from core.imports.meshes import MAX_CORNERS
from core.imports.mjcf import JOINT_KINDS, MjcfShapes
from core.scene import Body, Geom, Joint
from core.support.cli import expand
from core.support.sandbox import isolated
from core.support.text import clean
from core.values.urdf import MAX_BYTES, read_xml
from plugins.tasks.file.imports import Imported
from plugins.tasks.file.imports.imported import find_left_out, joined_body
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


def read_mjcf_bodies(
    file: str | Path,
    *,
    prefix: str = "",
    folder: Path | None = None,
    without: Sequence[str] = (),
) -> Imported:
    """Make bodies and joints of an MJCF file, as they stand at the start (``qpos0``).

    A body without joints becomes part of the one that it hangs from, or fixed if that is the world. As in MuJoCo a mesh
    collides as its convex hull, a body that hangs from a fixed one collides with it, and shapes with a ``contype`` and
    a ``conaffinity`` of 0 are only drawn.

    Args:
        file: the MJCF file.
        prefix: put before all names.
        folder: where all files must lie; None: where the MJCF file is.
        without: names of bodies, or patterns, that are left out with all that hangs from them.

    Raises:
        UserError: says what can't be used, where, and how to mend it.
    """
    file = expand(file).absolute()
    left = Counter[str]()
    try:
        root = _read_model(file, folder or file.parent, left)
        _leave_out(root, without, prefix)
        packed = _pack(root, file, folder or file.parent)
        binary = isolated(compile_model, "the model", packed, limit_s=LIMIT_S)
        model = mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": binary})
        return _BodyReading(model, prefix, left).read()
    # RuntimeError: Qhull's, of what is flat.
    except (UserError, ValueError, RuntimeError) as error:
        raise UserError(f"{file}: {clean(str(error), 300)}") from error


def compile_model(packed: bytes) -> bytes:
    """Compile a zipped model to MuJoCo's binary format.

    Raises:
        UserError: MuJoCo refuses it.
    """
    try:
        model = mujoco.MjSpec.from_zip(io.BytesIO(packed)).compile()
    except (ValueError, mujoco.FatalError) as error:
        # The lines that it names are not those of the file.
        reason = re.sub(", line [0-9-]+", "", str(error))
        raise UserError(f"is refused by MuJoCo: {reason}") from error

    binary = np.zeros(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, binary)

    return binary.tobytes()


def _read_model(file: Path, folder: Path, left: Counter[str]) -> Element:
    """Read the bodies of a model, and count what is left out."""
    root = _read_root(file, folder)
    if root.tag != "mujoco":
        raise UserError(
            f"it is no MJCF: its root is <{clean(root.tag, 40)}> instead of <mujoco>"
        )

    _strip(root, file, folder, left)
    return root


def _leave_out(root: Element, without: Sequence[str], prefix: str) -> None:
    """Take bodies out of a model's root, with all that hangs from them.

    Raises:
        UserError: one of them is not there.
    """
    names = [body.get("name", "") for body in root.iter("body")]
    left = find_left_out(without, prefix, filter(None, names))

    for bearer in list(root.iter()):
        for child in list(bearer):
            if child.tag == "body" and child.get("name") in left:
                bearer.remove(child)


def _pack(root: Element, file: Path, folder: Path) -> bytes:
    """Zip a model and its meshes, under names of our own."""
    options = dict[str, str]()
    for compiler in root.iter("compiler"):
        options |= compiler.attrib

    meshes = file.parent / options.get("meshdir", options.get("assetdir", ""))

    for element in root.iter():
        for key in ("assetdir", "meshdir", "texturedir", "texture", "builtin"):
            element.attrib.pop(key, None)

    stream = io.BytesIO()
    names = dict[Path, str]()
    with zipfile.ZipFile(stream, "w") as archive:
        for mesh in root.iterfind(".//mesh[@file]"):
            path = (meshes / mesh.attrib["file"]).resolve()
            kind = path.suffix.lower()
            if kind not in _MESHES:
                kinds = ", ".join(_MESHES)
                raise UserError(f"mesh {path} is of no kind that is read: {kinds}")

            if path not in names:
                names[path] = f"{len(names)}{kind}"
                archive.writestr(names[path], read_inside(path, folder, "mesh"))

            mesh.set("name", mesh.get("name", path.stem))
            mesh.set("file", names[path])
            mesh.set("maxhullvert", str(MAX_CORNERS))

        archive.writestr("model.xml", tostring(root))

    return stream.getvalue()


def _read_root(file: Path, folder: Path) -> Element:
    """Read an XML file of the folder."""
    return read_xml(read_inside(file, folder, "MJCF", MAX_BYTES / 1e6), file)


def _strip(root: Element, file: Path, folder: Path, left: Counter[str]) -> None:
    """Put in what is included, leave out what is not read, and count that.

    Raises:
        UserError: there is too much, or a file can't be included.
    """
    waiting = [(root, 0, 1)]
    included = {file.resolve()}
    total = 0
    while waiting:
        element, depth, copies = waiting.pop()
        copies *= _count_copies(element)
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
                children += reversed(_read_root(other, folder))
            elif child.tag in _READ and child.get("type") not in ("hfield", "sdf"):
                element.append(child)
                waiting.append((child, depth + 1, copies))
            else:
                left[clean(f"{child.tag} {child.get('type', '')}", 40)] += 1


def _count_copies(element: Element) -> int:
    """Return how many copies of what it holds an element makes."""
    if element.tag != "replicate":
        return 1

    count = element.get("count", "").strip()
    if not re.fullmatch("[0-9]{1,3}", count) or int(count) > MAX_BODIES:
        raise UserError(
            f"a replicate has count={clean(count, 20)}; it must be a number up to {MAX_BODIES}"
        )

    return int(count)


class _BodyReading:
    """Bodies and joints of a compiled model, at its ``qpos0``."""

    def __init__(self, model: Any, prefix: str, left: Counter[str]) -> None:
        if model.nbody > MAX_BODIES + 1:
            raise UserError(f"there are more than {MAX_BODIES} bodies; leave some out")

        self._model = model
        self._data = mujoco.MjData(model)
        self._prefix = prefix
        self._left = left
        mujoco.mj_kinematics(model, self._data)
        self._shapes = MjcfShapes(model)
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
        """Make the bodies and joints, and note what was left out."""
        bodies = tuple(filter(None, map(self._body, np.unique(self._heads))))
        numbers = np.flatnonzero(self._model.jnt_type).tolist()  # 0: free
        joints = tuple(self._joint(number) for number in numbers)
        left = sorted((+self._left).items())
        notes = [f"left out: {count} {name}" for name, count in left]
        return Imported(bodies, joints, (*notes, *self._notes))

    def _body(self, head: int) -> Body | None:
        """Make a body of all that is rigidly joined; None: nothing is there."""
        model = self._model
        name = self._names[head]
        joints = model.body_jntnum[head]
        if joints > 1:
            raise UserError(
                f"body {name!r} has {joints} joints; one is read: put a body with mass and shape between"
            )

        pose = _pose(self._data.body(head))
        visuals = list[Geom]()
        collisions = list[Geom]()
        frictions = set[float]()
        for geom in self._shapes.of_bodies(self._heads == head):
            if geom.shape is None or geom.solid is None:
                self._left[f"geom {geom.kind}"] += 1
                continue

            place = pose.inverse() @ _pose(self._data.geom(geom.number))
            if geom.drawn and geom.color[3]:
                visuals.append(Geom(geom.shape, place, geom.color))
            if geom.collides:
                collisions.append(Geom(geom.solid, place, geom.color))
                frictions.add(geom.friction)

        if len(frictions) > 1:
            self._notes.append(
                f"body {name!r}: its shapes have several frictions; all get the largest"
            )

        mass = None
        if self._moves[head]:
            mass = float(model.body_mass[self._heads == head].sum())
        elif not (visuals or collisions):
            return None

        friction = max(frictions, default=1.0)
        return joined_body(name, pose, mass, visuals, collisions, friction)

    def _joint(self, number: int) -> Joint:
        """Make a joint; a range that is a whole turn or more is none."""
        joint = self._model.joint(number)
        body = self._names[joint.bodyid[0]]
        kind = JOINT_KINDS[joint.type[0]]
        parent = self._heads[self._model.body_parentid[joint.bodyid[0]]]
        self._left["armature of a joint"] += bool(joint.armature[0])
        self._left["range of a ball"] += bool(kind == "ball" and joint.limited[0])
        lower, upper = joint.range.tolist()
        turns_freely = kind == "hinge" and upper - lower >= 2 * math.pi
        if not joint.limited[0] or kind == "ball" or turns_freely:
            lower = -math.inf
            upper = math.inf

        start = 0.0
        rest = 0.0
        if kind != "ball":
            start = float(joint.qpos0[0])
            rest = float(joint.qpos_spring[0])

        name = f"{body}_joint"
        if joint.name:
            name = self._prefix + joint.name

        bearer = None
        if self._moves[parent]:
            bearer = self._names[parent]

        return Joint(
            name,
            kind,  # type: ignore[arg-type]  # one of three
            body,
            bearer,
            axis=joint.axis,
            origin=joint.pos.tolist(),
            lower=lower,
            upper=upper,
            start=start,
            damping=float(joint.damping[0]),
            friction=float(joint.frictionloss[0]),
            stiffness=float(joint.stiffness[0]),
            rest=rest,
        )


def _pose(thing: Any) -> Pose:
    """Return where a body or geom is in the world."""
    rotation = Rotation.from_matrix(thing.xmat.reshape(3, 3))
    return Pose.from_rotation(thing.xpos, rotation)
