"""Place bodies: each tree of those that joints connect is one of PyBullet's multibodies."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pinocchio as pin

from core.geometry import Pose
from core.robot.writing import write
from core.scene import Body, Joint, Scene
from core.values.descriptions import (
    Description,
    Limits,
    Origin,
    RobotJoint,
    RobotLink,
    rounded,
    rounded_all,
)
from plugins.simulators.inertia import Inertia, inertia_of
from plugins.simulators.pybullet.engine import Client
from plugins.simulators.pybullet.mechanisms import Place
from plugins.simulators.pybullet.robot import joint_numbers
from plugins.simulators.pybullet.urdf_links import (
    DIGITS,
    collisions_of,
    dynamics_of,
    inertial,
    text_file,
)
from plugins.simulators.step_lengths import MILD

_KINDS = {
    "hinge": "revolute",
    "slider": "prismatic",
    "ball": "spherical",
}
_MODELS = {
    "hinge": pin.JointModelRevoluteUnaligned,
    "slider": pin.JointModelPrismaticUnaligned,
}
_ROOT = "root"


@dataclass(frozen=True, eq=False)
class PreparedTree:
    """Bodies that joints connect, or a single one, ready to be placed in one world after another.

    The root is a body that hangs from nothing, or the world. Fixed bodies are trees of their own, so what hangs from
    them is one each. Joints are at 0 in PyBullet where they start. Inertias and files, slow to make, are made once.

    Attributes:
        file: its URDF, whose links are numbers: names of bodies may be anything.
        root: the body; None: the world.
        frame: where its first link is in the world.
        joints: parents first.
        dynamics: PyBullet's settings of each body.
        offsets: each body's frame in PyBullet's, that of its centre of mass.
        rate: the highest, 1/s, at which springs and latches swing a joint, or dampers stop it.
        joined: pairs of bodies that don't touch.
    """

    file: Path
    root: Body | None
    frame: Pose
    joints: tuple[Joint, ...]
    dynamics: dict[str, dict[str, float]]
    offsets: dict[str, Pose]
    rate: float
    joined: frozenset[frozenset[str]]

    @classmethod
    def of(
        cls, scene: Scene, root: Body | None, joints: Sequence[Joint], folder: Path
    ) -> PreparedTree:
        """Prepare a tree.

        Args:
            scene: has its bodies.
            root: see the class.
            joints: parents first.
            folder: its files are written there.
        """
        bodies = [scene[joint.body] for joint in joints]
        frames = {joint.body: _frame(scene[joint.body], joint) for joint in joints}
        links = {joint.body: str(number) for number, joint in enumerate(joints)}
        described = {}

        if root is None:
            frame = frames[joints[0].body]
            described[_ROOT] = RobotLink(_ROOT)
        else:
            frame = root.pose
            bodies.append(root)
            frames[root.name] = frame
            links[root.name] = _ROOT

        offsets = {}
        weights = {}
        for body in bodies:
            name = links[body.name]
            place = Pose()  # of the body in the link
            if joints:
                place = frames[body.name].inverse() @ body.pose

            weight = None
            if not body.fixed:
                inertia = inertia_of(body)
                weight = replace(inertia, frame=place @ inertia.frame)
                weights[body.name] = weight
                offsets[body.name] = inertia.frame.inverse()

            shapes = collisions_of(body, folder, place)
            described[name] = RobotLink(name, inertial(weight), shapes)

        hung = {}
        for joint in joints:
            parent = frames.get(joint.parent or "", frame)
            above = links.get(joint.parent or "", _ROOT)
            pose = parent.inverse() @ frames[joint.body]
            name = links[joint.body]
            hung[name] = _describe_joint(
                joint,
                name,
                above,
                pose,
            )

        return cls(
            file=text_file(folder, write(Description("tree", described, hung)), "urdf"),
            root=root,
            frame=frame,
            joints=tuple(joints),
            dynamics={body.name: dynamics_of(body, bool(joints)) for body in bodies},
            offsets=offsets,
            rate=_find_rate(joints, frames, weights),
            joined=scene.joined,
        )

    def place(self, client: Client, others: dict[str, Place]) -> dict[str, Place]:
        """Place the tree in a world, without motors.

        Args:
            client: the world.
            others: where the bodies of other trees are.

        Returns:
            where the tree's bodies are.
        """
        flags = client.URDF_USE_INERTIA_FROM_FILE | client.URDF_USE_IMPLICIT_CYLINDER
        if self.joints:
            flags |= client.URDF_USE_SELF_COLLISION

        number = client.loadURDF(
            str(self.file),
            self.frame.position.tolist(),
            list(self.frame.rotation.as_quat()),
            useFixedBase=self.root is None or self.root.fixed,
            flags=flags,
        )
        places = self._find_places(client, number)
        for body, dynamics in self.dynamics.items():
            client.changeDynamics(*places[body], **dynamics)

        for first, second in combinations(places, 2):
            touch = int(frozenset((first, second)) not in self.joined)
            _set_touching(
                client,
                places[first],
                places[second],
                touch,
            )

        for joint in self.joints:
            if joint.parent in others:
                _set_touching(
                    client,
                    places[joint.body],
                    others[joint.parent],
                    0,
                )

        return places

    def _find_places(self, client: Client, number: int) -> dict[str, Place]:
        """Find the bodies in the multibody of this number."""
        _, links = joint_numbers(client, number)
        places = {}
        for i, joint in enumerate(self.joints):
            places[joint.body] = (number, links[str(i)])

        if self.root is not None:
            places[self.root.name] = (number, -1)

        return places


def _set_touching(client: Client, first: Place, second: Place, touch: int) -> None:
    """Let two bodies touch, 1, or not, 0; each is a multibody and a link."""
    client.setCollisionFilterPair(
        first[0],
        second[0],
        first[1],
        second[1],
        touch,
    )


def prepare_trees(scene: Scene, folder: Path) -> list[PreparedTree]:
    """Prepare all bodies of a scene, those without joints first; files are written to ``folder``."""
    roots: dict[str, str] = {}
    trees: dict[str, list[Joint]] = {}
    for placed in scene.ordered_joints:
        joint = placed.joint
        root = joint.body
        if joint.parent is not None and not scene[joint.parent].fixed:
            root = roots.get(joint.parent, joint.parent)

        roots[joint.body] = root
        trees.setdefault(root, []).append(joint)

    jointed = {*roots, *trees}
    single: dict[str, list[Joint]] = {
        body.name: []
        for body in scene.bodies
        if body.collisions and body.name not in jointed
    }
    prepared = []
    for name, joints in (single | trees).items():
        root_body = None if name in roots else scene[name]
        prepared.append(PreparedTree.of(scene, root_body, joints, folder))

    return prepared


def _frame(body: Body, joint: Joint) -> Pose:
    """Return the frame of a link: at the joint, and along the body's."""
    return Pose(body.pose.apply(joint.origin), body.pose.quaternion)


