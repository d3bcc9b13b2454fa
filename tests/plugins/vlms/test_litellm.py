"""Language models through LiteLLM, against servers on the loopback interface that speak the providers' protocols."""

import io
import json
import logging
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from core.config.compose import load
from core.errors import UsageError, UserError
from core.interfaces import Picture, Text
from core.plugins import installed
from plugins.vlms import LITELLM
from plugins.vlms.litellm import failures
from plugins.vlms.litellm.language_model import LanguageModel
from plugins.vlms.litellm.prices import estimate
from tests.plugins.vlms.asking import (
    KEYS,
    PAID,
    PROTOCOLS,
    VARIABLES,
    agent_of,
    ask,
    in_turn,
    model_at,
)
from tests.plugins.vlms.servers import (
    PNG,
    SCHEMA,
    Reset,
    Say,
    Send,
    Stall,
    request,
    serving,
)
from tests.support.commands import python_m
from tests.support.rare import rare

ROOT = Path(__file__).parents[3]

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("planted", "warm")]


# --- what is sent, what comes back ------------------------------------------------------------------------------


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_the_request_arrives_in_the_protocols_form(protocol):
    with serving(lambda call: Say('{"numbers": [1, 2]}')) as server:
        reply = ask(server, protocol)[0]
    (call,) = server.calls
    assert call.protocol == protocol
    assert call.pictures == [PNG]
    assert call.system == "Be brief."
    said, _, schema = (
        "".join(call.texts).replace("\n", "").partition("JSON schema of the answer:")
    )
    assert said == "I am agent 0.Design."
    # Which holds the model to it without showing it.
    assert bool(schema) == (protocol == "ollama")
    sent = call.body
    if protocol == "openai":
        assert sent["response_format"]["json_schema"]["schema"] == SCHEMA
        assert call.headers["authorization"] == f"Bearer {KEYS['openai']}"
    elif protocol == "google":
        sent = sent["generationConfig"]
        assert sent["response_json_schema"] == SCHEMA
        assert call.headers["x-goog-api-key"] == KEYS["google"]
    elif protocol == "anthropic":
        numbers = sent["output_format"]["schema"]["properties"]["numbers"]
        # LiteLLM turns limits that Claude refuses into words.
        assert numbers["items"] == {"type": "number"}
        assert "minimum number of items: 2" in numbers["description"]
        assert call.headers["x-api-key"] == KEYS["anthropic"]
    else:
        assert sent["format"] == SCHEMA
        sent = sent["options"]
    assert (sent["temperature"], sent.get("seed")) == (
        (1.0, None) if protocol == "anthropic" else (1.25, 100)
    )
    assert (reply.text, reply.error) == ('{"numbers": [1, 2]}', None)
    assert (reply.prompt_tokens, reply.completion_tokens) == (1000, 7)
    if protocol == "ollama":
        assert reply.cost_usd is None
    else:
        assert 0.001 < reply.cost_usd < 0.01


def test_unknown_price_is_not_zero_and_unknown_model_gets_the_schema_twice():
    """As a setting, which its server may know, and in the text, which the model sees."""
    with serving(lambda call: Say()) as server:
        (reply,) = LanguageModel("openai/my-own", server.url + "/v1").complete(
            [request(0)]
        )
    assert reply.cost_usd is None
    sent = server.calls[0].body["response_format"]
    assert sent["json_schema"]["schema"] == SCHEMA
    assert json.dumps(SCHEMA, separators=(",", ":")) in "".join(server.calls[0].texts)


def test_vllm_is_sent_the_schema_for_any_model_and_no_key_of_other_providers():
    with serving(lambda call: Say()) as server:
        (reply,) = LanguageModel(
            "hosted_vllm/who/what-8B", server.url + "/v1"
        ).complete([request(0)])
    (call,) = server.calls
    assert (call.body["model"], reply.cost_usd) == ("who/what-8B", None)
    assert call.body["response_format"]["json_schema"]["schema"] == SCHEMA
    assert not any(key in json.dumps(call.headers) for key in KEYS.values())


