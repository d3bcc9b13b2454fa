"""What may be set of the core's own parts, as plain values: a configuration knows them without the parts themselves."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from core.errors import UsageError

SYSTEM = ("system",)
_RULES = (
    "tool_rules",
    "action_rules",
    "action_diversity",
    "workspace",
    "spawn_rules",
    "frames",
    "units",
    "output",
    "context",
)
INITIAL = ("mission_initial", "procedure", *_RULES)
EVOLUTION = ("mission_evolve", "elites", "procedure", "evolution_rules", *_RULES)
GIVEN = (
    "mission_given",
    "elites",
    "procedure",
    *(rule for rule in _RULES if rule not in ("tool_rules", "spawn_rules")),
)
FEEDBACK = ("paper", "numbers", "full")


@dataclass
class PromptSettings:
    """What a model is told.

    Attributes:
        dir: a folder of templates to use instead of the project's own.
        file: a text file with a person's idea of the tool and its motion, for templates that pass one on.
        feedback: what is told of elites: what the ``paper`` tells, ``numbers`` on the rollout and its plan besides, or
            a picture too (``full``).
        repair: ask once more, with the reason, where a reply can't be read.
        system: the parts of the system message; none: no system message.
        initial: the parts of a first sampling; none: there is none, elites must come from elsewhere.
        evolution: the parts of a request that shows elites.
        given: the parts of a request for action plans only, for a tool that is there already.
    """

    dir: str | None = None
    file: str | None = None
    feedback: str = "paper"
    repair: bool = False
    system: list[str] = field(default_factory=lambda: list(SYSTEM))
    initial: list[str] = field(default_factory=lambda: list(INITIAL))
    evolution: list[str] = field(default_factory=lambda: list(EVOLUTION))
    given: list[str] = field(default_factory=lambda: list(GIVEN))


@dataclass
class Sampling:
    """How the model is sampled: an agent's temperature is drawn within ``spread`` of ``temperature``, clipped to [0,
    2].
    """

    temperature: float = 1.0
    spread: float = 0.5


@dataclass(unsafe_hash=True)
class PerturbationRange:
    """How far a scene may be changed, at most; each change is drawn uniformly between plus and minus this.

    ``position``: metres, along x and along y. ``yaw``: radians, about the vertical. ``mass`` and ``friction``: shares
    of what they are. By default 5 mm and 3 degrees, as things are placed by hand or found by a camera; a tenth of the
    mass; and a fifth of the friction, which is known worst.

    Raises:
        UsageError: a number that is negative or not finite, or a share of 1 or more.
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
