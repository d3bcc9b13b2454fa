import numpy as np

from core.geometry import Array
from core.goals import Placed
from core.interfaces import Task
from core.scene import Body, Box, Camera, Geom, Pose, Scene, State, floor, table
from core.values.layouts import around, within
from tasks.assets import board, turned
from tasks.rewards import progress

WIDTH = 0.25  # outer width along x and y
HEIGHT = 0.20  # height of the walls
WALL = 0.004  # their thickness
# Length of a flap, and the angle by which it rises outward.
FLAP = 0.10
SLANT = np.radians(25.0)
MASS = 0.3
CENTER = (0.68, 0.0, 0.12)  # of the box with its flaps; the origin of the body's frame
WANTED_HEIGHT = 0.25  # for the same point

CARDBOARD = (0.72, 0.53, 0.34, 1.0)
FLAP_COLOR = (0.80, 0.62, 0.42, 1.0)


def cardboard_box(pose: Pose, mass: float) -> Body:
    """A bottom, four walls and four flaps, all boards. The four sides are equal, rotated about z."""
    inside = WIDTH - 2 * WALL
    middle = HEIGHT / 2 - CENTER[2]
    boards = [
        board((inside, inside, WALL), (0.0, 0.0, WALL / 2 - CENTER[2]), CARDBOARD)
    ]
    for quarter in range(4):
        turn = turned(quarter * np.pi / 2)
        wall = Pose(np.array([(WIDTH - WALL) / 2, 0.0, middle]))
        flap = Pose.xyz_rpy(
            (WIDTH / 2 - WALL, 0.0, HEIGHT - CENTER[2] - WALL), (0.0, -SLANT, 0.0)
        )
        lengthwise = WIDTH if quarter % 2 else inside
        boards.append(Geom(Box((WALL, lengthwise, HEIGHT)), turn @ wall, CARDBOARD))
        boards.append(
            Geom(
                Box((FLAP, inside, WALL)),
                turn @ flap @ Pose(np.array([FLAP / 2, 0.0, 0.0])),
                FLAP_COLOR,
            )
        )
    return Body("box", pose, mass, tuple(boards), tuple(boards))


class LiftBox(Task):
    """Lift an open cardboard box that is too wide for a gripper; it can be held by its flaps.

    Task: lift the box straight up, and hold it.
    Layouts: in ``near`` the box moves and turns a little; in ``wide`` it stands anywhere in front of the robot, turned
    at will, lighter or heavier.
    Success: the box's centre within 7 mm of its place.
    """

    name = "LiftBox"
    description = (
        "A cardboard box, 0.25 m wide and 0.20 m high and too wide for a gripper, stands on the table in front of the "
        "robot. It is open on top, and its four flaps, each 0.1 m long, slant outward and upward from the edges of the "
        f"walls (from z = 0.20 to z = 0.24). The box weighs {MASS:g} kg. Lift it straight up by "
        f"{WANTED_HEIGHT - CENTER[2]:g} m without tilting it, until its centre, now at z = {CENTER[2]:g} m, is at "
        f"z = {WANTED_HEIGHT:g} m, and hold it there."
    )
    in_words = (
        "A cardboard box, too wide for a gripper, stands on the table in front of the robot. It is open on top, and "
        "its four flaps slant outward and upward from the edges of the walls. It is light. Lift it straight up by 0.13 "
        "m without tilting it, and hold it there."
    )
    success_reward = 0.95  # the paper's goals have no tolerance
    goals = (
        Placed(bodies=("box",), place=(0.0, 0.0, WANTED_HEIGHT - CENTER[2]), at="box"),
    )
    variations = {
        "near": around("box", CENTER, 0.03, 0.3),
        "wide": within(
            "box",
            x=(0.58, 0.72),
            y=(-0.2, 0.2),
            yaw=(-np.pi / 4, np.pi / 4),
            mass=(0.2, 0.45),
        ),
    }
    camera = Camera(position=(1.3, -0.95, 0.9), target=(0.48, 0.0, 0.28))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        return Scene(
            (
                floor(),
                table(),
                cardboard_box(draw.pose("box", CENTER), draw("box.mass", MASS)),
            )
        )

    def reward(self, start: State, end: State) -> Array:
        """The fraction of the way straight up to the wanted height (sum of absolute differences): 1 at the goal."""
        wanted = start.position("box").copy()
        wanted[..., 2] = WANTED_HEIGHT
        whole = np.abs(wanted - start.position("box")).sum(axis=-1)
        left = np.abs(wanted - end.position("box")).sum(axis=-1)
        return progress(left, whole)
