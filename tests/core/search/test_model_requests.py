import math

import pytest

from core.interfaces import Reply
from core.values.messages import checked


@pytest.mark.parametrize("count", [2**63, 2**53, -1, math.nan, "7", True, [7], 7.5])
def test_a_count_that_cannot_be_is_unknown(count):
    reply = checked(Reply("g0-a0", "{}", "m", None, count, count))
    assert (reply.prompt_tokens, reply.completion_tokens) == (None, None)


@pytest.mark.parametrize("cost", [math.nan, math.inf, -1.0, "7", True, 1e308, 10**400])
def test_a_cost_that_cannot_be_is_unknown(cost):
    assert checked(Reply("g0-a0", "{}", "m", cost_usd=cost)).cost_usd is None


def test_texts_can_be_stored_and_printed(monkeypatch):
    monkeypatch.setenv("SOME_TOKEN", "0123456789abcdef")
    key = "0123456789abcdef"
    reply = checked(
        Reply(
            "g0-a0",
            f"half \ud83d {key}",
            f"m\x1b[2J\ud83d {key}" + "m" * 999,
            f"no\n{key}",
        )
    )
    assert reply.text == "half ? ***"
    assert reply.model.startswith("m[2J ***m")
    assert len(reply.model) == 200
    assert reply.error == "no ***"


def test_a_sound_reply_is_the_same():
    reply = Reply(
        "g0-a0", '{"a": "\\u00e9"}\n', "gemini/gemini-2.5-pro", None, 1000, 7, 0.01
    )
    assert checked(reply) == reply
    assert checked(Reply("g0-a0", None, "m")).error == "the text is null"


@pytest.mark.parametrize(
    ("text", "error", "tokens", "unanswered"),
    [
        ("", "down", None, True),
        ("{}", "down", None, False),
        ("", None, None, False),
        ("", "down", 9, False),
    ],
)
def test_only_a_failure_that_cost_nothing_is_unanswered(
    text, error, tokens, unanswered
):
    assert (
        checked(Reply("g0-a0", text, "m", error, tokens, unanswered=True)).unanswered
        is unanswered
    )
