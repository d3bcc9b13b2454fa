"""Say what room a tool takes: each component from the mount, and the whole at each waypoint in the world."""

from __future__ import annotations

import numpy as np

from core.design import Candidate, Tool
from core.geometry import Array, Pose
from core.interfaces import Waypoints
from core.support.text import short_numbers

_MOST = 24  # waypoints at which it is said


def describe_space(tool: Tool) -> dict[str, str]:
    """Say for each component between which x, y and z it lies in its mount's frame, metres, with all joints at 0."""
    placed = tool.placed()
    return {
        component.name: _span(placed[component.name][1].apply(component.shape.corners))
        for component in tool.components
    }


def describe_sweep(candidate: Candidate) -> list[str]:
    """Say for each literal waypoint between which x, y and z the tool lies in the world, metres.

    Returns:
        None of a plan that looks at the layout first, or has too many waypoints, and of a tool on two fingers.
    """
    tool = candidate.tool
    plan = candidate.plan
    if not isinstance(plan, Waypoints) or len(plan) > _MOST:
        return []
    if tool is None or len(tool.mounts) > 1 or not tool.components:
        return []

    placed = tool.placed()
    corners = np.concatenate(
        [placed[part.name][1].apply(part.shape.corners) for part in tool.components]
    )
    poses = [Pose.xyz_rpy(pose[:3], pose[3:6]) for pose in plan.poses]
    return [_span(pose.apply(corners)) for pose in poses]


def _span(points: Array) -> str:
    low = points.min(axis=0)
    high = points.max(axis=0)
    spans = [short_numbers(pair, 3, " to ") for pair in zip(low, high, strict=True)]
    return ", ".join(spans)
