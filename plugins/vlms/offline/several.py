"""Design tools for several tasks: of the families for each of them, what promises to do the others too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from core.design import Evaluation, Tool
from core.interfaces import Brief
from plugins.vlms.offline.evolve import cross, mutate
from plugins.vlms.offline.invent import Layout, Workshop
from plugins.vlms.offline.scene_analysis import NothingToMove

_INVENTED = 6  # tools of which the most promising is taken
_TRIES = 12
_FRESH = 0.25  # the chance of a fresh tool where there are elites
_CROSSED = 0.5  # of one made of two tools


def tools_answer(brief: Brief) -> dict[str, Any]:
    """The document for a brief that asks for tools for several tasks.

    Raises:
        NothingToMove: see `SceneAnalysis`; in all of the tasks.
    """
    workshops, reasons = dict[str, Workshop](), list[str]()
    for number, part in enumerate(brief.task.parts):
        own = replace(brief, task=part, seed=brief.seed + number)
        try:
            workshops[part.name] = Workshop(own, Layout(own))
        except NothingToMove as error:
            reasons.append(f"{part.name}: {error}")
    if not workshops:
        raise NothingToMove("; ".join(reasons))
    rng = np.random.default_rng(brief.seed)
    elites = [e for e in brief.elites if e.candidate.tool is not None and e.candidate.tool.gripper == brief.gripper]
    strategies = [_strategy(brief, [*workshops.values()], elites, rng) for _ in range(brief.n_tool)]
    return {"scene_analysis": f"{len(workshops)} tasks for one tool.", "strategies": strategies}


def _strategy(
    brief: Brief, workshops: Sequence[Workshop], elites: Sequence[Evaluation], rng: np.random.Generator
) -> dict[str, Any]:
    bred = _bred(elites, workshops, rng) if elites and rng.random() >= _FRESH else None
    tool, done, parents = bred or _invented(workshops, rng)
    return {
        "strategy_name": done,
        "strategy_description": f"{tool.name}: {done}.",
        "tool_name": tool.name,
        "tool_description": tool.description,
        "gripper": tool.gripper,
        **brief.representation.dump(tool),
        **({"parents": parents or [elites[0].candidate.id]} if brief.elites else {}),
    }


def _invented(workshops: Sequence[Workshop], rng: np.random.Generator) -> tuple[Tool, str, list[str]]:
    """A fresh tool: that of several which is accepted in most scenes, and then with the least faults in all tasks."""
    found: list[tuple[float, Tool]] = []
    for _ in range(_INVENTED):
        tool = workshops[int(rng.integers(len(workshops)))].invent()[0]
        if found and rng.random() < _CROSSED:
            tool, _ = cross(tool, found[int(rng.integers(len(found)))][1], rng)
        found.append((_fault(tool, workshops), tool))
    return min(found, key=lambda one: one[0])[1], "a tool for all of the tasks", []


def _fault(tool: Tool, workshops: Sequence[Workshop]) -> float:
    return sum(workshop.fault(tool) if workshop.accepts(tool) else 1e6 for workshop in workshops)


def _bred(
    elites: Sequence[Evaluation], workshops: Sequence[Workshop], rng: np.random.Generator
) -> tuple[Tool, str, list[str]] | None:
    """An offspring: a mutation, or a part of the elite that does best what the first does worst put on it."""
    weights = np.array([max(elite.reward, 0.01) ** 2 for elite in elites])
    for attempt in range(_TRIES):
        first = elites[int(rng.choice(len(elites), p=weights / weights.sum()))]
        weak = min(first.figures, key=lambda task: first.figures[task], default="")
        second = max(elites, key=lambda e: e.figures.get(weak, 0.0))
        tool, other, crossing = first.candidate.tool, second.candidate.tool, second is not first and rng.random() < 0.5
        assert tool is not None
        assert other is not None
        new, done = cross(tool, other, rng) if crossing else mutate(tool, 1 / (1 + attempt / 3), rng)
        if new.components != tool.components and all(workshop.accepts(new) for workshop in workshops):
            base = tool.description.split("; changed: ")[0]
            new = replace(new, name=tool.name, description=f"{base}; changed: {done}")
            kind = "crossover" if crossing else "mutation"
            parents = [first.candidate.id, second.candidate.id] if crossing else [first.candidate.id]
            return new, f"{kind}: {done}", parents
    return None