def test_unsupported_parameters_are_left_out_with_one_warning(caplog):
    with serving(lambda call: Say()) as server:
        vlm = LanguageModel("openai/gpt-5", server.url + "/v1")
        replies = list(vlm.complete([request(0), request(1)]))
    assert [reply.error for reply in replies] == [None, None]
    assert not any("temperature" in call.body for call in server.calls)
    assert [record.message for record in caplog.records] == [
        "openai/gpt-5 accepts no temperature: left out of its requests"
    ]


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_critique_is_asked_for_without_a_schema(protocol):
    with serving(lambda call: Say("It slips off.")) as server:
        asked = replace(request(0), schema={}, purpose="critiques")
        (reply,) = model_at(server, protocol).complete([asked])
    assert reply.text == "It slips off."
    sent = json.dumps(server.calls[0].body)
    assert not any(
        word in sent
        for word in ("json_schema", "response_format", '"format"', "JSON schema")
    )


def test_schema_that_is_refused_is_left_out(caplog):
    def script(call):
        refused = Send(
            '{"error": {"message": "the schema has too many states for serving"}}', 400
        )
        return (
            refused
            if "response_json_schema" in call.body["generationConfig"]
            else Say("{}")
        )

    with serving(script) as server:
        vlm = LanguageModel("gemini/gemini-2.5-pro", server.url, concurrency=1)
        replies = list(vlm.complete([request(0), request(1)]))
    assert [reply.error for reply in replies] == [None, None]
    assert len(server.calls) == 3
    assert (
        len([record for record in caplog.records if record.levelno == logging.WARNING])
        == 1
    )
    shown = [
        "JSON schema of the answer" in "".join(call.texts) for call in server.calls
    ]
    assert shown == [False, True, True]


# --- together, within limits ------------------------------------------------------------------------------------


@pytest.mark.parametrize("protocol", PAID)
def test_requests_are_sent_in_parallel(protocol):
    """Twenty agents wait at the same time: no answer is sent before all requests have arrived."""
    with serving(lambda call: Say(f"{agent_of(call)}"), at_once=20) as server:
        replies = ask(server, protocol, agents=20)
    assert {agent: reply.text for agent, reply in replies.items()} == {
        agent: str(agent) for agent in range(20)
    }
    assert server.most_at_once == 20


def test_replies_come_as_they_arrive():
    with serving(
        lambda call: Say("{}", after_s=1.0 if agent_of(call) == 0 else 0.0)
    ) as server:
        replies = [
            reply.request_id
            for reply in model_at(server, "openai").complete([request(0), request(1)])
        ]
    assert replies == ["g0-a1", "g0-a0"]


def test_no_more_calls_than_allowed_wait_at_once():
    with serving(lambda call: Say("{}", after_s=0.2)) as server:
        ask(server, "openai", agents=6, concurrency=2)
    at = sorted(call.at for call in server.calls)
    assert all(
        later - earlier >= 0.19 for earlier, later in zip(at, at[2:], strict=False)
    )


def test_no_more_calls_than_allowed_begin_in_a_minute():
    with serving(lambda call: Say("{}")) as server:
        ask(server, "openai", agents=6, requests_per_minute=600)
    at = sorted(call.at for call in server.calls)
    assert at[-1] - at[0] >= 0.45


# --- what goes wrong --------------------------------------------------------------------------------------------

ECHO = " ".join(KEYS.values())
BUSY = Send(json.dumps({"error": {"message": f"slow down, {ECHO}"}}), 429)
BROKEN = Send('{"error": {"message": "oops"}}', 500)
FINE = Say('{"fine": true}')
CUT = '{"strategies": [{"tool_na'
SAFETY = {"openai": "content_filter", "google": "SAFETY", "anthropic": "refusal"}
LENGTH = {"openai": "length", "google": "MAX_TOKENS", "anthropic": "max_tokens"}
HUGE = "x" * 20_000_000


