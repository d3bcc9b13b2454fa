"""Compute the figures of a run, as in ``result.json``."""

from __future__ import annotations

import importlib.metadata
import math
import statistics
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache

from packaging.requirements import Requirement

from core.events import Generation, Result, Run
from core.simulation.measuring import figures
from core.store.rows import (
    Best,
    FailedLayout,
    GenerationFigures,
    HeldFigures,
    RunFigures,
    SecondEngineFigures,
    Unseen,
)
from core.trial import mean_figure
from core.values.efforts import Held

_PARTS = ("task", "robot", "sim", "vlm", "tool", "action", "evolution", "fitness")


def report(run: Run, result: Result) -> RunFigures:
    """Return the content of ``result.json``."""
    return RunFigures(
        name=run.config.get("name", ""),
        **{kind: run.parts[kind] for kind in _PARTS},
        material=run.representation.material.name,
        budget=run.config["budget"]["name"],
        seed=run.seed,
        best=best_figures(result),
        unseen=unseen_figures(run, result),
        effort=result.effort,
        finalists=dict(result.finals),
        held=held_figures(result.held),
        perturbed=held_figures(result.perturbed.count_held()),
        tie=result.tie,
        stopped=result.stopped,
        generations=tuple(map(summary, result.generations)),
        n_evaluations=result.n_evaluations,
        rollouts=result.rollouts,
        wall_time_s=round(result.wall_time_s, 3),
        rollouts_per_s=round(result.rollouts / result.wall_time_s, 3),
        versions=versions(),
    )


def best_figures(result: Result) -> Best | None:
    """Return the figures of the best candidate; None: no candidate could be tried."""
    best = result.best
    if best is None:
        return None

    means = {name: mean_figure(best.trials, name) for name in figures()}
    return Best(
        reward=best.reward,
        solved=best.solved,
        generation=best.candidate.generation,
        candidate=best.candidate.id,
        margin=best.least_margin,
        reason=best.why_nothing,
        torque=best.hardest,
        second_engine=second_engine_figures(result),
        measured={name: value for name, value in means.items() if math.isfinite(value)},
        making=result.making,
        makeable=result.makeable.candidate.id if result.makeable else None,
    )


def second_engine_figures(result: Result) -> SecondEngineFigures | None:
    """Return what the best candidate earned in a second engine; None: it was not tried, or not to the end."""
    trial = result.second_engine
    best = result.best
    if best is None or trial is None or trial.status != "ok":
        return None

    alike = [tried.reward for tried in best.trials if tried.layout == trial.layout]
    here = alike[0] if alike else best.reward
    return SecondEngineFigures(trial.engine, trial.reward, here, trial.solved)


def held_figures(held: Held) -> HeldFigures | None:
    """Return in how many layouts the best candidate held; None: it was tried in none."""
    if not held.layouts:
        return None
    return HeldFigures(held.held, held.layouts, round(held.fails_below, 4))


def unseen_figures(run: Run, result: Result) -> Unseen | None:
    """Return what the best candidate earned in unseen layouts; None: it was tried in none."""
    if not result.unseen:
        return None
    rewards = min(result.unseen.values(), key=statistics.fmean)
    return Unseen(
        layouts=len(rewards),
        mean=statistics.fmean(rewards),
        worst=min(rewards),
        rewards=rewards,
        engines=result.unseen,
        failed=tuple(failed_layouts(run, result)),
    )


def failed_layouts(run: Run, result: Result) -> Iterator[FailedLayout]:
    """Yield the unseen trials in which the best candidate failed, the worst first."""
    tasks = {task.name: task for task in run.task.parts}

    for trial in sorted(result.unseen_trials, key=lambda trial: trial.reward):
        if trial.solved:
            continue

        draw = tasks[trial.task].draw(trial.layout)
        numbers = {name: round(draw(name, math.nan), 4) for name in draw.ranges}
        where = trial.task, trial.engine, trial.layout
        failed = FailedLayout(*where, trial.reward, trial.cause, numbers)
        if (run.folder / failed.film_file).exists():
            failed = replace(failed, film=failed.film_file)
        yield failed


def summary(generation: Generation) -> GenerationFigures:
    """Return a generation's figures."""
    return GenerationFigures(
        index=generation.index,
        best_reward=generation.best_reward,
        mean_reward=generation.mean_reward,
        n_candidates=len(generation.evaluations),
        n_rejected=generation.count("rejected"),
        n_failed=generation.count("failed"),
    )


@lru_cache
def versions() -> dict[str, str]:
    """Return the installed versions of Python, of this distribution, and of each package that it requires."""
    found = {"python": sys.version.split()[0]}
    required = importlib.metadata.requires("vlmgineer") or []
    for requirement in ("vlmgineer", *required):
        name = Requirement(requirement).name
        # Left out: those of an extra, or not for this platform.
        with suppress(importlib.metadata.PackageNotFoundError):
            found[name] = importlib.metadata.version(name)
    return found
