"""Hold what an interrupted run has stored, so that nothing is asked or tried twice."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence

from core.design import Candidate
from core.errors import UserError
from core.interfaces import VLM, Reply, Request, Text
from core.store.database import Database
from core.store.rows import load_trial
from core.trial import Trial, TrialKey

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
    """The stored requests, replies, evaluations and trials of a run.

    Attributes:
        requests: digests by request id.
        replies: replies by request id, without those to ask for again.
        candidates: the ids of the evaluated candidates.
        trials: by content and condition.
        numbers: of the rows of the trials.
        again: ids of requests that got no answer, for a reason that may pass, and that nothing stored builds on.
    """

    def __init__(self, database: Database) -> None:
        self._folder = database.folder
        self.again: dict[str, tuple[int, int]] = {
            row[0]: row[1:] for row in map(tuple, database.rows(_AGAIN))
        }
        self.requests: dict[str, str] = dict(
            map(tuple, database.rows("SELECT id, digest FROM requests"))
        )
        replies = "SELECT request_id, text, model, error, prompt_tokens, completion_tokens, cost_usd FROM replies"
        stored = [Reply(*row) for row in database.rows(replies)]
        self.replies = {
            reply.request_id: reply
            for reply in stored
            if reply.request_id not in self.again
        }
        lost = {(*agent, "rejected") for agent in self.again.values()}
        rows = database.rows("SELECT * FROM evaluations")
        self._evaluations = {
            row["candidate"]: row
            for row in rows
            if (row["generation"], row["agent"], row["status"]) not in lost
        }
        self.candidates = set(self._evaluations)
        self.trials: dict[TrialKey, Trial] = {}
        self.numbers: dict[TrialKey, int] = {}
        for row in database.rows("SELECT * FROM trials ORDER BY number"):
            trial = load_trial(row)
            self.trials[row["content"], trial.where] = trial
            self.numbers[row["content"], trial.where] = row["number"]

    def expect(self, candidate: Candidate) -> None:
        """Check that a candidate is what it was when it was tried.

        Raises:
            UserError: another candidate was evaluated under this id.
        """
        row = self._evaluations.get(candidate.id)
        if row is None:
            return
        unread = row["status"] != "rejected" and candidate.problem is not None
        if unread or row["content"] != candidate.content:
            raise UserError(
                f"{candidate.id} reads differently now than when it was tried: the package or a plugin has changed "
                f"since; a new run with vlm=replay vlm.run={self._folder} takes the replies that there are"
            )


class CachedVLM(VLM):
    """A model that gives stored replies first, and asks another model for the rest."""

    def __init__(self, vlm: VLM, replies: Mapping[str, Reply]) -> None:
        self.model, self.takes_schema = vlm.model, vlm.takes_schema
        self.criticises, self.sees = vlm.criticises, vlm.sees
        self._vlm = vlm
        self._replies = replies

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        """See `VLM.complete`."""
        yield from (
            self._replies[request.id]
            for request in requests
            if request.id in self._replies
        )
        missing = [request for request in requests if request.id not in self._replies]
        if missing:
            yield from self._vlm.complete(missing)


def digest(request: Request) -> str:
    """Return a hash of a request, with pictures by name: not every engine draws the same pixels twice."""
    parts = [
        [part.text if isinstance(part, Text) else part.name for part in m.parts]
        for m in request.messages
    ]
    content = json.dumps([parts, request.schema, request.temperature], sort_keys=True)
    return hashlib.blake2b(
        content.encode("utf-8", "surrogatepass"), digest_size=16
    ).hexdigest()
