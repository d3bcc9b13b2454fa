"""Make the joints between a world's bodies resist, spring, latch and drive."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from core.scene import Drive, Joint
from plugins.simulators.forces import latch_force
from plugins.simulators.lifting import Lift
from plugins.simulators.pybullet.engine import Client

Place = tuple[int, int]
"""Of a body: PyBullet's numbers of its multibody and of its link, -1 the base."""


class Mechanism:
    """The joints between the bodies of a world, or of a tool: friction, dampers, springs, latches and drives.

    Call `drive` before each step if it acts, and `launch` once, when the robot's motion begins.


    Args:
        client: the world.
        joints: each with the place of the body that it moves.
        gain: the share of its error that a drive makes up in a step.
        time_step: seconds.
    """

    def __init__(
        self,
        client: Client,
        joints: Sequence[tuple[Place, Joint]],
        gain: float,
        time_step: float,
    ) -> None:
        self._client = client
        self._gain = gain
        self._time_step = time_step
        self._steps: int | None = None  # since the launch

        self._driven: list[tuple[Place, Joint, Drive, Lift]] = []
        self._pulled: list[tuple[Place, Joint]] = []
        for place, joint in joints:
            self.add(place, joint)

    @property
    def acts(self) -> bool:
        """Whether any joint is driven, sprung or latched."""
        return bool(self._driven or self._pulled)

    def add(self, place: Place, joint: Joint) -> None:
        """Let a joint act from here on."""
        self._resist(place, joint)
        self._client.changeDynamics(*place, jointDamping=joint.damping)
        if joint.drive:
            driven = place, joint, joint.drive, Lift(self._time_step)
            self._driven.append(driven)
        if joint.stiffness or joint.latches:
            self._pulled.append((place, joint))

    def _resist(self, place: Place, joint: Joint) -> None:
        """Set a motor at rest, which is dry friction; PyBullet's own would hold the joint."""
        client = self._client
        if joint.kind != "ball":
            client.setJointMotorControl2(
                *place,
                client.VELOCITY_CONTROL,
                targetVelocity=0,
                force=joint.friction,
            )
            return

        client.setJointMotorControlMultiDof(
            *place,
            client.POSITION_CONTROL,
            targetPosition=[0, 0, 0, 1],
            targetVelocity=[0, 0, 0],
            positionGain=0,
            velocityGain=1,
            force=[joint.friction] * 3,
        )

    def launch(self) -> None:
        """Begin the time of drives."""
        self._steps = 0

    def drive(self) -> None:
        """Set motors and torques for the next step."""
        for place, joint, drive, lift in self._driven:
            self._aim(place, joint, drive, lift)

        if self._steps is not None:
            self._steps += 1

        for place, joint in self._pulled:
            self._pull(place, joint)

    def _pull(self, place: Place, joint: Joint) -> None:
        """Add what its spring and latches pull a joint with to the forces of the next step."""
        client = self._client
        if joint.kind == "ball":
            quaternion = client.getJointStateMultiDof(*place)[0]
            turn = Rotation.from_quat(quaternion).as_rotvec()
            torques = -joint.stiffness * turn
            client.setJointMotorControlMultiDof(
                *place, client.TORQUE_CONTROL, force=torques.tolist()
            )
            return

        position = joint.start + client.getJointState(*place)[0]
        spring = joint.stiffness * (joint.rest - position)
        force = spring + latch_force(joint, position)
        client.setJointMotorControl2(*place, client.TORQUE_CONTROL, force=force)

    def _aim(self, place: Place, joint: Joint, drive: Drive, lift: Lift) -> None:
        """Aim a joint at where its schedule is at the end of the step."""
        begins = 0.0
        ends = 0.0
        if self._steps is not None:
            begins = self._steps * self._time_step
            ends = begins + self._time_step

        before, after = drive.sample(np.array([begins, ends])).tolist()
        away = after - before
        target = after - joint.start

        value = self._client.getJointState(*place)[0]
        if joint.kind == "hinge" and not joint.limited:
            # A wheel's schedule begins again a turn behind.
            turn = 2 * math.pi
            away -= turn * round(away / turn)
            target += turn * round((value - target) / turn)

        self._client.setJointMotorControl2(
            *place,
            self._client.POSITION_CONTROL,
            targetPosition=target + lift.add(target - value),
            targetVelocity=away / self._time_step,
            force=drive.force,
            positionGain=self._gain,
            velocityGain=1.0,
        )
