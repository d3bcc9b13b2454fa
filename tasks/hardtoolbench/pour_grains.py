"""PourGrains: pour grains from a heavy pan with a greasy handle into a bowl."""

from functools import cache

import numpy as np

from core.geometry import Array
from core.interfaces import Task
from core.layouts import around
from core.scene import Body, Camera, Color, Cylinder, Geom, Goal, Pose, Scene, Sphere, State, Trace, floor, table
from tasks.assets import board, revolved, round_wall

PAN, BOWL = (0.76, -0.18), (0.73, 0.15)  # x and y of their middles
STAND = 0.13  # height of the block under the pan
INSIDE, OUTSIDE, PAN_HEIGHT, WALL = 0.042, 0.05, 0.06, 0.006
HANDLE_Z, HANDLE_END, BAR = 0.045, -0.16, 0.014  # of the handle, which points toward -x: height, far end, thickness
BOWL_INSIDE, BOWL_RADIUS, BOWL_HEIGHT, CHINA_WALL = 0.045, 0.064, 0.05, 0.005  # radius at the bottom and at the top
GRAIN = 0.007
RINGS = ((0.0, 1), (0.0152, 6), (0.0298, 12))  # of grains on the pan's bottom: radius and number
GRAINS = tuple(f"grain_{i}" for i in range(1, sum(count for _, count in RINGS) + 1))
STILL_M_S = 0.05

IRON: Color = (0.22, 0.23, 0.25, 1.0)
STONE: Color = (0.66, 0.64, 0.60, 1.0)
CHINA: Color = (0.80, 0.88, 0.93, 1.0)
MAIZE: Color = (0.93, 0.72, 0.22, 1.0)


@cache
def pan() -> tuple[tuple[Geom, ...], tuple[Geom, ...]]:
    """What is drawn of the pan, and what collides; its frame is below, in the middle of the bottom."""
    handle = board((-HANDLE_END - OUTSIDE + 0.004, BAR, BAR), ((HANDLE_END - OUTSIDE + 0.004) / 2, 0.0, HANDLE_Z), IRON)
    bottom = Geom(Cylinder(OUTSIDE, WALL), Pose(np.array([0.0, 0.0, WALL / 2])), IRON)
    wall = round_wall((INSIDE, INSIDE), (OUTSIDE, OUTSIDE), WALL, PAN_HEIGHT, IRON, 16)
    outline = [(0.0, 0.0), (OUTSIDE, 0.0), (OUTSIDE, PAN_HEIGHT), (INSIDE, PAN_HEIGHT), (INSIDE, WALL), (0.0, WALL)]
    return (revolved(outline, IRON), handle), (bottom, *wall, handle)


@cache
def bowl() -> tuple[tuple[Geom, ...], tuple[Geom, ...]]:
    outer = (BOWL_INSIDE + CHINA_WALL, BOWL_RADIUS + CHINA_WALL)
    bottom = Geom(Cylinder(outer[0], CHINA_WALL), Pose(np.array([0.0, 0.0, CHINA_WALL / 2])), CHINA)
    wall = round_wall((BOWL_INSIDE, BOWL_RADIUS), outer, CHINA_WALL, BOWL_HEIGHT, CHINA, 16)
    outside, inside = [(0.0, 0.0), (outer[0], 0.0), (outer[1], BOWL_HEIGHT)], [(BOWL_RADIUS, BOWL_HEIGHT)]
    return (revolved([*outside, *inside, (BOWL_INSIDE, CHINA_WALL), (0.0, CHINA_WALL)], CHINA),), (bottom, *wall)


class PourGrains(Task):
    """Pour grains from a heavy pan with a greasy handle into a bowl.

    Task: get the grains out of the pan into the bowl, without the pan.
    Layouts: in ``near`` pan and bowl move a little; in ``wide`` both stand elsewhere, the pan's handle points another
    way, and weight and friction of pan and grains differ.
    Success: all grains at rest in the bowl, which the pan doesn't touch.
    """

    name = "PourGrains"
    description = (
        "A small iron pan of about 1.5 kg stands on a stone block 0.13 m high, to the robot's right. It is 0.1 m wide "
        "and 0.06 m high; its frame is in the middle of its underside. Its square handle, 0.014 m thick, points along "
        "the frame's minus x, roughly toward the robot, from the pan's wall to 0.16 m from its middle, 0.045 m above "
        "its underside. Handle and pan are greasy, so that fingers don't hold them. On the pan's bottom lie nineteen "
        "round grains, 0.014 m in diameter. To the robot's left a bowl, 0.128 m wide inside at its rim and 0.05 m "
        "high, is fixed to the table. Pour the grains into the bowl: each that is at rest in it counts the same. "
        "Nothing counts while the pan touches the bowl."
    )
    goals = (Goal(bodies=GRAINS, place=(0.0, 0.0, 0.02), tolerance=0.06, at="bowl", rest=True),)
    variations = {
        "near": {**around("pan", PAN, 0.03, 0.1), **around("bowl", BOWL, 0.03)},
        "wide": {
            "pan.x": (0.73, 0.79),
            "pan.y": (-0.25, -0.12),
            "pan.yaw": (-0.1, 0.3),
            "pan.mass": (1.3, 1.7),
            "pan.friction": (0.02, 0.06),
            "grain.mass": (0.0015, 0.003),
            "grain.friction": (0.2, 0.5),
            "bowl.x": (0.68, 0.78),
            "bowl.y": (0.1, 0.22),
        },
    }
    camera = Camera(position=(0.95, -0.72, 0.62), target=(0.62, 0.0, 0.14))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        place, mass = draw.pose("pan", (*PAN, STAND)), draw("grain.mass", 0.002)
        stone = (board((0.11, 0.11, STAND), (0.0, 0.0, -STAND / 2), STONE),)
        spots = [
            (radius * np.cos(angle), radius * np.sin(angle))
            for radius, count in RINGS
            for angle in np.arange(count) * 2 * np.pi / count
        ]
        looks = (Geom(Sphere(GRAIN), color=MAIZE),)
        grains = [
            Body(
                name,
                place @ Pose.xyz_rpy((x, y, WALL + GRAIN)),
                mass,
                looks,
                looks,
                friction=draw("grain.friction", 0.3),
                rolling_friction=0.0005,
            )
            for name, (x, y) in zip(GRAINS, spots, strict=True)
        ]
        return Scene(
            (
                floor(),
                table(),
                Body("stand", place, 0.0, stone, stone, friction=2.0),
                Body("bowl", draw.pose("bowl", (*BOWL, 0.0)), 0.0, *bowl()),
                Body("pan", place, draw("pan.mass", 1.5), *pan(), friction=draw("pan.friction", 0.04)),
                *grains,
            )
        )

    def reward(self, start: State, end: State, trace: Trace | None = None) -> Array:
        """The share of the grains that are at rest in the bowl; nothing while the pan touches it."""
        assert trace is not None
        inside = []
        for name in GRAINS:
            x, y, z = np.moveaxis(end.relative(name, "bowl"), -1, 0)
            slow = np.linalg.norm(end.linear_velocity(name), axis=-1) < STILL_M_S
            inside.append((np.hypot(x, y) < BOWL_RADIUS) & (z > 0) & (z < BOWL_HEIGHT) & slow)
        reward: Array = np.mean(inside, axis=0) * ~trace.touching_at_end("pan", "bowl")
        return reward
