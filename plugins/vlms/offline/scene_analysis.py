"""The scene for the designer: bodies and their sizes, the shifts that the goals need, and obstacles."""

from __future__ import annotations

import itertools
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

from core.geometry import Array, Box, Cylinder, Mesh, Pose, Shape
from core.interfaces import Brief
from core.scene import Body, Goal, Soft
from plugins.vlms.offline.boxes import Boxes, axes_of, overlaps
from plugins.vlms.offline.workspace import workspace_of

Flags = npt.NDArray[np.bool_]

UP = np.array([0.0, 0.0, 1.0])
LIFT_M = 0.15  # what is to be held is lifted by this
_DEEP_M = 0.05
_NEAR_M = 0.15
_SUPPORT_M = 0.006  # bodies are lifted by this for collision checks, since their support does not block them


class NothingToMove(ValueError):
    """A brief leaves the designer nothing to do."""


@dataclass(frozen=True, eq=False)
class Thing:
    """A body with collision shapes: their corners (V, 3), and boxes around them; of a soft body those at the start."""

    points: Array
    boxes: Boxes
    body: Body

    @property
    def position(self) -> Array:
        return self.body.pose.position

    @classmethod
    def of(cls, body: Body) -> Thing:
        points, placed = [], []
        for part in body.collisions or body.visuals:
            pose = body.pose @ part.pose
            points.append(pose.apply(np.asarray(part.shape.to_trimesh().vertices)))
            placed += [(pose @ around, np.maximum(size, 1e-4)) for around, size in _boxes_around(part.shape)]
        return cls(np.concatenate(points), Boxes.of(placed), body)


def _boxes_around(shape: Shape) -> list[tuple[Pose, Array]]:
    """Poses and full sides (3,) of upright boxes around a shape, in its frame.

    A cylinder gets four, which form an octagon; a mesh gets the smallest one.
    """
    if isinstance(shape, Box):
        return [(Pose(), np.array(shape.size))]
    if isinstance(shape, Cylinder):
        size = np.array([2 * shape.radius, 2 * shape.radius * np.tan(np.pi / 8), shape.length])
        return [(Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, k * np.pi / 4)), size) for k in range(4)]
    vertices = np.asarray(shape.to_trimesh().vertices)
    yaws = [0.0]
    if isinstance(shape, Mesh):
        flat = vertices[:, :2]
        edges = np.diff(flat[ConvexHull(flat).simplices], axis=1)[:, 0]
        yaws += list(np.arctan2(edges[:, 1], edges[:, 0]))
    turns = [Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, yaw)) for yaw in yaws]
    turned = [turn.inverse().apply(vertices) for turn in turns]
    best = min(range(len(yaws)), key=lambda i: float(np.prod(np.ptp(turned[i], axis=0))))
    lower, upper = turned[best].min(axis=0), turned[best].max(axis=0)
    return [(turns[best] @ Pose((lower + upper) / 2), upper - lower)]


class Extent(NamedTuple):
    """Unit vectors ahead and to the left of a heading, and where an errand's bodies begin and end along both."""

    heading: float
    ahead: Array
    side: Array
    rear: float
    front: float
    right: float
    left: float

    @property
    def along(self) -> float:
        return self.front - self.rear

    @property
    def across(self) -> float:
        return self.left - self.right

    @property
    def middle(self) -> Array:
        """The middle of the bodies across the heading."""
        return (self.left + self.right) / 2 * self.side


