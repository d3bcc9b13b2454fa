"""Write elites and critiques for a prompt, as JSON."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from core.design import Tool
from core.designs.prompt_values import RunFacts
from core.designs.reading import dump_names
from core.designs.tool_fields import dump_fixture
from core.interfaces import Brief, Evaluation, ToolRepresentation, Waypoints
from core.simulation.measuring import figures
from core.support.text import clean, number
from core.trial import mean_figure
from core.values.observations import Sight
from plugins.vlms.context.feedback import WHOLE, combined_figures, elite_feedback
from plugins.vlms.context.space import describe_space, describe_sweep

# Characters of a description: of the elites that are shown whole, and of the others.
_WHOLE = 1_000
_SHORT = 240
_NUMBERS = re.compile(r'(\[)\n([^][{}"]*)\n *(\])')
_INNERMOST = re.compile(r"(\{)\n([^{}]*)\n *(\})")


def elites_value(brief: Brief, mounted: Tool, facts: RunFacts) -> str:
    """Write elites as JSON for templates, their ``elites``: each list of numbers and each innermost object on one line.

    Plans and their rollouts are all that plans for a given tool differ in; else the paper shows none, and other prompts
    those of the best `WHOLE`.

    Args:
        brief: with its elites, the best first.
        mounted: the tool on the arm, which this says nothing of.
        facts: of the run: the settings of prompts, and the level at which bodies are described.

    Raises:
        ValueError: an elite has no tool.
    """
    task = brief.task
    sight = facts.level.sight(task, brief.scene_seed)
    given = brief.representation.given(task) is not None
    plans = facts.criticised or given or facts.settings.feedback != "paper"

    entries = []
    tools: set[str] = set()  # of which is said what room they take
    for place, elite in enumerate(brief.elites):
        longest = _WHOLE if place < WHOLE else _SHORT
        entry = describe_design(elite, brief.representation, longest)
        figures = combined_figures(elite, task, sight)

        if figures:
            entry["details"] = round_numbers(figures)

        if plans and (given or place < WHOLE):
            entry |= _describe_rollout(elite, sight)
            tool = elite.candidate.tool
            if tool is not None and not given and tool.content not in tools:
                entry["space"] = describe_space(tool)
                tools.add(tool.content)
        elif plans:  # of the others the components say enough
            del entry["tool_description"]

        entries.append(entry)

    text = _dump(entries)
    for pattern in (_NUMBERS, _INNERMOST):
        text = pattern.sub(_join_lines, text)

    return text


def critiques_value(brief: Brief, mounted: Tool, facts: RunFacts) -> str:
    """Write critiques of elites and of what was tried as JSON for templates, their ``critiques``; empty: no critic.

    Args:
        brief: with its critiques, by candidate.
        mounted: the tool on the arm, which this says nothing of.
        facts: of the run.
    """
    known = {e.candidate.id: e for e in (*brief.tried, *brief.elites)}

    entries = []
    for name, critique in brief.critiques.items():
        entry: dict[str, Any] = {"id": name, "reward": _round_reward(known[name])}
        tool = known[name].candidate.tool

        if tool is not None and tool.name:
            entry["tool_name"] = tool.name

        entries.append({**entry, "critique": critique})

    return _dump(entries) if entries else ""


def _dump(entries: Sequence[dict[str, Any]]) -> str:
    return json.dumps(entries, indent=1, ensure_ascii=False)


def _round_reward(evaluation: Evaluation) -> float:
    """Round a reward to four digits, never up to 1."""
    return float(number(evaluation.reward, 4))


def describe_design(
    elite: Evaluation,
    representation: ToolRepresentation,
    longest: int = _SHORT,
) -> dict[str, Any]:
    """Write the id of an elite, what it earned, its names, and its tool in short.

    Args:
        elite: the evaluation of a candidate.
        representation: how its tool is written.
        longest: of a description, in characters.

    Raises:
        ValueError: it has no tool.
    """
    candidate = elite.candidate
    entry: dict[str, Any] = {
        "id": candidate.id,
        "reward": _round_reward(elite),
    }

    entry |= dump_names(candidate)

    for name in ("strategy_description", "tool_description"):
        entry[name] = clean(entry[name], longest)

    if candidate.plan.action != Waypoints.action:
        entry["action"] = candidate.plan.action

    assert candidate.tool is not None

    entry |= representation.abridge(candidate.tool)
    return entry | dump_fixture(candidate.tool, representation)


def told_figures() -> dict[str, str]:
    """Return the figures that models are told of, and what each is, in words."""
    return {name: figure.words for name, figure in figures().items() if figure.words}


def measured_value(brief: Brief, mounted: Tool, facts: RunFacts) -> dict[str, str]:
    """Say for templates what the figures of elites are, their ``measured``."""
    return told_figures()


def _describe_rollout(elite: Evaluation, sight: Sight) -> dict[str, Any]:
    """Write the plan of an elite, what its tool sweeps, and what was observed."""
    told: dict[str, Any] = {"action_plan": elite.candidate.plan.dump()}
    for name in told_figures():
        told[name] = mean_figure(elite.trials, name)

    described: dict[str, Any] = round_numbers(told)
    swept = describe_sweep(elite.candidate)
    if swept:
        described["swept"] = swept

    described |= elite_feedback(elite, sight)
    if elite.warnings:
        described["warnings"] = [sight.text(warning) for warning in elite.warnings]

    return described


def round_numbers(value: Any) -> Any:
    """Round the numbers of a JSON value to four digits; nan, which JSON has not, becomes null."""
    return json.loads(
        json.dumps(value),
        parse_float=lambda text: round(float(text), 4) + 0.0,  # never -0
        parse_constant=lambda _: None,
    )


def _join_lines(found: re.Match[str]) -> str:
    """Write a list or object of several lines on one."""
    opening, inside, closing = found.groups()
    return opening + re.sub(r"\n *", " ", inside.strip()) + closing
