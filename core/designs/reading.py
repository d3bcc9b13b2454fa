"""Read candidates from a designs document, which a model or a person wrote, and write them back.

A document is an object ``{"strategies": [...]}``. A design holds the fields of its tool representation and
``action_sets``, a list of action plans; ``action`` (the representation of the plans, default ``waypoints``),
``gripper`` (default false), ``strategy_name``, ``strategy_description``, ``tool_name``, ``tool_description``,
``action_description``, ``fixture`` (`core.designs.tool_fields`) and ``parents`` (ids of the elites that it derives
from) are optional. Other fields are ignored.
Other spellings that have one meaning are read, too (`core.designs.replies.Reader`).
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from core.design import Candidate, DesignError, Tool
from core.designs.planning import named_actions, parse_plan
from core.designs.replies import EXPECTED, Fields, parse_reply, reader
from core.designs.rules import check_tool, given_tool
from core.designs.start import SpawnRules
from core.designs.tool_fields import (
    dump_tool,
    read_fields,
    read_gripper,
    read_tool,
    read_words,
)
from core.errors import Refusal, UsageError, UserError
from core.interfaces import ActionRepresentation, Task, ToolRepresentation, Waypoints
from core.plugins import installed
from core.plugins.blame import call_part
from core.support.files import read_text
from core.support.text import kind
from core.values.plans import NO_PLAN


def read_designs(
    document: object,
    representation: ToolRepresentation,
    task: Task,
    *,
    base: Candidate = Candidate(None, NO_PLAN),  # noqa: B008 - frozen
    elites: tuple[str, ...] = (),
    most: tuple[int | None, int | None] = (None, None),
    actions: ActionRepresentation | None = None,
    start: SpawnRules | None = None,
) -> list[Candidate]:
    """Read one candidate per action plan, in order, numbered by design and action from 0.

    A design that breaks a rule gives candidates with a `Candidate.problem`: all of a tool that breaks it,
    and a single one if the plans can't be counted. Candidates of a design share one tool.

    Args:
        document: what was read from JSON.
        representation: reads the tools.
        task: what the designs are for.
        base: has the generation and the agent of the candidates.
        elites: the ids that a design may name as ``parents``; others are ignored.
        most: how many designs are read, and plans of each; None: all.
        actions: reads the plans; None: the one that a design names.
        start: tools are to obey these rules, too; None: that is found out when they are tried.

    Raises:
        DesignError: the document has no designs at all.

    For example, what is wrong with the designs of a file::

        for candidate in read_designs(load_designs(path), representation, task):
            print(candidate.id, candidate.problem or "sound")
    """
    n_tool, n_action = most
    candidates: list[Candidate] = []

    for number, design in enumerate(list_designs(document)[:n_tool]):
        parents = _read_parents(design, elites)
        placed = replace(base, design=number, parents=parents)
        found = _read_design(design, placed, representation, task, actions, start)
        candidates += _choose_plans([*found], n_action)

    return candidates


def _choose_plans(found: list[Candidate], most: int | None) -> list[Candidate]:
    """Choose at most so many of a design's plans, in order: of more, the sound ones go first."""
    if most is None or len(found) <= most:
        return found

    sound_first = sorted(found, key=lambda candidate: candidate.problem is not None)
    return sorted(sound_first[:most], key=lambda candidate: candidate.action)


def list_designs(document: object) -> list[Any]:
    """Return the designs of a designs document, as they are written: each may still be unreadable.

    Raises:
        DesignError: it has none.
    """
    found = reader().list_designs(document)
    if not found:
        raise DesignError(f"the document has no designs; {EXPECTED}")
    return found


