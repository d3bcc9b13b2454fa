"""From requests to candidates: what agents are asked, and how their replies are read."""

import json
import threading

import numpy as np
import pytest

from core.config.schemas import PromptSettings
from core.design import Candidate
from core.errors import LimitReached
from core.hooks import hookimpl
from core.interfaces import Budget, Observation, Picture, Reply, Text
from core.plugins import event_hub
from core.search.assignment import Team
from plugins.conformance.evaluations import tried_once
from tests.support.designers import (
    PLAN,
    ROD,
    Canned,
    Listener,
    designer,
    document,
    good,
)

pytestmark = pytest.mark.slow


def test_a_team_has_its_own_elites_temperature_and_style_and_sees_nothing_of_others():
    tried = [
        tried_once(Candidate(ROD, np.array(PLAN), 0, agent), "ok", reward=0.5)
        for agent in range(3)
    ]
    vlm, plain = Canned(good), Canned(good)
    asking, alike = designer(vlm), designer(plain)
    for each in (asking, alike):
        each.tried = list(tried)
    list(
        asking.design_in(
            1, [Team([0, 2], tried[:1], -0.2, "Be brief."), Team([1], tried[1:2], 0.2)]
        )
    )
    list(alike.design(1, tried[:1]))
    requests, others = ({r.brief.agent: r for r in of.requests} for of in (vlm, plain))
    assert sorted(requests) == [0, 1, 2]
    for agent, ids in (
        (0, ["g0-a0-s0-p0", "g0-a2-s0-p0"]),
        (1, ["g0-a1-s0-p0"]),
        (2, ["g0-a0-s0-p0", "g0-a2-s0-p0"]),
    ):
        brief = requests[agent].brief
        assert [e.candidate.id for e in brief.tried] == ids
        assert brief.elites[0] is tried[agent % 2]
        texts = [
            part.text.strip()
            for part in requests[agent].messages[-1].parts
            if isinstance(part, Text)
        ]
        assert ("Be brief." in texts) == (agent != 1)
        warmer = requests[agent].temperature - others[agent].temperature
        assert warmer == pytest.approx(0.2 if agent == 1 else -0.2)
        assert len(others[agent].brief.tried) == 3


def test_one_candidate_per_agent_tool_and_plan_named_by_where_it_came_from():
    budget = Budget(2, 2, 3, 0, 5, 0.6)
    found = list(
        designer(Canned(lambda r: Reply(r.id, document(2, 3), "a can")), budget).design(
            4
        )
    )
    assert sorted(c.key for c in found) == [
        (4, a, s, p) for a in range(2) for s in range(2) for p in range(3)
    ]
    assert all(c.problem is None for c in found)


def test_agents_differ_and_follow_from_the_seed():
    def ask(seed):
        vlm = Canned(good)
        list(
            designer(
                vlm, Budget(20, 1, 1, 0, 5, 0.6), ("rigid", "gripper"), seed
            ).design(1)
        )
        return [
            (r.id, r.temperature, r.brief.seed, r.brief.gripper) for r in vlm.requests
        ]

    requests = ask(3)
    assert requests == ask(3) != ask(4)
    temperatures = [temperature for _, temperature, _, _ in requests]
    assert 0.5 <= min(temperatures) < 0.7 < 1.3 < max(temperatures) <= 1.5
    assert len({seed for _, _, seed, _ in requests}) == 20
    assert 2 < sum(gripper for _, _, _, gripper in requests) < 18


def test_temperatures_stay_in_the_providers_range():
    vlm = Canned(good)
    list(designer(vlm, Budget(20, 1, 1, 0, 5, 0.6), temperature=2.0).design(0))
    temperatures = [r.temperature for r in vlm.requests]
    assert max(temperatures) == 2.0
    assert min(temperatures) >= 1.5


@pytest.mark.parametrize(
    ("reply", "reason"),
    [
        (
            lambda r: Reply(r.id, "", "a can", error="quota exhausted"),
            "quota exhausted",
        ),
        (lambda r: Reply(r.id, "I would rather not.", "a can"), "can't be read"),
        (lambda r: Reply(r.id, '{"strategies": []}', "a can"), "is empty"),
        (lambda r: None, "no reply came"),
    ],
)
def test_an_agent_that_fails_costs_its_own_candidates_only(reply, reason):
    found = list(
        designer(Canned(lambda r: reply(r) if r.id == "g0-a1" else good(r))).design(0)
    )
    assert sorted(c.id for c in found) == ["g0-a0-s0-p0", "g0-a1-s0-p0", "g0-a2-s0-p0"]
    (lost,) = [c for c in found if c.problem is not None]
    assert lost.agent == 1
    assert reason in lost.problem


