"""``action=anchored``: a plan whose waypoints stand relative to bodies and marks of the scene, with tempo.

A waypoint is an object: an anchor, an offset and an orientation in the anchor's axes, and what it says of time. Nothing
in it is computed by the model's text: there are no expressions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Field, Strict, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from core.design import DesignError
from core.designs.plan_rules import MAX_ANGLE_RAD, MAX_REACH_M, MAX_WAYPOINTS, MIN_TEMPO
from core.errors import choices
from core.geometry import Array, Pose
from core.interfaces import (
    ActionPlan,
    ActionRepresentation,
    Anchor,
    Brief,
    Guard,
    Guards,
    Numbers,
    PlannedMotion,
    Seen,
    Tempo,
    Waypoints,
)
from core.support.templates import fill
from core.support.text import kind, shorten
from plugins.actions.guards import PlannedGuards
from plugins.actions.waypoints import MOST, STEPS

WORLD = "world"
"""The anchor of what stands in the world's frame."""

HERE = "here"
"""The anchor where the last guard ended."""

MAX_GUARDS = 6
"""The most guards of a plan."""

MAX_NEWTONS = 200.0
"""The largest force that a guard may wait for."""

MAX_CORRECTED = 50
"""The most bodies that a touch may correct."""

MAX_BEYOND_M = 0.2
"""How far a waypoint may lie beyond the place where contact is expected."""

STEP_LOG = 0.2
"""A small change of a speed or time, as a logarithm."""

# The arm's limits are lower, and slow the motion.
MAX_SPEED = 10.0
MAX_SECONDS = 60.0

_DIGITS = 5  # hundredths of a millimetre
_UNKNOWN = "unexpected_keyword_argument"
_BEYOND = ("less_than_equal", "greater_than_equal")
_APART_M = 1e-3  # a direction needs two anchors that are farther apart

Length = Annotated[
    float, Strict(), Field(ge=-MAX_REACH_M, le=MAX_REACH_M, allow_inf_nan=False)
]
Angle = Annotated[
    float, Strict(), Field(ge=-MAX_ANGLE_RAD, le=MAX_ANGLE_RAD, allow_inf_nan=False)
]
Seconds = Annotated[float, Strict(), Field(ge=0, le=MAX_SECONDS, allow_inf_nan=False)]
Speed = Annotated[float, Strict(), Field(ge=0, le=MAX_SPEED, allow_inf_nan=False)]
Share = Annotated[float, Strict(), Field(ge=0, le=1, allow_inf_nan=False)]
Newtons = Annotated[float, Strict(), Field(ge=0, le=MAX_NEWTONS, allow_inf_nan=False)]
Name = Annotated[str, Strict(), Field(max_length=200)]


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class Step:
    """One waypoint as written. An empty ``until`` is none, and beside another tempo a ``speed`` or ``seconds`` of 0.

    Attributes:
        offset: (3,) metres from the anchor to the mount, along the axes.
        rpy: (3,) the mount's orientation in the axes, radians.
        anchor: the name of a body or mark, ``world``, or ``here``: the mount when the last guard ended.
        axes: those of the world, or those of the anchor.
        toward: the name of a second anchor: the axes are the world's, turned about z until x points there.
        share: how far the origin lies on the way to ``toward``; then the axes may be the anchor's.
        speed: of the end-effector on the way there, m/s.
        seconds: the time of the way there.
        through: pass it without a stop.
        wait: seconds to stay there.
        grip: 0 open to 1 closed, for tools with the gripper.
        until: with ``newtons`` and ``otherwise`` the guard of the way there, see `core.interfaces.Guard`.
        corrects: bodies and marks that are then taken to be shifted, along the way there, as the touch was.
        beyond: how far the waypoint lies beyond the place where contact is expected, metres.
    """

    offset: tuple[Length, Length, Length]
    rpy: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)
    anchor: Name = WORLD
    axes: Literal["world", "anchor"] = "world"
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

    def frame(self, seen: Seen, where: str) -> Pose:
        """Return the frame of the offset in the world.

        Args:
            seen: where bodies and marks are.
            where: words for the waypoint, for an error.

        Raises:
            DesignError: an anchor is not there, or gives no direction.
        """
        anchor = _place(self.anchor, seen, where)
        if not self.toward:
            return anchor if self.axes == "anchor" else Pose(anchor.position)

        way = _place(self.toward, seen, where).position - anchor.position
        origin = anchor.position + self.share * way

        if self.axes == "anchor":
            return Pose(origin, anchor.quaternion)
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
            place = _place(name, seen, where)
            poses[name] = Pose(place.position + shift, place.quaternion)

        return poses

    @property
    def guard(self) -> Guard | None:
        """The guard of the way there; None: there is none."""
        if not self.until:
            return None

        return Guard(self.until, self.newtons, self.otherwise)

    def dump(self) -> dict[str, Any]:
        """Return what was written, without what has its default."""
        written: dict[str, Any] = _STEPS.dump_python(
            self, mode="json", exclude_defaults=True
        )
        return written


