"""Describe a model that MuJoCo compiled of an MJCF file; callers bring the model, so core needs no engine."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from core.errors import UserError
from core.geometry import (
    Array,
    Box,
    Capsule,
    Color,
    Cylinder,
    Mesh,
    Pose,
    Shape,
    Sphere,
)
from core.values.descriptions import (
    DIGITS,
    MOVING,
    Description,
    Inertial,
    Limits,
    Origin,
    RobotJoint,
    RobotLink,
    RobotShape,
)

WORLD = "world"
"""The root of each description: what stands in the file's world, or moves there, hangs on it."""

# Of joints and geoms by MuJoCo's numbers.
_JOINTS = ("floating", "ball", "prismatic", "revolute")
_GEOMS = (
    *("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box"),
    *("mesh", "sdf"),
)
_DRAWN_GROUPS = 3  # MuJoCo's viewer shows the groups before
_GREY = (0.5,) * 3 + (1.0,)  # of a geom without a colour: its material's counts
_BETWEEN = 0.01  # of a body's mass, for each link between two of its joints
_SHAPES: dict[str, Callable[[float, float, float], Shape]] = {
    "sphere": lambda x, y, z: Sphere(x),
    "capsule": lambda x, y, z: Capsule(x, 2 * y),
    "cylinder": lambda x, y, z: Cylinder(x, 2 * y),
    "box": lambda x, y, z: Box((2 * x, 2 * y, 2 * z)),
    "ellipsoid": lambda *radii: Mesh.from_trimesh(
        Sphere(1.0).to_trimesh().apply_scale(radii)
    ),
}


def list_files(root: Element, file: Path) -> Iterator[Path]:
    """Yield the files that an MJCF file names and that are there."""
    folders = [file.parent]
    for compiler in root.iter("compiler"):
        for key in ("meshdir", "assetdir", "texturedir"):
            folders.append(file.parent / compiler.get(key, ""))

    for folder, element in product(folders, root.iter()):
        named = folder / element.get("file", "")
        if named.is_file():
            yield named


def describe_model(
    model: Any, name: str, is_frame: Callable[[str], bool]
) -> tuple[Description, list[str]]:
    """Describe all bodies of a ``mujoco.MjModel``, at 0 of their joints, in the order of the file.

    Args:
        model: the compiled model.
        name: of the description.
        is_frame: tells by its name whether a site becomes a link without shapes.

    Returns:
        links and joints; and what was left out or assumed, a line each.

    Raises:
        UserError: two links would have one name.
    """
    reading = _ModelReading(model)
    reading.read(is_frame)
    left = [f"left out: {count} {what}" for what, count in sorted(reading.left.items())]
    return Description(name, reading.links, reading.joints), left + reading.notes


