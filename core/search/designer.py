"""Design candidates: compose requests, ask the model, and read its replies."""

from __future__ import annotations

import queue
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from types import MappingProxyType

import numpy as np
import pluggy

from core.config.schemas import Sampling
from core.design import Candidate, DesignError, Evaluation, Tool
from core.designs.composer import PromptComposer, answer_schema
from core.designs.feedback import last_generation, most_instructive
from core.designs.planning import NO_PLAN, TaskActions, guarded
from core.designs.reading import dump_design, parse_reply, read_designs
from core.designs.rules import SpawnRules, given_tool
from core.errors import UsageError, UserError, choices
from core.events import Generation
from core.geometry import Array
from core.hooks import hookimpl
from core.interfaces import (
    VLM,
    ActionRepresentation,
    Brief,
    Budget,
    Numbers,
    Picture,
    Reply,
    Request,
    Robot,
    Simulator,
    Task,
    ToolRepresentation,
)
from core.plugins import describe_part
from core.search.agent_groups import Team
from core.search.critic import Critic
from core.search.prompt_pictures import pictures_by_task, strips
from core.search.several import REPAIRED, TaskPlanner, without_plans
from core.support.cli import say
from core.support.memory import release_memory
from core.support.text import shorten
from core.support.threads import run_in_thread
from core.values.messages import checked

TOOL_KINDS = ("rigid", "gripper")
DEFAULT_KINDS = ("rigid",)  # for a task that names none


@dataclass(frozen=True, eq=False)
class Assignment:
    """What all agents of a run are asked for: tools and plans for a task, in these forms.

    An agent's seed, temperature and kind of tool follow from ``seed``, the generation and the agent's number alone. Of
    two ``tool_kinds`` each agent gets one at random. Where the representation gives a tool, agents are asked for plans
    only.

    Raises:
        UserError: an unknown tool kind.
    """

    task: Task
    representation: ToolRepresentation
    actions: ActionRepresentation
    budget: Budget
    seed: int
    tool_kinds: Sequence[str] = DEFAULT_KINDS

    def __post_init__(self) -> None:
        for name in self.tool_kinds:
            if name not in TOOL_KINDS:
                raise choices("tool kind", str(name), TOOL_KINDS, "task.tool_kinds")


