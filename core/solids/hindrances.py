"""Find what in a scene itself prevents a goal: joints that are blocked wherever others stand, and forces too small.

A joint is swept from where it starts, against what is fixed and against what other joints bear. What meets it counts
only if it does so wherever its own joint stands. What moves freely can be pushed away, and never counts.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from core.goals import Goal, Reach, limits, numbered
from core.robot.solids import Obstacles, body_solids
from core.scene import Joint, Scene
from core.solids.escape import find_trap
from core.solids.standing import OVERLAP_M, Box, bound, measure_gap

STEPS = 24  # places of a joint that are swept
PLACES = 9  # of another joint, while one is swept
MOVERS = 2  # other joints that are looked at together: that is 81 places
LEAST_SHARE = (
    0.05  # of a goal's progress: what lies beyond a stop, and is less, may be rounding
)
MOVED_M = 0.01  # a body that ends nearer stays where it is
CALM = 0.98
"""The share of the least force that a limit has to allow; the rest is rounding."""


@dataclass(frozen=True)
class Block:
    """Where a joint can't go on: its position, the body of it that meets another one."""

    joint: Joint
    value: float
    body: str
    other: str

    def __str__(self) -> str:
        unit = "m" if self.joint.kind == "slider" else "rad"
        where = f"where joint {self.joint.name} is at {self.value:.3g} {unit}"
        return f"{self.body} meets {self.other} {where}"


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
                if not moved[name].collisions:
                    continue

                low, high = bound(moved[name])
                for other, (bottom, top) in self._others.items():
                    apart = (low > top).any() or (bottom > high).any()
                    if not apart and self._is_blocked(moved, name, other):
                        return Block(self.joint, step, name, other)

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
    def _others(self) -> dict[str, Box]:
        """The bodies that can't be pushed away, fixed or borne by other joints of what is fixed, and their boxes."""
        return {
            body.name: bound(body)
            for body in self.scene.bodies
            if body.collisions
            and body.name not in self.bodies
            and (body.fixed or self.scene.find_hinge(body.name))
        }

    def _is_blocked(self, moved: Scene, name: str, other: str) -> bool:
        """Report whether a body meets another one, wherever the other joints that bear one of the two stand."""
        if frozenset((name, other)) in self.scene.joined:
            return False

        before = min(measure_gap(self.scene, name, other), 0.0)
        limit = before - OVERLAP_M
        if measure_gap(moved, name, other) >= limit:
            return False

        movers = self._list_movers(name, other)
        if len(movers) > MOVERS or any(joint.kind == "ball" for joint in movers):
            return False  # there may be a way past

        places = [_list_places(joint) for joint in movers]
        for values in itertools.product(*places):
            starts = {
                joint.name: value for joint, value in zip(movers, values, strict=True)
            }
            if measure_gap(moved.with_starts(starts), name, other) >= limit:
                return False

        return True

    def _list_movers(self, name: str, other: str) -> list[Joint]:
        """List the joints but the swept one that move one of two bodies against the other."""
        bearing = {*_list_bearing(self.scene, name)}
        moving = bearing.symmetric_difference(_list_bearing(self.scene, other))
        return [
            joint
            for joint in self.scene.joints
            if joint.name in moving and joint.name != self.joint.name
        ]


def _list_bearing(scene: Scene, name: str | None) -> Iterator[str]:
    """Yield the joints that bear a body, from its own one on."""
    joints = {joint.body: joint for joint in scene.joints}
    while name in joints:
        yield joints[name].name
        name = joints[name].parent


def _list_places(joint: Joint) -> list[float]:
    """List places of a joint that may stand anywhere."""
    low = max(joint.lower, -math.pi)
    high = min(joint.upper, math.pi)
    return np.linspace(low, high, PLACES).tolist()


def find_blocked(goals: Sequence[Goal], scene: Scene) -> dict[object, str]:
    """Find the goals that a scene's own bodies prevent, which nothing can push away, and a line for each.

    A joint meets them before a goal's body is where it is asked to be. What the joint can't do pays nothing.
    """
    found = dict[object, str]()
    scene = replace(scene, hindered={})  # what is known of it does not count
    state = scene.state()
    for number, goal in numbered(goals).items():
        blocks = dict[str, str]()
        for body, joint, aim in _list_guides(goal, scene):
            line = _explain_block(goal, scene, joint, aim)
            if line:
                blocks[body] = line

        if goal.needs_some(len(goal.subjects(state)), len(blocks)):
            (line, *_) = blocks.values()
            found[goal] = f"{goal.label(number)}: {line}"

    return found


def _list_guides(goal: Reach, scene: Scene) -> Iterator[tuple[str, str, float | None]]:
    """Yield the joints that alone decide where a goal's bodies get: the body, its joint, and what is asked of that."""
    for want in goal.wants(scene):
        for joint in scene.joints:
            root = scene.find_hinge(joint.body)
            if joint.kind == "ball" or joint.body not in want.bodies:
                continue
            if root and joint.name == want.joint:
                yield joint.body, joint.name, want.to
            elif root == joint.name and not want.joint:
                yield joint.body, joint.name, None


def _explain_block(goal: Reach, scene: Scene, name: str, aim: float | None) -> str:
    """Say what keeps a joint from where a goal is fulfilled best; empty: nothing does, or that is nowhere."""
    sweep = Sweep(scene, name)
    joint = sweep.joint
    ends = _ends(joint.lower, joint.upper, joint.start)
    if aim is not None:
        ends = [min(max(aim, joint.lower), joint.upper)]

    blocks = {end: sweep.to(end) for end in ends}
    if not any(blocks.values()):
        return ""

    start = scene.state()
    free = 0.0
    beyond = 0.0
    for end, block in blocks.items():
        places = np.linspace(joint.start, end, STEPS + 1).tolist()
        for place in places:
            moved = scene.with_starts({name: place})
            share = float(goal.progress(start, scene.complete(moved.state())))
            way = abs(place - joint.start)
            if block is None or way < abs(block.value - joint.start):
                free = max(free, share)
            elif share > beyond:
                beyond = share
                nearest = block

    if free > beyond - LEAST_SHARE:
        return ""

    mend = f"move {nearest.other}, or ask for less"
    return f"{nearest}, and has to go on; {mend}; so it pays nothing"


def find_hindrances(goals: Sequence[Goal], scene: Scene) -> Iterator[str]:
    """Yield a line for each goal that the scene itself prevents."""
    yield from find_blocked(goals, scene).values()
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
    mend = f"move {block.other} out of the way of {block.body}"
    return f"{name} can't get out: {block}, wherever {block.other} stands; {mend}"


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
