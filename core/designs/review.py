"""Describe designs before they are tried: broken rules, the space that a tool takes, and where its plans bring it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import RIGID_MOUNT, Candidate, DesignError, Tool
from core.designs.planning import resolve
from core.designs.rules import MAX_COMPONENTS
from core.geometry import Array
from core.interfaces import JointTrajectory, Robot, RolloutSettings, Task
from core.robot.frames import link_frames
from core.robot.tempo import plan_task_motion
from core.robot.trajectory import Motion, at_home
from core.solids.self_collision import find_self_collision
from core.support.text import clean

# A waypoint is reached if it is missed by no more than this.
REACHED_M, REACHED_RAD = 0.001, 0.01
_REASON = 500  # characters


def review(candidates: Sequence[Candidate], task: Task, seed: int, settings: RolloutSettings) -> str:
    """Describe the designs of one reply, given in the order of `Candidate.key`: a list item for each strategy.

    Motions are planned as for a rollout, and nothing is simulated: no contact changes where the arm gets.
    """
    return "\n".join(
        _strategy(number, list(group), task, seed, settings)
        for number, group in groupby(candidates, key=lambda candidate: candidate.strategy)
    )


def _strategy(number: int, candidates: list[Candidate], task: Task, seed: int, settings: RolloutSettings) -> str:
    tool, problems = candidates[0].tool, {candidate.problem for candidate in candidates}
    name = f" ({tool.name})" if tool is not None and tool.name else ""
    lines = [f"- Strategy {number + 1}{name}:"]
    shared = problems.pop() if len(problems) == 1 else None
    if shared is not None:
        lines.append(f"  - rejected: {clean(shared, _REASON)}")
    if tool is not None and tool.components:
        lines.append(f"  - {tool.mass:.3g} kg; x, y and z of each component at home, smallest to largest:")
        placed = place_components(task.robot, tool, at_home(task))
        lines += [f"    - {part}: {_space(points[0])}" for part, points in placed.items()]
    for candidate in candidates:
        found = [f"rejected: {clean(candidate.problem or '', _REASON)}"] if candidate.problem != shared else []
        if candidate.plan.dump():
            found += _plan(candidate, task, seed, settings)
        if found:
            lines.append(f"  - plan {candidate.action + 1}: {'; '.join(found)}")
    return "\n".join(lines)


def _plan(candidate: Candidate, task: Task, seed: int, settings: RolloutSettings) -> list[str]:
    """Describe the motion of a plan: how long it takes, and which waypoints it misses."""
    robot = task.robot
    try:
        plan = resolve(candidate.plan, task, seed, settings)
    except DesignError as error:
        return [f"rejected: {clean(str(error), _REASON)}"]
    motion = plan_task_motion(plan, task, settings)
    seconds, longest = motion.trajectory.duration, settings.max_motion_s
    found = [f"{seconds:.1f} s" + (f", rejected: more than {longest:g} s" if seconds > longest else "")]
    tool = candidate.tool
    if tool is not None and candidate.problem is None and settings.penetration != "ignore" and seconds <= longest:
        met = find_self_collision(robot, tool, motion.trajectory)
        if met is not None:
            verdict = "rejected: " if settings.penetration == "forbid" else ""
            found.append(verdict + met.describe(motion.arrivals))
    targets, fingers = motion.trajectory.sample(motion.arrivals)
    there = JointTrajectory(motion.arrivals, targets, fingers)
    found += _reach(robot, plan.poses, there, motion)
    return found


def _reach(robot: Robot, plan: Array, there: JointTrajectory, motion: Motion) -> list[str]:
    """Say which waypoints are missed, and by how much."""
    rotations, positions = link_frames(robot, False, there.arm, np.zeros((len(plan), 0)))[RIGID_MOUNT]
    missed_m = np.linalg.norm(positions - plan[:, :3], axis=1)
    turned = Rotation.from_matrix(rotations).inv() * Rotation.from_euler("xyz", plan[:, 3:6])
    missed_rad = np.asarray(turned.magnitude())
    found = [
        f"waypoint {k + 1} is missed by {missed_m[k] * 1000:.0f} mm and {missed_rad[k]:.2f} rad, "
        f"the end-effector gets to ({', '.join(f'{value:.3f}' for value in positions[k])})"
        for k in np.flatnonzero((missed_m > REACHED_M) | (missed_rad > REACHED_RAD))
    ]
    found = found or [f"every waypoint is reached within {REACHED_M * 1000:g} mm and {REACHED_RAD:g} rad"]
    if motion.ik_error_m > missed_m.max() + REACHED_M or motion.ik_error_rad > missed_rad.max() + REACHED_RAD:
        worst = f"{motion.ik_error_m * 1000:.0f} mm and {motion.ik_error_rad:.2f} rad"
        found.append(f"between waypoints the arm leaves the straight way by up to {worst}")
    return found


def place_components(robot: Robot, tool: Tool, motion: JointTrajectory) -> dict[str, Array]:
    """Place the corners of each component in the world, (T, V, 3); of at most `MAX_COMPONENTS` components."""
    frames = link_frames(robot, tool.gripper, motion.arm, np.column_stack([motion.fingers] * 2))
    placed, points = tool.placed(), {}
    for component in tool.components[:MAX_COMPONENTS]:
        mount, pose = placed[component.name]
        corners = pose.apply(np.asarray(component.shape.to_trimesh().vertices))
        rotations, positions = frames[mount]
        points[component.name] = np.einsum("tij,vj->tvi", rotations, corners) + positions[:, None]
    return points


def _space(points: Array) -> str:
    low, high = points.min(axis=0), points.max(axis=0)
    return ", ".join(f"{a:.3f} to {b:.3f}" for a, b in zip(low + 0.0, high + 0.0, strict=True))
