"""Design tools for several tasks: a part for each task, which points its own way, and parts that work put together.

At first a tool has a part for one task, or for each; what a part earns shows in the figures of its task. Later tools
join the best parts of elites, and then change a part for a task that is not done, or get a fresh one.

A part's components are named by its task. The tool's description says what each was drawn from, so that a request for
plans draws its head again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator

from core.design import Tool
from core.interfaces import Brief, Task
from core.trial import Evaluation
from plugins.vlms.offline.given_tools import PartSeed
from plugins.vlms.offline.layouts import Layout
from plugins.vlms.offline.sampler import Sampler
from plugins.vlms.offline.scene_analysis import NothingToMove
from plugins.vlms.offline.tool_parts import (
    find_part,
    rename_components,
    task_suffix,
    working_part,
)
from plugins.vlms.offline.tool_variation import mutate
from plugins.vlms.offline.written_design import Design, write_tool

_TRIES = 12
_WEAK = 1.02  # less what a task earns: how likely it is worked on; one that is done is at times, too
_FRESH = 0.4  # the chance of a fresh part for a task that is not done
# Degrees about the mount's axis, one after the other for the tasks.
_DIRECTIONS = (0, 90, -90, 180)
_ABOVE_M = 0.02  # clearance of all parts above the highest body below home


def answer_several(brief: Brief, *, looks_near: bool = False) -> dict[str, Any]:
    """Make the document for a brief that asks for tools for several tasks.

    Args:
        brief: what is asked for.
        looks_near: see `plugins.vlms.offline.answer.answer`.

    Raises:
        NothingToMove: see `SceneAnalysis`; in all of the tasks.
    """
    samplers: dict[str, Sampler] = {}

    reasons = []
    for part in brief.task.parts:
        alone = replace(brief, task=part)
        try:
            sampler = Sampler(alone, [Layout(alone)])
        except NothingToMove as error:
            reasons.append(f"{part.name}: {error}")
            continue

        sampler.looks_near = looks_near
        samplers[part.name] = sampler

    if not samplers:
        raise NothingToMove("; ".join(reasons))

    maker = _ToolMaker(brief, samplers, np.random.default_rng(brief.seed))
    designs = [maker.make_design(number) for number in range(brief.n_tool)]

    return {
        "scene_analysis": f"{len(samplers)} tasks for one tool.",
        "strategies": designs,
    }


def _as_design(
    tool: Tool,
    change: str,
    parents: Sequence[str] = (),
) -> Design:
    """Make a design of a tool without plans, named by what was done to make it."""
    return Design(change, f"{tool.name}: {change}.", tool, [], parents)


@dataclass(frozen=True, eq=False)
class _ToolMaker:
    """Makes tools for several tasks.

    Attributes:
        brief: which asks for tools.
        samplers: of each task that has something to move, by its name.
        rng: random numbers beside the samplers' own.
    """

    brief: Brief
    samplers: Mapping[str, Sampler]
    rng: Generator

    def make_design(self, number: int) -> dict[str, Any]:
        """Make a tool and write it as in a designs document, without plans.

        Args:
            number: of the tool in the document, from 0.
        """
        design = self._make_tool(number)
        fields = write_tool(design, self.brief.representation)

        if self.brief.elites:
            fields["parents"] = list(design.parents)

        return fields

    def _make_tool(self, number: int) -> Design:
        """Join the best parts first; then change the part for a task that is not done, or make a fresh one.

        Args:
            number: see `make_design`.
        """
        best = self._find_best()
        earned = {task: elite.figures.get(task, 0.0) for task, elite in best.items()}

        if not any(earned.values()):
            return self._make_first(number)

        joined = self._join_parts(best)
        if number == 0:
            return joined

        weak = self._draw_weak(earned)
        done = earned[weak] >= self._task(weak).success_reward
        if not done and self.rng.random() < _FRESH:
            return self._make_alone(weak)

        return self._change_part(joined, weak)

    def _find_best(self) -> dict[str, Evaluation]:
        """Find for each task the elite that did it best; empty: no elite has this kind of tool."""
        elites = []
        for elite in self.brief.elites:
            tool = elite.candidate.tool
            if tool and tool.gripper == self.brief.gripper:
                elites.append(elite)

        if not elites:
            return {}

        best = {}
        for task in self.samplers:
            best[task] = max(elites, key=lambda elite: elite.figures.get(task, 0.0))

        return best

    def _make_first(self, number: int) -> Design:
        """Make a part for a task alone; as the last of a request, a tool with one for each.

        Args:
            number: see `make_design`.
        """
        names = list(self.samplers)
        if number < self.brief.n_tool - 1:
            turn = self.brief.agent * self.brief.n_tool + number
            return self._make_alone(names[turn % len(names)])

        tool, *others = (self._make_part(name) for name in names)
        for part in others:
            tool = self._put_part(tool, replace(part, components=()), part) or tool

        return _as_design(tool, "a part for each")

    def _make_alone(self, name: str) -> Design:
        """Make a part for a task, and nothing for the others.

        Args:
            name: of the task.
        """
        return _as_design(self._make_part(name), f"a part for {name}")

    def _draw_weak(self, earned: Mapping[str, float]) -> str:
        """Draw a task, more likely one in which little was earned.

        Args:
            earned: rewards by task, 0..1.
        """
        weights = _WEAK - np.clip(list(earned.values()), 0.0, 1.0)
        chosen = self.rng.choice(len(earned), p=weights / weights.sum())

        return list(earned)[int(chosen)]

    def _change_part(self, joined: Design, name: str) -> Design:
        """Mutate the part for a task; where no change keeps the rules, make a fresh one.

        Args:
            joined: the parts that do most.
            name: of the task.
        """
        for attempt in range(_TRIES):
            part = working_part(joined.tool, self._task(name))
            changed, change = mutate(part, 1 / (1 + attempt / 3), self.rng)
            if changed.components == part.components:
                continue

            tool = self._put_part(joined.tool, part, changed)
            if tool is not None:
                return _as_design(tool, f"{name}: {change}", joined.parents)

        return self._make_alone(name)

    def _task(self, name: str) -> Task:
        return self.samplers[name].brief.task

    @staticmethod
    def _tool(elite: Evaluation) -> Tool:
        assert elite.candidate.tool is not None
        return elite.candidate.tool

    def _accepts(self, tool: Tool) -> bool:
        """Report whether a tool keeps the rules in all tasks."""
        return all(sampler.accepts(tool) for sampler in self.samplers.values())

    def _make_part(self, name: str) -> Tool:
        """Make a tool with a part for one task, which points its own way and is as long as all others.

        Args:
            name: of the task.
        """
        suffix = task_suffix(self._task(name))
        clearances = [s.model.clearance_at_home for s in self.samplers.values()]
        length_mm = int(1000 * (min(clearances) - _ABOVE_M))
        degrees = _DIRECTIONS[list(self.samplers).index(name) % len(_DIRECTIONS)]

        for _ in range(_TRIES):
            seed = PartSeed(suffix, degrees, length_mm, int(self.rng.integers(2**31)))
            tool = seed.invent(self.samplers[name].brief).tool

            if self._accepts(tool):
                break

        components = rename_components(tool, suffix)
        description = f"{tool.description}; {seed.text}"

        return replace(tool, components=components, description=description)

    def _join_parts(self, best: Mapping[str, Evaluation]) -> Design:
        """Take the tool that does most, with the parts of others for the tasks that they do better, where they fit.

        Args:
            best: by task, the elite that did it best.
        """
        base = max(best.values(), key=lambda elite: elite.reward)
        tool = self._tool(base)
        parents = [base.candidate.id]

        for name, other in best.items():
            if other.figures.get(name, 0.0) <= base.figures.get(name, 0.0):
                continue

            task = self._task(name)
            part = working_part(self._tool(other), task)
            joined = self._put_part(tool, find_part(tool, task), part)

            if joined is not None:
                tool = joined
                parents.append(other.candidate.id)

        unique = list(dict.fromkeys(parents))

        return _as_design(tool, "the parts that do most", unique)

    def _put_part(
        self,
        tool: Tool,
        old: Tool,
        part: Tool,
    ) -> Tool | None:
        """Put a part in the place of an old one; None: it does not fit, or another component has one of its names.

        Args:
            tool: with parts for several tasks.
            old: its part for a task, which may have no components.
            part: for the same task.
        """
        old_names = {component.name for component in old.components}
        kept = [c for c in tool.components if c.name not in old_names]
        added = [c for c in part.components if c not in kept]
        if {c.name for c in kept} & {c.name for c in added}:
            return None

        texts = [tool.description]
        for text in part.description.split("; "):
            if text not in tool.description:
                texts.append(text)

        description = "; ".join(texts)
        new = replace(tool, components=(*kept, *added), description=description)

        return new if self._accepts(new) else None
