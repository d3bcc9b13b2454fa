"""Try tools that are there already before a model is asked: with their own plans, and with plans made for the task."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from core.design import Candidate, DesignError, Tool
from core.designs.start import SpawnRules
from core.errors import UsageError
from core.interfaces import VLM, GivenTools, Request, Task, ToolRepresentation
from core.plugins import MODEL, installed
from core.search.assignment import Team
from core.search.designer import ModelDesigner


class KnownTool(GivenTools):
    """A tool of a design, for which only plans are asked for."""

    def __init__(self, tool: Tool, designed_by: ToolRepresentation) -> None:
        self.robot = designed_by.robot
        self.material = designed_by.material
        self.printer = designed_by.printer
        self._tool = tool

    def given(self, task: Task) -> Tool:
        return self._tool


@dataclass(eq=False)
class KeptTools:
    """The tools of a library as the first generation of a run: a `core.search.designer.FirstTools`.

    Each is tried with the plan that it was kept with (design 0), and with ``budget.n_action`` plans for the run's task
    (design 1). The model of the run is asked for none of them: what plans is one that computes them from the scene.

    Attributes:
        designer: of the run; composes the requests for plans.
        candidates: the tools with their plans, see `ToolRepresentation.kept`.

    Raises:
        UsageError: the run works on several tasks, its model is not to know numbers of the scene, or nothing that
            computes plans is installed.
    """

    designer: ModelDesigner
    candidates: Sequence[Candidate]

    def __post_init__(self) -> None:
        facts = self.designer.prompts.facts
        if len(self.designer.assignment.task.parts) > 1:
            raise UsageError(
                "tools of a library are tried on one task; for several use vlmgineer toolbox LIBRARY tasks=[NAME,...]"
            )
        if not facts.level.numbers:
            raise UsageError(
                "plans for tools of a library come from the scene's numbers, and later prompts show them: "
                f"prompt.context={facts.settings.context} holds these back; use words or source"
            )
        self._planner = _make_planner()

    def design(self) -> Iterator[Candidate]:
        """Yield all tools with their own plans, and then those that suit the task with plans for it."""
        checked = [self._check(candidate) for candidate in self.candidates]
        yield from checked

        asker = replace(
            self.designer,
            vlm=self._planner,
            critic=None,
            mender=None,
            memory=None,
            first_tools=None,
        )
        suitable = [c for c in checked if c.tool is not None and c.problem is None]
        requests = [_request_plans(asker, candidate) for candidate in suitable]
        for answer in asker.ask(requests):
            for candidate in answer.candidates:
                yield replace(candidate, design=1)

    def _check(self, candidate: Candidate) -> Candidate:
        """Add a problem to a candidate whose tool does not suit the task."""
        assignment = self.designer.assignment
        tool = candidate.tool
        if tool is None or candidate.problem is not None:
            return candidate

        kind = "gripper" if tool.gripper else "rigid"
        if kind not in assignment.tool_kinds:
            kinds = ", ".join(assignment.tool_kinds)
            problem = f"it is a {kind} tool, and task.tool_kinds is [{kinds}]"
            return replace(candidate, problem=problem)

        try:
            SpawnRules(assignment.task, assignment.seed).check(tool)
        except DesignError as error:
            return replace(candidate, problem=str(error))

        return candidate


def _request_plans(asker: ModelDesigner, candidate: Candidate) -> Request:
    """Compose the request for plans with which a kept tool does the task."""
    tool = candidate.tool
    assert tool is not None
    assignment = asker.assignment
    agent = candidate.agent
    brief, temperature = asker.brief(0, agent, Team([agent]), ())
    brief = replace(
        brief,
        representation=KnownTool(tool, assignment.representation),
        gripper=tool.gripper,
        n_tool=1,
        n_action=assignment.budget.n_action,
    )
    return asker.request(f"g0-a{agent}", brief, temperature, asker.prompts)


def _make_planner() -> VLM:
    """Make the model that computes plans from the scene, and reads no prompt.

    Raises:
        UsageError: none is installed.
    """
    for name, factory in installed().factories("vlm").items():
        if not getattr(factory, "sees", VLM.sees):
            return installed().create(MODEL, name)

    raise UsageError("nothing that computes plans for a known tool is installed")
