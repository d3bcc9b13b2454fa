"""The limits of language models: no more is paid than allowed."""

import json
from dataclasses import replace

import pytest

from core.errors import LimitReached, UsageError, UserError
from plugins.vlms.litellm.language_model import LanguageModel
from tests.plugins.vlms.asking import PAID, ask, model_at, until_limit
from tests.plugins.vlms.servers import Say, Send, request, serving

FINE = Say('{"fine": true}')  # 1007 tokens

pytestmark = pytest.mark.usefixtures("planted", "warm")


@pytest.mark.parametrize("protocol", PAID)
@pytest.mark.parametrize("limit", [{"max_tokens_total": 2500}, {"max_cost_usd": 0.0}])
def test_no_further_request_is_sent_when_a_limit_is_reached(protocol, limit):
    with serving(lambda call: FINE) as server:
        if "max_cost_usd" in limit:
            price = ask(server, protocol)[0].cost_usd
            server.calls.clear()
            limit = {"max_cost_usd": 2.5 * price}
        vlm = model_at(server, protocol, concurrency=1, **limit)
        replies, said = until_limit(vlm, [request(agent) for agent in range(10)])
        assert [reply.error for reply in replies] == [None] * 3
        assert len(server.calls) == 3
        ((name, value),) = limit.items()
        assert said.startswith(f"vlm.{name}={value:g} is reached: ")
        assert said.endswith("; 7 of 10 requests are left without a reply")
        replies, said = until_limit(vlm, [request(0)])
        assert (replies, len(server.calls)) == ([], 3)
        assert "1 of 1 requests" in said


def test_calls_that_are_under_way_are_completed():
    with serving(lambda call: Say("{}", after_s=0.3)) as server:
        vlm = model_at(server, "openai", concurrency=4, max_tokens_total=1000)
        replies, _ = until_limit(vlm, [request(agent) for agent in range(10)])
    assert 1 <= len(replies) == len(server.calls) <= 4


def test_tokens_that_a_server_does_not_report_are_counted():
    bare = {
        "choices": [
            {
                "message": {"role": "assistant", "content": "word " * 500},
                "finish_reason": "stop",
            }
        ]
    }
    with serving(
        lambda call: Send(
            json.dumps(bare | {"id": "1", "object": "chat.completion", "model": "m"})
        )
    ) as server:
        vlm = model_at(server, "openai", concurrency=1, max_tokens_total=900)
        replies, _ = until_limit(vlm, [request(agent) for agent in range(5)])
        assert len(replies) == 2  # some 500 each, and the prompt
        vlm = model_at(server, "openai", concurrency=1, max_cost_usd=0.006)
        replies, _ = until_limit(vlm, [request(agent) for agent in range(5)])
        assert len(replies) == 2  # some 500 tokens at 8 dollars a million


def completed(vlm, requests):
    """Complete requests as in a run, which reports each reply to the model."""
    for reply in vlm.complete(requests):
        vlm.reply_received(next(r for r in requests if r.id == reply.request_id), reply)
        yield reply


def test_the_cost_before_a_run_was_resumed_counts():
    with serving(lambda call: FINE) as server:
        paid = ask(server, "openai", agents=2)
        nothing = {"prompt_tokens": None, "completion_tokens": None, "cost_usd": None}
        failed = replace(paid[0], text="", error="no answer", **nothing)
        for past, calls in (([paid[0], paid[1]], 1), ([paid[0]], 2), ([failed], 3)):
            vlm = model_at(server, "openai", concurrency=1, max_tokens_total=2500)
            for reply in past:
                vlm.reply_received(request(9), reply)
            server.calls.clear()
            with pytest.raises(LimitReached):
                list(completed(vlm, [request(agent) for agent in range(6)]))
            assert len(server.calls) == calls


@pytest.mark.parametrize(
    "model", ["openai/my-own", "hosted_vllm/m", "ollama_chat/qwen3-vl:8b"]
)
def test_a_limit_of_cost_needs_a_price(model):
    with serving(lambda call: FINE) as server:
        with pytest.raises(
            UserError,
            match=r"vlm\.max_cost_usd can't be applied: .* no price for .*max_tokens_total",
        ):
            LanguageModel(model, server.url + "/v1", max_cost_usd=5.0)
        LanguageModel(model, server.url + "/v1", max_tokens_total=5)
    assert not server.calls


@pytest.mark.parametrize(
    "settings",
    [{"max_cost_usd": 0.0}, {"max_tokens_total": 0}, {"max_cost_usd": float("nan")}],
)
def test_invalid_limits(settings):
    with pytest.raises(
        UsageError, match=rf"vlm\.{next(iter(settings))} must be greater than 0"
    ):
        LanguageModel("openai/gpt-4.1", **settings)
