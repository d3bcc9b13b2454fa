"""Place bodies that joints connect: each tree of them is one of PyBullet's multibodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from core.geometry import Pose
from core.robot.description import write
from core.scene import Body, Inertia, Joint, Scene
from core.values.descriptions import Description, Limits, Origin, RobotJoint, RobotLink, rounded
from plugins.simulators.pybullet.bodies import DIGITS, collisions_of, dynamics_of, inertial, offset_of, text_file
from plugins.simulators.pybullet.engine import pybullet as p
from plugins.simulators.pybullet.stiffness import Lightness

Place = tuple[int, int]  # of a body: PyBullet's numbers of its multibody and of its link, -1 the base
_KINDS = {"hinge": "revolute", "slider": "prismatic", "ball": "spherical"}
_ROOT = "root"


@dataclass(frozen=True, eq=False)
class PreparedTree:
    """A tree of bodies, ready to be placed in one world after another.

    Its root is a free body that hangs from nothing, or the world. Fixed bodies are no part of it, so what hangs from
    them is a tree each. Joints are at 0 in PyBullet where they start.
    """

    file: Path
    root: Body | None  # None: the world
    frame: Pose
    joints: tuple[Joint, ...]
    dynamics: dict[str, dict[str, float]]  # by body
    offsets: dict[str, Pose | None]  # by body, as `PreparedBody.offset`
    lightness: Lightness
    joined: frozenset[frozenset[str]]

    @classmethod
    def of(cls, scene: Scene, root: Body | None, joints: Sequence[Joint], folder: Path) -> PreparedTree:
        """Prepare a tree, parents first; its files are written to ``folder``."""
        bodies = [scene[joint.body] for joint in joints]
        frames = {joint.body: _frame(scene[joint.body], joint) for joint in joints}
        links = {joint.body: str(number) for number, joint in enumerate(joints)}  # names of bodies may be anything
        frame = frames[joints[0].body] if root is None else root.pose
        if root is not None:
            bodies.append(root)
            frames[root.name], links[root.name] = root.pose, _ROOT
        inertias = {body.name: body.inertia() for body in bodies}
        made = {_ROOT: RobotLink(_ROOT)} if root is None else {}
        for body in bodies:
            name, inertia = links[body.name], inertias[body.name]
            place = frames[body.name].inverse() @ body.pose  # of the body in the link
            own = inertial(Inertia(inertia.mass, place @ inertia.frame, inertia.moments))
            made[name] = RobotLink(name, own, collisions_of(body, folder, place))
        hung = dict[str, RobotJoint]()
        for joint in joints:
            above = joint.parent if joint.parent in frames else None
            pose = (frame if above is None else frames[above]).inverse() @ frames[joint.body]
            name = links[joint.body]
            hung[name] = _joint(joint, name, _ROOT if above is None else links[above], pose)
        file = text_file(folder, write(Description("tree", made, hung)), "urdf")
        dynamics = {body.name: dynamics_of(body) for body in bodies}
        offsets = {name: offset_of(inertia) for name, inertia in inertias.items()}
        lightness = Lightness.of({body.name: body for body in bodies}, joints, inertias)
        return cls(file, root, frame, tuple(joints), dynamics, offsets, lightness, scene.joined)

    @property
    def rate(self) -> float:
        """The highest rate, 1/s, at which springs and latches swing a joint, or dampers stop it."""
        return max(map(self.lightness.rate, self.joints))

    def place(self, client: int, fixed: dict[str, Place]) -> dict[str, Place]:
        """Place the tree in a world of ``fixed`` bodies, without motors; return where its bodies are."""
        flags = p.URDF_USE_INERTIA_FROM_FILE | p.URDF_USE_IMPLICIT_CYLINDER | p.URDF_USE_SELF_COLLISION
        number = p.loadURDF(
            str(self.file),
            basePosition=self.frame.position.tolist(),
            baseOrientation=list(self.frame.rotation.as_quat()),
            useFixedBase=self.root is None,
            flags=flags,
            physicsClientId=client,
        )
        infos = [p.getJointInfo(number, link, physicsClientId=client) for link in range(len(self.joints))]
        links = {info[12].decode(): info[0] for info in infos}
        places = {joint.body: (int(number), links[str(i)]) for i, joint in enumerate(self.joints)}
        if self.root is not None:
            places[self.root.name] = int(number), -1
        p.changeDynamics(number, -1, linearDamping=0, angularDamping=0, physicsClientId=client)
        for body, dynamics in self.dynamics.items():
            p.changeDynamics(*places[body], **dynamics, physicsClientId=client)
        for one, other in combinations(places, 2):
            self._filter(client, places[one], places[other], frozenset((one, other)) not in self.joined)
        for joint in self.joints:
            if joint.parent in fixed:
                self._filter(client, places[joint.body], fixed[joint.parent], False)
        return places

    @staticmethod
    def _filter(client: int, one: Place, other: Place, touch: bool) -> None:
        (body, link), (body_b, link_b) = one, other
        p.setCollisionFilterPair(body, body_b, link, link_b, int(touch), physicsClientId=client)


def prepare_trees(scene: Scene, folder: Path) -> list[PreparedTree]:
    """Prepare all trees of a scene."""
    roots: dict[str, str] = {}
    trees: dict[str, list[Joint]] = {}
    for placed in scene.ordered_joints:
        joint = placed.joint
        loose = joint.parent is not None and not scene[joint.parent].fixed
        roots[joint.body] = roots.get(joint.parent, joint.parent) if loose and joint.parent else joint.body
        trees.setdefault(roots[joint.body], []).append(joint)
    return [
        PreparedTree.of(scene, None if name in roots else scene[name], joints, folder) for name, joints in trees.items()
    ]


def _frame(body: Body, joint: Joint) -> Pose:
    """The frame of a link: at the joint, and along the body's."""
    return Pose(body.pose.apply(joint.origin), body.pose.quaternion)


