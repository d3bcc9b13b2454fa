"""What the designer sees: where bodies are and how large, what has to go where, and what stands in the way."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from core.geometry import Array, Box, Pose
from core.interfaces import Brief
from core.scene import Body, Goal
from plugins.vlms.offline.boxes import Boxes, overlaps

UP = np.array([0.0, 0.0, 1.0])
_SUPPORT_M = 0.006  # bodies are lifted by this when asking what blocks them: what they rest on does not


class NothingToMove(ValueError):
    """A brief leaves the designer nothing to do."""


@dataclass(frozen=True, eq=False)
class Thing:
    """A body that can be felt: corners (V, 3) of its parts, a box around each part, and the point a goal speaks of."""

    points: Array
    boxes: Boxes
    position: Array

    @classmethod
    def of(cls, body: Body) -> Thing:
        points, placed = [], []
        for part in body.collisions:
            pose = body.pose @ part.pose
            vertices = np.asarray(part.shape.to_trimesh().vertices)
            middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
            size = np.array(part.shape.size) if isinstance(part.shape, Box) else np.ptp(vertices, axis=0)
            points.append(pose.apply(vertices))
            placed.append((pose @ Pose(middle), np.maximum(size, 1e-4)))
        return cls(np.concatenate(points), Boxes.of(placed), body.pose.position)


@dataclass(frozen=True, eq=False)
class Errand:
    """Some bodies, taken together, and the ``shift`` (3,) that brings them to where they are wanted."""

    things: tuple[Thing, ...]
    shift: Array
    others: Boxes  # all else that can be felt
    clear_z: float  # height over everything near the way

    @cached_property
    def points(self) -> Array:
        return np.concatenate([thing.points for thing in self.things])

    @cached_property
    def boxes(self) -> Boxes:
        return Boxes.join(thing.boxes for thing in self.things)

    @property
    def lower(self) -> Array:
        return np.asarray(self.points.min(axis=0))

    @property
    def upper(self) -> Array:
        return np.asarray(self.points.max(axis=0))

    @property
    def center(self) -> Array:
        return (self.lower + self.upper) / 2

    @property
    def length(self) -> float:
        """Of the way over ground."""
        return float(np.hypot(*self.shift[:2]))

    @property
    def heading(self) -> float:
        """Of the way over ground; toward the robot if there is none."""
        x, y = self.shift[:2] if self.length > 0.01 else -self.center[:2]
        return float(np.arctan2(y, x))

    def span(self, heading: float) -> tuple[float, float]:
        """The least and greatest coordinate of the bodies along a heading."""
        along = self.points[:, :2] @ np.array([np.cos(heading), np.sin(heading)])
        return float(along.min()), float(along.max())

    def rooms(self, heading: float) -> tuple[float, float]:
        """How far a tool behind the bodies may stand out on their right and on their left before it meets others."""
        rear, _ = self.span(heading)
        right, left = self.span(heading + np.pi / 2)
        ahead = np.array([np.cos(heading), np.sin(heading)])
        side = np.array([-ahead[1], ahead[0]])
        rooms = [1.0, 1.0]
        for lower, upper in zip(self.others.lower, self.others.upper, strict=True):
            if upper[2] < self.lower[2] + _SUPPORT_M or lower[2] > self.upper[2]:
                continue
            corners = np.array([[x, y] for x in (lower[0], upper[0]) for y in (lower[1], upper[1])])
            along, across = corners @ ahead, corners @ side
            if along.max() < rear - 0.05 or along.min() > rear + self.length:
                continue
            on_left = bool(across.mean() > (left + right) / 2)
            rooms[on_left] = min(rooms[on_left], max(0.0, across.min() - left if on_left else right - across.max()))
        return rooms[0], rooms[1]

    @cached_property
    def headroom(self) -> float:
        """How far it is from the bodies' top to what is over them; 1 m or more is as good as none."""
        lower, upper = self.others.lower, self.others.upper
        over = (lower[:, :2] < self.upper[:2]).all(axis=1) & (upper[:, :2] > self.lower[:2]).all(axis=1)
        over &= lower[:, 2] > self.upper[2] - 0.002
        return float((lower[over, 2] - self.upper[2]).min(initial=1.0))

    @property
    def covered(self) -> bool:
        """Whether there is a roof over the bodies."""
        return self.headroom < 0.5

    def blocked(self, shift: Array) -> bool:
        """Whether something stands where the bodies would pass."""
        steps = max(2, int(np.ceil(np.linalg.norm(shift) / 0.03)))
        way = np.linspace(0.0, 1.0, steps)[1:, None] * shift
        lifted = way + _SUPPORT_M * UP
        shrunk = Boxes(self.boxes.centers, self.boxes.axes, self.boxes.halves - 0.001)
        turns = np.broadcast_to(np.eye(3), (len(lifted), 3, 3))
        return overlaps(shrunk.carried(lifted, turns), self.others) > 0


