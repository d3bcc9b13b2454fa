"""What a server can't do to its caller: lead a key elsewhere, fill the memory, or end a run by what it sends."""

import gzip
import json
import threading
from dataclasses import replace

import pytest

from tests.plugins.vlms.asking import KEYS, PROTOCOLS, ask, in_turn
from tests.plugins.vlms.servers import Call, Say, Send, Stall, document, serving
from tests.support.rare import rare
from tests.support.text import replaced_all

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("planted", "warm")]


def redirecting(status, target):
    return lambda call: Send(
        "{}", status, (("Location", f"{target}{call.path}?key={KEYS['google']}"),)
    )


@pytest.mark.parametrize(
    ("protocol", "status"),
    [(protocol, 307) for protocol in PROTOCOLS]
    + [("openai", status) for status in (300, 301, 302, 303, 305, 308)],
)
def test_no_redirect_is_followed(protocol, status):
    with serving(lambda call: Say()) as other:
        target = replaced_all(other.url, ("127.0.0.1", "localhost"))
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
    "location",
    ["//", "http://[", "\ud83d", "http://\u202e/", "/v1/elsewhere", "javascript:0", ""],
)
def test_a_redirect_to_anywhere_is_one_line(location):
    header = (("Location", location.encode("utf-8", "replace").decode("latin-1")),)
    with serving(lambda call: Send("{}", 307, header)) as server:
        reply = ask(server, "anthropic")[0]
    assert len(server.calls) == 1
    assert reply.error.startswith("127.0.0.1 redirects to ")
    assert reply.error.isprintable()


# --- size -------------------------------------------------------------------------------------------------------

MEGABYTE = b"x" * 1_000_000


def answer(protocol):
    return document(Say("{}"), Call("", {}, {"model": "m"}, protocol, "", [], [], 0.0))


def packed(text):
    return Send(gzip.compress(text), headers=(("Content-Encoding", "gzip"),))


@pytest.mark.parametrize(
    "act", [Send(MEGABYTE, repeat=1000), packed(MEGABYTE * 100)], ids=["long", "packed"]
)
@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_what_is_too_large_is_one_line_and_one_call(protocol, act):
    with serving(in_turn(act, Say("{}"))) as server:
        assert (
            ask(server, protocol)[0].error
            == "the answer is larger than 32 MiB; the rest is not read"
        )
    assert len(server.calls) == 1


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_packed_answer_is_read_and_half_of_one_is_an_error(protocol):
    whole = packed(json.dumps(answer(protocol)).encode())
    half = replace(whole, body=whole.body[:-20])
    with serving(in_turn(whole)) as server:
        reply = ask(server, protocol)[0]
    assert (reply.text, reply.error) == ("{}", None)
    with serving(in_turn(half)) as server:
        assert ask(server, protocol)[0].error


def test_no_thread_reads_on_after_the_time_limit(one_try):
    with serving(lambda call: Stall(drip=True)) as server:
        before = threading.active_count()
        assert ask(server, "openai", timeout_s=1.0)[0].error == "no answer within 1 s"
        for _ in range(100):
            if threading.active_count() <= before + 1:  # the server's own
                break
            server.closing.wait(0.1)
        assert threading.active_count() <= before + 1


# --- fields -----------------------------------------------------------------------------------------------------

WRONG = [2**63, -1, 0.5, 1e308, "7", None, True, [], {}, [7], "\ud83d"]
NAN = "NaN"


def changed(protocol, path, value):
    whole = answer(protocol)
    at = whole
    for step in path[:-1]:
        at = at[step]
    at[path[-1]] = value
    return json.dumps(whole)


FIELDS = {
    "openai": [
        *(
            ("usage", "prompt_tokens"),
            ("usage",),
            ("model",),
            ("created",),
            ("choices",),
            ("choices", 0),
        ),
        *(
            ("choices", 0, "finish_reason"),
            ("choices", 0, "message"),
            ("choices", 0, "message", "content"),
        ),
    ],
    "google": [
        *(
            ("usageMetadata", "promptTokenCount"),
            ("usageMetadata",),
            ("modelVersion",),
            ("candidates", 0),
        ),
        *(
            ("candidates", 0, "finishReason"),
            ("candidates", 0, "content", "parts", 0, "text"),
        ),
    ],
    "anthropic": [
        ("usage", "input_tokens"),
        ("usage",),
        ("model",),
        ("content",),
        ("stop_reason",),
    ],
    "ollama": [
        ("prompt_eval_count",),
        ("model",),
        ("message",),
        ("message", "content"),
    ],
}


FEW = [(protocol, paths[0]) for protocol, paths in FIELDS.items()]


@pytest.mark.parametrize(
    ("protocol", "path"),
    rare([(p, path) for p, paths in FIELDS.items() for path in paths], *FEW),
    ids=str,
)
def test_a_wrong_field_gives_a_reply_that_can_be_stored(protocol, path, one_try):
    bodies = [changed(protocol, path, value) for value in WRONG]
    bodies += [
        replaced_all(changed(protocol, path, NAN), (f'"{NAN}"', number))
        for number in ("NaN", "-Infinity", "1e999")
    ]
    turn = iter(bodies)
    with serving(lambda call: Send(next(turn))) as server:
        replies = ask(
            server,
            protocol,
            agents=len(bodies),
            concurrency=1,
            max_tokens_total=10**9,
        )
    for reply in replies.values():
        for count in (reply.prompt_tokens, reply.completion_tokens):
            assert count is None or (type(count) is int and 0 <= count < 2**53)
        assert reply.cost_usd is None or 0 <= reply.cost_usd < 1e6
        assert reply.model.isprintable()
        assert reply.error is None or reply.error.isprintable()
        json.dumps(vars(reply)).encode()
        reply.text.encode()
