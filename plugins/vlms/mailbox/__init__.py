"""Requests that a person answers, or a model behind a chat window."""

from core.hooks import Factories, hookimpl


@hookimpl
def vlms() -> Factories:
    return {"mailbox": "plugins.vlms.mailbox.model:Mailbox"}
