"""Describe an arm in an MJCF file, as MuJoCo's own compiler reads it, in a process of its own."""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from core.errors import UserError, choices
from core.geometry import Array, Mesh, Pose
from core.imports.mjcf import JOINT_KINDS, MjcfGeom, MjcfShapes
from core.robot.meshes import keep_file
from core.robot.shape_files import urdf_shapes
from core.support.sandbox import isolated
from core.support.text import clean
from core.values.descriptions import (
    DIGITS,
    Description,
    Inertial,
    Limits,
    Origin,
    RobotJoint,
    RobotLink,
    RobotShape,
)
from plugins.robots.naming import names_tool_frame
from plugins.robots.near import describe_near, find_near

try:
    import mujoco
except (ImportError, RuntimeError) as error:  # it reads MUJOCO_GL when it is imported
    raise UserError(
        f"MuJoCo reads MJCF files, but can't be imported ({error}): pip install 'mujoco>=4,<5'"
    ) from error

LIMIT_S = 120
WORLD = "world"
_BETWEEN = 0.01  # of a body's mass, for each link between two of its joints
SPEED = 3.14  # rad/s or m/s: MJCF has no limits of speed
_KINDS = {"ball": "floating", "slider": "prismatic", "hinge": "revolute"}
"""Of joints, by their kinds in MJCF."""
_FREE = JOINT_KINDS.index("free")


def read_mjcf_arm(
    file: Path, without: Collection[str] = ()
) -> tuple[Description, list[str], dict[str, float]]:
    """Describe what stands in the world and has joints; its meshes become files in the user's cache folder.

    Args:
        file: the MJCF file.
        without: links that are left out, with all that they bear.

    Returns:
        links and joints; what was assumed or left out, a line each; the motors' inertias by joint, kg m^2.

    Raises:
        UserError: MuJoCo refuses the file, or nothing moves.
    """
    compiled = isolated(compile_arm, "the model", b"", str(file), limit_s=LIMIT_S)
    said, _, binary = compiled.partition(b"\n")
    notes: list[str] = json.loads(said)
    model = mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": binary})
    reading = _ArmReading(model, notes)
    reading.read(without)
    whole = Description(file.stem, reading.links, reading.joints)
    for link in without:
        if link not in whole.links:
            raise choices("link", link, whole.links)

    return whole.without(*without), notes, reading.motors


def compile_arm(_: bytes, file: str) -> bytes:
    """Compile a model without what only pictures need; return notes, a line of JSON, and MuJoCo's binary format.

    Raises:
        UserError: MuJoCo refuses it, or meshes are missing.
    """
    try:
        spec = mujoco.MjSpec.from_file(file)
        for thing in (*spec.textures, *spec.keys, *spec.skins):
            spec.delete(thing)

        for material in spec.materials:
            material.textures = [""] * len(material.textures)

        notes = list[str]()
        try:
            model = spec.compile()
        except ValueError:
            notes = _find_meshes(spec, Path(file))
            model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise UserError(f"is refused by MuJoCo: {clean(str(error), 300)}") from error

    binary = np.zeros(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, binary)
    return json.dumps(notes).encode() + b"\n" + binary.tobytes()


def _find_meshes(spec: Any, file: Path) -> list[str]:
    """Take meshes that are near where the file says, leave out missing ones that are only drawn, and say so.

    Raises:
        UserError: others are missing; names all of them.
    """
    near: dict[str, Path] = {}
    missing = {}
    for mesh in list(spec.meshes):
        named = str(Path(spec.meshdir, mesh.file))
        wanted = Path(spec.modelfiledir, named)
        if not mesh.file or wanted.is_file():
            continue

        alike = find_near(named.replace("\\", "/"), file)
        if alike is not None:
            near[named] = alike
            mesh.file = str(alike.absolute())
            continue

        missing[mesh.name or wanted.stem] = str(wanted)
        spec.delete(mesh)

    needed = set[str]()
    for geom in list(spec.geoms):
        if geom.meshname in missing:
            if geom.contype or geom.conaffinity:
                needed.add(missing[geom.meshname])
            spec.delete(geom)

    if needed:
        raise UserError(
            f"names mesh files that are missing: {', '.join(sorted(needed))}"
        )

    left_out = [
        f"not drawn, as there is no file {wanted}; where its body has no <inertial> it weighs less"
        for wanted in missing.values()
    ]
    return describe_near(near) + left_out