class Errand:
    """Bodies that are moved together, and the ``shift`` (3,) that brings them to their goal.

    ``reference`` is the body or mark by which the goal's place is given; ``alone``: it is one of several errands, with
    a body each. ``points`` (V, 3) and ``boxes`` are all bodies', ``length`` is that of the shift on the ground.
    """

    def __init__(
        self,
        things: Sequence[Thing],
        shift: Array,
        analysis: SceneAnalysis,
        goal: Goal | None = None,
        reference: str | None = None,
        alone: bool = False,
    ) -> None:
        self.things, self.shift, self.analysis = tuple(things), shift, analysis
        self.goal, self.reference, self.alone, self.space = goal, reference, alone, analysis.space
        self.points = np.concatenate([thing.points for thing in things])
        self.boxes = Boxes.join(thing.boxes for thing in things)
        self.lower, self.upper = np.asarray(self.points.min(axis=0)), np.asarray(self.points.max(axis=0))
        self.center, self.tall = (self.lower + self.upper) / 2, float(self.upper[2] - self.lower[2])
        self.length = float(np.hypot(*shift[:2]))

    @cached_property
    def others(self) -> Boxes:
        """The boxes of all other bodies."""
        return Boxes.join(thing.boxes for thing in self.analysis.things.values() if thing not in self.things)

    @cached_property
    def clear_z(self) -> float:
        """The height above everything near the bodies' way."""
        (lower, upper), ends = self.analysis.boxes.bounds, (self.points, self.points + self.shift)
        low = np.minimum(*ends).min(axis=0)[:2] - _NEAR_M
        high = np.maximum(*ends).max(axis=0)[:2] + _NEAR_M
        return float(upper[((lower[:, :2] < high) & (upper[:, :2] > low)).all(axis=1), 2].max())

    @cached_property
    def holder(self) -> Thing | None:
        """A loose body that encloses the positions of all bodies."""
        return next((thing for thing in self.analysis.around(self.things) if not thing.body.fixed), None)

    @property
    def heading(self) -> float:
        """The level direction of the shift; if there is none, toward the robot: in a turned scene, along an axis."""
        x, y = self.shift[:2] if self.length > 0.01 else -self.space.from_axis(self.center)
        angle = float(np.arctan2(y, x))
        return round(angle / (np.pi / 2)) * np.pi / 2 if self.analysis.turned and self.length <= 0.01 else angle

    def extent(self, heading: float) -> Extent:
        ahead, side = axes_of(heading)
        along, across = (self.points[:, :2] @ axes_of(turn)[0][:2] for turn in (heading, heading + np.pi / 2))
        return Extent(
            heading, ahead, side, *(float(end) for axis in (along, across) for end in (axis.min(), axis.max()))
        )

    def rooms(self, heading: float) -> tuple[float, float]:
        """The clearance, on the right and left of the bodies, of a tool that moves behind them."""
        way, rooms = self.extent(heading), [1.0, 1.0]
        for lower, upper in zip(*self.others.bounds, strict=True):
            corners = np.array([[x, y] for x in (lower[0], upper[0]) for y in (lower[1], upper[1])])
            along, across = corners @ way.ahead[:2], corners @ way.side[:2]
            beside = along.max() >= way.rear - 0.05 and along.min() <= way.rear + self.length
            if beside and upper[2] >= self.lower[2] + _SUPPORT_M and lower[2] <= self.upper[2]:
                on_left = bool(across.mean() > (way.left + way.right) / 2)
                room = across.min() - way.left if on_left else way.right - across.max()
                rooms[on_left] = min(rooms[on_left], max(0.0, room))
        return rooms[0], rooms[1]

    def overhang(self, heading: float) -> tuple[Flags, Array]:
        """Which boxes stand out across a heading, beyond those at the bodies' foot; and the half widths (N,) of all."""
        right, left = self.boxes.extents(axes_of(heading)[1], self.center)
        halves, low = np.maximum(left, -right), self.boxes.bounds[0][:, 2] < self.lower[2] + 0.004
        return ~low & (halves > halves[low].max() + 0.006), halves

    @cached_property
    def headroom(self) -> float:
        """The distance from the bodies' top to the lowest obstacle above them, at most 1 m."""
        lower, upper = self.others.bounds
        over = (lower[:, :2] < self.upper[:2]).all(axis=1) & (upper[:, :2] > self.lower[:2]).all(axis=1)
        over &= lower[:, 2] > self.upper[2] - 0.002
        return float((lower[over, 2] - self.upper[2]).min(initial=1.0))

    @property
    def covered(self) -> bool:
        """Report whether an obstacle is close above the bodies."""
        return self.headroom < 0.5

    @property
    def deep(self) -> bool:
        """Report whether near obstacles are much higher than the bodies, which are then reached from above."""
        return self.clear_z - float(self.upper[2]) > _DEEP_M

    def blocked(self, shift: Array, start: Array | None = None, margin: float = 0.0, step: float = 0.03) -> bool:
        """Report whether an obstacle is within ``margin`` of the bodies' way, which begins at ``start`` (3,)."""
        steps = max(2, int(np.ceil(np.linalg.norm(shift) / step)))
        way = np.linspace(0.0, 1.0, steps)[1:, None] * shift + (np.zeros(3) if start is None else start)
        lifted = way + _SUPPORT_M * UP
        shrunk = Boxes(self.boxes.centers, self.boxes.axes, self.boxes.halves - 0.001)
        turns = np.broadcast_to(np.eye(3), (len(lifted), 3, 3))
        return overlaps(shrunk.carried(lifted, turns), self.others, margin) > 0

    def detour(self) -> Array:
        """The shortest step (3,) aside, in the air, after which nothing is above the bodies; zero if none helps."""
        angles = np.arange(8) * np.pi / 4
        steps = [r * np.array([np.cos(a), np.sin(a), 0.0]) for r in (0.01, 0.02, 0.03, 0.04, 0.06) for a in angles]
        rise = max(float(self.shift[2]), 0.05)
        for aside in (np.zeros(3), *steps):
            if not self.blocked(rise * UP, aside + 0.02 * UP, 0.006):
                return aside
        return np.zeros(3)


