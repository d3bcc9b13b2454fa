"""The embedded designer: requests in, JSON replies out."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from core.design import DesignError, Tool
from core.designs.planning import look
from core.interfaces import VLM, ActionRepresentation, Brief, Perception, Reply, Request
from plugins.vlms.offline.evolve import Elite, breed, elites_with, offspring_plans
from plugins.vlms.offline.plans import turn_of
from plugins.vlms.offline.sampler import Layout, SampledPlan, Sampler
from plugins.vlms.offline.scene_analysis import NothingToMove
from plugins.vlms.offline.several import PartSeed, tools_answer

_LAYOUTS = 4  # others in which an anchored plan is checked
_DRAWN = 32  # layouts, of which the most unlike are chosen


class OfflineDesigner(VLM):
    """Designs tools and plans by classical means, from the scene's geometry and the task's goals.

    It uses no language model: it reads a request's brief, not its messages, and returns the document that a model is
    asked for. The same brief gets the same answer.
    """

    model = "offline (embedded designer, no language model)"
    criticises = False
    sees = False

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        for request in requests:
            try:
                yield Reply(request.id, json.dumps(answer(request.brief), indent=1), self.model)
            except (NothingToMove, DesignError) as error:
                yield Reply(request.id, "", self.model, error=str(error))


def answer(brief: Brief) -> dict[str, Any]:
    """The document for one brief.

    Raises:
        NothingToMove: see `SceneAnalysis`.
        DesignError: plans can't be written as the brief asks.
    """
    if len(brief.task.parts) > 1:
        return tools_answer(brief)
    layout = Layout(brief)
    others = list[Layout]()
    if brief.task.ranges and type(brief.actions).anchor is not ActionRepresentation.anchor:
        if (turn := turn_of(layout.analysis, layout.seen)) is not None:
            layout = Layout(brief, turn)
        others = [Layout(other) for other in _unlike(brief)]
    sampler = Sampler(brief, layout, others)
    elites = elites_with(brief.elites, brief.gripper, layout.seen)
    strategies = [_strategy(sampler, elites) for _ in range(brief.n_tool)]
    solids = layout.analysis.solids
    moving = sum(len(goal.bodies) for goal in layout.analysis.goals)
    analysis = f"{len(solids)} bodies have collision shapes; to be moved: {moving}."
    return {"scene_analysis": analysis, "strategies": strategies}


def _strategy(sampler: Sampler, elites: Sequence[Elite]) -> dict[str, Any]:
    """Design a tool with plans, or plans for the given tool: offspring of the elites, or fresh ones."""
    brief = sampler.brief
    given = brief.representation.given(brief.task)
    parents: list[str] = []
    if given is not None:
        tool = given
        plans, parents = _plans_for(tool, sampler, elites)
        name = "the given tool"
        description = f"It {plans[0].text}."
    elif elites:
        name, description, tool, plans, parents = breed(elites, brief.n_action, sampler)
    else:
        tool, head, pose, plan = sampler.invent()
        plans = [plan, *(sampler.use(tool, lambda _: (head, pose)) for _ in range(brief.n_action - 1))]
        parents = [elite.candidate.id for elite in brief.elites[:1]]  # none has this kind of tool
        name = f"{head.use} with {tool.name}"
        description = f"The {head.kind} {plan.text}."
    action_sets = []
    for i, plan in enumerate(plans):
        if brief.actions.guards and i % 2 == 0:
            action_sets.append(sampler.written_with_guard(plan, tool))
        else:
            action_sets.append(sampler.written(plan.rows, plan.anchors))
    fields: dict[str, Any] = {"strategy_name": name, "strategy_description": description}
    if given is None:
        fields |= {"tool_name": tool.name, "tool_description": tool.description}
    fields |= {"gripper": tool.gripper, **brief.representation.dump(tool)}
    fields["action_description"] = " | ".join(f"{i}: {plan.text}" for i, plan in enumerate(plans, start=1))
    fields["action_sets"] = action_sets
    return fields | {"parents": parents} if parents else fields


def _plans_for(tool: Tool, sampler: Sampler, elites: Sequence[Elite]) -> tuple[list[SampledPlan], list[str]]:
    """Make plans for the given tool, and name their parents."""
    count = sampler.brief.n_action
    if elites:
        elite = elites[int(sampler.rng.integers(len(elites)))]
        return offspring_plans(elite, tool, count, sampler), [elite.id]
    seed = PartSeed.of(tool, sampler.brief.task)
    if seed is None:
        return [sampler.use_any(tool) for _ in range(count)], []
    _, head, pose, plan = seed.invent(sampler.brief)
    return [plan, *(sampler.use(tool, lambda _: (head, pose)) for _ in range(count - 1))], []


def _unlike(brief: Brief) -> list[Brief]:
    """Choose briefs of layouts that are as unlike this one and each other as can be, with the same bodies."""
    drawn = [replace(brief, scene_seed=brief.scene_seed + i) for i in range(_DRAWN)]
    seen = [look(one.task, one.scene_seed, Perception()).poses for one in drawn]
    same = [i for i, poses in enumerate(seen) if list(poses) == list(seen[0])]
    places = np.array([np.ravel([pose.matrix[:3] for pose in seen[i].values()]) for i in same])
    chosen = [0]
    while len(chosen) < min(1 + _LAYOUTS, len(same)):
        apart = np.linalg.norm(places[:, None] - places[chosen], axis=-1).min(axis=1)
        chosen.append(int(apart.argmax()))
    return [drawn[same[i]] for i in chosen[1:]]
