"""What a task's goals ask that the embedded designer does not plan for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.goals import Away, Placed, Reach, Turned, limits, reaches
from core.interfaces import Task
from core.scene import Scene
from plugins.vlms.offline.subgoals import turn_to_goal
from plugins.vlms.offline.targets import Target, find_targets


def find_unplanned(task: Task, seed: int) -> list[str]:
    """Name what a task's goals ask that its plans leave out, in the layout of this seed.

    Each is a line for the user, who else would wonder why such a goal is never reached.
    """
    scene = task.scene(seed)
    reached = reaches(task.goals)
    targets = [target for goal in reached for target in find_targets(goal, scene)]
    cases = {
        "a ball joint's position": _has_ball_joint(targets, scene),
        "a turn about the vertical": any(_turns_level(t, scene) for t in targets),
        "a time limit": any(goal.by_s is not None for goal in reached),
        "what a soft body does as it gives way": bool(scene.softs),
        "a height, an area or a node": any(_names_no_place(goal) for goal in reached),
        "a limit of force": _has_force_limit(task),
        "a second goal, where one is a joint's or a turn (each tool is made for one)": _has_second(
            task, reached, targets
        ),
        "anything but its first free body, as the task has no goals": not targets,
    }
    return [name for name, holds in cases.items() if holds]


def _has_ball_joint(targets: Sequence[Target], scene: Scene) -> bool:
    """Report whether a goal is about a ball joint.

    Args:
        targets: of all goals.
        scene: which has the joints.
    """
    balls = {joint.name for joint in scene.joints if joint.kind == "ball"}
    return any(target.joint in balls for target in targets)


def _names_no_place(goal: Reach) -> bool:
    """Report whether a part of a goal is of a kind that says no place to go, or one of a node."""
    for part in goal.parts:
        if isinstance(part, Placed):
            if part.node is not None:
                return True
        elif _names_no_way(part):
            return True
    return False


def _has_force_limit(task: Task) -> bool:
    """Report whether a limit of the task is about a force."""
    return any(getattr(limit, "max_force_n", 0) for limit in limits(task.goals))


def _names_no_way(goal: Reach) -> bool:
    """Report whether a goal is of a kind that says neither a place nor a way nor a turn."""
    if type(goal) is Reach or isinstance(goal, Away | Turned):
        return False
    return type(goal).place_of is Reach.place_of


def _has_second(
    task: Task, reached: Sequence[Reach], targets: Sequence[Target]
) -> bool:
    """Report whether there are several goals to reach, one of which needs a head of its own.

    Args:
        task: whose goals may all count.
        reached: the goals to reach.
        targets: of all of them.
    """
    guided = any(target.joint or target.axis for target in targets)
    return task.every and len(reached) > 1 and guided


def _turns_level(goal: Target, scene: Scene) -> bool:
    """Report whether a goal's axis must turn about the vertical.

    Args:
        goal: with an axis, or without.
        scene: which has the goal's bodies.
    """
    if goal.axis is None or not goal.bodies:
        return False

    axis, _ = turn_to_goal(goal, scene[goal.bodies[0]])
    length = float(np.linalg.norm(axis))
    is_fulfilled = length <= np.sin(np.radians(goal.tolerance_deg))
    return not is_fulfilled and abs(float(axis[2])) > 0.5 * length
