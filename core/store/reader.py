"""Read what a run's store holds, as values: the one reader of a resumed run and of all who come later."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from core.config.trust import as_stored
from core.interfaces import Reply
from core.store.database import FILE, read_table
from core.store.rows import (
    Key,
    Row,
    RunFigures,
    StoredDesign,
    StoredEvaluation,
    StoredReply,
    StoredRequest,
    StoredTrial,
    load_trial,
    parsed,
)
from core.support.inputs import check
from core.support.text import number

T = TypeVar("T")
_ROUNDING = 1e-6  # of a reward


class StoredRun:
    """The store in the folder of a run, for any number of readers, whatever thread or process they are in.

    Each call reads anew: a run that goes on is read as far as it has come, and is not held up. Nothing is written, and
    nothing that stands in the store is resolved or executed::

        run = StoredRun(Path("runs/BringCube/2025-01-01_12-00-00"))
        best = max(run.evaluations(), key=lambda evaluation: evaluation.reward)

    Args:
        folder: of the run.
        read: gives the rows of a table to the process that writes the store; None: the file is opened for each call.

    Raises:
        UserError: the folder holds no store, or one that is damaged or that this version can't read; by each call.
    """

    def __init__(
        self, folder: Path, read: Callable[[str], list[Row]] | None = None
    ) -> None:
        self._folder = folder
        self._read = read or partial(read_table, folder)

    @property
    def exists(self) -> bool:
        """Whether there is a store, sound or not."""
        return (self._folder / FILE).exists()

    def config(self) -> dict[str, Any]:
        """Return the configuration; empty: the run was killed before it wrote anything."""
        for row in self._read("run"):
            return as_stored(parsed(row["config"]), self._folder)
        return {}

    def result(self) -> RunFigures | None:
        """Return what the run came to; None: it has not ended."""
        for row in self._read("run"):
            if row["result"] is not None:
                return check(RunFigures, parsed(row["result"]))
        return None

    def seconds(self) -> float:
        """Return the wall time of all sessions."""
        return sum((float(row["seconds"]) for row in self._read("sessions")), 0.0)

    def requests(self) -> list[StoredRequest]:
        """Return all requests, in the order of their replies; those without one come first."""
        replies = {
            reply.request_id: reply for reply in self._rows(StoredReply, "replies")
        }
        requests = [
            replace(request, reply=replies.get(request.id))
            for request in self._rows(StoredRequest, "requests")
        ]
        order = {name: number for number, name in enumerate(replies)}
        return sorted(requests, key=lambda request: order.get(request.id, -1))

    def answers(self) -> list[tuple[StoredRequest, Reply]]:
        """Return the requests that were answered, with their replies, in the order of these."""
        return [
            (request, request.reply)
            for request in self.requests()
            if request.reply is not None
        ]

    def designs(self) -> dict[Key, StoredDesign]:
        """Return all designs that were read, whatever became of them."""
        designs = self._rows(StoredDesign, "designs")
        return {design.key: design for design in designs}

    def trials(self) -> list[StoredTrial]:
        """Return all trials, in the order in which they ended."""
        return [
            StoredTrial(row["number"], row["content"], load_trial(row))
            for row in self._read("trials")
        ]

    def evaluations(
        self, tried: Iterable[StoredTrial] | None = None
    ) -> list[StoredEvaluation]:
        """Return the evaluations of all candidates, in the order of `Candidate.key`.

        ``tried`` are `trials`, where they were read already.
        """
        # Before the trials: a run that goes on adds these first.
        rows = [*self._rows(StoredEvaluation, "evaluations")]
        known = self.trials() if tried is None else tried
        trials = {stored.number: stored.trial for stored in known}
        return [
            replace(
                stored,
                trials=tuple(trials[number] for number in stored.details.trials),
                finals=tuple(trials[number] for number in stored.details.finals),
            )
            for stored in rows
        ]

    def reward_of(self, candidate: str) -> float | None:
        """Return what a candidate earned by its evaluation; None: it has none."""
        for row in self._read("evaluations"):
            if row["candidate"] == candidate:
                return float(row["reward"])
        return None

    def find_false_claim(self) -> str:
        """Say where the result claims another reward for the best candidate than was stored when that was tried.

        Empty: nowhere, or it claims none.
        """
        figures = self.result()
        if figures is None or figures.best is None:
            return ""

        best = figures.best
        earned = self.reward_of(best.candidate)
        if earned is not None and abs(earned - best.reward) <= _ROUNDING:
            return ""

        claimed = f"its result claims {number(best.reward, 3)} for {best.candidate}"
        return f"{claimed}, and its evaluation says {number(earned, 3)}"

    def _rows(self, schema: type[T], table: str) -> Iterable[T]:
        for row in self._read(table):
            yield check(schema, dict(row))
