"""Try saved designs again, as a configuration says, outside of a search: for all commands that take designs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from omegaconf import DictConfig

from core.config.compose import check_seed, node, part, task_part, tool_part
from core.design import Candidate
from core.designs.reading import find_representations, read_designs
from core.errors import UsageError
from core.interfaces import Fitness, RolloutSettings, Task, ToolRepresentation
from core.plugins import EXECUTOR, SIMULATOR
from core.search.builder import builder_for, check_starts
from core.search.trials import Trials
from core.store.rows import StoredDesign, StoredEvaluation
from core.trial import Evaluation
from core.values.plans import NO_PLAN


def read_candidates(cfg: DictConfig, document: Any, **limits: Any) -> list[Candidate]:
    """Read the candidates of a designs document, for the task and by the representation that are configured.

    ``limits`` are those of `read_designs`.

    Raises:
        UsageError: all designs are written for another representation; names it.
    """
    representation = tool_part(cfg).create()
    others = find_representations(document, representation)
    if others:
        fits = " or ".join(f"tool={name}" for name in others)
        raise UsageError(
            f"the designs are not written for tool={cfg.tool.name}; say {fits}"
        )

    return read_designs(document, representation, task_part(cfg).create(), **limits)


def read_stored(
    design: StoredDesign,
    tried: Sequence[StoredEvaluation],
    representation: ToolRepresentation,
    task: Task,
) -> list[Candidate]:
    """Read the candidates of a stored design again, which share its tool, with the numbers that they had.

    Args:
        design: of all of them.
        tried: their evaluations.
        representation: reads the tool.
        task: they were tried in.

    Raises:
        DesignError: the design can't be read.
    """
    plans = [stored.plan for stored in tried]
    document = {"strategies": [design.written | {"action_sets": plans}]}
    base = Candidate(None, NO_PLAN, design.generation, design.agent)
    read = read_designs(document, representation, task, base=base)

    return [
        replace(
            candidate,
            design=design.design,
            action=stored.number,
            parents=design.parents,
        )
        for stored, candidate in zip(tried, read, strict=True)
    ]


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


@contextmanager
def open_trials(cfg: DictConfig) -> Iterator[Trials]:
    """Start the configured executor, and hand out what schedules trials on it."""
    with part(EXECUTOR, cfg.executor).create() as executor:
        yield Trials(executor)


def try_all(
    cfg: DictConfig, candidates: Iterable[Candidate], fitness: Fitness
) -> list[Evaluation]:
    """Try candidates with the configured executor, judged by ``fitness``; in the order of `Candidate.key`."""
    with open_trials(cfg) as trials:
        evaluations = list(trials.evaluate(candidates, fitness))

    return sorted(evaluations, key=lambda evaluation: evaluation.candidate.key)
