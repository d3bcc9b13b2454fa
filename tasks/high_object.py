import numpy as np

from core.geometry import Array
from core.goals import Placed
from core.interfaces import Task
from core.scene import (
    Body,
    Box,
    Camera,
    Margin,
    Pose,
    Scene,
    State,
    Trace,
    floor,
)
from core.values.layouts import around, within
from tasks.assets import board, open_box
from tasks.rewards import progress

SIDE = 0.05
START = (1.2, 0.0)  # x, y

SHELF_X = 1.3
SHELF_DEPTH = 0.4
SHELF_WIDTH = 1.2
BOARD = 0.03
# Of the boards' middles; the upper board's top face is at z = 0.9.
BOARD_HEIGHTS = (0.435, 0.885)
SHELF_TOP = 0.9

BIN_CENTER = (0.8, 0.0, 0.05)
# Along x, y, z.
BIN_LENGTH = 0.38
BIN_WIDTH = 1.2
BIN_HEIGHT = 0.1
BIN_WALL = 0.015
OFF_THE_SHELF = (
    0.85  # below this height above the shelf's frame the cube has left the upper board
)


def shelf(height: float) -> Body:
    """Two boards on four posts; ``height`` is that of its frame above the ground."""
    wood = (0.72, 0.53, 0.34, 1.0)
    dark = (0.45, 0.32, 0.21, 1.0)
    boards = tuple(
        board((SHELF_DEPTH, SHELF_WIDTH, BOARD), (0.0, 0.0, height), wood)
        for height in BOARD_HEIGHTS
    )
    x = SHELF_DEPTH / 2 - 0.02
    y = SHELF_WIDTH / 2 + 0.02
    corners = ((-x, -y), (-x, y), (x, -y), (x, y))
    posts = tuple(
        board((0.04, 0.04, SHELF_TOP), (*corner, SHELF_TOP / 2), dark)
        for corner in corners
    )
    return Body(
        "shelf",
        Pose.xyz_rpy((SHELF_X, 0.0, height)),
        0.0,
        boards + posts,
        boards + posts,
    )


class HighObject(Task):
    """Bring a cube from a shelf, out of reach, into the bin in front of the shelf.

    Task: get the cube off the shelf and into the bin.
    Layouts: in ``near`` the cube and the bin move a little; in ``wide`` the cube lies anywhere on the shelf's front
    half, turned, larger or smaller, lighter or heavier, the shelf is lower, and the bin moves.
    Success: the cube in the bin.
    """

    name = "HighObject"
    description = (
        "A green cube with a side of 0.05 m lies on the upper board of a shelf, 0.9 m high and 1.2 m in front of the "
        "robot; the board's front edge is at x = 1.1 m. Between the robot and the shelf an open bin, 0.38 m deep (x), "
        "1.2 m wide (y) and 0.1 m high, stands on the floor, its centre 0.8 m in front of the robot. Bring the cube "
        "into the bin. There is no table: the robot stands on the floor."
    )
    in_words = (
        "A green cube lies on the upper board of a shelf in front of the robot. Between the robot and the shelf an "
        "open bin stands on the floor. Bring the cube into the bin. There is no table: the robot stands on the floor."
    )
    success_reward = 0.95  # the paper's goals have no tolerance
    goals = (
        Placed(
            bodies=("cube",), place=(0.0, 0.0, BIN_CENTER[2]), tolerance=0.05, at="bin"
        ),
    )
    variations = {
        "near": {**around("cube", START, 0.03, 0.3), **around("bin", BIN_CENTER, 0.02)},
        "wide": {
            **within(
                "cube",
                x=(1.15, 1.28),
                y=(-0.3, 0.3),
                yaw=(-np.pi / 4, np.pi / 4),
                side=(0.04, 0.06),
                mass=(0.05, 0.2),
            ),
            "shelf.z": (-0.1, 0.0),
            "bin.x": (0.74, 0.82),
        },
    }
    camera = Camera(position=(0.5, -1.95, 1.25), target=(0.72, 0.0, 0.5))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        side = draw("cube.side", SIDE)
        height = draw("shelf.z", 0.0)
        cube = Body.of(
            "cube",
            Box((side, side, side)),
            draw.position("cube", (*START, height + SHELF_TOP + side / 2)),
            rpy=(0.0, 0.0, draw("cube.yaw", 0.0)),
            mass=draw("cube.mass", 0.1),
            color=(0.18, 0.62, 0.27, 1.0),
        )
        walls = open_box(
            BIN_LENGTH, BIN_WIDTH, BIN_HEIGHT, BIN_WALL, (0.33, 0.47, 0.66, 1.0)
        )
        the_bin = Body(
            "bin",
            draw.pose("bin", (BIN_CENTER[0], BIN_CENTER[1], 0.0)),
            0.0,
            walls,
            walls,
        )
        return Scene((floor(0.0), shelf(height), the_bin, cube))

    def margins(
        self, start: State, end: State, trace: Trace | None = None
    ) -> list[Margin]:
        center = start.position("bin") + np.array([0.0, 0.0, BIN_CENTER[2]])
        offset = np.abs(end.position("cube") - center)
        limits = BIN_LENGTH / 2 - BIN_WALL, BIN_WIDTH / 2 - BIN_WALL, BIN_HEIGHT / 2
        return [
            Margin.at_most(f"cube off the bin's middle, along {axis}", off, most, "m")
            for axis, off, most in zip("xyz", offset, limits, strict=True)
        ]

    def reward(self, start: State, end: State) -> Array:
        """1 in the bin; otherwise the fraction of the way to its centre (sum of absolute differences), plus 0.2 for a
        cube that has left the shelf's upper board.
        """
        cube = end.position("cube")
        center = start.position("bin") + np.array([0.0, 0.0, BIN_CENTER[2]])
        offset = np.abs(cube - center)
        inside = (
            offset
            < np.array(
                [BIN_LENGTH / 2 - BIN_WALL, BIN_WIDTH / 2 - BIN_WALL, BIN_HEIGHT / 2]
            )
        ).all(axis=-1)
        way = progress(
            offset.sum(axis=-1), np.abs(start.position("cube") - center).sum(axis=-1)
        )
        near = np.minimum(
            way
            + 0.2 * (cube[..., 2] < start.position("shelf")[..., 2] + OFF_THE_SHELF),
            1.0,
        )
        return np.where(inside, 1.0, near)