def _describe_joint(joint: Joint, link: str, parent: str, pose: Pose) -> RobotJoint:
    """Describe a joint for a URDF file, at 0 where the scene has it.

    Args:
        joint: what it can do.
        link: the name of the link that it bears.
        parent: the name of the link that bears it.
        pose: of ``link`` in ``parent``.
    """
    kind = _KINDS[joint.kind]
    lower = 1.0  # above the upper one: none
    upper = -1.0

    if joint.limited:
        lower = joint.lower - joint.start
        upper = joint.upper - joint.start
    elif joint.kind == "hinge":
        kind = "continuous"

    limits = Limits(
        rounded(lower, DIGITS),
        rounded(upper, DIGITS),
        0.0,
        1000.0,
    )
    origin = Origin.from_pose(pose, DIGITS)
    return RobotJoint(
        f"{link}_joint",
        kind,
        parent,
        link,
        origin,
        rounded_all(joint.axis),
        limits,
    )


def _find_rate(
    joints: Sequence[Joint],
    frames: Mapping[str, Pose],
    weights: Mapping[str, Inertia],
) -> float:
    """Return the highest rate of a tree, see `PreparedTree.rate`: by what forces of 1 accelerate as it starts.

    Args:
        joints: parents first.
        frames: of the links in the world, by body.
        weights: the inertias of the links in their frames, by body.
    """
    if not joints:
        return 0.0

    model = pin.Model()
    numbers: dict[str | None, int] = {}

    children = {joint.body for joint in joints}
    for name in (name for name in frames if name not in children):  # a free root
        pose = pin.SE3(frames[name].matrix)
        numbers[name] = model.addJoint(
            0,
            pin.JointModelFreeFlyer(),
            pose,
            name,
        )

    for joint in joints:
        moving = pin.JointModelSpherical()
        if joint.kind != "ball":
            moving = _MODELS[joint.kind](np.array(joint.axis))

        parent = frames.get(joint.parent or "", Pose())
        place = pin.SE3((parent.inverse() @ frames[joint.body]).matrix)
        above = numbers.get(joint.parent, 0)
        numbers[joint.body] = model.addJoint(
            above,
            moving,
            place,
            joint.name,
        )

    for name, weight in weights.items():
        moments = pin.Inertia(weight.mass, np.zeros(3), np.diag(weight.moments))
        place = pin.SE3(weight.frame.matrix)
        model.appendBodyToJoint(numbers[name], moments, place)

    inverse = pin.computeMinverse(model, model.createData(), pin.neutral(model))
    rates = []
    for joint in joints:
        moved = model.joints[numbers[joint.body]]
        rows = slice(moved.idx_v, moved.idx_v + moved.nv)
        lightness = float(np.linalg.eigvalsh(inverse[rows, rows])[-1])
        latches = [math.pi * latch.force / latch.width for latch in joint.latches]
        stiffness = joint.stiffness + max(latches, default=0.0)
        rates += [math.sqrt(stiffness * lightness), joint.damping * lightness / MILD]

    return max(rates)