@dataclass(eq=False)
class ModelDesigner:
    """A `core.interfaces.Designer` that sends the requests of all agents at once.

    Attributes:
        pictures: those of each task's scene, without the gripper (False) and with it.
        planner: asks for plans for tools that must do several tasks; None: there is one task.
        show: draws a film strip of a rollout; if the prompts' feedback is ``full``, it is called for the best elite and
            for the most instructive failure of the last generation.
        tried: what requests may show of earlier generations; as a listener the designer collects it itself.
    """

    assignment: Assignment  # what is asked for
    vlm: VLM  # the model
    prompts: PromptComposer  # composes the requests
    sampling: Sampling  # the temperatures
    events: pluggy.PluginManager  # receives requests and replies
    pictures: Mapping[str, Mapping[bool, tuple[Picture, ...]]] = field(default_factory=dict)
    planner: TaskPlanner | None = None
    show: Callable[[Evaluation], Picture | None] | None = None
    critic: Critic | None = None  # has candidates criticised before each generation; None: nothing is
    tried: list[Evaluation] = field(default_factory=list)

    def __post_init__(self) -> None:
        asked = self.assignment
        self.task, self.representation = asked.task, asked.representation
        self.actions = asked.actions if self.planner is None else TaskActions()
        self.budget, self.seed = asked.budget, asked.seed
        self._spawns = {task.name: SpawnRules(task, self.seed) for task in (self.task, *self.task.parts)}
        self._given = self.representation.given(self.task)

    def design(self, generation: int, elites: Sequence[Evaluation] = ()) -> Iterator[Candidate]:
        """See `core.interfaces.Designer`.

        Raises:
            LimitReached: after the last candidate; see `VLM.complete`.
            UserError: no request got an answer, for a reason that may pass.
        """
        yield from self.design_in(generation, [Team(range(self.budget.n_agent), elites)])

    def design_in(self, generation: int, teams: Sequence[Team]) -> Iterator[Candidate]:
        """See `core.search.agent_groups.AsksTeams`, and `design`."""
        self._criticise(generation, [elite for team in teams for elite in team.elites])
        most, failures = self.budget.n_tool, list[Reply | None]()
        kept = self.planner.kept(generation, teams, self._given, most) if self.planner is not None else {}
        requests = [request for team in teams for request in self.requests(generation, team, apart=len(teams) > 1)]
        requests = [request for request in requests if request.brief.agent not in kept]
        answered = partial(self._answered, failures=failures, repair=self.prompts.settings.repair)
        designed: Iterator[Candidate] = chain(
            chain(*kept.values()), (c for _, found, _ in answered(requests) for c in found)
        )
        if self.planner is not None:
            designed = self.planner.candidates(designed, teams, self.tried, self._brief, answered)
        yield from designed
        unanswered = [reply for reply in failures if reply is not None and reply.unanswered]
        if unanswered and None not in failures:
            raise UserError(
                f"the model answered no request of generation {generation}: {unanswered[0].error}; requests without "
                "an answer are sent again when the run goes on"
            )

    @hookimpl
    def generation_finished(self, generation: Generation) -> None:
        self.tried += generation.evaluations

    def requests(self, generation: int, team: Team, *, apart: bool = False) -> list[Request]:
        """Compose the request of each agent of a team, which may be shown what was tried; if ``apart``, by the team."""
        tried = [e for e in self.tried if not apart or e.candidate.agent in team.agents]
        pictures: dict[str, Picture] = {}
        if self.show is not None and self.prompts.settings.feedback == "full":
            best = [elite.candidate.id for elite in team.elites[:1]]
            failure = most_instructive(e for e in last_generation(tried) if e.candidate.id not in best)
            shown = [*team.elites[:1], *([failure] if failure is not None else [])]
            drawn = {evaluation.candidate.id: self.show(evaluation) for evaluation in shown}
            pictures = {name: picture for name, picture in drawn.items() if picture is not None}
        return [self._request(generation, agent, team, tuple(tried), pictures) for agent in team.agents]

    def _criticise(self, generation: int, elites: Sequence[Evaluation]) -> None:
        """Ask for critiques, and wait for them: the generation's other requests show them."""
        if self.critic is not None:
            brief, _ = self._brief(generation, 0, Team(range(1), elites), tuple(self.tried))
            asked = {request.id: request for request in self.critic.requests(brief)}
            for reply in self._replies(list(asked.values())) if asked else ():
                self.critic.hear(reply, asked[reply.request_id])

    def parameters(self, candidate: Candidate) -> Numbers:
        """Return the N numbers of a candidate's tool and plan that a refinement may vary."""
        assert candidate.tool is not None
        found = Numbers() if self._given is not None else self.representation.parameters(candidate.tool)
        return found + self.actions.parameters(candidate.plan)

    def vary(self, candidate: Candidate, values: Array, key: tuple[int, int, int, int]) -> Candidate:
        """Make a candidate of ``values`` (N,), see `parameters`, with ``key``; what breaks a rule is its problem."""
        assert candidate.tool is not None
        generation, agent, strategy, _ = key
        count = len(values) - len(self.actions.parameters(candidate.plan))
        named = replace(candidate, generation=generation, agent=agent, strategy=strategy, action=0)
        varied = replace(named, parents=(candidate.id,), varied=True)
        try:
            with guarded(self.representation, "with_parameters"):
                tool = self.representation.with_parameters(candidate.tool, values[:count]) if count else candidate.tool
            with guarded(self.actions, "with_parameters"):
                plan = self.actions.with_parameters(candidate.plan, values[count:])
            document = {"strategies": [dump_design(replace(candidate, tool=tool, plan=plan), self.representation)]}
            (read,) = read_designs(document, self.representation, self._spawns[self.task.name], actions=self.actions)
        except DesignError as error:
            return replace(varied, problem=str(error))
        return replace(varied, tool=read.tool, plan=read.plan, problem=read.problem)

    def toward(self, candidate: Candidate, other: Candidate) -> Array | None:
        """Return the values (N,) of a candidate's `parameters` that make it like ``other``; None: more differs."""
        assert candidate.tool is not None
        assert other.tool is not None
        given = self._given is not None
        tool = Numbers().values if given else self.representation.toward(candidate.tool, other.tool)
        same = candidate.plan.anchors == other.plan.anchors
        plan = self.actions.toward(candidate.plan, other.plan) if same else None
        return None if tool is None or plan is None else np.concatenate([tool, plan])

    def _answered(
        self, requests: Sequence[Request], failures: list[Reply | None], *, repair: bool
    ) -> Iterator[tuple[Request, list[Candidate], bool]]:
        """Yield the candidates of each reply, and whether none came for a reason that may pass.

        With ``repair`` ask once more where a reply can't be read. Each reply with an error is appended to ``failures``,
        and None for each other one.
        """
        again: list[Request] = []
        missing = {request.id: request for request in requests}
        for reply in self._replies(requests):
            request = missing.pop(reply.request_id)
            failures.append(reply if reply.error is not None else None)
            if reply.error is not None:
                lost = _lost(request.brief, f"the model gave no answer: {reply.error}")
                yield request, [lost], reply.unanswered
                continue
            try:
                yield request, self._read(request.brief, reply), False
            except DesignError as error:
                if repair:
                    messages = self.prompts.repair(request, reply, str(error))
                    again.append(replace(request, id=f"{request.id}{REPAIRED}", messages=messages))
                else:
                    yield request, [_lost(request.brief, f"the reply can't be read: {error}")], False
        for request in missing.values():
            yield request, [_lost(request.brief, "no reply came")], False
        if again:
            yield from self._answered(again, failures, repair=False)

    def _replies(self, requests: Sequence[Request]) -> Iterator[Reply]:
        """Yield replies as they arrive.

        A thread of its own receives them and passes each on to the listeners. So a reply is on disk at once, while
        candidates of earlier replies are tried.
        """
        arrived: queue.SimpleQueue[Reply | Exception | None] = queue.SimpleQueue()
        by_id = {request.id: request for request in requests}
        missing = set(by_id)

        def receive() -> None:
            for reply in self.vlm.complete(requests):
                if not isinstance(reply, Reply) or reply.request_id not in missing:
                    wrong = f"{shorten(repr(reply))}, which is no Reply"
                    if isinstance(reply, Reply):
                        wrong = f"a reply to {reply.request_id!r}, which was not sent or has its reply already"
                    say(f"{describe_part(self.vlm)}: complete gave {wrong}; it is left out", file=sys.stderr)
                    continue
                missing.remove(reply.request_id)
                reply = checked(reply)
                self.events.hook.reply_received(request=by_id[reply.request_id], reply=reply)
                arrived.put(reply)

        for request in requests:
            self.events.hook.request_composed(request=request)
        release_memory()  # of pictures that were drawn: a model may take minutes
        run_in_thread(receive, arrived.put, "replies")
        while (reply := arrived.get()) is not None:
            if isinstance(reply, Exception):
                raise reply
            yield reply

    def _brief(self, generation: int, agent: int, team: Team, tried: tuple[Evaluation, ...]) -> tuple[Brief, float]:
        """Make an agent's assignment, and draw its temperature."""
        rng = np.random.default_rng([self.seed, generation, agent])
        kinds = self.assignment.tool_kinds
        kind = kinds[int(rng.integers(len(kinds)))]
        gripper = self._given.gripper if self._given is not None else kind == "gripper"
        temperature = self.sampling.temperature + team.warmth + rng.uniform(-self.sampling.spread, self.sampling.spread)
        brief = Brief(
            task=self.task,
            scene_seed=self.seed,
            representation=self.representation,
            actions=self.actions,
            gripper=gripper,
            n_tool=self.budget.n_tool if self._given is None else 1,
            n_action=self.budget.n_action if self.planner is None else 0,
            generation=generation,
            agent=agent,
            seed=int(rng.integers(2**31)),
            elites=tuple(team.elites),
            tried=tried,
            critiques=self.critic.words(team.elites, tried) if self.critic is not None else {},
            style=team.style,
        )
        return brief, float(np.clip(temperature, 0.0, 2.0))

    def _request(
        self,
        generation: int,
        agent: int,
        team: Team,
        tried: tuple[Evaluation, ...],
        pictures: Mapping[str, Picture],
    ) -> Request:
        brief, temperature = self._brief(generation, agent, team, tried)
        scene = tuple(p for of in self.pictures.values() for p in of.get(brief.gripper, ()))
        messages = self.prompts.compose(brief, scene, pictures, schema=not self.vlm.takes_schema)
        schema = answer_schema(brief)
        return Request(f"g{generation}-a{agent}", brief, messages, schema, temperature)

    def _read(self, brief: Brief, reply: Reply) -> list[Candidate]:
        """Read the candidates of a reply, at most as many as the brief asks for.

        Raises:
            DesignError: the reply can't be read.
        """
        document = parse_reply(reply.text)
        return read_designs(
            document if brief.n_action else without_plans(document),
            brief.representation,
            self._spawns[brief.task.name],
            generation=brief.generation,
            agent=brief.agent,
            elites=tuple(elite.candidate.id for elite in brief.elites),
            most=(brief.n_tool, brief.n_action or None),
            actions=brief.actions,
        )


