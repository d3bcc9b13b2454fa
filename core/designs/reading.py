"""Read candidates from a designs document, which a model or a person wrote, and write them back.

A document is an object ``{"strategies": [...]}``. A strategy holds the fields of its tool representation and
``action_sets``, a list of action plans; ``action`` (the representation of the plans, default ``waypoints``),
``gripper`` (default false), ``strategy_name``, ``strategy_description``, ``tool_name``, ``tool_description``,
``action_description`` and ``parents`` (ids of the elites that it derives from) are optional. Other fields are ignored.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from core.design import Candidate, DesignError, Tool
from core.designs.planning import NO_PLAN, guarded, named_actions, parse_plan
from core.designs.rules import check_tool, given_tool
from core.errors import UserError
from core.interfaces import ActionRepresentation, Task, ToolRepresentation, Waypoints
from core.plugins import describe_part
from core.support.files import read_text
from core.support.text import clean, kind, shorten

MAX_NAME = 200
MAX_DESCRIPTION = 5000

MAX_REPLY = 5_000_000  # characters, about ten times the longest answer of a model
MAX_MALFORMED = 100  # malformed strategies of a malformed reply, and
MAX_SAVED = 1000  # sound ones; the rest is not read
MAX_REREAD = (
    1_000_000  # characters of malformed strategies, which may lie inside each other
)

_SEPARATORS = re.compile(r"[\s,]*")
_OPENING = re.compile(r'"strategies"\s*:\s*\[')
_STRATEGY = re.compile(
    r'\{\s*"(?:parents|strategy_name)"\s*:'
)  # the beginning of a strategy, by the schema

# Matches a string (to its end or the reply's), or something that JSON forbids: a comment, or a comma before a closing
# bracket. Possessive quantifiers keep the time linear for every text.
_NOT_JSON = re.compile(
    r'"(?:[^"\\]++|\\.)*+(?:"|\Z)|//[^\n]*|/\*.*?(?:\*/|\Z)|,(?=\s*[]}])', re.DOTALL
)

_EXPECTED = 'expected an object {"strategies": [...]} with at least one strategy'

# Not strict, because models write line breaks inside strings. NaN and infinities become strings, which rules refuse.
_DECODER = json.JSONDecoder(strict=False, parse_constant=lambda name: name)


def read_designs(
    document: object,
    representation: ToolRepresentation,
    task: Task,
    *,
    generation: int = 0,
    agent: int = 0,
    elites: tuple[str, ...] = (),
    most: tuple[int | None, int | None] = (None, None),
    actions: ActionRepresentation | None = None,
) -> list[Candidate]:
    """Read one candidate per action plan, in order, numbered by strategy and action from 0.

    At most so many strategies and plans of each are read (None: all). A design that breaks
    a rule gives candidates with a `Candidate.problem`: all of its strategy if the tool breaks it, and a single one if
    the plans can't be counted. Candidates of a strategy share one tool. Of the ``parents`` that a strategy names, only
    the ids in ``elites`` are kept. Plans are read by ``actions``; None: by the one that the strategy names.

    Raises:
        DesignError: the document has no strategies at all.
    """
    candidates: list[Candidate] = []
    n_tool, n_action = most
    for number, strategy in enumerate(_strategies(document)[:n_tool]):
        base = Candidate(
            None,
            NO_PLAN,
            generation,
            agent,
            number,
            parents=_read_parents(strategy, elites),
        )
        candidates += _read_strategy(
            strategy, base, representation, task, n_action, actions
        )
    return candidates


def _strategies(document: object) -> list[Any]:
    if not isinstance(document, dict):
        raise DesignError(f"the document is {kind(document)}; {_EXPECTED}")
    if "strategies" not in document:
        raise DesignError(f"the document has no 'strategies'; {_EXPECTED}")
    strategies = document["strategies"]
    if not isinstance(strategies, list):
        raise DesignError(
            f"'strategies' is {kind(strategies)}, not a list; {_EXPECTED}"
        )
    if not strategies:
        raise DesignError(f"'strategies' is empty; {_EXPECTED}")
    return strategies


def _read_strategy(
    strategy: object,
    base: Candidate,
    representation: ToolRepresentation,
    task: Task,
    n_action: int | None,
    actions: ActionRepresentation | None,
) -> Iterator[Candidate]:
    try:
        if isinstance(strategy, Unread):
            raise DesignError(strategy.reason)  # noqa: TRY301
        if not isinstance(strategy, dict):
            raise DesignError(f"the strategy is {kind(strategy)}, not an object")  # noqa: TRY301
        given = given_tool(representation, task)
        gripper = _read_gripper(strategy, given)
        actions = actions or named_actions(strategy)
        base = replace(
            base,
            strategy_name=_read_text(strategy, "strategy_name", MAX_NAME),
            strategy_description=_read_text(
                strategy, "strategy_description", MAX_DESCRIPTION
            ),
            action_description=_read_text(
                strategy, "action_description", MAX_DESCRIPTION
            ),
        )
    except DesignError as error:
        for action in range(_count_plans(strategy))[:n_action]:
            yield replace(base, action=action, problem=str(error))
        return

    tool, tool_problem = (
        (given, None)
        if given is not None
        else _read_tool(strategy, representation, task, gripper)
    )
    try:
        plans = _read_action_sets(strategy)
    except DesignError as error:
        yield replace(base, tool=tool, problem=tool_problem or str(error))
        return
    for action, raw in enumerate(plans[:n_action]):
        plan, plan_problem = base.plan, None
        try:
            plan = parse_plan(actions, raw, gripper)
        except DesignError as error:
            plan_problem = f"action plan {action + 1}: {error}"
        yield replace(
            base,
            tool=tool,
            plan=plan,
            action=action,
            problem=tool_problem or plan_problem,
        )


def _read_parents(strategy: object, elites: tuple[str, ...]) -> tuple[str, ...]:
    parents = strategy.get("parents") if isinstance(strategy, dict) else None
    return (
        tuple(elite for elite in elites if elite in parents)
        if isinstance(parents, list)
        else ()
    )


def _read_gripper(strategy: dict[Any, Any], given: Tool | None) -> bool:
    gripper = strategy.get("gripper", given.gripper if given is not None else False)
    if not isinstance(gripper, bool):
        raise DesignError(f"'gripper' is {kind(gripper)}; it must be true or false")
    if given is not None and gripper != given.gripper:
        raise DesignError(
            f"'gripper' is {str(gripper).lower()}; the given tool needs {str(given.gripper).lower()}"
        )
    return gripper


def _read_text(strategy: dict[Any, Any], field: str, max_length: int) -> str:
    text = strategy.get(field)
    if text is None:
        return ""
    if not isinstance(text, str):
        raise DesignError(f"{field!r} is {kind(text)}; it must be a text")
    return clean(text, max_length)


def _read_tool(
    strategy: dict[Any, Any],
    representation: ToolRepresentation,
    task: Task,
    gripper: bool,
) -> tuple[Tool | None, str | None]:
    """The tool, as far as it can be read, and its problem."""
    tool = None
    try:
        if gripper and task.robot.gripper is None:
            raise DesignError(  # noqa: TRY301
                f"{task.robot.title} has no gripper; design one rigid tool, with 'gripper' false"
            )
        tool = _parsed(representation, strategy, gripper)
        check_tool(tool, task.robot, representation.material)
    except DesignError as error:
        return tool, str(error)
    return tool, None


def _parsed(
    representation: ToolRepresentation, strategy: dict[Any, Any], gripper: bool
) -> Tool:
    """Parse a strategy's tool, with its name and description.

    Raises:
        DesignError: a rule is broken, or the representation fails; then the message names its plugin.
    """
    name = _read_text(strategy, "tool_name", MAX_NAME)
    description = _read_text(strategy, "tool_description", MAX_DESCRIPTION)
    with guarded(representation, "parse"):
        tool = representation.parse(strategy, gripper=gripper)
    if not isinstance(tool, Tool) or tool.gripper != gripper:
        wanted = "a Tool for the fingers" if gripper else "a rigid Tool"
        raise DesignError(
            f"{describe_part(representation)}: parse gave {shorten(repr(tool))}; expected {wanted}"
        )
    return replace(
        representation.material.made(tool), name=name, description=description
    )


def _read_action_sets(strategy: dict[Any, Any]) -> list[Any]:
    if "action_sets" not in strategy:
        raise DesignError("'action_sets' is missing; give a list of action plans")
    plans = strategy["action_sets"]
    if not isinstance(plans, list) or not plans:
        what = "an empty list" if plans == [] else kind(plans)
        raise DesignError(f"'action_sets' is {what}; give a list of action plans")
    return plans


def _count_plans(strategy: object) -> int:
    """The number of candidates of a strategy that can't be read."""
    plans = strategy.get("action_sets") if isinstance(strategy, dict) else None
    return max(1, len(plans)) if isinstance(plans, list) else 1


