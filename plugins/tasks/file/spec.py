"""What a scene file may say, and one line for what it may not.

A number's unit is that of `core.scene`: metres, kilograms, seconds, radians; degrees only where a key ends in ``_deg``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields, replace
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, get_type_hints

import numpy as np
import yaml
from PIL import ImageColor
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetPydanticSchema,
    create_model,
)
from pydantic import model_validator as check_whole
from pydantic_core import core_schema

from core.errors import WrongPart
from core.geometry import KINDS, PRIMITIVES, Primitive
from core.goals import AboveZero, Key, Reach
from core.scene import Bond, Camera, Cloth, Color, Elastic, Joint, Rope
from core.support.inputs import STRICT, in_unit
from core.values.layouts import NONE
from core.values.softs import MAX_NODES
from plugins.tasks.file.goals import ALL_KINDS, Entry, read_entry
from plugins.tasks.file.hollows import COLUMN_M
from plugins.tasks.file.imports import imported as limits
from plugins.tasks.file.refusals import SceneReason
from plugins.tasks.file.varied_numbers import Varied
from plugins.tasks.file.vessels import Vessel

MAX_BODIES = 100
MAX_PARTS = 100
MAX_COPIES = 200  # of all bodies together, too
MAX_IMPORTS = 20
MAX_GOALS = 50
MAX_RANGES = 200
MAX_VARIATIONS = 20
MAX_PHOTOS = 8
# Keys of rigid bodies alone, and of soft ones.
_RIGID = (
    "parts",
    "friction",
    "rolling_friction",
    "restitution",
    "velocity",
    "spin",
    "breaks_n",
    "smooth",
    "magnetic",
    "loops",
)
_SOFT = ("rope", "cloth", "counts", "pinned")
SHAPES = (*PRIMITIVES, "tube", "cup", "mug", "bottle")

_METRES = in_unit("it is in metres")
Length = Annotated[float, Field(gt=limits.SHORTEST_M, le=limits.LONGEST_M), _METRES]
Gap = Annotated[float, Field(ge=0, le=limits.LONGEST_M), _METRES]
Coordinate = Annotated[float, Field(ge=-limits.LONGEST_M, le=limits.LONGEST_M), _METRES]
Place = tuple[Coordinate, Coordinate, Coordinate]
Angle = Annotated[float, Field(ge=-3600, le=3600)]
Turn = tuple[Angle, Angle, Angle]
Rate = Annotated[float, Field(ge=-100, le=100)]
Rates = tuple[Rate, Rate, Rate]
Name = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_-]{0,59}$")]
FileName = Annotated[str, Field(min_length=1, max_length=200)]
Fov = Annotated[float, Field(ge=1, le=170)]
Range = tuple[float, ...]
"""The lowest and the highest; or three or more values, one for a layout, drawn together with those of other numbers."""

Count = Annotated[int, Field(ge=1, le=MAX_COPIES)]
Friction = Annotated[float, Field(ge=0, le=limits.MAX_FRICTION)]
Path = Annotated[tuple[Place, ...], Field(min_length=2, max_length=MAX_NODES)]


def _color(text: str) -> str:
    """Refuse a text that names no colour."""
    try:
        ImageColor.getrgb(text)
    except ValueError:
        raise ValueError(
            "must be a colour such as red, seagreen or '#3366cc'"
        ) from None

    return text


ColorName = Annotated[str, AfterValidator(_color)]


def rgba(color: str) -> Color:
    """Read a colour such as ``red`` or ``#3366cc``; four numbers from 0 to 1."""
    channels = (*ImageColor.getrgb(color), 255)  # the last is for want of an opacity
    return tuple(channel / 255 for channel in channels[:4])


