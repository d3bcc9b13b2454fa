"""What a layout and the task's goals ask for: subgoals, drawn at random.

A goal gives one subgoal or several. Many bodies are moved in lanes, which are slices across the way to the goal, or one
by one; where one of them is enough, an easy one is chosen. The way of each follows from the goal's place, or is drawn
where the goal only says that bodies must be lifted, or get away.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from core.design import Fixture
from core.geometry import Array, Pose
from core.goals import Reach, number_of
from core.interfaces import Brief
from core.scene import Scene, State
from plugins.vlms.offline.boxes import LEVEL, UP
from plugins.vlms.offline.chance import Range
from plugins.vlms.offline.edges import lead_over_edge
from plugins.vlms.offline.pegs import hang_on_peg
from plugins.vlms.offline.scene_model import SceneModel, Solid
from plugins.vlms.offline.subgoals import Subgoal, goal_position
from plugins.vlms.offline.targets import Target, find_steady, find_targets, turn_over

_LIFT_M = 0.15  # what is to be held is lifted by this
_ASIDE_M = 0.1  # how far bodies are moved of which nothing is said
_AWAY_M = 0.2  # how far a body is moved in a task without goals
_FREE_M = 0.03  # clearance above a body that nothing lies on
_NEAR_GOAL_M = 0.05  # bodies that are nearer need no lanes
_MOST_LANES = 4
_ALL_AT_ONCE = 0.6  # how often bodies near their goal are moved at once, rather than one of the upper ones
_AS_HIGH_M = 0.005  # bodies that are lower by less are as easy to get at
# Of how far lots are apart at the start, that they are in a hollow.
_SPREAD = Range(0.2, 1.0)
# How far bodies get that only have to get away, in the ways that they have to: with so much more they are sure to.
_ESCAPE = Range(1.02, 1.4)
# How often each way: toward the arm's axis, along -x, x, y and -y, away from the axis, and up. An arm pulls with ease.
_ESCAPES = (2.0, 3.0, 1.0, 1.0, 1.0, 0.5, 1.5)
_BLOCKED = 0.02  # times as often where something is in the way, which may yield
# From a hollow's outside: its wall, and what a body is off where it falls.
_WALL_M = 0.03
_ALIKE_M = 0.06  # two ways that differ by less are one


class NothingToMove(ValueError):
    """A brief leaves the designer nothing to do."""


class SceneAnalysis:
    """A layout and the task's goals in it, of which `draw_subgoals` draws what a plan is to do.

    Attributes:
        world: the layout's bodies.
        model: the same, but where gravity draws up, it is turned over: subgoals and paths are made as if it drew down.
        groups: goals that must be reached together, in the model.
    """

    def __init__(
        self,
        brief: Brief,
        turn: Pose | None = None,
        fixture: Fixture | None = None,
    ) -> None:
        """Read a brief; for ``turn`` and ``fixture`` see `SceneModel`.

        For a task without goals, the goal is to move its first free body.

        Raises:
            NothingToMove: there are no goals and all bodies are fixed.
        """
        self.world = SceneModel(brief, turn, fixture=fixture)
        self.model = self.world
        self._gripper = brief.gripper
        scene = self.world.scene

        upright = self.world.find_upright()
        if upright is not None:
            self.model = SceneModel(brief, turn, upright, fixture)

        steady = find_steady(brief.task.goals, scene)
        groups: dict[int, list[Target]] = {}
        for number, goal in enumerate(brief.task.goals):
            if not isinstance(goal, Reach):
                continue

            group = groups.setdefault(0 if brief.task.every else number, [])
            is_met = brief.task.every and _is_met(goal, scene.state())
            targets = [
                replace(
                    target,
                    steady=not steady.isdisjoint(target.bodies),
                    number=number,
                    after=number_of(goal.after, brief.task.goals),
                )
                for target in find_targets(goal, scene)
            ]
            if upright is not None:
                targets = [turn_over(target, upright) for target in targets]
            _add_targets(group, targets, is_met)

        self.groups = [self._leave_out_riders(group) for group in groups.values()]
        self.groups = [group for group in self.groups if group]
        if self.groups:
            return

        if not scene.free:
            raise NothingToMove(
                "the task has no goals and no body that can move; give it a goal, such as "
                "Placed(bodies=('cube',), place=(0.6, 0, 0.05))"
            )

        self.groups = [[Target((scene.free[0].name,), away=_AWAY_M)]]

    def _leave_out_riders(self, group: list[Target]) -> list[Target]:
        """Return the goals of a group without those whose bodies are taken along by what they stand on.

        Args:
            group: goals that must be reached together, in the model.
        """
        return [
            target
            for target in group
            if not any(self._takes_along(other, target) for other in group)
        ]

    def _takes_along(self, carrier: Target, rider: Target) -> bool:
        """Report whether all of a goal's bodies stand on or in a body of another, which goes as far as they have to.

        Args:
            carrier: a goal with the body below.
            rider: the other one.
        """
        if carrier is rider or len(carrier.bodies) > 1 or carrier.place is None:
            return False

        below = self.model.solids[carrier.bodies[0]]
        shift = goal_position(below.position, carrier) - below.position
        for name in rider.bodies:
            body = self.model.solids[name]
            place = goal_position(body.position, rider)
            goes_along = np.linalg.norm(shift - place + body.position) < _ALIKE_M
            if not (body.stands_on(below) and rider.place and goes_along):
                return False

        return True

    @property
    def goals(self) -> list[Target]:
        """All goals that have something to reach, in the world."""
        return [goal for group in self.groups for goal in group]

    def with_groups(self, groups: Sequence[Sequence[Target]]) -> SceneAnalysis:
        """Return the same with other goals.

        Args:
            groups: of goals that must be reached together.
        """
        other = copy(self)
        other.groups = [[*group] for group in groups]
        return other

    def after(self, subgoals: Sequence[Subgoal]) -> SceneAnalysis:
        """Return the same as it is once subgoals are reached: bodies are there, and places that go by them went along.

        Args:
            subgoals: in this analysis.
        """
        scene = self.world.scene
        for subgoal in subgoals:
            scene = _reach(subgoal, scene)

        later = copy(self)
        later.world = self.world.after(scene)
        later.model = later.world
        later.groups = []
        for group in self.groups:
            aimed = [_aim_again(goal, self.world.scene, scene) for goal in group]
            later.groups.append(aimed)

        return later

    def draw_subgoals(self, rng: Generator, alone: bool = False) -> list[Subgoal]:
        """Draw subgoals for a group of goals at random, in order.

        They are for all bodies, in lanes if these are many; for one of them if it is enough. With ``alone`` each
        scattered body gets its own.

        Args:
            rng: random numbers.
            alone: whether scattered bodies are moved one by one.
        """
        number = 0
        if len(self.groups) > 1:
            number = int(rng.integers(len(self.groups)))

        subgoals = []
        for goal in self.groups[number]:
            subgoals += self._draw_for_goal(goal, rng, alone)

        return subgoals

    def _draw_for_goal(
        self,
        goal: Target,
        rng: Generator,
        alone: bool,
    ) -> list[Subgoal]:
        """Draw the subgoals of one goal.

        Args:
            goal: in the world.
            rng: random numbers.
            alone: see `draw_subgoals`.
        """
        model = self.model
        solids = [model.solids[name] for name in goal.bodies]
        if goal.any and len(solids) > 1:
            solids = [self._draw_easiest(solids, rng)]

        still = Subgoal(solids, np.zeros(3), model)
        goal = hang_on_peg(still, lead_over_edge(still, goal, rng), rng)

        # Of several bodies in one grip some are lost over the rim.
        fills = goal.container is not None and len(solids) <= _MOST_LANES
        alone = alone or (self._gripper and fills)
        alone = alone and len(solids) > 1 and model.find_container(solids) is None

        if model.turned:  # what one container holds is moved at once
            lanes = [solids]
        elif alone:
            lanes = [[solids[i]] for i in rng.permutation(len(solids))]
        else:
            lanes = _draw_lanes(solids, goal, rng)

        # What goes into a hollow in several lots lies in it side by side, and mostly where it is nearer.
        spread = 0.0
        nearer = np.zeros(3)
        if goal.container is not None:
            nearer = rng.uniform() * self._find_nearer(goal.container, solids)
            if len(lanes) > 1:
                spread = _SPREAD.draw(rng)

        middle = _mean_position(solids)
        subgoals = []
        for lane in lanes:
            shift = _draw_shift(Subgoal(lane, np.zeros(3), model), goal, rng)
            shift = shift + spread * LEVEL * (_mean_position(lane) - middle) + nearer
            subgoals.append(Subgoal(lane, shift, model, goal, alone))

        return subgoals

    def _find_nearer(self, container: str, solids: Sequence[Solid]) -> Array:
        """Find how far (3,) toward the robot bodies may end from the middle of a hollow, metres, on the level.

        Args:
            container: the name of the body that has the hollow.
            solids: the bodies, of which the largest must find room.
        """
        lower, upper = _bounds(self.model.solids[container])
        widest = max(
            float(np.ptp(solid.points[:, :2], axis=0).max()) for solid in solids
        )
        room = (upper - lower)[:2].min() / 2 - widest / 2 - _WALL_M

        outward = self.model.workspace.from_axis((lower + upper) / 2)
        way = np.append(-outward, 0.0) / max(float(np.hypot(*outward)), 1e-6)
        return np.asarray(max(0.0, room) * way)

    def _draw_easiest(self, solids: list[Solid], rng: Generator) -> Solid:
        """Choose a body with nothing on top, at random from the highest ones.

        Args:
            solids: of which one is enough for the goal.
            rng: random numbers.
        """
        free = [
            solid
            for solid in solids
            if Subgoal([solid], np.zeros(3), self.model).clearance_above > _FREE_M
        ]

        free = free or solids
        tops = np.array([solid.points[:, 2].max() for solid in free])
        return free[int(rng.choice(np.flatnonzero(tops > tops.max() - _AS_HIGH_M)))]


def _add_targets(group: list[Target], targets: Sequence[Target], is_met: bool) -> None:
    """Add targets to those that must be reached together; those of a joint that has one are later positions of it.

    Args:
        group: is changed.
        targets: of the next goal.
        is_met: whether they are reached at the start, so that others must not undo it.
    """
    for target in targets:
        joints = [other.joint for other in group]
        if target.joint is not None and target.joint in joints:
            number = joints.index(target.joint)
            later = (*group[number].later, target.to)
            group[number] = replace(group[number], later=later)
        elif not is_met:
            group.append(target)


def _is_met(goal: Reach, state: State) -> bool:
    """Report whether a goal asks only what is so at the start, so that others must not undo it."""
    asked = [
        measure
        for body in goal.subjects(state)
        for measure in goal.all_measures(body, state)
    ]
    if goal.held or not asked:
        return False

    return all(float(measure.left(state)) <= 0 for measure in asked)


def _reach(subgoal: Subgoal, scene: Scene) -> Scene:
    """Return the scene once a subgoal is reached; what stands on its bodies goes along.

    Args:
        subgoal: of bodies that may have been moved by others before.
        scene: at that time.
    """
    goal = subgoal.goal
    names = [solid.body.name for solid in subgoal.solids]
    later = scene

    if goal is not None and goal.joint is not None:
        joint = scene.placed_joints[goal.joint].joint
        if not joint.springs_back:
            later = scene.with_starts({joint.name: [goal.to, *goal.later][-1]})
    elif goal is None or not goal.breaks:
        places = {name: Pose(subgoal.shift) @ scene[name].pose for name in names}
        later = scene.with_poses(places)

    move = later[names[0]].pose @ scene[names[0]].pose.inverse()
    riders = [solid.body.name for solid in subgoal.riders]
    return later.with_poses({name: move @ later[name].pose for name in riders})


def _aim_again(target: Target, before: Scene, later: Scene) -> Target:
    """Return a target whose place goes by a body, when that was moved.

    Args:
        target: in the scene before.
        before: the scene in which it was found.
        later: the same with bodies moved.
    """
    names = [target.reference, target.container]
    name = next((name for name in names if name is not None), None)
    if name is None or target.place is None:
        return target

    move = later[name].pose @ before[name].pose.inverse()
    here = before[target.bodies[0]].pose.position
    place = move.apply(goal_position(here, target)).tolist()
    x, y, z = (
        None if wanted is None else coordinate
        for wanted, coordinate in zip(target.place, place, strict=True)
    )
    return replace(target, place=(x, y, z))


def _draw_shift(subgoal: Subgoal, goal: Target, rng: Generator) -> Array:
    """Draw the shift (3,) that brings a subgoal's bodies to their goal: by their mean where it is a place.

    Args:
        subgoal: the bodies, without a shift so far.
        goal: with a place, or without.
        rng: random numbers.
    """
    if goal.place is not None:
        middle = _mean_position(subgoal.solids)
        return goal_position(middle, goal) - middle

    if goal.held:
        return _LIFT_M * UP

    return _draw_escape(subgoal, goal.away or _ASIDE_M, rng)


def _bounds(solid: Solid) -> tuple[Array, Array]:
    """Return the lowest and the highest corner (3,) of a body's bounds."""
    return solid.points.min(axis=0), solid.points.max(axis=0)


