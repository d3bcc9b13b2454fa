from dataclasses import replace
from functools import cache

import numpy as np

from core.geometry import Array
from core.goals import Placed
from core.interfaces import Task
from core.scene import (
    Body,
    Camera,
    Cylinder,
    Geom,
    Pose,
    Scene,
    Sphere,
    State,
    floor,
    table,
)
from core.values.joints import rotate
from core.values.layouts import around, within
from tasks.assets import board, disc, hull, open_box, revolved, round_wall

POT = (0.75, -0.2)  # x, y of its middle
# Inside; the bottom is as thick as the wall.
POT_RADIUS = 0.12
POT_HEIGHT = 0.0875
POT_WALL = 0.004
OUTSIDE = POT_RADIUS + POT_WALL
AROUND = np.tile(np.arange(24) * np.pi / 12, 2)
POT_EDGES = np.stack(  # points around its foot and its mouth
    [
        OUTSIDE * np.cos(AROUND),
        OUTSIDE * np.sin(AROUND),
        np.repeat((0.0, POT_HEIGHT), 24),
    ],
    axis=-1,
)
# Of the handles' bars, which run along x on the pot's left and right.
HANDLE_Z = 0.07
HANDLE_Y = 0.152

BOX = (0.8, 0.25)  # x, y of its middle
# Along x, y, z.
BOX_LENGTH = 0.525
BOX_WIDTH = 0.265
BOX_HEIGHT = 0.105
BOX_WALL = 0.006

LEGS = tuple(f"leg_{i}" for i in range(1, 6))
# Along the leg; MEAT_RADIUS is its radius there.
MEAT_X = (-0.059, -0.055, -0.048, -0.038, -0.008, 0.004, 0.013, 0.02)
MEAT_RADIUS = (0.004, 0.011, 0.018, 0.022, 0.022, 0.0185, 0.013, 0.006)
BONE_RADIUS = 0.006
BONE_LENGTH = 0.04
BONE_X = 0.03
KNOB_RADIUS = 0.009
KNOB_X = 0.051
FACETS = 10  # of the meat's collision shape: it lies on one of them
FACET_RADIUS = 0.022 * np.cos(np.pi / FACETS)
RING = 0.072  # radius of the ring in which the legs lie

METAL = (0.75, 0.77, 0.80, 1.0)
STEEL = (0.50, 0.53, 0.57, 1.0)
ROAST = (0.72, 0.40, 0.18, 1.0)
BONE = (0.93, 0.90, 0.82, 1.0)


@cache
def pot() -> Body:
    """A round pot, open on top, with a handle on both sides; its frame is below, in the middle of the bottom."""
    bottom = disc(OUTSIDE, POT_WALL, POT_WALL / 2, METAL)
    wall = round_wall(
        (POT_RADIUS, POT_RADIUS), (OUTSIDE, OUTSIDE), POT_WALL, POT_HEIGHT, METAL, 20
    )
    shell = revolved(
        [
            (0.0, 0.0),
            (OUTSIDE, 0.0),
            (OUTSIDE, POT_HEIGHT),
            (POT_RADIUS, POT_HEIGHT),
            (POT_RADIUS, POT_WALL),
            (0.0, POT_WALL),
        ],
        METAL,
    )
    handles = tuple(
        part
        for side in (-1, 1)
        for part in (
            board((0.08, 0.01, 0.008), (0.0, side * HANDLE_Y, HANDLE_Z), STEEL),
            board((0.01, 0.036, 0.008), (-0.035, side * 0.133, HANDLE_Z), STEEL),
            board((0.01, 0.036, 0.008), (0.035, side * 0.133, HANDLE_Z), STEEL),
        )
    )
    return Body(
        "pot",
        Pose.xyz_rpy((*POT, 0.0)),
        1.0,
        (shell, *handles),
        (bottom, *wall, *handles),
        friction=0.5,
    )


def chefs_box() -> Body:
    """A deep tray with a lip around its upper edge."""
    walls = open_box(BOX_LENGTH, BOX_WIDTH, BOX_HEIGHT, BOX_WALL, METAL)
    x = BOX_LENGTH / 2 + 0.006
    y = BOX_WIDTH / 2 + 0.006
    z = BOX_HEIGHT - 0.002
    lip = (
        *(
            board((0.012, BOX_WIDTH + 0.024, 0.004), (side * x, 0.0, z), STEEL)
            for side in (-1, 1)
        ),
        *(
            board((BOX_LENGTH, 0.012, 0.004), (0.0, side * y, z), STEEL)
            for side in (-1, 1)
        ),
    )
    return Body("box", Pose.xyz_rpy((*BOX, 0.0)), 0.0, (*walls, *lip), (*walls, *lip))


