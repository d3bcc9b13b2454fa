"""Ask a model, and pass its replies on as they arrive."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from types import MappingProxyType

import pluggy

from core.errors import RAISED, UserError, fault, in_line
from core.interfaces import VLM, Reply, Request
from core.plugins import describe_part
from core.support.cli import say
from core.support.memory import release_memory
from core.support.text import shorten
from core.support.threads import merge
from core.values.messages import checked


def ask_model(
    vlm: VLM,
    requests: Sequence[Request],
    events: pluggy.PluginManager,
    stored: Mapping[str, Reply] = MappingProxyType({}),
) -> Iterator[Reply]:
    """Yield the replies to requests as they arrive; those that are ``stored``, by request id, are not asked for again.

    A thread of its own receives them and passes each on to the listeners. So a reply is on disk at once, while
    candidates of earlier replies are tried.

    A model that raises what it may not costs the replies that are missing, and a line names its plugin.
    """
    missing = {request.id: request for request in requests}

    def receive() -> Iterator[Reply]:
        given = [stored[request] for request in missing if request in stored]
        asked = [request for request in requests if request.id not in stored]
        answers = _complete(vlm, asked, missing) if asked else ()
        for reply in chain(given, answers):
            if not isinstance(reply, Reply) or reply.request_id not in missing:
                wrong = (
                    f"{shorten(repr(reply))}, which is no Reply to a request that waits"
                )
                say(
                    f"{describe_part(vlm)}: complete gave {wrong}; it is left out",
                    file=sys.stderr,
                )
                continue

            sound = checked(reply)
            request = missing.pop(sound.request_id)
            events.hook.reply_received(request=request, reply=sound)
            yield sound

    for request in requests:
        events.hook.request_composed(request=request)
    release_memory()  # of pictures that were drawn: a model may take minutes
    yield from merge({"replies": receive})


def _complete(
    vlm: VLM, asked: Sequence[Request], missing: Mapping[str, Request]
) -> Iterator[Reply]:
    """Yield a model's replies; those that are missing when it raises what it may not have an error."""
    try:
        yield from vlm.complete(asked)
    except RAISED as error:
        if isinstance(error, UserError) or fault(error) is not None:
            raise

        why = f"{describe_part(vlm)}: complete raised {in_line(error)}"
        left = [*missing]
        say(f"{why}; {len(left)} requests have no reply", file=sys.stderr)
        for name in left:
            yield Reply(name, "", vlm.model, error=why, unanswered=True)
