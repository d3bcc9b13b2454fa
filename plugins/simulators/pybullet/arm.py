"""Put the arm with its tool into a PyBullet world: motors, friction, and what touches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.interfaces import JointTrajectory, Order, Robot
from core.robot.description import beyond, joint_name
from core.scene import Joint
from plugins.simulators.links import bearers, friction_of, split_joints
from plugins.simulators.pybullet.engine import Client
from plugins.simulators.pybullet.engine import pybullet as p
from plugins.simulators.pybullet.mechanisms import Place
from plugins.simulators.pybullet.robot import driven_links, joint_numbers, load_robot

_HELD = 1e4  # N m or N, of a motor that holds a joint of the tool


class ArticulatedArm:
    """The arm with a tool in a world, its joints at a trajectory's first targets, and the tool's held.

    Attributes:
        number: PyBullet's, of its multibody.
        links: PyBullet's numbers of its links by name, the base's, -1, among them.
        beyond: the numbers of those that the arm's last joint moves.

    Args:
        client: the world.
        file: describes ``robot`` with ``tool``, see `robot_file`.
        robot: the arm.
        tool: what it holds.
        start: a motion that begins there.
        gain: the share of its error that a motor makes up in a step.
    """

    def __init__(
        self,
        client: Client,
        file: Path,
        robot: Robot,
        tool: Tool,
        start: JointTrajectory,
        gain: float,
    ) -> None:
        self._client = client
        self.number = load_robot(client, file)
        joints, links = joint_numbers(client, self.number)
        base = client.getBodyInfo(self.number)[0].decode()
        self.links = {base: -1, **links}
        self.beyond = {links[name] for name in beyond(robot, tool) if name in links}

        self._arm = len(robot.arm_joints)
        self._robot = robot
        self._tool = tool
        driven = robot.joints(tool.gripper)
        self._fingers = len(driven) - self._arm
        self._joints = [joints[name] for name in driven]
        self._loose = [joints[joint_name(bearer.name)] for bearer in tool.bearers]
        self._noted = [*self._joints, *self._loose]
        self._hung = [bearer.joint for bearer in tool.bearers]

        arm = self._joints[: self._arm]
        self._forces = [client.getJointInfo(self.number, joint)[10] for joint in arm]
        if self._fingers and robot.gripper is not None:
            self._forces += [robot.gripper.force_n] * self._fingers

        self._gains = [gain] * len(driven)
        self._velocity_gains = [1.0] * len(driven)
        self._order: Order | None = None  # the last one
        self._states: Sequence[tuple[Any, ...]] = ()  # of the last snapshot

        targets = [*start.arm[0], *([start.fingers[0]] * self._fingers)]
        for joint, target in zip(self._joints, targets, strict=True):
            client.resetJointState(self.number, joint, target)

        self._filter_contacts(robot, tool)
        self._set_dynamics(robot, tool, links)
        self._hold_tool()

    def _filter_contacts(self, robot: Robot, tool: Tool) -> None:
        """Let a tool touch all links but its bearer. The arm's own links overlap by construction, and never touch.

        Components that a joint connects don't touch either.
        """
        components = {*tool.borne_on}
        joined = [{bearer.name, bearer.parent} for bearer in tool.bearers]
        near = {*bearers(robot, tool)}

        for first, second in combinations(self.links, 2):
            pair = {first, second}
            at_flange = pair & near and pair & {*tool.mounts}
            touch = bool(pair & components) and not at_flange and pair not in joined
            self._client.setCollisionFilterPair(
                self.number,
                self.number,
                self.links[first],
                self.links[second],
                int(touch),
            )

    def _set_dynamics(self, robot: Robot, tool: Tool, links: dict[str, int]) -> None:
        """Set the friction of ``links``, and the inertia of those that a motor turns."""
        client = self._client
        for name, link in links.items():
            friction = np.sqrt(friction_of(robot, tool, name))
            client.changeDynamics(self.number, link, lateralFriction=friction)

        for name, inertia in driven_links(robot).items():
            moments = inertia.moments.tolist()
            client.changeDynamics(
                self.number, links[name], localInertiaDiagonal=moments
            )

    def _hold_tool(self) -> None:
        """Hold the tool's joints where they are, until the motion begins."""
        if self._loose:  # Bullet brakes everything that moves, by 4 % in a second
            self._client.changeDynamics(
                self.number, -1, linearDamping=0, angularDamping=0
            )

        for number in self._loose:
            self._client.setJointMotorControl2(
                self.number, number, p.POSITION_CONTROL, targetPosition=0, force=_HELD
            )

    def list_loose(self) -> Iterator[tuple[Place, Joint]]:
        """Yield the tool's joints, which are let go once the motion begins."""
        for number, joint in zip(self._loose, self._hung, strict=True):
            yield (
                (self.number, number),
                Joint(
                    "",
                    joint.kind,
                    "",
                    damping=joint.damping,
                    friction=joint.friction,
                    stiffness=joint.stiffness,
                    rest=joint.rest,
                ),
            )

    def drive(self, order: Order) -> None:
        """Set the motors for the next step."""
        if order == self._order:  # they keep their targets
            return

        self._order = order
        p.setJointMotorControlArray(  # names would cost half a microsecond a step
            self.number,
            self._joints,
            p.POSITION_CONTROL,
            [*order.arm, *[order.fingers] * self._fingers],
            [*order.speeds, *[order.finger_speed] * self._fingers],
            self._forces,
            self._gains,
            self._velocity_gains,
            self._client.number,
        )

    def note_torques(self) -> tuple[float, ...]:
        """Return what the arm's motors applied in the last step before the last snapshot (J,), N m."""
        return tuple([state[3] for state in self._states[: self._arm]])

    def snapshot(self) -> tuple[float, ...]:
        """Read the positions of the joints, the tool's behind the others.

        Python's garbage collector soon lets go of tuples of numbers, but not of lists.
        """
        self._states = p.getJointStates(self.number, self._noted, self._client.number)
        return tuple([state[0] for state in self._states])

    def read(self, snapshots: Sequence[tuple[float, ...]]) -> tuple[Array, Array]:
        """Decode T snapshots: arm (T, J) and fingers with the tool's joints (T, F + K)."""
        return split_joints(self._robot, self._tool, np.array(snapshots))
