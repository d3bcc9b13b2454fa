"""Hold what an interrupted run has stored, so that nothing is asked or tried twice."""

from __future__ import annotations

from core.design import Candidate
from core.errors import UserError
from core.interfaces import Reply, Request, Text
from core.store.database import Database
from core.store.reader import StoredRun
from core.trial import Trial, TrialKey
from core.values.plans import digest

# Replies and rollouts of later generations build on a failure as on a result: it stays then. So does a critique:
# the generation's other requests were composed without it. A second look that a limit kept from being sent is sent.
_AGAIN = """
    SELECT id, generation, agent FROM requests LEFT JOIN replies ON request_id = id
    WHERE (unanswered OR request_id IS NULL AND id LIKE '%-repair') AND id NOT LIKE '%-critic%' AND generation >= (
        SELECT max(generation) FROM (
            SELECT generation FROM requests JOIN replies ON request_id = id WHERE NOT unanswered
            UNION ALL SELECT generation FROM evaluations WHERE status != 'rejected'
            UNION ALL SELECT 0
        )
    )"""


class StoredProgress:
    """The stored requests, replies, evaluations and trials of a run, as they were when it was opened.

    Attributes:
        again: ids of requests that got no answer, for a reason that may pass, and that nothing stored builds on; of
            each the generation and the agent.
        requests: digests by request id.
        replies: replies by request id, without those to ask for again.
        designs: the keys of the stored designs.
        candidates: status and content of the evaluated candidates, by their ids.
        trials: by content and condition.
        numbers: of the rows of the trials.
    """

    def __init__(self, database: Database, stored: StoredRun) -> None:
        self._folder = database.folder
        self.again: dict[str, tuple[int, int]] = {
            row["id"]: (row["generation"], row["agent"])
            for row in database.rows(_AGAIN)
        }
        requests = stored.requests()
        self.requests = {request.id: request.digest for request in requests}
        self.replies: dict[str, Reply] = {}
        for request in requests:
            if request.reply is not None and request.id not in self.again:
                self.replies[request.id] = request.reply

        agents = set(self.again.values())
        self.designs = set(stored.designs())
        rows = stored.trials()
        self.candidates = {
            evaluation.candidate: (evaluation.status, evaluation.content)
            for evaluation in stored.evaluations(rows)
            if evaluation.status != "rejected"
            or evaluation.design_key[:2] not in agents
        }

        self.trials: dict[TrialKey, Trial] = {}
        self.numbers: dict[TrialKey, int] = {}
        for row in rows:
            key = row.content, row.trial.where
            self.trials[key] = row.trial
            self.numbers[key] = row.number

    def expect(self, candidate: Candidate) -> None:
        """Check that a candidate is what it was when it was tried.

        Raises:
            UserError: another candidate was evaluated under this id.
        """
        if candidate.id not in self.candidates:
            return
        status, content = self.candidates[candidate.id]
        unread = status != "rejected" and candidate.problem is not None
        if unread or content != candidate.content:
            raise UserError(
                f"{candidate.id} reads differently now than when it was tried: the package or a plugin has changed "
                f"since; a new run with vlm=replay vlm.run={self._folder} takes the replies that there are"
            )


def digest_request(request: Request) -> str:
    """Return a hash of a request, with pictures by name: not every engine draws the same pixels twice."""
    said = []
    for message in request.messages:
        for part in message.parts:
            said.append(part.text if isinstance(part, Text) else part.name)

    return digest((said, request.schema, request.temperature))
