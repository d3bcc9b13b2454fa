"""Where an arm works with ease."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from core.design import Tool
from core.geometry import Array, Pose
from core.interfaces import Robot
from core.robot.kinematics import arm_of, robot_model
from plugins.vlms.context.reach import span_at

_SHOULDER = 2  # the number of the second joint in a model; 0 is the world
_FOLDED_M = 0.06  # nearer to the least distance that an arm reaches, it is folded
_EASY = 0.85  # of the greatest distance, to which it works with ease on the level,
_STRETCHED = 0.94  # and beyond which it is stretched


@dataclass(frozen=True, eq=False)
class Reach:
    """Where an arm works with ease, its flange pointing away from its base's foot; metres.

    Attributes:
        base: where it stands in the world; z is its first axis.
        shoulder: how high its second joint is above the base.
        inner: the least distance from the first axis.
        outer: the greatest distance from the first axis.
        stretch: the greatest distance from the shoulder.
    """

    base: Pose
    shoulder: float
    inner: float
    outer: float
    stretch: float

    def find_heading(self, point: Array) -> float:
        """Find the direction from the base to a point (3,) on the level, radians in the world."""
        x, y, _ = point - self.base.position
        return float(np.arctan2(y, x))

    def too_near(self, points: Array) -> Array:
        """Measure how much nearer to the first axis than with ease points (..., 3) of the tool mount are, (...)."""
        return np.maximum(0.0, self.inner - self._measure_distance(points))

    def too_far(self, points: Array) -> Array:
        """Measure how much farther from the first axis than with ease points (..., 3) of the tool mount are, (...)."""
        return np.maximum(0.0, self._measure_distance(points) - self.outer)

    def excess(self, points: Array) -> Array:
        """Measure how far the worst of points (..., N, 3) of the tool mount is out of reach: (...), metres."""
        shoulder = self.base.apply([0.0, 0.0, self.shoulder])
        from_shoulder = np.linalg.norm(points - shoulder, axis=-1)
        stretched = np.maximum(0.0, from_shoulder - self.stretch)
        excess = self.too_near(points) + self.too_far(points) + stretched
        return np.asarray(excess.max(axis=-1))

    def _measure_distance(self, points: Array) -> Array:
        """Measure the distance of points (..., 3) from the first axis, (...)."""
        local = self.base.inverse().apply(points)
        return np.asarray(np.linalg.norm(local[..., :2], axis=-1))


@lru_cache(maxsize=8)
def measure_reach(robot: Robot) -> Reach:
    """Measure where an arm works, at the height of its shoulder: clear of where it is folded or stretched."""
    stand = replace(robot, base=Pose())
    model = robot_model(stand, Tool())
    _, joints = model.place_joints(np.array([robot.home]))
    _, _, shoulder = joints[_SHOULDER, 0]

    span = span_at(arm_of(stand), shoulder, 0.0)
    least = 0.0
    most = model.reach
    if span is not None:
        least = span.least
        most = span.most

    return Reach(
        base=robot.base,
        shoulder=float(shoulder),
        inner=least + _FOLDED_M,
        outer=_EASY * most,
        stretch=_STRETCHED * most,
    )
