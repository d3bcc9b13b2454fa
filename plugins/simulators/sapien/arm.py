"""Put the arm with its tool into a PhysX scene: an articulation with a drive in each joint."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from core.design import Tool, ToolJoint
from core.geometry import Array
from core.interfaces import JointTrajectory, Order, Robot
from core.robot.description import joint_name
from plugins.simulators.forces import thing_of
from plugins.simulators.links import bearers, friction_of, split_joints
from plugins.simulators.sapien.bodies import weigh
from plugins.simulators.sapien.engine import physx
from plugins.simulators.sapien.robot import (
    ArticulationLink,
    AxisJoint,
    robot_links,
)
from plugins.simulators.sapien.shapes import Setup, attach, to_sapien
from plugins.simulators.sapien.surfaces import Apart, Surface

# A drive is a spring and a damper. The spring reaches the joint's full force at this distance from the target, in
# radians or metres; the damper makes the error shrink at the tracking rate.
_GIVES_WAY = 0.001
# The fingers are light, 15 g each, and with such a force the solver would let them penetrate what they hold. But their
# drive has a mass too: this much each, in kg.
_FINGER_DRIVE = 0.1
# One motor moves both fingers: a spring (N/m) and a damper (N s/m) between them keep them as far from the middle.
_COUPLING = {"stiffness": 1e6, "damping": 1e3}

# A light body squeezed between two heavier fingers at full force needs so many times the solver's iterations; with
# fewer, they sink into it and it shoots out.
_GRIP = 4
_HELD = 1e6  # of the spring and the damper that hold a joint of the tool
_STICKS = 1e3  # N m s/rad or N s/m, of dry friction up to its limit


TorqueNote = tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]
"""What joints pass on to their links (L, 6), and the joints' accelerations (N,)."""


def surfaces_of(robot: Robot, tool: Tool) -> set[Surface]:
    """Return the surfaces of the arm's links and of the tool."""
    found = set()
    for link in robot_links(robot, tool):
        for shape in link.collisions:
            found.add(Surface(friction_of(robot, tool, shape.part)))

    return found


class ArticulatedArm:
    """The arm with a tool, its joints at a trajectory's first targets, and the tool's held.

    Args:
        setup: of the world.
        robot: the arm.
        tool: what it holds.
        start: a motion that begins there.
    """

    def __init__(
        self, setup: Setup, robot: Robot, tool: Tool, start: JointTrajectory
    ) -> None:
        self._arm = len(robot.arm_joints)
        self._robot = robot
        self._tool = tool
        components = _Builder(setup, robot, tool).build()
        # The target speed is added to the spring's target instead of the damper's: half as many calls. And in each of
        # the solver's n iterations a joint is driven as if that were the end of the step, and its speed is added: on
        # average (n - 1) / 2n of a step too far.
        self._articulation = components[0].articulation
        iterations = self._articulation.solver_position_iterations
        too_far = setup.time_step * (iterations - 1) / (2 * iterations)
        self._ahead = 1 / setup.tracking_rate - too_far

        active = self._articulation.active_joints
        numbers = {joint.name: number for number, joint in enumerate(active)}
        self._numbers = [numbers[name] for name in robot.joints(tool.gripper)]
        self._links = [
            active[number].child_link.index for number in self._numbers[: self._arm]
        ]
        self._inertia = np.array(robot.motor_inertia)
        # Of what a joint passes on, the force along its axis comes first, the torque about it fourth.
        self._along = np.where(robot.slides, 0, 3)
        setters = [active[number].set_drive_target for number in self._numbers]
        self._arm_setters = setters[: self._arm]
        self._finger_setters = setters[self._arm :]
        self._order: Order | None = None  # the last one
        self._closed = math.nan  # the last target of the fingers' drives

        self._loose = [numbers[joint_name(bearer.name)] for bearer in tool.bearers]
        self._hung = [bearer.joint for bearer in tool.bearers]
        self._pulled: list[tuple[int, ToolJoint]] = []  # once the motion begins
        self._forces = np.zeros(len(active), dtype=np.float32)

        positions = np.zeros(len(active))
        positions[self._numbers] = start.fingers[0]
        positions[self._numbers[: self._arm]] = start.arm[0]
        self._articulation.qpos = positions

    def launch(self) -> None:
        """Let the tool's joints go: the drive of each is its spring and damper.

        PhysX's own friction of a joint is a share of its load, which ours is not. So with dry friction the drive is
        that: a damper that gives up at a torque. Then the spring is applied in each step.
        """
        self._pulled = []
        active = self._articulation.active_joints

        for number, joint in zip(self._loose, self._hung, strict=True):
            drive = active[number]
            if joint.friction > 0:
                drive.set_drive_properties(
                    0.0,
                    _STICKS,
                    joint.friction,
                    "force",
                )
                self._pulled.append((number, joint))
                continue

            drive.set_drive_properties(
                joint.stiffness, joint.damping, math.inf, "force"
            )
            drive.set_drive_target(joint.rest)

    def drive(self, order: Order) -> None:
        """Set what drives the joints for the next step."""
        if self._pulled:
            self._pull()

        ahead = self._ahead
        if order == self._order:  # drives keep their targets, and one wakes the arm
            self._arm_setters[0](order.arm[0] + ahead * order.speeds[0])
            return

        self._order = order
        for set_target, target, speed in zip(
            self._arm_setters, order.arm, order.speeds, strict=True
        ):
            set_target(target + ahead * speed)

        closed = order.fingers + ahead * order.finger_speed
        if closed != self._closed:
            self._closed = closed
            for set_target in self._finger_setters:
                set_target(closed)

    def _pull(self) -> None:
        """Apply the springs and dampers of the tool's joints that have dry friction."""
        positions = self._articulation.qpos
        speeds = self._articulation.qvel
        for number, joint in self._pulled:
            spring = joint.stiffness * (joint.rest - positions[number])
            self._forces[number] = spring - joint.damping * speeds[number]

        self._articulation.qf = self._forces

    def note_torques(self) -> TorqueNote:
        """Take what each joint passes on to its link, and the joints' accelerations, in the last step."""
        articulation = self._articulation
        return articulation.link_incoming_joint_forces, articulation.qacc

    def read_torques(self, notes: Sequence[TorqueNote]) -> Array:
        """Compute what the arm's motors applied in S steps (S, J), N m or N. They move their own inertia as well."""
        forces, accelerations = zip(*notes, strict=True)
        count = len(notes)  # np.array(forces) would take ten times as long
        received = np.concatenate(forces).reshape(count, -1, 6)
        passed = received[:, self._links, self._along]
        turned = np.concatenate(accelerations).reshape(count, -1)
        driven = turned[:, self._numbers[: self._arm]]
        torques: Array = passed.astype(np.float64) + self._inertia * driven
        return torques

    def joints(self) -> tuple[Array, Array]:
        """Read the joint positions: arm (J,) and fingers with the tool's joints (F + K,)."""
        return self.read(self._articulation.qpos)

    def read(self, positions: Any) -> tuple[Array, Array]:
        """Decode the articulation's joints (..., N): arm (..., J) and fingers with the tool's joints (..., F + K)."""
        values = np.asarray(positions, dtype=np.float64)
        joints = values[..., [*self._numbers, *self._loose]]
        return split_joints(self._robot, self._tool, joints)


