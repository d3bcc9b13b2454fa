"""Place bodies that joints connect: each tree of them is one of PyBullet's multibodies."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from core.robot.writing import write
from core.scene import Body, Joint, Scene
from core.values.descriptions import (
    Description,
    Limits,
    Origin,
    RobotJoint,
    RobotLink,
    rounded,
)
from plugins.simulators.forces import latch_force
from plugins.simulators.inertia import Inertia, inertia_of
from plugins.simulators.pybullet.bodies import (
    DIGITS,
    collisions_of,
    dynamics_of,
    inertial,
    offset_of,
    text_file,
)
from plugins.simulators.pybullet.engine import Client
from plugins.simulators.steps import MILD

Place = tuple[int, int]
"""Of a body: PyBullet's numbers of its multibody and of its link, -1 the base."""
_KINDS = {"hinge": "revolute", "slider": "prismatic", "ball": "spherical"}
_ROOT = "root"


@dataclass(frozen=True, eq=False)
class Lightness:
    """What forces of 1 at the joints of a tree accelerate, as it starts.

    ``matrix`` (K, K) is the inverse of the inertia, 1/kg or 1/(kg m^2). ``axes`` has the rows of each joint by name:
    one, and a ball's three, about its body's axes.
    """

    matrix: Array
    axes: dict[str, list[int]]

    @classmethod
    def of(
        cls,
        bodies: Mapping[str, Body],
        joints: Sequence[Joint],
        inertias: Mapping[str, Inertia],
    ) -> Lightness:
        """Compute it for ``bodies`` and their ``inertias``, with a parent's own joint before those on it."""
        twists = list[Array]()
        above = {name: list[int]() for name in bodies}

        for name in bodies.keys() - {joint.body for joint in joints}:  # a free root
            above[name] = list(range(6))
            twists += [*np.eye(6)]

        first = len(twists)
        axes = dict[str, list[int]]()
        for joint in joints:
            moved_by = _twists(joint, bodies[joint.body].pose)
            rows = list(range(len(twists), len(twists) + len(moved_by)))
            above[joint.body] = [*above.get(joint.parent or "", []), *rows]
            axes[joint.name] = [row - first for row in rows]
            twists += moved_by

        masses = np.zeros((len(twists), len(twists)))
        for name, body in bodies.items():
            frame = body.pose @ inertias[name].frame
            moving = np.array([twists[row] for row in above[name]])
            moved = moving[:, 3:] + np.cross(moving[:, :3], frame.position)
            turned = moving[:, :3] @ frame.rotation.as_matrix()
            linear = body.mass * moved @ moved.T
            angular = turned * inertias[name].moments @ turned.T
            masses[np.ix_(above[name], above[name])] += linear + angular

        inverse = np.asarray(np.linalg.inv(masses), dtype=np.float64)
        return cls(inverse[first:, first:], axes)

    def most(self, joint: Joint) -> float:
        """The most that a force of 1 at a joint accelerates."""
        rows = self.axes[joint.name]
        return float(np.linalg.eigvalsh(self.matrix[np.ix_(rows, rows)])[-1])

    def rate(self, joint: Joint) -> float:
        """The highest rate, 1/s, at which its spring and latches swing a joint, or its damper stops it."""
        latches = [math.pi * latch.force / latch.width for latch in joint.latches]
        stiffness = joint.stiffness + max(latches, default=0.0)
        most = self.most(joint)
        return max(math.sqrt(stiffness * most), joint.damping * most / MILD)


