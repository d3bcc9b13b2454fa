"""Try candidates as a configuration says, outside of a search."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from omegaconf import DictConfig

from core.config.compose import check_seed, node, part, task_part
from core.design import Candidate
from core.interfaces import Fitness, RolloutSettings
from core.plugins import EXECUTOR, SIMULATOR
from core.search.builder import builder_for, check_starts
from core.search.trials import Trials
from core.trial import Evaluation


def build_fitness(cfg: DictConfig) -> Fitness:
    """Make the fitness that a configuration names.

    What each worker would report otherwise is reported here, once: a wrong setting of the engine, or an arm that can't
    start the task.

    Raises:
        UserError: a part or setting that can't be used.
    """
    check_seed(cfg.seed)
    part(SIMULATOR, cfg.sim).create()
    task = task_part(cfg)
    check_starts(task.create())
    # All that is tried is shown, with what was observed of it.
    settings = replace(node(cfg.rollout, RolloutSettings), observe=True)
    return builder_for(task).build_fitness(cfg, settings)


def try_all(
    cfg: DictConfig, candidates: Iterable[Candidate], fitness: Fitness
) -> list[Evaluation]:
    """Try candidates with the configured executor, judged by ``fitness``; in the order of `Candidate.key`."""
    with part(EXECUTOR, cfg.executor).create() as executor:
        evaluations = list(Trials(executor).evaluate(candidates, fitness))
    return sorted(evaluations, key=lambda evaluation: evaluation.candidate.key)
