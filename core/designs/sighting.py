"""Answer what plans ask of what is seen: which bodies of a goal are not in place, and how large a body is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np

from core.design import DesignError
from core.geometry import Array, Pose
from core.goals import Reach, numbered
from core.interfaces import Task
from core.robot.solids import body_solids
from core.scene import Scene, State


class SceneJudge:
    """Judges what is seen of a layout, see `core.interfaces.Judge`.

    Args:
        task: gives the goals.
        scene: the layout.
        first: the poses of bodies and marks as they were seen before the motion.
    """

    def __init__(self, task: Task, scene: Scene, first: Mapping[str, Pose]) -> None:
        self._task = task
        self._scene = scene
        self._first = first

    def names(self, goal: int | str) -> tuple[str, ...]:
        return self._find(goal).subjects(self._start)

    def left(self, goal: int | str, poses: Mapping[str, Pose]) -> tuple[str, ...]:
        """See `core.interfaces.Judge`. Speeds, and what the robot touches, can't be seen, and don't count.

        Marks and fixed bodies do not move: where they are seen now says better where the goal is than the first look.
        """
        wanted = self._find(goal)
        now = self._state(poses)
        start = replace(self._start, places=now.places)
        names = wanted.subjects(start)
        left = tuple(n for n in names if not wanted.is_in_place(n, start, now))

        if len(names) - len(left) >= wanted.count_enough(len(names)):
            return ()
        return left

    def goals(self) -> dict[int, Reach]:
        """Return the goals that want something reached, by their numbers among all."""
        return numbered(self._task.goals)

    def box(self, body: str) -> tuple[Array, Array]:
        """See `core.interfaces.Judge`. The box is that of the collision shapes; of a mark it is its picture's."""
        return measure_box(self._scene, body)

    @cached_property
    def _start(self) -> State:
        return self._state(self._first)

    def _find(self, which: int | str) -> Reach:
        """Find a goal by its number or name."""
        goals = self.goals()
        named = {goal.name: goal for goal in goals.values() if goal.name}
        found = goals.get(which) if isinstance(which, int) else named.get(which)
        if found is not None:
            return found

        known = ", ".join(map(str, [*goals, *named])) or "none"
        raise DesignError(f"no goal {which!r} to reach; possible: {known}")

    def _state(self, poses: Mapping[str, Pose]) -> State:
        """Return the state of the layout as it is seen: at rest, with its marks, too."""
        state = self._scene.state()
        seen = [poses.get(name, state.pose(name)) for name in state.names]
        count = len(seen)
        positions = np.reshape([pose.position for pose in seen], (count, 3))
        quaternions = np.reshape([pose.quaternion for pose in seen], (count, 4))
        shifts = positions - state.positions
        soft = {
            name: nodes + shifts[state.names.index(name)]
            for name, nodes in state.soft.items()
        }
        places = {name: poses.get(name, pose) for name, pose in state.places.items()}

        return replace(
            state,
            positions=positions,
            quaternions=quaternions,
            places=places,
            soft=soft,
        )


def measure_box(scene: Scene, body: str) -> tuple[Array, Array]:
    """Measure the box around a body's collision shapes, in its frame: its middle (3,), and half of its extents (3,).

    Of a mark it is the box around what is drawn.
    """
    found = scene[body]
    corners = []

    if found.collisions:
        for solid in body_solids(found, frame=0):
            middle, half = solid.bounds()
            corners += [middle - half, middle + half]
    else:
        for part in found.visuals:
            corners += [*part.pose.apply(part.shape.corners)]

    low = np.min(corners, axis=0)
    high = np.max(corners, axis=0)
    return (low + high) / 2, (high - low) / 2
