"""The rule for the start: a tool is clear of the arm, of the scene, and of its other half."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace

from core.design import Candidate, DesignError, Tool
from core.geometry import Pose
from core.interfaces import Task
from core.robot.kinematics import arm_of, link_poses
from core.robot.solids import (
    Obstacles,
    Solid,
    body_solids,
    robot_solids,
    signed_distance,
    solids_of,
)
from core.scene import Scene

MAX_ARM_OVERLAP_M = 0.001  # at the start; the scene may not even be touched
_TOUCH_M = 1e-5  # the accuracy of the home pose from inverse kinematics


class SpawnRules:
    """Checks that a tool starts clear of the arm and of all bodies, in ``scene`` (None: the task's layout of ``seed``).

    The arm is at the task's home pose and the fingers are open. A component may overlap what carries it: the links at
    the flange for rigid tools, the component's own finger for gripper tools.

    Raises:
        UserError: the arm can't reach the task's home pose.
    """

    def __init__(self, task: Task, seed: int = 0, scene: Scene | None = None) -> None:
        self.task = task
        self.robot = task.robot
        self._parts = [
            SpawnRules(part, seed) for part in task.parts if part is not task
        ]
        if self._parts:
            return
        self._joints = arm_of(task.robot).home_for(task.home)
        bodies = (scene or task.scene(seed)).bodies
        self._scene = Obstacles(itertools.chain(*map(body_solids, bodies)))
        self._arms: dict[bool, tuple[Obstacles, dict[str, Pose]]] = {}

    def check(self, tool: Tool) -> None:
        """Refuse a tool that starts inside the arm, in contact with the scene, or inside its other half.

        Raises:
            DesignError: names the component, what it overlaps, and the depth; of several tasks which.
        """
        for rules in self._parts:
            try:
                rules.check(tool)
            except DesignError as error:
                raise DesignError(f"in {rules.task.name}, {error}") from error

        if self._parts:
            return

        arm, frames = self._arm(tool.gripper)
        placed = tool.placed()
        solids: list[tuple[Solid, str]] = []  # each with its mount
        for component in tool.components:
            mount, pose = placed[component.name]
            there = frames[mount] @ pose
            for solid in solids_of(component.name, component.shape, there):
                solids.append((solid, mount))

        _check_halves(solids)

        for solid, mount in solids:
            carriers = (mount,) if tool.gripper else self.robot.near_mount
            _check_arm(solid, arm, carriers)
            _check_scene(solid, self._scene)

    def _arm(self, gripper: bool) -> tuple[Obstacles, dict[str, Pose]]:
        """The solids of the arm at home, and the world poses of its links."""
        if gripper not in self._arms:
            frames = link_poses(self.robot, gripper, self._joints)
            solids = [
                replace(solid, pose=frames[solid.name] @ solid.pose)
                for solid in robot_solids(self.robot, gripper)
            ]
            self._arms[gripper] = Obstacles(solids), frames
        return self._arms[gripper]


def check_starts(candidates: Iterable[Candidate], rules: SpawnRules) -> list[Candidate]:
    """Return candidates, those whose tool does not start clear of everything with that as their problem."""
    return [_check_start(candidate, rules) for candidate in candidates]


def _check_start(candidate: Candidate, rules: SpawnRules) -> Candidate:
    if candidate.problem is not None or candidate.tool is None:
        return candidate
    try:
        rules.check(candidate.tool)
    except DesignError as error:
        return replace(candidate, problem=str(error))
    return candidate


def _check_halves(solids: Sequence[tuple[Solid, str]]) -> None:
    """Refuse components on one finger that start inside components on the other."""
    for (left, left_mount), (right, right_mount) in itertools.combinations(solids, 2):
        if left_mount == right_mount:
            continue
        depth = -signed_distance(left, right)
        if depth > MAX_ARM_OVERLAP_M:
            raise DesignError(
                f"components {left.name!r} and {right.name!r}, on different fingers, start {depth * 1000:.1f} mm "
                "inside each other; move them apart"
            )


def _check_arm(solid: Solid, arm: Obstacles, carriers: Sequence[str]) -> None:
    """Refuse a component that starts inside a link of the arm, other than those that carry it."""
    for link, gap in arm.gaps(solid, _TOUCH_M):
        if link not in carriers and -gap > MAX_ARM_OVERLAP_M:
            raise DesignError(
                f"component {solid.name!r} starts {-gap * 1000:.1f} mm inside the arm ({link}); "
                "move it away from the arm, or bend the tool around it"
            )


def _check_scene(solid: Solid, scene: Obstacles) -> None:
    """Refuse a component that starts in contact with a body."""
    for body, gap in scene.gaps(solid, _TOUCH_M):
        if gap >= _TOUCH_M:
            continue
        contact = "touching"
        if -gap > _TOUCH_M:
            contact = f"{-gap * 1000:.1f} mm inside"
        raise DesignError(
            f"component {solid.name!r} starts {contact} {body!r} of the scene; "
            "shorten or turn the tool so that it starts clear of everything"
        )
