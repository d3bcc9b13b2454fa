"""Define motions: joint trajectories, and the figures of one that goes through waypoints.

Plugins import all of it from `core.interfaces`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from core.geometry import Array
from core.support.text import list_some

_SLOWED = 1.05  # from here on it is reported
_NAMED = 3  # waypoints that are named


@dataclass(frozen=True, eq=False)
class JointTrajectory:
    """The joint targets over time that every engine plays.

    ``times`` (T,) rises from 0, in seconds; ``arm`` (T, J) is in radians, or metres where a joint slides;
    ``fingers`` (T,) is each finger's distance from the middle, in metres (0 closed, 0.04 open). Targets are linear
    between instants, and constant after the last.
    """

    times: Array
    arm: Array
    fingers: Array

    @property
    def duration(self) -> float:
        return float(self.times[-1])

    def sample(self, times: Array) -> tuple[Array, Array]:
        """Return arm targets (S, 7) and finger targets (S,) at instants (S,)."""
        arm = np.stack(
            [np.interp(times, self.times, joint) for joint in self.arm.T], axis=-1
        )
        return arm, np.interp(times, self.times, self.fingers)

    def extended(self, times: Array, arm: Array, fingers: Array) -> JointTrajectory:
        """Add targets behind the last one; their ``times`` (S,) count from there."""
        return JointTrajectory(
            np.append(self.times, self.duration + times),
            np.vstack([self.arm, arm]),
            np.append(self.fingers, fingers),
        )

    def held(self, seconds: float) -> JointTrajectory:
        """Stay at the last targets for some time."""
        return self.extended(np.array([seconds]), self.arm[-1:], self.fingers[-1:])


@dataclass(frozen=True, eq=False)
class Motion:
    """A joint trajectory through N waypoints, and its figures.

    Attributes:
        trajectory: of the arm's joints and the fingers.
        distance_m: metres travelled by the end-effector's origin from home through all waypoints, along the joint path.
        arrivals: when each waypoint is reached (N,), seconds.
        misses: the largest errors of the inverse kinematics on the way to each (N, 2), metres and radians; for the
            first waypoint only on arrival.
        plan: the waypoints (N, 6) or (N, 7).
        slowed: how many times longer each way takes than asked (N,); 1 where nothing was asked.

    For example, when the arm rests at its last waypoint, and where its joints are then::

        motion = plan_task_motion(plan, task, RolloutSettings())
        print(motion.arrivals[-1], motion.trajectory.arm[-1])
        for line in motion.slowdowns():
            print(line)
    """

    trajectory: JointTrajectory
    distance_m: float
    arrivals: Array
    misses: Array
    plan: Array
    slowed: Array

    def slowdowns(self) -> list[str]:
        """Say in a line which waypoints were reached later than asked; none: all were in time."""
        late = np.flatnonzero(self.slowed > _SLOWED) + 1
        if len(late) == 0:
            return []

        names = list_some(late.tolist(), _NAMED)
        return [
            f"waypoint {names}: the arm's limits make the way there up to {self.slowed.max():.1f} times slower than "
            "asked"
        ]


class Begin(NamedTuple):
    """How a motion begins.

    Attributes:
        joints: of the arm, at rest (J,), radians.
        grip: how far the gripper is closed, 0 to 1.
    """

    joints: Array
    grip: float = 0.0