def find_representations(
    document: object, representation: ToolRepresentation
) -> list[str]:
    """Find the tool representations that a document is written for, where no design has a field of the given one.

    Args:
        document: of designs.
        representation: that is to read them.

    Returns:
        Their names; empty: a design has a field of ``representation``, or it asks for none.
    """
    wanted = _get_schema(representation)
    designs = [item for item in list_designs(document) if isinstance(item, dict)]
    if not wanted or any(_has_field(design, wanted) for design in designs):
        return []

    found = []
    for name in installed().names("tool"):
        factory = installed().factory("tool", name)
        parameters = inspect.signature(factory).parameters.values()
        if any(parameter.default is parameter.empty for parameter in parameters):
            continue

        try:
            schema = _get_schema(factory())
        except UsageError:  # its settings name what it needs, such as a file
            continue

        if any(not schema.keys().isdisjoint(design) for design in designs):
            found.append(name)

    return found


def _has_field(design: Fields, schema: Mapping[str, Any]) -> bool:
    """Report whether a design has a field of a schema, by any spelling of its name."""
    try:
        return not schema.keys().isdisjoint(reader().read_fields(design, schema))
    except DesignError:  # a name has two meanings
        return True


def _get_schema(representation: ToolRepresentation) -> dict[str, Any]:
    """Return the fields of a tool representation; empty: it has none, or fails, which its designs then say."""
    try:
        schema: dict[str, Any] = call_part(representation, "schema", dict)
    except DesignError:
        return {}

    return schema


def load_designs(path: Path, within: Path | None = None) -> object:
    """Read the document in a designs file, for `read_designs`; a model's reply is one, too.

    Args:
        path: of the file, JSON or a text that holds it.
        within: a folder that it must lie in, links followed; None: anywhere.

    Raises:
        UserError: the file can't be read, or holds no designs document.
    """
    what = f"designs file {path}"
    try:
        document = parse_reply(read_text(path, what, within=within))
        list_designs(document)
    except DesignError as error:
        raise UserError(f"{what}: {error}") from error
    return document


def load_tool(
    path: Path, number: int, representation: ToolRepresentation, task: Task
) -> Tool:
    """Read the tool of a design in a designs file, whatever rules it breaks.

    Args:
        path: of the file.
        number: of the design, from 0.
        representation: reads the tool; if it gives one itself, that is returned.
        task: what the tool is for.

    Raises:
        UserError: there is no such design, or its tool can't be read.
    """
    candidates = read_designs(load_designs(path), representation, task)
    by_design = {candidate.design: candidate for candidate in candidates}
    if number not in by_design:
        raise UserError(
            f"{path} has {len(by_design)} designs; there is no strategy={number}"
        )

    candidate = by_design[number]
    if candidate.tool is None:
        raise UserError(
            f"{path}: the tool of design {number} can't be read: {candidate.problem}"
        )

    return candidate.tool


def dump_design(
    candidate: Candidate, representation: ToolRepresentation
) -> dict[str, Any]:
    """Write a candidate as a design of a designs document, with its one action plan.

    Raises:
        ValueError: the candidate has no tool.
    """
    design = dump_names(candidate)
    assert candidate.tool is not None
    design |= dump_tool(candidate.tool, representation)
    design["action_description"] = candidate.action_description
    if candidate.plan.action != Waypoints.action:
        design["action"] = candidate.plan.action
    design["action_sets"] = [candidate.plan.dump()]

    return design


def dump_names(candidate: Candidate) -> dict[str, Any]:
    """Write what a design says of itself and of its tool, whatever the representation.

    Raises:
        ValueError: the candidate has no tool.
    """
    tool = candidate.tool
    if tool is None:
        raise ValueError(
            f"candidate {candidate.id} has no tool to write: {candidate.problem}"
        )

    return {
        "strategy_name": candidate.design_name,
        "strategy_description": candidate.design_description,
        "tool_name": tool.name,
        "tool_description": tool.description,
        "gripper": tool.gripper,
    }


