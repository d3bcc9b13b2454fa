"""Define the kinds of parts: their hooks, their interfaces, and the check that a part is what its kind says."""

from __future__ import annotations

from typing import Any

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

KINDS = {
    "task": "tasks",
    "robot": "robots",
    "sim": "simulators",
    "vlm": "vlms",
    "tool": "tool_representations",
    "action": "action_representations",
    "evolution": "evolution_strategies",
    "fitness": "fitness_functions",
    "executor": "executors",
    "listener": "listeners",
    "command": "commands",
}
"""The config group of each kind of part, and the hook that offers it."""

INTERFACES: dict[str, type] = {
    "task": Task,
    "robot": Robot,
    "sim": Simulator,
    "vlm": VLM,
    "tool": ToolRepresentation,
    "action": ActionRepresentation,
    "evolution": EvolutionStrategy,
    "fitness": Fitness,
    "executor": Executor,
    "command": Command,
}
"""The interface of each kind; a listener has none, it implements some of `core.hooks.Events`."""

ATTRIBUTES = {"task": ("name", "description", "goals"), "vlm": ("model",)}
"""The attributes that parts of a kind have beside methods."""

PROVIDED = {"evolution": ("designer", "budget"), "fitness": ("evaluator",)}
"""The arguments of a kind's factories that the program provides; the others are settings."""

NOT_SETTINGS = {"task": ("tool_kinds", "paper"), "robot": ("base",), "evolution": ("refine", "near_duplicates")}
"""The keys of a kind's configuration that are not settings of the part: the program itself reads them."""

WORDS: dict[str, dict[str, Any]] = {
    "robot": {"base": [0.0, 0.0, 0.0, 0.0]},
    "evolution": {"refine": 0, "near_duplicates": False},
}
"""Those of them that every part of the kind has, with their defaults."""


def check_part(part: object, kind: str, offer: str) -> None:
    """Refuse a part that lacks something of its kind; ``offer`` names it in the message.

    Raises:
        UserError: the message says what is wrong or missing.
    """
    interface = INTERFACES.get(kind)
    if interface is None:
        _check_listener(part, offer)
        return
    if not isinstance(part, interface):
        raise UserError(f"{offer} makes a {type(part).__name__}, which is no core.interfaces.{interface.__name__}")
    missing = [name for name in ATTRIBUTES.get(kind, ()) if not hasattr(part, name)]
    if missing:
        raise UserError(f"{offer}: {type(part).__qualname__} has no {' and no '.join(missing)}")


def _check_listener(part: object, offer: str) -> None:
    hub = event_hub()
    try:
        hub.register(part)
    except pluggy.PluginValidationError as error:
        raise UserError(f"{offer}: {' '.join(str(error).split())}") from error
    known = [name for name in vars(Events) if not name.startswith("_")]
    received = {caller.name for caller in hub.get_hookcallers(part) or ()}
    if not received & set(known):
        raise UserError(f"{offer} receives no event: {type(part).__qualname__} implements none of {', '.join(known)}")
    hub.unregister(part)


def event_hub() -> pluggy.PluginManager:
    """Make a manager that carries `Events` to the listeners registered with it."""
    hub = pluggy.PluginManager(PROJECT)
    hub.add_hookspecs(Events)
    return hub
