import numpy as np

from core.geometry import Array
from core.goals import Placed
from core.interfaces import Task
from core.scene import (
    Body,
    Camera,
    Color,
    Pose,
    Scene,
    Sphere,
    State,
    floor,
    table,
)
from core.values.layouts import around, within
from tasks.assets import board
from tasks.rewards import share

RADIUS = 0.02
MASS = 0.005
# Along x, along y; JITTER: a sphere's largest offset on the grid.
ROWS = 5
COLUMNS = 6
PITCH = 0.048
JITTER = 0.003
CONTAINER = (0.7, 0.0)  # its centre
# REACH: from its centre to the middle of each of its three walls.
REACH = 0.15
WALL_HEIGHT = 0.20
WALL = 0.01
WANTED_HEIGHT = 0.3
NAMES = tuple(f"sphere_{number}" for number in range(1, ROWS * COLUMNS + 1))

GLASS = (0.55, 0.75, 0.85, 0.3)
COLORS: tuple[Color, ...] = (
    (0.88, 0.28, 0.25, 1.0),
    (0.95, 0.66, 0.20, 1.0),
    (0.25, 0.62, 0.38, 1.0),
    (0.24, 0.45, 0.78, 1.0),
    (0.60, 0.36, 0.66, 1.0),
)


def container(pose: Pose) -> Body:
    """Fixed see-through walls at -y, at +y and at +x; the floor is the table."""
    length = 2 * REACH
    inside = 2 * REACH - WALL
    walls = (
        *(
            board((length, WALL, WALL_HEIGHT), (0.0, y, 0.0), GLASS)
            for y in (-REACH, REACH)
        ),
        board((WALL, inside, WALL_HEIGHT), (REACH, 0.0, 0.0), GLASS),
    )
    return Body("container", pose, 0.0, walls, walls, friction=0.1)


def spheres(seed: int, move: Pose, mass: float) -> tuple[Body, ...]:
    """The spheres, on a grid with random offsets, nearer to the far wall than to the open side; moved with it."""
    jitter = np.random.default_rng(seed).uniform(-JITTER, JITTER, (ROWS, COLUMNS, 2))
    row, column = np.mgrid[:ROWS, :COLUMNS]
    x = CONTAINER[0] + 0.015 + (row - (ROWS - 1) / 2) * PITCH + jitter[..., 0]
    y = CONTAINER[1] + (column - (COLUMNS - 1) / 2) * PITCH + jitter[..., 1]
    return tuple(
        Body.of(
            name,
            Sphere(RADIUS),
            move.apply((x.flat[i], y.flat[i], RADIUS)),
            mass=mass,
            color=COLORS[i % len(COLORS)],
            rolling_friction=0.0005,
        )
        for i, name in enumerate(NAMES)
    )


class GatherSpheres(Task):
    """Scoop up thirty small spheres from between three walls, and hold them in the air.

    Task: lift as many of the spheres as possible above 0.3 m.
    Layouts: each sphere's place is a little random. In ``near`` the walls move a little with the spheres between them;
    in ``wide`` they move farther and turn, and the spheres are lighter or heavier.
    Success: 95 % of the way up, on the mean over the spheres.
    """

    name = "GatherSpheres"
    description = (
        "Thirty small spheres (radius 0.02 m, 5 g each) lie on the table between three fixed see-through walls: at "
        "y = -0.15, at y = 0.15 and, away from the robot, at x = 0.85, each 0.2 m high and 0.01 m thick and slippery. "
        "Between them it is open toward the robot (at x = 0.55) and on top, and the table is the floor. Scoop up as "
        f"many of the spheres as possible, lift them above z = {WANTED_HEIGHT:g} m, and hold them there."
    )
    in_words = (
        "Thirty small light spheres lie on the table between three fixed see-through walls, which are slippery: one on "
        "the left, one on the right and one away from the robot. Between them it is open toward the robot and on top, "
        "and the table is the floor. Scoop up as many of the spheres as possible, lift them above z = 0.3 m, and hold "
        "them there."
    )
    success_reward = 0.95  # the paper's goals have no tolerance
    goals = (
        Placed(bodies=NAMES, place=(None, None, WANTED_HEIGHT + 0.05), tolerance=0.05),
    )
    variations = {
        "near": around("container", CONTAINER, 0.03, 0.1),
        "wide": {
            **within("container", x=(0.64, 0.74), y=(-0.15, 0.15), yaw=(-0.3, 0.3)),
            "sphere.mass": (0.003, 0.008),
        },
    }
    camera = Camera(position=(1.45, -1.0, 0.9), target=(0.48, 0.0, 0.31))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        middle = (*CONTAINER, WALL_HEIGHT / 2)
        pose = draw.pose("container", middle)
        move = pose @ Pose(-np.array(middle))
        return Scene(
            (
                floor(),
                table(),
                container(pose),
                *spheres(seed, move, draw("sphere.mass", MASS)),
            )
        )

    def reward(self, start: State, end: State) -> Array:
        """The mean over the spheres: the fraction of the way from rest to the wanted height."""
        rest = np.stack([start.position(name)[..., 2] for name in NAMES], axis=-1)
        height = np.stack([end.position(name)[..., 2] for name in NAMES], axis=-1)
        return share((height - rest) / (WANTED_HEIGHT - rest)).mean(axis=-1)
