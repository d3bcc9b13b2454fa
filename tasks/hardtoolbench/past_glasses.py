import numpy as np

from core.geometry import Array
from core.goals import Kept, Placed, Untouched, goals_reward
from core.interfaces import Task
from core.scene import (
    Body,
    Camera,
    Color,
    Cylinder,
    Geom,
    Pose,
    Scene,
    State,
    Trace,
    floor,
    table,
)
from core.values.layouts import around, within
from tasks.assets import board, revolved
from tasks.rewards import moved, share

# Place (x, y) of the middle of the cupboard's front edge; its x axis points inward.
FRONT = (0.67, 0.0)
# Inside; the roof's lower face is at the clear height.
DEPTH = 0.3
WIDTH = 0.52
CLEAR = 0.24
WALL = 0.014
GLASS_RADIUS = 0.024
GLASS_HEIGHT = 0.16
TIN_RADIUS = 0.0425
TIN_HEIGHT = 0.1
GATE = 0.152  # between the middles of the two glasses in front of the tin
ROW_X = 0.06  # where their row stands
GLASSES = tuple(f"glass_{i}" for i in range(1, 7))
NUDGED_M = 0.005  # a glass that the tin moves less counts as left alone
SHOVED_M = 0.03  # from here on nothing is earned

OAK: Color = (0.62, 0.44, 0.27, 1.0)
PANE: Color = (0.75, 0.86, 0.90, 0.18)
GLASS: Color = (0.45, 0.72, 0.85, 0.55)


def cupboard(pose: Pose) -> Body:
    """Two sides and a back of oak and a glass roof, open toward the robot."""
    height = CLEAR + WALL
    side = (WIDTH + WALL) / 2
    walls = (
        *(
            board((DEPTH, WALL, height), (DEPTH / 2, sign * side, height / 2), OAK)
            for sign in (-1, 1)
        ),
        board(
            (WALL, WIDTH + 2 * WALL, height), (DEPTH + WALL / 2, 0.0, height / 2), OAK
        ),
        board((DEPTH, WIDTH, WALL), (DEPTH / 2, 0.0, CLEAR + WALL / 2), PANE),
    )
    return Body("cupboard", pose, 0.0, walls, walls)


def glass(name: str, pose: Pose) -> Body:
    half = GLASS_HEIGHT / 2
    inside = GLASS_RADIUS - 0.002
    outline = [
        (0, -half),
        (GLASS_RADIUS, -half),
        (GLASS_RADIUS, half),
        (inside, half),
        (inside, 0.012 - half),
    ]
    looks = (revolved([*outline, (0, 0.012 - half)], GLASS, 40),)
    return Body(
        name,
        pose,
        0.12,
        looks,
        (Geom(Cylinder(GLASS_RADIUS, GLASS_HEIGHT)),),
        friction=0.4,
    )


