"""What an agent may give a tool, and what it is told of anything else."""

import random

import pytest

from plugins.agents.arguments import KINDS, Look, read_arguments, read_text
from plugins.agents.bench import Refused


@pytest.mark.parametrize(
    ("name", "given", "reason"),
    [
        ("try", {}, "no tool 'try'; there are: describe_task, look"),
        ("watch", {}, "watch: candidate: is missing"),
        ("try_design", {"designs": 3}, "try_design: designs"),
        ("watch", {"candidate": "a", "layot": 1}, "did you mean 'layout'"),
        ("look", {"position": [1, 2]}, "look: position"),
        ("look", {"position": [1, 2, float("nan")]}, "look: position.2"),
        ("look", {"position": [1, 2, 1e9]}, "look: position.2"),
        ("look", {"fov_deg": 500}, "look: fov_deg"),
        ("watch", {"candidate": "g" * 1000}, "watch: candidate"),
        ("best_designs", {"count": 10**9}, "best_designs: count"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(name, given, reason):
    with pytest.raises(Refused, match=reason.replace("(", r"\(")) as refused:
        read_arguments(name, given)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 400


def test_what_is_right_is_read():
    asked, assumed = read_arguments("look", {"position": [1, 0, 0.5], "fov_deg": 30})
    assert asked == Look(position=[1.0, 0.0, 0.5], fov_deg=30.0)
    assert assumed == []


@pytest.mark.parametrize(
    ("name", "given", "expected"),
    [
        ("look", {"position": "[1, 0, 0.5]", "fov_deg": "30"}, {"fov_deg": 30.0}),
        ("look", {"view": "Scene view"}, {"view": "scene"}),
        ("describe_task", {"kind": "Rigid"}, {"kind": "rigid"}),
        ("watch", {"candidate": "s0-p0", "layout": "2"}, {"layout": 2}),
        ("check_design", {"designs": [{"a": 1}]}, {"designs": [{"a": 1}]}),
    ],
)
def test_what_has_one_meaning_is_read(name, given, expected):
    asked, assumed = read_arguments(name, given)
    assert asked.model_dump(include=expected.keys()) == expected
    assert assumed == []


def test_what_was_assumed_is_said():
    asked, assumed = read_arguments("try_design", {"strategies": [], "reason": "x"})
    assert asked.designs == {"strategies": [], "reason": "x"}
    assert "beside the arguments" in assumed[0]

    asked, assumed = read_arguments("finish", {"now": True})
    assert assumed == ["'now' is no argument of finish, and was left out"]


def test_nonsense_is_refused_and_never_raises_anything_else():
    rng = random.Random(0)
    values = [None, True, -1, 1e308, "", "x" * 5000, [], [[[]]], {}, {"a": {"b": []}}]
    keys = ["designs", "position", "view", "candidate", "count", "layout", "kind", "\0"]
    refused = 0
    for _ in range(1000):
        name = rng.choice([*KINDS, "", "exec", "\ud800"])
        given = {rng.choice(keys): rng.choice(values) for _ in range(rng.randrange(4))}
        try:
            read_arguments(name, given)
        except Refused:
            refused += 1
    assert refused > 400


def test_a_document_is_an_object_or_its_text():
    assert read_text({"strategies": []}) == '{"strategies": []}'
    assert read_text('{"strategies": []}') == '{"strategies": []}'
    with pytest.raises(Refused, match="not JSON compliant"):
        read_text({"strategies": [float("inf")]})
    with pytest.raises(Refused, match="at most 2000000 are read"):
        read_text("x" * 3_000_000)
