"""Stop a rollout once its task is solved and nothing would change any more (`rollout.stop_s`)."""

from __future__ import annotations

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.interfaces import Recording, Task
from core.scene import Scene, State
from core.solids.rollout_solids import ROBOT
from core.solids.tracks import Pair, Track, follow, lengths
from core.task import reward_of

REST_M_S = 0.005
"""The greatest speed of a body at rest, m/s."""

REST_RAD_S = 0.05
"""The greatest angular speed of a body at rest, rad/s."""

AWAY_M = 0.02
"""The least clearance between the arm or its tool and any free body, metres."""


class Stop:
    """Says whether a world is solved: the reward says success, all bodies rest, and the arm is away from them.

    Args:
        task: has the goals and the reward.
        scene: the layout.
        tool: what the arm holds.
        stop_s: for how long that must last, seconds; the rollout ends then.
    """

    def __init__(self, task: Task, scene: Scene, tool: Tool, stop_s: float) -> None:
        self.stop_s = stop_s
        self._task = task
        self._scene = scene
        self._tool = tool

    def is_solved(self, start: State, arm: Array, fingers: Array, state: State) -> bool:
        """Report whether nothing is left to do in a world.

        Args:
            start: the free bodies at the start of the motion.
            arm: the joints (J,).
            fingers: those of the fingers, and of the tool (F + K,).
            state: of the free bodies.
        """
        return (
            _is_at_rest(state)
            and self._is_rewarded(start, state)
            and self._is_away(arm, fingers, state)
        )

    def _is_rewarded(self, start: State, state: State) -> bool:
        """Report whether the task's reward would be that of a success."""
        begun = self._scene.complete(State.stack([start]))
        now = self._scene.complete(State.stack([state]))
        earned = float(reward_of(self._task, begun, now)[0])
        return self._task.is_solved(earned, begun[0], now[0])

    def _is_away(self, arm: Array, fingers: Array, state: State) -> bool:
        """Report whether the arm and its tool keep their distance from each free body."""
        taken = Recording(np.zeros(1), arm[None], fingers[None], State.stack([state]))
        tracks = follow(self._scene, self._task.robot, self._tool, taken)
        free = {body.name for body in self._scene.free}
        bodies = [track for track in tracks.items if track.owner in free]
        robot = [track for track in tracks.items if track.owner == ROBOT]

        return not any(_is_near(one, other) for one in robot for other in bodies)


def can_stop(task: Task, scene: Scene) -> bool:
    """Report whether a task's rollouts may end early.

    Its reward must read the end alone: one that reads a trace asks what happens until the end. Soft bodies creep, and
    their nodes' speeds are not known.
    """
    if task.reads_trace or scene.softs:
        return False
    return not any(goal.needs_trace for goal in task.goals)


def _is_at_rest(state: State) -> bool:
    """Report whether no free body moves."""
    speeds = lengths(state.linear_velocities)
    turning = lengths(state.angular_velocities)
    return bool((speeds <= REST_M_S).all() and (turning <= REST_RAD_S).all())


def _is_near(one: Track, other: Track) -> bool:
    """Report whether two solids are nearer than the arm must keep away; their boxes are asked first."""
    gaps = np.maximum(one.low - other.high, other.low - one.high)[0]
    if np.linalg.norm(np.maximum(gaps, 0.0)) >= AWAY_M:
        return False

    return Pair(one, other).look(0).depth > -AWAY_M
