import json
import math

import numpy as np
import pytest
from hypothesis import strategies as st

from core.design import Candidate, DesignError
from core.designs.reading import (
    dump_design,
    load_designs,
    load_tool,
    read_designs,
)
from core.errors import UserError
from core.simulation.play import play
from core.support.text import clean
from core.values.plans import NO_PLAN
from tests.support.faults import Faulty
from tests.support.panda import on_panda
from tests.support.playing import condition
from tests.support.rods import PLAN, STRATEGY, TASK, Rod
from tests.support.scenes import CubeOnTable

pytestmark = pytest.mark.slow


OPEN = [[*waypoint, 0.0] for waypoint in PLAN]


def read(*strategies, **how):
    return read_designs({"strategies": list(strategies)}, Rod(), TASK, **how)


def without(field):
    return {name: value for name, value in STRATEGY.items() if name != field}


def test_parents_are_kept_if_they_are_elites():
    named = ["g0-a0-s0-p1", "g9-a9-s9-p9", 7, {"id": "g0-a1-s0-p0"}]
    first, second = read(
        {**STRATEGY, "parents": named},
        {**STRATEGY, "parents": "g0-a0-s0-p1"},
        elites=("g0-a1-s0-p0", "g0-a0-s0-p1"),
    )[::2]
    assert first.parents == ("g0-a0-s0-p1",)
    assert second.parents == ()


def test_one_candidate_per_action_plan():
    rods = Rod()
    document = {
        "scene_analysis": "ignored",
        "strategies": [STRATEGY, {**STRATEGY, "extra": 1}],
    }
    base = Candidate(None, NO_PLAN, generation=2, agent=3)
    candidates = read_designs(document, rods, TASK, base=base)
    assert [c.id for c in candidates] == [
        "g2-a3-s0-p0",
        "g2-a3-s0-p1",
        "g2-a3-s1-p0",
        "g2-a3-s1-p1",
    ]
    assert all(c.problem is None and c.parents == () for c in candidates)
    assert rods.parsed == 2
    first, second, third, _ = candidates
    assert first.tool is second.tool is not third.tool
    assert (first.tool.name, first.tool.description) == ("rod", "A rod.")
    described = (
        first.design_name,
        first.design_description,
        first.action_description,
    )
    assert described == ("poke", "Poke it.", "Forward.")
    np.testing.assert_array_equal(first.plan.poses, PLAN)
    assert second.plan.poses.shape == (1, 6)


def test_only_the_tool_and_the_plans_are_required():
    (candidate,) = read({"length": 0.2, "action_sets": [PLAN], "strategy_name": None})
    assert candidate.problem is None
    assert candidate.design_name == candidate.tool.name == ""


def test_gripper_designs():
    (candidate,) = read(
        {**STRATEGY, "gripper": True, "length": 0.05, "action_sets": [OPEN]}
    )
    assert candidate.problem is None
    assert candidate.tool.gripper
    assert candidate.plan.poses.shape == (2, 7)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"length": "long"}, "length must be a number"),
        ({"length": 5}, "5 m long in z"),
        ({"gripper": "a"}, "'gripper' is the text 'a'; it must be true or false"),
        ({"gripper": 0.5}, "'gripper' is a number"),
    ],
)
def test_a_fault_of_a_strategy_is_a_problem_of_all_its_plans(change, reason):
    good, *bad = read({**STRATEGY, "action_sets": [PLAN]}, {**STRATEGY, **change})
    assert good.problem is None
    assert [c.action for c in bad] == [0, 1]
    assert all(reason in c.problem and c.design == 1 for c in bad)


def test_whether_a_tool_starts_clear_is_asked_where_it_is_tried():
    (candidate,) = read({**STRATEGY, "length": 0.6, "action_sets": [PLAN]})
    assert candidate.problem is None
    (trial,) = play(condition(TASK, Faulty()), [candidate])
    assert trial.status == "rejected"
    assert "inside 'table' of the scene" in trial.reason


def test_a_fault_of_a_plan_is_its_own():
    good, bad, other = read(
        {**STRATEGY, "action_sets": [PLAN, [PLAN[0], OPEN[0]], PLAN]}
    )
    assert good.problem is other.problem is None
    assert (
        bad.problem
        == "action plan 2: waypoint 2 has 7 numbers, 6 are needed: x, y, z, roll, pitch, yaw"
    )
    assert bad.plan.poses.shape == (0, 6)
    assert bad.tool is good.tool


@pytest.mark.parametrize(
    ("plans", "reason"),
    [
        *((nothing, "is missing or empty") for nothing in (None, {}, [])),
        ({"a": 1}, "is an object"),
        ("none", "is the text 'none'"),
        (7, "is a number"),
    ],
)
def test_unusable_action_sets_give_one_candidate(plans, reason):
    (candidate,) = read({**STRATEGY, "action_sets": plans})
    assert candidate.problem == f"'action_sets' {reason}; give a list of action plans"
    (candidate,) = read({**STRATEGY, "action_sets": plans, "gripper": 0.5})
    assert "'gripper'" in candidate.problem


def test_missing_fields():
    (candidate,) = read(without("action_sets"))
    assert "'action_sets' is missing" in candidate.problem
    assert all("length" in c.problem for c in read(without("length")))


def test_a_strategy_that_is_not_an_object():
    bad, good = read([], {**STRATEGY, "action_sets": [PLAN]})
    assert "the design is a list" in bad.problem
    assert (good.problem, good.design) == (None, 1)


