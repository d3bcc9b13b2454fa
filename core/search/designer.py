"""Design candidates: compose requests, ask the model, and read its replies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain

import numpy as np
import pluggy

from core.config.schemas import Sampling
from core.design import Candidate, DesignError
from core.designs.composer import PromptComposer
from core.designs.feedback import last_generation, most_instructive
from core.designs.planning import NO_PLAN, TaskActions
from core.designs.reading import parse_reply, read_designs
from core.designs.schema import answer_schema
from core.errors import UserError
from core.events import Generation
from core.hooks import hookimpl
from core.interfaces import (
    VLM,
    Brief,
    Picture,
    Reply,
    Request,
)
from core.search.agent_groups import Team
from core.search.assignment import Assignment
from core.search.critic import Critic
from core.search.replies import ask_model
from core.search.several import REPAIRED, TaskPlanner, without_plans
from core.trial import Evaluation


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
    pictures: Mapping[str, Mapping[bool, tuple[Picture, ...]]] = field(
        default_factory=dict
    )
    planner: TaskPlanner | None = None
    show: Callable[[Evaluation], Picture | None] | None = None
    critic: Critic | None = (
        None  # has candidates criticised before each generation; None: nothing is
    )
    tried: list[Evaluation] = field(default_factory=list)

    def __post_init__(self) -> None:
        assignment = self.assignment
        self.task = assignment.task
        self.representation = assignment.representation
        self.actions = assignment.actions if self.planner is None else TaskActions()
        self.budget = assignment.budget
        self.seed = assignment.seed
        self._given = self.representation.given(self.task)

    def scene_pictures(self) -> Iterator[Picture]:
        """Yield the pictures of all scenes that prompts show."""
        for by_gripper in self.pictures.values():
            for pictures in by_gripper.values():
                yield from pictures

    def design(
        self, generation: int, elites: Sequence[Evaluation] = ()
    ) -> Iterator[Candidate]:
        """See `core.interfaces.Designer`.

        Raises:
            LimitReached: after the last candidate; see `VLM.complete`.
            UserError: no request got an answer, for a reason that may pass.
        """
        yield from self.design_in(
            generation, [Team(range(self.budget.n_agent), elites)]
        )

    def design_in(self, generation: int, teams: Sequence[Team]) -> Iterator[Candidate]:
        """See `core.search.agent_groups.AsksTeams`, and `design`."""
        self._criticise(generation, [elite for team in teams for elite in team.elites])
        most, failures = self.budget.n_tool, list[Reply | None]()
        kept = (
            self.planner.kept(generation, teams, self._given, most)
            if self.planner is not None
            else {}
        )
        requests = [
            request
            for team in teams
            for request in self.requests(generation, team, apart=len(teams) > 1)
        ]
        requests = [request for request in requests if request.brief.agent not in kept]
        answered = partial(
            self._answered, failures=failures, repair=self.prompts.settings.repair
        )
        designed: Iterator[Candidate] = chain(
            chain(*kept.values()),
            (c for _, found, _ in answered(requests) for c in found),
        )
        if self.planner is not None:
            designed = self.planner.candidates(
                designed, teams, self.tried, self._brief, answered
            )
        yield from designed
        unanswered = [
            reply for reply in failures if reply is not None and reply.unanswered
        ]
        if unanswered and None not in failures:
            raise UserError(
                f"the model answered no request of generation {generation}: {unanswered[0].error}; requests without "
                "an answer are sent again when the run goes on"
            )

    @hookimpl
    def generation_finished(self, generation: Generation) -> None:
        self.tried += generation.evaluations

    def requests(
        self, generation: int, team: Team, *, apart: bool = False
    ) -> list[Request]:
        """Compose the request of each agent of a team, which may be shown what was tried; if ``apart``, by the team."""
        tried = [e for e in self.tried if not apart or e.candidate.agent in team.agents]
        pictures: dict[str, Picture] = {}
        if self.show is not None and self.prompts.settings.feedback == "full":
            best = [elite.candidate.id for elite in team.elites[:1]]
            failure = most_instructive(
                e for e in last_generation(tried) if e.candidate.id not in best
            )
            shown = [*team.elites[:1], *([failure] if failure is not None else [])]
            drawn = {
                evaluation.candidate.id: self.show(evaluation) for evaluation in shown
            }
            pictures = {
                name: picture for name, picture in drawn.items() if picture is not None
            }
        return [
            self._request(generation, agent, team, tuple(tried), pictures)
            for agent in team.agents
        ]

    def _criticise(self, generation: int, elites: Sequence[Evaluation]) -> None:
        """Ask for critiques, and wait for them: the generation's other requests show them."""
        if self.critic is not None:
            brief, _ = self._brief(
                generation, 0, Team(range(1), elites), tuple(self.tried)
            )
            asked = {request.id: request for request in self.critic.requests(brief)}
            for reply in (
                ask_model(self.vlm, list(asked.values()), self.events) if asked else ()
            ):
                self.critic.hear(reply, asked[reply.request_id])

    def _answered(
        self, requests: Sequence[Request], failures: list[Reply | None], *, repair: bool
    ) -> Iterator[tuple[Request, list[Candidate], bool]]:
        """Yield the candidates of each reply, and whether none came for a reason that may pass.

        With ``repair`` ask once more where a reply can't be read. Each reply with an error is appended to ``failures``,
        and None for each other one.
        """
        again: list[Request] = []
        missing = {request.id: request for request in requests}
        for reply in ask_model(self.vlm, requests, self.events):
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
                    again.append(
                        replace(
                            request, id=f"{request.id}{REPAIRED}", messages=messages
                        )
                    )
                else:
                    yield (
                        request,
                        [_lost(request.brief, f"the reply can't be read: {error}")],
                        False,
                    )
        for request in missing.values():
            yield request, [_lost(request.brief, "no reply came")], False
        if again:
            yield from self._answered(again, failures, repair=False)

    def _brief(
        self, generation: int, agent: int, team: Team, tried: tuple[Evaluation, ...]
    ) -> tuple[Brief, float]:
        """Make an agent's assignment, and draw its temperature."""
        rng = np.random.default_rng([self.seed, generation, agent])
        kinds = self.assignment.tool_kinds
        kind = kinds[int(rng.integers(len(kinds)))]
        gripper = self._given.gripper if self._given is not None else kind == "gripper"
        temperature = (
            self.sampling.temperature
            + team.warmth
            + rng.uniform(-self.sampling.spread, self.sampling.spread)
        )
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
            critiques=self.critic.words(team.elites, tried)
            if self.critic is not None
            else {},
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
        scene = tuple(
            p for of in self.pictures.values() for p in of.get(brief.gripper, ())
        )
        messages = self.prompts.compose(
            brief, scene, pictures, schema=not self.vlm.takes_schema
        )
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
            brief.task,
            generation=brief.generation,
            agent=brief.agent,
            elites=tuple(elite.candidate.id for elite in brief.elites),
            most=(brief.n_tool, brief.n_action or None),
            actions=brief.actions,
        )


def _lost(brief: Brief, problem: str) -> Candidate:
    """Make a candidate that stands for all that an agent would have designed."""
    return Candidate(None, NO_PLAN, brief.generation, brief.agent, problem=problem)