class _ModelReading:
    """Links and joints of a compiled model, by its names, and what is left out of it."""

    def __init__(self, model: Any) -> None:
        self.links = {WORLD: RobotLink(WORLD)}
        self.joints = dict[str, RobotJoint]()
        self.left = Counter[str]()
        self.notes = list[str]()
        self._model = model
        self._meshes = dict[int, Mesh]()
        # Of each body: its link, and its frame in the link's.
        self._frames = {0: (WORLD, Pose())}

    def read(self, is_frame: Callable[[str], bool]) -> None:
        """Add the links of all bodies, and frames."""
        model = self._model
        self._fill(WORLD, model.body(0), Pose(), 1.0)
        for body in map(model.body, range(1, model.nbody)):
            self._add(body)

        for site in map(model.site, range(model.nsite)):
            if is_frame(site.name) and site.name not in self.links:
                parent, frame = self._frames[site.bodyid[0]]
                self._bear(site.name, parent, frame @ _pose(site.pos, site.quat))

        constraints = {"equality constraint": model.neq, "tendon": model.ntendon}
        self.left += Counter(constraints)

    def _add(self, body: Any) -> None:
        """Add a body's link; of several joints each but the last bears a link with a small part of its mass."""
        name = body.name or f"body{body.id}"
        parent, frame = self._frames[body.parentid[0]]
        frame = frame @ _pose(body.pos, body.quat)
        numbers = range(body.jntadr[0], body.jntadr[0] + body.jntnum[0])
        joints = [self._model.joint(number) for number in numbers]
        if not joints:
            self._bear(name, parent, frame)
            frame = Pose()

        share = 1.0
        for count, joint in enumerate(joints, 1):
            child = name if count == len(joints) else f"{name}:{count}"
            anchor = Pose(joint.pos)
            self._bear(child, parent, frame @ anchor, joint)
            frame = anchor.inverse()
            parent = child
            if child != name:
                share -= _BETWEEN
                weight = _weigh(body, frame, _BETWEEN)
                self.links[child] = RobotLink(child, weight)
                self.notes.append(
                    f"link {child!r}, between two joints of a body, gets {_BETWEEN:.0%} of its mass"
                )

        self._frames[body.id] = name, frame
        self._fill(name, body, frame, share)

    def _bear(self, name: str, parent: str, place: Pose, joint: Any = None) -> None:
        """Add a link without shapes, and the joint that bears it, at 0 of that.

        Raises:
            UserError: there is a link of that name.
        """
        if name in self.links:
            raise UserError(f"two links would be named {name!r}; rename that body")

        self.links[name] = RobotLink(name)
        borne = RobotJoint.fixed(f"{name}_fixed", parent, name, place, DIGITS)
        if joint is not None:
            borne = self._joint(borne, joint, place)

        self.joints[name] = borne

    def _joint(self, fixed: RobotJoint, joint: Any, place: Pose) -> RobotJoint:
        """Make a joint move what it bears; ``place`` is where that is in the file, at the joint's start."""
        kind = _JOINTS[joint.type[0]]
        limited = bool(joint.limited[0])
        if kind == "revolute" and not limited:
            kind = "continuous"

        lower, upper = joint.range.tolist()
        if not limited:
            lower = -math.inf
            upper = math.inf

        start = 0.0
        rest = 0.0
        if kind in MOVING:
            start = float(joint.qpos0[0])
            rest = float(joint.qpos_spring[0])

        borne = replace(
            fixed,
            name=joint.name or f"{fixed.child}_joint",
            kind=kind,
            axis=tuple(joint.axis.tolist()),
            limits=Limits(lower, upper, self._find_effort(joint.id)),
            damping=float(joint.damping[0]),
            friction=float(joint.frictionloss[0]),
            spring=(float(joint.stiffness[0]), rest),
            armature=float(joint.armature[0]),
            start=start,
        )
        origin = Origin.from_pose(place @ borne.moved(-start), DIGITS)
        return replace(borne, origin=origin)

    def _find_effort(self, joint: int) -> float | None:
        """Return the largest force or torque that drives a joint; None: it has no limit."""
        model = self._model
        forces = []
        if model.jnt_actfrclimited[joint]:
            forces.append(model.jnt_actfrcrange[joint])

        for motor in map(model.actuator, range(model.nu)):
            if motor.trnid[0] != joint or motor.trntype[0] > 1:
                continue
            if motor.forcelimited[0]:
                forces.append(motor.forcerange * motor.gear[0])
            elif motor.ctrllimited[0] and not motor.biastype[0]:
                forces.append(motor.ctrlrange * motor.gainprm[0] * motor.gear[0])

        most = [float(np.abs(ends).max()) for ends in forces]
        return min(most, default=None)

    def _fill(self, name: str, body: Any, frame: Pose, share: float) -> None:
        """Give a link its share of what its body weighs, and its shapes; ``frame`` is the body's in the link."""
        visuals = list[RobotShape]()
        collisions = list[RobotShape]()
        for number in np.flatnonzero(self._model.geom_bodyid == body.id).tolist():
            geom = self._model.geom(number)
            kind = _GEOMS[geom.type[0]]
            solid = self._shape(kind, geom)
            if solid is None:
                self.left[f"geom {kind}"] += 1
                continue

            place = Origin.from_pose(frame @ _pose(geom.pos, geom.quat), DIGITS)
            color = self._color(geom)
            shape = RobotShape(solid, place, color, friction=float(geom.friction[0]))
            if geom.contype[0] or geom.conaffinity[0]:
                collisions.append(shape)
            if geom.group[0] < _DRAWN_GROUPS and color[3]:
                visuals.append(shape)

        weight = _weigh(body, frame, share)
        shapes = (tuple(collisions), tuple(visuals))
        self.links[name] = RobotLink(
            name, weight, *shapes, tuple(frame.position.tolist())
        )

    def _shape(self, kind: str, geom: Any) -> Shape | None:
        """Make the shape of a geom; None: it is of a kind that is not read."""
        if kind in _SHAPES:
            return _SHAPES[kind](*geom.size.tolist())
        if kind != "mesh":
            return None

        number = int(geom.dataid[0])
        if number not in self._meshes:
            mesh = self._model.mesh(number)
            corners = self._model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]]
            triangles = self._model.mesh_face[mesh.faceadr[0] :][: mesh.facenum[0]]
            self._meshes[number] = Mesh(corners, triangles)

        return self._meshes[number]

    def _color(self, geom: Any) -> Color:
        """Return a geom's own colour, or its material's; the opacity may be 0."""
        color = geom.rgba
        if geom.matid[0] >= 0 and np.allclose(color, _GREY):
            color = self._model.mat_rgba[geom.matid[0]]

        return tuple(np.clip(color, 0, 1).tolist())


def _weigh(body: Any, frame: Pose, share: float) -> Inertial:
    """Weigh a share of a body, whose frame in the link is ``frame``."""
    origin = Origin.from_pose(frame @ _pose(body.ipos, body.iquat), DIGITS)
    xx, yy, zz = (share * body.inertia).tolist()
    mass = share * float(body.mass[0])
    return Inertial(mass, origin.xyz, (xx, 0.0, 0.0, yy, 0.0, zz), origin.rpy)


def _pose(position: Array, quaternion: Array) -> Pose:
    """Make a pose of MuJoCo's numbers."""
    rotation = Rotation.from_quat(quaternion, scalar_first=True)
    return Pose.from_rotation(position, rotation)
