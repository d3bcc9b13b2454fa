"""Checks that every model must pass. Each takes a model and raises an AssertionError that says what is wrong.

They send three small requests, which cost money where a model does. A reply may be an error; its content is not
checked.
"""

from __future__ import annotations

from dataclasses import replace

from core.interfaces import VLM, Estimate, Message, Picture, Reply, Request
from plugins.conformance.shared import (
    LengthOnly,
    between,
    brief,
    expect,
    expect_a,
    request,
    some_task,
)


def requests() -> list[Request]:
    """Requests of two agents."""
    task = some_task()
    return [request(brief(task, LengthOnly(), agent=agent)) for agent in (0, 1)]


def check_it_has_a_name(vlm: VLM) -> None:
    expect(
        isinstance(vlm.model, str) and vlm.model.strip(),
        f"model is {vlm.model!r}; a name for people is needed",
    )


def check_each_request_has_its_reply(vlm: VLM) -> None:
    sent = requests()
    replies = list(vlm.complete(sent))
    for reply in replies:
        expect_a(Reply, reply, "complete returned")
        for count in (reply.prompt_tokens, reply.completion_tokens, reply.cost_usd):
            between("what a reply counts, tokens or dollars", count or 0, 0)
    ids = ", ".join(sorted(reply.request_id for reply in replies))
    wanted = ", ".join(request.id for request in sent)
    expect(ids == wanted, f"the requests {wanted} had replies to {ids or 'none'}")


def check_a_request_that_it_cannot_serve_has_its_reply_too(vlm: VLM) -> None:
    """A picture that is none: the reply may be an error, but nothing is raised."""
    sent = requests()[0]
    broken = Message("user", (*sent.messages[-1].parts, Picture(b"no picture")))
    replies = list(vlm.complete([replace(sent, messages=(broken,))]))
    expect(len(replies) == 1, f"a request had {len(replies)} replies")


def check_a_request_has_an_estimate(vlm: VLM) -> None:
    estimate = vlm.estimate(requests()[0], vlm.model)
    expect_a(Estimate, estimate, "estimate returned")
    between("how many tokens a request is estimated to take", estimate.prompt_tokens, 1)
