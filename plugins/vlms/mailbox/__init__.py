"""A mailbox folder: a person, or a model behind a chat window, answers the requests."""

from core.hooks import Factories, hookimpl


@hookimpl
def vlms() -> Factories:
    return {"mailbox": "plugins.vlms.mailbox.model:Mailbox"}
