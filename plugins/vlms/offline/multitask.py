"""Design tools for several tasks: each by a way of using a tool that suits one of them.

Plans are asked for later, for each task alone, with the tool as given. A task that the tool's way suits, too, is done
by it; in all others the tool is used as a stranger's.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.random import Generator

from core.design import Tool
from core.interfaces import Brief, Evaluation
from plugins.vlms.offline.faults import obeys
from plugins.vlms.offline.making import Made, make
from plugins.vlms.offline.notes import read_recipe
from plugins.vlms.offline.search import NothingSuits, Search
from plugins.vlms.offline.vary import mutate_recipe
from plugins.vlms.offline.writing import write_names

_TOOLS = 12  # to find one that keeps the rules in all tasks
_VARIES = 0.7  # how often an elite's tool is varied, where there is one


def answer_several(brief: Brief) -> dict[str, Any]:
    """Make the document for a brief that asks for tools for several tasks.

    Raises:
        NothingSuits: no way of using a tool suits any of the tasks.
    """
    searches = []
    reasons = []
    for number, task in enumerate(brief.task.parts):
        # Otherwise all tasks would draw alike.
        alone = replace(brief, task=task, seed=brief.seed + number)
        try:
            searches.append(Search(alone))
        except NothingSuits as error:
            reasons.append(str(error))

    if not searches:
        raise NothingSuits("; ".join(reasons))

    rng = np.random.default_rng(brief.seed)
    designs = []
    for number in range(brief.n_tool):
        turn = brief.agent * brief.n_tool + number
        rotated = [*searches[turn % len(searches) :], *searches[: turn % len(searches)]]
        designs.append(_make_design(brief, rotated, rng))

    return {
        "scene_analysis": f"{len(searches)} of {len(brief.task.parts)} tasks are planned for.",
        "strategies": designs,
    }


def _make_design(
    brief: Brief, searches: list[Search], rng: Generator
) -> dict[str, Any]:
    """Vary the tool of an elite, or draw one for the first of the tasks."""
    elites = [elite for elite in brief.elites if elite.candidate.tool is not None]
    if elites and rng.random() < _VARIES:
        elite = elites[int(rng.integers(len(elites)))]
        made = _vary(elite, searches, rng)
        if made is not None:
            return write_names([made], brief, [elite.candidate.id])

    made = searches[0].invent()
    for _ in range(_TOOLS):
        if _fits(made.tool, searches):
            break
        made = searches[0].invent()

    return write_names([made], brief, [])


def _vary(elite: Evaluation, searches: list[Search], rng: Generator) -> Made | None:
    """Vary what an elite's tool was made of; None: it was not made here, or nothing fits."""
    read = read_recipe(elite.candidate)
    if read is None:
        return None

    note, recipe = read
    for search in searches:
        option = search.find_option(note.way, note.number)
        if option is None:
            continue
        for _ in range(_TOOLS):
            varied = mutate_recipe(recipe, option.way.ranges, 1 - elite.reward, rng)
            made = make(option, varied)
            if _fits(made.tool, searches):
                return made

    return None


def _fits(tool: Tool, searches: list[Search]) -> bool:
    """Report whether a tool keeps the rules in all tasks."""
    return all(obeys(tool, search.layout) for search in searches)
