"""Define the arguments of each tool, which are checked as they arrive."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field

from core.designs.curves import MOST, Axis
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

MOST_DESIGNS = 2_000_000
"""Characters of a designs document, some ten times the longest answer of a model."""

Kind = Literal["rigid", "gripper"]
Coordinate = Annotated[float, Field(ge=-10, le=10, allow_inf_nan=False)]
Point = Annotated[list[Coordinate], Field(min_length=3, max_length=3)]
Designs = Annotated[
    dict[str, Any] | str,
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


class Look(Arguments):
    view: str | None = Field(
        None,
        max_length=50,
        description="scene (the task's camera), close, robot, front, side or top; the last three with grids, m.",
    )
    position: Point | None = Field(
        None, description="Where another camera stands: x, y, z in metres."
    )
    target: Point | None = Field(
        None, description="What that camera looks at; else what the task's looks at."
    )
    fov_deg: float | None = Field(
        None, ge=2, le=120, description="That camera's vertical angle, degrees."
    )
    designs: Designs | None = Field(
        None, description="A designs document, whose first tool is shown on the arm."
    )


class CheckDesign(Arguments):
    designs: Designs


class TryDesign(Arguments):
    designs: Designs


class TryCurve(Arguments):
    candidate: CandidateId
    axes: Annotated[list[Axis], Field(min_length=1, max_length=MOST)] = Field(
        description=(
            "One or two numbers of the design, each with the range of what is added to it (m or rad): `add_to` is a "
            "coordinate of `waypoints` (from 1; none: all), or with `component` one of its pose on its parent, or a "
            "size."
        )
    )


class Watch(Arguments):
    candidate: CandidateId
    layout: int | None = Field(
        None, ge=0, description="Which trial; else the one that earned least."
    )


class BestDesigns(Arguments):
    count: int = Field(3, ge=1, le=10, description="How many designs are shown whole.")


class Finish(Arguments):
    pass


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
    "check_design": ToolKind(
        CheckDesign,
        "Say what is wrong with designs without playing them: rules, reach, collisions of the arm, and whether the "
        "robot would touch anything. Free. Where nobody measured the scene: rules, and reach in an empty room.",
    ),
    "try_design": ToolKind(
        TryDesign,
        "Play designs in the layouts of the search: reward, reason, what was observed. Costs rollouts of the budget. "
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
    "watch": ToolKind(
        Watch,
        "See a film strip of a trial: six instants at which something happens. Free.",
    ),
    "best_designs": ToolKind(
        BestDesigns,
        "List what was tried, the best first, with the designs of the best. Free.",
    ),
    "finish": ToolKind(
        Finish,
        "End the search: the best are tried in more layouts, the winner is chosen and written. Nothing can be tried "
        "afterwards.",
        reads_only=False,
    ),
}
"""The tools, by name."""


def read_arguments(name: str, given: Mapping[str, Any]) -> Arguments:
    """Check the arguments of a call.

    Raises:
        Refused: there is no such tool, or they are not its arguments; says which.
    """
    if name not in KINDS:
        raise Refused(f"no tool {clean(name, 60)!r}; there are: {', '.join(KINDS)}")
    return check(KINDS[name].arguments, dict(given), name, Refused)


def read_text(designs: dict[str, Any] | str) -> str:
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
