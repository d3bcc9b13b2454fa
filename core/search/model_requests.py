"""Ask a model, and pass its replies on as they arrive."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from types import MappingProxyType

import pluggy

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
    """
    missing = {request.id: request for request in requests}

    def receive() -> Iterator[Reply]:
        given = [stored[request] for request in missing if request in stored]
        asked = [request for request in requests if request.id not in stored]
        answers = vlm.complete(asked) if asked else ()
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
