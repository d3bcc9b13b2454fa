"""The embedded designer: requests in, JSON replies out."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from core.design import DesignError, Tool
from core.designs.planning import look
from core.designs.rules import SpawnRules
from core.geometry import Array
from core.interfaces import VLM, ActionRepresentation, Anchor, Brief, Perception, Reply, Request, Seen, Waypoints
from plugins.vlms.offline.anchoring import turn_of
from plugins.vlms.offline.evolve import Elite, breed, elites_with, offspring_plans
from plugins.vlms.offline.invent import Use, Workshop
from plugins.vlms.offline.recognize import recognize
from plugins.vlms.offline.scene_analysis import NothingToMove, Sight
from plugins.vlms.offline.tools import rods

_DIGITS = 5  # hundredths of a millimetre
_LAYOUTS, _DRAWN = 4, 32  # others in which an anchored plan is checked, the most unlike of so many
_ANCHORING = 1  # keeps its random numbers apart from others of the same seed


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
        NothingToMove: see `Sight.of`.
        DesignError: plans can't be written as the brief asks.
    """
    sight, seen = Sight.of(brief), _seen(brief)
    anchored = bool(brief.task.ranges) and type(brief.actions).anchor is not ActionRepresentation.anchor
    if anchored and (turn := turn_of(sight, seen)) is not None:
        sight, seen = Sight.of(brief, turn), Seen({name: turn @ pose for name, pose in seen.poses.items()})
    spawn = SpawnRules(brief.task, brief.scene_seed)
    rng, anchoring = np.random.default_rng(brief.seed), np.random.default_rng([brief.seed, _ANCHORING])
    workshop = Workshop(sight, seen, spawn, brief.gripper, rng, anchoring, brief.representation.material)
    if anchored:
        workshop.elsewhere = [
            (Sight.of(other), _seen(other), SpawnRules(other.task, other.scene_seed)) for other in _unlike(brief)
        ]
        workshop.read = lambda rows, anchors: brief.actions.parse(
            _written(brief, seen, rows, anchors), gripper=brief.gripper
        )
    given = brief.representation.given(brief.task)
    elites = elites_with(brief.elites, brief.gripper, seen)
    strategies = []
    for _ in range(brief.n_tool):
        if given is not None:
            strategies.append(_given(brief, given, elites, workshop))
        elif elites:
            name, description, tool, uses, parents = breed(elites, brief.n_action, workshop)
            strategies.append(
                _strategy(brief, workshop.seen, name, description, _in_its_shapes(tool, brief, workshop), uses, parents)
            )
        else:
            strategies.append(_fresh(brief, workshop))
    moving = sum(len(goal.bodies) for goal in sight.goals)
    analysis = f"{len(sight.things)} bodies have collision shapes; to be moved: {moving}."
    return {"scene_analysis": analysis, "strategies": strategies}


def _fresh(brief: Brief, workshop: Workshop) -> dict[str, Any]:
    tool, head, at, use = workshop.invent()
    uses = [use, *(workshop.use(tool, lambda _: (head, at)) for _ in range(brief.n_action - 1))]
    description, parents = f"The {head.kind} {use.text}.", [elite.candidate.id for elite in brief.elites[:1]]
    if parents:
        description += " A fresh design: no elite has this kind of tool."
    tool = _in_its_shapes(tool, brief, workshop)
    return _strategy(brief, workshop.seen, f"{head.use} with {tool.name}", description, tool, uses, parents)


def _in_its_shapes(tool: Tool, brief: Brief, workshop: Workshop) -> Tool:
    """Make bars round where the representation has rods."""
    if "cylinder" not in brief.representation.shapes:
        return tool
    changed = rods(tool)
    return changed if workshop.accepts(changed) else tool


def _given(brief: Brief, tool: Tool, elites: Sequence[Elite], workshop: Workshop) -> dict[str, Any]:
    """Plans for a given tool."""
    rng = workshop.rng
    if elites:
        elite = elites[int(rng.integers(len(elites)))]
        uses = offspring_plans(elite, tool, brief.n_action, workshop)
        return _strategy(
            brief, workshop.seen, "the given tool", f"Plans varied from {elite.id}.", tool, uses, [elite.id]
        )
    uses = [workshop.use(tool, lambda errand: recognize(tool, errand, rng)) for _ in range(brief.n_action)]
    return _strategy(brief, workshop.seen, "the given tool", f"It {uses[0].text}.", tool, uses)


def _strategy(
    brief: Brief, seen: Seen, name: str, description: str, tool: Tool, uses: Sequence[Use], parents: Sequence[str] = ()
) -> dict[str, Any]:
    named = {"tool_name": tool.name, "tool_description": tool.description}
    return {
        "strategy_name": name,
        "strategy_description": description,
        **({} if brief.representation.given(brief.task) is not None else named),
        "gripper": tool.gripper,
        **brief.representation.dump(tool),
        "action_description": " | ".join(f"{i}: {use.text}" for i, use in enumerate(uses, start=1)),
        "action_sets": [_written(brief, seen, use.plan, use.anchors) for use in uses],
        **({"parents": parents} if parents else {}),
    }


def _written(brief: Brief, seen: Seen, rows: Array, anchors: Sequence[Anchor]) -> list[Any]:
    return brief.actions.anchor(Waypoints(np.round(rows, _DIGITS) + 0.0), anchors, seen)


def _unlike(brief: Brief) -> list[Brief]:
    """Choose briefs of layouts that are as unlike this one and each other as can be, with the same bodies."""
    drawn = [replace(brief, scene_seed=brief.scene_seed + i) for i in range(_DRAWN)]
    seen = [_seen(one).poses for one in drawn]
    same = [i for i, poses in enumerate(seen) if list(poses) == list(seen[0])]
    places = np.array([np.ravel([pose.matrix[:3] for pose in seen[i].values()]) for i in same])
    chosen = [0]
    while len(chosen) < min(1 + _LAYOUTS, len(same)):
        apart = np.linalg.norm(places[:, None] - places[chosen], axis=-1).min(axis=1)
        chosen.append(int(apart.argmax()))
    return [drawn[same[i]] for i in chosen[1:]]


def _seen(brief: Brief) -> Seen:
    return look(brief.task, brief.scene_seed, Perception())
