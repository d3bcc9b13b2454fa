"""One errand of a tool: bodies, where they have to go, and the frame in which ways of using a tool are written."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np

from core.designs.statics import GRAVITY
from core.geometry import Array, Pose
from core.goals import Want
from plugins.vlms.offline.layout import CONTACT_M, Layout
from plugins.vlms.offline.sections import find_thickness

Asked = Literal["place", "joint", "turn", "break", "else"]
"""What a goal asks of bodies."""

NEAR_M = 0.15
"""Bodies that are nearer on the level are in the way of what comes down."""

MOST_ROOM_M = 0.2
"""More room than this is not looked for."""

_NO_WAY_M = 0.01  # a shorter way on the ground gives no direction
_RISES_M = 0.03  # what has to get up by more is lifted
_FALLS_M = 0.1  # what has to get down by more falls
_SUPPORT_M = 0.006  # what is so low beside a body is what it stands on
_LOOK_M = 0.03  # between two looks along a way
_TOOL_M = 0.55  # by which a tool makes an arm longer, at most
_LEAST_LOAD_N = 2.5  # that a tool bears, whatever it moves
_SLIDING = 0.5  # of its weight, it takes to move what slides
_HEAD_SAG = 0.5  # of what a tool may sag, a part of its head may
_HALVINGS = 6  # of a distance, to find how far something is away


@dataclass(frozen=True, eq=False)
class Job:
    """Bodies that a tool moves together, and where they have to go.

    All lengths are metres. Ways of using a tool work in the job's `frame`: its origin is below the middle of the
    bodies, at the height of their foot; x points where they have to go on the ground, or away from the robot where
    that is nowhere; z points up.

    Attributes:
        layout: where they are.
        want: what a goal wants of them.
        turned: by how much x is turned from what is said above, radians.
        approaches: whether x points away from the robot wherever the bodies have to go.
    """

    layout: Layout
    want: Want
    turned: float = 0.0
    approaches: bool = False

    @property
    def moved(self) -> tuple[str, ...]:
        """The names of what the tool may touch, where a way says so: what bodies lie in and what is in them, too."""
        names = (*self.want.bodies, *sorted(self.contents))
        if self.vessel is None:
            return names
        return names + self.vessel.want.bodies

    @cached_property
    def load(self) -> float:
        """The force that a tool has to bear, newtons: the weight of what it moves, or half of it for what slides.

        What rolls is not slowed by the ground, and strikes the walls around it.
        """
        if self.want.joint:  # that bears the weight
            return _LEAST_LOAD_N

        bodies = [self.layout.scene[name] for name in self.moved]
        weight = GRAVITY * sum(body.mass for body in bodies)
        rolls = any(body.rolling_friction > 0 for body in bodies)
        share = _SLIDING if self.slides and not rolls else 1.0
        return max(_LEAST_LOAD_N, share * weight)

    def find_thickness(
        self,
        length: float,
        least: float,
        most: float,
        wide: float | None = None,
        load: float = 0.0,
    ) -> float:
        """Find how thick a part of a head must be that is so long, and bears the load at its end; metres.

        Args:
            length: from where the part is held to its end.
            least: the thickness.
            most: the thickness, also where that is not stiff enough.
            wide: the part's other side; None: its section is a square.
            load: that it bears if that is more than the job's, newtons.
        """
        leverage = length**3 / 3 / _HEAD_SAG
        material = self.layout.material
        return find_thickness(
            max(load, self.load),
            length,
            leverage,
            material,
            least=least,
            most=most,
            wide=wide,
        )

    @cached_property
    def points(self) -> Array:
        """The corners of the bodies in the world, (V, 3)."""
        return np.concatenate([self.layout.points[name] for name in self.want.bodies])

    @cached_property
    def center(self) -> Array:
        """The middle of the bodies' bounds in the world, (3,)."""
        return np.asarray((self.points.min(axis=0) + self.points.max(axis=0)) / 2)

    @cached_property
    def shift(self) -> Array:
        """The way that the bodies have to go, (3,), in the world; where the goal leaves it open, none."""
        if self.want.place is None:
            return np.zeros(3)

        here = self.origins.mean(axis=0)
        if len(self.origins) > 1:  # the middle of what is around them goes there
            here = np.array([*self.center[:2], here[2]])

        place = np.array(self.want.place, dtype=float)  # None becomes nan
        return np.where(np.isnan(place), 0.0, place - here)

    @cached_property
    def origins(self) -> Array:
        """The origins of the bodies' frames in the world, (B, 3)."""
        names = self.want.bodies
        return np.array([self.layout.scene[name].pose.position for name in names])

    @property
    def asks(self) -> Asked:
        """What the goal asks beyond a place; ``else``: what no want says."""
        if self.want.unsaid:
            return "else"
        if self.want.joint:
            return "joint"
        if self.want.breaks:
            return "break"
        if self.turn > np.radians(self.want.tolerance_deg):
            return "turn"
        return "place"

    @property
    def turn(self) -> float:
        """By how much the bodies are to be turned, radians."""
        if self.want.axis is None:
            return 0.0

        body = self.layout.scene[self.want.bodies[0]]
        now = body.pose.rotation.apply(self.want.axis)
        wanted = np.asarray(self.want.points)
        lengths = np.linalg.norm(now) * np.linalg.norm(wanted)
        return float(np.arccos(np.clip(now @ wanted / lengths, -1.0, 1.0)))

    @cached_property
    def outward(self) -> float:
        """The direction from the robot to the bodies in the world, along an axis of theirs, radians."""
        away = self.layout.reach.find_heading(self.center)
        yaw = float(self.layout.scene[self.want.bodies[0]].pose.rpy[2])
        quarter = np.pi / 2
        return yaw + quarter * round((away - yaw) / quarter)

    @cached_property
    def heading(self) -> float:
        """The direction of the frame's x in the world, radians."""
        x, y = self.shift[:2]
        ahead = self.outward
        if np.hypot(x, y) > _NO_WAY_M and not self.approaches:
            ahead = float(np.arctan2(y, x))
        return ahead + self.turned

    @cached_property
    def frame(self) -> Pose:
        """The job's frame in the world."""
        foot = np.array([*self.center[:2], self.points[:, 2].min()])
        level = Pose.xyz_rpy(foot, (0.0, 0.0, self.heading))
        low, high = span(level.inverse().apply(self.points))
        middle = level.apply([*(low + high)[:2] / 2, 0.0])
        return Pose.xyz_rpy(middle, (0.0, 0.0, self.heading))

    @cached_property
    def size(self) -> Array:
        """The bodies' extents along the frame's axes, (3,)."""
        low, high = span(self.frame.inverse().apply(self.points))
        return high - low

    @property
    def length(self) -> float:
        """How far the bodies have to go on the ground."""
        if self.want.away is not None:
            return self.want.away
        return float(np.hypot(*self.shift[:2]))

    @property
    def rise(self) -> float:
        """How far the bodies have to get up."""
        return float(self.shift[2])

    @property
    def rises(self) -> bool:
        """Whether the bodies have to be lifted."""
        return self.rise > _RISES_M

    @property
    def falls(self) -> bool:
        """Whether the bodies have to get down by much."""
        return self.rise < -_FALLS_M

    @cached_property
    def is_borne(self) -> bool:
        """Whether something bears the bodies where they have to go: let go there, they fall by little."""
        below = self.way - np.array([0.0, 0.0, _RISES_M])
        return self.meets(below, self.size)

    @property
    def goes(self) -> bool:
        """Whether the bodies have to go somewhere on the ground."""
        return self.length > _NO_WAY_M

    @property
    def beyond(self) -> bool:
        """Whether the bodies have to go where no tool gets."""
        goal = self.center + self.shift
        return bool(self.layout.reach.too_far(goal) > _TOOL_M)

    @property
    def way(self) -> Array:
        """The way that the bodies have to go, in the frame, (3,)."""
        if self.want.away:
            return np.array([self.want.away, 0.0, 0.0])
        return self.frame.rotation.inv().apply(self.shift)

    @cached_property
    def clear(self) -> float:
        """The height in the frame above everything that is near the bodies or their way."""
        ends = np.stack([self.points, self.points + self.shift])
        low = ends.min(axis=(0, 1))[:2] - NEAR_M
        high = ends.max(axis=(0, 1))[:2] + NEAR_M
        top = self.layout.top_at(low, high)
        return float(top - self.frame.position[2])

    @cached_property
    def holder(self) -> str | None:
        """The smallest body that stands around all of the bodies, such as a jar or a tray; None: there is none."""
        origins = self.origins
        found = []
        for name, points in self.layout.points.items():
            low, high = span(points)
            is_around = ((origins > low) & (origins < high)).all()
            if is_around and name not in self.want.bodies:
                found.append((float(np.prod(high - low)), name))

        _, smallest = min(found, default=(0.0, None))
        return smallest

    @cached_property
    def contents(self) -> frozenset[str]:
        """The names of what lies in the bodies and goes along, such as a ball in a tray."""
        low, high = span(self.points)
        found = set()
        for body in self.layout.scene.free:
            origin = body.pose.position
            if ((origin > low) & (origin < high)).all():
                found.add(body.name)

        return frozenset(found.difference(self.want.bodies))

    @cached_property
    def vessel(self) -> Job | None:
        """What the bodies lie in, if it is loose, as what is moved; None: there is none."""
        holder = self.holder
        if holder is None or self.layout.scene[holder].fixed:
            return None
        return replace(self, want=Want((holder,)))

    @lru_cache(maxsize=32)  # noqa: B019 - a job lives as long as the answer to a brief
    def room(
        self,
        x: float = 0.0,
        y: float = 0.0,
        z: float = 0.0,
        *,
        ahead: float = 0.0,
    ) -> float:
        """Measure how far there is nothing beside the bodies, or above them; at most `MOST_ROOM_M`.

        Args:
            x: with y and z the direction in the frame, along an axis.
            y: see x.
            z: see x.
            ahead: how far beyond the bodies it must be free, too, along the frame's x.
        """
        direction = np.array([x, y, z])
        least = 0.0
        most = MOST_ROOM_M
        if self._is_free(direction, most, ahead):
            return most

        for _ in range(_HALVINGS):
            middle = (least + most) / 2
            if self._is_free(direction, middle, ahead):
                least = middle
            else:
                most = middle

        return least

    @cached_property
    def is_covered(self) -> bool:
        """Whether something is above the bodies, however high: heads come down from above all that is near."""
        height = self.clear - float(self.size[2])
        up = np.array([0.0, 0.0, 1.0])
        return height > 0 and not self._is_free(up, height, 0.0)

    @cached_property
    def slides(self) -> bool:
        """Whether the bodies get where they have to go along the ground, past all others, and may be left there."""
        if not self.goes or self.rises or self.beyond or self.want.held:
            return False

        ahead = self.way * [1.0, 1.0, 0.0]
        steps = int(np.ceil(self.length / _LOOK_M)) + 1
        return self.falls or not any(
            self.meets(share * ahead, self.size)
            for share in np.linspace(0.0, 1.0, steps)
        )

    def _is_free(self, direction: Array, distance: float, ahead: float) -> bool:
        """Report whether there is nothing within a distance of a side of the bodies' box, which is longer ahead."""
        size = np.where(direction != 0, distance, self.size)
        shift = direction * (self.size + distance) / 2
        size[0] += ahead
        shift[0] += ahead / 2
        return not self.meets(shift, size)

    def meets(self, shift: Array, size: Array) -> bool:
        """Report whether a box of this size, shifted from the bodies' middle, meets another body."""
        lift = np.array([0.0, 0.0, _SUPPORT_M / 2])
        up = np.array([0.0, 0.0, self.size[2] / 2])
        sides = np.maximum(size - 2 * CONTACT_M - 2 * lift, CONTACT_M)
        middle = self.frame.apply(shift + up + lift)
        x, y, z = sides.tolist()
        moved = self.contents.union(self.want.bodies)
        return self.layout.meets(Pose(middle, self.frame.quaternion), (x, y, z), moved)


def span(points: Array) -> tuple[Array, Array]:
    """Return the least and the greatest coordinates of points (V, 3)."""
    return points.min(axis=0), points.max(axis=0)
