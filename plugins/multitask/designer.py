"""Ask for tools that must do several tasks, and for plans for each tool and task.

What holds is kept: the plan of a parent for a task that it does goes over to its offspring, and for a tool that does
some of its tasks plans are asked for the others alone. `plugins.multitask.fitness.Together.recombine` joins what was
tried.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, zip_longest

import numpy as np

from core.design import Candidate, Tool
from core.designs.composer import PromptComposer
from core.interfaces import (
    ActionPlan,
    ActionRepresentation,
    Brief,
    Evaluation,
    Request,
    Task,
)
from core.search.answers import Answer
from core.search.assignment import Team
from core.search.designer import ModelDesigner, ScenePictures
from core.search.kept_tools import KnownTool
from plugins.multitask.joined_plans import TaskPlans

NO_PLANS = TaskPlans()


@dataclass(eq=False)
class PlannedTool:
    """A tool while its plans are asked for.

    Attributes:
        tool: a candidate without plans.
        kept: plans of its parents, by task.
        plans: those that came, by task; a text says why there is none.
        words: the model's descriptions of them.
        waits: for how many answers.
        lost: why an answer did not come that may come later; then the tool is not tried.
    """

    tool: Candidate
    kept: Mapping[str, ActionPlan]
    plans: dict[str, list[ActionPlan | str]] = field(default_factory=dict)
    words: dict[str, str] = field(default_factory=dict)
    waits: int = 0
    lost: str | None = None

    def take(self, task: str, answer: Answer) -> None:
        """Take the plans for a task.

        Args:
            task: the name of the task.
            answer: to the request for its plans.
        """
        first = answer.candidates[0]
        self.plans[task] = [c.problem or c.plan for c in answer.candidates]
        self.words[task] = first.action_description
        self.waits -= 1

        if answer.lost:
            self.lost = first.problem

    def candidates(self) -> Iterator[Candidate]:
        """Yield a candidate for each number of a plan; the first has the plans that are kept, too."""
        if self.lost is not None:
            yield replace(self.tool, problem=self.lost)
            return

        words = [f"{task}: {text}" for task, text in sorted(self.words.items())]
        sets = zip_longest(*self.plans.values()) if self.plans else [()]

        for number, plans in enumerate(sets):
            chosen: dict[str, ActionPlan | str] = dict(self.kept) if number == 0 else {}
            for task, plan in zip(self.plans, plans, strict=True):
                if plan is not None:
                    chosen[task] = plan

            yield replace(
                self.tool,
                plan=TaskPlans(tuple(chosen.items())),
                action=number,
                action_description=" | ".join(words),
            )


@dataclass(eq=False)
class MultitaskDesigner(ModelDesigner):
    """Asks each agent for tools, and then for plans with which each tool does each task.

    Attributes:
        plan_actions: how plans for a task are written.
        plan_prompts: composes the requests for plans, by task.
        plan_pictures: of the scenes, by task.
    """

    plan_actions: ActionRepresentation = field(kw_only=True)
    plan_prompts: Mapping[str, PromptComposer] = field(kw_only=True)
    plan_pictures: Mapping[str, ScenePictures] = field(kw_only=True)

    @property
    def tasks(self) -> Sequence[Task]:
        """The tasks that a tool must do."""
        return self.assignment.task.parts

    def design_in(self, generation: int, teams: Sequence[Team]) -> Iterator[Candidate]:
        requests = self.start(generation, teams)
        kept = self._keep_tools(generation, teams)
        asked = self.ask([r for r in requests if r.brief.agent not in kept])
        designed = (c for answer in asked for c in answer.candidates)
        yield from self._plan(chain(*kept.values(), designed), teams)
        self.refuse_silence(generation)

    def follow_ups(self, request: Request, elite: Evaluation | None) -> list[Request]:
        """Compose the requests for plans, for the elite's tool or, as an example, for none."""
        brief = request.brief
        tool = Candidate(Tool(gripper=brief.gripper), NO_PLANS)

        parents: list[Evaluation] = []
        if elite is not None:
            tool = elite.candidate
            parents = [elite]

        return [
            self._request_plans(task, tool, parents, brief, request.temperature)
            for task in self.tasks
        ]

    def brief(
        self,
        generation: int,
        agent: int,
        team: Team,
        tried: tuple[Evaluation, ...],
    ) -> tuple[Brief, float]:
        """Make an agent's assignment: tools alone."""
        brief, temperature = super().brief(generation, agent, team, tried)
        return replace(brief, n_action=0), temperature

    def parse(self, brief: Brief, text: str) -> object:
        """Find the designs document in a reply; one of tools alone gets an empty list of plans for tasks."""
        document = super().parse(brief, text)
        if brief.n_action or not isinstance(document, dict):
            return document

        designs = document.get("strategies")
        if not isinstance(designs, list):
            return document

        planless = [
            {**s, "action_sets": [[]]} if isinstance(s, dict) else s for s in designs
        ]

        return {"strategies": planless}

    def _keep_tools(
        self, generation: int, teams: Sequence[Team]
    ) -> dict[int, list[Candidate]]:
        """Return by agent the elites' tools that are kept: every second agent has plans asked for what they can't do.

        All agents keep a given tool.
        """
        given = self.assignment.given

        kept: dict[int, list[Candidate]] = {}

        for team in teams:
            tools = []
            for elite in team.elites:
                if given is not None or len(self._held(elite)) < len(self.tasks):
                    tools.append(elite.candidate)

            if not tools and given is not None:
                tools = [Candidate(given, NO_PLANS)]

            for agent in team.agents:
                if tools and (given is not None or (agent + generation) % 2):
                    kept[agent] = self._renew(tools, generation, agent, team)

        return kept

    def _renew(
        self,
        tools: Sequence[Candidate],
        generation: int,
        agent: int,
        team: Team,
    ) -> list[Candidate]:
        """Make candidates without plans of tools that are kept.

        Args:
            tools: candidates of earlier generations, the best first.
            generation: the number of the one that they are kept in.
            agent: which has plans asked for.
            team: of the agent.
        """
        most = self.assignment.budget.n_tool
        return [
            replace(
                tool,
                generation=generation,
                agent=agent,
                design=number,
                action=0,
                plan=NO_PLANS,
                parents=(tool.id,) if team.elites else (),
            )
            for number, tool in enumerate(tools[:most])
        ]

    def _plan(
        self, tools: Iterable[Candidate], teams: Sequence[Team]
    ) -> Iterator[Candidate]:
        """Ask for plans for tools, and yield their candidates as replies arrive.

        Args:
            tools: candidates without plans; those with a problem are yielded as they are.
            teams: of the generation.
        """
        waiting: dict[str, tuple[PlannedTool, str]] = {}

        requests: list[Request] = []
        for tool in tools:
            if tool.problem is not None:
                yield tool
                continue

            planned, new = self._ask_for_plans(tool, teams)
            for request in new:
                waiting[request.id] = (planned, request.brief.task.name)

            requests += new
            if not new:
                yield from planned.candidates()

        for answer in self.ask(requests):
            planned, task = waiting[answer.request.id]
            planned.take(task, answer)

            if planned.waits == 0:
                yield from planned.candidates()

    def _ask_for_plans(
        self, tool: Candidate, teams: Sequence[Team]
    ) -> tuple[PlannedTool, list[Request]]:
        """Compose the requests for the plans that a tool lacks.

        Args:
            tool: a candidate without plans.
            teams: of the generation; one has the tool's agent.

        Returns:
            The tool, which waits for as many answers as there are requests; and the requests.
        """
        team = next(team for team in teams if tool.agent in team.agents)
        parents = [e for e in team.elites if e.candidate.id in tool.parents]
        known = any(_has_tool(parent, tool) for parent in parents)

        held: dict[str, ActionPlan] = {}
        for parent in parents:
            held |= self._held(parent)

        open_tasks = [task for task in self.tasks if task.name not in held]
        if known and not open_tasks:
            open_tasks = list(self.tasks)

        tried = tuple(e for e in self.tried if _has_tool(e, tool))
        brief, temperature = self.brief(tool.generation, tool.agent, team, tried)
        planned = PlannedTool(tool, {} if known else held, waits=len(open_tasks))

        requests: list[Request] = []
        for task in open_tasks:
            planned.plans[task.name] = []
            requests.append(
                self._request_plans(task, tool, parents, brief, temperature)
            )

        return planned, requests

    def _held(self, evaluation: Evaluation) -> dict[str, ActionPlan]:
        """Return the plans of a candidate for the tasks that it does."""
        held: dict[str, ActionPlan] = {}
        for task in self.tasks:
            plan = evaluation.candidate.plan.of(task.name)
            solved = evaluation.in_task(task.name).solved

            if solved and isinstance(plan, ActionPlan):
                held[task.name] = plan

        return held

    def _request_plans(
        self,
        task: Task,
        tool: Candidate,
        parents: Sequence[Evaluation],
        brief: Brief,
        temperature: float,
    ) -> Request:
        """Compose the request for plans with which a tool does one task.

        Args:
            task: one of the tasks.
            tool: a candidate without plans.
            parents: what the prompt shows: evaluations in all tasks.
            brief: of the tool's agent.
            temperature: of the request.
        """
        assert tool.tool is not None
        number = self.tasks.index(task)
        alone = [parent.in_task(task.name) for parent in parents]
        rng = np.random.default_rng([brief.seed, tool.design, number])
        known = KnownTool(tool.tool, self.assignment.representation)
        for_task = replace(
            brief,
            task=task,
            representation=known,
            actions=self.plan_actions,
            gripper=tool.tool.gripper,
            n_tool=1,
            n_action=self.assignment.budget.n_action,
            elites=tuple(
                e for e in alone if e.candidate.problem is None and e.reward > 0
            ),
            tried=tuple(e.in_task(task.name) for e in brief.tried),
            critiques={},
            recalled=self.recall(task, known),
            seed=int(rng.integers(2**31)),
        )

        name = f"g{brief.generation}-a{brief.agent}-s{tool.design}-t{number}"
        pictures = self.plan_pictures[task.name].get(for_task.gripper, ())
        prompts = self.plan_prompts[task.name]
        return self.request(name, for_task, temperature, prompts, pictures)


def _has_tool(evaluation: Evaluation, candidate: Candidate) -> bool:
    """Report whether a candidate was tried with the same tool.

    Args:
        evaluation: of a candidate that was tried.
        candidate: another one.
    """
    tool = evaluation.candidate.tool
    other = candidate.tool

    return tool is not None and other is not None and tool.content == other.content
