"""Designs that break a rule go back with all their faults, and only they; the answer takes their places."""

import json
import re
from dataclasses import replace

import pytest

from core.config.schemas import PromptSettings
from core.errors import LimitReached
from core.geometry import Box, Pose
from core.interfaces import Budget, Reply, Text
from tests.support.designers import PLAN, ROD, URDF, Canned, designer
from tests.support.text import replaced_all

pytestmark = pytest.mark.slow

FAR = [[9.0, 0.0, 0.4, 0.0, 0.0, 0.0]]
SOUND = {**URDF.dump(ROD), "action_sets": [PLAN, PLAN]}
APART = {
    **SOUND,
    "tool_urdf": replaced_all(SOUND["tool_urdf"], ('xyz="0 0 -0.1"', 'xyz="0 0 -0.2"')),
}
ONE_PLAN = {**SOUND, "action_sets": [PLAN, FAR]}
BUDGET = Budget(1, 3, 2, 0, 5, 0.6)


def text_of(*strategies):
    return json.dumps({"strategies": strategies})


def answering(*texts):
    """A model that answers with the texts in turn."""
    turn = iter(texts)
    return Canned(lambda request: Reply(request.id, next(turn), "a can"))


def ask(vlm, repair=1):
    return list(designer(vlm, BUDGET, prompt=PromptSettings(repair=repair)).design(0))


def last_words(request):
    return "".join(p.text for p in request.messages[-1].parts if isinstance(p, Text))


def test_only_faulty_designs_go_back_and_the_answer_takes_their_names():
    vlm = answering(text_of(SOUND, APART, ONE_PLAN), text_of(SOUND, SOUND))
    found = ask(vlm)
    assert [c.id for c in found] == [
        f"g0-a0-s{strategy}-p{plan}" for strategy in range(3) for plan in range(2)
    ]
    assert all(candidate.problem is None for candidate in found)

    _, again = vlm.requests
    assert again.id == "g0-a0-repair"
    assert (again.brief.n_tool, again.brief.n_action) == (2, 2)
    assert [m.role for m in again.messages[-2:]] == ["assistant", "user"]
    words = last_words(again)
    assert "design 2: component 'rod' is 95.0 mm away from its mount" in words
    assert "design 3: action plan 2: waypoint 1: x is 9" in words
    assert "design 1" not in words
    assert "only these 2 designs, in this order" in words


@pytest.mark.parametrize(("cut_by", "asked"), [("", 2), ("a limit of 300", 1)])
def test_a_reply_that_was_cut_off_is_not_paid_for_twice(cut_by, asked):
    whole = text_of(SOUND, APART)
    vlm = Canned(lambda request: Reply(request.id, whole, "a can", cut_by=cut_by))
    found = ask(vlm)
    assert len(vlm.requests) == asked
    assert [candidate.problem is None for candidate in found[:2]] == [True, True]


def test_a_reply_of_which_nothing_can_be_read_names_the_limit_that_cut_it_off():
    cut = Canned(lambda r: Reply(r.id, '{"strat', "a can", cut_by="a limit of 300"))
    assert "a limit of 300" in ask(cut)[0].problem


def test_a_sound_tool_stays_and_so_do_its_sound_plans():
    longer = {**SOUND, "tool_urdf": replaced_all(SOUND["tool_urdf"], ("0.2", "0.18"))}
    moved = [[0.45, 0.0, 0.4, 0.0, 0.0, 0.0]]
    vlm = answering(text_of(ONE_PLAN), text_of({**longer, "action_sets": [moved]}))
    first, second = ask(vlm)
    assert first.plan.poses.tolist() == PLAN
    assert second.plan.poses.tolist() == moved
    assert second.tool is first.tool


def test_designs_beyond_those_asked_for_do_not_move_the_others():
    more = {**APART, "tool_name": "not asked for"}
    mended = {**SOUND, "tool_name": "mended"}
    vlm = answering(
        text_of(SOUND, SOUND, APART, more, more), text_of(SOUND, SOUND, mended)
    )
    found = ask(vlm)
    assert [c.tool.name for c in found if c.design == 2] == ["mended", "mended"]


def test_a_sound_tool_keeps_its_gripper():
    answer = {**SOUND, "gripper": True, "action_sets": [PLAN]}
    vlm = answering(text_of(ONE_PLAN), text_of(answer))
    first, second = ask(vlm)
    assert (first.problem, second.problem) == (None, None)
    assert second.tool is first.tool


def test_what_an_answer_leaves_out_stays():
    vlm = answering(text_of(ONE_PLAN), text_of({"action_sets": [PLAN, PLAN]}))
    assert [c.problem for c in ask(vlm)] == [None, None]


@pytest.mark.parametrize("answer", ["I can't", text_of(APART), text_of()])
def test_what_the_second_look_does_not_mend_is_rejected_with_its_reason(answer):
    vlm = answering(text_of(SOUND, APART), answer)
    found = ask(vlm)
    assert [c.problem is None for c in found] == [True, True, False, False]
    assert all("95.0 mm away" in c.problem for c in found[2:])
    assert len(vlm.requests) == 2


def test_it_goes_back_as_often_as_is_asked_for():
    vlm = answering(text_of(APART), text_of(APART), text_of(SOUND))
    assert all(c.problem is None for c in ask(vlm, repair=2))
    assert [r.id for r in vlm.requests][1:] == ["g0-a0-repair", "g0-a0-repair-repair"]

    vlm = answering(text_of(APART))
    assert all(c.problem for c in ask(vlm, repair=0))
    assert len(vlm.requests) == 1


def test_a_tool_that_does_not_start_clear_goes_back_too():
    pose = Pose.xyz_rpy((0.0, 0.0, -0.3))
    rod = replace(ROD.components[0], pose=pose, shape=Box((0.02, 0.02, 0.6)))
    long = {**SOUND, **URDF.dump(replace(ROD, components=(rod,)))}
    vlm = answering(text_of(long), text_of(SOUND))
    found = ask(vlm)
    assert "of the scene" in last_words(vlm.requests[1])
    assert all(candidate.problem is None for candidate in found)


def test_faults_of_tool_start_and_plan_go_back_together():
    pose = Pose.xyz_rpy((0.0, 0.0, -0.3))
    rod = replace(ROD.components[0], pose=pose, shape=Box((0.02, 0.02, 0.6)))
    long = {**ONE_PLAN, **URDF.dump(replace(ROD, components=(rod,)))}
    vlm = answering(text_of(long), text_of(SOUND))
    assert all(candidate.problem is None for candidate in ask(vlm))
    words = last_words(vlm.requests[1])
    assert re.search(
        r"mm inside '\w+' of the scene; move it by \(0, 0, 0.\d+\) m", words
    )
    assert "turn the tool; action plan 2: waypoint 1: x is 9" in words


def test_a_limit_in_the_second_round_loses_no_design():
    class Broke(Canned):
        def complete(self, requests):
            if self.requests:
                raise LimitReached("all is spent")
            yield from super().complete(requests)

    vlm = Broke(lambda r: Reply(r.id, text_of(SOUND, APART), "a can"))
    asking = designer(vlm, BUDGET, prompt=PromptSettings(repair=1)).design(0)
    found = []
    with pytest.raises(LimitReached, match="all is spent"):
        found.extend(asking)
    assert [c.problem is None for c in found] == [True, True, False, False]
