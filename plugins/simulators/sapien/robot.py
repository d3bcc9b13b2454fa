"""Put the arm with its tool into a PhysX scene: an articulation with a drive in each joint."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from core.design import Tool, ToolJoint
from core.geometry import Array
from core.interfaces import JointTrajectory
from core.robot.description import joint_name
from core.values.robots import Robot
from plugins.simulators.links import bearers, friction_of
from plugins.simulators.sapien.bodies import weigh
from plugins.simulators.sapien.description import (
    ArticulationLink,
    AxisJoint,
    PlacedShape,
    robot_links,
)
from plugins.simulators.sapien.engine import physx, sapien
from plugins.simulators.sapien.shapes import collision, hull, place, to_sapien
from plugins.simulators.sapien.surfaces import Surface, Surfaces

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


def surfaces_of(arm: Robot, tool: Tool) -> set[Surface]:
    """The surfaces of the arm's links and of the tool."""
    found = set()
    for link in robot_links(arm, tool):
        for shape in link.collisions:
            found.add(Surface(friction_of(arm, tool, shape.part)))
    return found


class ArticulatedArm:
    """The arm with ``tool``, its joints at the trajectory's first targets."""

    def __init__(
        self,
        scene: Any,
        surfaces: Surfaces,
        arm: Robot,
        tool: Tool,
        trajectory: JointTrajectory,
        folder: Path,
        tracking_rate: float,
        time_step: float,
    ) -> None:
        links = robot_links(arm, tool)
        joints = arm.joints(tool.gripper)
        self._arm = len(arm.arm_joints)
        self._fingers = len(arm.finger_joints)
        self._gripper = tool.gripper
        loose = {bearer.name: bearer.joint for bearer in tool.bearers}
        components = _components(links, arm, tool, surfaces, folder, tracking_rate)
        # The target speed is added to the spring's target instead of the damper's: half as many calls. And in each of
        # the solver's n iterations a joint is driven as if that were the end of the step, and its speed is added: on
        # average (n - 1) / 2n of a step too far.
        iterations = components[0].articulation.solver_position_iterations
        too_far = time_step * (iterations - 1) / (2 * iterations)
        self._ahead = 1 / tracking_rate - too_far

        for link, component in zip(links, components, strict=True):
            entity = sapien.Entity()
            entity.name = link.name
            entity.add_component(component)
            scene.add_entity(entity)

        self._articulation = components[0].articulation
        active_joints = self._articulation.active_joints
        active = {joint.name: number for number, joint in enumerate(active_joints)}
        self._numbers = [active[name] for name in joints]
        self._loose = [active[joint_name(name)] for name in loose]
        hung = zip(self._loose, loose.values(), strict=True)
        self._hung = [
            (number, active_joints[number], moving) for number, moving in hung
        ]
        driven = [active_joints[number] for number in self._numbers]
        self._setters = [joint.set_drive_target for joint in driven]
        self._orders = [math.nan] * len(joints)
        self._pull: list[tuple[int, ToolJoint]] = []  # once the motion begins
        self._forces = np.zeros(len(active), dtype=np.float32)
        start = np.zeros(len(active))
        start[self._numbers] = trajectory.fingers[0]
        start[self._numbers[: self._arm]] = trajectory.arm[0]
        self._articulation.qpos = start

    def launch(self) -> None:
        """Let the tool's joints go: the drive of each is its spring and damper.

        With dry friction it is that: a damper that gives up at a torque. Then the spring is applied in each step.
        """
        self._pull = []
        for number, joint, moving in self._hung:
            if moving.friction > 0:
                joint.set_drive_properties(0.0, _STICKS, moving.friction, "force")
                self._pull.append((number, moving))
            else:
                joint.set_drive_properties(
                    moving.stiffness, moving.damping, math.inf, "force"
                )
                joint.set_drive_target(moving.rest)

    def drive(
        self, arm: Array, fingers: float, speeds: Array, finger_speed: float
    ) -> None:
        """Set the drives for the next step: targets (J,), a finger opening, and their speeds."""
        orders = (arm + self._ahead * speeds).tolist()
        if self._gripper:
            orders += [fingers + self._ahead * finger_speed] * self._fingers

        if self._pull:
            values = self._articulation.qpos
            speeds = self._articulation.qvel

            for i, joint in self._pull:
                spring = joint.stiffness * (joint.rest - values[i])
                self._forces[i] = spring - joint.damping * speeds[i]

            self._articulation.qf = self._forces

        if orders == self._orders:
            self._setters[0](orders[0])  # keeps the arm awake
            return

        for set_target, order, before in zip(
            self._setters, orders, self._orders, strict=True
        ):
            if order != before:  # drives keep their target
                set_target(order)

        self._orders = orders

    def joints(self) -> tuple[Array, Array]:
        """Read the joint positions: arm (J,) and fingers (F,)."""
        return self.read(self._articulation.qpos)

    def read(self, values: Any) -> tuple[Array, Array]:
        """Decode the articulation's joints (..., N): arm (..., J) and fingers (..., F)."""
        everything = np.asarray(values, dtype=np.float64)
        values = everything[..., self._numbers]
        loose = everything[..., self._loose]
        fingers = np.zeros((*values.shape[:-1], self._fingers))
        if self._gripper:
            fingers = values[..., self._arm :]
        return values[..., : self._arm], np.concatenate([fingers, loose], axis=-1)


