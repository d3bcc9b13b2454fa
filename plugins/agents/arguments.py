"""Define the arguments of each tool, which are read as generously as a model's replies, and checked as they arrive."""

from __future__ import annotations

import difflib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, Field, WithJsonSchema

from core.designs.curves import MOST, Axis
from core.errors import choices
from core.support.inputs import FIELDS, check
from core.support.text import clean
from plugins.agents.bench import Refused

GUIDE = "vlmgineer://guide"
DESIGNS = "vlmgineer://designs"
DOCUMENTS = {
    GUIDE: "How to work at this bench: the calls, the layouts, the budget.",
    DESIGNS: "How designs and plans are written, with the JSON schema.",
}
"""What an agent may read beside its tools' answers."""

WAIT = "wait"
FINISH = "finish"

MOST_DESIGNS = 2_000_000
"""Characters of a designs document, some ten times the longest answer of a model."""

_ALIKE = 0.75  # of a name's letters: then it is the other one with a mistake
_OF_DESIGNS = (
    "strategies",
    "action_sets",
)  # keys of a designs document, or of a design


def _read_json(given: object) -> object:
    """Read a value that is written as JSON's text; any other text stays as it is."""
    if not isinstance(given, str):
        return given
    try:
        return json.loads(given)
    except (ValueError, RecursionError):
        return given


def _read_name(given: object) -> object:
    """Read a name as people write it, such as ``Scene view``."""
    if not isinstance(given, str):
        return given
    return given.strip().lower().removesuffix("view").strip()


def _check_document(given: object) -> object:
    if isinstance(given, dict | list | str):
        return given
    raise ValueError(
        'must be a designs document, {"strategies": [{...}]}, or its JSON text'
    )


Kind = Annotated[Literal["rigid", "gripper"], BeforeValidator(_read_name)]
Coordinate = Annotated[float, Field(ge=-10, le=10, allow_inf_nan=False)]
Point = Annotated[
    list[Coordinate], BeforeValidator(_read_json), Field(min_length=3, max_length=3)
]
Document = dict[str, Any] | list[Any] | str
Designs = Annotated[
    Any,
    BeforeValidator(_check_document),
    WithJsonSchema({"type": ["object", "array", "string"]}),
    Field(
        description='A designs document, {"strategies": [{...}]}, as describe_task says it; or its JSON text.'
    ),
]
CandidateId = Annotated[
    str,
    Field(
        max_length=100,
        description="A candidate's id, such as g0-a0-s0-p0, as try_design and best_designs name it.",
    ),
]


class Arguments(BaseModel):
    """The arguments of a tool: none but these."""

    model_config = FIELDS


class DescribeTask(Arguments):
    kind: Kind | None = Field(
        None,
        description="Tools at the flange (rigid) or attachments to the fingers (gripper), where the task takes both.",
    )


class OfDesigns(Arguments):
    """Names designs: a document, or one that was tried with what changes."""

    designs: Designs | None = None
    candidate: CandidateId | None = Field(
        None,
        max_length=100,
        description="In place of designs: a candidate that was tried, by its id.",
    )
    change: Annotated[dict[str, Any], BeforeValidator(_read_json)] = Field(
        default={},
        description=(
            "What differs from that candidate: values by their places in its design, as best_designs shows it, such "
            'as {"action_sets.0.2.0": 0.55, "tool_components.blade.size.1": 0.2}.'
        ),
    )


class FromCamera(Arguments):
    """Says where a camera stands."""

    position: Point | None = Field(
        None, description="Where another camera stands: x, y, z in metres."
    )
    target: Point | None = Field(
        None, description="What that camera looks at; else what the task's looks at."
    )
    fov_deg: float | None = Field(
        None, ge=2, le=120, description="That camera's vertical angle, degrees."
    )


class Look(OfDesigns, FromCamera):
    view: Annotated[str, BeforeValidator(_read_name)] | None = Field(
        None,
        max_length=50,
        description="scene (the task's camera), close, robot, front, side or top; the last three with grids, m.",
    )
    cut: float | None = Field(
        None,
        ge=-10,
        le=10,
        allow_inf_nan=False,
        description="Where front, side or top cuts the scene open: x, y or z in metres; what is nearer is left out.",
    )


class Rehearse(Look):
    layout: int | None = Field(
        None, ge=0, description="One of the search; else that of the pictures."
    )
    waypoint: int | None = Field(
        None, ge=1, description="Up to which one, from 1; else to the end."
    )
    time_s: float | None = Field(
        None,
        ge=0,
        allow_inf_nan=False,
        description="Or up to which instant, seconds of the motion.",
    )


class TryDesign(OfDesigns):
    layouts: Annotated[list[int], BeforeValidator(_read_json)] | None = Field(
        None,
        min_length=1,
        max_length=100,
        description="Only in these layouts of the search: less is played, and it is no candidate of the search.",
    )
    engine: Annotated[str, BeforeValidator(_read_name)] | None = Field(
        None,
        max_length=50,
        description="In another engine, such as pybullet, as a second opinion; by default in one layout.",
    )
    from_waypoint: int | None = Field(
        None,
        ge=1,
        description=(
            "With candidate and change: go on from this waypoint of that candidate, at which its arm rests, in layouts "
            "in which it was played. The plan up to there stays as it is, and only the rest is paid."
        ),
    )