def _read_with(model: type[BaseModel], make: Callable[[Any], Any]) -> GetPydanticSchema:
    """Check what a file says with a model, and ``make`` something of that."""

    def build(_source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_after_validator_function(make, handler(model))

    return GetPydanticSchema(build)


def _read_dataclass(
    kind: type, without: Sequence[str] = (), **types: Any
) -> GetPydanticSchema:
    """Read a dataclass by its fields, of these ``types`` where given, ``without`` some; it checks itself."""
    hints = get_type_hints(kind) | types
    entries = dict[str, Any]()
    for field in fields(kind):
        if not field.init or field.name in without:
            continue

        default = field.default
        if default is MISSING:
            default = ...

        entries[field.name] = (hints[field.name], default)

    def make(spec: BaseModel) -> Any:
        return kind(**{name: getattr(spec, name) for name in entries})

    model = create_model(kind.__name__, __config__=STRICT, **entries)
    return _read_with(model, make)


def _read_round(kind: type, *without: str) -> GetPydanticSchema:
    """Read a shape whose fields are lengths, but those it is ``without``."""
    lengths = {field.name: Length for field in fields(kind)}
    return _read_dataclass(kind, without, **lengths)


def _read_primitive(kind: type[Primitive]) -> Any:
    """Read a kind of shape by its lengths; where it has one only, that length may stand for it."""
    lengths = kind.lengths()
    name, *others = lengths
    if others:
        return Annotated[kind, _read_round(kind)]

    count = lengths[name]
    if count > 1:
        listed: Any = tuple[(Length,) * count]  # type: ignore[misc]
        return Annotated[listed, AfterValidator(kind)]

    def read(given: Any) -> Any:
        return {name: given} if isinstance(given, int | float) else given

    spec: Any = Annotated[kind, _read_round(kind)]
    alone = BeforeValidator(read, json_schema_input_type=float | spec)
    return Annotated[spec, alone]


def _goal_entry() -> GetPydanticSchema:
    """Read an entry of ``goals``: it has the keys of all kinds of goals, and those that are given say which it is."""
    keys = dict(Reach.keys)
    for kind in ALL_KINDS:
        keys |= kind.keys

    more = [kind.keys for kind in ALL_KINDS if issubclass(kind, Reach)]
    also = {key: said for found in more for key, said in found.items()}
    for key in Reach.keys:
        del also[key]

    part: Any = _goal_model("Also", also)
    keys["also"] = replace(keys["also"], type=tuple[part, ...])
    return _read_with(_goal_model("Goal", keys), lambda spec: read_entry(_given(spec)))


def _goal_model(name: str, keys: Mapping[str, Key]) -> type[BaseModel]:
    """Make a model of an object with keys of goals, each of which may be left out."""
    entries: dict[str, Any] = {
        key: (said.type | None, Field(None, description=said.means))
        for key, said in keys.items()
    }
    return create_model(name, __config__=STRICT, **entries)


def _given(spec: BaseModel) -> dict[str, Any]:
    """Return what an object says of a goal."""
    given = {key: value for key, value in spec if value is not None}
    if "also" in given:
        given["also"] = tuple(map(_given, given["also"]))

    return given


def _looks(camera: Camera) -> Camera:
    """Refuse a camera that looks nowhere."""
    if np.allclose(camera.position, camera.target, atol=1e-3):
        raise ValueError(
            "the camera's position and target are one point; move one of them"
        )

    return camera


def _perspective(camera: Camera | None) -> Camera | None:
    """Refuse a photograph's camera that is not in perspective."""
    if camera is not None and camera.height_m is not None:
        raise ValueError(
            "a photograph is in perspective; give fov_deg in place of height_m"
        )

    return camera


def _named(variations: dict[str, Any]) -> dict[str, Any]:
    """Refuse a variation whose name stands for none, or whose numbers have unlike many values."""
    if NONE in variations:
        raise ValueError(f"the variation {NONE!r} draws nothing; give it another name")

    for name, ranges in variations.items():
        lists = {path: v for path, v in ranges.items() if isinstance(v, tuple)}
        sets = {path: len(v) for path, v in lists.items() if len(v) > 2}
        if len(set(sets.values())) > 1:
            fewest = min(sets, key=sets.__getitem__)
            raise ValueError(
                f"in the variation {name!r}, {fewest} has {sets[fewest]} values, and others have "
                f"{max(sets.values())}; what is drawn together needs as many values each"
            )

    return variations


class _Spec(BaseModel):
    """A part of a scene file: no other keys than its own, and numbers that are numbers."""

    # Only here: Pydantic reads docstrings in a model's source, and models made by `create_model` have none.
    model_config = ConfigDict(**STRICT, use_attribute_docstrings=True)


NECK = ("neck", "neck_length")
TubeSpec = Annotated[Vessel, _read_round(Vessel, *NECK, "handle", "floor")]
CupSpec = Annotated[Vessel, _read_round(Vessel, *NECK, "handle")]
MugSpec = Annotated[Vessel, _read_round(Vessel, *NECK)]
BottleSpec = Annotated[Vessel, _read_round(Vessel, "handle")]


class _Primitives(_Spec):
    """A part that may have a shape of a few lengths, under a key of its kind."""

    @property
    def primitive(self) -> Primitive | None:
        """The first that is given."""
        given = [getattr(self, kind, None) for kind in PRIMITIVES]
        return next((shape for shape in given if shape is not None), None)


def _add_keys(*kinds: str) -> type[_Primitives]:
    """Make a model with the keys of kinds of shapes."""
    entries: dict[str, Any] = {
        kind: (_read_primitive(PRIMITIVES[kind]) | None, None) for kind in kinds
    }
    return create_model("Primitives", __base__=_Primitives, **entries)


if TYPE_CHECKING:  # Mypy reads no models that are made at runtime
    _Shaped = _Primitives
    _Space = _Primitives
else:
    _Shaped = _add_keys(*PRIMITIVES)
    _Space = _add_keys("box", "cylinder", "sphere")


class ShapeSpec(_Shaped):
    """One shape, and where it is in the body's frame. ``file`` is for a body of its own."""

    tube: TubeSpec | None = None
    cup: CupSpec | None = None
    mug: MugSpec | None = None
    bottle: BottleSpec | None = None
    position: Place = (0.0, 0.0, 0.0)
    rpy_deg: Turn = (0.0, 0.0, 0.0)
    color: ColorName | None = None

    @check_whole(mode="after")
    def _one_shape(self) -> Self:
        self._check_one(*SHAPES)
        return self

    def _check_one(self, *names: str) -> None:
        """Refuse a part that has none or several of these keys."""
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) == 1:
            return

        there = "is none"
        if given:
            there = f"are {', '.join(given)}"

        raise WrongPart.because(
            SceneReason.ONE_OF, possible=", ".join(names), found=there
        )


