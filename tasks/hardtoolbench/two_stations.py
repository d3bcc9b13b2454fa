import numpy as np

from core.geometry import Array
from core.goals import JointAt, goals_reward
from core.interfaces import Task
from core.scene import (
    Body,
    Camera,
    Cylinder,
    Geom,
    Joint,
    Pose,
    Scene,
    State,
    floor,
    table,
)
from core.values.layouts import around, within
from tasks.assets import board, raised

# Inside:
TUBE_WIDTH = 0.024
TUBE_HEIGHT = 0.03
TUBE_LENGTH = 0.16
WALL = 0.006
# Of the button's way, m.
PRESSED = 0.025
STOP = 0.03
# Inside:
BAY_WIDTH = 0.11
BAY_HEIGHT = 0.095
BAY_LENGTH = 0.22
# X and height of the handle; behind it; thickness.
HANDLE = 0.09
TOP = 0.05
GAP = 0.024
BAR = 0.012
# Of the drawer's way, m.
PULLED = 0.08
END = 0.1

STEEL = (0.48, 0.50, 0.54, 1.0)
GLASS = (0.62, 0.80, 0.86, 0.35)
WOOD = (0.66, 0.47, 0.29, 1.0)
RED = (0.80, 0.20, 0.17, 1.0)
BLUE = (0.20, 0.38, 0.70, 1.0)


def tube(mouth: Pose) -> Body:
    """A fixed square tube along x on a post; its frame is in the middle of its mouth."""
    z = float(mouth.position[2])
    wide = TUBE_WIDTH + 2 * WALL
    high = (TUBE_HEIGHT + WALL) / 2
    parts = (
        board((TUBE_LENGTH, wide, WALL), (TUBE_LENGTH / 2, 0.0, -high), STEEL),
        board((TUBE_LENGTH, wide, WALL), (TUBE_LENGTH / 2, 0.0, high), STEEL),
        *(
            board(
                (TUBE_LENGTH, WALL, TUBE_HEIGHT),
                (TUBE_LENGTH / 2, side * (TUBE_WIDTH + WALL) / 2, 0.0),
                color,
            )
            for side, color in ((-1, GLASS), (1, STEEL))
        ),
        board(
            (0.06, 0.03, z - high - WALL / 2),
            (TUBE_LENGTH - 0.03, 0.0, -(z + high + WALL / 2) / 2),
            WOOD,
        ),
    )
    return Body("tube", mouth, 0.0, parts, parts)


def cabinet(pose: Pose) -> Body:
    """Two fixed walls and a canopy over the drawer and its handle; its frame is on the table, below the front edge."""
    walls = (
        board(
            (BAY_LENGTH, 0.01, BAY_HEIGHT),
            (BAY_LENGTH / 2, side * (BAY_WIDTH + 0.01) / 2, BAY_HEIGHT / 2),
            color,
        )
        for side, color in ((-1, GLASS), (1, WOOD))
    )
    parts = (
        *walls,
        board(
            (BAY_LENGTH, BAY_WIDTH + 0.02, 0.01),
            (BAY_LENGTH / 2, 0.0, BAY_HEIGHT + 0.005),
            GLASS,
        ),
    )
    return Body("cabinet", pose, 0.0, parts, parts)


def drawer(pose: Pose, mass: float) -> Body:
    """A block with two arms below the roller; its frame is on top of the roller, in its middle."""
    # Nothing gets between it and the canopy.
    front = BAR / 2 + GAP
    height = BAY_HEIGHT - 0.007
    parts = (
        *(
            board((front, 0.008, 0.02), (front / 2, side * 0.03, -BAR - 0.012), BLUE)
            for side in (-1, 1)
        ),
        board((0.09, 0.1, height), (front + 0.045, 0.0, height / 2 + 0.003 - TOP), RED),
    )
    return Body("drawer", pose, mass, parts, parts)


def roller(drawer: Pose) -> Body:
    """The handle, which turns freely, so that friction on top of it pulls nothing."""
    shape = Geom(
        Cylinder(BAR / 2, 0.1),
        Pose.xyz_rpy((0.0, 0.0, 0.0), (np.pi / 2, 0.0, 0.0)),
        BLUE,
    )
    return Body("roller", drawer @ raised(-BAR / 2), 0.05, (shape,), (shape,))


