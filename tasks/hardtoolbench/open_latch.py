import numpy as np

from core.geometry import Array
from core.goals import JointAt, Kept, limits_margins
from core.interfaces import Task
from core.scene import (
    Body,
    Camera,
    Cylinder,
    Joint,
    Latch,
    Margin,
    Pose,
    Scene,
    State,
    Trace,
    floor,
    table,
)
from core.values.layouts import around, within
from tasks.assets import board
from tasks.rewards import moved, z_axis

# Of the door, and the heights of its lower and upper edge.
WIDTH = 0.21
BOTTOM = 0.014
TOP = 0.186
# Of the cabinet, and its clearance round the door.
DEPTH = 0.2
WALL = 0.012
GAP = 0.002
# The door's layers, from its face.
FRONT = 0.006
CAVITY = 0.016
BACK = 0.004
# Of the slot, and how far the cavity goes up behind its edge.
SLOT_WIDTH = 0.06
SLOT_HEIGHT = 0.014
UNDERCUT = 0.014
OPEN = 0.9  # rad
BEYOND = 0.1  # the goal is so far beyond what counts as open
GLASS_RADIUS = 0.028
GLASS_HEIGHT = 0.11
# A glass that moves less counts as left alone; from the second on nothing is earned.
NUDGED_M = 0.01
SHOVED_M = 0.05

OAK = (0.55, 0.38, 0.24, 1.0)
PINE = (0.80, 0.64, 0.44, 1.0)
BLUE = (0.55, 0.80, 0.90, 0.5)


def cabinet(pose: Pose) -> Body:
    """A fixed cabinet whose walls frame the door; its frame is on the table below the hinge."""
    middle = -WIDTH / 2
    wide = WIDTH + 2 * (GAP + WALL)
    inside = TOP - BOTTOM + 2 * GAP
    parts = (
        *(
            board((DEPTH, wide, WALL), (DEPTH / 2, middle, z), OAK)
            for z in (WALL / 2, TOP + GAP + WALL / 2)
        ),
        *(
            board(
                (DEPTH, WALL, inside),
                (DEPTH / 2, middle + side * (wide - WALL) / 2, (TOP + BOTTOM) / 2),
                OAK,
            )
            for side in (-1, 1)
        ),
        board(
            (WALL, wide - 2 * WALL, inside),
            (DEPTH - WALL / 2, middle, (TOP + BOTTOM) / 2),
            OAK,
        ),
    )
    return Body("cabinet", pose, 0.0, parts, parts)


def door(pose: Pose, mass: float, radius: float, height: float) -> Body:
    """A door with a slot into a cavity that is higher; its frame is in the middle of the slot, at the face."""
    right = radius - WIDTH
    left = radius
    low = BOTTOM - height
    high = TOP - height
    parts = [
        board(
            (BACK, WIDTH, high - low),
            (FRONT + CAVITY + BACK / 2, (left + right) / 2, (low + high) / 2),
            PINE,
        )
    ]
    for at, depth, top in (
        (0.0, FRONT, SLOT_HEIGHT / 2),
        (FRONT, CAVITY, SLOT_HEIGHT / 2 + UNDERCUT),
    ):
        x = at + depth / 2
        half = SLOT_WIDTH / 2
        rows = ((low, -SLOT_HEIGHT / 2), (top, high))
        parts += [
            board((depth, WIDTH, b - a), (x, (left + right) / 2, (a + b) / 2), PINE)
            for a, b in rows
        ]
        sides = ((right, -half), (half, left))
        a = -SLOT_HEIGHT / 2
        b = top
        parts += [
            board((depth, r - q, b - a), (x, (q + r) / 2, (a + b) / 2), PINE)
            for q, r in sides
        ]
    return Body("door", pose, mass, tuple(parts), tuple(parts), friction=0.2)


