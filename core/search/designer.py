"""Design candidates: compose requests, ask the model, and read its replies."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Protocol

import numpy as np
import pluggy

from core.config.schemas import Sampling
from core.design import Candidate, DesignError
from core.designs.composer import PromptComposer
from core.designs.replies import parse_reply
from core.designs.schema import answer_schema
from core.errors import LimitReached, NoAnswer, UsageError
from core.events import Generation, Result
from core.hooks import hookimpl
from core.interfaces import (
    VLM,
    Brief,
    Picture,
    Recalled,
    Reply,
    Request,
    Task,
    ToolRepresentation,
)
from core.scene import Camera, State
from core.search.answers import Answer, Mender
from core.search.assignment import Assignment, Team
from core.search.model_requests import ask_model
from core.trial import Evaluation

ScenePictures = Mapping[bool, tuple[Picture, ...]]
"""The pictures of a scene, without the gripper (False) and with it."""


Aim = Callable[[Camera, State], Camera]
"""Makes another camera of the task's, by where the free bodies are."""


class Artist:
    """Draws what prompts show of the scene and of rollouts; this one draws nothing.

    A plugin makes another one of an `Assignment`, a `PromptComposer` and what makes an engine.
    """

    def draw_scene(self, task: Task) -> ScenePictures:
        """Make the pictures of a task's scene that the prompt's settings ask for.

        Raises:
            UserError: the machine fails, or a prompt without numbers can't be drawn.
        """
        return {}

    def draw_strip(
        self, evaluation: Evaluation, aim: Aim | None = None
    ) -> Picture | None:
        """Draw a film strip of the trial that is shown; None: there is none.

        Args:
            evaluation: of a candidate.
            aim: makes the camera of each frame; None: it is close to what moves.
        """
        return None

    def draw_strips(
        self, elites: Sequence[Evaluation], tried: Sequence[Evaluation]
    ) -> Mapping[str, Picture]:
        """Draw the film strips that a prompt shows of elites, and of what was tried before, by candidates' ids."""
        return {}


class Critic(Protocol):
    """Has a model say what fails in candidates, for the prompts that follow; a plugin makes it of a `ModelDesigner`.

    The designer calls `criticise` before each generation, and then `words` for each request of the generation.
    """

    def criticise(self, brief: Brief) -> None:
        """Ask the model, and wait for its answers; ``brief`` has elites, and all that was tried before."""

    def words(
        self, elites: Sequence[Evaluation], tried: Iterable[Evaluation]
    ) -> Mapping[str, str]:
        """Return what was said of elites, and of the last generation's candidates, by candidate."""


class Memory(Protocol):
    """Recalls other runs, and has a model write down what this one taught; a plugin makes it of a `ModelDesigner`."""

    def recall(
        self, task: Task, representation: ToolRepresentation
    ) -> tuple[Recalled, ...]:
        """Return what prompts for a task show of other runs; with a given tool no other tools."""

    def learn(self, result: Result, folder: Path) -> None:
        """Ask the model at the end of a run, if the settings want it, and keep what it says in the run's folder.

        Args:
            result: of a run that came to its end, with a best candidate.
            folder: of the run.

        Raises:
            UserError: the folder can't be written.
        """


class FirstTools(Protocol):
    """Tools that are there already: what a run tries before its model is asked (`core.search.kept_tools`)."""

    def design(self) -> Iterator[Candidate]:
        """Yield the candidates of generation 0."""


