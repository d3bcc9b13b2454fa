"""What a server can't do to its caller: lead a key elsewhere, fill the memory, or end a run by what it sends."""

import functools
import gzip
import json
import resource
import threading
import zlib

import pytest

from plugins.vlms.litellm.model import LanguageModel
from plugins.vlms.litellm.transport import MAX_ITEMS
from tests.plugins.vlms.asking import KEYS, PROTOCOLS, ask, in_turn
from tests.plugins.vlms.servers import Call, Say, Send, Stall, document, request, serving

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("planted", "warm")]

# Other providers of LiteLLM's, with the environment that each needs.
OTHERS = {
    "azure/gpt-4o": {"AZURE_API_KEY": "planted-azure-0123", "AZURE_API_VERSION": "2024-10-21"},
    "azure_ai/mistral-large": {"AZURE_AI_API_KEY": "planted-azure-ai-0123"},
    "bedrock/anthropic.claude-3-haiku-20240307-v1:0": {
        "AWS_BEARER_TOKEN_BEDROCK": "planted-bedrock-0123",
        "AWS_REGION": "us-east-1",
    },
    "cohere_chat/command-r": {"COHERE_API_KEY": "planted-cohere-0123"},
    "databricks/dbrx": {"DATABRICKS_API_KEY": "planted-databricks-0123"},
    "deepseek/deepseek-chat": {"DEEPSEEK_API_KEY": "planted-deepseek-0123"},
    "groq/llama-3.3-70b-versatile": {"GROQ_API_KEY": "planted-groq-0123"},
    "hosted_vllm/m": {"HOSTED_VLLM_API_KEY": "planted-vllm-0123"},
    "mistral/mistral-large-latest": {"MISTRAL_API_KEY": "planted-mistral-0123"},
    "ollama/m": {"OLLAMA_API_KEY": "planted-ollama-0123"},
    "openrouter/openai/gpt-4o": {"OPENROUTER_API_KEY": "planted-openrouter-0123"},
    "watsonx/ibm/granite-3-8b-instruct": {
        "WATSONX_ZENAPIKEY": "planted-watsonx-0123",
        "WATSONX_PROJECT_ID": "p",
    },
    "xai/grok-4": {"XAI_API_KEY": "planted-xai-0123"},
}


def redirecting(status, target):
    return lambda call: Send("{}", status, (("Location", f"{target}{call.path}?key={KEYS['google']}"),))


@pytest.mark.parametrize(
    ("protocol", "status"),
    [(protocol, 307) for protocol in PROTOCOLS] + [("openai", status) for status in (300, 301, 302, 303, 305, 308)],
)
def test_no_redirect_is_followed(protocol, status):
    with serving(lambda call: Say()) as other:
        target = other.url.replace("127.0.0.1", "localhost")
        with serving(redirecting(status, target)) as server:
            reply = ask(server, protocol)[0]
    assert other.calls == []
    assert len(server.calls) == 1
    assert reply.unanswered
    assert reply.error == (
        f"127.0.0.1 redirects to localhost (status {status}), which is not followed: the key would go there; "
        "set vlm.api_base to the right address"
    )


@pytest.mark.parametrize(
    "location", ["//", "http://[", "\ud83d", "http://\u202e/", "/v1/elsewhere", "javascript:0", ""]
)
def test_a_redirect_to_anywhere_is_one_line(location):
    header = (("Location", location.encode("utf-8", "replace").decode("latin-1")),)
    with serving(lambda call: Send("{}", 307, header)) as server:
        reply = ask(server, "anthropic")[0]
    assert len(server.calls) == 1
    assert reply.error.startswith("127.0.0.1 redirects to ")
    assert reply.error.isprintable()


@pytest.mark.parametrize("model", OTHERS)
def test_no_provider_follows_a_redirect(model, monkeypatch):
    for name, value in OTHERS[model].items():
        monkeypatch.setenv(name, value)
    with serving(lambda call: Say(), any_path=True) as other:
        target = other.url.replace("127.0.0.1", "localhost")
        with serving(redirecting(307, target), any_path=True) as server:
            (reply,) = LanguageModel(model, server.url + "/v1").complete([request(0)])
    assert other.calls == []
    assert len(server.calls) == 1
    assert "127.0.0.1 redirects to localhost (status 307)" in reply.error
    assert "planted" not in reply.error
    key = next(value for name, value in OTHERS[model].items() if "KEY" in name or "TOKEN" in name)
    assert key in json.dumps(server.calls[0].headers)


# --- size -------------------------------------------------------------------------------------------------------

MEGABYTE = b"x" * 1_000_000


@functools.cache
def bomb(wrapper):
    """A text of 1 GB, packed."""
    packer = zlib.compressobj(1, wbits=wrapper)
    return b"".join([*(packer.compress(MEGABYTE) for _ in range(1000)), packer.flush()])


