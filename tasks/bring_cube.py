import numpy as np

from core.geometry import Array
from core.goals import Placed
from core.interfaces import Task
from core.scene import Body, Box, Camera, Scene, State, floor, table
from core.values.layouts import around, within
from tasks.rewards import progress

SIDE = 0.07
START = (1.0, 0.0, SIDE / 2)
TARGET = (0.6, 0.0, SIDE / 2)


class BringCube(Task):
    """Bring a cube nearer that lies on the table out of reach.

    Task: pull or push the cube onto the mark, and leave it there.
    Layouts: in ``near`` cube and mark move a little; in ``wide`` the cube lies anywhere on the table's far half,
    turned, lighter or heavier, and the mark anywhere in front of the robot.
    Success: the cube's centre within some 2 cm of the mark's.
    """

    name = "BringCube"
    description = (
        "A red cube with a side of 0.07 m and a mass of 1 kg lies on the table 1 m in front of the robot, beyond what "
        f"its gripper can reach. Bring the cube {START[0] - TARGET[0]:g} m closer, onto the blue mark on the "
        "table, and leave it there."
    )
    in_words = (
        "A red cube lies on the table, beyond what the robot's gripper can reach. Bring the cube closer, onto the blue "
        "mark on the table, and leave it there."
    )
    success_reward = 0.95  # the paper's goals have no tolerance
    goals = (Placed(bodies=("cube",), place=(0.0, 0.0, SIDE / 2), at="mark"),)
    variations = {
        "near": {**around("cube", START, 0.03, 0.3), **around("mark", TARGET, 0.03)},
        "wide": {
            **within(
                "cube",
                x=(0.85, 1.05),
                y=(-0.3, 0.3),
                yaw=(-np.pi / 4, np.pi / 4),
                mass=(0.5, 1.5),
            ),
            **within("mark", x=(0.45, 0.65), y=(-0.2, 0.2)),
        },
    }
    camera = Camera(position=(1.45, -1.1, 0.9), target=(0.52, 0.0, 0.2))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        cube = Body.of(
            "cube",
            Box((SIDE, SIDE, SIDE)),
            draw.position("cube", START),
            rpy=(0.0, 0.0, draw("cube.yaw", 0.0)),
            mass=draw("cube.mass", 1.0),
            color=(0.83, 0.18, 0.16, 1.0),
        )
        place = draw.position("mark", (TARGET[0], TARGET[1], 0.0))
        mark = Body.mark("mark", place, radius=0.05, color=(0.16, 0.36, 0.76, 1.0))
        return Scene((floor(), table(), cube, mark))

    def reward(self, start: State, end: State) -> Array:
        """The fraction of the way from the start to the target (sum of absolute differences): 1 at the target."""
        target = start.position("mark") + np.array([0.0, 0.0, SIDE / 2])
        left = np.abs(end.position("cube") - target).sum(axis=-1)
        whole = np.abs(start.position("cube") - target).sum(axis=-1)
        return progress(left, whole)
