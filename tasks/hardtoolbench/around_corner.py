from dataclasses import replace

import numpy as np

from core.geometry import Array
from core.goals import Placed
from core.interfaces import Task
from core.scene import Body, Box, Camera, Pose, Scene, State, floor, table
from core.values.joints import rotate
from core.values.layouts import around, within
from tasks.assets import board
from tasks.rewards import length, progress, share, speed

# Inside the box.
LENGTH = 0.18
WIDTH = 0.13
HEIGHT = 0.105
WALL = 0.008
MAT = 0.002  # thickness
OPENING = LENGTH / 2  # x of it in the box's frame
OUT = OPENING + 0.03  # x of a cube's middle that is out
# Of the cube's middle, m.
TOLERANCE = 0.015
NEAR = 0.05
# A cube that is higher than it lay, or faster, was not left.
RAISED = 0.006
STILL_M_S = 0.05

RUBBER = (0.20, 0.21, 0.23, 1.0)
WOOD = (0.66, 0.47, 0.29, 1.0)
GLASS = (0.62, 0.80, 0.86, 0.35)
RED = (0.80, 0.20, 0.17, 1.0)
GREEN = (0.25, 0.62, 0.35, 1.0)


def garage(pose: Pose) -> Body:
    """A fixed box with a roof, without a wall at +x, on a mat; its frame is on the table, in its middle."""
    side = (LENGTH + WALL, WALL, HEIGHT)
    back = (WALL, WIDTH, HEIGHT)
    parts = (
        board(side, (-WALL / 2, (WIDTH + WALL) / 2, HEIGHT / 2), WOOD),
        board(side, (-WALL / 2, -(WIDTH + WALL) / 2, HEIGHT / 2), GLASS),
        board(back, (-(LENGTH + WALL) / 2, 0.0, HEIGHT / 2), WOOD),
        board(
            (LENGTH + WALL, WIDTH + 2 * WALL, WALL),
            (-WALL / 2, 0.0, HEIGHT + WALL / 2),
            GLASS,
        ),
    )
    mat = board((0.46, 0.3, MAT), (0.23 - LENGTH / 2, 0.0, MAT / 2), RUBBER)
    return Body("box", pose, 0.0, (*parts, mat), (*parts, mat), friction=1.2)


class AroundCorner(Task):
    """Bring a cube out of a roofed box that opens away from the robot, onto a mark.

    Task: the cube must come out of the box, and end on the mark beside its opening.
    Layouts: in ``near`` the box moves and turns a little, with all that belongs to it; in ``wide`` it stands anywhere
    in front of the robot, turned, the cube lies elsewhere in it and is smaller or larger, lighter or heavier, smoother
    or rougher, and the mark is elsewhere before the opening.
    Success: the cube lies at rest, its middle within 15 mm of the mark's.
    """

    name = "AroundCorner"
    description = (
        "A box with a roof is fixed on the table. Inside it is 180 mm long (along x of its frame, which is in its "
        "middle on the table), 130 mm wide and 105 mm high; walls and roof are 8 mm thick. It is open at its +x end "
        "alone, which points away from the robot. Its floor is a rubber mat of 2 mm, which goes on beyond the "
        "opening. A cube with sides of 36 to 46 mm lies on it, its middle 55 to 75 mm from the closed end and up to "
        "15 mm aside. A mark lies on the mat outside, 130 to 190 mm beyond the opening and up to 0.1 m aside. Bring "
        f"the cube out and leave it there at rest, its middle within {1000 * TOLERANCE:g} mm of the mark's."
    )
    in_words = (
        "A box with a roof is fixed on the table. It is open at one end alone, which points away from the robot. Its "
        "floor is a rubber mat, which goes on beyond the opening. A red cube lies on it, near the closed end. A green "
        "mark lies on the mat outside. Bring the cube out and leave it there at rest, its middle within 15 mm of the "
        "mark's."
    )
    goals = (
        Placed(
            bodies=("cube",),
            at="mark",
            place=(0.0, 0.0, None),
            tolerance=TOLERANCE,
            rest=True,
        ),
    )
    variations = {
        "near": around("box", (0.46, 0.0), 0.03, 0.2),
        "wide": {
            **within("box", x=(0.42, 0.5), y=(-0.2, 0.2), yaw=(-0.5, 0.5)),
            **within(
                "cube",
                gap=(0.055, 0.075),
                y=(-0.015, 0.015),
                yaw=(-0.25, 0.25),
                side=(0.036, 0.046),
                mass=(0.05, 0.2),
                friction=(0.2, 0.5),
            ),
            **within("mark", x=(OPENING + 0.13, OPENING + 0.19), y=(-0.1, 0.1)),
        },
    }
    camera = Camera(position=(1.05, -0.85, 0.6), target=(0.52, 0.0, 0.1))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        pose = draw.pose("box", (0.46, 0.0, 0.0))
        side = draw("cube.side", 0.04)
        x = draw("cube.gap", 0.065) - LENGTH / 2
        y = draw("cube.y", 0.0)
        lies = pose @ Pose.xyz_rpy(
            (x, y, MAT + side / 2), (0.0, 0.0, draw("cube.yaw", 0.0))
        )
        cube = Body.of(
            "cube",
            Box((side, side, side)),
            tuple(lies.position),
            mass=draw("cube.mass", 0.1),
            color=RED,
            rpy=tuple(lies.rpy),
            friction=draw("cube.friction", 0.35),
        )
        there = pose @ Pose.xyz_rpy(
            (draw("mark.x", OPENING + 0.16), draw("mark.y", 0.08), MAT)
        )
        mark = replace(Body.mark("mark", (0.0, 0.0, 0.0), TOLERANCE, GREEN), pose=there)
        return Scene((floor(), table(), garage(pose), mark, cube))

    def reward(self, start: State, end: State) -> Array:
        """Up to 0.3 on the way out of the box, then up to 1 near the mark for a cube that lies there at rest."""
        back = end.quaternion("box") * [1.0, -1.0, -1.0, -1.0]
        cube, begin, mark = (
            rotate(back, at - end.position("box"))
            for at in (
                end.position("cube"),
                start.position("cube"),
                end.position("mark"),
            )
        )
        left = np.maximum(length((cube - mark)[..., :2]) - TOLERANCE, 0.0)
        lies = np.abs(end.position("cube") - start.position("cube"))[..., 2] < RAISED
        lies &= speed(end, "cube") < STILL_M_S
        beyond = 0.3 + 0.7 * progress(left, NEAR) * lies
        inside = 0.3 * share((cube - begin)[..., 0] / (OUT - begin[..., 0]))
        return np.where(cube[..., 0] > OUT, beyond, inside) * (cube[..., 2] > 0.0)
