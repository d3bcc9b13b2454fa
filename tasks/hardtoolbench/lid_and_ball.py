import numpy as np

from core.geometry import Array
from core.goals import Away, Placed
from core.interfaces import Task
from core.scene import (
    Body,
    Camera,
    Pose,
    Scene,
    Sphere,
    State,
    Trace,
    floor,
    table,
)
from core.values.layouts import around, within
from tasks.assets import board, disc, ringed_post, vessel
from tasks.rewards import apart, length, progress, speed, split, z_axis

POT_RADIUS = 0.095
POT_HEIGHT = 0.16
WALL = 0.006
FLOOR = 0.006
# Of the post in the pot, above its floor; its top is a ring.
CUP_RADIUS = 0.009
RING_RADIUS = 0.007  # of its hole
CUP_HEIGHT = 0.04
BALL_RADIUS = 0.022
LID_RADIUS = 0.108
LID_THICKNESS = 0.008
# The lid's handle, a bar on two posts.
BRIDGE = 0.08
BRIDGE_HEIGHT = 0.04
BOWL_RADIUS = 0.045
BOWL_HEIGHT = 0.035
# Of the lid's middle from the pot's, m: from the first on it counts, from the second on fully.
ASIDE = (0.13, 0.25)
STILL_M_S = 0.05
# Speed, m/s: up to the first the lid was put down, from the second on dropped.
GENTLE = (0.4, 0.8)

IRON = (0.30, 0.34, 0.40, 1.0)
TIN = (0.62, 0.65, 0.70, 1.0)
YELLOW = (0.93, 0.72, 0.20, 1.0)
CLAY = (0.72, 0.42, 0.30, 1.0)


def lid(pose: Pose, mass: float, friction: float) -> Body:
    """A flat lid with a bridge across its middle, along y; its frame is in the middle of the plate."""
    thick = 0.008
    post = BRIDGE_HEIGHT - 0.008
    plate = disc(LID_RADIUS, LID_THICKNESS, 0.0, TIN)
    posts = (
        board(
            (thick, thick, post),
            (0.0, side * (BRIDGE - thick) / 2, (LID_THICKNESS + post) / 2),
            IRON,
        )
        for side in (-1, 1)
    )
    bar = board(
        (thick, BRIDGE, thick), (0.0, 0.0, LID_THICKNESS / 2 + post + thick / 2), IRON
    )
    parts = (plate, *posts, bar)
    return Body("lid", pose, mass, parts, parts, friction)


