"""The space in which an arm works with ease, from its kinematics."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from core.design import Tool
from core.geometry import Array, Pose
from core.interfaces import Robot
from core.robot.kinematics import Arm, arm_of, robot_model
from plugins.vlms.told.reach import Span, span_at

_LOWEST_M = 0.1  # of the end-effector above the ground that bodies stand on
# Clear of the edges, where the elbow is stretched or folded.
_FOLDED_M = 0.06
_EASY = 0.85
_STRETCHED = 0.94  # and where it still gets, with less ease
_HIGHEST_M = 1.05  # of the heights at which an arm's reach is looked for
_HEIGHT_STEP_M = 0.1
_TOOL_M = 0.55  # what a tool adds to an arm's stretch, at most


@dataclass(frozen=True, eq=False)
class Workspace:
    """Bounds of the end-effector's place, with the flange pointing down, in the world and in metres.

    Attributes:
        base: where the robot stands, (3,).
        shoulder: its second joint, (3,).
        inner: the least distance from the base's axis.
        outer: the greatest distance from the base's axis.
        stretch: the greatest distance from the shoulder.
        farthest: how far from the axis a tool can bring a body, at most.
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

    def excess(self, points: Array) -> Array:
        """Measure how far points (..., N, 3) of the end-effector are outside at most: (...), metres.

        It is the sum of what is too far out, too near, too low and too far from the shoulder, of the worst point.
        """
        level = self.from_axis(points)
        ground = np.hypot(level[..., 0], level[..., 1])
        stretch = np.linalg.norm(points - self.shoulder, axis=-1)

        excess = np.maximum(0.0, ground - self.outer)
        excess = excess + np.maximum(0.0, self.inner - ground)
        too_low = np.maximum(0.0, _LOWEST_M - points[..., 2])
        too_far = np.maximum(0.0, stretch - self.stretch)
        excess += too_low + too_far

        return np.asarray(excess.max(axis=-1))


@lru_cache(maxsize=8)
def compute_workspace(robot: Robot) -> Workspace:
    """Compute the workspace from the arm's reach at about the height of its shoulder, its second joint.

    Args:
        robot: an arm, with its base where it stands.
    """
    stand = replace(robot, base=Pose())
    model = robot_model(stand, Tool())
    height = float(model.place_joints(np.array([robot.home]))[1][2, 0, 2])
    span = _find_span(arm_of(stand), height) or Span(0.0, model.reach)

    inner = round(span.least + _FOLDED_M, 2)
    outer = round(_EASY * span.most, 2)
    stretch = round(_STRETCHED * span.most, 2)

    base = robot.base.position
    shoulder = base + np.array([0.0, 0.0, round(height, 2)])
    return Workspace(base, shoulder, inner, outer, stretch, stretch + _TOOL_M)


def _find_span(arm: Arm, height: float) -> Span | None:
    """Find the distances that the arm reaches at a height, or at the nearest one where it reaches any.

    Args:
        arm: which stands at the world's origin.
        height: metres.

    Returns:
        The span with the flange pointing down; None: the arm reaches nothing.
    """
    heights = np.round(np.arange(0.0, _HIGHEST_M, _HEIGHT_STEP_M), 3).tolist()
    for z in sorted(heights, key=lambda z: abs(z - height)):
        span = span_at(arm, z, 0.0)
        if span is not None:
            return span

    return None
