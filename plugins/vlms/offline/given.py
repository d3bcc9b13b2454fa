"""Find what may be the head of a tool that is given."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from core.design import Tool
from core.geometry import Array
from core.robot.solids import Solid, corners
from plugins.vlms.offline.faults import place_solids
from plugins.vlms.offline.hand import hand_of
from plugins.vlms.offline.layout import Layout

_LOW_M = 0.015  # parts of a tool that reach so near its lowest point do its work
_TURNS = np.arange(4) * np.pi / 2


def draw_head(tool: Tool, layout: Layout, rng: Generator) -> dict[str, float]:
    """Draw where the head of a given tool is: the values of the mount's parameters.

    The lowest parts do the work, on one of their four sides, or within. What hangs from fingers works between them.

    Args:
        tool: of any origin.
        layout: has the arm.
        rng: random numbers.
    """
    groups = [_list_corners(solid) for solid in place_solids(tool, layout)]
    groups = groups or [np.zeros((1, 3))]  # the bare flange
    lowest = min(float(points[:, 2].min()) for points in groups)
    working = np.concatenate(
        [points for points in groups if points[:, 2].min() < lowest + _LOW_M]
    )
    middle = (working.min(axis=0) + working.max(axis=0)) / 2

    yaw = float(rng.choice(_TURNS))
    ahead = np.array([np.cos(yaw), np.sin(yaw)])
    along = (working[:, :2] - middle[:2]) @ ahead
    x, y = middle[:2] + rng.uniform(along.min(), along.max()) * ahead
    if tool.gripper:
        x, y = middle[:2]
        yaw = float(hand_of(layout.robot).tips.rpy[2])

    return {
        "mount_x": float(x),
        "mount_y": float(y),
        "mount_z": lowest,
        "mount_yaw": yaw,
    }


def _list_corners(solid: Solid) -> Array:
    """List the corners of a solid, (V, 3)."""
    return solid.pose.apply(corners(solid.geometry))
