"""The embedded designer: requests in, JSON replies out."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from core.design import DesignError
from core.hooks import hookimpl
from core.interfaces import VLM, Reply, Request
from core.support.cli import say
from plugins.vlms.offline.answer import answer
from plugins.vlms.offline.scene_analysis import NothingToMove
from plugins.vlms.offline.unplanned import find_unplanned

if TYPE_CHECKING:
    from core.events import Run


class OfflineDesigner(VLM):
    """Designs tools and plans by classical means, from the scene's geometry and the task's goals.

    It uses no language model: it reads a request's brief, not its messages, and returns the document that a model is
    asked for. The same brief gets the same answer.
    """

    model = "offline (embedded designer, no language model)"
    criticises = False
    sees = False

    @hookimpl(trylast=True)
    def run_started(self, run: Run) -> None:
        """Say what of the goals no plan is made for."""
        parts = run.task.parts
        unplanned = []
        for task in parts:
            prefix = f"{task.name}: " if len(parts) > 1 else ""
            for what in find_unplanned(task, run.seed):
                unplanned.append(prefix + what)

        if unplanned:
            words = "; ".join(unplanned)
            say(f"the embedded designer does not plan for: {words}", file=sys.stderr)

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        """See `VLM.complete`. A brief that can't be answered gets a reply with the reason."""
        for request in requests:
            try:
                document = answer(request.brief)
            except (NothingToMove, DesignError) as error:
                yield Reply(request.id, "", self.model, error=str(error))
                continue
            text = json.dumps(document, indent=1)
            yield Reply(request.id, text, self.model)
