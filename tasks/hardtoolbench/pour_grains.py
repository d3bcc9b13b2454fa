from functools import cache

import numpy as np

from core.geometry import Array
from core.goals import Placed
from core.interfaces import Task
from core.scene import (
    Body,
    Camera,
    Color,
    Geom,
    Pose,
    Scene,
    Sphere,
    State,
    Trace,
    floor,
    table,
)
from core.values.layouts import around, within
from tasks.assets import board, disc, revolved, round_wall
from tasks.rewards import speed, split

# X and y of their middles.
CRUCIBLE = (0.74, -0.18)
BOWL = (0.73, 0.15)
# Height of the block under the crucible, and of the rim around its foot.
STAND = 0.135
SEAT = 0.008
INSIDE = 0.042
OUTSIDE = 0.05
HEIGHT = 0.06
WALL = 0.006
# Of the crucible: radius, lower and upper face.
COLLAR = 0.072
COLLAR_LOW = 0.034
COLLAR_TOP = 0.042
# Radius at the bottom and at the top.
BOWL_INSIDE = 0.05
BOWL_RADIUS = 0.075
BOWL_HEIGHT = 0.055
CHINA_WALL = 0.005
GRAIN = 0.007
# Of grains on the crucible's bottom: radius and number.
RINGS = ((0.0, 1), (0.0152, 6), (0.0298, 12))
GRAINS = tuple(f"grain_{i}" for i in range(1, sum(count for _, count in RINGS) + 1))
STILL_M_S = 0.05

IRON: Color = (0.22, 0.23, 0.25, 1.0)
STONE: Color = (0.66, 0.64, 0.60, 1.0)
CHINA: Color = (0.80, 0.88, 0.93, 1.0)
MAIZE: Color = (0.93, 0.72, 0.22, 1.0)


def ring(
    inner: float, outer: float, bottom: float, top: float, color: Color
) -> tuple[Geom, ...]:
    """Collision shapes of an upright ring."""
    return round_wall((inner, inner), (outer, outer), bottom, top, color, 12)


@cache
def crucible() -> tuple[tuple[Geom, ...], tuple[Geom, ...]]:
    """What is drawn, and what collides; the frame is below, in the middle of the bottom."""
    bottom = disc(OUTSIDE, WALL, WALL / 2, IRON)
    outside = [
        (OUTSIDE, 0.0),
        (OUTSIDE, COLLAR_LOW),
        (COLLAR, COLLAR_LOW),
        (COLLAR, COLLAR_TOP),
        (OUTSIDE, COLLAR_TOP),
    ]
    outline = [
        (0.0, 0.0),
        *outside,
        (OUTSIDE, HEIGHT),
        (INSIDE, HEIGHT),
        (INSIDE, WALL),
        (0.0, WALL),
    ]
    wall = ring(INSIDE, OUTSIDE, WALL, HEIGHT, IRON)
    collar = ring(INSIDE, COLLAR, COLLAR_LOW, COLLAR_TOP, IRON)
    return (revolved(outline, IRON),), (bottom, *wall, *collar)


@cache
def stand(height: float) -> tuple[Geom, ...]:
    """A block with a low rim that keeps the crucible from being pushed off; the frame is where the crucible stands."""
    # Of the block, and the middle of the rim's bars.
    width = 2 * (OUTSIDE + 0.009)
    rim = OUTSIDE + 0.006
    along = [
        board((width, 0.006, SEAT), (0.0, side * rim, SEAT / 2), STONE)
        for side in (-1, 1)
    ]
    across = [
        board((0.006, width, SEAT), (side * rim, 0.0, SEAT / 2), STONE)
        for side in (-1, 1)
    ]
    return (
        board((width, width, height), (0.0, 0.0, -height / 2), STONE),
        *along,
        *across,
    )


@cache
def bowl() -> tuple[tuple[Geom, ...], tuple[Geom, ...]]:
    outer = (BOWL_INSIDE + CHINA_WALL, BOWL_RADIUS + CHINA_WALL)
    bottom = disc(outer[0], CHINA_WALL, CHINA_WALL / 2, CHINA)
    wall = round_wall(
        (BOWL_INSIDE, BOWL_RADIUS), outer, CHINA_WALL, BOWL_HEIGHT, CHINA, 12
    )
    outside = [(0.0, 0.0), (outer[0], 0.0), (outer[1], BOWL_HEIGHT)]
    inside = [(BOWL_RADIUS, BOWL_HEIGHT)]
    return (
        revolved(
            [*outside, *inside, (BOWL_INSIDE, CHINA_WALL), (0.0, CHINA_WALL)], CHINA
        ),
    ), (bottom, *wall)


