"""Simulate without physics: the arm is where its targets are, and bodies that the tool touches move along with it."""

from collections.abc import Iterator

import numpy as np
from typing_extensions import Unpack

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Tool
from core.geometry import Array, Pose
from core.interfaces import Ability, Image, Order, Robot, Rollout, Task, View, World
from core.robot.kinematics import arm_of
from core.scene import Scene, State
from core.simulation.engines import SteppingSimulator

PAPER = 235  # how light the picture's ground is, 0..255
RED = (200, 40, 40)
BLUE = (40, 80, 200)
BLACK = (30, 30, 30)


class ToySimulator(SteppingSimulator):
    """Bodies are points with a radius, which never fall or turn.

    `core.simulation.playback` settles, moves, holds and records: an engine that steps one world at a time needs only a
    world with three methods. Plans may look again, which needs nothing more. Jobs with guards, joints or forces are
    refused.

    Args:
        time_step: seconds.
        radius: of every body, metres.
    """

    drawn_by = "numpy"
    supports = frozenset({Ability.LOOKS})

    def __init__(self, time_step: float = 0.02, radius: float = 0.04) -> None:
        self.time_step = time_step
        self.radius = radius

    def build(self, robot: Robot, scene: Scene, job: Rollout) -> "ToyWorld":
        return ToyWorld(robot, scene.state(), job, self.time_step, self.radius)

    def render(self, task: Task, **view: Unpack[View]) -> Image:
        """Draw from above, x up and y to the left, 1 m to either side of (0.6, 0): bodies red, the tool blue."""
        height = view.get("height", 480)
        width = view.get("width", 640)
        picture = np.full((height, width, 3), PAPER, dtype=np.uint8)
        rows, columns = np.mgrid[:height, :width]
        x = 1.6 - 2 * rows / height
        y = 1 - 2 * columns / width

        def dot(position: Array, radius: float, color: tuple[int, int, int]) -> None:
            inside = (x - position[0]) ** 2 + (y - position[1]) ** 2 < radius**2
            picture[inside] = color

        state = view.get("state") or task.scene(view.get("seed", 0)).state()
        for position in state.positions:
            dot(position, self.radius, RED)

        robot = task.robot
        arm = view.get("arm")
        joints = arm_of(robot).home_for(task.home) if arm is None else arm
        fingers = view.get("fingers")
        opening = robot.opening_m if fingers is None else float(np.mean(fingers))
        tool = view.get("tool")
        if tool is not None:
            for pose, sides in place_boxes(robot, tool, joints, opening):
                for share in np.linspace(-0.5, 0.5, 20):
                    dot(pose.apply(share * sides), 0.015, BLUE)

        dot(arm_of(robot).forward(joints).position, 0.02, BLACK)
        return picture


def place_boxes(
    robot: Robot, tool: Tool, joints: Array, opening: float
) -> Iterator[tuple[Pose, Array]]:
    """Yield the pose in the world and the side lengths (3,) of the bounding box of each of the tool's components."""
    hand = arm_of(robot).forward(joints)
    mounts = {RIGID_MOUNT: hand}
    for mount, side in zip(GRIPPER_MOUNTS, (1, -1), strict=True):
        # Roughly where fingers are.
        mounts[mount] = hand @ Pose(np.array([0.0, side * opening, -0.045]))

    placed = tool.placed()
    for component in tool.components:
        mount, pose = placed[component.name]
        yield mounts[mount] @ pose, component.shape.bounds[1]


class ToyWorld(World):
    """The arm at the first targets of its motion, and bodies where the scene has them."""

    def __init__(
        self, robot: Robot, start: State, job: Rollout, time_step: float, radius: float
    ) -> None:
        self.time_step = time_step
        self._radius = radius
        self._robot = robot
        self._tool = job.tool
        self._start = start
        self._positions = start.positions.copy()
        self._velocities = np.zeros_like(self._positions)
        self._joints = job.trajectory.arm[0]
        self._fingers = float(job.trajectory.fingers[0])

    def step(self, order: Order) -> None:
        """Put the arm at its targets, and take along what the tool touched before."""
        before = list(self._boxes())
        self._joints = np.array(order.arm)
        self._fingers = order.fingers
        after = list(self._boxes())

        moved = np.zeros_like(self._positions)
        for (old, sides), (new, _) in zip(before, after, strict=True):
            reach = sides / 2 + self._radius
            for number, position in enumerate(self._positions):
                local = old.inverse().apply(position)
                if np.all(np.abs(local) < reach):
                    moved[number] = new.apply(local) - position
                    moved[number, 2] = 0.0  # it slides

        self._positions = self._positions + moved
        self._velocities = moved / self.time_step

    def _boxes(self) -> Iterator[tuple[Pose, Array]]:
        return place_boxes(self._robot, self._tool, self._joints, self._fingers)

    def joints(self) -> tuple[Array, Array]:
        opening = self._fingers if self._tool.gripper else 0.0
        return self._joints, np.full(len(self._robot.finger_joints), opening)

    def state(self) -> State:
        start = self._start
        return State(
            start.names,
            self._positions,
            start.quaternions,
            self._velocities,
            np.zeros_like(self._velocities),
        )
