"""Define what all kinds of grips share: a round patch of a face, what loads it, and when it gives way."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from core.errors import refuse
from core.geometry import Array, Pose, Shape
from core.values.margins import Margin

FACES = {
    "front": (1.0, 0.0, 0.0),
    "back": (-1.0, 0.0, 0.0),
    "left": (0.0, 1.0, 0.0),
    "right": (0.0, -1.0, 0.0),
    "top": (0.0, 0.0, 1.0),
    "bottom": (0.0, 0.0, -1.0),
}
"""The faces of a component's bounding box, and the direction in its own frame that they look to."""

TOUCH_M = 0.0015
"""The largest gap between a patch and a body that it takes hold of: a cup's lip or a pad gives way by as much."""

MIN_AREA_MM2 = 20.0  # a round patch of 5 mm
MAX_AREA_MM2 = 20_000.0  # one of 160 mm
_RIM = 8  # points


class Surface(Protocol):
    """What a body says of its surface, see `core.scene.Body`."""

    @property
    def smooth(self) -> bool:
        """Whether a suction cup is tight on it."""

    @property
    def magnetic(self) -> bool:
        """Whether a magnet pulls it."""

    @property
    def loops(self) -> bool:
        """Whether hooks catch in it."""


class Load(NamedTuple):
    """What a body loads a patch with.

    Attributes:
        pull: away from the patch, N; below 0 it is pressed on.
        shear: along the patch, N.
        tilt: the moment that opens it at one side, N m.
        twist: the moment about its axis, N m.
    """

    pull: float
    shear: float
    tilt: float
    twist: float

    @classmethod
    def of(cls, forces: Array, points: Array, turn: Array) -> Load:
        """Return what forces load a patch with.

        Args:
            forces: with which it holds a body (N, 3), in the world, N.
            points: at which they act, in the patch's frame (N, 3), m.
            turn: of the patch's frame in the world (3, 3).
        """
        local = forces @ turn
        x, y, z = (-local.sum(axis=0)).tolist()
        moments = np.cross(points, local).sum(axis=0)
        tilt = float(np.hypot(moments[0], moments[1]))
        return cls(z, math.hypot(x, y), tilt, abs(float(moments[2])))


class Limit(NamedTuple):
    """One figure of a load, what it may be at most, and the unit of both."""

    name: str
    value: float
    most: float
    unit: str

    @property
    def share(self) -> float:
        """How much of what it may be it is; above 1 the grip gives way."""
        if self.value <= 0:
            return 0.0
        return self.value / self.most if self.most > 0 else math.inf

    def __str__(self) -> str:
        return f"{self.name} of {self.value:.3g} {self.unit}, and it bears {self.most:.3g} {self.unit}"


@dataclass(frozen=True)
class Grip(ABC):
    """A round patch in the middle of a face, which holds a body that touches it with the whole patch.

    Attributes:
        face: one of `FACES`, in the component's own frame.
        area_mm2: of the patch.

    Raises:
        ValueError: says which of these can't be.
    """

    kind: ClassVar[str]
    switched: ClassVar[bool] = False
    """Whether the plan switches it, by the number with which it closes a gripper."""

    words: ClassVar[str]
    """What it holds and by how much, for the prompt."""

    face: str
    area_mm2: float

    def __post_init__(self) -> None:
        problems = {
            f"its face is one of {', '.join(FACES)}, not {self.face!r}": (
                self.face not in FACES
            ),
            f"area_mm2 must be between {MIN_AREA_MM2:g} and {MAX_AREA_MM2:g}, got {self.area_mm2:g}": (
                not MIN_AREA_MM2 <= self.area_mm2 <= MAX_AREA_MM2
            ),
        }
        refuse("", problems)

    @abstractmethod
    def limits(self, load: Load) -> tuple[Limit, ...]:
        """List the figures of a load that can make it give way."""

    def find_obstacle(self, surface: Surface) -> str:
        """Say why it can't hold a body of this surface; empty: it can."""
        return ""

    @property
    @abstractmethod
    def parts(self) -> str:
        """What to buy for it."""

    @property
    def area_m2(self) -> float:
        return self.area_mm2 * 1e-6

    @property
    def radius_m(self) -> float:
        return math.sqrt(self.area_m2 / math.pi)

    def place(self, shape: Shape) -> Pose:
        """Return the frame of the patch on a shape, in the shape's frame: z points out of the face."""
        out = np.array(FACES[self.face])
        middle, sides = shape.bounds
        across = np.roll(np.abs(out), 1)
        frame = np.eye(4)
        frame[:3, :3] = np.column_stack([across, np.cross(out, across), out])
        frame[:3, 3] = middle + out * sides / 2
        return Pose.from_matrix(frame)

    @property
    def points(self) -> Array:
        """The points (N, 3) by which a touch is judged, in the patch's frame: its middle and its rim."""
        turns = np.arange(_RIM) * 2 * math.pi / _RIM
        rim = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(_RIM)])
        return np.vstack([np.zeros(3), self.radius_m * rim])

    def fits(self, shape: Shape) -> bool:
        """Report whether the patch is no larger than the face of the shape's bounding box."""
        _, sides = shape.bounds
        along = np.array(FACES[self.face]) == 0
        return bool(sides[along].min() >= 2 * self.radius_m - 1e-9)