class RepeatSpec(_Spec):
    """Equal bodies, of which the one that is described is the first: in a grid, a ring, or a heap."""

    grid: tuple[Count, Count, Count] | None = None
    """How many along x, y and z; the position is that of the lowest of them."""
    ring: Count | None = None
    """How many on a circle around the position, each turned along."""
    heap: Count | None = None
    """How many in layers, as many in each as lie within the radius around the position."""
    radius: Length | None = None
    """Of the circle on which their middles are, or within which, m."""
    spacing: Length | tuple[Gap, Gap, Gap] | None = None
    """From one middle to the next, m; if left out they nearly touch. Where a grid has one only it may be 0."""

    @check_whole(mode="after")
    def _one_way(self) -> Self:
        given = [key for key in ("grid", "ring", "heap") if getattr(self, key)]
        if len(given) != 1:
            raise ValueError("needs one of grid, ring, heap")
        if (self.radius is None) != (given == ["grid"]):
            raise ValueError("a ring and a heap need a radius, and a grid has none")

        numbers = self.grid or (2, 2, 2)
        spacing = self.spacing if isinstance(self.spacing, tuple) else ()
        for axis, gap, number in zip("xyz", spacing, numbers, strict=False):
            if number > 1 and gap < limits.SHORTEST_M:
                raise ValueError(f"needs a spacing above 0 along {axis}")

        return self


