"""Read and write tools as a JSON list of components, each placed in its mount's frame.

Representations differ in how a component's shape is written; the rest is here. Poses in the mount's frame leave no
chains of half lengths to a model.
"""

from __future__ import annotations

import json
import math
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, Field, Strict, create_model
from pydantic.dataclasses import dataclass

from core.design import Component, DesignError, Tool, ToolJoint
from core.designs.plan_rules import MAX_ANGLE_RAD
from core.designs.rules import (
    MAX_COMPONENTS,
    MAX_DENSITY,
    MAX_MOUNT_GAP_M,
    MIN_DENSITY,
    NAME,
    mount_solids,
)
from core.designs.schema import object_schema
from core.geometry import Array, Pose, Shape
from core.interfaces import Brief, JsonObject, Robot
from core.robot.description import assembled
from core.robot.solids import closest, solids_of
from core.support.inputs import FIELDS, check, in_unit, meant
from core.support.text import kind, shorten
from core.values.grips import FACES, GRIPS, MAX_AREA_MM2, MIN_AREA_MM2, Grip
from plugins.tools.mounting import first_box, instruct
from plugins.tools.refusals import ToolReason
from plugins.tools.varying import VariedTools

MAX_NUMBER = 1000.0
"""Far above every length, angle and mass of a tool; keeps products finite."""

DIGITS = 5
"""Of what is written, after the point: hundredths of a millimetre."""

_NO_TURN = [0, 0, 0]
_JOINT_NUMBERS = ("lower", "upper", "damping", "friction", "stiffness", "rest")

# In JSON schemas.
TEXT = {"type": "string"}
NUMBER = {"type": "number"}
TRIPLE = {"type": "array", "items": NUMBER, "minItems": 3, "maxItems": 3}

_FAR = "metres, radians and kilograms of a tool are far below"
_RADIANS = "angles are in radians, at most a full turn (90 degrees are 1.5708)"
Number = Annotated[
    float,
    Strict(),
    Field(ge=-MAX_NUMBER, le=MAX_NUMBER, allow_inf_nan=False),
    in_unit(_FAR),
]
Angle = Annotated[
    float,
    Strict(),
    Field(ge=-MAX_ANGLE_RAD, le=MAX_ANGLE_RAD, allow_inf_nan=False),
    in_unit(_RADIANS),
]
Triple = tuple[Number, Number, Number]
Turn = tuple[Angle, Angle, Angle]
HexColor = Annotated[
    str,
    Field(pattern="^#[0-9a-fA-F]{6}$"),
    meant('must be red, green and blue in hexadecimal, such as "#3373cc"'),
]


@dataclass(frozen=True, config=FIELDS)
class WrittenJoint:
    """A joint as it is written, with its axis and its place in the mount's frame."""

    kind: Literal["hinge", "slider"]
    axis: Triple
    at: Triple | None = None
    lower: Number = 0.0
    upper: Number = 0.0
    damping: Number = 0.0
    friction: Number = 0.0
    stiffness: Number = 0.0
    rest: Number = 0.0


@dataclass(frozen=True, config=FIELDS)
class WrittenGrip:
    """What a face of a component holds with, as it is written."""

    kind: Literal["suction", "magnet", "adhesive", "hook_and_loop"]
    face: Literal["front", "back", "left", "right", "top", "bottom"]
    area_mm2: Annotated[
        float, Strict(), Field(ge=MIN_AREA_MM2, le=MAX_AREA_MM2, allow_inf_nan=False)
    ]

    @property
    def grip(self) -> Grip:
        return GRIPS[self.kind](self.face, self.area_mm2)


class WrittenComponent(BaseModel):
    """A component as it is written, without what a representation writes of its shape."""

    model_config = FIELDS

    name: str
    parent: Annotated[str, Strict()] = ""
    position: Triple
    rpy: Turn = (0.0, 0.0, 0.0)
    mass: Number | None = None
    color: HexColor | None = None


@lru_cache(maxsize=16)
def _component_of(
    keys: tuple[str, ...], *, joints: bool, grips: bool
) -> type[WrittenComponent]:
    """Make the class of a component whose shape is written by these keys, with a joint or a grip or without."""
    fields: dict[str, Any] = dict.fromkeys(keys, (Any, None))
    if joints:
        fields["joint"] = (WrittenJoint | None, None)
    if grips:
        fields["grips"] = (WrittenGrip | None, None)
    return create_model("Component", __base__=WrittenComponent, **fields)


# Gets a component and words for its place; returns its shape, and the shape's pose in the frame that the component's
# position and rpy give.
ReadShape = Callable[[JsonObject, str], tuple[Shape, Pose]]


