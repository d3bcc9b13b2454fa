"""Find what is wrong with a scene that a model wrote, though its file can be read."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from core.geometry import Pose
from core.goals import reaches
from core.interfaces import Robot
from core.robot.kinematics import arm_of
from core.scene import Scene
from core.solids.standing import bound
from plugins.tasks.file.places import find_ends
from plugins.tasks.file.task import FileTask

SURROUNDINGS = ("table", "floor")
WAY_M = 0.25  # what is farther from all ways is met by no tool
_FAR_M = 5.0  # ahead, where no arm gets


def find_faults(task: FileTask) -> Iterator[str]:
    """Yield a line for each fault of a scene and its goals."""
    yield from task.warnings
    yield from task.find_warnings()
    yield from _find_useless(task, task.scene(0))


def find_needed(task: FileTask) -> set[str]:
    """Find the bodies and marks that goals name: what is to be moved, and where."""
    state = task.scene(0).state()
    needed = set[str]()
    for goal in reaches(task.goals):
        needed.update(goal.subjects(state))
        needed.update(name for _, name in goal.list_named())

    return needed


def measure_reach(robot: Robot) -> float:
    """Measure how far a robot's flange gets ahead of its base, m."""
    arm = arm_of(robot)
    return _FAR_M - arm.inverse(Pose(np.array([_FAR_M, 0.0, 0.3])), arm.home).error_m


def _find_useless(task: FileTask, scene: Scene) -> Iterator[str]:
    """Yield a line for each body that no goal names, and that is far from where the arm and what it moves may go."""
    state = scene.state()
    ways = [np.zeros((1, 3))]
    for goal in reaches(task.goals):
        for name in goal.subjects(state):
            here, wanted = find_ends(goal, name, state)
            ways += [np.linspace(0.0, here), np.linspace(here, wanted)]

    way = np.concatenate(ways)

    words = " ".join(task.reward_in_words())
    for body in scene.bodies:
        named = re.search(rf"\b{re.escape(body.name)}\b", words)
        if named or body.name in SURROUNDINGS or not body.collisions:
            continue

        low, high = bound(body)
        beyond = np.maximum(low - way, way - high).clip(min=0.0)
        apart = np.linalg.norm(beyond, axis=1).min()
        if apart > WAY_M:
            yield (
                f"{body.name} serves no goal, and stands in no way, {apart:.2f} m from the nearest; leave it out, or "
                "say in a goal what is to become of it"
            )
