"""Compute the figures of a run, as in ``result.json``."""

from __future__ import annotations

import importlib.metadata
import math
import statistics
import sys
from contextlib import suppress
from dataclasses import asdict
from functools import lru_cache
from typing import Any

from packaging.requirements import Requirement

from core.events import Generation, Result, Run
from core.store.rows import Best, GenerationFigures, Unseen


def report(run: Run, result: Result) -> dict[str, Any]:
    """Return the content of ``result.json``."""
    return {
        "name": run.config.get("name", ""),
        **{
            kind: run.parts[kind]
            for kind in (
                "task",
                "robot",
                "sim",
                "vlm",
                "tool",
                "action",
                "evolution",
                "fitness",
            )
        },
        "material": run.representation.material.name,
        "budget": run.config["budget"]["name"],
        "seed": run.seed,
        "best": best_figures(result),
        "unseen": unseen_figures(result),
        "effort": asdict(result.effort) if result.effort is not None else None,
        "finalists": {
            name: {of: list(r) for of, r in engines.items()}
            for name, engines in result.finals.items()
        },
        "tie": result.tie,
        "stopped": result.stopped,
        "generations": [summary(generation) for generation in result.generations],
        "n_evaluations": result.n_evaluations,
        "rollouts": result.rollouts,
        "wall_time_s": round(result.wall_time_s, 3),
        "rollouts_per_s": round(result.rollouts / result.wall_time_s, 3),
        "versions": versions(),
    }


def best_figures(result: Result) -> dict[str, Any] | None:
    """Return the figures of the best candidate, as in ``result.json``; None: no candidate could be tried."""
    if (best := result.best) is None:
        return None
    candidate = best.candidate
    distance_m = (
        None if math.isnan(best.distance_m) else best.distance_m
    )  # of plans that were joined it is not known
    return asdict(
        Best(
            best.reward,
            distance_m,
            candidate.generation,
            candidate.id,
            best.least_margin,
        )
    )


def unseen_figures(result: Result) -> dict[str, Any] | None:
    """Return what the best candidate earned in unseen layouts, as in ``result.json``; None: it was tried in none."""
    if not result.unseen:
        return None
    rewards = min(result.unseen.values(), key=statistics.fmean)
    return asdict(
        Unseen(
            len(rewards),
            statistics.fmean(rewards),
            min(rewards),
            rewards,
            dict(result.unseen),
        )
    )


@lru_cache
def versions() -> dict[str, str]:
    """Return the installed versions of Python, of this distribution, and of each package that it requires."""
    found = {"python": sys.version.split()[0]}
    for requirement in ["vlmgineer", *(importlib.metadata.requires("vlmgineer") or [])]:
        name = Requirement(requirement).name
        with suppress(
            importlib.metadata.PackageNotFoundError
        ):  # an extra, or not for this platform
            found[name] = importlib.metadata.version(name)
    return found


def summary(generation: Generation) -> dict[str, Any]:
    """Return a generation's figures, as in ``result.json``."""
    earned = (generation.best_reward, generation.mean_reward)
    counts = map(generation.count, ("rejected", "failed"))
    return asdict(
        GenerationFigures(
            generation.index, *earned, len(generation.evaluations), *counts
        )
    )