class SceneAnalysis:
    """Bodies with collision shapes by name, the goals, the end-effector's home, and the arm's workspace.

    ``groups`` are the goals that must be reached together, in the world, each with what its place was given by.
    ``cache`` keeps what was found out about bodies.
    """

    def __init__(self, brief: Brief, turn: Pose | None = None) -> None:
        """Read a brief. For a task without goals, the goal is to move its first free body.

        With a ``turn`` everything but the robot is moved by it, so that the world's axes are those of what the bodies
        are taken by.

        Raises:
            NothingToMove: there are no goals and all bodies are fixed.
        """
        task, scene, self.home = brief.task, brief.task.scene(brief.scene_seed), brief.task.home
        if turn is not None:
            self.home = turn @ self.home
            scene = replace(scene, bodies=tuple(replace(body, pose=turn @ body.pose) for body in scene.bodies))
        groups = dict[int, list[tuple[Goal, str | None]]]()
        for number, goal in enumerate(task.goals):
            parts = [(part, goal.at) for part in goal.within(scene).spread() if part.bodies]
            groups.setdefault(0 if task.every else number, []).extend(parts)
        self.groups = [group for group in groups.values() if group]
        if not self.groups:
            if not scene.free:
                raise NothingToMove("the task has no goals and no body that can move; give it a Goal")
            self.groups = [[(Goal((scene.free[0].name,), away=0.2), None)]]
        self.things = {body.name: Thing.of(body) for body in scene.bodies if body.collisions or isinstance(body, Soft)}
        self.scene, self.space, self.turned = scene, workspace_of(task.robot), turn is not None
        self.cache: dict[Hashable, object] = {}

    @property
    def goals(self) -> list[Goal]:
        return [goal for group in self.groups for goal, _ in group]

    @cached_property
    def boxes(self) -> Boxes:
        return Boxes.join(thing.boxes for thing in self.things.values())

    def errands(self, rng: np.random.Generator, alone: bool = False) -> list[Errand]:
        """Draw errands for a group of goals at random, in order.

        They are for all bodies, in lanes if these are many; for one of them if it is enough. With ``alone`` each
        scattered body gets its own.
        """
        group = self.groups[int(rng.integers(len(self.groups)))] if len(self.groups) > 1 else self.groups[0]
        return [errand for goal, reference in group for errand in self._errands(goal, reference, rng, alone)]

    def _errands(self, goal: Goal, reference: str | None, rng: np.random.Generator, alone: bool) -> list[Errand]:
        things = [self.things[name] for name in goal.bodies]
        if goal.any and len(things) > 1:
            things = [self._easiest(things, rng)]
        alone = alone and len(things) > 1 and self.container(things) is None
        if self.turned:  # what one container holds is moved at once
            lanes = [things]
        else:
            lanes = [[things[i]] for i in rng.permutation(len(things))] if alone else _lanes(things, goal, rng)
        shifts = [_shift(Errand(lane, np.zeros(3), self), goal, rng) for lane in lanes]
        return [Errand(lane, shift, self, goal, reference, alone) for lane, shift in zip(lanes, shifts, strict=True)]

    def _easiest(self, things: list[Thing], rng: np.random.Generator) -> Thing:
        """A thing with nothing on top, at random from the highest ones."""
        free = [thing for thing in things if Errand((thing,), np.zeros(3), self).headroom > 0.03] or things
        tops = np.array([thing.points[:, 2].max() for thing in free])
        return free[int(rng.choice(np.flatnonzero(tops > tops.max() - 0.005)))]

    def around(self, things: Sequence[Thing]) -> Iterator[Thing]:
        """Yield the bodies that enclose the positions of all things."""
        inside = np.array([thing.position for thing in things])
        for other in self.things.values():
            lower, upper = other.points.min(axis=0), other.points.max(axis=0)
            if (inside > lower).all() and (inside < upper).all() and all(other is not thing for thing in things):
                yield other

    def container(self, things: Sequence[Thing]) -> str | None:
        """The name of the smallest body, fixed or loose, that encloses the positions of all things."""
        around = sorted(self.around(things), key=lambda thing: float(np.prod(np.ptp(thing.points, axis=0))))
        return around[0].body.name if around else None