def _twists(joint: Joint, pose: Pose) -> list[Array]:
    """The directions in which a joint moves its body: angular velocities, and velocities at the world's origin."""
    if joint.kind == "slider":
        return [np.concatenate([np.zeros(3), pose.rotation.apply(joint.axis)])]
    own_axes = [joint.axis] if joint.kind == "hinge" else np.eye(3)
    axes = pose.rotation.apply(own_axes)
    origin = pose.apply(joint.origin)
    return [np.concatenate([axis, np.cross(origin, axis)]) for axis in axes]


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
    def of(
        cls, scene: Scene, root: Body | None, joints: Sequence[Joint], folder: Path
    ) -> PreparedTree:
        """Prepare a tree, parents first; its files are written to ``folder``."""
        bodies = [scene[joint.body] for joint in joints]
        frames = {joint.body: _frame(scene[joint.body], joint) for joint in joints}
        # Names of bodies may be anything.
        links = {joint.body: str(number) for number, joint in enumerate(joints)}
        frame = frames[joints[0].body] if root is None else root.pose

        if root is not None:
            bodies.append(root)
            frames[root.name] = root.pose
            links[root.name] = _ROOT

        inertias = {body.name: inertia_of(body) for body in bodies}
        tree_links = {_ROOT: RobotLink(_ROOT)} if root is None else {}

        for body in bodies:
            name = links[body.name]
            inertia = inertias[body.name]
            place = frames[body.name].inverse() @ body.pose  # of the body in the link
            moved = replace(inertia, frame=place @ inertia.frame)
            shapes = collisions_of(body, folder, place)
            tree_links[name] = RobotLink(name, inertial(moved), shapes)

        hung = dict[str, RobotJoint]()
        for joint in joints:
            above = _ROOT
            parent_frame = frame

            if joint.parent in frames:
                above = links[joint.parent]
                parent_frame = frames[joint.parent]

            pose = parent_frame.inverse() @ frames[joint.body]
            name = links[joint.body]
            hung[name] = _joint(joint, name, above, pose)

        file = text_file(folder, write(Description("tree", tree_links, hung)), "urdf")
        dynamics = {body.name: dynamics_of(body) for body in bodies}
        offsets = {name: offset_of(inertia) for name, inertia in inertias.items()}
        lightness = Lightness.of({body.name: body for body in bodies}, joints, inertias)
        return cls(
            file=file,
            root=root,
            frame=frame,
            joints=tuple(joints),
            dynamics=dynamics,
            offsets=offsets,
            lightness=lightness,
            joined=scene.joined,
        )

    @property
    def rate(self) -> float:
        """The highest rate, 1/s, at which springs and latches swing a joint, or dampers stop it."""
        return max(map(self.lightness.rate, self.joints))

    def place(self, client: Client, fixed: dict[str, Place]) -> dict[str, Place]:
        """Place the tree in a world of ``fixed`` bodies, without motors; return where its bodies are."""
        flags = (
            client.URDF_USE_INERTIA_FROM_FILE
            | client.URDF_USE_IMPLICIT_CYLINDER
            | client.URDF_USE_SELF_COLLISION
        )
        number = int(
            client.loadURDF(
                str(self.file),
                self.frame.position.tolist(),
                list(self.frame.rotation.as_quat()),
                useFixedBase=self.root is None,
                flags=flags,
            )
        )
        infos = [client.getJointInfo(number, link) for link in range(len(self.joints))]
        links = {info[12].decode(): info[0] for info in infos}
        places = {}
        for i, joint in enumerate(self.joints):
            places[joint.body] = (number, links[str(i)])
        if self.root is not None:
            places[self.root.name] = (number, -1)
        client.changeDynamics(number, -1, linearDamping=0, angularDamping=0)
        for body, dynamics in self.dynamics.items():
            client.changeDynamics(*places[body], **dynamics)
        for first, second in combinations(places, 2):
            touch = int(frozenset((first, second)) not in self.joined)
            client.setCollisionFilterPair(
                number, number, places[first][1], places[second][1], touch
            )

        for joint in self.joints:
            if joint.parent in fixed:
                parent, link = fixed[joint.parent]
                client.setCollisionFilterPair(
                    number, parent, places[joint.body][1], link, 0
                )

        return places


def prepare_trees(scene: Scene, folder: Path) -> list[PreparedTree]:
    """Prepare all trees of a scene."""
    roots: dict[str, str] = {}
    trees: dict[str, list[Joint]] = {}
    for placed in scene.ordered_joints:
        joint = placed.joint
        loose = joint.parent is not None and not scene[joint.parent].fixed
        roots[joint.body] = joint.body
        if loose and joint.parent:
            roots[joint.body] = roots.get(joint.parent, joint.parent)
        trees.setdefault(roots[joint.body], []).append(joint)

    return [
        PreparedTree.of(scene, None if name in roots else scene[name], joints, folder)
        for name, joints in trees.items()
    ]


