"""The embedded designer: requests in, JSON replies out."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from core.config.schemas import PARTS, PromptSettings, Sampling
from core.design import DesignError
from core.hooks import hookimpl
from core.interfaces import VLM, Brief, Reply, Request
from core.support.cli import say
from core.support.text import hydra_word
from plugins.vlms.offline.answer import answer
from plugins.vlms.offline.options import KINDS, find_unplanned
from plugins.vlms.offline.search import NothingSuits
from plugins.vlms.offline.wants import list_unheeded

if TYPE_CHECKING:
    from core.events import Run

USUAL = "vlmgineer"
"""The prompt that is chosen without a word."""


class OfflineDesigner(VLM):
    """Designs tools and plans by classical means, from the scene's geometry and the task's goals.

    It uses no language model: it reads a request's brief, not its messages, and returns the document that a model is
    asked for. The same brief gets the same answer.
    """

    model = "offline (embedded designer, no language model)"
    criticises = False
    sees = False

    def __init__(self) -> None:
        self._takes_either = False  # tools on the flange or on the fingers

    @hookimpl(trylast=True)
    def run_started(self, run: Run) -> None:
        """Say which settings change nothing, and what designs pay no regard to; note the kinds of tools."""
        chosen = run.config.get("task", {}).get("tool_kinds")
        kinds = chosen or run.task.tool_kinds or KINDS
        self._takes_either = len({*kinds}) > 1

        unread = _list_unread(run)
        if unread:
            words = " ".join(unread)
            _warn(f"reads no prompt, so these change nothing: {words}")

        unplanned = []
        unheeded = []
        for task in run.task.parts:
            prefix = f"{task.name}: " if task is not run.task else ""
            is_made = run.representation.given(task) is None
            goals = find_unplanned(
                task,
                run.seed,
                run.representation.material,
                kinds if is_made else KINDS,
            )
            limits = list_unheeded(task, task.scene(run.seed))
            unplanned += [prefix + goal for goal in goals]
            unheeded += [prefix + limit for limit in limits]

        if unplanned:
            words = "; ".join(unplanned)
            _warn(f"does not plan for: {words}; ask a model, or an agent")
        if unheeded:
            words = "; ".join(unheeded)
            _warn(f"pays no regard to these limits, only rewards do: {words}")

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        """See `VLM.complete`. A brief that can't be answered gets a reply with the reason."""
        for request in requests:
            try:
                document = self._answer(request.brief)
            except (NothingSuits, DesignError) as error:
                yield Reply(request.id, "", self.model, error=str(error))
                continue

            text = json.dumps(document, indent=1)
            yield Reply(request.id, text, self.model)

    def _answer(self, brief: Brief) -> dict[str, Any]:
        """Make the document for a brief; where no way suits its kind of tool, of the other kind if the run allows it.

        Raises:
            NothingSuits: no way of using a tool suits the task.
            DesignError: plans can't be written as the brief asks.
        """
        try:
            return answer(brief)
        except NothingSuits:
            is_given = brief.representation.given(brief.task) is not None
            if is_given or not self._takes_either:
                raise

        return answer(replace(brief, gripper=not brief.gripper))


def _warn(text: str) -> None:
    """Say what the designer does not do."""
    say(f"the embedded designer {text}", file=sys.stderr)


def _list_unread(run: Run) -> list[str]:
    """List the settings of prompts that are not as usual, as they are typed: of a run that sends none."""
    usual = {"prompt": PromptSettings(name=""), "sampling": Sampling()}
    chosen = run.config.get("prompt", {}).get("name")
    unread = []

    for group, defaults in usual.items():
        for key, value in run.config.get(group, {}).items():
            if key not in ("name", *PARTS) and value != getattr(defaults, key):
                unread.append(f"{group}.{key}={hydra_word(value)}")

    if chosen not in (None, USUAL):
        unread.insert(0, f"prompt={chosen}")

    return unread
