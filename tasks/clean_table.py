import numpy as np

from core.geometry import Array, Pose
from core.goals import Placed
from core.interfaces import Task
from core.scene import Body, Box, Camera, Geom, Scene, State, floor, table
from core.values.layouts import around, within
from tasks.rewards import length, progress

COUNT = 8
SIDE = 0.03
APART = 0.05  # least distance of two cubes' centres, more than a diagonal
# Ranges of the cubes' centres at the start.
LITTER_X = (0.5, 0.9)
LITTER_Y = (-0.2, 0.2)
CIRCLE = (1.1, 0.0)  # x, y of its centre
RADIUS = 0.15
# A cube counts as swept in if its centre is within this distance of the circle's.
INSIDE = RADIUS + 0.01
DUST = tuple(f"dust_{i}" for i in range(1, COUNT + 1))

COLORS = (
    (0.83, 0.18, 0.16, 1.0),
    (0.93, 0.55, 0.14, 1.0),
    (0.95, 0.82, 0.20, 1.0),
    (0.22, 0.45, 0.80, 1.0),
    (0.16, 0.66, 0.72, 1.0),
    (0.52, 0.30, 0.66, 1.0),
    (0.90, 0.45, 0.62, 1.0),
    (0.25, 0.25, 0.28, 1.0),
)


def litter(seed: int) -> list[tuple[float, float, float]]:
    """Random x, y and yaw of each cube; no two cubes touch."""
    rng = np.random.default_rng(seed)
    places: list[tuple[float, float, float]] = []
    while len(places) < COUNT:
        x = rng.uniform(*LITTER_X)
        y = rng.uniform(*LITTER_Y)
        yaw = rng.uniform(0.0, np.pi / 2)
        if all(np.hypot(x - other[0], y - other[1]) > APART for other in places):
            places.append((x, y, yaw))
    return places


class CleanTable(Task):
    """Sweep small cubes, the dust, together on the table, away from the robot.

    Task: push all dust into the circle.
    Layouts: the dust is scattered at random. In ``near`` the circle moves a little, too; in ``wide`` the patch of dust
    and the circle move, and the dust is lighter or heavier.
    Success: at least 95 % of the way into the circle, on the mean over the cubes.
    """

    name = "CleanTable"
    description = (
        "Eight small coloured cubes with a side of 0.03 m and a mass of 10 g each, the dust, lie scattered on the "
        "table, 0.5 to 0.9 m in front of the robot and up to 0.2 m to either side, at random. Sweep "
        f"them all away from the robot, into the green circle with a radius of {RADIUS:g} m around (1.1, 0), without "
        "pushing any off the table or past the circle."
    )
    in_words = (
        "Eight small coloured cubes, the dust, light ones, lie scattered on the table in front of the robot, at "
        "random. Sweep them all away from the robot, into the green circle, without pushing any off the table or past "
        "the circle."
    )
    success_reward = 0.95  # the paper's goals have no tolerance
    goals = (
        Placed(bodies=DUST, place=(0.0, 0.0, None), tolerance=INSIDE, at="circle"),
    )
    variations = {
        "near": around("circle", CIRCLE, 0.03),
        "wide": {
            **within("patch", x=(-0.05, 0.0), y=(-0.1, 0.1)),
            "dust.mass": (0.005, 0.02),
            **within("circle", x=(1.08, 1.15), y=(-0.15, 0.15)),
        },
    }
    camera = Camera(position=(1.75, -1.0, 1.15), target=(0.58, 0.0, 0.12), fov_deg=50.0)

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        part = (Geom(Box((SIDE, SIDE, SIDE))),)
        patch_x = draw("patch.x", 0.0)
        patch_y = draw("patch.y", 0.0)
        dust = tuple(
            Body(
                name,
                Pose.xyz_rpy((x + patch_x, y + patch_y, SIDE / 2), (0.0, 0.0, yaw)),
                draw("dust.mass", 0.01),
                (Geom(part[0].shape, color=color),),
                part,
            )
            for name, color, (x, y, yaw) in zip(DUST, COLORS, litter(seed), strict=True)
        )
        place = draw.position("circle", (CIRCLE[0], CIRCLE[1], 0.0))
        circle = Body.mark("circle", place, RADIUS, color=(0.30, 0.68, 0.33, 1.0))
        return Scene((floor(), table(), circle, *dust))

    def reward(self, start: State, end: State) -> Array:
        """The mean over the cubes: 1 for a cube in the circle, otherwise the fraction of its way to the centre."""
        rewards = []
        center = start.position("circle") + np.array([0.0, 0.0, SIDE / 2])
        for name in DUST:
            left = length(end.position(name) - center)
            whole = length(start.position(name) - center)
            rewards.append(np.where(left <= INSIDE, 1.0, progress(left, whole)))
        return np.mean(rewards, axis=0)
