"""What a task's goals ask that the embedded designer does not plan for."""

from __future__ import annotations

from core.goals import Limit, Reach, limits, needs_fixture, reaches
from core.interfaces import Task
from core.scene import State
from plugins.vlms.offline.targets import Target, find_targets, is_planned


def find_unplanned(task: Task, seed: int) -> list[str]:
    """Name what a task's goals ask that its plans leave out, in the layout of this seed.

    Each is a line for the user, who else would wonder why such a goal is never reached.

    Args:
        task: of any origin.
        seed: of the layout.
    Returns:
        Noun phrases; none for a task that is planned for as a whole.
    """
    scene = task.scene(seed)
    reached = reaches(task.goals)
    targets: list[Target] = []

    parts: list[Reach] = []
    for goal in reached:
        targets += find_targets(goal, scene)
        parts += goal.parts

    balls = [joint.name for joint in scene.joints if joint.kind == "ball"]
    is_guided = any(target.joint or target.axis or target.breaks for target in targets)

    # One rod does several joints, and breaks several things.
    by_rod = all(target.joint or target.breaks for target in targets)
    several = task.every and len(reached) > 1 and not by_rod

    cases = {
        "a ball joint's position": any(t.joint in balls for t in targets),
        "a fixture": any(needs_fixture(goal) for goal in task.goals),
        "a time limit": any(goal.by_s is not None for goal in reached),
        "what a soft body does as it gives way": bool(scene.softs),
        "the place of a node": any(getattr(p, "node", None) is not None for p in parts),
        "a second goal with a gripper, where one is a joint's, a turn or a break": several
        and is_guided
        and "rigid" not in (task.tool_kinds or ["rigid"]),
        "anything but its first free body, as the task has no goals": not targets,
    }

    named = [name for name, holds in cases.items() if holds]
    state = scene.state()
    for goal in reached:
        named += _name_parts(goal, state)

    unminded = [limit for limit in limits(task.goals) if not is_planned(limit)]
    named += [_name_limit(limit) for limit in unminded]

    return list(dict.fromkeys(named))


def _name_parts(goal: Reach, state: State) -> list[str]:
    """Name what a goal measures of its first body where no plan is made for it, such as ``angle of cup``.

    Args:
        goal: with its parts.
        state: at the start.
    """
    first = goal.subjects(state)[:1]
    unplanned = [part for part in goal.parts if not is_planned(part)]
    return [
        measure.name
        for body in first
        for part in unplanned
        for measure in part.measures(body, state)
    ]


def _name_limit(limit: Limit) -> str:
    """Name a limit that plans do not mind."""
    if getattr(limit, "by", ()):
        return "what other bodies must not touch"
    if getattr(limit, "max_force_n", 0):
        return "a limit of force"

    return f"what must hold {type(limit).__name__.lower()}"
