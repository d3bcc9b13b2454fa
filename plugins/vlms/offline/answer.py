"""Answer a brief: fresh tools with plans, or offspring of elites, or plans for a tool that is given."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from core.design import Candidate, DesignError
from core.interfaces import Brief, Evaluation
from plugins.vlms.offline.faults import obeys
from plugins.vlms.offline.making import Made, make, plan
from plugins.vlms.offline.multitask import answer_several
from plugins.vlms.offline.notes import read_recipe
from plugins.vlms.offline.search import Search
from plugins.vlms.offline.vary import (
    cross,
    mutate,
    mutate_recipe,
    vary_numbers,
)
from plugins.vlms.offline.writing import write_design, write_tool

_CROSSES = 0.4  # how often two parents are crossed that use their tools alike
_FRESH = 0.3  # how often a design is fresh although there are elites, where these earn nothing
_LEAST_REWARD = 0.01  # what earned nothing is a parent at times, too
_SCALE = 1.5  # of changes, for the whole reward that is missing
_LEAST_SCALE = 0.03
_VARIATIONS = 12  # of a tool, to find one that keeps the rules


def answer(brief: Brief) -> dict[str, Any]:
    """Make the document for one brief.

    Raises:
        NothingSuits: no way of using a tool suits the task.
        DesignError: plans can't be written as the brief asks.
    """
    if len(brief.task.parts) > 1:
        return answer_several(brief)

    designer = _Designer(brief)
    return {
        "scene_analysis": designer.describe(),
        "strategies": [designer.make_design() for _ in range(brief.n_tool)],
    }


class _Designer:
    """Makes the designs of an answer.

    Args:
        brief: what is asked for.
    """

    def __init__(self, brief: Brief) -> None:
        self.brief = brief
        self.search = Search(brief)
        self.rng = self.search.rng
        self.elites = [
            elite
            for elite in brief.elites
            if elite.candidate.tool and elite.candidate.tool.gripper == brief.gripper
        ]

    def describe(self) -> str:
        """Say which ways of using a tool suit the task."""
        ways = dict.fromkeys(option.way.title for option in self.search.options)
        return f"Tools that suit: one that {'; one that '.join(ways)}."

    def make_design(self) -> dict[str, Any]:
        """Make a design, and write it."""
        if not self.elites:
            return self._write(self.search.invent(), [])

        weights = np.array([max(e.reward, _LEAST_REWARD) ** 2 for e in self.elites])
        chosen = self.rng.choice(len(weights), 2, p=weights / weights.sum())
        first, second = (self.elites[int(number)] for number in chosen)
        if self.rng.random() < _FRESH * (1 - first.reward):
            return self._write(self.search.invent(), [])

        return self._breed(first, second) or self._vary_stranger(first)

    def _breed(self, first: Evaluation, second: Evaluation) -> dict[str, Any] | None:
        """Breed from parents that were made here; None: the first was not, or the tool is given."""
        read = read_recipe(first.candidate)
        if read is None or self.search.given is not None:
            return None
        note, recipe = read
        option = self.search.find_option(note.way, note.number)
        if option is None:
            return None

        parents = [first]
        mate = read_recipe(second.candidate)
        is_alike = mate is not None and mate[0].way == note.way
        if not is_alike or second is first or self.rng.random() >= _CROSSES:
            mate = None
        if mate is not None:
            parents.append(second)

        scale = _find_scale(first)
        ranges = option.way.ranges

        def draw() -> Made:
            start = recipe if mate is None else cross(recipe, mate[1], self.rng)
            return make(option, mutate_recipe(start, ranges, scale, self.rng))

        return self._write(self.search.find_best(draw), parents, scale)

    def _write(
        self, made: Made, parents: Sequence[Evaluation], scale: float = 1.0
    ) -> dict[str, Any]:
        """Write a design with as many plans as are asked for: of offspring, plans are varied, else drawn anew."""
        plans = [made]
        moves = made.option.way.moves

        def vary() -> Made:
            values = mutate(made.recipe.values, moves, scale, self.rng)
            return plan(made, values)

        while len(plans) < self.brief.n_action:
            if parents:
                plans.append(self.search.find_best(vary, made.tool))
            else:
                plans.append(self.search.replan(made))

        ids = [parent.candidate.id for parent in parents]
        return write_design(plans, self.brief, self.search.layout, ids)

    def _vary_stranger(self, parent: Evaluation) -> dict[str, Any]:
        """Vary the numbers of an elite that was not made here."""
        scale = _find_scale(parent)
        candidate = parent.candidate
        is_given = self.search.given is not None
        first = self._vary_until_sound(candidate, scale, is_given=is_given)
        assert first.tool is not None
        plans = [first.plan]
        while len(plans) < self.brief.n_action:
            varied = self._vary_until_sound(first, scale, is_given=True)
            plans.append(varied.plan)

        return {
            "strategy_name": candidate.design_name,
            "strategy_description": f"Varied from {candidate.id}.",
            **write_tool(first.tool, self.brief),
            "action_description": candidate.action_description,
            "action_sets": [plan.dump() for plan in plans],
            "parents": [candidate.id],
        }

    def _vary_until_sound(
        self, begin: Candidate, scale: float, *, is_given: bool
    ) -> Candidate:
        """Vary numbers until the tool keeps the rules; where no variation does, it stays as it is."""
        for _ in range(_VARIATIONS):
            try:
                varied = vary_numbers(
                    begin, self.brief, scale, self.rng, is_given=is_given
                )
            except DesignError:
                continue
            if is_given or obeys(varied.tool, self.search.layout):
                return varied

        return begin


def _find_scale(parent: Evaluation) -> float:
    """Find how large the changes to a parent are: the more reward is missing, the larger."""
    return float(np.clip(_SCALE * (1 - parent.reward), _LEAST_SCALE, 1.0))
