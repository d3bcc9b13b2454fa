"""Define the configurations as typed schemas, one for each command, and the settings that core itself reads."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import yaml
from omegaconf import MISSING

from core.design import Budget
from core.errors import UsageError
from core.interfaces import RolloutSettings
from core.values.harmless import Harmless, Names
from core.values.materials import Material
from core.values.printers import Printer

# Not as a resource of `prompts`: a folder of the user's may hide that, which is said later.
_PROMPTS = Path(__file__).parents[2] / "prompts"
PARTS: dict[str, list[str]] = yaml.safe_load(
    (_PROMPTS / "parts.yaml").read_text("utf-8")
)
"""The templates of the project's own prompts, by the kind of request."""
PartConfig = dict[str, Any]
"""The name of a part, and its settings."""

FEEDBACK = ("paper", "numbers", "full")
PHOTOGRAPHS = ("beside", "alone", "none")
WRITE = "write"
"""Among the folders of `PromptSettings.lessons`: this run's are written."""


@dataclass
class PromptSettings:
    """The templates of the prompts, and what they show.

    Attributes:
        dir: a folder of templates that replace the project's own.
        file: a text file with a person's idea of the tool and its motion, for templates that quote it.
        context: what is said of the scene: a level that a plugin offers (`core.hooks.Configs`), as ``source``.
        picture: show a picture of the scene, from the task's camera.
        photographs: those of a scene file stand ``beside`` the drawn pictures of the scene, or ``alone``, or nowhere
            (``none``).
        feedback: what is shown of elites: tool and reward (``paper``), also the plan and what was observed of its
            rollout, and a line for each candidate of the last generation (``numbers``), or also a picture (``full``).
        generation_characters: the length of the lines of the last generation's candidates, beyond which some are left
            out.
        repair: how often designs that break a rule, or a reply that can't be read, go back with the reasons; None: once
            to a language model, and never with ``budget=paper``.
        critic: how many candidates of a generation the model is shown again, with pictures, one in each request; what
            fails in them by its words stands in the next generation's prompts.
        lessons: folders with a ``lessons.json``, of runs or written by hand; what fits the task stands in the prompts.
            The word ``write`` alone or among them: the model writes this run's at its end.
        examples: folders of finished runs; the winners of at most two tasks that are alike stand in the prompts.
        system: the templates of the system message; empty: no system message.
        initial: the templates of a first sampling; empty: no first sampling, elites come from elsewhere.
        evolution: the templates of a request that shows elites.
        given: the templates of a request for action plans only, for a given tool.
        tools: the templates of a request for tools only; plans are asked for later.
    """

    name: Harmless[str] = MISSING
    dir: Annotated[str | None, Names("folder")] = None
    file: Annotated[str | None, Names("file")] = None
    context: Harmless[str] = "source"
    picture: bool = True
    photographs: Harmless[str] = "beside"
    feedback: Harmless[str] = "numbers"
    generation_characters: int = 1_200
    repair: int | None = None
    critic: int = 0
    lessons: Annotated[Any, Names("folder")] = field(
        default_factory=list
    )  # a word, or a list of them
    examples: Annotated[list[str], Names("folder")] = field(default_factory=list)
    system: Harmless[list[str]] = field(default_factory=PARTS["system"].copy)
    initial: Harmless[list[str]] = field(default_factory=PARTS["initial"].copy)
    evolution: Harmless[list[str]] = field(default_factory=PARTS["evolution"].copy)
    given: Harmless[list[str]] = field(default_factory=PARTS["given"].copy)
    tools: Harmless[list[str]] = field(default_factory=PARTS["tools"].copy)

    @property
    def lesson_folders(self) -> list[str]:
        """The folders whose lessons are read."""
        return [word for word in self._lesson_words if word != WRITE]

    @property
    def writes_lessons(self) -> bool:
        """Whether the model is asked for lessons at the end of the run."""
        return WRITE in self._lesson_words

    @property
    def _lesson_words(self) -> list[str]:
        return [self.lessons] if isinstance(self.lessons, str) else self.lessons

    def check_lessons(self) -> None:
        """Check that ``lessons`` is a word, or a list of words.

        Raises:
            UsageError: it is something else.
        """
        words = self._lesson_words
        if isinstance(words, list) and all(isinstance(word, str) for word in words):
            return
        raise UsageError(
            f"prompt.lessons={self.lessons}: give {WRITE}, or folders as in prompt.lessons=[runs/A,runs/B]"
        )


@dataclass
class Sampling:
    """The model's temperature: each agent draws its own within ``spread`` of ``temperature``, clipped to [0, 2]."""

    temperature: float = 1.0
    spread: float = 0.5


@dataclass
class SceneConfig:
    """The task, the robot, the engine, the tools' material and printer, the layout's seed.

    A part's settings are checked by its factory's signature.
    """

    task: PartConfig = MISSING
    robot: PartConfig = MISSING
    sim: PartConfig = MISSING
    material: Material = field(default_factory=Material)
    printer: Printer = field(default_factory=Printer)
    seed: int = 0


@dataclass
class TrialConfig(SceneConfig):
    """How candidates are read, tried and judged.

    ``protocol``: what all entries of a benchmark have in common; reports read it.
    """

    tool: PartConfig = MISSING
    action: PartConfig = MISSING
    fitness: PartConfig = MISSING
    executor: PartConfig = MISSING
    rollout: RolloutSettings = field(default_factory=RolloutSettings)
    protocol: Harmless[PartConfig] = MISSING


@dataclass
class SearchConfig(TrialConfig):
    """How candidates are asked for."""

    vlm: PartConfig = MISSING
    evolution: PartConfig = MISSING
    prompt: PromptSettings = field(default_factory=PromptSettings)
    budget: Budget = MISSING
    sampling: Sampling = field(default_factory=Sampling)


@dataclass
class RunConfig(SearchConfig):
    """Settings of ``python -m core.run``.

    ``name``: what reports call the method; empty: what distinguishes it. ``second``: engines; the first that can tries
    the winner once more. ``patience_s``: how long the run waits for a machine or a server that fails, see
    `core.search.patience`.
    """

    name: Harmless[str] = ""
    listener: PartConfig = field(default_factory=dict)
    film: bool = True
    second: Harmless[list[str]] = field(default_factory=list)
    patience_s: float = 0.0


@dataclass
class EvaluateConfig(TrialConfig):
    """Settings of ``vlmgineer evaluate``. ``output``: a JSON file to write as well; ``check``: play nothing.

    ``film``: write a film of the best design, too.
    """

    designs: str = MISSING
    output: str | None = None
    check: bool = False
    film: bool = False
