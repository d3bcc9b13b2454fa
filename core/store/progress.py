"""Hold what an interrupted run has stored, so that nothing is asked or tried twice."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from sqlite3 import Row
from typing import Any

from core.design import Candidate, Evaluation
from core.errors import UserError
from core.interfaces import VLM, Reply, Request, Text
from core.store.database import Database
from core.store.rows import load_details

# An evaluation's numbers, which have columns of the same names.
FIGURES = ("reward", "distance_m", "ik_error_m", "ik_error_rad", "tracking_error_rad")


# Replies and rollouts of later generations build on a failure as on a result: it stays then. So does a critique:
# the generation's other requests were composed without it.
_AGAIN = """
    SELECT id, generation, agent FROM requests JOIN replies ON request_id = id
    WHERE unanswered AND id NOT LIKE '%-critic%' AND generation >= (
        SELECT max(generation) FROM (
            SELECT generation FROM requests JOIN replies ON request_id = id WHERE unanswered IS NULL
            UNION ALL SELECT generation FROM evaluations WHERE status != 'rejected'
            UNION ALL SELECT 0
        )
    )"""


class StoredProgress:
    """The stored requests, replies and evaluations of a run.

    Attributes:
        requests: digests by request id.
        replies: replies by request id, without those to ask for again.
        candidates: the ids of the evaluated candidates.
        again: ids of requests that got no answer, for a reason that may pass, and that nothing stored builds on.
    """

    def __init__(self, database: Database) -> None:
        self._folder = database.folder
        self.again: dict[str, tuple[int, int]] = {row[0]: row[1:] for row in map(tuple, database.rows(_AGAIN))}
        self.requests: dict[str, str] = dict(map(tuple, database.rows("SELECT id, digest FROM requests")))
        replies = "SELECT request_id, text, model, error, prompt_tokens, completion_tokens, cost_usd FROM replies"
        stored = [Reply(*row) for row in database.rows(replies)]
        self.replies = {reply.request_id: reply for reply in stored if reply.request_id not in self.again}
        lost = {(*agent, "rejected") for agent in self.again.values()}
        rows = database.rows("SELECT * FROM evaluations")
        self._evaluations = {
            row["candidate"]: row for row in rows if (row["generation"], row["agent"], row["status"]) not in lost
        }
        self.candidates = set(self._evaluations)
        details = {name: load_details(row["details"]) for name, row in self._evaluations.items()}
        tried = {name for name, of in details.items() if not any(t.tried_as for t in of.trials)}
        rows = [row for name, row in self._evaluations.items() if name in tried]
        self._by_content = {row["content"]: row for row in rows if row["content"] is not None}

    def evaluation(self, candidate: Candidate) -> Evaluation | None:
        """Return the stored evaluation of the candidate, or of an identical one; None: there is none.

        Raises:
            UserError: another candidate was evaluated under this id.
        """
        row = self._evaluations.get(candidate.id)
        unread = row is not None and row["status"] != "rejected" and candidate.problem is not None
        if row is not None and (unread or row["content"] not in (None, candidate.content)):
            raise UserError(
                f"{candidate.id} reads differently now than when it was tried: the package or a plugin has changed "
                f"since; a new run with vlm=replay vlm.run={self._folder} takes the replies that there are"
            )
        if candidate.problem is not None:
            return None
        row = row or self._by_content.get(candidate.content)
        return None if row is None else _evaluation(candidate, row)


def _evaluation(candidate: Candidate, row: Row) -> Evaluation:
    figures: dict[str, Any] = {
        name: math.nan if row[name] is None else row[name] for name in FIGURES
    }  # SQLite has no nan
    earned = Evaluation(
        candidate,
        row["status"],
        reason=row["reason"],
        moved_m=json.loads(row["moved_m"]),
        warnings=tuple(json.loads(row["warnings"])),
        **figures,
    )
    return replace(earned, **vars(load_details(row["details"])))


class CachedVLM(VLM):
    """A model that gives stored replies first, and asks another model for the rest."""

    def __init__(self, vlm: VLM, replies: Mapping[str, Reply]) -> None:
        self.model, self.takes_schema = vlm.model, vlm.takes_schema
        self.criticises, self.sees = vlm.criticises, vlm.sees
        self._vlm = vlm
        self._replies = replies

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        """See `VLM.complete`."""
        yield from (self._replies[request.id] for request in requests if request.id in self._replies)
        missing = [request for request in requests if request.id not in self._replies]
        if missing:
            yield from self._vlm.complete(missing)


def digest(request: Request) -> str:
    """Return a hash of a request, with pictures by name: not every engine draws the same pixels twice."""
    parts = [[part.text if isinstance(part, Text) else part.name for part in m.parts] for m in request.messages]
    content = json.dumps([parts, request.schema, request.temperature], sort_keys=True)
    return hashlib.blake2b(content.encode("utf-8", "surrogatepass"), digest_size=16).hexdigest()
