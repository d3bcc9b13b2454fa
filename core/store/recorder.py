"""Write a run's SQLite store and the plain files beside it, each thing before the loop goes on.

The store is a listener; the loop does not know it.
"""

from __future__ import annotations

import json
import logging
import math
import time
from collections.abc import Sequence
from contextlib import ExitStack, closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from core.config.trust import as_stored
from core.design import Candidate
from core.designs.reading import dump_design
from core.errors import UserError
from core.events import Generation, Result, Run
from core.hooks import hookimpl
from core.interfaces import Reply, Request
from core.store.database import FILE, SCHEMA_VERSION, Database, writing
from core.store.figures import report, summary, versions
from core.store.files import keep_task, write_request, write_text
from core.store.progress import StoredProgress, digest
from core.store.rows import Details, dump_details, dump_plan, trial_row
from core.trial import Evaluation, Trial, TrialKey

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
        self.result: dict[str, Any] | None = (
            json.loads(result) if result is not None else None
        )
        self.past = StoredProgress(database)
        ((self.seconds,),) = database.rows("SELECT total(seconds) FROM sessions")
        self._strategies = {
            tuple(row)
            for row in database.rows(
                "SELECT generation, agent, strategy FROM strategies"
            )
        }
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
                database.insert(
                    "run", schema_version=SCHEMA_VERSION, config=json.dumps(config)
                )
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
        for row in self._database.rows(
            "SELECT versions FROM sessions ORDER BY number DESC LIMIT 1"
        ):
            before = json.loads(row["versions"])
            names = sorted(
                name
                for name in {*before, *found}
                if before.get(name) != found.get(name)
            )
            if names:
                changes = ", ".join(
                    f"{name} {before.get(name)} -> {found.get(name)}" for name in names
                )
                _log.warning(
                    "versions have changed since this run began (%s): it may come to something else",
                    changes,
                )
        keep_task(self.folder, run.task)
        with self._database.transaction():
            for request, (generation, agent) in self.past.again.items():
                self._database.execute(
                    "DELETE FROM replies WHERE request_id = ?", request
                )
                rejected = "DELETE FROM evaluations WHERE generation = ? AND agent = ? AND status = 'rejected'"
                self._database.execute(rejected, generation, agent)
                self._database.execute(
                    "DELETE FROM generations WHERE number = ?", generation
                )
            self._database.insert(
                "sessions",
                began=datetime.now(UTC).isoformat(timespec="seconds"),
                seconds=0.0,
                overrides=json.dumps(list(self.overrides)),
                versions=json.dumps(found),
            )
            # A session that is killed leaves no result of an earlier one behind.
            self._database.execute(
                "UPDATE run SET config = ?, result = NULL", json.dumps(run.config)
            )

    @hookimpl
    def request_composed(self, request: Request) -> None:
        found, known = digest(request), request.id in self.past.requests
        if known and self.past.requests[request.id] == found:
            return
        if request.id in self.past.replies:
            _log.warning(
                "%s is composed differently now than when it was asked; its reply is kept",
                request.id,
            )
            return
        brief = request.brief
        with writing(self.folder):
            write_request(self.folder, request)
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
                    self._database.insert(
                        "replies",
                        **vars(reply) | {"unanswered": 1 if reply.unanswered else None},
                    )
        finally:
            file = self.folder / "replies" / f"{reply.request_id}.txt"
            with writing(self.folder):
                if not (file.exists() or reply.unanswered):
                    write_text(file, reply.text)

    @hookimpl
    def candidate_evaluated(self, evaluation: Evaluation) -> None:
        candidate = evaluation.candidate
        if candidate.id in self.past.candidates:
            return
        generation, agent, strategy, action = candidate.key
        distance_m = float(evaluation.distance_m)
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
                reward=float(evaluation.reward),
                distance_m=distance_m if math.isfinite(distance_m) else None,
                content=candidate.content,
                details=dump_details(self._details(evaluation)),
            )
            self._count_time()

    def keep_trial(self, key: TrialKey, trial: Trial) -> None:
        """Store a trial when it ends (`core.search.trials.Trials.tell`)."""
        content, _ = key
        number = len(self.past.numbers) + 1
        self.past.numbers[key] = number
        with self._database.transaction():
            self._database.insert("trials", number=number, **trial_row(content, trial))
            self._count_time()

    def _details(self, evaluation: Evaluation) -> Details:
        """Name the trials of an evaluation by the numbers of their rows."""
        numbers = self.past.numbers
        content = {
            task: evaluation.candidate.of(task).content for task in evaluation.tasks
        }
        trials = tuple(
            numbers[content[trial.task], trial.where] for trial in evaluation.trials
        )
        finals = tuple(
            numbers[content[trial.task], trial.where] for trial in evaluation.finals
        )
        return Details(evaluation.score, trials, finals)

    @hookimpl
    def finalist_tried(self, evaluation: Evaluation) -> None:
        with self._database.transaction():
            tried = "UPDATE evaluations SET details = ? WHERE candidate = ?"
            self._database.execute(
                tried, dump_details(self._details(evaluation)), evaluation.candidate.id
            )
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
            self._database.insert(
                "generations", verb="REPLACE", number=generation.index, summary=figures
            )
            self._count_time()

    @hookimpl
    def run_finished(self, run: Run, result: Result) -> None:
        outcome = report(run, result)
        with writing(self.folder):
            write_text(
                self.folder / "result.json", json.dumps(outcome, indent=2) + "\n"
            )
        with self._database.transaction():
            self._database.execute("UPDATE run SET result = ?", json.dumps(outcome))
            self._count_time()

    @hookimpl
    def run_ended(self) -> None:
        self._open = False
        self._database.close()