@pytest.mark.parametrize(
    "document",
    [
        *(None, "x", {}, [STRATEGY["action_sets"]]),
        *({"strategies": {}}, {"strategies": []}),
    ],
)
def test_a_document_without_strategies(document):
    with pytest.raises(DesignError, match=r"has no designs; expected an object"):
        read_designs(document, Rod(), TASK)


def test_no_design_is_lost_by_a_description():
    texts = {"tool_name": 3, "strategy_description": ["a", "b"], "tool_description": {}}
    (candidate,) = read({**STRATEGY, **texts, "action_sets": [PLAN]})
    assert candidate.problem is None
    assert candidate.tool.name == "3"
    assert candidate.design_description == '["a", "b"]'


def test_texts_are_cleaned():
    (candidate,) = read(
        {**STRATEGY, "tool_name": "a\x1b[31m\nb\u202e\ud800", "action_sets": [PLAN]}
    )
    assert candidate.tool.name == "a[31m b"
    assert clean("x" * 300, 200) == "x" * 197 + "..."
    (candidate,) = read(
        {**STRATEGY, "strategy_description": "y" * 10_000, "action_sets": [PLAN]}
    )
    assert len(candidate.design_description) == 5000


json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=10)
    | st.just(PLAN[0])
    | st.just(10**400),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from([*STRATEGY, "gripper"]), inner, max_size=5)
    ),
    max_leaves=20,
)
strategies = st.fixed_dictionaries(
    {}, optional={name: json_values | st.just(v) for name, v in STRATEGY.items()}
)


def test_numbers_may_be_strings():
    plans = [
        [[" 0.5", "0", "4e-1", "-0.10", ".5", "+1."]],
        [["0.5", "0", "0.4", "a/2", "0", "0"]],
        [["1e999", *"00000"]],
    ]
    good, bad, far = read({**STRATEGY, "action_sets": plans})
    np.testing.assert_array_equal(good.plan.poses, [[0.5, 0, 0.4, -0.1, 0.5, 1.0]])
    assert (
        bad.problem
        == "action plan 2: waypoint 1: roll must be a number, not the text 'a/2'"
    )
    assert "x is inf; it must be between -3 and 3 metres" in far.problem


def test_no_more_designs_are_read_than_requested():
    rods = Rod()
    document = {
        "strategies": [
            {**STRATEGY, "action_sets": [PLAN] * 5},
            {**STRATEGY, "gripper": 0.5, "action_sets": [1] * 5},
        ]
        * 3
    }
    candidates = read_designs(document, rods, TASK, most=(2, 3))
    assert [c.key[2:] for c in candidates] == [
        (s, p) for s in range(2) for p in range(3)
    ]
    assert rods.parsed == 1


# --- files ------------------------------------------------------------------------------------------------------


DOCUMENT = {
    "strategies": [
        {"tool_urdf": "<link name='{a}'>\n```json {\"</link>", "action_sets": [PLAN]}
    ]
}
TEXT = json.dumps(DOCUMENT)


def test_designs_files_are_read(tmp_path):
    path = tmp_path / "designs.json"
    path.write_bytes(b"\xef\xbb\xbf" + TEXT.encode())
    assert load_designs(path) == DOCUMENT


def test_a_tool_is_read_alone_whatever_rules_it_breaks(tmp_path):
    path = tmp_path / "designs.json"
    path.write_text(
        json.dumps({"strategies": [{"length": 9.0}, {"length": 99.0}, "none"]})
    )
    task = on_panda(CubeOnTable())
    assert load_tool(path, 0, Rod(), task).components[0].shape.size[2] == 9.0
    for number, reason in (
        (1, "the tool of design 1 can't be read: length must be"),
        (
            2,
            "the tool of design 2 can't be read: the design is the text 'none', not an object",
        ),
        (3, "has 3 designs; there is no strategy=3"),
        (-1, "has 3 designs; there is no strategy=-1"),
    ):
        with pytest.raises(UserError, match=f"designs.json.*{reason}"):
            load_tool(path, number, Rod(), task)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"\xff\xfe{}", "is not UTF-8 text"),
        (b'{"strategies": [\n1,]}', "malformed JSON at line 2, column"),
        (b"", "has no JSON object"),
        (b"[]", "has no JSON object"),
        (b'{"strategies": "x"}', "is empty, or no list of objects"),
    ],
)
def test_files_that_hold_no_designs(tmp_path, content, reason):
    path = tmp_path / "designs.json"
    path.write_bytes(content)
    with pytest.raises(UserError, match=reason) as caught:
        load_designs(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_are_not_there(tmp_path):
    with pytest.raises(
        UserError, match=r"designs file .*missing.json: there is no such file"
    ):
        load_designs(tmp_path / "missing.json")
    with pytest.raises(UserError, match="can't be read: Is a directory"):
        load_designs(tmp_path)


@pytest.mark.parametrize(
    "strategy",
    [STRATEGY, {**STRATEGY, "gripper": True, "length": 0.05, "action_sets": [OPEN]}],
)
def test_a_design_is_written_as_it_is_read(strategy):
    candidate = read(strategy)[0]
    written = json.loads(json.dumps(dump_design(candidate, Rod())))
    (again,) = read(written)
    assert again.problem is None
    assert again.tool == candidate.tool
    np.testing.assert_array_equal(again.plan.poses, candidate.plan.poses)
    assert written == {
        "gripper": False,
        **strategy,
        "action_sets": [strategy["action_sets"][0]],
    }


def test_a_design_without_a_tool_is_not_written():
    candidate = read({**STRATEGY, "length": math.inf})[0]
    with pytest.raises(ValueError, match="g0-a0-s0-p0 has no tool to write: length"):
        dump_design(candidate, Rod())