def packed_answer(protocol, packer):
    whole = json.dumps(document(Say("{}"), Call("", {}, {"model": "m"}, protocol, "", [], [], 0.0)))
    return packer(whole.encode())


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_an_answer_is_bounded_while_it_arrives(protocol):
    gzipped, deflated = bomb(zlib.MAX_WBITS | 16), bomb(zlib.MAX_WBITS)
    acts = [
        Send(gzipped, headers=(("Content-Encoding", "gzip"),)),
        Send(deflated, headers=(("Content-Encoding", "deflate"),)),
        Send(gzipped, 500, headers=(("Content-Encoding", "gzip"),)),
        Send(MEGABYTE, repeat=1000),
        Send(gzip.compress(gzipped), headers=(("Content-Encoding", "gzip, gzip"),)),
        Send(packed_answer(protocol, gzip.compress), headers=(("Content-Encoding", "br"),)),
        Send('{"choices": [' + "{}," * MAX_ITEMS + "{}]}"),
        Send('"\\"' * 1_000_000),
        Send('{"choices": [], "candidates": []}'.encode("utf-16-le")),
        Send(packed_answer(protocol, gzip.compress)[:-20], headers=(("Content-Encoding", "gzip"),)),
    ]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for act in acts:
        with serving(lambda call, act=act: act) as server:
            assert ask(server, protocol, retries=0)[0].error
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert grown < 400_000  # kB


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_what_is_too_large_is_one_line_and_one_call(protocol):
    with serving(in_turn(Send(MEGABYTE, repeat=1000), Say("{}"))) as server:
        assert ask(server, protocol)[0].error == "the answer is larger than 32 MiB; the rest is not read"
    assert len(server.calls) == 1


@pytest.mark.parametrize(
    ("protocol", "path"), [("openai", ("choices", 0, "message", "tool_calls")), ("ollama", ("message", "tool_calls"))]
)
def test_a_text_where_a_list_belongs_is_not_handed_on(protocol, path):
    """LiteLLM made an object of each letter of `tool_calls`: more than ten minutes for both."""
    act = Send(changed(protocol, path, "a" * 100_000).encode())
    with serving(lambda call: act) as server:
        reply = ask(server, protocol)[0]
    assert reply.error == "the answer's `tool_calls` is a text where a list belongs; it is not read"
    assert len(server.calls) == 1


@pytest.mark.parametrize("packer", [gzip.compress, zlib.compress])
@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_packed_answer_is_read(protocol, packer):
    name = {gzip.compress: "gzip", zlib.compress: "deflate"}[packer]
    act = Send(packed_answer(protocol, packer), headers=(("Content-Encoding", name),))
    with serving(lambda call: act) as server:
        reply = ask(server, protocol)[0]
    assert (reply.text, reply.error) == ("{}", None)
    assert server.calls[0].headers["accept-encoding"] == "gzip"


def test_no_thread_reads_on_after_the_time_limit():
    with serving(lambda call: Stall(drip=True)) as server:
        before = threading.active_count()
        assert ask(server, "openai", timeout_s=1.0, retries=0)[0].error == "no answer within 1 s"
        for _ in range(100):
            if threading.active_count() <= before + 1:  # the server's own
                break
            server.closing.wait(0.1)
        assert threading.active_count() <= before + 1


# --- fields -----------------------------------------------------------------------------------------------------

WRONG = [2**63, -1, 0.5, 1e308, "7", None, True, [], {}, [7], "\ud83d"]
NAN = "NaN"


def changed(protocol, path, value):
    whole = document(Say("{}"), Call("", {}, {"model": "m"}, protocol, "", [], [], 0.0))
    at = whole
    for step in path[:-1]:
        at = at[step]
    at[path[-1]] = value
    return json.dumps(whole)


FIELDS = {
    "openai": [
        *(("usage", "prompt_tokens"), ("usage",), ("model",), ("created",), ("choices",), ("choices", 0)),
        *(("choices", 0, "finish_reason"), ("choices", 0, "message"), ("choices", 0, "message", "content")),
    ],
    "google": [
        *(("usageMetadata", "promptTokenCount"), ("usageMetadata",), ("modelVersion",), ("candidates", 0)),
        *(("candidates", 0, "finishReason"), ("candidates", 0, "content", "parts", 0, "text")),
    ],
    "anthropic": [("usage", "input_tokens"), ("usage",), ("model",), ("content",), ("stop_reason",)],
    "ollama": [("prompt_eval_count",), ("model",), ("message",), ("message", "content")],
}


@pytest.mark.parametrize(
    ("protocol", "path"), [(protocol, path) for protocol, paths in FIELDS.items() for path in paths], ids=str
)
def test_a_wrong_field_gives_a_reply_that_can_be_stored(protocol, path):
    bodies = [changed(protocol, path, value) for value in WRONG]
    bodies += [changed(protocol, path, NAN).replace(f'"{NAN}"', number) for number in ("NaN", "-Infinity", "1e999")]
    turn = iter(bodies)
    with serving(lambda call: Send(next(turn))) as server:
        replies = ask(server, protocol, agents=len(bodies), retries=0, concurrency=1, max_tokens_total=10**9)
    for reply in replies.values():
        for count in (reply.prompt_tokens, reply.completion_tokens):
            assert count is None or (type(count) is int and 0 <= count < 2**53)
        assert reply.cost_usd is None or 0 <= reply.cost_usd < 1e6
        assert reply.model.isprintable()
        assert reply.error is None or reply.error.isprintable()
        json.dumps(vars(reply)).encode()
        reply.text.encode()
