"""Ask a model, and pass its replies on as they arrive."""

from __future__ import annotations

import queue
import sys
from collections.abc import Iterator, Sequence

import pluggy

from core.interfaces import VLM, Reply, Request
from core.plugins import describe_part
from core.support.cli import say
from core.support.memory import release_memory
from core.support.text import shorten
from core.support.threads import run_in_thread
from core.values.messages import checked


def ask_model(
    vlm: VLM, requests: Sequence[Request], events: pluggy.PluginManager
) -> Iterator[Reply]:
    """Yield the replies to requests as they arrive.

    A thread of its own receives them and passes each on to the listeners. So a reply is on disk at once, while
    candidates of earlier replies are tried.
    """
    arrived: queue.SimpleQueue[Reply | Exception | None] = queue.SimpleQueue()
    by_id = {request.id: request for request in requests}
    missing = set(by_id)

    def receive() -> None:
        for reply in vlm.complete(requests):
            if not isinstance(reply, Reply) or reply.request_id not in missing:
                wrong = f"{shorten(repr(reply))}, which is no Reply"
                if isinstance(reply, Reply):
                    wrong = f"a reply to {reply.request_id!r}, which was not sent or has its reply already"
                say(
                    f"{describe_part(vlm)}: complete gave {wrong}; it is left out",
                    file=sys.stderr,
                )
                continue

            missing.remove(reply.request_id)
            sound = checked(reply)
            events.hook.reply_received(request=by_id[sound.request_id], reply=sound)
            arrived.put(sound)

    for request in requests:
        events.hook.request_composed(request=request)
    release_memory()  # of pictures that were drawn: a model may take minutes
    run_in_thread(receive, arrived.put, "replies")

    while (reply := arrived.get()) is not None:
        if isinstance(reply, Exception):
            raise reply
        yield reply
