"""The document in a model's reply, whole, malformed or hostile."""

import json
import re

import pytest

from core.design import DesignError
from core.designs.reading import load_designs, read_designs
from core.designs.replies import parse_reply
from core.errors import UserError
from plugins.replies import saving
from plugins.replies.assumptions import assume
from plugins.replies.saving import MAX_SAVED
from tests.support.rods import PLAN, STRATEGY, TASK, Rod
from tests.support.text import replaced, replaced_all

pytestmark = pytest.mark.slow

DOCUMENT = {
    "strategies": [
        {"tool_urdf": "<link name='{a}'>\n```json {\"</link>", "action_sets": [PLAN]}
    ]
}
TEXT = json.dumps(DOCUMENT)


@pytest.mark.parametrize(
    "reply",
    [
        TEXT,
        f"\n {json.dumps(DOCUMENT, indent=2)} \n",
        f"```json\n{TEXT}\n```",
        f"```\n{TEXT}\n```",
        f"Sure! Here {{is}} what I {{ think:\n```json\n{TEXT}\n```\nGood luck {{}}.",
        f'First I thought of {{"a": 1}}, then of {TEXT} and {{"strategies": []}}',
        f"[{TEXT}]",
        TEXT.replace("\\n", "\n"),
    ],
)
def test_the_document_is_found_in_a_reply(reply):
    assert parse_reply(reply) == DOCUMENT


STEP = {"anchor": "cube", "offset": [0, 0, 0.1], "rpy": [0, 0, 0]}


@pytest.mark.parametrize(
    "steps",
    [
        [STEP],
        [{**STEP, "until": "touch"}],
        [{"look": True}, STEP],
        [{"repeat": [{"look": True}, STEP], "until_seen": {"goal": 0}, "at_most": 2}],
    ],
)
def test_a_reply_that_names_no_action_is_read_by_its_form(steps):
    document = {"strategies": [{**STRATEGY, "action_sets": [steps]}]}
    (candidate,) = read_designs(document, Rod(), TASK)
    assert (candidate.problem, candidate.plan.action) == (None, "anchored")


@pytest.mark.parametrize(
    ("old", "new"), [("]}]}", "]}}"), ("]}]}", "]}]"), ("", "I {{ think: ")]
)
def test_a_list_of_designs_that_was_mended_is_said_to_be(old, new, caplog):
    assume.cache_clear()
    text = TEXT[: -len(old)] + new if old else new + TEXT
    assert parse_reply(text)["strategies"] == DOCUMENT["strategies"]
    assert (saving.UNCLOSED in caplog.text) == bool(old)


def test_a_reply_without_a_document():
    with pytest.raises(DesignError, match=r"no designs \(its JSON has a\)"):
        parse_reply('so: {"a": 1} {"b": 2}')
    for reply in ("", "I can't help with that.", "[1, 2]", "```json\n```"):
        with pytest.raises(DesignError, match="no JSON object"):
            parse_reply(reply)


def test_malformed_json_is_located_at_its_outermost_object():
    with pytest.raises(
        DesignError, match=r"malformed JSON at line 2, column 16: Expecting"
    ):
        parse_reply('{"strategies": [\n  {"length": 2 -1}\n  {"length": 2 -1}]}')
    cut = json.dumps({"strategies": [STRATEGY]}, indent=1)[:-30]
    with pytest.raises(DesignError, match=r"malformed JSON at line \d+, column \d+"):
        parse_reply(f"Here {{it}} is:\n{cut}")


def test_complete_strategies_of_a_reply_that_cut_by_off_are_kept():
    whole = json.dumps(
        {"scene_analysis": "x", "strategies": [STRATEGY, STRATEGY, STRATEGY]}, indent=1
    )
    candidates = read_designs(
        parse_reply(f"Here it is:\n```json\n{whole[: -len(whole) // 4]}"), Rod(), TASK
    )
    assert [c.problem is None for c in candidates] == [True] * 4 + [False]
    assert re.search(
        r"cut off or malformed \(it begins at line \d+ of the reply\)",
        candidates[-1].problem,
    )


