"""The scene for the designer: its bodies and their sizes, the subgoals that follow from the goals, and obstacles."""

from __future__ import annotations

import itertools
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from numpy.random import Generator
from scipy.spatial import ConvexHull

from core.geometry import Array, Cylinder, Mesh, Pose, Shape
from core.goals import Target, reaches
from core.interfaces import Brief
from core.scene import Body, Soft
from plugins.vlms.offline.boxes import Boxes, axes_of, overlaps
from plugins.vlms.offline.workspace import workspace_of

UP = np.array([0.0, 0.0, 1.0])
LEVEL = np.array([1.0, 1.0, 0.0])  # times a vector: its level part
LIFT_M = 0.15  # what is to be held is lifted by this
_DEEP_M = 0.05
_NEAR_M = 0.15
_SUPPORT_M = 0.006  # bodies are lifted by this for collision checks, since their support does not block them


class NothingToMove(ValueError):
    """A brief leaves the designer nothing to do."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A body with collision shapes: their corners (V, 3), and boxes around them; of a soft body those at the start."""

    points: Array
    boxes: Boxes
    body: Body

    @property
    def position(self) -> Array:
        return self.body.pose.position

    @classmethod
    def of(cls, body: Body) -> Solid:
        points = []
        placed = []
        for part in body.collisions or body.visuals:
            pose = body.pose @ part.pose
            points.append(pose.apply(part.shape.to_trimesh().vertices))
            placed += [
                (pose @ around, np.maximum(size, 1e-4))
                for around, size in _boxes_around(part.shape)
            ]
        return cls(np.concatenate(points), Boxes.of(placed), body)


def _boxes_around(shape: Shape) -> list[tuple[Pose, Array]]:
    """Poses and full sides (3,) of upright boxes around a shape, in its frame.

    A cylinder gets four, which form an octagon; a mesh gets the smallest one.
    """
    if isinstance(shape, Cylinder):
        size = np.array(
            [2 * shape.radius, 2 * shape.radius * np.tan(np.pi / 8), shape.length]
        )
        return [(_turned(k * np.pi / 4), size) for k in range(4)]
    vertices = np.asarray(shape.to_trimesh().vertices)
    turns = [Pose()]
    if isinstance(shape, Mesh):
        flat = vertices[:, :2]
        edges = np.diff(flat[ConvexHull(flat).simplices], axis=1)[:, 0]
        turns += [_turned(yaw) for yaw in np.arctan2(edges[:, 1], edges[:, 0])]
    around = []
    for turn in turns:
        inside = turn.inverse().apply(vertices)
        lower = inside.min(axis=0)
        upper = inside.max(axis=0)
        around.append((turn @ Pose((lower + upper) / 2), upper - lower))
    return [min(around, key=lambda placed: float(np.prod(placed[1])))]


def _turned(yaw: float) -> Pose:
    return Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, yaw))


@dataclass(frozen=True, eq=False)
class Extent:
    """Unit vectors ahead and to the left of a heading, and where a subgoal's bodies begin and end along both."""

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


