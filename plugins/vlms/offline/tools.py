"""Build a tool from a head and a shaft that connects it to the mount, and find the head in a tool of any origin."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, Tool
from core.geometry import Array, Box, Pose
from core.interfaces import Task
from plugins.vlms.offline.boxes import Boxes, axes_of
from plugins.vlms.offline.heads import FINGER_OPEN, Head
from plugins.vlms.offline.scene_analysis import Subgoal

STYLES = {
    "gantry": "a boom and a drop",
    "slope": "a sloping shaft",
    "elbow": "a post and a low arm",
    "riser": "a riser and a jib",
}
"""Shafts, and what they consist of."""

_SHAFT = (0.30, 0.33, 0.38, 1.0)
_HEADS = (
    (0.90, 0.49, 0.13, 1.0),
    (0.16, 0.50, 0.73, 1.0),
    (0.18, 0.63, 0.42, 1.0),
    (0.75, 0.22, 0.17, 1.0),
)

_FINGERTIP = np.array([0.0, 0.0, -0.11])  # of the hand, in the frame of the tool mount
_LOW_M = 0.015  # boxes this close to a tool's lowest point form its foot
_FINGER_Z = -0.0584  # the fingers' frames below the tool mount, with the hand on
_TIP = np.array(
    [0.0, FINGER_OPEN + 0.0076, -0.105]
)  # the right fingertip, open; the left one's y is negative

HAND = Boxes.of(
    [
        (Pose(np.array([0.0, 0.0, -0.033])), np.array([0.064, 0.206, 0.066])),
        *(
            (
                Pose(np.array([0.0, side * _TIP[1], -0.086])),
                np.array([0.022, 0.016, 0.054]),
            )
            for side in (-1, 1)
        ),
    ]
)
"""The hand with its fingers open, in the frame of the tool mount."""

MOUNTS: dict[str, Pose] = {
    RIGID_MOUNT: Pose(),
    GRIPPER_MOUNTS[0]: Pose.xyz_rpy((0.0, -FINGER_OPEN, _FINGER_Z), (np.pi, 0.0, 0.0)),
    GRIPPER_MOUNTS[1]: Pose.xyz_rpy((0.0, FINGER_OPEN, _FINGER_Z), (np.pi, 0.0, 0.0)),
}
"""The mounts in the frame of the tool mount, with the fingers open."""


class Assembly:
    """Collects the boxes of a tool, with poses in the frame of the tool mount."""

    def __init__(self, gripper: bool, thickness: float) -> None:
        self.gripper = gripper
        self.thickness = thickness
        self._poses = dict(MOUNTS)
        self._components: list[Component] = []

    def add(
        self,
        name: str,
        parent: str,
        pose: Pose,
        size: Sequence[float],
        color: tuple[float, ...] = _SHAFT,
    ) -> str:
        x, y, z = (float(side) for side in size)
        red, green, blue, opacity = color
        local = self._poses[parent].inverse() @ pose
        self._components.append(
            Component(
                name, parent, local, Box((x, y, z)), color=(red, green, blue, opacity)
            )
        )
        self._poses[name] = pose
        return name

    def bar(self, name: str, parent: str, start: Array, end: Array) -> str:
        """A square bar between two points. If it is not upright, each end is longer by half its thickness."""
        way = end - start
        length = float(np.linalg.norm(way))
        if np.hypot(way[0], way[1]) < 0.02 * length:
            return self.add(
                name,
                parent,
                Pose((start + end) / 2),
                (self.thickness, self.thickness, length),
            )
        rpy = (0.0, -np.arcsin(way[2] / length), np.arctan2(way[1], way[0]))
        size = (length + self.thickness, self.thickness, self.thickness)
        return self.add(name, parent, Pose.xyz_rpy((start + end) / 2, rpy), size)

    def head(self, head: Head, parent: str, pose: Pose) -> None:
        """Add the head's pieces, with the head at a pose."""
        names: list[str] = []
        for piece, color in zip(
            head.pieces, [_HEADS[0], *_HEADS[1:] * len(head.pieces)], strict=False
        ):
            names.append(
                self.add(
                    piece.name,
                    names[piece.parent] if names else parent,
                    pose @ piece.pose,
                    piece.size,
                    color,
                )
            )

    def shaft(
        self,
        style: str,
        hold: Array,
        *,
        left: bool,
        bend: float = 0.5,
        top: float = 0.0,
    ) -> str:
        """Add bars from the mount (with a gripper, from the left or the right finger) to the point ``hold``, (3,).

        A riser goes up at the fraction ``bend`` of the way, to the height ``top``, and comes down on ``hold``. Returns
        the name of the last bar.
        """
        t = self.thickness
        if self.gripper:
            tip = _TIP * np.array([1.0, -1.0 if left else 1.0, 1.0])
            name = "left_" if left else "right_"
            mount = GRIPPER_MOUNTS[0 if left else 1]
            root = self.add(
                name + "sleeve",
                mount,
                Pose(tip - np.array([0.0, 0.0, 0.012])),
                (0.02, 0.018, 0.024),
            )
            start = tip - np.array([0.0, 0.0, 0.024 + t / 2])
        else:
            name = ""
            start = np.array([0.0, 0.0, -t / 2])
            root = self.add(
                "socket",
                RIGID_MOUNT,
                Pose(np.array([0.0, 0.0, -0.006])),
                (0.05, 0.05, 0.012),
            )
        if np.hypot(*(hold - start)[:2]) < 0.02:
            return self.bar(
                name + "post", root, np.array([*hold[:2], start[2] + t / 2]), hold
            )
        foot = (start + bend * (hold - start))[:2]
        points: dict[str, dict[str, Sequence[float] | Array]] = {
            "slope": {"shaft": hold},
            "riser": {
                "boom": (*foot, start[2]),
                "riser": (*foot, top),
                "jib": (*hold[:2], top),
                "drop": hold,
            },
            "gantry": {"boom": (*hold[:2], start[2]), "drop": hold},
            "elbow": {"post": (*start[:2], hold[2] + t / 2), "arm": hold},
        }
        last = root
        here = start + np.array([0.0, 0.0, t / 2]) if style == "elbow" else start
        for bar, end in points[style].items():
            last = self.bar(name + bar, last, here, np.array(end))
            here = np.array(end)
        return last

    def tool(self, name: str, description: str) -> Tool:
        return Tool(tuple(self._components), self.gripper, name, description)


