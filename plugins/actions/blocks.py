"""Define the blocks of anchored plans: looks, loops and choices by what can be seen, and how they are read.

A plan is a tree: its leaves are waypoints and looks. What it can cost is known from the tree alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import Annotated, Any

from pydantic import ConfigDict, Field, Strict, TypeAdapter
from pydantic.dataclasses import dataclass as checked

from core.design import DesignError
from core.designs.plan_rules import MAX_REACH_M, MAX_WAYPOINTS
from core.errors import choices
from core.support.checking import check, in_unit
from core.support.text import count_words, kind
from plugins.actions.steps import HERE, IT, Name, Step, read_step

MAX_ROUNDS = 8
"""The most rounds of a loop, and the most bodies of a block for each of them."""

MAX_DEPTH = 2
"""How many blocks may stand within one another."""

MAX_LOOKS = 40
"""The most looks that a plan may come to, with all rounds of its loops."""

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


@checked(frozen=True, config=ConfigDict(extra="forbid"))
class Sighting:
    """A condition that can be seen to hold: of a goal of the task, or of bodies.

    Attributes:
        goal: the number of a goal, from 0, or its name: its bodies are where it wants them.
        body: the name of a body, of several as a pattern such as ``card*``, or ``it``.
        at: the body or mark that the origin of each is ``within`` some metres of.
        within: see ``at``.
        inside: the body in whose box the origin of each is; of a flat mark, up to 0.1 m above it.
        above: the height above which the origin of each is, metres.
        enough: how many of them are enough; 0: all are needed.
    """

    goal: Annotated[
        Number | Name | None,
        Field(union_mode="left_to_right"),
        in_unit("give its number, from 0, or its name"),
    ] = None
    body: Name = ""
    at: Name = ""
    within: Reach | None = None
    inside: Name = ""
    above: Metres | None = None
    enough: Number = 0

    @property
    def names(self) -> tuple[str, ...]:
        """The bodies and marks that it names, but for its pattern."""
        return tuple(filter(None, (self.at, self.inside)))

    @property
    def relations(self) -> int:
        """How many things it says of its bodies."""
        said = [bool(self.at), bool(self.inside), self.above is not None]
        return sum(said)

    def __str__(self) -> str:
        if self.goal is not None:
            return f"goal {self.goal}"

        enough = f"{self.enough} of " if self.enough else ""
        if self.above is not None:
            return f"{enough}{self.body} above {self.above:g} m"
        if self.inside:
            return f"{enough}{self.body} inside {self.inside}"

        return f"{enough}{self.body} within {self.within:g} m of {self.at}"

    def dump(self) -> dict[str, Any]:
        written: dict[str, Any] = _SIGHTINGS.dump_python(
            self, mode="json", exclude_defaults=True
        )
        return written


_SIGHTINGS = TypeAdapter(Sighting)


@dataclass(frozen=True)
class LookStep:
    """The scene is looked at again: later anchors stand where bodies are seen then."""

    def dump(self) -> dict[str, Any]:
        return {"look": True}


@dataclass(frozen=True)
class Repeat:
    """A block that is done again until a condition is seen to hold, ``at_most`` so many times.

    The condition is asked before each round, or after the look that a round begins with.
    """

    steps: tuple[Item, ...]
    until_seen: Sighting
    at_most: int

    def dump(self) -> dict[str, Any]:
        return {
            "repeat": dump_items(self.steps),
            "until_seen": self.until_seen.dump(),
            "at_most": self.at_most,
        }


@dataclass(frozen=True)
class Choose:
    """One of two blocks, by whether a condition is seen to hold; the second may be empty."""

    if_seen: Sighting
    then: tuple[Item, ...]
    otherwise: tuple[Item, ...] = ()

    def dump(self) -> dict[str, Any]:
        written = {"choose": self.if_seen.dump(), "then": dump_items(self.then)}
        if self.otherwise:
            written["otherwise"] = dump_items(self.otherwise)
        return written


@dataclass(frozen=True)
class Each:
    """A block for each of the bodies of a pattern that are not yet where they should be, the nearest first.

    Which ones those are is asked again before each. In the block the body is ``it``.
    """

    pattern: str
    steps: tuple[Item, ...]
    until_seen: Sighting
    at_most: int = MAX_ROUNDS

    def dump(self) -> dict[str, Any]:
        return {
            "each": self.pattern,
            "do": dump_items(self.steps),
            "until_seen": self.until_seen.dump(),
            "at_most": self.at_most,
        }


Block = Repeat | Choose | Each
Item = Step | LookStep | Block


def dump_items(items: Sequence[Item]) -> list[Any]:
    """Return what was written."""
    return [item.dump() for item in items]


def parts_of(item: Item) -> tuple[tuple[Item, ...], ...]:
    """Return the lists of steps within a block; a leaf has none."""
    if isinstance(item, Choose):
        return item.then, item.otherwise
    if isinstance(item, Repeat | Each):
        return (item.steps,)
    return ()


def list_items(items: Sequence[Item]) -> Iterator[Item]:
    """Yield all steps and blocks of a tree, as they are written."""
    for item in items:
        yield item
        for part in parts_of(item):
            yield from list_items(part)


def list_waypoints(items: Sequence[Item]) -> list[Step]:
    """List the waypoints of a tree, as they are written."""
    return [item for item in list_items(items) if isinstance(item, Step)]


def change_waypoints(
    items: Sequence[Item], change: Callable[[Step], Step]
) -> tuple[Item, ...]:
    """Change each waypoint of a tree, as they are written."""
    changed: list[Item] = []

    for item in items:
        match item:
            case Step():
                changed.append(change(item))
            case LookStep():
                changed.append(item)
            case Choose():
                then = change_waypoints(item.then, change)
                otherwise = change_waypoints(item.otherwise, change)
                changed.append(replace(item, then=then, otherwise=otherwise))
            case _:
                steps = change_waypoints(item.steps, change)
                changed.append(replace(item, steps=steps))

    return tuple(changed)


@dataclass(frozen=True)
class Cost:
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

    def __add__(self, other: Cost) -> Cost:
        return Cost(*(a + b for a, b in zip(self.figures, other.figures, strict=True)))

    def times(self, count: int) -> Cost:
        return Cost(*(count * figure for figure in self.figures))

    def or_else(self, other: Cost) -> Cost:
        """Return the most of two of which one is done."""
        return Cost(*map(max, self.figures, other.figures))

    def __str__(self) -> str:
        counted = [
            count_words(self.waypoints, "waypoint"),
            count_words(self.looks, "look"),
            count_words(self.guards, "guard"),
        ]
        return ", ".join(counted)

    @property
    def figures(self) -> tuple[Any, ...]:
        return self.waypoints, self.looks, self.guards, self.seconds

    @classmethod
    def of(cls, items: Sequence[Item]) -> Cost:
        """Count the most that steps can come to."""
        return sum(map(_cost_of, items), cls())


def _cost_of(item: Item) -> Cost:
    match item:
        case Step():
            return Cost(1, 0, int(bool(item.until)), item.seconds + item.wait)
        case LookStep():
            return Cost(looks=1)
        case Choose():
            return Cost.of(item.then).or_else(Cost.of(item.otherwise))
        case _:
            return Cost.of(item.steps).times(item.at_most)


def outline(items: Sequence[Item], indent: str = "") -> list[str]:
    """Describe steps in lines, those within a block farther to the right."""
    lines = []
    waypoints = 0

    for item in [*items, None]:
        if isinstance(item, Step):
            waypoints += 1
            continue
        if waypoints:
            lines.append(f"{indent}{count_words(waypoints, 'waypoint')}")
            waypoints = 0

        match item:
            case LookStep():
                lines.append(f"{indent}look")
            case Choose():
                lines.append(f"{indent}if {item.if_seen} is seen:")
                lines += outline(item.then, f"{indent}  ")
                if item.otherwise:
                    lines.append(f"{indent}otherwise:")
                    lines += outline(item.otherwise, f"{indent}  ")
            case Repeat():
                most = f"at most {count_words(item.at_most, 'time')}"
                lines.append(f"{indent}until {item.until_seen} is seen, {most}:")
                lines += outline(item.steps, f"{indent}  ")
            case Each():
                most = f"at most {item.at_most}"
                lines.append(
                    f"{indent}for each of {item.pattern} until {item.until_seen} is seen, {most}:"
                )
                lines += outline(item.steps, f"{indent}  ")

    return lines


def match_names(pattern: str, names: Iterator[str] | Sequence[str]) -> list[str]:
    """List the names that a pattern such as ``card*`` means."""
    return [name for name in names if fnmatchcase(name, pattern)]


@dataclass(frozen=True)
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

    def read_all(self, data: object, what: str = "action plan") -> tuple[Item, ...]:
        """Read a list of steps.

        Raises:
            DesignError: names the step and its fault.
        """
        inner = bool(self.where)
        subject = f"{self.where}: {what}" if inner else what
        noun = "steps" if inner else "waypoints"

        if not isinstance(data, list):
            article = "an" if not inner else ""
            raise DesignError(
                f"{article} {subject} must be a list of {noun}, not {kind(data)}".strip()
            )

        if not 1 <= len(data) <= MAX_WAYPOINTS:
            article = "the" if not inner else ""
            raise DesignError(
                f"{article} {subject} has {len(data)} {noun}; between 1 and {MAX_WAYPOINTS} are needed".strip()
            )

        label = f"{self.where}."
        if not inner:
            label = "step " if any(map(_find_kinds, data)) else "waypoint "

        return tuple(
            self._read(item, f"{label}{number}")
            for number, item in enumerate(data, start=1)
        )

    def _read(self, data: object, where: str) -> Item:
        """Read a step or a block."""
        found = _find_kinds(data)
        if not found:
            step = read_step(data, where, self.gripper)
            self._check_names(step.names, where)
            return step

        assert isinstance(data, dict)
        if len(found) > 1:
            raise DesignError(f"{where}: give one of {' and '.join(found)}, not both")

        name = found[0]
        _refuse_others(data, name, where)
        if name == "look":
            if data["look"] is not True:
                raise DesignError(f'{where}: write {{"look": true}}, or leave it out')
            return LookStep()

        if self.depth == MAX_DEPTH:
            raise DesignError(
                f"{where}: blocks stand at most {MAX_DEPTH} deep within one another; '{name}' is one too many"
            )

        return _KINDS[name].read(self, data, where)

    def _inner(self, where: str, bound: bool = False) -> Reader:
        """Return what reads the steps of a block."""
        return replace(
            self, where=where, depth=self.depth + 1, bound=self.bound or bound
        )

    def _check_names(self, names: Sequence[str], where: str) -> None:
        if IT in names and not self.bound:
            raise DesignError(
                f"{where}: '{IT}' is the body of an 'each' block; there is none around it"
            )

    def read_repeat(self, data: dict[str, Any], where: str) -> Repeat:
        """Read a loop."""
        steps = self._inner(where).read_all(data["repeat"], "'repeat'")
        if not any(isinstance(step, LookStep) for step in steps):
            raise DesignError(
                f"{where}: 'repeat' needs a {{\"look\": true}} among its own steps, without which nothing new is seen"
            )

        wanted = self._read_sighting(data, "until_seen", where)
        return Repeat(steps, wanted, _read_rounds(data, where))

    def read_choose(self, data: dict[str, Any], where: str) -> Choose:
        """Read a choice."""
        inner = self._inner(where)
        wanted = self._read_sighting(data, "choose", where)
        then = inner.read_all(data.get("then"), "'then'")
        otherwise: tuple[Item, ...] = ()
        if data.get("otherwise"):
            otherwise = inner.read_all(data["otherwise"], "'otherwise'")

        return Choose(wanted, then, otherwise)

    def read_each(self, data: dict[str, Any], where: str) -> Each:
        """Read a block for each of some bodies."""
        pattern = data["each"]
        if not isinstance(pattern, str) or not pattern or len(pattern) > 200:
            raise DesignError(
                f"{where}: 'each' must be a name, or a pattern such as \"card*\", not {pattern!r:.40}"
            )

        inner = self._inner(where, bound=True)
        steps = inner.read_all(data.get("do"), "'do'")
        wanted = inner._read_sighting(data, "until_seen", where)
        if wanted.goal is None and wanted.body != IT:
            raise DesignError(
                f"{where}: 'until_seen' of an 'each' is about its body: give a goal, or \"body\": \"{IT}\""
            )

        return Each(pattern, steps, wanted, _read_rounds(data, where, MAX_ROUNDS))

    def _read_sighting(self, data: dict[str, Any], name: str, where: str) -> Sighting:
        """Read a condition.

        Args:
            data: the block.
            name: of its field.
            where: words for the block.
        """
        place = f"{where}: '{name}'"
        given = data.get(name)
        if not isinstance(given, dict):
            raise DesignError(
                f'{place} must be an object such as {{"goal": 0}}, not {kind(given)}'
            )

        wanted = check(Sighting, given, place, DesignError)
        fault = _find_fault(wanted)
        if fault:
            raise DesignError(f"{place}: {fault}")

        self._check_names((wanted.body, *wanted.names), where)
        return wanted


def _find_fault(wanted: Sighting) -> str:
    """Say what is wrong with a condition; empty: nothing is."""
    if (wanted.goal is None) == (not wanted.body):
        return "give a goal, or a body and what is to be seen of it"
    if wanted.goal is not None and wanted.relations + bool(wanted.enough):
        return "a goal says itself what is wanted; leave the rest out"
    if wanted.body and wanted.relations != 1:
        return "say one of at, inside and above of the body"
    if bool(wanted.at) != (wanted.within is not None):
        return "'at' needs 'within', metres, and nothing else has it"
    if HERE in wanted.names:
        return f"'{HERE}' can't be seen; name a body or mark"

    return ""


def _read_rounds(data: dict[str, Any], where: str, usual: int | None = None) -> int:
    """Read how many rounds there are at most."""
    what = f"{where}: 'at_most' is a whole number from 1 to {MAX_ROUNDS}"
    return check(Rounds, data.get("at_most", usual), what, DesignError)


@dataclass(frozen=True)
class _Kind:
    """A kind of block: what else it has, and how it is read."""

    others: tuple[str, ...] = ()
    read: Callable[[Reader, dict[str, Any], str], Block] = field(
        default=Reader.read_repeat
    )


_KINDS = {
    "look": _Kind(),
    "repeat": _Kind(("until_seen", "at_most"), Reader.read_repeat),
    "choose": _Kind(("then", "otherwise"), Reader.read_choose),
    "each": _Kind(("do", "until_seen", "at_most"), Reader.read_each),
}


def _find_kinds(data: object) -> list[str]:
    """List the fields that make a block of what was written; none: it is a waypoint."""
    if not isinstance(data, dict):
        return []
    return [name for name in _KINDS if name in data]


def _refuse_others(data: dict[Any, Any], name: str, where: str) -> None:
    """Refuse what a block of a kind does not have."""
    known = (name, *_KINDS[name].others)
    for given in data:
        if given not in known:
            raise DesignError(str(choices("field", str(given), known, where)))


def block_schemas(waypoint: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the JSON schemas of looks and blocks, of waypoints alone in them: a schema has no end otherwise."""
    look = _object({"look": {"type": "boolean"}})
    steps = {"type": "array", "items": {"anyOf": [waypoint, look]}, "minItems": 1}
    sighting = _object(
        {
            "goal": {"type": "integer"},
            "body": {"type": "string"},
            "at": {"type": "string"},
            "within": {"type": "number"},
            "inside": {"type": "string"},
            "above": {"type": "number"},
            "enough": {"type": "integer"},
        },
        required=[],
    )
    rounds = {"type": "integer", "minimum": 1, "maximum": MAX_ROUNDS}

    return [
        look,
        _object({"repeat": steps, "until_seen": sighting, "at_most": rounds}),
        _object(
            {"choose": sighting, "then": steps, "otherwise": steps},
            required=["choose", "then"],
        ),
        _object(
            {
                "each": {"type": "string"},
                "do": steps,
                "until_seen": sighting,
                "at_most": rounds,
            },
            required=["each", "do", "until_seen"],
        ),
    ]


def _object(
    properties: dict[str, Any], required: Sequence[str] | None = None
) -> dict[str, Any]:
    """Return the JSON schema of an object; by default all of it is required."""
    return {
        "type": "object",
        "properties": properties,
        "required": list(properties if required is None else required),
        "additionalProperties": False,
    }


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

    cost = Cost.of(items)
    limits = (
        ("waypoints", cost.waypoints, MAX_WAYPOINTS),
        ("looks", cost.looks, MAX_LOOKS),
        ("guards", cost.guards, MAX_FELT),
    )
    for what, count, most in limits:
        if count > most:
            raise DesignError(
                f"with all rounds of its loops the action plan may come to {count} {what}; at most {most} are "
                "allowed: give a smaller 'at_most', or fewer steps"
            )
