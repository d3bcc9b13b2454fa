"""Make all parts of a search, as a configuration names them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, cast

import pluggy
from omegaconf import DictConfig, OmegaConf
from pydantic import Field, NonNegativeInt

from core.config.compose import part
from core.config.trust import refuse_keys
from core.errors import UsageError
from core.events import Run
from core.interfaces import VLM, EvolutionStrategy, Executor, Fitness, Reply
from core.plugins import (
    EVOLUTION,
    EXECUTOR,
    LISTENER,
    MODEL,
    SIMULATOR,
    event_hub,
    installed,
)
from core.plugins.blame import add_listener
from core.search.builder import build_designer, check_numbers
from core.search.designer import ModelDesigner
from core.support.inputs import check
from core.trial import TIE

_Share: Any = Annotated[float, Field(ge=0, le=1)]
# Kinds of parts whose names a run's listeners receive.
_PARTS = ("task", "sim", "vlm", "tool", "action", "evolution", "fitness", "executor")


@dataclass(frozen=True, eq=False)
class Search:
    """All that takes part in a search."""

    run: Run
    designer: ModelDesigner
    strategy: EvolutionStrategy
    fitness: Fitness
    executor: Executor
    events: pluggy.PluginManager


def build_search(cfg: DictConfig, folder: Path, replies: Mapping[str, Reply]) -> Search:
    """Make the parts that ``cfg`` names; a model's ``replies`` are not asked for again.

    Raises:
        UserError: a part or setting that can't be used.
    """
    container = OmegaConf.to_container(cfg, resolve=True, throw_on_missing=True)
    config = cast(dict[str, Any], container)
    refuse_keys(OmegaConf.create(config))
    check_numbers(cfg)
    events = event_hub()
    vlm = part(MODEL, cfg.vlm).create()  # which may take seconds
    designer, fitness = build_designer(cfg, vlm, events)
    designer.stored = replies
    executor = part(EXECUTOR, cfg.executor).create()
    strategy = build_strategy(config["evolution"], designer)
    if strategy.learns:
        events.register(designer, "designer")
    _add_listeners(config["listener"], vlm, events)

    assignment = designer.assignment
    task = assignment.task
    parts = {kind: config[kind]["name"] for kind in _PARTS}
    parts["task"] = task.name  # two scene files are two tasks
    parts["robot"] = task.robot.name
    parts["material"] = assignment.representation.material.name
    run = Run(
        folder,
        config,
        parts,
        vlm.model,
        task,
        assignment.representation,
        assignment.budget,
        cfg.seed,
        part(SIMULATOR, cfg.sim).create(),
        designer.prompts.facts.rollout,
    )
    return Search(run, designer, strategy, fitness, executor, events)


def build_strategy(
    settings: Mapping[str, Any], designer: ModelDesigner
) -> EvolutionStrategy:
    """Make the strategy of a search, within the one that refines what it finds if ``refine`` says so, with its tie.

    Raises:
        UserError: it can't be used.
    """
    tie = check(_Share, settings.get("tie", TIE), "evolution.tie", UsageError)
    rollouts = check(
        NonNegativeInt, settings.get("refine", 0), "evolution.refine", UsageError
    )
    if rollouts:
        settings = {
            "name": _find_refiner(),
            "of": dict(settings),
            "rollouts": rollouts,
        }

    named = part(EVOLUTION, OmegaConf.create(dict(settings)))
    budget = designer.assignment.budget
    strategy = named.create(designer=designer, budget=budget)
    strategy.tie = tie
    return strategy


def _find_refiner() -> str:
    """Return the name of the strategy that refines what another one finds.

    Raises:
        UsageError: none is installed.
    """
    for name, factory in installed().factories("evolution").items():
        if getattr(factory, "refines", False):
            return name
    raise UsageError("evolution.refine: no strategy that refines another is installed")


def _add_listeners(
    chosen: Mapping[str, Mapping[str, Any] | None],
    vlm: VLM,
    events: pluggy.PluginManager,
) -> None:
    """Register the listeners, and the model, which may be one too.

    Raises:
        UserError: a listener can't be used.
    """
    listeners = {
        name: installed().create(LISTENER, name, settings or {})
        for name, settings in chosen.items()
    }
    listeners["vlm"] = vlm
    for name, listener in listeners.items():
        add_listener(events, listener, name)
