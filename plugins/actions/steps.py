"""Define the waypoints of anchored plans: what one says, where it stands in a layout, and how it is read.

Nothing in it is computed by the model's text: there are no expressions.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, Field, Strict, TypeAdapter
from pydantic.dataclasses import dataclass

from core.design import DesignError
from core.designs.plan_rules import MAX_ANGLE_RAD, MAX_REACH_M, MIN_TEMPO
from core.errors import refuse
from core.geometry import Array, Pose
from core.interfaces import Guard, JsonObject, Seen
from core.support.inputs import FIELDS, check, in_unit
from core.support.text import kind, shorten

WORLD = "world"
"""The anchor of what stands in the world's frame."""

ANCHOR = "anchor"
"""The axes of a waypoint's own anchor."""

HERE = "here"
"""The anchor where the last guard ended."""

IT = "it"
"""In a block for each of some bodies, the one that its turn has come."""

RESERVED = frozenset({WORLD, HERE, IT})
"""Names that are no body's or mark's."""

MAX_NEWTONS = 200.0
"""The largest force that a guard may wait for."""

MAX_CORRECTED = 50
"""The most bodies that a touch may correct."""

MAX_BEYOND_M = 0.2
"""How far a waypoint may lie beyond the place where contact is expected."""

# The arm's limits are lower, and slow the motion.
MAX_SPEED = 10.0
MAX_SECONDS = 60.0

UNTIMED = "'meet' needs 'seconds' of each way since the last look, and no guard there"
"""Why a body can't be met."""

_APART_M = 1e-3  # a direction needs two anchors that are farther apart

Length = Annotated[
    float, Strict(), Field(ge=-MAX_REACH_M, le=MAX_REACH_M, allow_inf_nan=False)
]
Angle = Annotated[
    float,
    Strict(),
    Field(ge=-MAX_ANGLE_RAD, le=MAX_ANGLE_RAD, allow_inf_nan=False),
    in_unit("angles are in radians (90 degrees are 1.5708)"),
]
Seconds = Annotated[float, Strict(), Field(ge=0, le=MAX_SECONDS, allow_inf_nan=False)]
Speed = Annotated[float, Strict(), Field(ge=0, le=MAX_SPEED, allow_inf_nan=False)]
Share = Annotated[float, Strict(), Field(ge=0, le=1, allow_inf_nan=False)]
Newtons = Annotated[float, Strict(), Field(ge=0, le=MAX_NEWTONS, allow_inf_nan=False)]
Name = Annotated[str, Strict(), Field(max_length=200)]


def _read_axes(name: str) -> str:
    """Read whose axes are meant; two words are no names, and may have capitals."""
    plain = name.lower()
    return plain if plain in (WORLD, ANCHOR) else name


