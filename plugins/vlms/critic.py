"""Have a model look at rollouts and say what fails, and keep its words for the prompts that follow."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from core.designs.composer import with_captions
from core.designs.prompt_values import prompt_values
from core.interfaces import Brief, Message, Picture, Reply, Request
from core.search.designer import ModelDesigner
from core.search.model_requests import ask_model
from core.support.text import clean
from core.trial import Evaluation
from plugins.vlms.artist import shown_in
from plugins.vlms.telling import last_generation, most_telling

CRITIC = "critic"  # the template
MAX_CRITIQUE = 2000  # characters
STRIP = "Film strip of the rollout: six instants at which something happens, in reading order:"
# In place of an agent's number: keeps requests' random numbers apart.
_CRITIC = 1_000_000


@dataclass(eq=False)
class ModelCritic:
    """Composes requests for critiques, and keeps the answers: a `core.search.designer.Critic`.

    Each candidate is shown once, with a film strip of its rollout where the ``designer`` can draw one.
    """

    designer: ModelDesigner
    _shown: dict[str, int] = field(default_factory=dict)  # generations, by candidate
    _words: dict[str, str] = field(default_factory=dict)  # by candidate

    def __post_init__(self) -> None:
        self.designer.prompts.templates.load(CRITIC)

    def criticise(self, brief: Brief) -> None:
        """Ask for critiques, and wait for them: the generation's other requests show them."""
        requests = {request.id: request for request in self.requests(brief)}
        if not requests:
            return

        designer = self.designer
        asked = [*requests.values()]
        for reply in ask_model(designer.vlm, asked, designer.events, designer.stored):
            self.hear(reply, requests[reply.request_id])

    def requests(self, brief: Brief) -> list[Request]:
        """Compose the requests before a generation, at most `PromptSettings.critic` of them.

        ``brief`` has its elites, and all that was tried before. A strategy may ask more than once for a generation.
        """
        first = list(self._shown.values()).count(brief.generation)
        telling = most_telling(brief.elites, last_generation(brief.tried))
        new = [e for e in telling if e.candidate.id not in self._shown]
        most = range(first, self.designer.prompts.facts.settings.critic)

        return [self._request(brief, *pair) for pair in zip(most, new, strict=False)]

    def _request(
        self,
        brief: Brief,
        number: int,
        shown: Evaluation,
    ) -> Request:
        self._shown[shown.candidate.id] = brief.generation
        tool = shown.candidate.tool
        task, elite = shown_in(brief.task, shown)
        rng = np.random.default_rng([brief.seed, _CRITIC + number])
        alone = replace(
            brief,
            task=task,
            agent=number,
            elites=(elite,),
            recalled=(),
            gripper=tool is not None and tool.gripper,
            n_tool=1,
            n_action=1,
            seed=int(rng.integers(2**31)),
        )

        strip = self.designer.artist.draw_strip(shown)
        pictures = [replace(strip, caption=STRIP)] if strip is not None else []
        messages = self._compose(alone, pictures)
        temperature = self.designer.sampling.temperature
        name = f"g{brief.generation}-critic{number}"

        return Request(name, alone, messages, {}, temperature, "critiques")

    def _compose(
        self, brief: Brief, pictures: Sequence[Picture]
    ) -> tuple[Message, ...]:
        """Compose a request for a critique of the brief's one elite.

        Raises:
            UserError: a template uses an unknown name or fails otherwise.
            ValueError: the elite has no tool.
        """
        prompts = self.designer.prompts
        values = prompt_values(replace(prompts.facts, criticised=True), brief)
        values["pictured"] = list(pictures)
        text = prompts.templates.fill(CRITIC, values)
        user = (text, *with_captions(pictures))

        return (*prompts.system(values), Message("user", user))

    def hear(self, reply: Reply, request: Request) -> None:
        """Keep what a reply says; a failed one says nothing.

        Args:
            reply: to a request for a critique.
            request: of `requests`.
        """
        text = clean(reply.text[: 10 * MAX_CRITIQUE], MAX_CRITIQUE, lines=True)
        words = text.replace("```", "'''")

        if reply.error is None and words:
            self._words[request.brief.elites[0].candidate.id] = words

    def words(
        self, elites: Sequence[Evaluation], tried: Iterable[Evaluation]
    ) -> dict[str, str]:
        """Return the critiques of elites, and of the last generation's candidates, by candidate.

        Args:
            elites: that a prompt will show.
            tried: all that was tried so far.
        """
        shown = (*elites, *last_generation(tried))
        names = dict.fromkeys(evaluation.candidate.id for evaluation in shown)

        return {name: self._words[name] for name in names if name in self._words}