_GUARD_FIELDS = ("until", "newtons", "otherwise", "corrects", "beyond")
_STEPS = TypeAdapter(Step)
# Of the schema, which takes longer to make than a tool takes to be read.
_PROPERTIES = _STEPS.json_schema()["properties"]


@dataclass(frozen=True)
class AnchoredPlan(ActionPlan):
    """A plan of steps.

    Attributes:
        steps: the waypoints as written.
        gripper: whether they move the gripper.
    """

    action: ClassVar[str] = "anchored"
    steps: tuple[Step, ...]
    gripper: bool = False

    def resolve(self, seen: Seen) -> Waypoints:
        """Place the steps in a layout, one after another: what a guard felt moves those that follow.

        Where it is not known yet what a guard feels, it ends at its waypoint.
        """
        rows: list[list[float]] = []
        known = seen
        felt = list(seen.felt)
        for number, step in enumerate(self.steps, start=1):
            where = f"waypoint {number}"
            pose = step.frame(known, where) @ Pose.xyz_rpy(step.offset, step.rpy)

            if step.until:
                reached = felt.pop(0) if felt else None
                poses = {**known.poses, HERE: reached or pose}
                if step.corrects:
                    way = pose.position - rows[-1][:3]
                    missed = poses[HERE].position - pose.position
                    corrected = step.corrected(
                        known,
                        way,
                        missed,
                        where,
                    )
                    if reached:
                        poses |= corrected

                known = Seen(poses)

            row = [*pose.position, *pose.rpy]
            if self.gripper:
                row.append(step.grip)

            rows.append(row)

        guards = tuple(step.guard for step in self.steps)
        if not any(guards):
            guards = ()

        return Waypoints(np.array(rows), self._tempo(), guards)

    def make_guards(self, planned: PlannedMotion) -> Guards:
        return PlannedGuards(planned)

    @property
    def anchors(self) -> tuple[Anchor, ...]:
        return tuple(
            Anchor(
                step.anchor,
                step.axes,
                step.toward,
                step.share,
            )
            for step in self.steps
        )

    @property
    def turns(self) -> Array:
        return np.array([step.rpy for step in self.steps])

    def _tempo(self) -> Tempo | None:
        """Return what the steps say of time; None: nothing."""
        steps = self.steps
        if not any(
            step.speed or step.seconds or step.through or step.wait for step in steps
        ):
            return None

        return Tempo(
            np.array([step.seconds or math.nan for step in steps]),
            np.array([step.speed or math.nan for step in steps]),
            np.array([step.through for step in steps]),
            np.array([step.wait for step in steps]),
        )

    def dump(self) -> list[Any]:
        return [step.dump() for step in self.steps]