@dataclass(eq=False)
class Subgoal:
    """Bodies that are moved together, and the ``shift`` (3,) that brings them to their goal.

    ``reference`` is the body or mark by which the goal's place is given; ``alone``: it is one of several subgoals, with
    a body each. ``points`` (V, 3) and ``boxes`` are all bodies', ``length`` is that of the shift on the ground.
    """

    solids: Sequence[Solid]
    shift: Array
    analysis: SceneAnalysis
    goal: Target | None = None
    reference: str | None = None
    alone: bool = False

    def __post_init__(self) -> None:
        self.points = np.concatenate([solid.points for solid in self.solids])
        self.boxes = Boxes.join(solid.boxes for solid in self.solids)
        self.lower: Array = self.points.min(axis=0)
        self.upper: Array = self.points.max(axis=0)
        self.center: Array = (self.lower + self.upper) / 2
        self.tall = float(self.upper[2] - self.lower[2])
        self.length = float(np.hypot(*self.shift[:2]))
        self.space = self.analysis.space

    @cached_property
    def others(self) -> Boxes:
        """The boxes of all other bodies."""
        return Boxes.join(
            solid.boxes
            for solid in self.analysis.solids.values()
            if solid not in self.solids
        )

    @cached_property
    def clear_z(self) -> float:
        """The height above everything near the bodies' way."""
        lower, upper = self.analysis.boxes.bounds
        low = np.minimum(self.lower, self.lower + self.shift) - _NEAR_M
        high = np.maximum(self.upper, self.upper + self.shift) + _NEAR_M
        return float(
            upper[((lower < high) & (upper > low))[:, :2].all(axis=1), 2].max()
        )

    @cached_property
    def holder(self) -> Solid | None:
        """A loose body that encloses the positions of all bodies."""
        loose = (
            solid for solid in self.analysis.around(self.solids) if not solid.body.fixed
        )
        return next(loose, None)

    @property
    def heading(self) -> float:
        """The level direction of the shift; if there is none, toward the robot: in a turned scene, along an axis."""
        x, y = (
            self.shift[:2] if self.length > 0.01 else -self.space.from_axis(self.center)
        )
        angle = float(np.arctan2(y, x))
        if self.length <= 0.01 and self.analysis.turned:
            return round(angle / (np.pi / 2)) * np.pi / 2
        return angle

    def extent(self, heading: float) -> Extent:
        ahead, side = axes_of(heading)
        along = self.points[:, :2] @ ahead[:2]
        across = self.points[:, :2] @ axes_of(heading + np.pi / 2)[0][:2]
        ends = (
            float(end) for end in (along.min(), along.max(), across.min(), across.max())
        )
        return Extent(heading, ahead, side, *ends)

    def rooms(self, heading: float) -> tuple[float, float]:
        """The clearance, on the right and left of the bodies, of a tool that moves behind them."""
        way = self.extent(heading)
        lower, upper = self.others.bounds
        x = np.stack([lower[:, 0], lower[:, 0], upper[:, 0], upper[:, 0]])
        y = np.stack([lower[:, 1], upper[:, 1], lower[:, 1], upper[:, 1]])
        along = x * way.ahead[0] + y * way.ahead[1]  # of their corners
        across = x * way.side[0] + y * way.side[1]
        beside = (along.max(axis=0) >= way.rear - 0.05) & (
            along.min(axis=0) <= way.rear + self.length
        )
        beside &= (upper[:, 2] >= self.lower[2] + _SUPPORT_M) & (
            lower[:, 2] <= self.upper[2]
        )
        on_left = across.mean(axis=0) > (way.left + way.right) / 2
        free_right = (way.right - across.max(axis=0))[beside & ~on_left].min(
            initial=1.0
        )
        free_left = (across.min(axis=0) - way.left)[beside & on_left].min(initial=1.0)
        return max(0.0, float(free_right)), max(0.0, float(free_left))

    def overhang(self, heading: float) -> tuple[npt.NDArray[np.bool_], Array]:
        """Which boxes stand out across a heading, beyond those at the bodies' foot; and the half widths (N,) of all."""
        right, left = self.boxes.extents(axes_of(heading)[1], self.center)
        halves = np.maximum(left, -right)
        low = self.boxes.bounds[0][:, 2] < self.lower[2] + 0.004
        return ~low & (halves > halves[low].max() + 0.006), halves

    @cached_property
    def headroom(self) -> float:
        """The distance from the bodies' top to the lowest obstacle above them, at most 1 m."""
        lower, upper = self.others.bounds
        over = (lower[:, :2] < self.upper[:2]).all(axis=1) & (
            upper[:, :2] > self.lower[:2]
        ).all(axis=1)
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

    def blocked(
        self,
        shift: Array,
        start: Array | float = 0.0,
        margin: float = 0.0,
        step: float = 0.03,
    ) -> bool:
        """Report whether an obstacle is within ``margin`` of the bodies' way, which begins at ``start`` (3,)."""
        steps = max(2, int(np.ceil(np.linalg.norm(shift) / step)))
        way = np.linspace(0.0, 1.0, steps)[1:, None] * shift + start + _SUPPORT_M * UP
        shrunk = Boxes(self.boxes.centers, self.boxes.axes, self.boxes.halves - 0.001)
        turns = np.broadcast_to(np.eye(3), (len(way), 3, 3))
        return overlaps(shrunk.carried(way, turns), self.others, margin) > 0

    def detour(self) -> Array:
        """The shortest step (3,) aside, in the air, after which nothing is above the bodies; zero if none helps."""
        rise = max(self.shift[2], 0.05) * UP
        steps = [np.zeros(3)]
        for radius in (0.01, 0.02, 0.03, 0.04, 0.06):
            steps += [radius * axes_of(angle)[0] for angle in np.arange(8) * np.pi / 4]
        free = (
            aside for aside in steps if not self.blocked(rise, aside + 0.02 * UP, 0.006)
        )
        return next(free, np.zeros(3))


