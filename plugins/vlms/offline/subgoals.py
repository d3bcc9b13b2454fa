"""Subgoals: bodies that are moved together, the way that they have to go, and what is around them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from core.geometry import Array, Pose
from core.scene import Body, Soft
from plugins.vlms.offline.boxes import UP, Boxes, count_overlaps, heading_axes
from plugins.vlms.offline.scene_model import SceneModel, Solid
from plugins.vlms.offline.targets import Target

_NO_WAY_M = 0.01  # a shorter shift on the ground gives no direction
_ENCLOSED_M = 0.05  # of what is near, above the bodies
_NEAR_M = 0.15  # to what is near, on the level
_BEHIND_M = 0.05  # from where on an obstacle is in a tool's way
_COVERED_M = 0.5  # to what covers the bodies, above them, or is near their way
_FOOT_M = 0.004  # boxes that begin lower than this are a body's foot,
_OVERHANG_M = 0.006  # and those that stand out by more than this its overhang
_GRIP_TURNS = 12  # in half a turn: headings across which fingers may close
_NARROWER = 0.8  # of the bodies' width at home: what is worth to turn the hand for
_FALLS_M = 0.1  # bodies that go down by more are pushed, and fall
_RISES_M = 0.03  # bodies that have to get up by more are lifted
_TOUCHES_M = 0.002  # what is above bodies may reach into them by this
_SHRUNK_M = 0.001  # bodies are smaller by this for collision checks, since what only touches them does not block them
_STEPS_M = (0.01, 0.02, 0.03, 0.04, 0.06)  # aside, the shortest first
_STEP_WAYS = 8
_LEAST_RISE_M = 0.05  # that must be free after a step
_STEP_UP_M = 0.02  # its end is above its beginning
_STEP_CLEAR_M = 0.006
_LIFT_M = 0.002  # by which bodies rise that nothing keeps down
_LEVEL_SINE = 0.5  # of the steepest axis that a body is turned about
_SUPPORT_M = 0.006  # bodies are lifted by this for collision checks, since their support does not block them


@dataclass(frozen=True, eq=False)
class Extent:
    """Where a subgoal's bodies begin and end along a heading and across it, in metres from the world's origin.

    Attributes:
        heading: radians about z.
        ahead: unit vector (3,) along the heading.
        side: unit vector (3,) to its left.
        rear: the least coordinate along ``ahead``.
        front: the greatest coordinate along ``ahead``.
        right: the least coordinate along ``side``.
        left: the greatest coordinate along ``side``.
    """

    heading: float
    ahead: Array
    side: Array
    rear: float
    front: float
    right: float
    left: float

    @property
    def along(self) -> float:
        """The length of the bodies along the heading, metres."""
        return self.front - self.rear

    @property
    def across(self) -> float:
        """The width of the bodies across the heading, metres."""
        return self.left - self.right

    @property
    def middle(self) -> Array:
        """The middle (3,) of the bodies across the heading."""
        return (self.left + self.right) / 2 * self.side


@dataclass(eq=False)
class Subgoal:
    """Bodies that are moved together, and the shift that brings them to their goal.

    Attributes:
        solids: the bodies.
        shift: (3,), metres.
        model: the layout that they are in.
        goal: of the task, in the world.
        alone: whether it is one of several subgoals, with a body each.
        points: corners of all bodies, (V, 3).
        boxes: of all bodies.
        lower: the lowest corner of their bounds, (3,).
        upper: the highest corner of their bounds, (3,).
        center: of their bounds, (3,).
        height: from the lowest to the highest, metres.
        length: of the shift on the ground, metres.
        workspace: of the arm.
    """

    solids: Sequence[Solid]
    shift: Array
    model: SceneModel
    goal: Target | None = None
    alone: bool = False

    def __post_init__(self) -> None:
        """Measure the bodies where they are now."""
        self.points = np.concatenate([solid.points for solid in self.solids])
        self.boxes = Boxes.concatenate(solid.boxes for solid in self.solids)
        self.lower: Array = self.points.min(axis=0)

        self.upper: Array = self.points.max(axis=0)
        self.center: Array = (self.lower + self.upper) / 2
        self.height = self.upper[2] - self.lower[2]

        self.length = np.hypot(*self.shift[:2])
        self.workspace = self.model.workspace

    @cached_property
    def others(self) -> list[Solid]:
        """All other bodies, also where these are moved or turned."""
        names = {solid.body.name for solid in self.solids}
        return [solid for name, solid in self.model.solids.items() if name not in names]

    @cached_property
    def obstacles(self) -> Boxes:
        """The boxes of all other bodies."""
        return Boxes.concatenate(solid.boxes for solid in self.others)

    @property
    def riders(self) -> list[Solid]:
        """The loose bodies that stand on or in these, and go along."""
        return [
            solid
            for solid in self.others
            if not solid.body.fixed
            and any(solid.stands_on(below) for below in self.solids)
        ]

    @property
    def loaded(self) -> Subgoal:
        """The same with its riders, which are in no way."""
        return replace(self, solids=(*self.solids, *self.riders))

    @cached_property
    def clear_height(self) -> float:
        """The height above everything near the bodies' way, in the world, metres."""
        lower, upper = self.model.boxes.bounds
        return float(upper[self._is_near(lower, upper, self.shift), 2].max())

    @cached_property
    def loose_container(self) -> Solid | None:
        """A loose body that encloses the positions of all bodies."""
        for solid in self.model.find_enclosing(self.solids):
            if not solid.body.fixed:
                return solid

        return None

    @property
    def reference(self) -> str | None:
        """The body or mark by which the goal's place is given."""
        return self.goal.reference if self.goal is not None else None

    @property
    def is_released(self) -> bool:
        """Whether the goal wants the bodies let go, so that the head has to leave them."""
        return self.goal is not None and self.goal.released

    @property
    def is_held(self) -> bool:
        """Whether the goal wants the bodies in hand at the end."""
        return self.goal is not None and self.goal.held

    @property
    def must_rest(self) -> bool:
        """Whether the goal wants the bodies at rest at the end."""
        return self.goal is not None and self.goal.rest

    @property
    def falls_in(self) -> bool:
        """Whether the goal wants the bodies in the hollow of another, so that they may be let fall into it."""
        return (
            self.goal is not None
            and self.goal.container is not None
            and not self.goal.held
        )

    @property
    def over_edge(self) -> bool:
        """Whether the goal is a place beyond a known edge; see `Target.over_edge`."""
        return self.goal is not None and self.goal.over_edge

    @property
    def falls(self) -> bool:
        """Whether the bodies are to fall over an edge: they are pushed on the level, and go down by themselves."""
        return bool(self.over_edge or self.shift[2] < -_FALLS_M)

    @property
    def rises(self) -> bool:
        """Whether the bodies have to be lifted."""
        return bool(self.shift[2] > _RISES_M)

    @property
    def heading(self) -> float:
        """The level direction of the shift; if there is none, toward the robot: in a turned scene, along an axis."""
        x, y = self.shift[:2]
        if self.length <= _NO_WAY_M:
            x, y = -self.workspace.from_axis(self.center)

        angle = float(np.arctan2(y, x))
        if self.length <= _NO_WAY_M and self.model.turned:
            return round(angle / (np.pi / 2)) * np.pi / 2

        return angle

    @property
    def yaw(self) -> float:
        """By how much the goal wants the first body turned about the vertical, radians; 0: not so."""
        if self.goal is None or self.goal.axis is None:
            return 0.0

        axis, angle = turn_to_goal(self.goal, self.solids[0].body)
        return float(np.sign(axis[2]) * angle) if is_upright(axis) else 0.0

    @property
    def turned(self) -> Subgoal:
        """The same with its bodies turned by the yaw about the first one's origin."""
        if self.yaw == 0.0:
            return self

        origin = self.solids[0].position
        about = Pose(origin)
        by = (
            about
            @ Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, self.yaw))
            @ about.inverse()
        )
        turned = [solid.moved_by(by) for solid in self.solids]
        return replace(self, solids=turned)

    def extent(self, heading: float) -> Extent:
        """Measure the bodies along a heading and across it.

        Args:
            heading: radians about z.
        Returns:
            In the world.
        """
        ahead, side = heading_axes(heading)
        leftward, _ = heading_axes(heading + np.pi / 2)

        along = self.points[:, :2] @ ahead[:2]
        across = self.points[:, :2] @ leftward[:2]

        return Extent(
            heading,
            ahead,
            side,
            rear=along.min(),
            front=along.max(),
            right=across.min(),
            left=across.max(),
        )

    @cached_property
    def grip_heading(self) -> float:
        """The heading across which fingers close: that of home, 0, or one across which the bodies are much narrower."""
        headings = np.arange(_GRIP_TURNS) * np.pi / _GRIP_TURNS
        widths = np.array([self.extent(heading).across for heading in headings])
        narrowest = int(widths.argmin())
        if widths[narrowest] > _NARROWER * widths[0]:
            return 0.0

        heading = float(headings[narrowest])
        return heading - np.pi if heading > np.pi / 2 else heading

    @cached_property
    def height_on_way(self) -> float:
        """The height of the highest obstacle near the bodies' way, in the world; the bodies' foot where none is."""
        lower, upper = self.obstacles.bounds
        near = self._is_near(lower, upper, self.shift)
        return float(upper[near, 2].max(initial=self.lower[2]))

    def _is_near(
        self, lower: Array, upper: Array, shift: Array
    ) -> npt.NDArray[np.bool_]:
        """Report which boxes, between corners (N, 3), are near the bodies' way by a shift (3,), on the level."""
        low = np.minimum(self.lower, self.lower + shift) - _NEAR_M
        high = np.maximum(self.upper, self.upper + shift) + _NEAR_M
        near = ((lower < high) & (upper > low))[:, :2].all(axis=1)
        # What is far above them is no reason to come down from higher still.
        below: npt.NDArray[np.bool_] = lower[:, 2] < self.upper[2] + _COVERED_M
        return np.asarray(near & below)

    def side_clearances(self, heading: float) -> tuple[float, float]:
        """Measure the clearance on the right and on the left of the bodies, for a tool that moves behind them.

        An obstacle counts where the tool passes, from a little behind the bodies on, and as high as they are.

        Args:
            heading: along which the tool moves, radians about z.

        Returns:
            To the nearest obstacle on the right and on the left, at most 1 m each.
        """
        extent = self.extent(heading)
        lower, upper = self.obstacles.bounds
        bounds = np.stack([lower, upper])
        x = bounds[[0, 0, 1, 1], :, 0]

        y = bounds[[0, 1, 0, 1], :, 1]
        along = x * extent.ahead[0] + y * extent.ahead[1]  # of the obstacles' corners

        across = x * extent.side[0] + y * extent.side[1]

        # Where the tool passes.
        beside = along.max(axis=0) >= extent.rear - _BEHIND_M
        beside &= along.min(axis=0) <= extent.rear + self.length
        beside &= upper[:, 2] >= self.lower[2] + _SUPPORT_M

        beside &= lower[:, 2] <= self.upper[2]
        on_left = across.mean(axis=0) > (extent.left + extent.right) / 2

        # From the bodies' sides to the nearest of them.
        on_right = extent.right - across.max(axis=0)
        free_right = on_right[beside & ~on_left].min(initial=1.0)

        free_left = (across.min(axis=0) - extent.left)[beside & on_left]
        free_left = free_left.min(initial=1.0)

        return max(0.0, float(free_right)), max(0.0, float(free_left))

    def overhang(self, heading: float) -> tuple[npt.NDArray[np.bool_], Array]:
        """Find which boxes stand out across a heading, beyond those at the bodies' foot.

        Args:
            heading: radians about z.

        Returns:
            Whether each box does, (N,); and its half width across the heading, (N,), metres.
        """
        _, side = heading_axes(heading)
        right, left = self.boxes.ranges_along(side, self.center)
        halves = np.maximum(left, -right)
        low = self.boxes.bounds[0][:, 2] < self.lower[2] + _FOOT_M

        return ~low & (halves > halves[low].max() + _OVERHANG_M), halves

    @cached_property
    def clearance_above(self) -> float:
        """The distance from the bodies' top to the lowest obstacle above them, at most 1 m."""
        lower, upper = self.obstacles.bounds
        above = (lower[:, :2] < self.upper[:2]).all(axis=1)

        above &= (upper[:, :2] > self.lower[:2]).all(axis=1)
        above &= lower[:, 2] > self.upper[2] - _TOUCHES_M

        return float((lower[above, 2] - self.upper[2]).min(initial=1.0))

    @property
    def is_covered(self) -> bool:
        """Whether an obstacle is close above the bodies."""
        return self.clearance_above < _COVERED_M

    @cached_property
    def slides_out(self) -> bool:
        """Whether an obstacle keeps the bodies from being lifted, and they get straight to their goal as they are."""
        if self.goal is None or self.goal.joint is not None or len(self.solids) > 1:
            return False
        if isinstance(self.solids[0].body, Soft):  # it gives way
            return False
        if self.rises or self.length < _NO_WAY_M or not self.is_blocked(_LIFT_M * UP):
            return False

        return not self.is_blocked(self.shift, -_SUPPORT_M * UP)

    @property
    def is_enclosed(self) -> bool:
        """Whether obstacles near where the bodies are now are much higher, so that they are reached from above."""
        return self.height_around > _ENCLOSED_M

    @cached_property
    def height_around(self) -> float:
        """How far obstacles near where the bodies are now are higher, metres."""
        lower, upper = self.model.boxes.bounds
        near = self._is_near(lower, upper, np.zeros(3))
        return float(upper[near, 2].max() - self.upper[2])

    def is_blocked(
        self,
        shift: Array,
        start: Array | float = 0.0,
        margin: float = 0.0,
        step: float = 0.03,
    ) -> bool:
        """Report whether an obstacle is in the bodies' way.

        Args:
            shift: the way (3,), metres.
            start: where it begins (3,), from where the bodies are, metres.
            margin: distance from an obstacle that is needed, metres.
            step: between two places that are checked, at most, metres.
        Returns:
            Whether one is at a place that is checked.
        """
        steps = max(2, int(np.ceil(np.linalg.norm(shift) / step)))
        shares = np.linspace(0.0, 1.0, steps)[1:, None]
        way = shares * shift + start + _SUPPORT_M * UP
        turns = np.broadcast_to(np.eye(3), (len(way), 3, 3))
        halves = self.boxes.halves - _SHRUNK_M
        shrunk = Boxes(self.boxes.centers, self.boxes.axes, halves)

        return count_overlaps(shrunk.moved_to(way, turns), self.obstacles, margin) > 0

    def find_sidestep(self) -> Array:
        """Find the shortest step (3,) aside, in the air, after which nothing is above the bodies; zero: none helps.

        Returns:
            In the world, metres: one of `_STEP_WAYS` ways, as short as can be.
        """
        # All the way up from the place beside must be free.
        rise = max(self.shift[2], _LEAST_RISE_M) * UP
        steps = [np.zeros(3)]

        for radius in _STEPS_M:
            for angle in np.arange(_STEP_WAYS) * 2 * np.pi / _STEP_WAYS:
                ahead, _ = heading_axes(angle)
                steps.append(radius * ahead)

        for step in steps:
            if not self.is_blocked(rise, step + _STEP_UP_M * UP, _STEP_CLEAR_M):
                return step

        return np.zeros(3)


def goal_position(here: Array, goal: Target) -> Array:
    """Compute the goal's place (3,); along an axis where it has none, it is here.

    Args:
        here: where the body is, (3,).
        goal: which may leave some coordinates free.
    Returns:
        In the world, metres.
    """
    place = np.array(here)
    for axis, coordinate in enumerate(goal.place or here):
        if coordinate is not None:
            place[axis] = coordinate

    return place


def turn_to_goal(goal: Target, body: Body) -> tuple[Array, float]:
    """Compute the turn that brings a body's axis to where the goal wants it.

    Args:
        goal: one with an axis.
        body: where it is now.

    Returns:
        The axis of the turn (3,), as long as the angle's sine; and the angle, radians.
    """
    assert goal.axis is not None
    now = body.pose.rotation.apply(goal.axis)
    now = now / np.linalg.norm(now)
    wanted = np.divide(goal.points, np.linalg.norm(goal.points))

    angle = float(np.arccos(np.clip(now @ wanted, -1.0, 1.0)))

    return np.cross(now, wanted), angle


def is_upright(axis: Array) -> bool:
    """Report whether the axis (3,) of a turn is steep."""
    return bool(abs(axis[2]) > _LEVEL_SINE * np.linalg.norm(axis) + 1e-6)
