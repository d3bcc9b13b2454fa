"""Carry a head: bars from the mount to where it is attached, as thick as they must be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from core.design import RIGID_MOUNT, Component, Tool
from core.geometry import Array, Box, Color, Pose
from core.interfaces import Material
from plugins.vlms.offline.heads import Head
from plugins.vlms.offline.recipe import Shaft
from plugins.vlms.offline.sections import find_thickness, measure_leverage

_LEAST_BAR_M = 0.01  # a bar is at least so thick, to be made,
_MOST_BAR_M = 0.04  # and at most, to find room
_SOCKET_M = (0.05, 0.05, 0.012)  # it covers a flange
_BRIDGE_M = 0.06  # a bridge goes up by so much, over the mount or the head
_BEND_SHARE = 0.35  # of the way out, a bridge goes before it goes up
_BESIDE_ARM_M = 0.11  # so far out at least, where the arm's last links are not
_UPRIGHT = 0.02  # the slope of a bar that counts as upright

_STEEL: Color = (0.30, 0.33, 0.38, 1.0)
HEAD_COLOR: Color = (0.90, 0.49, 0.13, 1.0)


def build_tool(
    head: Head,
    mount: Pose,
    shaft: Shaft | None,
    load: float,
    material: Material,
    name: str,
) -> Tool:
    """Build a rigid tool: a socket at the flange, bars, and the head.

    Args:
        head: its working end.
        mount: the head's pose in the frame of the tool mount.
        shaft: carries the head; None: that is on the flange itself.
        load: that it bears, newtons.
        material: of which it is made.
        name: of the way of using it.
    """
    builder = Builder({RIGID_MOUNT: Pose()}, load, material)
    bearer = RIGID_MOUNT
    text = head.text

    if shaft is not None:
        end = mount.apply(head.attach)
        foot = np.array([0.0, 0.0, -_SOCKET_M[2]])
        length = float(np.abs(end - foot).sum())
        tip = mount.apply(head.tip)
        bearer = builder.add("socket", bearer, Pose(foot / 2), _SOCKET_M)
        bearer = builder.add_bars("bar", bearer, shaft, foot, end, tip)
        text += f", on a {shaft} {length:.2f} m long"
        name += f"_{shaft}"

    names: list[str] = []
    for piece in head.pieces:
        parent = names[piece.parent] if names else bearer
        pose = mount @ piece.pose
        names.append(
            builder.add(piece.name, parent, pose, piece.shape.size, HEAD_COLOR)
        )

    return Tool(tuple(builder.components), name=name, description=text)


def _list_bars(
    shaft: Shaft, start: Array, end: Array, thick: float
) -> list[tuple[Array, Array]]:
    """List where the bars of a shaft begin and end, in the frame of the tool mount.

    Args:
        shaft: its kind.
        start: where the first one begins, (3,): below the middle of the socket.
        end: where the last one ends, (3,).
        thick: of each.
    """
    half = thick / 2
    high = start[2] - half
    level = np.array([0.0, 0.0, half])
    far = np.hypot(*(end - start)[:2])
    points: Sequence[Array]

    if far < thick:
        points = [start, end]
    elif shaft == "gantry":
        points = [np.array([*start[:2], high]), np.array([*end[:2], high]), end]
    elif shaft == "elbow":
        low = min(end[2] + half, high)
        points = [start, np.array([*start[:2], low]), end + level]
    elif shaft == "slope":
        points = [start - level, end]
    else:
        top = max(high, end[2]) + _BRIDGE_M
        bend = start + min(1.0, max(_BEND_SHARE, _BESIDE_ARM_M / far)) * (end - start)
        points = [
            np.array([*start[:2], high]),
            np.array([*bend[:2], high]),
            np.array([*bend[:2], top]),
            np.array([*end[:2], top]),
            end,
        ]

    return [
        (first, second)
        for first, second in pairwise(points)
        if np.linalg.norm(second - first) > half
    ]


class Builder:
    """Collects the boxes of a tool, with poses in the frame of the tool mount.

    Args:
        mounts: the poses of what the tool hangs from.
        load: that the tool bears, newtons.
        material: of which it is made.

    Attributes:
        components: of the tool.
    """

    def __init__(
        self, mounts: Mapping[str, Pose], load: float, material: Material
    ) -> None:
        self.components: list[Component] = []
        self._poses = dict(mounts)
        self._load = load
        self._material = material

    def add(
        self,
        name: str,
        parent: str,
        pose: Pose,
        size: Sequence[float],
        color: Color = _STEEL,
    ) -> str:
        """Add a box of full sides (3,) at a pose, and return its name."""
        x, y, z = (float(side) for side in size)
        local = self._poses[parent].inverse() @ pose
        self.components.append(
            Component(name, parent, local, Box((x, y, z)), color=color)
        )
        self._poses[name] = pose
        return name

    def add_bars(
        self,
        name: str,
        parent: str,
        shaft: Shaft,
        start: Array,
        end: Array,
        tip: Array,
    ) -> str:
        """Add the bars of a shaft, as thick as they must be, and return the last one's name.

        Args:
            name: of the bars, before their numbers.
            parent: the name of what bears the shaft.
            shaft: its kind.
            start: where it begins, (3,).
            end: where it ends, (3,).
            tip: where the load acts, (3,).
        """
        bars = _list_bars(shaft, start, end, _LEAST_BAR_M)
        thick = find_thickness(
            self._load,
            max(float(np.linalg.norm(bar_start - tip)) for bar_start, _ in bars),
            measure_leverage(bars, tip),
            self._material,
            least=_LEAST_BAR_M,
            most=_MOST_BAR_M,
        )
        last = parent
        for number, (first, second) in enumerate(_list_bars(shaft, start, end, thick)):
            last = self._add_bar(f"{name}_{number}", last, first, second, thick)
        return last

    def _add_bar(
        self, name: str, parent: str, start: Array, end: Array, thick: float
    ) -> str:
        """Add a square bar between two points (3,); what is not upright is longer by half its thickness at each end."""
        way = end - start
        length = float(np.linalg.norm(way))
        middle = (start + end) / 2
        if np.hypot(way[0], way[1]) < _UPRIGHT * length:
            return self.add(name, parent, Pose(middle), (thick, thick, length))

        rpy = (0.0, -np.arcsin(way[2] / length), np.arctan2(way[1], way[0]))
        size = (length + thick, thick, thick)
        return self.add(name, parent, Pose.xyz_rpy(middle, rpy), size)
