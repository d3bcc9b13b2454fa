import numpy as np

from core.geometry import Array
from core.goals import Kept, Placed, Untouched, limits_margins
from core.interfaces import Task
from core.scene import (
    Body,
    Camera,
    Color,
    Margin,
    Pose,
    Scene,
    State,
    Trace,
    floor,
    table,
)
from core.values.layouts import around, within
from tasks.assets import board, disc, open_box, raised, revolved
from tasks.rewards import moved, split

# The middle of the board's near edge, on top; its x axis points from the robot.
PLACE = (0.39, 0.0)
TOP = 0.055
DEPTH = 0.34
WIDTH = 0.46
THICKNESS = 0.02
TRAY = (0.12, 0.48, 0.03)  # outer length, width and height
CARD = (0.04, 0.03, 0.003)
VASE = (0.17, 0.0)  # on the board
VASE_RADIUS = 0.022
VASE_HEIGHT = 0.12
CELLS = (
    *((0.25, y) for y in (-0.165, -0.0825, 0.0, 0.0825, 0.165)),
    *((0.17, y) for y in (-0.165, -0.09, 0.09, 0.165)),
    *((0.09, y) for y in (-0.124, -0.0413, 0.0413, 0.124)),
)
CARDS = tuple(f"card_{i}" for i in range(1, len(CELLS) + 1))
BY_S = 15.0
PRESS_N = 15.0
NUDGED_M = 0.01  # a vase that moves less counts as left alone

LACQUER: Color = (0.16, 0.17, 0.20, 1.0)
BEECH: Color = (0.72, 0.52, 0.33, 1.0)
CHINA: Color = (0.35, 0.60, 0.72, 1.0)
PAPER: tuple[Color, Color] = ((0.96, 0.95, 0.91, 1.0), (0.83, 0.25, 0.22, 1.0))


def vase(pose: Pose) -> Body:
    """A slender vase; its frame is below, in the middle of its foot."""
    profile = [
        (0, 0),
        (0.02, 0),
        (VASE_RADIUS, 0.045),
        (0.011, 0.09),
        (0.016, VASE_HEIGHT),
        (0, VASE_HEIGHT),
    ]
    shape = disc(VASE_RADIUS, VASE_HEIGHT, VASE_HEIGHT / 2, CHINA)
    return Body(
        "vase", pose, 0.2, (revolved(profile, CHINA, 40),), (shape,), friction=0.6
    )


