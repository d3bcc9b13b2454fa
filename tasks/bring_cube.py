"""BringCube: bring a cube nearer that lies on the table out of reach."""

import numpy as np

from core.geometry import Array
from core.interfaces import Task
from core.scene import Body, Box, Camera, Goal, Scene, State, floor, table

SIDE = 0.07
START = (1.0, 0.0, SIDE / 2)
TARGET = (0.6, 0.0, SIDE / 2)


class BringCube(Task):
    name = "BringCube"
    description = (
        "A red cube with a side of 0.07 m and a mass of 1 kg lies on the table 1 m in front of the robot, beyond what "
        "its gripper can reach. Bring the cube 0.4 m closer, onto the blue mark on the table, and leave it there."
    )
    goals = (Goal(bodies=("cube",), place=TARGET),)
    camera = Camera(position=(1.45, -1.1, 0.9), target=(0.52, 0.0, 0.2))

    def scene(self, seed: int) -> Scene:
        cube = Body.of("cube", Box((SIDE, SIDE, SIDE)), START, mass=1.0, color=(0.83, 0.18, 0.16, 1.0))
        mark = Body.mark("mark", (TARGET[0], TARGET[1], 0.0), radius=0.05, color=(0.16, 0.36, 0.76, 1.0))
        return Scene((floor(), table(), cube, mark))

    def reward(self, start: State, end: State) -> Array:
        """The fraction of the way from the start to the target (sum of absolute differences): 1 at the target."""
        left = np.abs(end.position("cube") - TARGET).sum(axis=-1)
        whole = np.abs(start.position("cube") - TARGET).sum(axis=-1)
        reward: Array = np.clip(1 - left / whole, 0.0, 1.0)
        return reward
