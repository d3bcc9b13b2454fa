"""Make all parts of a search, as a configuration names them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import pluggy
from omegaconf import DictConfig, OmegaConf

from core.config.compose import part
from core.config.trust import refuse_keys
from core.events import Run
from core.interfaces import EvolutionStrategy, Executor, Fitness, Reply
from core.plugins import EVOLUTION, EXECUTOR, MODEL, SIMULATOR, event_hub, installed
from core.plugins.blame import Guard, add_listener, refuse_exit
from core.search.asking import build_designer
from core.search.designer import ModelDesigner
from core.search.refinement import Refinement
from core.search.variation import Variation
from core.store.progress import CachedVLM

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
    guards: list[Guard]


@refuse_exit()
def build_search(cfg: DictConfig, folder: Path, replies: Mapping[str, Reply]) -> Search:
    """Make the parts that ``cfg`` names; a model's ``replies`` are not asked for again.

    Raises:
        UserError: a part or setting that can't be used.
    """
    config = cast(
        dict[str, Any], OmegaConf.to_container(cfg, resolve=True, throw_on_missing=True)
    )
    refuse_keys(OmegaConf.create(config))
    events = event_hub()
    vlm = part(MODEL, cfg.vlm).create()
    simulator = part(SIMULATOR, cfg.sim).create()
    designer, fitness = build_designer(
        cfg, CachedVLM(vlm, replies) if replies else vlm, events
    )
    assignment = designer.assignment
    executor: Executor = part(EXECUTOR, cfg.executor).create()

    strategy: EvolutionStrategy = part(EVOLUTION, cfg.evolution).create(
        designer=designer, budget=assignment.budget
    )
    if strategy.learns:
        events.register(designer, "designer")
    refine = config["evolution"].get("refine", 0)
    if refine != 0:
        variation = Variation(
            assignment.task,
            assignment.representation,
            assignment.actions,
            assignment.seed,
        )
        strategy = Refinement(strategy, designer, variation, refine)

    listeners = {
        name: installed().create("listener", name, given or {})
        for name, given in config["listener"].items()
    }
    guards = [
        add_listener(events, listener, name)
        for name, listener in {**listeners, "vlm": vlm}.items()
    ]

    task = assignment.task
    parts = {kind: config[kind]["name"] for kind in _PARTS}
    parts |= {
        "robot": task.robot.name,
        "material": assignment.representation.material.name,
    }
    parts["task"] = task.name  # two scene files are two tasks
    run = Run(
        folder,
        config,
        parts,
        vlm.model,
        task,
        assignment.representation,
        assignment.budget,
        cfg.seed,
        simulator,
        designer.prompts.rollout,
    )
    return Search(run, designer, strategy, fitness, executor, events, guards)
