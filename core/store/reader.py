"""Read what a run's store holds. Covered by `tests/core/store/test_database.py` and `tests/core/test_transfer.py`."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from sqlite3 import Row
from typing import Any

from core.config.trust import as_stored
from core.design import Evaluation
from core.designs.reading import read_designs
from core.designs.rules import SpawnRules
from core.errors import UserError
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
