"""The rules for the start: a tool suits the goals, and is clear of the arm, of the scene, and of its other half."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

from core.design import Fixture, Tool
from core.designs.rules import Faults, check_goals, describe_way
from core.designs.tool_fields import find_fixture_faults
from core.geometry import Pose
from core.interfaces import Task
from core.robot.description import beyond
from core.robot.kinematics import arm_of, link_poses
from core.robot.solids import (
    Obstacles,
    Solid,
    body_solids,
    contact,
    robot_solids,
    solids_of,
)
from core.scene import Scene
from core.solids.escape import Trap, find_trap

MAX_ARM_OVERLAP_M = 0.001  # at the start; the scene may not even be touched
_CLEAR_M = 0.001  # from what it overlapped, by the way out
_TOUCH_M = 1e-5  # the accuracy of the home pose from inverse kinematics


class SpawnRules:
    """Checks that a tool starts clear of the arm and of all bodies, in ``scene`` (None: the task's layout of ``seed``).

    It must also have been possible to bring it there, past what stands in the scene, unless `Task.tool_in_place`. What
    the arm's last joint moves, such as a hand, comes along; the links before it are not looked at.

    All tools come here before they are tried: written, given, kept or varied. So the goals are looked at here, too: a
    tool without the fixture that they name can earn nothing.

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
        self._fixed = {body.name for body in bodies if body.fixed}
        self._arms: dict[bool, tuple[Obstacles, dict[str, Pose]]] = {}

    def check(self, tool: Tool) -> None:
        """Refuse a tool with which the goals can't be reached, or that does not start clear; see `check_start`.

        Raises:
            DesignError: says why.
        """
        check_goals(tool, self.task)
        self.check_start(tool)

    def check_start(self, tool: Tool) -> None:
        """Refuse a tool that starts inside the arm, in contact with the scene, inside its other half, or in a trap.

        Raises:
            DesignError: names all components that do, what they overlap, the depths and the ways out; of several tasks
                which.
        """
        faults = Faults()
        for rules in self._parts:
            with faults.collect(f"in {rules.task.name}, "):
                rules.check_start(tool)
        if not self._parts:
            # What starts inside something is told so, and not that it can't get out.
            faults += [*self._find_faults(tool)] or [*self._find_traps(tool)]
        faults.refuse()

    def _find_faults(self, tool: Tool) -> Iterator[str]:
        """Say what each component overlaps at the start."""
        arm, frames = self._arm(tool.gripper)
        placed = [*_place_tool(tool, frames)]

        if tool.fixture is not None:
            solids = [part.solid for part in placed]
            others = [*solids, *arm.solids, *self._scene.solids]
            place = self.task.fixture
            yield from find_fixture_faults(tool.fixture, place, self._fixed, others)

        for part in placed:
            near = (part.solid, _TOUCH_M)
            carriers = (part.mount,) if tool.gripper else self.robot.near_mount
            halves = [other.solid for other in placed if other.mount != part.mount]
            links = [link for link in arm.near(*near) if link.name not in carriers]
            start = f"component {part.solid.name!r} starts"
            for other, depth, move in part.overlaps(halves, MAX_ARM_OVERLAP_M):
                yield f"{start} {depth} {other!r} on the other finger; {move}"
            for link, depth, move in part.overlaps(links, MAX_ARM_OVERLAP_M):
                yield f"{start} {depth} the arm ({link}); {move}, or bend the tool around it"
            for body, depth, move in part.overlaps(self._scene.near(*near), -_TOUCH_M):
                yield f"{start} {depth} {body!r} of the scene; {move}, or shorten or turn the tool"

    def _find_traps(self, tool: Tool) -> Iterator[str]:
        """Say what keeps a tool, or its fixture, from being brought to where it starts."""
        if self.task.tool_in_place:
            return

        standing = self._scene
        fixture = tool.fixture

        if fixture is not None:
            solids = [*_place_fixture(fixture)]
            yield from _describe_trap("fixture", find_trap(solids, standing), ())
            standing = Obstacles([*standing.solids, *solids])

        arm, frames = self._arm(tool.gripper)
        held = [part.solid for part in _place_tool(tool, frames)]
        if not held:
            return

        moved = beyond(self.robot, Tool(gripper=tool.gripper))
        hand = [link for link in arm.solids if link.name in moved]
        trap = find_trap([*held, *hand], standing)
        yield from _describe_trap("tool", trap, moved)

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


class _Placed(NamedTuple):
    """A solid of a component, in the world, with the mount that it hangs from and the mount's pose."""

    solid: Solid
    mount: str
    frame: Pose

    def overlaps(
        self, others: Iterable[Solid], most: float
    ) -> Iterator[tuple[str, str, str]]:
        """Yield the name of what it overlaps by more than ``most`` metres, the depth, and how it comes out."""
        for other in others:
            gap, _, direction = contact(self.solid, other)
            if -gap > most:
                way = self.frame.rotation.inv().apply((gap - _CLEAR_M) * direction)
                depth = "touching"
                if -gap > _TOUCH_M:
                    depth = f"{-gap * 1000:.1f} mm inside"
                yield other.name, depth, f"move it by {describe_way(way, self.mount)}"


def _place_tool(tool: Tool, frames: dict[str, Pose]) -> Iterator[_Placed]:
    """Yield the solids of a tool's components, with the world poses of the links that bear them."""
    places = tool.placed()

    for component in tool.components:
        mount, pose = places[component.name]
        there = frames[mount] @ pose
        for solid in solids_of(component.name, component.shape, there):
            yield _Placed(solid, mount, frames[mount])


def _place_fixture(fixture: Fixture) -> Iterator[Solid]:
    """Yield the solids of a fixture's components in the world."""
    places = fixture.parts.placed()

    for component in fixture.parts.components:
        _, pose = places[component.name]
        yield from solids_of(component.name, component.shape, fixture.pose @ pose)


def _describe_trap(
    what: str, trap: Trap | None, links: Collection[str]
) -> Iterator[str]:
    """Say why a tool or a fixture can't have been brought to where it starts.

    Args:
        what: the tool or the fixture.
        trap: what holds it; None: nothing does.
        links: of the arm, which come along.
    """
    if trap is None:
        return

    part = f"component {trap.part!r}"
    if trap.part in links:
        part = f"the arm ({trap.part})"

    x, y, z = (round(float(value), 1) + 0.0 for value in trap.direction)
    yield (
        f"nothing could have brought the {what} to its start: even straight out along ({x:g}, {y:g}, {z:g}) {part} "
        f"goes through {trap.body!r}, and no way around was found; start outside, and let the plan bring it in"
    )