class ComponentTools(VariedTools):
    """A representation as one field, a list of components with their poses in the mount's frame.

    Subclasses say how a component's shape is written. With ``joints`` components may move against their parents, with
    ``grips`` hold on to what they touch.

    Attributes:
        field: the name of the list.
        keys: those of a component that say its shape.
        shape_schemas: the JSON schemas of these keys, one for each way to write a shape.
        template: of the instructions.
        limits: what else the template names.
    """

    field: str
    keys: tuple[str, ...]
    shape_schemas: tuple[JsonObject, ...]
    template: str
    limits: Mapping[str, Any] = MappingProxyType({})

    def __init__(self, joints: bool = False, grips: bool = False) -> None:
        self.joints = joints
        self.grips = grips

    @abstractmethod
    def example_shape(self, size: Array) -> JsonObject:
        """Write the shape of the example, which fills a box of this size (3,)."""

    @abstractmethod
    def readers(self) -> Iterable[ReadShape]:
        """Return what reads the shapes of one tool, for each pass over its components; the last makes them."""

    @abstractmethod
    def write_shape(self, shape: Shape, where: str) -> JsonObject:
        """Write a shape as `readers` read it."""

    def schema(self) -> JsonObject:
        items = []

        for shape in self.shape_schemas:
            properties = {
                "name": TEXT,
                "parent": TEXT,
                **shape,
                "position": TRIPLE,
                "rpy": TRIPLE,
                "mass": NUMBER,
                "color": TEXT,
            }

            if self.joints:
                properties["joint"] = {"anyOf": [{"type": "null"}, _JOINT]}
            if self.grips:
                properties["grips"] = {"anyOf": [{"type": "null"}, _GRIP]}

            items.append(object_schema(properties))

        item = items[0]
        if len(items) > 1:
            item = {"anyOf": items}

        return {self.field: {"type": "array", "items": item}}

    def instructions(self, brief: Brief) -> str:
        box = first_box(brief)
        example = {
            "name": box.name,
            "parent": box.mount,
            **self.example_shape(box.size),
            "position": rounded(box.place),
            "rpy": [0, 0, 0],
            "mass": 0.005,
            "color": "#3373cc",
        }

        return instruct(
            self.template,
            brief,
            self.material,
            field=self.field,
            joints=self.joints,
            grips=GRIPS.values() if self.grips and not brief.gripper else (),
            example=json.dumps([example]),
            **self.limits,
        )

    def parse(self, data: Mapping[str, Any], *, gripper: bool) -> Tool:
        """Read a tool; components may come in any order.

        Args:
            data: the fields of a design.
            gripper: whether the tool hangs from the fingers.

        Raises:
            DesignError: says what is wrong, where, and how to mend it.
        """
        if self.field not in data:
            wanted = "a list of the tool's components"
            raise DesignError.because(
                ToolReason.FIELD_MISSING, field=self.field, wanted=wanted
            )

        items = data[self.field]
        if not isinstance(items, list):
            raise DesignError.because(
                ToolReason.FIELD_LIST, field=self.field, given=kind(items)
            )

        if len(items) > MAX_COMPONENTS:
            raise DesignError.because(
                ToolReason.FIELD_COUNT,
                field=self.field,
                count=len(items),
                most=MAX_COMPONENTS,
            )

        tool = Tool(gripper=gripper)
        for read_shape in self.readers():
            tool = Tool(tuple(self._read(items, read_shape, tool.mounts)), gripper)

        return tool

    def _read(
        self,
        items: list[Any],
        read_shape: ReadShape,
        mounts: tuple[str, ...],
    ) -> Iterator[Component]:
        """Yield components after their parents, each with its pose in its parent's frame."""
        read: dict[str, Component] = {}  # with their poses in the mount's frame
        reserved = robot_names(self.robot)

        for number, item in enumerate(items, start=1):
            where = f"{self.field}: component {number}"
            name = _read_name(item, where, read, reserved)
            component = self._read_component(name, item, read_shape, mounts)
            if not component.parent:
                parent = self._find_parent(component, read, mounts[0])
                component = replace(component, parent=parent)

            read[name] = component

        placed = {mount: Pose() for mount in mounts}
        parents = {name: component.parent for name, component in read.items()}

        for name in parents_first(parents, mounts, "component"):
            component = read[name]
            placed[name] = component.pose
            pose = placed[component.parent].inverse() @ component.pose
            yield replace(component, pose=pose)

    def _read_component(
        self,
        name: str,
        item: JsonObject,
        read_shape: ReadShape,
        mounts: tuple[str, ...],
    ) -> Component:
        """Read a component, with its pose in the mount's frame; its parent is empty where none is written.

        Args:
            name: of the component, which was read already.
            item: what a model wrote.
            read_shape: reads its shape.
            mounts: what the tool may hang from.
        """
        where = f"component {name!r}"
        kind_of = _component_of(self.keys, joints=self.joints, grips=self.grips)
        written = check(kind_of, item, where, DesignError)
        if not written.parent and len(mounts) > 1:
            raise DesignError.because(
                ToolReason.PARENT_MISSING, where=where, mounts=" or ".join(mounts)
            )

        parent = dict(self.robot.aliases).get(written.parent, written.parent)
        shape, place = read_shape(item, where)
        pose = Pose.xyz_rpy(written.position, written.rpy) @ place
        mass = written.mass
        if mass is None:
            mass = default_mass(shape.volume)

        color = Component.color
        if written.color is not None:
            red, green, blue = bytes.fromhex(written.color[1:])
            color = (red / 255, green / 255, blue / 255, 1.0)

        joint = _make_joint(
            getattr(written, "joint", None), f"{where}: its joint", pose
        )
        grips: WrittenGrip | None = getattr(written, "grips", None)
        holds = None if grips is None else grips.grip
        return Component(name, parent, pose, shape, mass, color, joint, holds)

    def _find_parent(
        self, component: Component, before: Mapping[str, Component], mount: str
    ) -> str:
        """Find what a component without a parent hangs from: the mount if it touches that, else what it is closest to.

        Args:
            component: with its pose in the mount's frame.
            before: what stands before it in the list, likewise.
            mount: the only one.
        """
        there = solids_of(component.name, component.shape, component.pose)
        flange = mount_solids(Tool(), self.robot)[mount]
        gap, _, _ = closest(there, flange)
        if not before or gap <= MAX_MOUNT_GAP_M:
            return mount

        gaps = {}
        for name, other in before.items():
            gaps[name], _, _ = closest(there, solids_of(name, other.shape, other.pose))

        return min(gaps, key=gaps.__getitem__)

    def dump(self, tool: Tool) -> JsonObject:
        placed = tool.placed()
        items = [
            self._write(component, placed[component.name][1])
            for component in tool.components
        ]

        return {self.field: items}

    def _write(self, component: Component, pose: Pose) -> JsonObject:
        """Write a component at a pose in the mount's frame."""
        shares = component.color[:3]
        item = {
            "name": component.name,
            "parent": component.parent,
            **self.write_shape(component.shape, f"component {component.name!r}"),
            "position": rounded(pose.position),
            "rpy": rounded_rpy(pose),
            "mass": float(f"{component.mass:.6g}"),
            "color": "#" + "".join(f"{round(255 * share):02x}" for share in shares),
        }

        if self.joints:
            item["joint"] = _write_joint(component.joint, pose)
        if self.grips:
            item["grips"] = _write_grip(component.grips)

        return item

    def abridge(self, tool: Tool) -> JsonObject:
        """Write the tool without colours and what is added when it is read, to 0.1 mm."""
        return {self.field: [_abridge(item) for item in self.dump(tool)[self.field]]}