class _Builder:
    """Makes the articulation's links, with their shapes and with what drives or holds their joints.

    Args:
        setup: of the world.
        robot: the arm.
        tool: what it holds.
    """

    def __init__(self, setup: Setup, robot: Robot, tool: Tool) -> None:
        self._setup = setup
        self._robot = robot
        self._tool = tool
        self._loose = {bearer.name for bearer in tool.bearers}

    def build(self) -> list[Any]:
        """Add the links to the scene, and return PhysX's, the base first."""
        components: list[Any] = []
        fingers = []
        links = robot_links(self._robot, self._tool)
        for link in links:
            parent = None if link.parent is None else components[link.parent]
            component = physx.PhysxArticulationLinkComponent(parent)
            components.append(component)
            weigh(component, link.inertia)
            self._attach_shapes(component, link)
            self._set_joint(component.joint, link)
            if link.joint and link.joint.joint.name in self._robot.finger_joints:
                fingers.append(component)

        if self._tool.gripper:
            difference = [0.0, 1.0, -1.0]  # of the two joints, that is
            articulation = components[0].articulation
            articulation.create_fixed_tendon(
                [fingers[0].parent, *fingers], difference, difference, **_COUPLING
            )
            articulation.solver_position_iterations *= _GRIP

        for link, component in zip(links, components, strict=True):
            self._setup.add(link.name, component)

        return components

    def _attach_shapes(self, component: Any, link: ArticulationLink) -> None:
        """Attach the shapes of a link."""
        for shape in link.collisions:
            part = shape.part
            surface = Surface(friction_of(self._robot, self._tool, part))
            attach(
                self._setup,
                component,
                shape,
                thing_of(self._tool, part),
                surface,
                self._apart(part),
            )

    def _apart(self, part: str) -> Apart:
        """Say what a part of the description doesn't touch.

        The arm's links overlap by construction, and a tool overlaps the link that bears it.
        """
        tool = self._tool
        bits = 0 if part in tool.borne_on else 1
        near = bearers(self._robot, tool)
        for number, mount in enumerate(tool.mounts, start=1):
            if part == mount or part in near:
                bits |= 1 << number

        for number, bearer in enumerate(tool.bearers, start=len(tool.mounts) + 1):
            if part in (bearer.name, bearer.parent):
                bits |= 1 << number

        return Apart(bits=bits)

    def _set_joint(self, joint: Any, link: ArticulationLink) -> None:
        """Place a link's joint, and set its drive: a motor's, or one that holds a joint of the tool where it is."""
        about = link.joint
        if about is None:
            joint.type = "fixed"
            return

        joint.name = about.joint.name
        joint.type = about.joint.kind
        joint.pose_in_parent = to_sapien(about.in_parent)
        joint.pose_in_child = to_sapien(about.in_child)
        joint.limit = [list(about.joint.range)]
        joint.friction = 0.0  # PhysX's own is a share of the joint's load
        if link.name in self._loose:
            joint.set_drive_properties(
                _HELD,
                _HELD,
                math.inf,
                "force",
            )
        else:
            self._set_motor(joint, about)

    def _set_motor(self, joint: Any, about: AxisJoint) -> None:
        """Give a joint its motor: inertia, and a drive up to its force."""
        robot = self._robot
        name = about.joint.name
        if robot.gripper is not None and name in robot.gripper.joints:
            force = robot.gripper.force_n
            joint.armature = [_FINGER_DRIVE]
        else:
            force = about.joint.limits.effort or 0.0
            joint.armature = [robot.motor_inertia[robot.arm_joints.index(name)]]

        stiffness = force / _GIVES_WAY
        damping = stiffness / self._setup.tracking_rate
        joint.set_drive_properties(
            stiffness,
            damping,
            force,
            "force",
        )
