"""Near-duplicates: which candidates are, and what becomes of them in a search."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.design import Candidate, Component, Evaluation, Tool, ToolJoint
from core.geometry import Box, Cylinder, Pose
from core.interfaces import Tempo, Waypoints
from core.search.duplicates import NearDuplicates
from core.search.evolution import Trials
from plugins.actions.anchored import AnchoredActions
from tests.executors import Inline

PLAN = np.array([[0.5, 0.0, 0.4, 0.0, 0.0, 0.0], [0.6, 0.1, 0.4, 0.0, 0.0, 1.0]])


def rod(length=0.2, *, at=(0.0, 0.0, -0.1), yaw=0.0, shape=Box, joint=None, parent="tool_mount"):
    size = (0.02, 0.02, length)
    solid = shape(size) if shape is Box else shape(0.01, length)
    first = Component("base", "tool_mount", Pose(), Box((0.02, 0.02, 0.02)))
    own = Component("rod", parent, Pose.xyz_rpy(at, (0.0, 0.0, yaw)), solid, joint=joint)
    return Tool((first, own))


def candidate(tool=None, plan=PLAN, **more):
    return Candidate(tool or rod(), plan, **more)


def moved(index, column, by):
    plan = PLAN.copy()
    plan[index, column] += by
    return plan


A = candidate(action=0)
NEAR = {
    "the same": candidate(),
    "a size": candidate(rod(0.2015)),
    "a place": candidate(rod(at=(0.0009, 0.0, -0.1))),
    "a turn": candidate(rod(yaw=0.03)),
    "a position": candidate(plan=moved(1, 0, 0.009)),
    "an angle": candidate(plan=moved(1, 5, 0.04)),
    "a whole turn": candidate(plan=moved(1, 5, 2 * np.pi)),
}
OTHER = {
    "a size": candidate(rod(0.204)),
    "a place": candidate(rod(at=(0.0011, 0.0, -0.1))),
    "a turn": candidate(rod(yaw=0.1)),
    "a kind": candidate(rod(shape=Cylinder)),
    "a parent": candidate(rod(parent="base")),
    "a joint": candidate(rod(joint=ToolJoint("hinge", (0.0, 0.0, 1.0), -1.0, 1.0))),
    "a mass": candidate(Tool(tuple(replace(c, mass=2 * c.mass) for c in rod().components))),
    "friction": candidate(replace(rod(), friction=0.9)),
    "a position": candidate(plan=moved(1, 0, 0.011)),
    "an angle": candidate(plan=moved(1, 5, 0.06)),
    "a waypoint": candidate(plan=PLAN[:1]),
    "a grip": candidate(plan=np.column_stack([PLAN, [0.0, 1.0]])),
    "tempo": candidate(plan=Waypoints(PLAN, Tempo.usual(2))),
}


@pytest.mark.parametrize("what", NEAR)
def test_what_hardly_differs_is_a_near_duplicate(what):
    near = NearDuplicates()
    assert near.first(A) is None
    assert near.first(replace(NEAR[what], action=1)) is A


@pytest.mark.parametrize("what", OTHER)
def test_what_differs_is_none(what):
    near = NearDuplicates()
    near.first(A)
    assert near.first(replace(OTHER[what], action=1)) is None


def test_an_anchored_plan_is_compared_by_its_offsets():
    actions, near = AnchoredActions(), NearDuplicates()

    def step(offset, **more):
        plan = actions.parse([{"anchor": "cube", "toward": "goal", "offset": offset, **more}], gripper=False)
        return candidate(plan=plan)

    first = step([0.1, 0.0, 0.2])
    assert near.first(first) is None
    assert near.first(step([0.1, 0.009, 0.2])) is first
    assert near.first(step([0.1, 0.011, 0.2])) is None
    assert near.first(step([0.1, 0.0, 0.2], anchor="goal", toward="cube")) is None
    assert near.first(step([0.1, 0.0, 0.2], speed=0.1)) is None


def test_what_a_search_varied_and_what_breaks_a_rule_is_compared_with_nothing():
    near = NearDuplicates()
    near.first(A)
    assert near.first(replace(A, varied=True)) is None
    assert near.first(replace(A, tool=None, problem="no tool")) is None
    beside = NearDuplicates()
    beside.first(replace(A, varied=True))
    assert beside.first(A) is None


@settings(max_examples=30)
@given(order=st.permutations([0, 1, 2]), shifts=st.lists(st.sampled_from([0.0, 0.006, 0.012, 0.018]), min_size=9))
def test_the_order_of_replies_makes_no_difference(order, shifts):
    replies = [
        [candidate(plan=moved(1, 0, shifts[3 * agent + n]), agent=agent, action=n) for n in range(3)]
        for agent in range(3)
    ]

    def found(agents):
        near, firsts = NearDuplicates(), {}
        for generation in (0, 1):
            near.next_generation()
            for agent in agents:
                for c in replies[agent]:
                    own = replace(c, generation=generation)
                    first = near.first(own)
                    firsts[own.id] = first and first.id
        return firsts

    firsts = found(order)
    assert firsts == found([0, 1, 2])
    assert all(first is not None for key, first in firsts.items() if key.startswith("g1"))


def test_a_near_duplicate_gets_the_evaluation_of_the_first_and_says_so():
    tried = []

    def evaluate(candidates):
        tried.extend(c.id for c in candidates)
        return [Evaluation(c, "ok", 0.5 + c.action / 10) for c in candidates]

    same = replace(A, action=1)
    close = candidate(plan=moved(1, 0, 0.005), action=2)
    later = candidate(plan=moved(1, 0, 0.004), generation=1, agent=3, action=3)
    trials = Trials(evaluate, Inline(), near=NearDuplicates())
    first = {e.candidate.id: e for e in trials([A, same, close])}
    second = {e.candidate.id: e for e in trials([later])}
    assert tried == [A.id]
    assert first[same.id].same_as is None
    for evaluation in (first[close.id], second[later.id]):
        assert (evaluation.reward, evaluation.same_as) == (0.5, A.id)
        assert evaluation.warnings[-1] == f"not tried: it hardly differs from {A.id}, whose evaluation it gets"
    assert {e.candidate.id for e in Trials(evaluate, Inline())([A, close])} == {A.id, close.id}
    assert tried == [A.id, A.id, close.id]


def test_a_resumed_search_comes_to_the_same():
    close = candidate(plan=moved(1, 0, 0.005), action=1)
    closer = candidate(plan=moved(1, 0, 0.007), action=2)

    def evaluate(candidates):
        return [Evaluation(c, "ok", 0.1 * (1 + c.action)) for c in candidates]

    def rewards(known):
        trials = Trials(evaluate, Inline(), lambda c: known.get(c.id), NearDuplicates())
        return {e.candidate.id: e for e in trials([A, close, closer])}

    whole = rewards({})
    for stored in ([], [A.id], [A.id, close.id], [A.id, closer.id]):
        again = rewards({key: whole[key] for key in stored})
        assert {key: e.reward for key, e in again.items()} == {key: e.reward for key, e in whole.items()}
