"""The cache and the limits of language models: nothing is paid twice, and no more than allowed."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from core.errors import LimitReached, UsageError, UserError
from core.interfaces import Picture, Text
from plugins.vlms.litellm.cache import Cache
from plugins.vlms.litellm.model import LanguageModel
from tests.plugins.vlms.asking import PAID, agent_of, ask, in_turn, model_at
from tests.plugins.vlms.servers import Say, Send, Stall, request, serving

ROOT = Path(__file__).parents[3]
FINE = Say('{"fine": true}')  # 1007 tokens

pytestmark = pytest.mark.usefixtures("planted", "warm")


@pytest.fixture
def folder(tmp_path):
    return {"cache": True, "cache_dir": str(tmp_path / "cache")}


def entries(folder):
    return list(Path(folder["cache_dir"]).rglob("*.json"))


# --- the cache --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("protocol", PAID)
def test_a_cached_request_is_not_sent_again(protocol, folder):
    with serving(lambda call: Say(f"I am {agent_of(call)} \u20ac \u00fc\n")) as server:
        first = ask(server, protocol, agents=3, **folder)
        again = ask(server, protocol, agents=4, **folder)
    assert len(server.calls) == 4
    for agent in range(3):
        assert first[agent].cost_usd > 0
        assert again[agent] == replace(first[agent], cost_usd=0.0)
    assert again[3].text == "I am 3 \u20ac \u00fc\n"
    assert len(entries(folder)) == 4


def changed(**changes):
    """A request that differs in one field."""
    original = request(0)
    if "seed" in changes:
        return replace(original, brief=replace(original.brief, **changes))
    return replace(original, **changes)


REQUEST = request(0)
OTHERS = [
    changed(seed=7),
    changed(temperature=0.5),
    changed(schema={"type": "object"}),
    changed(messages=REQUEST.messages[1:]),
    changed(
        messages=(REQUEST.messages[0], replace(REQUEST.messages[1], parts=(*REQUEST.messages[1].parts, Text("!"))))
    ),
    changed(
        messages=(REQUEST.messages[0], replace(REQUEST.messages[1], parts=(*REQUEST.messages[1].parts, Picture(b"!"))))
    ),
]


def test_the_whole_request_is_the_key(tmp_path):
    def file(request, **settings):
        return Cache(str(tmp_path), {"model": "m", **settings}).file(request)

    files = [file(REQUEST), *(file(other) for other in OTHERS), file(REQUEST, model="n"), file(REQUEST, api_base="x")]
    assert len(set(files)) == len(files)
    assert file(replace(REQUEST, id="g7-a7")) == files[0]  # the id makes no difference


def test_models_and_addresses_have_their_own_entries(folder):
    with serving(lambda call: FINE) as server:
        for model, address in (("gpt-4.1", "/v1"), ("gpt-4.1-mini", "/v1"), ("gpt-4.1", "/w")):
            list(LanguageModel(f"openai/{model}", server.url + address, **folder).complete([REQUEST]))
    assert len(server.calls) == 3


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"null", b"\xff", b'{"text": 5}', b"[" * 100_000])
def test_a_broken_entry_counts_as_missing(folder, content):
    with serving(lambda call: FINE) as server:
        ask(server, "openai", **folder)
        (entry,) = entries(folder)
        whole = entry.read_bytes()
        entry.write_bytes(content)
        assert ask(server, "openai", **folder)[0].text == FINE.text
        assert len(server.calls) == 2
    assert entry.read_bytes() == whole  # mended


def test_an_entry_of_the_wrong_kind_counts_as_missing(folder):
    with serving(lambda call: FINE) as server:
        ask(server, "openai", **folder)
        (entry,) = entries(folder)
        for change in ({"text": None}, {"model": 3}, {"prompt_tokens": "many"}):
            entry.write_text(json.dumps(json.loads(entry.read_text()) | change))
            ask(server, "openai", **folder)
    assert len(server.calls) == 4


def test_errors_are_not_cached(folder):
    blocked = Say("", "content_filter")
    with serving(in_turn(blocked, Send("no", 401), Say("", "length"), FINE)) as server:
        for _ in range(4):
            reply = ask(server, "openai", **folder)[0]
        assert reply.error is None
    assert len(server.calls) == 4
    assert len(entries(folder)) == 1


def test_without_the_cache_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with serving(lambda call: FINE) as server:
        ask(server, "openai")
        assert not list(tmp_path.iterdir())
        ask(server, "openai", cache=True)
    if sys.platform == "linux":
        assert len(list((tmp_path / "vlmgineer" / "replies").rglob("*.json"))) == 1


def test_a_folder_that_can_not_be_made(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match=r"the cache folder .* can't be made: .*; set vlm\.cache_dir"):
        LanguageModel("openai/gpt-4.1", cache=True, cache_dir=str(tmp_path / "file" / "cache"))


def test_a_reply_that_can_not_be_cached_is_returned(folder, caplog):
    with serving(lambda call: FINE) as server:
        vlm = model_at(server, "openai", **folder)
        Path(folder["cache_dir"]).rmdir()
        Path(folder["cache_dir"]).write_text("in the way")
        (reply,) = vlm.complete([REQUEST])
    assert reply.text == FINE.text
    assert "can't be cached" in caplog.text


KILLED = [
    *("task=BringCube", "vlm=litellm", "vlm.model=openai/gpt-4.1", "vlm.cache=true", "executor.workers=1"),
    *("budget.n_agent=4", "budget.n_tool=1", "budget.n_action=1", "budget.n_iteration=0", "film=false", "listener={}"),
]


def start(tmp_path, server, name):
    words = [*KILLED, f"vlm.api_base={server.url}/v1", f"vlm.cache_dir={tmp_path / 'cache'}", f"hydra.run.dir={name}"]
    return subprocess.Popen(
        [sys.executable, "-m", "core.run", *words],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.slow
def test_a_run_that_is_killed_and_run_again_sends_no_answered_request_twice(tmp_path, folder):
    solution = (ROOT / "tests/tasks/solutions/BringCube.json").read_text()
    answered, seeds, calm = set(), [], False

    def script(call):
        seeds.append(call.body["seed"])
        if calm or len(seeds) in (2, 4):
            answered.add(call.body["seed"])
            return Say(solution)
        return Stall()

    with serving(script) as server:
        first = start(tmp_path, server, "first")
        deadline = time.monotonic() + 120
        while len(entries(folder)) < 2 and first.poll() is None and time.monotonic() < deadline:
            time.sleep(0.05)
        first.send_signal(signal.SIGKILL)
        first.communicate(timeout=30)
        assert first.returncode == -signal.SIGKILL
        assert (len(seeds), len(answered)) == (4, 2)
        kept, calm = set(answered), True
        second = start(tmp_path, server, "second")
        _, err = second.communicate(timeout=240)
    assert second.returncode == 0, err
    assert len(seeds) == 6
    assert set(seeds[4:]) == set(seeds[:4]) - kept
    result = json.loads((tmp_path / "second" / "result.json").read_text())
    assert result["generations"][0]["n_rejected"] == 0
    assert result["best"]["reward"] > 0.95


# --- limits -----------------------------------------------------------------------------------------------------


def until_limit(vlm, requests):
    """The replies, and the message at the end."""
    replies = []
    with pytest.raises(LimitReached) as error:
        replies.extend(vlm.complete(requests))  # extend keeps those before the error
    return replies, str(error.value)


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


def test_a_limit_that_is_not_reached_has_no_effect():
    with serving(lambda call: FINE) as server:
        assert len(ask(server, "openai", agents=3, concurrency=1, max_tokens_total=3000, max_cost_usd=1.0)) == 3


def test_failures_that_cost_something_count():
    with serving(lambda call: Say("", "content_filter")) as server:
        replies, _ = until_limit(
            model_at(server, "openai", concurrency=1, max_tokens_total=1500), [request(agent) for agent in range(4)]
        )
    assert [reply.error for reply in replies] == ["the provider's safety filter blocked the reply"] * 2


def test_no_retry_beyond_a_limit():
    with serving(lambda call: FINE if agent_of(call) == 0 else Send("{}", 503)) as server:
        vlm = model_at(server, "openai", concurrency=2, retries=100, max_tokens_total=500)
        until_limit(vlm, [request(0), request(1)])
    assert len(server.calls) < 20


def test_tokens_that_a_server_does_not_report_are_counted():
    bare = {"choices": [{"message": {"role": "assistant", "content": "word " * 500}, "finish_reason": "stop"}]}
    with serving(
        lambda call: Send(json.dumps(bare | {"id": "1", "object": "chat.completion", "model": "m"}))
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


def test_the_cost_before_a_run_was_resumed_counts(folder):
    with serving(lambda call: FINE) as server:
        paid = ask(server, "openai", agents=2, **folder)
        free = ask(server, "openai", agents=2, **folder)
        nothing = {"prompt_tokens": None, "completion_tokens": None, "cost_usd": None}
        failed = replace(paid[0], text="", error="no answer", **nothing)
        for past, calls in (([paid[0], paid[1]], 1), ([paid[0]], 2), ([free[0], free[1]], 3), ([failed], 3)):
            vlm = model_at(server, "openai", concurrency=1, max_tokens_total=2500)
            for reply in past:
                vlm.reply_received(request(9), reply)
            server.calls.clear()
            with pytest.raises(LimitReached):
                list(completed(vlm, [request(agent) for agent in range(6)]))
            assert len(server.calls) == calls


def test_cached_replies_cost_nothing(folder):
    with serving(lambda call: FINE) as server:
        ask(server, "openai", agents=4, **folder)
        assert len(ask(server, "openai", agents=4, max_tokens_total=10, max_cost_usd=1e-6, **folder)) == 4
        replies, _ = until_limit(
            model_at(server, "openai", concurrency=1, max_tokens_total=10, **folder),
            [request(agent) for agent in (9, 0, 8, 1)],
        )
    assert [reply.request_id for reply in replies] == ["g0-a9", "g0-a0", "g0-a1"]


@pytest.mark.parametrize("model", ["openai/my-own", "hosted_vllm/m", "ollama_chat/qwen3-vl:8b"])
def test_a_limit_of_cost_needs_a_price(model):
    with serving(lambda call: FINE) as server:
        with pytest.raises(UserError, match=r"vlm\.max_cost_usd can't be applied: .* no price for .*max_tokens_total"):
            LanguageModel(model, server.url + "/v1", max_cost_usd=5.0)
        LanguageModel(model, server.url + "/v1", max_tokens_total=5)
    assert not server.calls


@pytest.mark.parametrize("settings", [{"max_cost_usd": 0.0}, {"max_tokens_total": 0}, {"max_cost_usd": float("nan")}])
def test_invalid_limits(settings):
    with pytest.raises(UsageError, match=rf"vlm\.{next(iter(settings))} must be greater than 0"):
        LanguageModel("openai/gpt-4.1", **settings)
