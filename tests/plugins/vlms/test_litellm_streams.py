"""Streams of each protocol as its provider writes them: whole, cut off, and without a count of tokens."""

import json

import pytest

from plugins.vlms.litellm.language_model import LanguageModel
from tests.plugins.vlms.asking import PROTOCOLS, ask, in_turn, until_limit
from tests.plugins.vlms.servers import Say, Send, request, serving

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("planted", "warm")]

DESIGN = {"strategy_name": "poke", "gripper": False, "tool_urdf": "<link/>"}
TEXT = json.dumps({"strategies": [DESIGN | {"action_sets": [[[0, 0, 0, 0, 0, 0]]]}]})
PIECES = [TEXT[:20], TEXT[20:50], TEXT[50:]]
TOKENS = (1000, 7)


def events(documents, last=()):
    """Write documents as server-sent events; those with a type are named by it."""
    lines = []
    for document in documents:
        if "type" in document:
            lines.append(f"event: {document['type']}\n")
        lines.append(f"data: {json.dumps(document)}\n\n")

    return "".join([*lines, *last])


def openai(pieces, *, usage=True):
    head = {"id": "1", "object": "chat.completion.chunk", "created": 1, "model": "m"}
    choices = [{"index": 0, "delta": {"content": piece}} for piece in pieces]
    choices[0]["delta"]["role"] = "assistant"
    choices.append({"index": 0, "delta": {}, "finish_reason": "stop"})
    documents = [head | {"choices": [choice]} for choice in choices]
    if usage:
        counts = {"prompt_tokens": 1000, "completion_tokens": 7, "total_tokens": 1007}
        documents.append(head | {"choices": [], "usage": counts})

    return Send(events(documents, ["data: [DONE]\n\n"]), type="text/event-stream")


def anthropic(pieces):
    usage = {"input_tokens": 1000, "output_tokens": 1}
    message = {"id": "1", "type": "message", "role": "assistant", "content": []}
    message |= {"model": "claude-sonnet-4-6", "stop_reason": None, "usage": usage}
    block = {"type": "text", "text": ""}
    documents = [
        {"type": "message_start", "message": message},
        {"type": "content_block_start", "index": 0, "content_block": block},
        {"type": "ping"},
    ]
    for piece in pieces:
        delta = {"type": "text_delta", "text": piece}
        documents.append({"type": "content_block_delta", "index": 0, "delta": delta})

    documents.append({"type": "content_block_stop", "index": 0})
    end = {"delta": {"stop_reason": "end_turn"}, "usage": {"output_tokens": 7}}
    documents += [{"type": "message_delta", **end}, {"type": "message_stop"}]

    return Send(events(documents), type="text/event-stream")


def google(pieces):
    documents = []
    for number, piece in enumerate(pieces, 1):
        candidate = {"content": {"role": "model", "parts": [{"text": piece}]}}
        candidate["index"] = 0
        if number == len(pieces):
            candidate["finishReason"] = "STOP"

        usage = {"promptTokenCount": 1000, "candidatesTokenCount": 7}
        usage["totalTokenCount"] = 1007
        documents.append({"candidates": [candidate], "usageMetadata": usage})

    return Send(events(documents), type="text/event-stream")


def ollama(pieces):
    documents = []
    for piece in pieces:
        message = {"role": "assistant", "content": piece}
        documents.append({"model": "m", "message": message, "done": False})

    end = {"model": "m", "message": {"role": "assistant", "content": ""}, "done": True}
    counts = {"prompt_eval_count": 1000, "eval_count": 7}
    documents.append({**end, "done_reason": "stop", **counts})
    lines = [f"{json.dumps(document)}\n" for document in documents]

    return Send("".join(lines), type="application/x-ndjson")


STREAMS = {
    "openai": openai,
    "anthropic": anthropic,
    "google": google,
    "ollama": ollama,
}


@pytest.mark.parametrize("protocol", STREAMS)
def test_a_stream_as_the_provider_writes_it_is_read_with_its_tokens(protocol):
    with serving(lambda call: STREAMS[protocol](PIECES)) as server:
        reply = ask(server, protocol)[0]

    assert (reply.error, reply.text) == (None, TEXT)
    assert (reply.prompt_tokens, reply.completion_tokens) == TOKENS
    assert len(server.calls) == 1


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_stream_is_asked_for(protocol):
    with serving(lambda call: Say("{}")) as server:
        ask(server, protocol)

    (call,) = server.calls
    is_named = "streamGenerateContent" in call.path  # Google's way to say it
    assert is_named or call.body["stream"] is True


SECOND = json.dumps(DESIGN | {"action_sets": [[[1, 0, 0, 0, 0, 0]]]})
BEGUN = TEXT.removesuffix("]}") + ", " + SECOND[:60]  # a design, and half of another


def cut(act, text):
    """Leave out what comes after a text, and say that more is to come."""
    body = act.body.partition("THE END")[0]
    assert text in body.replace('\\"', '"')
    return Send(body, type=act.type, missing=500)


@pytest.mark.parametrize("protocol", ["openai", "anthropic", "google", "ollama"])
def test_a_stream_that_cut_by_off_keeps_what_came(protocol, caplog):
    whole = STREAMS[protocol]([BEGUN[:100], BEGUN[100:], "THE END"])
    with serving(lambda call: cut(whole, BEGUN[100:])) as server:
        reply = ask(server, protocol)[0]

    assert (reply.error, reply.text) == (None, BEGUN)
    assert len(server.calls) == 1
    assert f"broke off after {len(BEGUN)} characters, which are kept" in caplog.text


def test_a_stream_that_cut_by_off_before_its_first_design_is_asked_for_again():
    act = openai([TEXT[:30], "THE END"])
    script = in_turn(cut(act, TEXT[:30]), openai(PIECES))
    with serving(script) as server:
        reply = ask(server, "openai")[0]

    assert (reply.error, reply.text) == (None, TEXT)
    assert len(server.calls) == 2


def test_tokens_of_a_stream_that_names_none_are_counted_towards_a_limit():
    words = json.dumps({"words": "word " * 500})
    with serving(lambda call: openai([words], usage=False)) as server:
        model = "openai/gpt-4.1"
        address = server.url + "/v1"
        vlm = LanguageModel(model, address, concurrency=1, max_tokens_total=1000)
        replies, _ = until_limit(vlm, [request(agent) for agent in range(5)])

    assert len(replies) == 2  # some 500 each, and the prompt
    for reply in replies:
        assert 480 < reply.completion_tokens < 540
        assert reply.prompt_tokens > 50
