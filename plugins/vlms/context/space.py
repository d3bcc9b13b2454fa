"""Say what room a tool takes: each component from the mount, and the whole at each waypoint in the world."""

from __future__ import annotations

import numpy as np

from core.design import Candidate, Tool
from core.geometry import Array, Pose
from core.interfaces import Waypoints
from core.support.text import short_numbers

_MOST = 24  # waypoints at which it is said; of more, as many spread evenly


def describe_space(tool: Tool) -> dict[str, str]:
    """Say for each component between which x, y and z it lies in its mount's frame, metres, with all joints at 0."""
    placed = tool.placed()
    return {
        component.name: _span(placed[component.name][1].apply(component.shape.corners))
        for component in tool.components
    }


def describe_sweep(candidate: Candidate) -> dict[int, str]:
    """Say for literal waypoints between which x, y and z the tool lies in the world, metres.

    Returns:
        By the number of the waypoint, the first is 1. None of a plan that looks at the layout first, and of a tool on
        two fingers.
    """
    tool = candidate.tool
    plan = candidate.plan
    if not isinstance(plan, Waypoints):
        return {}
    if tool is None or len(tool.mounts) > 1 or not tool.components:
        return {}

    placed = tool.placed()
    corners = np.concatenate(
        [placed[part.name][1].apply(part.shape.corners) for part in tool.components]
    )
    count = min(len(plan), _MOST)
    swept = {}
    for place in np.linspace(0, len(plan) - 1, count).round().astype(int).tolist():
        pose = plan.poses[place]
        swept[place + 1] = _span(Pose.xyz_rpy(pose[:3], pose[3:6]).apply(corners))

    return swept


def _span(points: Array) -> str:
    low = points.min(axis=0)
    high = points.max(axis=0)
    spans = [short_numbers(pair, 3, " to ") for pair in zip(low, high, strict=True)]
    return ", ".join(spans)
