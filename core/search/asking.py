"""Make what asks a model for candidates, and the fitness that judges them, as a configuration names them."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, cast

import pluggy
from omegaconf import DictConfig, OmegaConf

from core.config.compose import check_seed, node, part, task_part, tool_part
from core.config.schemas import PromptSettings, Sampling
from core.designs.composer import PromptComposer
from core.errors import UsageError
from core.interfaces import VLM, Budget, EvolutionStrategy, Fitness, RolloutSettings
from core.plugins import ACTION, SIMULATOR, installed
from core.robot.kinematics import arm_of
from core.search.assemble import make_designer
from core.search.assignment import DEFAULT_KINDS, Assignment
from core.search.designer import ModelDesigner
from core.search.together import make_fitness
from core.trial import TIE


def build_designer(
    cfg: DictConfig, vlm: VLM, events: pluggy.PluginManager
) -> tuple[ModelDesigner, Fitness]:
    """Make what asks ``vlm`` for candidates in a run with this configuration, and what judges them.

    Raises:
        UserError: a part or setting that can't be used.
    """
    check_seed(cfg.seed)
    budget = _read_budget(cfg)
    task = task_part(cfg).create()
    representation = tool_part(cfg).create()
    for each in task.parts:
        arm_of(task.robot).home_for(
            each.home
        )  # an arm that can't start is reported once, before it is drawn
    if representation.given(task) is not None:
        budget = replace(budget, n_tool=1)

    settings = node(cfg.rollout, RolloutSettings)
    if cfg.prompt.feedback != "paper" or cfg.prompt.critic or _strategy_observes(cfg):
        settings = replace(settings, observe=True)
    fitness = make_fitness(cfg, settings)

    prompt = node(cfg.prompt, PromptSettings)
    tie = cfg.evolution.get("tie", TIE)
    instructions = {"": fitness.instructions()}
    if len(task.parts) > 1:
        instructions |= {
            each.name: fitness.instructions_in(each.name) for each in task.parts
        }
    prompts = {
        name: PromptComposer(prompt, settings, cfg.sim.name, tie=tie, judged=text)
        for name, text in instructions.items()
    }
    kinds = cfg.task.get("tool_kinds") or task.tool_kinds or DEFAULT_KINDS
    designer = make_designer(
        Assignment(
            task,
            representation,
            part(ACTION, cfg.action).create(),
            budget,
            cfg.seed,
            kinds,
        ),
        part(SIMULATOR, cfg.sim).create,
        vlm,
        prompts.pop(""),
        node(cfg.sampling, Sampling),
        events,
        prompts,
    )
    return designer, fitness


def _read_budget(cfg: DictConfig) -> Budget:
    budget = Budget(**{field.name: cfg.budget[field.name] for field in fields(Budget)})
    for name, least in (
        ("n_agent", 1),
        ("n_tool", 1),
        ("n_action", 1),
        ("k_top", 1),
        ("n_iteration", 0),
    ):
        if getattr(budget, name) < least:
            raise UsageError(
                f"budget.{name} must be at least {least}, got {getattr(budget, name)}"
            )
    return budget


def _strategy_observes(cfg: DictConfig) -> bool:
    """Report whether the strategy needs observations, which is settled before it is made."""
    strategy = installed().factory("evolution", cfg.evolution.name)
    settings = cast(dict[str, Any], OmegaConf.to_container(cfg.evolution))
    return bool(getattr(strategy, "observes", EvolutionStrategy.observes)(settings))