def _read_design(
    design: object,
    base: Candidate,
    representation: ToolRepresentation,
    task: Task,
    actions: ActionRepresentation | None,
    start: SpawnRules | None,
) -> Iterator[Candidate]:
    """Yield the candidates of a design; ``base`` holds what is known of them."""
    try:
        fields = read_fields(design, representation)
        given = given_tool(representation, task)
        gripper = read_gripper(fields, given, task)
        base = replace(
            base,
            tool=given,
            design_name=read_words(fields, "strategy_name"),
            design_description=read_words(fields, "strategy_description"),
            action_description=read_words(fields, "action_description"),
        )
        base = _read_tool(fields, base, representation, task, gripper, start)
        closes = gripper or representation.grips
        actions = actions or named_actions(fields)
        plans = _read_action_sets(fields, actions, closes)
    except DesignError as error:
        if base.problem is None:
            base = replace(base, problem=str(error), refusals=error.refusals)
        for action in range(max(1, len(_list_written(design, "action_sets")))):
            yield replace(base, action=action)
        return

    for action, raw in enumerate(plans):
        # Poses alone leave off what is switched.
        switches = gripper or (closes and not _is_bare(raw))
        yield _read_plan(raw, replace(base, action=action), actions, switches)


def _read_tool(
    fields: Fields,
    base: Candidate,
    representation: ToolRepresentation,
    task: Task,
    gripper: bool,
    start: SpawnRules | None,
) -> Candidate:
    """Read the tool of a design into a candidate, unless one is given; with the rule that it breaks, if any."""
    tool = base.tool
    problem = None
    refusals: tuple[Refusal, ...] = ()

    try:
        if tool is None:
            tool = read_tool(fields, representation, gripper, task)
            check_tool(tool, task.robot, representation.material)
        if start is not None:
            start.check(tool)
    except DesignError as error:
        problem = str(error)
        refusals = error.refusals

    return replace(base, tool=tool, problem=problem, refusals=refusals)


def _read_plan(
    raw: object, base: Candidate, actions: ActionRepresentation, gripper: bool
) -> Candidate:
    """Read an action plan into a candidate; a fault of it is added to that of the tool.

    Args:
        raw: the plan as it is written, or why it can't be read.
        base: the candidate without its plan.
        actions: reads the plan.
        gripper: whether plans close the tool's gripper, or switch a grip.
    """
    try:
        if isinstance(raw, DesignError):
            raise raw
        return replace(base, plan=parse_plan(actions, raw, gripper))
    except DesignError as error:
        faults = filter(None, (base.problem, f"action plan {base.action + 1}: {error}"))
        refusals = (*base.refusals, *error.refusals)
        return replace(base, problem="; ".join(faults), refusals=refusals)


def _is_bare(raw: object) -> bool:
    """Report whether a plan is a list of poses alone: of six numbers each."""
    return isinstance(raw, list) and all(
        isinstance(row, list) and len(row) == 6 for row in raw
    )


def _read_parents(design: object, elites: tuple[str, ...]) -> tuple[str, ...]:
    """Return the elites that a design names as its parents; what else it names is ignored."""
    named = _list_written(design, "parents")
    return tuple(elite for elite in elites if elite in named)


def _list_written(design: object, name: str) -> list[Any]:
    """Return the list that a design has under a name, read or not; empty: it has none."""
    written = design.get(name) if isinstance(design, dict) else None
    return written if isinstance(written, list) else []


def _read_action_sets(
    fields: Fields, actions: ActionRepresentation, gripper: bool
) -> list[Any]:
    """List a design's action plans as they are written; a `DesignError` stands for one that can't be read.

    Raises:
        DesignError: there are none.
    """
    schema = call_part(actions, "schema", dict, gripper=gripper)
    plans = reader().list_plans(fields.get("action_sets"), schema, gripper=gripper)
    if not isinstance(plans, list) or not plans:
        what = kind(plans) if plans else "missing or empty"
        raise DesignError(f"'action_sets' is {what}; give a list of action plans")
    return plans
