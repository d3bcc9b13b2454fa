import numpy as np

from core.geometry import Array
from core.goals import Placed
from core.interfaces import Task
from core.scene import (
    Body,
    Camera,
    Color,
    Cylinder,
    Geom,
    Pose,
    Scene,
    State,
    Trace,
    floor,
    table,
)
from core.values.joints import rotate
from core.values.layouts import around, within
from tasks.assets import board, hull, raised
from tasks.rewards import length, progress, speed

# Length, width and height, and the height of the lip at its tip.
PEG = 0.1
PEG_WIDTH = 0.01
LIP = 0.012
HANGS = 0.05  # from the peg's root to the ring, m
# Of the ring, along its radius and its axis.
SECTION = 0.01
AXIAL = 0.012
PIECES = 16
INNER = (0.034, 0.046)  # inner radius of the ring, m
SWINGS = 0.1  # m/s; a ring that hangs may sway a little
SINKS = 0.002  # m; an engine may let the ring sink so far into its peg
STEEL = (0.48, 0.50, 0.54, 1.0)
WOOD = (0.66, 0.47, 0.29, 1.0)
GREEN = (0.25, 0.62, 0.35, 1.0)
RED = (0.80, 0.20, 0.17, 1.0)


def post(name: str, pose: Pose, height: float, color: Color) -> tuple[Body, Body]:
    """A fixed post, and its peg toward -x; the peg's frame is at the middle of its upper face's root."""
    column = Geom(
        Cylinder(0.018, height + 0.03),
        Pose.xyz_rpy((0.018, 0.0, (height + 0.03) / 2)),
        WOOD,
    )
    foot = board((0.12, 0.12, 0.012), (0.018, 0.0, 0.006), WOOD)
    bar = board((PEG, PEG_WIDTH, PEG_WIDTH), (-PEG / 2, 0.0, -PEG_WIDTH / 2), color)
    lip = board((0.006, PEG_WIDTH, LIP), (0.003 - PEG, 0.0, LIP / 2), color)
    peg = Body(f"peg_{name}", pose @ raised(height), 0.0, (bar, lip), (bar, lip), 0.4)
    return Body(f"post_{name}", pose, 0.0, (column, foot), (column, foot)), peg


def ring(pose: Pose, inner: float, mass: float) -> Body:
    """A ring around x, of convex pieces."""
    outer = inner + SECTION
    half = AXIAL / 2
    stretch = 1 / np.cos(np.pi / PIECES)
    pieces = []
    for i in range(PIECES):
        corners = [
            (r * stretch, (i + k) * 2 * np.pi / PIECES)
            for r in (inner, outer)
            for k in (-0.5, 0.5)
        ]
        points = [
            (x, r * np.sin(a), r * np.cos(a)) for x in (-half, half) for r, a in corners
        ]
        pieces.append(Geom(hull(points), color=RED))
    return Body("ring", pose, mass, tuple(pieces), tuple(pieces), friction=0.4)


