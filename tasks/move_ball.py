import numpy as np

from core.geometry import Array
from core.goals import Placed
from core.interfaces import Task
from core.scene import Body, Camera, Scene, Sphere, State, floor, table
from core.values.layouts import around, within
from tasks.rewards import share, speed

RADIUS = 0.08
START = (0.6, 0.3, RADIUS)
TARGET = (0.6, -0.3, RADIUS)
ROLLING_FRICTION = (
    0.003  # metres; a soft ball on wood: from 0.5 m/s it comes to rest within 3 s
)


class MoveBall(Task):
    """Move a ball from the robot's left to its right, and bring it to rest there.

    Task: bring the ball onto the mark, and let it rest there.
    Layouts: in ``near`` ball and mark move a little; in ``wide`` they lie anywhere to the robot's left and right, and
    the ball is lighter or heavier.
    Success: the ball at rest, within 3 cm of its place.
    """

    name = "MoveBall"
    description = (
        "A red ball with a radius of 0.08 m and a mass of 1 kg lies on the table 0.3 m to the robot's left. It rolls "
        "easily and far. Bring it to the blue mark 0.3 m to the robot's right, 0.6 m away, and leave it there. The "
        "reward is measured when the motion is over, and the ball's speed, in m/s, is subtracted from it."
    )
    in_words = (
        "A red ball lies on the table to the robot's left. It rolls easily and far. Bring it to the blue mark to the "
        "robot's right, and leave it there. The reward is measured when the motion is over, and the ball's speed, in "
        "m/s, is subtracted from it."
    )
    success_reward = 0.95  # the paper's goals have no tolerance
    goals = (Placed(bodies=("ball",), place=(0.0, 0.0, RADIUS), at="mark"),)
    variations = {
        "near": {**around("ball", START, 0.03), **around("mark", TARGET, 0.03)},
        "wide": {
            **within("ball", x=(0.5, 0.7), y=(0.2, 0.35), mass=(0.5, 1.5)),
            **within("mark", x=(0.5, 0.7), y=(-0.35, -0.2)),
        },
    }
    camera = Camera(position=(1.6, -1.2, 1.05), target=(0.5, 0.0, 0.2), fov_deg=52.0)

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        ball = Body.of(
            "ball",
            Sphere(RADIUS),
            draw.position("ball", START),
            mass=draw("ball.mass", 1.0),
            color=(0.83, 0.18, 0.16, 1.0),
            rolling_friction=ROLLING_FRICTION,
        )
        place = draw.position("mark", (TARGET[0], TARGET[1], 0.0))
        mark = Body.mark("mark", place, radius=0.05, color=(0.16, 0.36, 0.76, 1.0))
        return Scene((floor(), table(), ball, mark))

    def reward(self, start: State, end: State) -> Array:
        """The fraction of the way from the start to the target (sum of absolute differences), minus the speed."""
        target = start.position("mark") + np.array([0.0, 0.0, RADIUS])
        left = np.abs(end.position("ball") - target).sum(axis=-1)
        whole = np.abs(start.position("ball") - target).sum(axis=-1)
        return share(1 - left / whole - speed(end, "ball"))