class AnchoredActions(ActionRepresentation):
    """Objects with an anchor, an offset, an orientation, and tempo.

    Args:
        guards: the model is told that waypoints may have guards. They are read in any case.
    """

    def __init__(self, guards: bool = False) -> None:
        self.guards = guards

    def instructions(self, brief: Brief) -> str:
        scene = brief.task.scene(brief.scene_seed)
        names = ", ".join(f"`{body.name}`" for body in scene.bodies)
        return fill(
            "plugins.actions",
            "anchored",
            names=names,
            gripper=brief.gripper,
            guards=MAX_GUARDS if self.guards else 0,
        )

    def schema(self, *, gripper: bool) -> dict[str, Any]:
        left_out = set() if self.guards else {*_GUARD_FIELDS}
        if not gripper:
            left_out.add("grip")

        properties = {}
        for name, field in _PROPERTIES.items():
            if name not in left_out:
                properties[name] = _plain(field)

        waypoint = {
            "type": "object",
            "properties": properties,
            "required": ["offset"],
            "additionalProperties": False,
        }
        return {
            "type": "array",
            "items": waypoint,
            "minItems": 1,
        }

    def parse(self, data: object, *, gripper: bool) -> AnchoredPlan:
        if not isinstance(data, list):
            raise DesignError(
                f"an action plan must be a list of waypoints, not {kind(data)}"
            )

        if not 1 <= len(data) <= MAX_WAYPOINTS:
            raise DesignError(
                f"the action plan has {len(data)} waypoints; between 1 and {MAX_WAYPOINTS} are needed"
            )

        steps = []
        guards = 0
        for number, item in enumerate(data, start=1):
            step = _read_step(item, f"waypoint {number}", gripper)
            if HERE in (step.anchor, step.toward) and not guards:
                raise DesignError(
                    f"waypoint {number}: 'here' is where a guard ended; none comes before"
                )

            guards += bool(step.until)
            steps.append(step)

        if guards > MAX_GUARDS:
            raise DesignError(
                f"the action plan has {guards} guards; at most {MAX_GUARDS} are allowed"
            )

        if steps[0].corrects:
            raise DesignError(
                "waypoint 1: 'corrects' needs a waypoint before, from which the way leads there"
            )

        return AnchoredPlan(tuple(steps), gripper)

    def dump(self, waypoints: Waypoints) -> list[Any]:
        """Anchor them to the world; a tempo is left out."""
        return self.anchor(waypoints, [Anchor()] * len(waypoints), Seen({}))

    def anchor(
        self, waypoints: Waypoints, anchors: Sequence[Anchor], seen: Seen
    ) -> list[Any]:
        guards = waypoints.guards or (None,) * len(waypoints)
        rows = zip(
            waypoints.poses, waypoints.grips.tolist(), anchors, guards, strict=True
        )
        steps = []
        for number, (row, grip, anchor, guard) in enumerate(rows, start=1):
            where = f"waypoint {number}"
            pose = Pose.xyz_rpy(row[:3], row[3:6])
            written: dict[str, Any] = {
                "anchor": anchor.name,
                "axes": anchor.axes,
                "toward": anchor.toward,
                "share": anchor.share,
                "grip": grip,
            }
            if guard:
                written |= vars(guard)

            numbers = row[:6]

            if anchor != Anchor():
                frame = Step((0.0, 0.0, 0.0), **written).frame(seen, where)
                offset = frame.inverse() @ pose
                numbers = np.round([*offset.position, *offset.rpy], _DIGITS) + 0.0

            if guard:
                seen = Seen({**seen.poses, HERE: pose})

            place = numbers.tolist()
            written |= {"offset": place[:3], "rpy": place[3:]}

            try:
                step = Step(**written)
            except ValidationError as error:
                message = error.errors(include_url=False)[0]["msg"]
                raise DesignError(f"{where}: {message}") from error

            steps.append(step.dump())

        return steps

    def parameters(self, plan: ActionPlan) -> Numbers:
        """Return offsets and angles of all steps, and the logarithms of speeds, times and waits that are given."""
        if not isinstance(plan, AnchoredPlan):
            return Numbers()

        rows = np.array([[*step.offset, *step.rpy] for step in plan.steps])
        found = Numbers.near(rows, STEPS, MOST)
        for _, name, value in _tempi(plan):
            most = MAX_SPEED if name == "speed" else MAX_SECONDS
            limits = np.log([MIN_TEMPO, most])
            found += Numbers(
                np.log([value]), np.array([STEP_LOG]), limits[:1], limits[1:]
            )

        return found

    def with_parameters(self, plan: ActionPlan, values: Array) -> AnchoredPlan:
        assert isinstance(plan, AnchoredPlan)
        count = 6 * len(plan.steps)
        changes: list[dict[str, Any]] = []
        for offset, rpy in np.round(values[:count], _DIGITS).reshape(-1, 2, 3).tolist():
            changes.append({"offset": tuple(offset), "rpy": tuple(rpy)})

        tempi = np.exp(values[count:]).tolist()
        for (number, name, _), value in zip(_tempi(plan), tempi, strict=True):
            changes[number][name] = round(value, _DIGITS)

        changed = [
            replace(step, **change)
            for step, change in zip(plan.steps, changes, strict=True)
        ]
        return replace(plan, steps=tuple(changed))


