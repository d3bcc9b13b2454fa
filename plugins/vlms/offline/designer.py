"""The embedded designer: requests in, JSON replies out."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from core.design import DesignError
from core.designs.planning import look
from core.hooks import hookimpl
from core.interfaces import VLM, ActionRepresentation, Brief, Perception, Reply, Request, Task
from core.scene import Goal, Scene
from core.support.cli import say
from plugins.vlms.offline.evolve import Elite, breed, elites_with, offspring_plans
from plugins.vlms.offline.plans import turn_of
from plugins.vlms.offline.sampler import Layout, Sampler
from plugins.vlms.offline.scene_analysis import NothingToMove
from plugins.vlms.offline.several import task_plans, tools_answer

if TYPE_CHECKING:
    from core.events import Run

_LAYOUTS, _DRAWN = 4, 32  # others in which an anchored plan is checked, the most unlike of so many


class OfflineDesigner(VLM):
    """Designs tools and plans by classical means, from the scene's geometry and the task's goals.

    It uses no language model: it reads a request's brief, not its messages, and returns the document that a model is
    asked for. The same brief gets the same answer.
    """

    model = "offline (embedded designer, no language model)"
    criticises = False
    sees = False

    @hookimpl(trylast=True)
    def run_started(self, run: Run) -> None:
        parts = run.task.parts
        left = [f"{f'{task.name}: ' * (len(parts) > 1)}{what}" for task in parts for what in left_out(task, run.seed)]
        if left:
            say(f"the embedded designer does not plan for: {'; '.join(left)}", file=sys.stderr)

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        for request in requests:
            try:
                yield Reply(request.id, json.dumps(answer(request.brief), indent=1), self.model)
            except (NothingToMove, DesignError) as error:
                yield Reply(request.id, "", self.model, error=str(error))


def left_out(task: Task, seed: int) -> list[str]:
    """Name what a task's goals ask that its plans leave out."""
    scene = task.scene(seed)
    balls = {joint.name for joint in scene.joints if joint.kind == "ball"}
    goals = [goal.within(scene) for goal in task.goals if goal.moves]
    cases = {
        "a ball joint's position": any(goal.joint in balls for goal in goals),
        "a turn about the vertical": any(_turns_level(goal, scene) for goal in goals),
        "a time limit": any(goal.by_s is not None for goal in goals),
        "what a soft body does as it gives way": bool(scene.softs),
        "a height, an area or a node": any(g.max_height_m or g.min_area_m2 or g.node is not None for g in goals),
        "a limit of force": any(goal.max_force_n for goal in task.goals),
        "a second goal, where one is a joint's or a turn (each tool is made for one)": task.every
        and len(goals) > 1
        and any(goal.joint or goal.axis for goal in goals),
        "anything but its first free body, as the task has no goals": not goals,
    }
    return [name for name, holds in cases.items() if holds]


def _turns_level(goal: Goal, scene: Scene) -> bool:
    """Report whether a goal's axis must turn about the vertical."""
    if goal.axis is None or not goal.bodies:
        return False
    now = scene[goal.bodies[0]].pose.rotation.apply(np.divide(goal.axis, np.linalg.norm(goal.axis)))
    about = np.cross(now, np.divide(goal.points, np.linalg.norm(goal.points)))
    length = float(np.linalg.norm(about))
    return length > np.sin(np.radians(goal.tolerance_deg)) and abs(float(about[2])) > 0.5 * length


def answer(brief: Brief) -> dict[str, Any]:
    """The document for one brief.

    Raises:
        NothingToMove: see `SceneAnalysis`.
        DesignError: plans can't be written as the brief asks.
    """
    if len(brief.task.parts) > 1:
        return tools_answer(brief)
    layout, others = Layout(brief), list[Layout]()
    if brief.task.ranges and type(brief.actions).anchor is not ActionRepresentation.anchor:
        if (turn := turn_of(layout.analysis, layout.seen)) is not None:
            layout = Layout(brief, turn)
        others = [Layout(other) for other in _unlike(brief)]
    sampler = Sampler(brief, layout, others)
    elites = elites_with(brief.elites, brief.gripper, layout.seen)
    strategies = [_strategy(sampler, elites) for _ in range(brief.n_tool)]
    solids, moving = layout.analysis.solids, sum(len(goal.bodies) for goal in layout.analysis.goals)
    analysis = f"{len(solids)} bodies have collision shapes; to be moved: {moving}."
    return {"scene_analysis": analysis, "strategies": strategies}


def _strategy(sampler: Sampler, elites: Sequence[Elite]) -> dict[str, Any]:
    """Design a tool with plans, or plans for the given tool: offspring of the elites, or fresh ones."""
    brief, rng, representation = sampler.brief, sampler.rng, sampler.brief.representation
    given, feels, parents = representation.given(brief.task), brief.actions.guards, list[str]()
    if given is not None:
        name, tool = "the given tool", given
        if (made := task_plans(sampler, given, elites)) is not None:
            uses, parents = made
            description = f"Plans varied from {parents[0]}." if parents else f"It {uses[0].text}."
        elif elites:
            elite = elites[int(rng.integers(len(elites)))]
            uses, parents = offspring_plans(elite, tool, brief.n_action, sampler), [elite.id]
            description = f"Plans varied from {elite.id}."
        else:
            uses = [sampler.use_any(tool) for _ in range(brief.n_action)]
            description = f"It {uses[0].text}."
    elif elites:
        name, description, tool, uses, parents = breed(elites, brief.n_action, sampler)
    else:
        tool, head, pose, use = sampler.invent()
        uses = [use, *(sampler.use(tool, lambda _: (head, pose)) for _ in range(brief.n_action - 1))]
        name, description = f"{head.use} with {tool.name}", f"The {head.kind} {use.text}."
        if parents := [elite.candidate.id for elite in brief.elites[:1]]:
            description += " A fresh design: no elite has this kind of tool."
    return {
        "strategy_name": name,
        "strategy_description": description,
        **({"tool_name": tool.name, "tool_description": tool.description} if given is None else {}),
        "gripper": tool.gripper,
        **representation.dump(tool),
        "action_description": " | ".join(f"{i}: {use.text}" for i, use in enumerate(uses, start=1)),
        "action_sets": [
            sampler.written_with_guard(use, tool) if feels and i % 2 == 0 else sampler.written(use.rows, use.anchors)
            for i, use in enumerate(uses)
        ],
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