def test_elites_reach_the_brief_and_parents_come_back():
    elite = tried_once(
        Candidate(ROD, np.array(PLAN), design_name="poke"), "ok", reward=0.8
    )
    vlm = Canned(
        lambda r: Reply(r.id, document(parents=["g0-a0-s0-p0", "g7-a7-s7-p7"]), "a can")
    )
    found = list(designer(vlm).design(1, [elite]))
    assert all(c.parents == ("g0-a0-s0-p0",) for c in found)
    assert all(r.brief.elites == (elite,) for r in vlm.requests)


def test_listeners_receive_replies_before_they_are_read():
    """A reply that was paid for is kept although the candidates of the first one are still being tried."""
    replied = []
    all_replied = threading.Event()

    class Listener:
        @hookimpl
        def reply_received(self, request, reply):
            replied.append(reply.request_id)
            if len(replied) == 3:
                all_replied.set()

    events = event_hub()
    events.register(Listener())
    candidates = designer(Canned(good), events=events).design(0)
    next(candidates)
    assert all_replied.wait(10.0)
    assert sorted(replied) == ["g0-a0", "g0-a1", "g0-a2"]


# --- repairs ----------------------------------------------------------------------------------------------------


def chatting(request):
    """Agent 1 answers with chatter, the first time; agent 2 not at all."""
    if request.id == "g0-a2":
        return Reply(request.id, "", "a can", error="quota exhausted")
    return (
        Reply(request.id, "I think that", "a can")
        if request.id == "g0-a1"
        else good(request)
    )


def test_an_unreadable_reply_is_asked_for_once_more_if_wanted():
    listener, vlm = Listener(), Canned(chatting)
    found = list(
        designer(vlm, events=listener.hub, prompt=PromptSettings(repair=1)).design(0)
    )
    assert {c.agent: c.problem for c in found} == {
        0: None,
        1: None,
        2: "the model gave no answer: quota exhausted",
    }
    assert [what for what in listener.received if what[1].startswith("g0-a1")] == [
        ("asked", "g0-a1"),
        ("answered", "g0-a1"),
        ("asked", "g0-a1-repair"),
        ("answered", "g0-a1-repair"),
    ]
    assert [r.id for r in vlm.requests] == ["g0-a0", "g0-a1", "g0-a2", "g0-a1-repair"]
    first, again = vlm.requests[1], vlm.requests[3]
    assert again.messages[: len(first.messages)] == first.messages
    assert [m.role for m in again.messages[len(first.messages) :]] == [
        "assistant",
        "user",
    ]
    assert (again.schema, again.temperature, again.brief) == (
        first.schema,
        first.temperature,
        first.brief,
    )


def test_no_repair_unless_it_is_wanted_and_never_a_second_one():
    vlm = Canned(chatting)
    assert [c.problem is None for c in designer(vlm).design(0)].count(True) == 1
    assert len(vlm.requests) == 3
    stubborn = Canned(lambda r: Reply(r.id, "no", "a can"))
    found = list(designer(stubborn, prompt=PromptSettings(repair=1)).design(0))
    assert len(stubborn.requests) == 6
    assert [c.id for c in found] == ["g0-a2-s0-p0", "g0-a1-s0-p0", "g0-a0-s0-p0"][::-1]
    assert all("the reply can't be read" in c.problem for c in found)


# --- limits -----------------------------------------------------------------------------------------------------


def test_a_limit_is_passed_on_after_the_candidates_that_there_are():
    class Broke(Canned):
        def complete(self, requests):
            yield good(requests[0])
            raise LimitReached("all is spent")

    candidates = designer(Broke(good)).design(0)
    assert next(candidates).id == "g0-a0-s0-p0"
    with pytest.raises(LimitReached, match="all is spent"):
        next(candidates)


# --- film strips ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("feedback", ["paper", "numbers", "full"])
def test_the_best_elite_is_drawn_once_and_only_if_it_is_shown(feedback):
    drawn = []

    def show(evaluation):
        drawn.append(evaluation.candidate.id)
        return Picture(b"drawn", f"strip_{evaluation.candidate.id}")

    elites = [
        tried_once(Candidate(ROD, np.array(PLAN), design=n), "ok", reward=0.8)
        for n in range(2)
    ]
    vlm = Canned(good)
    list(
        designer(vlm, prompt=PromptSettings(feedback=feedback), show=show).design(
            1, elites
        )
    )
    names = ["g0-a0-s0-p0"] if feedback == "full" else []
    assert drawn == names
    for request in vlm.requests:
        pictures = [
            part.name
            for part in request.messages[-1].parts
            if isinstance(part, Picture)
        ]
        assert pictures == [f"strip_{name}" for name in names]


