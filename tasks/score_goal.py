from dataclasses import replace
from functools import cache

import numpy as np
import trimesh

from core.geometry import Array, Pose
from core.goals import Placed
from core.interfaces import Task
from core.scene import (
    Body,
    Camera,
    Color,
    Cylinder,
    Geom,
    Margin,
    Mesh,
    Scene,
    State,
    Trace,
    floor,
)
from core.values.layouts import around, within
from tasks.assets import board
from tasks.rewards import share, split

PUCK_RADIUS = 0.038
PUCK_HEIGHT = 0.025
PUCK_MASS = 0.17
START = (0.8, 0.6, PUCK_HEIGHT / 2)
# The goal's middle; its mouth faces the robot.
CENTER_X = 2.0
CENTER_Y = 0.0
# Inside the goal, along x, y, z.
DEPTH = 0.254
WIDTH = 0.457
HEIGHT = 0.305
BAR = 0.019  # radius of the goal's bars, which are around the inside
# Thickness of the net's collision shape, against tunnelling, and of its strings.
NET = 2 * BAR
THREAD = 0.004
# Friction; a contact has the geometric mean of both, so 0.5 on ice gives 0.1.
RUBBER = 0.5
ICE = 0.02

RED: Color = (0.80, 0.14, 0.14, 1.0)
STRING: Color = (0.62, 0.67, 0.74, 1.0)
CLEAR: Color = (0.92, 0.94, 0.97, 0.25)


def bar(start: tuple[float, float, float], end: tuple[float, float, float]) -> Geom:
    """A round bar from one point to another, in the goal's frame."""
    along = np.subtract(end, start)
    length = float(np.linalg.norm(along))
    turn = (
        0.0,
        float(np.arccos(along[2] / length)),
        float(np.arctan2(along[1], along[0])),
    )
    return Geom(Cylinder(BAR, length), Pose.xyz_rpy(np.add(start, end) / 2, turn), RED)


def strings(net: Geom) -> Geom:
    """Visual crossed strings in the middle of a piece of net, which is a thin board."""
    size = np.array(net.shape.to_trimesh().extents)
    thin = int(np.argmin(size))
    pieces = []
    for along in range(3):
        across = 3 - thin - along
        if along == thin:
            continue
        for at in np.linspace(
            -size[across] / 2, size[across] / 2, round(size[across] / 0.045) + 1
        )[1:-1]:
            piece = np.full(3, THREAD)
            center = np.zeros(3)
            piece[along] = size[along]
            center[across] = at
            pieces.append(trimesh.creation.box(piece).apply_translation(center))
    return Geom(Mesh.from_trimesh(trimesh.util.concatenate(pieces)), net.pose, STRING)


@cache
def hockey_goal() -> Body:
    """A frame of bars: two posts and a crossbar in front, and bars on the ground behind and on both sides. The net is
    on both sides, behind and above.
    """
    front = -DEPTH / 2
    back = DEPTH / 2 + BAR
    side = WIDTH / 2 + BAR
    top = HEIGHT + BAR
    posts = (
        bar((front, -side, 0.0), (front, -side, top + BAR)),
        bar((front, side, 0.0), (front, side, top + BAR)),
    )
    bars = (
        *posts,
        bar((front, -side, top), (front, side, top)),
        bar((back, -side - BAR, BAR), (back, side + BAR, BAR)),
        bar((front, -side, BAR), (back, -side, BAR)),
        bar((front, side, BAR), (back, side, BAR)),
    )
    length = back - front
    middle = (front + back) / 2
    net = (
        board((NET, 2 * side, top), (back, 0.0, top / 2), CLEAR),
        board((length, 2 * side, NET), (middle, 0.0, top), CLEAR),
        board((length, NET, top), (middle, -side, top / 2), CLEAR),
        board((length, NET, top), (middle, side, top / 2), CLEAR),
    )
    collisions = (*bars, *net)
    return Body(
        "goal",
        Pose.xyz_rpy((CENTER_X, CENTER_Y, 0.0)),
        0.0,
        (*collisions, *map(strings, net)),
        collisions,
    )


class ScoreGoal(Task):
    """Shoot a puck, which lies on ice to the robot's left, into a goal that is far out of reach.

    Task: get the puck into the goal.
    Layouts: in ``near`` puck and goal move a little; in ``wide`` both stand elsewhere, and the puck is lighter or
    heavier.
    Success: the puck's centre inside the goal.
    """

    name = "ScoreGoal"
    description = (
        "The robot stands on ice; there is no table, the ground is at z = 0. A hockey puck with a radius of 0.038 m, a "
        "height of 0.025 m and a mass of 0.17 kg lies in front of the robot and to its left, at (0.8, 0.6). A red "
        "hockey goal stands at (2.0, 0), far out of reach, its mouth toward the robot. The puck slides on the ice with "
        "a friction of 0.1. Get it into the goal."
    )
    in_words = (
        "The robot stands on ice; there is no table, the ground is at z = 0. A hockey puck lies in front of the robot "
        "and to its left. A red hockey goal stands far out of reach, its mouth toward the robot. The puck slides well "
        "on the ice. Get it into the goal."
    )
    success_reward = 0.95  # the paper's goals have no tolerance
    goals = (
        Placed(
            bodies=("puck",), place=(0.0, 0.0, None), tolerance=DEPTH / 2, at="goal"
        ),
    )
    variations = {
        "near": {
            **around("puck", START, 0.03),
            **around("goal", (CENTER_X, CENTER_Y), 0.03),
        },
        "wide": {
            **within("puck", x=(0.7, 0.85), y=(0.45, 0.65), mass=(0.12, 0.22)),
            **within("goal", x=(1.8, 2.1), y=(-0.3, 0.3)),
        },
    }
    camera = Camera(position=(1.6, -1.75, 1.5), target=(1.05, 0.3, 0.1), fov_deg=52.0)

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        puck = Body.of(
            "puck",
            Cylinder(PUCK_RADIUS, PUCK_HEIGHT),
            draw.position("puck", START),
            mass=draw("puck.mass", PUCK_MASS),
            color=(0.12, 0.12, 0.13, 1.0),
            friction=RUBBER,
        )
        place = draw.pose("goal", (CENTER_X, CENTER_Y, 0.0))
        return Scene((floor(0.0, ICE), replace(hockey_goal(), pose=place), puck))

    def margins(
        self, start: State, end: State, trace: Trace | None = None
    ) -> list[Margin]:
        x, y, _ = np.abs(end.position("puck") - start.position("goal"))
        return [
            Margin.at_most("puck off the goal's middle, along x", x, DEPTH / 2, "m"),
            Margin.at_most("puck off the goal's middle, along y", y, WIDTH / 2, "m"),
        ]

    def reward(self, start: State, end: State) -> Array:
        """1 if the puck's centre is inside the goal, otherwise the fraction of its way to the goal's middle."""
        x, y, z = split(end.position("puck") - start.position("goal"))
        inside = (
            (np.abs(x) < DEPTH / 2) & (np.abs(y) < WIDTH / 2) & (z > 0) & (z < HEIGHT)
        )
        began = start.position("puck") - start.position("goal")
        nearer = 1 - np.hypot(x, y) / np.hypot(began[..., 0], began[..., 1])
        return np.where(inside, 1.0, share(nearer))
