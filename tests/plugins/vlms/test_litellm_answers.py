"""Where answers stand: the text is taken from there, and no answer that was paid for is asked for again."""

import json
import os

import pytest

from plugins.vlms.litellm.language_model import LanguageModel
from tests.plugins.vlms.asking import ask
from tests.plugins.vlms.servers import Say, Send, request, serving

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("planted")]
TEXT = '{"strategies": [1]}'
CALL = {
    "id": "1",
    "type": "function",
    "function": {"name": "answer", "arguments": TEXT},
}
THOUGHT = {"type": "thinking", "thinking": [{"type": "text", "text": "a hook"}]}
WHERE = {
    "content": {"content": TEXT},
    "parts": {"content": [THOUGHT, {"type": "text", "text": TEXT}]},
    "two parts": {
        "content": [
            {"type": "text", "text": TEXT[:5]},
            {"type": "text", "text": TEXT[5:]},
        ]
    },
    "reasoning_content": {"content": None, "reasoning_content": TEXT},
    "reasoning": {"content": "", "reasoning": f"So: {TEXT}"},
    "tool call": {"content": None, "tool_calls": [CALL]},
    "function call": {"content": None, "function_call": CALL["function"]},
}


def chat(message, finish="stop", **more):
    choice = {"index": 0, "finish_reason": finish, "message": message}
    usage = {"prompt_tokens": 1000, "completion_tokens": 7, "total_tokens": 1007}
    document = {"id": "1", "object": "chat.completion", "created": 1, "model": "m"}
    return Send(json.dumps({**document, "choices": [choice], "usage": usage, **more}))


def complete(act, model="openai/gpt-4.1", **settings):
    """Send one request to a server that answers it with ``act``; return the reply, and how many calls came."""
    with serving(lambda call: act) as server:
        vlm = LanguageModel(model, server.url + "/v1", **settings)
        (reply,) = vlm.complete([request(0)])
        return reply, len(server.calls)


@pytest.mark.parametrize("model", ["openai/gpt-4.1", "hosted_vllm/m"])
@pytest.mark.parametrize("where", WHERE)
def test_the_text_is_taken_from_where_it_stands(where, model):
    message = {"role": "assistant", **WHERE[where]}
    finish = "tool_calls" if "call" in where else "stop"
    reply, calls = complete(chat(message, finish), model)
    assert reply.error is None
    assert TEXT in reply.text
    assert (reply.prompt_tokens, reply.completion_tokens) == (1000, 7)
    assert calls == 1


def test_a_refusal_is_quoted():
    words = "I can't help with tools that strike things."
    message = {"role": "assistant", "content": None, "refusal": words}
    reply, calls = complete(chat(message))
    assert reply.error == f"the model refuses: {words}"
    assert (reply.prompt_tokens, calls) == (1000, 1)


def test_an_error_in_an_answer_of_status_200_keeps_the_providers_words():
    error = {"code": 429, "message": "Provider returned error: too many designs"}
    reply, calls = complete(Send(json.dumps({"error": error})))
    assert "too many designs" in reply.error
    assert reply.unanswered
    assert calls == 5

    error = {"code": 402, "message": "no credits left"}
    broken = {"index": 0, "finish_reason": "error", "error": error}
    message = {"role": "assistant", "content": ""}
    body = json.dumps({"choices": [{**broken, "message": message}]})
    reply, calls = complete(Send(body))
    assert "no credits left" in reply.error
    assert calls == 1


def test_a_key_is_known_by_its_variable(monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", "EMPTY")
    monkeypatch.setenv("HOSTED_VLLM_API_KEY", "EMPTY")
    reply, _ = complete(chat({"role": "assistant", "content": TEXT}), "hosted_vllm/m")
    assert reply.text == TEXT

    # A short key is no part of another header.
    monkeypatch.setenv("OPENAI_API_KEY", "x")
    reply, _ = complete(chat({"role": "assistant", "content": TEXT}), "hosted_vllm/m")
    assert reply.text == TEXT
    assert os.environ["HOSTED_VLLM_API_KEY"] == "EMPTY"


def test_other_protocols_are_read_as_before():
    with serving(lambda call: Say(TEXT)) as server:
        for protocol in ("google", "anthropic", "ollama"):
            assert ask(server, protocol)[0].text == TEXT
