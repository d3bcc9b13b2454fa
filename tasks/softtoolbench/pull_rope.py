import numpy as np

from core.geometry import Array
from core.goals import Placed
from core.interfaces import Task
from core.scene import (
    Body,
    Camera,
    Elastic,
    Geom,
    Pose,
    Rope,
    Scene,
    Soft,
    State,
    Trace,
    floor,
    table,
)
from core.values.layouts import around, within
from tasks.assets import board, round_wall
from tasks.rewards import length, progress

# Radius of the eye, length of the rest, and thickness, m.
EYE = 0.03
TAIL = 0.22
THICK = 0.008
NODES = 22  # of the rope
IN_EYE = 9  # the last of them are the eye
# From the ring to the middle of the eye, and its rest below the ring's middle, m.
BEHIND = 0.105
LEVEL = -0.02
THROUGH = 0.04  # m on the near side that the whole eye must be
OPENING = 0.057  # m; what passes a ring within it passes inside, what passes outside stays beyond it
HEMP = (0.72, 0.26, 0.20, 1.0)
WOOD = (0.66, 0.47, 0.29, 1.0)
STEEL = (0.48, 0.50, 0.54, 1.0)


def rest(pose: Pose) -> Body:
    """A plate and two rails that point from it toward -x, on a foot; the frame is the ring's."""
    plate = board((0.22, 0.12, 0.012), (BEHIND + 0.15, 0.0, LEVEL - 0.006), WOOD)
    rails = [
        board((0.09, 0.01, 0.012), (BEHIND, y, LEVEL - 0.006), WOOD)
        for y in (-0.022, 0.022)
    ]
    height = pose.position[2] + LEVEL - 0.012
    foot = board(
        (0.1, 0.1, height), (BEHIND + 0.2, 0.0, LEVEL - 0.012 - height / 2), WOOD
    )
    return Body(
        "rest", pose, 0.0, (plate, *rails, foot), (plate, *rails, foot), friction=0.4
    )


class PullRope(Task):
    """Pull the end of a rope through a ring.

    Task: the eye at the rope's end must end on the near side of the ring, the rope through it, its other end behind it.
    Layouts: in ``near`` the ring moves and turns a little with all that is behind it; in ``wide`` it stands anywhere in
    front of the robot, is higher or lower, wider or narrower, and the rope's place, weight and stiffness differ.
    Success: the whole eye is through, by 0.04 m.
    """

    name = "PullRope"
    description = (
        "A steel ring, 12 mm thick, its inner radius 45 to 55 mm, stands upright on a post, 0.2 to 0.3 m above the "
        "table; the frame of ring is in its middle, x is its axis and points away from the robot. Behind it, 0.02 m "
        "below its middle, a springy rope of 8 mm lies on a rest, along its axis. The rope ends in a round eye of 30 "
        "mm radius, whose middle is 0.105 m behind the ring, and which lies on two rails, 34 mm apart, open toward the "
        "ring. Pull the eye through the ring, until all of it is 0.04 m on the near side, and leave the other end of "
        "the rope behind the ring."
    )
    in_words = (
        "A steel ring stands upright on a post; x of its frame is its axis and points away from the robot. Behind it a "
        "springy rope lies on a rest, along that axis. The rope ends in a round eye, which lies on two rails that are "
        "open toward the ring. Pull the eye through the ring, until all of it is well on the near side, and leave the "
        "other end of the rope behind the ring."
    )
    goals = (
        Placed(bodies=("rope",), at="ring", place=(0.02, None, None), tolerance=0.05),
    )
    variations = {
        "near": around("ring", (0.66, 0.0), 0.03, 0.15),
        "wide": {
            **within(
                "ring",
                x=(0.64, 0.7),
                y=(-0.2, 0.2),
                z=(0.2, 0.3),
                yaw=(-0.25, 0.25),
                inner=(0.045, 0.055),
            ),
            **within(
                "rope",
                x=(-0.01, 0.01),
                density=(600, 1500),
                young=(8e6, 3e7),
                friction=(0.3, 0.6),
            ),
        },
    }
    camera = Camera(position=(0.2, -0.75, 0.6), target=(0.62, 0.0, 0.22))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        pose = draw.pose("ring", (0.66, 0.0, 0.25))
        inner = draw("ring.inner", 0.05)
        wall = round_wall(
            (inner, inner), (inner + 0.01, inner + 0.01), -0.006, 0.006, STEEL, 16
        )
        height = pose.position[2] - inner - 0.005
        post = board(
            (0.02, 0.02, height), (0.0, 0.0, -inner - 0.005 - height / 2), STEEL
        )
        upright = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0))
        parts = (*(Geom(part.shape, upright @ part.pose, STEEL) for part in wall), post)
        ring = Body("ring", pose, 0.0, parts, parts, friction=0.3)
        angles = np.linspace(0.0, 2 * np.pi * (1 - 1 / IN_EYE), 4 * IN_EYE)
        eye = [(EYE * float(np.cos(a)), EYE * float(np.sin(a)), 0.0) for a in angles]
        form = Rope(((EYE + TAIL, 0.0, 0.0), *eye), NODES, thickness=THICK)
        elastic = Elastic(
            draw("rope.density", 900),
            draw("rope.young", 1e7),
            friction=draw("rope.friction", 0.4),
        )
        lies = pose @ Pose.xyz_rpy(
            (BEHIND + draw("rope.x", 0.0), 0.0, LEVEL + THICK / 2 + 1e-4)
        )
        rope = Soft.make("rope", form, elastic, lies, color=HEMP)
        return Scene((floor(), table(), ring, rest(pose), rope))

    def reward(self, start: State, end: State, trace: Trace | None = None) -> Array:
        """Up to 0.09 on the way to the ring, then up to 1 by how far the whole eye is through it; 0.09 at most if the
        rope does not go through the ring once."""
        first = start.nodes("rope", "ring")
        last = end.nodes("rope", "ring")
        x = last[..., 0]
        beyond = last[..., 1:, 0]
        share = x[..., :-1] / np.where(x[..., :-1] == beyond, 1.0, x[..., :-1] - beyond)
        at = last[..., :-1, 1:] + share[..., None] * (
            last[..., 1:, 1:] - last[..., :-1, 1:]
        )
        crosses = (x[..., :-1] > 0) != (beyond > 0)
        inside = length(at) < OPENING
        threaded = (
            ((crosses & inside).sum(axis=-1) == 1)
            & ~(crosses & ~inside).any(axis=-1)
            & (x[..., 0] > 0)
        )
        behind, before = (
            nodes[..., -IN_EYE:, 0].max(axis=-1) for nodes in (last, first)
        )
        near = 0.09 * progress(np.maximum(behind, 0.0), before)
        return np.where(
            threaded, np.clip(0.1 - 0.9 * behind / THROUGH, near, 1.0), near
        )