def _frame(body: Body, joint: Joint) -> Pose:
    """The frame of a link: at the joint, and along the body's."""
    return Pose(body.pose.apply(joint.origin), body.pose.quaternion)


def _joint(joint: Joint, link: str, parent: str, pose: Pose) -> RobotJoint:
    """Make the joint that bears ``link`` at a pose in its parent."""
    kind = _KINDS[joint.kind]
    lower = 1.0  # above the upper one: none
    upper = -1.0

    if joint.limited:
        lower = joint.lower - joint.start
        upper = joint.upper - joint.start
    elif joint.kind == "hinge":
        kind = "continuous"

    limits = Limits(rounded(lower, DIGITS), rounded(upper, DIGITS), 0.0, 1000.0)
    x, y, z = (rounded(value, DIGITS) for value in joint.axis)
    origin = Origin.from_pose(pose, DIGITS)
    return RobotJoint(f"{link}_joint", kind, parent, link, origin, (x, y, z), limits)


class Mechanism:
    """The joints of a tree in a world: friction, springs, latches, dampers and drives."""

    def __init__(
        self,
        client: Client,
        tree: PreparedTree,
        places: dict[str, Place],
        gain: float,
        time_step: float,
    ) -> None:
        """``places`` are those of bodies; ``gain`` is the share of its error that a drive makes up in a step."""
        self._client = client
        self._gain = gain
        self._time_step = time_step
        self._steps: int | None = None  # since the launch
        joints = [(places[joint.body], joint) for joint in tree.joints]
        for place, joint in joints:
            self._resist(place, joint)
            client.changeDynamics(*place, jointDamping=joint.damping)

        self._driven = [placed for placed in joints if placed[1].drive]
        self._pulled = [
            placed for placed in joints if placed[1].stiffness or placed[1].latches
        ]

    def _resist(self, place: Place, joint: Joint) -> None:
        """Set a motor at rest, which is dry friction; PyBullet's own would hold the joint."""
        client = self._client
        most = joint.friction

        if joint.kind == "ball":
            client.setJointMotorControlMultiDof(
                *place,
                client.POSITION_CONTROL,
                targetPosition=[0, 0, 0, 1],
                targetVelocity=[0, 0, 0],
                positionGain=0,
                velocityGain=1,
                force=[most] * 3,
            )
        else:
            client.setJointMotorControl2(
                *place, client.VELOCITY_CONTROL, targetVelocity=0, force=most
            )

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
        client = self._client

        if joint.kind == "ball":
            quaternion = client.getJointStateMultiDof(*place)[0]
            torques = -joint.stiffness * Rotation.from_quat(quaternion).as_rotvec()
            client.setJointMotorControlMultiDof(
                *place, client.TORQUE_CONTROL, force=torques.tolist()
            )
        else:
            position = joint.start + client.getJointState(*place)[0]
            spring = joint.stiffness * (joint.rest - position)
            force = spring + latch_force(joint, position)
            client.setJointMotorControl2(*place, client.TORQUE_CONTROL, force=force)

    def _aim(self, place: Place, joint: Joint) -> None:
        """Drive a joint to where its schedule is at the end of the step."""
        assert joint.drive is not None
        begins = 0.0
        ends = 0.0
        if self._steps is not None:
            begins = self._steps * self._time_step
            ends = begins + self._time_step

        before, after = joint.drive.sample(np.array([begins, ends])).tolist()
        away = after - before
        target = after - joint.start
        wheel = joint.kind == "hinge" and not joint.limited
        if wheel:  # its schedule begins again a turn behind
            away -= 2 * np.pi * round(away / (2 * np.pi))
            value = self._client.getJointState(*place)[0]
            target += 2 * np.pi * round((value - target) / (2 * np.pi))

        self._client.setJointMotorControl2(
            *place,
            self._client.POSITION_CONTROL,
            targetPosition=target,
            targetVelocity=away / self._time_step,
            force=joint.drive.force,
            positionGain=self._gain,
            velocityGain=1.0,
        )
