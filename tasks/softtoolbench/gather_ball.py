import numpy as np

from core.geometry import Array
from core.goals import Placed, Untouched
from core.interfaces import Task
from core.scene import (
    Body,
    Camera,
    Elastic,
    Filling,
    Pose,
    Scene,
    Soft,
    Sphere,
    State,
    Trace,
    floor,
    table,
)
from core.values.layouts import around, within
from tasks.assets import board, turned
from tasks.rewards import length, progress, speed

# Length and height of the two walls, m.
WALL = 0.22
HIGH = 0.07
RADIUS = (0.048, 0.056)  # of the ball, m
NEAR = 0.04  # m from the mark
SQUEEZE_N = 2.0  # N
STILL = 0.05  # m/s
ROSE = (0.93, 0.55, 0.60, 1.0)
WOOD = (0.66, 0.47, 0.29, 1.0)
GREEN = (0.25, 0.62, 0.35, 1.0)


class GatherBall(Task):
    """Bring a soft ball out of a corner, without squeezing it.

    Task: the ball must end at rest on the mark, and nothing of the robot may ever press it with more than 2 N.
    Layouts: in ``near`` the corner moves and turns a little; in ``wide`` it stands anywhere before the robot, the mark
    too, and the ball's size, weight, stiffness and friction differ.
    Success: the middle of the ball within 0.04 m of the mark.
    """

    name = "GatherBall"
    description = (
        "A soft ball, 48 to 56 mm in radius, lies in a corner on the table and touches both of its walls, which are "
        "0.22 m long and 0.07 m high. The frame of corner is on the table where the walls meet inside; the walls run "
        "along -x and -y of it, and its diagonal points away from the robot. Bring the ball's middle within 0.04 m of "
        f"the mark, at rest. Nothing is earned if the robot ever presses the ball with more than {SQUEEZE_N:g} N."
    )
    in_words = (
        "A soft ball lies in a corner on the table and touches both of its walls. The frame of corner is on the table "
        "where the walls meet inside; the walls run along -x and -y of it, and its diagonal points away from the "
        "robot. Bring the ball to the mark, at rest. Nothing is earned if the robot ever presses the ball with more "
        "than 2 N."
    )
    goals = (
        Placed(
            bodies=("ball",),
            at="mark",
            place=(0.0, 0.0, None),
            tolerance=NEAR,
            rest=True,
        ),
        Untouched(("ball",), max_force_n=SQUEEZE_N, mean=True),
    )
    variations = {
        "near": around("corner", (0.7, 0.0), 0.03, 0.15),
        "wide": {
            **within("corner", x=(0.66, 0.74), y=(-0.12, 0.12), yaw=(-0.2, 0.2)),
            **within("mark", x=(0.38, 0.46), y=(-0.06, 0.06)),
            **within(
                "ball",
                radius=RADIUS,
                density=(100, 250),
                young=(1e4, 4e4),
                friction=(0.3, 0.6),
            ),
        },
    }
    camera = Camera(position=(0.1, -0.65, 0.65), target=(0.55, 0.0, 0.05))

    def scene(self, seed: int) -> Scene:
        """The corner's frame is turned by an eighth, so that its diagonal points away from the robot."""
        draw = self.draw(seed)
        corner = draw.pose("corner", (0.7, 0.0, 0.0)) @ turned(-np.pi / 4)
        walls = (
            board(
                (0.012, WALL + 0.012, HIGH), (0.006, 0.006 - WALL / 2, HIGH / 2), WOOD
            ),
            board((WALL, 0.012, HIGH), (-WALL / 2, 0.006, HIGH / 2), WOOD),
        )
        radius = draw("ball.radius", 0.052)
        elastic = Elastic(
            draw("ball.density", 150),
            draw("ball.young", 2e4),
            friction=draw("ball.friction", 0.4),
        )
        form = Filling(Sphere(radius))
        off = radius + form.thickness / 2 + 5e-4
        lies = corner @ Pose.xyz_rpy((-off, -off, radius + form.thickness / 2))
        return Scene(
            (
                floor(),
                table(),
                Body("corner", corner, 0.0, walls, walls, friction=0.3),
                Body.mark("mark", draw.position("mark", (0.42, 0.0, 0.0)), NEAR, GREEN),
                Soft.make("ball", form, elastic, lies, color=ROSE),
            )
        )

    def reward(self, start: State, end: State, trace: Trace | None = None) -> Array:
        """Up to 0.15 by the way to the mark, 1 at rest on it; nothing for a ball that was squeezed."""
        assert trace is not None
        left, whole = (
            length(at.relative("ball", "mark")[..., :2]) for at in (end, start)
        )
        still = speed(end, "ball") < STILL
        there = (left < NEAR) & still & (end.position("ball")[..., 2] < 1.2 * RADIUS[1])
        gone = progress(np.maximum(left - NEAR, 0.0), whole - NEAR)
        return np.where(there, 1.0, 0.15 * gone) * (
            trace.force_n("ball", "robot") <= SQUEEZE_N
        )