def test_strategies_after_a_malformed_one_are_kept():
    first, *_ = whole = [
        json.dumps({**STRATEGY, "strategy_name": str(n)}) for n in range(4)
    ]
    broken = whole[1].replace("[[", "[[0.5 -0.1, ", 1)
    text = '{"strategies": [' + ",\n".join([first, broken, broken, whole[3]]) + "]}"
    candidates = read_designs(parse_reply(text), Rod(), TASK)
    # Fmt: skip.
    assert [(c.design, c.problem is None) for c in candidates] == [
        *([(0, True)] * 2),
        (1, False),
        (2, False),
        *([(3, True)] * 2),
    ]
    assert candidates[-1].design_name == "3"
    assert "line 2 " in candidates[2].problem
    assert "line 3 " in candidates[3].problem


@pytest.mark.parametrize(
    "loose",
    [
        replaced_all(TEXT, ("]", ", ]"), ("}, ]", ",\n}, ]")),
        TEXT.replace("]", '] // up ] "\n'),
        replaced(TEXT, ("[[0", "/* it's \" a\ncomment */ [[0")),
        'Say " and {' + TEXT.replace("]", ",]"),
    ],
)
def test_comments_and_extra_commas_are_ignored(loose):
    tricky = replaced_all(
        loose, ("'{a}'", "'{a},] /* // */'")
    )  # within a text they stay
    assert parse_reply(tricky)["strategies"] == [
        {
            **DOCUMENT["strategies"][0],
            "tool_urdf": replaced_all(
                DOCUMENT["strategies"][0]["tool_urdf"], ("{a}", "{a},] /* // */")
            ),
        }
    ]


def test_what_fails_is_charged_to_what_may_be_mended(monkeypatch):
    tried = []

    def mend(text):
        tried.append(len(text))
        raise DesignError("it can't be mended")

    monkeypatch.setattr(saving, "mend_json", mend)
    long = f'{{"strategy_name": "a", "tool_urdf": "{"x" * 20_000}" 1}}'
    sound = json.dumps({**STRATEGY, "strategy_name": "last"})
    text = f'{{"strategies": [{", ".join([long] * 30)}, {sound}]}}'
    found = parse_reply(text)["strategies"]
    assert len(found) == 31
    assert found[-1]["strategy_name"] == "last"
    assert 100_000 < sum(tried) <= saving.MAX_ALL_MENDED


@pytest.mark.thorough
def test_many_sound_objects_before_the_document_are_passed():
    text = '{"a": 1} ' * 500_000 + TEXT
    assert parse_reply(text) == DOCUMENT


HUGE = 20_000_000


@pytest.mark.parametrize(
    "endless",
    [
        *("x", "{", "[", '"', "9", "/*", ", ", '{"', '\\"', '{"a":'),
        *(
            '{"strategies": [',
            '{"strategies": [],',
            '{"strategies": [{"strategy_name": 1, ',
        ),
    ],
)
@pytest.mark.parametrize("before", ["", '{"strategies": ['])
def test_twenty_megabytes_of_anything_are_read_or_refused(before, endless):
    try:
        document = parse_reply(before + endless * (HUGE // len(endless)))
    except DesignError as error:
        document, reason = {}, str(error)
        assert len(reason) < 300
    assert len(document.get("strategies", ())) <= MAX_SAVED


@pytest.mark.parametrize(
    ("inside", "reason"),
    [
        ("9" * 5000, "too many digits"),
        ("[" * 100_000 + "]" * 100_000, "nested too deep"),
    ],
)
def test_json_that_breaks_parsers(inside, reason, tmp_path):
    text = f'{{"strategies": [{inside}]}}'
    with pytest.raises(DesignError, match=reason):
        parse_reply(text)
    (tmp_path / "designs.json").write_text(text)
    with pytest.raises(UserError, match=reason):
        load_designs(tmp_path / "designs.json")