def _lost(brief: Brief, problem: str) -> Candidate:
    """Make a candidate that stands for all that an agent would have designed."""
    return Candidate(None, NO_PLAN, brief.generation, brief.agent, problem=problem)


def borne_kinds(tool_kinds: Sequence[str], robot: Robot) -> list[str]:
    """Return the tool kinds that the robot can bear: without a gripper, rigid ones.

    Raises:
        UserError: none is left.
    """
    borne = [name for name in tool_kinds if name != "gripper" or robot.gripper is not None]
    if not borne:
        raise UserError(
            f"robot {robot.name} has no gripper, and task.tool_kinds has no other kind; set task.tool_kinds=[rigid], "
            "or choose another robot"
        )
    return borne


def make_designer(
    assignment: Assignment,
    create: Callable[[], Simulator],
    vlm: VLM,
    prompts: PromptComposer,
    sampling: Sampling,
    events: pluggy.PluginManager,
    prompts_of: Mapping[str, PromptComposer] = MappingProxyType({}),
) -> ModelDesigner:
    """Make a designer that shows the model pictures of the scene and of rollouts, drawn by what ``create`` makes.

    ``prompts_of`` composes the requests for plans for each of several tasks.

    One with a loaded scene holds 100 MB: the scene's is let go, and rollouts have another from the first one on. Where
    nothing can draw, standard error says why, and the model gets text alone.

    Raises:
        UsageError: the model or the task is not one for the level ``prompt.told``.
        UserError: no tool kind that the robot can bear, no given tool for the task, or one that breaks a rule.
    """
    told, unseen = prompts.settings.told, not prompts.level.numbers
    if unseen and not vlm.sees:
        raise UsageError(
            f"{vlm.model} reads the scene's numbers, not pictures: prompt.told={told} needs a model that sees"
        )
    if prompts.level.in_words and not assignment.task.in_words:
        raise UsageError(
            f"{assignment.task.name} has no text without numbers for prompt.told={told}: give it `in_words`"
        )
    task, seed = assignment.task, assignment.seed
    if unseen and len(task.parts) > 1:
        raise UsageError(f"prompt.told={told} shows one scene, and {task.name} has several: use words or source")
    given = given_tool(assignment.representation, task, seed)
    if given is None:
        assignment = replace(assignment, tool_kinds=borne_kinds(assignment.tool_kinds, task.robot))
    bare = [Tool(gripper=name == "gripper") for name in dict.fromkeys(assignment.tool_kinds)]
    mounted = bare if given is None else [given]
    pictures, drawable = pictures_by_task(task, create, prompts, seed, mounted)
    film = strips(task, create, seed, prompts.rollout) if drawable else None
    count, critic = prompts.settings.critic, None
    if count and not vlm.criticises:
        say(f"prompt.critic={count}: {vlm.model} writes no critiques; there are none", file=sys.stderr)
    elif count:
        critic = Critic(prompts, sampling.temperature, film)
    planner = None
    if len(task.parts) > 1:
        forms, count = (assignment.representation, assignment.actions), assignment.budget.n_action
        planner = TaskPlanner(task, *forms, count, prompts_of, pictures, vlm.takes_schema)
    return ModelDesigner(assignment, vlm, prompts, sampling, events, pictures, planner, film, critic)
