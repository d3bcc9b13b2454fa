import numpy as np

from core.geometry import Array, Pose
from core.goals import Placed
from core.interfaces import Task
from core.scene import Body, Box, Camera, Color, Geom, Scene, State, floor, table
from core.values.layouts import around, within
from tasks.rewards import share

SIDE = 0.07
WALL = 0.01
HEIGHT = (
    0.13  # of the pipe, outside; inside it is 0.11 high, and the main run is 0.11 wide
)
# Main run along x: open at NEAR, closed at FAR.
NEAR = 0.9
FAR = 1.3
# Outer faces of its side walls, along y.
RIGHT = 0.08
LEFT = 0.21
BRANCH_X = 1.19  # the side branch is 0.1 wide inside, from here to the inner face of the closed end,
BRANCH_Y = 0.01  # and 0.07 long, from the main run toward -y: open here
CUBE = (1.24, 0.15, WALL + SIDE / 2)

CLEAR: Color = (0.93, 0.95, 0.98, 0.35)
WHITE: Color = (0.97, 0.97, 0.98, 1.0)
Range = tuple[float, float]


def board(x: Range, y: Range, z: Range, color: Color = CLEAR) -> Geom:
    """A board of the pipe, between two coordinates along each axis of the world."""
    low, high = np.transpose([x, y, z])
    a, b, c = high - low
    return Geom(Box((a, b, c)), Pose((low + high) / 2), color)


def rims() -> tuple[Geom, ...]:
    """Visual white edges around the two openings, which stand out by a millimetre."""
    rim = (-0.001, 0.004)
    near = (NEAR + rim[0], NEAR + rim[1])
    aside = (BRANCH_Y + rim[0], BRANCH_Y + rim[1])
    wide = (RIGHT, LEFT)
    high = (0.0, HEIGHT + 0.001)
    branch = (BRANCH_X - WALL, FAR)
    bottom = (0.0, WALL)
    top = (HEIGHT - WALL, HEIGHT + 0.001)
    return (
        *(board(near, wide, z, WHITE) for z in (bottom, top)),
        *(
            board(near, y, high, WHITE)
            for y in ((RIGHT, RIGHT + WALL), (LEFT - WALL, LEFT))
        ),
        *(board(branch, aside, z, WHITE) for z in (bottom, top)),
        *(
            board(x, aside, high, WHITE)
            for x in ((BRANCH_X - WALL, BRANCH_X), (FAR - WALL, FAR))
        ),
    )


def pipe(pose: Pose) -> Body:
    """The pipe: eight fixed boards, and rims around both openings. Its frame is the world's where it usually stands."""
    bottom = (0.0, WALL)
    top = (HEIGHT - WALL, HEIGHT)
    inside = (WALL, HEIGHT - WALL)
    boards = (
        board((NEAR, FAR), (RIGHT, LEFT), bottom),
        board((NEAR, FAR), (RIGHT, LEFT), top),
        board((NEAR, FAR), (LEFT - WALL, LEFT), inside),
        board((NEAR, BRANCH_X), (RIGHT, RIGHT + WALL), inside),
        board(
            (FAR - WALL, FAR), (BRANCH_Y, LEFT - WALL), inside
        ),  # the closed end, on to the branch's far wall
        board((BRANCH_X - WALL, FAR), (BRANCH_Y, RIGHT), bottom),
        board((BRANCH_X - WALL, FAR), (BRANCH_Y, RIGHT), top),
        board((BRANCH_X - WALL, BRANCH_X), (BRANCH_Y, RIGHT), inside),
    )
    return Body("pipe", pose, 0.0, (*boards, *rims()), boards)


class DislodgeCube(Task):
    """Get a cube out of the far end of a bent pipe, which is open toward the robot and to the side.

    Task: push or pull the cube through either opening.
    Layouts: in ``near`` the pipe moves a little; in ``wide`` it moves farther and turns about the robot, and the cube
    in it is smaller or larger, lighter or heavier, and lies nearer to the end or farther from it.
    Success: the cube almost halfway out.
    """

    name = "DislodgeCube"
    description = (
        "A see-through square pipe, 0.11 m wide and high inside, is fixed on the table in front of the robot and a "
        "little to its left. It runs 0.4 m along x, from an opening toward the robot at x = 0.9 to a closed end at "
        "x = 1.3; next to the closed end a short branch, 0.1 m wide, leads to a second opening on the robot's right, "
        "at y = 0.01. At the far end, where the branch begins, lies a red cube with a side of 0.07 m. Get it out of "
        "the pipe, through either opening, and leave it on the table. The arm starts low above the table, so that "
        "only a tool that lies flat starts clear of it."
    )
    in_words = (
        "A see-through square pipe is fixed on the table in front of the robot. It runs away from the robot, from an "
        "opening toward the robot to a closed end; next to the closed end a short branch leads to a second opening on "
        "the robot's right. At the far end, where the branch begins, lies a red cube. Get it out of the pipe, through "
        "either opening, and leave it on the table. The arm starts low above the table, so that only a tool that lies "
        "flat starts clear of it."
    )
    success_reward = 0.95  # the paper's goals have no tolerance
    goals = (
        Placed(bodies=("cube",), place=(CUBE[0], BRANCH_Y - SIDE / 2, None), at="pipe"),
        Placed(bodies=("cube",), place=(NEAR - SIDE / 2, CUBE[1], None), at="pipe"),
    )
    variations = {
        "near": around("pipe", (0.0, 0.0), 0.03, 0.05),
        "wide": {
            **within("pipe", x=(-0.05, 0.03), y=(-0.1, 0.1), yaw=(-0.2, 0.2)),
            **within(
                "cube",
                x=(CUBE[0] - 0.02, CUBE[0] + 0.005),
                side=(0.055, 0.08),
                mass=(0.1, 0.4),
            ),
        },
    }
    home = Pose(np.array([0.4, 0.0, 0.1]))
    camera = Camera(position=(1.7, -0.95, 0.95), target=(0.68, 0.0, 0.1), fov_deg=50.0)

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        pose = draw.pose("pipe")
        side = draw("cube.side", SIDE)
        place = pose @ Pose.xyz_rpy((draw("cube.x", CUBE[0]), CUBE[1], WALL + side / 2))
        part = (Geom(Box((side, side, side)), color=(0.83, 0.18, 0.16, 1.0)),)
        cube = Body("cube", place, draw("cube.mass", 0.2), part, part)
        return Scene((floor(), table(), pipe(pose), cube))

    def reward(self, start: State, end: State) -> Array:
        """The fraction of the way to an opening, along its axis, for the better of the two openings.

        It is 1 when the cube is halfway out or farther, and 0 for a cube that has fallen off the table.
        """
        began = start.relative("cube", "pipe")
        ended = end.relative("cube", "pipe")
        ahead = 1 - (ended[..., 0] - NEAR) / (began[..., 0] - NEAR)
        aside = 1 - (ended[..., 1] - BRANCH_Y) / (began[..., 1] - BRANCH_Y)
        return np.where(ended[..., 2] > 0, share(np.maximum(ahead, aside)), 0.0)
