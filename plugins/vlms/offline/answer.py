"""Answer a brief: tools with plans, or plans for a given tool, fresh ones or offspring of elites."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from core.interfaces import Brief
from plugins.vlms.offline.chaining import invent
from plugins.vlms.offline.evolve import breed
from plugins.vlms.offline.given_tools import plan_for_given_tool
from plugins.vlms.offline.layouts import make_layouts
from plugins.vlms.offline.parents import Parent, find_parents
from plugins.vlms.offline.sampler import Sampler
from plugins.vlms.offline.several import answer_several
from plugins.vlms.offline.written_design import (
    Design,
    plans_of_fresh_design,
    write_design,
)


def answer(brief: Brief, *, looks_near: bool = False) -> dict[str, Any]:
    """Make the document for one brief.

    Args:
        brief: what is asked for.
        looks_near: whether plans that look do so before the tool comes down, too.

    Raises:
        NothingToMove: see `SceneAnalysis`.
        DesignError: plans can't be written as the brief asks.
    """
    if len(brief.task.parts) > 1:
        return answer_several(brief, looks_near=looks_near)

    sampler = Sampler(brief, make_layouts(brief))
    sampler.looks_near = looks_near
    parents = find_parents(brief.elites, brief.gripper, sampler.layout.seen)
    designs = [_make_design(sampler, parents) for _ in range(brief.n_tool)]

    bodies = len(sampler.model.solids)
    moving = sum(len(goal.bodies) for goal in sampler.analysis.goals)
    return {
        "scene_analysis": f"{bodies} bodies have collision shapes; to be moved: {moving}.",
        "strategies": designs,
    }


def _make_design(sampler: Sampler, parents: Sequence[Parent]) -> dict[str, Any]:
    """Make a design, and write it as in the document."""
    brief = sampler.brief
    given = brief.representation.given(brief.task)
    if given is not None:
        design = plan_for_given_tool(given, sampler, parents)
    elif parents:
        design = breed(parents, brief.n_action, sampler)
    else:
        design = _invent(sampler)

    return write_design(design, sampler, is_given=given is not None)


def _invent(sampler: Sampler) -> Design:
    """Design a fresh tool with plans."""
    brief = sampler.brief
    design = invent(sampler)
    tool = design.tool
    head = design.placed.head
    plans = plans_of_fresh_design(design, tool, brief.n_action, sampler)

    description = f"The {head.kind} {design.plan.text}."
    if brief.elites:
        description += " A fresh design: no elite has this kind of tool."

    return Design(
        f"{head.primitive} with {tool.name}",
        description,
        tool,
        plans,
        parents=[elite.candidate.id for elite in brief.elites[:1]],
    )
