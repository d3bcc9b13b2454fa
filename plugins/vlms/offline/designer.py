"""The embedded designer: requests in, JSON replies out."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from core.design import DesignError, Tool
from core.designs.planning import look
from core.interfaces import VLM, ActionRepresentation, Brief, Perception, Reply, Request, Seen
from plugins.vlms.offline.evolve import Elite, breed, elites_with, offspring_plans
from plugins.vlms.offline.invent import Layout, Use, Workshop
from plugins.vlms.offline.plans import turn_of
from plugins.vlms.offline.scene_analysis import NothingToMove, SceneAnalysis
from plugins.vlms.offline.tools import recognize, rods

_LAYOUTS, _DRAWN = 4, 32  # others in which an anchored plan is checked, the most unlike of so many


class OfflineDesigner(VLM):
    """Designs tools and plans by classical means, from the scene's geometry and the task's goals.

    It uses no language model: it reads a request's brief, not its messages, and returns the document that a model is
    asked for. The same brief gets the same answer.
    """

    model = "offline (embedded designer, no language model)"
    criticises = False

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        for request in requests:
            try:
                yield Reply(request.id, json.dumps(answer(request.brief), indent=1), self.model)
            except (NothingToMove, DesignError) as error:
                yield Reply(request.id, "", self.model, error=str(error))


def answer(brief: Brief) -> dict[str, Any]:
    """The document for one brief.

    Raises:
        NothingToMove: see `SceneAnalysis.of`.
        DesignError: plans can't be written as the brief asks.
    """
    layout, others = Layout.of(brief), list[Layout]()
    if brief.task.ranges and type(brief.actions).anchor is not ActionRepresentation.anchor:
        if (turn := turn_of(layout.analysis, layout.seen)) is not None:
            seen = Seen({name: turn @ pose for name, pose in layout.seen.poses.items()})
            layout = replace(layout, analysis=SceneAnalysis.of(brief, turn), seen=seen)
        others = [Layout.of(other) for other in _unlike(brief)]
    workshop = Workshop(brief, layout, others)
    given = brief.representation.given(brief.task)
    elites = elites_with(brief.elites, brief.gripper, layout.seen)
    if given is not None:
        strategies = [_given(workshop, given, elites) for _ in range(brief.n_tool)]
    elif elites:
        strategies = [_bred(workshop, elites) for _ in range(brief.n_tool)]
    else:
        strategies = [_fresh(workshop) for _ in range(brief.n_tool)]
    things, moving = layout.analysis.things, sum(len(goal.bodies) for goal in layout.analysis.goals)
    analysis = f"{len(things)} bodies have collision shapes; to be moved: {moving}."
    return {"scene_analysis": analysis, "strategies": strategies}


def _fresh(workshop: Workshop) -> dict[str, Any]:
    brief = workshop.brief
    tool, head, pose, use = workshop.invent()
    uses = [use, *(workshop.use(tool, lambda _: (head, pose)) for _ in range(brief.n_action - 1))]
    description, parents = f"The {head.kind} {use.text}.", [elite.candidate.id for elite in brief.elites[:1]]
    if parents:
        description += " A fresh design: no elite has this kind of tool."
    tool = _in_its_shapes(workshop, tool)
    return _strategy(workshop, f"{head.use} with {tool.name}", description, tool, uses, parents)


def _bred(workshop: Workshop, elites: Sequence[Elite]) -> dict[str, Any]:
    name, description, tool, uses, parents = breed(elites, workshop.brief.n_action, workshop)
    return _strategy(workshop, name, description, _in_its_shapes(workshop, tool), uses, parents)


def _in_its_shapes(workshop: Workshop, tool: Tool) -> Tool:
    """Make bars round where the representation has rods."""
    if "cylinder" not in workshop.brief.representation.shapes:
        return tool
    changed = rods(tool)
    return changed if workshop.accepts(changed) else tool


def _given(workshop: Workshop, tool: Tool, elites: Sequence[Elite]) -> dict[str, Any]:
    """Plans for a given tool."""
    rng, count = workshop.rng, workshop.brief.n_action
    if elites:
        elite = elites[int(rng.integers(len(elites)))]
        uses = offspring_plans(elite, tool, count, workshop)
        return _strategy(workshop, "the given tool", f"Plans varied from {elite.id}.", tool, uses, [elite.id])
    uses = [workshop.use(tool, lambda errand: recognize(tool, errand, rng)) for _ in range(count)]
    return _strategy(workshop, "the given tool", f"It {uses[0].text}.", tool, uses)


def _strategy(
    workshop: Workshop, name: str, description: str, tool: Tool, uses: Sequence[Use], parents: Sequence[str] = ()
) -> dict[str, Any]:
    representation = workshop.brief.representation
    named = {"tool_name": tool.name, "tool_description": tool.description}
    return {
        "strategy_name": name,
        "strategy_description": description,
        **({} if representation.given(workshop.brief.task) is not None else named),
        "gripper": tool.gripper,
        **representation.dump(tool),
        "action_description": " | ".join(f"{i}: {use.text}" for i, use in enumerate(uses, start=1)),
        "action_sets": [workshop.written(use.plan, use.anchors) for use in uses],
        **({"parents": parents} if parents else {}),
    }


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
