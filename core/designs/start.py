"""The rules for the start: a tool suits the goals, and is clear of the arm, of the scene, and of its other half."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from core.design import DesignError, Fixture, Tool
from core.designs.rules import Faults, check_goals, describe_way
from core.designs.tool_fields import find_fixture_faults
from core.geometry import Array, Pose
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
from core.values.refusals import DesignReason

MAX_ARM_OVERLAP_M = 0.001  # at the start; the scene may not even be touched
_CLEAR_M = 0.001  # from what it overlapped, by the way out
_MOST_STEPS = 5  # of a search for the way out
_LONGEST_M = 0.5  # of a way out
_INFEASIBLE = 1e-9
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

    def _find_faults(self, tool: Tool) -> Iterator[DesignError]:
        """Say what each component overlaps at the start."""
        arm, frames = self._arm(tool.gripper)
        placed = [*_place_tool(tool, frames)]

        if tool.fixture is not None:
            solids = [part.solid for part in placed]
            others = [*solids, *arm.solids, *self._scene.solids]
            place = self.task.fixture
            yield from find_fixture_faults(tool.fixture, place, self._fixed, others)

        for mount in dict.fromkeys(part.mount for part in placed):
            group = [part for part in placed if part.mount == mount]
            halves = [other.solid for other in placed if other.mount != mount]
            carriers = (mount,) if tool.gripper else self.robot.near_mount
            rest = _Others(Obstacles(halves), arm, self._scene, carriers)
            yield from _describe_overlaps(group, rest)

    def _find_traps(self, tool: Tool) -> Iterator[DesignError]:
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


class _Overlap(NamedTuple):
    """What a component overlaps at the start.

    Attributes:
        component: its name.
        depth_m: how deep it is inside.
        other: inside what, in words.
        way: (3,) the way out, in the world.
        mend: what else would help, in words.
    """

    component: str
    depth_m: float
    other: str
    way: Array
    mend: str

    def refuse(self, mend: str = "") -> DesignError:
        """Build the error that says so."""
        depth = "touching"
        if self.depth_m > _TOUCH_M:
            depth = f"{1000 * self.depth_m:.1f} mm inside"

        return DesignError.because(
            DesignReason.START_INSIDE,
            component=self.component,
            depth=depth,
            depth_mm=1000 * self.depth_m,
            other=self.other,
            mend=mend,
        )


class _Others(NamedTuple):
    """What the components that hang from one mount have to be clear of.

    Attributes:
        halves: the tool's components on the other finger.
        arm: its links.
        scene: the solids of its bodies.
        carriers: links that the components may overlap.
    """

    halves: Obstacles
    arm: Obstacles
    scene: Obstacles
    carriers: Collection[str]


def _find_overlaps(group: Iterable[_Placed], others: _Others) -> list[_Overlap]:
    """Find what the components that hang from one mount overlap."""
    around = ", or bend the tool around it"
    smaller = ", or shorten or turn the tool"
    kinds = (
        (others.halves, MAX_ARM_OVERLAP_M, "{!r} on the other finger", ""),
        (others.arm, MAX_ARM_OVERLAP_M, "the arm ({})", around),
        (others.scene, -_TOUCH_M, "{!r} of the scene", smaller),
    )
    found: list[_Overlap] = []

    for part in group:
        for obstacles, most, name, mend in kinds:
            for other in obstacles.near(part.solid, _TOUCH_M):
                if obstacles is others.arm and other.name in others.carriers:
                    continue
                gap, _, direction = contact(part.solid, other)
                if -gap <= most:
                    continue

                way = (gap - _CLEAR_M) * direction
                where = name.format(other.name)
                found.append(_Overlap(part.solid.name, -gap, where, way, mend))

    return found


def _describe_overlaps(
    group: Sequence[_Placed], others: _Others
) -> Iterator[DesignError]:
    """Say what the components that hang from one mount overlap, and the one way on which all of them come out."""
    overlaps = _find_overlaps(group, others)
    if not overlaps:
        return

    *first, last = overlaps
    for overlap in first:
        yield overlap.refuse()

    way = _find_way_out(group, others) if first else last.way
    if way is None:
        yield last.refuse(
            "; no move of the whole tool helps: shorten it, turn it, or bend it around what is there"
        )
        return

    mount = group[0].mount
    turned = group[0].frame.rotation.inv().apply(way)
    moved = "all of these components" if first else "it"
    yield last.refuse(f"; move {moved} by {describe_way(turned, mount)}{last.mend}")


def _find_way_out(group: Sequence[_Placed], others: _Others) -> Array | None:
    """Find the shortest way (3,) in the world on which components come out of all that they overlap, moved as one.

    None: none was found. Each overlap asks for a length along its direction; what is met on the way asks for more.
    """
    way = np.zeros(3)
    directions: list[Array] = []
    lengths: list[float] = []

    for _ in range(_MOST_STEPS):
        moved = [part._replace(solid=_shift(part.solid, way)) for part in group]
        overlaps = _find_overlaps(moved, others)
        if not overlaps:
            return way

        for overlap in overlaps:
            length = float(np.linalg.norm(overlap.way))
            direction = overlap.way / length
            directions.append(direction)
            lengths.append(length + float(direction @ way))

        shortest = _solve_shortest(np.array(directions), np.array(lengths))
        if shortest is None:
            return None
        way = shortest

    return None


def _shift(solid: Solid, way: Array) -> Solid:
    """Return a solid that is moved by ``way`` (3,)."""
    pose = solid.pose
    return replace(solid, pose=Pose(pose.position + way, pose.quaternion))


def _solve_shortest(directions: Array, lengths: Array) -> Array | None:
    """Return the shortest way (3,) that goes as far as asked along each of N directions; None: there is none.

    By Lawson and Hanson's reduction of the least distance to non-negative least squares.
    """
    from scipy.optimize import nnls  # a third of a second, for what is seldom

    columns = np.vstack([directions.T, lengths])
    weights, rest = nnls(columns, np.array([0.0, 0.0, 0.0, 1.0]))
    left = columns @ weights - np.array([0.0, 0.0, 0.0, 1.0])
    if rest < _INFEASIBLE or np.linalg.norm(left[:3]) > _LONGEST_M * abs(left[3]):
        return None

    return np.asarray(-left[:3] / left[3])


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
) -> Iterator[DesignError]:
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
    yield DesignError.because(
        DesignReason.TRAPPED,
        what=what,
        direction=f"({x:g}, {y:g}, {z:g})",
        part=part,
        body=trap.body,
    )
