import numpy as np

from core.geometry import Array
from core.goals import Placed, Untouched
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
    Trace,
    floor,
    table,
)
from core.values.layouts import around, within
from tasks.assets import board, raised
from tasks.rewards import share, speed, split

# Of the track's frame: x points across it and away from the robot, y back to where the carts start.
PLACE = (0.68, 0.0)
# Height of the track and half its width.
TOP = 0.06
TRACK = 0.04
# Ends of the track along its y; beyond the second is the bin.
START = 0.66
END = -0.34
# Near edge of the deck before the track; height and thickness of the lid.
DECK = -0.1
LID = 0.115
PANE = 0.006
TRAY = (0.055, 0.2)  # x inside the tray
TRAY_FLOOR = 0.03  # its floor
FAR = 0.2  # the far wall
# Of a cart:
SIDE = 0.05
HEIGHT = 0.024
SPEED = 0.2  # of the carts
AT = 0.4  # where the blue one starts
GAP = 0.155  # from one cart to the next
STILL_M_S = 0.02

BLUE: Color = (0.16, 0.36, 0.76, 1.0)
RED: Color = (0.83, 0.25, 0.20, 1.0)
STEEL: Color = (0.55, 0.58, 0.62, 1.0)
GREEN: Color = (0.45, 0.62, 0.45, 1.0)
GLASS: Color = (0.75, 0.86, 0.92, 0.22)


def machine(pose: Pose) -> Body:
    """What stands around the track: a deck on this side, a tray on the far side, a bin at the end, a lid over it."""
    length = START - END
    middle = (START + END) / 2
    wall = 0.01
    tray = FAR - TRACK
    parts = (
        board(
            (-DECK - TRACK, length, TOP), ((DECK - TRACK) / 2, middle, TOP / 2), STEEL
        ),
        board(
            (tray, length, TRAY_FLOOR),
            (TRACK + tray / 2, middle, TRAY_FLOOR / 2),
            GREEN,
        ),
        board((wall, length, LID), (FAR + wall / 2, middle, LID / 2), STEEL),
        board((tray, wall, LID), (TRACK + tray / 2, START + wall / 2, LID / 2), STEEL),
        board((tray, wall, LID), (TRACK + tray / 2, END - wall / 2, LID / 2), STEEL),
        board(
            (FAR + wall - DECK, length, PANE),
            ((FAR + wall + DECK) / 2, middle, LID + PANE / 2),
            GLASS,
        ),
        board(
            (2 * TRACK, 0.2, 0.01), (0.0, END - 0.1, 0.005), GREEN
        ),  # the bin: floor, two sides, end
        *(
            board(
                (wall, 0.2, TOP), (side * (TRACK + wall / 2), END - 0.1, TOP / 2), STEEL
            )
            for side in (-1, 1)
        ),
        board(
            (2 * (TRACK + wall), wall, LID), (0.0, END - 0.2 - wall / 2, LID / 2), STEEL
        ),
    )
    return Body("machine", pose, 0.0, parts, parts, friction=0.6)


