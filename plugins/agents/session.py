"""Keep an agent's search: its run, what was tried, what is left of the budget, and the assignments that it is told."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import cast

from omegaconf import DictConfig, OmegaConf

from core.config.compose import task_part
from core.config.schemas import RunConfig
from core.events import Run
from core.interfaces import (
    Brief,
    Condition,
    Evaluation,
    EvolutionStrategy,
    Message,
    Trial,
)
from core.search.assignment import Team
from core.search.builder import builder_for
from core.search.designer import ModelDesigner
from core.simulation.measuring import BEGINS_S
from core.support.text import clean
from core.trial import best_first, count_rollouts
from plugins.agents.agent import Agent
from plugins.agents.bench import Refused
from plugins.agents.describing import Describer

_ALONE = Team([0])
_SEARCHED = re.compile(r"g\d+-a0-")
"""The ids of candidates of the search; those that are tried beside it have other agents' numbers."""


def begins_s(trial: Trial) -> float:
    """Return from when on a trial was played, seconds of its motion; 0: from the start."""
    return trial.measured.get(BEGINS_S, 0.0)


def _find_played_s(trial: Trial) -> float:
    """Return how many seconds of motion were played; 0: it was not played to its end."""
    return (trial.motion_s or 0.0) - begins_s(trial)


@dataclass(eq=False)
class Session:
    """An agent's search, for the strategy that keeps it and the tools that work on it.

    Attributes:
        strategy: has the budget, and what tries candidates beside the search.
        asked: what composes prompts and reads designs.
        agent: has the run, and its result.
        tried: the evaluations so far.
        beside: of candidates that were tried in some layouts or in another engine, and are none of the search.
        generation: the number of the next one.
    """

    strategy: EvolutionStrategy
    asked: ModelDesigner
    agent: Agent
    tried: list[Evaluation] = field(default_factory=list)
    beside: list[Evaluation] = field(default_factory=list)
    generation: int = 0

    # --- the run --------------------------------------------------------------------------------------------------

    @property
    def run(self) -> Run:
        """What runs."""
        run = self.agent.run
        assert run is not None
        return run

    @property
    def unseen(self) -> bool:
        """Whether nobody is told a number of the scene: then no free answer may be a ruler, and a yes or no is one."""
        return not self.asked.prompts.facts.level.numbers

    @cached_property
    def describer(self) -> Describer:
        """Describes what came of candidates."""
        return Describer(self.asked.prompts.facts, self.brief())

    @cached_property
    def conditions(self) -> Sequence[Condition]:
        """The conditions in which a candidate is tried, as the run's configuration has them."""
        schema = OmegaConf.structured(RunConfig)
        cfg = cast(DictConfig, OmegaConf.merge(schema, self.run.config))
        builder = builder_for(task_part(cfg))
        return builder.build_fitness(cfg, self.run.settings).conditions()

    def choose_condition(self, layout: int | None) -> Condition:
        """Return the condition of the search with this layout; without one that of the pictures, or else the first.

        Raises:
            Refused: there is no such layout.
        """
        wanted = self.run.seed if layout is None else layout
        for condition in self.conditions:
            if condition.layout == wanted and condition.change is None:
                return condition
        if layout is None:
            return self.conditions[0]
        layouts = sorted({condition.layout for condition in self.conditions})
        listed = ", ".join(map(str, layouts))
        raise Refused(f"no layout {layout} in the search; there are: {listed}")

    # --- what was tried, and what is left -------------------------------------------------------------------------

    def rank(self) -> list[Evaluation]:
        """Return the evaluations of what was played, the best first."""
        return best_first(self.tried, self.strategy.tie)

    def find(self, name: str) -> Evaluation:
        """Return the evaluation of a candidate.

        Raises:
            Refused: none of this id was tried.
        """
        tried = [*self.tried, *self.beside]
        found = [e for e in tried if e.candidate.id == name]
        if not found:  # its end names it, where no other ends so
            found = [e for e in tried if e.candidate.id.endswith(f"-{name}")]
        if len(found) > 1:
            names = ", ".join(e.candidate.id for e in found)
            raise Refused(f"{clean(name, 60)!r} is the end of several ids: {names}")
        if not found:
            raise Refused(
                f"no candidate {clean(name, 60)!r} was tried; best_designs lists those that were"
            )
        return found[0]

    @property
    def trials_beside(self) -> list[Trial]:
        """The trials that are none of the search."""
        trials = self.strategy.trials
        known = () if trials is None else trials.known.values()
        return [trial for trial in known if not _SEARCHED.match(trial.candidate)]

    @property
    def beside_rollouts(self) -> float:
        """The rollouts of these; of one that went on from an earlier trial the share that was played."""
        return math.fsum(
            _find_played_s(trial) / trial.figure("motion_s") if begins_s(trial) else 1.0
            for trial in self.trials_beside
        )

    @property
    def rollouts(self) -> float:
        """The rollouts that were played so far."""
        searched = sum(count_rollouts(e.candidate.id, e.trials) for e in self.tried)
        return searched + self.beside_rollouts

    @property
    def seconds(self) -> float:
        """How long the motions of these took."""
        played = [
            t for e in self.tried for t in e.trials if t.candidate == e.candidate.id
        ]
        return math.fsum(map(_find_played_s, [*played, *self.trials_beside]))

    def count_left(self, each: int) -> int:
        """Count the tries of ``each`` rollouts that the budget still holds: as many candidates in all, or rollouts."""
        budget = self.strategy.budget
        whole = len(self.conditions)
        most = budget.population * (budget.n_iteration + 1)
        left = (most - len(self.tried)) * whole - self.beside_rollouts
        if budget.n_rollouts is not None:
            # One that was refused in the scene says where things are, as one that was played does.
            refused = sum(evaluation.status == "rejected" for evaluation in self.tried)
            left = min(left, budget.n_rollouts - self.rollouts - refused * whole)
        return max(int(left // each), 0)

    # --- assignments ----------------------------------------------------------------------------------------------

    def brief(self, *, gripper: bool | None = None) -> Brief:
        """Make the assignment that the agent is told: one tool with one plan.

        Args:
            gripper: ask for attachments to the fingers; None: what the task asks for first.
        """
        brief, _ = self.asked.brief(0, 0, _ALONE, ())
        assignment = self.asked.assignment
        if assignment.given is not None:
            gripper = assignment.given.gripper
        elif gripper is None:
            gripper = assignment.tool_kinds[0] == "gripper"

        return replace(brief, gripper=gripper, n_tool=1, n_action=1, alone=True)

    def brief_reading(self) -> Brief:
        """Make the assignment by which designs are read: as many as a call may hold, with parents of all tried."""
        budget = self.asked.assignment.budget
        return replace(
            self.brief(),
            generation=self.generation,
            n_tool=budget.n_tool,
            n_action=budget.n_action,
            elites=tuple(self.tried),
        )

    def compose(self, brief: Brief) -> tuple[Message, ...]:
        """Compose what a prompt would hold."""
        pictures = self.asked.pictures.get(brief.gripper, ())
        return self.asked.prompts.compose(brief, pictures)
