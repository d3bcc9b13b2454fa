"""Vary the numbers of a candidate's tool and plan, and read the result as a model's design is read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.design import Candidate, DesignError, Tool
from core.designs.reading import dump_design, read_designs
from core.designs.start import SpawnRules
from core.geometry import Array
from core.interfaces import ActionPlan, Numbers
from core.plugins.blame import call_part
from core.search.assignment import Assignment


class Variation:
    """Varies candidates of one assignment; where its representation gives the tool, their plans alone."""

    def __init__(self, assignment: Assignment) -> None:
        self._task = assignment.task
        self._tools = assignment.representation
        self._actions = assignment.actions
        self._start = SpawnRules(assignment.task, assignment.seed)
        self._given = assignment.given is not None

    def parameters(self, candidate: Candidate) -> Numbers:
        """Return the N numbers of a candidate's tool and plan that a refinement may vary."""
        numbers = Numbers()
        if not self._given:
            numbers = self._tools.parameters(_tool_of(candidate))

        return numbers + self._actions.parameters(candidate.plan)

    def vary(
        self, candidate: Candidate, values: Array, key: tuple[int, int, int, int]
    ) -> Candidate:
        """Make a candidate of ``values`` (N,), see `parameters`, with ``key``; what breaks a rule is its problem."""
        generation, agent, number, action = key
        varied = replace(
            candidate,
            generation=generation,
            agent=agent,
            design=number,
            action=action,
            parents=(candidate.id,),
        )

        try:
            tool, plan = self._apply(candidate, values)
            design = dump_design(replace(candidate, tool=tool, plan=plan), self._tools)
            (read,) = read_designs(
                {"strategies": [design]},
                self._tools,
                self._task,
                actions=self._actions,
            )
            if read.tool is not None:
                self._start.check(read.tool)
        except DesignError as error:
            return replace(varied, problem=str(error))

        return replace(varied, tool=read.tool, plan=read.plan, problem=read.problem)

    def _apply(
        self, candidate: Candidate, values: Array
    ) -> tuple[Tool | None, ActionPlan]:
        """Give a tool and a plan the ``values`` (N,).

        Raises:
            DesignError: there is no such design.
        """
        tool = candidate.tool
        of_tool = len(values) - len(self._actions.parameters(candidate.plan))
        if of_tool:
            tool = call_part(
                self._tools, "with_parameters", Tool, tool, values[:of_tool]
            )

        plan = call_part(
            self._actions,
            "with_parameters",
            ActionPlan,
            candidate.plan,
            values[of_tool:],
        )
        return tool, plan

    def toward(self, candidate: Candidate, other: Candidate) -> Array | None:
        """Return the values (N,) of a candidate's `parameters` that make it like ``other``; None: more differs."""
        tool: Array | None = Numbers().values
        if not self._given:
            tool = self._tools.toward(_tool_of(candidate), _tool_of(other))
        if tool is None or candidate.plan.anchors != other.plan.anchors:
            return None

        plan = self._actions.toward(candidate.plan, other.plan)
        return None if plan is None else np.concatenate([tool, plan])


def _tool_of(candidate: Candidate) -> Tool:
    assert candidate.tool is not None  # it was tried
    return candidate.tool