def _abridge(item: JsonObject) -> JsonObject:
    """Write a component in short: without its colour, and what is as usual."""
    short = {}

    for key, value in item.items():
        if key == "color" or value in (_NO_TURN, "box"):
            continue

        short[key] = value
        if isinstance(value, list):
            short[key] = [round(number, 4) for number in value]

    return short


_JOINT = object_schema(
    {
        "kind": TEXT | {"enum": ["hinge", "slider"]},
        "axis": TRIPLE,
        "at": TRIPLE,
        **dict.fromkeys(_JOINT_NUMBERS, NUMBER),
    }
)


_GRIP = object_schema(
    {
        "kind": TEXT | {"enum": [*GRIPS]},
        "face": TEXT | {"enum": [*FACES]},
        "area_mm2": NUMBER,
    }
)


def _write_grip(grips: Grip | None) -> JsonObject | None:
    """Write what a component holds with; None: nothing."""
    if grips is None:
        return None
    return {"kind": grips.kind, "face": grips.face, "area_mm2": grips.area_mm2}


def default_mass(volume: float) -> float:
    """Return the mass, kg, of what has none written: the usual one, or the nearest of a possible density."""
    return min(max(Component.mass, MIN_DENSITY * volume), MAX_DENSITY * volume)


def parents_first(
    parents: Mapping[str, str],
    mounts: tuple[str, ...],
    what: str,
) -> Iterator[str]:
    """Yield names so that parents come before their children.

    Args:
        parents: the parent's name by name.
        mounts: what stands at the beginning.
        what: what has these names, for an error.

    Raises:
        DesignError: parents do not lead to a mount.
    """
    done = set(mounts)

    for start in parents:
        chain: list[str] = []
        name = start

        while name not in done:
            if name in chain:
                raise DesignError.because(
                    ToolReason.PARENT_CIRCLE, name=name, mounts=" or ".join(mounts)
                )

            if name not in parents:
                raise DesignError.because(
                    ToolReason.PARENT_UNKNOWN,
                    what=what,
                    name=chain[-1],
                    parent=shorten(name),
                    mounts=" or ".join(mounts),
                )

            chain.append(name)
            name = parents[name]

        done.update(chain)
        yield from reversed(chain)