class PourGrains(Task):
    """Pour grains from a heavy, oiled crucible into a bowl.

    Task: get the grains out of the crucible into the bowl, without the crucible.
    Layouts: in ``near`` crucible and bowl move a little; in ``wide`` both stand elsewhere, the block under the crucible
    is lower or higher, and weight and friction of crucible and grains differ.
    Success: all grains at rest in the bowl, which the crucible doesn't touch.
    """

    name = "PourGrains"
    description = (
        "A round iron crucible of about 1.5 kg stands on a stone block 0.1 to 0.17 m high, to the robot's right, "
        "in a seat with a rim 8 mm high. It is open on top, 0.1 m wide and 0.06 m high; its frame is in the middle "
        "of its underside. A collar of 0.144 m diameter surrounds it, 0.034 to 0.042 m above its underside. All of "
        "it is oiled, so that fingers don't hold it. On its bottom lie nineteen round grains, 0.014 m in diameter. "
        "To the robot's left a bowl, 0.15 m wide inside at its rim and 0.055 m high, is fixed to the table. Pour "
        "the grains into the bowl: each that lies in it at rest counts the same, but none that is still carried, in "
        "the crucible or by the tool. Nothing counts while the crucible touches the bowl."
    )
    in_words = (
        "A round iron crucible, open on top, stands on a stone block, in a seat with a rim. A collar surrounds it "
        "above its underside. All of it is oiled, so that fingers don't hold it. On its bottom lie nineteen small "
        "round grains. On the robot's other side a bowl is fixed to the table. Pour the grains into the bowl: each "
        "that lies in it at rest counts the same, but none that is still carried, in the crucible or by the tool. "
        "Nothing counts while the crucible touches the bowl."
    )
    goals = (
        Placed(
            bodies=GRAINS, place=(0.0, 0.0, 0.02), tolerance=0.06, at="bowl", rest=True
        ),
    )
    variations = {
        "near": {**around("crucible", CRUCIBLE, 0.03), **around("bowl", BOWL, 0.03)},
        "wide": {
            **within("crucible", x=(0.68, 0.78), y=(-0.27, -0.12)),
            "stand.height": (0.1, 0.17),
            **within("crucible", mass=(1.3, 1.7), friction=(0.01, 0.03)),
            **within("grain", mass=(0.0015, 0.003), friction=(0.2, 0.5)),
            **within("bowl", x=(0.68, 0.78), y=(0.1, 0.22)),
        },
    }
    camera = Camera(position=(0.95, -0.72, 0.62), target=(0.62, 0.0, 0.14))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        height = draw("stand.height", STAND)
        mass = draw("grain.mass", 0.002)
        place = draw.pose("crucible", (*CRUCIBLE, height))
        friction = draw("grain.friction", 0.3)
        looks = (Geom(Sphere(GRAIN), color=MAIZE),)
        grains: list[Body] = []
        for radius, count in RINGS:
            for angle in np.arange(count) * 2 * np.pi / count:
                pose = place @ Pose.xyz_rpy(
                    (radius * np.cos(angle), radius * np.sin(angle), WALL + GRAIN)
                )
                name = GRAINS[len(grains)]
                grains.append(
                    Body(
                        name,
                        pose,
                        mass,
                        looks,
                        looks,
                        friction,
                        rolling_friction=0.0005,
                    )
                )
        iron = Body(
            "crucible",
            place,
            draw("crucible.mass", 1.5),
            *crucible(),
            draw("crucible.friction", 0.02),
        )
        dish = Body("bowl", draw.pose("bowl", (*BOWL, 0.0)), 0.0, *bowl())
        return Scene(
            (
                floor(),
                table(),
                Body("stand", place, 0.0, stand(height), stand(height)),
                dish,
                iron,
                *grains,
            )
        )

    def reward(self, start: State, end: State, trace: Trace | None = None) -> Array:
        """The share of the grains that lie in the bowl at rest, not carried; nothing while the crucible touches it."""
        assert trace is not None
        inside = []
        for name in GRAINS:
            x, y, z = split(end.relative(name, "bowl"))
            slow = speed(end, name) < STILL_M_S
            across, along, up = split(end.relative(name, "crucible"))
            # By the tool, or in the crucible, even if that rests on other grains.
            carried = trace.support.held(name)[..., -1] | (
                (np.hypot(across, along) < OUTSIDE) & (up > 0) & (up < HEIGHT)
            )
            inside.append(
                (np.hypot(x, y) < BOWL_RADIUS)
                & (z > 0)
                & (z < BOWL_HEIGHT)
                & slow
                & ~carried
            )
        return np.mean(inside, axis=0) * ~trace.touching_at_end("crucible", "bowl")