class LidAndBall(Task):
    """Take the lid off a pot, put it down, and bring the ball that stands inside to a bowl.

    Task: the lid must be put down on the table, and the ball end in the bowl.
    Layouts: in ``near`` the pot moves and turns a little; in ``wide`` pot and bowl stand anywhere before the robot,
    the lid is turned, and lid and ball are lighter or heavier, smoother or rougher.
    Success: the lid rests flat on the table, clear of the pot, and never fell faster than 0.4 m/s; the ball rests in
    the bowl.
    """

    name = "LidAndBall"
    description = (
        "A pot is fixed on the table, 0.19 m wide inside, too narrow for the hand, and 0.16 m high, with a loose "
        "flat lid on it, 0.216 m across. The lid, 0.25 to 0.5 kg, has a bridge as handle: a bar of 80 mm length and "
        "8 mm square along the lid's y axis, on two posts, with 32 mm of room below it. Inside the pot a ball of 44 "
        "mm diameter stands on a post 18 mm thick, whose top is 46 mm above the table. Take the lid off and put it "
        f"down flat on the table, clear of the pot; it must not fall faster than {GENTLE[0]:g} m/s. Then take the ball "
        "out and leave it in the clay bowl, 90 mm wide and 35 mm high."
    )
    in_words = (
        "A pot, too narrow for the hand, is fixed on the table, with a loose flat lid on it. The lid has a bridge as "
        "handle: a square bar on two posts, with room below it. Inside the pot a ball stands on a post. Take the lid "
        "off and put it down flat on the table, clear of the pot; it must not fall faster than 0.4 m/s. Then take the "
        "ball out and leave it in the clay bowl."
    )
    goals = (
        Away(bodies=("lid",), at="pot", away=ASIDE[1]),
        Placed(
            bodies=("ball",),
            at="bowl",
            place=(0.0, 0.0, None),
            tolerance=0.02,
            rest=True,
        ),
    )
    every = True
    variations = {
        "near": around("pot", (0.54, 0.0), 0.03, 0.2),
        "wide": {
            **within("pot", x=(0.48, 0.58), y=(-0.06, 0.06), yaw=(-0.3, 0.3)),
            **within("bowl", x=(0.4, 0.54), y=(-0.36, -0.29)),
            **within("lid", yaw=(-0.3, 0.3), mass=(0.25, 0.5), friction=(0.3, 0.6)),
            "ball.mass": (0.03, 0.09),
        },
    }
    camera = Camera(position=(1.15, -0.75, 0.7), target=(0.48, 0.03, 0.08))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        pose = draw.pose("pot", (0.54, 0.0, 0.0))
        turned = Pose.xyz_rpy(
            (0.0, 0.0, POT_HEIGHT + LID_THICKNESS / 2), (0.0, 0.0, draw("lid.yaw", 0.0))
        )
        parts = (
            *vessel(POT_RADIUS, POT_HEIGHT, WALL, FLOOR, IRON),
            *ringed_post(CUP_RADIUS, RING_RADIUS, CUP_HEIGHT, FLOOR, TIN),
        )
        bowl = vessel(BOWL_RADIUS, BOWL_HEIGHT, WALL, FLOOR, CLAY)
        stands = pose.apply(
            (
                0.0,
                0.0,
                FLOOR + CUP_HEIGHT + np.sqrt(BALL_RADIUS**2 - RING_RADIUS**2) + 1e-4,
            )
        )
        ball = Body.of(
            "ball",
            Sphere(BALL_RADIUS),
            stands,
            mass=draw("ball.mass", 0.05),
            color=YELLOW,
            rolling_friction=5e-4,
        )
        return Scene(
            (
                floor(),
                table(),
                Body("pot", pose, 0.0, parts, parts),
                Body("bowl", draw.pose("bowl", (0.47, -0.32, 0.0)), 0.0, bowl, bowl),
                lid(pose @ turned, draw("lid.mass", 0.35), draw("lid.friction", 0.4)),
                ball,
            )
        )

    def reward(self, start: State, end: State, trace: Trace | None = None) -> Array:
        """0.25 for the lid put down; if it counts, 0.25 for the way of a ball that is out of the pot, and 0.5 for one
        that was left in the bowl.
        """
        assert trace is not None
        aside = apart(end, "lid", "pot")
        flat = z_axis(end, "lid")[..., 2] > 0.99
        down = np.abs(end.position("lid")[..., 2] - LID_THICKNESS / 2) < 0.003
        falls = np.maximum(-trace.states.linear_velocity("lid")[..., 2], 0.0)
        sank = np.maximum(-np.diff(trace.states.position("lid")[..., 2], axis=-1), 0.0)
        # A lid that is let go may be faster between two instants, up to a free fall.
        alone = (
            np.hypot(falls[..., :-1], np.sqrt(2 * 9.81 * sank))
            * ~trace.contact("lid", "robot")[..., 1:]
        )
        fell = np.maximum(falls.max(axis=-1), alone.max(axis=-1, initial=0.0))
        lying = flat & down & (speed(end, "lid") < STILL_M_S)
        off = (
            np.interp(aside, ASIDE, (0.0, 1.0))
            * lying
            * np.interp(fell, GENTLE, (1.0, 0.0))
        )
        left, way = (
            length(state.position("ball") - state.position("bowl"))
            for state in (end, start)
        )
        out = apart(end, "ball", "pot") > POT_RADIUS + WALL
        still = speed(end, "ball") < STILL_M_S
        x, y, z = split(end.relative("ball", "bowl"))
        lies = (
            (np.hypot(x, y) < BOWL_RADIUS)
            & (z < BOWL_HEIGHT)
            & ~trace.touching_at_end("ball", "robot")
        )
        near = progress(np.maximum(left - BOWL_RADIUS, 0.0), way)
        there = np.where(lies, 1.0, near / 3) * out * still
        return off * (0.25 + 0.75 * there)
