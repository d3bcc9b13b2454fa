"""Settings of the core itself, as plain values that a schema can use without importing the code that reads them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from core.errors import UsageError

SYSTEM = ("system",)
_PLANS = ("action_rules", "action_diversity", "workspace")
_REPLY = ("frames", "units", "output", "context")
_RULES = ("tool_rules", *_PLANS, "spawn_rules", *_REPLY)
LAST = "last_generation"  # the part that is left out with the feedback "paper"
CRITIQUES = "critiques"  # the part that is left out without a critic
INITIAL = ("mission_initial", LAST, CRITIQUES, "procedure", *_RULES)
EVOLUTION = ("mission_evolve", "elites", LAST, CRITIQUES, "procedure", "evolution_rules", *_RULES)
GIVEN = ("mission_given", "elites", LAST, CRITIQUES, "procedure", *_PLANS, *_REPLY)
FEEDBACK = ("paper", "numbers", "full")
TOLD = ("source", "words", "pictures", "photos")
UNSEEN = ("pictures", "photos")  # no place, size or mass of a body


@dataclass
class PromptSettings:
    """The templates of the prompts, and what they show.

    Attributes:
        dir: a folder of templates that replace the project's own.
        file: a text file with a person's idea of the tool and its motion, for templates that quote it.
        told: what is said of the scene: the task's source with all numbers (``source``), a description and a table of
            places and sizes (``words``), or the description with calibrated pictures (``pictures``) or photographs
            (``photos``) and no number of any body.
        picture: show a picture of the scene, from the task's camera.
        feedback: what is shown of elites: tool and reward (``paper``), also the plan and what was observed of its
            rollout, and a line for each candidate of the last generation (``numbers``), or also a picture (``full``).
        generation_characters: the length of the lines of the last generation's candidates, beyond which some are left
            out.
        repair: ask once more, with the reason, if a reply can't be read.
        critic: how many candidates of a generation the model is shown again, with pictures, one in each request; what
            fails in them by its words stands in the next generation's prompts.
        system: the templates of the system message; empty: no system message.
        initial: the templates of a first sampling; empty: no first sampling, elites come from elsewhere.
        evolution: the templates of a request that shows elites.
        given: the templates of a request for action plans only, for a given tool.
    """

    dir: str | None = None
    file: str | None = None
    told: str = "source"
    picture: bool = True
    feedback: str = "paper"
    generation_characters: int = 12_000
    repair: bool = False
    critic: int = 0
    system: list[str] = field(default_factory=lambda: list(SYSTEM))
    initial: list[str] = field(default_factory=lambda: list(INITIAL))
    evolution: list[str] = field(default_factory=lambda: list(EVOLUTION))
    given: list[str] = field(default_factory=lambda: list(GIVEN))


@dataclass
class Sampling:
    """The model's temperature: each agent draws its own within ``spread`` of ``temperature``, clipped to [0, 2]."""

    temperature: float = 1.0
    spread: float = 0.5


@dataclass(unsafe_hash=True)
class PerturbationRange:
    """The greatest perturbations of a scene; each is drawn uniformly between minus and plus this number.

    ``position``: metres, along x and along y. ``yaw``: radians, about the vertical. ``mass`` and ``friction``:
    fractions of the nominal value. The defaults are 5 mm and 3 degrees, as bodies are placed by hand or located by a
    camera; a tenth of the mass; and a fifth of the friction, which is known least.

    Raises:
        UsageError: a number is negative or not finite, or a fraction is 1 or more.
    """

    position: float = 0.005
    yaw: float = 0.05
    mass: float = 0.1
    friction: float = 0.2

    def __post_init__(self) -> None:
        for name, most in (("position", math.inf), ("yaw", math.inf), ("mass", 1.0), ("friction", 1.0)):
            value = getattr(self, name)
            if not 0 <= value < most:
                less = f" and less than {most:g}" if most < math.inf else ", and finite"
                raise UsageError(f"perturbation.{name} must be 0 or greater{less}, got {value}")
