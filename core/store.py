"""A run's SQLite store, and the plain files beside it. Each thing is on disk before the loop goes on.

The store is a listener like any other; the loop does not know it.
"""

from __future__ import annotations

import importlib.metadata
import json
import sqlite3
import sys
import threading
from pathlib import Path
from typing import Any

from core.design import Candidate, Evaluation
from core.errors import UserError
from core.hooks import hookimpl
from core.interfaces import Picture, Reply, Request, Text
from core.reading import dump_design
from core.record import Generation, Result, Run

SCHEMA_VERSION = 2

_SCHEMA = """
CREATE TABLE run (schema_version INTEGER NOT NULL, config TEXT NOT NULL);
CREATE TABLE requests (
    id TEXT PRIMARY KEY, generation INTEGER NOT NULL, agent INTEGER NOT NULL, gripper INTEGER NOT NULL,
    temperature REAL NOT NULL, elites TEXT NOT NULL
);
CREATE TABLE replies (
    request_id TEXT PRIMARY KEY REFERENCES requests(id), model TEXT NOT NULL, text TEXT NOT NULL, error TEXT,
    prompt_tokens INTEGER, completion_tokens INTEGER, cost_usd REAL
);
CREATE TABLE strategies (
    generation INTEGER NOT NULL, agent INTEGER NOT NULL, strategy INTEGER NOT NULL, parents TEXT NOT NULL,
    design TEXT NOT NULL, PRIMARY KEY (generation, agent, strategy)
);
CREATE TABLE evaluations (
    candidate TEXT PRIMARY KEY, generation INTEGER NOT NULL, agent INTEGER NOT NULL, strategy INTEGER NOT NULL,
    plan INTEGER NOT NULL, waypoints TEXT NOT NULL, status TEXT NOT NULL, reason TEXT NOT NULL, reward REAL NOT NULL,
    distance_m REAL, ik_error_m REAL, ik_error_rad REAL, tracking_error_rad REAL, moved_m TEXT NOT NULL,
    warnings TEXT NOT NULL, details TEXT NOT NULL
);
CREATE TABLE generations (number INTEGER PRIMARY KEY, summary TEXT NOT NULL);
"""