def test_a_failure_of_the_last_generation_is_drawn_too_with_elites_or_without():
    def show(evaluation):
        return Picture(b"drawn", f"strip_{evaluation.candidate.id}")

    def tried(generation, strategy, result, reward):
        candidate = Candidate(ROD, np.array(PLAN), generation, design=strategy)
        return tried_once(
            candidate, "ok", reward=reward, observation=Observation(result)
        )

    last = [
        tried(1, 0, "missed", 0.8),
        tried(1, 1, "tipped", 0.3),
        tried(1, 2, "solved", 1.0),
    ]
    for elites, names in (
        (last[:1], ["g1-a0-s0-p0", "g1-a0-s1-p0"]),
        ([], ["g1-a0-s0-p0"]),
    ):
        asking = designer(
            vlm := Canned(good), prompt=PromptSettings(feedback="full"), show=show
        )
        asking.tried += [tried(0, 0, "stuck", 0.9), *last]
        list(asking.design(2, elites))
        *_, message = vlm.requests[0].messages
        assert [part.name for part in message.parts if isinstance(part, Picture)] == [
            f"strip_{name}" for name in names
        ]
        labels = [
            part.text
            for part in message.parts
            if isinstance(part, Text) and "Film strip of" in part.text
        ]
        assert labels[-1].startswith(f"Film strip of a failure, {names[-1]}: ")


def test_a_sound_design_behind_broken_ones_is_taken(caplog):
    broken = {"strategy_name": "broken", "tool_urdf": "<link/>", "action_sets": [PLAN]}
    strategies = [broken, broken, *json.loads(document(2))["strategies"]]
    answer = json.dumps({"strategies": strategies})
    canned = Canned(lambda request: Reply(request.id, answer, "a can"))
    budget = Budget(1, 2, 1, 0, 5, 0.6)

    found = list(designer(canned, budget).design(0))

    assert [candidate.design_name for candidate in found] == ["", ""]
    assert [candidate.problem for candidate in found] == [None, None]
    assert "those that break a rule are left out first" in caplog.text


# --- curves -----------------------------------------------------------------------------------------------------

YAW = {"add_to": "yaw", "low": -0.2, "high": 0.2, "component": "", "waypoints": []}
WITH_CURVES = Budget(1, 1, 1, 0, 5, 0.6, curves=3)


def design_with(curve, budget=WITH_CURVES):
    vlm = Canned(lambda request: Reply(request.id, document(curve=curve), "a can"))
    return vlm, list(designer(vlm, budget).design(0))


def test_a_design_may_ask_for_a_curve_whose_designs_are_candidates_like_any_other():
    vlm, (base, *curve) = design_with([YAW])
    assert [candidate.id for candidate in curve] == [
        f"g0-a0-s{number}-p0" for number in (1, 2, 3)
    ]
    assert [c.plan.poses[0, 5] for c in curve] == pytest.approx([-0.2, 0.0, 0.2])
    assert [c.problem for c in (base, *curve)] == [None] * 4
    assert {c.varied.base for c in curve} == {base.id}
    assert {c.idea for c in (base, *curve)} == {"g0-a0-s0"}
    (request,) = vlm.requests
    design = request.schema["properties"]["strategies"]["items"]
    assert "curve" in design["required"]
    assert any("`curve`" in part.text for part in request.messages[-1].parts)


def test_what_breaks_a_rule_in_a_curve_loses_its_own_place_alone():
    longer = {**YAW, "component": "rod", "add_to": "size_z", "low": 0.0, "high": 3.0}
    _, (base, first, *rest) = design_with([longer])
    assert base.problem is None
    assert first.problem is None
    assert all(candidate.problem for candidate in rest)
    _, (base, refused) = design_with([{**YAW, "waypoints": [9]}])
    assert base.problem is None
    assert "the plan has waypoints 1 to 1" in refused.problem


def test_without_the_setting_nothing_is_said_of_curves_and_none_is_tried():
    vlm, (base,) = design_with([YAW], Budget(1, 1, 1, 0, 5, 0.6))
    assert base.problem is None
    (request,) = vlm.requests
    assert "curve" not in str(request.schema)
    assert not any("`curve`" in part.text for part in request.messages[-1].parts)
