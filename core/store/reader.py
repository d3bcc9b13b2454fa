"""Read what a run's store holds: the one reader of all who come later."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from sqlite3 import Row
from typing import Any

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from core.config.compose import first_line, load
from core.config.trust import as_stored
from core.design import Candidate
from core.designs.reading import load_designs, read_designs
from core.errors import UsageError, UserError
from core.interfaces import Reply, Task, ToolRepresentation
from core.store.database import FILE, reading
from core.store.rows import (
    GenerationFigures,
    RunFigures,
    load_details,
    load_plan,
    load_trial,
    parsed,
    validated,
)
from core.trial import TIE, Evaluation, Score, Trial, best_first, count_rollouts

Key = tuple[int, int, int]  # generation, agent and strategy of a design


@dataclass(frozen=True)
class StoredRequest:
    """A request with the ids of its elites, and its reply; None: none came."""

    id: str
    generation: int
    agent: int
    elites: tuple[str, ...]
    reply: Reply | None

    @property
    def critique(self) -> bool:
        """Whether it asked for a critique of its elite, and not for designs."""
        return "-critic" in self.id


@dataclass(frozen=True)
class StoredDesign:
    """A design as a model wrote it, without its plans, and the ids of the candidates that it derives from."""

    written: dict[str, Any]
    parents: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class StoredEvaluation:
    """What a candidate earned; ``number`` is that of its plan."""

    candidate: str
    design: Key
    number: int
    waypoints: str
    status: str
    reason: str
    reward: float
    distance_m: float | None
    content: str | None
    score: Score
    trials: tuple[Trial, ...]
    finals: tuple[Trial, ...]

    @property
    def plan(self) -> list[Any]:
        """The plan as written: an item of ``action_sets``."""
        return load_plan(self.waypoints)

    @property
    def rollouts(self) -> int:
        """The number of rollouts that were played for it."""
        return count_rollouts(self.candidate, self.trials)

    def of(self, candidate: Candidate) -> Evaluation:
        """Return it as the evaluation of a candidate that was read again."""
        return Evaluation(candidate, self.trials, self.score, self.finals)


class StoredRun:
    """The store in the folder of a run. Each call reads anew: a run that goes on is read as far as it has come.

    Raises:
        UserError: the folder holds no store, or one that is damaged or that this version can't read; by each call.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    @property
    def exists(self) -> bool:
        """Whether there is a store, sound or not."""
        return (self._folder / FILE).exists()

    def config(self) -> dict[str, Any]:
        """Return the configuration; empty: the run was killed before it wrote anything."""
        return next(
            (
                as_stored(parsed(row["config"]), self._folder)
                for row in self._rows("run")
            ),
            {},
        )

    def result(self) -> RunFigures | None:
        """Return what the run came to; None: it has not ended."""
        results = [dict(row).get("result") for row in self._rows("run")]
        return (
            validated(RunFigures, parsed(results[0]))
            if results and results[0] is not None
            else None
        )

    def generations(self) -> tuple[GenerationFigures, ...]:
        """Return the figures of the generations that are done."""
        rows = self._rows("generations ORDER BY number")
        return tuple(
            validated(GenerationFigures, parsed(row["summary"])) for row in rows
        )

    def seconds(self) -> float:
        """Return the wall time of all sessions."""
        return float(sum(row["seconds"] for row in self._rows("sessions")))

    def requests(self) -> list[StoredRequest]:
        """Return all requests, in the order of their replies."""
        rows = self._rows(
            "requests LEFT JOIN replies ON request_id = id ORDER BY replies.rowid"
        )
        names = (
            "text",
            "model",
            "error",
            "prompt_tokens",
            "completion_tokens",
            "cost_usd",
        )
        return [
            StoredRequest(
                *(
                    row["id"],
                    row["generation"],
                    row["agent"],
                    tuple(json.loads(row["elites"])),
                ),
                None
                if row["request_id"] is None
                else Reply(row["id"], *(row[name] for name in names)),
            )
            for row in rows
        ]

    def answers(self) -> list[tuple[StoredRequest, Reply]]:
        """Return the requests that were answered, with their replies, in the order of these."""
        return [
            (request, request.reply)
            for request in self.requests()
            if request.reply is not None
        ]

    def designs(self) -> dict[Key, StoredDesign]:
        """Return all designs that were read, whatever became of them."""
        return {
            _key(row): StoredDesign(
                json.loads(row["design"]), tuple(json.loads(row["parents"]))
            )
            for row in self._rows("strategies")
        }

    def evaluations(self) -> list[StoredEvaluation]:
        """Return the evaluations of all candidates, in the order of `Candidate.key`."""
        trials = {row["number"]: load_trial(row) for row in self._rows("trials")}
        found = []
        for row in self._rows("evaluations ORDER BY generation, agent, strategy, plan"):
            details = load_details(row["details"])
            found.append(
                StoredEvaluation(
                    candidate=row["candidate"],
                    design=_key(row),
                    number=row["plan"],
                    waypoints=row["waypoints"],
                    status=row["status"],
                    reason=row["reason"],
                    reward=row["reward"],
                    distance_m=row["distance_m"],
                    content=row["content"],
                    score=details.score,
                    trials=tuple(trials[number] for number in details.trials),
                    finals=tuple(trials[number] for number in details.finals),
                )
            )
        return found

    def _rows(self, table: str) -> list[Row]:
        with reading(self._folder) as database:
            return database.execute(f"SELECT * FROM {table}").fetchall()  # noqa: S608


