"""Servers that take few pictures, or a part of a prompt, are asked for what they can do."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image as Pillow

from core.errors import LimitReached
from core.interfaces import Message, Picture, Text
from core.simulation.pictures import png
from plugins.vlms.litellm.context import ANSWER, SMALLEST
from tests.plugins.vlms.asking import ask, model_at
from tests.plugins.vlms.servers import Say, request, serving
from tests.support.model_runs import refused

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("planted", "warm")]

ONE_PICTURE = "At most 1 image(s) may be provided in one request."  # vLLM's words


def showing(*heights, needs_pictures=False, text="Design."):
    """A request with pictures of some heights in pixels, each 40 wide, with words before each."""
    parts = [Text(text)]
    for number, height in enumerate(heights):
        picture = np.full((height, 40, 3), 10 * number, np.uint8)
        parts += [Text(f"Caption {number}."), Picture(png(picture), f"view_{number}")]
    plain = request(0)
    return replace(
        plain,
        messages=(Message("user", tuple(parts)),),
        needs_pictures=needs_pictures,
    )


def fewer_than(most, words):
    def script(call):
        return refused(words) if len(call.pictures) > most else Say("{}")

    return script


def answers(script, *requests, protocol="openai", **settings):
    """The replies, one after the other, and the calls that a server took."""
    with serving(script) as server:
        vlm = model_at(server, protocol, concurrency=1, **settings)
        return list(vlm.complete(requests)), server.calls


@pytest.mark.parametrize(
    ("words", "most"),
    [
        (ONE_PICTURE, 1),
        ("Too many images: the request has 3, a maximum of 2 images is allowed.", 2),
    ],
)
def test_pictures_share_sheets_where_a_server_takes_few(words, most, caplog):
    heights = (30, 50, 20)
    shown = showing(*heights)
    replies, calls = answers(fewer_than(most, words), shown, replace(shown, id="g0-a1"))
    assert [reply.error for reply in replies] == [None, None]
    assert [len(call.pictures) for call in calls] == [3, most, most]

    sheets = [Pillow.open(io.BytesIO(sheet)) for sheet in calls[-1].pictures]
    assert {sheet.width for sheet in sheets} == {40}
    assert sum(sheet.height for sheet in sheets) > sum(heights)
    text = "".join(calls[-1].texts)
    assert all(f"`view_{number}`" in text for number in range(3))
    assert len(caplog.records) == 1


def test_as_many_pictures_as_a_server_takes_stay_as_they_are():
    shown = showing(30, 50)
    _, calls = answers(fewer_than(2, ONE_PICTURE), shown)
    (call,) = calls
    assert call.pictures == [
        part.png for part in shown.messages[0].parts if isinstance(part, Picture)
    ]


@pytest.mark.parametrize(
    "words",
    [
        "image input is not supported - hint: mmproj",
        "this model is missing data required for image input",  # Ollama's
    ],
)
@pytest.mark.parametrize("status", [400, 500])
def test_a_blind_model_ends_what_pictures_alone_tell(words, status):
    def script(call):
        return refused(words, status) if call.pictures else Say("{}")

    replies, calls = answers(script, showing(30))
    assert replies[0].error is None
    assert len(calls) == 2

    with serving(script) as server:
        vlm = model_at(server, "openai")
        with pytest.raises(LimitReached, match=r"prompt\.context=source"):
            list(vlm.complete([showing(30, needs_pictures=True)]))
        assert len(server.calls) == 1


@pytest.mark.parametrize(
    ("characters", "pictures", "settings", "most", "expected"),
    [
        (100, 0, {}, None, SMALLEST * 2),  # the answer needs room, too
        (100, 0, {"max_output_tokens": 1000}, None, SMALLEST),
        (60_000, 0, {"max_output_tokens": 1000}, None, SMALLEST * 4),
        (100, 20, {"max_output_tokens": 1000}, None, SMALLEST * 4),
        (60_000, 0, {}, 16_000, 16_000),
        (60_000, 0, {"options": {"num_ctx": 5000}}, None, 5000),
    ],
)
def test_ollama_is_asked_for_a_context_that_holds_the_prompt(
    characters, pictures, settings, most, expected
):
    assert ANSWER <= SMALLEST
    with serving(lambda call: Say("{}")) as server:
        server.context = most
        vlm = model_at(server, "ollama", **settings)
        asked = showing(*[30] * pictures, text="x" * characters)
        (reply,) = vlm.complete([asked])
    assert reply.error is None
    assert server.calls[-1].body["options"]["num_ctx"] == expected


def test_no_other_server_is_told_of_a_context():
    _, calls = answers(lambda call: Say("{}"), request(0))
    assert "num_ctx" not in str(calls[0].body)


@pytest.mark.parametrize(("characters", "warned"), [(5_900, 0), (6_200, 1)])
def test_a_count_of_tokens_far_below_the_prompt_has_warned_once(
    characters, warned, caplog
):
    shown = showing(text="x" * characters)  # the server counts 1,000 tokens
    answers(lambda call: Say("{}"), shown, replace(shown, id="g0-a1"))
    warnings = [record for record in caplog.records if "1,000 tokens" in record.message]
    assert len(warnings) == warned


@pytest.mark.parametrize(
    ("finish", "limit", "named"),
    [("length", None, "provider"), ("length", 300, "=300"), ("stop", 300, "")],
)
def test_a_reply_says_which_limit_cut_it_off(finish, limit, named):
    with serving(lambda call: Say('{"strategies": [', finish)) as server:
        reply = ask(server, "openai", max_output_tokens=limit)[0]
    assert named in reply.cut_by
    assert bool(reply.cut_by) == (finish == "length")