@dataclass(frozen=True)
class Unread:
    """Replaces a strategy that can't be read, and gives the reason."""

    reason: str


def parse_reply(text: str) -> object:
    """Find and parse the JSON document in a model's reply, with or without text around it.

    It is the first object that has strategies; without one, the first object. ``NaN`` and ``Infinity`` are read as
    strings. If the document is malformed, its strategies are read one by one: comments and extra commas are ignored,
    and an `Unread` replaces each strategy that is cut off or still malformed. A reply is cut off after `MAX_REPLY`
    characters.

    Raises:
        DesignError: there is no object, or it is malformed and has no sound strategy; gives line and column.
    """
    text = text[:MAX_REPLY]
    first: object = None
    failure: tuple[int, DesignError] | None = None
    start = text.find("{")
    # Each failure counts all lines before it; this many take a second or two.
    for _ in range(100 + 1_000_000_000 // max(1, len(text))):
        if start < 0:
            break
        try:
            document, end = _DECODER.raw_decode(text, start)
        except json.JSONDecodeError as error:
            # An object that begins before the error would be an inner one.
            end = max(error.pos, start + 1)
            where = f"line {error.lineno}, column {error.colno}"
            if failure is None or end - start > failure[0]:
                failure = (
                    end - start,
                    DesignError(
                        f"the reply's JSON is malformed at {where}: {error.msg}"
                    ),
                )
        except (
            ValueError,
            RecursionError,
        ) as error:  # an integer of thousands of digits; deep nesting
            raise DesignError(
                f"the reply's JSON at position {start} can't be read: {_reason(error)}"
            ) from error
        else:
            if "strategies" in document:
                return document
            first = document if first is None else first
        start = text.find("{", end)
    if failure is not None:
        saved = _save_sound(text)
        if saved is not None:
            return saved
        raise failure[1]
    if first is None:
        raise DesignError(f"the reply has no JSON object; {_EXPECTED}")
    return first


def _save_sound(text: str) -> dict[str, Any] | None:
    """Read the strategies of a malformed document one by one; None: none of them is sound."""
    opening = _OPENING.search(text)
    if opening is None:
        return None
    strategies: list[Any] = []
    malformed = reread = 0
    position, end = opening.end(), len(text)
    blanked = False
    while True:
        separators = _SEPARATORS.match(text, position)
        assert separators is not None  # it matches nothing, too
        position = separators.end()
        if position >= end or text[position] == "]":
            break
        try:
            strategy, position = _DECODER.raw_decode(text, position)
        except (ValueError, RecursionError) as error:
            reread += _read_until(error, end) - position
            if not blanked:
                text, blanked = (
                    text[:position] + _NOT_JSON.sub(_blank, text[position:]),
                    True,
                )
                continue
            malformed += 1
            strategies.append(_unread(text, position))
            following = _STRATEGY.search(text, position + 1)
            if following is None or malformed == MAX_MALFORMED or reread > MAX_REREAD:
                break
            position = following.start()
        else:
            strategies.append(strategy)
            if len(strategies) >= MAX_SAVED:
                break
    if len(strategies) == malformed:
        return None
    if position >= end and not malformed:
        strategies.append(_unread(text, position))
    return {"strategies": strategies}


def _read_until(error: Exception, end: int) -> int:
    """How far the decoder read before it failed, at most."""
    if isinstance(error, json.JSONDecodeError) and not error.msg.startswith(
        "Unterminated string"
    ):
        return error.pos
    return end


def _unread(text: str, position: int) -> Unread:
    line = text.count("\n", 0, position) + 1
    return Unread(
        f"the strategy is cut off or malformed (it begins at line {line} of the reply)"
    )


def _blank(match: re.Match[str]) -> str:
    """A string as it is; anything else as blanks and line breaks, so that positions stay the same."""
    return match[0] if match[0].startswith('"') else re.sub(r"[^\n]", " ", match[0])


def _reason(error: Exception) -> str:
    return (
        "it is nested too deep"
        if isinstance(error, RecursionError)
        else "a number has too many digits"
    )


def load_designs(path: Path) -> object:
    """Read the document in a designs file, for `read_designs`.

    Raises:
        UserError: the file can't be read, or holds no designs document.
    """
    text, what = read_text(path, f"designs file {path}"), f"designs file {path}"
    try:
        document: object = _DECODER.decode(text)
        _strategies(document)
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise UserError(
            f"{what} is malformed JSON at {where}: {error.msg}; {_EXPECTED}"
        ) from error
    except DesignError as error:
        raise UserError(f"{what}: {error}") from error
    except (ValueError, RecursionError) as error:
        raise UserError(f"{what} can't be read as JSON: {_reason(error)}") from error
    return document


def load_tool(
    path: Path, number: int, representation: ToolRepresentation, task: Task
) -> Tool:
    """Read the tool of a strategy in a designs file, whatever rules it breaks.

    Raises:
        UserError: there is no such strategy, or its tool can't be read.
    """
    strategies, given = _strategies(load_designs(path)), representation.given(task)
    if number not in range(len(strategies)):
        raise UserError(
            f"{path} has {len(strategies)} strategies; there is no strategy={number}"
        )
    strategy = strategies[number]
    try:
        if not isinstance(strategy, dict):
            raise DesignError(f"it is {kind(strategy)}, not an object")  # noqa: TRY301
        gripper = _read_gripper(strategy, given)
        return _parsed(representation, strategy, gripper) if given is None else given
    except DesignError as error:
        raise UserError(
            f"{path}: the tool of strategy {number} can't be read: {error}"
        ) from error


def save_design(
    candidate: Candidate, representation: ToolRepresentation, folder: Path
) -> None:
    """Write ``design.json``, a designs file with one candidate."""
    folder.mkdir(parents=True, exist_ok=True)
    document = {"strategies": [dump_design(candidate, representation)]}
    (folder / "design.json").write_text(
        json.dumps(document, indent=2) + "\n", encoding="utf-8"
    )


def dump_design(
    candidate: Candidate, representation: ToolRepresentation
) -> dict[str, Any]:
    """Write a candidate as a strategy of a designs document, with its one action plan.

    Raises:
        ValueError: the candidate has no tool.
    """
    tool = candidate.tool
    if tool is None:
        raise ValueError(
            f"candidate {candidate.id} has no tool to write: {candidate.problem}"
        )
    return {
        "strategy_name": candidate.strategy_name,
        "strategy_description": candidate.strategy_description,
        "tool_name": tool.name,
        "tool_description": tool.description,
        "gripper": tool.gripper,
        **representation.dump(tool),
        "action_description": candidate.action_description,
        **(
            {"action": candidate.plan.action}
            if candidate.plan.action != Waypoints.action
            else {}
        ),
        "action_sets": [candidate.plan.dump()],
    }