class TryCurve(Arguments):
    candidate: CandidateId
    axes: Annotated[
        list[Axis], BeforeValidator(_read_json), Field(min_length=1, max_length=MOST)
    ] = Field(
        description=(
            "One or two numbers of the design, each with the range of what is added to it (m or rad): `add_to` is a "
            "coordinate of `waypoints` (from 1; none: all), or with `component` one of its pose on its parent, or a "
            "size."
        )
    )


class Watch(FromCamera):
    candidate: CandidateId
    layout: int | None = Field(
        None, ge=0, description="Which trial; else the one that earned least."
    )
    body: str | None = Field(
        None,
        max_length=200,
        description="A body to follow from near, 0.3 m from top to bottom, or by fov_deg.",
    )


class TraceTrial(Arguments):
    candidate: CandidateId
    beside: CandidateId | None = Field(
        None,
        max_length=100,
        description="Another one, which is shown beside it: then it is also said in what their designs differ.",
    )
    layout: int | None = Field(
        None, ge=0, description="Which trials; else those that earned least."
    )


class BestDesigns(Arguments):
    count: int = Field(3, ge=1, le=10, description="How many designs are shown whole.")


@dataclass(frozen=True)
class ToolKind:
    """A tool of the agent's.

    Attributes:
        arguments: their model.
        description: for the agent.
        reads_only: it changes nothing in the run.
    """

    arguments: type[Arguments]
    description: str
    reads_only: bool = True


KINDS: dict[str, ToolKind] = {
    "describe_task": ToolKind(
        DescribeTask,
        "Read this first: the task, the arm, the rules for tools and plans, the pictures, the schema of a designs "
        "document, what was tried so far, and what is left of the budget.",
    ),
    "look": ToolKind(
        Look,
        "See the scene before the motion, from a named view or from a camera of your own. Free.",
    ),
    "rehearse": ToolKind(
        Rehearse,
        "Play a plan by kinematics alone, up to a waypoint or an instant: a picture, where the tool is, and what its "
        "way meets; bodies stay where they begin. Free.",
    ),
    "check_design": ToolKind(
        OfDesigns,
        "Say what is wrong with designs without playing them: rules, reach, collisions of the arm, and whether the "
        "robot would touch anything. Free. Where nobody measured the scene: rules, and reach in an empty room.",
    ),
    "try_design": ToolKind(
        TryDesign,
        "Play designs in the layouts of the search, in some of them, in another engine, or the rest of a plan from a "
        "waypoint of an earlier trial: reward, reason, what was observed. Costs rollouts of the budget. "
        "A design that breaks a rule is not played, and costs nothing; where nobody measured the scene, one that does "
        "not start clear of it counts.",
        reads_only=False,
    ),
    "try_curve": ToolKind(
        TryCurve,
        "Play a design again with one or two of its numbers varied over ranges: the curve of reward and room. Costs "
        "the rollouts of budget.curves candidates. Each of them counts like any other design.",
        reads_only=False,
    ),
    WAIT: ToolKind(
        Arguments,
        "Wait for what goes on, such as finish: its answer, or after some seconds how far it is. Free.",
    ),
    "watch": ToolKind(
        Watch,
        "See a film strip of a trial: six instants at which something happens; close to a body, or from a camera of "
        "your own. Free.",
    ),
    "trace": ToolKind(
        TraceTrial,
        "Play a trial once more, and show over time what is left of the way to each goal, and what the robot presses: "
        "a plot and a table; of two trials side by side. Free.",
    ),
    "best_designs": ToolKind(
        BestDesigns,
        "List what was tried, the best first, with the designs of the best. Free.",
    ),
    FINISH: ToolKind(
        Arguments,
        "End the search: the best are tried in more layouts, the winner is chosen and written. Nothing can be tried "
        "afterwards. It goes on while you wait for it.",
        reads_only=False,
    ),
}
"""The tools, by name."""


def read_arguments(name: str, given: Mapping[str, Any]) -> tuple[Arguments, list[str]]:
    """Check the arguments of a call.

    Returns:
        The arguments, and what was assumed of them, a line each.

    Raises:
        Refused: there is no such tool, or they are not its arguments; says which.
    """
    if name not in KINDS:
        raise Refused(f"no tool {clean(name, 60)!r}; there are: {', '.join(KINDS)}")

    model = KINDS[name].arguments
    known = {key: value for key, value in given.items() if key in model.model_fields}
    others = {key: value for key, value in given.items() if key not in known}
    assumed = []
    if "designs" in model.model_fields and any(key in others for key in _OF_DESIGNS):
        known.setdefault("designs", others)
        others = {}
        assumed.append("what stood beside the arguments was read as `designs`")

    for key in others:
        shown = clean(str(key), 60)
        if difflib.get_close_matches(key, model.model_fields, 1, _ALIKE):
            raise Refused(f"{name}: {choices('argument', shown, model.model_fields)}")
        assumed.append(f"{shown!r} is no argument of {name}, and was left out")

    return check(model, known, name, Refused), assumed


def read_text(designs: Document) -> str:
    """Return a designs document as the text of a reply.

    Raises:
        Refused: it is too long, or no JSON.
    """
    try:
        text = (
            designs
            if isinstance(designs, str)
            else json.dumps(designs, ensure_ascii=False, allow_nan=False)
        )
    except (ValueError, RecursionError) as error:
        raise Refused(f"designs: {clean(str(error), 200)}") from error

    if len(text) > MOST_DESIGNS:
        raise Refused(
            f"designs: {len(text)} characters; at most {MOST_DESIGNS} are read"
        )
    return text