class BodySpec(ShapeSpec):
    """A body: one shape, several ``parts``, or what a file holds; its mass, its density, or ``fixed``.

    What is ``elastic`` is soft: a rope, a cloth, or a solid that fills the convex hull of its shape. Its pose is in the
    frame of the body or mark ``at``, which the file has before it; else in the world.
    """

    name: Name
    at: Name | None = None
    repeat: RepeatSpec | None = None
    parts: (
        Annotated[tuple[ShapeSpec, ...], Field(min_length=1, max_length=MAX_PARTS)]
        | None
    ) = None
    file: FileName | None = None
    scale: Length = 1.0
    rope: Annotated[Rope, _read_dataclass(Rope, path=Path, thickness=Length)] | None = (
        None
    )
    cloth: (
        Annotated[
            Cloth, _read_dataclass(Cloth, size=tuple[Length, Length], thickness=Length)
        ]
        | None
    ) = None
    elastic: Annotated[Elastic, _read_dataclass(Elastic)] | None = None
    counts: tuple[int, int, int] = (3, 3, 3)
    pinned: Annotated[tuple[int, ...], Field(max_length=MAX_NODES)] = ()
    mass: Annotated[float, Field(ge=limits.LIGHTEST, le=limits.HEAVIEST)] | None = None
    density: Annotated[float, Field(ge=1, le=3e4)] | None = None
    fixed: bool | None = None
    friction: Friction = 0.5
    rolling_friction: Annotated[float, Field(ge=0, le=1)] = 0.0
    restitution: Annotated[float, Field(ge=0, le=1)] = 0.0
    velocity: Rates = (0.0, 0.0, 0.0)
    spin: Rates = (0.0, 0.0, 0.0)
    breaks_n: AboveZero | None = None
    smooth: bool = False
    magnetic: bool = False
    loops: bool = False

    @check_whole(mode="after")
    def _one_shape(self) -> Self:
        self._check_one(*SHAPES, "parts", "file", "rope", "cloth")
        if self.fixed is False:
            raise ValueError(
                "fixed: false says nothing; leave it out, and give a mass or a density"
            )

        self._check_one("mass", "density", "fixed", "elastic")
        self._check_softness()

        if "counts" in self.model_fields_set and (self.rope or self.cloth):
            raise ValueError(
                "counts is for a soft solid; a rope has a count, and a cloth counts, of its own"
            )

        if self.scale != 1 and self.file is None:
            raise ValueError("scale is for a body with a file")

        return self

    def _check_softness(self) -> None:
        """Refuse a key that is for soft bodies in a rigid one, or the other way."""
        wrong: tuple[str, ...] = _SOFT
        hint = "a soft body; give it elastic: {density: 300, young: 1.0e5}"
        if self.elastic:
            wrong = _RIGID
            hint = (
                "a rigid body; leave it out (the friction of a soft one is in elastic)"
            )

        for name in wrong:
            if name in self.model_fields_set:
                raise ValueError(f"{name} is for {hint}")


class ImportSpec(_Spec):
    """The bodies and joints of a URDF or MJCF file.

    A URDF's root is ``fixed`` to the world, or not; of MJCF what has no joint is.
    """

    file: FileName
    at: Name | None = None
    prefix: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{0,30}$")] = ""
    position: Place = (0.0, 0.0, 0.0)
    rpy_deg: Turn = (0.0, 0.0, 0.0)
    fixed: bool = True
    without: tuple[FileName, ...] = ()
    """Bodies, by name or pattern, that are left out with all that hangs from them; and meshes, as a URDF names them."""

    density: Annotated[float, Field(ge=1, le=2.3e4)] | None = None
    """kg/m^3 of what moves and has no mass in a URDF; osmium, the densest, has 22,600."""


class MarkSpec(_Space):
    """A mark that nothing touches: flat and round, or with a shape, whose space bodies can be ``inside``."""

    name: Name
    at: Name | None = None
    position: Place
    rpy_deg: Turn = (0.0, 0.0, 0.0)
    radius: Length = 0.05
    height: Length = COLUMN_M
    """How high above a flat one is still inside it, m."""
    color: ColorName = "royalblue"


class GroundSpec(_Spec):
    """The ground: where it ends, and what stands there."""

    size: tuple[Length, Length] | None = None
    """Along x and y, m, around the robot's base; if left out it does not end."""
    wall: Length | None = None
    """How high a wall stands around it, m."""
    friction: Friction = 0.5

    @check_whole(mode="after")
    def _walled(self) -> Self:
        if self.wall is not None and self.size is None:
            raise ValueError("a wall needs a size, where it stands")
        return self


class RegionSpec(_Spec):
    """The box in which a designed fixture may stand, along the world's axes."""

    box: tuple[Length, Length, Length]
    position: Place
    """Of its middle."""


CameraSpec = Annotated[
    Camera,
    _read_dataclass(
        Camera, position=Place, target=Place, fov_deg=Fov, height_m=Length | None
    ),
    AfterValidator(_looks),
]


class HomeSpec(_Spec):
    """The end-effector's pose at the start."""

    position: Place = (0.5, 0.0, 0.5)
    rpy_deg: Turn = (0.0, 0.0, 0.0)


class PhotoSpec(_Spec):
    """A photograph of one's own bench, in the scene file's folder."""

    file: Annotated[str, Field(min_length=1, max_length=200)]
    camera: Annotated[CameraSpec | None, AfterValidator(_perspective)] = None


