"""Checks that every model must pass. Each takes a model and raises an AssertionError that says what is wrong.

They send three small requests, which cost money where a model does. A reply may be an error; its content is not
checked.
"""

from __future__ import annotations

from dataclasses import replace

from core.interfaces import VLM, Estimate, Message, Picture, Reply, Request
from plugins.conformance.sample_tools import LengthOnly
from plugins.conformance.shared import between, brief, expect_a, request, some_task


def _request(agent: int = 0) -> Request:
    return request(brief(some_task(), LengthOnly(), agent=agent))


def check_it_has_a_name(vlm: VLM) -> None:
    what = f"model is {vlm.model!r}; a name for people is needed"
    assert isinstance(vlm.model, str), what
    assert vlm.model.strip(), what


def check_each_request_has_its_reply(vlm: VLM) -> None:
    """The requests are of two agents."""
    sent = [_request(0), _request(1)]
    replies = list(vlm.complete(sent))
    for reply in replies:
        expect_a(Reply, reply, "complete returned")
        for count in (reply.prompt_tokens, reply.completion_tokens, reply.cost_usd):
            between("what a reply counts, tokens or dollars", count or 0, 0)
    ids = ", ".join(sorted(reply.request_id for reply in replies))
    wanted = ", ".join(request.id for request in sent)
    assert ids == wanted, f"the requests {wanted} had replies to {ids or 'none'}"


def check_a_request_that_it_cannot_serve_has_its_reply_too(vlm: VLM) -> None:
    """A picture that is none: the reply may be an error, but nothing is raised."""
    sent = _request()
    broken = Message("user", (*sent.messages[-1].parts, Picture(b"no picture")))
    replies = list(vlm.complete([replace(sent, messages=(broken,))]))
    assert len(replies) == 1, f"a request had {len(replies)} replies"


def check_a_request_has_an_estimate(vlm: VLM) -> None:
    estimate = vlm.estimate(_request(), vlm.model)
    expect_a(Estimate, estimate, "estimate returned")
    between("how many tokens a request is estimated to take", estimate.prompt_tokens, 1)
