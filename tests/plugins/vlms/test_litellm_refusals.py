"""What a server refuses by name is said in a weaker way, once for the run; other refusals are not repeated."""

import json

import pytest

from core.interfaces import Message, Text
from plugins.vlms.litellm.language_model import LanguageModel
from tests.plugins.vlms.asking import ask, in_turn
from tests.plugins.vlms.servers import Say, Send, request, serving
from tests.support.model_runs import refused

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("planted", "warm")]

SHARED = "# Rules\nNo glue.\n\n"
NEWS = "# What is wanted\n\nA hook.\n"


def ask_twice(script, model="openai/my-own", **settings):
    """Send two requests, one after the other; return the replies, and the bodies of all calls."""
    with serving(script) as server:
        vlm = LanguageModel(model, server.url + "/v1", concurrency=1, **settings)
        replies = list(vlm.complete([request(0), request(1)]))
        return replies, [call.body for call in server.calls]


# As llama-cpp-python says it, with a status that is otherwise repeated.
UNKNOWN_FORM = (
    "[{'type': 'literal_error', 'loc': ('body', 'response_format', 'type'), "
    "'msg': \"Input should be 'text' or 'json_object'\", 'input': 'json_schema'}]"
)


@pytest.mark.parametrize("status", [400, 422, 500])
def test_a_schema_becomes_json_and_then_text(status, caplog):
    def script(call):
        form = call.body.get("response_format", {}).get("type")
        if form == "json_schema":
            return refused(UNKNOWN_FORM, status)
        if form == "json_object":
            return refused("response_format is not supported", status)
        return Say("{}")

    replies, bodies = ask_twice(script)
    assert [reply.error for reply in replies] == [None, None]
    forms = [body.get("response_format", {}).get("type") for body in bodies]
    assert forms == ["json_schema", "json_object", None, None]
    assert "JSON schema of the answer" in json.dumps(bodies[-1])
    assert len(caplog.records) == 2
    assert "Input should be" in caplog.records[0].message


@pytest.mark.parametrize(
    ("words", "name", "settings"),
    [
        ("seed: Extra inputs are not permitted", "seed", {}),
        ("'temperature' does not support 0.7 with this model", "temperature", {}),
        ("unknown field stream_options", "stream_options", {}),
        (
            "Unsupported parameter: reasoning_effort",
            "reasoning_effort",
            {"thinking": "low"},
        ),
        (
            "Unsupported parameter: 'max_tokens'. Use 'max_completion_tokens' instead.",
            "max_tokens",
            {"max_output_tokens": 99},
        ),
    ],
)
def test_a_parameter_that_is_refused_is_left_out(words, name, settings, caplog):
    def script(call):
        return refused(words) if name in call.body else Say("{}")

    replies, bodies = ask_twice(script, **settings)
    assert [reply.error for reply in replies] == [None, None]
    assert [name in body for body in bodies] == [True, False, False]
    assert len(caplog.records) == 1
    if name == "max_tokens":
        assert bodies[-1]["max_completion_tokens"] == 99


def test_a_model_without_eyes_gets_a_line_in_the_place_of_pictures(caplog):
    def script(call):
        if call.pictures:
            return refused("image input is not supported - hint: mmproj", 500)
        return Say("{}")

    replies, bodies = ask_twice(script)
    assert [reply.error for reply in replies] == [None, None]
    assert len(bodies) == 3
    assert "`scene`, that you are not shown" in json.dumps(bodies[-1])
    assert "no pictures" in caplog.text


def test_a_model_that_litellm_knows_to_be_blind_is_no_model_that_sees(
    monkeypatch, caplog
):
    monkeypatch.setenv("DEEPSEEK_API_KEY", "planted-0123456789")
    assert not LanguageModel("deepseek/deepseek-chat").sees
    assert "no pictures" in caplog.text


def test_other_refusals_are_quoted_and_not_repeated():
    with serving(
        in_turn(refused("validation error: messages must be a list", 500))
    ) as server:
        reply = ask(server, "openai")[0]
    assert "messages must be a list" in reply.error
    assert len(server.calls) == 1


@pytest.mark.parametrize(
    "words",
    [
        # LiteLLM's own proxy; "vision" is of the name, and refuses no picture.
        "/chat/completions: Invalid model name passed in model=my-vision. "
        "Call `/v1/models` to view available models for your key.",
        "my-vision is not a valid model ID",  # OpenRouter
    ],
)
def test_a_model_that_a_gateway_does_not_have_is_asked_for_again_on_resume(words):
    with serving(in_turn(refused(words))) as server:
        reply = ask(server, "openai")[0]
    assert words in reply.error
    assert reply.unanswered
    assert len(server.calls) == 1


def test_failures_of_a_gateway_are_told_apart():
    """In the words of LiteLLM's own proxy."""
    tail = "LiteLLM: model group 'm' failed with the error above. No fallback was attempted."
    limited = refused(f"litellm.RateLimitError: too many\n\n{tail}", 429)
    narrow = refused(
        "litellm.ContextWindowExceededError: litellm.BadRequestError: too much\nmodel=m. "
        f"context_window_fallbacks=None. fallbacks=None.\n\n{tail}"
    )
    with serving(in_turn(limited, limited, narrow)) as server:
        reply = ask(server, "openai")[0]
    assert "too long: some" in reply.error
    assert reply.unanswered
    assert len(server.calls) == 3


