import numpy as np

from core.geometry import Array
from core.goals import Placed, Turned
from core.interfaces import Task
from core.scene import (
    Body,
    Box,
    Camera,
    Color,
    Geom,
    Pose,
    Scene,
    State,
    floor,
    table,
)
from core.values.layouts import around, within
from tasks.assets import board, hull, raised, turned
from tasks.rewards import length, progress, share, z_axis

# Of the plug's stem: square section and height.
SIDE = 0.028
STEM = 0.05
NECK = 0.014
NECK_HEIGHT = 0.02
HEAD = 0.15
HEAD_HEIGHT = 0.09
# Of the socket's hole, and the thickness of its bottom.
DEPTH = 0.04
BOTTOM = 0.01
# Of the hole's mouth: width and height.
CHAMFER = 0.004
SLOPE = 0.007
OUTER = 0.1  # side of the socket
SPARE = 0.005
DEEP = DEPTH - SPARE  # the plug is in

BLUE = (0.20, 0.38, 0.70, 1.0)
GREY = (0.62, 0.64, 0.67, 1.0)
DARK = (0.30, 0.32, 0.35, 1.0)
GREEN = (0.30, 0.60, 0.38, 1.0)


def plug(pose: Pose, mass: float, friction: float) -> Body:
    """A square stem, a thinner neck and a large head; its frame is below, in the middle of the stem's end."""
    parts = (
        board((SIDE, SIDE, STEM), (0.0, 0.0, STEM / 2), BLUE),
        board((NECK, NECK, NECK_HEIGHT), (0.0, 0.0, STEM + NECK_HEIGHT / 2), BLUE),
        board(
            (HEAD, HEAD, HEAD_HEIGHT),
            (0.0, 0.0, STEM + NECK_HEIGHT + HEAD_HEIGHT / 2),
            BLUE,
        ),
    )
    return Body("plug", pose, mass, parts, parts, friction)


def block(
    name: str, pose: Pose, hole: float, depth: float, chamfer: float, color: Color
) -> Body:
    """A fixed block with a square hole, down to the table; its frame is in the middle of the hole's mouth."""
    height = pose.position[2]
    slope = SLOPE * chamfer / CHAMFER
    wall = (OUTER - hole) / 2 - chamfer
    parts = [
        board((OUTER, OUTER, height - depth), (0.0, 0.0, -(depth + height) / 2), color)
    ]
    for side in range(4):
        turn = turned(side * np.pi / 2)
        length = OUTER if side % 2 else hole + 2 * chamfer
        place = turn @ Pose.xyz_rpy(((OUTER - wall) / 2, 0.0, -depth / 2))
        parts.append(Geom(Box((wall, length, depth)), place, color))
        if chamfer:
            near = hole / 2
            far = hole / 2 + chamfer
            outline = ((near, -depth), (far, -depth), (far, 0.0), (near, -slope))
            points = np.array([(x, y, z) for x, z in outline for y in (-far, far)])
            parts.append(Geom(hull(points), turn, DARK))
    return Body(name, pose, 0.0, tuple(parts), tuple(parts), friction=0.8)


class InsertPlug(Task):
    """Carry a plug with a large head from its stand to a socket, and put it in.

    Task: the plug must end in the socket's hole, upright, down to its bottom.
    Layouts: in ``near`` stand and socket move and turn a little; in ``wide`` they are anywhere on their side, turned,
    lower or higher, the hole is narrower or wider, the plug lighter or heavier, smoother or rougher.
    Success: the stem is 35 mm deep in the hole of 40 mm.
    """

    name = "InsertPlug"
    description = (
        "A plug stands upright in a fixed stand; its frame is at the lower end of its stem. The stem is 28 mm square "
        "and 50 mm high, then comes a neck, 14 mm square and 20 mm high, then a head, 150 mm square and 90 mm high. "
        "The plug weighs 0.4 to 0.8 kg. The stand's hole is 40 mm deep. A fixed socket has a square hole, 40 mm deep "
        "and 4 to 8 mm wider than the stem; its mouth, where the socket's frame is, has chamfers that are 4 mm wide. "
        "Stem and hole have the axes of plug and socket. Put the stem at least "
        f"{1000 * DEEP:g} mm deep into the hole, upright."
    )
    in_words = (
        "A plug stands upright in a fixed stand: a square stem below, a narrower neck, a wide head on top. A fixed "
        "socket has a square hole, a little wider than the stem, with chamfers around its mouth. Stem and hole have "
        "the axes of plug and socket. Put the stem at least 35 mm deep into the hole, upright."
    )
    goals = (
        Placed(
            bodies=("plug",),
            at="socket",
            place=(0.0, 0.0, -DEPTH),
            tolerance=SPARE,
            also=(Turned(axis=(0.0, 0.0, 1.0), at="socket"),),
        ),
    )
    variations = {
        "near": {
            **around("stand", (0.62, -0.2), 0.03, 0.2),
            **around("socket", (0.62, 0.2), 0.03, 0.2),
        },
        "wide": {
            **within(
                "stand",
                x=(0.57, 0.7),
                y=(-0.3, -0.15),
                yaw=(-0.5, 0.3),
                height=(0.05, 0.12),
            ),
            **within(
                "socket",
                x=(0.57, 0.7),
                y=(0.15, 0.3),
                yaw=(-0.3, 0.5),
                height=(0.05, 0.13),
            ),
            "clearance": (0.002, 0.004),
            **within("plug", mass=(0.4, 0.8), friction=(0.4, 0.7)),
        },
    }
    camera = Camera(position=(1.15, -0.35, 0.55), target=(0.52, 0.0, 0.1))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        stand = draw.pose("stand", (0.62, -0.2, 0.0)) @ raised(
            draw("stand.height", 0.08)
        )
        socket = draw.pose("socket", (0.62, 0.2, 0.0)) @ raised(
            draw("socket.height", 0.08)
        )
        fixed = (
            block("stand", stand, SIDE + 0.006, DEPTH, 0.0, GREY),
            block(
                "socket",
                socket,
                SIDE + 2 * draw("clearance", 0.003),
                DEPTH,
                CHAMFER,
                GREEN,
            ),
        )
        stands = stand @ raised(-DEPTH)
        return Scene(
            (
                floor(),
                table(),
                *fixed,
                plug(stands, draw("plug.mass", 0.6), draw("plug.friction", 0.55)),
            )
        )

    def reward(self, start: State, end: State) -> Array:
        """Up to 0.15 for the way to above the hole, the rest by depth in it; nothing for a plug that is not upright."""
        there = end.position("socket")
        plug = end.position("plug")
        off = length((plug - there)[..., :2])
        whole = length((start.position("plug") - there)[..., :2])
        depth = (there - plug)[..., 2]
        upright = z_axis(end, "plug")[..., 2] > 0.95
        # Its end can't be at such a place in any other way, below the mouth.
        inside = off < 0.007
        above = 0.15 * progress(off, whole) * (depth < 0.001)
        sunk = 0.15 + 0.85 * share(depth / DEEP)
        return np.where(inside & (depth > 0), sunk, above) * upright
