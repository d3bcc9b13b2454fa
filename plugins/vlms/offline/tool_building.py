"""Build a tool: a head, and a shaft of bars that connects it to the mount."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, Tool
from core.geometry import Array, Box, Color, Pose
from plugins.vlms.offline.heads import Head
from plugins.vlms.offline.tool_parts import FINGERTIP, MOUNTS

_STEEP = 0.02  # the slope of a bar that counts as upright
_STRAIGHT_M = 0.02  # a head so near below the mount is borne by a post alone
_SOCKET_M = (0.05, 0.05, 0.012)  # which covers a flange
_SLEEVE_M = (0.02, 0.018, 0.024)  # which covers a fingertip
_INTO_PAD_M = 0.003  # how far a bar goes into a pad
_FACE_M = 0.008  # from a head's attachment ahead to its face

SHAFTS = {
    "gantry": "a boom and a drop",
    "slope": "a sloping shaft",
    "elbow": "a post and a low arm",
    "riser": "a riser and a jib",
}
"""Kinds of shafts, and what they consist of."""

_SHAFT_COLOR = (0.30, 0.33, 0.38, 1.0)
_FIRST_COLOR = (0.90, 0.49, 0.13, 1.0)
_NEXT_COLORS = (
    (0.16, 0.50, 0.73, 1.0),
    (0.18, 0.63, 0.42, 1.0),
    (0.75, 0.22, 0.17, 1.0),
)


@dataclass(frozen=True)
class Shaft:
    """How a head is carried.

    Attributes:
        kind: of `SHAFTS`.
        thickness: of its bars, metres.
        bend: of a riser, the fraction of the way at which it goes up.
        top: of a riser, the height to which it goes up, metres over the tool mount.
    """

    kind: str
    thickness: float
    bend: float = 0.5
    top: float = 0.0


class ToolBuilder:
    """Collects the boxes of a tool, with poses in the frame of the tool mount.

    builder = ToolBuilder(gripper=False)
    bar = builder.add_shaft(Shaft("gantry", thickness=0.02), end, left=True)
    builder.add_head(head, bar, pose)
    tool = builder.build("gantry_blade", "a blade, carried by a boom and a drop")
    """

    def __init__(self, gripper: bool) -> None:
        self._gripper = gripper
        self._poses = dict(MOUNTS)
        self._components: list[Component] = []

    def build(self, name: str, description: str) -> Tool:
        """Return the tool with all boxes that were added."""
        return Tool(tuple(self._components), self._gripper, name, description)

    def add_box(
        self,
        name: str,
        parent: str,
        pose: Pose,
        size: Sequence[float],
        color: Color = _SHAFT_COLOR,
    ) -> str:
        """Add a box of full sides (3,), and return its name.

        Args:
            name: of the component.
            parent: the name of a component, or of a mount.
            pose: in the frame of the tool mount.
            size: full sides (3,), metres.
            color: red, green, blue and opacity, 0..1.
        """
        x, y, z = (float(side) for side in size)
        local = self._poses[parent].inverse() @ pose
        component = Component(name, parent, local, Box((x, y, z)), color=color)
        self._components.append(component)
        self._poses[name] = pose

        return name

    def add_bar(
        self,
        name: str,
        parent: str,
        start: Array,
        end: Array,
        thickness: float,
    ) -> str:
        """Add a square bar between two points (3,). If it is not upright, each end is longer by half its thickness.

        Args:
            name: of the component.
            parent: the name of a component, or of a mount.
            start: in the frame of the tool mount.
            end: in the frame of the tool mount.
            thickness: metres.
        """
        way = end - start
        middle = (start + end) / 2
        length = float(np.linalg.norm(way))
        if np.hypot(way[0], way[1]) < _STEEP * length:
            upright = (thickness, thickness, length)
            return self.add_box(name, parent, Pose(middle), upright)

        rpy = (0.0, -np.arcsin(way[2] / length), np.arctan2(way[1], way[0]))
        size = (length + thickness, thickness, thickness)
        return self.add_box(name, parent, Pose.xyz_rpy(middle, rpy), size)

    def add_head(self, head: Head, parent: str, pose: Pose) -> None:
        """Add the head's pieces, with the head at a pose.

        Args:
            head: whose first piece is borne by the shaft.
            parent: the name of the last bar, or of a mount.
            pose: of the head in the frame of the tool mount.
        """
        names: list[str] = []
        for number, piece in enumerate(head.pieces):
            color = _FIRST_COLOR
            if number > 0:
                color = _NEXT_COLORS[(number - 1) % len(_NEXT_COLORS)]

            bearer = names[piece.parent] if names else parent
            placed = pose @ piece.pose
            names.append(self.add_box(piece.name, bearer, placed, piece.size, color))

    def add_shaft(self, shaft: Shaft, end: Array, *, left: bool) -> str:
        """Add bars from the mount to a point (3,), and return the name of the last one.

        With a gripper, the mount is the left or the right finger.

        Args:
            shaft: its kind and its measures.
            end: where the head is attached, in the frame of the tool mount.
            left: whether it begins at the left finger.
        """
        thickness = shaft.thickness
        prefix = ""
        if self._gripper:
            prefix = "left_" if left else "right_"

        root, start = self._add_root(prefix, thickness, left=left)

        if np.hypot(*(end - start)[:2]) < _STRAIGHT_M:
            top = np.array([*end[:2], start[2] + thickness / 2])
            return self.add_bar(f"{prefix}post", root, top, end, thickness)

        last = root
        here = start
        if shaft.kind == "elbow":
            here = start + np.array([0.0, 0.0, thickness / 2])

        for name, there in _shaft_points(shaft, start, end):
            last = self.add_bar(prefix + name, last, here, there, thickness)
            here = there

        return last

    def _add_root(
        self,
        prefix: str,
        thickness: float,
        *,
        left: bool,
    ) -> tuple[str, Array]:
        """Add what a shaft begins with, and return its name, and where the first bar begins, (3,).

        Args:
            prefix: of its name, on a finger.
            thickness: of the shaft's bars, metres.
            left: see `add_shaft`.
        """
        if not self._gripper:
            pose = Pose(np.array([0.0, 0.0, -_SOCKET_M[2] / 2]))
            root = self.add_box("socket", RIGID_MOUNT, pose, _SOCKET_M)
            return root, np.array([0.0, 0.0, -thickness / 2])

        side = -1.0 if left else 1.0
        tip = FINGERTIP * np.array([1.0, side, 1.0])
        mount = GRIPPER_MOUNTS[0 if left else 1]
        pose = Pose(tip - np.array([0.0, 0.0, _SLEEVE_M[2] / 2]))
        root = self.add_box(f"{prefix}sleeve", mount, pose, _SLEEVE_M)

        return root, tip - np.array([0.0, 0.0, _SLEEVE_M[2] + thickness / 2])


def _shaft_points(shaft: Shaft, start: Array, end: Array) -> list[tuple[str, Array]]:
    """Return the names of a shaft's bars, and where each ends, (3,).

    Args:
        shaft: its kind and its measures.
        start: where the first bar begins, (3,).
        end: where the last bar ends, (3,).
    """
    if shaft.kind == "slope":
        return [("shaft", end)]

    if shaft.kind == "elbow":
        low = np.array([*start[:2], end[2] + shaft.thickness / 2])
        return [("post", low), ("arm", end)]

    if shaft.kind == "gantry":
        return [("boom", np.array([*end[:2], start[2]])), ("drop", end)]

    foot = (start + shaft.bend * (end - start))[:2]
    return [
        ("boom", np.array([*foot, start[2]])),
        ("riser", np.array([*foot, shaft.top])),
        ("jib", np.array([*end[:2], shaft.top])),
        ("drop", end),
    ]


def build_clamp(head: Head, pose: Pose, thickness: float) -> Tool:
    """Build a mirrored pair of finger extensions, with the head at ``pose`` in the frame of the tool mount.

    Args:
        head: two pads, the left one first.
        pose: of the middle between them.
        thickness: of the bars, metres.
    """
    builder = ToolBuilder(gripper=True)
    shaft = Shaft("gantry", thickness)
    for piece, is_left in zip(head.pieces, (True, False), strict=True):
        pad = pose @ piece.pose
        top = pad.position + np.array([0.0, 0.0, piece.size[2] / 2 - _INTO_PAD_M])
        bar = builder.add_shaft(shaft, top, left=is_left)
        builder.add_box(piece.name, bar, pad, piece.size, _FIRST_COLOR)

    reach = np.linalg.norm(pose.position)
    text = f"two pads {head.width:.3f} m apart, {reach:.2f} m from the hand, that close on the body"
    return builder.build("long_fingers", text)


def build_pourer(head: Head, pose: Pose) -> Tool:
    """Build a head that needs no shaft, at ``pose`` in the frame of the tool mount.

    Args:
        head: two channels.
        pose: of the head, which has no shaft.
    """
    builder = ToolBuilder(gripper=False)
    builder.add_head(head, RIGID_MOUNT, pose)
    text = f"two channels {head.width:.3f} m apart, {head.depth:.3f} m long, that slide over handles"
    return builder.build("handle_fork", text)


def build_tool(
    head: Head,
    pose: Pose,
    shaft: Shaft,
    gripper: bool,
) -> Tool:
    """Build a tool with its head at ``pose`` in the frame of the tool mount.

    Args:
        head: one that needs a shaft.
        pose: of the head.
        shaft: its kind and its measures.
        gripper: whether it hangs from the left finger, not from the flange.
    """
    builder = ToolBuilder(gripper)
    # aligns the shaft's front with the head's face
    flush = np.array([_FACE_M - shaft.thickness / 2, 0.0, 0.0])
    end = pose.apply(head.attachment + flush)
    last = builder.add_shaft(shaft, end, left=True)
    builder.add_head(head, last, pose)

    reach = np.linalg.norm(pose.position)
    bearer = "the left finger" if gripper else "the flange"
    text = f"{head.kind} {head.width:.3f} m wide, {reach:.2f} m from {bearer}, carried by {SHAFTS[shaft.kind]}"
    return builder.build(f"{shaft.kind}_{head.kind}", text)
