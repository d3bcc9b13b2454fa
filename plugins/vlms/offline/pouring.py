"""Take a loose container by its handles, and turn it over where the bodies in it are to go.

Handles are what stands out of the container on both sides. Two channels, open toward each other, slide over them from
behind. The flange points ahead meanwhile, so that the arm's last joint turns the container over.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from core.geometry import Pose
from plugins.vlms.offline.boxes import UP, heading_axes
from plugins.vlms.offline.chance import Range
from plugins.vlms.offline.guided import QUARTERS
from plugins.vlms.offline.heads import SIDES, Head, Piece, make_piece
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.subgoals import Subgoal

# A fork of channels, from the flange ahead.
_BACK_M = 0.018  # its plate and crossbar
_PLATE_M = (0.01, 0.06)  # thick and wide: it bears the container's weight at the flange
_ABOVE_PLATE_M = 0.07  # that a plate is longer than the channels are below the flange
_CROSSBAR_M = 0.03  # high
_LIP_M = 0.004  # thickness of a fork's channels
_INTO_M = 0.002  # parts reach into each other by this
_INNER = 0.3  # of a handle, from the container on, that the channel leaves free
# Of the channels below the flange: clear of the arm, and near its last joint.
_DROP_M = Range(0.07, 0.12)
_ROOM_M = Range(0.002, 0.005)  # around a handle, on each side
_GAP_M = Range(0.003, 0.012)  # between the crossbar and the container
_LONGER_M = Range(-0.03, 0.015)  # channels than handles

# Its way.
_BEHIND_M = Range(0.01, 0.03)  # the container
_ABOVE_M = Range(0.06, 0.15)  # from where it comes down
_TAKE_M_S = Range(0.1, 0.3)
_CLEAR_M = Range(0.01, 0.06)  # above everything near
_CARRY_M_S = Range(0.15, 0.4)
_ASIDE_RAD = Range(-0.5, 0.8)  # of the heading at the goal, by the way from the arm
_TURN_RAD = Range(2.2, 3.0)  # upside down, and what slopes inward empties, too
_SIDE = 0.5  # of the drop, aside, so that the container's mouth is above the goal once it is turned
_LEAST_STEPS = 3  # of the turn: with few it pours at once, with many bit by bit
_MOST_STEPS = 6
_SHAKE_M = 0.02


@dataclass(frozen=True, eq=False)
class Handles:
    """Parts that stand out of a loose container on both sides.

    Attributes:
        container: the subgoal of moving the container as its bodies are moved.
        heading: the one that is easiest to reach from the arm's side, radians.
        length: from where the container begins along the heading to where the handles end, metres.
        rear: where the container begins along the heading, from its centre, metres.
        low: the least height of the handles in the world, metres.
        high: the greatest height of the handles in the world, metres.
        inner: the container's half width without the handles, metres.
        outer: its half width with them, metres.
    """

    container: Subgoal
    heading: float
    length: float
    rear: float
    low: float
    high: float
    inner: float
    outer: float


def find_handles(subgoal: Subgoal) -> Handles | None:
    """Find handles of the bodies' loose container; None: it has none, or there is no such container.

    Handles are looked for along the two headings of the world's axes that are nearest to the way from the arm.

    Args:
        subgoal: of bodies that may be in a container.
    Returns:
        Measured along the better heading.
    """
    holder = subgoal.loose_container
    if holder is None:
        return None

    container = Subgoal((holder,), subgoal.shift, subgoal.model)
    boxes = container.boxes

    away = subgoal.workspace.direction(holder.position)
    nearest = sorted(QUARTERS, key=lambda turn: -np.cos(turn - away))

    for heading in nearest[:2]:
        ahead, side = heading_axes(heading)
        outstanding, halves = container.overhang(heading)

        right, left = boxes.ranges_along(side, container.center)
        on_left = (outstanding & (left > 0)).any()
        on_right = (outstanding & (right < 0)).any()

        if on_left and on_right and not outstanding.all():
            break
    else:
        return None

    lower, upper = boxes.bounds
    ends = boxes.ranges_along(ahead, container.center)[1]
    rear = ((container.points - container.center) @ ahead).min()

    return Handles(
        container,
        heading,
        length=ends[outstanding].max() - rear,
        rear=rear,
        low=lower[outstanding, 2].min(),
        high=upper[outstanding, 2].max(),
        inner=halves[~outstanding].max(),
        outer=halves[outstanding].max(),
    )


def make_pourer(
    subgoal: Subgoal,
    handles: Handles,
    rng: Generator,
    thickness_factor: float,
) -> Head:
    """Make channels that slide over the handles of the bodies' container.

    It is lifted, carried to the goal and turned over there by the arm's last joint: the flange points ahead, and the
    head's frame is the flange's: x along the axis of that joint.

    Args:
        subgoal: the bodies that are poured.
        handles: of their container.
        rng: random numbers.
        thickness_factor: how many times as thick as of the stiff default material the channels are.
    """
    drop = _DROP_M.draw(rng)
    room = _ROOM_M.draw(rng)

    gap = _GAP_M.draw(rng)
    pourer = _Pourer(
        subgoal,
        handles,
        length=handles.length + gap + _LONGER_M.draw(rng),
        drop=drop,
        room=room,
        lip=thickness_factor * _LIP_M,
        gap=gap,
    )

    return Head(
        "fork",
        "pour",
        tuple(pourer.make_pieces()),
        np.zeros(3),
        pourer.length,
        pourer.width,
        motion=pourer.pour,
        mount_pose=Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0)),
    )


@dataclass(frozen=True, eq=False)
class _Pourer:
    """Two channels, open toward each other, that slide over handles, and their motion; lengths in metres.

    Attributes:
        subgoal: the bodies that are poured.
        handles: of their container.
        length: of each channel.
        drop: how far they are below the flange.
        room: between a handle and the channel around it, on each side.
        lip: thickness of their walls.
        gap: between the crossbar and the container.
    """

    subgoal: Subgoal
    handles: Handles
    length: float
    drop: float
    room: float
    lip: float
    gap: float

    @property
    def outer(self) -> float:
        """Half of the space between the channels' webs, metres."""
        return self.handles.outer + self.room

    @property
    def width(self) -> float:
        """Across both channels, walls and all, metres."""
        return 2 * (self.outer + self.lip)

    def make_pieces(self) -> list[Piece]:
        """Make a plate below the flange, a crossbar, and the channels.

        The plate is the first piece, and bears the crossbar; that bears the channels.

        Returns:
            In the flange's frame.
        """
        drop = self.drop
        lip = self.lip
        handles = self.handles

        thick, wide = _PLATE_M
        plate_size = (thick, wide, drop + _ABOVE_PLATE_M)
        crossbar_size = (thick, self.width, _CROSSBAR_M)
        pieces = [
            make_piece("plate", thick / 2, 0.0, -drop / 2, plate_size),
            make_piece("crossbar", _BACK_M - thick / 2, 0.0, -drop, crossbar_size),
        ]

        inner = handles.inner + _INNER * (handles.outer - handles.inner)
        height = handles.high - handles.low + 2 * self.room
        x = _BACK_M - _INTO_M + self.length / 2

        web_size = (self.length + _INTO_M, lip, height + 2 * lip)
        edge_size = (self.length + _INTO_M, self.outer - inner + _INTO_M, lip)

        for name, side in SIDES:
            y = side * (self.outer + lip / 2)
            pieces.append(make_piece(f"{name}_web", x, y, -drop, web_size, 1))
            y = side * (inner + self.outer) / 2

            for edge, up in (("lower", -1.0), ("upper", 1.0)):
                z = -drop + up * (height + lip) / 2
                pieces.append(make_piece(f"{name}_{edge}", x, y, z, edge_size, 1))

        return pieces

    def pour(self, path: HeadPath, rng: Generator) -> str:
        """Take the container, carry it to the goal, turn it over in steps, and shake it once.

        Args:
            path: that waypoints are added to.
            rng: random numbers.
        """
        height = self._take(path, rng)

        # Carry the container to the goal.
        positions = [solid.position for solid in self.subgoal.solids]
        place = np.mean(positions, axis=0) + self.subgoal.shift
        heading = self.subgoal.workspace.direction(place) + _ASIDE_RAD.draw(rng)

        side = rng.choice([-1.0, 1.0])
        turn = side * _TURN_RAD.draw(rng)

        ahead, left = heading_axes(heading)
        back = self.gap + _BACK_M - self.handles.rear
        there = place - back * ahead - side * _SIDE * self.drop * left
        there[2] = height

        path.move(there, heading, _CARRY_M_S.draw(rng))

        # Turn it over, and shake it: what sticks to the wall falls then.
        steps = rng.integers(_LEAST_STEPS, _MOST_STEPS + 1)

        for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
            pose = Pose.xyz_rpy(there, (share * turn, 0.0, heading))
            path.add(pose, touch=True)

        shaken = there + _SHAKE_M * UP
        path.go(path.poses[-1], shaken, there, shaken, touch=True)

        degrees = np.degrees(abs(turn))
        carried = (
            f"slides over the handles, lifts, carries by {self.subgoal.length:.2f} m"
        )

        return f"{carried} and turns over by {degrees:.0f} degrees"

    def _take(self, path: HeadPath, rng: Generator) -> float:
        """Slide over the handles and lift the container; return the height at which it is carried, metres.

        Args:
            path: that waypoints are added to.
            rng: random numbers.
        """
        handles = self.handles
        container = handles.container

        heading = handles.heading
        ahead, _ = heading_axes(heading)

        back = handles.rear - self.gap - _BACK_M
        grasp = container.center + back * ahead
        grasp[2] = (handles.low + handles.high) / 2 + self.drop

        before = grasp - (self.length + _BEHIND_M.draw(rng)) * ahead
        path.go(heading, before + _ABOVE_M.draw(rng) * UP, before)

        path.move(grasp, heading, _TAKE_M_S.draw(rng))

        # High enough for the container to pass over everything near, upright and on its side.
        upright = grasp[2] - container.lower[2]
        lying = np.ptp(container.points[:, :2], axis=0).min() / 2
        height = self.subgoal.clear_height + max(upright, lying)

        height += _CLEAR_M.draw(rng)
        lifted = np.array([*grasp[:2], height])
        path.move(lifted, heading, _TAKE_M_S.draw(rng))
        path.hold()

        return float(height)
