"""The space in which an arm works with ease, from its kinematics."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from core.design import Tool
from core.geometry import Array, Pose
from core.interfaces import Robot
from core.robot.kinematics import arm_of, joint_frames, robot_model
from plugins.vlms.told.arm import Span, span_at

_LOWEST_M = 0.1  # of the end-effector above the ground that bodies stand on
_TOOL_M = 0.55  # what a tool adds to an arm's stretch, at most


@dataclass(frozen=True, eq=False)
class Workspace:
    """Bounds of the end-effector's place, with the flange pointing down, in the world and in metres.

    ``base`` (3,) is where the robot stands. ``inner`` and ``outer`` are distances from its axis, ``stretch`` is that
    from its ``shoulder`` (3,). ``farthest`` from the axis a tool can bring a body, at most.
    """

    base: Array
    shoulder: Array
    inner: float
    outer: float
    stretch: float
    farthest: float

    def from_axis(self, points: Array) -> Array:
        """Compute the horizontal ways (..., 2) from the base to points (..., 3)."""
        return np.asarray(points)[..., :2] - self.base[:2]

    def direction(self, point: Array) -> float:
        """Compute the direction from the base to a point (3,), an angle about the world's z."""
        x, y = self.from_axis(point)
        return float(np.arctan2(y, x))

    def strain(self, points: Array) -> float:
        """Measure how far points (N, 3) of the end-effector are outside at most, metres."""
        ground = np.hypot(*self.from_axis(points).T)
        stretch = np.linalg.norm(points - self.shoulder, axis=1)
        strain = np.maximum(0.0, ground - self.outer) + np.maximum(
            0.0, self.inner - ground
        )
        strain += np.maximum(0.0, _LOWEST_M - points[:, 2]) + np.maximum(
            0.0, stretch - self.stretch
        )
        return float(strain.max())


@lru_cache(maxsize=8)
def workspace_of(robot: Robot) -> Workspace:
    """Compute the workspace from the arm's reach at about the height of its shoulder, its second joint."""
    stand = replace(robot, base=Pose())
    model = robot_model(stand, Tool())
    arm = arm_of(stand)
    base = robot.base.position
    height = float(joint_frames(model, np.array([robot.home]))[1][2, 0, 2])
    heights = sorted(
        np.round(np.arange(0.0, 1.05, 0.1), 3).tolist(), key=lambda z: abs(z - height)
    )
    span = next(
        (span for z in heights if (span := span_at(arm, z, 0.0)) is not None),
        Span(0.0, model.reach),
    )
    # Clear of the edges, where the elbow is stretched or folded: by 6 cm inside, and by 15 % outside.
    inner = round(span.least + 0.06, 2)
    outer = round(0.85 * span.most, 2)
    stretch = round(0.94 * span.most, 2)
    shoulder = base + np.array([0.0, 0.0, round(height, 2)])
    return Workspace(base, shoulder, inner, outer, stretch, stretch + _TOOL_M)