class RunStore:
    """Writes ``run.sqlite``, ``requests/``, ``replies/`` and ``result.json`` of a run folder.

    Raises:
        UserError: the folder holds a run already.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        file = folder / "run.sqlite"
        if file.exists():
            raise UserError(f"{folder} already holds a run; choose another folder with hydra.run.dir=...")
        folder.mkdir(parents=True, exist_ok=True)
        for name in ("requests", "replies"):
            (folder / name).mkdir(exist_ok=True)
        self._lock = threading.Lock()  # replies come from a thread of their own
        self._open = True
        self._database = sqlite3.connect(file, check_same_thread=False)
        self._database.execute("PRAGMA journal_mode=WAL")
        self._database.executescript(_SCHEMA)
        self._run: Run | None = None
        self._strategies: set[tuple[int, int, int]] = set()

    def _insert(self, table: str, **values: Any) -> None:
        columns, marks = ", ".join(values), ", ".join("?" * len(values))
        with self._lock, self._database:
            self._database.execute(f"INSERT INTO {table} ({columns}) VALUES ({marks})", list(values.values()))  # noqa: S608

    @hookimpl
    def run_started(self, run: Run) -> None:
        self._run = run
        self._insert("run", schema_version=SCHEMA_VERSION, config=json.dumps(run.config))

    @hookimpl
    def request_composed(self, request: Request) -> None:
        brief = request.brief
        self._insert(
            "requests",
            id=request.id,
            generation=brief.generation,
            agent=brief.agent,
            gripper=brief.gripper,
            temperature=request.temperature,
            elites=json.dumps([elite.candidate.id for elite in brief.elites]),
        )
        (self.folder / "requests" / f"{request.id}.md").write_text(_readable(request), encoding="utf-8")
        schema = json.dumps(request.schema, indent=2)
        (self.folder / "requests" / f"{request.id}.schema.json").write_text(schema, encoding="utf-8")

    @hookimpl
    def reply_received(self, reply: Reply) -> None:
        (self.folder / "replies" / f"{reply.request_id}.txt").write_text(reply.text, encoding="utf-8")
        if self._open:  # one that comes after the end of an interrupted run is kept as a file
            self._insert("replies", **vars(reply))

    @hookimpl
    def candidate_evaluated(self, evaluation: Evaluation) -> None:
        candidate = evaluation.candidate
        generation, agent, strategy, action = candidate.key
        self._store_strategy(candidate)
        self._insert(
            "evaluations",
            candidate=candidate.id,
            generation=generation,
            agent=agent,
            strategy=strategy,
            plan=action,
            waypoints=json.dumps(candidate.plan.tolist()),
            status=evaluation.status,
            reason=evaluation.reason,
            reward=evaluation.reward,
            distance_m=evaluation.distance_m,
            ik_error_m=evaluation.ik_error_m,
            ik_error_rad=evaluation.ik_error_rad,
            tracking_error_rad=evaluation.tracking_error_rad,
            moved_m=json.dumps(evaluation.moved_m),
            warnings=json.dumps(evaluation.warnings),
            details=json.dumps(evaluation.details),
        )

    def _store_strategy(self, candidate: Candidate) -> None:
        """Once for all of its candidates: the design as a strategy of a designs file, without action plans."""
        key = candidate.key[:3]
        if key in self._strategies or candidate.tool is None or self._run is None:
            return
        self._strategies.add(key)
        design = dump_design(candidate, self._run.representation) | {"action_sets": []}
        generation, agent, strategy = key
        self._insert(
            "strategies",
            generation=generation,
            agent=agent,
            strategy=strategy,
            parents=json.dumps(candidate.parents),
            design=json.dumps(design),
        )

    @hookimpl
    def generation_finished(self, generation: Generation) -> None:
        self._insert("generations", number=generation.index, summary=json.dumps(summary(generation)))

    @hookimpl
    def run_finished(self, run: Run, result: Result) -> None:
        text = json.dumps(report(run, result), indent=2) + "\n"
        (self.folder / "result.json").write_text(text, encoding="utf-8")

    @hookimpl
    def run_ended(self) -> None:
        with self._lock:
            self._open = False
            self._database.close()


def report(run: Run, result: Result) -> dict[str, Any]:
    """The content of ``result.json``."""
    best = result.best
    return {
        **{kind: run.parts[kind] for kind in ("task", "sim", "vlm", "tool", "evolution")},
        "budget": run.config["budget"]["name"],
        "seed": run.seed,
        "best": None
        if best is None
        else {
            "reward": best.reward,
            "distance_m": best.distance_m,
            "generation": best.candidate.generation,
            "candidate": best.candidate.id,
        },
        "generations": [summary(generation) for generation in result.generations],
        "n_evaluations": result.n_evaluations,
        "wall_time_s": round(result.wall_time_s, 3),
        "rollouts_per_s": round(result.n_evaluations / result.wall_time_s, 3),
        "versions": versions(),
    }


def versions() -> dict[str, str]:
    """Of Python, of this distribution, and of all that it requires and is installed."""
    found = {"python": sys.version.split()[0]}
    for requirement in ["vlmgineer", *(importlib.metadata.requires("vlmgineer") or [])]:
        name = requirement.split(";")[0].split("[")[0].rstrip("<>=!~.,0123456789 ")
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue  # an extra, or not for this platform
    return found


def summary(generation: Generation) -> dict[str, Any]:
    """A generation's figures, as in ``result.json``."""
    return {
        "index": generation.index,
        "best_reward": generation.best.reward if generation.best is not None else None,
        "mean_reward": generation.mean_reward,
        "n_candidates": len(generation.evaluations),
        "n_rejected": generation.count("rejected"),
        "n_failed": generation.count("failed"),
    }


def _readable(request: Request) -> str:
    """The messages as one Markdown text; the picture is the run's ``scene.png``."""
    blocks = []
    for message in request.messages:
        parts = [part.text if isinstance(part, Text) else "![the scene](../scene.png)" for part in message.parts]
        assert all(isinstance(part, Text | Picture) for part in message.parts)
        blocks.append(f"# {message.role}\n\n" + "\n\n".join(parts))
    return "\n\n".join(blocks) + "\n"