class OpenLatch(Task):
    """Open a latched door by the slot of its recessed handle, and leave the glass beside it standing.

    Task: open the door of the cabinet by 0.9 rad.
    Layouts: in ``near`` the cabinet moves and turns a little, with the glass; in ``wide`` it stands anywhere before
    the robot, turned, the slot is elsewhere in the door, the glass nearer to the door's way or farther, the latch and
    the hinge are weaker or stronger, and the door is lighter or heavier.
    Success: the door rests at 0.9 rad or more, and the glass moved by 1 cm at most.
    """

    name = "OpenLatch"
    description = (
        "A low cabinet, 0.24 m wide and 0.2 m high, is fixed on the table with its door toward the robot, flush with "
        "its walls. The door turns about a vertical hinge at its left edge, and has no handle but a slot in its "
        "face, 0.15 to 0.17 m from the hinge, 60 mm wide and 14 mm high, too low for a finger; the door's frame is "
        "in its middle. Behind the face of 6 mm is a cavity, 16 mm deep, that goes 14 mm higher than the slot. A "
        f"latch holds the door shut with 6 to 10 N m. Open the door by at least {OPEN:g} rad. A glass stands where the "
        "door would be at 1.55 to 1.75 rad; leave it there."
    )
    in_words = (
        "A low cabinet is fixed on the table with its door toward the robot, flush with its walls. The door turns "
        "about a vertical hinge at its left edge, and has no handle but a slot in its face, too low for a finger. "
        "Behind the face is a cavity that goes higher than the slot. A latch holds the door shut. Open the door by at "
        "least 0.9 rad. A glass stands where the door would be if it were opened much wider; leave it there."
    )
    goals = (
        JointAt(
            joint="hinge",
            to=OPEN + BEYOND,
            tolerance=BEYOND,
            rest=True,
        ),
        Kept(("glass",), kept_m=NUDGED_M, rounds=("glass",)),
    )
    variations = {
        "near": around("cabinet", (0.64, 0.0), 0.03, 0.15),
        "wide": {
            **within("cabinet", x=(0.58, 0.68), y=(-0.15, 0.15), yaw=(-0.35, 0.35)),
            **within("slot", radius=(0.15, 0.17), z=(0.1, 0.13)),
            "glass.angle": (1.55, 1.75),
            "latch.force": (6.0, 10.0),
            "hinge.friction": (0.05, 0.3),
            "door.mass": (0.7, 1.4),
        },
    }
    camera = Camera(position=(0.12, -0.6, 0.5), target=(0.56, 0.06, 0.1))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        pose = draw.pose("cabinet", (0.64, 0.0, 0.0)) @ Pose.xyz_rpy(
            (0.0, WIDTH / 2, 0.0)
        )
        radius = draw("slot.radius", 0.16)
        height = draw("slot.z", 0.115)
        angle = draw("glass.angle", 1.65)
        leaf = door(
            pose @ Pose.xyz_rpy((0.0, -radius, height)),
            draw("door.mass", 1.0),
            radius,
            height,
        )
        stands = pose.apply(
            (-0.19 * np.sin(angle), -0.19 * np.cos(angle), GLASS_HEIGHT / 2 + 1e-4)
        )
        glass = Body.of(
            "glass", Cylinder(GLASS_RADIUS, GLASS_HEIGHT), stands, mass=0.15, color=BLUE
        )
        hinge = Joint(
            "hinge",
            "hinge",
            "door",
            parent="cabinet",
            axis=(0.0, 0.0, -1.0),
            origin=(0.0, radius, 0.0),
            lower=0.0,
            upper=2.0,
            damping=0.1,
            friction=draw("hinge.friction", 0.15),
            latches=(Latch(at=0.0, force=draw("latch.force", 8.0), width=0.08),),
        )
        return Scene((floor(), table(), cabinet(pose), leaf, glass), (hinge,))

    def reward(self, start: State, end: State) -> Array:
        """The share of the angle; less for a glass that moved or tilts, and for a door in motion."""
        hinge = end.joint("hinge")
        still = np.interp(np.abs(hinge.speed), (0.1, 0.5), (1.0, 0.0))
        shift = moved(start, end, "glass")
        upright = z_axis(end, "glass")[..., 2] > 0.98
        opened = np.interp(hinge.position, (0.08, OPEN), (0.0, 1.0))
        return (
            opened
            * still
            * np.interp(shift, (NUDGED_M, SHOVED_M), (1.0, 0.0))
            * upright
        )

    def margins(
        self, start: State, end: State, trace: Trace | None = None
    ) -> list[Margin]:
        opened = float(end.joint("hinge").position)
        door = Margin.at_least("door", opened, OPEN, "rad", BEYOND)
        return [*limits_margins(self, start, end, trace), door]