def _tempi(plan: AnchoredPlan) -> list[tuple[int, str, float]]:
    """The speeds, times and waits of a plan that are above 0: number of the step, name, value."""
    found = []
    for number, step in enumerate(plan.steps):
        for name in ("speed", "seconds", "wait"):
            value = getattr(step, name)
            if value > MIN_TEMPO:
                found.append((number, name, value))

    return found


# What must not hold of a step, each with the words for the model.
_FAULTS: tuple[tuple[Callable[[Step], object], str], ...] = (
    (
        lambda step: step.speed and step.seconds,
        "give speed or seconds, not both",
    ),
    (
        lambda step: step.through and step.wait,
        "a waypoint that is passed through has no wait; leave one of them out",
    ),
    (
        lambda step: step.through and step.until,
        "a waypoint that is passed through has no guard; leave one of them out",
    ),
    (
        lambda step: (step.until == "force") != (step.newtons > 0),
        "until 'force' needs 'newtons' above 0, and nothing else has them",
    ),
    (
        lambda step: step.otherwise != "go_on" and not step.until,
        "'otherwise' is for a guard; give 'until', too",
    ),
    (
        lambda step: step.corrects and not step.until,
        "'corrects' is for a guard; give 'until', too",
    ),
    (
        lambda step: step.beyond and not step.corrects,
        "'beyond' is for what a guard corrects; give 'corrects', too",
    ),
    (
        lambda step: {WORLD, HERE} & {*step.corrects},
        f"'corrects' is for bodies and marks, not for '{WORLD}' or '{HERE}'",
    ),
    (
        lambda step: step.toward and step.axes == "anchor" and not step.share,
        "toward turns the world's axes; leave 'axes' out, or give a share of the way",
    ),
    (
        lambda step: step.share and not step.toward,
        "a share is one of the way to a second anchor; name it in 'toward'",
    ),
)


# Of a waypoint that says no other tempo.
_STANDS_STILL = {
    "speed": f"a speed of 0 never gets there; give {MIN_TEMPO:g} m/s or more, or leave 'speed' out for the usual one",
    "seconds": f"a time of 0 is none; give {MIN_TEMPO:g} s or more, or leave 'seconds' out for the usual one",
}


def _describe_fault(error: ValidationError, where: str) -> str:
    """Say what is wrong with a waypoint: a field that there is not, before what is missing; and how angles are written.

    Args:
        error: of its fields.
        where: words for the waypoint.
    """
    faults = error.errors(include_url=False)
    unknown = [fault for fault in faults if fault["type"] == _UNKNOWN]
    first = (unknown or faults)[0]
    place = ".".join(str(part) for part in first["loc"])

    if unknown:
        names = [known.name for known in fields(Step)]
        return str(choices("field", place, names, where))

    message = f"{where}: {place[:100]}: {first['msg']}"
    if first["loc"][0] == "rpy" and first["type"] in _BEYOND:
        message += (
            f", not {first['input']:g}; angles are in radians (90 degrees are 1.5708)"
        )

    return message


def _read_step(data: object, where: str, gripper: bool) -> Step:
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
        raise DesignError(f"{where}: 'grip' needs a tool on the gripper; leave it out")

    try:
        step = _STEPS.validate_python(data)
    except ValidationError as error:
        raise DesignError(_describe_fault(error, where)) from error

    if not (step.speed or step.seconds):
        for name, message in _STANDS_STILL.items():
            if name in data:
                raise DesignError(f"{where}: {message}")

    for is_broken, message in _FAULTS:
        if is_broken(step):
            raise DesignError(f"{where}: {message}")

    return step


def _place(name: str, seen: Seen, where: str) -> Pose:
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


def _plain(schema: dict[str, Any]) -> dict[str, Any]:
    """A field's schema in the words that all providers know: without titles, defaults and prefixes."""
    plain = dict(schema)
    for name in ("title", "default"):
        plain.pop(name, None)

    if plain.pop("prefixItems", None):
        plain["items"] = {"type": "number"}

    return plain