def leg(name: str, pose: Pose, mass: float) -> Body:
    """Meat around a bone along x, 0.12 m long, with a knob at +x. The meat's collision shape has flat sides."""
    along_x = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0))
    outline = [
        (0.0, MEAT_X[0]),
        *zip(MEAT_RADIUS, MEAT_X, strict=True),
        (0.0, MEAT_X[-1]),
    ]
    visual = Geom(revolved(outline, ROAST).shape, along_x, ROAST)
    angles = (np.arange(FACETS) + 0.5) * 2 * np.pi / FACETS - np.pi / 2
    rings = [
        (x, r * np.cos(a), r * np.sin(a))
        for r, x in zip(MEAT_RADIUS, MEAT_X, strict=True)
        for a in angles
    ]
    collision = Geom(hull(rings))
    bone = Geom(
        Cylinder(BONE_RADIUS, BONE_LENGTH),
        Pose.xyz_rpy((BONE_X, 0.0, 0.0), along_x.rpy),
        BONE,
    )
    knob = Geom(Sphere(KNOB_RADIUS), Pose.xyz_rpy((KNOB_X, 0.0, 0.0)), BONE)
    knobs = tuple(
        Geom(Sphere(KNOB_RADIUS - 0.002), Pose.xyz_rpy((KNOB_X, y, 0.0)), BONE)
        for y in (-0.003, 0.003)
    )
    return Body(
        name,
        pose,
        mass,
        (visual, bone, *knobs),
        (collision, bone, knob),
        friction=0.2,
        rolling_friction=0.002,
    )


class TurkeyLegs(Task):
    """Bring five turkey legs from a pot into the chef's box, without the pot.

    Task: get all legs into the box, but not the pot.
    Layouts: the legs lie in the pot at random. In ``near`` pot and box move a little; in ``wide`` they move farther,
    the pot turns, and the legs are lighter or heavier.
    Success: all five legs in the box, and no part of the pot.
    """

    name = "TurkeyLegs"
    description = (
        "A silver pot, 1 kg in weight, 0.25 m wide and 0.0875 m high, stands on the table, its middle at x = 0.75 m, "
        "y = -0.2 m. It has a handle on its left and one on its right: bars along x at y = -0.048 m and y = -0.352 m, "
        "z = 0.07 m, 0.08 m long and 0.01 m thick, with a gap between bar and pot. Five turkey legs, each 0.12 m long "
        "and slippery, lie in it. To its left a chef's box, an open tray 0.525 m long (x), 0.265 m wide (y) and 0.105 "
        "m high, is fixed to the table, its middle at x = 0.8 m, y = 0.25 m. Bring all legs into the box, but not the "
        "pot. The end-effector starts at (0.4, -0.2, 0.2)."
    )
    in_words = (
        "A silver pot stands on the table. It has a handle on its left and one on its right: bars that point away from "
        "the robot, with a gap between bar and pot. Five turkey legs, slippery, lie in it. To its left a chef's box, "
        "an open tray, is fixed to the table. Bring all legs into the box, but not the pot."
    )
    success_reward = 0.95  # the paper's goals have no tolerance
    goals = (Placed(bodies=LEGS, place=(0.0, 0.0, 0.03), tolerance=0.1, at="box"),)
    variations = {
        "near": {**around("pot", POT, 0.03, 0.1), **around("box", BOX, 0.02)},
        "wide": {
            **within("pot", x=(0.68, 0.78), y=(-0.27, -0.17), yaw=(-0.3, 0.3)),
            "leg.mass": (0.04, 0.08),
            **within("box", x=(0.72, 0.85), y=(0.24, 0.32)),
        },
    }
    home = Pose(np.array([0.4, -0.2, 0.2]))
    camera = Camera(position=(1.45, -0.7, 0.95), target=(0.52, 0.02, 0.17))

    def scene(self, seed: int) -> Scene:
        """The legs lie in a ring, one behind the other; the ring's angle and small offsets of each leg are random."""
        draw = self.draw(seed)
        random = np.random.default_rng(seed)
        pose = draw.pose("pot", (*POT, 0.0))
        mass = draw("leg.mass", 0.06)
        move = pose @ Pose(-np.array([*POT, 0.0]))
        start = random.uniform(-np.pi, np.pi)
        height = POT_WALL + FACET_RADIUS + 0.0005
        legs = []
        for i, name in enumerate(LEGS):
            angle = start + i * 2 * np.pi / len(LEGS)
            yaw = angle + np.pi / 2 - 0.15 + random.uniform(-0.02, 0.02)
            shift = 0.016 + random.uniform(-0.001, 0.001)  # along the leg
            x = RING * np.cos(angle) + shift * np.cos(yaw)
            y = RING * np.sin(angle) + shift * np.sin(yaw)
            lies = Pose.xyz_rpy((POT[0] + x, POT[1] + y, height), (0.0, 0.0, yaw))
            legs.append(leg(name, move @ lies, mass))
        box = replace(chefs_box(), pose=draw.pose("box", (*BOX, 0.0)))
        return Scene((floor(), table(), box, replace(pot(), pose=pose), *legs))

    def reward(self, start: State, end: State) -> Array:
        """The fraction of the legs that is inside the box, times 0.7 if any of the pot's edges is inside too."""
        box = start.position("box")
        legs = sum(
            inside_box(end.position(name) - box).astype(np.float64) for name in LEGS
        ) / len(LEGS)
        edges = rotate(end.quaternion("pot")[..., None, :], POT_EDGES)
        pot = inside_box((end.position("pot") - box)[..., None, :] + edges).any(axis=-1)
        return legs * np.where(pot, 0.7, 1.0)


def inside_box(position: Array) -> Array:
    """Report whether points (..., 3), relative to the box, are between its walls and below its edge."""
    offset = np.abs(position - np.array([0.0, 0.0, BOX_HEIGHT / 2]))
    room = np.array(
        [BOX_LENGTH / 2 - BOX_WALL, BOX_WIDTH / 2 - BOX_WALL, BOX_HEIGHT / 2]
    )
    return (offset < room).all(axis=-1)
