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
from core.values.layouts import around, within
from tasks.assets import disc, revolved, round_wall
from tasks.rewards import share

JAR = (0.58, 0.0)  # x, y of its middle
# Thickness.
BOTTOM = 0.008
WALL = 0.005
# Inside:
BODY_RADIUS = 0.1
NECK_RADIUS = 0.088
# Heights; between the first two the jar narrows.
BODY_TOP = 0.17
NECK_BOTTOM = 0.205
MOUTH = 0.25

COOKIES = 12
RADIUS = 0.04
THICKNESS = 0.014
# Of the two columns, from the jar's middle; six cookies in each.
COLUMN_X = (-0.0445, 0.0445)
OUT_Z = 0.3  # a cookie whose centre is above this is out

GLASS = (0.62, 0.80, 0.86, 0.3)
DOUGH = (0.80, 0.58, 0.33, 1.0)
CHOCOLATE = (0.24, 0.13, 0.07, 1.0)


@cache
def jar() -> Body:
    """A glass jar with a neck, open on top."""
    heights = (BOTTOM, BODY_TOP, NECK_BOTTOM, MOUTH)
    inside = (BODY_RADIUS, BODY_RADIUS, NECK_RADIUS, NECK_RADIUS)
    bottom = disc(BODY_RADIUS + WALL, BOTTOM, BOTTOM / 2, GLASS)
    walls = tuple(
        piece
        for i in range(3)
        for piece in round_wall(
            (inside[i], inside[i + 1]),
            (inside[i] + WALL, inside[i + 1] + WALL),
            heights[i],
            heights[i + 1],
            GLASS,
            20,
        )
    )
    outer = [(0.0, 0.0)] + [
        (r + WALL, h) for r, h in zip(inside, (0.0, *heights[1:]), strict=True)
    ]
    inner = [
        (r, h) for r, h in zip(reversed(inside), reversed(heights), strict=True)
    ] + [(0.0, BOTTOM)]
    return Body(
        "jar",
        Pose.xyz_rpy((*JAR, 0.0)),
        0.0,
        (revolved(outer + inner, GLASS),),
        (bottom, *walls),
        friction=0.3,
    )


@cache
def look() -> tuple[Geom, ...]:
    """Visual shapes of a cookie: a disc with a rounded edge, and chocolate chips."""
    edge = RADIUS - 0.002
    half = THICKNESS / 2
    disc = revolved(
        [
            (0, -half),
            (edge, -half),
            (RADIUS, 0.002 - half),
            (RADIUS, half - 0.002),
            (edge, half),
            (0, half),
        ],
        DOUGH,
    )
    spots = [
        (radius, angle)
        for radius, count in ((0.013, 3), (0.028, 6))
        for angle in np.arange(count) * 6.3 / count
    ]
    on_top = [(r * np.cos(a + r), r * np.sin(a + r), half - 0.0025) for r, a in spots]
    on_edge = [
        ((RADIUS - 0.0025) * np.cos(a), (RADIUS - 0.0025) * np.sin(a), 0.001)
        for a in np.arange(7) * 0.9
    ]
    return disc, *(
        Geom(Sphere(0.0035), Pose(np.array(spot)), CHOCOLATE)
        for spot in on_top + on_edge
    )


def cookie(number: int, pose: Pose, mass: float) -> Body:
    collisions = (Geom(Cylinder(RADIUS, THICKNESS)),)
    return Body(f"cookie_{number}", pose, mass, look(), collisions, friction=0.8)


class SnatchCookie(Task):
    """Take one cookie out of a deep jar.

    Task: take any cookie out of the jar, and hold it above the mouth.
    Layouts: each cookie's place is a little random. In ``near`` the jar moves a little with the cookies in it; in
    ``wide`` it stands anywhere in front of the robot, turned, and the cookies are lighter or heavier.
    Success: a cookie's centre close to 0.3 m or above it.
    """

    name = "SnatchCookie"
    description = (
        "A glass jar stands on the table 0.58 m in front of the robot, fixed. Its mouth, 0.176 m wide, is at z = 0.25; "
        "below the neck it is 0.2 m wide inside. Twelve cookies, flat round discs with a diameter of 0.08 m, 0.014 m "
        "thick and 20 g in weight, lie at its bottom in two columns of six, one nearer to the robot and one farther; "
        f"the columns reach up to z = 0.093. Take one cookie out of the jar and hold it higher than z = {OUT_Z:g}."
    )
    in_words = (
        "A glass jar stands on the table in front of the robot, fixed. Its mouth is narrower than the inside below. "
        "Twelve cookies, flat round discs, lie at its bottom in two columns of six, one nearer to the robot and one "
        "farther. Take one cookie out of the jar and hold it higher than z = 0.3."
    )
    success_reward = 0.95  # the paper's goals have no tolerance
    goals = (
        Placed(
            bodies=tuple(f"cookie_{i}" for i in range(1, COOKIES + 1)),
            place=(None, None, OUT_Z + 0.02),
            any=True,
        ),
    )
    variations = {
        "near": around("jar", JAR, 0.03, 0.3),
        "wide": {
            **within("jar", x=(0.5, 0.65), y=(-0.2, 0.2), yaw=(-0.6, 0.6)),
            "cookie.mass": (0.012, 0.03),
        },
    }
    camera = Camera(position=(1.15, -0.62, 0.68), target=(0.42, 0.0, 0.3))

    def scene(self, seed: int) -> Scene:
        """Each column has a small random offset, and so has each cookie in its column."""
        draw = self.draw(seed)
        random = np.random.default_rng(seed)
        pose = draw.pose("jar", (*JAR, 0.0))
        mass = draw("cookie.mass", 0.02)
        move = pose @ Pose(-np.array([*JAR, 0.0]))
        cookies = []
        for column, x in enumerate(COLUMN_X):
            shift = random.uniform(-0.001, 0.001, 2)
            for layer in range(COOKIES // 2):
                place = (
                    np.array([JAR[0] + x, JAR[1]])
                    + shift
                    + random.uniform(-0.001, 0.001, 2)
                )
                height = BOTTOM + (layer + 0.5) * THICKNESS + (layer + 1) * 0.0001
                number = column * (COOKIES // 2) + layer + 1
                lies = Pose.xyz_rpy(
                    (*place, height), (0.0, 0.0, random.uniform(-np.pi, np.pi))
                )
                cookies.append(cookie(number, move @ lies, mass))
        return Scene((floor(), table(), replace(jar(), pose=pose), *cookies))

    def reward(self, start: State, end: State) -> Array:
        """The fraction of the highest cookie's way from its rest to above the mouth: 1 if it is out."""
        highest = end.positions[..., 2].argmax(axis=-1)[..., None]
        now = np.take_along_axis(end.positions[..., 2], highest, axis=-1)[..., 0]
        rest = np.take_along_axis(start.positions[..., 2], highest, axis=-1)[..., 0]
        return share((now - rest) / (OUT_Z - rest))
