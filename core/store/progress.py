"""What a run has come to so far, so that it goes on without asking or trying again."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from sqlite3 import Row

from core.design import Candidate, Evaluation
from core.errors import UserError
from core.interfaces import VLM, Reply, Request, Text
from core.store.database import Database


class StoredProgress:
    """What is stored: ``requests`` (their digests by id, None where an older version kept none), ``replies`` by
    request, and the ids of ``candidates`` that were evaluated.
    """

    def __init__(self, database: Database) -> None:
        self._folder = database.folder
        self.requests: dict[str, str | None] = {
            row["id"]: row["digest"] for row in database.rows("SELECT id, digest FROM requests")
        }
        replies = "SELECT request_id, text, model, error, prompt_tokens, completion_tokens, cost_usd FROM replies"
        self.replies = {row["request_id"]: Reply(*row) for row in database.rows(replies)}
        self._evaluations = {row["candidate"]: row for row in database.rows("SELECT * FROM evaluations")}
        self.candidates = set(self._evaluations)
        self._by_content = {row["content"]: row for row in self._evaluations.values() if row["content"] is not None}

    def evaluation(self, candidate: Candidate) -> Evaluation | None:
        """What the candidate, or an identical one, earned; None if that isn't known.

        Raises:
            UserError: one of this name was evaluated, but it was another one.
        """
        row = self._evaluations.get(candidate.id)
        if row is not None and not _same(row, candidate):
            raise UserError(
                f"{candidate.id} reads differently now than when it was tried: the package or a plugin has changed "
                f"since; a new run with vlm=replay vlm.run={self._folder} takes the replies that there are"
            )
        if candidate.problem is not None:
            return None
        row = row or self._by_content.get(candidate.content)
        return None if row is None else _evaluation(candidate, row)


def _same(row: Row, candidate: Candidate) -> bool:
    tried = row["status"] != "rejected"
    return row["content"] in (None, candidate.content) and not (tried and candidate.problem is not None)


def _evaluation(candidate: Candidate, row: Row) -> Evaluation:
    return Evaluation(
        candidate,
        row["status"],
        reward=row["reward"],
        distance_m=_number(row["distance_m"]),
        reason=row["reason"],
        ik_error_m=_number(row["ik_error_m"]),
        ik_error_rad=_number(row["ik_error_rad"]),
        tracking_error_rad=_number(row["tracking_error_rad"]),
        moved_m=json.loads(row["moved_m"]),
        warnings=tuple(json.loads(row["warnings"])),
        details=json.loads(row["details"]),
    )


def _number(stored: float | None) -> float:
    return math.nan if stored is None else stored  # SQLite has no nan


class CachedVLM(VLM):
    """A model that is not asked again what it has answered."""

    def __init__(self, vlm: VLM, replies: Mapping[str, Reply]) -> None:
        self.model = vlm.model
        self._vlm = vlm
        self._replies = replies

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        """See `VLM.complete`."""
        yield from (self._replies[request.id] for request in requests if request.id in self._replies)
        missing = [request for request in requests if request.id not in self._replies]
        if missing:
            yield from self._vlm.complete(missing)


def digest(request: Request) -> str:
    """Names what a model is asked; pictures by their names, since not every engine draws the same pixels twice."""
    told = [[part.text if isinstance(part, Text) else part.name for part in m.parts] for m in request.messages]
    asked = json.dumps([told, request.schema, request.temperature], sort_keys=True)
    return hashlib.blake2b(asked.encode("utf-8", "surrogatepass"), digest_size=16).hexdigest()
