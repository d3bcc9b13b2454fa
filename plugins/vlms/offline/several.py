"""Design tools for several tasks: a part for each task, which points its own way, and parts that work put together.

A part's components are named by its task. The tool's description says which draw each was, so that a request for plans
draws its head again.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator

from core.design import Candidate, DesignError, Tool
from core.geometry import Pose
from core.interfaces import Brief, Task
from core.trial import Evaluation
from plugins.vlms.offline.evolve import Elite, mutate, offspring_plans
from plugins.vlms.offline.heads import Head
from plugins.vlms.offline.sampler import Aim, Layout, SampledPlan, Sampler
from plugins.vlms.offline.scene_analysis import NothingToMove
from plugins.vlms.offline.tools import part_for, suffix

_TRIES = 12
_FRESH = 0.4  # the chance of a fresh part for a task that is not done
_WAYS = (
    0,
    90,
    -90,
    180,
)  # degrees about the mount's axis, one after the other for the tasks
_ABOVE_M = 0.02  # clearance of all parts above the highest body below home
_PART = re.compile(
    r"for ([\w.-]+): turned by (-?\d+) degrees, (\d+) mm long, draw (\d+)"
)


class PartSeed(NamedTuple):
    """Which way a part points, its length and its random seed; ``text`` says so in a tool's description."""

    task: str
    degrees: int
    mm: int
    seed: int

    def text(self) -> str:
        return f"for {self.task}: turned by {self.degrees} degrees, {self.mm} mm long, draw {self.seed}"

    def invent(self, brief: Brief) -> tuple[Tool, Head, Pose, SampledPlan]:
        """Invent a part; the same for the same task and scene."""
        aim = Aim(np.radians(self.degrees), self.mm / 1000)
        return Sampler(replace(brief, seed=self.seed), Layout(brief), aim=aim).invent()


def task_plans(
    sampler: Sampler, tool: Tool, elites: Sequence[Elite]
) -> tuple[list[SampledPlan], list[str]] | None:
    """Make plans for a tool with parts for several tasks, and name their parents; None: it is no such tool.

    Raises:
        DesignError: no part is for this task, and none seems to do.
    """
    parts = {
        task: PartSeed(task, *map(int, numbers))
        for task, *numbers in _PART.findall(tool.description)
    }
    if not parts:
        return None
    brief = sampler.brief
    name = suffix(brief.task)
    if elites:
        elite = max(elites, key=lambda elite: elite.reward)
        return offspring_plans(elite, tool, brief.n_action, sampler), [elite.id]
    if name in parts:
        _, head, pose, use = parts[name].invent(brief)
        return [
            use,
            *(
                sampler.use(tool, lambda _: (head, pose))
                for _ in range(brief.n_action - 1)
            ),
        ], []
    if sampler.fault(tool) > 0.0:
        raise DesignError(f"the tool has no part for {brief.task.name}")
    return [sampler.use_any(tool) for _ in range(brief.n_action)], []


def tools_answer(brief: Brief) -> dict[str, Any]:
    """The document for a brief that asks for tools for several tasks.

    Raises:
        NothingToMove: see `SceneAnalysis`; in all of the tasks.
    """
    samplers = dict[str, Sampler]()
    reasons = list[str]()
    for part in brief.task.parts:
        own = replace(brief, task=part)
        try:
            samplers[part.name] = Sampler(own, Layout(own))
        except NothingToMove as error:
            reasons.append(f"{part.name}: {error}")
    if not samplers:
        raise NothingToMove("; ".join(reasons))
    maker = _ToolMaker(brief, samplers, np.random.default_rng(brief.seed))
    strategies = [maker.strategy(number) for number in range(brief.n_tool)]
    return {
        "scene_analysis": f"{len(samplers)} tasks for one tool.",
        "strategies": strategies,
    }


