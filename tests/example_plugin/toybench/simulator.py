"""Simulate without physics: the arm is where its targets are, and bodies that the tool touches move along with it."""

import numpy as np

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT
from core.geometry import Pose
from core.interfaces import Simulator
from core.robot.kinematics import arm_of
from core.scene import State
from core.simulation.playback import play


class ToySimulator(Simulator):
    """Bodies are points with a radius, and never fall or turn."""

    drawn_by = "numpy"

    def __init__(self, time_step: float = 0.02, radius: float = 0.04):
        self.time_step = time_step
        self.radius = radius

    def rollout(self, task, jobs):
        return [play(self.world(task, job.tool, job.seed), job) for job in jobs]

    def world(self, task, tool, seed=0):
        return ToyWorld(task, tool, seed, self.time_step, self.radius)

    def render(
        self,
        task,
        *,
        seed=0,
        tool=None,
        arm=None,
        fingers=None,
        state=None,
        camera=None,
        width=640,
        height=480,
    ):
        """From above, x up and y to the left, 1 m to either side of (0.6, 0): bodies red, the tool blue."""
        picture = np.full((height, width, 3), 235, dtype=np.uint8)
        rows, columns = np.mgrid[:height, :width]
        x, y = 1.6 - 2 * rows / height, 1 - 2 * columns / width

        def dot(position, radius, color):
            picture[(x - position[0]) ** 2 + (y - position[1]) ** 2 < radius**2] = color

        state = task.scene(seed).state() if state is None else state
        for position in state.positions:
            dot(position, self.radius, (200, 40, 40))
        joints = arm_of(task.robot).home_for(task.home) if arm is None else arm
        opening = task.robot.opening_m if fingers is None else float(np.mean(fingers))
        for pose, box in boxes(task.robot, tool, joints, opening) if tool else ():
            for corner in np.linspace(-0.5, 0.5, 20)[:, None] * box.size:
                dot(pose.apply(corner), 0.015, (40, 80, 200))
        dot(arm_of(task.robot).forward(joints).position, 0.02, (30, 30, 30))
        return picture


def boxes(robot, tool, joints, opening):
    """Yield pose in the world and shape of each of the tool's boxes."""
    hand = arm_of(robot).forward(joints)
    # Roughly where fingers are.
    left, right = (Pose(np.array([0.0, side * opening, -0.045])) for side in (1, -1))
    mounts = {
        RIGID_MOUNT: hand,
        **dict(zip(GRIPPER_MOUNTS, (hand @ left, hand @ right), strict=True)),
    }
    placed = tool.placed()
    for component in tool.components:
        mount, pose = placed[component.name]
        yield mounts[mount] @ pose, component.shape


class ToyWorld:
    """A `core.interfaces.World`."""

    def __init__(self, task, tool, seed, time_step, radius):
        self.time_step = time_step
        self._radius = radius
        self._robot, self._tool = task.robot, tool
        self._start = task.scene(seed).state()
        self._positions = self._start.positions.copy()
        self._velocities = np.zeros_like(self._positions)
        self._joints, self._fingers = (
            arm_of(task.robot).home_for(task.home),
            task.robot.opening_m,
        )

    def step(self, arm, fingers, speeds, finger_speed):
        before = list(boxes(self._robot, self._tool, self._joints, self._fingers))
        self._joints, self._fingers = np.array(arm), float(fingers)
        after = list(boxes(self._robot, self._tool, self._joints, self._fingers))
        moved = np.zeros_like(self._positions)
        for (old, box), (new, _) in zip(before, after, strict=True):
            for i, position in enumerate(self._positions):
                local = old.inverse().apply(position)
                if np.all(np.abs(local) < np.array(box.size) / 2 + self._radius):
                    moved[i] = new.apply(local) - position
                    moved[i, 2] = 0.0  # it slides
        self._positions = self._positions + moved
        self._velocities = moved / self.time_step

    def joints(self):
        count = len(self._robot.finger_joints)
        return self._joints, np.full(
            count, self._fingers if self._tool.gripper else 0.0
        )

    def state(self):
        start = self._start
        return State(
            start.names,
            self._positions,
            start.quaternions,
            self._velocities,
            np.zeros_like(self._velocities),
        )