class SceneAnalysis:
    """Bodies with collision shapes by name, the goals, the end-effector's home, and the arm's workspace.

    ``groups`` are the goals that must be reached together, in the world.
    ``cache`` keeps what was found out about bodies.
    """

    def __init__(self, brief: Brief, turn: Pose | None = None) -> None:
        """Read a brief. For a task without goals, the goal is to move its first free body.

        With a ``turn`` everything but the robot is moved by it, so that the world's axes are those of what the bodies
        are taken by.

        Raises:
            NothingToMove: there are no goals and all bodies are fixed.
        """
        task = brief.task
        scene = task.scene(brief.scene_seed)
        self.home = task.home
        if turn is not None:
            self.home = turn @ self.home
            scene = replace(
                scene,
                bodies=tuple(
                    replace(body, pose=turn @ body.pose) for body in scene.bodies
                ),
            )
        groups = dict[int, list[Target]]()
        for number, goal in enumerate(reaches(task.goals)):
            group = groups.setdefault(0 if task.every else number, [])
            group += goal.targets(scene)
        self.groups = [group for group in groups.values() if group]
        if not self.groups:
            if not scene.free:
                raise NothingToMove(
                    "the task has no goals and no body that can move; give it a Goal"
                )
            self.groups = [[Target((scene.free[0].name,), away=0.2)]]
        self.solids = {
            body.name: Solid.of(body)
            for body in scene.bodies
            if body.collisions or isinstance(body, Soft)
        }
        self.boxes = Boxes.join(solid.boxes for solid in self.solids.values())
        self.scene = scene
        self.space = workspace_of(task.robot)
        self.turned = turn is not None
        self.cache: dict[Hashable, object] = {}

    @property
    def goals(self) -> list[Target]:
        return [goal for group in self.groups for goal in group]

    def subgoals(self, rng: Generator, alone: bool = False) -> list[Subgoal]:
        """Draw subgoals for a group of goals at random, in order.

        They are for all bodies, in lanes if these are many; for one of them if it is enough. With ``alone`` each
        scattered body gets its own.
        """
        group = (
            self.groups[int(rng.integers(len(self.groups)))]
            if len(self.groups) > 1
            else self.groups[0]
        )
        found = []
        for goal in group:
            found += self._subgoals(goal, rng, alone)
        return found

    def _subgoals(self, goal: Target, rng: Generator, alone: bool) -> list[Subgoal]:
        solids = [self.solids[name] for name in goal.bodies]
        if goal.any and len(solids) > 1:
            solids = [self._choose_easiest(solids, rng)]
        alone = alone and len(solids) > 1 and self.container(solids) is None
        if self.turned:  # what one container holds is moved at once
            lanes = [solids]
        elif alone:
            lanes = [[solids[i]] for i in rng.permutation(len(solids))]
        else:
            lanes = _draw_lanes(solids, goal, rng)
        shifts = [
            _draw_shift(Subgoal(lane, np.zeros(3), self), goal, rng) for lane in lanes
        ]
        return [
            Subgoal(lane, shift, self, goal, goal.reference, alone)
            for lane, shift in zip(lanes, shifts, strict=True)
        ]

    def _choose_easiest(self, solids: list[Solid], rng: Generator) -> Solid:
        """A body with nothing on top, at random from the highest ones."""
        free = [
            solid
            for solid in solids
            if Subgoal([solid], np.zeros(3), self).headroom > 0.03
        ] or solids
        tops = np.array([solid.points[:, 2].max() for solid in free])
        return free[int(rng.choice(np.flatnonzero(tops > tops.max() - 0.005)))]

    def around(self, solids: Sequence[Solid]) -> list[Solid]:
        """The bodies that enclose the positions of all the others."""
        inside = np.array([solid.position for solid in solids])
        found = []
        for other in self.solids.values():
            holds = (inside > other.points.min(axis=0)) & (
                inside < other.points.max(axis=0)
            )
            if holds.all() and other not in solids:
                found.append(other)
        return found

    def container(self, solids: Sequence[Solid]) -> str | None:
        """The name of the smallest body, fixed or loose, that encloses the positions of all bodies."""
        around = self.around(solids)
        if not around:
            return None
        return min(
            around, key=lambda solid: float(np.prod(np.ptp(solid.points, axis=0)))
        ).body.name