class PastGlasses(Task):
    """Fetch a tin from a low cupboard, past slender glasses that the robot must not touch.

    Task: bring the tin onto the mark in front of the cupboard, and touch no glass.
    Layouts: in ``near`` the cupboard moves and turns a little with all that is in it; in ``wide`` it stands anywhere in
    front of the robot, all glasses, the tin and the mark stand elsewhere, and the tin's size, mass and friction differ.
    Success: the tin at rest within 12 mm of the mark, no glass touched by the robot or pushed by the tin.
    """

    name = "PastGlasses"
    description = (
        "A low cupboard stands on the table, open toward the robot: 0.52 m wide, 0.3 m deep, with a glass roof 0.24 m "
        "above the table; its x axis points inward from the middle of its front edge. In it stand six slender drinking "
        "glasses, 0.16 m high and 0.048 m in diameter, four of them in a row at the front edge. Behind the middle two "
        "of that row, glass_2 and glass_3, between glass_5 and glass_6, stands a red tin, 0.1 m high and about 0.085 m "
        "in diameter, too wide for the gripper; the space between glass_2 and glass_3 is 12 to 26 mm wider than the "
        "tin. Bring the tin out between them onto the blue mark in front of the cupboard, where it must be upright and "
        "at rest. The robot and its tool must not touch any glass, and the tin must not push one."
    )
    in_words = (
        "A low cupboard with a glass roof stands on the table, open toward the robot. In it stand six slender drinking "
        "glasses, four of them, glass_1 to glass_4, in a row at the front edge. Behind the middle two of that row, "
        "between glass_5 and glass_6, stands a red tin, too wide for the gripper; it fits between glass_2 and glass_3 "
        "with little room. Bring the tin out between them onto the blue mark in front of the cupboard, where it must "
        "be upright and at rest. The robot and its tool must not touch any glass, and the tin must not push one."
    )
    goals = (
        Placed(
            bodies=("tin",),
            place=(0.0, 0.0, None),
            at="mark",
            tolerance=0.012,
            rest=True,
        ),
        Untouched(GLASSES),
        Kept(GLASSES, rounds=GLASSES),
    )
    variations = {
        "near": around("cupboard", FRONT, 0.03, 0.15),
        "wide": {
            **within("cupboard", x=(0.64, 0.7), y=(-0.15, 0.15), yaw=(-0.25, 0.25)),
            **within("gate", y=(-0.04, 0.04), width=(0.147, 0.157)),
            **within(
                "tin",
                x=(0.175, 0.195),
                y=(-0.03, 0.03),
                radius=(0.0415, 0.0435),
                mass=(0.15, 0.5),
                friction=(0.3, 0.6),
            ),
            **within("mark", x=(-0.125, -0.1), y=(-0.04, 0.04)),
            **{f"{name}.{axis}": (-0.01, 0.01) for name in GLASSES for axis in "xy"},
        },
    }
    home = Pose(np.array([0.32, 0.0, 0.5]))
    camera = Camera(position=(0.1, -0.62, 0.75), target=(0.62, 0.02, 0.06))

    def scene(self, seed: int) -> Scene:
        """All places but the cupboard's are in its frame; those in ``y`` are from the middle of the gate or the tin."""
        draw = self.draw(seed)
        frame = draw.pose("cupboard", (*FRONT, 0.0))
        gate = draw("gate.y", 0.0)
        half = draw("gate.width", GATE) / 2
        tin_x = draw("tin.x", 0.185)
        tin_y = gate + draw("tin.y", 0.0)
        radius = draw("tin.radius", TIN_RADIUS)
        row = [
            (ROW_X, gate + side * (half + out))
            for out, side in ((0.085, 1), (0.0, 1), (0.0, -1), (0.085, -1))
        ]
        beside = [(0.21, tin_y + side * 0.115) for side in (1, -1)]
        glasses = []
        for name, (x, y) in zip(GLASSES, [*row, *beside], strict=True):
            inner = name in GLASSES[1:3]  # the gate's own width is drawn above
            place = (
                x + draw(f"{name}.x", 0.0),
                y + draw(f"{name}.y", 0.0) * (not inner),
                GLASS_HEIGHT / 2,
            )
            glasses.append(glass(name, frame @ Pose.xyz_rpy(place)))
        look = (Geom(Cylinder(radius, TIN_HEIGHT), color=(0.80, 0.20, 0.17, 1.0)),)
        stands = frame @ Pose.xyz_rpy((tin_x, tin_y, TIN_HEIGHT / 2))
        tin = Body(
            "tin", stands, draw("tin.mass", 0.3), look, look, draw("tin.friction", 0.4)
        )
        there = frame.apply([draw("mark.x", -0.11), gate + draw("mark.y", 0.0), 0.0])
        mark = Body.mark("mark", there, 0.05, (0.16, 0.36, 0.76, 1.0))
        return Scene((floor(), table(), mark, cupboard(frame), *glasses, tin))

    def reward(self, start: State, end: State, trace: Trace | None = None) -> Array:
        """The share of the tin's way to the mark; nothing once the robot touches a glass, less if the tin moves one."""
        shifts = [moved(start, end, name) for name in GLASSES]
        left = share((SHOVED_M - np.max(shifts, axis=0)) / (SHOVED_M - NUDGED_M))
        upright = np.abs(end.position("tin")[..., 2] - TIN_HEIGHT / 2) < 0.005
        return goals_reward(self, start, end, trace) * left * upright