def _joint(joint: Joint, link: str, parent: str, pose: Pose) -> RobotJoint:
    """Make the joint that bears ``link`` at a pose in its parent."""
    kind = "continuous" if joint.kind == "hinge" and not joint.limited else _KINDS[joint.kind]
    lower, upper = (joint.lower - joint.start, joint.upper - joint.start) if joint.limited else (1.0, -1.0)  # none
    low, high, x, y, z = (rounded(value, DIGITS) for value in (lower, upper, *joint.axis))
    limits, origin = Limits(low, high, 0.0, 1000.0), Origin.of(pose, DIGITS)
    return RobotJoint(f"{link}_joint", kind, parent, link, origin, (x, y, z), limits)


class Mechanism:
    """The joints of a tree in a world: friction, springs, latches, dampers and drives."""

    def __init__(
        self, client: int, tree: PreparedTree, places: dict[str, Place], gain: float, time_step: float
    ) -> None:
        """``places`` are those of bodies; ``gain`` is the share of its error that a drive makes up in a step."""
        self._client, self._gain, self._time_step = client, gain, time_step
        self._steps: int | None = None  # since the launch
        joints = [(places[joint.body], joint) for joint in tree.joints]
        for place, joint in joints:
            self._resist(place, joint)
            p.changeDynamics(*place, jointDamping=joint.damping, physicsClientId=client)
        self._driven = [(place, joint) for place, joint in joints if joint.drive]
        self._pulled = [(place, joint) for place, joint in joints if joint.stiffness or joint.latches]

    def _resist(self, place: Place, joint: Joint) -> None:
        """Set a motor at rest, which is dry friction; PyBullet's own would hold the joint."""
        most = joint.friction
        if joint.kind == "ball":
            p.setJointMotorControlMultiDof(
                *place,
                p.POSITION_CONTROL,
                targetPosition=[0, 0, 0, 1],
                targetVelocity=[0, 0, 0],
                positionGain=0,
                velocityGain=1,
                force=[most] * 3,
                physicsClientId=self._client,
            )
            return
        p.setJointMotorControl2(*place, p.VELOCITY_CONTROL, targetVelocity=0, force=most, physicsClientId=self._client)

    def launch(self) -> None:
        """Begin the time of drives."""
        self._steps = 0

    def drive(self) -> None:
        """Set motors and torques for the next step."""
        for place, joint in self._driven:
            self._aim(place, joint)
        if self._driven and self._steps is not None:
            self._steps += 1
        for place, joint in self._pulled:
            self._pull(place, joint)

    def _pull(self, place: Place, joint: Joint) -> None:
        """Add what its spring and latches pull a joint with to the forces of the next step."""
        if joint.kind == "ball":
            quaternion = p.getJointStateMultiDof(*place, physicsClientId=self._client)[0]
            torques = -joint.stiffness * Rotation.from_quat(quaternion).as_rotvec()
            p.setJointMotorControlMultiDof(
                *place, p.TORQUE_CONTROL, force=torques.tolist(), physicsClientId=self._client
            )
            return
        position = np.array([joint.start + p.getJointState(*place, physicsClientId=self._client)[0]])
        force = joint.stiffness * (joint.rest - position) + joint.latch_force(position)
        p.setJointMotorControl2(*place, p.TORQUE_CONTROL, force=float(force[0]), physicsClientId=self._client)

    def _aim(self, place: Place, joint: Joint) -> None:
        """Drive a joint to where its schedule is at the end of the step."""
        assert joint.drive is not None
        begins = 0.0 if self._steps is None else self._steps * self._time_step
        ends = begins if self._steps is None else begins + self._time_step
        before, after = joint.drive.sample(np.array([begins, ends])).tolist()
        away = after - before
        target = after - joint.start
        if joint.kind == "hinge" and not joint.limited:  # the schedule of a wheel begins again a turn behind
            away -= 2 * np.pi * round(away / (2 * np.pi))
            value = p.getJointState(*place, physicsClientId=self._client)[0]
            target += 2 * np.pi * round((value - target) / (2 * np.pi))
        p.setJointMotorControl2(
            *place,
            p.POSITION_CONTROL,
            targetPosition=target,
            targetVelocity=away / self._time_step,
            force=joint.drive.force,
            positionGain=self._gain,
            velocityGain=1.0,
            physicsClientId=self._client,
        )