def _draw_shift(subgoal: Subgoal, goal: Target, rng: Generator) -> Array:
    if goal.place is not None:
        middle: Array = np.mean([solid.position for solid in subgoal.solids], axis=0)
        return wanted(middle, goal) - middle
    return LIFT_M * UP if goal.held else _draw_escape(subgoal, goal.away or 0.1, rng)


def wanted(here: Array, goal: Target) -> Array:
    """The goal's place (3,); along an axis where it has none, it is here."""
    return np.array(
        [h if w is None else w for h, w in zip(here, goal.place or here, strict=True)]
    )


def turn_between(goal: Target, body: Body) -> tuple[Array, float]:
    """The turn that brings a body's axis to where the goal wants it: about which axis (3,), and the angle.

    The axis is as long as the angle's sine.
    """
    assert goal.axis is not None
    now = body.pose.rotation.apply(goal.axis)
    now = now / np.linalg.norm(now)
    there = np.divide(goal.points, np.linalg.norm(goal.points))
    return np.cross(now, there), float(np.arccos(np.clip(now @ there, -1.0, 1.0)))


def _draw_lanes(solids: list[Solid], goal: Target, rng: Generator) -> list[list[Solid]]:
    """Groups of bodies, each moved at once: slices across the way to the goal."""
    if len(solids) == 1:
        return [solids]
    positions = np.array([solid.position for solid in solids])
    middle = positions.mean(axis=0)
    way = wanted(middle, goal) - middle
    length = np.hypot(*way[:2])
    if length < 0.05:
        if rng.random() < 0.6:
            return [solids]
        upper = sorted(solids, key=lambda solid: -solid.position[2])[
            : max(1, len(solids) // 3)
        ]
        return [[upper[int(rng.integers(len(upper)))]]]
    across = positions @ np.cross(UP, way / length)
    edges = np.linspace(
        across.min(),
        across.max() + 1e-9,
        int(rng.integers(1, min(4, len(solids)) + 1)) + 1,
    )
    slices = [
        (across >= low) & (across < high + 1e-12)
        for low, high in itertools.pairwise(edges)
    ]
    lanes = [
        list(itertools.compress(solids, inside)) for inside in slices if inside.any()
    ]
    return [lanes[i] for i in rng.permutation(len(lanes))]


def _draw_escape(subgoal: Subgoal, away: float, rng: Generator) -> Array:
    """A shift of at least ``away``, at random from unblocked directions, most likely toward the robot."""
    way = subgoal.space.from_axis(subgoal.center)
    toward = np.append(-way / max(np.hypot(*way), 1e-6), 0.0)
    options = np.array(
        [toward, (-1, 0, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0), -toward, UP]
    )
    weights = np.array([2.0, 3.0, 1.0, 1.0, 1.0, 0.5, 1.5])
    shifts = away * rng.uniform(1.02, 1.4) * options
    weights[[subgoal.blocked(shift) for shift in shifts]] *= 0.02
    return np.asarray(shifts[rng.choice(len(shifts), p=weights / weights.sum())])
