"""Define the interface of a task. Plugins import it from `core.interfaces`. Covered by `tests/tasks/test_tasks.py`."""

from __future__ import annotations

import inspect
import sys
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from core.errors import choices
from core.geometry import Array, Pose
from core.layouts import NONE, Draw, Ranges
from core.robots import Robot, default_robot
from core.scene import Camera, Goal, Scene, State


class Task(ABC):
    """A manipulation task: a scene, a goal, and a reward. The model reads its source file as it is.

    Args:
        variation: what differs between layouts: ``none``, or a key of ``variations``.

    Raises:
        UsageError: the task has no such variation.
    """

    name: ClassVar[str]
    description: ClassVar[str]  # one paragraph, for the model
    goals: ClassVar[tuple[Goal, ...]]  # the same, for programs; of several goals one is enough
    home: ClassVar[Pose] = Pose(np.array([0.5, 0.0, 0.5]))  # the end-effector's pose in the world at the start
    camera: ClassVar[Camera] = Camera()
    success_reward: ClassVar[float] = 0.95  # from here on the task counts as solved
    variations: ClassVar[Mapping[str, Ranges]] = {}  # by name: what `draw` draws at random, and from which range
    variation: str = NONE
    _robot: Robot | None = None

    def __init__(self, variation: str = NONE) -> None:
        if variation not in (NONE, *self.variations):
            raise choices("variation", variation, (NONE, *self.variations), f"the task {self.name}")
        self.variation = variation

    @property
    def robot(self) -> Robot:
        """The arm that performs the task. The program sets it; until then it is the default robot.

        Raises:
            UserError: no robot is installed.
        """
        return self._robot if self._robot is not None else default_robot()

    @robot.setter
    def robot(self, robot: Robot) -> None:
        self._robot = robot

    @property
    def ranges(self) -> Ranges:
        """What the task's variation draws at random, and from which range."""
        return self.variations.get(self.variation, {})

    def draw(self, seed: int) -> Draw:
        """Return the numbers of the layout of ``seed``, for `scene`."""
        return Draw(self.ranges, seed)

    @abstractmethod
    def scene(self, seed: int) -> Scene:
        """Return the bodies of the world. The same seed gives the same layout; a fixed layout ignores the seed."""

    @abstractmethod
    def reward(self, start: State, end: State) -> Array:
        """Compute rewards from 0 to 1, of one world or of many: from states (..., B, 3) of B bodies, rewards (...).

        ``start`` is after settling and before the motion, ``end`` is after it. Both have the places of marks and fixed
        bodies too: take goals from there, since they differ between layouts.
        """

    def source(self) -> str:
        """Return the text of the file that defines the task."""
        return inspect.getsource(sys.modules[type(self).__module__])
