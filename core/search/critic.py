"""Have a model look at rollouts and say what fails, and keep its words for the prompts that follow."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np

from core.designs.composer import PromptComposer
from core.designs.feedback import last_generation, most_telling
from core.interfaces import Brief, Picture, Reply, Request
from core.search.together import weakest
from core.support.text import clean
from core.trial import Evaluation

MAX_CRITIQUE = 2000  # characters
STRIP = "Film strip of the rollout: six instants at which something happens, in reading order"
_CRITIC = (
    1_000_000  # in place of an agent's number, keeps a request's random numbers apart
)


@dataclass(eq=False)
class Critic:
    """Composes requests for critiques, and keeps the answers. Each candidate is shown once.

    ``film`` draws a film strip of a rollout; None: nothing can draw, and the model gets text alone.
    """

    prompts: PromptComposer
    temperature: float
    film: Callable[[Evaluation], Picture | None] | None
    _asked: dict[str, int] = field(default_factory=dict)  # generations by candidate
    _words: dict[str, str] = field(default_factory=dict)  # by candidate

    def requests(self, brief: Brief) -> list[Request]:
        """Compose the requests before a generation: ``brief`` has its elites, and all that was tried before.

        At most `PromptSettings.critic` of them belong to a generation.
        """
        generation = brief.generation
        first = list(self._asked.values()).count(generation)
        telling = most_telling(brief.elites, last_generation(brief.tried))
        new = (e for e in telling if e.candidate.id not in self._asked)
        chosen = list(islice(new, max(0, self.prompts.settings.critic - first)))
        return [
            self._request(brief, number, shown)
            for number, shown in enumerate(chosen, first)
        ]

    def _request(self, brief: Brief, number: int, shown: Evaluation) -> Request:
        self._asked[shown.candidate.id] = brief.generation
        tool, (task, worst) = shown.candidate.tool, weakest(brief.task, shown)
        seed = int(
            np.random.default_rng([brief.seed, _CRITIC + number]).integers(2**31)
        )
        gripper = tool is not None and tool.gripper
        alone = replace(
            brief,
            task=task,
            agent=number,
            elites=(worst,),
            gripper=gripper,
            n_tool=1,
            n_action=1,
            seed=seed,
        )
        strip = self.film(shown) if self.film is not None else None
        messages = self.prompts.critique(
            alone, {STRIP: strip} if strip is not None else {}
        )
        return Request(
            f"g{brief.generation}-critic{number}",
            alone,
            messages,
            {},
            self.temperature,
            critique=True,
        )

    def hear(self, reply: Reply, request: Request) -> None:
        """Keep what a reply says; a failed one says nothing."""
        words = clean(
            reply.text[: 10 * MAX_CRITIQUE], MAX_CRITIQUE, lines=True
        ).replace("```", "'''")
        if reply.error is None and words:
            self._words[request.brief.elites[0].candidate.id] = words

    def words(
        self, elites: Sequence[Evaluation], tried: Iterable[Evaluation]
    ) -> dict[str, str]:
        """Return the critiques of elites, and of the last generation's candidates, by candidate."""
        names = dict.fromkeys(
            e.candidate.id for e in (*elites, *last_generation(tried))
        )
        return {name: self._words[name] for name in names if name in self._words}
