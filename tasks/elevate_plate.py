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
    State,
    floor,
    table,
)
from core.values.layouts import around, within
from tasks.assets import raised, revolved, round_wall
from tasks.rewards import progress

# The plate stands on a foot; around the foot there is a gap of FOOT_HEIGHT between the plate and the table.
FOOT_RADIUS = 0.055
FOOT_HEIGHT = 0.018
# Flat, its underside on the foot.
DISC_RADIUS = 0.105
DISC_TOP = 0.024
# The rim leans outward, from the disc's edge.
RIM_RADIUS = 0.13
RIM_TOP = 0.036
# Radii of the rim's inner face, at FOOT_HEIGHT (within the disc) and at RIM_TOP.
RIM_INSIDE = (0.095, 0.127)
MASS = 0.5
# The plate's frame is in the middle of its foot, at the bottom.
START = (0.75, 0.0, 0.0)
LIFT = 0.4

CHINA = (0.95, 0.95, 0.93, 1.0)
BLUE = (0.20, 0.36, 0.62, 1.0)


@cache
def plate() -> Body:
    """The plate. Visual: a solid of revolution with a hollow foot and a blue line; collision: two discs and a ring."""
    slope = (RIM_TOP - FOOT_HEIGHT) / (RIM_INSIDE[1] - RIM_INSIDE[0])
    # Where the rim rises from the disc's upper face.
    face = RIM_INSIDE[0] + (DISC_TOP - FOOT_HEIGHT) / slope
    china = [
        (0.0, 0.012),
        (FOOT_RADIUS - 0.006, 0.012),
        (FOOT_RADIUS - 0.004, 0.0),
        (FOOT_RADIUS, 0.0),
        (FOOT_RADIUS, FOOT_HEIGHT),
        (DISC_RADIUS, FOOT_HEIGHT),
        (RIM_RADIUS, RIM_TOP),
        (RIM_INSIDE[1], RIM_TOP),
        (face, DISC_TOP),
        (0.0, DISC_TOP),
    ]
    low = 0.115
    high = 0.121
    up = 0.001
    line = [(r, FOOT_HEIGHT + (r - RIM_INSIDE[0]) * slope) for r in (low, high)]
    line += [(r, z + up) for r, z in reversed(line)]

    foot = Geom(Cylinder(FOOT_RADIUS, FOOT_HEIGHT), raised(FOOT_HEIGHT / 2))
    thickness = DISC_TOP - FOOT_HEIGHT
    disc = Geom(Cylinder(DISC_RADIUS, thickness), raised(FOOT_HEIGHT + thickness / 2))
    rim = round_wall(RIM_INSIDE, (DISC_RADIUS, RIM_RADIUS), FOOT_HEIGHT, RIM_TOP, CHINA)
    visuals = (revolved(china, CHINA), revolved(line, BLUE))
    return Body("plate", Pose(np.array(START)), MASS, visuals, (foot, disc, *rim))


class ElevatePlate(Task):
    """Lift a dinner plate from the table and keep it level.

    Task: lift the plate straight up by 0.4 m, and hold it.
    Layouts: in ``near`` the plate moves a little; in ``wide`` it stands anywhere in front of the robot, lighter or
    heavier.
    Success: the plate's middle within 2 cm of its place.
    """

    name = "ElevatePlate"
    description = (
        "A white dinner plate, 0.26 m across with a raised rim, 0.5 kg, stands on the table, 0.75 m in front of the "
        "robot. Its foot has a radius of 0.055 m, so that all around the foot there is a gap of 0.018 m between the "
        f"plate's underside and the table. Lift the plate straight up by {LIFT:g} m, level, and hold it there."
    )
    in_words = (
        "A white dinner plate with a raised rim stands on its foot on the table in front of the robot; all around the "
        "foot there is a narrow gap between the plate's underside and the table. Lift the plate straight up by 0.4 m, "
        "level, and hold it there."
    )
    success_reward = 0.95  # the paper's goals have no tolerance
    goals = (Placed(bodies=("plate",), place=(0.0, 0.0, LIFT), at="plate"),)
    variations = {
        "near": around("plate", START, 0.03),
        "wide": within("plate", x=(0.6, 0.8), y=(-0.25, 0.25), mass=(0.3, 0.7)),
    }
    camera = Camera(position=(1.45, -1.05, 0.95), target=(0.48, 0.0, 0.31))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        return Scene(
            (
                floor(),
                table(),
                replace(
                    plate(),
                    pose=draw.pose("plate", START),
                    mass=draw("plate.mass", MASS),
                ),
            )
        )

    def reward(self, start: State, end: State) -> Array:
        """The fraction of the lift (sum of absolute differences to the goal above the start): 1 at the goal."""
        wanted = start.position("plate") + np.array([0.0, 0.0, LIFT])
        left = np.abs(end.position("plate") - wanted).sum(axis=-1)
        return progress(left, LIFT)