def _key(row: Row) -> Key:
    return row["generation"], row["agent"], row["strategy"]


def stored_config(folder: Path) -> dict[str, Any]:
    """Return the configuration of a run.

    Raises:
        UserError: the folder holds no run, or one that this version can't read.
    """
    config = StoredRun(folder).config()
    if not config:
        raise UserError(
            f"{folder} holds a run that ended before it began; its store is empty"
        )
    return config


def stored_evaluations(
    folder: Path, representation: ToolRepresentation, task: Task
) -> list[Evaluation]:
    """Return the evaluations with status ``ok``, in the order of `Candidate.key`: candidates, rewards, distances
    and details.

    The candidates of a strategy share one tool.

    Raises:
        UserError: the folder holds no run.
    """
    designs = StoredRun(folder).designs()
    tried = [
        stored for stored in StoredRun(folder).evaluations() if stored.status == "ok"
    ]
    evaluations = []
    for key, group in groupby(tried, lambda stored: stored.design):
        alike, design = list(group), designs[key]
        document = {
            "strategies": [
                design.written | {"action_sets": [stored.plan for stored in alike]}
            ]
        }
        candidates = read_designs(
            document, representation, task, generation=key[0], agent=key[1]
        )
        for stored, candidate in zip(alike, candidates, strict=True):
            known = replace(
                candidate, strategy=key[2], action=stored.number, parents=design.parents
            )
            evaluations.append(stored.of(known))
    return evaluations


def chosen_evaluations(
    cfg: DictConfig, representation: ToolRepresentation, task: Task
) -> list[Evaluation]:
    """Read all designs of the file, or the best of the run, that ``cfg.designs`` names, and what each earned: in a file
    nothing.
    """
    path = Path(cfg.designs)
    if not path.exists() and not path.suffix:
        raise UserError(
            f"{path}: there is no such folder of a run, and no designs file"
        )
    if not path.is_dir():
        return [
            Evaluation(candidate)
            for candidate in read_designs(load_designs(path), representation, task)
        ]
    if cfg.top < 1:
        raise UsageError(f"top must be at least 1, got {cfg.top}")
    tie = (
        stored_config(path).get("evolution", {}).get("tie", TIE)
    )  # as the run chose its best
    tried = stored_evaluations(path, representation, task)
    if not tried:
        raise UserError(f"{path}: no design of this run came to the end of a rollout")
    ended = StoredRun(path).result()
    winner = (
        ended.best.candidate if ended is not None and ended.best is not None else None
    )
    ranked = sorted(
        best_first(tried, tie), key=lambda e: e.candidate.id != winner
    )  # what the run chose is first
    return ranked[: cfg.top]


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
        below = [
            f"{group}.{name}"
            for group in ("rollout", "material")
            for name in run.get(group, {})
        ]
        for key in ("seed", *below):
            if not {key, key.partition(".")[0]} & named:
                OmegaConf.update(cfg, key, OmegaConf.select(OmegaConf.create(run), key))
        for kind in {"task", "tool", "robot"} - {
            key.partition(".")[0] for key in named
        }:
            OmegaConf.update(cfg, kind, run[kind], merge=False, force_add=True)
    except (KeyError, OmegaConfBaseException) as error:
        raise UserError(
            f"{cfg.designs}: its configuration can't be used here: {first_line(error)}"
        ) from error
    return cfg
