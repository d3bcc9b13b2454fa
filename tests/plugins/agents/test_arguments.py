"""What an agent may give a tool, and what it is told of anything else."""

import random

import pytest

from plugins.agents.arguments import KINDS, Look, read_arguments, read_text
from plugins.agents.bench import Refused


@pytest.mark.parametrize(
    ("name", "given", "reason"),
    [
        ("try", {}, "no tool 'try'; there are: describe_task, look"),
        ("try_design", {}, "try_design: designs: is missing"),
        ("try_design", {"designs": 3}, "try_design: designs"),
        ("try_design", {"designs": {}, "run": "x"}, "run: no key 'run'"),
        ("look", {"position": [1, 2]}, "look: position"),
        ("look", {"position": [1, 2, float("nan")]}, "look: position.2"),
        ("look", {"position": [1, 2, 1e9]}, "look: position.2"),
        ("look", {"fov_deg": 500}, "look: fov_deg"),
        ("watch", {"candidate": "g" * 1000}, "watch: candidate"),
        ("best_designs", {"count": 10**9}, "best_designs: count"),
        ("finish", {"now": True}, "finish: now: no key 'now'"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(name, given, reason):
    with pytest.raises(Refused, match=reason.replace("(", r"\(")) as refused:
        read_arguments(name, given)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 400


def test_what_is_right_is_read():
    asked = read_arguments("look", {"position": [1, 0, 0.5], "fov_deg": 30})
    assert asked == Look(position=[1.0, 0.0, 0.5], fov_deg=30.0)


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
    assert refused > 700


def test_a_document_is_an_object_or_its_text():
    assert read_text({"strategies": []}) == '{"strategies": []}'
    assert read_text('{"strategies": []}') == '{"strategies": []}'
    with pytest.raises(Refused, match="not JSON compliant"):
        read_text({"strategies": [float("inf")]})
    with pytest.raises(Refused, match="at most 2000000 are read"):
        read_text("x" * 3_000_000)