class StopCart(Task):
    """Push one of three moving carts off its track, at the right moment.

    Task: push the blue cart into the tray beside the track, and let the red ones before and behind it pass.
    Layouts: in ``near`` the track moves and turns a little; in ``wide`` it stands anywhere in front of the robot, the
    carts start elsewhere and follow at other distances, and their speed and mass differ by some per cent.
    Success: the blue cart at rest in the tray, the red ones untouched.
    """

    name = "StopCart"
    description = (
        "A straight track crosses in front of the robot, 0.06 m above the table; its frame has x across it, away from "
        "the robot, and y along it, to the robot's left. Three carts, 0.05 m wide and long and 0.024 m high, float "
        "on it without friction, 0.14 to 0.17 m from one to the next: a red one, the blue one, a red one. When the "
        "robot's motion begins they begin to move to the robot's right, along minus y, at some 0.2 m/s; the speed "
        "differs by up to 8 %. Push the blue cart off the track while it passes, into the green tray along the track's "
        "far side, where it must come to rest. The robot must not touch the red carts, which go on to the end of the "
        "track. From 0.06 m before the track to beyond the tray a glass lid leaves 0.055 m of height above the track, "
        "open toward the robot."
    )
    in_words = (
        "A straight track crosses in front of the robot; its frame has x across it, away from the robot, and y along "
        "it, to the robot's left. Three small carts float on it without friction, one after another: a red one, the "
        "blue one, a red one. When the robot's motion begins they begin to move to the robot's right, all at one "
        "speed, and pass the middle of the robot's front after some two seconds. Push the blue cart off the track "
        "while it passes, into the green tray along the track's far side, where it must come to rest. The robot must "
        "not touch the red carts, which go on to the end of the track. From a little before the track to beyond the "
        "tray a glass lid leaves low room above the track, open toward the robot."
    )
    goals = (
        Placed(
            bodies=("cart",),
            place=(sum(TRAY) / 2, None, None),
            tolerance=0.07,
            at="track",
            rest=True,
        ),
        Untouched(("red_before", "red_behind")),
    )
    variations = {
        "near": around("track", PLACE, 0.03, 0.15),
        "wide": {
            **within("track", x=(0.64, 0.72), y=(-0.1, 0.1), yaw=(-0.3, 0.3)),
            **within("cart", y=(0.36, 0.44), mass=(0.08, 0.2)),
            "before.gap": (0.14, 0.17),
            "behind.gap": (0.14, 0.17),
            "speed": (0.92 * SPEED, 1.08 * SPEED),
        },
    }
    home = Pose(np.array([0.27, 0.0, 0.36]))
    hold_s = 2.0
    camera = Camera(position=(0.05, -0.75, 0.8), target=(0.58, 0.06, 0.05))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        frame = draw.pose("track", (*PLACE, 0.0))
        at = draw("cart.y", AT)
        mass = draw("cart.mass", 0.12)
        velocity = frame.rotation.apply([0.0, -draw("speed", SPEED), 0.0])
        bed = (
            board(
                (2 * TRACK, START - END, TOP),
                (0.0, (START + END) / 2, TOP / 2),
                (0.88, 0.90, 0.93, 1.0),
            ),
        )
        track = Body("track", frame, 0.0, bed, bed, friction=0.0)
        places = {
            "cart": at,
            "red_before": at - draw("before.gap", GAP),
            "red_behind": at + draw("behind.gap", GAP),
        }
        carts = []
        for name, along in places.items():
            body = (
                Geom(Box((SIDE, SIDE, HEIGHT)), color=BLUE if name == "cart" else RED),
            )
            stripe = Geom(Box((0.006, SIDE - 0.01, 0.001)), raised(HEIGHT / 2))
            pose = frame @ Pose.xyz_rpy((0.0, along, TOP + HEIGHT / 2))
            x, y, z = velocity
            carts.append(
                Body(
                    name,
                    pose,
                    mass,
                    (*body, stripe),
                    body,
                    friction=0.5,
                    velocity=(x, y, z),
                )
            )
        return Scene((floor(), table(), track, machine(frame), *carts))

    def reward(self, start: State, end: State, trace: Trace | None = None) -> Array:
        """1 for the blue cart at rest in the tray, at most a half for its way there; 0 if a red one is not let pass."""
        assert trace is not None
        aside = TRACK - SIDE / 2  # what lies in the bin may be so far from the middle
        across, _, height = split(end.relative("cart", "track"))
        inside = (across > TRAY[0]) & (across < TRAY[1]) & (height < TOP)
        slow = speed(end, "cart") < STILL_M_S
        earned = np.where(
            inside & slow, 1.0, share((across - aside) / (TRAY[0] - aside)) / 2
        )
        for name in ("red_before", "red_behind"):
            aside, along, _ = split(end.relative(name, "track"))
            before = start.linear_velocity(name)
            now = end.linear_velocity(name)
            goes_on = (before * now).sum(axis=-1) > 0.8 * (before * before).sum(axis=-1)
            passes = (np.abs(aside) < TRACK) & ((along < END) | goes_on)
            earned = earned * (passes & ~trace.touched(name, "robot"))
        return earned
