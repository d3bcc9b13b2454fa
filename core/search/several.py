"""Ask for plans for tools that must do several tasks: a request for each tool and task.

What holds is kept: the plan of a parent for a task that it does goes over to its offspring, and for a tool that does
some of its tasks plans are asked for the others alone. `core.search.together.Together.joined` joins what was tried.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest

import numpy as np

from core.design import Candidate, Tool
from core.designs.composer import PromptComposer
from core.designs.schema import answer_schema
from core.interfaces import (
    ActionPlan,
    ActionRepresentation,
    Brief,
    GivenTools,
    Picture,
    Request,
    Task,
    ToolRepresentation,
)
from core.search.agent_groups import Team
from core.trial import Evaluation
from core.values.plans import TaskPlans

Briefing = Callable[[int, int, Team, tuple[Evaluation, ...]], tuple[Brief, float]]
Answered = Callable[
    [Sequence[Request]], Iterator[tuple[Request, list[Candidate], bool]]
]
NO_PLANS = TaskPlans(())
REPAIRED = "-repair"  # at the end of the id of a request that asks once more


class KnownTool(GivenTools):
    """A tool of a design, for which only plans are asked for."""

    def __init__(self, tool: Tool, of: ToolRepresentation) -> None:
        self.robot, self.material, self._tool = of.robot, of.material, tool

    def given(self, task: Task) -> Tool:
        return self._tool


@dataclass(eq=False)
class _Asked:
    """A tool while its plans are asked for: the plans that it keeps, and those that came, by task."""

    tool: Candidate
    kept: Mapping[str, ActionPlan]
    plans: dict[str, list[ActionPlan | str]] = field(default_factory=dict)
    words: dict[str, str] = field(default_factory=dict)
    waits: int = 0
    lost: str | None = None

    def candidates(self) -> Iterator[Candidate]:
        """Yield a candidate for each number of a plan; the first has the plans that are kept, too."""
        if self.lost is not None:
            yield replace(self.tool, problem=self.lost)
            return
        for number, plans in enumerate(
            zip_longest(*self.plans.values()) if self.plans else [()]
        ):
            new = {
                task: plan
                for task, plan in zip(self.plans, plans, strict=True)
                if plan is not None
            }
            made = {**(self.kept if number == 0 else {}), **new}
            words = " | ".join(
                f"{task}: {text}" for task, text in sorted(self.words.items())
            )
            plan = TaskPlans(tuple(made.items()))
            yield replace(self.tool, plan=plan, action=number, action_description=words)


@dataclass(eq=False)
class TaskPlanner:
    """Composes the requests for plans, and makes candidates of tools and the plans that came.

    Attributes:
        task: that of several parts.
        representation: of the tools.
        actions: of the plans.
        n_action: plans that are asked for, for each tool and task.
        prompts: by task.
        pictures: of the scenes, by task, without the gripper (False) and with it.
        takes_schema: see `core.interfaces.VLM.takes_schema`.
    """

    task: Task
    representation: ToolRepresentation
    actions: ActionRepresentation
    n_action: int
    prompts: Mapping[str, PromptComposer]
    pictures: Mapping[str, Mapping[bool, tuple[Picture, ...]]]
    takes_schema: bool = False

    def kept(
        self, generation: int, teams: Sequence[Team], given: Tool | None, most: int
    ) -> dict[int, list[Candidate]]:
        """Return by agent the elites' tools that are kept: every second agent has plans asked for what they can't do.

        All agents keep a ``given`` tool. Each has at most ``most`` tools.
        """
        found: dict[int, list[Candidate]] = {}
        for team in teams:
            tools = [
                e.candidate
                for e in team.elites
                if given is not None or len(self._held(e)) < len(self.task.parts)
            ]
            tools = tools or ([Candidate(given, NO_PLANS)] if given is not None else [])
            for agent in (
                a
                for a in team.agents
                if tools and (given is not None or (a + generation) % 2)
            ):
                named = [
                    replace(
                        tool,
                        generation=generation,
                        agent=agent,
                        plan=NO_PLANS,
                        action=0,
                    )
                    for tool in tools
                ]
                parents = [(tool.id,) if team.elites else () for tool in tools]
                found[agent] = [
                    replace(tool, strategy=number, parents=of, varied=False)
                    for number, (tool, of) in enumerate(
                        zip(named[:most], parents, strict=False)
                    )
                ]
        return found

    def candidates(
        self,
        tools: Iterable[Candidate],
        teams: Sequence[Team],
        tried: Sequence[Evaluation],
        brief: Briefing,
        answered: Answered,
    ) -> Iterator[Candidate]:
        """Ask for plans for ``tools``, and yield their candidates as replies arrive.

        ``brief`` makes an agent's brief; ``answered`` sends requests, and yields what came of each, and whether there
        was no answer for a reason that may pass: then the tool is not tried.
        """
        asked: dict[str, tuple[_Asked, str]] = {}
        requests: list[Request] = []
        for tool in tools:
            if tool.problem is not None:
                yield tool
                continue
            team = next(team for team in teams if tool.agent in team.agents)
            parents = [e for e in team.elites if e.candidate.id in tool.parents]
            known = [e for e in parents if _has(e, tool)]
            held = {
                task: plan
                for parent in parents
                for task, plan in self._held(parent).items()
            }
            one = _Asked(tool, {} if known else held)
            open_ = [part for part in self.task.parts if part.name not in held] or [
                *self.task.parts
            ] * bool(known)
            plain, temperature = brief(
                tool.generation,
                tool.agent,
                team,
                tuple(e for e in tried if _has(e, tool)),
            )
            for part in open_:
                one.plans[part.name] = []
                requests.append(self.request(part, tool, parents, plain, temperature))
                asked[requests[-1].id] = one, part.name
            one.waits = len(open_)
            if not open_:
                yield from one.candidates()
        for request, found, lost in answered(requests):
            one, task = asked[request.id.removesuffix(REPAIRED)]
            one.plans[task] = [
                c.plan if c.problem is None else c.problem for c in found
            ]
            one.words[task] = found[0].action_description
            one.waits -= 1
            one.lost = found[0].problem if lost else one.lost
            if one.waits == 0:
                yield from one.candidates()

    def _held(self, evaluation: Evaluation) -> dict[str, ActionPlan]:
        """Return the plans of a candidate for the tasks that it does."""
        done = [
            part.name
            for part in self.task.parts
            if evaluation.figures.get(part.name, 0.0) >= part.success_reward
        ]
        plans = {name: evaluation.candidate.plan.of(name) for name in done}
        return {
            name: plan for name, plan in plans.items() if isinstance(plan, ActionPlan)
        }

    def request(
        self,
        part: Task,
        tool: Candidate,
        parents: Sequence[Evaluation],
        brief: Brief,
        temperature: float,
    ) -> Request:
        """Compose the request for plans with which a tool does one task."""
        assert tool.tool is not None
        number = self.task.parts.index(part)
        elites = [
            e.in_task(part.name)
            for e in parents
            if e.candidate.of(part.name).problem is None
        ]
        own = replace(
            brief,
            task=part,
            representation=KnownTool(tool.tool, self.representation),
            actions=self.actions,
            gripper=tool.tool.gripper,
            n_tool=1,
            n_action=self.n_action,
            elites=tuple(e for e in elites if e.reward > 0),
            tried=tuple(e.in_task(part.name) for e in brief.tried),
            critiques={},
            seed=int(
                np.random.default_rng([brief.seed, tool.strategy, number]).integers(
                    2**31
                )
            ),
        )
        pictures = self.pictures.get(part.name, {}).get(own.gripper, ())
        messages = self.prompts[part.name].compose(
            own, pictures, schema=not self.takes_schema
        )
        name = f"g{brief.generation}-a{brief.agent}-s{tool.strategy}-t{number}"
        return Request(name, own, messages, answer_schema(own), temperature)


def _has(evaluation: Evaluation, candidate: Candidate) -> bool:
    """Report whether a candidate was tried with the same tool."""
    one, other = evaluation.candidate.tool, candidate.tool
    return one is not None and other is not None and one.content == other.content


def without_plans(document: object) -> object:
    """Give each strategy of a reply that was asked for tools alone an empty list of plans for tasks."""
    strategies = document.get("strategies") if isinstance(document, dict) else None
    if not isinstance(strategies, list):
        return document
    return {
        "strategies": [
            {**s, "action_sets": [[]]} if isinstance(s, dict) else s for s in strategies
        ]
    }