class SceneSpec(_Spec):
    """A scene file."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,59}$")]
    description: Annotated[str, Field(min_length=20, max_length=4000)]
    in_words: Annotated[str, Field(max_length=4000)] = ""
    table: bool = True
    floor: bool = True
    ground: GroundSpec = GroundSpec()
    floor_height: Coordinate = -0.625
    gravity: Rates = (0.0, 0.0, -9.81)
    """m/s^2, along the world's axes."""
    tool_kinds: tuple[Literal["rigid", "gripper"], ...] = ()
    """What a tool may hang from, as `tool_kinds` of the configuration; empty: as there."""
    fixture: RegionSpec | None = None
    """Where a design may add a fixture, which no plan moves; if left out it can't."""
    tool_in_place: bool = False
    """Whether the tool waits on site, so that it may start where nothing could have brought it."""
    payload_kg: Annotated[float, Field(gt=0, le=100)] | None = None
    """The most that a tool may weigh, if that is less than what the arm carries."""
    colors: dict[str, ColorName] = {}
    """Colours of bodies by name or pattern, such as ``"grain*"``."""
    bodies: Annotated[tuple[BodySpec, ...], Field(max_length=MAX_COPIES)] = ()
    imports: Annotated[tuple[ImportSpec, ...], Field(max_length=MAX_IMPORTS)] = ()
    marks: Annotated[tuple[MarkSpec, ...], Field(max_length=MAX_BODIES)] = ()
    joints: Annotated[
        tuple[
            Annotated[
                Joint, _read_dataclass(Joint, name=Name, axis=Place, origin=Place)
            ],
            ...,
        ],
        Field(max_length=MAX_BODIES),
    ] = ()
    bonds: Annotated[
        tuple[Annotated[Bond, _read_dataclass(Bond, name=Name, origin=Place)], ...],
        Field(max_length=MAX_BODIES),
    ] = ()
    goals: Annotated[
        tuple[Annotated[Entry, _goal_entry()], ...],
        Field(min_length=1, max_length=MAX_GOALS),
    ]
    every: bool = False
    hold_s: Annotated[float, Field(ge=0, le=60)] = 0.0
    noise_m: Annotated[float, Field(ge=0, le=1)] = 0.0
    success_reward: Annotated[float, Field(gt=0, le=1)] = 1.0
    home: HomeSpec = HomeSpec()
    camera: CameraSpec = Camera()
    pictures: Annotated[tuple[PhotoSpec, ...], Field(max_length=MAX_PHOTOS)] = ()
    variations: Annotated[
        dict[
            Name,
            Annotated[dict[str, Varied], Field(min_length=1, max_length=MAX_RANGES)],
        ],
        Field(max_length=MAX_VARIATIONS),
        AfterValidator(_named),
    ] = {}

    @check_whole(mode="after")
    def _no_idle_ground(self) -> Self:
        """Refuse what says something of ground that is not there."""
        idle = {"ground", "floor_height"} & self.model_fields_set
        if idle and not self.floor:
            raise ValueError(
                f"{min(idle)} says nothing where floor is false; leave one of the two out"
            )
        return self


def name_pictures(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """Write a name among the pictures of a scene file's ``data`` as a photograph without its camera."""
    pictures = data.get("pictures")
    if not isinstance(pictures, list):
        return data

    named = [{"file": given} if isinstance(given, str) else given for given in pictures]
    return {**data, "pictures": named}


@cache
def json_schema() -> dict[str, Any]:
    """Describe what a scene file may say as a JSON Schema, for editors and for models; ``keys.yaml`` has the words."""
    dialect = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    schema = SceneSpec.model_json_schema()
    pictures = schema["properties"]["pictures"]
    pictures["items"] = {"anyOf": [{"type": "string"}, pictures["items"]]}

    del schema["$defs"]["Also"]  # a model is told the keys of goals once
    also = schema["$defs"]["Goal"]["properties"]["also"]["anyOf"][0]
    also["items"] = {"$ref": "#/$defs/Goal"}

    text = (files(__package__) / "keys.yaml").read_text("utf-8")
    words: dict[str, str] = yaml.safe_load(text)
    for primitive in KINDS:
        words[primitive.kind] = primitive.means
        words |= {f"{primitive.__name__}.{key}": "m" for key in primitive.lengths()}

    for kind in (schema, *schema["$defs"].values()):
        for key, found in kind["properties"].items():
            if "description" not in found:
                special = words.get(f"{kind['title']}.{key}")
                found["description"] = special or words[key]

    return dialect | schema