@dataclass(frozen=True, eq=False)
class Sight:
    """The scene with a designer's eyes: bodies that can be felt, their names, the goals, the end-effector's home."""

    things: tuple[Thing, ...]
    names: tuple[str, ...]
    goals: tuple[Goal, ...]
    home: Pose

    @classmethod
    def of(cls, brief: Brief) -> Sight:
        """What there is for a brief. A task without goals wants, for all that can be seen, something moved.

        Raises:
            NothingToMove: there are no goals and all bodies are fixed.
        """
        scene, goals = brief.task.scene(brief.scene_seed), tuple(brief.task.goals)
        if not goals:
            if not scene.free:
                raise NothingToMove("the task has no goals and no body that can move; give it a Goal")
            goals = tuple(Goal((body.name,), away=0.2) for body in scene.free[:1])
        bodies = [body for body in scene.bodies if body.collisions]
        names = tuple(body.name for body in bodies)
        return cls(tuple(Thing.of(body) for body in bodies), names, goals, brief.task.home)

    @cached_property
    def boxes(self) -> Boxes:
        return Boxes.join(thing.boxes for thing in self.things)

    def errands(self, rng: np.random.Generator) -> list[Errand]:
        """One way to see what is to be done: for every goal its bodies, in lanes where they are many."""
        errands: list[Errand] = []
        for goal in self.goals:
            things = [self.things[self.names.index(name)] for name in goal.bodies]
            for lane in _lanes(things, goal, rng):
                errand = self._errand(lane, np.zeros(3))
                shift = self._shift(errand, goal, rng)
                errands.append(self._errand(lane, shift))
        return errands

    def _errand(self, things: list[Thing], shift: Array) -> Errand:
        others = Boxes.join(thing.boxes for thing in self.things if thing not in things)
        points = np.concatenate([thing.points for thing in things])
        reach = np.array([0.15, 0.15])
        low = np.minimum(points, points + shift).min(axis=0)[:2] - reach
        high = np.maximum(points, points + shift).max(axis=0)[:2] + reach
        boxes = self.boxes
        near = ((boxes.lower[:, :2] < high) & (boxes.upper[:, :2] > low)).all(axis=1)
        return Errand(tuple(things), shift, others, float(boxes.upper[near, 2].max()))

    def _shift(self, errand: Errand, goal: Goal, rng: np.random.Generator) -> Array:
        if goal.place is None:
            return _escape(errand, float(goal.away or 0.1), rng)
        middle: Array = np.mean([thing.position for thing in errand.things], axis=0)
        place = [here if wanted is None else wanted for here, wanted in zip(middle, goal.place, strict=True)]
        return np.array(place) - middle


def _lanes(things: list[Thing], goal: Goal, rng: np.random.Generator) -> list[list[Thing]]:
    """Groups of bodies that are moved at a stroke: side by side across the way to the place."""
    if len(things) == 1:
        return [things]
    positions = np.array([thing.position for thing in things])
    middle = positions.mean(axis=0)
    wanted = np.array([m if p is None else p for m, p in zip(middle, goal.place or middle, strict=True)])
    way = (wanted - middle)[:2]
    if np.hypot(*way) < 0.05:
        upper = sorted(things, key=lambda thing: -float(thing.position[2]))[: max(1, len(things) // 3)]
        return [things if rng.random() < 0.6 else [upper[int(rng.integers(len(upper)))]]]
    side = np.array([-way[1], way[0]]) / np.hypot(*way)
    across = positions[:, :2] @ side
    count = int(rng.integers(1, min(4, len(things)) + 1))
    edges = np.linspace(across.min(), across.max() + 1e-9, count + 1)
    lanes = [
        [t for t, a in zip(things, across, strict=True) if low <= a < high + 1e-12]
        for low, high in itertools.pairwise(edges)
    ]
    lanes = [lane for lane in lanes if lane]
    return [lanes[i] for i in rng.permutation(len(lanes))]


def _escape(errand: Errand, away: float, rng: np.random.Generator) -> Array:
    """A shift that leaves, of those that nothing blocks; toward the robot rather than elsewhere."""
    toward = -errand.center[:2] / max(np.hypot(*errand.center[:2]), 1e-6)
    flat = [(toward[0], toward[1]), (-1, 0), (1, 0), (0, 1), (0, -1), (-toward[0], -toward[1])]
    options = [np.array([x, y, 0.0]) for x, y in flat] + [UP]
    prior = np.array([2.0, 3.0, 1.0, 1.0, 1.0, 0.5, 1.5])
    length = away * rng.uniform(1.02, 1.4)
    free = np.array([not errand.blocked(length * option) for option in options])
    weights = prior * np.where(free, 1.0, 0.02)
    chosen: Array = length * options[int(rng.choice(len(options), p=weights / weights.sum()))]
    return chosen
