"""What any model must satisfy: each check takes one and raises an AssertionError that says what is wrong.

The checks ask it three small questions; a model behind an API takes money for that. Whether it answers well is not
among them: an answer may be an error.
"""

from __future__ import annotations

from core.conformance.checking import LengthOnly, brief, expect, request, some_task
from core.interfaces import VLM, Estimate, Reply, Request


def questions() -> list[Request]:
    """Two, of two agents."""
    task = some_task()
    return [request(brief(task, LengthOnly(), agent=agent)) for agent in (0, 1)]


def check_it_has_a_name(vlm: VLM) -> None:
    expect(isinstance(vlm.model, str) and vlm.model.strip(), f"model is {vlm.model!r}; people are shown it")


def check_each_request_has_its_reply(vlm: VLM) -> None:
    asked = questions()
    replies = list(vlm.complete(asked))
    for reply in replies:
        expect(isinstance(reply, Reply), f"complete gave a {type(reply).__name__}, not a Reply")
        expect(isinstance(reply.text, str), f"a reply's text is a {type(reply.text).__name__}")
        expect(reply.error is None or reply.error.strip(), "a reply's error says nothing")
        for count in (reply.prompt_tokens, reply.completion_tokens, reply.cost_usd):
            expect(count is None or count >= 0, f"a reply counts {count} tokens or dollars")
    ids, wanted = sorted(reply.request_id for reply in replies), [one.id for one in asked]
    expect(ids == wanted, f"the requests {', '.join(wanted)} had replies to {', '.join(ids) or 'none'}")


def check_no_requests_have_no_replies(vlm: VLM) -> None:
    expect(list(vlm.complete([])) == [], "replies came where nothing was asked")


def check_an_estimate_asks_nobody(vlm: VLM) -> None:
    estimate = vlm.estimate(questions()[0], vlm.model)
    expect(isinstance(estimate, Estimate), f"estimate gave a {type(estimate).__name__}, not an Estimate")
    expect(estimate.prompt_tokens > 0, f"a request is reckoned to take {estimate.prompt_tokens} tokens")


CHECKS = (
    check_it_has_a_name,
    check_each_request_has_its_reply,
    check_no_requests_have_no_replies,
    check_an_estimate_asks_nobody,
)