class Pressing(Grip):
    """A grip that presses the body on with a force of its own: what is left of it makes friction.

    It opens at the rim, about which a moment tilts the body, and slips where the shear is more than the friction. A
    patch that is pressed evenly bears two thirds of its radius as the arm of a twist. What is pressed on harder than
    the grip itself presses does not open: the faces around the patch bear it, too.
    """

    friction: ClassVar[float]

    @property
    @abstractmethod
    def strength_n(self) -> float:
        """With how much it presses, N."""

    def limits(self, load: Load) -> tuple[Limit, ...]:
        pull = Limit("pull", load.pull, self.strength_n, "N")
        if pull.share >= 1:
            return (pull,)

        left = self.strength_n - load.pull
        slips = self.friction * left
        tilts = self.radius_m * left
        if load.pull < -self.strength_n:
            tilts = math.inf
        return (
            pull,
            Limit("shear", load.shear, slips, "N"),
            Limit("tilt", load.tilt, tilts, "N m"),
            Limit("twist", load.twist, slips * self.radius_m * 2 / 3, "N m"),
        )


class Sticking(Grip):
    """A grip that bears so much stress: it peels where that of the pull and of the tilt is too much at the rim.

    Stress is spread as in a round bar: a moment M adds 4 M / (area radius) at the rim, and a twist 2 M / (area radius)
    of shear.
    """

    pull_pa: ClassVar[float]
    shear_pa: ClassVar[float]

    def limits(self, load: Load) -> tuple[Limit, ...]:
        radius = self.radius_m
        peel = max(load.pull + 4 * load.tilt / radius, 0.0)
        shear = load.shear + 2 * load.twist / radius
        return (
            Limit("peel", peel, self.pull_pa * self.area_m2, "N"),
            Limit("shear", shear, self.shear_pa * self.area_m2, "N"),
        )


class Gripped(NamedTuple):
    """What a grip did with a body.

    Attributes:
        component: that has it.
        kind: of the grip.
        body: that it held, or touched in vain.
        begin_s: when it took hold, or touched it first, seconds of the motion.
        end_s: when it let go; inf: never.
        why: why it let go, or did not hold, in words; empty: it was switched off, or held to the end.
        hardest: the largest share of a limit while it held; None: it did not hold.
    """

    component: str
    kind: str
    body: str
    begin_s: float
    end_s: float = math.inf
    why: str = ""
    hardest: Limit | None = None

    @property
    def failed(self) -> bool:
        """Whether it did not hold, or gave way."""
        return bool(self.why)

    @property
    def margins(self) -> tuple[Margin, ...]:
        """How far it stayed from giving way; of one that failed there is none."""
        limit = self.hardest
        if limit is None or self.failed or not 0 < limit.most < math.inf:
            return ()

        name = f"{limit.name} on {self.component}, which holds {self.body}"
        return (Margin.at_most(name, limit.value, limit.most, limit.unit),)

    def holds(self, times: Array) -> npt.NDArray[np.bool_]:
        """Report at which instants (T,) it held the body."""
        if self.hardest is None:
            return np.zeros(times.shape, dtype=bool)
        return np.asarray((times >= self.begin_s) & (times < self.end_s))

    def __str__(self) -> str:
        who = f"{self.component} ({self.kind})"
        if self.hardest is None:
            return f"{who} touched {self.body} at {self.begin_s:.2f} s and did not hold it: {self.why}"

        said = f"{who} held {self.body} from {self.begin_s:.2f} s"
        if self.end_s == math.inf:
            return f"{said} to the end; hardest was a {self.hardest}"
        if self.failed:
            return f"{said} and lost it at {self.end_s:.2f} s: {self.why}"
        return f"{said} until it was switched off at {self.end_s:.2f} s; hardest was a {self.hardest}"
