"""Take a loose container by its handles, and turn it over where the bodies in it are to go.

Handles are what stands out of the container on both sides. Two channels, open toward each other, slide over them from
behind. The flange points ahead meanwhile, so that the arm's last joint turns the container over.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from core.geometry import Array, Pose
from plugins.vlms.offline.boxes import UP, heading_axes
from plugins.vlms.offline.guided import QUARTERS
from plugins.vlms.offline.heads import SIDES, Head, Piece, make_piece
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.subgoals import Subgoal

_BACK_M = 0.018  # a fork's plate and crossbar, from the flange ahead
_LIP_M = 0.004  # thickness of a fork's channels


class Handles:
    """Parts that stand out of a loose container on both sides.

    Attributes:
        container: the subgoal of moving the container as its bodies are moved.
        heading: the one that is easiest to reach from the arm's side, radians.
        rear: where the container begins along the heading, from its centre, metres.
        front: where the handles end along the heading, from its centre, metres.
        low: the least height of the handles in the world, metres.
        high: the greatest height of the handles in the world, metres.
        inner: the container's half width without the handles, metres.
        outer: its half width with them, metres.
    """

    def __init__(self, container: Subgoal, heading: float) -> None:
        """Measure the handles of a container along a heading, radians about z.

        Args:
            container: the subgoal of moving it.
            heading: along which channels slide over the handles.
        """
        self.container = container
        self.heading = heading
        ahead, _ = heading_axes(heading)
        outstanding, halves = container.overhang(heading)
        lower, upper = container.boxes.bounds
        ends = container.boxes.ranges_along(ahead, container.center)[1]

        self.rear = float(((container.points - container.center) @ ahead).min())
        self.front = float(ends[outstanding].max())
        self.low = float(lower[outstanding, 2].min())
        self.high = float(upper[outstanding, 2].max())
        self.inner = float(halves[~outstanding].max())
        self.outer = float(halves[outstanding].max())


def find_handles(subgoal: Subgoal) -> Handles | None:
    """Find handles of the bodies' loose container; None: it has none, or there is no such container.

    Handles are looked for along the two headings of the world's axes that are nearest to the way from the arm.
    """
    holder = subgoal.loose_container
    if holder is None:
        return None

    container = Subgoal((holder,), subgoal.shift, subgoal.model)
    away = subgoal.workspace.direction(holder.position)
    nearest = sorted(QUARTERS, key=lambda turn: -np.cos(turn - away))

    for heading in nearest[:2]:
        outstanding, _ = container.overhang(heading)
        _, side = heading_axes(heading)
        right, left = container.boxes.ranges_along(side, container.center)
        on_left = (outstanding & (left > 0)).any()
        on_right = (outstanding & (right < 0)).any()
        if on_left and on_right and not outstanding.all():
            return Handles(container, heading)

    return None


@dataclass(frozen=True, eq=False)
class _Channels:
    """Two channels, open toward each other, that slide over handles; all in metres.

    Attributes:
        length: of each.
        drop: how far they are below the flange.
        inner: how far they reach to the middle.
        outer: half of the space between their webs.
        height: inside.
        lip: thickness of their walls.
        gap: between the crossbar and the container.
    """

    length: float
    drop: float
    inner: float
    outer: float
    height: float
    lip: float
    gap: float

    @property
    def width(self) -> float:
        """Across both channels, walls and all, metres."""
        return 2 * (self.outer + self.lip)

    def pieces(self) -> list[Piece]:
        """Return a plate below the flange, a crossbar, and the channels.

        The plate is the first piece, and bears the crossbar; that bears the channels.
        """
        drop = self.drop
        lip = self.lip
        plate_size = (0.01, 0.06, drop + 0.07)
        crossbar_size = (0.01, self.width, 0.03)
        pieces = [
            make_piece("plate", 0.005, 0.0, -drop / 2, plate_size),
            make_piece("crossbar", _BACK_M - 0.005, 0.0, -drop, crossbar_size),
        ]

        x = _BACK_M - 0.002 + self.length / 2
        web_size = (self.length + 0.002, lip, self.height + 2 * lip)
        edge_size = (self.length + 0.002, self.outer - self.inner + 0.002, lip)

        for name, side in SIDES:
            y = side * (self.outer + lip / 2)
            pieces.append(make_piece(f"{name}_web", x, y, -drop, web_size, 1))
            y = side * (self.inner + self.outer) / 2

            for edge, up in (("lower", -1.0), ("upper", 1.0)):
                z = -drop + up * (self.height + lip) / 2
                pieces.append(make_piece(f"{name}_{edge}", x, y, z, edge_size, 1))

        return pieces


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
    lip = thickness_factor * _LIP_M
    drop = rng.uniform(0.07, 0.12)
    room = rng.uniform(0.002, 0.005)
    gap = rng.uniform(0.003, 0.012)
    inner = handles.inner + 0.3 * (handles.outer - handles.inner)
    length = handles.front - handles.rear + gap + rng.uniform(-0.03, 0.015)
    height = handles.high - handles.low + 2 * room
    channels = _Channels(length, drop, inner, handles.outer + room, height, lip, gap)

    return Head(
        "fork",
        "pour",
        tuple(channels.pieces()),
        np.zeros(3),
        length,
        channels.width,
        motion=_Pouring(subgoal, handles, channels),
        mount_pose=Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0)),
    )


@dataclass(frozen=True, eq=False)
class _Pouring:
    """The motion of a pourer: it takes the container, carries it, and turns it over.

    Attributes:
        subgoal: the bodies that are poured.
        handles: of their container.
        channels: which slide over the handles.
    """

    subgoal: Subgoal
    handles: Handles
    channels: _Channels

    def __call__(self, path: HeadPath, rng: Generator) -> str:
        """Take the container, carry it to the goal, turn it over in steps, and shake it once.

        Args:
            path: that waypoints are added to.
            rng: random numbers.
        """
        height = self._take(path, rng)
        there_heading, there, turn = self._carry(path, height, rng)

        steps = int(rng.integers(3, 7))
        for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
            pose = Pose.xyz_rpy(there, (share * turn, 0.0, there_heading))
            path.add(pose, touch=True)

        shaken = there + 0.02 * UP
        path.go(path.poses[-1], shaken, there, shaken, touch=True)

        degrees = np.degrees(abs(turn))
        carried = (
            f"slides over the handles, lifts, carries by {self.subgoal.length:.2f} m"
        )
        return f"{carried} and turns over by {degrees:.0f} degrees"

    def _take(self, path: HeadPath, rng: Generator) -> float:
        """Slide over the handles and lift the container; return the height at which it is carried.

        Args:
            path: that waypoints are added to.
            rng: random numbers.
        """
        handles = self.handles
        container = handles.container
        heading = handles.heading
        ahead, _ = heading_axes(heading)
        back = handles.rear - self.channels.gap - _BACK_M
        grasp = container.center + back * ahead
        grasp[2] = (handles.low + handles.high) / 2 + self.channels.drop
        before = grasp - (self.channels.length + rng.uniform(0.01, 0.03)) * ahead
        path.go(heading, before + rng.uniform(0.06, 0.15) * UP, before)
        path.move(grasp, heading, rng.uniform(0.1, 0.3))

        # High enough for the container to pass over everything near, upright and on its side.
        upright = grasp[2] - container.lower[2]
        lying = float(np.ptp(container.points[:, :2], axis=0).min()) / 2
        height = self.subgoal.clear_height + max(upright, lying)
        height += rng.uniform(0.01, 0.06)
        lifted = np.array([*grasp[:2], height])
        path.move(lifted, heading, rng.uniform(0.1, 0.3))
        path.hold()

        return float(height)

    def _carry(
        self,
        path: HeadPath,
        height: float,
        rng: Generator,
    ) -> tuple[float, Array, float]:
        """Carry the container to the goal; return the heading there, the place (3,), and by how much it is turned.

        Args:
            path: that waypoints are added to.
            height: of the head, metres in the world.
            rng: random numbers.
        """
        positions = [solid.position for solid in self.subgoal.solids]
        place = np.mean(positions, axis=0) + self.subgoal.shift
        heading = self.subgoal.workspace.direction(place) + rng.uniform(-0.5, 0.8)
        side = float(rng.choice([-1.0, 1.0]))
        turn = side * rng.uniform(2.2, 3.0)

        ahead, left = heading_axes(heading)
        back = self.channels.gap + _BACK_M - self.handles.rear
        there = place - back * ahead - side * 0.5 * self.channels.drop * left
        there[2] = height
        path.move(there, heading, rng.uniform(0.15, 0.4))

        return heading, there, turn
