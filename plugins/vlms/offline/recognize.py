"""Find a head in a tool of any origin."""

from __future__ import annotations

import numpy as np

from core.design import Tool
from core.geometry import Array, Pose
from plugins.vlms.offline.heads import Head, Use
from plugins.vlms.offline.scene_analysis import Errand
from plugins.vlms.offline.tools import FINGER_OPEN, tool_boxes

_LOW_M = 0.015  # boxes this close to the tool's lowest point form its foot
_FINGERTIP = np.array([0.0, 0.0, -0.11])  # of the hand, in the frame of the tool mount


def foot(tool: Tool) -> Array:
    """Corners (V, 3) of the tool's lowest boxes, which do its work, in the frame of the tool mount."""
    if not tool.components:
        return _FINGERTIP[None]
    boxes = tool_boxes(tool)
    low = boxes[boxes.lower[:, 2] < boxes.lower[:, 2].min() + _LOW_M]
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners: Array = low.centers[:, None] + np.einsum("nij,ncj->nci", low.axes, signs * low.halves[:, None])
    return corners.reshape(-1, 3)


def middle(tool: Tool) -> Array:
    """The middle (3,) of the foot, at its lowest height."""
    corners = foot(tool)
    lower, upper = corners.min(axis=0), corners.max(axis=0)
    return np.array([(lower[0] + upper[0]) / 2, (lower[1] + upper[1]) / 2, lower[2]])


def recognize(tool: Tool, errand: Errand, rng: np.random.Generator) -> tuple[Head, Pose]:
    """The tool's foot as a head for an errand, and its pose in the frame of the tool mount.

    The side that works is guessed at random, and so is the face: in front as a blade's, or at the back as a cage's.
    """
    turn = float(rng.choice([0.0, np.pi / 4, -np.pi / 4, np.pi / 2, -np.pi / 2], p=[0.6, 0.1, 0.1, 0.1, 0.1]))
    turn += rng.normal(0.0, 0.1)
    deep = bool(rng.random() < 0.5)
    if tool.gripper and not tool.components:
        return Head("hand", "clamp", (), np.zeros(3), 0.01, 2 * FINGER_OPEN), Pose(_FINGERTIP)
    heading = errand.heading - turn
    ahead, side = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
    corners = foot(tool)
    along, across = corners[:, :2] @ ahead, corners[:, :2] @ side
    depth, width = float(np.ptp(along)), float(np.ptp(across))
    rises = errand.shift[2] > 0.03
    inside = max(0.0, depth - 0.01) if rises or deep else 0.0
    face = (along.max() - inside) * ahead + (across.min() + across.max()) / 2 * side
    use: Use = "scoop" if rises else "push"
    head = Head("foot", use, (), np.zeros(3), inside, width)
    return head, Pose.xyz_rpy((face[0], face[1], float(corners[:, 2].min())), (0.0, 0.0, heading))