class HangRing(Task):
    """Take a ring off the peg of one post, and hang it on the peg of another.

    Task: the ring must end hanging at rest on the second peg, let go; arm and gripper must not touch it.
    Layouts: in ``near`` both posts move and turn a little; in ``wide`` they stand anywhere on their side, turned, their
    pegs are lower or higher, and the ring is smaller or larger, lighter or heavier.
    Success: the second peg goes through the ring, which rests and touches no part of the robot.
    """

    name = "HangRing"
    description = (
        "Two fixed posts stand on the table, each with a peg at peg_a and peg_b, which points from its post toward "
        "the robot side (along -x of the peg's frame, whose origin is at the root of the peg's upper face). A peg is "
        "0.1 m long, 10 mm wide and high, and its tip has a lip of 12 mm height. A steel ring wet with acid, 12 mm "
        "thick along its axis, its inner radius 34 to 46 mm, 0.1 to 0.3 kg heavy, hangs around peg_a, half-way along "
        "it. Lift it off and hang it on peg_b, let go. Only a tool may touch the ring: neither hand, fingers nor arm."
    )
    in_words = (
        "Two fixed posts stand on the table, each with a peg, peg_a and peg_b, which points from its post toward the "
        "robot side and has a lip at its tip. A steel ring wet with acid hangs around peg_a. Lift it off and hang it "
        "on peg_b, let go. Only a tool may touch the ring: neither hand, fingers nor arm."
    )
    goals = (
        Placed(
            bodies=("ring",),
            at="peg_b",
            place=(-HANGS, 0.0, -0.04),
            tolerance=0.04,
            rest=True,
        ),
    )
    variations = {
        "near": {
            **around("post_a", (0.62, -0.2), 0.03, 0.2),
            **around("post_b", (0.62, 0.2), 0.03, 0.2),
        },
        "wide": {
            **within(
                "post_a",
                x=(0.57, 0.7),
                y=(-0.3, -0.14),
                yaw=(-0.45, 0.3),
                height=(0.2, 0.35),
            ),
            **within(
                "post_b",
                x=(0.57, 0.7),
                y=(0.14, 0.3),
                yaw=(-0.3, 0.45),
                height=(0.2, 0.35),
            ),
            **within("ring", inner=INNER, mass=(0.1, 0.3)),
        },
    }
    camera = Camera(position=(0.12, -0.8, 0.68), target=(0.55, 0.0, 0.24))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        place_a = draw.pose("post_a", (0.62, -0.2, 0.0))
        place_b = draw.pose("post_b", (0.62, 0.2, 0.0))
        post_a, peg_a = post("a", place_a, draw("post_a.height", 0.28), STEEL)
        post_b, peg_b = post("b", place_b, draw("post_b.height", 0.28), GREEN)
        inner = draw("ring.inner", 0.04)
        hanging = peg_a.pose @ Pose.xyz_rpy((-HANGS, 0.0, 1e-5 - inner))
        bodies = (floor(), table(), post_a, peg_a, post_b, peg_b)
        return Scene((*bodies, ring(hanging, inner, draw("ring.mass", 0.2))))

    def reward(self, start: State, end: State, trace: Trace | None = None) -> Array:
        """Up to 0.12 on the way to the second peg, 0.6 with the peg through the ring's hole, 1 if let go and at rest;
        nothing for a ring touched by hand or arm, or one that fell."""
        assert trace is not None
        root = end.position("peg_b")
        middle = end.position("ring")
        reach, beside, slope = self.crossing(end, "peg_b")
        # At the start it hangs by its inner radius.
        inner = np.clip(self.crossing(start, "peg_a")[1], *INNER)
        around_it = (
            (reach > 0)
            & (reach < PEG)
            & (beside < inner + SINKS)
            & (np.abs(slope) > 0.5)
        )

        along = rotate(end.quaternion("peg_b"), np.array([-1.0, 0.0, 0.0]))
        there = root + HANGS * along - [0.0, 0.0, np.mean(INNER)]
        left, whole = (length(at - there) for at in (middle, start.position("ring")))
        up = (
            middle[..., 2]
            > np.minimum(root[..., 2], start.position("peg_a")[..., 2]) - 0.08
        )
        partial = 0.12 * progress(left, whole) * up

        swings = speed(end, "ring") > SWINGS
        hangs = np.where(trace.touching_at_end("ring", "robot") | swings, 0.6, 1.0)
        return np.where(around_it & up, hangs, partial) * ~trace.touched("ring", "arm")

    @staticmethod
    def crossing(state: State, peg: str) -> tuple[Array, Array, Array]:
        """Where the line of a peg's upper face crosses the ring's plane: how far from the peg's root and from the
        ring's middle, m, and the cosine of the angle between peg and ring's axis, (...) each."""
        root = state.position(peg)
        along = rotate(state.quaternion(peg), np.array([-1.0, 0.0, 0.0]))
        middle = state.position("ring")
        axis = rotate(state.quaternion("ring"), np.array([1.0, 0.0, 0.0]))
        slope = (along * axis).sum(axis=-1)
        reach = ((middle - root) * axis).sum(axis=-1) / np.where(
            np.abs(slope) < 0.1, np.inf, slope
        )
        return reach, length(root + reach[..., None] * along - middle), slope
