"""The embedded designer: requests in, JSON replies out."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from core.design import DesignError, Tool
from core.designs.planning import look
from core.goals import Placed, Reach, Target, limits, reaches
from core.hooks import hookimpl
from core.interfaces import (
    VLM,
    ActionRepresentation,
    Brief,
    Perception,
    Reply,
    Request,
    Task,
)
from core.scene import Scene
from core.support.cli import say
from plugins.vlms.offline.evolve import Elite, breed, elites_with, offspring_plans
from plugins.vlms.offline.plans import turn_of
from plugins.vlms.offline.sampler import Layout, SampledPlan, Sampler
from plugins.vlms.offline.scene_analysis import NothingToMove, turn_between
from plugins.vlms.offline.several import task_plans, tools_answer

if TYPE_CHECKING:
    from core.events import Run

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

    @hookimpl(trylast=True)
    def run_started(self, run: Run) -> None:
        parts = run.task.parts
        left = [
            f"{f'{task.name}: ' * (len(parts) > 1)}{what}"
            for task in parts
            for what in left_out(task, run.seed)
        ]
        if left:
            say(
                f"the embedded designer does not plan for: {'; '.join(left)}",
                file=sys.stderr,
            )

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        for request in requests:
            try:
                yield Reply(
                    request.id, json.dumps(answer(request.brief), indent=1), self.model
                )
            except (NothingToMove, DesignError) as error:
                yield Reply(request.id, "", self.model, error=str(error))


def left_out(task: Task, seed: int) -> list[str]:
    """Name what a task's goals ask that its plans leave out."""
    scene = task.scene(seed)
    balls = {joint.name for joint in scene.joints if joint.kind == "ball"}
    reached = reaches(task.goals)
    goals = [target for goal in reached for target in goal.targets(scene)]
    parts = [part for goal in reached for part in goal.parts]
    cases = {
        "a ball joint's position": any(goal.joint in balls for goal in goals),
        "a turn about the vertical": any(_turns_level(goal, scene) for goal in goals),
        "a time limit": any(goal.by_s is not None for goal in reached),
        "what a soft body does as it gives way": bool(scene.softs),
        "a height, an area or a node": any(_names_no_place(part) for part in parts),
        "a limit of force": any(
            getattr(limit, "max_force_n", 0) for limit in limits(task.goals)
        ),
        "a second goal, where one is a joint's or a turn (each tool is made for one)": task.every
        and len(goals) > 1
        and any(goal.joint or goal.axis for goal in goals),
        "anything but its first free body, as the task has no goals": not goals,
    }
    return [name for name, holds in cases.items() if holds]


def _names_no_place(goal: Reach) -> bool:
    """Report whether a goal is of a kind that says no place to go, or one of a node."""
    if isinstance(goal, Placed):
        return goal.node is not None
    return type(goal) is not Reach and type(goal).aim is Reach.aim


def _turns_level(goal: Target, scene: Scene) -> bool:
    """Report whether a goal's axis must turn about the vertical."""
    if goal.axis is None or not goal.bodies:
        return False
    axis, _ = turn_between(goal, scene[goal.bodies[0]])
    length = float(np.linalg.norm(axis))
    return (
        length > np.sin(np.radians(goal.tolerance_deg))
        and abs(float(axis[2])) > 0.5 * length
    )


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
    if (
        brief.task.ranges
        and type(brief.actions).anchor is not ActionRepresentation.anchor
    ):
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
    representation = brief.representation
    tool = representation.given(brief.task)
    fields: dict[str, Any] = {}
    if tool is not None:
        name = "the given tool"
        plans, parents = _plans_for(tool, sampler, elites)
        description = (
            f"Plans varied from {parents[0]}." if parents else f"It {plans[0].text}."
        )
    else:
        if elites:
            name, description, tool, plans, parents = breed(
                elites, brief.n_action, sampler
            )
        else:
            tool, head, pose, plan = sampler.invent()
            plans = [
                plan,
                *(
                    sampler.use(tool, lambda _: (head, pose))
                    for _ in range(brief.n_action - 1)
                ),
            ]
            parents = [elite.candidate.id for elite in brief.elites[:1]]
            name = f"{head.use} with {tool.name}"
            description = f"The {head.kind} {plan.text}."
            if parents:
                description += " A fresh design: no elite has this kind of tool."
        fields = {"tool_name": tool.name, "tool_description": tool.description}
    action_sets = []
    for i, plan in enumerate(plans):
        if brief.actions.guards and i % 2 == 0:
            action_sets.append(sampler.written_with_guard(plan, tool))
        else:
            action_sets.append(sampler.written(plan.rows, plan.anchors))
    fields = {
        "strategy_name": name,
        "strategy_description": description,
        **fields,
        "gripper": tool.gripper,
        **representation.dump(tool),
        "action_description": " | ".join(
            f"{i}: {plan.text}" for i, plan in enumerate(plans, start=1)
        ),
        "action_sets": action_sets,
    }
    return fields | {"parents": parents} if parents else fields


def _plans_for(
    tool: Tool, sampler: Sampler, elites: Sequence[Elite]
) -> tuple[list[SampledPlan], list[str]]:
    """Make plans for the given tool, and name their parents."""
    brief = sampler.brief
    made = task_plans(sampler, tool, elites)
    if made is not None:
        return made
    if elites:
        elite = elites[int(sampler.rng.integers(len(elites)))]
        return offspring_plans(elite, tool, brief.n_action, sampler), [elite.id]
    return [sampler.use_any(tool) for _ in range(brief.n_action)], []


def _unlike(brief: Brief) -> list[Brief]:
    """Choose briefs of layouts that are as unlike this one and each other as can be, with the same bodies."""
    drawn = [replace(brief, scene_seed=brief.scene_seed + i) for i in range(_DRAWN)]
    seen = [look(one.task, one.scene_seed, Perception()).poses for one in drawn]
    same = [i for i, poses in enumerate(seen) if list(poses) == list(seen[0])]
    places = np.array(
        [np.ravel([pose.matrix[:3] for pose in seen[i].values()]) for i in same]
    )
    chosen = [0]
    while len(chosen) < min(1 + _LAYOUTS, len(same)):
        apart = np.linalg.norm(places[:, None] - places[chosen], axis=-1).min(axis=1)
        chosen.append(int(apart.argmax()))
    return [drawn[same[i]] for i in chosen[1:]]
