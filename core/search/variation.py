"""Vary the numbers of a candidate's tool and plan, and read the result as a model's design is read."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from core.design import Candidate, DesignError, Tool
from core.designs.planning import call_part
from core.designs.reading import dump_design, read_designs
from core.designs.start import SpawnRules
from core.geometry import Array
from core.interfaces import (
    ActionPlan,
    ActionRepresentation,
    Numbers,
    Task,
    ToolRepresentation,
)


@dataclass(eq=False)
class Variation:
    """Varies candidates of one task; where its representation gives the tool, their plans alone."""

    task: Task
    representation: ToolRepresentation
    actions: ActionRepresentation
    seed: int

    def __post_init__(self) -> None:
        self._start = SpawnRules(self.task, self.seed)
        self._given = self.representation.given(self.task)

    def parameters(self, candidate: Candidate) -> Numbers:
        """Return the N numbers of a candidate's tool and plan that a refinement may vary."""
        assert candidate.tool is not None
        found = (
            Numbers()
            if self._given is not None
            else self.representation.parameters(candidate.tool)
        )
        return found + self.actions.parameters(candidate.plan)

    def vary(
        self, candidate: Candidate, values: Array, key: tuple[int, int, int, int]
    ) -> Candidate:
        """Make a candidate of ``values`` (N,), see `parameters`, with ``key``; what breaks a rule is its problem."""
        assert candidate.tool is not None
        generation, agent, strategy, _ = key
        count = len(values) - len(self.actions.parameters(candidate.plan))
        named = replace(
            candidate, generation=generation, agent=agent, strategy=strategy, action=0
        )
        varied = replace(named, parents=(candidate.id,), varied=True)
        try:
            tool = candidate.tool
            if count:
                tool = call_part(
                    self.representation, "with_parameters", Tool, tool, values[:count]
                )
            plan = call_part(
                self.actions,
                "with_parameters",
                ActionPlan,
                candidate.plan,
                values[count:],
            )
            document = {
                "strategies": [
                    dump_design(
                        replace(candidate, tool=tool, plan=plan), self.representation
                    )
                ]
            }
            (read,) = read_designs(
                document, self.representation, self.task, actions=self.actions
            )
            if read.tool is not None:
                self._start.check(read.tool)
        except DesignError as error:
            return replace(varied, problem=str(error))
        return replace(varied, tool=read.tool, plan=read.plan, problem=read.problem)

    def toward(self, candidate: Candidate, other: Candidate) -> Array | None:
        """Return the values (N,) of a candidate's `parameters` that make it like ``other``; None: more differs."""
        assert candidate.tool is not None
        assert other.tool is not None
        given = self._given is not None
        tool = (
            Numbers().values
            if given
            else self.representation.toward(candidate.tool, other.tool)
        )
        same = candidate.plan.anchors == other.plan.anchors
        plan = self.actions.toward(candidate.plan, other.plan) if same else None
        return None if tool is None or plan is None else np.concatenate([tool, plan])