def build_clamp(head: Head, pose: Pose, thickness: float) -> Tool:
    """A mirrored pair of finger extensions, with the head at ``pose`` in the frame of the tool mount."""
    assembly = Assembly(True, thickness)
    for piece, is_left in zip(head.pieces, (True, False), strict=True):
        pad = pose @ piece.pose
        hold = pad.position + np.array([0.0, 0.0, piece.size[2] / 2 - 0.003])
        assembly.add(
            piece.name,
            assembly.shaft("gantry", hold, left=is_left),
            pad,
            piece.size,
            _HEADS[0],
        )
    reach = float(np.linalg.norm(pose.position))
    text = f"two pads {head.width:.3f} m apart, {reach:.2f} m from the hand, that close on the body"
    return assembly.tool("long_fingers", text)


def tool_boxes(tool: Tool) -> Boxes:
    """The components in the frame of the tool mount, with the fingers open."""
    placed = tool.placed()
    return Boxes.of(
        (MOUNTS[placed[c.name][0]] @ placed[c.name][1], c.shape.bounds[1])
        for c in tool.components
    )


def build(
    head: Head,
    pose: Pose,
    style: str,
    thickness: float,
    gripper: bool,
    *,
    bend: float = 0.5,
    top: float = 0.0,
) -> Tool:
    """The tool with its head at ``pose`` in the tool mount's frame; for ``bend`` and ``top`` see `Assembly.shaft`."""
    assembly = Assembly(gripper, thickness)
    if head.pose is not None:
        assembly.head(head, RIGID_MOUNT, pose)
        text = f"two channels {head.width:.3f} m apart, {head.depth:.3f} m long, that slide over handles"
        return assembly.tool("handle_fork", text)
    flush = np.array(
        [0.008 - thickness / 2, 0.0, 0.0]
    )  # aligns the shaft's front with the head's face
    last = assembly.shaft(
        style, pose.apply(head.hold + flush), left=True, bend=bend, top=top
    )
    assembly.head(head, last, pose)
    reach = float(np.linalg.norm(pose.position))
    carrier = "the left finger" if gripper else "the flange"
    text = f"{head.kind} {head.width:.3f} m wide, {reach:.2f} m from {carrier}, carried by {STYLES[style]}"
    return assembly.tool(f"{style}_{head.kind}", text)


