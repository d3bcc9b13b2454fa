"""Replay past replies, to try the same designs in another simulator or with other settings, at no cost."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

from core.errors import UsageError, UserError
from core.hooks import Names
from core.interfaces import VLM, Reply, Request
from core.support.files import read_text


class PastReplies(VLM):
    """Answers each request with the past run's reply to the request of the same generation and agent.

    Another simulator may choose other elites. The replies of later generations still refer to the past run's elites,
    and their designs are tried all the same. A file holds the answer to each request, whatever was asked.

    Args:
        run: the past run's folder, or a file with the text of an answer.

    Raises:
        UserError: it holds no run, or can't be read.
    """

    def __init__(self, run: Annotated[str, Names("file")] = "") -> None:
        from core.store.reader import StoredRun  # imports what only runs need

        if not run:
            raise UsageError(
                "vlm.run is empty; give the folder of a past run, such as vlm.run=runs/BringCube/..., or a file "
                "with an answer, such as vlm.run=answer.md"
            )

        self._replies = dict[str, Reply]()
        self._answer: str | None = None
        try:
            if Path(run).is_file():
                self._answer = read_text(Path(run))
                self.model = f"replay of {run}"
                return

            answers = StoredRun(Path(run)).answers()
        except UserError as error:
            raise UserError(f"vlm.run: {error}") from error

        self._replies = {
            request.id: Reply(request.id, reply.text, reply.model, reply.error)
            for request, reply in answers
        }
        self.repairs = any(request.purpose == "repairs" for request, _ in answers)
        models = sorted({reply.model for reply in self._replies.values()})
        self.model = f"replay of {', '.join(models) or 'nothing'} from {run}"

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        for request in requests:
            if self._answer is not None:
                yield Reply(request.id, self._answer, self.model)
                continue

            missing = Reply(
                request.id,
                "",
                self.model,
                error="the past run has no reply to this request",
            )
            yield self._replies.get(request.id, missing)
