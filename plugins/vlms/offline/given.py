"""Find what may be the head of a tool that is given."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from core.design import Tool
from core.geometry import Pose
from core.robot.solids import corners
from plugins.vlms.offline.faults import place_solids
from plugins.vlms.offline.hand import hand_of
from plugins.vlms.offline.heads import at
from plugins.vlms.offline.layout import Layout

_WORKING_M = 0.015  # parts of a tool that reach so near its lowest point do its work


def draw_head(tool: Tool, layout: Layout, rng: Generator) -> Pose:
    """Draw where the head of a given tool is, in the frame of the tool mount.

    The lowest parts do the work, within them or on one of four sides; of a tool on fingers, between these.

    Args:
        tool: of any origin.
        layout: has the arm.
        rng: random numbers.
    """
    solids = place_solids(tool, layout)
    groups = [solid.pose.apply(corners(solid.geometry)) for solid in solids]
    groups = groups or [np.zeros((1, 3))]  # the bare flange
    lowest = min(float(points[:, 2].min()) for points in groups)
    working = np.concatenate(
        [points for points in groups if points[:, 2].min() < lowest + _WORKING_M]
    )
    x, y, _ = (working.min(axis=0) + working.max(axis=0)) / 2

    if tool.gripper:
        yaw = float(hand_of(layout.robot).tips.rpy[2])
        return at(x, y, lowest, yaw=yaw)

    yaw = np.pi / 2 * int(rng.integers(4))
    head = at(x, y, lowest, yaw=yaw)
    along = head.inverse().apply(working)[:, 0]
    return head @ at(rng.uniform(along.min(), along.max()), 0.0, 0.0)
