"""Hold what an interrupted run has stored, so that nothing is asked or tried twice."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from core.design import Candidate
from core.errors import UserError
from core.interfaces import Reply, Request, Text
from core.store.reader import StoredRun
from core.store.rows import StoredEvaluation, StoredRequest
from core.trial import Trial, TrialKey
from core.values.contents import digest


class StoredProgress:
    """The stored requests, replies, evaluations and trials of a run, as they were when it was opened.

    Attributes:
        again: ids of requests that got no answer, for a reason that may pass, and that nothing stored builds on; of
            each the generation and the agent.
        requests: digests by request id.
        replies: replies by request id, without those to ask for again.
        designs: the keys of the stored designs.
        candidates: status and content of the evaluated candidates, by their ids.
        generations: how many there are up to the last one of which a candidate was evaluated.
        trials: by content and condition.
        numbers: of the rows of the trials.
    """

    def __init__(self, folder: Path, stored: StoredRun) -> None:
        self._folder = folder
        requests = stored.requests()
        rows = stored.trials()
        evaluations = stored.evaluations(rows)
        self.again = _find_again(requests, evaluations)
        self.requests = {request.id: request.digest for request in requests}
        self.replies: dict[str, Reply] = {}
        for request in requests:
            if request.reply is not None and request.id not in self.again:
                self.replies[request.id] = request.reply

        agents = set(self.again.values())
        self.designs = set(stored.designs())
        self.candidates = {
            evaluation.candidate: (evaluation.status, evaluation.content)
            for evaluation in evaluations
            if evaluation.status != "rejected"
            or evaluation.design_key[:2] not in agents
        }

        tried = [evaluation.generation for evaluation in evaluations]
        self.generations = max(tried, default=-1) + 1

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


def _find_again(
    requests: Sequence[StoredRequest], evaluations: Sequence[StoredEvaluation]
) -> dict[str, tuple[int, int]]:
    """Find the requests to ask again, with their generation and agent.

    Replies and rollouts of later generations build on a failure as on a result: it stays then. So does a critique: the
    generation's other requests were composed without it. A second look that a limit kept from being sent is sent.
    """
    answered = [
        request.generation
        for request in requests
        if request.reply is not None and not request.reply.unanswered
    ]
    tried = [
        evaluation.generation
        for evaluation in evaluations
        if evaluation.status != "rejected"
    ]
    latest = max([0, *answered, *tried])

    again = {}
    for request in requests:
        reply = request.reply
        unsent = reply is None and request.purpose == "repairs"
        lacks = unsent or (reply is not None and reply.unanswered)
        if lacks and request.asks_designs and request.generation >= latest:
            again[request.id] = (request.generation, request.agent)

    return again


def digest_request(request: Request) -> str:
    """Return a hash of a request, with pictures by name: not every engine draws the same pixels twice."""
    said = []
    for message in request.messages:
        for part in message.parts:
            said.append(part.text if isinstance(part, Text) else part.name)

    return digest((said, request.schema, request.temperature))
