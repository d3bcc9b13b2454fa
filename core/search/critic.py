"""Have a model look at rollouts and say what fails, and keep its words for the prompts that follow."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np

from core.design import Evaluation
from core.designs.composer import PromptComposer
from core.designs.feedback import last_generation, most_telling
from core.errors import RAISED
from core.interfaces import VLM, Brief, Picture, Reply, Request, Simulator, Task
from core.simulation.pictures import draw_tool, png, report_missing
from core.support.cli import say
from core.support.text import clean

MAX_CRITIQUE = 2000  # characters
_CRITIC = 1_000_000  # in place of an agent's number, keeps a request's random numbers apart


@dataclass(eq=False)
class Critic:
    """Composes requests for critiques, and keeps the answers. Each candidate is shown once.

    ``draw`` makes pictures of a candidate, by their captions.
    """

    prompts: PromptComposer
    temperature: float
    draw: Callable[[Evaluation], Mapping[str, Picture]]
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
        return [self._request(brief, number, shown) for number, shown in enumerate(chosen, first)]

    def _request(self, brief: Brief, number: int, shown: Evaluation) -> Request:
        self._asked[shown.candidate.id] = brief.generation
        tool = shown.candidate.tool
        seed = int(np.random.default_rng([brief.seed, _CRITIC + number]).integers(2**31))
        gripper = tool is not None and tool.gripper
        alone = replace(brief, agent=number, elites=(shown,), gripper=gripper, n_tool=1, n_action=1, seed=seed)
        messages = self.prompts.critique(alone, self.draw(shown))
        return Request(f"g{brief.generation}-critic{number}", alone, messages, {}, self.temperature, critique=True)

    def hear(self, reply: Reply, request: Request) -> None:
        """Keep what a reply says; a failed one says nothing."""
        words = clean(reply.text[: 10 * MAX_CRITIQUE], MAX_CRITIQUE, lines=True).replace("```", "'''")
        if reply.error is None and words:
            self._words[request.brief.elites[0].candidate.id] = words

    def words(self, elites: Sequence[Evaluation], tried: Iterable[Evaluation]) -> dict[str, str]:
        """Return the critiques of elites, and of the last generation's candidates, by candidate."""
        names = dict.fromkeys(e.candidate.id for e in (*elites, *last_generation(tried)))
        return {name: self._words[name] for name in names if name in self._words}


def make_critic(
    vlm: VLM,
    prompts: PromptComposer,
    temperature: float,
    task: Task,
    simulator: Callable[[], Simulator],
    seed: int,
    film: Callable[[Evaluation], Picture | None] | None,
) -> Critic | None:
    """Make the critic that the prompts' settings ask for; None: they ask for none, or the model can't be one.

    ``film`` draws a film strip of a rollout; None: nothing can draw, and the model gets text alone.
    """
    count = prompts.settings.critic
    if count and not vlm.criticises:
        say(f"prompt.critic={count}: {vlm.model} writes no critiques; there are none", file=sys.stderr)
    if not (count and vlm.criticises):
        return None

    def draw(evaluation: Evaluation) -> dict[str, Picture]:
        candidate, drawn = evaluation.candidate, dict[str, Picture]()
        if film is not None and candidate.tool is not None and candidate.tool.components:
            try:
                views = draw_tool(task, simulator(), seed, candidate.tool)
            except OSError:  # the machine fails, see `make_designer`
                raise
            except RAISED as error:
                report_missing(f"views of the tool of {candidate.id}", error)
            else:
                drawn["The tool on the arm at home"] = Picture(png(views), f"tool_{candidate.id}")
        if film is not None and (strip := film(evaluation)) is not None:
            drawn["Film strip of the rollout: six instants at which something happens, in reading order"] = strip
        return drawn

    return Critic(prompts, temperature, draw)
