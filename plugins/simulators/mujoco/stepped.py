"""A world that is stepped from outside, as guards and tests need it."""

from __future__ import annotations

import numpy as np

from core.geometry import Array
from core.interfaces import JointTrajectory, World
from core.scene import State
from plugins.simulators.mujoco.contacts import is_discrete
from plugins.simulators.mujoco.engine import mujoco, warnings_caught
from plugins.simulators.mujoco.joints import Joints
from plugins.simulators.mujoco.moving import Moving
from plugins.simulators.mujoco.shapes import Element


class Stepped(World):
    """A world, with the robot at first at a trajectory's first targets.

    Args:
        model: of the world; the tool's joints are held in it until `launch`.
        moving: its bodies.
        start: a motion that begins there.
        joints: the robot's.
    """

    def __init__(
        self, model: Element, moving: Moving, start: JointTrajectory, joints: Joints
    ) -> None:
        self.time_step = float(model.opt.timestep)
        self._model = model
        self._data = mujoco.MjData(model)
        self._joints = joints
        self._moving = moving
        self._steps_since_launch = -np.inf
        fingers = [start.fingers[0]] * joints.grip
        self._data.qpos[joints.driven] = [*start.arm[0], *fingers]

        self._discrete = is_discrete(model.opt)
        # s, from a step's end to the instant of which servos get the targets, see `World._controls`.
        self._back = self.time_step
        if self._discrete:
            self._back = 0.0

    def step(
        self, arm: Array, fingers: float, speeds: Array, finger_speed: float
    ) -> None:
        """Step once.

        Args:
            arm: targets at the step's end (A,).
            fingers: the target of all fingers there.
            speeds: at which the arm's approaches (A,).
            finger_speed: at which the fingers' does.
        """
        arm = arm - self._back * speeds
        fingers -= self._back * finger_speed
        controls = self._data.ctrl.reshape(-1, 2)
        self._joints.command(
            controls,
            arm,
            speeds,
            fingers,
            finger_speed,
        )

        if self._moving.drives:
            driven = len(self._joints.driven)
            steps = self._steps_since_launch + np.array([0.0, 1.0])
            begin, end = self._moving.aim(steps * self.time_step)
            controls[driven:, 1] = (end - begin) / self.time_step
            controls[driven:, 0] = begin
            if self._discrete:
                controls[driven:, 0] = end

        self._moving.pull(self._model, self._data)
        self._joints.hold(self._model, held=self._steps_since_launch < 0)
        self._steps_since_launch += 1
        with warnings_caught():  # a world that diverges shows it in its state too
            mujoco.mj_step(self._model, self._data)

    def launch(self) -> None:
        """Begin the motion: launched bodies get their velocities, and drives and the tool's joints begin to move."""
        self._steps_since_launch = 0.0
        self._moving.launch(self._data.qpos, self._data.qvel)

    def joints(self) -> tuple[Array, Array]:
        """Return the arm's joints (A,), and the fingers' with the tool's (F + K,)."""
        arm, others = self._joints.read(self._data.qpos[None])
        return arm[0], others[0]

    def state(self) -> State:
        """Return the state of the scene's bodies."""
        return self._moving.state(self._data.qpos, self._data.qvel)
