"""Read the designs that a command names: all of a file, or the best of a run, with that run's settings."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

from omegaconf import MISSING, DictConfig, OmegaConf

from core.config.compose import load
from core.config.schemas import PartConfig
from core.designs.reading import load_designs, read_designs
from core.errors import UsageError, UserError
from core.interfaces import (
    Material,
    Printer,
    RolloutSettings,
    Task,
    ToolRepresentation,
)
from core.plugins import SIMULATOR, installed
from core.search.run_settings import stored_config, take_over, take_run
from core.search.saved_designs import read_stored
from core.store.reader import StoredRun
from core.support.cli import key_of, say
from core.trial import TIE, Evaluation, best_first


@dataclass
class DesignsConfig:
    """What the settings of all commands have that take designs (`config_for`).

    Attributes:
        task: what the designs are for.
        robot: the arm.
        tool: how the designs' tools are written.
        material: of the tools.
        printer: whose plate and thinnest wall count.
        rollout: how plans are executed.
        seed: of the layout.
        designs: a designs file, or a run's folder.
        top: how many candidates of a run are taken, the best first.
    """

    task: PartConfig = MISSING
    robot: PartConfig = MISSING
    tool: PartConfig = MISSING
    material: Material = field(default_factory=Material)
    printer: Printer = field(default_factory=Printer)
    rollout: RolloutSettings = field(default_factory=RolloutSettings)
    seed: int = 0
    designs: str = MISSING
    top: int = 1


def stored_evaluations(
    folder: Path, representation: ToolRepresentation, task: Task
) -> list[Evaluation]:
    """Return the evaluations with status ``ok``, in the order of `Candidate.key`, with their candidates read again.

    The candidates of a design share one tool.

    Raises:
        UserError: the folder holds no run.
    """
    run = StoredRun(folder)
    designs = run.designs()
    tried = [stored for stored in run.evaluations() if stored.status == "ok"]
    evaluations = []
    for key, group in groupby(tried, lambda stored: stored.design_key):
        alike = list(group)
        candidates = read_stored(designs[key], alike, representation, task)
        for stored, candidate in zip(alike, candidates, strict=True):
            evaluations.append(stored.of(candidate))

    return evaluations


def chosen_evaluations(
    cfg: DictConfig, representation: ToolRepresentation, task: Task
) -> list[Evaluation]:
    """Read all designs of the file, or the best of the run, that ``cfg.designs`` names, and what each earned.

    Those of a file have earned nothing.

    Raises:
        UserError: there is no such file or run, or it holds no design that could be tried.
    """
    path = Path(cfg.designs)
    if not path.is_dir():
        if not path.exists() and not path.suffix:
            raise UserError(
                f"{path}: there is no such folder of a run, and no designs file"
            )

        written = read_designs(load_designs(path), representation, task)
        return [Evaluation(candidate) for candidate in written]

    if cfg.top < 1:
        raise UsageError(f"top must be at least 1, got {cfg.top}")

    tried = stored_evaluations(path, representation, task)
    if not tried:
        raise UserError(f"{path}: no design of this run came to the end of a rollout")

    tie = stored_config(path).get("evolution", {}).get("tie", TIE)
    ranking = best_first(tried, tie)  # as the run chose its best
    ended = StoredRun(path).result()
    if ended is not None and ended.best is not None:
        winner = ended.best.candidate
        ranking.sort(key=lambda evaluation: evaluation.candidate.id != winner)

    return ranking[: cfg.top]


def config_for(words: Sequence[str], name: str, schema: type, usage: str) -> DictConfig:
    """Compose the primary config ``name`` of a command that takes ``designs``, a file or a run's folder.

    Of a run its task, robot, tool, material, printer, layout and rollout settings count, unless the command line sets
    them.
    Engines (``sims``) that the command line does not name are left out where their packages are missing.

    Raises:
        UserError: no designs are given, or the run's configuration can't be used here.
    """
    run, left = take_run(words)
    cfg = load(name, left, schema)
    if OmegaConf.is_missing(cfg, "designs"):
        raise UsageError(f"no designs given; {usage}")

    named = set(map(key_of, left))
    if "sims" in cfg and "sims" not in named:
        for fault in _leave_out_unusable(cfg):
            say(f"left out: {fault}", file=sys.stderr)

    if run is not None:
        take_over(cfg, run, named)

    return cfg


def config_for_run(run: Mapping[str, Any], name: str, schema: type) -> DictConfig:
    """Compose the primary config ``name`` of a command as `config_for` does for a run's folder.

    Args:
        run: the configuration of the run.
        name: of the command.
        schema: of its settings.

    Raises:
        UserError: the run's configuration can't be used here.
    """
    cfg = load(name, [], schema)
    _leave_out_unusable(cfg)
    take_over(cfg, run, ())
    return cfg


def _leave_out_unusable(cfg: DictConfig) -> list[UserError]:
    """Leave the engines out of ``sims`` whose packages are missing, and return what is missing."""
    usable = []
    faults = []
    for name in cfg.sims:
        try:
            installed().factory(SIMULATOR.name, name)
            usable.append(name)
        except UserError as error:
            faults.append(error)

    cfg.sims = usable
    return faults