@lru_cache(maxsize=8)
def robot_names(robot: Robot) -> frozenset[str]:
    """Collect the names of the robot's links and joints, with and without its gripper, and of its mounts."""
    names = {*Tool().mounts, *Tool(gripper=True).mounts, *dict(robot.aliases)}

    for gripper in {False, robot.gripper is not None}:
        arm = assembled(robot, Tool(gripper=gripper))
        names.update(arm.links, arm.named)

    return frozenset(names)


def _make_joint(
    written: WrittenJoint | None,
    where: str,
    pose: Pose,
) -> ToolJoint | None:
    """Make the joint of a component at this pose in the frame of its mount.

    Axis and place are written in the mount's frame; what is returned has them in the component's.
    """
    if written is None:
        return None

    turned = tuple(pose.rotation.inv().apply(written.axis))
    origin = (0.0, 0.0, 0.0)
    if written.kind == "hinge":
        place = pose.position if written.at is None else np.array(written.at)
        origin = tuple(pose.inverse().apply(place).tolist())

    numbers = {name: getattr(written, name) for name in _JOINT_NUMBERS}
    try:
        return ToolJoint(written.kind, turned, origin=origin, **numbers)
    except DesignError as error:
        raise error.placed(f"{where}: ") from error


def _write_joint(joint: ToolJoint | None, pose: Pose) -> JsonObject | None:
    """Write the joint of a component at this pose in the frame of its mount."""
    if joint is None:
        return None

    axis = pose.rotation.apply(joint.axis)
    at = rounded(pose.apply(joint.origin))
    numbers = {name: float(f"{getattr(joint, name):.6g}") for name in _JOINT_NUMBERS}
    # Written as 1, so that what is read again is written the same.
    longest = float(abs(axis).max())

    return {"kind": joint.kind, "axis": rounded(axis / longest), "at": at, **numbers}


def rounded(values: Iterable[float]) -> list[float]:
    """Round numbers to `DIGITS`, and write whole ones without a point."""
    numbers = [round(float(value), DIGITS) + 0.0 for value in values]

    return [
        int(number) if number.is_integer() else number  # a whole one as 1, not 1.0
        for number in numbers
    ]


def rounded_rpy(pose: Pose) -> list[float]:
    """Round a pose's roll, pitch and yaw so that they are found again when they are read.

    Where the pitch is a right angle to the last digit, only roll less yaw (or plus yaw) counts, and yaw becomes 0.
    """
    roll, pitch, yaw = (float(angle) for angle in pose.rpy)
    if round(abs(pitch), DIGITS) >= 1.57079:
        way = math.copysign(1.0, pitch)
        roll = math.remainder(roll - way * yaw, math.tau)
        pitch = way * math.pi / 2
        yaw = 0.0

    return rounded((roll, pitch, yaw))


def _read_name(
    item: object,
    where: str,
    taken: Mapping[str, object],
    reserved: frozenset[str],
) -> str:
    """Read the name of a component, which neither the tool nor the robot has already."""
    if not isinstance(item, Mapping):
        raise DesignError.because(
            ToolReason.COMPONENT_OBJECT, where=where, given=kind(item)
        )

    name = item.get("name")
    if not isinstance(name, str):
        raise DesignError.because(ToolReason.NAME_MISSING, where=where)

    if not NAME.fullmatch(name):
        raise DesignError.because(
            ToolReason.NAME_LETTERS, where=where, name=shorten(name)
        )

    if name in reserved:
        raise DesignError.because(ToolReason.NAME_OF_ROBOT, where=where, name=name)

    if name in taken:
        raise DesignError.because(ToolReason.NAME_TAKEN, name=name)

    return name
