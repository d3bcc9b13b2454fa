import numpy as np

from core.geometry import Array
from core.goals import Turned
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
from core.values.joints import rotate
from core.values.layouts import around, within
from tasks.assets import board
from tasks.rewards import length, speed

# Of the stone.
LENGTH = 0.28
WIDTH = 0.28
HEIGHT = 0.18
SLAB = 0.05  # height of the slab that it lies on
OVERHANG = 0.05  # of the stone's near edge
# Of the fulcrum.
BAR_TOP = 0.03
BAR_RADIUS = 0.012
RAISED = (0.025, 0.04)  # how far the near edge must be raised, m
KEPT = 0.02  # how far the far edge may slide, m

GRANITE = (0.62, 0.58, 0.56, 1.0)
SLATE = (0.36, 0.38, 0.42, 1.0)
STEEL = (0.25, 0.42, 0.62, 1.0)


def fulcrum(pose: Pose) -> Body:
    """A fixed round bar across the way to the stone, on a foot; its frame is on the table below the bar."""
    foot = board(
        (0.03, 0.2, BAR_TOP - BAR_RADIUS), (0.0, 0.0, (BAR_TOP - BAR_RADIUS) / 2), STEEL
    )
    lies = Pose.xyz_rpy((0.0, 0.0, BAR_TOP - BAR_RADIUS), (np.pi / 2, 0.0, 0.0))
    return Body(
        "fulcrum",
        pose,
        0.0,
        (foot, bar := Geom(Cylinder(BAR_RADIUS, 0.2), lies, STEEL)),
        (foot, bar),
    )


def edges(state: State, side: float) -> Array:
    """Return the ends (..., 2, 3) of the stone's lower edge toward the robot (-1) or away from it (1)."""
    ends = np.array(
        [(side * LENGTH / 2, y, -HEIGHT / 2) for y in (-WIDTH / 2, WIDTH / 2)]
    )
    return state.position("stone")[..., None, :] + rotate(
        state.quaternion("stone")[..., None, :], ends
    )


class LeverStone(Task):
    """Raise the edge of a stone that is too heavy for the arm, with a lever.

    Task: raise the near edge of the stone, and hold it there.
    Layouts: in ``near`` stone and fulcrum move and turn a little together; in ``wide`` they stand anywhere in front of
    the robot, turned, the fulcrum nearer to the stone or farther, and the stone is lighter or heavier.
    Success: at the end, at rest, all of the near edge is 2.5 to 4 cm higher, and the far edge slid by 2 cm at most.
    """

    name = "LeverStone"
    description = (
        "A block of granite, 0.28 m x 0.28 m and 0.18 m high, 32 to 44 kg, lies on a slab of 50 mm height on the "
        "table. Its near edge sticks out 50 mm over the slab, so that there is a gap of 50 mm below it. In front of "
        "it, parallel to the edge and 40 to 60 mm away, is the fulcrum: a fixed round bar of 0.2 m length whose top "
        "is at z = 0.03. The arm alone can't lift the edge, since that takes 155 N or more. Raise the near edge by "
        f"{1000 * RAISED[0]:g} to {1000 * RAISED[1]:g} mm and hold it there at rest until the end, without letting the "
        "stone slide."
    )
    in_words = (
        "A block of granite, far too heavy for the arm, lies on a slab on the table. Its near edge sticks out over the "
        "slab, so that there is a gap below it. In front of it, parallel to the edge, is the fulcrum: a fixed round "
        "bar. Raise the near edge by 25 to 40 mm and hold it there at rest until the end, without letting the stone "
        "slide."
    )
    goals = (
        Turned(
            bodies=("stone",),
            axis=(0.0, 0.0, 1.0),
            points=(0.115, 0.0, 0.993),
            at="fulcrum",
            tolerance_deg=1.5,
        ),
    )
    variations = {
        "near": around("fulcrum", (0.75, 0.0), 0.03, 0.15),
        "wide": {
            **within("fulcrum", x=(0.7, 0.8), y=(-0.2, 0.2), yaw=(-0.3, 0.3)),
            "gap": (0.04, 0.06),
            **within("stone", y=(-0.03, 0.03), mass=(32.0, 44.0), friction=(0.6, 0.9)),
        },
    }
    camera = Camera(position=(0.95, -1.1, 0.55), target=(0.62, 0.0, 0.12))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        pose = draw.pose("fulcrum", (0.75, 0.0, 0.0))
        x = draw("gap", 0.05) + LENGTH / 2
        y = draw("stone.y", 0.0)
        lies = pose @ Pose.xyz_rpy((x, y, SLAB + HEIGHT / 2))
        under = pose @ Pose.xyz_rpy((x + OVERHANG, y, SLAB / 2))
        mass = draw("stone.mass", 38.0)
        friction = draw("stone.friction", 0.75)
        stone = Geom(Box((LENGTH, WIDTH, HEIGHT)), color=GRANITE)
        slab = Geom(Box((LENGTH, WIDTH, SLAB)), color=SLATE)
        return Scene(
            (
                floor(),
                table(),
                fulcrum(pose),
                Body("slab", under, 0.0, (slab,), (slab,), friction),
                Body("stone", lies, mass, (stone,), (stone,), friction),
            )
        )

    def reward(self, start: State, end: State) -> Array:
        """The share of the way up; less above the range, where the stone slid, and in motion."""
        rise = (edges(end, -1) - edges(start, -1))[..., 2].min(axis=-1)
        slid = length((edges(end, 1) - edges(start, 1))[..., :2]).max(axis=-1)
        up = np.interp(rise, (0.002, *RAISED, 2 * RAISED[1]), (0.0, 1.0, 1.0, 0.0))
        return (
            up
            * np.interp(slid, (KEPT, 4 * KEPT), (1.0, 0.0))
            * np.interp(speed(end, "stone"), (0.02, 0.1), (1.0, 0.0))
        )
