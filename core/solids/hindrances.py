"""Find what in a scene itself prevents a goal: joints that are blocked wherever others stand, and forces too small.

A joint is swept from where it starts, against what is fixed and against what other joints bear. What meets it counts
only if it does so wherever its own joint stands. What moves freely can be pushed away, and never counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from core.goals import Goal, Reach, limits, numbered
from core.robot.solids import Obstacles, body_solids
from core.scene import Scene
from core.solids.escape import find_trap
from core.solids.standing import OVERLAP_M, measure_gap

STEPS = 24  # places of a joint that are swept
PLACES = 9  # of another joint, while one is swept
MOVED_M = 0.01  # a body that ends nearer stays where it is
CALM = 0.98
"""The share of the least force that a limit has to allow; the rest is rounding."""


@dataclass(frozen=True)
class Block:
    """Where a joint can't go on: its position, the body of it that meets another one."""

    value: float
    body: str
    other: str


class Sweep:
    """How far a joint of a scene gets, while all others stand where they help most."""

    def __init__(self, scene: Scene, joint: str) -> None:
        self.scene = scene
        self.joint = scene.placed_joints[joint].joint

    def to(self, value: float) -> Block | None:
        """Return what stops the joint on its way to a value; None: nothing does."""
        for step in np.linspace(self.joint.start, value, STEPS + 1)[1:].tolist():
            moved = self.scene.with_starts({self.joint.name: step})
            for name in self.bodies:
                for other in self._others:
                    if self._is_blocked(moved, name, other):
                        return Block(step, name, other)

        return None

    def reach(self, value: float) -> float:
        """Return how far towards a value the joint gets."""
        block = self.to(value)
        if block is None:
            return value

        step = (value - self.joint.start) / STEPS
        return block.value - step

    @cached_property
    def bodies(self) -> list[str]:
        """The joint's body, and what hangs from it."""
        names = [self.joint.body]
        for placed in self.scene.ordered_joints:
            if placed.joint.parent in names:
                names.append(placed.joint.body)

        return names

    @cached_property
    def _others(self) -> list[str]:
        """The bodies that can't be pushed away: fixed, or borne by another joint."""
        borne = {joint.body for joint in self.scene.joints}
        return [
            body.name
            for body in self.scene.bodies
            if body.collisions
            and body.name not in self.bodies
            and (body.fixed or body.name in borne)
        ]

    def _is_blocked(self, moved: Scene, name: str, other: str) -> bool:
        """Report whether a body meets another one, wherever that one's own joint stands."""
        if frozenset((name, other)) in self.scene.joined:
            return False

        before = min(measure_gap(self.scene, name, other), 0.0)
        limit = before - OVERLAP_M
        if measure_gap(moved, name, other) >= limit:
            return False

        for value in self._places(other):
            elsewhere = moved.with_starts(value)
            if measure_gap(elsewhere, name, other) >= limit:
                return False

        return True

    def _places(self, other: str) -> Iterator[dict[str, float]]:
        """Yield places of the joint that bears a body."""
        for joint in self.scene.joints:
            if joint.body == other and joint.kind != "ball":
                low = max(joint.lower, -math.pi)
                high = min(joint.upper, math.pi)
                for value in np.linspace(low, high, PLACES).tolist():
                    yield {joint.name: value}


def find_hindrances(goals: Sequence[Goal], scene: Scene) -> Iterator[str]:
    """Yield a line for each goal that the scene itself prevents."""
    for number, goal in numbered(goals).items():
        where = goal.label(number)
        yield from find_shut_in(goal, where, scene)
        yield from find_weak_limits(goal, where, goals, scene)


def find_shut_in(goal: Reach, where: str, scene: Scene) -> Iterator[str]:
    """Yield a line for each body that must leave, and that a joint shuts in which can't open far enough."""
    for name in _list_leaving(goal, scene):
        shutters = _find_shutters(scene, name)
        if not shutters:
            continue

        found = [_explain_shutter(scene, name, joint) for joint in shutters]
        if all(found):
            yield f"{where}: {found[0]}"


def _list_leaving(goal: Reach, scene: Scene) -> list[str]:
    """List the free bodies that a goal wants elsewhere."""
    state = scene.state()
    borne = {joint.body for joint in scene.joints}
    names = []
    for name in goal.subjects(state):
        place = goal.place_of(name, state)
        if place is None or name in borne or scene[name].fixed:
            continue

        here = state.position(name)
        way = np.where(np.isnan(place), 0.0, place - here)
        if np.linalg.norm(way) > MOVED_M:
            names.append(name)

    return names


def _find_shutters(scene: Scene, name: str) -> list[str]:
    """Find the joints that keep a body in where they start, and would let it out at their far end; none: it is free."""
    if not _is_shut_in(scene, name):
        return []

    shutters = []
    for joint in scene.joints:
        if joint.kind == "ball":
            continue

        for end in _ends(joint.lower, joint.upper, joint.start):
            if not _is_shut_in(scene.with_starts({joint.name: end}), name):
                shutters.append(joint.name)
                break

    return shutters


def _explain_shutter(scene: Scene, name: str, joint_name: str) -> str:
    """Say what keeps a joint from letting a body out; empty: nothing does."""
    sweep = Sweep(scene, joint_name)
    joint = sweep.joint
    blocks = []
    for end in _ends(joint.lower, joint.upper, joint.start):
        if _is_shut_in(scene.with_starts({joint_name: end}), name):
            continue

        block = sweep.to(end)
        if block is None:
            return ""
        reached = scene.with_starts({joint_name: sweep.reach(end)})
        if not _is_shut_in(reached, name):
            return ""
        blocks.append(block)

    if not blocks:
        return ""

    block = blocks[0]
    unit = "m" if joint.kind == "slider" else "rad"
    return (
        f"{name} can't get out: joint {joint_name} would let it, and {block.body} meets {block.other} at "
        f"{block.value:.3g} {unit}, wherever {block.other} stands; move {block.other} out of the way of {block.body}"
    )


def _ends(lower: float, upper: float, start: float) -> list[float]:
    """List the ends of a joint that are not where it starts."""
    limits = (max(lower, -math.pi), min(upper, math.pi))
    return [end for end in limits if abs(end - start) > 1e-3]


def _is_shut_in(scene: Scene, name: str) -> bool:
    """Report whether what is fixed or borne by joints keeps a body where it is."""
    borne = {joint.body for joint in scene.joints}
    solids = [
        solid
        for body in scene.bodies
        if body.name != name and (body.fixed or body.name in borne)
        for solid in body_solids(body)
    ]
    return find_trap(tuple(body_solids(scene[name])), Obstacles(solids)) is not None


def find_weak_limits(
    goal: Reach, where: str, goals: Sequence[Goal], scene: Scene
) -> Iterator[str]:
    """Yield a line for each body that must move, and may be pressed with less than it takes to push or lift it."""
    gravity = float(np.linalg.norm(scene.gravity))
    smoothest = min(body.friction for body in scene.bodies if body.fixed)
    for name in _list_leaving(goal, scene):
        body = scene[name]
        weight = body.mass * gravity
        needed = weight * min(math.sqrt(body.friction * smoothest), 1.0)
        for limit in limits(goals):
            allowed = limit.allows_n(name)
            if allowed is None or allowed >= CALM * needed:
                continue
            yield (
                f"{where}: {name} weighs {weight:.3g} N, and takes about {needed:.3g} N to push; {allowed:g} N "
                "move nothing; allow more, or make it lighter"
            )