@pytest.mark.parametrize(
    ("words", "asked", "room"),
    [
        (
            "This model's maximum context length is 2048 tokens. However, you requested 5000 tokens "
            "(4692 in the messages, 308 in the completion).",
            "5000",
            "2048",
        ),
        ("Requested tokens (4692) exceed context window of 2048", "4692", "2048"),
        (
            "request (4692 tokens) exceeds the available context size (2048 tokens), try increasing it",
            "4692",
            "2048",
        ),
        ("prompt is too long: 205000 tokens > 200000 maximum", "205000", "200000"),
        (
            "The input token count (1200000) exceeds the maximum number of tokens allowed (1048576).",
            "1200000",
            "1048576",
        ),
        (
            "The input (4692 tokens) is longer than the model's context length (2048 tokens).",
            "4692",
            "2048",
        ),
    ],
)
def test_a_context_that_is_too_small_is_named_with_both_numbers(words, asked, room):
    with serving(in_turn(refused(words))) as server:
        reply = ask(server, "openai")[0]
    assert f"too long: {asked} tokens, and the server holds {room};" in reply.error
    assert "prompt.context=words" in reply.error
    assert reply.unanswered
    assert len(server.calls) == 1


@pytest.mark.parametrize("missing", [0, 100])
@pytest.mark.parametrize("body", ["", ": ping - 12:00:00\r\n\r\n"])
def test_an_empty_stream_is_asked_for_whole_which_says_why(body, missing):
    """As llama-cpp-python answers where the prompt is longer than its context, after pings if it is slow."""
    empty = Send(body, type="text/event-stream", missing=missing)
    words = "Requested tokens (4692) exceed context window of 1024"
    with serving(
        lambda call: empty if call.body.get("stream") else refused(words)
    ) as server:
        reply = ask(server, "openai")[0]
    assert "4692 tokens, and the server holds 1024" in reply.error
    assert len(server.calls) == 2


def test_an_address_without_its_last_part_gets_a_hint():
    lost = Send('{"error": "Unexpected endpoint or method. (POST /chat/completions)"}')
    with serving(in_turn(lost)) as server:
        vlm = LanguageModel("openai/my-own", server.url)
        (reply,) = vlm.complete([request(0)])
    assert "Unexpected endpoint or method" in reply.error
    assert "vlm.api_base has no /v1" in reply.error
    assert len(server.calls) == 1


def test_what_claude_is_to_keep_is_marked_and_what_that_saved_is_counted():
    usage = {"input_tokens": 100, "output_tokens": 7, "cache_read_input_tokens": 900}
    usage["cache_creation_input_tokens"] = 0
    answer = {"id": "1", "type": "message", "role": "assistant", "usage": usage}
    answer |= {"model": "claude-sonnet-4-6", "stop_reason": "end_turn"}
    answer["content"] = [{"type": "text", "text": "{}"}]

    asked = request(0)
    parts = (Text(SHARED), Text(NEWS))
    asked = type(asked)(
        asked.id, asked.brief, (Message("user", parts),), asked.schema, 1.0
    )
    with serving(lambda call: Send(json.dumps(answer))) as server:
        vlm = LanguageModel("anthropic/claude-sonnet-4-6", server.url)
        (reply,) = vlm.complete([asked])
    first, second = server.calls[0].body["messages"][0]["content"]
    assert first["cache_control"] == {"type": "ephemeral"}
    assert "cache_control" not in second
    assert (reply.prompt_tokens, reply.cached_tokens) == (1000, 900)
    assert reply.saved_usd == pytest.approx(900 * (3e-6 - 3e-7))
    assert reply.cost_usd == pytest.approx(100 * 3e-6 + 900 * 3e-7 + 7 * 1.5e-5)


def test_where_a_provider_keeps_prompts_the_first_request_goes_ahead():
    parts = (Text(SHARED), Text("I am agent 0.\n"), Text(NEWS))
    requests = []
    for agent in range(4):
        asked = request(agent)
        message = Message("user", parts)
        requests.append(
            type(asked)(f"g0-a{agent}", asked.brief, (message,), asked.schema, 1.0)
        )

    with serving(lambda call: Say("{}", after_s=0.5)) as server:
        vlm = LanguageModel("openai/gpt-4.1", server.url + "/v1")
        assert len(list(vlm.complete(requests))) == 4
        assert len(list(vlm.complete(requests))) == 4
    at = [call.at for call in server.calls]
    assert at[1] - at[0] >= 0.5
    assert at[3] - at[1] < 0.5


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"api_key": "x"}, "vlm.options.api_key"),
        ({"temperature": 1}, "change vlm.temperature"),
        ({"tools": []}, "vlm.options.tools"),
        ({"extra_headers": {"Authorization": "x"}}, "looks like a secret"),
        ({"user": "sk-planted/0123456789"}, "looks like a secret"),
    ],
)
def test_options_that_are_refused(options, message):
    with pytest.raises(Exception, match=message):
        LanguageModel("openai/gpt-4.1", options=options)


def test_options_thinking_and_temperature_are_sent():
    with serving(lambda call: Say("{}")) as server:
        vlm = LanguageModel(
            "openai/my-own",
            server.url + "/v1",
            thinking="low",
            temperature=0.25,
            options={"top_p": 0.5, "my_own": 3},
        )
        (reply,) = vlm.complete([request(0)])
    body = server.calls[0].body
    assert reply.error is None
    sent = {
        name: body[name]
        for name in ("reasoning_effort", "temperature", "top_p", "my_own")
    }
    assert sent == {
        "reasoning_effort": "low",
        "temperature": 0.25,
        "top_p": 0.5,
        "my_own": 3,
    }