class _ArmReading:
    """Links and joints of a compiled model, by its names."""

    def __init__(self, model: Any, notes: list[str]) -> None:
        self.links = dict[str, RobotLink]()
        self.joints = dict[str, RobotJoint]()
        # Of each joint the motor's inertia, kg m^2.
        self.motors = dict[str, float]()
        self._model = model
        self._geoms = MjcfShapes(model)
        self._notes = notes
        # Of each body: its link, and its frame in the link's.
        self._frames = {0: (WORLD, Pose())}

    def read(self, without: Collection[str]) -> None:
        """Add the links of all bodies that count, and frames for tools."""
        model = self._model
        kept = self._find_kept()
        tops = [model.body(number) for number in kept]
        tops = [top for top in tops if top.name not in without]
        if len(tops) != 1 or (model.jnt_type[model.jnt_bodyid == tops[0].id] > 0).any():
            self.links[WORLD] = RobotLink(WORLD)
        elif _pose(tops[0].pos, tops[0].quat) != Pose():
            self._notes.append(
                "where it stands in the file's world is left out; robot.base=[x,y,z,yaw] places it"
            )

        for number in range(1, model.nbody):
            if model.body_rootid[number] in kept:
                self._add(model.body(number))

        for site in map(model.site, range(model.nsite)):
            for_tools = names_tool_frame(site.name) and site.name not in self.links
            if for_tools and site.bodyid[0] in self._frames:
                parent, frame = self._frames[site.bodyid[0]]
                self._bear(site.name, parent, frame @ _pose(site.pos, site.quat))

        if model.neq or model.ntendon:
            self._notes.append(
                f"left out: {model.neq} equality constraints, {model.ntendon} tendons"
            )

    def _find_kept(self) -> set[int]:
        """Find what stands in the world and has joints; what is free to move counts if nothing else does."""
        model = self._model
        roots = model.body_rootid[model.jnt_bodyid]
        free = {*roots[model.jnt_type == _FREE].tolist()}
        moving = {*roots[model.jnt_type != _FREE].tolist()}
        kept = moving - free or moving
        if not kept:
            raise UserError(
                "no joint moves in this MJCF file; give the file that includes the arm, or that it includes"
            )

        if kept & free:
            self._notes.append("its base, which is free there, is fixed here")

        others = {*model.body_rootid.tolist()} - kept - {0}
        if others:
            names = [model.body(number).name for number in sorted(others)]
            self._notes.append(f"left out, as no arms: {', '.join(names)}")

        return kept

    def _add(self, body: Any) -> None:
        """Add a body's link; of several joints each but the last bears a link with a small part of its mass."""
        name = body.name or f"body{body.id}"
        parent, frame = self._frames[body.parentid[0]]
        frame = frame @ _pose(body.pos, body.quat)
        numbers = range(body.jntadr[0], body.jntadr[0] + body.jntnum[0])
        joints = [joint for joint in map(self._model.joint, numbers) if joint.type[0]]
        between = dict[str, Pose]()
        for count, joint in enumerate(joints, 1):
            child = name if count == len(joints) else f"{name}:{count}"
            anchor = Pose(joint.pos)
            self._bear(child, parent, frame @ anchor, joint)
            frame = anchor.inverse()
            parent = child
            if child != name:
                between[child] = frame

        if not joints:
            self._bear(name, parent, frame)
            frame = Pose()

        self._frames[body.id] = name, frame
        self._fill(name, body, frame, 1 - _BETWEEN * len(between))
        for child, place in between.items():
            weight = _weigh(body, place, _BETWEEN)
            self.links[child] = RobotLink(child, weight)
            self._notes.append(
                f"link {child!r}, between two joints of a body, gets {_BETWEEN:.0%} of its mass"
            )

    def _bear(self, name: str, parent: str, place: Pose, joint: Any = None) -> None:
        """Add a link without shapes, and the joint that bears it, at 0 of that; the base has none.

        Raises:
            UserError: there is a link of that name.
        """
        if name in self.links:
            raise UserError(f"two links would be named {name!r}; rename that body")

        self.links[name] = RobotLink(name)
        if parent not in self.links:
            return

        fixed = RobotJoint.fixed(f"{name}_fixed", parent, name, place, DIGITS)
        self.joints[name] = fixed
        if joint is None:
            return

        called = joint.name or f"{name}_joint"
        self.motors[called] = float(self._model.dof_armature[joint.dofadr[0]])
        kind = _KINDS[JOINT_KINDS[joint.type[0]]]
        if kind == "floating":  # a ball, which has no axis
            self.joints[name] = replace(fixed, name=called, kind=kind)
            return
        if kind == "revolute" and not joint.limited[0]:
            kind = "continuous"

        # The file's poses are those at qpos0.
        back = -joint.qpos0[0] * joint.axis
        away = Pose(back)
        if kind != "prismatic":
            away = Pose.from_rotation(np.zeros(3), Rotation.from_rotvec(back))

        lower, upper = joint.range.tolist()
        self.joints[name] = replace(
            fixed,
            name=called,
            kind=kind,
            origin=Origin.from_pose(place @ away, DIGITS),
            axis=tuple(joint.axis.tolist()),
            limits=Limits(lower, upper, self._find_effort(joint.id), SPEED),
        )

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
        for geom in self._geoms.of_bodies(np.arange(self._model.nbody) == body.id):
            if geom.collides:
                collisions += self._shapes(geom, frame)
            elif geom.drawn:
                visuals += self._shapes(geom, frame)

        weight = _weigh(body, frame, share)
        self.links[name] = RobotLink(name, weight, tuple(collisions), tuple(visuals))

    def _shapes(self, geom: MjcfGeom, frame: Pose) -> list[RobotShape]:
        """Make the shapes of a geom; ``frame`` is the body's in the link."""
        there = self._model.geom(geom.number)
        if geom.shape is None:
            owner = self._model.body(there.bodyid[0]).name
            self._notes.append(f"left out: geom {geom.kind} of {owner!r}")
            return []

        place = frame @ _pose(there.pos, there.quat)
        shapes = list[RobotShape]()
        if isinstance(geom.shape, Mesh):
            solid = trimesh.Trimesh(
                geom.shape.vertices, geom.shape.faces, process=False
            )
            content = bytes(solid.export(file_type="stl"))
            file = keep_file("mjcf", "stl", content, lambda: content)
            shapes = [RobotShape(file, Origin.from_pose(place, DIGITS))]
        else:
            shapes = urdf_shapes(geom.shape, place)

        red, green, blue, opacity = geom.color
        color = (red, green, blue, opacity or 1.0)  # what collides is often hidden
        return [replace(shape, color=color) for shape in shapes]


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