class SweepCards(Task):
    """Sweep thirteen cards off a lacquered board, around a vase, into the tray below its edge.

    Task: get the cards into the tray within 15 s; don't touch the vase, and don't press on the board.
    Layouts: in ``near`` the board moves and turns a little with all that is on it; in ``wide`` it stands anywhere in
    front of the robot and slopes, cards and vase lie and stand elsewhere, and weight and friction of the cards differ.
    Success: all cards in the tray.
    """

    name = "SweepCards"
    description = (
        "A lacquered board, 0.34 m deep and 0.46 m wide, lies 0.055 m above the table; its frame is on its top, in the "
        "middle of the edge toward the robot, x pointing away from the robot. It slopes by up to 3 degrees. On it lie "
        "thirteen thin cards, 0.04 m by 0.03 m and 3 mm thick, and in their middle stands a slender vase, 0.12 m high "
        "and 0.044 m in diameter. In front of the board, below its near edge, stands an open tray, 0.1 m by 0.46 m "
        f"inside. Sweep the cards over that edge into the tray, within {BY_S:g} s after the motion begins: each counts "
        f"the same. Nothing is earned if the robot touches the vase, or presses on the board with more than "
        f"{PRESS_N:g} N."
    )
    in_words = (
        "A lacquered board stands above the table, its frame on its top, in the middle of the edge toward the robot; "
        "it may slope a little. On it lie thirteen thin cards, and in their middle stands a slender vase. In front of "
        "the board, below its near edge, stands an open tray. Sweep the cards over that edge into the tray, within 15 "
        "s after the motion begins: each counts the same. Nothing is earned if the robot touches the vase, or presses "
        "on the board with more than 15 N."
    )
    goals = (
        Placed(
            bodies=CARDS,
            place=(0.0, None, 0.02),
            tolerance=0.05,
            at="tray",
            by_s=BY_S,
        ),
        Untouched(("vase",)),
        Untouched(("board",), max_force_n=PRESS_N, mean=True),
        Kept(("vase",), kept_m=NUDGED_M),
    )
    variations = {
        "near": around("board", PLACE, 0.03, 0.15),
        "wide": {
            **within(
                "board",
                x=(0.36, 0.42),
                y=(-0.08, 0.08),
                yaw=(-0.2, 0.2),
                pitch=(-0.05, 0.05),
                roll=(-0.03, 0.03),
            ),
            **within("cards", mass=(0.003, 0.008), friction=(0.3, 0.6)),
            **{
                f"{name}.{axis}": (-0.012, 0.012)
                for name in ("vase", *CARDS)
                for axis in "xy"
            },
            **{f"{name}.yaw": (-3.14, 3.14) for name in CARDS},
        },
    }
    home = Pose(np.array([0.4, 0.0, 0.5]))
    camera = Camera(position=(0.05, -0.68, 0.78), target=(0.48, 0.02, 0.05))

    def scene(self, seed: int) -> Scene:
        """Places of the cards and the vase are from the middles of their cells, in the board's frame."""
        draw = self.draw(seed)
        upright = draw.pose("board", (*PLACE, TOP))
        frame = upright @ Pose.xyz_rpy(
            (0.0, 0.0, 0.0), (draw("board.roll", 0.0), draw("board.pitch", 0.0), 0.0)
        )
        slab = (
            board((DEPTH, WIDTH, THICKNESS), (DEPTH / 2, 0.0, -THICKNESS / 2), LACQUER),
        )
        box = open_box(*TRAY, 0.008, BEECH)
        below = upright @ Pose.xyz_rpy((-TRAY[0] / 2 - 0.004, 0.0, -TOP))
        mass = draw("cards.mass", 0.005)
        friction = draw("cards.friction", 0.4)
        cards = []
        for number, (name, (x, y)) in enumerate(zip(CARDS, CELLS, strict=True)):
            lies = draw.pose(name) @ raised(CARD[2] / 2)
            pose = frame @ Pose.xyz_rpy((x, y, 0.0)) @ lies
            looks = (board(CARD, (0.0, 0.0, 0.0), PAPER[number % 2]),)
            cards.append(Body(name, pose, mass, looks, looks, friction))
        return Scene(
            (
                floor(),
                table(),
                Body("board", frame, 0.0, slab, slab, friction=0.4),
                Body("tray", below, 0.0, box, box, friction=0.5),
                vase(frame @ Pose.xyz_rpy((*VASE, 0.0)) @ draw.pose("vase")),
                *cards,
            )
        )

    def reward(self, start: State, end: State, trace: Trace | None = None) -> Array:
        """The share of the cards that are in the tray in time and stay there; nothing for harm to vase or board."""
        assert trace is not None
        in_time = trace.times <= BY_S
        inside = [
            self.inside(end, name)
            * self.inside(trace.states, name)[..., in_time].any(axis=-1)
            for name in CARDS
        ]
        harmed = trace.touched("vase", "robot") | (
            trace.force_n("board", "robot") > PRESS_N
        )
        shifted = moved(start, end, "vase") > NUDGED_M
        return np.mean(inside, axis=0) * ~harmed * ~shifted

    def margins(
        self, start: State, end: State, trace: Trace | None = None
    ) -> list[Margin]:
        return limits_margins(self, start, end, trace)

    @staticmethod
    def inside(state: State, name: str) -> Array:
        """Whether a card's middle is within the tray, (...)."""
        x, y, z = split(state.relative(name, "tray"))
        return (np.abs(x) < TRAY[0] / 2) & (np.abs(y) < TRAY[1] / 2) & (z < TRAY[2])
