"""Define the blocks of anchored plans: looks, loops and choices by what can be seen, and how they are read.

A plan is a tree: its leaves are waypoints and looks. What it can cost is known from the tree alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass as plain
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, Strict, TypeAdapter
from pydantic.dataclasses import dataclass

from core.design import DesignError
from core.designs.plan_rules import MAX_REACH_M, MAX_WAYPOINTS
from core.designs.schema import object_schema
from core.errors import refuse
from core.geometry import Array
from core.interfaces import JsonObject
from core.support.inputs import FIELDS, check, meant
from core.support.text import count_words, kind
from plugins.actions.steps import HERE, IT, Angle, Name, Step, read_step

MAX_ROUNDS = 8
"""The most rounds of a loop, and the most bodies of a block for each of them."""

MAX_DEPTH = 2
"""How many blocks may stand within one another."""

MAX_LOOKS = 40
"""The most looks that a plan may come to, with all rounds of its loops."""

MAX_MEANT = 10
"""The most looks of which a condition takes the mean."""

MAX_GUARDS = 6
"""The most guards that a plan may have as it is written."""

MAX_FELT = 24
"""The most guards that a plan may come to, with all rounds of its loops."""

Metres = Annotated[
    float, Strict(), Field(ge=-MAX_REACH_M, le=MAX_REACH_M, allow_inf_nan=False)
]
Reach = Annotated[float, Strict(), Field(gt=0, le=MAX_REACH_M, allow_inf_nan=False)]
Rounds = Annotated[int, Strict(), Field(ge=1, le=MAX_ROUNDS)]
Number = Annotated[int, Strict(), Field(ge=0, le=1000)]
Pattern = Annotated[str, Strict(), Field(min_length=1, max_length=200)]


@dataclass(frozen=True, config=FIELDS)
class Sighting:
    """A condition that can be seen to hold: of a goal of the task, of bodies, or of the time.

    Attributes:
        goal: the number of a goal, from 0, or its name: its bodies are where it wants them.
        left_s: at the last look so much time was left or less, of what the whole motion may take, seconds.
        body: the name of a body, of several as a pattern such as ``card*``, or ``it``.
        at: the body or mark that the origin of each is ``within`` some metres of.
        within: see ``at``.
        inside: the body in whose box the origin of each is; of a flat mark, up to 0.1 m above it.
        above: the height above which the origin of each is, metres.
        slower: the speed below which each moved between the last two looks, m/s.
        angle: which of each body's fixed-axis angles in the world is ``between`` two, radians.
        between: see ``angle``; from the first on, up to the second.
        enough: how many of them are enough; 0: all are needed.
        mean_of: so many of the last looks count, by the mean of what they saw.
        sure: the least probability with which it must hold, by the noise of what is seen; 0: as it is seen.

    Raises:
        ValueError: it says nothing, or too much.
    """

    goal: Annotated[
        Number | Name | None,
        Field(union_mode="left_to_right"),
        meant("give its number, from 0, or its name"),
    ] = None
    body: Name = ""
    at: Name = ""
    within: Reach | None = None
    inside: Name = ""
    above: Metres | None = None
    slower: Reach | None = None
    angle: Literal["", "roll", "pitch", "yaw"] = ""
    between: tuple[Angle, Angle] | None = None
    enough: Number = 0
    left_s: Annotated[float, Strict(), Field(gt=0, allow_inf_nan=False)] | None = None
    mean_of: Annotated[int, Strict(), Field(ge=1, le=MAX_MEANT)] = 1
    sure: Annotated[float, Strict(), Field(ge=0, lt=1, allow_inf_nan=False)] = 0.0

    def __post_init__(self) -> None:
        is_measured = [self.above is not None, self.slower is not None]
        count = sum(map(bool, (self.at, self.inside, self.angle, *is_measured)))
        is_of_goal = self.goal is not None
        is_of_time = self.left_s is not None
        is_near = self.within is not None
        rules = {
            "give a goal, or a body and what is to be seen of it, or left_s": (
                is_of_goal + is_of_time + bool(self.body) != 1
            ),
            "a goal says itself what is wanted; leave the rest out": (
                is_of_goal and (count or self.enough)
            ),
            "the time that is left is nothing that is seen; leave the rest out": (
                is_of_time and (count or self.enough or self.mean_of > 1 or self.sure)
            ),
            "say one of at, inside, above, slower and angle of the body": (
                self.body and count != 1
            ),
            "'slower' is about two looks, not about their mean; leave mean_of out": (
                self.slower is not None and self.mean_of > 1
            ),
            "'angle' needs 'between', two angles, and nothing else has it": (
                bool(self.angle) != (self.between is not None)
            ),
            "'at' needs 'within', metres, and nothing else has it": (
                bool(self.at) != is_near
            ),
            f"'{HERE}' can't be seen; name a body or mark": HERE in self.names,
        }
        refuse("", rules)

    @property
    def names(self) -> tuple[str, ...]:
        """The bodies and marks that it names, but for its pattern."""
        return tuple(filter(None, (self.at, self.inside)))


@dataclass(frozen=True, config=FIELDS)
class LookStep:
    """The scene is looked at again: later anchors stand where bodies are seen then."""

    LISTS: ClassVar[tuple[str, ...]] = ()
    look: Annotated[Literal[True], meant('write {"look": true}, or leave it out')]


@dataclass(frozen=True, config=FIELDS)
class Repeat:
    """A block that is done again until a condition is seen to hold, ``at_most`` so many times.

    The condition is asked before each round, or after the look that a round begins with.

    Raises:
        ValueError: nothing new is seen in it.
    """

    LISTS: ClassVar[tuple[str, ...]] = ("repeat",)
    repeat: tuple[Item, ...]
    until_seen: Sighting
    at_most: Rounds

    def __post_init__(self) -> None:
        if not any(isinstance(step, LookStep) for step in self.repeat):
            raise ValueError(
                "'repeat' needs a {\"look\": true} among its own steps, without which nothing new is seen"
            )


@dataclass(frozen=True, config=FIELDS)
class Choose:
    """One of two blocks, by whether a condition is seen to hold; the second may be empty."""

    LISTS: ClassVar[tuple[str, ...]] = ("then", "otherwise")
    choose: Sighting
    then: tuple[Item, ...]
    otherwise: tuple[Item, ...] = ()


@dataclass(frozen=True, config=FIELDS)
class Each:
    """A block for each of the bodies of a pattern that are not yet where they should be, the nearest first.

    Which ones those are is asked again before each. In the block the body is ``it``.

    Raises:
        ValueError: the condition is not about its bodies.
    """

    LISTS: ClassVar[tuple[str, ...]] = ("do",)
    each: Pattern
    do: tuple[Item, ...]
    until_seen: Sighting
    at_most: Rounds

    def __post_init__(self) -> None:
        if self.until_seen.goal is None and self.until_seen.body != IT:
            raise ValueError(
                f"'until_seen' of an 'each' is about its body: give a goal, or \"body\": \"{IT}\""
            )


Block = Repeat | Choose | Each
Item = Step | LookStep | Block
KINDS: Mapping[str, type[LookStep | Block]] = {
    "look": LookStep,
    "repeat": Repeat,
    "choose": Choose,
    "each": Each,
}
"""Looks and blocks by the field that makes one."""

_ITEMS = TypeAdapter[Any](tuple[Item, ...])


def dump_items(items: Sequence[Item]) -> list[Any]:
    """Return what was written, without what has its default."""
    written: list[Any] = _ITEMS.dump_python(
        tuple(items), mode="json", exclude_defaults=True
    )
    return written


def parts_of(item: Item) -> dict[str, tuple[Item, ...]]:
    """Return the lists of steps within a block, by their fields; a leaf has none."""
    return {name: getattr(item, name) for name in item.LISTS}


def list_items(items: Sequence[Item]) -> Iterator[Item]:
    """Yield all steps and blocks of a tree, as they are written."""
    for item in items:
        yield item
        for part in parts_of(item).values():
            yield from list_items(part)


def condition_of(block: Block) -> Sighting:
    """Return the condition of a block."""
    return block.choose if isinstance(block, Choose) else block.until_seen


def list_waypoints(items: Sequence[Item]) -> list[Step]:
    """List the waypoints of a tree, as they are written."""
    return [item for item in list_items(items) if isinstance(item, Step)]


def change_waypoints(
    items: Sequence[Item], change: Callable[[Step], Step]
) -> tuple[Item, ...]:
    """Change each waypoint of a tree, as they are written."""
    changed: list[Item] = []
    for item in items:
        if isinstance(item, Step):
            changed.append(change(item))
            continue

        parts: dict[str, Any] = {
            name: change_waypoints(part, change)
            for name, part in parts_of(item).items()
        }
        changed.append(replace(item, **parts))

    return tuple(changed)


class Cost(NamedTuple):
    """The most that steps can come to, with all rounds of loops, however the scene looks.

    Attributes:
        waypoints: that the arm goes to.
        looks: that are taken.
        guards: that are waited for.
        seconds: that are asked for, without looks.
    """

    waypoints: int = 0
    looks: int = 0
    guards: int = 0
    seconds: float = 0.0

    def __str__(self) -> str:
        return ", ".join(map(count_words, self[:3], ("waypoint", "look", "guard")))

    @classmethod
    def of(cls, items: Sequence[Item]) -> Cost:
        """Count the most that steps can come to."""
        waypoints, looks, guards, seconds = _count_all(items).tolist()
        return cls(int(waypoints), int(looks), int(guards), seconds)


def _count_all(items: Sequence[Item]) -> Array:
    """Count the figures (4,) of a `Cost`."""
    return sum(map(_count, items), np.zeros(4))


def _count(item: Item) -> Array:
    match item:
        case Step():
            return np.array([1, 0, bool(item.until), item.seconds + item.wait])
        case LookStep():
            return np.array([0, 1, 0, 0])
        case Choose():
            return np.maximum(_count_all(item.then), _count_all(item.otherwise))
        case Repeat():
            return item.at_most * _count_all(item.repeat)
        case Each():
            return item.at_most * _count_all(item.do)


def match_names(pattern: str, names: Iterator[str] | Sequence[str]) -> list[str]:
    """List the names that a pattern such as ``card*`` means."""
    return [name for name in names if fnmatchcase(name, pattern)]


@plain(frozen=True)
class Reader:
    """Reads steps and blocks that a model wrote.

    Attributes:
        gripper: whether the tool hangs from the fingers.
        where: words for the block that is read, for errors; empty: the plan.
        depth: within how many blocks it stands.
        bound: whether one of them is for each of some bodies, so that there is an ``it``.
    """

    gripper: bool
    where: str = ""
    depth: int = 0
    bound: bool = False

    def read_all(self, data: object, what: str = "the action plan") -> tuple[Item, ...]:
        """Read a list of steps.

        Raises:
            DesignError: names the step and its fault.
        """
        noun = "steps" if self.where else "waypoints"
        subject = f"{self.where}: {what}" if self.where else what
        if not isinstance(data, list):
            raise DesignError(f"{subject} must be a list of {noun}, not {kind(data)}")
        if not 1 <= len(data) <= MAX_WAYPOINTS:
            raise DesignError(
                f"{subject} has {len(data)} {noun}; between 1 and {MAX_WAYPOINTS} are needed"
            )

        label = f"{self.where}."
        if not self.where:
            label = "step " if any(map(_find_kinds, data)) else "waypoint "

        return tuple(
            self._read(item, f"{label}{number}")
            for number, item in enumerate(data, start=1)
        )

    def _read(self, data: Any, where: str) -> Item:
        """Read a step or a block."""
        found = _find_kinds(data)
        if not found:
            step = read_step(data, where, self.gripper)
            self._check_names(step.names, where)
            return step
        if len(found) > 1:
            raise DesignError(f"{where}: give one of {' and '.join(found)}, not both")

        wanted = KINDS[found[0]]
        if self.depth == MAX_DEPTH and wanted.LISTS:
            raise DesignError(
                f"{where}: blocks stand at most {MAX_DEPTH} deep within one another; '{found[0]}' is one too many"
            )

        fields = {**data}
        if wanted is Each:
            fields.setdefault("at_most", MAX_ROUNDS)
        bound = self.bound or wanted is Each
        inner = replace(self, where=where, depth=self.depth + 1, bound=bound)
        for name in wanted.LISTS:
            if name == "otherwise" and not data.get(name):
                fields[name] = ()
            elif name in data:
                fields[name] = inner.read_all(data[name], repr(name))

        item: LookStep | Block = check(wanted, fields, where, DesignError)
        if not isinstance(item, LookStep):
            asks = inner if wanted is Each else self
            condition = condition_of(item)
            asks._check_names((condition.body, *condition.names), where)

        return item

    def _check_names(self, names: Sequence[str], where: str) -> None:
        if IT in names and not self.bound:
            raise DesignError(
                f"{where}: '{IT}' is the body of an 'each' block; there is none around it"
            )


def _find_kinds(data: object) -> list[str]:
    """List the fields that make a block of what was written; none: it is a waypoint."""
    if not isinstance(data, dict):
        return []
    return [name for name in KINDS if name in data]


def block_schemas(waypoint: JsonObject) -> list[JsonObject]:
    """Return the JSON schemas of looks and blocks, of waypoints alone in them: a schema has no end otherwise."""
    look = object_schema({"look": {"type": "boolean"}})
    steps = {"type": "array", "items": {"anyOf": [waypoint, look]}, "minItems": 1}
    sighting = object_schema(
        {
            "goal": {"type": "integer"},
            "body": {"type": "string"},
            "at": {"type": "string"},
            "within": {"type": "number"},
            "inside": {"type": "string"},
            "above": {"type": "number"},
            "slower": {"type": "number"},
            "angle": {"type": "string", "enum": ["roll", "pitch", "yaw"]},
            "between": {"type": "array", "items": {"type": "number"}},
            "enough": {"type": "integer"},
            "left_s": {"type": "number"},
            "mean_of": {"type": "integer"},
            "sure": {"type": "number"},
        },
        [],
    )
    rounds = {"type": "integer", "minimum": 1, "maximum": MAX_ROUNDS}
    until = {"until_seen": sighting, "at_most": rounds}

    return [
        look,
        object_schema({"repeat": steps, **until}),
        object_schema(
            {"choose": sighting, "then": steps, "otherwise": steps}, ["choose", "then"]
        ),
        object_schema(
            {"each": {"type": "string"}, "do": steps, **until},
            ["each", "do", "until_seen"],
        ),
    ]


def check_cost(items: Sequence[Item]) -> None:
    """Refuse steps that may come to too much.

    Raises:
        DesignError: with the figures.
    """
    guards = sum(bool(step.until) for step in list_waypoints(items))
    if guards > MAX_GUARDS:
        raise DesignError(
            f"the action plan has {guards} guards; at most {MAX_GUARDS} are allowed"
        )

    limits = {"waypoints": MAX_WAYPOINTS, "looks": MAX_LOOKS, "guards": MAX_FELT}
    for (what, most), count in zip(limits.items(), Cost.of(items), strict=False):
        if count > most:
            raise DesignError(
                f"with all rounds of its loops the action plan may come to {count} {what}; at most {most} are "
                "allowed: give a smaller 'at_most', or fewer steps"
            )
