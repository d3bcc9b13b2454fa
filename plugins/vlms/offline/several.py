"""Design tools for several tasks: a part for each task, which points its own way.

A part's components are named by its task. The tool's description says which draw each part was, so that a request for
plans draws its head again.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator

from core.design import Tool
from core.geometry import Pose
from core.interfaces import Brief, Task
from plugins.vlms.offline.evolve import mutate
from plugins.vlms.offline.heads import Head
from plugins.vlms.offline.sampler import Aim, Layout, SampledPlan, Sampler
from plugins.vlms.offline.tools import part_for, suffix

_TRIES = 12
_WAYS = (0, 90, -90, 180)  # degrees about the mount's axis, one after the other for the tasks
_ABOVE_M = 0.02  # clearance of all parts above the highest body below home
_PART = re.compile(r"; for ([\w.-]+): turned by (-?\d+) degrees, (\d+) mm long, draw (\d+)")


class PartSeed(NamedTuple):
    """Which way a part points, its length and its random seed."""

    degrees: int
    mm: int
    draw: int

    @classmethod
    def of(cls, tool: Tool, task: Task) -> PartSeed | None:
        """Read the seed of the tool's part for a task; None: it has none."""
        parts = {name: numbers for name, *numbers in _PART.findall(tool.description)}
        numbers = parts.get(suffix(task))
        return cls(*map(int, numbers)) if numbers else None

    def invent(self, brief: Brief) -> tuple[Tool, Head, Pose, SampledPlan]:
        """Invent a part; the same for the same task and scene."""
        aim = Aim(np.radians(self.degrees), self.mm / 1000)
        return Sampler(replace(brief, seed=self.draw), Layout(brief), aim=aim).invent()


def tools_answer(brief: Brief) -> dict[str, Any]:
    """The document for a brief that asks for tools for several tasks.

    Raises:
        NothingToMove: see `SceneAnalysis`; in one of the tasks.
    """
    briefs = [replace(brief, task=task) for task in brief.task.parts]
    samplers = [Sampler(own, Layout(own)) for own in briefs]
    elites = [e for e in brief.elites if e.candidate.tool and e.candidate.tool.gripper == brief.gripper]
    rng = np.random.default_rng(brief.seed)
    strategies = []
    for number in range(brief.n_tool):
        if elites:
            elite = elites[number % len(elites)]
            assert elite.candidate.tool is not None
            tool, done = _change(elite.candidate.tool, elite.figures, samplers, rng)
            more: dict[str, Any] = {"parents": [elite.candidate.id]}
        else:
            tool = Tool(gripper=brief.gripper)
            for sampler in samplers:
                tool = _with_fresh_part(tool, sampler, samplers, rng)
            done = "a part for each task"
            more = {}
        fields = {
            "strategy_name": done,
            "strategy_description": f"{tool.name}: {done}.",
            "tool_name": tool.name,
            "tool_description": tool.description,
            "gripper": tool.gripper,
        }
        strategies.append(fields | brief.representation.dump(tool) | more)
    return {"scene_analysis": f"{len(samplers)} tasks for one tool.", "strategies": strategies}


def _change(tool: Tool, earned: Mapping[str, float], samplers: Sequence[Sampler], rng: Generator) -> tuple[Tool, str]:
    """Replace the part for the task that earned least; change any part where all tasks are done."""
    tasks = [sampler.brief.task for sampler in samplers]
    weakest = int(np.argmin([earned.get(task.name, 0.0) for task in tasks]))
    task = tasks[weakest]
    if earned.get(task.name, 0.0) < task.success_reward:
        return _with_fresh_part(tool, samplers[weakest], samplers, rng), f"another part for {task.name}"
    for attempt in range(_TRIES):
        changed, done = mutate(tool, 1 / (1 + attempt), rng)
        if _accept(changed, samplers):
            return changed, done
    return tool, "other plans"


def _with_fresh_part(tool: Tool, sampler: Sampler, samplers: Sequence[Sampler], rng: Generator) -> Tool:
    """The tool with a new part for a sampler's task, which is as long as all others; the same tool if none fits."""
    task = sampler.brief.task
    end = suffix(task)
    mm = int(1000 * (min(one.room for one in samplers) - _ABOVE_M))
    degrees = _WAYS[samplers.index(sampler) % len(_WAYS)]
    gone = part_for(tool, task, strict=True).components
    kept = [c for c in tool.components if c not in gone]
    said = "".join(text.group() for text in _PART.finditer(tool.description) if text.group(1) != end)
    for _ in range(_TRIES):
        seed = PartSeed(degrees, mm, int(rng.integers(2**31)))
        part = seed.invent(sampler.brief)[0]
        names = {c.name: f"{c.name}_{end}" for c in part.components}
        added = [replace(c, name=names[c.name], parent=names.get(c.parent, c.parent)) for c in part.components]
        note = f"; for {end}: turned by {degrees} degrees, {mm} mm long, draw {seed.draw}"
        text = f"a part for each task{said}{note}"
        new = replace(tool, components=(*kept, *added), name="parts", description=text)
        if _accept(new, samplers):
            return new
    return tool


def _accept(tool: Tool, samplers: Sequence[Sampler]) -> bool:
    return all(sampler.accepts(tool) for sampler in samplers)