def foot(tool: Tool) -> Array:
    """Corners (V, 3) of the tool's lowest boxes, which do its work, in the frame of the tool mount."""
    if not tool.components:
        return _FINGERTIP[None]
    boxes = tool_boxes(tool)
    bottoms = boxes.bounds[0][:, 2]
    low = boxes[bottoms < bottoms.min() + _LOW_M]
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners: Array = low.centers[:, None] + np.einsum(
        "nij,ncj->nci", low.axes, signs * low.halves[:, None]
    )
    return corners.reshape(-1, 3)


def middle(tool: Tool) -> Array:
    """The middle (3,) of the foot, at its lowest height."""
    corners = foot(tool)
    lower = corners.min(axis=0)
    upper = corners.max(axis=0)
    return np.array([(lower[0] + upper[0]) / 2, (lower[1] + upper[1]) / 2, lower[2]])


def suffix(task: Task) -> str:
    """The end of the names of components that are for one of several tasks."""
    return re.sub(r"[^\w.-]", "_", task.name, flags=re.ASCII)[:24]


def part_for(tool: Tool, task: Task, *, strict: bool = False) -> Tool:
    """The part of a tool that is for one of several tasks; the tool where there is none, with ``strict`` nothing."""
    own = set[str]()
    for c in tool.components:  # parents go before their children
        if c.parent in own or c.name.endswith(f"_{suffix(task)}"):
            own.add(c.name)
    part = replace(tool, components=tuple(c for c in tool.components if c.name in own))
    return part if own or strict else tool


def sample_turn(rng: Generator) -> float:
    """A turn of a head about z at random: most often none, or by an eighth or a quarter."""
    return float(
        rng.choice(
            [0.0, np.pi / 4, -np.pi / 4, np.pi / 2, -np.pi / 2],
            p=[0.6, 0.1, 0.1, 0.1, 0.1],
        )
    )


def recognize(tool: Tool, subgoal: Subgoal, rng: Generator) -> tuple[Head, Pose]:
    """The tool's foot as a head for a subgoal, and its pose in the frame of the tool mount.

    The side that works is guessed at random, and so is the face: in front as a blade's, or at the back as a cage's.
    """
    turn = sample_turn(rng) + rng.normal(0.0, 0.1)
    deep = bool(rng.random() < 0.5)
    if tool.gripper and not tool.components:
        return Head("hand", "clamp", (), np.zeros(3), 0.01, 2 * FINGER_OPEN), Pose(
            _FINGERTIP
        )
    heading = subgoal.heading - turn
    ahead, side = (axis[:2] for axis in axes_of(heading))
    corners = foot(tool)
    along = corners[:, :2] @ ahead
    across = corners[:, :2] @ side
    depth = float(np.ptp(along))
    width = float(np.ptp(across))
    rises = subgoal.shift[2] > 0.03
    inside = max(0.0, depth - 0.01) if rises or deep else 0.0
    face = (along.max() - inside) * ahead + (across.min() + across.max()) / 2 * side
    head = Head("foot", "scoop" if rises else "push", (), np.zeros(3), inside, width)
    return head, Pose.xyz_rpy(
        (face[0], face[1], float(corners[:, 2].min())), (0.0, 0.0, heading)
    )
