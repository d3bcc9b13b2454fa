import numpy as np

from core.geometry import Array
from core.goals import Placed, Turned
from core.interfaces import Task
from core.scene import (
    Body,
    Box,
    Camera,
    Cylinder,
    Geom,
    Pose,
    Scene,
    State,
    floor,
    table,
)
from core.values.layouts import around, within
from tasks.assets import raised
from tasks.rewards import apart, speed, z_axis

RADIUS = 0.08
TOP = 0.016  # of the board, above the table
# Its width, and its height above the board.
STRIP = 0.01
STRIP_HEIGHT = 0.006
NEAR_EDGE = -0.14  # of the board, from the middle of the strip
FAR_EDGE = 0.32
WIDTH = 0.34
TOLERANCE = 0.015  # of the disc's middle, m
TILT = 15.0  # of its axis, degrees
RAISED = 0.005  # m; a disc that is higher than it lay is held, or leans

WOOD = (0.76, 0.56, 0.36, 1.0)
DARK = (0.34, 0.24, 0.16, 1.0)
BLUE = (0.20, 0.38, 0.70, 1.0)
RED = (0.78, 0.22, 0.18, 1.0)
GREEN = (0.25, 0.62, 0.35, 1.0)


def board(pose: Pose) -> Body:
    """A fixed board with a strip across it; its frame is on the table below the strip."""
    plank = Geom(
        Box((FAR_EDGE - NEAR_EDGE, WIDTH, TOP)),
        Pose.xyz_rpy(((FAR_EDGE + NEAR_EDGE) / 2, 0.0, TOP / 2)),
        WOOD,
    )
    strip = Geom(
        Box((STRIP, WIDTH, STRIP_HEIGHT)), raised(TOP + STRIP_HEIGHT / 2), DARK
    )
    return Body("board", pose, 0.0, (plank, strip), (plank, strip))


def disc(pose: Pose, thickness: float, mass: float, friction: float) -> Body:
    """A stone disc, blue above and red below."""
    halves = (
        Geom(Cylinder(RADIUS, thickness / 2), raised(side * thickness / 4), color)
        for side, color in ((1, BLUE), (-1, RED))
    )
    return Body(
        "disc",
        pose,
        mass,
        tuple(halves),
        (Geom(Cylinder(RADIUS, thickness)),),
        friction,
    )


class TurnDisc(Task):
    """Turn a stone disc upside down over a strip, and push it onto a mark.

    Task: the disc must end upside down, with its middle on the mark.
    Layouts: in ``near`` the board moves and turns a little, with all that is on it; in ``wide`` it lies anywhere in
    front of the robot, turned, the disc lies elsewhere before the strip, the mark elsewhere behind it, and the disc is
    thinner or thicker, lighter or heavier, smoother or rougher.
    Success: the disc's axis points down within 15 degrees, its middle is within 1.5 cm of the mark, and it rests.
    """

    name = "TurnDisc"
    description = (
        "A board of 16 mm height is fixed on the table, with a strip across it, 6 mm high and 10 mm wide. On the "
        "side toward the robot a stone disc of 0.16 m diameter, 14 to 20 mm thick and 0.3 to 0.6 kg heavy, lies on "
        "the board: its far rim is next to the strip, its near rim sticks out 26 to 33 mm over the board's edge. "
        "Beyond the strip is a green mark. Turn the disc upside down, so that its red side is on top, and leave it "
        f"at rest on the mark: its axis within {TILT:g} degrees of straight down, its middle within "
        f"{100 * TOLERANCE:g} cm of the mark's."
    )
    in_words = (
        "A board is fixed on the table, with a low strip across it. On the side toward the robot a flat stone disc "
        "lies on the board: its far rim is next to the strip, its near rim sticks out over the board's edge. Beyond "
        "the strip is a green mark. Turn the disc upside down, so that its red side is on top, and leave it at rest on "
        "the mark: its axis within 15 degrees of straight down, its middle within 1.5 cm of the mark's."
    )
    goals = (
        Placed(
            bodies=("disc",),
            at="mark",
            place=(0.0, 0.0, None),
            tolerance=TOLERANCE,
            also=(
                Turned(
                    axis=(0.0, 0.0, 1.0),
                    points=(0.0, 0.0, -1.0),
                    at="mark",
                    tolerance_deg=TILT,
                ),
            ),
            rest=True,
        ),
    )
    variations = {
        "near": around("board", (0.55, 0.0), 0.03, 0.2),
        "wide": {
            **within("board", x=(0.52, 0.62), y=(-0.15, 0.15), yaw=(-0.4, 0.4)),
            "gap": (0.001, 0.008),
            **within(
                "disc",
                y=(-0.05, 0.05),
                thickness=(0.014, 0.02),
                mass=(0.3, 0.6),
                friction=(0.35, 0.7),
            ),
            **within("mark", x=(0.13, 0.2), y=(-0.03, 0.03)),
        },
    }
    camera = Camera(position=(1.15, -0.75, 0.6), target=(0.48, 0.0, 0.08))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        pose = draw.pose("board", (0.55, 0.0, 0.0))
        thickness = draw("disc.thickness", 0.016)
        x = -STRIP / 2 - draw("gap", 0.004) - RADIUS
        y = draw("disc.y", 0.0)
        lies = pose @ Pose.xyz_rpy((x, y, TOP + thickness / 2))
        stone = disc(
            lies, thickness, draw("disc.mass", 0.45), draw("disc.friction", 0.5)
        )
        there = pose.apply((draw("mark.x", 0.16), y + draw("mark.y", 0.0), TOP))
        return Scene(
            (
                floor(),
                table(),
                board(pose),
                Body.mark("mark", there, 0.03, GREEN),
                stone,
            )
        )

    def reward(self, start: State, end: State) -> Array:
        """0.1 for a disc on its rim or held, 1 for one that lies upside down; less away from the mark, or in motion."""
        axis = z_axis(end, "disc")
        angle = np.degrees(np.arccos(np.clip(axis[..., 2], -1.0, 1.0)))
        turned = np.interp(angle, (20, 90, 180 - TILT), (0.0, 0.1, 1.0))
        lies = np.abs(end.position("disc") - start.position("disc"))[..., 2] < RAISED
        turned = np.where(lies, turned, np.minimum(turned, 0.1))
        away = apart(end, "disc", "mark")
        near = np.interp(away, (TOLERANCE, 0.05, 0.2), (1.0, 0.5, 0.1))
        return turned * near * np.interp(speed(end, "disc"), (0.02, 0.1), (1.0, 0.0))
