"""Define the kinds of parts: their hooks, their interfaces, and the check that a part is what its kind says."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import pluggy

from core.errors import UserError
from core.hooks import PROJECT, Command, Events
from core.interfaces import (
    VLM,
    ActionRepresentation,
    EvolutionStrategy,
    Executor,
    Fitness,
    Robot,
    Simulator,
    Task,
    ToolRepresentation,
)
from core.trial import TIE

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Kind(Generic[T]):
    """A kind of part.

    Attributes:
        defaults: the keys of its configuration that are no settings of the part, since the program itself reads them.
    """

    name: str  # its config group, as in ``sim=NAME``
    hook: str  # the hook that offers its parts, of `core.hooks.Parts`
    # The class of its parts; None: a part implements some of `core.hooks.Events`.
    interface: type[T] | None
    # The arguments of its factories that the program provides; the others are settings.
    provided: tuple[str, ...] = ()
    defaults: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.name

    def check(self, part: object, offer: str) -> None:
        """Refuse a part that lacks something of its kind; ``offer`` names it in the message.

        Raises:
            UserError: the message says what is wrong or missing.
        """
        if self.interface is None:
            _check_listener(part, offer)
            return

        if not isinstance(part, self.interface):
            expected = f"{self.interface.__module__}.{self.interface.__name__}"
            raise UserError(
                f"{offer} makes a {type(part).__name__}, which is no {expected}"
            )

        declared = inspect.get_annotations(self.interface)
        missing = [name for name in declared if not hasattr(part, name)]
        if missing:
            raise UserError(
                f"{offer}: {type(part).__qualname__} has no {' and no '.join(missing)}"
            )


PAPER_BUDGET = {
    "n_agent": 20,
    "n_tool": 10,
    "n_action": 10,
    "k_top": 5,
    "reward_save": 0.6,
    "n_iteration": 3,
}
"""What ``budget=paper`` spends on most tasks of the paper (arXiv 2507.12644)."""

TASK = Kind(
    "task",
    "tasks",
    Task,
    defaults={"tool_kinds": ["rigid"], "paper": PAPER_BUDGET},
)
ROBOT = Kind("robot", "robots", Robot, defaults={"base": [0.0, 0.0, 0.0, 0.0]})
SIMULATOR = Kind("sim", "simulators", Simulator)
MODEL = Kind("vlm", "vlms", VLM)
TOOL = Kind("tool", "tool_representations", ToolRepresentation)
ACTION = Kind("action", "action_representations", ActionRepresentation)
EVOLUTION = Kind(
    "evolution",
    "evolution_strategies",
    EvolutionStrategy,
    provided=("designer", "budget"),
    defaults={"refine": 0, "tie": TIE},
)
FITNESS = Kind(
    "fitness",
    "fitness_functions",
    Fitness,
    provided=("condition",),
    defaults={"tie_by": "room"},
)
EXECUTOR = Kind("executor", "executors", Executor)
LISTENER: Kind[object] = Kind("listener", "listeners", None)
COMMAND = Kind("command", "commands", Command)

KINDS: dict[str, Kind[Any]] = {
    kind.name: kind
    for kind in (
        TASK,
        ROBOT,
        SIMULATOR,
        MODEL,
        TOOL,
        ACTION,
        EVOLUTION,
        FITNESS,
        EXECUTOR,
        LISTENER,
        COMMAND,
    )
}
"""All kinds by their config group."""

HOOKS = {
    **{kind.hook: kind.name for kind in KINDS.values()},
    "levels": "level",
    "prompt_values": "prompt_value",
    "readers": "reader",
    "tool_rules": "tool_rule",
    "figures": "figure",
    "artists": "artist",
    "critics": "critic",
    "memories": "memory",
    "menders": "mender",
    "exports": "export",
    "goals": "goal",
    "makers": "maker",
    "importers": "importer",
}
"""What each hook of `core.hooks` offers."""


def _check_listener(part: object, offer: str) -> None:
    hub = event_hub()
    try:
        hub.register(part)
        hub.check_pending()
    except pluggy.PluginValidationError as error:
        raise UserError(f"{offer}: {' '.join(str(error).split())}") from error
    if not hub.get_hookcallers(part):
        raise UserError(
            f"{offer} receives no event: {type(part).__qualname__} implements nothing of core.hooks.Events"
        )


def event_hub() -> pluggy.PluginManager:
    """Make a manager that carries `Events` to the listeners registered with it."""
    hub = pluggy.PluginManager(PROJECT)
    hub.add_hookspecs(Events)
    return hub