class TwoStations(Task):
    """Press a button deep in a narrow tube, and pull a drawer by a handle below a canopy.

    Task: one tool and one plan must do both.
    Layouts: in ``near`` tube and cabinet move and turn a little; in ``wide`` they stand anywhere on their side, turned,
    the tube is lower or higher, the button is deeper or less deep in it, and both are harder or easier to move.
    Success: the button is pressed by 25 mm, the drawer pulled by 80 mm; each counts by half.
    """

    name = "TwoStations"
    description = (
        "At the robot's left a square tube is fixed on a post, 24 mm wide and 30 mm high inside; its frame is in its "
        "mouth, its axis along x of the frame, away from the robot. A button is 60 to 90 mm deep in it; its frame is "
        f"in the middle of its face. Press it in by {1000 * PRESSED:g} mm: it stays. At the robot's right stands a "
        "cabinet. The handle of its drawer is a roller that turns freely, 12 mm thick and 100 mm long along y, 24 mm "
        "in front of the drawer; the drawer's frame is on top of the roller, in its middle, 50 mm above the table. The "
        "roller's axis is 90 mm behind the front edge of the cabinet's walls, which are 110 mm apart, and of its "
        f"canopy, 95 mm above the table. Pull the drawer by {1000 * PULLED:g} mm toward the robot, along -x of its "
        "frame. Each needs 3 to 8 N. One tool must do both."
    )
    in_words = (
        "At the robot's left a square tube is fixed on a post; its axis is along x of its frame, away from the robot. "
        "A button is deep in it. Press it in by 25 mm: it stays. At the robot's right stands a cabinet with a canopy. "
        "The handle of its drawer is a roller that turns freely, in front of the drawer, deep between the cabinet's "
        "walls. Pull the drawer by 80 mm toward the robot, along -x of its frame. Each needs a few newtons. One tool "
        "must do both."
    )
    goals = (
        JointAt(joint="button", to=STOP, tolerance=STOP - PRESSED, name="pressed"),
        JointAt(joint="drawer", to=END, tolerance=END - PULLED, name="pulled"),
    )
    every = True
    variations = {
        "near": {
            **around("tube", (0.56, 0.2), 0.03, 0.2),
            **around("cabinet", (0.54, -0.2), 0.03, 0.2),
        },
        "wide": {
            **within(
                "tube",
                x=(0.5, 0.64),
                y=(0.12, 0.28),
                yaw=(-0.3, 0.45),
                height=(0.12, 0.24),
            ),
            **within("button", depth=(0.06, 0.09), friction=(3.0, 8.0)),
            **within("cabinet", x=(0.5, 0.6), y=(-0.28, -0.14), yaw=(-0.45, 0.3)),
            **within("drawer", friction=(3.0, 8.0), mass=(0.3, 0.8)),
        },
    }
    camera = Camera(position=(0.12, -0.72, 0.55), target=(0.57, 0.02, 0.12))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        mouth = draw.pose("tube", (0.56, 0.2, 0.0)) @ raised(draw("tube.height", 0.18))
        stands = draw.pose("cabinet", (0.54, -0.2, 0.0))
        depth = draw("button.depth", 0.075)
        mass = draw("drawer.mass", 0.5)
        stiff = draw("button.friction", 5.0)
        heavy = draw("drawer.friction", 5.0)
        face = board((0.03, 0.022, 0.028), (0.015, 0.0, 0.0), RED)
        button = Body(
            "button", mouth @ Pose.xyz_rpy((depth, 0.0, 0.0)), 0.03, (face,), (face,)
        )
        drawn = drawer(stands @ Pose.xyz_rpy((HANDLE, 0.0, TOP)), mass)
        forward = (1.0, 0.0, 0.0)
        back = (-1.0, 0.0, 0.0)
        joints = (
            Joint(
                "button",
                "slider",
                "button",
                "tube",
                forward,
                upper=STOP,
                lower=0.0,
                damping=5.0,
                friction=stiff,
            ),
            Joint(
                "drawer",
                "slider",
                "drawer",
                "cabinet",
                back,
                upper=END,
                lower=0.0,
                damping=5.0,
                friction=heavy,
            ),
            Joint("roller", "hinge", "roller", "drawer", (0.0, 1.0, 0.0), damping=1e-4),
        )
        return Scene(
            (
                floor(),
                table(),
                tube(mouth),
                button,
                cabinet(stands),
                drawn,
                roller(drawn.pose),
            ),
            joints,
        )

    def reward(self, start: State, end: State) -> Array:
        """Half for each: the share of the way of the button, and of the drawer."""
        return goals_reward(self, start, end)
