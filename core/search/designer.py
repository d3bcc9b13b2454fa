"""Design candidates: compose requests, ask the model, and read its replies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np
import pluggy

from core.config.schemas import Sampling
from core.design import Candidate, DesignError
from core.designs.composer import PromptComposer
from core.designs.feedback import last_generation, most_telling
from core.designs.planning import NO_PLAN
from core.designs.reading import read_designs
from core.designs.replies import parse_reply
from core.designs.schema import answer_schema
from core.errors import UserError
from core.events import Generation
from core.hooks import hookimpl
from core.interfaces import VLM, Brief, Picture, Reply, Request
from core.search.agent_groups import Team
from core.search.assignment import Assignment
from core.search.critic import Critic
from core.search.replies import ask_model
from core.trial import Evaluation

REPAIRED = "-repair"  # at the end of the id of a request that asks once more


@dataclass(frozen=True, eq=False)
class Answer:
    """What came of a request: ``candidates``; ``lost``: none of them, for a reason that may pass."""

    request: Request
    candidates: list[Candidate]
    lost: bool = False


@dataclass(eq=False)
class ModelDesigner:
    """A `core.interfaces.Designer` that sends the requests of all agents at once.

    Attributes:
        assignment: what is asked for.
        vlm: the model.
        prompts: composes the requests.
        sampling: the temperatures.
        events: receives requests and replies.
        pictures: those of the scene, without the gripper (False) and with it.
        film: draws a film strip of a rollout; if the prompts' feedback is ``full``, it is called for the best elite and
            for the most instructive failure of the last generation.
        critic: has candidates criticised before each generation; None: nothing is.
        tried: what requests may show of earlier generations; as a listener the designer collects it itself.
    """

    assignment: Assignment
    vlm: VLM
    prompts: PromptComposer
    sampling: Sampling
    events: pluggy.PluginManager
    pictures: Mapping[bool, tuple[Picture, ...]] = field(default_factory=dict)
    film: Callable[[Evaluation], Picture | None] | None = None
    critic: Critic | None = None
    tried: list[Evaluation] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._replies: list[Reply] = []  # of the generation that is being asked for

    @property
    def seed(self) -> int:
        """The run's seed."""
        return self.assignment.seed

    def scene_pictures(self) -> Iterator[Picture]:
        """Yield the pictures of the scene that prompts show."""
        for pictures in self.pictures.values():
            yield from pictures

    def design(
        self, generation: int, elites: Sequence[Evaluation] = ()
    ) -> Iterator[Candidate]:
        """See `core.interfaces.Designer`.

        Raises:
            LimitReached: after the last candidate; see `VLM.complete`.
            UserError: no request got an answer, for a reason that may pass.
        """
        agents = range(self.assignment.budget.n_agent)
        yield from self.design_in(generation, [Team(agents, elites)])

    def design_in(self, generation: int, teams: Sequence[Team]) -> Iterator[Candidate]:
        """See `core.search.agent_groups.AsksTeams`, and `design`."""
        for answer in self.ask(self.start(generation, teams)):
            yield from answer.candidates
        self.refuse_silence(generation)

    def start(self, generation: int, teams: Sequence[Team]) -> list[Request]:
        """Have elites criticised, and compose the requests of a generation's agents."""
        self._replies = []
        self._criticise(generation, [elite for team in teams for elite in team.elites])
        apart = len(teams) > 1
        requests: list[Request] = []
        for team in teams:
            requests += self.requests(generation, team, apart=apart)
        return requests

    def refuse_silence(self, generation: int) -> None:
        """Check that some request of the generation got an answer.

        Raises:
            UserError: none did, for a reason that may pass.
        """
        unanswered = [reply for reply in self._replies if reply.unanswered]
        if unanswered and all(reply.error is not None for reply in self._replies):
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
        strips = self._draw_strips(team, tried)
        return [
            self._request(generation, agent, team, tuple(tried), strips)
            for agent in team.agents
        ]

    def follow_ups(self, request: Request, elite: Evaluation | None) -> list[Request]:
        """Compose the requests that follow an answer with ``elite`` to a request; here there are none."""
        return []

    def ask(self, requests: Sequence[Request]) -> Iterator[Answer]:
        """Send requests, and yield their answers as they arrive; some ask once more where a reply can't be read."""
        again: list[Request] = []
        repair = self.prompts.settings.repair
        yield from self._answers(requests, again if repair else None)
        yield from self._answers(again, None)

    def _answers(
        self, requests: Sequence[Request], again: list[Request] | None
    ) -> Iterator[Answer]:
        """Yield the answers to requests; where a reply can't be read, append to ``again`` what asks once more."""
        missing = {request.id: request for request in requests}
        replies = ask_model(self.vlm, requests, self.events) if requests else ()
        for reply in replies:
            request = missing.pop(reply.request_id)
            self._replies.append(reply)

            if reply.error is not None:
                lost = _lose(request, f"the model gave no answer: {reply.error}")
                yield Answer(request, [lost], lost=reply.unanswered)
                continue

            try:
                yield Answer(request, self._read(request.brief, reply))
            except DesignError as error:
                if again is None:
                    yield Answer(
                        request, [_lose(request, f"the reply can't be read: {error}")]
                    )
                    continue

                messages = self.prompts.repair(request, reply, str(error))
                name = f"{request.id}{REPAIRED}"
                again.append(replace(request, id=name, messages=messages))

        for request in missing.values():
            yield Answer(request, [_lose(request, "no reply came")])

    def _criticise(self, generation: int, elites: Sequence[Evaluation]) -> None:
        """Ask for critiques, and wait for them: the generation's other requests show them."""
        if self.critic is None:
            return
        brief, _ = self.brief(generation, 0, Team(range(1), elites), tuple(self.tried))
        requests = {request.id: request for request in self.critic.requests(brief)}
        if not requests:
            return
        for reply in ask_model(self.vlm, list(requests.values()), self.events):
            self.critic.hear(reply, requests[reply.request_id])

    def _draw_strips(
        self, team: Team, tried: Sequence[Evaluation]
    ) -> dict[str, Picture]:
        """Draw film strips of the best elite and of a failure, by the candidates' ids."""
        if self.film is None or self.prompts.settings.feedback != "full":
            return {}
        best = team.elites[:1]
        telling = most_telling(best, last_generation(tried))
        strips: dict[str, Picture] = {}
        for evaluation in islice(telling, len(best) + 1):
            strip = self.film(evaluation)
            if strip is not None:
                strips[evaluation.candidate.id] = strip
        return strips

    def brief(
        self, generation: int, agent: int, team: Team, tried: tuple[Evaluation, ...]
    ) -> tuple[Brief, float]:
        """Make an agent's assignment, and draw its temperature."""
        assignment = self.assignment
        given = assignment.given
        rng = np.random.default_rng([assignment.seed, generation, agent])
        kinds = assignment.tool_kinds
        kind = kinds[int(rng.integers(len(kinds)))]
        spread = self.sampling.spread
        temperature = (
            self.sampling.temperature + team.warmth + rng.uniform(-spread, spread)
        )
        critiques: Mapping[str, str] = {}
        if self.critic is not None:
            critiques = self.critic.words(team.elites, tried)
        brief = Brief(
            task=assignment.task,
            scene_seed=assignment.seed,
            representation=assignment.representation,
            actions=assignment.actions,
            gripper=kind == "gripper" if given is None else given.gripper,
            n_tool=assignment.budget.n_tool if given is None else 1,
            n_action=assignment.budget.n_action,
            generation=generation,
            agent=agent,
            seed=int(rng.integers(2**31)),
            elites=tuple(team.elites),
            tried=tried,
            critiques=critiques,
            style=team.style,
        )
        return brief, float(np.clip(temperature, 0.0, 2.0))

    def _request(
        self,
        generation: int,
        agent: int,
        team: Team,
        tried: tuple[Evaluation, ...],
        strips: Mapping[str, Picture],
    ) -> Request:
        brief, temperature = self.brief(generation, agent, team, tried)
        scene = self.pictures.get(brief.gripper, ())
        schema = not self.vlm.takes_schema
        messages = self.prompts.compose(brief, scene, strips, schema=schema)
        name = f"g{generation}-a{agent}"
        return Request(name, brief, messages, answer_schema(brief), temperature)

    def _read(self, brief: Brief, reply: Reply) -> list[Candidate]:
        """Read the candidates of a reply, at most as many as the brief asks for.

        Raises:
            DesignError: the reply can't be read.
        """
        return read_designs(
            self.parse(brief, reply.text),
            brief.representation,
            brief.task,
            generation=brief.generation,
            agent=brief.agent,
            elites=tuple(elite.candidate.id for elite in brief.elites),
            most=(brief.n_tool, brief.n_action or None),
            actions=brief.actions,
        )

    def parse(self, brief: Brief, text: str) -> object:
        """Find the designs document in a reply.

        Raises:
            DesignError: there is none, or it is malformed.
        """
        return parse_reply(text)


def _lose(request: Request, problem: str) -> Candidate:
    """Make a candidate that stands for all that an agent would have designed."""
    brief = request.brief
    return Candidate(None, NO_PLAN, brief.generation, brief.agent, problem=problem)
