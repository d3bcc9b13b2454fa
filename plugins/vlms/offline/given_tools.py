"""Plan for a tool that is given: one of any origin, or one with parts for several tasks."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from core.design import DesignError, Tool
from core.interfaces import Brief
from plugins.vlms.offline.layouts import Layout
from plugins.vlms.offline.mounting import HeadDirection
from plugins.vlms.offline.parents import Parent
from plugins.vlms.offline.paths import SampledPlan
from plugins.vlms.offline.plan_variation import make_offspring_plans
from plugins.vlms.offline.sampler import FreshDesign, Sampler
from plugins.vlms.offline.tool_parts import task_suffix
from plugins.vlms.offline.written_design import Design, plans_of_fresh_design

_PART = re.compile(
    r"for ([\w.-]+): turned by (-?\d+) degrees, (\d+) mm long, draw (\d+)"
)


@dataclass(frozen=True)
class PartSeed:
    """What a part for one of several tasks was drawn from; ``text`` says so in a tool's description.

    Attributes:
        task: the end of the names of its components.
        degrees: which way it points from the mount.
        mm: its length.
        seed: of random numbers.
    """

    task: str
    degrees: int
    mm: int
    seed: int

    @property
    def text(self) -> str:
        """As it stands in a tool's description, where `read_part_seeds` finds it."""
        return f"for {self.task}: turned by {self.degrees} degrees, {self.mm} mm long, draw {self.seed}"

    def invent(self, brief: Brief) -> FreshDesign:
        """Invent a part; the same for the same task and scene."""
        direction = HeadDirection(np.radians(self.degrees), self.mm / 1000)
        seeded = replace(brief, seed=self.seed)
        return Sampler(seeded, [Layout(brief)], direction).invent()


def read_part_seeds(tool: Tool) -> dict[str, PartSeed]:
    """Read from a tool's description what its parts were drawn from, by the end of their names."""
    return {
        task: PartSeed(task, int(degrees), int(mm), int(seed))
        for task, degrees, mm, seed in _PART.findall(tool.description)
    }


def plan_for_given_tool(
    tool: Tool,
    sampler: Sampler,
    parents: Sequence[Parent],
) -> Design:
    """Make plans for a tool that is given: offspring of a parent's plans, or fresh ones.

    Args:
        tool: of any origin, or one that this designer made for several tasks.
        sampler: for the task at hand.
        parents: evaluated candidates with this tool.

    Raises:
        DesignError: it has parts for several tasks, but none for this one, and none seems to do.
    """
    brief = sampler.brief
    seeds = read_part_seeds(tool)
    if not parents:
        plans = _make_fresh_plans(tool, sampler, seeds)
        description = f"It {plans[0].text}."
        return Design("the given tool", description, tool, plans, [])

    if seeds:
        parent = max(parents, key=lambda parent: parent.reward)
    else:
        parent = parents[int(sampler.rng.integers(len(parents)))]

    plans = make_offspring_plans(parent, tool, brief.n_action, sampler)
    description = f"Plans varied from {parent.id}."
    return Design("the given tool", description, tool, plans, [parent.id])


def _make_fresh_plans(
    tool: Tool,
    sampler: Sampler,
    seeds: Mapping[str, PartSeed],
) -> list[SampledPlan]:
    """Make plans with the head that the part for this task was drawn with, or with what is taken for a head.

    Args:
        tool: that is given.
        sampler: for the task at hand.
        seeds: what the tool's parts were drawn from, by the end of their names.
    """
    brief = sampler.brief
    seed = seeds.get(task_suffix(brief.task))
    if seed is not None:
        design = seed.invent(brief)
        return plans_of_fresh_design(design, tool, brief.n_action, sampler)

    if seeds and sampler.least_fault(tool) > 0.0:
        raise DesignError(f"the tool has no part for {brief.task.name}")
    return [sampler.use_any(tool) for _ in range(brief.n_action)]
