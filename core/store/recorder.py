"""Write a run's SQLite store and the plain files beside it, each thing before the loop goes on.

The store is a listener; the loop does not know it.
"""

from __future__ import annotations

import importlib.metadata
import json
import logging
import math
import statistics
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import asdict
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement

from core.config.trust import as_stored
from core.design import Candidate, Evaluation
from core.designs.composer import as_markdown
from core.designs.reading import dump_design
from core.errors import UserError
from core.events import Generation, Result, Run
from core.hooks import hookimpl
from core.interfaces import Picture, Reply, Request, Task
from core.store.database import FILE, SCHEMA_VERSION, Database, writing
from core.store.progress import FIGURES, StoredProgress, digest
from core.store.rows import MAX_BYTES, Best, GenerationFigures, Unseen, dump_details, dump_plan
from core.support.files import read_untrusted, write_whole
from core.support.secrets import scrub

_log = logging.getLogger(__name__)


class RunStore:
    """A listener that writes ``run.sqlite``, ``requests/``, ``replies/`` and ``result.json`` of a run's folder.

    `create` and `open` make one. It holds the folder's lock until the run ends. Events that a resumed run repeats
    change nothing in it.

    Attributes:
        config: the run's configuration, resolved.
        past: what was stored when the store was opened.
        result: the last outcome (`report`); None: the run has neither ended nor been stopped.
        seconds: the time that earlier sessions took.
        overrides: what the command line changed of the configuration on resume; stored as a note.
    """

    def __init__(self, database: Database) -> None:
        self.folder = database.folder
        self._database = database
        ((config, result),) = database.rows("SELECT config, result FROM run")
        self.config = as_stored(json.loads(config), database.folder)
        self.result: dict[str, Any] | None = json.loads(result) if result is not None else None
        self.past = StoredProgress(database)
        ((self.seconds,),) = database.rows("SELECT total(seconds) FROM sessions")
        self._strategies = {tuple(row) for row in database.rows("SELECT generation, agent, strategy FROM strategies")}
        self.overrides: Sequence[str] = ()
        self._began = time.monotonic()
        self._open = True
        self._run: Run | None = None
        with writing(self.folder):
            for name in ("requests", "replies"):
                (self.folder / name).mkdir(exist_ok=True)

    @classmethod
    def create(cls, folder: Path, config: dict[str, Any]) -> RunStore:
        """Make the store of a new run.

        Raises:
            UserError: the folder holds a run already, another process uses it, or it can't be written.
        """
        with ExitStack() as on_error:
            database = on_error.enter_context(closing(Database(folder)))
            if database.begun():
                raise UserError(
                    f"{folder} already holds a run; go on with it with resume={folder}, or choose another folder with "
                    "hydra.run.dir=..."
                )
            with database.transaction():
                database.create()
                database.insert("run", schema_version=SCHEMA_VERSION, config=json.dumps(config))
            store = cls(database)
            on_error.pop_all()
        return store

    @classmethod
    def open(cls, folder: Path) -> RunStore | None:
        """Open the store of a run to resume; None: the run had stored nothing.

        Raises:
            UserError: the store is damaged, another process uses it, another version wrote it, or it can't be written.
        """
        if not (folder / FILE).exists():
            return None
        with ExitStack() as unless_begun:
            database = unless_begun.enter_context(closing(Database(folder)))
            if not database.begun():
                return None
            store = cls(database)
            unless_begun.pop_all()
        return store

    @hookimpl
    def run_started(self, run: Run) -> None:
        self._run = run
        self._began = time.monotonic()
        found = versions()
        for row in self._database.rows("SELECT versions FROM sessions ORDER BY number DESC LIMIT 1"):
            before = json.loads(row["versions"])
            names = sorted(name for name in {*before, *found} if before.get(name) != found.get(name))
            if names:
                changes = ", ".join(f"{name} {before.get(name)} -> {found.get(name)}" for name in names)
                _log.warning("versions have changed since this run began (%s): it may come to something else", changes)
        self._keep_task(run.task)
        with self._database.transaction():
            for request, (generation, agent) in self.past.again.items():
                self._database.execute("DELETE FROM replies WHERE request_id = ?", request)
                rejected = "DELETE FROM evaluations WHERE generation = ? AND agent = ? AND status = 'rejected'"
                self._database.execute(rejected, generation, agent)
                self._database.execute("DELETE FROM generations WHERE number = ?", generation)
            self._database.insert(
                "sessions",
                began=datetime.now(UTC).isoformat(timespec="seconds"),
                seconds=0.0,
                overrides=json.dumps(list(self.overrides)),
                versions=json.dumps(found),
            )
            # A session that is killed leaves no result of an earlier one behind.
            self._database.execute("UPDATE run SET config = ?, result = NULL", json.dumps(run.config))

    def _keep_task(self, task: Task) -> None:
        """Keep the text of a task that is no program.

        Raises:
            UserError: it is not what it was when the run began.
        """
        if task.language == "python":
            return
        file, text = self.folder / f"task.{task.language}", scrub(task.source())
        with writing(self.folder):
            if not file.exists():
                _write(file, text)
            elif read_untrusted(file, MAX_BYTES) != text.encode():
                what = f"the file of the task {task.name} has changed since the run in {self.folder} began"
                raise UserError(f"{what}; put it back from {file}, or begin a new run")

    @hookimpl
    def request_composed(self, request: Request) -> None:
        found, known = digest(request), request.id in self.past.requests
        if known and self.past.requests[request.id] == found:
            return
        if request.id in self.past.replies:
            _log.warning("%s is composed differently now than when it was asked; its reply is kept", request.id)
            return
        brief = request.brief
        with writing(self.folder):
            folder = self.folder / "requests"
            for part in (part for message in request.messages for part in message.parts):
                if isinstance(part, Picture) and part.name != "scene":  # which the run's folder has already
                    (folder / f"{part.name}.png").write_bytes(part.png)
            _write(folder / f"{request.id}.md", _readable(request))
            if not request.critique:
                _write(folder / f"{request.id}.schema.json", json.dumps(request.schema, indent=2))
        with self._database.transaction():
            self._database.insert(
                "requests",
                verb="REPLACE",
                id=request.id,
                generation=brief.generation,
                agent=brief.agent,
                gripper=brief.gripper,
                temperature=request.temperature,
                elites=json.dumps([elite.candidate.id for elite in brief.elites]),
                digest=found,
            )

    @hookimpl
    def reply_received(self, reply: Reply) -> None:
        try:
            # A reply that arrives after an interrupted run has ended becomes a file only.
            if self._open and reply.request_id not in self.past.replies:
                with self._database.transaction(paid=True):
                    self._database.insert("replies", **vars(reply) | {"unanswered": 1 if reply.unanswered else None})
        finally:
            file = self.folder / "replies" / f"{reply.request_id}.txt"
            with writing(self.folder):
                if not (file.exists() or reply.unanswered):
                    _write(file, reply.text)

    @hookimpl
    def candidate_evaluated(self, evaluation: Evaluation) -> None:
        candidate = evaluation.candidate
        if candidate.id in self.past.candidates:
            return
        generation, agent, strategy, action = candidate.key
        # An engine's numbers may be numpy's.
        numbers = {name: float(getattr(evaluation, name)) for name in FIGURES}
        figures: dict[str, Any] = {name: number if math.isfinite(number) else None for name, number in numbers.items()}
        with self._database.transaction():
            self._insert_strategy(candidate)
            self._database.insert(
                "evaluations",
                candidate=candidate.id,
                generation=generation,
                agent=agent,
                strategy=strategy,
                plan=action,
                waypoints=dump_plan(candidate.plan),
                status=evaluation.status,
                reason=evaluation.reason,
                moved_m=json.dumps(evaluation.moved_m),
                warnings=json.dumps(evaluation.warnings),
                content=candidate.content,
                details=dump_details(evaluation),
                **figures,
            )
            self._count_time()

    @hookimpl
    def finalist_tried(self, evaluation: Evaluation) -> None:
        with self._database.transaction():
            tried = "UPDATE evaluations SET details = ? WHERE candidate = ?"
            self._database.execute(tried, dump_details(evaluation), evaluation.candidate.id)
            self._count_time()

    def _insert_strategy(self, candidate: Candidate) -> None:
        """Insert the design, without action plans, once for all of its candidates."""
        key = candidate.key[:3]
        if key in self._strategies or candidate.tool is None or self._run is None:
            return
        self._strategies.add(key)
        design = dump_design(candidate, self._run.representation) | {"action_sets": []}
        generation, agent, strategy = key
        self._database.insert(
            "strategies",
            generation=generation,
            agent=agent,
            strategy=strategy,
            parents=json.dumps(candidate.parents),
            design=json.dumps(design),
        )

    def _count_time(self) -> None:
        last = "UPDATE sessions SET seconds = ? WHERE number = (SELECT max(number) FROM sessions)"
        self._database.execute(last, time.monotonic() - self._began)

    @hookimpl
    def generation_finished(self, generation: Generation) -> None:
        with self._database.transaction():
            figures = json.dumps(summary(generation))
            self._database.insert("generations", verb="REPLACE", number=generation.index, summary=figures)
            self._count_time()

    @hookimpl
    def run_finished(self, run: Run, result: Result) -> None:
        outcome = report(run, result)
        with writing(self.folder):
            _write(self.folder / "result.json", json.dumps(outcome, indent=2) + "\n")
        with self._database.transaction():
            self._database.execute("UPDATE run SET result = ?", json.dumps(outcome))
            self._count_time()

    @hookimpl
    def run_ended(self) -> None:
        self._open = False
        self._database.close()