@dataclass(eq=False)
class ModelDesigner:
    """A `core.interfaces.Designer` that sends the requests of all agents at once.

    It composes a request for each agent, sends designs that break a rule back with the reasons, and yields candidates
    as replies arrive. What was paid for before is not asked for again (``stored``).

    For example::

        designer = ModelDesigner(assignment, vlm, PromptComposer(), Sampling(), event_hub())
        for candidate in designer.design(generation=0):
            print(candidate.id, candidate.problem or candidate.tool.name)

    Attributes:
        assignment: what is asked for.
        vlm: the model.
        prompts: composes the requests.
        sampling: the temperatures.
        events: receives requests and replies; register the designer there, so that it hears what was tried.
        pictures: those of the scene, without the gripper (False) and with it.
        artist: draws film strips of rollouts.
        critic: has candidates criticised before each generation; None: nothing is.
        mender: sends designs that break a rule back; None: nothing goes back.
        memory: recalls other runs, and has the model write down what this one taught; None: neither is asked for.
        first_tools: those of generation 0, for which the model is not asked; None: there are none.
        stored: replies that are not asked for again, by request id.
        tried: what requests may show of earlier generations; as a listener the designer collects it itself.

    Raises:
        UsageError: the model or the task is not one for the level ``prompt.context``.
    """

    assignment: Assignment
    vlm: VLM
    prompts: PromptComposer
    sampling: Sampling
    events: pluggy.PluginManager
    pictures: ScenePictures = field(default_factory=dict)
    artist: Artist = field(default_factory=Artist)
    critic: Critic | None = None
    mender: Mender | None = None
    memory: Memory | None = None
    first_tools: FirstTools | None = None
    stored: Mapping[str, Reply] = field(default_factory=dict)
    tried: list[Evaluation] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._replies: list[Reply] = []  # of the generation that is being asked for
        name = self.prompts.facts.settings.context
        level = self.prompts.facts.level
        task = self.assignment.task
        if level.in_words and not task.in_words:
            raise UsageError(
                f"{task.name} has no text without numbers for prompt.context={name}: give it `in_words`"
            )

        if not level.numbers and not self.vlm.sees:
            raise UsageError(
                f"{self.vlm.model} reads numbers, not pictures: prompt.context={name} needs a model that sees"
            )

    def design(
        self, generation: int, elites: Sequence[Evaluation] = ()
    ) -> Iterator[Candidate]:
        """Ask all agents for candidates, as one team; see `core.interfaces.Designer`.

        Args:
            generation: its number, from 0.
            elites: what each agent is shown, the best first.

        Raises:
            LimitReached: after the last candidate; see `VLM.complete`.
            UserError: no request got an answer, for a reason that may pass.
        """
        agents = range(self.assignment.budget.n_agent)
        yield from self.design_in(generation, [Team(agents, elites)])

    def design_in(self, generation: int, teams: Sequence[Team]) -> Iterator[Candidate]:
        """See `core.search.assignment.AsksTeams`, and `design`."""
        if generation == 0 and self.first_tools is not None:
            yield from self.first_tools.design()
            return

        for answer in self.ask(self.start(generation, teams)):
            yield from answer.candidates
        self.refuse_silence(generation)

    def start(self, generation: int, teams: Sequence[Team]) -> list[Request]:
        """Have elites criticised, and compose the requests of a generation's agents.

        Of several teams each is shown only what its own agents tried.
        """
        self._replies = []
        elites = [*chain.from_iterable(team.elites for team in teams)]
        if self.critic is not None:
            team = Team(range(1), elites)
            brief, _ = self.brief(generation, 0, team, tuple(self.tried))
            self.critic.criticise(brief)

        apart = len(teams) > 1
        requests: list[Request] = []
        for team in teams:
            requests += self.requests(generation, team, apart=apart)

        return requests

    def refuse_silence(self, generation: int) -> None:
        """Check that some request of the generation got an answer.

        Raises:
            NoAnswer: none did, for a reason that may pass.
        """
        unanswered = [reply for reply in self._replies if reply.unanswered]
        if unanswered and all(reply.error is not None for reply in self._replies):
            raise NoAnswer(
                f"the model answered no request of generation {generation}: {unanswered[0].error}; requests without "
                "an answer are sent again when the run goes on"
            )

    @hookimpl
    def generation_finished(self, generation: Generation) -> None:
        self.tried += generation.evaluations

    def requests(
        self, generation: int, team: Team, *, apart: bool = False
    ) -> list[Request]:
        """Compose the request of each agent of a team, with pictures of the scene and film strips.

        Args:
            generation: its number, from 0.
            team: whose agents are asked.
            apart: requests show only what the team's own agents tried.
        """
        tried = tuple(
            evaluation
            for evaluation in self.tried
            if not apart or evaluation.candidate.agent in team.agents
        )
        strips = self.artist.draw_strips(team.elites, tried)
        requests = []
        for agent in team.agents:
            brief, temperature = self.brief(generation, agent, team, tried)
            scene = self.pictures.get(brief.gripper, ())
            name = f"g{generation}-a{agent}"
            requests.append(
                self.request(name, brief, temperature, self.prompts, scene, strips)
            )

        return requests

    def request(
        self,
        name: str,
        brief: Brief,
        temperature: float,
        prompts: PromptComposer,
        pictures: Sequence[Picture] = (),
        strips: Mapping[str, Picture] | None = None,
    ) -> Request:
        """Compose the request of a brief.

        Args:
            name: its id.
            brief: the agent's assignment.
            temperature: of the model.
            prompts: composes the messages.
            pictures: of the scene.
            strips: film strips by candidates' ids.
        """
        return Request(
            name,
            brief,
            prompts.compose(brief, pictures, strips, schema=not self.vlm.takes_schema),
            answer_schema(brief),
            temperature,
            needs_pictures=not self.prompts.facts.level.numbers,
        )

    def follow_ups(self, request: Request, elite: Evaluation | None) -> list[Request]:
        """Compose the requests that follow an answer with ``elite`` to a request; here there are none."""
        return []

    def ask(self, requests: Sequence[Request]) -> Iterator[Answer]:
        """Send requests, and yield an answer to each; designs that break a rule go back `PromptSettings.repair` times.

        Raises:
            LimitReached: after all that came, see `VLM.complete`.
        """
        left = self.prompts.facts.settings.repair or 0
        again = {request.id: Answer(request, request) for request in requests}
        while again:
            missing = again
            again = {}
            asked = [answer.sent for answer in missing.values()]

            try:
                for reply in ask_model(self.vlm, asked, self.events, self.stored):
                    self._replies.append(reply)
                    before = missing.pop(reply.request_id)
                    answer = self._hear(before, reply, may_ask=left > 0)
                    if answer.sent is before.sent:
                        yield answer.with_curves()
                    else:
                        again[answer.sent.id] = answer
            except LimitReached:
                for answer in (*missing.values(), *again.values()):
                    if answer.candidates:
                        yield answer.with_curves()
                raise

            for answer in missing.values():
                yield answer.complete("no reply came")
            left -= 1

    def brief(
        self, generation: int, agent: int, team: Team, tried: tuple[Evaluation, ...]
    ) -> tuple[Brief, float]:
        """Make an agent's assignment, and draw its temperature.

        Both follow from the seed, the generation and the agent's number, so that a run can be repeated.

        Args:
            generation: its number, from 0.
            agent: its number, from 0.
            team: the agent's team.
            tried: what the prompt may show of earlier generations.

        Returns:
            The assignment, and the temperature, 0 to 2.
        """
        assignment = self.assignment
        given = assignment.given

        # The draws keep their order: kind, temperature, seed.
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
            recalled=self.recall(assignment.task, assignment.representation),
            style=team.style,
            curves=assignment.budget.curves,
        )

        return brief, float(np.clip(temperature, 0.0, 2.0))

    def recall(
        self, task: Task, representation: ToolRepresentation
    ) -> tuple[Recalled, ...]:
        """Return what prompts for a task show of other runs; see `Memory.recall`."""
        if self.memory is None:
            return ()
        return self.memory.recall(task, representation)

    def parse(self, brief: Brief, text: str) -> object:
        """Find the designs document in a reply.

        Args:
            brief: of the request; subclasses may read replies by it.
            text: the reply.

        Raises:
            DesignError: there is none, or it is malformed.
        """
        return parse_reply(text)

    def _hear(self, answer: Answer, reply: Reply, *, may_ask: bool) -> Answer:
        """Return an answer with what a reply adds; with a new request to be sent where it needs a second look.

        Args:
            answer: what was read before.
            reply: to the request that was sent last.
            may_ask: it may have a second look.
        """
        if reply.error is not None:
            lost = reply.unanswered and not answer.candidates
            problem = f"the model gave no answer: {reply.error}"
            return replace(answer.complete(problem), lost=lost)

        problem = ""

        try:
            document = self.parse(answer.request.brief, reply.text)
            answer = answer.read(document, self.mender)
        except DesignError as error:
            problem = str(error)

        if may_ask and self.mender is not None:
            again = self.mender.look_again(answer, reply, problem)
            if again is not None:
                return replace(answer, sent=again)

        if reply.cut_by:
            return answer.complete(
                f"the reply was cut off by {reply.cut_by}: {problem}"
            )

        return answer.complete(f"the reply can't be read: {problem}")