@dataclass(frozen=True, config=FIELDS)
class Step:
    """One waypoint as written. An empty ``until`` is none, and beside another tempo a ``speed`` or ``seconds`` of 0.

    Attributes:
        offset: (3,) metres from the anchor to the mount, along the axes.
        rpy: (3,) the mount's orientation in the axes, radians.
        anchor: the name of a body or mark, ``world``, or ``here``: the mount when the last guard ended.
        axes: those of the ``world``, those of the ``anchor``, or those of another body or mark, by its name.
        toward: the name of a second anchor: the axes are the world's, turned about z until x points there.
        share: how far the origin lies on the way to ``toward``; then the axes may be the anchor's.
        speed: of the end-effector on the way there, m/s.
        seconds: the time of the way there.
        through: pass it without a stop.
        wait: seconds to stay there.
        grip: 0 open to 1 closed, for tools with the gripper; or suction, 0 off to 1 on.
        until: with ``newtons`` and ``otherwise`` the guard of the way there, see `core.interfaces.Guard`.
        corrects: bodies and marks that are then taken to be shifted, along the way there, as the touch was.
        beyond: how far the waypoint lies beyond the place where contact is expected, metres.
        meet: the anchor moves, and is where it will be when the waypoint is reached, as two looks saw it move.

    Raises:
        ValueError: fields that mean nothing together.
    """

    LISTS: ClassVar[tuple[str, ...]] = ()  # of steps within it, as blocks have them
    offset: tuple[Length, Length, Length]
    rpy: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)
    anchor: Name = WORLD
    axes: Annotated[Name, AfterValidator(_read_axes)] = WORLD
    toward: Name = ""
    share: Share = 0.0
    speed: Speed = 0.0
    seconds: Seconds = 0.0
    through: Annotated[bool, Strict()] = False
    wait: Seconds = 0.0
    grip: Share = 0.0
    until: Literal["", "touch", "force", "stall"] = ""
    newtons: Newtons = 0.0
    otherwise: Literal["go_on", "end"] = "go_on"
    corrects: Annotated[tuple[Name, ...], Field(max_length=MAX_CORRECTED)] = ()
    beyond: Annotated[
        float, Strict(), Field(ge=0, le=MAX_BEYOND_M, allow_inf_nan=False)
    ] = 0.0
    meet: Annotated[bool, Strict()] = False

    def __post_init__(self) -> None:
        has_force = self.newtons > 0
        is_fixed = self.anchor in (WORLD, HERE)
        fixed = f"'{WORLD}' or '{HERE}'"
        leave = "leave one of them out"
        unguarded = "is for a guard; give 'until', too"
        is_otherwise = self.otherwise != "go_on"
        turns_axes = self.toward and self.axes != WORLD and not self.share
        rules: dict[str, object] = {
            "give speed or seconds, not both": self.speed and self.seconds,
            f"what is passed through has no wait; {leave}": self.through and self.wait,
            f"what is passed through has no guard; {leave}": (
                self.through and self.until
            ),
            "until 'force' needs 'newtons' above 0, and nothing else has them": (
                has_force != (self.until == "force")
            ),
            f"'otherwise' {unguarded}": is_otherwise and not self.until,
            f"'corrects' {unguarded}": self.corrects and not self.until,
            "'beyond' is for what a guard corrects; give 'corrects', too": (
                self.beyond and not self.corrects
            ),
            f"'corrects' is for bodies and marks, not for {fixed}": (
                {WORLD, HERE} & {*self.corrects}
            ),
            "toward turns the world's axes; leave 'axes' out, or give a share of the way": turns_axes,
            "'meet' needs the 'seconds' of the way there, after which the anchor is met": (
                self.meet and not self.seconds
            ),
            f"'meet' is for bodies that move, not for {fixed}": self.meet and is_fixed,
            "a share is one of the way to a second anchor; name it in 'toward'": (
                self.share and not self.toward
            ),
        }
        refuse("", rules)

    def frame(self, seen: Seen, where: str) -> Pose:
        """Return the frame of the offset in the world.

        Args:
            seen: where bodies and marks are.
            where: words for the waypoint, for an error.

        Raises:
            DesignError: an anchor is not there, or gives no direction.
        """
        anchor = place_anchor(self.anchor, seen, where)
        axes = Pose()
        if self.axes != WORLD:
            name = self.anchor if self.axes == ANCHOR else self.axes
            axes = place_anchor(name, seen, where)
        if not self.toward:
            return Pose(anchor.position, axes.quaternion)

        way = place_anchor(self.toward, seen, where).position - anchor.position
        origin = anchor.position + self.share * way

        if self.axes != WORLD:
            return Pose(origin, axes.quaternion)
        if math.hypot(way[0], way[1]) < _APART_M:
            raise DesignError(
                f"{where}: {self.toward!r} is not beside {self.anchor!r}, so that there is no direction"
            )

        return Pose.xyz_rpy(origin, (0.0, 0.0, math.atan2(way[1], way[0])))

    def corrected(
        self, seen: Seen, way: Array, missed: Array, where: str
    ) -> dict[str, Pose]:
        """Return where the bodies in ``corrects`` are, as the arm ended at ``missed`` (3,) from the waypoint.

        Args:
            seen: where bodies and marks were taken to be.
            way: (3,) leads there from the waypoint before, metres.
            missed: (3,) from the waypoint to where the arm ended, metres.
            where: words for the waypoint, for an error.

        Raises:
            DesignError: a name is not there, or there is no way.
        """
        length = float(np.linalg.norm(way))
        if length < _APART_M:
            raise DesignError(
                f"{where}: 'corrects' needs a way there, and the waypoint before is at the same place"
            )

        shift = (missed @ way / length + self.beyond) * way / length
        poses = {}
        for name in self.corrects:
            place = place_anchor(name, seen, where)
            poses[name] = Pose(place.position + shift, place.quaternion)

        return poses

    @property
    def guard(self) -> Guard | None:
        """The guard of the way there; None: there is none."""
        if not self.until:
            return None

        return Guard(self.until, self.newtons, self.otherwise)

    @property
    def is_timed(self) -> bool:
        """Whether its time is known: a guard may end earlier, and a way without seconds has a time of its own."""
        return bool(self.seconds) and not self.until

    @property
    def names(self) -> tuple[str, ...]:
        """What it names."""
        axes = "" if self.axes in (WORLD, ANCHOR) else self.axes
        return tuple(filter(None, (self.anchor, axes, self.toward, *self.corrects)))

    def bound(self, name: str) -> Step:
        """Return the waypoint for a body whose turn it is: `IT`."""
        if IT not in self.names:
            return self

        return replace(
            self,
            anchor=name if self.anchor == IT else self.anchor,
            axes=name if self.axes == IT else self.axes,
            toward=name if self.toward == IT else self.toward,
            corrects=tuple(name if n == IT else n for n in self.corrects),
        )

    def dump(self) -> JsonObject:
        """Return what was written, without what has its default."""
        written: JsonObject = _STEPS.dump_python(
            self, mode="json", exclude_defaults=True
        )
        return written