@dataclass(frozen=True, eq=False)
class _ToolMaker:
    """Makes tools for several tasks; ``samplers`` are those of each, by its name."""

    brief: Brief
    samplers: Mapping[str, Sampler]
    rng: Generator

    def strategy(self, number: int) -> dict[str, Any]:
        tool, done, parents = self._tool(number)
        return {
            "strategy_name": done,
            "strategy_description": f"{tool.name}: {done}.",
            "tool_name": tool.name,
            "tool_description": tool.description,
            "gripper": tool.gripper,
            **self.brief.representation.dump(tool),
            **({"parents": parents} if self.brief.elites else {}),
        }

    def _tool(self, number: int) -> tuple[Tool, str, list[str]]:
        """Join the best parts first; then change the part for a task that is not done, or make a fresh one."""
        elites = [
            e
            for e in self.brief.elites
            if e.candidate.tool and e.candidate.tool.gripper == self.brief.gripper
        ]
        best = {
            task: max(elites, key=lambda e: e.figures.get(task, 0.0), default=None)
            for task in self.samplers
        }
        names = list(best)
        earned = [e.figures.get(task, 0.0) if e else 0.0 for task, e in best.items()]
        if not elites or not any(earned):
            first = names[(self.brief.agent * self.brief.n_tool + number) % len(names)]
            if number < self.brief.n_tool - 1:
                return self._fresh(first), f"a part for {first}", []
            tool, *others = (self._fresh(name) for name in names)
            for part in others:
                tool = self._with(tool, replace(part, components=()), part) or tool
            return tool, "a part for each", []
        joined, parents = self._joined(
            {task: e for task, e in best.items() if e is not None}
        )
        if number == 0:
            return joined, "the parts that do most", parents
        weights = 1.02 - np.clip(earned, 0.0, 1.0)
        weak = names[int(self.rng.choice(len(names), p=weights / weights.sum()))]
        done = earned[names.index(weak)] >= self._task(weak).success_reward
        if not done and self.rng.random() < _FRESH:
            return self._fresh(weak), f"a part for {weak}", []
        for attempt in range(_TRIES):
            part = part_for(joined, self._task(weak))
            changed, what = mutate(part, 1 / (1 + attempt / 3), self.rng)
            if (
                changed.components != part.components
                and (new := self._with(joined, part, changed)) is not None
            ):
                return new, f"{weak}: {what}", parents
        return self._fresh(weak), f"a part for {weak}", []

    def _task(self, name: str) -> Task:
        return self.samplers[name].brief.task

    def _accepts(self, tool: Tool) -> bool:
        return all(sampler.accepts(tool) for sampler in self.samplers.values())

    def _fresh(self, name: str) -> Tool:
        """A tool with a part for one task, which points its own way and is as long as all others."""
        task = self._task(name)
        mm = int(1000 * (min(w.room for w in self.samplers.values()) - _ABOVE_M))
        way = _WAYS[list(self.samplers).index(name) % len(_WAYS)]
        for _ in range(_TRIES):
            seed = PartSeed(suffix(task), way, mm, int(self.rng.integers(2**31)))
            tool = seed.invent(self.samplers[name].brief)[0]
            if self._accepts(tool):
                break
        names = {c.name: f"{c.name}_{suffix(task)}" for c in tool.components}
        named = [
            replace(c, name=names[c.name], parent=names.get(c.parent, c.parent))
            for c in tool.components
        ]
        return replace(
            tool,
            components=tuple(named),
            description=f"{tool.description}; {seed.text()}",
        )

    def _joined(self, best: Mapping[str, Evaluation]) -> tuple[Tool, list[str]]:
        """The tool that does most, with the parts of others for the tasks that they do better, where they fit."""
        base = max(best.values(), key=lambda e: e.reward)
        tool = _tool_of(base.candidate)
        parents = [base.candidate.id]
        for name, other in best.items():
            if other.figures.get(name, 0.0) > base.figures.get(name, 0.0):
                task = self._task(name)
                part = part_for(_tool_of(other.candidate), task)
                if (
                    new := self._with(tool, part_for(tool, task, strict=True), part)
                ) is not None:
                    tool = new
                    parents.append(other.candidate.id)
        return tool, list(dict.fromkeys(parents))

    def _with(self, tool: Tool, old: Tool, part: Tool) -> Tool | None:
        """Put a part in the place of an old one; None: it does not fit, or another component has one of its names."""
        gone = {c.name for c in old.components}
        kept = [c for c in tool.components if c.name not in gone]
        added = [c for c in part.components if c not in kept]
        said = (
            tool.description,
            *(d for d in part.description.split("; ") if d not in tool.description),
        )
        new = replace(tool, components=(*kept, *added), description="; ".join(said))
        return (
            None
            if {c.name for c in kept} & {c.name for c in added}
            or not self._accepts(new)
            else new
        )


def _tool_of(candidate: Candidate) -> Tool:
    assert candidate.tool is not None
    return candidate.tool
