"""Write a run's SQLite store and the plain files beside it, each thing before the loop goes on."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from core.errors import UserError
from core.events import Result, Run
from core.hooks import hookimpl
from core.interfaces import Reply, Request
from core.store import columns
from core.store.database import FILE, SCHEMA_VERSION, Database
from core.store.plain_files import write_request, write_text
from core.store.reader import StoredRun
from core.store.run_figures import report, versions
from core.store.stored_progress import StoredProgress, digest_request
from core.support.files import writing
from core.trial import Evaluation, Trial, TrialKey

_log = logging.getLogger(__name__)


class RunStore:
    """A listener that writes ``run.sqlite``, ``requests/``, ``replies/`` and ``result.json`` of a run's folder.

    `create` and `open` make one. The loop does not know it: it is registered as the listener that hears each event
    first, and what it raises ends the run.

    **Ownership.** It holds the folder's lock until `run_ended`, which has to be called in any case; one process writes
    a run at a time. Others read as they like (`core.store.reader`).

    **Threads.** Events come from the run's thread, but for `reply_received`; each is one transaction, and they exclude
    one another.

    **What may be lost.** When an event returns, what it carried survives the end of the process. A reply survives a
    power cut too; of the rest a power cut may take the last few transactions, in order. What cannot be written raises
    a `UserError`, and what is stored stays.

    **Resume.** Events that a resumed run repeats change nothing.

    Attributes:
        config: the run's configuration, resolved.
        past: what was stored when the store was opened.
        result: the last outcome; None: the run has neither ended nor been stopped.
        seconds: the time that earlier sessions took.
    """

    def __init__(self, database: Database) -> None:
        self.folder = database.folder
        stored = StoredRun(database.folder, database.table)
        self.config = stored.config()
        self.result = stored.result()
        self.seconds = stored.seconds()
        self.past = StoredProgress(database.folder, stored)
        self._database = database
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
        with _opened(folder) as database:
            if database.begun():
                raise UserError(
                    f"{folder} already holds a run; go on with it with resume={folder}, or choose another folder with "
                    "hydra.run.dir=..."
                )

            with database.transaction():
                database.create()
                _put_run(database, config)

            return cls(database)

    @classmethod
    def open(cls, folder: Path) -> RunStore | None:
        """Open the store of a run to resume; None: the run had stored nothing.

        Raises:
            UserError: the store is damaged, another process uses it, another version wrote it, or it can't be written.
        """
        if not (folder / FILE).exists():
            return None
        with _opened(folder) as database:
            if database.begun():
                return cls(database)
        database.close()
        return None

    @hookimpl
    def run_started(self, run: Run) -> None:
        self._run = run
        self._began = time.monotonic()
        found = versions()
        self._warn_of_changes(found)
        database = self._database
        with database.transaction():
            for request, agent in self.past.again.items():
                database.forget_reply(request, *agent)
            database.add(
                "sessions",
                seconds=0.0,
                versions=found,
            )
            # A session that is killed leaves no result of an earlier one behind.
            _put_run(database, run.config)

    def _warn_of_changes(self, found: dict[str, str]) -> None:
        """Warn where the versions ``found`` are not those of the last session."""
        for row in self._database.table("sessions")[-1:]:
            before = json.loads(row["versions"])
            changed = {name for name, _ in before.items() ^ found.items()}
            if changed:
                changes = [
                    f"{name} {before.get(name)} -> {found.get(name)}"
                    for name in sorted(changed)
                ]
                _log.warning(
                    "versions have changed since this run began (%s): it may come to something else",
                    ", ".join(changes),
                )

    @hookimpl
    def request_composed(self, request: Request) -> None:
        composed = digest_request(request)
        if self.past.requests.get(request.id) == composed:
            return
        if request.id in self.past.replies:
            _log.warning(
                "%s is composed differently now than when it was asked; its reply is kept",
                request.id,
            )
            return

        with writing(self.folder):
            write_request(self.folder, request)
        with self._database.transaction():
            row = columns.request_row(request, composed)
            self._database.put("requests", **row)

    @hookimpl
    def reply_received(self, reply: Reply) -> None:
        try:
            # A reply that arrives after an interrupted run has ended becomes a file only.
            if self._open and reply.request_id not in self.past.replies:
                with self._database.transaction(paid=True):
                    self._database.add("replies", **vars(reply))
        finally:
            file = self.folder / "replies" / f"{reply.request_id}.txt"
            with writing(self.folder):
                if not (file.exists() or reply.unanswered):
                    write_text(file, reply.text)

    def keep_trial(self, key: TrialKey, trial: Trial) -> None:
        """Store a trial when it ends (`core.search.trials.Trials.tell`)."""
        content, _ = key
        number = len(self.past.numbers) + 1
        self.past.numbers[key] = number
        with self._recording() as database:
            row = columns.trial_row(content, trial)
            database.add("trials", number=number, **row)

    @hookimpl
    def candidate_evaluated(self, evaluation: Evaluation) -> None:
        candidate = evaluation.candidate
        if candidate.id in self.past.candidates:
            return
        key = candidate.key[:3]
        with self._recording() as database:
            if candidate.tool and self._run and key not in self.past.designs:
                self.past.designs.add(key)  # once for all of its candidates
                design = columns.design_row(candidate, self._run.representation)
                database.add("designs", **design)
            row = columns.evaluation_row(evaluation, self.past.numbers)
            database.add("evaluations", **row)

    @hookimpl
    def finalist_tried(self, evaluation: Evaluation) -> None:
        row = columns.evaluation_row(evaluation, self.past.numbers)
        with self._recording() as database:
            database.put("evaluations", **row)

    @hookimpl
    def run_finished(self, run: Run, result: Result) -> None:
        outcome = asdict(report(run, result))
        with writing(self.folder):
            text = json.dumps(outcome, indent=2) + "\n"
            write_text(self.folder / "result.json", text)
        with self._recording() as database:
            _put_run(database, run.config, outcome)

    @contextmanager
    def _recording(self) -> Iterator[Database]:
        """Write in one transaction, with the time that the session has taken so far."""
        with self._database.transaction():
            yield self._database
            self._database.note_seconds(time.monotonic() - self._began)

    @hookimpl
    def run_ended(self) -> None:
        self._open = False
        self._database.close()


@contextmanager
def _opened(folder: Path) -> Iterator[Database]:
    """Open a database, which an error within closes.

    Raises:
        UserError: see `Database`.
    """
    database = Database(folder)
    try:
        yield database
    except BaseException:
        database.close()
        raise


def _put_run(
    database: Database, config: dict[str, Any], result: dict[str, Any] | None = None
) -> None:
    """Write the row of the run itself in place of the one that is there; within a transaction.

    Raises:
        UserError: it holds what no reader takes.
    """
    for key, settings in config.items():
        try:
            json.dumps(settings, allow_nan=False)
        except ValueError as error:
            raise UserError(f"{key}: a number in it is not finite") from error

    database.put_run(schema_version=SCHEMA_VERSION, config=config, result=result)