def _write(file: Path, text: str) -> None:
    write_whole(file, scrub(text).encode())


def report(run: Run, result: Result) -> dict[str, Any]:
    """Return the content of ``result.json``."""
    return {
        "name": run.config.get("name", ""),
        **{kind: run.parts[kind] for kind in ("task", "robot", "sim", "vlm", "tool", "action", "evolution", "fitness")},
        "material": run.representation.material.name,
        "budget": run.config["budget"]["name"],
        "seed": run.seed,
        "best": best_figures(result),
        "unseen": unseen_figures(result),
        "effort": asdict(result.effort) if result.effort is not None else None,
        "finalists": {name: {of: list(r) for of, r in engines.items()} for name, engines in result.finals.items()},
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
    distance_m = None if math.isnan(best.distance_m) else best.distance_m  # of plans that were joined it is not known
    return asdict(Best(best.reward, distance_m, candidate.generation, candidate.id, best.least_margin))


def unseen_figures(result: Result) -> dict[str, Any] | None:
    """Return what the best candidate earned in unseen layouts, as in ``result.json``; None: it was tried in none."""
    if not result.unseen:
        return None
    rewards = min(result.unseen.values(), key=statistics.fmean)
    return asdict(Unseen(len(rewards), statistics.fmean(rewards), min(rewards), rewards, dict(result.unseen)))


@lru_cache
def versions() -> dict[str, str]:
    """Return the installed versions of Python, of this distribution, and of each package that it requires."""
    found = {"python": sys.version.split()[0]}
    for requirement in ["vlmgineer", *(importlib.metadata.requires("vlmgineer") or [])]:
        name = Requirement(requirement).name
        with suppress(importlib.metadata.PackageNotFoundError):  # an extra, or not for this platform
            found[name] = importlib.metadata.version(name)
    return found


def summary(generation: Generation) -> dict[str, Any]:
    """Return a generation's figures, as in ``result.json``."""
    earned, counts = (generation.best_reward, generation.mean_reward), map(generation.count, ("rejected", "failed"))
    return asdict(GenerationFigures(generation.index, *earned, len(generation.evaluations), *counts))


def _readable(request: Request) -> str:
    """Write the messages as one Markdown text with links to the pictures."""
    blocks = [f"# {message.role}\n\n{as_markdown(message).rstrip()}" for message in request.messages]
    return "\n\n".join(blocks).replace("![scene](scene.png)", "![the scene](../scene.png)") + "\n"