def _mean_position(solids: Sequence[Solid]) -> Array:
    """Compute the mean of the bodies' origins, (3,)."""
    positions = np.array([solid.position for solid in solids])
    return np.asarray(positions.mean(axis=0))


def _draw_lanes(solids: list[Solid], goal: Target, rng: Generator) -> list[list[Solid]]:
    """Draw groups of bodies, each moved at once: slices across the way to the goal.

    Args:
        solids: all bodies of the goal.
        goal: which gives the way.
        rng: random numbers.

    Returns:
        The bodies of each lane. Near the goal it is all at once, or one of the upper ones.
    """
    if len(solids) == 1:
        return [solids]

    middle = _mean_position(solids)
    way = goal_position(middle, goal) - middle
    length = np.hypot(*way[:2])
    if length < _NEAR_GOAL_M:
        if rng.random() < _ALL_AT_ONCE:
            return [solids]

        from_top = sorted(solids, key=lambda solid: -solid.position[2])
        upper = from_top[: max(1, len(solids) // 3)]
        return [[upper[rng.integers(len(upper))]]]

    positions = np.array([solid.position for solid in solids])
    across = positions @ np.cross(UP, way / length)
    count = rng.integers(1, min(_MOST_LANES, len(solids)) + 1)
    edges = np.linspace(across.min(), across.max() + 1e-9, count + 1)
    lanes = []

    for low, high in itertools.pairwise(edges):
        inside = (across >= low) & (across < high + 1e-12)
        if inside.any():
            lanes.append(list(itertools.compress(solids, inside)))

    return [lanes[i] for i in rng.permutation(len(lanes))]


def _draw_escape(subgoal: Subgoal, away: float, rng: Generator) -> Array:
    """Draw a shift of at least ``away``, at random from unblocked directions, most likely toward the robot.

    Args:
        subgoal: of bodies that have to get away from where they are.
        away: how far, metres.
        rng: random numbers.
    """
    way = subgoal.workspace.from_axis(subgoal.center)
    toward = np.append(-way / max(np.hypot(*way), 1e-6), 0.0)
    directions = np.array(
        [toward, (-1, 0, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0), -toward, UP]
    )
    weights = np.array(_ESCAPES)

    shifts = away * _ESCAPE.draw(rng) * directions
    weights[[subgoal.is_blocked(shift) for shift in shifts]] *= _BLOCKED
    chosen = rng.choice(len(shifts), p=weights / weights.sum())
    return np.asarray(shifts[chosen])