def cases(protocol):
    """For each agent: the server's act at each try, a pattern of the error (None: no error), the text, and the number
    of calls.
    """
    blocked = Send(
        '{"promptFeedback": {"blockReason": "SAFETY"}, "usageMetadata": {"promptTokenCount": 9}}'
    )
    html = Send(f"<html>log in, {ECHO}</html>", type="text/html")
    return [
        ([FINE], None, FINE.text, 1),
        ([BUSY, FINE], None, FINE.text, 2),
        ([BROKEN, FINE], None, FINE.text, 2),
        (
            [Send("<html>bad gateway</html>", 502, type="text/html"), FINE],
            None,
            FINE.text,
            2,
        ),
        ([Reset(), FINE], None, FINE.text, 2),
        ([Reset()], r"\(after 5 tries\)", "", 5),
        ([BUSY], r"RateLimitError: .*slow down.*\(after 5 tries\)", "", 5),
        (
            [Send(json.dumps({"error": {"message": f"bad key {ECHO}"}}), 401)],
            "AuthenticationError: .*bad key",
            "",
            1,
        ),
        (
            [Send('{"error": {"message": "no such model"}}', 404)],
            "no such model",
            "",
            1,
        ),
        (
            [
                Send(
                    '{"error": {"code": "insufficient_quota", "message": "insufficient_quota"}}',
                    429,
                )
            ],
            "quota",
            "",
            1,
        ),
        ([Say("", SAFETY[protocol])], "safety filter blocked", "", 1),
        (
            [blocked] if protocol == "google" else [Say("", SAFETY[protocol])],
            "safety filter blocked",
            "",
            1,
        ),
        ([Say("")], r"the reply is empty \(finish reason: stop\)", "", 1),
        ([Say(CUT, LENGTH[protocol])], None, CUT, 1),
        (
            [Say("", LENGTH[protocol])],
            "length limit was reached before any text",
            "",
            1,
        ),
        ([Say("half a pair: \ud83d")], None, "half a pair: ?", 1),
        (
            [Send(json.dumps({"error": {"message": "half a pair: \ud83d"}}), 400)],
            "half a pair:",
            "",
            1,
        ),
        ([Say(HUGE)], None, HUGE, 1),
        ([html], "Error: .", "", None),
        ([Send("null")], "Error: .", "", None),
        ([Send("[1]")], "Error: .", "", None),
        ([Send('{"choices": [], "candidates": []}')], ".", "", None),
        ([FINE], None, FINE.text, 1),
    ]


# Of the cases: is it asked again by a resumed run?
UNANSWERED = [False] * 5 + [True] * 5 + [False] * 8


@pytest.mark.parametrize("protocol", rare(PAID, "anthropic"))
def test_each_fault_costs_its_own_reply_only_and_no_key_is_shown(protocol, caplog):
    wanted = cases(protocol)
    scripts = [in_turn(*acts) for acts, *_ in wanted]
    with serving(lambda call: scripts[agent_of(call)](call)) as server:
        replies = ask(server, protocol, agents=len(wanted), concurrency=len(wanted))
    calls = [agent_of(call) for call in server.calls]
    for agent, (acts, error, text, tries) in enumerate(wanted):
        reply = replies[agent]
        assert reply.text == text, str(acts)[:1000]
        assert (reply.error is None) == (error is None), (acts, reply)
        assert error is None or re.search(error, reply.error), (acts, reply.error)
        if agent < len(UNANSWERED):
            assert reply.unanswered == UNANSWERED[agent], acts
        assert tries is None or calls.count(agent) == tries, acts
        shown = reply.error or ""
        assert shown.isprintable()
        assert "Traceback" not in shown
        assert "planted" not in shown
    assert "planted" not in caplog.text
    assert "cut off the reply" in caplog.text


@pytest.mark.parametrize("protocol", rare(PAID, "openai"))
def test_a_server_that_stalls_meets_the_time_limit(protocol, monkeypatch):
    """So does one that sends a byte at times; each costs its own reply only."""
    monkeypatch.setattr(failures, "TRIES", 3)
    scripts = [in_turn(Stall()), in_turn(Stall(drip=True), FINE), in_turn(FINE)]
    with serving(lambda call: scripts[agent_of(call)](call)) as server:
        replies = ask(server, protocol, agents=3, timeout_s=1.0)
    assert (replies[0].error, replies[0].unanswered) == (
        "no answer within 1 s (after 3 tries)",
        True,
    )
    assert [replies[agent].text for agent in (1, 2)] == [FINE.text] * 2
    calls = [agent_of(call) for call in server.calls]
    assert calls.count(0) == 3
    assert calls.count(1) >= 2