def _components(
    links: Sequence[ArticulationLink],
    arm: Robot,
    tool: Tool,
    surfaces: Surfaces,
    folder: Path,
    tracking_rate: float,
) -> list[Any]:
    """Make the articulation's links, with their shapes and with what drives or holds their joints."""
    loose = {bearer.name for bearer in tool.bearers}
    components: list[Any] = []
    for link in links:
        parent = None if link.parent is None else components[link.parent]
        component = physx.PhysxArticulationLinkComponent(parent)
        components.append(component)
        weigh(component, link.inertia)
        for shape in link.collisions:
            _attach(component, shape, arm, tool, surfaces, folder)
        if link.joint is None:
            component.joint.type = "fixed"
        elif link.name in loose:
            _hold(component.joint, link.joint)
        else:
            _drive(component.joint, link.joint, arm, tracking_rate)

    if tool.gripper:
        fingers = []
        for link, component in zip(links, components, strict=True):
            if link.joint and link.joint.joint.name in arm.finger_joints:
                fingers.append(component)

        difference = [0.0, 1.0, -1.0]  # of the two joints, that is
        articulation = components[0].articulation
        articulation.create_fixed_tendon(
            [fingers[0].parent, *fingers], difference, difference, **_COUPLING
        )
        articulation.solver_position_iterations *= _GRIP

    return components


def _attach(
    component: Any,
    part: PlacedShape,
    arm: Robot,
    tool: Tool,
    surfaces: Surfaces,
    folder: Path,
) -> None:
    def make(material: Any) -> Any:
        shape = part.shape
        if isinstance(shape, Path):
            collider = hull(shape, material)
        else:
            collider = collision(shape, material, folder)
        place(collider, shape, part.pose)
        return collider

    surface = Surface(friction_of(arm, tool, part.part))
    bits = _apart(part.part, arm, tool)
    for shape in surfaces.copies(surface, make, apart=bits):
        component.attach(shape)


def _apart(part: str, arm: Robot, tool: Tool) -> int:
    """Compute a part's bits: parts that share one don't touch each other.

    The arm's links overlap by construction, and a tool overlaps the link that bears it.
    """
    bits = 0 if part in tool.borne_on else 1
    near = bearers(arm, tool)
    for number, mount in enumerate(tool.mounts, start=1):
        if part == mount or part in near:
            bits |= 1 << number

    for number, bearer in enumerate(tool.bearers, start=len(tool.mounts) + 1):
        if part in (bearer.name, bearer.parent):
            bits |= 1 << number

    return bits


def _hold(joint: Any, about: AxisJoint) -> None:
    """Set a joint of the tool, to be held where it is."""
    _place(joint, about)
    joint.friction = 0.0  # PhysX's own is a share of the joint's load
    joint.set_drive_properties(_HELD, _HELD, math.inf, "force")


def _place(joint: Any, about: AxisJoint) -> None:
    joint.name = about.joint.name
    joint.type = about.joint.kind
    joint.pose_in_parent = to_sapien(about.in_parent)
    joint.pose_in_child = to_sapien(about.in_child)
    joint.limit = [list(about.joint.range)]


def _drive(joint: Any, about: AxisJoint, arm: Robot, tracking_rate: float) -> None:
    _place(joint, about)
    joint.friction = 0.0
    force = about.joint.limits.effort or 0.0
    if arm.gripper is not None and about.joint.name in arm.gripper.joints:
        force = arm.gripper.force_n
        joint.armature = [_FINGER_DRIVE]
    else:
        joint.armature = [arm.motor_inertia[arm.arm_joints.index(about.joint.name)]]
    stiffness = force / _GIVES_WAY
    joint.set_drive_properties(stiffness, stiffness / tracking_rate, force, "force")
