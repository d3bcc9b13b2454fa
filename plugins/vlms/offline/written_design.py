"""A design of a designs document: a tool and its plans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from core.design import Tool
from core.designs.tool_fields import dump_fixture
from core.interfaces import ToolRepresentation
from plugins.vlms.offline.chaining import use_again
from plugins.vlms.offline.paths import SampledPlan
from plugins.vlms.offline.sampler import FreshDesign, Sampler


@dataclass(frozen=True, eq=False)
class Design:
    """A tool and its plans, with what the document says of them.

    Attributes:
        name: what it is, in a few words.
        description: what it is, in a sentence.
        tool: a new one, or the one that was given.
        plans: for the tool.
        parents: ids of the candidates that it comes from.
    """

    name: str
    description: str
    tool: Tool
    plans: Sequence[SampledPlan]
    parents: Sequence[str]


def plans_of_fresh_design(
    design: FreshDesign,
    tool: Tool,
    count: int,
    sampler: Sampler,
) -> list[SampledPlan]:
    """Return the plan of a fresh design, and others with the same head, for a tool that has it.

    Args:
        design: which gives the first plan and the head.
        tool: the design's own, or one that has it as a part.
        count: of plans.
        sampler: of the other plans.
    """
    plans = [design.plan]
    while len(plans) < count:
        plans.append(use_again(design, tool, sampler))
    return plans


def write_tool(
    design: Design,
    representation: ToolRepresentation,
    *,
    is_given: bool = False,
) -> dict[str, Any]:
    """Write what a designs document says of a design's tool.

    Args:
        design: with or without plans.
        representation: how the document describes tools.
        is_given: whether the tool is not asked for.
    """
    tool = design.tool
    fields: dict[str, Any] = {
        "strategy_name": design.name,
        "strategy_description": design.description,
    }
    if not is_given:
        fields["tool_name"] = tool.name
        fields["tool_description"] = tool.description

    fields["gripper"] = tool.gripper
    return fields | representation.dump(tool)


def write_design(
    design: Design,
    sampler: Sampler,
    *,
    is_given: bool,
) -> dict[str, Any]:
    """Write a design as in a designs document.

    Args:
        design: with plans.
        sampler: which knows how plans are written.
        is_given: whether its tool is not asked for.
    """
    representation = sampler.brief.representation
    fields = write_tool(design, representation, is_given=is_given)
    if not is_given:
        fixture = sampler.layout.fixture or design.tool.fixture
        fields |= dump_fixture(replace(design.tool, fixture=fixture), representation)

    texts = [f"{i}: {plan.text}" for i, plan in enumerate(design.plans, start=1)]
    fields["action_description"] = " | ".join(texts)

    fields["action_sets"] = [
        _write_plan(number, plan, design.tool, sampler)
        for number, plan in enumerate(design.plans)
    ]
    if design.parents:
        fields["parents"] = design.parents
    return fields


def _write_plan(
    number: int, plan: SampledPlan, tool: Tool, sampler: Sampler
) -> list[Any]:
    """Write the plan of a number. Where guards are known, every other plan has one; where looks are, others look."""
    actions = sampler.brief.actions
    writer = sampler.writer
    if actions.guards and number % 2 == 0:
        return writer.write_with_guard(plan, tool)
    if actions.looks and (actions.guards or number % 2 == 0):
        return writer.write_with_looks(plan, near=sampler.looks_near)
    return writer.write(plan.rows, plan.anchors)