@pytest.mark.parametrize("protocol", PAID)
def test_the_wait_that_a_server_requests_is_observed(protocol):
    hint = '{"error": {"message": "slow", "details": [{"retryDelay": "0.5s"}]}}'
    busy = (
        Send(hint, 429)
        if protocol == "google"
        else Send("{}", 429, (("Retry-After", "0.5"),))
    )
    with serving(in_turn(busy, FINE)) as server:
        assert ask(server, protocol)[0].error is None
    first, second = (call.at for call in server.calls)
    assert second - first >= 0.5


@pytest.mark.parametrize(
    "when", ["Fri, 31 Dec 99999999999999999999 23:59:59 GMT", "soon", "9" * 400, "-1"]
)
def test_a_wait_that_cannot_be_read_is_no_answer(when):
    """Parsing the first raises an OverflowError, which was stored as the answer."""
    busy = Send("{}", 429, (("Retry-After", when),))
    with serving(in_turn(busy)) as server:
        reply = ask(server, "openai")[0]
    assert "RateLimitError" in reply.error
    assert reply.unanswered
    assert len(server.calls) == (1 if when.startswith("9") else 5)


@pytest.mark.parametrize("body", ["<html>log in</html>", "", "null", "[1]"])
@pytest.mark.parametrize("protocol", PAID)
def test_an_answer_that_cannot_be_read_is_asked_for_again(protocol, body):
    with serving(in_turn(Send(body), FINE)) as server:
        assert ask(server, protocol)[0].text == FINE.text
    assert len(server.calls) == 2
    with serving(in_turn(Send(body))) as server:
        reply = ask(server, protocol)[0]
    assert reply.unanswered
    assert reply.error.isprintable()


@pytest.mark.parametrize("agents", [1, 5])
def test_a_thread_that_ends_is_not_waited_for(agents, monkeypatch):
    """Whatever fails in the handling of a failure too."""

    def fail(*_):
        raise UnicodeEncodeError("utf-8", "\udcff", 0, 1, "surrogates not allowed")

    monkeypatch.setattr("plugins.vlms.litellm.client.explain", fail)
    model = LanguageModel("ollama_chat/m", "http://127.0.0.1:9", concurrency=2)
    with pytest.raises(UnicodeEncodeError):
        list(model.complete([request(agent) for agent in range(agents)]))


def test_an_expired_key_leaves_the_request_unanswered():
    expired = {
        "code": 400,
        "message": "API key expired. Renew it.",
        "status": "INVALID_ARGUMENT",
    }
    with serving(lambda call: Send(json.dumps({"error": expired}), 400)) as server:
        reply = ask(server, "google")[0]
    assert "API key expired" in reply.error
    assert reply.unanswered


# --- made or refused --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "variable"),
    [
        ("gemini/gemini-2.5-pro", "GEMINI_API_KEY or GOOGLE_API_KEY"),
        ("openai/gpt-4.1", "OPENAI_API_KEY"),
        ("anthropic/claude-sonnet-4-6", "ANTHROPIC_API_KEY"),
        ("mistral/mistral-large-latest", "MISTRAL_API_KEY"),
    ],
)
def test_a_missing_key_is_an_error_at_once(model, variable, monkeypatch):
    for name in VARIABLES.values():
        monkeypatch.delenv(name)
    with pytest.raises(UserError) as error:
        LanguageModel(model)
    assert (
        str(error.value)
        == f"vlm.model={model} needs an API key; set the environment variable {variable}"
    )


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_local_server_needs_no_key(protocol, monkeypatch):
    for name in VARIABLES.values():
        monkeypatch.delenv(name)
    with serving(lambda call: FINE) as server:
        assert ask(server, protocol)[0].text == FINE.text