def _shift(errand: Errand, goal: Goal, rng: np.random.Generator) -> Array:
    if goal.place is None:
        return LIFT_M * UP if goal.held else _escape(errand, float(goal.away or 0.1), rng)
    middle: Array = np.mean([thing.position for thing in errand.things], axis=0)
    return wanted(middle, goal) - middle


def wanted(here: Array, goal: Goal) -> Array:
    """The goal's place (3,); along an axis where it has none, it is here."""
    return np.array([h if w is None else w for h, w in zip(here, goal.place or here, strict=True)])


def _lanes(things: list[Thing], goal: Goal, rng: np.random.Generator) -> list[list[Thing]]:
    """Groups of bodies, each moved with one stroke: slices across the way to the goal."""
    if len(things) == 1:
        return [things]
    positions = np.array([thing.position for thing in things])
    middle = positions.mean(axis=0)
    way = (wanted(middle, goal) - middle)[:2]
    if np.hypot(*way) < 0.05:
        upper = sorted(things, key=lambda thing: -float(thing.position[2]))[: max(1, len(things) // 3)]
        return [things if rng.random() < 0.6 else [upper[int(rng.integers(len(upper)))]]]
    side = np.array([-way[1], way[0]]) / np.hypot(*way)
    across = positions[:, :2] @ side
    count = int(rng.integers(1, min(4, len(things)) + 1))
    edges = np.linspace(across.min(), across.max() + 1e-9, count + 1)
    slices = [(across >= low) & (across < high + 1e-12) for low, high in itertools.pairwise(edges)]
    lanes = [list(itertools.compress(things, inside)) for inside in slices if inside.any()]
    return [lanes[i] for i in rng.permutation(len(lanes))]


def _escape(errand: Errand, away: float, rng: np.random.Generator) -> Array:
    """A shift of at least ``away``, at random from unblocked directions, most likely toward the robot."""
    way = errand.space.from_axis(errand.center)
    toward = -way / max(np.hypot(*way), 1e-6)
    flat = [(toward[0], toward[1]), (-1, 0), (1, 0), (0, 1), (0, -1), (-toward[0], -toward[1])]
    options = [np.array([x, y, 0.0]) for x, y in flat] + [UP]
    prior = np.array([2.0, 3.0, 1.0, 1.0, 1.0, 0.5, 1.5])
    length = away * rng.uniform(1.02, 1.4)
    free = np.array([not errand.blocked(length * option) for option in options])
    weights = prior * np.where(free, 1.0, 0.02)
    return np.asarray(length * options[int(rng.choice(len(options), p=weights / weights.sum()))])