GUARD_FIELDS = ("until", "newtons", "otherwise", "corrects", "beyond")
_STEPS = TypeAdapter(Step)
# Of the schema, which takes longer to make than a tool takes to be read.
PROPERTIES = _STEPS.json_schema()["properties"]


# Of a waypoint that says no other tempo.
_STANDS_STILL = {
    "speed": f"a speed of 0 never gets there; give {MIN_TEMPO:g} m/s or more, or leave 'speed' out for the usual one",
    "seconds": f"a time of 0 is none; give {MIN_TEMPO:g} s or more, or leave 'seconds' out for the usual one",
}


def read_step(data: object, where: str, gripper: bool) -> Step:
    """Read a waypoint that a model wrote.

    Args:
        data: what was written.
        where: words for the waypoint, for an error.
        gripper: whether the tool hangs from the fingers.

    Raises:
        DesignError: names the field and its fault.
    """
    if not isinstance(data, dict):
        raise DesignError(f"{where} must be an object with an offset, not {kind(data)}")
    if "grip" in data and not gripper:
        raise DesignError(
            f"{where}: 'grip' needs a tool on the gripper, or tool.grips=true; leave it out"
        )

    step = check(Step, data, where, DesignError)
    if not (step.speed or step.seconds):
        for name, message in _STANDS_STILL.items():
            if name in data:
                raise DesignError(f"{where}: {message}")

    return step


def place_anchor(name: str, seen: Seen, where: str) -> Pose:
    """Return the pose of an anchor.

    Args:
        name: of a body or mark, ``world`` or ``here``.
        seen: where bodies and marks are.
        where: words for the waypoint, for an error.

    Raises:
        DesignError: it is not there.
    """
    if name.lower() == WORLD:
        return Pose()
    if name not in seen.poses:
        alike = [known for known in seen.poses if known.lower() == name.lower()]
        if len(alike) == 1:
            return seen.poses[alike[0]]

        raise DesignError(
            f"{where}: no anchor {shorten(name)}; possible: {', '.join((*seen.poses, WORLD))}"
        )

    return seen.poses[name]