def test_unknown_provider(capfd):
    with pytest.raises(
        UserError,
        match=r"vlm.model=foo/bar: LiteLLM knows no such provider; write provider/model",
    ):
        LanguageModel("foo/bar")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "settings",
    [
        {"model": ""},
        {"concurrency": 0},
        {"timeout_s": 0.0},
        {"requests_per_minute": 0.0},
        {"max_output_tokens": 0},
    ],
)
def test_invalid_settings(settings):
    with pytest.raises(UsageError, match=rf"vlm\.{next(iter(settings))}"):
        LanguageModel(**{"model": "openai/gpt-4.1", **settings})


@pytest.mark.parametrize("name", LITELLM)
def test_each_name_has_a_configuration_that_fits(name, monkeypatch):
    monkeypatch.setenv("ANTHROPIC_API_KEY", "planted-for-anthropic")
    config = load(
        "config",
        [f"vlm={name}", *(["vlm.model=openai/gpt-4.1"] if name == "litellm" else [])],
    )
    settings = dict(config.vlm)
    vlm = installed().create("vlm", settings.pop("name"), settings)
    assert vlm.model == config.vlm.model


# --- the process ------------------------------------------------------------------------------------------------


def python(code, *arguments):
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


NO_MODEL = {
    "core.run": [
        "vlm=offline",
        "budget.n_agent=1",
        "budget.n_iteration=0",
        "film=false",
        "hydra.run.dir=run",
    ],
    "core.plugins": [],
    "core evaluate": [f"designs={ROOT / 'tests/tasks/solutions/BringCube.json'}"],
    "core prompt": ["vlm=offline"],
}


@pytest.mark.parametrize("command", rare(NO_MODEL, "core evaluate"))
def test_what_needs_no_model_does_not_import_litellm(command, tmp_path):
    """In no process: a LiteLLM that fails on import precedes the real one."""
    (tmp_path / "litellm.py").write_text("raise SystemExit('LiteLLM was imported')")
    words = [*command.split(), *NO_MODEL[command]]
    done = python_m(tmp_path, *words, PYTHONPATH=f"{tmp_path}:{ROOT}")
    assert (done.returncode, "LiteLLM was imported" in done.stdout + done.stderr) == (
        0,
        False,
    ), done.stderr


CALL_TWICE = """
import socket, sys
sent_to = set()
def watched(function):
    def call(*arguments, **named):
        sent_to.add(arguments[0] if isinstance(arguments[0], str) else arguments[1][0])
        return function(*arguments, **named)
    return call
socket.getaddrinfo = watched(socket.getaddrinfo)
socket.socket.connect = watched(socket.socket.connect)
from tests.plugins.vlms.servers import request
from plugins.vlms.litellm.language_model import LanguageModel
vlm = LanguageModel(sys.argv[1], sys.argv[2])
for reply in vlm.complete([request(0), request(1)]):
    print(reply.text, reply.error, sent_to, flush=True)
list(vlm.complete([request(2), request(3)]))
"""


@pytest.mark.thorough
def test_only_calls_go_over_the_network_nothing_is_printed_and_an_interrupt_waits_for_no_server():
    with serving(lambda call: FINE if agent_of(call) < 2 else Stall()) as server:
        process = python(CALL_TWICE, "gemini/gemini-2.5-pro", server.url)
        deadline = time.monotonic() + 60
        while (
            len(server.calls) < 4
            and process.poll() is None
            and time.monotonic() < deadline
        ):
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    assert out.splitlines() == ["{\"fine\": true} None {'127.0.0.1'}"] * 2
    assert err.startswith("Traceback")
    assert err.endswith("KeyboardInterrupt\n")


def test_pictures_are_estimated_by_their_pixels():
    """LiteLLM's own counter takes each for a small one."""
    drawn = io.BytesIO()
    Image.new("RGB", (1000, 750)).save(drawn, "PNG")
    sent = request(0)
    model = "anthropic/claude-sonnet-4-6"
    *before, user = sent.messages
    plain = replace(
        user, parts=tuple(part for part in user.parts if isinstance(part, Text))
    )
    shown = replace(
        plain,
        parts=(*plain.parts, Picture(drawn.getvalue()), Picture(drawn.getvalue())),
    )
    counts = [
        estimate(replace(sent, messages=(*before, last)), model).prompt_tokens
        for last in (plain, shown)
    ]
    assert counts[1] - counts[0] == 2000
