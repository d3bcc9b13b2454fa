"""Put the arm with its tool into a PhysX scene: an articulation with a drive in each joint."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Tool
from core.geometry import Array
from core.interfaces import JointTrajectory
from core.robot.description import (
    ARM_JOINTS,
    FINGER_FRICTION,
    FINGER_JOINTS,
    GRIP_FORCE,
    MOTOR_INERTIA,
    TOOL_FRICTION,
)
from plugins.simulators.sapien.bodies import weigh
from plugins.simulators.sapien.description import Joint, Shape, robot
from plugins.simulators.sapien.engine import physx, sapien
from plugins.simulators.sapien.shapes import collision, hull, to_sapien
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

_BEARERS = {RIGID_MOUNT: ("panda_link7", "panda_link8"), **dict.fromkeys(GRIPPER_MOUNTS, ("panda_hand",))}


def surface_of(part: str) -> Surface:
    return Surface(FINGER_FRICTION if part in GRIPPER_MOUNTS else TOOL_FRICTION)


def surfaces_of(tool: Tool) -> set[Surface]:
    return {surface_of(shape.part) for link in robot(tool) for shape in link.collisions}


class Robot:
    """The arm with ``tool``, its base at the origin, its joints at the trajectory's first targets."""

    def __init__(
        self,
        scene: Any,
        surfaces: Surfaces,
        tool: Tool,
        trajectory: JointTrajectory,
        folder: Path,
        tracking_rate: float,
        time_step: float,
    ) -> None:
        self._gripper = tool.gripper
        links = robot(tool)
        components: list[Any] = []
        for link in links:
            component = physx.PhysxArticulationLinkComponent(None if link.parent is None else components[link.parent])
            components.append(component)
            weigh(component, link.inertia)
            for shape in link.collisions:
                _attach(component, shape, tool, surfaces, folder)
            if link.joint is None:
                component.joint.type = "fixed"
            else:
                _drive(component.joint, link.joint, tracking_rate)
        if tool.gripper:
            fingers = [i for i, link in enumerate(links) if link.joint is not None and link.joint.name in FINGER_JOINTS]
            chain = [components[i].parent for i in fingers[:1]] + [components[i] for i in fingers]
            difference = [0.0, 1.0, -1.0]  # of the two joints, that is
            components[0].articulation.create_fixed_tendon(chain, difference, difference, **_COUPLING)
            components[0].articulation.solver_position_iterations *= _GRIP
        # The target speed is added to the spring's target instead of the damper's: half as many calls. And in each of
        # the solver's n iterations a joint is driven as if that were the end of the step, and its speed is added: on
        # average (n - 1) / 2n of a step too far.
        iterations = components[0].articulation.solver_position_iterations
        self._ahead = 1 / tracking_rate - time_step * (iterations - 1) / (2 * iterations)
        for link, component in zip(links, components, strict=True):
            entity = sapien.Entity()
            entity.name = link.name
            entity.add_component(component)
            scene.add_entity(entity)
        self._articulation = components[0].articulation
        active = {joint.name: number for number, joint in enumerate(self._articulation.active_joints)}
        self._numbers = [active[name] for name in (*ARM_JOINTS, *(FINGER_JOINTS if tool.gripper else ()))]
        joints = [self._articulation.active_joints[number] for number in self._numbers]
        self._setters = [joint.set_drive_target for joint in joints]
        self._orders = [math.nan] * len(joints)
        start = np.empty(len(self._numbers))
        start[self._numbers] = [*trajectory.arm[0], *([trajectory.fingers[0]] * 2 if tool.gripper else ())]
        self._articulation.qpos = start

    def orders(self, arm: Array, fingers: Array, speeds: Array, finger_speeds: Array) -> list[list[float]]:
        """Make the orders that `drive` takes, one list for each of S steps.

        Given are the joints' targets (S, 7), finger openings (S,), and the speeds at which they are approached.
        """
        if self._gripper:
            arm, speeds = np.column_stack([arm, fingers, fingers]), np.column_stack([speeds, *[finger_speeds] * 2])
        orders: list[list[float]] = (arm + self._ahead * speeds).tolist()
        return orders

    def drive(self, orders: list[float]) -> None:
        if orders == self._orders:
            self._setters[0](orders[0])  # keeps the arm awake
            return
        for set_target, order, before in zip(self._setters, orders, self._orders, strict=True):
            if order != before:  # drives keep their target
                set_target(order)
        self._orders = orders

    def joints(self) -> tuple[Array, Array]:
        """Read the joint positions: arm (7,) and fingers (2,)."""
        return self.read(self.note())

    def note(self) -> Any:
        """Take a snapshot for `read`."""
        return self._articulation.qpos

    def read(self, notes: Any) -> tuple[Array, Array]:
        """Decode snapshots (..., J): arm (..., 7) and fingers (..., 2)."""
        values = np.asarray(notes, dtype=np.float64)[..., self._numbers]
        return values[..., :7], values[..., 7:] if self._gripper else np.zeros((*values.shape[:-1], 2))


def _attach(component: Any, part: Shape, tool: Tool, surfaces: Surfaces, folder: Path) -> None:
    def make(material: Any) -> Any:
        shape = part.shape
        collider = hull(shape, material) if isinstance(shape, Path) else collision(shape, material, folder)
        collider.local_pose = to_sapien(part.pose)
        return collider

    for shape in surfaces.copies(surface_of(part.part), make, apart=_apart(part.part, tool)):
        component.attach(shape)


def _apart(part: str, tool: Tool) -> int:
    """Compute a part's bits: parts that share one don't touch each other.

    The arm's links overlap by construction, and a tool overlaps the link that bears it.
    """
    bits = 0 if part in tool.mounts else 1
    for number, mount in enumerate(tool.mounts, start=1):
        if part == mount or part in _BEARERS[mount]:
            bits |= 1 << number
    return bits


def _drive(joint: Any, about: Joint, tracking_rate: float) -> None:
    joint.name = about.name
    joint.type = about.kind
    joint.pose_in_parent = to_sapien(about.in_parent)
    joint.pose_in_child = to_sapien(about.in_child)
    joint.limit = [[about.lower, about.upper]]
    joint.friction = 0.0
    force = about.effort
    if about.name in FINGER_JOINTS:
        force = GRIP_FORCE
        joint.armature = [_FINGER_DRIVE]
    else:
        joint.armature = [MOTOR_INERTIA[ARM_JOINTS.index(about.name)]]
    stiffness = force / _GIVES_WAY
    joint.set_drive_properties(stiffness, stiffness / tracking_rate, force, "force")
