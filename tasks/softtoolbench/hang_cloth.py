import numpy as np

from core.geometry import Array
from core.goals import Placed
from core.interfaces import Task
from core.scene import (
    Body,
    Camera,
    Cloth,
    Cylinder,
    Elastic,
    Geom,
    Pose,
    Scene,
    Soft,
    State,
    Trace,
    floor,
    table,
)
from core.values.layouts import around, within
from tasks.assets import board, raised
from tasks.rewards import length, progress, share, speed, split

# Length and radius of the bar, m.
BAR = 0.18
RADIUS = 0.008
# Of the cloth, along the slats and across, m.
LONG = 0.14
WIDE = 0.27
# Where they are, their width, and their height, m.
SLATS = (-0.125, -0.08, 0.0, 0.08, 0.125)
SLAT = 0.01
RACK = 0.16
SHARE = 0.3  # of the nodes on each side of a bar
STILL = 0.1  # m/s of a cloth at rest
LINEN = (0.86, 0.82, 0.70, 1.0)
WOOD = (0.66, 0.47, 0.29, 1.0)
STEEL = (0.48, 0.50, 0.54, 1.0)


def rack(pose: Pose) -> Body:
    """Slats that point from a beam toward -x; the frame is on the table, below the middle of the cloth."""
    beam = LONG / 2 + 0.02
    height = RACK - SLAT / 2
    slats = [board((LONG + 0.03, SLAT, SLAT), (0.005, y, height), WOOD) for y in SLATS]
    wall = board((0.02, SLATS[-1] * 2 + SLAT, RACK), (beam + 0.01, 0.0, RACK / 2), WOOD)
    return Body("rack", pose, 0.0, (*slats, wall), (*slats, wall), friction=0.4)


class HangCloth(Task):
    """Take a cloth from a rack, and hang it over a bar.

    Task: the cloth must end hanging down on both sides of the bar, at rest and let go; hand and arm must not touch it.
    Layouts: in ``near`` rack and bar move and turn a little; in ``wide`` they stand anywhere on their side, turned, the
    bar is lower or higher, and the cloth's weight, stiffness and friction differ.
    Success: at least three tenths of the cloth hang on each side of the bar; it touches nothing else.
    """

    name = "HangCloth"
    description = (
        "A cloth, 0.14 m by 0.27 m, lies on a rack of five slats, 0.16 m above the table. The frame of rack is on the "
        "table below the cloth's middle; the slats are 10 mm wide and high, lie at y = 0, 0.08 and 0.125 m on both "
        "sides in its frame, and are open toward -x of it. On the other side a post carries a round bar, 16 mm thick "
        "and 0.18 m long, that points from it toward the robot side: the frame of bar is at the top of its root, and "
        "it runs along -x of it. Hang the cloth over the bar, so that it hangs down on both sides of it, at rest and "
        "let go. The cloth is sterile: only a tool may touch it, neither hand, fingers nor arm."
    )
    in_words = (
        "A cloth lies on a rack of five slats, open toward the robot side. On the other side a post carries a "
        "round bar that points from it toward the robot side. Hang the cloth over the bar, so that it hangs down on "
        "both sides of it, at rest and let go. The cloth is sterile: only a tool may touch it, neither hand, fingers "
        "nor arm."
    )
    goals = (
        Placed(
            bodies=("cloth",),
            at="bar",
            place=(-BAR / 2, 0.0, -0.05),
            tolerance=0.06,
            rest=True,
        ),
    )
    variations = {
        "near": {
            **around("rack", (0.57, -0.2), 0.03, 0.2),
            **around("post", (0.66, 0.22), 0.03, 0.2),
        },
        "wide": {
            **within("rack", x=(0.54, 0.62), y=(-0.26, -0.18), yaw=(-0.3, 0.3)),
            **within(
                "post",
                x=(0.62, 0.7),
                y=(0.2, 0.28),
                yaw=(-0.3, 0.3),
                height=(0.26, 0.36),
            ),
            **within(
                "cloth", density=(150, 400), young=(4e4, 2e5), friction=(0.3, 0.7)
            ),
        },
    }
    camera = Camera(position=(0.0, -0.75, 0.72), target=(0.56, 0.0, 0.2))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        below = draw.pose("rack", (0.57, -0.2, 0.0))
        place = draw.pose("post", (0.66, 0.22, 0.0))
        height = draw("post.height", 0.3)
        column = Geom(
            Cylinder(0.018, height + 0.03),
            Pose.xyz_rpy((0.018, 0.0, (height + 0.03) / 2)),
            WOOD,
        )
        foot = board((0.12, 0.12, 0.012), (0.018, 0.0, 0.006), WOOD)
        rod = Geom(
            Cylinder(RADIUS, BAR),
            Pose.xyz_rpy((-BAR / 2, 0.0, -RADIUS), (0.0, np.pi / 2, 0.0)),
            STEEL,
        )
        elastic = Elastic(
            draw("cloth.density", 250),
            draw("cloth.young", 1e5),
            0.2,
            friction=draw("cloth.friction", 0.5),
        )
        form = Cloth((WIDE, LONG), (9, 4))
        lies = below @ Pose.xyz_rpy(
            (0.0, 0.0, RACK + form.thickness / 2), (0.0, 0.0, np.pi / 2)
        )
        return Scene(
            (
                floor(),
                table(),
                rack(below),
                Body("post", place, 0.0, (column, foot), (column, foot)),
                Body("bar", place @ raised(height), 0.0, (rod,), (rod,), friction=0.6),
                Soft.make("cloth", form, elastic, lies, color=LINEN),
            )
        )

    def reward(self, start: State, end: State, trace: Trace | None = None) -> Array:
        """Up to 0.15 on the way to the bar, more by the share on its lesser side for a cloth that hangs there, let go
        and at rest; nothing for a cloth that hand or arm touched."""
        assert trace is not None
        x, y, z = split(end.nodes("cloth", "bar"))
        over = (x < 0) & (x > -BAR - 0.02) & (z < 0.01)
        sides = [
            (over & (side * y > 0) & (z < -2 * RADIUS)).mean(axis=-1)
            for side in (-1, 1)
        ]
        hung = share(np.minimum(*sides) / SHARE)
        there = end.position("bar") - [0.0, 0.0, 0.05]
        left, whole = (length(at.position("cloth") - there) for at in (end, start))
        partial = 0.15 * progress(left, whole)
        hangs = trace.touching_at_end("cloth", "bar")
        for other in ("robot", "table", "rack", "post"):
            hangs = hangs & ~trace.touching_at_end("cloth", other)
        hangs = hangs & (speed(end, "cloth") < STILL)
        return np.where(hangs, np.maximum(hung, partial), partial) * ~trace.touched(
            "cloth", "arm"
        )
