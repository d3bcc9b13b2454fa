"""Read what a run's store holds.

Covered by `tests/core/store/test_database.py` and `tests/plugins/test_transfer.py`.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from sqlite3 import Row
from typing import Any

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from core.config.compose import first_line, load
from core.config.trust import as_stored
from core.design import TIE, Candidate, Evaluation, best_first
from core.designs.reading import load_designs, read_designs
from core.designs.rules import SpawnRules
from core.errors import UsageError, UserError
from core.interfaces import ToolRepresentation
from core.store.database import reading
from core.store.rows import load_plan


def _query(folder: Path, query: str) -> list[Row]:
    with reading(folder) as database:
        return database.execute(query).fetchall()


def stored_config(folder: Path) -> dict[str, Any]:
    """Return the configuration of a run.

    Raises:
        UserError: the folder holds no run, or one that this version can't read.
    """
    rows = _query(folder, "SELECT config FROM run")
    if not rows:
        raise UserError(f"{folder} holds a run that ended before it began; its store is empty")
    return as_stored(json.loads(rows[0]["config"]), folder)


def stored_evaluations(folder: Path, representation: ToolRepresentation, spawn: SpawnRules) -> list[Evaluation]:
    """Return the evaluations with status ``ok``, in the order of `Candidate.key`: candidates, rewards, distances
    and details.

    The candidates of a strategy share one tool.

    Raises:
        UserError: the folder holds no run.
    """
    key_of = itemgetter("generation", "agent", "strategy")
    strategies = {key_of(row): row for row in _query(folder, "SELECT * FROM strategies")}
    rows = _query(folder, "SELECT * FROM evaluations WHERE status = 'ok' ORDER BY generation, agent, strategy, plan")
    evaluations = []
    for key, group in groupby(rows, key_of):
        plans = list(group)
        design = json.loads(strategies[key]["design"])
        design["action_sets"] = [load_plan(row["waypoints"]) for row in plans]
        parents = tuple(json.loads(strategies[key]["parents"]))
        candidates = read_designs({"strategies": [design]}, representation, spawn, generation=key[0], agent=key[1])
        for row, candidate in zip(plans, candidates, strict=True):
            known = replace(candidate, strategy=key[2], action=row["plan"], parents=parents)
            details = json.loads(row["details"])
            evaluations.append(Evaluation(known, "ok", row["reward"], row["distance_m"], details=details))
    return evaluations


def chosen_designs(cfg: DictConfig, representation: ToolRepresentation, spawn: SpawnRules) -> list[Candidate]:
    """Read all designs of the file, or the best of the run, that ``cfg.designs`` names."""
    path = Path(cfg.designs)
    if not path.is_dir():
        return read_designs(load_designs(path), representation, spawn)
    if cfg.top < 1:
        raise UsageError(f"top must be at least 1, got {cfg.top}")
    tie = stored_config(path).get("evolution", {}).get("tie", TIE)  # as the run chose its best
    return [e.candidate for e in best_first(stored_evaluations(path, representation, spawn), tie)[: cfg.top]]


def config_for(words: Sequence[str], name: str, schema: type, usage: str) -> DictConfig:
    """Compose the primary config ``name`` of a command that takes ``designs``, a file or a run's folder.

    Of a run its task, robot, tool, material, layout and rollout settings count, unless the command line sets them.

    Raises:
        UserError: no designs are given, or the run's configuration can't be used here.
    """
    cfg = load(name, words, schema)
    if OmegaConf.is_missing(cfg, "designs"):
        raise UsageError(f"no designs given; {usage}")
    if not Path(cfg.designs).is_dir():
        return cfg
    run = stored_config(Path(cfg.designs))
    named = {word.lstrip("+~").partition("=")[0] for word in words}
    try:
        below = [f"{group}.{name}" for group in ("rollout", "material") for name in run.get(group, {})]
        for key in ("seed", *below):
            if not {key, key.partition(".")[0]} & named:
                OmegaConf.update(cfg, key, OmegaConf.select(OmegaConf.create(run), key))
        kinds = {"task", "tool", *(["robot"] if run.get("robot") else [])}  # runs of earlier versions had no robot
        for kind in kinds - {key.partition(".")[0] for key in named}:
            OmegaConf.update(cfg, kind, run[kind], merge=False, force_add=True)
    except (KeyError, OmegaConfBaseException) as error:
        raise UserError(f"{cfg.designs}: its configuration can't be used here: {first_line(error)}") from error
    return cfg
