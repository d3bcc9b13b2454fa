"""Say of the fields of designs which units and parts they have, and under which other names models write them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from plugins.replies.envelopes import plain_name
from plugins.replies.written_numbers import (
    ANGLES,
    FORCES,
    LENGTHS,
    MASSES,
    SPEEDS,
    TIMES,
    find_unit,
)

XYZ = ("x", "y", "z")
RPY = ("roll", "pitch", "yaw")

_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+|\d+")


@dataclass(frozen=True)
class Spelling:
    """How a field may be written.

    Attributes:
        units: by which its numbers may be followed.
        parts: the names of a vector's numbers; none: it is no vector, or they have no names.
        others: other names of the field, as `plain_name` gives them, with what a number under them is multiplied by.
    """

    units: Mapping[str, float] = field(default_factory=dict)
    parts: tuple[str, ...] = ()
    others: Mapping[str, float] = field(default_factory=dict)


def _named(words: str, factor: float = 1.0) -> dict[str, float]:
    return dict.fromkeys(words.split(), factor)


_PLACE = _named("position pos xyz translation location place origin center centre")
_TURN = _named("orientation rotation rot euler eulerangles rollpitchyaw angles")

SPELLINGS: Mapping[str, Spelling] = {
    # Of literal waypoints, whose place is in the world: an offset is none.
    "xyz": Spelling(LENGTHS, XYZ, _named("position pos translation location")),
    # Of anchored waypoints.
    "offset": Spelling(LENGTHS, XYZ, _PLACE | _named("relativeposition displacement")),
    "anchor": Spelling(others=_named("body relativeto reference anchorbody object")),
    "toward": Spelling(others=_named("towards towardbody directionto facing")),
    "axes": Spelling(others=_named("axis orientationframe axesof")),
    "speed": Spelling(SPEEDS, (), _named("velocity vel")),
    "seconds": Spelling(TIMES, (), _named("duration time")),
    "wait": Spelling(TIMES, (), _named("pause dwell waittime hold holdtime")),
    "through": Spelling(others=_named("passthrough flythrough via")),
    "grip": Spelling(others=_named("gripper gripperstate fingers")),
    "newtons": Spelling(FORCES, (), _named("force threshold")),
    "until": Spelling(others=_named("guard stopwhen stopon")),
    "otherwise": Spelling(others=_named("onmiss else")),
    "beyond": Spelling(LENGTHS),
    # Of components.
    "name": Spelling(others=_named("id componentname component label link")),
    "parent": Spelling(others=_named("parentlink parentname attachedto attachto")),
    "shape": Spelling(others=_named("type kind geometry primitive shapetype")),
    "size": Spelling(
        LENGTHS,
        XYZ,
        _named("dimensions dims sizes extents fullsize boxsize sidelengths")
        | _named("halfextents halfsize halfsizes halflengths", 2.0),
    ),
    "radius": Spelling(LENGTHS, (), _named("r") | _named("diameter d dia", 0.5)),
    "length": Spelling(LENGTHS, (), _named("len l")),
    "position": Spelling(LENGTHS, XYZ, _PLACE | _named("offset")),
    "mass": Spelling(MASSES, (), _named("weight")),
    "color": Spelling(others=_named("colour rgb rgba")),
    # Of joints; what they move decides on the units of a range.
    "kind": Spelling(others=_named("type jointtype")),
    "axis": Spelling(parts=XYZ, others=_named("direction")),
    "at": Spelling(LENGTHS, XYZ, _named("origin position point pivot")),
    "lower": Spelling(ANGLES | LENGTHS, (), _named("min minimum lowerlimit")),
    "upper": Spelling(ANGLES | LENGTHS, (), _named("max maximum upperlimit")),
    "rest": Spelling(ANGLES | LENGTHS),
    # Of both.
    "rpy": Spelling(ANGLES, RPY, _TURN),
}
"""By the name of a field in its JSON schema."""

_NONE = Spelling()

DESCRIBES = frozenset(
    _named(
        "purpose comment comments note notes description desc name label title reason rationale explanation role "
        "function phase stage step index id number waypoint material remark remarks motion details why"
    )
)
"""Names, as `plain_name` gives them, of what only describes where no field has that name."""

WORDS: Mapping[str, str] = {
    "cuboid": "box",
    "cube": "box",
    "block": "box",
    "rectangularprism": "box",
    "rectangle": "box",
    "ball": "sphere",
    "disc": "cylinder",
    "disk": "cylinder",
    "rod": "cylinder",
    "revolute": "hinge",
    "rotary": "hinge",
    "prismatic": "slider",
    "sliding": "slider",
    "contact": "touch",
    "touched": "touch",
    "continue": "go_on",
    "proceed": "go_on",
    "stop": "end",
    "abort": "end",
    "local": "anchor",
    "body": "anchor",
    "global": "world",
    "base": "world",
    "none": "",
    "null": "",
    "no": "",
}
"""Words that stand for a word of a field that has a few, as `plain_name` gives them."""


@dataclass(frozen=True)
class Named:
    """What a key means: a field, perhaps a part of its vector, the unit that the key says, and a factor."""

    name: str
    part: str = ""
    unit: str = ""
    factor: float = 1.0


def spelling_of(name: str) -> Spelling:
    """Return how a field may be written; of one that is not known, as it is asked for."""
    return SPELLINGS.get(name, _NONE)


def name_key(key: object, fields: Iterable[str]) -> Named | None:
    """Say which of some fields a key means; None: none, or not for certain.

    Args:
        key: what a model wrote, such as ``Position_mm``.
        fields: their names.
    """
    names = {plain_name(name): name for name in fields}
    plain = plain_name(key)
    if plain in names:
        return Named(names[plain])

    words = [word.lower() for word in _WORDS.findall(str(key))]
    for count in (0, 2, 1):
        unit = find_unit("/".join(words[len(words) - count :])) if count else ""
        if unit is None or count >= len(words):
            continue

        found = _name_word("".join(words[: len(words) - count]), unit, names)
        if found is not None:
            return found

    return None


def _name_word(word: str, unit: str, names: Mapping[str, str]) -> Named | None:
    """Say which field a word without its unit means; ``names`` has the fields by their plain names."""
    word = word.removesuffix("in") if unit else word
    if word in names:
        return Named(names[word], unit=unit)

    found = []
    for name in names.values():
        spelling = spelling_of(name)
        if word in spelling.others:
            found.append(Named(name, unit=unit, factor=spelling.others[word]))

    if len(found) == 1:
        return found[0]
    if found:
        return None

    for name in ("xyz", "offset", "position", "rpy"):
        if name in names.values() and word in spelling_of(name).parts:
            return Named(name, word, unit)

    return None
